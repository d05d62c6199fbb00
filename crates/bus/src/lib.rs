//! The bus: sessions of the middleware, with the settings that a lock-step system needs.
//!
//! A simulator embeds the router and everything else is a client of it: one path between any two, which is what keeps
//! messages in order. No multicast, no gossip, loopback unless an address says otherwise.
//!
//! `middleware.rs` is the only file that names the middleware.

mod declared;
pub mod endpoint;
mod error;
mod inbox;
mod middleware;
mod protection;
mod qos;
mod reason;
mod reply;
mod role;
pub mod runtime;
pub mod secure;
mod settings;

pub use protocol::DEFAULT_ENDPOINT;

pub use declared::Declared;
pub use error::BusError;
pub use inbox::{Inbox, OnArrival, Worker, WorkerThread};
pub use middleware::{Bus, Publisher, Query, WatchedPublisher, check_exposure, check_run};
pub use protection::check_key_file;
pub use qos::Qos;
pub use reply::{QUERY_TIMEOUT, Reply};
pub use role::Role;
