//! A nemesis: processes are killed and stopped, links are cut, a rogue client floods the run, and files are damaged, all drawn
//! from a seed. Nothing hangs, ticks follow the last fault, no process is left behind, and the record is whole.
//!
//! Each seed is one launch. Without more a few fixed ones are played. `CARS_NEMESIS_S=60` plays launches for so many seconds, with
//! seeds from the clock on; `CARS_NEMESIS_SEED=17` begins with this one, and alone plays only it. `CARS_NEMESIS_BURST=5000`
//! floods with 20,000 messages at a time instead of 2,000.

mod cable;
mod damage;
mod plan;
mod rogue;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use nix::sys::signal::Signal;
use protocol::messages::OnLate;
use protocol::{RobotName, RunName};
use serde_json::Value;
use system_tests::processes::{Running, named, nobody_is_left, send};
use system_tests::{Lab, assert_same, eventually, free_port, is_within, within};

use cable::Cable;
use plan::{Fault, Flood, Plan};
use rogue::Rogue;

/// Launches that are always played: together they have every size, both policies, plain and secured, every kind of fault.
const ALWAYS: [u64; 5] = [0, 1, 3, 4, 8];
/// Ticks that must follow the last fault.
const FOLLOWING: u64 = 20;
/// Within this time.
const FOLLOW: Duration = Duration::from_secs(15);
/// Within this time after the last fault every robot takes part.
const RETURN: Duration = Duration::from_secs(30);
/// Longest time that a flood may take.
const FLOOD: Duration = Duration::from_secs(60);
/// A stop or a cut lasts for at least so many ticks where the clock goes on, so that the robot misses one of them.
const MISSED: u64 = 3;
/// Messages of a burst of a flood, unless `CARS_NEMESIS_BURST` states another number.
const BURST: usize = 500;
/// Length of a tick, simulated seconds.
const TICK_S: f64 = 0.5;

/// The files of a launch.
struct Files {
    scenario: PathBuf,
    launch: PathBuf,
}

/// Writes a launch of pairs of a Butler and a Leguin that are restarted.
fn write_files(lab: &Lab, plan: &Plan) -> Files {
    let on_late = if plan.waits() { "wait" } else { "continue" };
    let mut scenario = format!(
        "seed = {}\nduration = \"100000 s\"\ntick = \"{TICK_S} s\"\non_late = \"{on_late}\"\n\
         deadline = \"0.2 s\"\nlose_after = 2\nrecord = {{ frames = false }}\n[guests]\ncount = 10\n",
        plan.seed
    );
    let mut launch =
        "scenario = \"nemesis.toml\"\nspeed = 100\n[console]\nenabled = false\n".to_owned();
    for i in 0..plan.robots {
        let x = 2 + 3 * (i % 4);
        let y = 2 + 3 * (i / 4);
        let (class, parameters) = if i % 2 == 0 {
            // The last of an odd number shares the first one's refiller.
            let refiller = if i + 1 < plan.robots { i + 1 } else { 1 };
            ("Butler", format!("refiller = \"R{refiller}\""))
        } else {
            ("Leguin", format!("waiter = \"R{}\"", i - 1))
        };
        let program = class.to_lowercase();
        scenario += &format!(
            "[[robot]]\nname = \"R{i}\"\nclass = \"{class}\"\nat = [\"{x} m\", \"{y} m\"]\n\
             params = {{ {parameters} }}\n"
        );
        launch += &format!(
            "[[process]]\nname = \"R{i}\"\ncommand = [\"cars-{program}\"]\nrestart = \"on-failure\"\n\
             backoff = \"0.05 s\"\n"
        );
    }

    Files {
        scenario: lab.write("nemesis.toml", &scenario),
        launch: lab.write("nemesis-launch.toml", &launch),
    }
}

/// Certificates for these robots.
fn certificates(lab: &Lab, robots: &[RobotName]) -> PathBuf {
    let folder = lab.out().join("certificates");
    let robots: Vec<&str> = robots.iter().map(RobotName::as_str).collect();
    let (code, text) = lab.cars_without_out(&[
        "secure",
        "init",
        &folder.display().to_string(),
        "--robots",
        &robots.join(","),
    ]);
    assert_eq!(code, 0, "{text}");

    folder
}

/// What was played so far: how often each fault, how many messages, files and records.
#[derive(Default)]
struct Counts(BTreeMap<String, usize>);

