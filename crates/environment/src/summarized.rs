//! The summary of a run as it goes on.

use protocol::{Event, RunName, Tick};
use record::Summary;
use record::summary::QueryReach;

use crate::simulation::Simulation;

impl Simulation {
    /// The empty summary of the epoch.
    #[must_use]
    pub fn begin_summary(&self, run: &RunName) -> Summary {
        Summary::begin(run, self.scenario())
    }

    /// Counts an event of a tick.
    pub fn count(&self, summary: &mut Summary, tick: Tick, event: &Event) {
        let reach = QueryReach {
            unreachable: self.unreachable(),
            in_range: self.in_range(),
        };
        summary.count(self.scenario().tick_s, reach, tick, event);
    }

    /// Completes the summary at the end of the epoch.
    pub fn finish_summary(&self, summary: &mut Summary) {
        let tick_s = self.scenario().tick_s;
        summary.finish(self.tick(), tick_s, self.digest(), |robot| {
            self.state_variables(robot).cloned()
        });
        summary.guest_motion.held_ticks = self.world().held_ticks();
        summary.measures = self.measurements().measured();
    }
}
