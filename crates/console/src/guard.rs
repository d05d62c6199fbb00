//! Decides which HTTP requests are answered.
//!
//! Other users of this machine must not reach a run: a request needs the token, which only the printed address and the
//! browser that opened it know. Other web pages must not reach it through the browser of a person who has the console
//! open, neither through a host name that resolves to this machine (DNS rebinding) nor through a WebSocket across origins.
//!
//! The printed address exchanges the token for a cookie. A browser sends its cookies to every port of a host, so another
//! user's server on this machine could collect them; it does not send them to other paths. The page is therefore at a
//! path that is drawn for each console, and the cookie is limited to that path.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use axum::http::header::{
    CONTENT_SECURITY_POLICY, COOKIE, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN,
    REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
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

/// The path that exchanges the token for a cookie.
pub(crate) const ENTRANCE: &str = "/";
/// Random bytes in a token.
const TOKEN_BYTES: usize = 24;
/// Random bytes in the path of the page.
const PATH_BYTES: usize = 8;
/// Longest name of a host with its port, bytes.
const MAX_HOST_BYTES: usize = 260;

/// Decides which requests are answered.
#[derive(Debug)]
pub(crate) struct Guard {
    address: SocketAddr,
    /// The secret that admits a browser.
    token: String,
    /// Path of the page, with a slash at both ends.
    path: String,
    /// Cookies with this name contain the token. Consoles on one host have different ports and share the browser's cookies.
    cookie_name: String,
    /// Further hosts that requests may name.
    hosts: Vec<AllowedHost>,
}

/// A host under which a proxy serves the console: a name or an address, with a port unless it is the usual one of HTTP or HTTPS.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AllowedHost(String);

impl std::str::FromStr for AllowedHost {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_part = |c: char| c.is_ascii_alphanumeric() || "-.:[]".contains(c);
        let is_host = !HostHeader::parse(text).name.is_empty() && text.chars().all(is_part);
        if !is_host || text.len() > MAX_HOST_BYTES {
            return Err(format!(
                "{text:?} is not a host such as cars.example.org or cars.example.org:8443, without http:// and path"
            ));
        }
        Ok(Self(text.to_owned()))
    }
}

/// Why a request is refused.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum RequestRefusal {
    /// It is for another host, or from another page; the text explains it.
    Foreign(String),
    /// It has no token, or a wrong one.
    NoToken,
}

impl Guard {
    /// A guard with a new token for what is served at `address`.
    pub(crate) fn new(address: SocketAddr) -> Result<Self, getrandom::Error> {
        let token = random_hex::<TOKEN_BYTES>()?;
        let path = random_hex::<PATH_BYTES>()?;

        Ok(Self {
            address,
            token,
            path: format!("/{path}/"),
            cookie_name: format!("cars-console-{}", address.port()),
            hosts: Vec::new(),
        })
    }

    /// A guard with the token and the path of a console that was here before.
    pub(crate) fn again(address: SocketAddr, token: String, path: &str) -> Self {
        Self {
            address,
            token,
            path: path.to_owned(),
            cookie_name: format!("cars-console-{}", address.port()),
            hosts: Vec::new(),
        }
    }

    /// The guard, which also admits requests that name these hosts.
    pub(crate) fn allowing(mut self, hosts: Vec<AllowedHost>) -> Self {
        self.hosts = hosts;
        self
    }

