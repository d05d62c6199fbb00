//! Real links that are really cut: through proxies, between network namespaces, between containers; and a run across
//! three hosts.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use system_tests::network::{Row, has_namespaces, namespaces_of};
use system_tests::processes::{Running, nobody_is_left};
use system_tests::stalls::Stalls;
use system_tests::tools::{lacks_tool, skip};
use system_tests::{Lab, assert_same, programs, root, side_by_side};

const FILE: &str = "launch/hors_doeuvres.toml";
/// A link that is silent for so long is given up (`bus`).
const LEASE: Duration = Duration::from_secs(2);
/// What a loaded machine may take on top of what is promised.
const ROOM: Duration = Duration::from_secs(2);
/// Within this time after healing the clock goes on.
const HEALED: Duration = Duration::from_secs(1);

/// What happens to the link of Leguin a second after the clock first ran.
fn fault(for_s: u64, what: &str) -> String {
    format!("[[link_fault]]\nrobot = \"Leguin\"\nat = \"1 s\"\nfor = \"{for_s} s\"\ndo = {what}\n")
}

/// A plan with nothing but this.
fn plan(lab: &Lab, for_s: u64, what: &str) -> String {
    let file = lab.write("plan.toml", &fault(for_s, what));
    file.to_str().unwrap().to_owned()
}

fn play(lab: &Lab, run: &str, via: &str, plan: &str, more: &[&str]) -> Running {
    let args = [
        "net", "play", FILE, "--plan", plan, "--via", via, "--speed", "10",
    ];
    lab.start(run, &[args.as_slice(), more].concat())
}

/// Checks links of all that they can be made of here, side by side.
fn for_each_via(test: &str, check: impl Fn(&str) + Sync) {
    let by_proxy = || check("proxy");
    let by_namespaces = || check("namespaces");
    let checks: [(&str, &(dyn Fn() + Sync)); 2] =
        [("proxy", &by_proxy), ("namespaces", &by_namespaces)];
    let count = if has_namespaces(test) { 2 } else { 1 };
    side_by_side(&checks[..count]);
}

fn nothing_is_left(run: &str, player: &Running) {
    nobody_is_left(run);
    assert_eq!(
        namespaces_of(player.id()),
        Vec::<String>::new(),
        "namespaces are left"
    );
}

/// `on_late = "wait"`: Leguin is named within the lease, the clock goes on soon after healing, the record is that of a run
/// whose link was never cut.
fn a_cut_changes_nothing(via: &str, cut_s: u64) {
    let (lab, run) = (Lab::new(), format!("cut-{via}-{cut_s}"));
    let plan = plan(&lab, cut_s, "\"cut\"");
    let stalls = Stalls::watch();
    let mut player = play(&lab, &run, via, &plan, &["--duration", "60 s"]);
    let cut = player.prints("the link of Leguin is cut");
    let named = player.prints_after("waiting for Leguin", Some(cut));
    let gone = player.prints_after("Leguin (is gone", Some(cut));
    let healed = player.prints_after("the link of Leguin is whole", Some(cut));
    // The two lines come from two processes: the clock may go on before the healing is printed.
    let went_on = player.prints_after("the clock goes on", Some(gone));
    let named = stalls.time_between(cut, named);
    let gone = stalls.time_between(cut, gone);
    let went_on = stalls.time_between(healed, went_on);
    println!(
        "{via}, {cut_s} s: named after {named:?}, gone after {gone:?}, on {went_on:?} after healing"
    );
    assert!(
        named < LEASE + ROOM && gone < LEASE + ROOM,
        "named after {named:?}, gone after {gone:?}"
    );
    assert!(
        went_on < HEALED + ROOM,
        "the clock went on {went_on:?} after healing"
    );
    player.finish();

    lab.ok(&["run", FILE, "--run", "uncut", "--duration", "60 s"]);
    assert_same(
        ("cut and healed", &lab.bytes(&run)),
        ("never cut", &lab.bytes("uncut")),
    );
    let record = std::fs::read_to_string(lab.file(&run, "links.jsonl")).unwrap();
    let record: Vec<serde_json::Value> = record
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(
        (record[0]["link"].as_str(), record[1]["link"].as_str()),
        (Some("cut"), Some("whole"))
    );
    assert_eq!(
        record[0]["tick"]
            .as_u64()
            .zip(record[1]["tick"].as_u64())
            .map(|(a, b)| b - a <= 1),
        Some(true)
    );
    // The player may be late to cut the link.
    let time_s = |change: usize| record[change]["time_s"].as_f64().unwrap();
    let was_cut_s = time_s(1) - time_s(0);
    let held_s = lab.summary(&run)["wall"]["held_up_by"]["Leguin"]["longest_s"]
        .as_f64()
        .unwrap();
    assert!(
        held_s > was_cut_s - 0.5,
        "the summary names who held up the run: {held_s} s of {was_cut_s} s"
    );
    nothing_is_left(&run, &player);
}

