//! Supervises the processes of a run: starts, restarts and ends them. It works with processes and signals only, not with
//! the bus.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use protocol::RobotName;
use protocol::messages::{FaultKind, ProcessOrder};
use terminal::RESUME;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};

use super::ending::ProcessEnd;
use super::failure::Failure;
use super::leftovers::Leftovers;
use super::log::{LIMIT_BYTES, ProcessLog};
use super::plan::{Part, Planned, quote};
use super::process::{self, Group, OutputSink};
use super::restart::{BUDGET, RestartBudget};
use super::screen::ScreenHandle;
use super::tail::Tail;

/// Longest description of an end for the simulator, characters.
const MAX_REASON: usize = 1000;

/// Robots wait this long for the launcher to observe the run. One that does not reach the simulator must keep none from trying.
const OBSERVED_WITHIN: Duration = Duration::from_secs(3);

/// A console that no browser shows has ended after this long.
const UNSEEN: Duration = Duration::from_secs(1);

/// An event of the supervisor's loop. Processes are named by their indices.
#[derive(Debug)]
pub(super) enum SupervisorEvent {
    /// A process has exited and its output has been read.
    Ended(usize, ProcessEnd),
    /// The wait before a restart is over.
    RestartDue(usize),
    /// The scenario orders faults of processes; the sender waits until they are carried out.
    Faults(Vec<ProcessOrder>, FaultsDone),
    /// The wall-clock duration of a fault is over.
    FaultOver(usize, FaultKind),
    /// A slowed process is stopped (`true`) or continued (`false`).
    Pulse(usize, bool),
    /// The launcher observes the run, or has had the time to.
    Observed,
    /// The launcher has received a signal to end.
    Asked(Signal),
    /// The grace period of a phase is over.
    GraceOver(Shutdown),
}

/// Callback that reports to the simulator that its faults have been carried out.
pub(super) struct FaultsDone(pub(super) Box<dyn FnOnce() + Send>);

impl std::fmt::Debug for FaultsDone {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("FaultsDone")
    }
}

/// Robots whose process has ended in the middle of the run, and for which no further one is started.
#[derive(Debug)]
pub(super) struct Gone {
    pub(super) robots: Vec<RobotName>,
    /// How it ended, as the predicate of a sentence.
    pub(super) because: String,
}

/// Phase of the end of a run. Phases only advance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Shutdown {
    /// The run goes on.
    Running,
    /// The simulator has received SIGTERM and writes its record.
    Stopping,
    /// The simulator has exited; the robots exit by themselves.
    Leaving,
    /// All processes have received SIGTERM.
    Terminating,
    /// All processes have received SIGKILL.
    Killing,
    /// Some processes survived SIGKILL.
    GivenUp,
}

/// How a launch ended.
#[derive(Debug)]
pub struct LaunchOutcome {
    /// The first failure that ended the run.
    pub failure: Option<Failure>,
    /// The first signal to end.
    pub asked: Option<Signal>,
    /// Whether a person who saw the failure in the console wants the run to go on.
    pub is_to_resume: bool,
    /// Whether the run has not begun, and the record that it was to replace is as it was.
    pub keeps_replaced: bool,
}

/// A process under supervision.
struct Supervised {
    planned: Planned,
    budget: RestartBudget,
    /// Its process group while it runs.
    group: Option<Group>,
    log: ProcessLog,
    tail: Tail,
    /// Whether the scenario has killed it, so that its exit is not a failure.
    is_down: bool,
    /// Whether the scenario slows it down.
    is_slow: bool,
}

impl Supervised {
    fn new(planned: Planned, logs: &Path) -> Self {
        // The console prints its token.
        let is_private = planned.part == Part::Observer;
        let log = log_of(logs, &planned.name);

        Self {
            budget: RestartBudget::new(planned.backoff),
            planned,
            group: None,
            log: ProcessLog::new(log, is_private, LIMIT_BYTES),
            tail: Tail::default(),
            is_down: false,
            is_slow: false,
        }
    }

    fn is_observer(&self) -> bool {
        self.planned.part == Part::Observer
    }

    fn signal(&self, signal: Signal) {
        if let Some(group) = self.group {
            group.signal(signal);
        }
    }
}

