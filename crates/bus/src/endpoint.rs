//! Endpoints as the middleware writes them: `tcp/127.0.0.1:7447`, `tls/hall.example:7447`, `unixsock-stream/hall.sock`.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

use serde_json::Value;

/// Beginning of the endpoints that are encrypted and ask for certificates.
pub const TLS: &str = "tls";

/// The protocol and the address of an endpoint, without its metadata (`?…`) and settings (`#…`).
fn parts(endpoint: &str) -> Option<(&str, &str)> {
    let (protocol, rest) = endpoint.split_once('/')?;
    Some((protocol, rest.split(['?', '#']).next().unwrap_or(rest)))
}

/// The host and the port of an address; brackets around an IPv6 host are not part of it.
fn host_and_port(address: &str) -> Option<(&str, &str)> {
    let (host, port) = address.rsplit_once(':')?;
    let bare = host
        .strip_prefix('[')
        .and_then(|host| host.strip_suffix(']'));
    Some((bare.unwrap_or(host), port))
}

/// The protocols of endpoints, as this project has them compiled.
const PROTOCOLS: [&str; 3] = ["tcp", TLS, SOCKET_FILE];
/// Protocol of socket files, the address of which is a path.
const SOCKET_FILE: &str = "unixsock-stream";

/// Checks that sessions can listen or connect at an endpoint.
///
/// ```
/// use bus::endpoint::check;
/// assert!(check("tcp/127.0.0.1:7447").is_ok());
/// assert!(check("tcp://127.0.0.1:7447").unwrap_err().contains("write tcp/127.0.0.1:7447"));
/// ```
///
/// # Errors
/// What is wrong with it, and how it is written.
pub fn check(endpoint: &str) -> Result<(), String> {
    let Some((protocol, address)) = parts(endpoint) else {
        return Err(advise(endpoint, "it does not begin with a protocol"));
    };
    if endpoint.contains("://") {
        return Err(advise(endpoint, "it is not written as a URL"));
    }
    if !PROTOCOLS.contains(&protocol) {
        let reason = format!("the protocols are {}", PROTOCOLS.join(", "));
        return Err(advise(endpoint, &reason));
    }
    if protocol == SOCKET_FILE {
        return if address.is_empty() {
            Err(format!("{endpoint:?} names no socket file"))
        } else {
            Ok(())
        };
    }

    let (host, port) = host_and_port(address).unwrap_or((address, ""));
    if host.is_empty() {
        return Err(advise(endpoint, "it has no host"));
    }
    match port.parse::<u16>() {
        Ok(0) => Err(format!(
            "{endpoint:?} has port 0, which is any free port, and the others could not know which: name one from 1 to 65535"
        )),
        Ok(_) => Ok(()),
        Err(_) => Err(advise(endpoint, "it has no port from 1 to 65535")),
    }
}

/// What is wrong with an endpoint, and how it may have been meant.
fn advise(endpoint: &str, reason: &str) -> String {
    let (protocol, address) = match endpoint.split_once("://") {
        Some((protocol, address)) => (protocol, address),
        None => endpoint.split_once('/').unwrap_or(("", endpoint)),
    };
    let protocol = match protocol {
        TLS | "https" | "wss" => TLS,
        _ => "tcp",
    };

    let address = address.trim_matches('/');
    let is_address = host_and_port(address).is_some_and(|(host, port)| {
        !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0)
    });
    let meant = if is_address { address } else { "HOST:PORT" };
    format!("{endpoint:?} is not an endpoint: {reason}; write {protocol}/{meant}")
}

/// Whether what is said there is encrypted.
#[must_use]
pub fn is_tls(endpoint: &str) -> bool {
    parts(endpoint).is_some_and(|(protocol, _)| protocol == TLS)
}

/// The same endpoint with one more setting.
#[must_use]
pub(crate) fn with_setting(endpoint: &str, setting: &str) -> String {
    let separator = if endpoint.contains('#') { ';' } else { '#' };
    format!("{endpoint}{separator}{setting}")
}

