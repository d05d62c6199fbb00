//! Launches whose processes play one unit after another: a further unit is a further epoch of them, begun by `load`.
//!
//! A unit is the run of a fresh launch, whatever was played before. So a launch plays its first unit once more before it is used
//! again: where that is another run, a robot keeps something over `init`, and all units of such processes get fresh ones. What
//! fails in processes that have played before is played again in fresh ones, and only that is its result.

use std::collections::BTreeSet;
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use bus::{Bus, Role};
use lab::LabError;
use lab::folder::read_summary;
use lab::scratch::Scratch;
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer, End, Phase, Status};
use protocol::{Epoch, RunName, Tick, decode, encode};
use record::RunFolder;
use record::names::{ENDPOINT, EVENTS, OPERATOR_CONFIG, RECORDING, SCENARIO, SUMMARY};
use scenario::{FaultEnd, Scenario};
use xxhash_rust::xxh3::xxh3_128;

use super::follow::{EndedRun, Follow};
use super::plan::LaunchText;
use super::processes::{read, write_launch};

/// Name of the run of a launch, and of its folder.
const RUN: &str = "unit";
/// Where the output of a launch is kept for the reason of its failure.
const OUTPUT: &str = "launch.err";
/// Longest part of the output of a launch that is the reason of its failure, bytes.
const MAX_REASON: usize = 2000;
/// How long a tick of wall clock may take, and a launch to begin, unless the options say otherwise.
pub const TICK_PATIENCE: Duration = Duration::from_secs(120);
/// Most robots that are named where a run does not go on.
const MAX_AWAITED: usize = 5;
/// How long the simulator may take for an answer before it is asked again.
const ANSWER: Duration = Duration::from_secs(2);
/// How long a launch may take to end before it is killed.
const LEAVING: Duration = Duration::from_secs(10);
/// How often a launch is looked at: at first, and at most.
const LOOKS: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(16)];

/// Makes the command `cars`, whose process ends with the thread that starts it.
pub type Launcher = Box<dyn Fn() -> Command + Send + Sync>;

/// How launches are used.
#[derive(Debug, Clone, Copy)]
pub struct LaunchUse {
    /// Whether every unit gets fresh processes.
    pub is_fresh: bool,
    /// How long a tick may take, wall clock, before the unit fails.
    pub tick_patience: Duration,
}

impl Default for LaunchUse {
    fn default() -> Self {
        Self {
            is_fresh: false,
            tick_patience: TICK_PATIENCE,
        }
    }
}

/// The launches of an experiment or a hunt: one for each unit that is played at the same time.
pub struct Launches {
    /// Starts them on a thread that lasts as long as they do.
    starter: Option<Sender<StartRequest>>,
    starting: Option<std::thread::JoinHandle<()>>,
    launcher: Launcher,
    usage: LaunchUse,
    idle: Mutex<Vec<ReusedLaunch>>,
    /// Processes that are not used twice, by their kinds: their robots keep something over `init`.
    kept_state: Mutex<BTreeSet<Kind>>,
}

impl std::fmt::Debug for Launches {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Launches")
            .field("usage", &self.usage)
            .finish_non_exhaustive()
    }
}

/// A command to start, and where its process is awaited.
type StartRequest = (Command, Sender<std::io::Result<Child>>);

/// Digest of what launches must have in common to play each other's units: the roster with its classes, and the launch file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Kind(u128);

/// A launch whose processes run.
struct ReusedLaunch {
    kind: Kind,
    folder: Scratch,
    child: Child,
    /// The session with its simulator, from the time when that listens.
    session: Option<Session>,
    epoch: Epoch,
    /// Its first unit, until that has been played once more: the scenario and the digest of the run.
    first: Option<(String, String)>,
}

struct Session {
    bus: Bus,
    key: String,
}

impl Drop for Session {
    fn drop(&mut self) {
        self.bus.close();
    }
}

/// Why a run has not come to its end.
enum Broken {
    /// The launch has ended.
    Ended,
    /// In words.
    Because(String),
}

impl Launches {
    /// Launches that `launcher` starts.
    #[must_use]
    pub fn new(launcher: Launcher, usage: LaunchUse) -> Self {
        let (starter, requests) = channel::<StartRequest>();
        let thread = std::thread::Builder::new().name("launches".to_owned());
        let starting = thread.spawn(move || {
            for (mut command, started) in requests {
                // Nobody waits for a launch of a thread that has panicked.
                let _unheard = started.send(command.spawn());
            }
        });
        Self {
            starter: Some(starter),
            starting: starting.ok(),
            launcher,
            usage,
            idle: Mutex::default(),
            kept_state: Mutex::default(),
        }
    }

