//! Keeps the processes of a run: starts them, starts them again, and brings all of them to an end. It knows processes
//! and signals, and nothing of the bus.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use protocol::messages::{FaultKind, ProcessOrder};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};

use super::ending::{Ended, Failure};
use super::plan::{Part, Planned};
use super::process::{self, Group, Output};
use super::restart::{BUDGET, Budget};
use super::screen::Tell;
use super::tail::Tail;

/// Everything that can happen to a launcher.
#[derive(Debug)]
pub(super) enum Event {
    /// A process is over, and what it had to say has been read.
    Ended(usize, Ended),
    /// The wait before a restart is over.
    RestartDue(usize),
    /// The scenario has something in store for processes.
    Faults(Vec<ProcessOrder>, Done),
    /// A fault is over by the wall clock.
    FaultOver(usize, FaultKind),
    /// A slowed process goes on for a moment, or is stopped again.
    Pulse(usize, bool),
    /// A person, or the system, asks to end.
    Asked(Signal),
    /// The patience of a stage is over.
    GraceOver(Stage),
}

/// Tells whoever ordered faults that they have been carried out.
pub(super) struct Done(pub(super) Box<dyn FnOnce() + Send>);

impl std::fmt::Debug for Done {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Done")
    }
}

/// How far the end of a run has come. Stages only ever go forward.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    /// Not at all.
    Running,
    /// The simulator was told to end the run, and writes its record.
    Stopping,
    /// The simulator is over; the robots leave by themselves.
    Leaving,
    /// Everybody was told to end.
    Terminating,
    /// Everybody is being killed.
    Killing,
    /// Not even that helped.
    GivenUp,
}

/// How a launch ended.
#[derive(Debug)]
pub struct Outcome {
    /// The first failure that ended the run.
    pub failure: Option<Failure>,
    /// The signal that asked to end.
    pub asked: Option<Signal>,
}

/// A process under supervision.
struct Kept {
    planned: Planned,
    budget: Budget,
    group: Option<Group>,
    tail: Tail,
    /// Whether the scenario has killed it: its end is no failure.
    is_down: bool,
    /// Whether the scenario slows it down.
    is_slow: bool,
}

/// The launcher's loop.
pub(super) struct Supervisor {
    kept: Vec<Kept>,
    logs: PathBuf,
    grace: Duration,
    tell: Tell,
    queue: UnboundedSender<Event>,
    events: UnboundedReceiver<Event>,
    stage: Stage,
    outcome: Outcome,
}

impl Supervisor {
    /// Prepares to run these processes; `logs` is the folder of their logs, `grace` how long a process that is asked to
    /// end has for it.
    pub(super) fn new(planned: Vec<Planned>, logs: &Path, grace: Duration, tell: Tell) -> Self {
        let (queue, events) = tokio::sync::mpsc::unbounded_channel();
        let keep = |planned: Planned| {
            let budget = Budget::new(planned.backoff);
            Kept {
                planned,
                budget,
                group: None,
                tail: Tail::default(),
                is_down: false,
                is_slow: false,
            }
        };

        Self {
            kept: planned.into_iter().map(keep).collect(),
            logs: logs.to_owned(),
            grace,
            tell,
            queue,
            events,
            stage: Stage::Running,
            outcome: Outcome {
                failure: None,
                asked: None,
            },
        }
    }

    /// Where signals are put.
    pub(super) fn queue(&self) -> UnboundedSender<Event> {
        self.queue.clone()
    }

    /// Runs all processes to their end.
    pub(super) async fn run(mut self) -> Outcome {
        for index in 0..self.kept.len() {
            if self.kept[index].planned.is_extern {
                self.announce_extern(index);
            } else {
                self.start(index);
            }
        }

        while self.stage < Stage::GivenUp
            && (self.stage == Stage::Running || self.is_anybody_there())
        {
            match self.events.recv().await {
                Some(event) => self.handle(event),
                None => unreachable!("the supervisor holds a sender of its own queue"),
            }
        }

        self.outcome
    }

