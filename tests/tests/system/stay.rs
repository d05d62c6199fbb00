//! A launch that stays when its run is over, and a console that is killed.

use std::io::{Read, Write};
use std::net::TcpStream;

use nix::sys::signal::Signal;
use system_tests::processes::{Running, nobody_is_left, send};
use system_tests::{Lab, assert_same, eventually};

const FILE: &str = "launch/hors_doeuvres.toml";

fn phase(lab: &Lab, run: &str) -> (String, u64) {
    let status = lab.ctl(run, &["status"]);
    let phase = status["phase"].as_str().unwrap().to_owned();
    (phase, status["epoch"].as_u64().unwrap())
}

fn until_ended(lab: &Lab, run: &str, epoch: u64) {
    eventually("the end", || {
        (phase(lab, run) == ("ended".to_owned(), epoch)).then_some(())
    });
}

#[test]
fn a_launch_that_stays_plays_the_next_run_with_the_same_processes_and_ctrl_c_ends_it() {
    let lab = Lab::new();
    let run = "stay-always";
    let args = [
        "launch",
        FILE,
        "--no-console",
        "--stay",
        "--duration",
        "30 s",
    ];
    let mut launch = lab.start(run, &args);
    eventually("the simulator", || {
        lab.file(run, "endpoint").exists().then_some(())
    });
    until_ended(&lab, run, 1);
    let processes = launch.processes();
    let first = lab.bytes(run);
    assert!(first.ends_with(b"\n") && lab.events(run).last().unwrap()["event"] == "end");
    assert!(lab.ok(&["verify", run]).contains("60 ticks to the end"));
    let (_, said) = lab.fails(&["ctl", "start", "--run", run]);
    assert!(said.contains("the run is ended"), "{said}");

    lab.ctl(run, &["init"]);
    eventually("the next epoch", || {
        (phase(&lab, run) == ("ready".to_owned(), 2)).then_some(())
    });
    assert!(!lab.file(run, "summary.json").exists());
    lab.ctl(run, &["start"]);
    until_ended(&lab, run, 2);
    assert_eq!(launch.processes(), processes);
    assert_same(("first", &first), ("second", &lab.bytes(run)));
    assert!(lab.file(run, "summary.json").exists());
    assert!(lab.file(run, "events-epoch1.jsonl").exists());

    launch.signal(Signal::SIGINT);
    let status = launch.wait();
    assert_eq!(status.code(), Some(130), "{}", launch.printed());
    nobody_is_left(run);
    let verified = lab.ok(&["verify", run]);
    assert!(verified.contains("epoch 1: the same") && verified.contains("epoch 2: the same"));
}

#[test]
fn stop_ends_a_launch_that_stays_and_without_a_browser_it_ends_by_itself() {
    let lab = Lab::new();
    let run = "stay-stopped";
    let mut launch = lab.start(run, &["launch", FILE, "--stay", "--duration", "5 s"]);
    launch.prints("the run is over, and its processes stay");
    lab.ctl(run, &["stop"]);
    launch.finish();
    nobody_is_left(run);

    let run = "stay-alone";
    lab.start(run, &["launch", FILE, "--duration", "5 s"])
        .finish();
    nobody_is_left(run);
}

/// The address that the console of a launch has printed, with its token.
fn address(launch: &mut Running) -> String {
    launch.prints("console: http://");
    let printed = launch.printed();
    let (_, address) = printed.split_once("console: http://").unwrap();
    address.split_whitespace().next().unwrap().to_owned()
}

/// The first line of the answer to a request for an address with a token; `None` if nobody answers.
fn ask(address: &str) -> Option<String> {
    let (host, path) = address.split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).ok()?;
    let request = format!("GET /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    answer.lines().next().map(str::to_owned)
}

#[test]
fn a_console_that_is_killed_comes_back_at_its_address_with_its_token() {
    let lab = Lab::new();
    let run = "console-killed";
    let file = root_file(&lab);
    let mut launch = lab.start(run, &["launch", &file, "--paused"]);
    lab.until_ready(run);
    let address = address(&mut launch);
    assert!(ask(&address).unwrap().contains("303"));
    let first = launch.process("cars-console");
    send(first, Signal::SIGKILL);
    launch.prints("restarting console");
    eventually("the console", || {
        ask(&address)?.contains("303").then_some(())
    });
    assert_ne!(launch.process("cars-console"), first);
    let kept = lab.file(run, "logs/console.kept");
    let mode = std::os::unix::fs::PermissionsExt::mode(&kept.metadata().unwrap().permissions());
    assert_eq!(
        mode & 0o777,
        0o600,
        "the file with the token is its owner's"
    );
    lab.ctl(run, &["stop"]);
    launch.finish();
    nobody_is_left(run);
}

/// A launch file with a console at a port of its own.
fn root_file(lab: &Lab) -> String {
    let scenario = system_tests::root().join("configs/hors_doeuvres.toml");
    let text = format!(
        "scenario = {:?}\n[console]\nbind = \"127.0.0.1:0\"\n[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n\
         [[process]]\nname = \"Leguin\"\ncommand = [\"cars-leguin\"]\n",
        scenario.display().to_string()
    );
    lab.write("launch.toml", &text).to_str().unwrap().to_owned()
}
