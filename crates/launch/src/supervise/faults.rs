//! Carries out the faults that a scenario orders for the robots' processes.

use std::time::Duration;

use super::{FaultsDone, Shutdown, Supervisor, SupervisorEvent};
use nix::sys::signal::Signal;
use protocol::RobotName;
use protocol::messages::{FaultKind, ProcessOrder};

/// How long a slowed process is stopped at a time \[I\].
const SLOW_STOP: Duration = Duration::from_millis(40);
/// How long it runs in between \[I\].
const SLOW_GO: Duration = Duration::from_millis(10);

impl Supervisor {
    /// Carries orders out and reports it. Orders are idempotent, because the simulator may repeat them.
    pub(super) fn on_faults(&mut self, orders: &[ProcessOrder], done: FaultsDone) {
        // A run that ends has no use for faults: its simulator has exited, or has received SIGTERM.
        if self.stage != Shutdown::Running {
            return;
        }

        for order in orders {
            let robot = &order.robot;
            match self.index_of(robot) {
                Some(index) if order.begins => self.begin_fault(index, order),
                Some(index) => self.end_fault(index, order.kind),
                None => self.notice(format!(
                    "{robot} is not started by this launcher: carry its fault out yourself"
                )),
            }
        }
        // What can be done at once has been done. Whether it has had its effect the simulator sees by
        // the tokens.
        (done.0)();
    }

    /// The process of a robot, unless the user starts it.
    fn index_of(&self, robot: &RobotName) -> Option<usize> {
        let mut processes = self.processes.iter();
        let index = processes.position(|process| process.planned.robots.contains(robot))?;
        (!self.processes[index].planned.is_extern).then_some(index)
    }

    fn begin_fault(&mut self, index: usize, order: &ProcessOrder) {
        let process = &mut self.processes[index];
        match order.kind {
            FaultKind::Crash if process.is_down => return,
            FaultKind::Crash => {
                // Before the signal: the end of the process is then not a failure.
                process.is_down = true;
                process.signal(Signal::SIGKILL);
            }
            // To stop a process that is stopped changes nothing.
            FaultKind::Hang => process.signal(Signal::SIGSTOP),
            // The simulator orders it as a crash and its end.
            FaultKind::Restart => return,
            FaultKind::Slow if process.is_slow => return,
            FaultKind::Slow => {
                process.is_slow = true;
                self.pulse(index, true);
            }
        }

        let duration = order.for_s.map(Duration::try_from_secs_f64);
        if let Some(Ok(duration)) = duration {
            self.after(duration, SupervisorEvent::FaultOver(index, order.kind));
        }
    }

    /// Ends a fault, by order or after its wall-clock duration.
    pub(super) fn end_fault(&mut self, index: usize, kind: FaultKind) {
        let process = &mut self.processes[index];

        match kind {
            FaultKind::Crash if process.is_down && process.group.is_some() => {
                // The exit of the killed process has not been handled yet.
                self.after(SLOW_GO, SupervisorEvent::FaultOver(index, kind));
            }
            // The second of two orders to end it finds it up.
            FaultKind::Crash if process.is_down => {
                process.is_down = false;
                if self.stage == Shutdown::Running {
                    self.start(index);
                }
            }
            FaultKind::Crash | FaultKind::Restart => {}
            FaultKind::Hang => process.signal(Signal::SIGCONT),
            FaultKind::Slow => {
                process.is_slow = false;
                // In case that it is just in the stopped part of a pulse. The pulse itself ends when it
                // is due.
                process.signal(Signal::SIGCONT);
            }
        }
    }

    /// Stops or continues a slowed process, and schedules the opposite.
    pub(super) fn pulse(&mut self, index: usize, stops: bool) {
        if !self.processes[index].is_slow || self.stage != Shutdown::Running {
            return;
        }

        let next = SupervisorEvent::Pulse(index, !stops);
        let process = &self.processes[index];
        if stops {
            process.signal(Signal::SIGSTOP);
            self.after(SLOW_STOP, next);
        } else {
            process.signal(Signal::SIGCONT);
            self.after(SLOW_GO, next);
        }
    }
}
