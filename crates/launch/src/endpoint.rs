//! Where the simulator of a launch listens.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};

use bus::endpoint::TLS;

/// A loopback port that is free at this moment.
pub(crate) fn free_port() -> std::io::Result<u16> {
    Ok(TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?
        .local_addr()?
        .port())
}

/// This port of the loopback interface.
pub(crate) fn loopback(port: u16, is_secured: bool) -> String {
    let protocol = if is_secured { TLS } else { "tcp" };
    format!("{protocol}/{}:{port}", Ipv4Addr::LOCALHOST)
}

/// Whether somebody listens there now.
pub(super) fn is_taken(endpoint: &str) -> bool {
    let address: Option<SocketAddr> = endpoint
        .split_once('/')
        .and_then(|(_, address)| address.parse().ok());
    let bound = address.map(TcpListener::bind);
    matches!(bound, Some(Err(error)) if error.kind() == std::io::ErrorKind::AddrInUse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_taken_while_somebody_listens() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        assert!(is_taken(&loopback(port, false)) && is_taken(&loopback(port, true)));
        drop(listener);
        assert!(!is_taken(&loopback(port, false)));
        assert!(!is_taken(&loopback(free_port().unwrap(), false)));
    }
}
