//! Which requests are admitted, and what they get.

use std::io::{Read, Write};
use std::net::TcpListener;

use crate::client::{Console, fails, program};

#[test]
fn a_request_for_another_host_is_refused() {
    let console = Console::live();

    for path in [
        "/",
        &console.entrance(),
        &console.path,
        &console.path_of("ws"),
    ] {
        for host in [
            "evil.example",
            &format!("evil.example:{}", console.port),
            "127.0.0.1",
            "",
        ] {
            let headers = [("Host", host), ("Cookie", &console.cookie)];
            let answer = console.get_with(path, &headers);
            assert_eq!(answer.status, 403, "{path} of {host:?}");
            assert_eq!(answer.header("set-cookie"), "");
            assert!(answer.body.contains(&console.host()), "{}", answer.body);
        }

        let without_host = console.get_with(path, &[("Cookie", &console.cookie)]);
        assert_eq!(without_host.status, 403, "{path} without a host");
    }
}

#[test]
fn a_request_for_the_own_address_is_served() {
    let console = Console::live();

    for host in [
        console.host(),
        format!("localhost:{}", console.port),
        format!("[::1]:{}", console.port),
    ] {
        let headers = [("Host", host.as_str()), ("Cookie", &console.cookie)];
        let answer = console.get_with(&console.path_of("nothing"), &headers);
        assert_eq!(answer.status, 404, "{host}");
    }
}

/// As behind a proxy that brings TLS.
#[test]
fn a_host_that_is_allowed_is_served_and_no_other() {
    let console = Console::start(&[
        "--bind",
        "127.0.0.1:0",
        "--connect",
        "tcp/127.0.0.1:1",
        "--allow-host",
        "cars.example.org,lab.example:8443",
    ]);

    for (host, status) in [
        ("cars.example.org", 303),
        ("lab.example:8443", 303),
        ("lab.example", 403),
        ("evil.example", 403),
    ] {
        let answer = console.get_with(&console.entrance(), &[("Host", host)]);
        assert_eq!(answer.status, status, "{host}");
    }
    let path = console.path_of("nothing");
    let admitted = [("Host", "cars.example.org"), ("Cookie", &console.cookie)];
    assert_eq!(console.get_with(&path, &admitted).status, 404);
    for (origin, status) in [
        ("https://cars.example.org", 404),
        ("https://evil.example", 403),
    ] {
        let headers = [&admitted[..], &[("Origin", origin)]].concat();
        assert_eq!(console.get_with(&path, &headers).status, status, "{origin}");
    }
    assert_eq!(
        console.get_with(&path, &admitted[..1]).status,
        403,
        "without the cookie"
    );

    let output = program(&["--allow-host", "https://cars.example.org"]).output();
    let output = output.expect("the program is there");
    assert_eq!(output.status.code(), Some(2));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("without http://"), "{errors}");
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

    // Programs other than browsers send no origin.
    let mut program = console.page_of(None).expect("is admitted");
    assert_eq!(program.until("hello")["run"], "absent");
}

#[test]
fn every_answer_forbids_what_the_page_does_not_need() {
    let console = Console::live();
    let foreign = [("Host", "evil.example")];
    let answers = [
        console.get(""),
        console.get("nothing"),
        console.get("assets/nothing"),
        console.get("recording"),
        console.get("ws"),
        console.get_without_cookie("/"),
        console.get_without_cookie(&console.entrance()),
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
fn the_page_is_served_with_all_its_parts() {
    let console = Console::live();
    let page = console.get("");
    assert_eq!(page.status, 200);
    assert_eq!(page.header("content-type"), "text/html; charset=utf-8");

    let parts: Vec<&str> = page
        .body
        .split('"')
        .filter(|text| text.starts_with("assets/"))
        .collect();
    assert!(parts.len() > 2, "{parts:?}");

    for part in parts {
        let answer = console.get(part);
        let expected = match part.rsplit('.').next() {
            Some("js") => "text/javascript; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => panic!("{part} has an unknown extension"),
        };
        assert_eq!(answer.status, 200, "{part}");
        assert_eq!(answer.header("content-type"), expected, "{part}");
    }
}

#[test]
fn nothing_but_the_page_can_be_read() {
    let console = Console::live();

    for path in [
        "assets/../src/main.rs",
        "assets/../../Cargo.toml",
        "assets/%2e%2e/Cargo.toml",
        "assets/..%2fCargo.toml",
        "assets/%2e%2e%2f%2e%2e%2f%2e%2e%2fetc%2fpasswd",
        "assets//etc/passwd",
        "assets/%2fetc%2fpasswd",
        "assets/",
        "../../../etc/passwd",
        "assets/..\\Cargo.toml",
    ] {
        let answer = console.get(path);
        assert_eq!(answer.status, 404, "{path}");
        assert_eq!(answer.body, "Not found.\n", "{path}");
    }
}

#[test]
fn malformed_http_does_no_harm() {
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
        // The console may close the connection before all is written.
        let _ = stream.write_all(junk.as_bytes());
        let _ = stream.shutdown(std::net::Shutdown::Write);

        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(!answer.starts_with(b"HTTP/1.1 200"), "{junk:?}");
    }

    assert_eq!(console.get("nothing").status, 404, "it still serves");
}

#[test]
fn a_default_port_in_use_is_replaced_and_a_requested_one_is_not() {
    // If this fails, another process uses the port, and that will do.
    let listener = TcpListener::bind("127.0.0.1:7007");

    let mut console = Console::start(&["--connect", "tcp/127.0.0.1:1"]);
    assert_ne!(console.port, 7007);
    console.terminate();
    assert!(console.wait().success());
    assert!(console.errors().contains("127.0.0.1:7007 is in use"));

    let text = fails(&["--bind", "127.0.0.1:7007"]);
    assert!(text.contains("cannot serve at 127.0.0.1:7007"), "{text}");
    assert!(text.contains("--bind"), "{text}");
    drop(listener);
}
