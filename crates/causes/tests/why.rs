//! What decided a run, where that is known: planted coins, messages, ways and crashes.

#![expect(clippy::print_stdout, reason = "a test prints what it measures")]
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot set up its subject fails"
)]

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use causes::{WhyAnswer, WhyOptions, why};
use config::Source;
use lab::LabError;
use lab::folder::recorded_epoch;
use lab::run::{RobotMaker, execute_with};
use protocol::RobotName;
use protocol::random::unit;
use record::{EpochFiles, RunFolder};
use recording::RunDecisions;
use robot::{Action, BadParameters, Cars, Robot};
use scenario::Scenario;
use timeline::ForkOutcomes;

/// Ticks at which the coins are thrown.
const FLIPS: [u64; 3] = [30, 60, 90];
/// The tick in which the command that matters is sent, and in which the way that matters is gone.
const DECISIVE: u64 = 47;

/// Throws three coins, and publishes how many showed heads.
#[derive(Clone, Default)]
struct Thrower {
    heads: u32,
}

impl Robot for Thrower {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if FLIPS.contains(&cars.tick()) {
            self.heads += u32::from(unit(cars.random()) < 0.5);
        }
        Action::stay(cars).variable("heads", f64::from(self.heads))
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

/// The same, of a robot that cannot be copied.
struct Uncopied(Thrower);

impl Robot for Uncopied {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.0.init(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.0.tick(cars)
    }
}

/// Adds a small random number in each tick: no tick decides where the sum ends.
#[derive(Clone, Default)]
struct Drifter {
    sum: f64,
}

impl Robot for Drifter {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.sum += unit(cars.random()) - 0.5;
        Action::stay(cars).variable("sum", self.sum)
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

/// Sends a command in every fifth tick, and the one that matters once.
#[derive(Clone, Default)]
struct Messenger;

impl Robot for Messenger {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if cars.tick() == DECISIVE {
            cars.broadcast("key", None);
        } else if cars.tick().is_multiple_of(5) {
            cars.broadcast("news", None);
        }
        Action::stay(cars)
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

/// Publishes whether the command that matters has arrived.
#[derive(Clone, Default)]
struct Listener {
    has_key: bool,
}

impl Robot for Listener {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.has_key |= cars.commands().iter().any(|command| command.text == "key");
        Action::stay(cars).variable("key", f64::from(u8::from(self.has_key)))
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

/// Takes one step, and publishes whether its way was free.
#[derive(Clone, Default)]
struct Walker {
    was_blocked: bool,
}

impl Robot for Walker {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let mut action = Action::stay(cars);
        if cars.tick() == DECISIVE {
            action.proposal.x += 0.6;
        }
        if cars.tick() == DECISIVE + 1 {
            self.was_blocked = cars.was_blocked();
        }
        action.variable("blocked", f64::from(u8::from(self.was_blocked)))
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

fn robots() -> RobotMaker {
    Arc::new(|_: &RobotName, class: &str| -> Option<Box<dyn Robot>> {
        Some(match class {
            "Thrower" => Box::<Thrower>::default(),
            "Drifter" => Box::<Drifter>::default(),
            "Messenger" => Box::<Messenger>::default(),
            "Listener" => Box::<Listener>::default(),
            "Walker" => Box::<Walker>::default(),
            _ => return None,
        })
    })
}

const HEAD: &str = "tick = \"0.5 s\"\nduration = \"60 s\"\n[field]\nsize = [\"12 m\", \"12 m\"]\nbody = \"0.6 m\"\n";

fn robot(name: &str, class: &str, x_m: f64) -> String {
    format!("[[robot]]\nname = \"{name}\"\nclass = \"{class}\"\nat = [\"{x_m} m\", \"6 m\"]\n")
}

/// A recorded run.
struct Recorded {
    _out: tempfile::TempDir,
    folder: RunFolder,
}

fn record(text: &str, seed: u64) -> Recorded {
    let out = tempfile::tempdir().unwrap();
    let source = Source {
        name: "test".to_owned(),
        text: format!("seed = {seed}\n{text}"),
    };
    let scenario = Scenario::parse(&source, Path::new(".")).unwrap();
    let folder = RunFolder::at(out.path().join("run"));
    let lock = folder.create(&scenario).unwrap();
    let make = robots();
    execute_with(
        scenario,
        &"run".parse().unwrap(),
        &folder,
        None,
        &*make,
        || Ok(()),
    )
    .unwrap();
    drop(lock);
    Recorded { _out: out, folder }
}

fn options<'a>(what: &str, stop: &'a AtomicBool, jobs: usize) -> WhyOptions<'a> {
    WhyOptions {
        what: Some(what.to_owned()),
        budget: None,
        jobs,
        make: robots(),
        stop,
    }
}

fn ask(recorded: &Recorded, what: &str) -> WhyAnswer {
    let stop = AtomicBool::new(false);
    let files = recorded_epoch(&recorded.folder, None).unwrap();
    let options = options(what, &stop, 2);
    let run = "run".parse().unwrap();
    let (answer, _) = why(&recorded.folder, &run, &files, &options, &mut |_| {}).unwrap();
    println!("{}", answer.sentence);

    // The console, reports and diagrams read the file as another type.
    let found = RunDecisions::read(recorded.folder.path());
    assert!(found.notes.is_empty(), "{:?}", found.notes);
    let [shown] = &found.all[..] else {
        panic!("{} answers", found.all.len());
    };
    assert_eq!(shown.question.name, answer.question.words());
    assert_eq!(shown.curve, answer.curve);
    assert!(
        shown
            .jumps
            .iter()
            .eq(answer.jumps.iter().map(|jump| &jump.shown))
    );
    answer
}

/// A number that a robot published last.
fn last(recorded: &Recorded, robot: &str, variable: &str) -> f64 {
    let summary = lab::folder::read_summary(&recorded.folder)
        .unwrap()
        .unwrap();
    let variables = &summary.robots[robot].state_variables;
    variables
        .get(variable)
        .and_then(robot::Variable::as_f64)
        .unwrap()
}

/// The first of these runs in which a robot ends with a number that is wanted. Names and seeds differ, so that chance does.
fn first(
    text: impl Fn(&str) -> String,
    (stem, number): (&str, usize),
    variable: &str,
    is_wanted: impl Fn(f64) -> bool,
) -> (Recorded, String) {
    let name = format!("{stem}{number}");
    for seed in seeds(number) {
        let recorded = record(&text(&name), seed);
        if is_wanted(last(&recorded, &name, variable)) {
            return (recorded, name);
        }
    }
    panic!("no run of {name} has the outcome");
}

/// The seeds of the runs of a number.
fn seeds(number: usize) -> Range<u64> {
    let first = 1000 * number as u64;
    first..first + 1000
}

/// How many intervals of 95 % miss what is true, of how many.
#[derive(Debug, Clone, Copy, Default)]
struct Misses {
    missed: u32,
    all: u32,
}

impl Misses {
    fn note(&mut self, outcome: &ForkOutcomes, truth: f64) {
        if let (Some(low), Some(high)) = (outcome.low, outcome.high) {
            self.missed += u32::from(!(low..=high).contains(&truth));
            self.all += 1;
        }
    }

