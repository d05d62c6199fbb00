//! Starts a console and connects to it as a browser does.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// How long to wait for anything before a test fails.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

/// The program under test.
pub(crate) fn program(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cars-console"));
    for variable in [
        "CARS_RUN",
        "CARS_CONNECT",
        "CARS_ZENOH_CONFIG",
        "CARS_CONSOLE_BIND",
        "CARS_CONSOLE_ALLOW_HOST",
        "CARS_CONSOLE_KEEP",
        "CARS_CONSOLE_FAILED",
    ] {
        command.env_remove(variable);
    }

    command
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());

    command
}

/// Runs the program, which must fail, and returns its error output.
pub(crate) fn fails(args: &[&str]) -> String {
    let output = program(args).output().unwrap();

    assert_eq!(output.status.code(), Some(1));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "");

    String::from_utf8(output.stderr).unwrap()
}

/// A running console, and what a browser that opened the printed URL knows; dropping it kills it.
pub(crate) struct Console {
    child: Child,
    pub(crate) port: u16,
    pub(crate) token: String,
    /// Path of the page, with a slash at both ends.
    pub(crate) path: String,
    /// Name and value of the cookie.
    pub(crate) cookie: String,
}

impl Console {
    /// Starts a console with these arguments and opens the URL that it prints.
    pub(crate) fn start(args: &[&str]) -> Self {
        Self::start_program(program(args))
    }

    /// Like [`Console::start`], with a command of [`program`].
    pub(crate) fn start_program(command: Command) -> Self {
        let mut console = Self::start_unopened(command);
        let entrance = console.get_with(&console.entrance(), &[("Host", &console.host())]);
        assert_eq!(entrance.status, 303, "{}", entrance.body);

        console.path = entrance.header("location").to_owned();
        let cookie = entrance.header("set-cookie").split(';').next().unwrap();
        console.cookie = cookie.to_owned();
        console
    }

    /// Starts a console and waits until it has printed its URL, which no browser opens.
    pub(crate) fn start_unopened(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let stdout = child.stdout.as_mut().unwrap();
        let mut line = String::new();
        BufReader::new(stdout).read_line(&mut line).unwrap();

        let url = line
            .trim()
            .strip_prefix("console: http://")
            .unwrap_or_else(|| panic!("{line:?}"));
        let (address, token) = url
            .split_once("/?token=")
            .unwrap_or_else(|| panic!("no token: {line:?}"));
        let address: SocketAddr = address.parse().unwrap();

        Self {
            child,
            port: address.port(),
            token: token.to_owned(),
            path: String::new(),
            cookie: String::new(),
        }
    }

    /// Starts a console that connects to a port without a simulator.
    pub(crate) fn live() -> Self {
        // No process listens at port 1.
        Self::start(&[
            "--bind",
            "127.0.0.1:0",
            "--connect",
            "tcp/127.0.0.1:1",
            "--run",
            "absent",
            // For which requests wait here.
            "--reply-timeout",
            "0.5",
        ])
    }

    /// The `Host` that it accepts.
    pub(crate) fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Path and query of the printed URL.
    pub(crate) fn entrance(&self) -> String {
        format!("/?token={}", self.token)
    }

    /// Requests a part of the page as its browser does.
    pub(crate) fn get(&self, part: &str) -> Response {
        self.get_with(
            &self.path_of(part),
            &[("Host", &self.host()), ("Cookie", &self.cookie)],
        )
    }

    /// Path of a part of the page.
    pub(crate) fn path_of(&self, part: &str) -> String {
        format!("{}{part}", self.path)
    }

    /// Requests a path as a program without cookies does.
    pub(crate) fn get_without_cookie(&self, path: &str) -> Response {
        self.get_with(path, &[("Host", &self.host())])
    }

    /// Requests a path with exactly these headers.
    pub(crate) fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Response {
        self.request("GET", path, headers)
    }

    /// Requests a path with this method and exactly these headers.
    pub(crate) fn request(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> Response {
        let headers: String = headers
            .iter()
            .map(|(name, value)| format!("{name}: {value}\r\n"))
            .collect();

        let mut stream = self.connect();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n"
        )
        .unwrap();

        let mut text = Vec::new();
        stream.read_to_end(&mut text).unwrap();
        Response::parse(&String::from_utf8_lossy(&text))
    }

    /// A WebSocket as the page opens it.
    pub(crate) fn page(&self) -> Page {
        let origin = format!("http://{}", self.host());
        self.page_of(Some(&origin))
            .unwrap_or_else(|status| panic!("{status}"))
    }

