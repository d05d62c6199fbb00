//! Decides which HTTP requests are answered. Other web pages must not reach a run through the browser of a person who has
//! the console open, neither through a host name that resolves to this machine (DNS rebinding) nor through a WebSocket
//! across origins.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use axum::http::header::{
    CONTENT_SECURITY_POLICY, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use subtle::ConstantTimeEq;

/// The page runs and loads only what this server serves.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                      connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// Headers of every response.
pub(crate) const HEADERS: [(HeaderName, HeaderValue); 5] = [
    (CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
    (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        HeaderValue::from_static("same-origin"),
    ),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        HeaderValue::from_static("same-origin"),
    ),
];

/// Random bytes in a token.
const TOKEN_BYTES: usize = 24;

/// Decides which requests are answered.
#[derive(Debug)]
pub(crate) struct Guard {
    address: SocketAddr,
    /// What a request must contain; `None` if the console serves loopback only.
    token: Option<String>,
}

impl Guard {
    /// A guard for what is served at `address`, with a new token if that is not loopback.
    pub(crate) fn new(address: SocketAddr) -> Result<Self, getrandom::Error> {
        let token = if address.ip().is_loopback() {
            None
        } else {
            Some(new_token()?)
        };
        Ok(Self { address, token })
    }

    /// The URL of the page, with the token if one is needed.
    pub(crate) fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(loopback_like(address.ip()));
        }

        match &self.token {
            Some(token) => format!("http://{address}/?token={token}"),
            None => format!("http://{address}/"),
        }
    }

    /// Why a request is refused; `None` if it is admitted.
    pub(crate) fn refuse(
        &self,
        headers: &HeaderMap,
        path: &str,
        query: Option<&str>,
    ) -> Option<String> {
        let Some(host) = single(headers, &HOST).filter(|host| self.is_own(host)) else {
            return Some(format!(
                "This console is at {}: a request must name that address, or localhost, with its port.\n",
                self.address
            ));
        };
        if is_from_other_page(headers, host) {
            return Some("A page from elsewhere may not use this console.\n".to_owned());
        }

        // The files of the page are public; only what the page shows and does is protected.
        if path.starts_with("/assets/") || self.has_token(query) {
            return None;
        }
        Some(
            "This console is open to the network: use the address with ?token= that it printed.\n"
                .to_owned(),
        )
    }

    fn is_own(&self, host: &str) -> bool {
        let host = Host::parse(host);
        if host.port != Some(self.address.port()) {
            return false;
        }

        host.name.eq_ignore_ascii_case("localhost")
            || host.name.parse().is_ok_and(|ip| self.is_own_ip(ip))
    }

    fn is_own_ip(&self, ip: IpAddr) -> bool {
        ip == self.address.ip() || self.address.ip().is_unspecified() || is_usual_loopback(ip)
    }

    fn has_token(&self, query: Option<&str>) -> bool {
        let Some(token) = &self.token else {
            return true;
        };

        let mut parameters = query.unwrap_or_default().split('&');
        let given = parameters
            .find_map(|parameter| parameter.strip_prefix("token="))
            .unwrap_or_default();
        given.as_bytes().ct_eq(token.as_bytes()).into()
    }
}

/// The value of a `Host` header.
struct Host<'a> {
    /// A name or an IP address, without brackets.
    name: &'a str,
    /// `None` if it is not a port number.
    port: Option<u16>,
}

impl<'a> Host<'a> {
    fn parse(text: &'a str) -> Self {
        // The colons in `[::1]` are not followed by a port.
        let with_port = text
            .rsplit_once(':')
            .filter(|(_, port)| !port.ends_with(']'));

        match with_port {
            Some((name, port)) => Self {
                name: without_brackets(name),
                port: port.parse().ok(),
            },
            None => Self {
                name: without_brackets(text),
                port: Some(80),
            },
        }
    }
}

/// `[::1]` is written in brackets in a URL.
fn without_brackets(name: &str) -> &str {
    name.strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'))
        .unwrap_or(name)
}

