//! Bounds of parameters.

/// Refuses a parameter that must be a number above zero.
pub(crate) fn positive(name: &str, value: f64) -> Result<(), String> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(format!("{name} must be above 0, not {value}"))
    }
}

/// Refuses a parameter that must be a number of at least zero.
pub(crate) fn not_negative(name: &str, value: f64) -> Result<(), String> {
    if value >= 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(format!("{name} must be at least 0, not {value}"))
    }
}
