//! Without the token there is nothing to see and nothing to do, on loopback as elsewhere.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::io::{Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tungstenite::Message;

use crate::client::{Console, PATIENCE, Response, program};

/// Addresses to serve at: loopback, and all interfaces.
const BINDS: [&str; 2] = ["127.0.0.1:0", "0.0.0.0:0"];

fn console_at(bind: &str) -> Console {
    Console::start(&["--bind", bind, "--connect", "tcp/127.0.0.1:1"])
}

/// Asserts that a response is the page that explains what to do, and nothing else.
fn assert_refused(answer: &Response, what: &str) {
    assert_eq!(answer.status, 403, "{what}: {}", answer.body);
    assert_eq!(answer.header("set-cookie"), "", "{what}");
    assert_eq!(answer.header("location"), "", "{what}");
    assert_eq!(
        answer.header("content-type"),
        "text/html; charset=utf-8",
        "{what}"
    );
    assert!(
        answer.body.contains("?token=…") && answer.body.contains("cars launch"),
        "{what}: {}",
        answer.body
    );
}

#[test]
fn the_printed_address_gives_a_cookie_and_an_address_without_token() {
    for bind in BINDS {
        let console = console_at(bind);
        let token = &console.token;
        assert!(
            token.len() >= 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()),
            "{token}"
        );

        let entrance = console.get_without_cookie(&console.entrance());
        assert_eq!(entrance.status, 303);
        assert_eq!(entrance.header("cache-control"), "no-store");
        assert_eq!(entrance.header("referrer-policy"), "no-referrer");

        let path = entrance.header("location");
        assert_eq!(path, console.path);
        assert!(path.len() > 16 && !path.contains(token), "{path}");
        assert!(path.starts_with('/') && path.ends_with('/'), "{path}");

        let cookie = entrance.header("set-cookie");
        let expected = format!(
            "cars-console-{}={token}; Path={path}; HttpOnly; SameSite=Strict",
            console.port
        );
        assert_eq!(cookie, expected);
        assert_eq!(console.page().until("hello")["mode"], "live");
    }
}

#[test]
fn every_path_is_refused_without_the_token() {
    for bind in BINDS {
        let console = console_at(bind);
        let parts = [
            "ws",
            "recording",
            "recording/ticks?from=0&count=1",
            "recording/diagram?from=0&count=1&width=900",
            "nothing",
            "//ws",
            "/",
            "./ws",
            "../ws",
            "assets",
            "%61ssets/app.js",
            "%2fassets/app.js",
            "Assets/app.js",
            "ws/",
            "ws%2f",
            "ws;assets/",
            "%77s",
        ];
        for part in parts {
            assert_refused(&console.get_without_cookie(&console.path_of(part)), part);
        }
        for path in [
            "/",
            "//",
            "/ws",
            "//ws",
            "/./ws",
            "/recording",
            "/assets/app.js",
            "/assets/../ws",
            "/index.html",
            "/%2f",
            "/%2fws",
            "/nothing",
            console.path.trim_end_matches('/'),
        ] {
            assert_refused(&console.get_without_cookie(path), path);
        }
    }
}

#[test]
fn a_path_behind_the_public_files_leads_nowhere() {
    let console = Console::live();

    for part in [
        "assets/../ws",
        "assets/..%2fws",
        "assets/%2e%2e/recording",
        "assets/../recording/ticks?from=0&count=1",
        "assets//ws",
    ] {
        let answer = console.get_without_cookie(&console.path_of(part));
        assert_eq!(answer.status, 404, "{part}");
        assert_eq!(answer.body, "Not found.\n", "{part}");
    }
    let socket = console.socket(&console.path_of("assets/../ws"), &[]);
    assert_eq!(socket.err(), Some(404));
}

#[test]
fn no_method_is_admitted_without_the_token() {
    let console = Console::live();
    let host = console.host();
    let ws = console.path_of("ws");

    for method in [
        "HEAD", "POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "BREW",
    ] {
        for path in ["/", &ws] {
            let answer = console.request(method, path, &[("Host", &host)]);
            assert_eq!(answer.status, 403, "{method} {path}");
        }
        let page = console.request(method, &console.path, &[("Host", &host)]);
        let expected = if method == "HEAD" { 200 } else { 405 };
        assert_eq!(page.status, expected, "{method}");
    }
    let asterisk = console.request("OPTIONS", "*", &[("Host", &host)]);
    assert_eq!(asterisk.status, 403);
}

