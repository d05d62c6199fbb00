//! A launch over links of its own, with a plan of faults played on them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::{Duration, SystemTime};

use bus::endpoint::is_tls;
use miette::{IntoDiagnostic, WrapErr, miette};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use protocol::RobotName;
use serde::Serialize;
use simulator::RunFolder;
use simulator::recorder::EVENTS;

use super::compose::Compose;
use super::links::{Links, Start};
use super::namespaces::Namespaces;
use super::plan::Plan;
use super::proxy::{self, Proxy};
use super::shape::Shape;
use crate::endpoint;
use crate::file::{LaunchFile, Process};
use crate::link::Link;
use crate::options::RunOptions;

/// What was done to which link and when, in the folder of the run.
const LINKS: &str = "links.jsonl";
/// The end of a record in which its last line is looked for.
const TAIL_BYTES: u64 = 16 * 1024;
/// How often to look whether the clock has begun to run.
const LOOK_AGAIN: Duration = Duration::from_millis(5);

/// A launch over links of its own, with faults on them.
#[derive(Debug)]
pub struct Play {
    /// The launch file.
    pub file: PathBuf,
    /// The plan of faults; without one the partitions of the scenario are played, and not simulated in addition.
    pub plan: Option<PathBuf>,
    /// What the links are made of.
    pub via: Via,
    /// Options of the execution.
    pub options: RunOptions,
    /// Further arguments of `cars launch`.
    pub launch_args: Vec<String>,
}

/// What links are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Via {
    /// A TCP proxy for each process: cut, close, delay, jitter, bandwidth. Needs nothing.
    Proxy,
    /// A network namespace for each process and a virtual cable to it: cut. Needs root and `ip` (iproute2).
    Namespaces,
    /// A container for each process: cut, by `docker network disconnect`. Needs docker and the image `cars:local`.
    Compose,
}

/// A proxy for each process.
struct Proxies {
    endpoint: String,
    proxies: BTreeMap<String, Proxy>,
}

impl Proxies {
    /// What is encrypted passes a proxy as it is.
    fn new(file: &LaunchFile) -> miette::Result<Self> {
        let port = endpoint::free_port().into_diagnostic()?;
        let endpoint = endpoint::loopback(port, file.secure.is_some());
        let proxy = |process: &Process| Ok((process.name.clone(), proxy::on_loopback(&endpoint)?));
        let proxies = file
            .processes
            .iter()
            .map(proxy)
            .collect::<miette::Result<_>>()?;
        Ok(Self { endpoint, proxies })
    }
}

impl Links for Proxies {
    fn command(&self, start: &Start) -> miette::Result<Command> {
        let is_secured = is_tls(&self.endpoint);
        let link = |(process, proxy): (&String, &Proxy)| Link {
            process: process.clone(),
            endpoint: endpoint::loopback(proxy.address().port(), is_secured),
            namespace: None,
        };
        let links: Vec<Link> = self.proxies.iter().map(link).collect();
        let mut command = Command::new(std::env::current_exe().into_diagnostic()?);
        command
            .args(start.args(&links))
            .arg(format!("--listen={}", self.endpoint));

        Ok(command)
    }

    fn set(&mut self, process: &str, shape: Shape) -> miette::Result<()> {
        self.proxies
            .get(process)
            .map(|proxy| proxy.set(shape))
            .ok_or_else(|| miette!("no link of {process}"))
    }
}

