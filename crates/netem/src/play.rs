//! Launches over links of its own and plays a plan of faults on them.

use bus::endpoint::is_tls;
use launch::child::{self, AtExit};
use launch::{LaunchError, LaunchFile, ProcessLink, RunOptions, endpoint};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use protocol::RobotName;
use record::{IfTaken, RunFolder};
use scenario::files::{EVENTS, LINKS};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::{Duration, Instant};

use super::compose::Compose;
use super::links::{Links, Start};
use super::namespaces::{self, Namespaces};
use super::plan::FaultPlan;
use super::proxy::{self, Proxy};
use super::shape::LinkShape;
use config::Speed;
use scenario::Scenario;

/// Number of bytes at the end of a record in which its last line is searched.
const TAIL_BYTES: u64 = 16 * 1024;
/// What is reported where the process of the launch cannot be waited for.
const LOST: &str = "the state of the launch is not known";
/// How often to check for the first tick.
const LOOK_AGAIN: Duration = Duration::from_millis(5);

/// A launch with faults of real links.
#[derive(Debug)]
pub struct Play {
    /// The launch file.
    pub file: PathBuf,
    /// The plan of faults. Without one, the partitions of the scenario are played on the links instead of being simulated.
    pub plan: Option<PathBuf>,
    /// The kind of links.
    pub via: Via,
    /// Options of the execution.
    pub options: RunOptions,
    /// Further arguments of `cars launch`.
    pub launch_args: Vec<String>,
}

/// Kinds of links.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Via {
    /// A TCP proxy for each process: cut, close, delay, jitter, bandwidth. Needs no privileges.
    Proxy,
    /// A network namespace for each process, connected by a veth pair: cut. Needs root and `ip` (iproute2).
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
    /// Starts a proxy for each process. TLS passes a proxy unchanged.
    fn new(file: &LaunchFile) -> Result<Self, LaunchError> {
        let port = endpoint::free_port()?;
        let endpoint = endpoint::loopback(port, file.secure.is_some());
        let mut proxies = BTreeMap::new();
        for process in &file.processes {
            let proxy = proxy::on_loopback(port)?;
            proxies.insert(process.name.clone(), proxy);
        }
        Ok(Self { endpoint, proxies })
    }
}

impl Links for Proxies {
    fn command(&self, start: &Start) -> Result<Command, LaunchError> {
        let is_secured = is_tls(&self.endpoint);
        let mut links = Vec::new();
        for (process, proxy) in &self.proxies {
            links.push(ProcessLink {
                process: process.clone(),
                endpoint: endpoint::loopback(proxy.address().port(), is_secured),
                namespace: None,
            });
        }

        let mut command = child::command(AtExit::Terminate, child::own_program());
        command
            .args(start.args(&links))
            .arg(format!("--listen={}", self.endpoint));

        Ok(command)
    }

    fn set(&mut self, process: &str, shape: LinkShape) -> Result<(), LaunchError> {
        let proxy = self.proxies.get(process);
        let proxy = proxy.ok_or_else(|| LaunchError::refused(format!("no link of {process}")))?;
        proxy.set(shape);
        Ok(())
    }
}

