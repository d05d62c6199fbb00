//! The experiment of the paper ("Experimental Results"), over many seeds of the shipped scenario. Tests are numbered as
//! those of `crates/robots/tests/robots/documented.rs`, of which they show what takes a whole hall. Items are the statements of
//! that section of the paper, in its order: 15 is the hall, 27 is Vonda.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use environment::{Event, Simulation};
use protocol::RunName;
use protocol::messages::Point;
use robot::LocalHost;
use system_tests::hall::{Hall, scenario};
use system_tests::{Lab, programs, root};

pub(super) const HALL: &str = "configs/hors_doeuvres.toml";
const THREE: &str = "configs/three_robots.toml";
pub(super) const FT_M: f64 = 0.3048;
pub(super) const SEEDS: u64 = 32;

/// Behavior of the two robots in two ticks in a row.
pub(super) struct Change<'a> {
    pub(super) hall: &'a Hall,
    pub(super) events: &'a [Event],
    pub(super) seed: u64,
    pub(super) butler: (&'a str, &'a str),
    pub(super) leguin: (&'a str, &'a str),
}

impl Change<'_> {
    /// Whether an exchange begins.
    fn meets(&self) -> bool {
        self.butler.0 != "EXCHANGE" && self.butler.1 == "EXCHANGE"
    }
}