impl Counts {
    fn add(&mut self, what: &str, count: usize) {
        *self.0.entry(what.to_owned()).or_default() += count;
    }
}

/// A launch whose robots have a link each, and what happens to it.
struct Hall<'a> {
    lab: &'a Lab,
    run: String,
    launch: Running,
    cables: Vec<Cable>,
    rogue: Rogue,
    floods: Vec<(Flood, JoinHandle<usize>)>,
}

impl<'a> Hall<'a> {
    /// Starts a launch and waits until its clock runs.
    fn start(lab: &'a Lab, run: &str, plan: &Plan, files: &Files) -> Self {
        let port = free_port();
        let scheme = if plan.is_secured { "tls" } else { "tcp" };
        let robots: Vec<RobotName> = (0..plan.robots)
            .map(|i| RobotName::new(&format!("R{i}")).unwrap())
            .collect();
        let mut arguments = vec![
            "launch".to_owned(),
            files.launch.display().to_string(),
            format!("--connect-port={port}"),
        ];

        let mut stolen = None;
        if plan.is_secured {
            let folder = certificates(lab, &robots);
            stolen = Some(folder.join("R0").join("zenoh.json5"));
            arguments.push(format!("--secure={}", folder.display()));
        }
        let mut cables = Vec::new();
        for robot in &robots {
            let cable = Cable::new(scheme, port);
            arguments.push(format!("--link={robot}={}", cable.endpoint));
            cables.push(cable);
        }
        let rogue = Rogue {
            endpoint: format!("{scheme}/127.0.0.1:{port}"),
            stolen,
            run: RunName::new(run).unwrap(),
            robots,
            burst: number("CARS_NEMESIS_BURST").map_or(BURST, |burst| burst as usize),
        };

        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let launch = lab.start(run, &arguments);
        let hall = Self {
            lab,
            run: run.to_owned(),
            launch,
            cables,
            rogue,
            floods: Vec::new(),
        };
        // Its first lines may have been printed before the launcher subscribed, so the status is polled.
        eventually("the clock to run", || {
            let status = hall.status()?;
            (status["phase"] == "running").then_some(())
        });
        hall
    }

    fn status(&self) -> Option<Value> {
        status(self.lab, &self.run)
    }

    /// The last tick that is complete. Fails if the run does not reply.
    fn tick(&self) -> u64 {
        within(FOLLOW, "the status of the run", || {
            self.status()?["tick"].as_u64()
        })
    }

    /// Waits until so many further ticks are complete.
    fn pass(&self, ticks: u64) {
        let reached = self.tick();
        within(FOLLOW, &format!("{ticks} ticks after {reached}"), || {
            (self.tick() >= reached + ticks).then_some(())
        });
    }

    /// Lets the faults of a plan happen, one after the other. Returns the robots that were struck.
    fn strike(&mut self, plan: &Plan) -> BTreeSet<String> {
        let mut struck = BTreeSet::new();
        for (number, fault) in plan.faults.iter().enumerate() {
            for cable in &mut self.cables {
                cable.heal_if_due();
            }
            println!("{}: {fault:?}", self.run);

            match *fault {
                Fault::Kill(robot) => self.kill(robot),
                Fault::Stop(robot, lasting) => self.stop(robot, lasting, plan),
                Fault::Cut(robot, lasting) => {
                    self.cables[robot].cut_for(lasting);
                    if !plan.waits() {
                        self.pass(MISSED);
                    }
                }
                Fault::Starve(lasting) => self.starve(lasting),
                Fault::Flood(flood) => {
                    let rogue = self.rogue.clone();
                    let seed = plan.seed.wrapping_add(number as u64);
                    let flooding = std::thread::spawn(move || rogue.flood(flood, seed));
                    self.floods.push((flood, flooding));
                }
            }
            if let Fault::Kill(robot) | Fault::Stop(robot, _) | Fault::Cut(robot, _) = fault {
                struck.insert(format!("R{robot}"));
            }
        }

        struck
    }

    fn kill(&self, robot: usize) {
        let pid = self.process(robot);
        send(pid, Signal::SIGKILL);
        // The next fault must not strike the process that is ending.
        let name = format!("R{robot}");
        eventually("the end of a killed process", || {
            (named(&self.run, &name) != Some(pid)).then_some(())
        });
    }

    fn stop(&self, robot: usize, lasting: Duration, plan: &Plan) {
        let pid = self.process(robot);
        send(pid, Signal::SIGSTOP);
        std::thread::sleep(lasting);
        if !plan.waits() {
            self.pass(MISSED);
        }
        send(pid, Signal::SIGCONT);
    }