    /// None: all robots are in this process.
    #[must_use]
    pub fn none() -> Self {
        Self::new(
            Box::new(|| unreachable!("all robots are in this process")),
            LaunchUse::default(),
        )
    }

    /// What people may want to know of the use of processes, a sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        if lock(&self.kept_state).is_empty() {
            return Vec::new();
        }
        vec![
            "a robot keeps something over `init`: played once more by the same processes, the first run was another one, or \
             failed. Every unit of these robots gets fresh processes, which is slower"
                .to_owned(),
        ]
    }

    /// Plays a scenario to its end and shows its record to a follower. Without a launch file the robots are the programs of the
    /// project. Where the run has failed, the follower has seen what was recorded of it.
    ///
    /// # Errors
    /// If no launch can be started, the run does not come to its end, or its record cannot be read.
    pub fn follow(
        &self,
        mut scenario: Scenario,
        launch: Option<&LaunchText>,
        follower: &mut impl Follow,
    ) -> Result<EndedRun, LabError> {
        scenario.record.frames = true;
        scenario.record.panels = false;
        scenario.record.log = false;
        let text = scenario.to_toml()?;
        let kind = Kind::of(&scenario, launch);
        let patience = self.usage.tick_patience + longest_hold(&scenario);

        if let Some(mut launched) = self.take(kind) {
            match self.play_again(&mut launched, &text, patience) {
                Ok(()) => return self.conclude(launched, &scenario, follower),
                Err(_) => launched.end(),
            }
        }

        let mut launched = self.start(kind, &scenario, launch)?;
        match launched.play(patience) {
            Ok(()) if launched.has_finished() => {
                let digest = read_summary(&launched.run())?.map(|summary| summary.digest);
                launched.first = digest.map(|digest| (text, digest));
                self.conclude(launched, &scenario, follower)
            }
            broken => {
                let reason = launched.reason(broken.err());
                launched.end_run();
                // What there is of it; that it has no end is known.
                let _incomplete = read(&scenario, &launched.run(), follower);
                launched.end();
                Err(reason)
            }
        }
    }

    /// A launch of a kind whose processes are there and have played, if they may play again. One of another kind makes room for
    /// the one that has to be started.
    fn take(&self, kind: Kind) -> Option<ReusedLaunch> {
        let mut idle = lock(&self.idle);
        if let Some(place) = idle.iter().position(|launched| launched.kind == kind) {
            return Some(idle.swap_remove(place));
        }
        let other = idle.pop();
        drop(idle);
        if let Some(other) = other {
            other.end();
        }
        None
    }

    /// Plays a further unit; its first one once more before the second.
    fn play_again(
        &self,
        launched: &mut ReusedLaunch,
        scenario: &str,
        patience: Duration,
    ) -> Result<(), Broken> {
        if let Some((first, digest)) = launched.first.take() {
            launched.load(&first)?;
            let has_ended = launched.play(patience).is_ok();
            let again = read_summary(&launched.run()).ok().flatten();
            if !has_ended || again.is_none_or(|again| again.digest != digest) {
                lock(&self.kept_state).insert(launched.kind);
                return Err(Broken::Because("another run after `init`".to_owned()));
            }
        }
        launched.load(scenario)?;
        launched.play(patience)?;
        if launched.has_finished() {
            Ok(())
        } else {
            Err(Broken::Because("it was aborted".to_owned()))
        }
    }

    /// Reads a run that has finished, and keeps its processes.
    fn conclude(
        &self,
        launched: ReusedLaunch,
        scenario: &Scenario,
        follower: &mut impl Follow,
    ) -> Result<EndedRun, LabError> {
        let run = launched.run();
        let ended = read(scenario, &run, follower).and_then(|()| {
            let summary = read_summary(&run)?;
            let summary = summary.ok_or_else(|| LabError::record("the run has no summary"))?;
            EndedRun::of(&summary)
        });
        let is_kept = !self.usage.is_fresh && !lock(&self.kept_state).contains(&launched.kind);
        if is_kept && ended.is_ok() {
            lock(&self.idle).push(launched);
        } else {
            launched.end();
        }
        ended
    }

    fn start(
        &self,
        kind: Kind,
        scenario: &Scenario,
        launch: Option<&LaunchText>,
    ) -> Result<ReusedLaunch, LabError> {
        let folder = Scratch::new().map_err(LabError::failed)?;
        let file = write_launch(scenario, launch, folder.path())?;
        let output = File::create(folder.path().join(OUTPUT)).map_err(LabError::failed)?;

        let mut command = (self.launcher)();
        command
            .arg("launch")
            .arg(file)
            .arg("--out")
            .arg(folder.path())
            .args(["--run", RUN, "--speed", "max", "--no-console", "--quiet"])
            .arg("--stay")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(output);
        // Ctrl-C is for this process, which ends its launches in order. Elsewhere nothing else would end them.
        if cfg!(target_os = "linux") {
            command.process_group(0);
        }
        let (started, child) = channel();
        let starter = self.starter.as_ref();
        let is_sent = starter.is_some_and(|starter| starter.send((command, started)).is_ok());
        let child = child.recv().ok().filter(|_| is_sent);
        let child = child.ok_or_else(|| LabError::failed("no thread can be started"))?;
        Ok(ReusedLaunch {
            kind,
            folder,
            child: child.map_err(LabError::failed)?,
            session: None,
            epoch: 1,
            first: None,
        })
    }
}

