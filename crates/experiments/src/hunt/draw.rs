//! Draws plans of faults from a seed.

use std::collections::BTreeMap;

use protocol::messages::Point;
use protocol::random::{Stream, unit};
use protocol::{RobotName, Tick};
use scenario::MAX_GUESTS;
use scenario::Scenario;

use super::fault::{AbsenceReason, Effect, FaultClass, Link, Messages, PlannedFault, TickSpan};
use super::trial::TrialResult;

/// Most faults of a plan.
const MAX_FAULTS: usize = 4;
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
    /// Number of commands on each link in the run without faults.
    sent: BTreeMap<Link, u64>,
    kinds: Vec<FaultClass>,
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
        let mut sent = BTreeMap::new();
        for message in &played.sent {
            if scenario.robots.contains_key(&message.link.to) {
                sent.insert(message.link.clone(), message.number);
            }
        }

        let mut ground = Self {
            scenario: scenario.clone(),
            roster: scenario.roster(),
            sent,
            kinds: Vec::new(),
            longest_ticks: ((longest_s / scenario.tick_s).round() as Tick).max(1),
        };
        for kind in kinds {
            if ground.has(*kind) {
                ground.kinds.push(*kind);
            }
        }
        ground
    }

    /// The kinds that are drawn.
    #[must_use]
    pub fn kinds(&self) -> &[FaultClass] {
        &self.kinds
    }

    fn has(&self, kind: FaultClass) -> bool {
        match kind {
            FaultClass::Lose => !self.sent.is_empty(),
            FaultClass::Loss
            | FaultClass::Burst
            | FaultClass::Delay
            | FaultClass::Duplication
            | FaultClass::Partition
            | FaultClass::OneWay => self.roster.len() > 1,
            FaultClass::Crash | FaultClass::Hang => !self.roster.is_empty(),
            FaultClass::Wall => true,
            FaultClass::Crowd => self.scenario.guests.count > 0,
        }
    }

    /// A new plan of one to four faults; fewer are more likely.
    pub fn draw(&self, chance: &mut Stream) -> Vec<PlannedFault> {
        let mut faults = vec![self.fault(chance)];
        while faults.len() < MAX_FAULTS && unit(chance) < 0.5 {
            faults.push(self.fault(chance));
        }
        faults
    }

    /// A plan that is like another one: a fault is replaced or added.
    pub fn mutate(&self, plan: &[PlannedFault], chance: &mut Stream) -> Vec<PlannedFault> {
        let mut faults = plan.to_vec();
        let fault = self.fault(chance);
        let is_full = faults.len() >= MAX_FAULTS;
        if !faults.is_empty() && (is_full || unit(chance) < 0.5) {
            let place = below(faults.len(), chance);
            faults[place] = fault;
        } else {
            faults.push(fault);
        }
        faults
    }

    fn fault(&self, chance: &mut Stream) -> PlannedFault {
        let kind = self.kinds[below(self.kinds.len(), chance)];
        match kind {
            FaultClass::Lose => self.lose(chance),
            FaultClass::Loss => {
                let effect = Effect::Loss(5 * (1 + below(20, chance) as u64));
                self.channel(self.messages(chance), effect, chance)
            }
            FaultClass::Burst => {
                let enter = 1 + below(20, chance) as u64;
                let leave = 5 * (1 + below(10, chance) as u64);
                let effect = Effect::Burst(enter, leave);
                self.channel(self.messages(chance), effect, chance)
            }
            FaultClass::Delay => {
                let effect = Effect::Delay(1 << below(6, chance));
                self.channel(Messages::Commands, effect, chance)
            }
            FaultClass::Duplication => {
                let effect = Effect::Duplication(5 * (1 + below(20, chance) as u64));
                self.channel(Messages::Commands, effect, chance)
            }
            FaultClass::Partition => self.partition(false, chance),
            FaultClass::OneWay => self.partition(true, chance),
            FaultClass::Crash => self.absence(AbsenceReason::Crash, chance),
            FaultClass::Hang => self.absence(AbsenceReason::Hang, chance),
            FaultClass::Wall => self.wall(chance),
            FaultClass::Crowd => {
                let count = self.scenario.guests.count;
                let more = 1 + below(count, chance);
                let guests = (count + more).min(MAX_GUESTS);
                PlannedFault::Crowd { guests }
            }
        }
    }

    fn lose(&self, chance: &mut Stream) -> PlannedFault {
        let links: Vec<(&Link, u64)> = self.sent.iter().map(|(link, n)| (link, *n)).collect();
        let (link, sent) = links[below(links.len(), chance)];
        let number = 1 + below(usize::try_from(sent).unwrap_or(usize::MAX), chance) as u64;
        PlannedFault::Lose {
            link: link.clone(),
            number,
        }
    }

    fn messages(&self, chance: &mut Stream) -> Messages {
        if unit(chance) < 0.75 {
            Messages::Commands
        } else {
            Messages::Queries
        }
    }

    fn channel(&self, of: Messages, effect: Effect, chance: &mut Stream) -> PlannedFault {
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
            span: self.span(chance),
        }
    }

    fn absence(&self, why: AbsenceReason, chance: &mut Stream) -> PlannedFault {
        let robot = self.roster[below(self.roster.len(), chance)].clone();
        let span = self.span(chance);
        PlannedFault::Absence { robot, why, span }
    }

    /// A partition of one robot from the others, or of two halves.
    fn partition(&self, one_way: bool, chance: &mut Stream) -> PlannedFault {
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
            span: self.span(chance),
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

    /// A time that begins in the run.
    fn span(&self, chance: &mut Stream) -> TickSpan {
        let ticks = usize::try_from(self.scenario.ticks).unwrap_or(usize::MAX);
        let from = 1 + below(ticks, chance) as Tick;
        let scale = SHORTEST_TICKS << below(DOUBLINGS, chance);
        let lasting = scale + below(scale as usize, chance) as Tick;
        TickSpan {
            from,
            until: from + lasting.min(self.longest_ticks),
        }
    }
}

/// A number from 0 up to but not including `end`, which is not 0.
pub(super) fn below(end: usize, chance: &mut Stream) -> usize {
    ((unit(chance) * end as f64) as usize).min(end - 1)
}