    /// Lowers the simulator's limit of open files below what it has open, for this long.
    fn starve(&self, lasting: Duration) {
        let simulator = self.launch.process("cars-sim").to_string();
        let limit = prlimit(&simulator, &["--nofile", "--output=SOFT", "--noheadings"]);

        prlimit(&simulator, &["--nofile=3:"]);
        std::thread::sleep(lasting);
        prlimit(&simulator, &[&format!("--nofile={}:", limit.trim())]);
    }

    /// The process of a robot. One that was killed is restarted.
    fn process(&self, robot: usize) -> u32 {
        let name = format!("R{robot}");
        eventually(&format!("the process of {name}"), || {
            named(&self.run, &name)
        })
    }

    /// Waits until every fault is over.
    fn heal(&mut self, plan: &Plan, counts: &mut Counts) {
        eventually("the end of the cuts", || {
            for cable in &mut self.cables {
                cable.heal_if_due();
            }
            (!self.cables.iter().any(Cable::is_cut)).then_some(())
        });

        for (flood, flooding) in self.floods.drain(..) {
            within(FLOOD, "the end of a flood", || {
                flooding.is_finished().then_some(())
            });
            let count = flooding.join().expect("the flood goes as planned");
            println!("{}: a flood of {count}", self.run);

            let what = match flood {
                Flood::Silent => "silent connections",
                Flood::Rubbish | Flood::Stale | Flood::Forged => "rogue messages",
            };
            counts.add(&format!("{what}, {}", plan.security()), count);
        }
    }

    /// The clock runs, and every robot takes part.
    fn recovers(&self) {
        let begun = Instant::now();
        self.pass(FOLLOWING);
        let followed = begun.elapsed();

        let mut absent = Vec::new();
        let is_complete = is_within(RETURN, || {
            let Some(status) = self.status() else {
                return false;
            };
            absent = status["robots"].as_array().unwrap().clone();
            absent.retain(|robot| robot["presence"] != "here");
            absent.is_empty()
        });
        let printed = self.launch.printed();
        let lines = printed.lines().filter(|line| !line.contains("malformed"));
        assert!(
            is_complete,
            "within {RETURN:?} these robots do not take part again: {absent:?}; the launch printed\n{}",
            lines.collect::<Vec<_>>().join("\n")
        );
        println!(
            "{}: {FOLLOWING} ticks after {:.1} s, all robots after {:.1} s",
            self.run,
            followed.as_secs_f64(),
            begun.elapsed().as_secs_f64()
        );
    }

    /// The simulator has received what the rogue client put, and ignored it. (Stale messages may all be clocks.)
    fn has_ignored_floods(&self, plan: &Plan) {
        for fault in &plan.faults {
            let reasons = match fault {
                Fault::Flood(Flood::Rubbish) => &["malformed"][..],
                // The robot whose name is forged may be lost.
                Fault::Flood(Flood::Forged) => &["stale", "lost"],
                _ => continue,
            };
            within(
                FOLLOW,
                &format!("messages to be ignored, {reasons:?}"),
                || {
                    let ignored = &self.status()?["ignored"];
                    let mut counts = reasons.iter().filter_map(|reason| ignored[reason].as_u64());
                    counts.any(|count| count > 0).then_some(())
                },
            );
        }
    }

    /// Ends the run. Nothing is left behind, and no program has panicked.
    fn finish(mut self) {
        self.lab.ok(&["ctl", "stop", "--run", &self.run]);
        self.launch.finish();
        nobody_is_left(&self.run);

        let printed = self.launch.printed();
        assert!(!printed.contains("panicked"), "{printed}");
        for log in std::fs::read_dir(self.lab.file(&self.run, "logs")).unwrap() {
            let log = log.unwrap().path();
            let bytes = std::fs::read(&log).unwrap();
            let text = String::from_utf8_lossy(&bytes);
            assert!(!text.contains("panicked"), "{}: {text}", log.display());
        }
    }
}

/// Reads or sets a limit of a process. Returns what is printed.
fn prlimit(pid: &str, arguments: &[&str]) -> String {
    let mut command = Command::new("prlimit");
    let output = command.args(["--pid", pid]).args(arguments).output();
    let output = output.expect("prlimit is part of every Linux distribution");
    assert!(output.status.success(), "{arguments:?}: {output:?}");

    String::from_utf8(output.stdout).unwrap()
}