impl Drop for Launches {
    fn drop(&mut self) {
        for launched in std::mem::take(&mut *lock(&self.idle)) {
            launched.end();
        }
        // The thread ends with its channel, and what it has started with the thread.
        self.starter = None;
        if let Some(starting) = self.starting.take() {
            let _panicked = starting.join();
        }
    }
}

impl Kind {
    fn of(scenario: &Scenario, launch: Option<&LaunchText>) -> Self {
        let mut text = String::new();
        for (name, spec) in &scenario.robots {
            text += &format!("{name} {:?}\n", spec.class);
        }
        if let Some(launch) = launch {
            text += &format!("{}\n{}", launch.folder.display(), launch.text);
        }
        Self(xxh3_128(text.as_bytes()))
    }
}

impl ReusedLaunch {
    fn run(&self) -> RunFolder {
        RunFolder::at(self.path())
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join(RUN)
    }

    /// Whether the run has finished, and was not aborted.
    fn has_finished(&self) -> bool {
        let summary = read_summary(&self.run()).ok().flatten();
        summary.is_some_and(|summary| summary.end == Some(End::Finished))
    }

    /// Waits for the end of the run.
    fn play(&mut self, tick_patience: Duration) -> Result<(), Broken> {
        let mut look = LOOKS[0];
        let mut last_progress = Instant::now();
        let mut reached: Option<(Epoch, Tick, Phase)> = None;
        loop {
            let status = self.status()?;
            if let Some(status) = &status {
                let now = (status.epoch, status.tick, status.phase);
                if reached != Some(now) {
                    reached = Some(now);
                    last_progress = Instant::now();
                }
                match status.phase {
                    Phase::Ended if status.epoch == self.epoch => return Ok(()),
                    // After `load` the clock waits.
                    Phase::Ready | Phase::Paused => _ = self.ask(&Control::Start)?,
                    Phase::Ended | Phase::Gathering | Phase::Running => {}
                }
            }
            if last_progress.elapsed() > tick_patience {
                return Err(Broken::Because(hung(status.as_ref(), tick_patience)));
            }

            std::thread::sleep(look);
            look = LOOKS[1].min(look * 2);
        }
    }

    /// How things stand; `None` if the simulator does not answer yet.
    fn status(&mut self) -> Result<Option<Status>, Broken> {
        match self.ask(&Control::Status)? {
            Some(ControlAnswer::Done(status)) => Ok(Some(*status)),
            _ => Ok(None),
        }
    }

    /// The simulator's answer; `None` if it does not answer yet.
    fn ask(&mut self, control: &Control) -> Result<Option<ControlAnswer>, Broken> {
        if !matches!(self.child.try_wait(), Ok(None)) {
            return Err(Broken::Ended);
        }
        if self.session.is_none() {
            self.session = Session::open(&self.path());
        }
        let Some(session) = &self.session else {
            return Ok(None);
        };

        let reply = session
            .bus
            .get_within(&session.key, "", Some(encode(control)), ANSWER);
        let reply = reply.ok().flatten();
        let Some(Ok(bytes)) = reply.map(|reply| reply.result) else {
            return Ok(None);
        };
        let answer = decode(&session.key, "simulator", &bytes);
        answer
            .map(Some)
            .map_err(|error| Broken::Because(error.to_string()))
    }

