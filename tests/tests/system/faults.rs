//! Processes that hang, die and come back.

use std::time::{Duration, Instant};

use bus::{Bus, Role};
use nix::sys::signal::Signal;
use protocol::keys::Keys;
use protocol::messages::Clock;
use protocol::{RunName, encode};
use system_tests::processes::{Running, nobody_is_left, send};
use system_tests::stalls::Stalls;
use system_tests::{Lab, PATIENCE, assert_same, has_played, root, side_by_side};

const FILE: &str = "launch/hors_doeuvres.toml";

/// A launch file of Butler and Leguin with something more in Leguin's process.
fn launch_file(lab: &Lab, leguin: &str) -> String {
    let scenario = root().join("configs/hors_doeuvres.toml");
    let text = format!(
        "scenario = {:?}\n[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n\
         [[process]]\nname = \"Leguin\"\ncommand = [\"cars-leguin\"]\n{leguin}\n",
        scenario.display().to_string()
    );
    lab.write("launch.toml", &text).to_str().unwrap().to_owned()
}

/// A launch that has done some ticks, of which Leguin's process, which is returned, is stopped then. It goes on when it is told to
/// `start`: a run that is not paused may have ended by the time its process is stopped.
fn with_leguin_stopped(lab: &Lab, run: &str, duration: &str, more: &[&str]) -> (Running, u32) {
    let mut args = vec!["launch", FILE, "--duration", duration, "--paused"];
    args.extend(more);
    let launch = lab.start(run, &args);
    lab.until_ready(run);
    lab.step(run, 2);

    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    (launch, leguin)
}

#[test]
fn a_stopped_robot_holds_the_clock_costs_nothing_and_changes_nothing() {
    let lab = Lab::new();
    let (mut launch, leguin) = with_leguin_stopped(&lab, "hang", "60 s", &["--speed", "20"]);
    let stopped = Instant::now();
    lab.ctl("hang", &["start"]);
    let said = launch.prints_after("Leguin (", Some(stopped));
    println!(
        "the terminal named whom it waits for after {:?}",
        said - stopped
    );

    // Long enough that its link is given up, too.
    std::thread::sleep(Duration::from_secs(1));
    let (before_s, begun) = (launch.cpu_s(), Instant::now());
    std::thread::sleep(Duration::from_secs(3));
    let share = (launch.cpu_s() - before_s) / begun.elapsed().as_secs_f64();
    println!(
        "all processes together used {:.2} % of a core while the clock was held",
        share * 100.0
    );
    assert!(
        share < 0.02,
        "waiting used {:.1} % of a core",
        share * 100.0
    );

    send(leguin, Signal::SIGCONT);
    launch.finish();
    lab.ok(&["run", FILE, "--run", "no-hang", "--duration", "60 s"]);
    assert_same(
        ("stopped and continued", &lab.bytes("hang")),
        ("undisturbed", &lab.bytes("no-hang")),
    );
    let held = lab.summary("hang")["wall"]["held_up_by"]["Leguin"]["longest_s"]
        .as_f64()
        .unwrap();
    assert!(held > 1.0, "the summary says who held up the run: {held}");
    nobody_is_left("hang");
}

#[test]
fn a_killed_robot_that_is_required_ends_the_launch_with_its_status() {
    let lab = Lab::new();
    let mut launch = lab.start("kill", &["launch", FILE, "--speed", "10"]);
    launch.prints("behavior");
    send(launch.process("cars-leguin"), Signal::SIGKILL);
    let status = launch.wait();
    assert_eq!(status.code(), Some(128 + 9), "{}", launch.printed());
    assert!(launch.printed().contains("Leguin"), "{}", launch.printed());
    nobody_is_left("kill");
    // What was recorded until then is whole: every line is JSON, and the last one ends the run.
    let events = lab.events("kill");
    assert_eq!(events.last().unwrap()["event"], "end");
}