/// The status of a run, if it replies.
fn status(lab: &Lab, run: &str) -> Option<Value> {
    let output = lab
        .cars(&["ctl", "status", "--json", "--run", run])
        .output()
        .unwrap();

    serde_json::from_slice(&output.stdout).ok()
}

/// Prints how to repeat a launch if it fails.
struct Repeat(u64);

impl Repeat {
    fn command(&self) -> String {
        format!(
            "CARS_NEMESIS_SEED={} cargo test --release -p system-tests --test system nemesis::whatever -- --ignored --nocapture",
            self.0
        )
    }
}

impl Drop for Repeat {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("seed {} failed, again: {}", self.0, self.command());
        }
    }
}

/// Plays the launch of a seed, and counts what happened.
fn play(plan: &Plan, counts: &mut Counts) {
    let lab = Lab::new();
    let run = format!("nemesis-{}", plan.seed);
    let files = write_files(&lab, plan);

    let mut hall = Hall::start(&lab, &run, plan, &files);
    let struck = hall.strike(plan);
    hall.heal(plan, counts);
    hall.recovers();
    hall.has_ignored_floods(plan);
    hall.finish();

    let (code, text) =
        lab.cars_without_out(&["check", &lab.out().join(&run).display().to_string()]);
    assert_eq!(code, 0, "{text}");
    if plan.waits() {
        check_record(&lab, &run, &BTreeSet::new());
        let compared = check_undisturbed(&lab, &run, &files.scenario);
        counts.add(&format!("equal records, {}", plan.security()), 1);
        counts.add("bytes of equal records", compared);
    } else {
        check_record(&lab, &run, &struck);
    }

    damage::record(&lab, &run, plan.seed);
    counts.add("damaged records", 1);
    counts.add("damaged files", damage::files(&lab, plan.seed));
    for fault in &plan.faults {
        counts.add(&format!("{}, {}", fault.kind(), plan.security()), 1);
    }
}

/// A number in an environment variable.
fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;

    Some(text.parse().expect("a number"))
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn whatever_happens_the_run_goes_on_and_its_record_is_whole() {
    let begun = Instant::now();
    let length = number("CARS_NEMESIS_S").map(Duration::from_secs);
    let seeds: Box<dyn Iterator<Item = u64>> = match (number("CARS_NEMESIS_SEED"), length) {
        (Some(seed), None) => Box::new(std::iter::once(seed)),
        (Some(seed), Some(_)) => Box::new(seed..),
        (None, None) => Box::new(ALWAYS.into_iter()),
        (None, Some(_)) => {
            let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
            Box::new(now.as_millis() as u64..)
        }
    };

    let mut launches = 0;
    let mut counts = Counts::default();
    for seed in seeds {
        let plan = Plan::draw(seed);
        let repeat = Repeat(seed);
        println!(
            "seed {seed}: {} robots, on_late {:?}, secured: {}, again: {}",
            plan.robots,
            plan.on_late,
            plan.is_secured,
            repeat.command()
        );
        play(&plan, &mut counts);

        launches += 1;
        println!(
            "{launches} launches in {:.0} s: {:?}",
            begun.elapsed().as_secs_f64(),
            counts.0
        );
        if length.is_some_and(|length| begun.elapsed() >= length) {
            break;
        }
    }
}

#[test]
fn the_short_version_has_everything() {
    let mut kinds = BTreeSet::new();
    for seed in ALWAYS {
        let plan = Plan::draw(seed);
        kinds.insert(format!("{} robots", plan.robots));
        kinds.insert(format!(
            "on_late {:?}, secured: {}",
            plan.on_late, plan.is_secured
        ));
        for fault in &plan.faults {
            kinds.insert(fault.kind().to_owned());
        }
    }

    // Four sizes, two policies with and without certificates, four kinds of faults and four kinds of floods.
    assert_eq!(kinds.len(), 4 + 4 + 8, "{kinds:?}");
}

/// The record, up to where the run was stopped, is that of the same scenario without processes and faults. Returns how many
/// bytes these are.
fn check_undisturbed(lab: &Lab, run: &str, scenario: &Path) -> usize {
    let disturbed = ticks(&lab.bytes(run));
    let last = lab.events(run).last().unwrap()["tick"].as_u64().unwrap();
    assert!(last >= FOLLOWING, "the run has {last} ticks");

    let duration = format!("{} s", last as f64 * TICK_S);
    let file = scenario.display().to_string();
    lab.ok(&[
        "run",
        &file,
        "--duration",
        &duration,
        "--run",
        "undisturbed",
    ]);
    assert_same(
        (run, &disturbed),
        ("undisturbed", &ticks(&lab.bytes("undisturbed"))),
    );

    disturbed.len()
}