/// The link of Butler was whole: the clock never waited for him, but for what the machine took.
fn assert_butler_is_heard(lab: &Lab, run: &str, stalls: &Stalls) {
    let held = lab.summary(run)["wall"]["held_up_by"]["Butler"]["longest_s"].clone();
    let held_s = held.as_f64().unwrap_or(0.0);
    let most = ROOM + stalls.total();
    assert!(
        held_s < most.as_secs_f64(),
        "{held_s} s, more than {most:?}"
    );
}

/// `on_late = "continue"`: the run goes on without Leguin, and says in its record when she was lost and when she was back.
fn a_cut_loses_a_robot_that_returns(via: &str, cut_s: u64) {
    let (lab, run) = (Lab::new(), format!("lost-{via}-{cut_s}"));
    let plan = plan(&lab, cut_s, "\"cut\"");

    // Twenty ticks a second: the run is still under way when the link has healed.
    let duration = format!("{} s", 10 * (cut_s + 6));
    // The clock waits for Butler, whom the machine may keep waiting for longer than the deadline.
    let set = [
        "--set",
        "robot.Leguin.on_late=continue",
        "--set",
        "deadline=0.5 s",
        "--duration",
        &duration,
    ];
    let stalls = Stalls::watch();
    let mut player = play(&lab, &run, via, &plan, &set);
    let cut = player.prints("the link of Leguin is cut");
    let lost = player.prints_after("Leguin       is lost", Some(cut));
    let healed = player.prints_after("the link of Leguin is whole", Some(cut));
    // She may be back before the other process has printed that her link is whole.
    let back = player.prints_after("Leguin       is back", Some(lost));
    let back = stalls.time_between(healed, back);
    println!("{via}, {cut_s} s: back {back:?} after healing");
    assert!(back < HEALED + ROOM, "back {back:?} after healing");

    player.finish();
    let events = lab.events(&run);
    let tick_of = |what: &str| {
        let of = |event: &&serde_json::Value| event["event"] == what && event["robot"] == "Leguin";
        events
            .iter()
            .rfind(of)
            .and_then(|event| event["tick"].as_u64())
            .expect("it is in the record")
    };
    let (lost, joined) = (tick_of("lost"), tick_of("joined"));
    println!("{via}, {cut_s} s: lost at tick {lost}, back at tick {joined}");
    assert!(lost > 0 && lost < joined);

    assert_butler_is_heard(&lab, &run, &stalls);

    let missed = events.iter().filter(|event| event["event"] == "missed");
    assert!(
        missed.count() as u64 >= joined - lost,
        "every tick without her is recorded"
    );
    // A machine that stands still for about as long as the lease makes both sides give a whole link up.
    let stalls = stalls.longer_than(LEASE / 2) as u64;
    let returns = lab.summary(&run)["robots"]["Leguin"]["returns"].as_u64();
    let returns = returns.expect("a number");
    assert!(
        (1..=1 + stalls).contains(&returns),
        "{returns} returns, {stalls} stalls"
    );

    nothing_is_left(&run, &player);
}

