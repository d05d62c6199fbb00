//! Reading state variables that an incarnation published.

use robot::{Point, StateVariables, Variable};

pub(crate) fn number(variables: &StateVariables, name: &str) -> Option<f64> {
    variables.get(name)?.as_f64()
}

/// A flag; false if it is missing.
pub(crate) fn flag(variables: &StateVariables, name: &str) -> bool {
    variables
        .get(name)
        .and_then(Variable::as_bool)
        .unwrap_or(false)
}

pub(crate) fn text<'a>(variables: &'a StateVariables, name: &str) -> Option<&'a str> {
    variables.get(name)?.as_str()
}

/// A count; 0 if it is missing.
pub(crate) fn count(variables: &StateVariables, name: &str) -> u32 {
    number(variables, name).map_or(0, saturated)
}

/// A location, from its two coordinates.
pub(crate) fn location(variables: &StateVariables, x: &str, y: &str) -> Option<Point> {
    Some(Point::new(number(variables, x)?, number(variables, y)?))
}

/// A number from outside as a count: saturates, so that it cannot be out of range.
pub(crate) fn saturated(value: f64) -> u32 {
    value as u32
}
