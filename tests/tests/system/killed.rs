//! Processes end with their parent, also if it is killed.

use std::io::ErrorKind;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use system_tests::processes::{Running, nobody_is_left};
use system_tests::{Lab, eventually};

/// How long the processes of a killed launcher may take to exit.
const PATIENCE: Duration = Duration::from_secs(10);

#[test]
fn a_killed_launcher_leaves_no_process_no_port_and_a_whole_record() {
    let lab = Lab::new();
    let run = "launcher-killed";
    let mut command = lab.cars(&["launch", "launch/hors_doeuvres.toml", "--speed", "10"]);
    // The simulator prints, also while its standard error has no reader.
    command.args(["--run", run]).env("RUST_LOG", "debug");
    // A port of its own: the usual one may be the console's of another test as soon as this one leaves it.
    command.env("CARS_CONSOLE_BIND", "127.0.0.1:0");
    let mut launch = Running::start(command, run, lab.out().join(run));
    launch.prints("console: http://");
    for program in ["cars-sim", "cars-butler", "cars-leguin", "cars-console"] {
        assert!(launch.process(program) > 0);
    }
    let ports = [port_of_console(&launch), port_of_simulator(&lab, run)];
    eventually("the clock", || {
        let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
        events.contains("\"tick\":5,").then_some(())
    });

    launch.signal(Signal::SIGKILL);
    let killed = Instant::now();
    launch.wait();
    nobody_is_left(run);

    assert!(killed.elapsed() < PATIENCE, "{:?}", killed.elapsed());
    for port in ports {
        // A connection of another test may have the number of the port by now, but nothing listens there.
        let refused = TcpStream::connect(("127.0.0.1", port)).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::ConnectionRefused, "port {port}");
    }
    assert_eq!(lab.events(run).pop().unwrap()["event"], "end");
    assert!(lab.summary(run)["ticks"].as_u64().unwrap() >= 5);
    assert!(!lab.file(run, "endpoint").exists());
}

/// The port in the address that the console prints.
fn port_of_console(launch: &Running) -> u16 {
    let printed = launch.printed();
    let (_, address) = printed.split_once("console: http://127.0.0.1:").unwrap();
    let port: String = address.chars().take_while(char::is_ascii_digit).collect();
    port.parse().unwrap()
}

fn port_of_simulator(lab: &Lab, run: &str) -> u16 {
    let endpoint = eventually("the endpoint", || {
        std::fs::read_to_string(lab.file(run, "endpoint")).ok()
    });
    let (_, port) = endpoint.trim().rsplit_once(':').unwrap();
    port.parse().unwrap()
}