    /// One event. The arms call; they do not think.
    fn handle(&mut self, event: Event) {
        match event {
            Event::Ended(index, ended) => self.on_ended(index, &ended),
            Event::RestartDue(index) => self.on_restart_due(index),
            Event::Faults(orders, done) => self.on_faults(&orders, done),
            Event::FaultOver(index, kind) => self.end_fault(index, kind),
            Event::Pulse(index, stops) => self.pulse(index, stops),
            Event::Asked(signal) => self.on_asked(signal),
            Event::GraceOver(stage) => self.on_grace_over(stage),
        }
    }

    fn is_anybody_there(&self) -> bool {
        self.kept.iter().any(|kept| kept.group.is_some())
    }

    fn announce_extern(&self, index: usize) {
        let Planned { name, command, .. } = &self.kept[index].planned;
        self.tell.notice(format!(
            "{name} is yours to start, in another terminal or a debugger:\n  {command}"
        ));
    }

    fn start(&mut self, index: usize) {
        let kept = &mut self.kept[index];
        let queue = self.queue.clone();
        let started = match process::start(&kept.planned.command) {
            Ok(started) => started,
            Err(error) => {
                let program = kept.planned.command.program.display();
                let ended = Ended::NotStarted(format!("{program} cannot be started: {error}"));
                return report(&queue, Event::Ended(index, ended));
            }
        };

        kept.group = Some(started.group);
        let (tell, tail) = (self.tell.clone(), kept.tail.clone());
        let output = Output {
            tell,
            index,
            log: log_of(&self.logs, &kept.planned.name),
            tail,
        };

        tokio::spawn(async move {
            let ended = match started.run(output).await {
                Ok(status) => Ended::Exited(status),
                Err(error) => Ended::NotStarted(format!("it cannot be kept: {error}")),
            };
            report(&queue, Event::Ended(index, ended));
        });
    }

    fn on_ended(&mut self, index: usize, ended: &Ended) {
        self.kept[index].group = None;

        if self.kept[index].planned.part == Part::Simulator {
            self.on_simulator_ended(index, ended);
        } else if self.kept[index].is_down {
            tracing::debug!(
                "{} was killed by the scenario",
                self.kept[index].planned.name
            );
        } else if self.stage == Stage::Running {
            self.on_other_ended(index, ended);
        } else if ended.has_failed() && self.stage <= Stage::Leaving {
            self.tell.notice(format!(
                "{} {ended} at the end of the run",
                self.kept[index].planned.name
            ));
        }
    }

    /// The run is over with its simulator.
    fn on_simulator_ended(&mut self, index: usize, ended: &Ended) {
        match (ended.has_failed(), self.stage) {
            (true, Stage::Running) => {
                self.fail(index, ended);
                self.terminate();
            }
            (true, Stage::Stopping) => {
                self.tell.notice(format!(
                    "{} {ended} while ending the run",
                    self.kept[index].planned.name
                ));
                self.terminate();
            }
            // A failure after the signal that asked for the end is the end that was asked for.
            _ => {
                self.enter(Stage::Leaving);
                // Robots hear that the run is over; who watches would go on watching.
                let observers = self
                    .kept
                    .iter()
                    .filter(|kept| kept.planned.part == Part::Observer);
                observers
                    .filter_map(|kept| kept.group)
                    .for_each(|group| group.signal(Signal::SIGTERM));
            }
        }
    }

    /// A process other than the simulator is over before the run is.
    fn on_other_ended(&mut self, index: usize, ended: &Ended) {
        let kept = &mut self.kept[index];
        let (name, has_failed) = (kept.planned.name.clone(), ended.has_failed());
        if kept.planned.restart.applies(has_failed) {
            if let Some((wait, number)) = kept.budget.spend(Instant::now()) {
                let wait_s = wait.as_secs_f64();
                self.tell.notice(format!(
                    "{name} {ended}; restart {number} of {BUDGET} in {wait_s:.1} s"
                ));
                return self.after(wait, Event::RestartDue(index));
            }
            self.tell.notice(format!(
                "{name} {ended}, and has been restarted {BUDGET} times already"
            ));
        }

        if !has_failed {
            // Robots leave when they hear that the run is over, often before the simulator does.
            tracing::debug!("{name} {ended}");
        } else if kept.planned.is_required {
            self.fail(index, ended);
            self.stop();
        } else {
            let log = log_of(&self.logs, &name);
            let text =
                format!("{name} {ended}; it is not required, and the run goes on without it");
            self.tell
                .notice(format!("{text} (its log: {})", log.display()));
        }
    }

