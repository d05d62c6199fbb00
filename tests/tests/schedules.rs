//! The real barrier and the real robots' loop over a network inside this process that a seed permutes, delays, repeats
//! and breaks: thousands of schedules a minute, and the same run in all of them.
//!
//! `CARS_SCHEDULES=5000` executes more of them, `CARS_SCHEDULE_SEED=17` one alone.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bus::{Bus, Faults, MemoryNetwork, Traffic};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer, End, StateVariables};
use protocol::random::{Stream, stream, unit};
use protocol::{RobotName, RunName, Tick, decode, encode};
use robot::{Action, BadParameters, Cars, Host, HostOptions, Robot};
use simulator::server::{Event, Options, Server};
use simulator::{RunFolder, Scenario, Summary};
use system_tests::hall::{Hall, scenario};

/// Ticks of every run.
const TICKS: u64 = 40;
/// A schedule that takes longer than this hangs. A command that was lost together with its sender is given up after 10 s.
const PATIENCE: Duration = Duration::from_secs(40);
/// The simulator asks everybody to repeat after this long.
const REPEAT_AFTER: Duration = Duration::from_millis(5);
/// Seeds of the hall: each is another run.
const HALLS: u64 = 4;
/// Schedules at the same time; they mostly wait.
const WORKERS: usize = 12;

/// A hall in which something happens within [`TICKS`]: few treats, eager guests, commands that are repeated.
fn hall(seed: u64) -> Scenario {
    let set = [
        "duration=20 s",
        "guests.count=10",
        "record.log=false",
        "record.frames=false",
        "robot.Butler.params.treat_capacity=6",
        "robot.Butler.params.treat_mean_s=0.5 s",
        "robot.Butler.params.resend=on",
        "robot.Butler.params.resend_s=2 s",
    ];
    let hall = scenario("configs/hors_doeuvres.toml", seed, &set);
    assert_eq!(hall.ticks, TICKS);
    hall
}

/// How bad the network of a schedule is.
fn faults(seed: u64) -> Faults {
    let mut draws = stream(seed, "faults");
    let mut up_to = |most: f64| most * unit(&mut draws);
    Faults {
        pause: Duration::from_micros(if seed.is_multiple_of(2) {
            0
        } else {
            up_to(60.0) as u64
        }),
        nap: up_to(0.02),
        cut: up_to(0.004),
        loss: up_to(0.01),
        duplicate: up_to(0.05),
        longest: Duration::from_secs_f64(up_to(0.003)),
    }
}

/// What is done to a schedule beside the faults of its network.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Harm {
    /// Nothing.
    None,
    /// This robot's process is killed in this tick, before or after it has sent its commands, and another one comes.
    KilledIn(RobotName, Tick, Phase),
    /// The same after so many microseconds.
    KilledAfter(RobotName, u64),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Begin,
    End,
}

/// A robot whose process is killed in the middle of a tick.
struct Mortal {
    robot: Box<dyn Robot>,
    network: Arc<MemoryNetwork>,
    bus: Bus,
    dies: (Tick, Phase),
}

impl Mortal {
    fn live(&self, cars: &Cars<'_>, phase: Phase) {
        if self.dies == (cars.tick(), phase) {
            self.network.kill(&self.bus);
            std::panic::resume_unwind(Box::new("killed"));
        }
    }
}

impl Robot for Mortal {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.robot.init(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.live(cars, Phase::Begin);
        let action = self.robot.tick(cars);
        // At the end of a tick its commands are sent, and its report is not.
        self.live(cars, Phase::End);
        action
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        self.robot.resume(cars, last);
    }
}

/// One run over one network.
struct Schedule {
    network: Arc<MemoryNetwork>,
    scenario: Scenario,
    harm: Harm,
}

/// How a host ended: by itself, or in words why not.
type Ended = Result<End, String>;

impl Schedule {
    fn new(seed: u64, faults: Faults, scenario: Scenario, harm: Harm) -> Self {
        Self {
            network: Arc::new(MemoryNetwork::new(seed, faults)),
            scenario,
            harm,
        }
    }