/// Launches, plays the faults, and waits for the end of the launch. `report` receives a line for each change of a link.
/// Returns the exit status of the launch.
///
/// # Errors
/// If a file cannot be used, the links cannot be made, or a fault cannot be played.
pub fn play(play: &Play, mut report: impl FnMut(String)) -> Result<u8, LaunchError> {
    let changes = play.options.changes();
    let (file, scenario) = LaunchFile::load_with_scenario(&play.file, &changes)?;
    let run = play.options.run_name(&play.file)?;
    let process_of = process_of(&file);

    let mut options = play.options.clone();
    let plan = match &play.plan {
        Some(plan) => FaultPlan::load(plan, &process_of.keys().cloned().collect())?,
        None => partitions(&scenario, options.speed.or(file.speed))?,
    };
    // Containers read the scenario file itself.
    if play.plan.is_none() && play.via != Via::Compose {
        let change = WITHOUT_PARTITIONS.parse();
        options.set.push(change.map_err(LaunchError::refused)?);
    }

    // The launch takes this folder, and this process has to know it.
    let made = RunFolder::make(&play.options.out, &run, play.options.if_taken)?;
    if let Some(text) = &made.notice {
        report(text.clone());
    }
    let reserved = made.reserve();
    options.if_taken = IfTaken::Reserved;
    let folder = &reserved.folder;
    let start = Start {
        file: &play.file,
        run: &reserved.run,
        options: &options,
        more: &play.launch_args,
    };
    // Before the links are made: from here on Ctrl-C ends the launch, and this process goes on to
    // remove them.
    let signals = Signals::forward()?;
    let links = make_links(play.via, &file, &plan, &start, &mut report);
    let mut links = links.inspect_err(|_| reserved.discard())?;

    let mut launch = signals.spawn(links.command(&start)?)?;
    let player = LinkPlayer {
        plan: &plan,
        process_of: &process_of,
        folder,
    };
    let played = match wait_for_clock(&mut launch, &folder.file(EVENTS)) {
        Ok(true) => player.play(links.as_mut(), &mut launch, report),
        Ok(false) => Ok(()),
        Err(error) => Err(error),
    };
    // The launch is ended in order even then: its record is written, and the links go after it.
    if played.is_err() {
        signals.end();
    }

    // The links are dropped after this, so that nothing is cut while the processes leave.
    let status = launch.wait().map_err(LaunchError::system(LOST))?;
    // A launch that has not come to its folder has not done so.
    folder.restore_replaced()?;
    played.map(|()| exit_code(status))
}

/// The process of each robot. Robots of one process share its link.
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
    plan: &FaultPlan,
    start: &Start,
    report: &mut dyn FnMut(String),
) -> Result<Box<dyn Links>, LaunchError> {
    // What these links cannot do is refused before anything of them is made.
    match via {
        Via::Proxy => Ok(Box::new(Proxies::new(file)?)),

        Via::Namespaces => {
            plan.check_cuts_only("the link of a namespace")?;
            check_not_secured(file)?;
            namespaces::remove_abandoned(report);
            Ok(Box::new(Namespaces::new(&file.processes)?))
        }

        Via::Compose => {
            plan.check_cuts_only("the link of a container")?;
            check_not_secured(file)?;
            Ok(Box::new(Compose::new(start)?))
        }
    }
}

/// Refuses secured launches: the addresses of these links are not in the certificate of the simulator.
fn check_not_secured(file: &LaunchFile) -> Result<(), LaunchError> {
    if file.secure.is_none() {
        return Ok(());
    }

    let help = "play it --via proxy, or leave out `secure`: the network of these links is private";
    Err(LaunchError::refused_with_help(
        "certificates do not have the addresses of these links",
        help,
    ))
}

/// Change of a scenario that removes its partitions.
const WITHOUT_PARTITIONS: &str = "network.partition=[]";

/// The partitions of the scenario, as faults of real links.
fn partitions(scenario: &Scenario, speed: Option<Speed>) -> Result<FaultPlan, LaunchError> {
    let Some(speed) = speed.and_then(|speed| speed.0) else {
        return Err(LaunchError::refused_with_help(
            "without a speed, partitions have no time on the wall clock",
            "for example --speed 20",
        ));
    };
    Ok(FaultPlan::of_partitions(scenario, speed)?)
}

/// Waits until the first tick is in the record. Returns `false` if the launch ends before.
fn wait_for_clock(launch: &mut Child, events: &Path) -> Result<bool, LaunchError> {
    loop {
        if last_tick(events).is_some_and(|tick| tick > 0) {
            return Ok(true);
        }

        let status = launch.try_wait().map_err(LaunchError::system(LOST))?;
        if status.is_some() {
            return Ok(false);
        }
        std::thread::sleep(LOOK_AGAIN);
    }
}

/// The tick of the last line of a record that is being written.
fn last_tick(events: &Path) -> Option<u64> {
    let mut file = File::open(events).ok()?;
    let length = file.metadata().ok()?.len();
    // The end of the file is enough, however long the run: lines are much shorter than this.
    let begin = length.saturating_sub(TAIL_BYTES);
    file.seek(SeekFrom::Start(begin)).ok()?;
    let mut tail = Vec::new();
    file.read_to_end(&mut tail).ok()?;

    let lines = tail.strip_suffix(b"\n").unwrap_or(&tail);
    let line = lines.rsplit(|byte| *byte == b'\n').next()?;
    let line: serde_json::Value = serde_json::from_slice(line).ok()?;
    line.get("tick")?.as_u64()
}

