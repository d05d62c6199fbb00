//! People who walk: models of walking, crowds of any size, and checks of a model against published measurements.
//!
//! [`Pedestrians`] holds a crowd, [`Premises`] what stands still, and a [`WalkingModel`] decides how fast and where each person
//! walks next. [`checks`] plays the cases of RiMEA and experiments with people, and compares.
//!
//! This crate uses no clock, network or files, and neither chance nor threads reach a result: [`Pedestrians::step`] reads the
//! state before the step and writes the state after it, and sums go by cell and number of the person. So the state after a step
//! is a function of the state before it, to the last bit, for any number of threads. All is computed with + - * /, square
//! roots and `libm`.
//!
//! Where numbers come from: \[D\] is documented in a source that was read, \[I\] was chosen here, or is cited from memory and was not
//! checked.
//!
//! # Example
//!
//! ```
//! use crowd::{CollisionFree, Itinerary, Pedestrian, Pedestrians, Premises, Vector, WallLine};
//!
//! let premises = Premises {
//!     walls: vec![WallLine::new(Vector::new(0.0, 2.0), Vector::new(40.0, 2.0))],
//!     ..Premises::default()
//! };
//! let mut crowd = Pedestrians::new(CollisionFree::default(), &premises)?;
//! let exit = WallLine::new(Vector::new(40.0, 0.0), Vector::new(40.0, 2.0));
//! let to_exit = crowd.add_itinerary(Itinerary::leaving_by(&[exit]))?;
//! let guest = crowd.add(Pedestrian {
//!     itinerary: to_exit,
//!     ..Pedestrian::at(Vector::new(1.0, 1.0))
//! })?;
//!
//! crowd.advance(10.0, 2);
//! assert!(crowd.get(guest).is_some_and(|person| person.position.x > 10.0));
//! # Ok::<(), crowd::CrowdError>(())
//! ```

mod cells;
pub mod checks;
mod collision_free;
mod draws;
mod itinerary;
mod model;
mod pedestrian;
mod pedestrians;
mod premises;
mod social_force;
mod vector;

pub use collision_free::CollisionFree;
pub use itinerary::{AtEnd, Itinerary, Waypoint};
pub use model::{NearWall, Neighbor, Surroundings, WalkingModel};
pub use pedestrian::Pedestrian;
pub use pedestrians::{CrowdError, Pedestrians};
pub use premises::{Disc, Premises, WallLine};
pub use social_force::SocialForce;
pub use vector::Vector;