/// Plays one hall to its end and shows every tick to `look`, which keeps its notes.
pub(super) fn play<N: Default>(
    file: &str,
    seed: u64,
    set: &[&str],
    look: &impl Fn(&mut N, &Change<'_>),
) -> (N, Hall) {
    let (mut notes, mut hall) = (N::default(), Hall::new(scenario(file, seed, set)));
    for _ in 0..hall.simulation.scenario().ticks {
        let (butler, leguin) = (hall.behavior("Butler"), hall.behavior("Leguin"));
        let events = hall.step();
        let now = (hall.behavior("Butler"), hall.behavior("Leguin"));
        let change = Change {
            hall: &hall,
            events: &events,
            seed,
            butler: (&butler, &now.0),
            leguin: (&leguin, &now.1),
        };
        look(&mut notes, &change);
    }

    (notes, hall)
}

/// Does something for every seed, on all processors, and returns what came of it in the order of the seeds.
fn for_each_seed<T: Send>(seeds: u64, one: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(1);
    let work = || {
        std::iter::from_fn(|| Some(next.fetch_add(1, Ordering::Relaxed)))
            .take_while(|seed| *seed <= seeds)
            .map(|seed| (seed, one(seed)))
            .collect::<Vec<_>>()
    };
    let mut done: Vec<(u64, T)> = std::thread::scope(|scope| {
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..count).map(|_| scope.spawn(work)).collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, _>| {
            worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(join).collect()
    });

    done.sort_by_key(|(seed, _)| *seed);

    done.into_iter().map(|(_, result)| result).collect()
}

/// Plays the hall over all seeds; returns the notes that `look` made of each.
pub(super) fn watch<N: Default + Send>(
    file: &str,
    set: &[&str],
    look: impl Fn(&mut N, &Change<'_>) + Sync,
) -> Vec<N> {
    watch_seeds(SEEDS, file, set, look)
}

/// Plays a scenario with seeds 1 to `seeds`; returns the notes that `look` made of each.
pub(super) fn watch_seeds<N: Default + Send>(
    seeds: u64,
    file: &str,
    set: &[&str],
    look: impl Fn(&mut N, &Change<'_>) + Sync,
) -> Vec<N> {
    for_each_seed(seeds, |seed| play(file, seed, set, &look).0)
}

fn sent(events: &[Event], what: &str) -> usize {
    events
        .iter()
        .filter(|event| matches!(event, Event::CommandSent { command, .. } if command == what))
        .count()
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Sums of pairs of counts.
fn totals(notes: &[(u32, u32)]) -> (u32, u32) {
    notes
        .iter()
        .fold((0, 0), |sum, note| (sum.0 + note.0, sum.1 + note.1))
}

/// Items 15 to 17.
#[test]
fn t01_the_hall_is_that_of_the_paper() {
    let scenario = scenario(HALL, 1, &[]);
    assert_eq!(scenario.field_m, [50.0 * FT_M, 50.0 * FT_M]);
    assert_eq!((scenario.guests.count, scenario.body_m), (100, 2.0 * FT_M));

    let table = scenario.obstacles[0].at;
    let hall = Hall::new(scenario);
    assert!(
        hall.at("Leguin").distance_m(table) <= 4.0 * FT_M,
        "Leguin is at the table"
    );
    assert!(
        hall.at("Butler")
            .distance_m(Point::new(25.0 * FT_M, 25.0 * FT_M))
            < 3.0 * FT_M
    );
    assert_eq!(hall.number("Butler", "treats"), 30.0);
    assert_eq!(
        (hall.emotion("Butler"), hall.behavior("Butler")),
        ("HAPPY".into(), "SERVE".into())
    );
    assert_eq!(
        (hall.emotion("Leguin"), hall.behavior("Leguin")),
        ("HAPPY".into(), "WAIT".into())
    );
}

/// Items 17, 22 and 23.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t05_an_exchange_happens_within_four_feet_and_fills_the_tray() {
    let notes = watch(
        HALL,
        &[],
        |(exchanges, from_intercept): &mut (u32, u32), change| {
            let hall = change.hall;
            if change.meets() {
                *exchanges += 1;
                *from_intercept += u32::from(change.butler.0 == "INTERCEPT");
                // He knows where she was at the last tick; meanwhile each may have moved by one stride.
                let stride_m = 4.5 * FT_M * hall.simulation.scenario().tick_s;
                let apart_m = hall.at("Butler").distance_m(hall.at("Leguin"));
                assert!(
                    apart_m <= 4.0 * FT_M + stride_m,
                    "seed {}: {apart_m} m",
                    change.seed
                );
            }
            if change.butler.0 == "EXCHANGE" && change.butler.1 != "EXCHANGE" {
                assert_eq!(
                    (change.butler.1, hall.number("Butler", "treats")),
                    ("GO_BACK", 30.0)
                );
                assert_eq!(sent(change.events, "go home"), 1, "he sends her home");
            } else {
                assert_eq!(sent(change.events, "go home"), 0, "only after an exchange");
            }
        },
    );

    let (exchanges, from_intercept) = totals(&notes);
    println!("{exchanges} exchanges, {from_intercept} of them begun from INTERCEPT");
    assert!(exchanges > 150 && from_intercept > 0);
}

/// Item 23.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t07_after_the_exchange_leguin_stands_until_she_is_sent_home() {
    #[derive(Default)]
    struct Notes {
        at: Option<Point>,
        counts: (u32, u32),
    }

    let notes = watch(
        HALL,
        &[],
        |Notes {
             at,
             counts: (waits, departures),
         },
         change| {
            let delivered = change
            .events
            .iter()
            .any(|event| matches!(event, Event::CommandDelivered { to, .. } if to.as_str() == "Leguin"));
            // What she does in a tick moves her in the next: in the first tick of GO_HOME she still stands.
            if matches!(
                change.leguin,
                ("EXCHANGE" | "AWAIT_GO_HOME", "AWAIT_GO_HOME" | "GO_HOME")
            ) {
                *waits += 1;
                assert_eq!(Some(change.hall.at("Leguin")), *at, "seed {}", change.seed);
            }
            if change.leguin == ("AWAIT_GO_HOME", "GO_HOME") {
                *departures += 1;
                assert!(
                    delivered,
                    "seed {}: she left without having been sent",
                    change.seed
                );
            }
            assert!(
                change.leguin != ("EXCHANGE", "GO_HOME"),
                "she stops and waits in between"
            );
            *at = Some(change.hall.at("Leguin"));
        },
    );
    let (waits, departures) = totals(&notes.iter().map(|notes| notes.counts).collect::<Vec<_>>());
    println!("{waits} ticks of waiting, {departures} departures");
    assert!(waits > 150 && departures > 150);
}

/// Item 24.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t08_at_the_table_leguin_waits_for_refill_or_hurry() {
    #[derive(Default)]
    struct Notes {
        at: Option<Point>,
        starts: u32,
    }

    let notes = watch(HALL, &[], |Notes { at, starts }, change| {
        let now = change.hall.at("Leguin");
        if change.leguin == ("WAIT", "WAIT") {
            assert_eq!(now, at.unwrap_or(now), "seed {}", change.seed);
        }
        *starts += u32::from(change.leguin == ("WAIT", "REFILL"));
        assert!(change.leguin != ("WAIT", "GO_HOME"));
        *at = (change.leguin.1 == "WAIT").then_some(now);
    });
    let starts: u32 = notes.iter().map(|notes| notes.starts).sum();
    assert!(starts > 150, "{starts}");
}

/// Item 21.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t10_intercepting_is_moving_toward_leguin() {
    #[derive(Default)]
    struct Notes {
        before: Option<(Point, Point)>,
        counts: (u32, u32),
    }

    /// Share of the moves that brought Butler nearer to where Leguin was.
    fn share_toward(behavior: &str) -> f64 {
        let notes = watch(
            HALL,
            &[],
            |Notes {
                 before,
                 counts: (nearer, moves),
             },
             change| {
                let now = (change.hall.at("Butler"), change.hall.at("Leguin"));
                let has_way_to_go = matches!(change.leguin.0, "REFILL" | "WAIT");
                let moved = before.filter(|before| before.0 != now.0);
                if let (true, true, Some((butler, leguin))) =
                    (change.butler == (behavior, behavior), has_way_to_go, moved)
                {
                    *moves += 1;
                    *nearer += u32::from(now.0.distance_m(leguin) < butler.distance_m(leguin));
                }
                *before = Some(now);
            },
        );
        let (nearer, moves) = totals(&notes.iter().map(|notes| notes.counts).collect::<Vec<_>>());
        f64::from(nearer) / f64::from(moves)
    }

    let (intercept, serve) = (share_toward("INTERCEPT"), share_toward("SERVE"));
    println!("share of moves toward Leguin: {intercept:.2} intercepting, {serve:.2} serving");
    assert!(
        intercept > 0.75,
        "he drives straight at her, around guests where he must: {intercept}"
    );
    assert!(serve < 0.65, "serving is a random walk: {serve}");
}