/// The launcher's loop.
pub(super) struct Supervisor {
    processes: Vec<Supervised>,
    logs: PathBuf,
    grace: Duration,
    screen: ScreenHandle,
    leftovers: Leftovers,
    /// Robots without a process, for the simulator.
    gone: Sender<Gone>,
    queue: UnboundedSender<SupervisorEvent>,
    events: UnboundedReceiver<SupervisorEvent>,
    /// Processes of robots that start once the run is observed.
    unstarted: Vec<usize>,
    stage: Shutdown,
    outcome: LaunchOutcome,
}

impl Supervisor {
    /// Prepares to run these processes. `logs` is the folder of their logs; `grace` is how long a process may take to exit
    /// after SIGTERM; `gone` receives the robots that have lost their process for good.
    pub(super) fn new(
        planned: Vec<Planned>,
        logs: &Path,
        grace: Duration,
        screen: ScreenHandle,
        leftovers: Leftovers,
        gone: Sender<Gone>,
    ) -> Self {
        let (queue, events) = tokio::sync::mpsc::unbounded_channel();

        Self {
            processes: planned
                .into_iter()
                .map(|planned| Supervised::new(planned, logs))
                .collect(),
            logs: logs.to_owned(),
            grace,
            screen,
            leftovers,
            gone,
            queue,
            events,
            unstarted: Vec::new(),
            stage: Shutdown::Running,
            outcome: LaunchOutcome {
                failure: None,
                asked: None,
                is_to_resume: false,
                keeps_replaced: false,
            },
        }
    }

    /// Queue for events from outside.
    pub(super) fn queue(&self) -> UnboundedSender<SupervisorEvent> {
        self.queue.clone()
    }

    /// Runs all processes until they have exited.
    pub(super) async fn run(mut self) -> LaunchOutcome {
        // Robots come after the observer, as the clock may begin with the last of them: in a short run all ticks would be
        // over before their log is followed, and orders for processes would come too early.
        let mut processes = self.processes.iter();
        let has_simulator = processes.any(|process| process.planned.part == Part::Simulator);
        for index in 0..self.processes.len() {
            let planned = &self.processes[index].planned;
            if planned.is_extern {
                self.announce_extern(index);
            } else if has_simulator && planned.part == Part::Robots {
                self.unstarted.push(index);
            } else {
                self.start(index);
            }
        }
        self.after(OBSERVED_WITHIN, SupervisorEvent::Observed);

        // A run without processes of this launcher goes on: those that the user starts are not its to
        // wait for. From the first step of the end on, the loop lasts as long as a process does; each
        // phase is bounded by the grace period.
        while self.stage == Shutdown::Running
            || (self.stage < Shutdown::GivenUp && self.is_any_running())
        {
            match self.events.recv().await {
                Some(event) => self.handle(event),
                None => unreachable!("the supervisor holds a sender of its own queue"),
            }
        }

        // Only when the processes are gone: until then they may start further programs.
        let killed = self.leftovers.kill_all();
        self.notice_killed("the robots' processes", killed);
        self.explain().await;
        self.outcome
    }

    /// Waits while the console shows people why the run has failed. It ends by itself when no browser shows it any more.
    async fn explain(&mut self) {
        let mut is_told = false;
        while self.is_console_running() {
            // A console without a browser ends at once. Only one that is still here after this time is
            // worth a word.
            let event = tokio::time::timeout(UNSEEN, self.events.recv()).await;
            let Ok(event) = event else {
                if !is_told && self.is_explaining() {
                    is_told = true;
                    self.notice(
                        "a browser shows why, and can resume the run; Ctrl-C ends the console",
                    );
                }
                continue;
            };

            match event {
                Some(SupervisorEvent::Ended(index, ended)) => self.on_ended(index, &ended),
                Some(SupervisorEvent::Asked(signal)) if self.is_explaining() => {
                    self.outcome.asked = Some(signal);
                    self.end_observers();
                    self.after(self.grace, SupervisorEvent::GraceOver(Shutdown::GivenUp));
                }
                Some(SupervisorEvent::Asked(_) | SupervisorEvent::GraceOver(Shutdown::GivenUp)) => {
                    self.signal_all(Signal::SIGKILL);
                }
                Some(_) => {}
                None => unreachable!("the supervisor holds a sender of its own queue"),
            }
        }
    }

    /// Whether the console stays to show why the run has failed: no process takes it along, unless a person ends the run.
    fn is_explaining(&self) -> bool {
        let LaunchOutcome { failure, asked, .. } = &self.outcome;
        let is_final = failure
            .as_ref()
            .is_some_and(|failure| !failure.is_port_taken());
        is_final && asked.is_none()
    }

