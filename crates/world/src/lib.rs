//! The environment of CARS: a bounded field, fixed obstacles, guests who wander, and the robots' bodies.
//!
//! This crate exists so that the rules of motion and collision stand alone and can be read, tested and trusted
//! without anything around them: no clock, no network, no files, no threads. What happens is a function of the
//! [`Hall`], of the random stream given to [`World::new`] and of the proposals given to [`World::advance`];
//! the same three give the same positions, to the last bit, on every machine.
//!
//! The rules are the seed's (CARS, 2002, section "Obstacles"): every body occupies a square of the same size,
//! guests walk straight for a while and then choose anew, and a body whose proposed location collides is not
//! advanced. What a robot does about a collision is its own affair, so no robot's reasoning is found here.
//!
//! # One tick
//!
//! Robots in index order, then guests in index order. Each attempts its proposed location against the bodies
//! *where they are at that moment*: it arrives, or it stays. This is the one order there is; because of it no
//! two bodies ever overlap and no body leaves the field. Only the proposed location is tested, as in the seed,
//! not the way to it.
//!
//! # Random draws
//!
//! All draws come from the one stream, and in this order:
//!
//! 1. at [`World::new`] the guests' places, in index order: x then y for each try; if that jams, one number for
//!    each guest that chooses among the places left (see [`Guests`]);
//! 2. at [`World::new`] the guests' first courses, in index order: direction, speed, duration;
//! 3. in each tick, for every guest whose course is over, in index order: direction, speed, duration.
//!
//! What robots do never changes how many numbers are drawn.
//!
//! # Example
//!
//! ```
//! use rand::SeedableRng;
//! use rand_xoshiro::Xoshiro256PlusPlus;
//! use world::{Field, Guests, Hall, Point, Triangular, Verdict, World};
//!
//! const FT: f64 = 0.3048;
//! let hall = Hall {
//!     field: Field { size_m: (50.0 * FT, 50.0 * FT), body_m: 2.0 * FT },
//!     obstacles: vec![Point::new(3.0 * FT, 3.0 * FT)],
//!     guests: Guests {
//!         count: 100,
//!         speed_mps: Triangular::new(0.2, 0.6, 1.2)?,
//!         duration_s: Triangular::new(1.0, 3.0, 8.0)?,
//!     },
//!     robots: vec![Point::new(25.0 * FT, 25.0 * FT)],
//!     tick_s: 0.1,
//!     max_speed_mps: 2.0 * FT,
//! };
//! let mut world = World::new(&hall, Xoshiro256PlusPlus::seed_from_u64(2002))?;
//!
//! let here = world.robots()[0];
//! let verdicts = world.advance(&[Some(here + Point::new(10.0, 0.0))]);
//! assert_eq!(verdicts, [Verdict::TooFast]);
//! assert_eq!(world.robots()[0], here);
//! assert_eq!(world.guests().len(), 100);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bodies;
mod error;
mod grid;
mod guests;
mod hall;
mod motion;
mod placing;
mod point;
mod triangular;

pub use bodies::{Blocker, Body, Near};
pub use error::{HallError, TriangularError};
pub use guests::Course;
pub use hall::{BODIES_MAX, BODY_MIN_M, Field, Guests, Hall, SIDE_MAX_M, TOLERANCE_M};
pub use motion::{Verdict, World};
pub use point::Point;
pub use triangular::Triangular;