/// Items 20 and 25.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t11_butler_goes_back_to_where_he_started_and_serves_again() {
    let start = Point::new(25.0 * FT_M, 25.0 * FT_M);
    let notes = watch(HALL, &[], |(returns, emptied): &mut (u32, u32), change| {
        if change.butler == ("GO_BACK", "SERVE") {
            *returns += 1;
            let missed_m = change.hall.at("Butler").distance_m(start);
            assert!(
                missed_m <= 2.5 * FT_M,
                "seed {}: {missed_m} m from the start",
                change.seed
            );
        }
        let is_empty = change.hall.number("Butler", "treats") == 0.0;
        *emptied += u32::from(change.butler.1 == "GO_BACK" && is_empty);
    });
    let (returns, emptied) = totals(&notes);
    println!(
        "{returns} returns; in {emptied} ticks the tray was empty before the start was reached"
    );
    assert!(returns > 150);
    assert!(
        emptied > 0,
        "sometimes the treats are gone before he is back"
    );
}

/// Share of the exchanges that Butler began by intercepting, over all seeds.
fn share_intercepted(set: &[&str]) -> f64 {
    let notes = watch(
        HALL,
        set,
        |(exchanges, from_intercept): &mut (u32, u32), change| {
            *exchanges += u32::from(change.meets());
            *from_intercept += u32::from(change.meets() && change.butler.0 == "INTERCEPT");
        },
    );
    let (exchanges, from_intercept) = totals(&notes);

    f64::from(from_intercept) / f64::from(exchanges)
}