    /// Begins the next epoch, with another scenario.
    fn load(&mut self, scenario: &str) -> Result<(), Broken> {
        self.forget_record();
        let load = Control::Load {
            scenario: scenario.to_owned(),
        };
        match self.ask(&load)? {
            Some(ControlAnswer::Done(_)) => {
                self.epoch += 1;
                Ok(())
            }
            Some(ControlAnswer::Refused { explanation, .. }) => Err(Broken::Because(explanation)),
            _ => Err(Broken::Because("its simulator does not answer".to_owned())),
        }
    }

    /// Removes what was recorded and has been read: a launch plays thousands of units.
    fn forget_record(&self) {
        for name in [EVENTS, RECORDING, SUMMARY, SCENARIO] {
            let _is_gone = std::fs::remove_file(self.path().join(name));
        }
    }

    /// Has the run end, if its processes do not by themselves, and waits for them.
    fn end_run(&mut self) {
        let _is_gone = self.ask(&Control::Stop);
        let begun = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) {
            if begun.elapsed() > LEAVING {
                // What it has started ends with it.
                let _is_gone = self.child.kill();
                let _ended = self.child.wait();
                return;
            }
            std::thread::sleep(LOOKS[1]);
        }
    }

    fn end(mut self) {
        self.end_run();
    }

    /// Why the run has failed.
    fn reason(&mut self, broken: Option<Broken>) -> LabError {
        if let Some(Broken::Because(reason)) = broken {
            return LabError::failed(reason);
        }
        // A run that was aborted waits to be stopped, and the launch says why at its end.
        self.end_run();
        let printed = std::fs::read(self.folder.path().join(OUTPUT)).unwrap_or_default();
        let printed = String::from_utf8_lossy(&printed);
        // The name of the folder is drawn at random.
        let printed = printed.replace(&self.folder.path().display().to_string(), "");
        let mut end = printed.len().min(MAX_REASON);
        while !printed.is_char_boundary(end) {
            end -= 1;
        }
        LabError::failed(format!("the launch failed: {}", printed[..end].trim()))
    }
}

impl Drop for ReusedLaunch {
    /// In whatever way its use has ended, no process is left.
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            let _is_gone = self.child.kill();
            let _ended = self.child.wait();
        }
    }
}

impl Session {
    /// A session with the simulator of the run in a folder, if it listens.
    fn open(folder: &Path) -> Option<Self> {
        let line = |name: &str| {
            let text = std::fs::read_to_string(folder.join(name)).ok()?;
            Some(text.trim().to_owned())
        };
        let role = Role::Client {
            connect: line(ENDPOINT)?,
            patience: ANSWER,
        };
        let config = line(OPERATOR_CONFIG).map(PathBuf::from);
        let bus = Bus::open(&role, config.as_ref()).ok()?;
        let run = RunName::new(RUN).ok()?;
        Some(Self {
            bus,
            key: Keys::new(&run).control(),
        })
    }
}

/// Longest time of wall clock for which a fault of the scenario holds the clock.
fn longest_hold(scenario: &Scenario) -> Duration {
    let changed = scenario.changes.iter().flat_map(|change| &change.faults);
    let all = scenario.faults.iter().chain(changed);
    let held = all.map(|fault| match fault.end {
        FaultEnd::After(time_s) => Duration::try_from_secs_f64(time_s).unwrap_or_default(),
        _ => Duration::ZERO,
    });
    held.max().unwrap_or_default()
}

/// That a run does not go on, for people.
fn hung(status: Option<&Status>, patience: Duration) -> String {
    let patience_s = patience.as_secs_f64();
    let Some(status) = status else {
        return format!("the launch has not begun to play within {patience_s} s");
    };
    let mut awaited = Vec::new();
    for one in status.awaiting.iter().take(MAX_AWAITED) {
        awaited.push(format!("{} {}", one.name, one.because));
    }
    let text = format!("no tick for {patience_s} s after tick {}", status.tick);
    if awaited.is_empty() {
        return text;
    }
    format!("{text}: {}", awaited.join("; "))
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