#[test]
fn a_killed_robot_that_is_restarted_takes_part_again() {
    let lab = Lab::new();
    let file = launch_file(&lab, "restart = \"on-failure\"\nbackoff = \"0.1 s\"");
    let mut launch = lab.start(
        "restart",
        &["launch", &file, "--speed", "20", "--duration", "600 s"],
    );
    launch.prints("behavior");
    send(launch.process("cars-leguin"), Signal::SIGKILL);
    launch.prints("Leguin       is back");
    lab.ok(&["ctl", "speed", "max", "--run", "restart"]);
    launch.finish();
    nobody_is_left("restart");
    let events = lab.events("restart");
    let joined = events
        .iter()
        .find(|event| event["event"] == "joined" && event["generation"] == 2);
    assert_eq!(
        joined.expect("the second incarnation joined")["robot"],
        "Leguin"
    );
    assert_eq!(events.last().unwrap()["reason"], "finished");
    assert_eq!(lab.summary("restart")["robots"]["Leguin"]["returns"], 1);
}

#[test]
fn interrupting_a_launch_leaves_nothing_behind() {
    let lab = Lab::new();
    let mut launch = lab.start("interrupt", &["launch", FILE, "--speed", "10"]);
    launch.prints("behavior");
    launch.signal(Signal::SIGINT);
    launch.wait();
    nobody_is_left("interrupt");
    assert_eq!(lab.events("interrupt").last().unwrap()["event"], "end");
}

#[test]
fn a_crash_of_the_simulator_loses_at_most_the_current_tick() {
    let lab = Lab::new();
    let mut launch = lab.start("crash", &["launch", FILE, "--speed", "50"]);
    launch.prints("behavior");
    send(launch.process("cars-sim"), Signal::SIGKILL);
    let status = launch.wait();
    assert!(!status.success(), "{}", launch.printed());
    nobody_is_left("crash");
    let record = lab.bytes("crash");
    lab.ok(&["run", FILE, "--run", "no-crash"]);
    assert!(
        record.ends_with(b"\n") && lab.bytes("no-crash").starts_with(&record),
        "the record is whole"
    );
}

/// A deadline that no robot misses because the machine keeps it waiting.
const PATIENT: &str = "deadline=60 s";

/// Changes the deadline of a run in progress.
fn set_deadline(lab: &Lab, run: &str, deadline: &str) {
    lab.ok(&["ctl", "late", "--deadline", deadline, "--run", run]);
}

#[test]
fn on_late_abort_ends_the_run_and_on_late_continue_goes_on() {
    let play = |mode: &str, end: &str| {
        let lab = Lab::new();
        let run = format!("late-{mode}");
        let set = format!("on_late={mode}");
        let args = ["--speed", "20", "--set", &set, "--set", PATIENT];
        let (mut launch, leguin) = with_leguin_stopped(&lab, &run, "60 s", &args);
        set_deadline(&lab, &run, "0.5 s");
        lab.ctl(&run, &["start"]);
        if mode == "continue" {
            launch.prints("missed the tick");
            send(leguin, Signal::SIGCONT);
        }
        let status = launch.wait();
        let has_finished = has_played(status, &launch.folder);
        assert_eq!(has_finished, mode == "continue", "{}", launch.printed());
        let events = lab.events(&run);
        assert_eq!(
            events.last().unwrap()["reason"],
            end,
            "{}",
            launch.printed()
        );
        nobody_is_left(&run);
    };
    side_by_side(&[
        ("abort", &|| play("abort", "aborted")),
        ("continue", &|| play("continue", "finished")),
    ]);
}

