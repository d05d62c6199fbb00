//! The shame of a refiller who ignores calls for help: a standards-based emotion of Ortony's model \[D: Gage and Murphy 2004\].

use serde::{Deserialize, Serialize};

use super::Recruitment;
use crate::bounds::{not_negative, positive};
use crate::units::FT_M;

/// How much a call from a distance weighs \[D: both\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weight {
    /// 1/D.
    #[default]
    Inverse,
    /// 1/D².
    InverseSquare,
}

/// How a refiller answers calls for help.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HelperParameters {
    /// When she offers. Default off \[I\]; `greedy` and `random` are the same to her.
    pub by: Recruitment,
    /// Shame from which she offers, 0 to 1. Default 0.6 \[I\]; that there is a threshold of at most 1 \[D\].
    pub threshold: f64,
    /// What an ignored call from `near_m` adds to her shame (dimensionless). Default 1 \[I\]; that it is a constant \[D\].
    pub gain: f64,
    /// How the weight of a call falls with the distance of the waiter. Default inverse \[I\]; that it is one of two \[D\].
    pub weight: Weight,
    /// The unit of that distance, m; a call from nearer weighs no more. Default 1 ft \[I\].
    pub near_m: f64,
    /// Her shame at the start is uniform from 0 to this. Default 0.3 \[I\].
    pub shame_start_max: f64,
}

impl Default for HelperParameters {
    fn default() -> Self {
        Self {
            by: Recruitment::Off,
            threshold: 0.6,
            gain: 1.0,
            weight: Weight::Inverse,
            near_m: FT_M,
            shame_start_max: 0.3,
        }
    }
}

impl HelperParameters {
    /// Checks the values.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub fn check(&self) -> Result<(), String> {
        share("recruitment.threshold", self.threshold)?;
        share("recruitment.shame_start_max", self.shame_start_max)?;
        not_negative("recruitment.gain", self.gain)?;
        positive("recruitment.near_m", self.near_m)
    }

    /// What a call from a distance adds to her shame.
    fn step(&self, distance_m: f64) -> f64 {
        let distance = (distance_m / self.near_m).max(1.0);
        let weight = match self.weight {
            Weight::Inverse => 1.0 / distance,
            Weight::InverseSquare => 1.0 / (distance * distance),
        };
        self.gain * weight
    }
}

fn share(name: &str, value: f64) -> Result<(), String> {
    if (0.0..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(format!("{name} must be from 0 to 1, not {value}"))
    }
}

/// Shame at calls for help that were ignored, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Shame(f64);

impl Shame {
    /// Shame of this strength, which is limited to 0 to 1.
    #[must_use]
    pub fn new(value: f64) -> Self {
        Self(value.clamp(0.0, 1.0))
    }

    /// How strong it is, 0 to 1.
    #[must_use]
    pub fn value(self) -> f64 {
        self.0
    }

    /// Takes a call for help to an idle refiller, from a waiter at this distance. Returns whether she offers. A call that is still
    /// ignored shames her.
    pub fn hear(&mut self, distance_m: f64, parameters: &HelperParameters) -> bool {
        if self.0 < parameters.threshold {
            *self = Self::new(self.0 + parameters.step(distance_m));
        }
        self.0 >= parameters.threshold
    }

    /// She is assigned: nothing is left to be ashamed of.
    pub fn relieve(&mut self) {
        self.0 = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn affective() -> HelperParameters {
        HelperParameters {
            by: Recruitment::Affective,
            ..HelperParameters::default()
        }
    }

    #[test]
    fn ignored_calls_shame_her_until_she_offers() {
        let mut shame = Shame::default();
        let parameters = affective();
        // 10 ft away, a call adds 1/10: six of them reach 0.6.
        let far_m = 10.0 * FT_M;
        for call in 1..=5 {
            assert!(!shame.hear(far_m, &parameters), "call {call}");
        }
        assert!((shame.value() - 0.5).abs() < 1e-12);
        // 0.1 six times is a little less than 0.6: the next call decides.
        shame.hear(far_m, &parameters);
        assert!(shame.hear(far_m, &parameters));

        // She offers from then on, and her shame stays until she is assigned.
        let before = shame.value();
        assert!(shame.hear(far_m, &parameters));
        assert_eq!(shame.value(), before);
        shame.relieve();
        assert_eq!(shame.value(), 0.0);
        assert!(!shame.hear(far_m, &parameters));
    }

    #[test]
    fn a_nearer_call_weighs_more_and_none_weighs_more_than_the_gain() {
        for (weight, distance_ft, step) in [
            (Weight::Inverse, 4.0, 0.25),
            (Weight::InverseSquare, 4.0, 0.0625),
            (Weight::Inverse, 1.0, 1.0),
            (Weight::InverseSquare, 0.25, 1.0),
            (Weight::Inverse, 0.0, 1.0),
        ] {
            let mut parameters = affective();
            parameters.weight = weight;
            let given = parameters.step(distance_ft * FT_M);
            assert!((given - step).abs() < 1e-12, "{weight:?}, {distance_ft} ft");
        }

        let mut shame = Shame::new(0.5);
        assert!(shame.hear(0.0, &affective()));
        assert_eq!(shame.value(), 1.0, "shame is limited");
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        assert_eq!(HelperParameters::default().check(), Ok(()));
        let wrong = |change: fn(&mut HelperParameters)| {
            let mut parameters = affective();
            change(&mut parameters);
            parameters.check().unwrap_err()
        };
        assert!(wrong(|p| p.threshold = 1.5).contains("recruitment.threshold"));
        assert!(wrong(|p| p.shame_start_max = f64::NAN).contains("shame_start_max"));
        assert!(wrong(|p| p.gain = -1.0).contains("recruitment.gain"));
        assert!(wrong(|p| p.near_m = 0.0).contains("recruitment.near_m"));
    }
}
