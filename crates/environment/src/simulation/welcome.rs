//! The welcome of a robot that joins: what it needs to go on from the last tick.

use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::messages::{
    DriveLimits, NEWS_FLAGS, Parameters, ParametersOffer, PublicState, Report, Welcome,
};
use protocol::{Generation, PROTOCOL_VERSION, RobotName, RunName, Tick, encode};

use crate::driving::drive_limits;

use super::Simulation;

/// Most bytes of parameters of one kind of other times in a welcome, so that it fits into a message.
const MAX_OTHER_PARAMETERS: usize = MAX_MESSAGE_BYTES / 4;

impl Simulation {
    /// The next tick that a robot that joins now runs.
    fn next_tick(&self) -> Tick {
        let has_begun = !self.stood_at.is_empty();
        if has_begun { self.tick + 1 } else { 0 }
    }

    /// The welcome of a robot that joins; `None` if it is not in the roster. `open` is a report that an earlier incarnation
    /// has sent for the tick in progress.
    #[must_use]
    pub fn welcome(
        &self,
        run: &RunName,
        name: &RobotName,
        generation: Generation,
        open: Option<&Report>,
    ) -> Option<Welcome> {
        let next_tick = self.next_tick();
        let parameters = self.scenario.parameters_at(name, next_tick)?;
        let earlier = self.scenario.parameters_before(name, next_tick).into_iter();
        let later = self.scenario.parameters_after(name, next_tick);
        let index = self.index(name)?;
        let location = self.location(name)?;
        let open_state = open.map(|report| report.state(location));
        let last_state = self.last_state(name);

        Some(Welcome {
            protocol: PROTOCOL_VERSION,
            run: run.clone(),
            name: name.clone(),
            generation,
            epoch: self.epoch,
            tick: self.tick,
            seed: self.scenario.stream_seed(name, next_tick),
            stream: self.stream_of(name, generation, open),
            tick_s: self.scenario.tick_s,
            field_m: self.scenario.field_m,
            body_m: self.scenario.body_m,
            sensing_range_m: self.scenario.sensing.range_m,
            rays: self.scenario.sensing.rays,
            drive: self.drive_limits(name),
            location,
            roster: self.names.clone(),
            known_sites: self.sites.known(),
            parameters: parameters.clone(),
            earlier_parameters: within_message(earlier),
            later_parameters: within_message(later),
            reseeds: self.scenario.stream_reseeds(name, next_tick),
            news_flag: 1 << (index % NEWS_FLAGS),
            // With an answer to the open tick the newest state is that one, and others may still query
            // the one before.
            state_before: open_state.as_ref().and(last_state.clone()),
            last_state: open_state.or(last_state),
        })
    }

    /// The limits of a robot that drives like wheels; `None` for any other one.
    fn drive_limits(&self, name: &RobotName) -> Option<DriveLimits> {
        let wheels = self.scenario.robots.get(name)?.wheels?;
        Some(drive_limits(&wheels, self.scenario.max_speed_mps))
    }

    /// The state of a robot as of the last complete tick, if it has reported.
    #[must_use]
    pub fn last_state(&self, name: &RobotName) -> Option<PublicState> {
        let report = self.reports.get(name)?;
        let location = self.stood_at.get(self.index(name)?)?;
        Some(report.state(*location))
    }

    /// The name of a robot's random stream. The first incarnation in an epoch draws from the stream of its name; a later one
    /// must not draw the same numbers again.
    fn stream_of(&self, name: &RobotName, generation: Generation, open: Option<&Report>) -> String {
        match self.incarnation(name, generation, open) {
            1 => format!("robot/{name}"),
            incarnation => format!("robot/{name}#{incarnation}"),
        }
    }
}

/// The first of these parameters, as many as have a place in a welcome.
fn within_message<'a>(all: impl Iterator<Item = &'a Parameters>) -> Vec<Parameters> {
    let mut bytes = 0;
    let mut within = Vec::new();
    for parameters in all {
        bytes += encode(&ParametersOffer {
            parameters: parameters.clone(),
        })
        .len();

        // Without gaps: a robot goes through them in their order.
        if bytes > MAX_OTHER_PARAMETERS {
            break;
        }
        within.push(parameters.clone());
    }
    within
}
