//! However `cars exec` ends, its program ends with it.

use std::process::{Command, Stdio};

use nix::sys::signal::Signal;
use system_tests::processes::{Running, find, named, nobody_is_left, send};
use system_tests::{eventually, programs};

use super::stage::{Stage, is_gone, says};

/// A run that is still under way when the test strikes.
const LONG: &[&str] = &["--speed", "10", "--duration", "600 s"];

const PID: &str = "if is init; then echo $$ > pid; fi";

#[test]
fn sigterm_ends_the_program_in_order() {
    let stage = Stage::each_tick(PID, "");
    let mut launch = stage.start("exec-term", LONG);
    let program = stage.written("pid");
    send(robot("exec-term"), Signal::SIGTERM);
    launch.wait();
    is_gone(&program);
    let log = stage.log("exec-term");
    assert!(
        log.contains("Leguin: end {\"type\":\"end\",\"reason\":\"interrupted\"}"),
        "{log}"
    );

    says(&launch, &["Leguin ended with exit status 143"]);
    nobody_is_left("exec-term");
}

#[test]
fn killing_the_launch_leaves_nobody() {
    let stage = Stage::each_tick(PID, "");
    let mut launch = stage.start("exec-launch-killed", LONG);
    let program = stage.written("pid");
    launch.signal(Signal::SIGKILL);
    launch.wait();
    is_gone(&program);
    nobody_is_left("exec-launch-killed");
}

#[test]
fn a_program_that_hears_nothing_is_killed() {
    // It hangs in the middle of tick 3, reads nothing, ignores the signal, and has a child.
    let hang =
        "if is tick; then trap '' TERM; sleep 600 & echo $! > child; while :; do sleep 1; done; fi";
    let stage = Stage::each_tick(&format!("{PID}\n{hang}"), "");
    let mut launch = stage.start("exec-deaf", LONG);
    let (program, child) = (stage.written("pid"), stage.written("child"));
    send(robot("exec-deaf"), Signal::SIGTERM);
    launch.wait();
    says(&launch, &["Leguin ended with exit status 143"]);
    is_gone(&program);
    is_gone(&child);
    nobody_is_left("exec-deaf");
}

#[test]
fn interrupting_the_launch_leaves_nobody() {
    let stage = Stage::each_tick(PID, "");
    let mut launch = stage.start("exec-interrupt", LONG);
    let program = stage.written("pid");
    launch.signal(Signal::SIGINT);
    launch.wait();
    is_gone(&program);
    assert!(
        !stage.log("exec-interrupt").contains("gives up"),
        "{}",
        stage.log("exec-interrupt")
    );

    nobody_is_left("exec-interrupt");
}

#[test]
fn a_program_does_not_outlive_a_robot_that_is_killed_or_never_gets_in() {
    for (signal, code) in [
        (Signal::SIGKILL, None),
        (Signal::SIGTERM, Some(143)),
        (Signal::SIGINT, Some(130)),
    ] {
        // Nobody listens there: it tries for its patience. And it reads nothing.
        let run = format!("exec-alone-{}", signal as i32);
        let stage = Stage::new("echo $$ > pid; while :; do sleep 1; done", "");
        let mut command = Command::new(programs().join("cars"));
        command.args([
            "exec",
            "--name",
            "Leguin",
            "--run",
            &run,
            "--connect",
            "tcp/127.0.0.1:1",
            "--patience-s",
            "80",
            "--",
        ]);
        command
            .arg(stage.lab.out().join("leguin.sh"))
            .stdin(Stdio::null());
        let mut alone = Running::start(command, &run, stage.lab.out().join(&run));
        let program = stage.written("pid");
        alone.signal(signal);
        assert_eq!(alone.wait().code(), code, "{}", alone.printed());
        is_gone(&program);
    }
}

#[test]
fn an_incarnation_that_takes_over_is_told_what_the_last_one_reported() {
    let stage = Stage::new(
        r#"
        while hear; do
            if is end; then exit 0; fi
            if is init; then
                echo $$ > pid; echo "$json" >&2
                # A robot that takes over answers the tick that follows.
                case $json in *'"tick":0,'*) ;; *) hear; echo "$json" >&2 ;; esac
            fi
            say '{"type":"done","state_variables":{"steps":7}}'
        done"#,
        "restart = \"on-failure\"\nbackoff = \"0.1 s\"",
    );
    let mut launch = stage.start("exec-return", LONG);
    let program = stage.written("pid");
    eventually("a few ticks", || {
        (stage.lab.bytes("exec-return").len() > 2000).then_some(())
    });
    send(program.parse().unwrap(), Signal::SIGKILL);
    launch.prints("Leguin       is back");
    let speed = ["ctl", "speed", "max", "--run", "exec-return"];
    stage.lab.ok(&speed);
    launch.finish();
    let log = stage.log("exec-return");
    assert!(log.contains("its program was ended by SIGKILL"), "{log}");
    let lines: Vec<&str> = log
        .lines()
        .skip_while(|line| !line.contains("\"generation\":2,"))
        .collect();
    assert!(
        lines[0].contains("\"last_state_variables\":{\"steps\":7.0}"),
        "{log}"
    );
    assert!(lines[0].contains("\"stream\":\"robot/Leguin#2\""), "{log}");
    let tick = |line: &str| {
        let (_, rest) = line.split_once("\"tick\":").unwrap();
        rest.split([',', '}']).next().unwrap().to_owned()
    };
    assert_eq!(tick(lines[0]), tick(lines[1]), "{log}");
    assert_ne!(tick(lines[0]), "0", "{log}");
    nobody_is_left("exec-return");
}

/// The process of `cars exec` itself, and not its program.
fn robot(run: &str) -> u32 {
    let found = eventually("cars exec", || named(run, "Leguin"));
    assert!(
        find(run)
            .iter()
            .any(|(pid, program)| *pid == found && program == "cars")
    );
    found
}