#[test]
fn a_token_in_the_wrong_place_is_refused() {
    let console = Console::live();
    let token = &console.token;
    let host = console.host();
    let bearer = format!("Bearer {token}");
    let named = format!("token {token}");
    let ws = console.path_of("ws");

    for (name, value) in [
        ("Authorization", bearer.as_str()),
        ("Authorization", &named),
        ("X-Token", token),
        ("Token", token),
        ("Cookie", token),
        ("Cookie", &format!("token={token}")),
        ("Cookie", &format!("cars-console={token}")),
        ("Cookie", &format!("cars-console-1={token}")),
        ("Set-Cookie", &console.cookie),
        ("Referer", &format!("http://{host}/?token={token}")),
    ] {
        let answer = console.get_with(&ws, &[("Host", &host), (name, value)]);
        assert_refused(&answer, &format!("{name}: {value}"));
        let answer = console.get_with("/", &[("Host", &host), (name, value)]);
        assert_refused(&answer, &format!("{name}: {value} at the entrance"));
    }

    for path in [
        format!("/{token}"),
        format!("/{token}/ws"),
        format!("/token={token}"),
        format!("/ws?token={token}"),
        format!("{ws}?token={token}"),
        format!("/?{token}"),
        format!("/?TOKEN={token}"),
        format!(
            "/?token={}",
            token.to_uppercase().replace(['0', '1'], "%30")
        ),
        format!("/?token=&token={token}"),
        format!("//?token={token}"),
    ] {
        assert_refused(&console.get_without_cookie(&path), &path);
        assert_eq!(console.socket(&path, &[]).err(), Some(403), "{path}");
    }
}

#[test]
fn a_wrong_token_is_refused() {
    let console = Console::live();
    let right = console.token.clone();

    for wrong in [
        "",
        "0",
        &right[1..],
        &format!("{right}0"),
        &"0".repeat(right.len()),
        &"0".repeat(4096),
        "%00",
        "*",
    ] {
        let answer = console.get_without_cookie(&format!("/?token={wrong}"));
        assert_refused(&answer, wrong);

        let cookie = format!("cars-console-{}={wrong}", console.port);
        let headers = [("Host", console.host()), ("Cookie", cookie.clone())];
        let headers = headers
            .each_ref()
            .map(|(name, value)| (*name, value.as_str()));
        assert_refused(&console.get_with(&console.path_of("ws"), &headers), wrong);
        let socket = console.socket(&console.path_of("ws"), &[("Cookie", &cookie)]);
        assert_eq!(socket.err(), Some(403), "{wrong}");
    }
}

#[test]
fn a_socket_needs_the_cookie_with_and_without_an_origin() {
    let console = Console::live();
    let own = format!("http://{}", console.host());
    let ws = console.path_of("ws");

    for path in [ws.as_str(), "/ws", "/", &console.entrance()] {
        assert!(console.socket(path, &[]).is_err(), "{path}");
        assert!(console.socket(path, &[("Origin", &own)]).is_err(), "{path}");
    }
    let foreign = [
        ("Cookie", console.cookie.as_str()),
        ("Origin", "http://evil.example"),
    ];
    assert_eq!(console.socket(&ws, &foreign).err(), Some(403));

    let mut page = console.socket(&ws, &[("Cookie", &console.cookie)]).unwrap();
    assert_eq!(page.until("hello")["mode"], "live");
}

#[test]
fn consoles_of_one_host_do_not_take_each_others_cookies() {
    let one = Console::live();
    let other = Console::live();
    assert_ne!(one.token, other.token);
    assert_ne!(one.path, other.path);

    // A browser sends both to both, were it not for their paths.
    let both = format!("{}; {}", other.cookie, one.cookie);
    for console in [&one, &other] {
        let mut page = console
            .socket(&console.path_of("ws"), &[("Cookie", &both)])
            .unwrap();
        page.until("hello");
    }

    let foreign = one.socket(&one.path_of("ws"), &[("Cookie", &other.cookie)]);
    assert_eq!(foreign.err(), Some(403));
    let renamed = format!("cars-console-{}={}", one.port, other.token);
    let foreign = one.socket(&one.path_of("ws"), &[("Cookie", &renamed)]);
    assert_eq!(foreign.err(), Some(403));
    let foreign = one.socket(&other.path_of("ws"), &[("Cookie", &both)]);
    assert_eq!(foreign.err(), Some(403));
    let entrance = one.get_without_cookie(&other.entrance());
    assert_refused(&entrance, "the token of another console");
}

/// Time until a page has an answer to a request.
fn round_trip(console: &Console) -> Duration {
    let mut page = console.page();
    page.until("hello");
    let started = Instant::now();
    page.send_text("{");
    page.until("answer");
    let took = started.elapsed();

    // The number of browsers is limited, and the console may be late to notice that one is disconnected.
    page.send(Message::Close(None));
    page.until_closed();
    took
}

