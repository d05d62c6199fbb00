//! The console on a real launch: the messages of its WebSocket, and its cost for the run.

use std::fs::Permissions;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
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
use system_tests::stalls::Stalls;
use system_tests::{Lab, PATIENCE, assert_stepped, eventually, programs, root};

/// A launch that runs until it is stopped, and a session with its simulator.
struct Run {
    name: String,
    endpoint: String,
    bus: Bus,
    keys: Keys,
    launch: Running,
}

impl Run {
    fn start(lab: &Lab, name: &str) -> Self {
        Self::start_opening(lab, name, None, &[], None)
    }

    /// Starts a launch with `BROWSER` and further arguments; `config` is a zenoh configuration file for the session.
    fn start_opening(
        lab: &Lab,
        name: &str,
        browser: Option<&Path>,
        more: &[&str],
        config: Option<&PathBuf>,
    ) -> Self {
        let file = root().join("launch/hors_doeuvres.toml");
        let args = [
            "launch",
            file.to_str().unwrap(),
            "--paused",
            "--speed",
            "max",
            "--duration",
            "10000000 s",
            // The recording of a run without a speed limit would be gigabytes.
            "--set",
            "record.frames=false",
        ];
        let mut command = lab.cars(&[&args[..], more].concat());
        // The console writes its file for the browser into the current folder.
        command.args(["--run", name]).current_dir(lab.out());
        if let Some(browser) = browser {
            command.arg("--open").env("BROWSER", browser);
        }
        let launch = Running::start(command, name, lab.file(name, ""));
        let endpoint = eventually("the simulator's endpoint", || {
            let text = std::fs::read_to_string(lab.file(name, "endpoint")).ok()?;
            text.ends_with('\n').then(|| text.trim().to_owned())
        });
        let role = Role::Client {
            connect: endpoint.clone(),
            patience: PATIENCE,
        };

        let run = Self {
            name: name.to_owned(),
            endpoint,
            bus: Bus::open(&role, config).unwrap(),
            keys: Keys::new(&RunName::new(name).unwrap()),
            launch,
        };
        eventually("the robots", || {
            let status = run.control(&Control::Status)?;
            (status.phase == Phase::Ready).then_some(())
        });
        run
    }

    /// The simulator's status after a request; `None` without a reply.
    fn control(&self, control: &Control) -> Option<Status> {
        let reply = self
            .bus
            .get_within(&self.keys.control(), "", Some(encode(control)), PATIENCE)
            .unwrap()?;

        match decode("control", "simulator", &reply.result.unwrap()).unwrap() {
            ControlAnswer::Done(status) => Some(*status),
            other => panic!("{other:?}"),
        }
    }

    /// The last tick that is complete. There is no reply while a link that a stall of the machine has broken is opened anew.
    fn tick(&self) -> u64 {
        eventually("the status", || self.control(&Control::Status)).tick
    }

    /// Lets the clock run.
    fn run_clock(&self) {
        eventually("the start", || self.control(&Control::Start));
    }

    /// Checks the answer to a request for steps, and waits until the last one is complete.
    fn reaches(&self, answer: &Value, tick: u64) {
        assert_stepped(&answer["answer"], tick);
        eventually("the last of the steps", || {
            (self.tick() == tick).then_some(())
        });
    }

    /// Ticks per second over `window`.
    fn rate(&self, window: Duration) -> f64 {
        let first_tick = self.tick();
        let started = Instant::now();
        std::thread::sleep(window);
        let last_tick = self.tick();

        (last_tick - first_tick) as f64 / started.elapsed().as_secs_f64()
    }

    fn console(&self) -> Console {
        self.console_at(&self.endpoint)
    }

    /// A console that finds the simulator at another endpoint than the simulator's own.
    fn console_at(&self, endpoint: &str) -> Console {
        let mut child = Command::new(programs().join("cars-console"))
            .args(["--bind", "127.0.0.1:0"])
            .args(["--run", &self.name])
            .args(["--connect", endpoint])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let stdout = child.stdout.as_mut().unwrap();
        let mut line = String::new();
        BufReader::new(stdout).read_line(&mut line).unwrap();

        Console {
            child,
            entered: Entered::new(Printed::parse(line.trim())),
        }
    }

    /// The URL of the launch's own console.
    fn printed(&mut self) -> Printed {
        self.launch.prints("console: http://");
        let printed = self.launch.printed();
        let line = printed
            .lines()
            .find(|line| line.contains("console: http://"));
        Printed::parse(line.unwrap())
    }
}

/// A printed URL of a console.
struct Printed {
    address: String,
    token: String,
}

