//! Units in which the experiments are stated.

/// Meters in a foot, exact by definition \[D\].
pub const FT_M: f64 = 0.3048;