/// Launches, plays the faults, and waits for the end. `report` receives a line for each change of a link. Returns the
/// exit status of the launch.
///
/// # Errors
/// If a file cannot be used, if the links cannot be made, or if a fault cannot be played.
pub fn play(play: &Play, report: impl FnMut(String)) -> miette::Result<u8> {
    let file = LaunchFile::load(&play.file)?;
    let run = play.options.run_name(&play.file).into_diagnostic()?;
    let process_of = process_of(&file);

    let mut options = play.options.clone();
    let plan = match &play.plan {
        Some(plan) => Plan::load(plan, &process_of.keys().cloned().collect())?,
        None => {
            let plan = partitions(&file, &options)?;
            // Containers read the scenario as it is.
            if play.via != Via::Compose {
                let change = WITHOUT_PARTITIONS
                    .parse()
                    .map_err(|error| miette!("{error}"))?;
                options.set.push(change);
            }
            plan
        }
    };

    let start = Start {
        file: &play.file,
        run: &run,
        options: &options,
        more: &play.launch_args,
    };
    let signals = Signals::forward()?;
    let mut links = make_links(play.via, &file, &plan, &start)?;

    let folder = RunFolder::new(&play.options.out, &run);
    let begun = SystemTime::now();
    let mut launch = signals.spawn(links.command(&start)?)?;
    let played = wait_for_clock(&mut launch, &folder.file(EVENTS), begun).and_then(|runs| {
        if runs {
            let stage = Stage {
                plan: &plan,
                process_of: &process_of,
                folder: &folder,
            };
            stage.play(links.as_mut(), &mut launch, report)
        } else {
            Ok(())
        }
    });
    if played.is_err() {
        signals.end();
    }

    let status = launch.wait().into_diagnostic()?;
    played.map(|()| exit_code(status))
}

/// The process that runs each robot: robots of one process share its link.
fn process_of(file: &LaunchFile) -> BTreeMap<RobotName, String> {
    let mut process_of = BTreeMap::new();
    for process in &file.processes {
        for robot in &process.robots {
            process_of.insert(robot.clone(), process.name.clone());
        }
    }
    process_of
}

fn make_links(
    via: Via,
    file: &LaunchFile,
    plan: &Plan,
    start: &Start,
) -> miette::Result<Box<dyn Links>> {
    match via {
        Via::Proxy => Ok(Box::new(Proxies::new(file)?)),
        Via::Namespaces => {
            plan.check_cuts_only("the link of a namespace")?;
            check_not_secured(file)?;
            Ok(Box::new(Namespaces::new(&file.processes)?))
        }
        Via::Compose => {
            plan.check_cuts_only("the link of a container")?;
            check_not_secured(file)?;
            Ok(Box::new(Compose::new(start)?))
        }
    }
}

/// Certificates name the hosts by which a simulator is reached, and those of these links are made anew each time.
fn check_not_secured(file: &LaunchFile) -> miette::Result<()> {
    let help =
        "play it --via proxy, or leave out `secure`: nobody else is in the network of these links";

    if file.secure.is_some() {
        Err(miette!(
            help = help,
            "a secured launch has no certificate there"
        ))
    } else {
        Ok(())
    }
}

/// A change of a scenario: no partition is simulated.
const WITHOUT_PARTITIONS: &str = "network.partition=[]";

/// The partitions of the scenario, as faults of real links.
fn partitions(file: &LaunchFile, options: &RunOptions) -> miette::Result<Plan> {
    let scenario = file.load_scenario(&options.changes())?;
    let Some(speed) = options.speed.or(file.speed).and_then(|speed| speed.0) else {
        let help = "say --speed 20, for example";
        return Err(miette!(
            help = help,
            "as fast as it goes, nobody knows when a partition would come"
        ));
    };
    Ok(Plan::of_partitions(&scenario, speed)?)
}

/// Waits until the first tick is in the record. Returns whether it came before the end of the launch.
fn wait_for_clock(launch: &mut Child, events: &Path, begun: SystemTime) -> miette::Result<bool> {
    let is_new = || {
        events
            .metadata()
            .and_then(|file| file.modified())
            .is_ok_and(|at| at >= begun)
    };

    loop {
        if is_new() && last_tick(events).is_some_and(|tick| tick > 0) {
            return Ok(true);
        }
        if launch.try_wait().into_diagnostic()?.is_some() {
            return Ok(false);
        }
        std::thread::sleep(LOOK_AGAIN);
    }
}

/// The tick of the last line of a record that is being written.
fn last_tick(events: &Path) -> Option<u64> {
    let mut file = File::open(events).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES)))
        .ok()?;
    let mut tail = Vec::new();
    file.read_to_end(&mut tail).ok()?;
    let line = tail
        .strip_suffix(b"\n")
        .unwrap_or(&tail)
        .rsplit(|byte| *byte == b'\n')
        .next()?;

    serde_json::from_slice::<serde_json::Value>(line)
        .ok()?
        .get("tick")?
        .as_u64()
}

