//! Faults of real links. Experiments use the simulated network between robots (`[network]` of a scenario), which is
//! reproducible. Faults of real links test that a run survives them and loses nothing but time.

mod compose;
mod gate;
mod links;
mod namespaces;
mod plan;
mod play;
mod proxy;
mod shape;

pub use plan::FaultPlan;
pub use play::{Play, Via, play};
pub use proxy::{AddressError, Proxy, address};
pub use shape::{Flow, LinkOrder, LinkShape, OrderError};
