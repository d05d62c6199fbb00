//! What a scenario has in store for the robots' processes, done to the real ones.

use std::time::Duration;

use nix::sys::signal::Signal;
use protocol::messages::{FaultKind, ProcessOrder};

use super::{Done, Event, Stage, Supervisor};

/// A slowed process stands still for this long, and goes on for as long as the second says \[I\].
const SLOW_STOP: Duration = Duration::from_millis(40);
const SLOW_GO: Duration = Duration::from_millis(10);

impl Supervisor {
    /// Carries orders out, and says so. What has been done already is not done again.
    pub(super) fn on_faults(&mut self, orders: &[ProcessOrder], done: Done) {
        if self.stage != Stage::Running {
            return;
        }

        for order in orders {
            let runs = |kept: &super::Kept| kept.planned.robots.contains(&order.robot);
            let Some(index) = self
                .kept
                .iter()
                .position(runs)
                .filter(|index| !self.kept[*index].planned.is_extern)
            else {
                self.tell.notice(format!(
                    "{} is not run by this launcher: its fault is yours to bring about",
                    order.robot
                ));
                continue;
            };
            if order.begins {
                self.begin_fault(index, order);
            } else {
                self.end_fault(index, order.kind);
            }
        }

        (done.0)();
    }

    fn begin_fault(&mut self, index: usize, order: &ProcessOrder) {
        let kept = &mut self.kept[index];

        match order.kind {
            FaultKind::Crash if kept.is_down => return,
            FaultKind::Crash => {
                kept.is_down = true;
                self.signal(index, Signal::SIGKILL);
            }
            FaultKind::Hang => self.signal(index, Signal::SIGSTOP),
            FaultKind::Slow if kept.is_slow => return,
            FaultKind::Slow => {
                kept.is_slow = true;
                self.pulse(index, true);
            }
        }

        if let Some(wall) = order
            .for_s
            .and_then(|for_s| Duration::try_from_secs_f64(for_s).ok())
        {
            self.after(wall, Event::FaultOver(index, order.kind));
        }
    }

    /// A fault is over, by order or by the wall clock.
    pub(super) fn end_fault(&mut self, index: usize, kind: FaultKind) {
        let kept = &mut self.kept[index];

        match kind {
            FaultKind::Crash if kept.is_down && kept.group.is_some() => {
                // Its end has not been noticed yet.
                self.after(SLOW_GO, Event::FaultOver(index, kind));
            }
            FaultKind::Crash if kept.is_down => {
                kept.is_down = false;
                if self.stage == Stage::Running {
                    self.start(index);
                }
            }
            FaultKind::Crash => {}
            FaultKind::Hang => self.signal(index, Signal::SIGCONT),
            FaultKind::Slow => {
                kept.is_slow = false;
                self.signal(index, Signal::SIGCONT);
            }
        }
    }

    /// Stops a slowed process, or lets it go on for a moment.
    pub(super) fn pulse(&mut self, index: usize, stops: bool) {
        if !self.kept[index].is_slow || self.stage != Stage::Running {
            return;
        }

        let (signal, wait) = if stops {
            (Signal::SIGSTOP, SLOW_STOP)
        } else {
            (Signal::SIGCONT, SLOW_GO)
        };

        self.signal(index, signal);
        self.after(wait, Event::Pulse(index, !stops));
    }

    fn signal(&self, index: usize, signal: Signal) {
        if let Some(group) = self.kept[index].group {
            group.signal(signal);
        }
    }
}
