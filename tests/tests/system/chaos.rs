//! Processes are killed and stopped and their links cut at random, drawn from a seed: nothing hangs, no process is left behind,
//! the record is whole and names whom it happened to. A short version runs always; `CARS_CHAOS=200` plays as many events as
//! it says, `CARS_CHAOS_SEED` others.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use protocol::random::{Stream, stream, unit};
use serde_json::Value;
use system_tests::processes::{Running, find, named, send};
use system_tests::{Lab, eventually, programs};

/// Events of the short version.
const EVENTS: usize = 24;
/// Robots of the launches, in turn.
const ROBOTS: [usize; 4] = [2, 5, 9, 16];
/// Kills of one robot in one launch: below what the launcher takes for a broken program.
const MAX_KILLS: usize = 4;

/// What happens to a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Blow {
    Kill,
    Stop(Duration),
    /// Its link to the simulator; meanwhile other things happen.
    Cut(Duration),
}

/// The link of a robot: a proxy that obeys.
struct Cable {
    proxy: Child,
    /// Its output, which must be read: a program with a closed pipe ends.
    _said: BufReader<ChildStdout>,
    endpoint: String,
    /// When it is to be whole again.
    heals: Option<Instant>,
}

impl Cable {
    fn new(port: u16) -> Self {
        let to = format!("tcp/127.0.0.1:{port}");
        let mut command = Command::new(programs().join("cars"));
        command.args(["net", "proxy", "--listen", "tcp/127.0.0.1:0", "--to", &to]);
        let mut proxy = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (mut line, mut said) = (String::new(), BufReader::new(proxy.stdout.take().unwrap()));
        said.read_line(&mut line).unwrap();
        let address = line
            .strip_prefix("listening at ")
            .and_then(|rest| rest.split(',').next())
            .unwrap();
        let endpoint = format!("tcp/{address}");

        Self {
            proxy,
            _said: said,
            endpoint,
            heals: None,
        }
    }

    fn say(&mut self, order: &str) {
        writeln!(self.proxy.stdin.as_mut().unwrap(), "{order}").unwrap();
    }

    fn cut(&mut self, lasting: Duration) {
        self.say("cut");
        self.heals = Some(Instant::now() + lasting);
    }

    fn heal_by(&mut self, now: Instant) {
        if self.heals.is_some_and(|at| at <= now) {
            self.say("heal");
            self.heals = None;
        }
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.proxy.kill().unwrap();
        self.proxy.wait().unwrap();
    }
}

fn below(chance: &mut Stream, n: usize) -> usize {
    (unit(chance) * n as f64) as usize
}

/// A launch of `n` robots that are restarted, and without which the clock goes on.
fn launch_file(lab: &Lab, n: usize) -> String {
    let mut scenario =
        "seed = 7\nduration = \"100000 s\"\non_late = \"continue\"\ndeadline = \"0.2 s\"\nlose_after = 2\n\
                        record = { frames = false }\n[guests]\ncount = 10\n"
            .to_owned();
    let mut launch =
        "scenario = \"chaos.toml\"\nspeed = 100\n[console]\nenabled = false\n".to_owned();
    for i in 0..n {
        let (x, y) = (2 + 3 * (i % 4), 2 + 3 * (i / 4));
        scenario += &format!(
            "[[robot]]\nname = \"R{i}\"\nclass = \"Vonda\"\nat = [\"{x} m\", \"{y} m\"]\n"
        );
        launch += &format!(
            "[[process]]\nname = \"R{i}\"\ncommand = [\"cars-vonda\"]\nrestart = \"on-failure\"\nbackoff = \"0.05 s\"\n"
        );
    }

    lab.write("chaos.toml", &scenario);

    lab.write("chaos-launch.toml", &launch)
        .to_str()
        .unwrap()
        .to_owned()
}

/// A launch of `n` robots whose clock runs, each with a link of its own.
fn start(lab: &Lab, run: &str, n: usize) -> (Running, Vec<Cable>) {
    let port = TcpListener::bind(("127.0.0.1", 0))
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let cables: Vec<Cable> = (0..n).map(|_| Cable::new(port)).collect();
    let mut args = vec![
        "launch".to_owned(),
        launch_file(lab, n),
        format!("--connect-port={port}"),
    ];
    for (i, cable) in cables.iter().enumerate() {
        args.push(format!("--link=R{i}={}", cable.endpoint));
    }

    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let launch = lab.start(run, &args);
    // Its first lines may have been said before the launcher listened: whether it runs is asked.
    eventually("the clock to run", || {
        let status = status(lab, run)?;
        (status["phase"] == "running").then_some(())
    });
    (launch, cables)
}

