//! Who may come in. A web page of somebody else's must not reach a run through the browser of a person who has the
//! console open: neither by a name that suddenly means this machine (DNS rebinding) nor by a WebSocket across origins.

use std::net::{IpAddr, SocketAddr};

use axum::http::header::{
    CONTENT_SECURITY_POLICY, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use subtle::ConstantTimeEq;

/// Nothing but what comes with the page runs in it or is loaded by it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                      connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// What every answer says about itself.
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

/// Bytes of chance in a token.
const TOKEN_BYTES: usize = 24;

/// Decides about requests.
#[derive(Debug)]
pub(crate) struct Guard {
    address: SocketAddr,
    /// What whoever comes from another machine must know; none where nobody can.
    token: Option<String>,
}

impl Guard {
    /// A guard of what is served at `address`; a new token where that is not loopback.
    pub(crate) fn new(address: SocketAddr) -> Result<Self, getrandom::Error> {
        let token = if address.ip().is_loopback() {
            None
        } else {
            Some(draw_token()?)
        };
        Ok(Self { address, token })
    }

    /// Where people find it.
    pub(crate) fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            let loopback: (IpAddr, IpAddr) =
                ([127, 0, 0, 1].into(), [0, 0, 0, 0, 0, 0, 0, 1].into());
            address.set_ip(if address.is_ipv4() {
                loopback.0
            } else {
                loopback.1
            });
        }
        match &self.token {
            Some(token) => format!("http://{address}/?token={token}"),
            None => format!("http://{address}/"),
        }
    }

    /// Why a request is refused; `None` if it may pass.
    pub(crate) fn refuse(
        &self,
        headers: &HeaderMap,
        path: &str,
        query: Option<&str>,
    ) -> Option<String> {
        let Some(host) = only(headers, &HOST).filter(|host| self.is_own(host)) else {
            return Some(format!(
                "This console is at {}: a request must name that address, or localhost, with its port.\n",
                self.address
            ));
        };
        let is_foreign = |origin: &str| !origin.eq_ignore_ascii_case(&format!("http://{host}"));
        if headers.contains_key(ORIGIN) && only(headers, &ORIGIN).is_none_or(is_foreign) {
            return Some("A page from elsewhere may not use this console.\n".to_owned());
        }
        // The page's parts are no secret; what it shows and does is.
        if path.starts_with("/assets/") || self.knows_token(query) {
            return None;
        }
        Some(
            "This console is open to the network: use the address with ?token= that it printed.\n"
                .to_owned(),
        )
    }

    /// Whether a `Host` means this console. A literal address cannot be made to mean another machine, a name can.
    fn is_own(&self, host: &str) -> bool {
        let (name, port) = match host
            .rsplit_once(':')
            .filter(|(_, port)| !port.ends_with(']'))
        {
            Some((name, port)) => (name, port.parse().ok()),
            None => (host, Some(80)),
        };
        let ip = name
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'))
            .unwrap_or(name);
        let is_ours = |ip: IpAddr| {
            ip == self.address.ip() || self.address.ip().is_unspecified() || is_usual_loopback(ip)
        };
        port == Some(self.address.port())
            && (name.eq_ignore_ascii_case("localhost") || ip.parse().is_ok_and(is_ours))
    }

    fn knows_token(&self, query: Option<&str>) -> bool {
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

fn is_usual_loopback(ip: IpAddr) -> bool {
    ip == IpAddr::from([127, 0, 0, 1]) || ip == IpAddr::from([0, 0, 0, 0, 0, 0, 0, 1])
}

/// The value of a header that is there once.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(first)
}

fn draw_token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, origin.parse().unwrap());
        }
        headers
    }

    fn passes(guard: &Guard, host: &str, origin: Option<&str>) -> bool {
        guard.refuse(&headers(host, origin), "/", None).is_none()
    }

    #[test]
    fn only_the_own_address_with_its_port_is_served() {
        let guard = Guard::new("127.0.0.1:7007".parse().unwrap()).unwrap();
        for own in [
            "127.0.0.1:7007",
            "localhost:7007",
            "LOCALHOST:7007",
            "[::1]:7007",
        ] {
            assert!(passes(&guard, own, None), "{own} was refused");
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
            assert!(!passes(&guard, foreign, None), "{foreign} was served");
        }
        let mut twice = headers("localhost:7007", None);
        twice.append(HOST, "evil.example".parse().unwrap());
        assert!(guard.refuse(&twice, "/", None).is_some());
        assert!(guard.refuse(&HeaderMap::new(), "/", None).is_some());
    }

    #[test]
    fn a_page_from_elsewhere_is_refused() {
        let guard = Guard::new("127.0.0.1:7007".parse().unwrap()).unwrap();
        assert!(passes(
            &guard,
            "localhost:7007",
            Some("http://localhost:7007")
        ));
        for foreign in [
            "http://evil.example",
            "null",
            "http://localhost:8080",
            "https://localhost:7007",
            "",
        ] {
            assert!(
                !passes(&guard, "localhost:7007", Some(foreign)),
                "{foreign} was served"
            );
        }
    }

    #[test]
    fn an_open_console_wants_its_token_and_an_address_in_figures() {
        let guard = Guard::new("0.0.0.0:7007".parse().unwrap()).unwrap();
        let token = guard.token.clone().unwrap();
        assert_eq!(token.len(), 2 * TOKEN_BYTES);
        assert_eq!(guard.url(), format!("http://127.0.0.1:7007/?token={token}"));
        let ask = |host, path, query: &str| {
            guard
                .refuse(&headers(host, None), path, Some(query))
                .is_none()
        };
        assert!(ask("10.0.0.1:7007", "/ws", &format!("token={token}")));
        assert!(ask(
            "10.0.0.1:7007",
            "/recording/ticks",
            &format!("from=1&token={token}")
        ));
        assert!(ask("10.0.0.1:7007", "/assets/app.js", ""));
        for wrong in [
            "",
            "token=",
            "token=0",
            &format!("token={token}0"),
            &format!("token={}", &token[1..]),
        ] {
            assert!(!ask("10.0.0.1:7007", "/", wrong), "{wrong} was let in");
        }
        assert!(!ask("evil.example:7007", "/", &format!("token={token}")));
        assert_ne!(
            token,
            Guard::new("0.0.0.0:7007".parse().unwrap())
                .unwrap()
                .token
                .unwrap()
        );
    }
}