/// Whether a browser sent the request for a page that `host` did not serve. Other programs send no `Origin`.
fn is_from_other_page(headers: &HeaderMap, host: &str) -> bool {
    if !headers.contains_key(ORIGIN) {
        return false;
    }

    let own_origin = format!("http://{host}");
    single(headers, &ORIGIN).is_none_or(|origin| !origin.eq_ignore_ascii_case(&own_origin))
}

/// The loopback address of the same IP version.
fn loopback_like(ip: IpAddr) -> IpAddr {
    if ip.is_ipv4() {
        Ipv4Addr::LOCALHOST.into()
    } else {
        Ipv6Addr::LOCALHOST.into()
    }
}

fn is_usual_loopback(ip: IpAddr) -> bool {
    ip == Ipv4Addr::LOCALHOST || ip == Ipv6Addr::LOCALHOST
}

/// The value of a header that occurs exactly once.
fn single<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?.to_str().ok()?;

    values.next().is_none().then_some(first)
}

fn new_token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes)?;

    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(address: &str) -> Guard {
        Guard::new(address.parse().unwrap()).unwrap()
    }

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, origin.parse().unwrap());
        }
        headers
    }

    fn admits(guard: &Guard, host: &str, path: &str, query: &str) -> bool {
        guard
            .refuse(&headers(host, None), path, Some(query))
            .is_none()
    }

    fn admits_origin(guard: &Guard, origin: &str) -> bool {
        let headers = headers("localhost:7007", Some(origin));
        guard.refuse(&headers, "/", None).is_none()
    }

    #[test]
    fn only_the_own_address_with_its_port_is_served() {
        let guard = guard("127.0.0.1:7007");

        for own in [
            "127.0.0.1:7007",
            "localhost:7007",
            "LOCALHOST:7007",
            "[::1]:7007",
        ] {
            assert!(admits(&guard, own, "/", ""), "{own} was refused");
        }
        for foreign in [
            "evil.example:7007",
            "localhost",
            "localhost:80",
            "127.0.0.1",
            "127.0.0.1:70070",
            "10.0.0.1:7007",
            "127.0.0.1.evil.example:7007",
            "localhost.:7007",
            "[::1]",
            "",
            ":7007",
        ] {
            assert!(!admits(&guard, foreign, "/", ""), "{foreign} was served");
        }
    }

    #[test]
    fn a_request_needs_exactly_one_host() {
        let guard = guard("127.0.0.1:7007");
        let mut twice = headers("localhost:7007", None);
        twice.append(HOST, "evil.example".parse().unwrap());

        assert!(guard.refuse(&twice, "/", None).is_some());
        assert!(guard.refuse(&HeaderMap::new(), "/", None).is_some());
    }

    #[test]
    fn a_page_from_elsewhere_is_refused() {
        let guard = guard("127.0.0.1:7007");

        assert!(admits_origin(&guard, "http://localhost:7007"));
        for foreign in [
            "http://evil.example",
            "null",
            "http://localhost:8080",
            "https://localhost:7007",
            "",
        ] {
            assert!(!admits_origin(&guard, foreign), "{foreign} was served");
        }
    }

    #[test]
    fn an_open_console_requires_its_token_and_an_ip_address() {
        let guard = guard("0.0.0.0:7007");
        let token = guard.token.clone().unwrap();
        let right = format!("token={token}");
        assert_eq!(token.len(), 2 * TOKEN_BYTES);
        assert_eq!(guard.url(), format!("http://127.0.0.1:7007/?token={token}"));

        let host = "10.0.0.1:7007";
        assert!(admits(&guard, host, "/ws", &right));
        assert!(admits(
            &guard,
            host,
            "/recording/ticks",
            &format!("from=1&{right}")
        ));
        assert!(admits(&guard, host, "/assets/app.js", ""));

        for wrong in [
            "",
            "token=",
            "token=0",
            &format!("token={token}0"),
            &format!("token={}", &token[1..]),
        ] {
            assert!(!admits(&guard, host, "/", wrong), "{wrong} was admitted");
        }
        assert!(!admits(&guard, "evil.example:7007", "/", &right));
    }

    #[test]
    fn every_token_is_new() {
        assert_ne!(guard("0.0.0.0:7007").token, guard("0.0.0.0:7007").token);
    }
}