/// Short and long cuts, with the clock that waits and the clock that goes on, in two ways: side by side, because all of
/// them mostly wait.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn links_cut_for_5_s_and_30_s_change_nothing_or_lose_a_robot_that_returns() {
    let mut checks: Vec<(&str, &(dyn Fn() + Sync))> = vec![
        ("proxy, 5 s, wait", &|| a_cut_changes_nothing("proxy", 5)),
        ("proxy, 30 s, wait", &|| a_cut_changes_nothing("proxy", 30)),
        ("proxy, 5 s, continue", &|| {
            a_cut_loses_a_robot_that_returns("proxy", 5);
        }),
        ("proxy, 30 s, continue", &|| {
            a_cut_loses_a_robot_that_returns("proxy", 30);
        }),
    ];

    if has_namespaces("cuts") {
        checks.extend::<[(&str, &(dyn Fn() + Sync)); 4]>([
            ("namespaces, 5 s, wait", &|| {
                a_cut_changes_nothing("namespaces", 5);
            }),
            ("namespaces, 30 s, wait", &|| {
                a_cut_changes_nothing("namespaces", 30);
            }),
            ("namespaces, 5 s, continue", &|| {
                a_cut_loses_a_robot_that_returns("namespaces", 5);
            }),
            ("namespaces, 30 s, continue", &|| {
                a_cut_loses_a_robot_that_returns("namespaces", 30);
            }),
        ]);
    }

    side_by_side(&checks);
}

/// The partition of the scenario itself, on real links: what is simulated elsewhere is a cable here, and with `wait` the
/// record is that of a network that was never cut.
#[test]
fn the_partition_of_a_scenario_is_played_on_real_links() {
    let (lab, run) = (Lab::new(), "partition-on-links");
    let file = "launch/partition.toml";

    // From 120 s to 240 s at this speed: from 2 s to 4 s of the wall clock.
    let mut player = lab.start(
        run,
        &[
            "net",
            "play",
            file,
            "--via",
            "proxy",
            "--speed",
            "60",
            "--duration",
            "300 s",
        ],
    );
    let cut = player.prints("the link of Leguin is cut");
    player.prints_after("waiting for Leguin", Some(cut));
    player.prints_after("the link of Leguin is whole", Some(cut));
    player.finish();
    lab.ok(&[
        "run",
        file,
        "--run",
        "whole",
        "--duration",
        "300 s",
        "--set",
        "network.partition=[]",
    ]);

    assert_same(
        ("cut on real links", &lab.bytes(run)),
        ("never cut", &lab.bytes("whole")),
    );

    nothing_is_left(run, &player);
}

