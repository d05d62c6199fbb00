//! Who is let in, and what they get.

use std::io::{Read, Write};
use std::net::TcpListener;

use crate::client::{Console, fails};

#[test]
fn a_request_for_another_host_is_refused() {
    let console = Console::live();
    for path in ["/", "/ws", "/assets/app.js", "/recording"] {
        for host in [
            "evil.example",
            &format!("evil.example:{}", console.port),
            "127.0.0.1",
            "",
        ] {
            let answer = console.get_with(path, &[("Host", host)]);
            assert_eq!(answer.status, 403, "{path} of {host:?}");
            assert!(answer.body.contains(&console.host()), "{}", answer.body);
        }
        assert_eq!(
            console.get_with(path, &[]).status,
            403,
            "{path} without a host"
        );
    }
    for host in [
        console.host(),
        format!("localhost:{}", console.port),
        format!("[::1]:{}", console.port),
    ] {
        assert_eq!(
            console.get_with("/nothing", &[("Host", &host)]).status,
            404,
            "{host}"
        );
    }
}

#[test]
fn a_page_from_elsewhere_gets_no_socket() {
    let console = Console::live();
    for origin in [
        "http://evil.example",
        "null",
        "https://127.0.0.1",
        "http://127.0.0.1:1",
    ] {
        assert_eq!(console.page_of(Some(origin)).err(), Some(403), "{origin}");
    }
    assert_eq!(console.page().until("hello")["mode"], "live");
    // A program that is no browser names no origin.
    assert_eq!(
        console
            .page_of(None)
            .map(|mut page| page.until("hello")["run"].clone()),
        Ok("nobody".into())
    );
}

#[test]
fn every_answer_forbids_what_the_page_does_not_need() {
    let console = Console::live();
    let foreign = [("Host", "evil.example")];
    let answers = [
        console.get("/"),
        console.get("/nothing"),
        console.get("/assets/nothing"),
        console.get("/recording"),
        console.get("/ws"),
        console.get_with("/", &foreign),
    ];
    for answer in answers {
        assert_eq!(
            answer.header("content-security-policy"),
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
             font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        );
        assert_eq!(answer.header("x-content-type-options"), "nosniff");
        assert_eq!(answer.header("referrer-policy"), "no-referrer");
        assert_eq!(answer.header("cross-origin-resource-policy"), "same-origin");
        assert_eq!(answer.header("access-control-allow-origin"), "");
    }
}

#[test]
fn an_open_console_wants_its_token() {
    let console = Console::start(&["--bind", "0.0.0.0:0", "--connect", "tcp/127.0.0.1:1"]);
    let token = console
        .token
        .strip_prefix("?token=")
        .unwrap_or_else(|| panic!("no token: {}", console.line));
    assert!(
        token.len() >= 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()),
        "{token}"
    );
    for path in ["/", "/ws", "/recording", "/recording/ticks?from=0&count=1"] {
        for query in ["", "token=", "token=0", "token=0000", &token[1..]] {
            let glue = if path.contains('?') { '&' } else { '?' };
            let answer = console.get(&format!("{path}{glue}{query}"));
            assert_eq!(answer.status, 403, "{path} with {query:?}");
            assert!(answer.body.contains("?token="), "{}", answer.body);
        }
    }
    assert_ne!(console.get(&format!("/{}", console.token)).status, 403);
    assert_eq!(
        console.get("/assets/nothing").status,
        404,
        "the page's parts are no secret"
    );
    assert_eq!(console.page().until("hello")["mode"], "live");
    assert_ne!(
        Console::start(&["--bind", "0.0.0.0:0"]).token,
        console.token,
        "a new one every time"
    );
}

#[test]
fn the_page_is_served_with_all_its_parts() {
    let console = Console::live();
    let page = console.get("/");
    assert_eq!(
        (page.status, page.header("content-type")),
        (200, "text/html; charset=utf-8")
    );
    let parts: Vec<&str> = page
        .body
        .split('"')
        .filter(|text| text.starts_with("assets/"))
        .collect();
    assert!(parts.len() > 2, "{parts:?}");
    for part in parts {
        let answer = console.get(&format!("/{part}"));
        let expected = match part.rsplit('.').next() {
            Some("js") => "text/javascript; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => panic!("what is {part}?"),
        };
        assert_eq!(
            (answer.status, answer.header("content-type")),
            (200, expected),
            "{part}"
        );
    }
}

#[test]
fn nothing_but_the_page_can_be_read() {
    let console = Console::live();
    for path in [
        "/assets/../src/main.rs",
        "/assets/../../Cargo.toml",
        "/assets/%2e%2e/Cargo.toml",
        "/assets/..%2fCargo.toml",
        "/assets/%2e%2e%2f%2e%2e%2f%2e%2e%2fetc%2fpasswd",
        "/assets//etc/passwd",
        "/assets/%2fetc%2fpasswd",
        "/assets/",
        "/../../../etc/passwd",
        "/assets/..\\Cargo.toml",
    ] {
        let answer = console.get(path);
        assert_eq!(
            (answer.status, answer.body.as_str()),
            (404, "There is nothing here.\n"),
            "{path}"
        );
    }
    let answer = console.get("/recording");
    assert_eq!(
        answer.status, 404,
        "a run in progress is no recording: {}",
        answer.body
    );
}

#[test]
fn requests_that_are_no_requests_do_no_harm() {
    let console = Console::live();
    let long = format!("GET /{} HTTP/1.1\r\n\r\n", "x".repeat(1 << 20));
    for junk in [
        "\r\n\r\n\r\n",
        "\0\0\0\0\r\n\r\n",
        "GET\r\n\r\n",
        "POST / HTTP/9.9\r\n\r\n",
        &long,
    ] {
        let mut stream = console.connect();
        // It may be shut before all is written.
        let _ = stream.write_all(junk.as_bytes());
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(!answer.starts_with(b"HTTP/1.1 200"), "{junk:?}");
    }
    assert_eq!(console.get("/nothing").status, 404, "it still serves");
}

#[test]
fn a_taken_default_port_gives_way_and_a_wanted_one_does_not() {
    // Whoever has it: what matters is that it is taken.
    let taken = TcpListener::bind("127.0.0.1:7007");
    let mut console = Console::start(&["--connect", "tcp/127.0.0.1:1"]);
    assert_ne!(console.port, 7007);
    console.terminate();
    assert!(console.wait().success());
    assert!(console.errors().contains("127.0.0.1:7007 is taken"));
    let text = fails(&["--bind", "127.0.0.1:7007"]);
    assert!(
        text.contains("cannot serve at 127.0.0.1:7007") && text.contains("--bind"),
        "{text}"
    );
    drop(taken);
}