/// How a run stands, if it answers.
fn status(lab: &Lab, run: &str) -> Option<Value> {
    let output = lab
        .cars(&["ctl", "status", "--json", "--run", run])
        .output()
        .unwrap();

    serde_json::from_slice(&output.stdout).ok()
}

/// Strikes robots of a launch `count` times; returns whom. In the end all links are whole.
fn strike(run: &str, cables: &mut [Cable], count: usize, chance: &mut Stream) -> BTreeSet<String> {
    let mut kills = vec![0; cables.len()];
    let mut struck = BTreeSet::new();
    for _ in 0..count {
        let robot = below(chance, cables.len());
        cables
            .iter_mut()
            .for_each(|cable| cable.heal_by(Instant::now()));
        let is_cut = cables[robot].heals.is_some();
        let blow = match below(chance, 3) {
            0 if kills[robot] < MAX_KILLS => Blow::Kill,
            // Shorter and longer than the lease of a link.
            1 if !is_cut => Blow::Cut(Duration::from_millis(500 + below(chance, 4000) as u64)),
            _ => Blow::Stop(Duration::from_millis(500 + below(chance, 500) as u64)),
        };
        let name = format!("R{robot}");
        // One that was killed just now is being started again.
        let pid = eventually(&name, || named(run, &name));
        println!("{run}: {name} {blow:?}");
        match blow {
            Blow::Kill => {
                kills[robot] += 1;
                send(pid, Signal::SIGKILL);
                // The next blow is not to strike the one that is dying.
                eventually("it to be gone", || {
                    (named(run, &name) != Some(pid)).then_some(())
                });
            }
            Blow::Stop(lasting) => {
                send(pid, Signal::SIGSTOP);
                std::thread::sleep(lasting);
                send(pid, Signal::SIGCONT);
            }
            Blow::Cut(lasting) => cables[robot].cut(lasting),
        }
        struck.insert(name);
    }

    // One that was cut a moment ago has to be missed before it is back.
    let last = cables
        .iter()
        .filter_map(|cable| cable.heals)
        .max()
        .unwrap_or_else(Instant::now);

    std::thread::sleep(last.saturating_duration_since(Instant::now()));
    cables.iter_mut().for_each(|cable| cable.heal_by(last));

    struck
}

#[test]
fn whatever_befalls_the_robots_the_run_goes_on_and_its_record_is_whole() {
    let events = std::env::var("CARS_CHAOS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(EVENTS);
    let seed = std::env::var("CARS_CHAOS_SEED")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(1);
    let launches = ROBOTS.len().min(events);
    let lab = Lab::new();

    for (index, n) in ROBOTS.iter().take(launches).enumerate() {
        let run = format!("chaos-{index}");
        let (mut launch, mut cables) = start(&lab, &run, *n);
        let mut chance = stream(seed, &run);
        let struck = strike(&run, &mut cables, events / launches, &mut chance);
        // The clock still runs, whichever robots are missing.
        let tick = || status(&lab, &run).unwrap()["tick"].as_u64().unwrap();
        let reached = tick();
        eventually("further ticks", || (tick() > reached + 10).then_some(()));
        lab.ok(&["ctl", "stop", "--run", &run]);
        launch.finish();
        eventually("the last process to be gone", || {
            find(&run).is_empty().then_some(())
        });
        check_record(&lab, &run, &struck);
    }
}

/// Its link is cut when the next epoch begins: it misses tick 0 of it, and joins it later.
#[test]
fn a_robot_that_is_cut_off_while_the_run_is_initialized_returns() {
    let lab = Lab::new();
    let run = "chaos-init";
    let (mut launch, mut cables) = start(&lab, run, 2);
    cables[0].say("cut");
    lab.ok(&["ctl", "init", "--run", run]);
    let status = || status(&lab, run).unwrap();
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
    cables[0].say("heal");
    presence("here");

    let reached = status()["tick"].as_u64().unwrap();
    eventually("further ticks", || {
        (status()["tick"].as_u64().unwrap() > reached + 10).then_some(())
    });
    lab.ok(&["ctl", "stop", "--run", run]);
    launch.finish();
    eventually("the last process to be gone", || {
        find(run).is_empty().then_some(())
    });
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
