//! What was measured with people, and what is asked of models.

/// Densities of the speeds, persons per m².
pub const DENSITIES_PER_M2: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// Measured speeds by density.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpeedData {
    /// A corridor of 1.8 m, periodic, 434 points; computed from the data of jpscore, `systemtest/Validation` (Zhang 2012). \[D\]
    Corridor,
    /// In one direction with open ends, 571 points; from the same place. \[D\]
    Open,
    /// The line of Weidmann 1993, over measurements of 25 authors; cited from memory \[I\].
    Weidmann,
}

impl SpeedData {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Corridor, Self::Open, Self::Weidmann];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Corridor => "corridor",
            Self::Open => "open",
            Self::Weidmann => "Weidmann",
        }
    }

    /// Speeds at [`DENSITIES_PER_M2`], m/s.
    #[must_use]
    pub fn speeds_mps(self) -> [f64; 6] {
        match self {
            Self::Corridor => [1.07, 0.81, 0.62, 0.49, 0.38, 0.27],
            Self::Open => [1.47, 1.29, 1.13, 0.81, 0.44, 0.29],
            Self::Weidmann => DENSITIES_PER_M2.map(weidmann_mps),
        }
    }
}

/// Weidmann's speed at a density, m/s: 1.34 (1 - exp(-1.913 (1/ρ - 1/5.4))), and 0 beyond 5.4 persons per m². Cited
/// from memory \[I\].
#[must_use]
pub fn weidmann_mps(density_per_m2: f64) -> f64 {
    let free_m2 = 1.0 / density_per_m2 - 1.0 / 5.4;
    (1.34 * (1.0 - libm::exp(-1.913 * free_m2))).max(0.0)
}

/// Speeds in single file by persons per meter: (1/m, m/s). Seyfried, Steffen, Klingsch, Boltes 2005, cited from memory \[I\].
pub const SINGLE_FILE: [(f64, f64); 4] = [(0.75, 0.89), (1.25, 0.45), (1.75, 0.19), (2.25, 0.07)];

/// Flow of 75 people through a gate of 0.5 m at the end of a corridor of 5.6 m, 1/s. \[D\] Adrian, Seyfried, Sieben 2020, run
/// `040_c_56_h-`, as PedPy ships it. They were in no hurry: `h-` is the second run, in which people had been told that everyone will see
/// the stage.
pub const GATE_FLOW_PER_S: f64 = 1.15;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_weidmann_is_that_of_the_table() {
        let table = [1.30, 1.06, 0.81, 0.61, 0.45, 0.33];
        for (computed, printed) in SpeedData::Weidmann.speeds_mps().iter().zip(table) {
            assert!((computed - printed).abs() <= 0.005, "{computed} {printed}");
        }
        assert_eq!(weidmann_mps(6.0), 0.0);
    }
}