impl Printed {
    /// Parses a line that ends in the URL.
    fn parse(line: &str) -> Self {
        let (_, url) = line.split_once("console: http://").unwrap();
        let (address, token) = url.split_once("/?token=").unwrap();
        assert!(token.len() >= 32, "{line}");

        Self {
            address: address.to_owned(),
            token: token.to_owned(),
        }
    }
}

/// What a browser knows after it has opened a console's URL.
struct Entered {
    address: String,
    /// Path of the page, with a slash at both ends.
    path: String,
    cookie: String,
}

impl Entered {
    /// Opens a printed URL.
    fn new(printed: Printed) -> Self {
        let path = format!("/?token={}", printed.token);
        let head = request(&printed.address, &path, "").1;
        assert!(head.starts_with("HTTP/1.1 303 "), "{head}");
        let value = |name: &str| {
            let line = head.lines().find_map(|line| line.strip_prefix(name));
            let value = line.unwrap_or_else(|| panic!("no {name} in {head}"));
            value.split(';').next().unwrap().to_owned()
        };

        Self {
            path: value("location: "),
            cookie: value("set-cookie: "),
            address: printed.address,
        }
    }
}

/// Sends a request and reads the head of the response. `more` is further lines of the request's head.
fn request(address: &str, path: &str, more: &str) -> (BufReader<TcpStream>, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    write!(
        stream,
        "GET {path} HTTP/1.1\r\nHost: {address}\r\n{more}\r\n"
    )
    .unwrap();

    let mut stream = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        assert!(stream.read_line(&mut head).unwrap() > 0, "{head}");
    }
    (stream, head)
}