    /// What is served.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// The secret that admits a browser.
    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// The URL that admits a browser, with the token.
    pub(crate) fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            // A browser cannot open the address that means all of them.
            address.set_ip(loopback_like(address.ip()));
        }

        format!("http://{address}{ENTRANCE}?token={}", self.token)
    }

    /// Path of the page, with a slash at both ends.
    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// The value of `Set-Cookie` for a browser that has shown the token.
    pub(crate) fn cookie(&self) -> String {
        format!(
            "{}={}; Path={}; HttpOnly; SameSite=Strict",
            self.cookie_name, self.token, self.path
        )
    }

    /// Why a request is refused; `None` if it is admitted.
    pub(crate) fn refuse(
        &self,
        headers: &HeaderMap,
        path: &str,
        query: Option<&str>,
    ) -> Option<RequestRefusal> {
        // The host before anything else: under a name that was rebound to this machine, a page would be
        // of the same origin as its request, and pass the next check.
        let named = single(headers, &HOST);
        let is_allowed = named.is_some_and(|host| self.is_allowed(host));
        let Some(host) = named.filter(|host| is_allowed || self.is_own(host)) else {
            return Some(RequestRefusal::Foreign(format!(
                "This console is at {}: a request must name that address, or localhost, with its port. \
                 The option --allow-host admits other names.\n",
                self.address
            )));
        };
        // A proxy that serves an allowed host may do so over TLS.
        let schemes: &[&str] = if is_allowed {
            &["http", "https"]
        } else {
            &["http"]
        };
        if is_from_other_page(headers, host, schemes) {
            return Some(RequestRefusal::Foreign(
                "A page from elsewhere may not use this console.\n".to_owned(),
            ));
        }

        // The token is good for one path alone, and what it buys, the cookie, for all others.
        let is_admitted = match path.strip_prefix(&self.path) {
            Some(rest) => is_static(rest) || self.has_cookie(headers),
            None => path == ENTRANCE && self.has_token(query),
        };
        (!is_admitted).then_some(RequestRefusal::NoToken)
    }

    fn is_allowed(&self, host: &str) -> bool {
        let mut hosts = self.hosts.iter();
        hosts.any(|AllowedHost(allowed)| allowed.eq_ignore_ascii_case(host))
    }

    fn is_own(&self, host: &str) -> bool {
        let host = HostHeader::parse(host);
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
        let mut parameters = query.unwrap_or_default().split('&');
        parameters
            .find_map(|parameter| parameter.strip_prefix("token="))
            .is_some_and(|given| self.is_token(given.as_bytes()))
    }

    /// Whether one of the request's cookies contains the token. Pages on other ports of the host may have set cookies with
    /// the same name, or with bytes that are not text.
    fn has_cookie(&self, headers: &HeaderMap) -> bool {
        for header in headers.get_all(COOKIE) {
            for cookie in header.as_bytes().split(|byte| *byte == b';') {
                let value = cookie
                    .trim_ascii()
                    .strip_prefix(self.cookie_name.as_bytes())
                    .and_then(|rest| rest.strip_prefix(b"="));
                if value.is_some_and(|value| self.is_token(value)) {
                    return true;
                }
            }
        }
        false
    }

    /// Takes the same time for every wrong token of the right length.
    fn is_token(&self, given: &[u8]) -> bool {
        given.ct_eq(self.token.as_bytes()).into()
    }
}

/// Whether this part of the page is a file of the program, with nothing of the run in it. After a visit through a link from
/// elsewhere, a browser requests these files without the cookie, because that is `SameSite=Strict`.
fn is_static(path: &str) -> bool {
    path.is_empty() || path.starts_with("assets/")
}

/// The value of a `Host` header.
struct HostHeader<'a> {
    /// A name or an IP address, without brackets.
    name: &'a str,
    /// `None` if it is not a port number.
    port: Option<u16>,
}

