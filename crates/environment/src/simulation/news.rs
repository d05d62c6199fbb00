//! The news of a tick: what robots learn of it, which is exceptions only.

use std::collections::{BTreeMap, BTreeSet};

use lockstep::{Bulletin, IncarnationNotice};
use protocol::RobotName;
use protocol::messages::{Correction, Delivery, TickUpdate};
use scenario::to_wire;
use world::MoveOutcome;

use crate::driving::pose;

use super::Simulation;

impl Simulation {
    /// Robots with news of the tick in progress.
    #[must_use]
    pub fn robots_with_news(&self) -> BTreeSet<RobotName> {
        self.news.keys().cloned().collect()
    }

    /// The news of a robot for the tick in progress, with the incarnations that they name. Those of an incarnation that takes
    /// part from this tick on always contain its location.
    #[must_use]
    pub fn news(&self, name: &RobotName, notice: IncarnationNotice) -> TickUpdate {
        let mut news = match self.news.get(name) {
            Some(news) => TickUpdate::clone(news),
            None => TickUpdate {
                epoch: self.epoch,
                tick: self.now,
                ..TickUpdate::default()
            },
        };

        news.joined = notice.joined;
        news.rejoin = notice.rejoin;
        if notice.joined.is_some() {
            let location = self.location(name);
            news.correction = news.correction.or(location.map(|location| Correction {
                location,
                blocked: false,
            }));
        }
        news
    }

    /// Whether the news of a robot contain the bodies around it, from the next tick on.
    pub fn list_bodies(&mut self, name: &RobotName, is_wanted: bool) {
        if is_wanted {
            self.with_bodies.insert(name.clone());
        } else {
            self.with_bodies.remove(name);
        }
    }

    /// Whether the news of a robot contain the ranges of its rays, from the next tick on.
    pub fn list_ranges(&mut self, name: &RobotName, is_wanted: bool) {
        if is_wanted {
            self.with_ranges.insert(name.clone());
        } else {
            self.with_ranges.remove(name);
        }
    }

    /// Composes the news of the tick in progress, which contain exceptions only.
    pub(super) fn compose_news(&mut self, verdicts: &[MoveOutcome]) {
        let mut all = BTreeMap::new();
        for (index, name) in self.names.iter().enumerate() {
            let viewpoint = self.viewpoint(index);
            let is_refused = !verdicts.is_empty() && self.blocked[index];
            // What a robot proposed that has missed the last tick did not count. An incarnation that takes part from this tick
            // on is named: see `Self::news`.
            let is_corrected = is_refused || self.silent.contains(name);
            let news = TickUpdate {
                epoch: self.epoch,
                tick: self.now,
                joined: None,
                rejoin: None,
                correction: is_corrected.then(|| Correction {
                    location: to_wire(self.world.robots()[index]),
                    blocked: is_refused,
                }),
                pose: pose(&self.world, index),
                commands: self.deliveries(name),
                in_range: self.robots_in_range(name),
                unreachable: self.unreachable.get(name).cloned().unwrap_or_default(),
                sensed: self.sensed_robots(index, &viewpoint),
                bodies: self.sensed_bodies(index, &viewpoint),
                ranges: self.sensed_ranges(index),
                sites: self.sensed_sites(index, &viewpoint),
                site_results: self.sites.results(name).to_vec(),
                layers: self.layers.near(to_wire(self.world.robots()[index])),
                layer_results: self.layers.results(name).to_vec(),
            };
            // A robot without news gets none: silence says that all is as it expects.
            if !news.is_empty() {
                all.insert(name.clone(), Box::new(news));
            }
        }

        self.news = all;
    }

    fn robots_in_range(&self, of: &RobotName) -> Option<Vec<RobotName>> {
        let in_range = self.in_range.as_ref()?;
        Some(in_range.get(of).cloned().unwrap_or_default())
    }

    fn deliveries(&self, to: &RobotName) -> Vec<Delivery> {
        let arrivals = self.arriving.get(to).into_iter().flatten();
        arrivals.map(|arrival| arrival.delivery.clone()).collect()
    }

    /// Robots that each robot cannot query: those from which the medium cuts it off, those whose last report is missing, those
    /// of which a new incarnation has just joined, and those whose processes have just been stopped.
    pub(super) fn join_unanswering(
        &self,
        mut cut: BTreeMap<RobotName, Vec<RobotName>>,
    ) -> BTreeMap<RobotName, Vec<RobotName>> {
        let mut unanswering = self.silent.clone();
        unanswering.extend_from_slice(&self.newcomers);
        unanswering.extend_from_slice(&self.stopped);
        if unanswering.is_empty() {
            return cut;
        }

        for name in &self.names {
            let others = cut.entry(name.clone()).or_default();
            for other in &unanswering {
                if other != name {
                    others.push(other.clone());
                }
            }
            // A robot may be out of reach for two reasons, and the order of names is that of the
            // record.
            others.sort();
            others.dedup();
        }
        cut
    }
}

impl Bulletin<TickUpdate> for Simulation {
    fn robots(&self) -> BTreeSet<RobotName> {
        self.robots_with_news()
    }

    fn compose(&self, robot: &RobotName, notice: IncarnationNotice) -> TickUpdate {
        self.news(robot, notice)
    }
}
