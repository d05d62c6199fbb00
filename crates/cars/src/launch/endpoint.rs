//! Where the simulator of a launch listens.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};

/// A loopback port that is free at this moment.
pub(crate) fn free() -> std::io::Result<String> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    Ok(format!("tcp/{}", listener.local_addr()?))
}

/// This port of the loopback interface.
pub(super) fn loopback(port: u16) -> String {
    format!("tcp/127.0.0.1:{port}")
}

/// Whether somebody listens there now.
pub(super) fn is_taken(endpoint: &str) -> bool {
    let address: Option<SocketAddr> = endpoint.strip_prefix("tcp/").and_then(|address| address.parse().ok());
    let bound = address.map(TcpListener::bind);
    matches!(bound, Some(Err(error)) if error.kind() == std::io::ErrorKind::AddrInUse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_taken_while_somebody_listens() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let endpoint = loopback(listener.local_addr().unwrap().port());
        assert!(is_taken(&endpoint));
        drop(listener);
        assert!(!is_taken(&endpoint));
        assert!(!is_taken(&free().unwrap()));
    }
}
