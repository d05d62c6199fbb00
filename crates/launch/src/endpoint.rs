//! Endpoints of the simulator of a launch.

use std::net::{Ipv4Addr, TcpListener};

use bus::endpoint::TLS;

/// A port of the loopback interface that is free at this moment.
pub(crate) fn free_port() -> std::io::Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    Ok(listener.local_addr()?.port())
}

/// The endpoint of a port of the loopback interface.
pub(crate) fn loopback(port: u16, is_secured: bool) -> String {
    let protocol = if is_secured { TLS } else { "tcp" };
    format!("{protocol}/{}:{port}", Ipv4Addr::LOCALHOST)
}