/// Requests a WebSocket; returns the head of the response, too.
fn request_socket(address: &str, path: &str, cookie: &str) -> (BufReader<TcpStream>, String) {
    let more = format!(
        "Origin: http://{address}\r\nCookie: {cookie}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    );
    request(address, path, &more)
}

/// A running console; dropping it kills it.
struct Console {
    child: Child,
    entered: Entered,
}

impl Console {
    /// Resident memory, bytes.
    fn resident_bytes(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();

        let line = text
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))
            .unwrap();
        let kibibytes: u64 = line.trim().trim_end_matches(" kB").parse().unwrap();
        1024 * kibibytes
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A minimal WebSocket client.
struct Page {
    stream: BufReader<TcpStream>,
}

const TEXT: u8 = 1;
const PING: u8 = 9;
const PONG: u8 = 10;

impl Page {
    fn open(entered: &Entered) -> Self {
        let path = format!("{}ws", entered.path);
        let (stream, head) = request_socket(&entered.address, &path, &entered.cookie);
        assert!(head.starts_with("HTTP/1.1 101 "), "{head}");
        Self { stream }
    }

    /// The next frame: opcode and payload.
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

    /// Sends a frame. Clients must mask their frames; the mask is zero.
    fn write(&mut self, opcode: u8, payload: &[u8]) -> std::io::Result<()> {
        let mut message = vec![0x80 | opcode, 0x80 | 126];
        message.extend(u16::try_from(payload.len()).unwrap().to_be_bytes());
        message.extend([0; 4]);
        message.extend(payload);
        self.stream.get_mut().write_all(&message)
    }

    /// The next message; pings are answered on the way.
    fn receive(&mut self) -> std::io::Result<Value> {
        let started = Instant::now();
        while started.elapsed() < PATIENCE {
            match self.read()? {
                (TEXT, text) => return Ok(serde_json::from_slice(&text).unwrap()),
                (PING, payload) => self.write(PONG, &payload)?,
                (opcode, payload) => panic!("{opcode}: {payload:?}"),
            }
        }
        Err(std::io::ErrorKind::TimedOut.into())
    }

    /// The next message for which `is_wanted` holds.
    fn until(&mut self, is_wanted: impl Fn(&Value) -> bool) -> Value {
        let started = Instant::now();

        loop {
            let message = self.receive().unwrap();
            if is_wanted(&message) {
                return message;
            }
            assert!(
                started.elapsed() < PATIENCE,
                "no such message; the last one is {message}"
            );
        }
    }

    /// Sends a request without waiting for its answer.
    fn request(&mut self, control: &str) {
        let text = format!(r#"{{"type":"control","id":1,"control":{control}}}"#);
        self.write(TEXT, text.as_bytes()).unwrap();
    }

    /// Sends a request and waits for its answer.
    fn control(&mut self, control: &str) -> Value {
        self.request(control);
        self.until(|message| message["type"] == "answer")
    }

    /// The tick of the next frame.
    fn next_tick(&mut self) -> u64 {
        let message = self.until(is_frame);
        message["frame"]["tick"].as_u64().unwrap()
    }

    /// Reads and answers pings on a thread, as a browser does, until the value returned is dropped.
    fn keep_reading(mut self) -> Reading {
        let handle = self.stream.get_ref().try_clone().unwrap();
        std::thread::spawn(move || while self.receive().is_ok() {});
        Reading(handle)
    }
}

/// A page that is read; dropping it closes the connection.
struct Reading(TcpStream);

impl Drop for Reading {
    fn drop(&mut self) {
        let _ = self.0.shutdown(Shutdown::Both);
    }
}

fn is_frame(message: &Value) -> bool {
    message["type"] == "frame"
}

fn is_absence(message: &Value) -> bool {
    message["type"] == "simulator" && message["present"] == false
}

fn is_error(message: &Value) -> bool {
    message["type"] == "answer" && message["error"].is_string()
}

#[test]
fn a_page_receives_frames_and_panels_and_controls_the_run() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-live");
    let console = run.console();
    let mut page = Page::open(&console.entered);
    assert_eq!(page.receive().unwrap()["mode"], "live");
    let first = page.until(is_frame);
    assert_eq!(first["frame"]["tick"], 0);
    assert_eq!(first["frame"]["phase"], "ready");

    let stepped = page.control(r#"{"do":"step","n":3}"#);
    run.reaches(&stepped, 3);

    page.control(r#"{"do":"start"}"#);
    let panel = page.until(|message| message["type"] == "panel" && message["robot"] == "Butler");
    assert!(!panel["panel"]["widgets"].as_array().unwrap().is_empty());
    let log = page.until(|message| message["type"] == "log");
    assert!(!log["lines"].as_array().unwrap().is_empty());

    let mut ticks = Vec::new();
    let mut intervals = Vec::new();
    let started = Instant::now();
    while started.elapsed() < Duration::from_secs(2) || ticks.len() < 20 {
        let before = Instant::now();
        ticks.push(page.next_tick());
        intervals.push(before.elapsed());
    }
    // A median, because the machine may stand still for a moment.
    intervals.sort();
    let interval = intervals[intervals.len() / 2];
    println!("a frame every {interval:.0?} of a run without a speed limit");
    assert!(interval < Duration::from_millis(100), "{intervals:?}");
    assert!(ticks.is_sorted(), "{ticks:?}");
    assert!(ticks.last() > ticks.first());

    let refused = eventually("an answer", || {
        let answer = page.control(r#"{"do":"step","n":1}"#);
        answer["answer"].is_object().then_some(answer)
    });
    assert_eq!(refused["answer"]["answer"], "refused");

    page.request(r#"{"do":"stop"}"#);
    page.until(is_absence);
    let answer = page.control(r#"{"do":"start"}"#);
    let error = answer["error"].as_str().unwrap();
    assert!(error.contains("no simulator of run con-live"), "{error}");
}

/// Accepts one connection after another, each to the simulator at `endpoint`.
fn forward(listener: &TcpListener, endpoint: &str) {
    let address = endpoint.strip_prefix("tcp/").unwrap();

    for stream in listener.incoming() {
        let (Ok(stream), Ok(simulator)) = (stream, TcpStream::connect(address)) else {
            return;
        };
        for (mut from, mut to) in [
            (stream.try_clone().unwrap(), simulator.try_clone().unwrap()),
            (simulator, stream),
        ] {
            std::thread::spawn(move || std::io::copy(&mut from, &mut to));
        }
    }
}

#[test]
fn a_request_waits_for_a_simulator_that_is_not_found_yet() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-early");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let console = run.console_at(&format!("tcp/{}", listener.local_addr().unwrap()));
    let mut page = Page::open(&console.entered);
    assert_eq!(
        page.until(|message| message["type"] == "simulator")["present"],
        false
    );

    page.request(r#"{"do":"step","n":3}"#);
    let endpoint = run.endpoint.clone();
    std::thread::spawn(move || forward(&listener, &endpoint));

    let stepped = page.until(|message| message["type"] == "answer");
    run.reaches(&stepped, 3);
}

#[test]
fn a_simulator_that_hangs_gives_an_error_and_one_that_returns_is_found() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-hang");
    let console = run.console();
    let mut page = Page::open(&console.entered);
    page.until(is_frame);

    let simulator = Pid::from_raw(i32::try_from(run.launch.process("cars-sim")).unwrap());
    kill(simulator, Signal::SIGSTOP).unwrap();
    let stalls = Stalls::watch();
    let stopped = Instant::now();
    page.request(r#"{"do":"step","n":100000}"#);

    // The two messages may arrive in any order.
    let first = page.until(|message| is_absence(message) || is_error(message));
    if is_absence(&first) {
        page.until(is_error);
    } else {
        page.until(is_absence);
    }
    let elapsed = stalls.time_between(stopped, Instant::now());
    assert!(elapsed < Duration::from_secs(8), "after {elapsed:?}");

    kill(simulator, Signal::SIGCONT).unwrap();
    page.until(|message| message["type"] == "simulator" && message["present"] == true);
    eventually("an answer", || {
        let answer = page.control(r#"{"do":"status"}"#);
        answer["answer"].is_object().then_some(())
    });
    page.request(r#"{"do":"status"}"#);
    page.until(is_frame);
}

#[test]
fn a_slow_browser_is_shown_the_newest_frame() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-slow");
    let console = run.console();
    let mut page = Page::open(&console.entered);
    page.until(is_frame);
    run.run_clock();

    // The socket's buffers would hold the frames of ninety such periods.
    std::thread::sleep(Duration::from_secs(3));
    let now = run.tick();

    let mut outdated = 0;
    while page.next_tick() < now {
        outdated += 1;
    }
    println!("{outdated} outdated frames before the newest, at tick {now}");
    assert!(outdated <= 5, "{outdated} outdated frames came first");
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_stalled_browser_costs_no_memory() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-stuck");
    let console = run.console();
    let _reading = Page::open(&console.entered).keep_reading();
    let _stalled = Page::open(&console.entered);
    run.run_clock();

    // From then on the feed holds as many lines of the log as it may.
    eventually("2000 lines", || {
        let tick = run.control(&Control::Status)?.tick;
        (tick > 20_000).then_some(())
    });
    let before = console.resident_bytes();
    std::thread::sleep(Duration::from_secs(15));
    let after = console.resident_bytes();

    println!("resident: {before} bytes, {after} bytes after 15 s more");
    assert!(after < before + (4 << 20), "{before} bytes became {after}");
}

/// The median ratio of the rates with and without what `start` returns, from alternating windows of one run.
fn paired_ratio<T>(pairs: usize, run: &Run, start: impl Fn() -> T) -> f64 {
    let mut ratios = Vec::new();
    for pair in 0..pairs {
        // The order alternates, so that a drift of the rate cancels out.
        let starts_without = pair % 2 == 0;
        let mut without = 0.0;
        if starts_without {
            without = run.rate(RATE_WINDOW);
        }
        let with = rate_with(run, &start);
        if !starts_without {
            without = run.rate(RATE_WINDOW);
        }

        let ratio = with / without;
        println!("  {without:.0} ticks/s without, {with:.0} with: {ratio:.3}");
        ratios.push(ratio);
    }

    ratios.sort_by(f64::total_cmp);
    ratios[pairs / 2]
}

fn rate_with<T>(run: &Run, start: &impl Fn() -> T) -> f64 {
    let _started = start();
    run.rate(RATE_WINDOW)
}

/// How long a rate is measured.
const RATE_WINDOW: Duration = Duration::from_millis(600);

/// The design demands a change of less than 5 %. That cannot be measured on a machine under other load, so the limit of
/// the test is far below.
const MIN_RATIO: f64 = 0.75;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_console_hardly_slows_a_run() {
    let lab = Lab::new();
    let run = Run::start(&lab, "con-rate");
    run.run_clock();
    run.rate(Duration::from_secs(1));

    let unwatched = paired_ratio(9, &run, || run.console());
    println!("a console without a browser: {unwatched:.3} of the rate without a console");

    let watched = paired_ratio(9, &run, || {
        let console = run.console();
        let mut page = Page::open(&console.entered);
        let stalled = Page::open(&console.entered);
        page.until(is_frame);
        (page.keep_reading(), stalled, console)
    });
    println!(
        "a console with a browser and a stalled one: {watched:.3} of the rate without a console"
    );

    assert!(unwatched > MIN_RATIO, "{unwatched:.3}");
    assert!(watched > MIN_RATIO, "{watched:.3}");
}

/// A program to set as `BROWSER`, which stays until the end of the run.
fn lasting_browser(lab: &Lab) -> PathBuf {
    let browser = lab.write(
        "browser",
        "#!/bin/sh\necho \"$@\" > \"$0.started\"\nsleep 600\n",
    );
    std::fs::set_permissions(&browser, Permissions::from_mode(0o755)).unwrap();
    browser
}

/// Arguments of all processes of this machine.
fn all_arguments() -> Vec<String> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let arguments = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
        all.push(String::from_utf8_lossy(&arguments).into_owned());
    }
    all
}

/// The files below a folder that contain a text.
fn files_with(folder: &Path, text: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files_with(&path, text));
        } else if contains(&std::fs::read(&path).unwrap_or_default(), text) {
            found.push(path);
        }
    }
    found
}

fn contains(bytes: &[u8], text: &str) -> bool {
    let mut parts = bytes.windows(text.len());
    parts.any(|part| part == text.as_bytes())
}

/// Asserts that a user of the machine without the token neither finds it nor gets through to the run, and that the owner
/// does.
fn assert_controlled_by_the_owner_only(lab: &Lab, run: &mut Run) {
    let started = lab.out().join("browser.started");
    eventually("the browser", || started.exists().then_some(()));
    let printed = run.printed();
    let token = &printed.token;

    let arguments = all_arguments();
    let browser = arguments.iter().any(|line| line.contains("/browser\0"));
    assert!(browser, "the browser is not among the processes");
    for line in arguments {
        assert!(!line.contains(token), "{line}");
    }

    let log = lab.file(&run.name, "logs/console.log");
    eventually("the log", || {
        let bytes = std::fs::read(&log).unwrap_or_default();
        contains(&bytes, token).then_some(())
    });
    let with_token = files_with(lab.out(), token);
    assert!(with_token.contains(&log), "{with_token:?}");
    for file in with_token {
        let mode = std::fs::metadata(&file).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", file.display());
    }

    for path in ["/", "/ws", "/?token=", "/ws?token=", "/recording"] {
        let (_, head) = request_socket(&printed.address, path, "");
        assert!(head.starts_with("HTTP/1.1 403 "), "{path}: {head}");
    }
    let address = printed.address.clone();
    let entered = Entered::new(printed);
    let path = format!("{}ws", entered.path);
    for cookie in [
        "",
        "cars-console=0",
        &entered.cookie[..entered.cookie.len() - 1],
    ] {
        let (_, head) = request_socket(&address, &path, cookie);
        assert!(head.starts_with("HTTP/1.1 403 "), "{cookie}: {head}");
    }
    assert_eq!(run.tick(), 0);

    let mut page = Page::open(&entered);
    let stepped = page.control(r#"{"do":"step","n":3}"#);
    run.reaches(&stepped, 3);
}

#[test]
fn only_the_token_gives_control_of_a_launch() {
    let lab = Lab::new();
    let browser = lasting_browser(&lab);
    let mut run = Run::start_opening(&lab, "con-own", Some(&browser), &[], None);

    assert_controlled_by_the_owner_only(&lab, &mut run);
}

#[test]
fn only_the_token_gives_control_of_a_secured_launch() {
    let lab = Lab::new();
    let folder = lab.out().join("certificates");
    let folder = folder.to_str().unwrap();
    let init = ["secure", "init", folder, "--robots", "Butler,Leguin"];
    let (code, text) = lab.cars_without_out(&init);
    assert_eq!(code, 0, "{text}");
    let operator = Path::new(folder).join("operator/zenoh.json5");
    let browser = lasting_browser(&lab);
    let more = ["--secure", folder];
    let mut run = Run::start_opening(&lab, "con-sec", Some(&browser), &more, Some(&operator));
    assert!(run.endpoint.starts_with("tls/"), "{}", run.endpoint);

    assert_controlled_by_the_owner_only(&lab, &mut run);
}

/// What a launch needs does not depend on what it prints: the page opens, and its buttons work.
#[test]
fn a_quiet_launch_opens_the_page_too() {
    let lab = Lab::new();
    let browser = lasting_browser(&lab);
    let run = Run::start_opening(&lab, "con-quiet", Some(&browser), &["--quiet"], None);

    let started = lab.out().join("browser.started");
    let file = eventually("the browser", || {
        let text = std::fs::read_to_string(&started).ok()?;
        text.ends_with('\n').then(|| text.trim().to_owned())
    });
    let page = eventually("the file for the browser", || {
        std::fs::read_to_string(lab.out().join(file.trim_start_matches("file://"))).ok()
    });
    let (_, address) = page.split_once("http://").unwrap();
    let (address, rest) = address.split_once("/?token=").unwrap();
    let (token, _) = rest.split_once('"').unwrap();
    let entered = Entered::new(Printed {
        address: address.to_owned(),
        token: token.to_owned(),
    });

    let mut page = Page::open(&entered);
    let stepped = page.control(r#"{"do":"step","n":3}"#);
    run.reaches(&stepped, 3);
}