impl<'a> HostHeader<'a> {
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

/// Whether a browser sent the request for a page that `host` did not serve over one of the schemes. Other programs send no
/// `Origin`.
fn is_from_other_page(headers: &HeaderMap, host: &str, schemes: &[&str]) -> bool {
    if !headers.contains_key(ORIGIN) {
        return false;
    }

    let origin = single(headers, &ORIGIN).unwrap_or_default();
    let mut own_origins = schemes.iter().map(|scheme| format!("{scheme}://{host}"));
    !own_origins.any(|own| origin.eq_ignore_ascii_case(&own))
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

    // Of two values, this server and the browser or a proxy might each take another one.
    values.next().is_none().then_some(first)
}

/// `N` random bytes as hexadecimal digits.
fn random_hex<const N: usize>() -> Result<String, getrandom::Error> {
    let mut bytes = [0; N];
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

    /// Whether a request with the right token is admitted.
    fn admits(guard: &Guard, host: &str) -> bool {
        let query = format!("token={}", guard.token);
        guard
            .refuse(&headers(host, None), ENTRANCE, Some(&query))
            .is_none()
    }

    fn admits_origin(guard: &Guard, origin: &str) -> bool {
        let headers = headers("localhost:7007", Some(origin));
        let query = format!("token={}", guard.token);
        guard.refuse(&headers, ENTRANCE, Some(&query)).is_none()
    }

    /// Whether a request with these cookies is admitted to a part of the page.
    fn admits_cookies(guard: &Guard, cookies: &[&[u8]], part: &str) -> bool {
        let mut headers = headers("127.0.0.1:7007", None);
        for cookie in cookies {
            headers.append(COOKIE, HeaderValue::from_bytes(cookie).unwrap());
        }
        let path = format!("{}{part}", guard.path);
        guard.refuse(&headers, &path, None).is_none()
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
            assert!(admits(&guard, own), "{own} was refused");
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
            assert!(!admits(&guard, foreign), "{foreign} was served");
        }
    }

    #[test]
    fn hosts_are_allowed_by_name() {
        let allowed = ["cars.example.org", "lab.example:8443"].map(|host| host.parse().unwrap());
        let guard = guard("127.0.0.1:7007").allowing(allowed.to_vec());

        for own in [
            "cars.example.org",
            "CARS.example.org",
            "lab.example:8443",
            "localhost:7007",
        ] {
            assert!(admits(&guard, own), "{own} was refused");
        }
        for foreign in [
            "cars.example.org:7007",
            "cars.example.org.",
            "x.cars.example.org",
            "example.org",
            "lab.example",
            "lab.example:7007",
        ] {
            assert!(!admits(&guard, foreign), "{foreign} was served");
        }

        let query = format!("token={}", guard.token);
        let admits = |origin| {
            let headers = headers("cars.example.org", Some(origin));
            guard.refuse(&headers, ENTRANCE, Some(&query)).is_none()
        };
        assert!(admits("https://cars.example.org") && admits("http://cars.example.org"));
        for foreign in [
            "https://lab.example:8443",
            "https://cars.example.org:8443",
            "null",
            "",
        ] {
            assert!(!admits(foreign), "{foreign} was served");
        }
        // The own address is not served over TLS.
        assert!(!admits_origin(&guard, "https://localhost:7007"));
    }