    /// A WebSocket as a page of `origin` opens it.
    ///
    /// # Errors
    /// The HTTP status of a refusal.
    pub(crate) fn page_of(&self, origin: Option<&str>) -> Result<Page, u16> {
        let mut headers = vec![("Cookie", self.cookie.as_str())];
        headers.extend(origin.map(|origin| ("Origin", origin)));
        self.socket(&self.path_of("ws"), &headers)
    }

    /// A WebSocket at any path, with these headers in addition to those of the handshake.
    ///
    /// # Errors
    /// The HTTP status of a refusal.
    pub(crate) fn socket(&self, path: &str, headers: &[(&'static str, &str)]) -> Result<Page, u16> {
        let url = format!("ws://{}{path}", self.host());
        let mut request = url.into_client_request().unwrap();
        for (name, value) in headers {
            let value = HeaderValue::from_str(value).unwrap();
            request.headers_mut().append(*name, value);
        }

        match tungstenite::client(request, self.connect()) {
            Ok((socket, _)) => Ok(Page { socket }),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                Err(response.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }

    /// Sends SIGTERM.
    pub(crate) fn terminate(&self) {
        let pid = Pid::from_raw(self.child.id().try_into().unwrap());
        kill(pid, Signal::SIGTERM).unwrap();
    }

    /// Waits until the process has ended.
    pub(crate) fn wait(&mut self) -> ExitStatus {
        let started = Instant::now();

        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(started.elapsed() < PATIENCE, "the console does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// The error output of a console that has ended.
    pub(crate) fn errors(&mut self) -> String {
        let mut stderr = self.child.stderr.take().unwrap();
        let mut text = String::new();
        stderr.read_to_string(&mut text).unwrap();
        text
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An HTTP response.
#[derive(Debug)]
pub(crate) struct Response {
    pub(crate) status: u16,
    /// Names are in lower case.
    headers: Vec<(String, String)>,
    pub(crate) body: String,
}

impl Response {
    fn parse(text: &str) -> Self {
        let (head, body) = text
            .split_once("\r\n\r\n")
            .unwrap_or_else(|| panic!("no HTTP: {text:?}"));
        let mut lines = head.lines();
        let status_line = lines.next().unwrap();
        let status = status_line.split(' ').nth(1).unwrap();

        let mut headers = Vec::new();
        for line in lines {
            let (name, value) = line.split_once(": ").unwrap();
            headers.push((name.to_ascii_lowercase(), value.to_owned()));
        }

        Self {
            status: status.parse().unwrap(),
            headers,
            body: body.to_owned(),
        }
    }

    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers
            .iter()
            .find(|(own, _)| own == name)
            .map_or("", |(_, value)| value)
    }

    pub(crate) fn json(&self) -> Value {
        assert_eq!(self.status, 200, "{}", self.body);
        assert_eq!(self.header("content-type"), "application/json");

        serde_json::from_str(&self.body).unwrap()
    }
}

/// A page's WebSocket.
pub(crate) struct Page {
    socket: WebSocket<TcpStream>,
}

/// What a page receives.
#[derive(Debug)]
pub(crate) enum Received {
    Message(Value),
    /// A close frame.
    Closed {
        code: u16,
        reason: String,
    },
    /// The end of the connection, without a close frame.
    Disconnected,
}

impl Page {
    /// Waits for a message or for the end of the connection. Pings are answered on the way.
    pub(crate) fn receive(&mut self) -> Received {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => {
                    return Received::Message(serde_json::from_str(&text).unwrap());
                }
                Ok(Message::Close(Some(frame))) => {
                    return Received::Closed {
                        code: frame.code.into(),
                        reason: frame.reason.to_string(),
                    };
                }
                Ok(_) => {}
                // This process was stopped and goes on.
                Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::Interrupted => {}
                Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                    panic!("received nothing for {PATIENCE:?}")
                }
                Err(_) => return Received::Disconnected,
            }
        }
    }

    /// The next message of this type.
    pub(crate) fn until(&mut self, kind: &str) -> Value {
        loop {
            match self.receive() {
                Received::Message(value) if value["type"] == kind => return value,
                Received::Message(_) => {}
                other => panic!("waited for {kind}: {other:?}"),
            }
        }
    }

    /// Reads to the end of the connection: code and reason of the close frame, or `None` without one.
    pub(crate) fn until_closed(&mut self) -> Option<(u16, String)> {
        loop {
            match self.receive() {
                Received::Message(_) => {}
                Received::Closed { code, reason } => return Some((code, reason)),
                Received::Disconnected => return None,
            }
        }
    }

    pub(crate) fn send_text(&mut self, text: &str) {
        self.send(Message::text(text));
    }

    pub(crate) fn send(&mut self, message: Message) {
        // The console may refuse a message, and then it may close before all of it is sent.
        let _ = self.socket.send(message);
    }
}