    fn add(&mut self, more: Self) {
        self.missed += more.missed;
        self.all += more.all;
    }
}

/// The misses of a run with three heads: of the points of its curve, which share forks' seeds, and of the outcomes before its jumps, which
/// are of fresh forks. The jumps must be where the coins are thrown.
fn misses(number: usize) -> (Misses, Misses) {
    let text = |name: &str| format!("{HEAD}{}", robot(name, "Thrower", 6.0));
    let (recorded, name) = first(text, ("Coin", number), "heads", |heads| heads == 3.0);
    let what = format!("{{ robot = \"{name}\", variable = \"heads\", above = 2.5 }}");
    let answer = ask(&recorded, &what);

    let ticks: Vec<u64> = answer.jumps.iter().map(|jump| jump.shown.tick).collect();
    // The first jump is the least that counts, and so is not always named.
    assert!(ticks == FLIPS || ticks == FLIPS[1..], "{ticks:?}");
    let truth = |tick| match tick {
        0..30 => 0.125,
        30..60 => 0.25,
        60..90 => 0.5,
        _ => 1.0,
    };
    let (mut points, mut jumps) = (Misses::default(), Misses::default());
    for point in &answer.curve {
        points.note(&point.outcome, truth(point.tick));
    }
    for jump in &answer.jumps {
        jumps.note(&jump.shown.before, truth(jump.shown.tick - 1));
        let cause = jump
            .shown
            .cause
            .as_ref()
            .expect("the robot's chance is the cause");
        assert_eq!(cause.what, format!("chance of robot.{name}"));
    }
    (points, jumps)
}

/// 95 % intervals miss in 5 % of the cases; points of a run share their forks' seeds, so more than that is no wonder.
fn assert_level(points: Misses) {
    let Misses { missed, all } = points;
    assert!(
        f64::from(missed) <= 0.1 * f64::from(all),
        "{missed} of {all}"
    );
}

#[test]
fn coins_decide_where_they_are_thrown() {
    let (points, _) = misses(0);
    assert_level(points);
}

/// How many runs of each kind the thorough tests ask about: a part of the 200 that take an hour.
fn thorough_runs() -> usize {
    std::env::var("CARS_WHY_RUNS").map_or(10, |runs| runs.parse().unwrap())
}

#[test]
#[ignore = "thorough: minutes; CARS_WHY_RUNS=100 for a hundred"]
fn intervals_of_coins_cover_the_truth_in_many_runs() {
    let (mut points, mut jumps) = (Misses::default(), Misses::default());
    for number in 0..thorough_runs() {
        let (of_points, of_jumps) = misses(number);
        points.add(of_points);
        jumps.add(of_jumps);
    }
    println!("points of curves: {points:?}; before jumps: {jumps:?}");
    assert_level(points);
}

/// Whether a run without a cause gets none.
fn has_no_cause(number: usize) -> bool {
    let head = HEAD.replace("60 s", "300 s");
    let text = |name: &str| format!("{head}{}", robot(name, "Drifter", 6.0));
    let (recorded, name) = first(text, ("Drift", number), "sum", |sum| sum < 0.0);
    let what = format!("{{ robot = \"{name}\", variable = \"sum\", above = 7 }}");
    let answer = ask(&recorded, &what);
    answer.jumps.is_empty()
}

/// Whether the lost command is found.
fn finds_the_command(number: usize) -> bool {
    let text = |name: &str| {
        let robots = robot("Sender", "Messenger", 3.0) + &robot(name, "Listener", 8.0);
        format!("{HEAD}[network]\ncommands = {{ loss = 0.3 }}\n{robots}")
    };
    let (recorded, name) = first(text, ("Hearer", number), "key", |key| key == 0.0);
    let what = format!("{{ robot = \"{name}\", variable = \"key\", above = 0.5 }}");
    let answer = ask(&recorded, &what);
    let found = answer.jumps.iter().any(|jump| {
        let cause = jump.shown.cause.as_ref();
        let words = cause.map_or("", |cause| cause.what.as_str());
        jump.shown.tick.abs_diff(DECISIVE + 1) <= 1
            && words.contains("(key)")
            && words.ends_with("was lost")
    });
    found && answer.jumps.len() == 1
}

/// Whether the guest that stood in the way is found.
fn finds_the_way(number: usize) -> bool {
    let text = |name: &str| {
        // Guests that turn in every tick: whether one is in the way is decided in that tick.
        let guests = "[guests]\ncount = 8\nspeed = { min = \"2 m/s\", mode = \"4 m/s\", max = \"6 m/s\" }\n\
                      duration = { min = \"0.4 s\", mode = \"0.5 s\", max = \"0.6 s\" }\n";
        let field = HEAD.replace("12 m", "8 m");
        format!(
            "{field}{guests}{}",
            robot(name, "Walker", 3.0).replace("\"6 m\"]", "\"4 m\"]")
        )
    };
    let (recorded, name) = first(text, ("Walker", number), "blocked", |blocked| {
        blocked == 1.0
    });
    let what = format!("{{ robot = \"{name}\", variable = \"blocked\", above = 0.5 }}");
    let answer = ask(&recorded, &what);
    answer.jumps.iter().any(|jump| {
        let words = jump
            .shown
            .cause
            .as_ref()
            .map_or("", |cause| cause.what.as_str());
        // Robots move before guests: where a guest stands when the robot moves is drawn in the tick before.
        jump.shown.tick.abs_diff(DECISIVE) <= 1
            && (words == format!("a guest blocked {name}") || words == "chance of guests")
    })
}

/// Whether the crash is found that costs a robot its two heads.
fn finds_the_crash(number: usize) -> bool {
    let name = format!("Coin{number}");
    let text = format!(
        "on_late = \"continue\"\n{HEAD}{}",
        robot(&name, "Thrower", 6.0)
    );
    // Without the crash the run has three heads in the end, and so two of them before it.
    let has_three = |seed: &u64| last(&record(&text, *seed), &name, "heads") == 3.0;
    let seed = seeds(number)
        .find(has_three)
        .expect("some run has three heads");
    let crash =
        format!("[[fault]]\nrobot = \"{name}\"\ndo = \"crash\"\nat = \"35 s\"\nuntil = \"37 s\"\n");
    let recorded = record(&(text + &crash), seed);
    let what = format!("{{ robot = \"{name}\", variable = \"heads\", above = 2.5 }}");
    let answer = ask(&recorded, &what);
    answer
        .planned
        .iter()
        .any(|effect| effect.matters && effect.tick == 70)
}

#[test]
fn planted_causes_are_found_and_no_others() {
    assert!(finds_the_command(0));
    assert!(finds_the_way(0));
    assert!(finds_the_crash(0));
    assert!(has_no_cause(0));
}

/// Of many runs at least 95 % must be right; of few runs one may be wrong.
fn assert_right(what: &str, check: fn(usize) -> bool) {
    let runs = thorough_runs();
    let least = (runs * 95).div_ceil(100).min(runs - 1);
    let wrong: Vec<usize> = (0..runs).filter(|number| !check(*number)).collect();
    let right = runs - wrong.len();
    println!("{what}: {right} of {runs}, all but {wrong:?}");
    assert!(right >= least, "{what}: {right} of {runs}");
}

#[test]
#[ignore = "thorough: minutes; CARS_WHY_RUNS=200 for two hundred"]
fn planted_commands_are_found_in_95_percent_of_runs() {
    assert_right("command", finds_the_command);
}

#[test]
#[ignore = "thorough: minutes; CARS_WHY_RUNS=200 for two hundred"]
fn planted_ways_are_found_in_95_percent_of_runs() {
    assert_right("way", finds_the_way);
}

#[test]
#[ignore = "thorough: minutes; CARS_WHY_RUNS=200 for two hundred"]
fn planted_crashes_are_found_in_95_percent_of_runs() {
    assert_right("crash", finds_the_crash);
}

#[test]
#[ignore = "thorough: minutes; CARS_WHY_RUNS=200 for two hundred"]
fn without_a_cause_none_is_named_in_95_percent_of_runs() {
    assert_right("none", has_no_cause);
}

/// What is asked about the run of [`record_coin`].
const TWO_HEADS: &str = "{ robot = \"Coin\", variable = \"heads\", above = 1.5 }";

/// A run of one robot that throws three coins.
fn record_coin() -> (Recorded, EpochFiles) {
    let recorded = record(&format!("{HEAD}{}", robot("Coin", "Thrower", 6.0)), 1);
    let files = recorded_epoch(&recorded.folder, None).unwrap();
    (recorded, files)
}

#[test]
fn an_answer_does_not_depend_on_threads_and_goes_on_where_it_was_stopped() {
    let what = TWO_HEADS;
    let (recorded, files) = record_coin();
    let run = "run".parse().unwrap();

    let stop = AtomicBool::new(false);
    let mut played = 0;
    let stopped = why(
        &recorded.folder,
        &run,
        &files,
        &options(what, &stop, 2),
        &mut |_| {
            played += 1;
            if played == 1000 {
                stop.store(true, Ordering::Relaxed);
            }
        },
    );
    assert!(matches!(stopped, Err(LabError::Interrupted)));

    // A process that is killed may leave half a line.
    let kept = recorded.folder.file("why");
    let line = std::fs::read_dir(&kept)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let mut lines = std::fs::read_to_string(&line).unwrap();
    lines += "{\"fork\":\"after\",\"tick\":0,\"num";
    std::fs::write(&line, lines).unwrap();

    stop.store(false, Ordering::Relaxed);
    let mut more = 0;
    let (resumed, path) = why(
        &recorded.folder,
        &run,
        &files,
        &options(what, &stop, 3),
        &mut |_| more += 1,
    )
    .unwrap();
    let again = std::fs::read(&path).unwrap();
    std::fs::remove_dir_all(&kept).unwrap();
    let mut all = 0;
    let (whole, _) = why(
        &recorded.folder,
        &run,
        &files,
        &options(what, &stop, 1),
        &mut |_| all += 1,
    )
    .unwrap();
    assert_eq!(resumed, whole);
    assert_eq!(again, std::fs::read(&path).unwrap());
    assert_eq!(more, all - played);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_that_cannot_be_copied_gives_the_same_answer() {
    let what = TWO_HEADS;
    let (recorded, files) = record_coin();
    let run = "run".parse().unwrap();
    let stop = AtomicBool::new(false);

    let uncopied: RobotMaker = Arc::new(|_, _| Some(Box::new(Uncopied(Thrower::default()))));
    let mut answers = Vec::new();
    for make in [robots(), uncopied] {
        let options = WhyOptions {
            make,
            ..options(what, &stop, 2)
        };
        let (answer, _) = why(&recorded.folder, &run, &files, &options, &mut |_| {}).unwrap();
        std::fs::remove_dir_all(recorded.folder.file("why")).unwrap();
        answers.push(answer);
    }
    assert!(!answers[0].jumps.is_empty());
    assert_eq!(answers[0], answers[1]);
}
