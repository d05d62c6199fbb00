//! The bus: a middleware behind seven verbs.
//!
//! A simulator embeds the router and everything else is a client of it: one path between any two, which is what keeps
//! messages in order. No multicast, no gossip, loopback unless an address says otherwise.
//!
//! There are two of them. `middleware.rs` is the real one and the only file that names it. [`MemoryNetwork`] is a star
//! of the same shape inside one process whose deliveries are chosen by a seed, for tests of everything above it.

mod bus;
mod declared;
pub mod endpoint;
mod error;
mod memory;
mod middleware;
mod qos;
mod reason;
mod reply;
mod role;
pub mod runtime;
pub mod secure;
mod settings;

pub use protocol::DEFAULT_ENDPOINT;

pub use bus::{Bus, Publisher, Query};
pub use declared::Declared;
pub use error::BusError;
pub use memory::{Faults, MemoryNetwork, Overheard, Traffic};
pub use middleware::check_exposure;
pub use qos::Qos;
pub use reply::{QUERY_TIMEOUT, Reply};
pub use role::Role;