/// A record up to the end of its last tick: what follows depends on why the run ended.
fn ticks(record: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(record);
    let mut ticks = String::new();
    let mut tick = String::new();
    for line in text.split_inclusive('\n') {
        tick += line;
        if line.contains("\"event\":\"tick\"") {
            ticks += &std::mem::take(&mut tick);
        }
    }

    ticks.into_bytes()
}

/// Its link is cut when the next epoch begins: it misses tick 0 of it, and joins it later.
#[test]
fn a_robot_that_is_cut_off_while_the_run_is_initialized_returns() {
    let lab = Lab::new();
    let run = "nemesis-init";
    let plan = Plan {
        seed: 7,
        robots: 2,
        on_late: OnLate::Continue,
        is_secured: false,
        faults: Vec::new(),
    };
    let files = write_files(&lab, &plan);
    let mut hall = Hall::start(&lab, run, &plan, &files);
    hall.cables[0].cut();
    lab.ok(&["ctl", "init", "--run", run]);
    let status = || within(FOLLOW, "the status of the run", || status(&lab, run));
    eventually("tick 0 of the next epoch", || {
        let status = status();
        (status["epoch"] == 2 && status["phase"] == "ready").then_some(())
    });
    lab.ok(&["ctl", "start", "--run", run]);
    let presence = |expected: &str| {
        eventually(expected, || {
            let status = status();
            let robot = &status["robots"][0];
            assert_eq!(
                (&robot["name"], &status["epoch"]),
                (&"R0".into(), &2.into())
            );
            (robot["presence"] == expected).then_some(())
        });
    };
    presence("lost");
    hall.cables[0].heal();
    presence("here");

    let reached = status()["tick"].as_u64().unwrap();
    eventually("further ticks", || {
        (status()["tick"].as_u64().unwrap() > reached + 10).then_some(())
    });
    hall.finish();

    let events = lab.events(run);
    let of = |kind: &str| -> Vec<u64> {
        events
            .iter()
            .filter(|event| event["event"] == kind && event["robot"] == "R0")
            .map(|event| event["tick"].as_u64().unwrap())
            .collect()
    };
    let missed = of("missed");
    assert_eq!(missed[0], 0, "it was not there when the epoch began");
    let joined = of("joined");
    assert!(joined.len() > 1 && joined[1] > 0, "it returned: {joined:?}");
    assert_eq!(
        missed[..joined[1] as usize],
        (0..joined[1]).collect::<Vec<_>>()
    );
    // An emotion is recorded when it changes: the first one is that of the first report.
    let acted = of("emotion");
    assert!(acted[0] >= joined[1], "it acted: {acted:?}");
}

/// Every line is complete, every tick is there once and in order, and every robot with a fault is named.
fn check_record(lab: &Lab, run: &str, struck: &BTreeSet<String>) {
    let bytes = lab.bytes(run);
    assert!(bytes.ends_with(b"\n"));

    let events = lab.events(run);
    assert_eq!(events.last().unwrap()["reason"], "stopped");

    let ticks = events
        .iter()
        .filter(|event| event["event"] == "tick")
        .map(|event| event["tick"].as_u64().unwrap());
    assert!(
        ticks.enumerate().all(|(index, tick)| index as u64 == tick),
        "a tick is missing or out of order"
    );

    let named: BTreeSet<String> = events
        .iter()
        .filter(|event| {
            event["event"] == "missed" || event["event"] == "lost" || event["generation"].is_u64()
        })
        .map(|event| event["robot"].as_str().unwrap().to_owned())
        .collect();

    assert!(
        struck.is_subset(&named),
        "struck {struck:?}, named {named:?}"
    );

    // A robot is lost before a further incarnation of it joins, and every incarnation has a higher number.
    for robot in struck {
        let own = events
            .iter()
            .filter(|event| event["robot"] == robot.as_str());
        let generations: Vec<u64> = own
            .filter(|event| event["event"] == "joined")
            .filter_map(|event| event["generation"].as_u64())
            .collect();
        assert!(
            generations.windows(2).all(|pair| pair[0] <= pair[1]),
            "{robot}: {generations:?}"
        );
    }
}