/// Sets a flag when it is dropped, also where a test panics.
struct End<'a>(&'a std::sync::atomic::AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, std::sync::atomic::Ordering::Relaxed);
    }
}

/// Wrong tokens, at least, while answers to a page are timed.
const MIN_REFUSED: u32 = 100;

#[test]
fn many_wrong_tokens_do_not_slow_others() {
    let console = Console::live();
    let is_over = std::sync::atomic::AtomicBool::new(false);
    let refused = std::sync::atomic::AtomicU32::new(0);
    let order = std::sync::atomic::Ordering::Relaxed;
    let wrong_path = format!("/?token={}", "0".repeat(console.token.len()));
    let mut round_trips = Vec::new();

    std::thread::scope(|scope| {
        let _ends_guessing = End(&is_over);
        let guess = || {
            while !is_over.load(order) {
                let answer = console.get_without_cookie(&wrong_path);
                assert_eq!(answer.status, 403);
                refused.fetch_add(1, order);
            }
        };
        for _ in 0..3 {
            scope.spawn(guess);
        }
        let started = Instant::now();
        let goes_on = || {
            let is_early = started.elapsed() < Duration::from_secs(2);
            let has_guessed = refused.load(order) > MIN_REFUSED;
            is_early || (!has_guessed && started.elapsed() < PATIENCE)
        };
        while goes_on() {
            round_trips.push(round_trip(&console));
        }
    });

    let refused = refused.into_inner();
    assert!(refused > MIN_REFUSED, "{refused}");
    // Not the slowest: the machine may stand still for a moment.
    round_trips.sort();
    let median = round_trips[round_trips.len() / 2];
    println!("{refused} wrong tokens; an answer to a page took {median:?}");
    assert!(median < Duration::from_millis(500), "{round_trips:?}");
}

#[test]
fn clients_without_the_token_cannot_keep_all_connections() {
    let console = Console::live();
    let host = console.host();
    let mut kept = Vec::new();

    // More than the console serves at a time. They would stay open for a further request.
    for _ in 0..300 {
        let mut stream = console.connect();
        write!(stream, "GET /?token=0 HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        kept.push(stream);
    }

    assert_eq!(console.page().until("hello")["mode"], "live");
    for stream in &mut kept {
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 403 "), "{answer}");
    }
}

/// A folder with a program to set as `BROWSER`, which writes down its arguments.
struct Browser {
    folder: tempfile::TempDir,
}

impl Browser {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let browser = folder.path().join("browser");
        let script =
            "#!/bin/sh\necho \"$@\" > \"$0.writing\"\nmv \"$0.writing\" \"$0.arguments\"\n";
        std::fs::write(&browser, script).unwrap();
        std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).unwrap();
        Self { folder }
    }

    /// A console that opens this browser.
    fn console(&self, current_folder: &Path) -> Console {
        let mut command = program(&["--open", "--bind", "127.0.0.1:0"]);
        command
            .args(["--connect", "tcp/127.0.0.1:1"])
            .current_dir(current_folder)
            .env("BROWSER", self.folder.path().join("browser"));
        Console::start_unopened(command)
    }

    /// Waits for the arguments with which it was started.
    fn arguments(&self) -> String {
        let file = self.folder.path().join("browser.arguments");
        eventually(|| file.exists());
        std::fs::read_to_string(file).unwrap()
    }
}

fn eventually(is_done: impl Fn() -> bool) {
    let started = Instant::now();
    while !is_done() {
        assert!(started.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Asserts that the file leads to the console's address and that only its owner can read it.
fn assert_leads_to(file: &Path, console: &Console) {
    let text = std::fs::read_to_string(file).unwrap();
    let url = format!("url=http://{}{}\"", console.host(), console.entrance());
    assert!(text.contains(&url), "{text}");

    let mode = std::fs::metadata(file).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
}

#[test]
fn the_browser_is_started_without_the_token_in_its_arguments() {
    let browser = Browser::new();
    let folder = tempfile::tempdir().unwrap();
    let console = browser.console(folder.path());

    let arguments = browser.arguments();
    assert!(!arguments.contains(&console.token), "{arguments}");
    let file = PathBuf::from(arguments.trim());
    assert_eq!(file.parent(), Some(folder.path()));
    assert_leads_to(&file, &console);

    let entrance = console.get_without_cookie(&console.entrance());
    assert_eq!(entrance.status, 303);
    eventually(|| !file.exists());
}

#[test]
fn the_file_for_the_browser_does_not_outlive_the_console() {
    let browser = Browser::new();
    let folder = tempfile::tempdir().unwrap();
    let mut console = browser.console(folder.path());
    let file = PathBuf::from(browser.arguments().trim());
    assert!(file.exists());

    console.terminate();
    assert!(console.wait().success());
    assert!(!file.exists());
}