/// Setting of an endpoint whose links bound their handshakes: the limit in milliseconds.
const HANDSHAKE_LIMIT: &str = "handshake_ms=";

/// Whether the links of an endpoint can bound their handshakes: those of this project's changed crates in `vendor`.
fn bounds_handshakes(endpoint: &str) -> bool {
    parts(endpoint).is_some_and(|(protocol, _)| protocol == "tcp" || protocol == TLS)
}

/// Lets the links of all endpoints in a value bound their handshakes, unless there is one whose links cannot, and returns
/// whether they do. An endpoint that sets the limit itself keeps it.
pub(crate) fn bound_handshakes(endpoints: &mut Value, limit_ms: u64) -> bool {
    let mut all = Vec::new();
    texts(endpoints, &mut all);
    let can_bound = all.iter().all(|endpoint| bounds_handshakes(endpoint));
    if can_bound {
        for endpoint in all {
            let is_set = endpoint
                .split(['#', ';'])
                .any(|setting| setting.starts_with(HANDSHAKE_LIMIT));
            if !is_set {
                *endpoint = with_setting(endpoint, &format!("{HANDSHAKE_LIMIT}{limit_ms}"));
            }
        }
    }

    can_bound
}

/// All endpoints in a value: they may be listed for all modes or for each.
pub(crate) fn texts<'a>(value: &'a mut Value, found: &mut Vec<&'a mut String>) {
    match value {
        Value::String(text) => found.push(text),
        Value::Array(items) => items.iter_mut().for_each(|item| texts(item, found)),
        Value::Object(fields) => fields.values_mut().for_each(|field| texts(field, found)),
        _ => {}
    }
}

/// Whether a listener there can be reached from this machine only. An endpoint that cannot be read counts as reachable.
///
/// ```
/// use bus::endpoint::is_local;
/// assert!(is_local("tcp/127.0.0.1:7447") && is_local("tls/localhost:7447") && is_local("unixsock-stream/x.sock"));
/// assert!(!is_local("tcp/0.0.0.0:7447") && !is_local("tcp/[::]:7447") && !is_local("tcp/localhost.example:7447"));
/// ```
#[must_use]
pub fn is_local(endpoint: &str) -> bool {
    let Some((protocol, address)) = parts(endpoint) else {
        return false;
    };
    if protocol == SOCKET_FILE {
        return true;
    }
    let is_loopback = |host: &str| match host.parse::<IpAddr>() {
        Ok(address) => address.to_canonical().is_loopback(),
        Err(_) => host == "localhost",
    };
    host_and_port(address).is_some_and(|(host, _)| is_loopback(host))
}

