//! Draws plans of faults from a seed.

use protocol::messages::Point;
use protocol::random::{Stream, unit};
use protocol::{RobotName, Tick};
use scenario::MAX_GUESTS;
use scenario::Scenario;

use super::fault::{AbsenceReason, Effect, FaultClass, Messages, PlannedFault, TickSpan};

use super::sent::{Link, Onset};
use super::trial::TrialResult;

/// Most faults of a plan that is drawn anew.
const MAX_FAULTS: usize = 4;
/// Most faults of a plan that goes on from a state, with those that led to it.
pub(super) const MAX_STEPS: usize = 8;
/// How often the time after a state is halved at most, so that faults soon after it are as likely as later ones.
const HALVINGS: usize = 6;
/// Seeds of re-seeds are below this number, so that people can read them.
const MAX_RESEED: usize = 1_000_000_000;
/// Longest delay of a single command, ticks.
const MAX_LATE_TICKS: usize = 256;
/// Most obstacles of a wall.
const MAX_WALL: usize = 8;
/// Shortest time of a fault, ticks, unless the hunt draws shorter ones only.
const SHORTEST_TICKS: Tick = 10;
/// How often the shortest time is doubled at most, so that short and long times are as likely.
const DOUBLINGS: usize = 8;
/// Attempts to place an obstacle where no robot begins.
const ATTEMPTS: usize = 10;

/// What faults are drawn for: the scenario, and its run without any.
#[derive(Debug)]
pub struct Ground {
    scenario: Scenario,
    roster: Vec<RobotName>,
    /// The beginning of the run without faults.
    beginning: Onset,
    kinds: Vec<FaultClass>,
    /// Those of them that can begin in the middle of a run.
    later_kinds: Vec<FaultClass>,
    /// Longest time of a fault.
    longest_ticks: Tick,
}

impl Ground {
    /// The faults of these kinds that a scenario can have, which was played without any; none lasts longer than
    /// `longest_s`, simulated seconds.
    #[must_use]
    pub fn new(
        scenario: &Scenario,
        played: &TrialResult,
        kinds: &[FaultClass],
        longest_s: f64,
    ) -> Self {
        let mut ground = Self {
            scenario: scenario.clone(),
            roster: scenario.roster(),
            beginning: Onset::of(&played.sent, 0),
            kinds: Vec::new(),
            later_kinds: Vec::new(),
            longest_ticks: ((longest_s / scenario.tick_s).round() as Tick).max(1),
        };
        for kind in kinds {
            if ground.has(*kind) {
                ground.kinds.push(*kind);
            }
        }
        let later = ground.kinds.iter().copied();
        ground.later_kinds = later.filter(|kind| kind.can_begin_later()).collect();
        ground
    }

    /// The kinds that are drawn.
    #[must_use]
    pub fn kinds(&self) -> &[FaultClass] {
        &self.kinds
    }

    fn has(&self, kind: FaultClass) -> bool {
        match kind {
            FaultClass::Lose | FaultClass::Late | FaultClass::Double => {
                !self.links(&self.beginning).is_empty()
            }
            FaultClass::Loss
            | FaultClass::Burst
            | FaultClass::Delay
            | FaultClass::Duplication
            | FaultClass::Partition
            | FaultClass::OneWay => self.roster.len() > 1,
            FaultClass::Crash | FaultClass::Hang => !self.roster.is_empty(),
            FaultClass::Wall | FaultClass::Reseed => true,
            FaultClass::Crowd => self.scenario.guests.count > 0,
        }
    }

    /// A new plan of one to four faults; fewer are more likely.
    pub fn draw(&self, chance: &mut Stream) -> Vec<PlannedFault> {
        let mut faults = Vec::new();
        self.add(&mut faults, &self.kinds, &self.beginning, chance);
        while faults.len() < MAX_FAULTS && unit(chance) < 0.5 {
            self.add(&mut faults, &self.kinds, &self.beginning, chance);
        }
        faults
    }

    /// Whether something can be drawn for the time after a state to which these faults led.
    pub(super) fn can_go_on(&self, faults: &[PlannedFault]) -> bool {
        !self.later_kinds.is_empty() && faults.len() < MAX_STEPS
    }

    /// A plan that goes on from a moment to which these faults led: in every second one chance is another one from then on, and
    /// further faults begin.
    pub(super) fn go_on(
        &self,
        faults: &[PlannedFault],
        onset: &Onset,
        chance: &mut Stream,
    ) -> Vec<PlannedFault> {
        let mut faults = faults.to_vec();
        let can_reseed = self.later_kinds.contains(&FaultClass::Reseed);
        if can_reseed && unit(chance) < 0.5 {
            self.add(&mut faults, &[FaultClass::Reseed], onset, chance);
        } else {
            self.add(&mut faults, &self.later_kinds, onset, chance);
        }
        while faults.len() < MAX_STEPS && unit(chance) < 0.5 {
            self.add(&mut faults, &self.later_kinds, onset, chance);
        }
        faults
    }

