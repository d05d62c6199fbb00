//! One message from one antenna to another: its power at the receiver, and why it is not received.

use crate::fading::Fading;
use crate::path_loss::PathLoss;
use crate::shadowing::Shadowing;

/// The radios of a run, which are all the same.
#[derive(Debug, Clone, PartialEq)]
pub struct RadioModel {
    /// Power of the transmitter, dBm.
    pub transmit_dbm: f64,
    /// Least power with which a message is received, dBm.
    pub sensitivity_dbm: f64,
    /// Loss over the distance.
    pub path_loss: PathLoss,
    /// Attenuation by each wall that is crossed, dB.
    pub walls_db: f64,
    /// Attenuation by each body of a robot or guest that is crossed, dB.
    pub bodies_db: f64,
    /// Shadowing, if there is any.
    pub shadowing: Option<Shadowing>,
    /// Fading.
    pub fading: Fading,
}

/// What is between two antennas.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkGeometry {
    /// Their distance, meters.
    pub distance_m: f64,
    /// How many walls are on the straight line between them.
    pub walls: u32,
    /// How many bodies are on it.
    pub bodies: u32,
}

/// What a message arrives with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reception {
    /// Its power at the receiver, dBm; minus infinity if fading leaves none.
    pub power_dbm: f64,
    /// Why it is not received; `None` if it is.
    pub lost: Option<LossTerm>,
}

/// A term of the power of a message, in the order in which they add up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LossTerm {
    /// The loss over the distance.
    Distance,
    /// Walls.
    Walls,
    /// Bodies.
    Bodies,
    /// Shadowing.
    Shadowing,
    /// Fading.
    Fading,
}

impl RadioModel {
    /// What becomes of a message, given the loss by shadowing in dB ([`Shadowing::loss_db`]) and the gain of fading
    /// ([`Fading::gain`]). The cause of a loss is the term after which the power stays below the sensitivity.
    #[must_use]
    pub fn reception(
        &self,
        geometry: LinkGeometry,
        shadowing_db: f64,
        fading_gain: f64,
    ) -> Reception {
        let losses_db = [
            (
                LossTerm::Distance,
                self.path_loss.loss_db(geometry.distance_m),
            ),
            (LossTerm::Walls, self.walls_db * f64::from(geometry.walls)),
            (
                LossTerm::Bodies,
                self.bodies_db * f64::from(geometry.bodies),
            ),
            (LossTerm::Shadowing, shadowing_db),
            (LossTerm::Fading, -10.0 * libm::log10(fading_gain)),
        ];

        let mut power_dbm = self.transmit_dbm;
        // Distance is the cause where not even the transmitter's power is enough.
        let mut lost = (power_dbm < self.sensitivity_dbm).then_some(LossTerm::Distance);
        for (term, loss_db) in losses_db {
            power_dbm -= loss_db;
            if power_dbm >= self.sensitivity_dbm {
                lost = None;
            } else if lost.is_none() {
                lost = Some(term);
            }
        }
        Reception { power_dbm, lost }
    }

    /// The distance up to which a message is received without anything in its way, shadowing and fading; 0 if there is none.
    #[must_use]
    pub fn nominal_range_m(&self) -> f64 {
        let budget_db = self.transmit_dbm - self.sensitivity_dbm;
        self.path_loss.reach_m(budget_db)
    }
}