    fn on_restart_due(&mut self, index: usize) {
        if self.stage == Stage::Running {
            self.tell.notice(format!(
                "{} is started again",
                self.kept[index].planned.name
            ));
            self.start(index);
        }
    }

    fn on_asked(&mut self, signal: Signal) {
        self.outcome.asked.get_or_insert(signal);
        if self.stage >= Stage::Terminating || signal == Signal::SIGQUIT {
            self.tell.notice("killing all processes");
            self.kill();
        } else {
            self.tell
                .notice("ending all processes; once more to kill them");
            self.terminate();
        }
    }

    fn on_grace_over(&mut self, stage: Stage) {
        if stage != self.stage {
            return; // The end went on faster than that.
        }

        match stage {
            Stage::Running | Stage::GivenUp => {
                unreachable!("no patience with a stage that waits for nothing")
            }
            Stage::Stopping | Stage::Leaving => {
                self.name_those_left("still there after the end of the run");
                self.terminate();
            }
            Stage::Terminating => {
                self.name_those_left("still there after the signal to end");
                self.kill();
            }
            Stage::Killing => {
                self.name_those_left("cannot be killed");
                self.stage = Stage::GivenUp;
            }
        }
    }

    fn name_those_left(&self, what: &str) {
        let left = self.kept.iter().filter(|kept| kept.group.is_some());
        let names: Vec<&str> = left.map(|kept| kept.planned.name.as_str()).collect();
        self.tell.notice(format!("{}: {what}", names.join(", ")));
    }

    /// Remembers the first failure, and says it at once.
    fn fail(&mut self, index: usize, ended: &Ended) {
        let kept = &self.kept[index];
        let name = kept.planned.name.clone();
        self.tell.notice(format!("{name} {ended}: ending the run"));
        let log = log_of(&self.logs, &name);
        let failure = Failure {
            text: format!("{name} {ended}"),
            code: ended.code(),
            tail: kept.tail.lines(),
            log,
        };

        self.outcome.failure.get_or_insert(failure);
    }

    /// Lets the simulator end the run in good order: it writes its record, and the robots leave.
    fn stop(&mut self) {
        match self
            .kept
            .iter()
            .find(|kept| kept.planned.part == Part::Simulator)
            .and_then(|kept| kept.group)
        {
            Some(simulator) => {
                simulator.signal(Signal::SIGTERM);
                self.enter(Stage::Stopping);
            }
            None => self.terminate(),
        }
    }

    fn terminate(&mut self) {
        self.signal_all(Signal::SIGTERM);
        // A process that is stopped hears nothing until it goes on.
        self.signal_all(Signal::SIGCONT);
        self.enter(Stage::Terminating);
    }

    fn kill(&mut self) {
        self.signal_all(Signal::SIGKILL);
        self.enter(Stage::Killing);
    }

    fn signal_all(&self, signal: Signal) {
        self.kept
            .iter()
            .filter_map(|kept| kept.group)
            .for_each(|group| group.signal(signal));
    }

    fn enter(&mut self, stage: Stage) {
        if stage > self.stage {
            self.stage = stage;
            self.after(self.grace, Event::GraceOver(stage));
        }
    }

    fn after(&self, wait: Duration, event: Event) {
        let queue = self.queue.clone();
        tokio::spawn(async move {
            tokio::time::sleep(wait).await;
            report(&queue, event);
        });
    }
}

/// Nobody listens any more only when the launch is over.
fn report(queue: &UnboundedSender<Event>, event: Event) {
    let _over = queue.send(event);
}

fn log_of(logs: &Path, name: &str) -> PathBuf {
    logs.join(format!("{name}.log"))
}

mod faults;
#[cfg(test)]
mod tests;