/// Closing a connection that is cut must not keep the simulator from hearing all others (`vendor/zenoh-link-tcp`).
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn several_links_cut_at_once_hold_up_nobody_else() {
    if !has_namespaces("several") {
        return;
    }

    let (lab, run) = (Lab::new(), "several");
    let fault = |robot| {
        format!("[[link_fault]]\nrobot = \"{robot}\"\nat = \"1 s\"\nfor = \"6 s\"\ndo = \"cut\"\n")
    };
    let plan = lab.write("plan.toml", &(fault("Leguin") + &fault("Vonda")));
    let args = [
        "net",
        "play",
        "launch/three_robots.toml",
        "--via",
        "namespaces",
        "--speed",
        "10",
        "--plan",
    ];
    let set = [
        "--set",
        "robot.Leguin.on_late=continue",
        "--set",
        "robot.Vonda.on_late=continue",
        "--set",
        "deadline=0.5 s",
        "--duration",
        "120 s",
    ];
    let stalls = Stalls::watch();
    let mut player = lab.start(
        run,
        &[&args, [plan.to_str().unwrap()].as_slice(), &set].concat(),
    );
    let cut = player.prints("the link of Vonda is cut");
    let healed = player.prints_after("the link of Vonda is whole", Some(cut));

    for robot in ["Leguin", "Vonda"] {
        let lost = player.prints_after(&format!("{robot:<12} is lost"), Some(cut));
        let back = player.prints_after(&format!("{robot:<12} is back"), Some(lost));
        let back = stalls.time_between(healed, back);
        println!("{robot} {back:?} after healing");
        assert!(back < HEALED + ROOM, "{robot} {back:?} after healing");
    }

    player.finish();
    let events = lab.events(run);
    let missed = |robot: &str| {
        events
            .iter()
            .filter(|event| event["event"] == "missed" && event["robot"] == robot)
            .count()
    };

    assert!(missed("Leguin") > 0 && missed("Vonda") > 0);
    assert_butler_is_heard(&lab, run, &stalls);

    nothing_is_left(run, &player);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_slow_a_narrow_and_a_closed_link_change_nothing() {
    let lab = Lab::new();
    lab.ok(&["run", FILE, "--run", "fast", "--duration", "30 s"]);
    let check = |run: &str, what: &str| {
        let plan = lab.write(&format!("{run}.toml"), &fault(1, what));
        let plan = plan.to_str().unwrap();
        let mut player = play(&lab, run, "proxy", plan, &["--duration", "30 s"]);
        player.prints("the link of Leguin is whole");
        player.finish();
        assert_same((run, &lab.bytes(run)), ("fast", &lab.bytes("fast")));
        nothing_is_left(run, &player);
    };

    side_by_side(&[
        ("slow", &|| {
            check("slow", "{ delay = \"20 ms\", jitter = \"10 ms\" }");
        }),
        ("narrow", &|| check("narrow", "{ bandwidth_bps = 200000 }")),
        ("closed", &|| check("closed", "\"close\"")),
    ]);
}

#[test]
fn an_interrupted_play_leaves_nothing_behind() {
    for_each_via("interrupt", |via| {
        let (lab, run) = (Lab::new(), format!("stop-{via}"));
        let plan = plan(&lab, 60, "\"cut\"");
        let mut player = play(&lab, &run, via, &plan, &[]);
        player.prints("the link of Leguin is cut");
        player.signal(Signal::SIGTERM);
        assert!(
            !player.wait().success(),
            "a run that was interrupted did not finish"
        );
        nothing_is_left(&run, &player);
    });
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_killed_play_leaves_nothing_but_what_the_next_one_removes() {
    for_each_via("killed", |via| {
        let (lab, run) = (Lab::new(), format!("killed-{via}"));
        let plan = plan(&lab, 60, "\"cut\"");
        let mut player = play(&lab, &run, via, &plan, &[]);
        player.prints("the link of Leguin is cut");
        player.signal(Signal::SIGKILL);
        player.wait();
        nobody_is_left(&run);
        assert_eq!(lab.events(&run).pop().unwrap()["event"], "end");
        if via == "proxy" {
            return;
        }

        // A process of the play that does not end by itself.
        let left = namespaces_of(player.id());
        assert_eq!(left.len(), 4, "{left:?}");
        let mut stays = Command::new("ip");
        stays.args(["netns", "exec", &left[0], "sleep", "600"]);
        let mut stays = stays.spawn().unwrap();
        let mut next = play(&lab, "next-play", via, &plan, &[]);
        next.prints("the link of Leguin is cut");
        assert!(!stays.wait().unwrap().success(), "it was killed");
        next.signal(Signal::SIGTERM);
        next.wait();
        nothing_is_left("next-play", &player);
        nothing_is_left("next-play", &next);
    });
}

#[test]
fn a_plan_that_cannot_be_played_is_refused_before_anything_starts() {
    let lab = Lab::new();
    let plan = plan(&lab, 1, "{ delay = \"20 ms\" }");
    let (_, text) = lab.fails(&[
        "net",
        "play",
        FILE,
        "--plan",
        &plan,
        "--via",
        "namespaces",
        "--run",
        "never",
    ]);

    assert!(
        text.contains("delay 20ms") && text.contains("--via proxy"),
        "{text}"
    );
    assert!(!lab.out().join("never").exists());
}

/// The simulator on one host, the robots on another, and a router between that is the only way.
fn across_three_hosts(test: &str, router: impl FnOnce(&Row, &Lab) -> Command) {
    let (lab, row) = (Lab::new(), Row::new(test, 3));
    let mut router = Running::start(router(&row, &lab), test, lab.out().join("router"));

    // The documented file, with the one line changed that it says must be.
    let text = std::fs::read_to_string(root().join("configs/zenoh/simulator.json5")).unwrap();
    assert!(text.contains("192.0.2.1"), "the file names the router");

    let config = lab.write("simulator.json5", &text.replace("192.0.2.1", "10.78.0.2"));
    let mut simulator = row.on(0, &programs().join("cars-sim"));
    simulator.args([
        "configs/hors_doeuvres.toml",
        "--duration",
        "60 s",
        "--run",
        test,
        "--out",
    ]);

    simulator
        .arg(lab.out())
        .arg("--zenoh-config")
        .arg(config)
        .current_dir(root());
    let mut simulator = Running::start(simulator, test, lab.out().join(test));
    let mut robots: Vec<Running> = ["cars-butler", "cars-leguin"]
        .map(|program| {
            let mut robot = row.on(2, &programs().join(program));
            robot
                .env("CARS_CONNECT", "tcp/10.78.1.1:7447")
                .env("CARS_RUN", test);
            robot.env(
                "CARS_ZENOH_CONFIG",
                root().join("configs/zenoh/robot.json5"),
            );
            Running::start(robot, test, lab.out().join(program))
        })
        .into();
    let begun = Instant::now();
    simulator.finish();
    robots.iter_mut().for_each(Running::finish);
    println!(
        "{test}: 120 ticks across three hosts in {:?}, start and end included",
        begun.elapsed()
    );
    lab.ok(&[
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "here",
        "--duration",
        "60 s",
    ]);

    assert_same(
        ("across three hosts", &lab.bytes(test)),
        ("in one process", &lab.bytes("here")),
    );

    router.signal(Signal::SIGTERM);
    router.wait();
}

#[test]
fn a_run_across_three_hosts_gives_the_same_record() {
    if !has_namespaces("router") {
        return;
    }

    across_three_hosts("hosts", |row, _| {
        let mut router = row.on(1, &programs().join("cars"));
        router.args([
            "router",
            "--insecure",
            "--listen",
            "tcp/0.0.0.0:7447",
            "--zenoh-config",
        ]);
        router.arg(root().join("configs/zenoh/router.json5"));
        router
    });
}

#[test]
fn a_run_across_three_hosts_by_zenohd_gives_the_same_record() {
    if Command::new("zenohd").arg("--version").output().is_err() {
        // `cars router` runs the same code; this needs what hardly any machine has.
        return skip(
            "zenohd",
            "there is no zenohd here (cargo install zenohd); `cars router` was tried instead",
        );
    }

    if has_namespaces("zenohd") {
        across_three_hosts("zenohd", |row, _| {
            let mut router = row.on(1, Path::new("zenohd"));
            router
                .arg("-c")
                .arg(root().join("configs/zenoh/router.json5"))
                .args(["-l", "tcp/0.0.0.0:7447"]);
            router
        });
    }
}

/// Makes the image `cars:local` from the programs of this build, as docker/Dockerfile says. The error says why that cannot be.
fn image() -> Result<(), String> {
    finished(Command::new("docker").arg("info"))
        .map_err(|error| format!("no docker engine answers: {error}"))?;

    let context = tempfile::tempdir().unwrap();
    let files = context.path().join("cars");
    let mut layout = Command::new(root().join("docker/layout"));
    finished(layout.arg("cars").arg(programs()).arg(files))?;

    let mut build = Command::new("docker");
    build.args(["build", "-q", "-t", "cars:local", "--target", "cars-given"]);
    build.arg("-f").arg(root().join("docker/Dockerfile"));
    finished(build.arg(context.path()))
}

/// Runs a command to its end. The error is why it did not start, or what it printed.
fn finished(command: &mut Command) -> Result<(), String> {
    let output = command
        .output()
        .map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }

    let errors = String::from_utf8_lossy(&output.stderr);
    Err(format!("{command:?}: {}", errors.trim()))
}

#[test]
fn containers_cut_for_5_s_change_nothing() {
    const TEST: &str = "containers";

    if Command::new("docker-compose")
        .arg("version")
        .output()
        .is_err()
        && !Command::new("docker")
            .args(["compose", "version"])
            .output()
            .is_ok_and(|output| output.status.success())
    {
        return skip(
            TEST,
            "there is no docker-compose here (Debian: apt install docker.io docker-compose)",
        );
    }

    if let Err(reason) = image() {
        // `.ci/with-podman` names an engine, which has to work.
        assert!(std::env::var_os("DOCKER_HOST").is_none(), "{reason}");
        return skip(TEST, &reason);
    }

    // The runs of containers are kept in ./runs, so this lab is the current folder, with its own launch and scenario.
    let lab = Lab::new();
    copy_folder(&root().join("configs"), &lab.out().join("configs"));
    let scenario = lab.out().join("configs/hors_doeuvres.toml");
    let text = std::fs::read_to_string(&scenario)
        .unwrap()
        .replace("\"600 s\"", "\"60 s\"");
    std::fs::write(&scenario, text).unwrap();
    let processes = ["Butler", "Leguin"].map(|name| {
        format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars-{}\"]\n",
            name.to_lowercase()
        )
    });
    let launch =
        "scenario = \"configs/hors_doeuvres.toml\"\n[console]\nenabled = false\n".to_owned();
    lab.write("launch.toml", &(launch + &processes.concat()));
    plan(&lab, 5, "\"cut\"");
    let mut command = Command::new(programs().join("cars"));
    command
        .current_dir(lab.out())
        .args(["net", "play", "launch.toml", "--plan", "plan.toml"]);
    command.args(["--via", "compose", "--speed", "10", "--run", "boxes"]);
    let mut player = Running::start(command, "boxes", lab.out().join("runs/boxes"));
    let cut = player.prints("the link of Leguin is cut");
    let gone = player.prints_after("Leguin (is gone", Some(cut));
    let healed = player.prints_after("the link of Leguin is whole", Some(cut));
    let went_on = player.prints_after("the clock goes on", Some(healed));
    println!(
        "containers, 5 s: gone after {:?}, on {:?} after healing",
        gone - cut,
        went_on - healed
    );
    assert!(
        went_on - healed < HEALED + ROOM,
        "the clock went on {:?} after healing",
        went_on - healed
    );

    player.finish();
    lab.ok(&["run", scenario.to_str().unwrap(), "--run", "uncut"]);
    let record = std::fs::read(lab.out().join("runs/boxes/events.jsonl")).unwrap();
    assert_same(
        ("cut and healed", &record),
        ("never cut", &lab.bytes("uncut")),
    );
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy_folder(&from, &to);
        } else {
            std::fs::copy(from, to).unwrap();
        }
    }
}

#[test]
fn the_compose_files_are_valid() {
    let file = root().join("docker-compose.yml");
    let tools: [&[&str]; 3] = [
        &[
            "docker-compose",
            "-f",
            file.to_str().unwrap(),
            "config",
            "-q",
        ],
        &[
            "docker",
            "compose",
            "-f",
            file.to_str().unwrap(),
            "config",
            "-q",
        ],
        &[
            "check-jsonschema",
            "--builtin-schema",
            "vendor.compose-spec",
            file.to_str().unwrap(),
        ],
    ];

    for tool in tools {
        let is_there = match tool[1] {
            "compose" => Command::new("docker").args(["compose", "version"]).output(),
            _ => Command::new(tool[0]).arg("--help").output(),
        };
        if is_there.is_ok_and(|output| output.status.success()) {
            let output = Command::new(tool[0]).args(&tool[1..]).output().unwrap();
            assert!(
                output.status.success(),
                "{tool:?}: {}",
                String::from_utf8_lossy(&output.stderr)
            );
            return;
        }
    }

    lacks_tool(
        "docker-compose.yml",
        "nothing to check it with (Debian: apt install docker-compose; or pip install check-jsonschema)",
    );
}