    /// Executes it, and says how it ended and what the network did.
    fn execute(self) -> (Result<Summary, String>, Traffic) {
        let run = RunName::new("schedule").unwrap();
        let out = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(out.path(), &run);
        let _lock = folder.create(&self.scenario).unwrap();
        let options = Options {
            run: run.clone(),
            speed: None,
            is_paused: false,
            repeat_after: REPEAT_AFTER,
        };
        let server = Server::open(self.network.router(), &self.scenario, options).unwrap();
        let queue = server.queue();
        let hosts: Vec<_> = self
            .scenario
            .roster()
            .into_iter()
            .map(|name| self.host(&run, name))
            .collect();

        let (sender, ended) = channel();
        let scenario = self.scenario.clone();
        let server = std::thread::spawn(move || {
            let _ = sender.send(server.run(scenario, &folder));
        });
        let outcome = match ended.recv_timeout(PATIENCE) {
            Ok(summary) => summary.map_err(|error| error.to_string()),
            Err(RecvTimeoutError::Disconnected) => Err("the simulator panicked".to_owned()),
            Err(RecvTimeoutError::Timeout) => {
                let held = self.awaited(&run);
                let _ = queue.send(Event::Terminate);
                let summary = ended.recv_timeout(PATIENCE);
                let tick = summary
                    .ok()
                    .and_then(Result::ok)
                    .map(|summary| summary.ticks);
                Err(format!("it hangs after tick {tick:?}, {held}"))
            }
        };
        let outcome = outcome.and_then(|summary| match server.join() {
            Ok(()) => Ok(summary),
            Err(_) => Err("the simulator panicked".to_owned()),
        });
        let mut failed = Vec::new();
        for host in hosts {
            match host.join() {
                Ok(Ok(_)) => {}
                Ok(Err(error)) => failed.push(error),
                Err(_) => failed.push("a robot panicked".to_owned()),
            }
        }
        let traffic = self.network.traffic();
        // A robot whose link breaks under the last message of the run cannot know that it was the last.
        let (deaf, failed): (Vec<_>, Vec<_>) = failed
            .into_iter()
            .partition(|error| traffic.cuts > 0 && error.contains("has been gone"));
        let outcome = match outcome {
            Ok(_) if !failed.is_empty() => Err(failed.join("; ")),
            Err(reason) => Err(format!(
                "{reason}; {}",
                failed
                    .into_iter()
                    .chain(deaf)
                    .collect::<Vec<_>>()
                    .join("; ")
            )),
            ok => ok,
        };
        (outcome, traffic)
    }

    /// For whom the clock waits, in the simulator's words.
    fn awaited(&self, run: &RunName) -> String {
        let bus = self.network.router();
        let answer = bus.get(
            &Keys::new(run).control(),
            "",
            Some(encode(&Control::Status)),
        );
        match answer
            .unwrap()
            .map(|answer| decode("control", "simulator", &answer.result.unwrap()))
        {
            Some(Ok(ControlAnswer::Done(status))) => {
                format!("{:?}, {:?}", status.awaiting, status.robots)
            }
            other => format!("{other:?}"),
        }
    }

    /// The process of a robot, and of its successor if it is killed.
    fn host(&self, run: &RunName, name: RobotName) -> JoinHandle<Ended> {
        let class = self.scenario.robots[&name].class.clone();
        let (network, harm) = (self.network.clone(), self.harm.clone());
        let options = HostOptions {
            run: run.clone(),
            connect: "this process".to_owned(),
            patience: Duration::from_secs(4),
            gone_patience: Duration::from_secs(4),
            zenoh_config: None,
        };
        let make = |class: &str| robots::make(class).expect("a shipped class");
        let bus = network.client();
        std::thread::spawn(move || {
            let own = name.clone();
            let live = move |bus: Bus, robot: Box<dyn Robot>| {
                Host::join_over(bus, vec![(own.clone(), robot)], options.clone())
                    .and_then(Host::run)
                    .map_err(|error| format!("{own}: {error}"))
            };
            match harm {
                Harm::KilledIn(victim, tick, phase) if victim == name => {
                    let (network, dies) = (network.clone(), (tick, phase));
                    let mortal = Mortal {
                        robot: make(&class),
                        network: network.clone(),
                        bus: bus.clone(),
                        dies,
                    };
                    let mortal: Box<dyn Robot> = Box::new(mortal);
                    let life = std::panic::AssertUnwindSafe(|| live(bus, mortal));
                    std::panic::catch_unwind(life).expect_err("it is killed");
                    live(network.client(), make(&class))
                }
                Harm::KilledAfter(victim, after_us) if victim == name => {
                    let process = bus.clone();
                    // How it ends interests nobody: it is killed, or the run is over before that.
                    let (first, robot_class) = (live.clone(), class.clone());
                    std::thread::spawn(move || drop(first(bus, make(&robot_class))));
                    std::thread::sleep(Duration::from_micros(after_us));
                    network.kill(&process);
                    live(network.client(), make(&class)).or_else(after_the_end)
                }
                _ => live(bus, make(&class)),
            }
        })
    }
}

