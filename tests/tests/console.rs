//! The console on a real launch: what a program hears over its WebSocket, what it costs the run, and, in a browser, the
//! page (`tests/console`, Python).

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use bus::{Bus, Role};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer, Phase, Status};
use protocol::{RunName, decode, encode};
use serde_json::Value;
use system_tests::processes::Running;
use system_tests::{Lab, PATIENCE, eventually, programs, root};

/// A launch that goes on until it is stopped, its simulator's endpoint, and a way to ask it.
struct Run {
    name: String,
    endpoint: String,
    bus: Bus,
    keys: Keys,
    _launch: Running,
}

impl Run {
    fn start(lab: &Lab, name: &str, more: &[&str]) -> Self {
        let file = "launch/hors_doeuvres.toml";
        let mut args = vec![
            "launch",
            file,
            "--paused",
            "--speed",
            "max",
            "--duration",
            "10000000 s",
        ];
        // The record of a free run would be gigabytes.
        args.extend(["--set", "record.frames=false"]);
        args.extend(more);
        let launch = lab.start(name, &args);
        let endpoint = eventually("the simulator's endpoint", || {
            let text = std::fs::read_to_string(lab.file(name, "endpoint")).ok()?;
            text.ends_with('\n').then(|| text.trim().to_owned())
        });
        let role = Role::Client {
            connect: endpoint.clone(),
            patience: PATIENCE,
        };
        let (bus, keys) = (
            Bus::open(&role, None).unwrap(),
            Keys::new(&RunName::new(name).unwrap()),
        );
        let run = Self {
            name: name.to_owned(),
            endpoint,
            bus,
            keys,
            _launch: launch,
        };
        eventually("the robots", || {
            (run.ask(&Control::Status)?.phase == Phase::Ready).then_some(())
        });
        run
    }

    fn ask(&self, control: &Control) -> Option<Status> {
        let answer = self
            .bus
            .get(&self.keys.control(), "", Some(encode(control)))
            .unwrap()?;
        match decode("control", "simulator", &answer.result.unwrap()).unwrap() {
            ControlAnswer::Done(status) => Some(*status),
            other => panic!("{other:?}"),
        }
    }

    /// Ticks per second over `window`.
    fn rate(&self, window: Duration) -> f64 {
        let tick = || (self.ask(&Control::Status).unwrap().tick, Instant::now());
        let (from, begun) = tick();
        std::thread::sleep(window);
        let (to, ended) = tick();
        (to - from) as f64 / (ended - begun).as_secs_f64()
    }

    fn console(&self) -> Console {
        let mut command = Command::new(programs().join("cars-console"));
        command.args([
            "--bind",
            "127.0.0.1:0",
            "--run",
            &self.name,
            "--connect",
            &self.endpoint,
        ]);
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        let address = line
            .trim()
            .strip_prefix("console: http://")
            .unwrap()
            .trim_end_matches('/')
            .to_owned();
        Console { child, address }
    }
}

/// A console that runs, until dropped.
struct Console {
    child: Child,
    address: String,
}

impl Console {
    /// Memory that it occupies, bytes.
    fn resident_bytes(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))
            .unwrap();
        1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A WebSocket as a browser has it, in the few lines that a test needs.
struct Page {
    stream: BufReader<TcpStream>,
}

const TEXT: u8 = 1;
const PING: u8 = 9;
const PONG: u8 = 10;

impl Page {
    fn open(console: &Console) -> Self {
        let mut stream = TcpStream::connect(&console.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(
            stream,
            "GET /ws HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
            console.address
        )
        .unwrap();
        let mut page = Self {
            stream: BufReader::new(stream),
        };
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            assert!(page.stream.read_line(&mut head).unwrap() > 0, "{head}");
        }
        assert!(head.starts_with("HTTP/1.1 101 "), "{head}");
        page
    }

