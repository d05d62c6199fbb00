//! The limits within which the arithmetic of this crate is valid.

/// How far two bodies may overlap, or a body extend beyond the field, and still count as touching: 1 nm \[chosen
/// here\].
///
/// Positions are converted from feet, parsed from JSON and summed from steps, so squares that are meant to touch
/// are off by a few units in the last place. On fields up to [`SIDE_MAX_M`] these errors stay below the tolerance.
/// The tolerance does not accumulate, because each test uses the bodies' actual positions.
pub const TOLERANCE_M: f64 = 1e-9;

/// Maximum side of a field, 1,000 km; beyond that, the spacing of `f64` approaches [`TOLERANCE_M`] \[chosen here\].
pub const SIDE_MAX_M: f64 = 1e6;

/// Minimum side of a body, 1 mm, a million times [`TOLERANCE_M`] \[chosen here\].
pub const BODY_MIN_M: f64 = 1e-3;

/// Maximum number of obstacles, robots and guests together \[chosen here\]. A world of that size takes up to 2.5 GB.
pub const BODIES_MAX: usize = 1 << 24;

/// Maximum number of walls, and of obstacles with a shape of their own \[chosen here\]: the floor plan of a large
/// building, and a frame with all of it fits into a message.
pub const WALLS_MAX: usize = 4096;

/// Minimum length of a tick, 1 µs \[chosen here\].
pub(crate) const TICK_MIN_S: f64 = 1e-6;

/// Maximum length of a tick, 11 days \[chosen here\].
pub(crate) const TICK_MAX_S: f64 = 1e6;

/// Maximum speed limit of robots, which crosses the largest field in one second \[chosen here\].
pub(crate) const SPEED_MAX_MPS: f64 = 1e6;