    /// Adds a fault of one of these kinds. Chance becomes another one once in a tick.
    fn add(
        &self,
        faults: &mut Vec<PlannedFault>,
        kinds: &[FaultClass],
        onset: &Onset,
        chance: &mut Stream,
    ) {
        let kind = kinds[below(kinds.len(), chance)];
        let fault = self.fault(kind, onset, chance);
        let is_twice = faults.iter().any(|other| match (other, &fault) {
            (PlannedFault::Reseed { at: one, .. }, PlannedFault::Reseed { at: other, .. }) => {
                one == other
            }
            _ => false,
        });
        if !is_twice {
            faults.push(fault);
        }
    }

    fn fault(&self, kind: FaultClass, onset: &Onset, chance: &mut Stream) -> PlannedFault {
        match kind {
            FaultClass::Lose => {
                let (link, number) = self.command(onset, chance);
                PlannedFault::Lose { link, number }
            }
            FaultClass::Late => {
                let (link, number) = self.command(onset, chance);
                let most = MAX_LATE_TICKS >> below(DOUBLINGS, chance);
                let by = 1 + below(most, chance) as Tick;
                PlannedFault::Late { link, number, by }
            }
            FaultClass::Double => {
                let (link, number) = self.command(onset, chance);
                PlannedFault::Double { link, number }
            }
            FaultClass::Reseed => PlannedFault::Reseed {
                at: onset.after + 1,
                seed: 1 + below(MAX_RESEED, chance) as u64,
                of: Vec::new(),
            },
            FaultClass::Loss => {
                let effect = Effect::Loss(5 * (1 + below(20, chance) as u64));
                self.channel(self.messages(chance), effect, onset, chance)
            }
            FaultClass::Burst => {
                let enter = 1 + below(20, chance) as u64;
                let leave = 5 * (1 + below(10, chance) as u64);
                let effect = Effect::Burst(enter, leave);
                self.channel(self.messages(chance), effect, onset, chance)
            }
            FaultClass::Delay => {
                let effect = Effect::Delay(1 << below(6, chance));
                self.channel(Messages::Commands, effect, onset, chance)
            }
            FaultClass::Duplication => {
                let effect = Effect::Duplication(5 * (1 + below(20, chance) as u64));
                self.channel(Messages::Commands, effect, onset, chance)
            }
            FaultClass::Partition => self.partition(false, onset, chance),
            FaultClass::OneWay => self.partition(true, onset, chance),
            FaultClass::Crash => self.absence(AbsenceReason::Crash, onset, chance),
            FaultClass::Hang => self.absence(AbsenceReason::Hang, onset, chance),
            FaultClass::Wall => self.wall(chance),
            FaultClass::Crowd => {
                let count = self.scenario.guests.count;
                let more = 1 + below(count, chance);
                let guests = (count + more).min(MAX_GUESTS);
                PlannedFault::Crowd { guests }
            }
        }
    }