    fn is_console_running(&self) -> bool {
        let mut processes = self.processes.iter();
        processes.any(|process| process.is_observer() && process.group.is_some())
    }

    fn handle(&mut self, event: SupervisorEvent) {
        match event {
            SupervisorEvent::Ended(index, ended) => self.on_ended(index, &ended),
            SupervisorEvent::RestartDue(index) => self.on_restart_due(index),
            SupervisorEvent::Faults(orders, done) => self.on_faults(&orders, done),
            SupervisorEvent::FaultOver(index, kind) => self.end_fault(index, kind),
            SupervisorEvent::Pulse(index, stops) => self.pulse(index, stops),
            SupervisorEvent::Observed => self.on_observed(),
            SupervisorEvent::Asked(signal) => self.on_asked(signal),
            SupervisorEvent::GraceOver(stage) => self.on_grace_over(stage),
        }
    }

    fn on_observed(&mut self) {
        // Both the observer and the limit say it, also where the run has ended before.
        let unstarted = std::mem::take(&mut self.unstarted);
        if self.stage == Shutdown::Running {
            for index in unstarted {
                self.start(index);
            }
        }
    }

    fn is_any_running(&self) -> bool {
        let is_explaining = self.is_explaining();
        let mut processes = self.processes.iter();
        processes
            .any(|process| process.group.is_some() && !(is_explaining && process.is_observer()))
    }

    fn notice(&self, text: impl Into<String>) {
        self.screen.notice(text);
    }

    fn name(&self, index: usize) -> &str {
        &self.processes[index].planned.name
    }

    fn announce_extern(&self, index: usize) {
        let Planned { name, command, .. } = &self.processes[index].planned;
        self.notice(format!(
            "start {name} yourself, in another terminal or a debugger:\n  {command}"
        ));
    }

    fn start(&mut self, index: usize) {
        let supervised = &mut self.processes[index];
        let queue = self.queue.clone();
        let started = match process::start(&supervised.planned.command) {
            Ok(started) => started,
            Err(error) => {
                let program = supervised.planned.command.program.display();
                let ended = ProcessEnd::NotStarted(format!("{program} cannot be started: {error}"));
                return report(&queue, SupervisorEvent::Ended(index, ended));
            }
        };

        // Noted before anything else can happen to it: its end arrives through the queue, and is
        // handled after this.
        supervised.group = Some(started.group);
        // For the guard beside the launcher, in case that this one is killed.
        if supervised.planned.part == Part::Robots {
            self.leftovers.add(started.group.0);
        }
        if supervised.planned.part == Part::Simulator {
            let name = supervised.planned.name.clone();
            let screen = self.screen.clone();
            tokio::spawn(process::watch_stops(started.group, name, screen));
        }

        let output = OutputSink {
            screen: self.screen.clone(),
            index,
            log: supervised.log.clone(),
            tail: supervised.tail.clone(),
        };
        tokio::spawn(async move {
            let ended = match started.run(output).await {
                Ok(status) => ProcessEnd::Exited(status),
                Err(error) => ProcessEnd::NotStarted(format!("it cannot be supervised: {error}")),
            };
            report(&queue, SupervisorEvent::Ended(index, ended));
        });
    }

    fn on_ended(&mut self, index: usize, ended: &ProcessEnd) {
        // In every case: the number of the group may be given to another one, which must not get its
        // signals.
        self.forget_group(index);

        let process = &self.processes[index];
        if process.planned.part == Part::Simulator {
            self.on_simulator_ended(index, ended);
        } else if process.is_observer() && self.outcome.failure.is_some() {
            self.outcome.is_to_resume = self.outcome.asked.is_none() && ended.code() == RESUME;
        // An order has killed it, and another one starts it: neither a failure nor a restart.
        } else if process.is_down {
            tracing::debug!("{} was killed by the scenario", self.name(index));
        } else if self.stage == Shutdown::Running {
            self.on_other_ended(index, ended);
        } else if ended.has_failed() && self.stage <= Shutdown::Leaving {
            self.notice(format!(
                "{} {ended} at the end of the run",
                self.name(index)
            ));
        }
    }