    #[test]
    fn what_is_no_host_cannot_be_allowed() {
        for host in [
            "cars.example.org",
            "10.0.0.1:80",
            "[::1]:8443",
            &"a".repeat(MAX_HOST_BYTES),
        ] {
            assert!(host.parse::<AllowedHost>().is_ok(), "{host}");
        }
        let long = "a".repeat(MAX_HOST_BYTES + 1);
        for wrong in [
            "",
            ":80",
            "https://cars.example.org",
            "cars.example.org/",
            "a b",
            "*",
            "a,b",
            &long,
        ] {
            assert!(wrong.parse::<AllowedHost>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_request_needs_exactly_one_host() {
        let guard = guard("127.0.0.1:7007");
        let mut twice = headers("localhost:7007", None);
        twice.append(HOST, "evil.example".parse().unwrap());

        for wrong in [twice, HeaderMap::new()] {
            let refusal = guard.refuse(&wrong, ENTRANCE, None);
            assert!(
                matches!(refusal, Some(RequestRefusal::Foreign(_))),
                "{refusal:?}"
            );
        }
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
    fn the_printed_address_has_the_token() {
        for (address, host) in [
            ("127.0.0.1:7007", "127.0.0.1:7007"),
            ("0.0.0.0:7007", "127.0.0.1:7007"),
            ("[::]:7007", "[::1]:7007"),
            ("10.0.0.1:7007", "10.0.0.1:7007"),
        ] {
            let guard = guard(address);
            let token = &guard.token;
            assert_eq!(token.len(), 2 * TOKEN_BYTES);
            assert_eq!(guard.url(), format!("http://{host}/?token={token}"));
        }
    }

    #[test]
    fn the_entrance_requires_the_token_at_every_address() {
        for address in ["127.0.0.1:7007", "[::1]:7007", "0.0.0.0:7007"] {
            let guard = guard(address);
            let token = &guard.token;
            let headers = headers("127.0.0.1:7007", None);

            for wrong in [
                "",
                "token",
                "token=",
                "token=0",
                &format!("token={token}0"),
                &format!("token={}", &token[1..]),
                &format!("token={}", "0".repeat(token.len())),
                &format!("token=0&token={token}"),
                &format!("Token={token}"),
                &format!("x=token={token}"),
                token,
            ] {
                let refusal = guard.refuse(&headers, ENTRANCE, Some(wrong));
                assert_eq!(
                    refusal,
                    Some(RequestRefusal::NoToken),
                    "{wrong:?} at {address}"
                );
            }
            assert!(guard.refuse(&headers, ENTRANCE, None).is_some());

            let right = format!("x=1&token={token}");
            assert_eq!(guard.refuse(&headers, ENTRANCE, Some(&right)), None);
            assert!(!admits(&guard, "evil.example:7007"));
        }
    }

    #[test]
    fn the_token_in_the_query_admits_to_the_entrance_only() {
        let guard = guard("127.0.0.1:7007");
        let headers = headers("127.0.0.1:7007", None);
        let query = format!("token={}", guard.token);

        for path in [
            "/ws",
            "/recording",
            "//",
            "/.",
            "",
            &format!("{}ws", guard.path),
            &format!("/{}{}ws", guard.path, guard.path),
        ] {
            let refusal = guard.refuse(&headers, path, Some(&query));
            assert_eq!(refusal, Some(RequestRefusal::NoToken), "{path:?}");
        }
    }

    #[test]
    fn the_page_requires_the_cookie_of_this_console() {
        let guard = guard("127.0.0.1:7007");
        let own = format!("cars-console-7007={}", guard.token);
        assert!(guard.cookie().starts_with(&own), "{}", guard.cookie());

        let own = own.as_bytes();
        let other: &[u8] = b"cars-console-7008=0123; theme=dark";
        let bytes: &[u8] = b"name=\xff\xfe";
        let tossed: &[u8] = b"cars-console-7007=0123";
        let joined = [tossed, own].join(&b"; "[..]);
        for right in [
            &[own] as &[&[u8]],
            &[other, own],
            &[bytes, own],
            &[tossed, own],
            &[&joined],
        ] {
            assert!(admits_cookies(&guard, right, "ws"), "{right:?}");
        }

        let renamed = format!("cars-console-7008={}", guard.token);
        let prefixed = format!("x-cars-console-7007={}", guard.token);
        let longer = format!("cars-console-7007={}0", guard.token);
        for wrong in [
            &[] as &[&[u8]],
            &[b""],
            &[b"cars-console-7007"],
            &[b"cars-console-7007="],
            &[other, tossed],
            &[renamed.as_bytes()],
            &[prefixed.as_bytes()],
            &[longer.as_bytes()],
        ] {
            assert!(!admits_cookies(&guard, wrong, "ws"), "{wrong:?}");
            assert!(admits_cookies(&guard, wrong, ""));
            assert!(admits_cookies(&guard, wrong, "assets/app.js"));
        }
    }

    #[test]
    fn every_token_and_every_path_is_new() {
        let one = guard("127.0.0.1:7007");
        let other = guard("127.0.0.1:7007");

        assert_ne!(one.token, other.token);
        assert_ne!(one.path, other.path);
    }
}
