//! The robot's body: where it stands, and where it wants to be.

use protocol::Tick;
use protocol::messages::{Correction, Point, Welcome};

/// Every so many ticks the same happens to a body again.
pub(crate) const ROUND: Tick = 16;
/// In a round: it is placed elsewhere, and its move is refused.
const PLACED: Tick = 5;
const REFUSED: Tick = 9;
/// How far it is placed from where it stood, meters.
const SHIFT: (f64, f64) = (0.25, 0.125);

/// Where the robot stands, and where it wants to be.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RobotBody {
    pub(crate) stands: Point,
    pub(crate) proposal: Point,
}

impl RobotBody {
    /// A body that stands and stays.
    pub(crate) fn at(location: Point) -> Self {
        Self {
            stands: location,
            proposal: location,
        }
    }

    /// Its move into a tick, and the correction if it does not stand where it proposed.
    pub(crate) fn advance(&mut self, tick: Tick, welcome: &Welcome) -> Option<Correction> {
        if tick % ROUND == PLACED {
            let mut placed = self.shifted(1.0);
            if !is_free(placed, welcome) {
                placed = self.shifted(-1.0);
            }

            self.stands = placed;
            return Some(Correction {
                location: self.stands,
                blocked: false,
            });
        }

        if tick % ROUND == REFUSED || !is_free(self.proposal, welcome) {
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
