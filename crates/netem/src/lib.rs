//! Network emulation: a launch over links of its own, which are cut, closed, delayed and narrowed by a plan ([`play()`],
//! [`FaultPlan`]). A link is a TCP proxy, a pair of network interfaces between namespaces, or the network of a container ([`Via`]).
//!
//! These are faults of real links. Experiments use the simulated network between robots (`[network]` of a scenario), which is
//! reproducible. Those here test that a run survives them and loses nothing but time.

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
