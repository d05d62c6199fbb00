//! A console to test, and what a browser does to it.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// Longest that anything here may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// The program under test.
pub(crate) fn program(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cars-console"));
    for variable in [
        "CARS_RUN",
        "CARS_CONNECT",
        "CARS_ZENOH_CONFIG",
        "CARS_CONSOLE_BIND",
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

/// Runs the program to its end, which must be a failure, and returns what it says.
pub(crate) fn fails(args: &[&str]) -> String {
    let output = program(args).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "");
    String::from_utf8(output.stderr).unwrap()
}

/// A console that runs, until dropped.
pub(crate) struct Console {
    child: Child,
    /// The one line that it printed.
    pub(crate) line: String,
    pub(crate) port: u16,
    /// `?token=…`, or nothing.
    pub(crate) token: String,
}

impl Console {
    /// Starts one; `args` say what it shows.
    pub(crate) fn start(args: &[&str]) -> Self {
        let mut child = program(args).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        let url = line
            .trim()
            .strip_prefix("console: http://")
            .unwrap_or_else(|| panic!("{line:?}"));
        let (address, token) = url.split_once('/').unwrap();
        let address: SocketAddr = address.parse().unwrap();
        let (port, token) = (address.port(), token.to_owned());
        Self {
            child,
            line,
            port,
            token,
        }
    }

    /// One that waits for a simulator that never comes.
    pub(crate) fn live() -> Self {
        // Nobody listens at port 1 of this machine.
        Self::start(&[
            "--bind",
            "127.0.0.1:0",
            "--connect",
            "tcp/127.0.0.1:1",
            "--run",
            "nobody",
        ])
    }

    /// Where it expects to be called.
    pub(crate) fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Asks for a path as a browser would.
    pub(crate) fn get(&self, path: &str) -> Answer {
        self.get_with(path, &[("Host", &self.host())])
    }

    /// Asks for a path with exactly these headers.
    pub(crate) fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        let mut stream = self.connect();
        let headers: String = headers
            .iter()
            .map(|(name, value)| format!("{name}: {value}\r\n"))
            .collect();
        write!(
            stream,
            "GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n"
        )
        .unwrap();
        let mut text = Vec::new();
        stream.read_to_end(&mut text).unwrap();
        Answer::parse(&String::from_utf8_lossy(&text))
    }

    /// A WebSocket as the page opens it.
    pub(crate) fn page(&self) -> Page {
        self.page_of(Some(&format!("http://{}", self.host())))
            .unwrap_or_else(|status| panic!("{status}"))
    }

    /// A WebSocket as a page of `origin` opens it; `Err` is the HTTP status of a refusal.
    pub(crate) fn page_of(&self, origin: Option<&str>) -> Result<Page, u16> {
        let url = format!("ws://{}/ws{}", self.host(), self.token);
        let mut request = url.into_client_request().unwrap();
        if let Some(origin) = origin {
            request
                .headers_mut()
                .insert("Origin", HeaderValue::from_str(origin).unwrap());
        }
        match tungstenite::client(request, self.connect()) {
            Ok((socket, _)) => Ok(Page { socket }),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                Err(response.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }

    /// Tells it to end.
    pub(crate) fn terminate(&self) {
        kill(
            Pid::from_raw(self.child.id().try_into().unwrap()),
            Signal::SIGTERM,
        )
        .unwrap();
    }

    /// Waits for its end.
    pub(crate) fn wait(&mut self) -> ExitStatus {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(begun.elapsed() < PATIENCE, "it does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What it printed besides, after its end.
    pub(crate) fn errors(&mut self) -> String {
        let mut text = String::new();
        self.child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut text)
            .unwrap();
        text
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What came back.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) headers: Vec<(String, String)>,
    pub(crate) body: String,
}

impl Answer {
    fn parse(text: &str) -> Self {
        let (head, body) = text
            .split_once("\r\n\r\n")
            .unwrap_or_else(|| panic!("no HTTP: {text:?}"));
        let mut lines = head.lines();
        let status = lines
            .next()
            .unwrap()
            .split(' ')
            .nth(1)
            .unwrap()
            .parse()
            .unwrap();
        let headers = lines.map(|line| line.split_once(": ").unwrap());
        let headers = headers
            .map(|(name, value)| (name.to_ascii_lowercase(), value.to_owned()))
            .collect();
        Self {
            status,
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
        assert_eq!(
            (self.status, self.header("content-type")),
            (200, "application/json"),
            "{}",
            self.body
        );
        serde_json::from_str(&self.body).unwrap()
    }
}

/// A page's WebSocket.
pub(crate) struct Page {
    socket: WebSocket<TcpStream>,
}

/// What came over it.
#[derive(Debug)]
pub(crate) enum Heard {
    Said(Value),
    /// Closed, with code and reason.
    Closed(u16, String),
    /// The connection is gone.
    Gone,
}

impl Page {
    /// What comes next. Pings are answered on the way.
    pub(crate) fn hear(&mut self) -> Heard {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => {
                    return Heard::Said(serde_json::from_str(&text).unwrap());
                }
                Ok(Message::Close(Some(frame))) => {
                    return Heard::Closed(frame.code.into(), frame.reason.to_string());
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(error))
                    if error.kind() == std::io::ErrorKind::WouldBlock =>
                {
                    panic!("nothing for {PATIENCE:?}")
                }
                Err(_) => return Heard::Gone,
            }
        }
    }

    /// The next message of this type.
    pub(crate) fn until(&mut self, kind: &str) -> Value {
        loop {
            match self.hear() {
                Heard::Said(value) if value["type"] == kind => return value,
                Heard::Said(_) => {}
                other => panic!("waited for {kind}: {other:?}"),
            }
        }
    }

    /// Reads on until it is closed; `None` if it just ends.
    pub(crate) fn farewell(&mut self) -> Option<(u16, String)> {
        loop {
            match self.hear() {
                Heard::Said(_) => {}
                Heard::Closed(code, reason) => return Some((code, reason)),
                Heard::Gone => return None,
            }
        }
    }

    pub(crate) fn say(&mut self, text: &str) {
        self.send(Message::text(text));
    }

    pub(crate) fn send(&mut self, message: Message) {
        // A console that does not want it may have closed before all of it was sent.
        let _ = self.socket.send(message);
    }
}