/// A line of what was done.
#[derive(Debug, Serialize)]
struct Done<'a> {
    /// Seconds of the wall clock since the clock first ran.
    time_s: f64,
    robot: &'a RobotName,
    link: Shape,
    /// The last tick that was in the record by then.
    tick: Option<u64>,
}

/// What faults are played on.
struct Stage<'a> {
    plan: &'a Plan,
    process_of: &'a BTreeMap<RobotName, String>,
    folder: &'a RunFolder,
}

impl Stage<'_> {
    /// Plays the plan from now on.
    fn play(
        &self,
        links: &mut dyn Links,
        launch: &mut Child,
        mut report: impl FnMut(String),
    ) -> miette::Result<()> {
        let begun = std::time::Instant::now();
        let path = self.folder.file(LINKS);
        let mut record = File::create(&path)
            .into_diagnostic()
            .wrap_err_with(|| path.display().to_string())?;

        let apply = |robot: &RobotName, shape: Shape, _| {
            links.set(&self.process_of[robot], shape)?;

            let time_s = begun.elapsed().as_secs_f64();
            let tick = last_tick(&self.folder.file(EVENTS));
            report(format!("{time_s:.3} s: the link of {robot} is {shape}"));
            let line = serde_json::to_string(&Done {
                time_s,
                robot,
                link: shape,
                tick,
            })
            .into_diagnostic()?;
            writeln!(record, "{line}")
                .into_diagnostic()
                .wrap_err_with(|| path.display().to_string())
        };
        // A launch that cannot be asked is over.
        self.plan
            .play(begun, apply, || !matches!(launch.try_wait(), Ok(None)))
    }
}

fn exit_code(status: ExitStatus) -> u8 {
    let code = status
        .code()
        .or_else(|| status.signal().map(|signal| 128 + signal));
    code.and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
}

/// Ctrl-C and SIGTERM go to the launch, which ends in good order; then the links are taken down.
struct Signals {
    launch: Arc<AtomicI32>,
    is_asked: Arc<AtomicBool>,
}

impl Signals {
    fn forward() -> miette::Result<Self> {
        let signals = Self {
            launch: Arc::default(),
            is_asked: Arc::default(),
        };
        let (launch, is_asked) = (signals.launch.clone(), signals.is_asked.clone());
        ctrlc::set_handler(move || {
            is_asked.store(true, Ordering::SeqCst);
            terminate(launch.load(Ordering::SeqCst));
        })
        .into_diagnostic()?;

        Ok(signals)
    }

    fn spawn(&self, mut command: Command) -> miette::Result<Child> {
        // In a group of its own: Ctrl-C reaches it once, by way of this process.
        let program = command.get_program().to_owned();
        let child = command.process_group(0).spawn();
        let child = child
            .into_diagnostic()
            .wrap_err_with(|| format!("starting {}", program.display()))?;
        self.launch.store(
            i32::try_from(child.id()).into_diagnostic()?,
            Ordering::SeqCst,
        );

        if self.is_asked.load(Ordering::SeqCst) {
            self.end();
        }

        Ok(child)
    }

    fn end(&self) {
        terminate(self.launch.load(Ordering::SeqCst));
    }
}

/// A launch that is over already needs no signal.
fn terminate(launch: i32) {
    if launch > 0 {
        let _over = kill(Pid::from_raw(launch), Signal::SIGTERM);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_tick_of_a_record_is_found_while_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(EVENTS);
        assert_eq!(last_tick(&file), None);

        for (text, tick) in [
            ("", None),
            ("{\"tick\":0,\"event\":\"joined\"}\n", Some(0)),
            ("{\"tick\":0}\n{\"tick\":17,\"event\":\"tick\"}\n", Some(17)),
            ("{\"tick\":0}\n{\"tick\":17,\"ev", None),
        ] {
            std::fs::write(&file, text).unwrap();
            assert_eq!(last_tick(&file), tick, "{text}");
        }

        std::fs::write(&file, "{\"tick\":1}\n".repeat(5000) + "{\"tick\":2}\n").unwrap();
        assert_eq!(last_tick(&file), Some(2));
    }
}
