//! The roles of sessions.

use std::time::Duration;

/// How to take part.
#[derive(Debug, Clone)]
pub enum Role {
    /// Listen at this endpoint and route for all others: the simulator.
    Router {
        /// For example `tcp/127.0.0.1:7447`.
        listen: String,
        /// Whether other machines may reach it without certificates and access control.
        trusts_network: bool,
    },
    /// Connect to this endpoint: all others.
    Client {
        /// For example `tcp/127.0.0.1:7447`.
        connect: String,
        /// How long to go on trying to reach it.
        patience: Duration,
    },
    /// Only forward, between a simulator and robots on different machines. What is empty is left to the
    /// configuration file.
    Relay {
        /// Where others reach it, for example `tcp/192.0.2.1:7447`.
        listen: Vec<String>,
        /// Other relays that it reaches.
        connect: Vec<String>,
        /// Whether other machines may reach it without certificates and access control.
        trusts_network: bool,
    },
}

impl Role {
    /// All endpoints at which it listens, or to which it connects.
    pub(crate) fn endpoints(&self) -> impl Iterator<Item = &String> {
        let (listen, connect): (&[String], &[String]) = match self {
            Self::Router { listen, .. } => (std::slice::from_ref(listen), &[]),
            Self::Client { connect, .. } => (&[], std::slice::from_ref(connect)),
            Self::Relay {
                listen, connect, ..
            } => (listen, connect),
        };
        listen.iter().chain(connect)
    }
}