    /// Forgets the group of a process that has ended, and kills what has left the group.
    fn forget_group(&mut self, index: usize) {
        let process = &mut self.processes[index];
        let Some(group) = process.group.take() else {
            return;
        };
        if process.planned.part != Part::Robots {
            return;
        }

        // The guard must not kill another group that gets this number.
        self.leftovers.remove(group.0);
        // At the end of the run all are killed together.
        if self.stage == Shutdown::Running {
            let name = self.name(index);
            let killed = self.leftovers.kill_of(name);
            self.notice_killed(name, killed);
        }
    }

    fn notice_killed(&self, whose: &str, killed: BTreeSet<String>) {
        if !killed.is_empty() {
            let programs: Vec<String> = killed.into_iter().collect();
            self.notice(format!(
                "killed what {whose} left behind: {}",
                programs.join(", ")
            ));
        }
    }

    /// Ends the run after its simulator. A failure after SIGTERM is part of the end that was asked for.
    fn on_simulator_ended(&mut self, index: usize, ended: &ProcessEnd) {
        let has_failed = ended.has_failed();
        if has_failed && self.stage == Shutdown::Running {
            // Its robots would wait for ever: all others are ended as well.
            self.fail(index, ended);
            self.terminate();
        } else if has_failed && self.stage == Shutdown::Stopping {
            self.notice(format!("{} {ended} while ending the run", self.name(index)));
            self.terminate();
        } else {
            self.enter(Shutdown::Leaving);
            if !self.is_explaining() {
                self.end_observers();
            }
        }
    }

    /// Robots learn from the bus that the run is over and exit; observers would stay.
    fn end_observers(&self) {
        for process in &self.processes {
            if process.planned.part == Part::Observer {
                process.signal(Signal::SIGTERM);
            }
        }
    }

    /// Handles the exit of a process other than the simulator during the run.
    fn on_other_ended(&mut self, index: usize, ended: &ProcessEnd) {
        let restart = self.processes[index].planned.restart;
        // As long as there are restarts left, even a process that is required may fail.
        if restart.applies(ended.has_failed()) && self.restart_later(index, ended) {
            return;
        }

        if ended.has_failed() && self.processes[index].planned.is_required {
            self.fail(index, ended);
            // By the simulator, so that the record has an end, and the other robots leave in order.
            self.stop();
        } else {
            self.on_gone(index, ended);
        }
    }

    /// Handles the exit of a process that no other one follows. Robots also exit when the run is over, often before the
    /// simulator does, which knows.
    fn on_gone(&self, index: usize, ended: &ProcessEnd) {
        let Planned {
            part, robots, name, ..
        } = &self.processes[index].planned;
        if *part == Part::Robots {
            // The observer lasts as long as the supervisor.
            let _over = self.gone.send(Gone {
                robots: robots.clone(),
                because: self.because(index, ended),
            });
        }

        if ended.has_failed() {
            let log = log_of(&self.logs, name);
            self.notice(format!(
                "{name} {ended}; it is not required (its log: {})",
                log.display()
            ));
        }
    }

    /// How a process has ended for good, as the predicate of a sentence.
    fn because(&self, index: usize, ended: &ProcessEnd) -> String {
        let ended: String = ended.to_string().chars().take(MAX_REASON).collect();
        if self.processes[index].budget.is_exhausted() {
            format!("{ended}, and has been restarted {BUDGET} times already")
        } else {
            ended
        }
    }

    /// Schedules a restart; returns whether the process has one left.
    fn restart_later(&mut self, index: usize, ended: &ProcessEnd) -> bool {
        let spent = self.processes[index].budget.spend(Instant::now());
        let name = self.name(index);
        let Some((wait, number)) = spent else {
            self.notice(format!(
                "{name} {ended}, and has been restarted {BUDGET} times already"
            ));
            return false;
        };

        let wait_s = wait.as_secs_f64();
        self.notice(format!(
            "{name} {ended}; restart {number} of {BUDGET} in {wait_s:.1} s"
        ));
        self.after(wait, SupervisorEvent::RestartDue(index));
        true
    }

    fn on_restart_due(&mut self, index: usize) {
        // The run may have ended during the wait.
        if self.stage == Shutdown::Running {
            self.notice(format!("restarting {}", self.name(index)));
            self.start(index);
        }
    }

