//! The robot's body: where it stands, and where it wants to be.

use std::f64::consts::{PI, TAU};

use protocol::messages::{Correction, Point, Pose, Report, Velocity, Welcome};
use protocol::{Tick, published_angle};

/// Every so many ticks the same happens to a body again. A prime number: whatever a robot does every few ticks meets all of it.
pub const ROUND: Tick = 17;
/// In a round: it is placed elsewhere.
const PLACED: Tick = 5;
/// In a round: its moves are refused, in two ticks in turn.
pub const REFUSED: [Tick; 2] = [9, 10];
/// How far it is placed from where it stood, meters.
const SHIFT: (f64, f64) = (0.25, 0.125);

/// Where the robot stands, and where it wants to be.
#[derive(Debug, Clone, Copy, Default)]
pub struct RobotBody {
    /// Where it stands, meters.
    pub stands: Point,
    /// Where it wants to be in the next tick, meters.
    pub proposal: Point,
    /// Of a robot that drives.
    heading_rad: f64,
    velocity: Velocity,
}

impl RobotBody {
    /// A body that stands and stays.
    pub fn at(location: Point, heading_rad: f64) -> Self {
        Self {
            stands: location,
            proposal: location,
            heading_rad: published_angle(heading_rad),
            velocity: Velocity::default(),
        }
    }

    /// A correction that says where it stands anyway.
    pub fn confirmed(&self) -> Correction {
        Correction {
            location: self.stands,
            blocked: false,
        }
    }

    /// Where the robot wants to be, by its report. One that drives moves straight along its heading, and then turns: how exactly it
    /// moves is the simulator's affair.
    pub fn propose(&mut self, report: &Report, welcome: &Welcome) {
        let Some(limits) = welcome.drive else {
            self.proposal = report.proposal;
            return;
        };

        let wanted = report.velocity.unwrap_or_default();
        let most_mps = limits.max_speed_mps;
        self.velocity.linear_mps = wanted.linear_mps.clamp(-most_mps, most_mps);
        let most_radps = limits.max_turn_radps.unwrap_or(PI);
        self.velocity.angular_radps = wanted.angular_radps.clamp(-most_radps, most_radps);

        let step_m = self.velocity.linear_mps * welcome.tick_s;
        let (sin, cos) = libm::sincos(self.heading_rad);
        self.proposal = Point::new(self.stands.x + step_m * cos, self.stands.y + step_m * sin);
        let turned_rad = self.heading_rad + self.velocity.angular_radps * welcome.tick_s;
        self.heading_rad = published_angle(libm::remainder(turned_rad, TAU));
    }

    /// Its pose.
    pub fn pose(&self) -> Pose {
        Pose {
            location: self.stands,
            heading_rad: self.heading_rad,
            velocity: self.velocity,
        }
    }

    /// Its move into a tick, and the correction if it does not stand where it proposed.
    pub fn advance(&mut self, tick: Tick, welcome: &Welcome) -> Option<Correction> {
        if tick % ROUND == PLACED {
            let mut placed = self.shifted(1.0);
            if !is_free(placed, welcome) {
                placed = self.shifted(-1.0);
            }

            self.stands = placed;
            return Some(self.confirmed());
        }

        if REFUSED.contains(&(tick % ROUND)) || !is_free(self.proposal, welcome) {
            self.velocity.linear_mps = 0.0;
            return Some(Correction {
                location: self.stands,
                blocked: true,
            });
        }

        self.stands = self.proposal;
        None
    }

    fn shifted(self, sign: f64) -> Point {
        Point::new(
            self.stands.x + sign * SHIFT.0,
            self.stands.y + sign * SHIFT.1,
        )
    }
}

/// Whether a body at a place is within the field.
fn is_free(at: Point, welcome: &Welcome) -> bool {
    let half_m = welcome.body_m / 2.0;
    let [width_m, height_m] = welcome.field_m;
    let is_within_width = at.x >= half_m && at.x <= width_m - half_m;
    let is_within_height = at.y >= half_m && at.y <= height_m - half_m;

    is_within_width && is_within_height
}