/// Obstacles side by side, from wall to wall around the table's corner.
pub(super) fn walled_in() -> String {
    let mut around = vec!["{ at = [\"2 ft\", \"2 ft\"] }".to_owned()];
    for y in [1, 3, 5, 7, 9] {
        around.push(format!("{{ at = [\"9 ft\", \"{y} ft\"] }}"));
    }
    for x in [1, 3, 5, 7] {
        around.push(format!("{{ at = [\"{x} ft\", \"9 ft\"] }}"));
    }
    format!("obstacle=[{}]", around.join(", "))
}

/// Item 21.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t12_who_blocks_leguin_frustrates_butler_who_intercepts_and_else_he_does_not() {
    let wall = walled_in();
    for (what, set) in [
        ("a wall", vec![wall.as_str(), "guests.count=0"]),
        ("a wall and guests", vec![wall.as_str()]),
        ("a crowd of guests", vec!["guests.count=150"]),
    ] {
        let is_met = watch(HALL, &set, |is_met: &mut bool, change| {
            let hall = change.hall;
            *is_met |=
                hall.emotion("Butler") == "FRUSTRATED" && change.butler == ("SERVE", "INTERCEPT");
        });
        let share = is_met.iter().filter(|is_met| **is_met).count() as f64 / is_met.len() as f64;
        println!(
            "{what} in front of Leguin: FRUSTRATED and INTERCEPT in {:.0} % of {SEEDS} seeds",
            share * 100.0
        );
        assert!(share >= 0.95, "{what}: {share}");
    }

    let share = share_intercepted(&["guests.count=0"]);
    println!("no guest in front of Leguin: {share:.3} of the exchanges begun from INTERCEPT");
    assert!(share <= 0.05, "{share}");
}

/// Item 21.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t13_the_more_guests_the_more_exchanges_are_begun_by_intercepting() {
    let shares = ["guests.count=0", "guests.count=50", "guests.count=100"]
        .map(|set| share_intercepted(&[set]));
    println!("share of exchanges begun from INTERCEPT with 0, 50, 100 guests: {shares:.3?}");
    assert!(shares[0] < shares[1] && shares[1] < shares[2], "{shares:?}");
}

/// Item 27.
#[test]
fn t14_vonda_stands_still_unless_she_is_called() {
    let mut hall = Hall::new(scenario(THREE, 1, &[]));
    let (at, emotion, behavior) = (
        hall.at("Vonda"),
        hall.emotion("Vonda"),
        hall.behavior("Vonda"),
    );

    for _ in 0..hall.simulation.scenario().ticks {
        hall.step();
        assert_eq!(
            (
                hall.at("Vonda"),
                hall.emotion("Vonda"),
                hall.behavior("Vonda")
            ),
            (at, emotion.clone(), behavior.clone())
        );
    }

    assert!(
        hall.number("Butler", "exchanges") > 3.0,
        "Leguin works meanwhile"
    );
}

/// Item 27.
#[test]
fn t14_vonda_comes_in_leguins_place_when_butlers_parameter_names_her() {
    let mut hall = Hall::new(scenario(THREE, 1, &["robot.Butler.params.refiller=Vonda"]));
    let at = hall.at("Leguin");
    let mut vonda_worked = false;
    for _ in 0..hall.simulation.scenario().ticks {
        hall.step();
        assert_eq!(
            (hall.at("Leguin"), hall.behavior("Leguin")),
            (at, "WAIT".into())
        );
        vonda_worked |= hall.behavior("Vonda") == "EXCHANGE";
    }

    assert!(vonda_worked && hall.number("Butler", "exchanges") > 3.0);
}

/// How far Leguin is from her place to Butler, 0 to 1.
fn part_of_the_way(hall: &Hall) -> f64 {
    let robots = &hall.simulation.scenario().robots;
    let leguin = robots.iter().find(|(name, _)| name.as_str() == "Leguin");
    let from_m = hall.at("Leguin").distance_m(leguin.unwrap().1.at);
    let to_m = hall.at("Leguin").distance_m(hall.at("Butler"));

    from_m / (from_m + to_m)
}