/// Who comes when all is over has missed nothing.
fn after_the_end(error: String) -> Ended {
    if error.contains("is over") || error.contains("no simulator") {
        Ok(End::Finished)
    } else {
        Err(error)
    }
}

/// How many schedules, or the only one that is wanted.
fn seeds(default: u64) -> std::ops::Range<u64> {
    let number = |name: &str| {
        std::env::var(name)
            .ok()
            .map(|text| text.parse::<u64>().expect("a number"))
    };
    match number("CARS_SCHEDULE_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("CARS_SCHEDULES").unwrap_or(default),
    }
}

/// Executes a schedule for each seed, several at a time; fails with all seeds whose `judge` finds something.
fn explore<T: Send>(
    test: &str,
    seeds: std::ops::Range<u64>,
    schedule: impl Fn(u64) -> Schedule + Sync,
    judge: impl Fn(u64, Summary) -> Result<T, String> + Sync,
) -> (Vec<T>, Traffic) {
    let (begun, next, first) = (Instant::now(), AtomicU64::new(seeds.start), seeds.start);
    let (found, failed) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let total = Mutex::new(Traffic::default());
    std::thread::scope(|scope| {
        for _ in 0..WORKERS {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if !seeds.contains(&seed) {
                        return;
                    }
                    let schedule = schedule(seed);
                    let harm = schedule.harm.clone();
                    let (outcome, traffic) = schedule.execute();
                    total.lock().unwrap().add(traffic);
                    match outcome.and_then(|summary| judge(seed, summary)) {
                        Ok(one) => found.lock().unwrap().push(one),
                        Err(reason) => {
                            failed.lock().unwrap().push((
                                seed,
                                format!("{harm:?}: {reason}"),
                                traffic,
                            ));
                        }
                    }
                }
            });
        }
    });
    let (count, took_s) = (seeds.end - first, begun.elapsed().as_secs_f64());
    let (found, mut failed, total) = (
        found.into_inner().unwrap(),
        failed.into_inner().unwrap(),
        total.into_inner().unwrap(),
    );
    let rate = count as f64 / took_s * 60.0;
    println!("{test}: {count} schedules in {took_s:.1} s, {rate:.0} a minute; {total:?}");
    failed.sort_by_key(|(seed, ..)| *seed);
    for (seed, reason, traffic) in failed.iter().take(5) {
        println!("seed {seed}: {reason}; {:?}; {traffic:?}", faults(*seed));
        println!(
            "  again: CARS_SCHEDULE_SEED={seed} cargo test --release -p system-tests --test schedules {test} -- --nocapture"
        );
    }
    assert!(
        failed.is_empty(),
        "{} of {count} schedules failed",
        failed.len()
    );
    (found, total)
}

/// Sums what networks did.
trait Add {
    fn add(&mut self, other: Traffic);
}

impl Add for Traffic {
    fn add(&mut self, other: Traffic) {
        self.delivered += other.delivered;
        self.lost += other.lost;
        self.duplicated += other.duplicated;
        self.cuts += other.cuts;
        self.naps += other.naps;
    }
}