/// A line of [`LINKS`].
#[derive(Debug, Serialize)]
struct LinkRecord<'a> {
    /// Wall clock since the first tick, s.
    time_s: f64,
    robot: &'a RobotName,
    link: LinkShape,
    /// The last tick in the record at that time.
    tick: Option<u64>,
}

/// Plays a plan on the links of a launch.
struct LinkPlayer<'a> {
    plan: &'a FaultPlan,
    process_of: &'a BTreeMap<RobotName, String>,
    folder: &'a RunFolder,
}

impl LinkPlayer<'_> {
    /// Plays the plan, the times of which begin now.
    fn play(
        &self,
        links: &mut dyn Links,
        launch: &mut Child,
        mut report: impl FnMut(String),
    ) -> Result<(), LaunchError> {
        let begun = Instant::now();
        let path = self.folder.file(LINKS);
        let mut record = File::create_new(&path).map_err(LaunchError::path("make", &path))?;

        let apply = |robot: &RobotName, shape: LinkShape, _| {
            links.set(&self.process_of[robot], shape)?;

            let entry = LinkRecord {
                time_s: begun.elapsed().as_secs_f64(),
                robot,
                link: shape,
                tick: last_tick(&self.folder.file(EVENTS)),
            };
            let time_s = entry.time_s;
            report(format!("{time_s:.3} s: the link of {robot} is {shape}"));
            let line = serde_json::to_string(&entry).map_err(std::io::Error::from);
            line.and_then(|line| writeln!(record, "{line}"))
                .map_err(LaunchError::path("write", &path))
        };
        // If the state of the launch cannot be read, it is over.
        let is_over = || !matches!(launch.try_wait(), Ok(None));
        self.plan.play(begun, apply, is_over)
    }
}

fn exit_code(status: ExitStatus) -> u8 {
    let signal = status.signal().map(|signal| 128 + signal);
    let code = status.code().or(signal);
    code.and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
}

/// Forwards Ctrl-C and SIGTERM to the launch, which ends the run. The links are removed after that. The first signal arrives
/// there as SIGTERM, further ones as SIGINT.
struct Signals {
    launch: Arc<AtomicI32>,
    is_asked: Arc<AtomicBool>,
}

impl Signals {
    fn forward() -> Result<Self, LaunchError> {
        let signals = Self {
            launch: Arc::default(),
            is_asked: Arc::default(),
        };
        let launch = signals.launch.clone();
        let is_asked = signals.is_asked.clone();
        ctrlc::set_handler(move || {
            let signal = if is_asked.swap(true, Ordering::SeqCst) {
                Signal::SIGINT
            } else {
                Signal::SIGTERM
            };
            ask(launch.load(Ordering::SeqCst), signal);
        })
        .map_err(LaunchError::system("signals cannot be received"))?;

        Ok(signals)
    }

    fn spawn(&self, mut command: Command) -> Result<Child, LaunchError> {
        // In a process group of its own it receives Ctrl-C only through this process.
        let program = command.get_program().to_owned();
        let child = command
            .process_group(0)
            .spawn()
            .map_err(|source| LaunchError::NotStarted {
                program: program.display().to_string(),
                source,
            })?;
        let pid =
            i32::try_from(child.id()).map_err(LaunchError::system("the system's process id"))?;
        // Stored first, then looked: a signal in between is seen here or forwarded by the handler, or
        // both, which is harmless.
        self.launch.store(pid, Ordering::SeqCst);

        // A signal may have come before the process id was stored.
        if self.is_asked.load(Ordering::SeqCst) {
            self.end();
        }

        Ok(child)
    }

    fn end(&self) {
        ask(self.launch.load(Ordering::SeqCst), Signal::SIGTERM);
    }
}

/// Sends a signal to a launch, if it has been started.
fn ask(launch: i32, signal: Signal) {
    if launch > 0 {
        let _over = kill(Pid::from_raw(launch), signal);
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
