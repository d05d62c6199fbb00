//! Endpoints of the simulator of a launch.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};

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

/// Whether a process listens at the endpoint now.
pub(super) fn is_taken(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map(|(_, address)| address);
    let address: Option<SocketAddr> = address.and_then(|address| address.parse().ok());
    let bound = address.map(TcpListener::bind);
    matches!(bound, Some(Err(error)) if error.kind() == std::io::ErrorKind::AddrInUse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_taken_while_a_process_listens() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        assert!(is_taken(&loopback(port, false)) && is_taken(&loopback(port, true)));
        drop(listener);
        assert!(!is_taken(&loopback(port, false)));
        assert!(!is_taken(&loopback(free_port().unwrap(), false)));
    }
}
