//! Faults of real links. The simulated network between robots (`[network]` of a scenario) is reproducible and is what
//! experiments are made with; this is for seeing that the real one may break, too, and nothing but time is lost.

mod compose;
mod gate;
mod links;
mod namespaces;
mod plan;
mod play;
mod proxy;
mod shape;

pub use plan::Plan;
pub use play::{Play, Via, play};
pub use proxy::{AddressError, Proxy, address};
pub use shape::{Flow, Order, OrderError, Shape};
