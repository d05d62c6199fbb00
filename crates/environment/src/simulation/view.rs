//! What observers read of a simulation.

use std::collections::BTreeMap;
use std::sync::Arc;

use observe::{Measurements, RobotState};
use protocol::messages::{Cut, GuestMood, Point, Pose, Report, Standing, StateVariables};
use protocol::random::Stream;
use protocol::{Epoch, RobotName, Tick};
use scenario::{Scenario, to_wire};
use world::World;

use crate::driving::pose;
use crate::layers::Layers;
use crate::sites::Sites;
use crate::static_world::guest_sample;

use super::Simulation;

impl Simulation {
    /// What a robot reported last, and where it stands; `None` before its first report.
    #[must_use]
    pub fn robot_state(&self, name: &RobotName) -> Option<RobotState<'_>> {
        let report = self.reports.get(name)?;
        Some(RobotState {
            location: *self.stood_at.get(self.index(name)?)?,
            state_variables: &report.state_variables,
            emotion_state: &report.emotion_state,
            behavior_state: &report.behavior_state,
        })
    }

    /// The measures of the scenario up to the last complete tick, or at the end of the run.
    #[must_use]
    pub fn measurements(&self) -> &Measurements {
        &self.measurements
    }

    /// How the expectations of the scenario stand.
    #[must_use]
    pub fn standings(&self) -> Vec<Standing> {
        self.watches.standings()
    }

    pub(super) fn index(&self, name: &RobotName) -> Option<usize> {
        self.names.binary_search(name).ok()
    }

    /// Location of a robot; `None` if it is not in the roster.
    #[must_use]
    pub fn location(&self, name: &RobotName) -> Option<Point> {
        let index = self.index(name)?;
        Some(to_wire(self.world.robots()[index]))
    }

    /// The pose of a robot that drives like wheels; `None` for any other one.
    #[must_use]
    pub fn pose(&self, name: &RobotName) -> Option<Pose> {
        pose(&self.world, self.index(name)?)
    }

    /// The guests that frames have, their number and their center: all that are on the field, or every so manyth of very many.
    pub fn shown_guests(&self) -> impl Iterator<Item = (usize, world::Point)> + '_ {
        let step = guest_sample(self.world.guests().len()).unwrap_or(1) as usize;
        let present = self.world.present_guests();
        present.filter(move |(guest, _)| guest % step == 0)
    }

    /// The numbers of the guests that frames have, in their order; empty where all are on the field all the time.
    #[must_use]
    pub fn guest_numbers(&self) -> Vec<u32> {
        let are_counted = guest_sample(self.world.guests().len()).is_none();
        if are_counted && !self.world.has_passages() {
            return Vec::new();
        }
        self.shown_guests()
            .map(|(guest, _)| u32::try_from(guest).unwrap_or(u32::MAX))
            .collect()
    }

    /// Guests that are not content, by their index among those that frames have, by mood.
    #[must_use]
    pub fn guest_moods(&self) -> BTreeMap<GuestMood, Vec<u32>> {
        self.guests
            .moods(self.shown_guests().map(|(guest, _)| guest))
    }

    /// The sites.
    #[must_use]
    pub fn sites(&self) -> &Sites {
        &self.sites
    }

    /// The state of a site; `None` if the scenario has no such site.
    #[must_use]
    pub fn site_state(&self, name: &str) -> Option<&StateVariables> {
        self.sites.state(name)
    }

    /// The layers.
    #[must_use]
    pub fn layers(&self) -> &Layers {
        &self.layers
    }

    /// Whether a robot's last move was blocked.
    #[must_use]
    pub fn is_blocked(&self, name: &RobotName) -> bool {
        self.index(name).is_some_and(|index| self.blocked[index])
    }

    /// The last complete tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The epoch.
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The scenario.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Simulated time of a tick, seconds.
    #[must_use]
    pub fn time_s(&self, tick: Tick) -> f64 {
        protocol::time::time_s(tick, self.scenario.tick_s)
    }

    /// The robots, in the order of their names.
    #[must_use]
    pub fn names(&self) -> &[RobotName] {
        &self.names
    }

    /// The environment, for observers.
    #[must_use]
    pub fn world(&self) -> &World<Stream> {
        &self.world
    }

    /// The last report of a robot.
    #[must_use]
    pub fn report(&self, name: &RobotName) -> Option<&Report> {
        self.reports.get(name).map(Arc::as_ref)
    }

    /// The last state variables of a robot.
    #[must_use]
    pub fn state_variables(&self, name: &RobotName) -> Option<&StateVariables> {
        self.report(name).map(|report| &report.state_variables)
    }

    /// Pairs of robots whose link is cut now.
    #[must_use]
    pub fn cuts(&self) -> Vec<Cut> {
        self.medium.cuts()
    }

    /// Robots that each robot cannot query in this tick, though its radio reaches them.
    #[must_use]
    pub fn unreachable(&self) -> &BTreeMap<RobotName, Vec<RobotName>> {
        &self.unreachable
    }

    /// The robots within the range of the radio of each robot in the tick in progress; `None` where distance does not matter.
    #[must_use]
    pub fn in_range(&self) -> Option<&BTreeMap<RobotName, Vec<RobotName>>> {
        self.in_range.as_ref()
    }

    /// Digest of the run so far.
    #[must_use]
    pub fn digest(&self) -> String {
        self.digest.to_string()
    }
}