#[test]
fn each_robot_can_have_its_own_rule_and_a_lost_one_returns() {
    let lab = Lab::new();
    let args = [
        "--speed",
        "20",
        "--set",
        "robot.Leguin.on_late=continue",
        "--set",
        PATIENT,
        "--set",
        "lose_after=3",
    ];
    let (mut launch, leguin) = with_leguin_stopped(&lab, "late-own", "300 s", &args);
    // Three of them are over long before the lease of her link, which would lose her, too.
    set_deadline(&lab, "late-own", "0.1 s");
    lab.ctl("late-own", &["start"]);
    launch.prints("is lost");
    set_deadline(&lab, "late-own", "60 s");
    send(leguin, Signal::SIGCONT);
    launch.prints("Leguin       is back");
    // Otherwise a machine that stands still for longer than the lease of a link loses her again.
    let wait = ["ctl", "late", "wait", "--robot", "Leguin"];
    lab.ok(&[&wait[..], &["--run", "late-own"]].concat());
    lab.ok(&["ctl", "speed", "max", "--run", "late-own"]);
    launch.finish();
    let events = lab.events("late-own");
    let of = |kind: &str| -> Vec<u64> {
        let own = events
            .iter()
            .filter(|event| event["event"] == kind && event["robot"] == "Leguin");
        own.map(|event| event["tick"].as_u64().unwrap()).collect()
    };
    let (missed, lost, joined) = (of("missed"), of("lost"), of("joined"));
    assert_eq!(lost.len(), 1, "{lost:?}");
    assert!(
        missed.len() >= 3 && missed[2] == lost[0],
        "lost after three in a row: {missed:?} {lost:?}"
    );
    assert!(
        joined.len() == 2 && joined[1] > lost[0],
        "it returned: {joined:?}"
    );
    // It missed every tick in between, and none after.
    assert_eq!(*missed.last().unwrap() + 1, joined[1]);
    assert_eq!(missed.len() as u64, joined[1] - missed[0]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_that_is_stuck_does_not_freeze_the_others() {
    let lab = Lab::new();
    let set = [
        "--set",
        "on_late=continue",
        "--set",
        "deadline=0.1 s",
        "--set",
        "lose_after=2",
    ];
    let mut args = vec!["launch", FILE, "--speed", "10", "--duration", "20000 s"];
    args.extend(set);
    let mut launch = lab.start("late-stuck", &args);
    launch.prints("behavior");
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    launch.prints("is lost");
    // From here on it is sent a clock a tick, which it never reads.
    lab.ok(&["ctl", "speed", "max", "--run", "late-stuck"]);
    launch.finish();
    let events = lab.events("late-stuck");
    assert_eq!(events.last().unwrap()["reason"], "finished");
    assert_eq!(lab.summary("late-stuck")["ticks"], 40_000);
    nobody_is_left("late-stuck");
}

#[test]
fn what_the_clock_does_about_late_robots_changes_while_it_is_held() {
    let lab = Lab::new();
    let (mut launch, _) = with_leguin_stopped(&lab, "late-change", "60 s", &["--speed", "20"]);
    lab.ctl("late-change", &["start"]);
    launch.prints("waiting for");
    let status = lab.ok(&["ctl", "status", "--run", "late-change"]);
    assert!(status.contains("Leguin"), "{status}");
    let (code, text) = lab.fails(&[
        "ctl",
        "late",
        "continue",
        "--robot",
        "Nobody",
        "--run",
        "late-change",
    ]);
    assert!(
        code == 1 && text.contains("no robot of this run is called Nobody"),
        "{text}"
    );
    lab.ok(&[
        "ctl",
        "late",
        "continue",
        "--deadline",
        "0.1 s",
        "--run",
        "late-change",
    ]);
    launch.prints("is lost");
    launch.finish();
    assert_eq!(
        lab.events("late-change").last().unwrap()["reason"],
        "finished"
    );
    nobody_is_left("late-change");
}

#[test]
fn a_quiet_launch_prints_no_log_also_where_the_scenario_has_faults() {
    let lab = Lab::new();
    let mut args = vec!["launch", FILE, "--run", "quiet", "--no-console", "--quiet"];
    args.extend(["--speed", "max", "--duration", "60 s"]);
    args.extend(["--set", "on_late=continue", "--set"]);
    args.push(r#"fault=[{ robot = "Leguin", do = "crash", at = "20 s", until = "30 s" }]"#);
    let output = lab.cars(&args).output().unwrap();

    let printed = String::from_utf8_lossy(&output.stdout);
    assert_eq!(printed, "");
    let log = std::fs::read_to_string(lab.file("quiet", "cars.log")).unwrap();
    assert!(log.contains("Leguin"), "{log}");
}

#[test]
fn a_crash_of_the_scenario_happens_at_its_tick_and_is_the_same_every_time() {
    let lab = Lab::new();
    let fault = "fault=[{ robot = \"Leguin\", do = \"crash\", at = \"40 s\", until = \"70 s\" }]";
    // The clock waits for the robot that is gone until the deadline, in real time. It is long enough that no load of the
    // machine makes the other robot miss it.
    let set = [
        "--set",
        fault,
        "--set",
        "on_late=continue",
        "--set",
        "deadline=10 s",
    ];
    let play = |run: &str| {
        let mut args = vec!["launch", FILE, "--speed", "max", "--duration", "120 s"];
        args.extend(set);
        lab.start(run, &args).finish();
        nobody_is_left(run);
    };
    side_by_side(&[
        ("fault-crash", &|| play("fault-crash")),
        ("fault-again", &|| play("fault-again")),
    ]);
    assert_same(
        ("once", &lab.bytes("fault-crash")),
        ("again", &lab.bytes("fault-again")),
    );
    let events = lab.events("fault-crash");
    let of = |kind: &str| -> Vec<u64> {
        let own = events
            .iter()
            .filter(|event| event["event"] == kind && event["robot"] == "Leguin");
        own.map(|event| event["tick"].as_u64().unwrap()).collect()
    };
    assert_eq!(
        (of("fault"), of("lost"), of("joined")),
        (vec![80, 140], vec![80], vec![0, 140])
    );
    assert_eq!(of("missed"), (80..140).collect::<Vec<_>>());
    assert_eq!(lab.summary("fault-crash")["robots"]["Leguin"]["returns"], 1);
}

/// Plays the hall several times side by side with Leguin stopped at 10 s, and demands the same record of all. The lease of her
/// token and the deadline end in the middle of the hang. The deadline is so long, and Butler has none, because otherwise a
/// machine that stands still makes a robot miss a tick. Returns the events of one run.
fn play_hang(run: &str, end: &str, lose_after: u32) -> Vec<serde_json::Value> {
    const REPETITIONS: usize = 4;
    let lab = Lab::new();
    let fault = format!("fault=[{{ robot = \"Leguin\", do = \"hang\", at = \"10 s\"{end} }}]");
    let lose_after = format!("lose_after={lose_after}");
    let runs: Vec<String> = (1..=REPETITIONS)
        .map(|repetition| format!("{run}-{repetition}"))
        .collect();
    let play = |run: &str| {
        let args = [
            "launch",
            FILE,
            "--speed",
            "6",
            "--duration",
            "60 s",
            "--set",
            &fault,
            "--set",
            "on_late=continue",
            "--set",
            "robot.Butler.on_late=wait",
            "--set",
            "deadline=5 s",
            "--set",
            &lose_after,
        ];
        lab.start(run, &args).finish();
        nobody_is_left(run);
    };
    std::thread::scope(|scope| {
        for run in &runs {
            scope.spawn(|| play(run));
        }
    });

    for run in &runs[1..] {
        assert_same((&runs[0], &lab.bytes(&runs[0])), (run, &lab.bytes(run)));
    }
    lab.events(&runs[0])
}

/// The ticks of the events of this kind that name Leguin.
fn ticks_of_leguin(events: &[serde_json::Value], kind: &str) -> Vec<u64> {
    events
        .iter()
        .filter(|event| event["event"] == kind && event["robot"] == "Leguin")
        .map(|event| event["tick"].as_u64().unwrap())
        .collect()
}

/// A robot whose process the scenario stops is lost by the count of its missed ticks: lease and deadline are wall clock and
/// decide nothing.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_hang_of_the_scenario_loses_the_robot_at_the_same_tick_whatever_the_lease_does() {
    let events = play_hang("fault-lease", "", 70);
    let of = |kind| ticks_of_leguin(&events, kind);
    assert_eq!(
        (of("fault"), of("lost"), of("joined")),
        (vec![20], vec![89], vec![0])
    );
    assert_eq!(of("missed"), (20..=120).collect::<Vec<_>>());
}

/// Plays a hang from 10 s to `until_s`. Leguin returns at its end as a further incarnation, whether the hang has lost her or
/// not, and reports every tick from then on.
fn returns_from_hang(until_s: u64, lose_after: u32) {
    let run = format!("fault-return-{until_s}-{lose_after}");
    let events = play_hang(&run, &format!(", until = \"{until_s} s\""), lose_after);
    let of = |kind| ticks_of_leguin(&events, kind);
    let until = 2 * until_s;
    let lost = 20 + u64::from(lose_after) - 1;
    let expected_lost: Vec<u64> = (lost < until).then_some(lost).into_iter().collect();

    assert_eq!(
        (of("fault"), of("lost"), of("joined")),
        (vec![20, until], expected_lost, vec![0, until])
    );
    assert_eq!(of("missed"), (20..until).collect::<Vec<_>>());
    let last = events.last().unwrap();
    assert_eq!(
        (last["reason"].as_str(), last["tick"].as_u64()),
        (Some("finished"), Some(120))
    );
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_that_returns_from_a_hang_of_the_scenario_does_the_same_every_time() {
    side_by_side(&[
        ("after it was lost", &|| returns_from_hang(50, 70)),
        ("without having been lost", &|| returns_from_hang(50, 100)),
    ]);
}

/// Its link has not been given up.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_that_returns_from_a_short_hang_does_the_same_every_time() {
    returns_from_hang(14, 70);
}

/// Robots ask the simulator which epoch it is, and go on where they were.
#[test]
fn stray_clocks_of_a_later_epoch_change_nothing() {
    let lab = Lab::new();
    let run = "stray-clocks";
    let args = ["launch", FILE, "--duration", "60 s", "--speed", "20"];
    let mut launch = lab.start(run, &args);
    launch.prints("behavior");
    let endpoint = std::fs::read_to_string(lab.file(run, "endpoint")).unwrap();
    let role = Role::Client {
        connect: endpoint.trim().to_owned(),
        patience: PATIENCE,
    };
    let bus = Bus::open(&role, None).unwrap();
    let key = Keys::new(&RunName::new(run).unwrap()).clock();
    for tick in 0..20 {
        let clock = Clock {
            epoch: 9,
            tick,
            ..Clock::default()
        };
        bus.put(&key, encode(&clock)).unwrap();
        std::thread::sleep(Duration::from_millis(50)); // So that they meet robots in many states.
    }
    bus.close();

    launch.finish();
    lab.ok(&["run", FILE, "--run", "no-strays", "--duration", "60 s"]);
    assert_same(
        ("with stray clocks", &lab.bytes(run)),
        ("without", &lab.bytes("no-strays")),
    );
    nobody_is_left(run);
}

#[test]
fn where_the_clock_waits_hanging_and_slow_processes_change_nothing_in_the_record() {
    let lab = Lab::new();
    let faults = "fault=[{ robot = \"Leguin\", do = \"hang\", at = \"10 s\", for = \"1 s\" }, \
                  { robot = \"Butler\", do = \"slow\", at = \"20 s\", until = \"22 s\" }]";
    lab.start(
        "fault-hang",
        &[
            "launch",
            FILE,
            "--speed",
            "max",
            "--duration",
            "40 s",
            "--set",
            faults,
        ],
    )
    .finish();
    lab.ok(&["run", FILE, "--run", "fault-none", "--duration", "40 s"]);
    // Without the seals, too: they cover the lines that tell of the faults.
    let without_faults = |run: &str| -> Vec<u8> {
        let events = lab.events(run).into_iter();
        let lines = events
            .filter(|event| event["event"] != "fault")
            .map(|mut event| {
                event.as_object_mut().unwrap().remove("seal");
                format!("{event}\n")
            });
        lines.collect::<String>().into_bytes()
    };
    assert_same(
        ("with", &without_faults("fault-hang")),
        ("without", &without_faults("fault-none")),
    );
    let held = &lab.summary("fault-hang")["wall"]["held_up_by"];
    assert!(
        held["Leguin"]["longest_s"].as_f64().unwrap() > 0.5,
        "{held}"
    );
    nobody_is_left("fault-hang");
}

#[test]
fn impossible_faults_are_refused_where_they_stand() {
    let lab = Lab::new();
    for (fault, reason) in [
        (
            "{ robot = \"Nobody\", do = \"crash\", at = \"4 s\", for = \"1 s\" }",
            "called Nobody",
        ),
        (
            "{ robot = \"Leguin\", do = \"melt\", at = \"4 s\" }",
            "melt",
        ),
        (
            "{ robot = \"Leguin\", do = \"crash\", at = \"4 s\" }",
            "for ever",
        ),
        (
            "{ robot = \"Leguin\", do = \"hang\", at = \"4 s\", until = \"5 s\" }",
            "for ever",
        ),
        (
            "{ robot = \"Leguin\", do = \"hang\", at = \"4 s\", until = \"5 s\", for = \"1 s\" }",
            "say one",
        ),
        (
            "{ robot = \"Leguin\", do = \"slow\", at = \"4 s\", until = \"3 s\" }",
            "before it begins",
        ),
    ] {
        let set = format!("fault=[{fault}]");
        let (_, text) = lab.fails(&["launch", FILE, "--set", &set]);
        assert!(text.contains(reason), "{fault}: {text}");
    }
    let goes_on = "robot.Leguin.on_late=continue";
    let slow = "fault=[{ robot = \"Leguin\", do = \"slow\", at = \"4 s\", until = \"5 s\" }]";
    let (_, text) = lab.fails(&["run", FILE, "--set", slow, "--set", goes_on]);
    assert!(text.contains("cars launch"), "{text}");
    let fault = "fault=[{ robot = \"Leguin\", do = \"hang\", at = \"4 s\", for = \"1 s\" }]";
    let (_, text) = lab.fails(&["launch", FILE, "--set", fault, "--set", goes_on]);
    assert!(text.contains("say `until`"), "{text}");
}

#[test]
fn a_stopped_simulator_is_named_while_it_is_stopped_and_afterwards() {
    let lab = Lab::new();
    let args = ["launch", FILE, "--speed", "20", "--duration", "60 s"];
    let mut launch = lab.start("sim-stopped", &args);
    launch.prints("behavior");

    let simulator = launch.process("cars-sim");
    send(simulator, Signal::SIGSTOP);
    launch.prints("simulator is stopped");
    std::thread::sleep(Duration::from_secs(1));
    send(simulator, Signal::SIGCONT);
    launch.prints("simulator runs again");
    launch.prints("process did not run for");
    launch.finish();

    lab.ok(&[
        "run",
        FILE,
        "--duration",
        "60 s",
        "--run",
        "sim-undisturbed",
    ]);
    assert_same(
        ("stopped", &lab.bytes("sim-stopped")),
        ("undisturbed", &lab.bytes("sim-undisturbed")),
    );
}

/// What robots answered before the stop, or in it, arrives after the deadline: they are not late. A machine that stands still
/// keeps the robots waiting, too: then it is tried again.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_stopped_simulator_misses_no_robot() {
    const ATTEMPTS: usize = 5;
    let lab = Lab::new();
    for attempt in 1..=ATTEMPTS {
        let (late, is_disturbed) = stop_simulator(&lab, &format!("sim-stops-{attempt}"));
        if late == 0 {
            return;
        }
        assert!(is_disturbed, "{late} robots were late");
    }
    panic!("this machine stood still in each of {ATTEMPTS} attempts");
}

/// Stops the simulator of a run several times. Returns how often a robot was late, and whether the machine stood still.
fn stop_simulator(lab: &Lab, run: &str) -> (usize, bool) {
    const STOPS: usize = 4;
    const DEADLINE: Duration = Duration::from_millis(700);
    // Shorter than the lease of a link, which would lose every robot.
    const STOP: Duration = Duration::from_millis(1000);

    let deadline = format!("deadline={} s", DEADLINE.as_secs_f64());
    // At this speed a tick is open nearly always.
    let mut args = vec!["launch", FILE, "--speed", "max", "--duration", "1000000 s"];
    args.extend(["--set", "on_late=continue", "--set", &deadline]);
    args.extend(["--set", "record.frames=false"]);
    let stalls = Stalls::watch();
    let mut launch = lab.start(run, &args);
    launch.prints("behavior");
    let simulator = launch.process("cars-sim");
    for _ in 0..STOPS {
        send(simulator, Signal::SIGSTOP);
        std::thread::sleep(STOP);
        send(simulator, Signal::SIGCONT);
        lab.ok(&["ctl", "status", "--run", run]);
    }
    lab.ok(&["ctl", "stop", "--run", run]);
    launch.finish();
    nobody_is_left(run);

    let events = lab.events(run);
    let late = events
        .iter()
        .filter(|event| event["event"] == "missed" || event["event"] == "lost");
    let late = late.count();
    println!(
        "{STOPS} stops, {} ticks, {late} late",
        events.last().unwrap()["tick"]
    );
    (late, stalls.longer_than(DEADLINE / 2) > 0)
}
