//! What robots sense of the bodies, robots and sites within range, checked.

use protocol::messages::Rays;

/// How robots sense. By default they sense all that is within range, at its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensing {
    /// Distance within which robots sense other bodies, meters.
    pub range_m: f64,
    /// Angle that a robot overlooks, half of it to each side of the direction that it has reported last, radians; `None` is all
    /// around.
    pub field_of_view_rad: Option<f64>,
    /// Whether obstacles hide what is behind them.
    pub walls_hide: bool,
    /// Probability that a robot does not sense something in a tick.
    pub misses: f64,
    /// Greatest error of each coordinate of a sensed place, meters.
    pub noise_m: f64,
    /// The fan of rays of robots that ask for ranges.
    pub rays: Option<Rays>,
}

impl Sensing {
    /// Senses all within a range.
    #[must_use]
    pub fn within(range_m: f64) -> Self {
        Self {
            range_m,
            field_of_view_rad: None,
            walls_hide: false,
            misses: 0.0,
            noise_m: 0.0,
            rays: None,
        }
    }
}
