//! What a robot senses in the tick in progress: robots, bodies, sites and the ranges of its rays.

use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::messages::{SensedBody, SensedKind, SensedRobot, SensedSite, site_bytes};
use scenario::{to_wire, to_world};
use world::Body;

use crate::driving::pose;
use crate::sensing::{Viewpoint, ranges_m};

use super::Simulation;

/// Most bodies in the news of a robot, so that the news fit into a message.
const MAX_BODIES: usize = 4096;

/// Most bytes of sites in the news of a robot, which also have commands and bodies.
const MAX_SITE_BYTES: usize = MAX_MESSAGE_BYTES / 16;

/// Most robots that are all compared with each other to find those within sensing range.
const MAX_COMPARED: usize = 64;

impl Simulation {
    /// A robot as it looks around in the tick in progress.
    pub(super) fn viewpoint(&self, of: usize) -> Viewpoint<'_> {
        let reach_m = self.scenario.sensing.range_m.max(self.sites.reach_m());
        Viewpoint::new(
            &self.scenario,
            &self.world,
            self.now,
            &self.names[of],
            self.world.robots()[of],
            self.heading_rad(of),
            reach_m,
        )
    }

    /// Where a robot looks, radians: its heading, or the direction of motion that it reported last if it does not drive.
    fn heading_rad(&self, of: usize) -> f64 {
        if let Some(pose) = pose(&self.world, of) {
            return pose.heading_rad;
        }
        let report = self.reports.get(&self.names[of]);
        report.map_or(0.0, |report| report.direction_rad)
    }

    /// The ranges of a robot's rays, if its news contain them.
    pub(super) fn sensed_ranges(&self, of: usize) -> Vec<f64> {
        if !self.with_ranges.contains(&self.names[of]) {
            return Vec::new();
        }
        ranges_m(
            &self.scenario.sensing,
            &self.world,
            of,
            self.heading_rad(of),
        )
    }

    /// The sites that a robot senses, the first of them by name that fit into its news.
    pub(super) fn sensed_sites(&self, of: usize, viewpoint: &Viewpoint<'_>) -> Vec<SensedSite> {
        let mut sensed = Vec::new();
        let mut bytes = 0;
        for site in self.sites.near(to_wire(self.world.robots()[of])) {
            let what = format_args!("site/{}", site.name);
            if let Some(at) = viewpoint.senses(what, to_world(site.location), None) {
                bytes += site_bytes(&site.name, &site.kind, &site.state);
                if bytes > MAX_SITE_BYTES {
                    break;
                }
                sensed.push(SensedSite {
                    location: to_wire(at),
                    ..site
                });
            }
        }
        sensed
    }

    /// All bodies within a robot's sensing range, if its news contain them.
    pub(super) fn sensed_bodies(&self, of: usize, viewpoint: &Viewpoint<'_>) -> Vec<SensedBody> {
        if !self.with_bodies.contains(&self.names[of]) {
            return Vec::new();
        }

        let center = self.world.robots()[of];
        let near = self.world.near(center, self.scenario.sensing.range_m);
        let others = near.into_iter().filter(|near| near.body != Body::Robot(of));
        let mut sensed = Vec::new();
        for near in others.take(MAX_BODIES) {
            let at = near.center;
            let (kind, sensed_at) = match near.body {
                Body::Obstacle(index) => {
                    let what = format_args!("obstacle/{index}");
                    let at = viewpoint.senses(what, at, Some(index));
                    (SensedKind::Obstacle, at)
                }
                Body::Guest(index) => {
                    let at = viewpoint.senses(format_args!("guest/{index}"), at, None);
                    (SensedKind::Guest, at)
                }
                Body::Robot(index) => (SensedKind::Robot, self.senses_robot(viewpoint, index)),
            };
            if let Some(at) = sensed_at {
                sensed.push(SensedBody {
                    kind,
                    location: to_wire(at),
                });
            }
        }
        sensed
    }

    /// Where a robot senses another one that is within range.
    fn senses_robot(&self, viewpoint: &Viewpoint<'_>, other: usize) -> Option<world::Point> {
        let what = format_args!("robot/{}", self.names[other]);
        viewpoint.senses(what, self.world.robots()[other], None)
    }

    /// Robots among which are all that one senses, in the order of names. Of many robots these are those around it, so that a tick does
    /// not cost the square of their number.
    fn robots_around(&self, of: usize) -> Vec<usize> {
        let robots = self.world.robots();
        if robots.len() <= MAX_COMPARED {
            return (0..robots.len()).collect();
        }

        // A little more, because it measures distances with other roundings.
        let range_m = self.scenario.sensing.range_m * 1.001;
        let near = self.world.near(robots[of], range_m).into_iter();
        let robot = |near: world::Near| match near.body {
            Body::Robot(index) => Some(index),
            Body::Obstacle(_) | Body::Guest(_) => None,
        };
        near.filter_map(robot).collect()
    }

    pub(super) fn sensed_robots(&self, of: usize, viewpoint: &Viewpoint<'_>) -> Vec<SensedRobot> {
        let robots = self.world.robots();
        let mut sensed = Vec::new();
        for other in self.robots_around(of) {
            let is_near = robots[of].distance_m(robots[other]) <= self.scenario.sensing.range_m;
            if other == of || !is_near {
                continue;
            }
            if let Some(at) = self.senses_robot(viewpoint, other) {
                sensed.push(SensedRobot {
                    name: self.names[other].clone(),
                    location: to_wire(at),
                });
            }
        }

        sensed
    }
}