/// Whether both are CONCERNED, he serves, and she is on her way with "hurry", about halfway.
pub(super) fn is_state_of_figure_6(change: &Change<'_>) -> bool {
    let hall = change.hall;
    let are_concerned = ["Butler", "Leguin"]
        .iter()
        .all(|robot| hall.emotion(robot) == "CONCERNED");
    let work = (change.butler.1, change.leguin.1) == ("SERVE", "REFILL");
    let is_halfway = (0.35..=0.65).contains(&part_of_the_way(hall));

    are_concerned && work && hall.flag("Leguin", "hurried") && is_halfway
}

/// Item 26. The figure shows a state of both robots at one of its moments: with seven treats left.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t15_the_state_of_figure_6_is_reached() {
    /// Tick, treats left and part of the way, of each tick in the state.
    type Found = Vec<(u64, f64, f64)>;

    let notes = watch(HALL, &[], |found: &mut Found, change| {
        if is_state_of_figure_6(change) {
            let hall = change.hall;
            let treats = hall.number("Butler", "treats");
            found.push((hall.simulation.tick(), treats, part_of_the_way(hall)));
        }
    });
    let reached = |least: f64, most: f64| {
        let is_reached = |found: &&Found| {
            found
                .iter()
                .any(|(_, treats, _)| (least..=most).contains(treats))
        };
        notes.iter().filter(is_reached).count()
    };

    for (least, most) in [(0.0, 30.0), (0.0, 10.0), (6.0, 8.0)] {
        let seeds = reached(least, most);
        println!("Figure 6 with {least} to {most} treats: in {seeds} of {SEEDS} seeds");
    }
    let snapshots = reached(7.0, 7.0);
    println!("Figure 6 with seven treats: in {snapshots} of {SEEDS} seeds, first at:");
    for (seed, found) in (1..).zip(&notes) {
        if let Some((tick, _, part)) = found.iter().find(|(_, treats, _)| *treats == 7.0) {
            println!("  seed {seed}, tick {tick}, {part:.2} of the way");
        }
    }

    assert_eq!(reached(6.0, 8.0), notes.len());
    assert!(snapshots >= 20, "{snapshots}");
}

/// What is left of a team when commands are lost.
struct Losses {
    exchanges: Vec<f64>,
    empty_s: Vec<f64>,
}

/// Plays the hall with this probability of losing a command.
fn lossy(loss: f64, arm: &[&str]) -> Losses {
    let loss = format!("network.commands={{ loss = {loss:?} }}");
    let set: Vec<&str> = arm.iter().copied().chain([loss.as_str()]).collect();
    let runs = for_each_seed(SEEDS, |seed| {
        let (_, hall) = play(HALL, seed, &set, &|(): &mut (), _| {});
        (
            hall.number("Butler", "exchanges"),
            hall.number("Butler", "empty_s"),
        )
    });
    let (exchanges, empty_s) = runs.into_iter().unzip();

    Losses { exchanges, empty_s }
}

const AFFECTLESS: [&str; 2] = [
    "robot.Butler.params.affect=off",
    "robot.Leguin.params.affect=off",
];
const TIMER: &str = "robot.Butler.params.resend=on";