    /// The next message, and its kind.
    fn read(&mut self) -> std::io::Result<(u8, Vec<u8>)> {
        let mut head = [0; 2];
        self.stream.read_exact(&mut head)?;
        let mut long = [0; 8];
        let len = match head[1] {
            126 => {
                self.stream.read_exact(&mut long[6..])?;
                u64::from_be_bytes(long)
            }
            127 => {
                self.stream.read_exact(&mut long)?;
                u64::from_be_bytes(long)
            }
            len => u64::from(len),
        };
        let mut payload = vec![0; usize::try_from(len).unwrap()];
        self.stream.read_exact(&mut payload)?;
        Ok((head[0] & 15, payload))
    }

    /// Sends a message; one of a client is masked, with zeros as good as with anything.
    fn write(&mut self, kind: u8, payload: &[u8]) -> std::io::Result<()> {
        let mut message = vec![0x80 | kind, 0x80 | 126];
        message.extend(u16::try_from(payload.len()).unwrap().to_be_bytes());
        message.extend([0; 4]);
        message.extend(payload);
        self.stream.get_mut().write_all(&message)
    }

    /// What is said next; pings are answered on the way.
    fn hear(&mut self) -> std::io::Result<Value> {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            match self.read()? {
                (TEXT, text) => return Ok(serde_json::from_slice(&text).unwrap()),
                (PING, payload) => self.write(PONG, &payload)?,
                (kind, payload) => panic!("{kind}: {payload:?}"),
            }
        }
        Err(std::io::ErrorKind::TimedOut.into())
    }

    /// The next message for which `is_wanted` holds.
    fn until(&mut self, is_wanted: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let message = self.hear().unwrap();
            if is_wanted(&message) {
                return message;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "waited in vain; last came {message}"
            );
        }
    }

    fn request(&mut self, control: &str) {
        self.write(
            TEXT,
            format!(r#"{{"type":"control","id":1,"control":{control}}}"#).as_bytes(),
        )
        .unwrap();
    }

    fn control(&mut self, control: &str) -> Value {
        self.request(control);
        self.until(|message| message["type"] == "answer")
    }

    /// Reads all that comes, as a browser does, until the connection ends or this is dropped.
    fn keep_reading(mut self) -> Reading {
        let handle = self.stream.get_ref().try_clone().unwrap();
        std::thread::spawn(move || while self.hear().is_ok() {});
        Reading(handle)
    }
}

struct Reading(TcpStream);

impl Drop for Reading {
    fn drop(&mut self) {
        let _ = self.0.shutdown(Shutdown::Both);
    }
}

fn is_frame(message: &Value) -> bool {
    message["type"] == "frame"
}

