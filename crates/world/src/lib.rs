//! The environment of CARS: a bounded field, fixed obstacles, wandering guests, and the robots' bodies.
//!
//! This crate implements the rules of motion and collision and nothing else. It uses no clock, network, files or
//! threads. The state of a [`World`] is a function of the [`Hall`], the random stream passed to [`World::new`] and
//! the proposals passed to [`World::advance`]. The same three inputs give bit-identical positions on every machine.
//!
//! The rules are those of the paper (CARS, 2002, section "Obstacles"). Every body occupies a square of the same
//! size, unless the hall gives it another [`Shape`] (chosen here, as are walls). Guests walk in a straight line for a while, then choose a new one, unless they react to a robot
//! ([`Reaction`], chosen here), or walk as recorded people did ([`Recorded`], chosen here) or
//! as a model of people has them ([`CrowdGuests`], chosen here). A body whose proposed location collides is not advanced. How a robot reacts to a collision is up to the robot and not part of this crate.
//!
//! # One tick
//!
//! Robots move first, in index order, followed by the guests, in index order. Each body's proposed location is
//! tested against the *current* positions of all other bodies; the body then either moves there or stays in place.
//! Because bodies move one at a time in this fixed order, no two bodies ever overlap and no body leaves the field.
//! As in the paper, only the proposed location is tested, and not the path to it. Walls, and obstacles with a shape of their
//! own, are tested against the straight path: no body passes through one, however fast it is.
//!
//! A robot with [`Wheels`] (chosen here) proposes no location but a [`Velocity`], and its body turns with it: it moves and turns, or
//! it stands still and turns, or, where the turned body has no room either, it stays as it is. On the way it turns evenly, and
//! walls and obstacles with a shape of their own are tested against the whole of it.
//!
//! # Random draws
//!
//! All draws come from one stream, in this order:
//!
//! 1. In [`World::new`], the guests' positions, in index order: x, then y, for each attempt. If rejection sampling
//!    fails, one more number per guest, which selects one of the remaining free positions (see [`Guests`]).
//! 2. In [`World::new`], the guests' first courses, in index order: direction, speed, duration.
//! 3. In [`World::with_guests`], for guests who [`Want`] something, one number for each, in index order.
//! 4. In each tick, for every guest whose course is over, in index order: direction, speed, duration.
//!
//! The behavior of robots never changes how many numbers are drawn.
//!
//! # Example
//!
//! ```
//! use rand::SeedableRng;
//! use rand_xoshiro::Xoshiro256PlusPlus;
//! use world::{Field, Guests, Hall, MoveOutcome, Point, Shapes, Triangular, World};
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
//!     shapes: Shapes::default(),
//!     tick_s: 0.1,
//!     max_speed_mps: 2.0 * FT,
//! };
//! let mut world = World::new(&hall, Xoshiro256PlusPlus::seed_from_u64(2002))?;
//!
//! let here = world.robots()[0];
//! let verdicts = world.advance(&[Some(here + Point::new(10.0, 0.0))]);
//! assert_eq!(verdicts, [MoveOutcome::TooFast]);
//! assert_eq!(world.robots()[0], here);
//! assert_eq!(world.guests().len(), 100);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bodies;
mod error;
mod footprint;
mod grid;
mod guests;
mod hall;
mod limits;
mod motion;
mod placing;
mod point;
mod reactions;
mod shape;
mod shapes;
mod sight;
mod social;
mod solids;
mod sweep;
mod tracks;
mod triangular;
mod walk;
mod wants;
mod wheels;

pub use bodies::{Blocker, Body, Near};
pub use error::{HallError, TriangularError};
pub use footprint::Footprint;
pub use guests::Course;
pub use hall::{Field, Guests, Hall};
pub use limits::{BODIES_MAX, BODY_MIN_M, SIDE_MAX_M, TOLERANCE_M, WALLS_MAX};
pub use motion::{GuestWalk, MoveOutcome, World};
pub use placing::{Placer, Region};
pub use point::Point;
pub use reactions::{Reaction, Response};
pub use shape::{Shape, Wall};
pub use shapes::Shapes;
pub use sight::{Crossed, Opaque, is_hidden};
pub use social::{CrowdGuests, CrowdModel};
pub use tracks::{Recorded, Track, TrackPoint};
pub use triangular::Triangular;
pub use walk::Passage;
pub use wants::{Want, WantTarget};
pub use wheels::{Pose, Velocity, Wheels};