/// Where to connect on this machine to a listener at `endpoint`: an address that means "all of mine", as
/// `0.0.0.0`, is none that a certificate could name.
#[must_use]
pub fn connectable(endpoint: &str) -> String {
    let Some((protocol, address)) = parts(endpoint) else {
        return endpoint.to_owned();
    };
    let Some((host, port)) = host_and_port(address) else {
        return endpoint.to_owned();
    };

    match host.parse::<IpAddr>() {
        Ok(IpAddr::V4(Ipv4Addr::UNSPECIFIED)) => {
            format!("{protocol}/{}:{port}", Ipv4Addr::LOCALHOST)
        }
        Ok(IpAddr::V6(Ipv6Addr::UNSPECIFIED)) => {
            format!("{protocol}/[{}]:{port}", Ipv6Addr::LOCALHOST)
        }
        _ => endpoint.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn only_what_is_surely_local_counts_as_local() {
        for local in [
            "tcp/127.0.0.1:7447",
            "tcp/127.8.9.1:0",
            "tls/[::1]:7447",
            "tcp/localhost:7447",
            "tcp/[::ffff:127.0.0.1]:7447",
            "tcp/127.0.0.1:7447?rel=1#so_sndbuf=65000",
            "unixsock-stream//tmp/cars.sock",
        ] {
            assert!(is_local(local), "{local}");
        }
        for reachable in [
            "tcp/0.0.0.0:7447",
            "tcp/[::]:7447",
            "tcp/0:7447",
            "tcp/192.168.1.7:7447",
            "tls/hall.example:7447",
            "tcp/127.0.0.1.example:7447",
            "tcp/10.0.0.1:7447#bind=127.0.0.1:1",
            "udp/localhost",
            "7447",
            "",
        ] {
            assert!(!is_local(reachable), "{reachable}");
        }
    }

    #[test]
    fn endpoints_that_nobody_could_use_are_refused_with_advice() {
        for good in [
            "tcp/127.0.0.1:7447",
            "tcp/[::1]:7447",
            "tls/hall.example:1",
            "tcp/localhost:65535?rel=1#so_sndbuf=65000",
            "unixsock-stream//tmp/cars.sock",
            "unixsock-stream/x.sock",
        ] {
            assert_eq!(check(good), Ok(()), "{good}");
        }

        for (bad, advice) in [
            ("tcp://127.0.0.1:7447", "write tcp/127.0.0.1:7447"),
            ("tcp://localhost:7447/", "write tcp/localhost:7447"),
            ("tls://hall.example:7447", "write tls/hall.example:7447"),
            ("http://127.0.0.1:7447", "write tcp/127.0.0.1:7447"),
            ("https://hall:7447", "write tls/hall:7447"),
            ("ws/127.0.0.1:7447", "write tcp/127.0.0.1:7447"),
            (
                "udp/127.0.0.1:7447",
                "the protocols are tcp, tls, unixsock-stream",
            ),
            ("TCP/127.0.0.1:7447", "write tcp/127.0.0.1:7447"),
            ("127.0.0.1:7447", "write tcp/127.0.0.1:7447"),
            ("localhost:7447", "write tcp/localhost:7447"),
            ("7447", "write tcp/HOST:PORT"),
            ("tcp/127.0.0.1", "no port"),
            ("tcp/127.0.0.1:", "no port"),
            ("tcp/127.0.0.1:65536", "no port"),
            ("tcp/127.0.0.1:-1", "no port"),
            ("tcp/:7447", "no host"),
            ("tcp/[]:7447", "no host"),
            ("tcp/127.0.0.1:0", "any free port"),
            ("tls/[::1]:00", "any free port"),
            ("tcp/127.0.0.1:0#so_sndbuf=65000", "any free port"),
            ("unixsock-stream/", "no socket file"),
            ("", "write tcp/HOST:PORT"),
        ] {
            let refused = check(bad).unwrap_err();
            assert!(refused.contains(advice), "{bad}: {refused}");
        }
    }

    #[test]
    fn endpoints_bound_handshakes_unless_one_cannot() {
        let bounded = |mut endpoints: Value| {
            let is_bounded = bound_handshakes(&mut endpoints, 1000);
            (is_bounded, endpoints)
        };
        let listed = json!({
            "router": ["tcp/[::]:7447", "tls/hall.example:7447#so_sndbuf=65000"],
            "client": ["tcp/hall.example:7447#handshake_ms=3000"],
        });
        let expected = json!({
            "router": [
                "tcp/[::]:7447#handshake_ms=1000",
                "tls/hall.example:7447#so_sndbuf=65000;handshake_ms=1000",
            ],
            "client": ["tcp/hall.example:7447#handshake_ms=3000"],
        });
        assert_eq!(bounded(listed), (true, expected));

        let mixed = json!(["tcp/[::]:7447", "unixsock-stream/hall.sock"]);
        assert_eq!(bounded(mixed.clone()), (false, mixed));
        assert_eq!(bounded(Value::Null), (true, Value::Null));
    }

    #[test]
    fn an_address_that_means_all_is_reached_by_loopback() {
        for (listen, connect) in [
            ("tcp/0.0.0.0:7447", "tcp/127.0.0.1:7447"),
            ("tls/[::]:1", "tls/[::1]:1"),
            ("tcp/10.0.0.1:7447", "tcp/10.0.0.1:7447"),
            ("unixsock-stream/x.sock", "unixsock-stream/x.sock"),
        ] {
            assert_eq!(connectable(listen), connect);
        }
    }
}
