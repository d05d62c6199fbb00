//! Tests of the environment, tick by tick and part by part, through the public interface.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod actors;
mod by_hand;
mod common;
mod driving;
mod layers;
mod messages;
mod network;
mod network_figures;
mod network_laws;
mod odd_values;
mod radio;
mod sensing;
mod sites;
mod tick;