/// The four teams, by name: affectless, timer repeat, affect only, both.
fn arms(loss: f64) -> BTreeMap<&'static str, Losses> {
    let [butler, leguin] = AFFECTLESS;
    let arms: [(&str, &[&str]); 4] = [
        ("affectless", &AFFECTLESS),
        ("timer repeat", &[butler, leguin, TIMER]),
        ("affect only", &[]),
        ("both", &[TIMER]),
    ];
    let arms: BTreeMap<_, _> = arms
        .into_iter()
        .map(|(name, arm)| (name, lossy(loss, arm)))
        .collect();
    for (name, Losses { exchanges, empty_s }) in &arms {
        let (least, most) = (
            exchanges.iter().copied().fold(f64::INFINITY, f64::min),
            exchanges.iter().copied().fold(0.0, f64::max),
        );
        println!(
            "loss {loss}: {name:12} {:.1} exchanges ({least} to {most}), {:.0} s with an empty tray",
            mean(exchanges),
            mean(empty_s)
        );
    }

    arms
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t20_without_any_command_emotions_keep_the_team_at_work() {
    let arms = arms(1.0);

    for with in ["affect only", "both"] {
        let least = arms[with]
            .exchanges
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        assert!(least >= 3.0, "{with}: {least} exchanges in some seed");
    }

    for without in ["affectless", "timer repeat"] {
        let most = arms[without].exchanges.iter().copied().fold(0.0, f64::max);
        assert!(most <= 1.0, "{without}: {most} exchanges in some seed");
    }
}

/// The abilities of these teams differ: the one with the timer neither hurries nor intercepts. `docs/experiments.md` compares
/// teams with the same abilities.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn t21_with_a_quarter_of_commands_lost_emotions_do_better_than_repeated_calls_alone() {
    let arms = arms(0.25);
    let empty_s = |arm| mean(&arms[arm].empty_s);
    let (affect, timer) = (empty_s("affect only"), empty_s("timer repeat"));

    // What each is worth where both can do the same is an experiment: `docs/experiments.md`.
    assert!(affect < timer, "{affect} s, and {timer} s with the timer");
    assert!(
        timer < empty_s("affectless"),
        "a timer is better than nothing"
    );
}

/// Every event of a run in which the robots act in this order.
fn events_in_order(order: [&str; 3]) -> Vec<Event> {
    let run = RunName::new("order").unwrap();
    let mut simulation =
        Simulation::new(scenario(THREE, 5, &["network.commands={ loss = 0.1 }"]), 1).unwrap();
    let runners = order.map(|class| {
        let name = class.parse().unwrap();
        let robot = robots::make(class).unwrap();
        simulation.list_bodies(&name, robot.senses_bodies());
        let welcome = simulation.welcome(&run, &name, 1, None).unwrap();
        (robot, welcome)
    });
    let mut robots = LocalHost::new(runners.into());
    let mut events = simulation.init(&mut robots).unwrap().events.to_vec();
    for _ in 0..simulation.scenario().ticks {
        events.extend(simulation.step(&mut robots).unwrap().events.to_vec());
    }

    events
}

#[test]
fn t25_the_order_in_which_robots_act_changes_no_event() {
    let (a, b, c) = ("Butler", "Leguin", "Vonda");
    let straight = events_in_order([a, b, c]);
    println!("{} events", straight.len());
    for order in [[a, c, b], [b, a, c], [b, c, a], [c, a, b], [c, b, a]] {
        assert!(events_in_order(order) == straight, "{order:?}");
    }
}

#[test]
fn the_readable_log_tells_the_story() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "story", "--duration", "300 s"]);
    let log = std::fs::read_to_string(lab.file("story", "cars.log")).unwrap();

    for part in [
        "emotion HAPPY -> CONFIDENT",
        "-> Leguin: refill",
        "behavior WAIT -> REFILL",
        "-> Leguin: go home",
    ] {
        assert!(log.contains(part), "no {part:?} in\n{log}");
    }
}

/// The text that a page shows for a file.
fn shown<'a>(page: &'a str, file: &str) -> &'a str {
    let (_, after) = page.split_once(&format!("**`{file}`**")).unwrap();
    let (_, block) = after.split_once("\n```toml\n").unwrap();
    block.split_once("```").unwrap().0
}