    fn on_asked(&mut self, signal: Signal) {
        // The first one decides about the exit status.
        self.outcome.asked.get_or_insert(signal);
        let is_ending = self.stage >= Shutdown::Terminating;
        if signal == Signal::SIGQUIT || is_ending && signal == Signal::SIGINT {
            self.notice("killing all processes");
            self.kill();
        } else if !is_ending {
            self.notice("ending all processes; Ctrl-C kills them");
            self.terminate();
        }
        // Further signals of other kinds ask for nothing new: one death of a parent can be several, one for each of its threads.
    }

    fn on_grace_over(&mut self, stage: Shutdown) {
        if stage != self.stage {
            return; // The phase ended before its grace period.
        }

        match stage {
            Shutdown::Running | Shutdown::GivenUp => {
                unreachable!("these phases have no grace period")
            }
            Shutdown::Stopping | Shutdown::Leaving => {
                self.name_running("still running after the end of the run");
                self.terminate();
            }
            Shutdown::Terminating => {
                self.name_running("still running after SIGTERM");
                self.kill();
            }
            Shutdown::Killing => {
                self.name_running("cannot be killed");
                self.stage = Shutdown::GivenUp;
            }
        }
    }

    fn name_running(&self, what: &str) {
        let is_explaining = self.is_explaining();
        let running = self
            .processes
            .iter()
            .filter(|process| process.group.is_some() && !(is_explaining && process.is_observer()));
        let names: Vec<&str> = running.map(|process| &*process.planned.name).collect();
        self.notice(format!("{}: {what}", names.join(", ")));
    }

    /// Reports a failure and keeps it as the outcome if it is the first one.
    fn fail(&mut self, index: usize, ended: &ProcessEnd) {
        let name = self.name(index);
        self.notice(format!("{name} {ended}: ending the run"));

        let failure = Failure {
            process: name.to_owned(),
            text: format!("{name} {ended}"),
            code: ended.code(),
            tail: self.processes[index].tail.lines(),
            log: Some(log_of(&self.logs, name)),
        };
        // What fails after that fails because of it, most likely.
        if self.outcome.failure.is_none() {
            self.outcome.failure = Some(failure);
            self.show_failure();
        }
    }

    /// Tells the console why the run has failed.
    fn show_failure(&self) {
        let Some(failure) = self
            .outcome
            .failure
            .as_ref()
            .filter(|_| self.is_explaining())
        else {
            return;
        };

        let run = self.logs.parent().unwrap_or(&self.logs);
        let command = format!("cars launch --resume {}", quote(&run.display().to_string()));
        if let Err(error) = failure.show(&self.logs, command) {
            self.notice(format!("the console cannot be told why: {error}"));
        }
    }

    /// Ends the run by its simulator, which writes its record and dismisses the robots.
    fn stop(&mut self) {
        let mut processes = self.processes.iter();
        let simulator = processes.find(|process| process.planned.part == Part::Simulator);
        match simulator.and_then(|process| process.group) {
            Some(simulator) => {
                simulator.signal(Signal::SIGTERM);
                self.enter(Shutdown::Stopping);
            }
            None => self.terminate(),
        }
    }

    fn terminate(&mut self) {
        self.signal_all(Signal::SIGTERM);
        // A stopped process handles SIGTERM only after it is continued.
        self.signal_all(Signal::SIGCONT);
        self.enter(Shutdown::Terminating);
    }

    fn kill(&mut self) {
        self.signal_all(Signal::SIGKILL);
        self.enter(Shutdown::Killing);
    }

    /// Signals all processes but a console that shows why the run has failed.
    fn signal_all(&self, signal: Signal) {
        let is_explaining = self.is_explaining();
        for process in &self.processes {
            if !(is_explaining && process.is_observer()) {
                process.signal(signal);
            }
        }
    }

    fn enter(&mut self, stage: Shutdown) {
        // Phases only advance. So the timer of an earlier one finds another phase, and decides nothing.
        if stage > self.stage {
            self.stage = stage;
            self.after(self.grace, SupervisorEvent::GraceOver(stage));
        }
    }

    fn after(&self, wait: Duration, event: SupervisorEvent) {
        let queue = self.queue.clone();
        tokio::spawn(async move {
            tokio::time::sleep(wait).await;
            report(&queue, event);
        });
    }
}

/// Queues an event. The queue is closed only when the launch is over.
fn report(queue: &UnboundedSender<SupervisorEvent>, event: SupervisorEvent) {
    let _over = queue.send(event);
}

fn log_of(logs: &Path, name: &str) -> PathBuf {
    logs.join(format!("{name}.log"))
}

mod faults;
#[cfg(test)]
mod tests;
