//! Endpoints of the simulator of a launch.

use std::net::{Ipv4Addr, TcpListener};

use bus::endpoint::TLS;

use super::error::LaunchError;

/// What is reported where the loopback interface has no port left.
pub const NO_PORT: &str = "no free port of the loopback interface";

/// A port of the loopback interface that is free at this moment.
///
/// # Errors
/// [`LaunchError::System`] if there is none.
pub fn free_port() -> Result<u16, LaunchError> {
    let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
    let address = bound.and_then(|listener| listener.local_addr());
    Ok(address.map_err(LaunchError::system(NO_PORT))?.port())
}

/// The endpoint of a port of the loopback interface.
#[must_use]
pub fn loopback(port: u16, is_secured: bool) -> String {
    let protocol = if is_secured { TLS } else { "tcp" };
    format!("{protocol}/{}:{port}", Ipv4Addr::LOCALHOST)
}