/// Vera, whom `crates/robots/tests/robots/new_robot.rs` plays in memory, started as the page describes.
#[test]
fn the_robot_of_the_documentation_runs_as_a_process() {
    let (lab, page) = (
        Lab::new(),
        std::fs::read_to_string(root().join("docs/new-robot.md")).unwrap(),
    );

    for folder in ["configs", "launch"] {
        std::fs::create_dir(lab.out().join(folder)).unwrap();
        let file = format!("{folder}/vera.toml");
        let text = shown(&page, &file);
        let program = programs().join("examples/vera");
        lab.write(
            &file,
            &text.replace("../target/release/examples/vera", program.to_str().unwrap()),
        );
    }

    let launch = lab.out().join("launch/vera.toml");
    lab.ok(&[
        "launch",
        launch.to_str().unwrap(),
        "--speed",
        "max",
        "--no-console",
        "--run",
        "party",
    ]);

    let log = std::fs::read_to_string(lab.file("party", "cars.log")).unwrap();

    for part in [
        "emotion CALM -> SHY",
        "behavior MINGLE -> HIDE",
        "behavior HIDE -> MINGLE",
    ] {
        assert!(log.contains(part), "no {part:?} in\n{log}");
    }
}

/// Numbers of the tests in a folder that are called `tNN_…`.
fn numbers_in(folder: &Path) -> BTreeSet<u32> {
    let mut numbers = BTreeSet::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            numbers.extend(numbers_in(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            let names = text
                .lines()
                .filter_map(|line| line.trim_start().strip_prefix("fn t"));
            numbers.extend(names.filter_map(|name| name.split_once('_')?.0.parse::<u32>().ok()));
        }
    }

    numbers
}

#[test]
fn every_documented_behavior_has_its_test() {
    let folders = [
        "crates/affect/tests",
        "crates/robots/tests",
        "tests/tests/system",
        "crates/cars/tests",
    ];
    let found: BTreeSet<u32> = folders
        .iter()
        .flat_map(|folder| numbers_in(&root().join(folder)))
        .collect();

    assert_eq!(found, (1..=25).collect());
}

/// Where an experiment plays a crash or a hang, no process ends or stops: what comes of it must be the same.
#[test]
fn absences_in_one_process_give_the_run_of_a_launch() {
    let lab = Lab::new();
    let changes = [
        // Lost at once, lost after some ticks, not lost, both at a time, and until after the end of the run.
        "fault=[\
         { robot = \"Leguin\", do = \"crash\", at = \"40 s\", until = \"70 s\" }, \
         { robot = \"Butler\", do = \"hang\", at = \"50 s\", until = \"60 s\" }, \
         { robot = \"Leguin\", do = \"hang\", at = \"80 s\", until = \"81 s\" }, \
         { robot = \"Butler\", do = \"hang\", at = \"90 s\", until = \"90.5 s\" }, \
         { robot = \"Butler\", do = \"hang\", at = \"99.5 s\", until = \"104 s\" }, \
         { robot = \"Leguin\", do = \"crash\", at = \"100 s\", until = \"105 s\" }, \
         { robot = \"Leguin\", do = \"hang\", at = \"110 s\", until = \"200 s\" }]",
        "on_late=continue",
        "lose_after=3",
        "deadline=10 s",
        "duration=120 s",
    ];
    let mut args = vec![
        "launch",
        "launch/hors_doeuvres.toml",
        "--speed",
        "max",
        "--no-console",
    ];
    for change in changes {
        args.extend(["--set", change]);
    }
    lab.start("crash-twice", &args).finish();

    let run = RunName::new("crash-twice").unwrap();
    let mut events = Vec::new();
    lab::run::play(scenario(HALL, 2002, &changes), &run, |_, record| {
        events.extend(
            record
                .lines()
                .map(|line| serde_json::to_value(line).unwrap()),
        );
        Ok(())
    })
    .unwrap();
    let mut launched = lab.events("crash-twice");
    for event in &mut launched {
        event.as_object_mut().unwrap().remove("seal");
    }
    let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count();
    assert_eq!((count("lost"), count("joined")), (5, 8));
    assert_eq!(events.len(), launched.len());
    for (event, launched) in events.iter().zip(&launched) {
        assert_eq!(event, launched);
    }
}