#[test]
fn frames_and_panels_come_and_controls_go() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-live", &[]);
    let console = run.console();
    let mut page = Page::open(&console);
    assert_eq!(page.hear().unwrap()["mode"], "live");
    let first = page.until(is_frame);
    assert_eq!(
        (&first["frame"]["tick"], &first["frame"]["phase"]),
        (&0.into(), &"ready".into())
    );
    let answer = page.control(r#"{"do":"step","n":3}"#);
    assert_eq!(answer["answer"]["tick"], 3);
    assert_eq!(run.ask(&Control::Status).unwrap().tick, 3);
    page.control(r#"{"do":"start"}"#);
    let panel = page.until(|message| message["type"] == "panel" && message["robot"] == "Butler");
    assert!(!panel["panel"]["widgets"].as_array().unwrap().is_empty());
    let line = page.until(|message| message["type"] == "log");
    assert!(!line["lines"].as_array().unwrap().is_empty());
    let (mut frames, begun) = (Vec::new(), Instant::now());
    while begun.elapsed() < Duration::from_secs(2) {
        frames.push(page.until(is_frame)["frame"]["tick"].as_u64().unwrap());
    }
    println!(
        "{:.0} frames/s of a free run",
        frames.len() as f64 / begun.elapsed().as_secs_f64()
    );
    assert!(frames.len() > 20 && frames.is_sorted(), "{frames:?}");
    assert!(frames.last() > frames.first());
    let refused = page.control(r#"{"do":"step","n":1}"#);
    assert_eq!(refused["answer"]["answer"], "refused");
    page.request(r#"{"do":"stop"}"#);
    page.until(|message| message["type"] == "simulator" && message["present"] == false);
    let gone = page.control(r#"{"do":"start"}"#);
    assert!(
        gone["error"]
            .as_str()
            .unwrap()
            .contains("no simulator of run con-live"),
        "{gone}"
    );
}

#[test]
fn a_simulator_that_hangs_gives_an_error_and_one_that_returns_is_found() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-hang", &[]);
    let console = run.console();
    let mut page = Page::open(&console);
    page.until(is_frame);
    let simulator = Pid::from_raw(i32::try_from(run._launch.process("cars-sim")).unwrap());
    kill(simulator, Signal::SIGSTOP).unwrap();
    let begun = Instant::now();
    page.request(r#"{"do":"step","n":100000}"#);
    // Which of the two comes first is nobody's promise.
    let is_gone = |message: &Value| message["type"] == "simulator" && message["present"] == false;
    let is_error = |message: &Value| message["type"] == "answer" && message["error"].is_string();
    let first = page.until(|message| is_gone(message) || is_error(message));
    page.until(|message| {
        if is_gone(&first) {
            is_error(message)
        } else {
            is_gone(message)
        }
    });
    assert!(
        begun.elapsed() < Duration::from_secs(8),
        "told after {:?}",
        begun.elapsed()
    );
    kill(simulator, Signal::SIGCONT).unwrap();
    page.until(|message| message["type"] == "simulator" && message["present"] == true);
    eventually("an answer", || {
        page.control(r#"{"do":"status"}"#)["answer"]
            .is_object()
            .then_some(())
    });
    page.request(r#"{"do":"status"}"#);
    page.until(is_frame);
}

#[test]
fn a_slow_browser_is_shown_the_newest_picture() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-slow", &[]);
    let console = run.console();
    let mut page = Page::open(&console);
    page.until(is_frame);
    run.ask(&Control::Start).unwrap();
    // Pictures of ninety such moments would fit into the socket's buffers.
    std::thread::sleep(Duration::from_secs(3));
    let now = run.ask(&Control::Status).unwrap().tick;
    let mut old = 0;
    while page.until(is_frame)["frame"]["tick"].as_u64().unwrap() < now {
        old += 1;
    }
    println!("{old} old pictures before the newest, at tick {now}");
    assert!(old <= 5, "{old} old pictures came first");
}

#[test]
fn a_stuck_browser_costs_no_memory() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-stuck", &[]);
    let console = run.console();
    let _reading = Page::open(&console).keep_reading();
    let _stuck = Page::open(&console);
    run.ask(&Control::Start).unwrap();
    // All there is room for is taken: the lines of the log that are kept.
    eventually("2000 lines", || {
        (run.ask(&Control::Status)?.tick > 20_000).then_some(())
    });
    let before = console.resident_bytes();
    std::thread::sleep(Duration::from_secs(15));
    let after = console.resident_bytes();
    println!("resident: {before} bytes, {after} bytes after 15 s more of a free run");
    assert!(after < before + (4 << 20), "{before} bytes became {after}");
}

/// The median ratio of rates with and without something, from alternating windows of one run.
fn paired_ratio(pairs: usize, run: &Run, mut with: impl FnMut() -> Box<dyn std::any::Any>) -> f64 {
    const WINDOW: Duration = Duration::from_millis(1200);
    let mut measure_with = || {
        let _there = with();
        run.rate(WINDOW)
    };
    let mut ratios = Vec::new();
    for pair in 0..pairs {
        let (with, without) = if pair % 2 == 0 {
            let without = run.rate(WINDOW);
            (measure_with(), without)
        } else {
            (measure_with(), run.rate(WINDOW))
        };
        println!(
            "  {without:.0} ticks/s without, {with:.0} with: {:.3}",
            with / without
        );
        ratios.push(with / without);
    }
    ratios.sort_by(f64::total_cmp);
    ratios[pairs / 2]
}

/// What the design asks for is a change of less than 5 %; a machine that others use, too, cannot promise that it sees
/// it, so what fails here is far below.
const LEAST_RATIO: f64 = 0.75;

#[test]
fn a_console_hardly_slows_a_run() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-rate", &[]);
    run.ask(&Control::Start).unwrap();
    run.rate(Duration::from_secs(1));
    let unwatched = paired_ratio(9, &run, || Box::new(run.console()));
    println!("a console without a browser: {unwatched:.3} of the rate without a console");
    let watched = paired_ratio(9, &run, || {
        let console = run.console();
        let (mut page, stuck) = (Page::open(&console), Page::open(&console));
        page.until(is_frame);
        Box::new((page.keep_reading(), stuck, console))
    });
    println!(
        "a console with a browser and a stuck one: {watched:.3} of the rate without a console"
    );
    assert!(
        unwatched > LEAST_RATIO && watched > LEAST_RATIO,
        "{unwatched:.3}, {watched:.3}"
    );
}

/// Longest that the tests in the browser may take, all together.
const BROWSER_PATIENCE: Duration = Duration::from_secs(540);

/// Runs `tests/console` in Chromium, where there is one.
#[test]
fn the_page_does_in_a_browser_what_it_should() {
    if let Some(missing) = missing_tools() {
        let text = format!("the tests of the console in a browser are skipped: {missing}");
        assert!(std::env::var_os("CI").is_none(), "{text}");
        // Past the test harness, which keeps what a passing test prints to itself.
        let _ = writeln!(std::io::stderr(), "\nSKIPPED: {text}\n");
        return;
    }
    let programs = programs();
    let mut pytest = Command::new("python3");
    pytest.current_dir(root()).args([
        "-m",
        "pytest",
        "-v",
        "-rP",
        "--tb=short",
        "-p",
        "no:cacheprovider",
    ]);
    pytest
        .arg("tests/console")
        .env("CARS_BIN", programs)
        .env("PYTHONDONTWRITEBYTECODE", "1");
    for variable in [
        "CARS_RUN",
        "CARS_CONNECT",
        "CARS_LISTEN",
        "CARS_CONSOLE_BIND",
    ] {
        pytest.env_remove(variable);
    }
    let lab = Lab::new();
    let printed = lab.out().join("pytest.txt");
    let file = std::fs::File::create(&printed).unwrap();
    let mut pytest = pytest
        .stdin(Stdio::null())
        .stdout(file.try_clone().unwrap())
        .stderr(file)
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = pytest.try_wait().unwrap() {
            break Some(status);
        }
        if begun.elapsed() > BROWSER_PATIENCE {
            // An interrupted pytest ends what its tests have started.
            kill(
                Pid::from_raw(i32::try_from(pytest.id()).unwrap()),
                Signal::SIGINT,
            )
            .unwrap();
            pytest.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    println!("{}", std::fs::read_to_string(&printed).unwrap_or_default());
    let status = status.unwrap_or_else(|| panic!("not done after {BROWSER_PATIENCE:?}"));
    assert!(status.success(), "pytest: {status}");
}

/// What is missing for tests in a browser, and how to get it.
fn missing_tools() -> Option<String> {
    if !Path::new("/usr/bin/chromium").exists() {
        return Some("there is no /usr/bin/chromium; `apt-get install chromium`".to_owned());
    }
    let python = Command::new("python3")
        .args(["-c", "import pytest, playwright.sync_api"])
        .output();
    match python {
        Ok(output) if output.status.success() => None,
        Ok(_) => Some(
            "python3 has no pytest or no playwright; `pip install pytest playwright`".to_owned(),
        ),
        Err(error) => Some(format!(
            "python3 does not run ({error}); install Python 3.11 or later"
        )),
    }
}