    /// The links to robots of the roster on which commands are sent.
    fn links<'a>(&self, onset: &'a Onset) -> Vec<(&'a Link, (u64, u64))> {
        let links = onset.links.iter().map(|(link, counts)| (link, *counts));
        links
            .filter(|(link, _)| self.scenario.robots.contains_key(&link.to))
            .collect()
    }

    /// A command on which nothing is decided in a onset: its link and its number.
    fn command(&self, onset: &Onset, chance: &mut Stream) -> (Link, u64) {
        let mut links = self.links(onset);
        if links.is_empty() {
            links = self.links(&self.beginning);
        }
        let (link, (decided, all)) = links[below(links.len(), chance)];
        // At the end of a run there may be none. In another run there may be one.
        let left = usize::try_from((all - decided).max(1)).unwrap_or(usize::MAX);
        let number = decided + 1 + below(soon(left, onset, chance), chance) as u64;
        (link.clone(), number)
    }

    fn messages(&self, chance: &mut Stream) -> Messages {
        if unit(chance) < 0.75 {
            Messages::Commands
        } else {
            Messages::Queries
        }
    }

    fn channel(
        &self,
        of: Messages,
        effect: Effect,
        onset: &Onset,
        chance: &mut Stream,
    ) -> PlannedFault {
        let mut link = None;
        if unit(chance) < 0.5 {
            let from = below(self.roster.len(), chance);
            let further = 1 + below(self.roster.len() - 1, chance);
            let to = (from + further) % self.roster.len();
            link = Some(Link {
                from: self.roster[from].clone(),
                to: self.roster[to].clone(),
            });
        }

        PlannedFault::Channel {
            link,
            of,
            effect,
            span: self.span(onset, chance),
        }
    }

    fn absence(&self, why: AbsenceReason, onset: &Onset, chance: &mut Stream) -> PlannedFault {
        let robot = self.roster[below(self.roster.len(), chance)].clone();
        let span = self.span(onset, chance);
        PlannedFault::Absence { robot, why, span }
    }

    /// A partition of one robot from the others, or of two halves.
    fn partition(&self, one_way: bool, onset: &Onset, chance: &mut Stream) -> PlannedFault {
        let first = below(self.roster.len(), chance);
        let mut one = vec![self.roster[first].clone()];
        let mut other = Vec::new();
        for (index, robot) in self.roster.iter().enumerate() {
            if index == first {
                continue;
            }
            // The last robot decides whether the second group has any.
            let is_last = other.is_empty() && one.len() == self.roster.len() - 1;
            if !is_last && unit(chance) < 0.3 {
                one.push(robot.clone());
            } else {
                other.push(robot.clone());
            }
        }

        let cuts = match below(4, chance) {
            0 => vec![Messages::Commands],
            1 => vec![Messages::Queries],
            _ => vec![Messages::Commands, Messages::Queries],
        };
        let is_swapped = unit(chance) < 0.5;
        if is_swapped {
            std::mem::swap(&mut one, &mut other);
        }
        PlannedFault::Partition {
            one,
            other,
            one_way,
            cuts,
            span: self.span(onset, chance),
        }
    }

    /// A row of touching obstacles along one of the axes, without those that would stand on a robot or off the field.
    fn wall(&self, chance: &mut Stream) -> PlannedFault {
        let mut at = Vec::new();
        for _ in 0..ATTEMPTS {
            let is_upright = unit(chance) < 0.5;
            let length = 1 + below(MAX_WALL, chance);
            let [width_m, height_m] = self.scenario.field_m;
            let body_m = self.scenario.body_m;
            let begin_x = unit(chance) * width_m;
            let begin_y = unit(chance) * height_m;

            for index in 0..length {
                let along_m = index as f64 * body_m;
                let (x, y) = if is_upright {
                    (begin_x, begin_y + along_m)
                } else {
                    (begin_x + along_m, begin_y)
                };

                // Centimeters, so that the file is readable.
                let place = Point::new((x * 100.0).round() / 100.0, (y * 100.0).round() / 100.0);
                if self.is_free(place) {
                    at.push(place);
                }
            }

            if !at.is_empty() {
                break;
            }
        }

        PlannedFault::Wall { at }
    }

    fn is_free(&self, place: Point) -> bool {
        let body_m = self.scenario.body_m;
        let [width_m, height_m] = self.scenario.field_m;
        let is_inside = |at: f64, size_m: f64| at >= body_m / 2.0 && at <= size_m - body_m / 2.0;
        let mut robots = self.scenario.robots.values();
        let is_on_robot = robots.any(|robot| {
            let is_beside_x = (robot.at.x - place.x).abs() >= body_m;
            let is_beside_y = (robot.at.y - place.y).abs() >= body_m;
            !is_beside_x && !is_beside_y
        });
        is_inside(place.x, width_m) && is_inside(place.y, height_m) && !is_on_robot
    }

    /// A time that begins in the run, after a onset.
    fn span(&self, onset: &Onset, chance: &mut Stream) -> TickSpan {
        let left = self.scenario.ticks.saturating_sub(onset.after).max(1);
        let left = usize::try_from(left).unwrap_or(usize::MAX);
        let from = onset.after + 1 + below(soon(left, onset, chance), chance) as Tick;
        let scale = SHORTEST_TICKS << below(DOUBLINGS, chance);
        let lasting = scale + below(scale as usize, chance) as Tick;
        TickSpan {
            from,
            until: from + lasting.min(self.longest_ticks),
        }
    }
}

/// How many of the next things one is drawn from, of those that are left: all at the beginning of a run. After a state often only the
/// first ones, because it may not last.
fn soon(left: usize, onset: &Onset, chance: &mut Stream) -> usize {
    if onset.after == 0 {
        return left;
    }
    (left >> below(HALVINGS, chance)).max(1)
}

/// A number from 0 up to but not including `end`, which is not 0.
pub(super) fn below(end: usize, chance: &mut Stream) -> usize {
    ((unit(chance) * end as f64) as usize).min(end - 1)
}