/// The digest of a hall whose robots are called directly.
fn digest_without_network(scenario: Scenario) -> String {
    let mut hall = Hall::new(scenario);
    let mut delivered = 0;
    for _ in 0..TICKS {
        let is_delivered =
            |event: &simulator::Event| matches!(event, simulator::Event::CommandDelivered { .. });
        delivered += hall
            .step()
            .iter()
            .filter(|event| is_delivered(event))
            .count();
    }
    assert!(
        delivered > 0,
        "nothing would be shown by a run without commands"
    );
    hall.simulation.digest()
}

fn same(expected: &str, summary: &Summary) -> Result<(), String> {
    if summary.ticks != TICKS || summary.end != Some(End::Finished) {
        return Err(format!(
            "it ended after {} ticks, {:?}",
            summary.ticks, summary.end
        ));
    }
    if summary.digest != expected {
        return Err(format!("digest {} instead of {expected}", summary.digest));
    }
    Ok(())
}

#[test]
fn every_schedule_is_the_same_run() {
    let halls: Vec<Scenario> = (0..HALLS).map(hall).collect();
    let expected: Vec<String> = halls.iter().cloned().map(digest_without_network).collect();
    let of = |seed: u64| (seed % HALLS) as usize;
    let (_, traffic) = explore(
        "every_schedule_is_the_same_run",
        seeds(400),
        |seed| Schedule::new(seed, faults(seed), halls[of(seed)].clone(), Harm::None),
        |seed, summary| same(&expected[of(seed)], &summary),
    );
    let happened = [traffic.lost, traffic.duplicated, traffic.cuts, traffic.naps];
    assert!(
        seeds(400).count() < 100 || happened.iter().all(|count| *count > 0),
        "{traffic:?}"
    );
}

/// Who is killed, and when, by seed: few ways, so that several schedules share each.
fn kill(seed: u64, scenario: &Scenario) -> Harm {
    let names = scenario.roster();
    let mut draws: Stream = stream(seed, "harm");
    let mut one_of = |count: usize| (unit(&mut draws) * count as f64) as usize;
    let tick = [0, 1, 2, 9, 17, 39][one_of(6)];
    let phase = [Phase::Begin, Phase::End][one_of(2)];
    Harm::KilledIn(names[one_of(names.len())].clone(), tick, phase)
}

#[test]
fn a_robot_that_is_killed_and_comes_back_changes_the_run_in_one_way() {
    let halls: Vec<Scenario> = (0..HALLS).map(hall).collect();
    let of = |seed: u64| (seed % HALLS) as usize;
    let harm = |seed: u64| kill(seed, &halls[of(seed)]);
    let (found, _) = explore(
        "a_robot_that_is_killed_and_comes_back_changes_the_run_in_one_way",
        seeds(300),
        |seed| Schedule::new(seed, faults(seed), halls[of(seed)].clone(), harm(seed)),
        |seed, summary| {
            same(&summary.digest, &summary)?;
            Ok(((of(seed), harm(seed)), (summary.digest, seed)))
        },
    );
    let mut runs: BTreeMap<_, BTreeMap<String, Vec<u64>>> = BTreeMap::new();
    for (way, (digest, seed)) in found {
        runs.entry(way)
            .or_default()
            .entry(digest)
            .or_default()
            .push(seed);
    }
    runs.retain(|_, digests| digests.len() > 1);
    assert!(
        runs.is_empty(),
        "the same harm gave different runs (digest, then seeds): {runs:#?}"
    );
}

#[test]
fn a_robot_that_is_killed_at_any_moment_comes_back() {
    let halls: Vec<Scenario> = (0..HALLS).map(hall).collect();
    let of = |seed: u64| (seed % HALLS) as usize;
    explore(
        "a_robot_that_is_killed_at_any_moment_comes_back",
        seeds(200),
        |seed| {
            let scenario = halls[of(seed)].clone();
            let mut draws = stream(seed, "moment");
            let victim = scenario.roster()[(unit(&mut draws) * 2.0) as usize].clone();
            let after_us = (unit(&mut draws) * 25_000.0) as u64;
            Schedule::new(
                seed,
                faults(seed),
                scenario,
                Harm::KilledAfter(victim, after_us),
            )
        },
        |_, summary| same(&summary.digest, &summary),
    );
}
