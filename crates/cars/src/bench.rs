//! `cars bench`: ticks per second, interleaved in one sitting, beside a raw TCP barrier as the floor.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::Instant;

use bus::runtime::{ONE_THREAD, RUNTIME_VARIABLE};
use clap::Args;
use miette::{IntoDiagnostic, miette};
use protocol::RunName;
use robot::{Action, BadParameters, Cars, Robot, RobotArgs, RobotName};
use simulator::recorder::SUMMARY;
use simulator::scenario::{Changes, Scenario};
use simulator::{RunFolder, Summary};
use tabled::builder::Builder;
use tabled::settings::Alignment;
use tabled::settings::Style;
use tabled::settings::object::Columns;

/// Size of what the raw barrier sends out and back; a clock and a report are about as long.
const CLOCK_BYTES: usize = 64;
const REPORT_BYTES: usize = 300;

/// `cars bench`.
#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// Times that everything is measured, in turn.
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    /// Numbers of robot processes for the bare barrier.
    #[arg(long, value_delimiter = ',', default_value = "2,4,16")]
    robots: Vec<usize>,
    /// The hall that is measured.
    #[arg(long, default_value = "configs/hors_doeuvres.toml")]
    scenario: PathBuf,
    /// Ticks of each measurement, divided by the number of robots for the bare barrier.
    #[arg(long, default_value_t = 20_000)]
    ticks: u64,
}

/// One thing that is measured, with its results, ticks per second.
struct Subject {
    name: String,
    results: Vec<f64>,
    /// Index of the subject that it is compared with.
    floor: usize,
}

/// Measures everything in turn, as often as asked for, and prints a table.
pub(crate) fn bench(args: &BenchArgs) -> miette::Result<ExitCode> {
    let scratch = std::env::temp_dir().join(format!("cars-bench-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).into_diagnostic()?;
    let outcome = measure(args, &scratch);
    std::fs::remove_dir_all(&scratch).into_diagnostic()?;
    print_table(&outcome?);
    Ok(ExitCode::SUCCESS)
}

fn measure(args: &BenchArgs, scratch: &Path) -> miette::Result<Vec<Subject>> {
    let mut subjects = Vec::new();
    let mut add = |name: String, floor: usize| {
        subjects.push(Subject {
            name,
            results: Vec::new(),
            floor,
        })
    };
    for (index, n) in args.robots.iter().enumerate() {
        add(format!("raw TCP barrier, {n} processes (floor)"), 2 * index);
        add(format!("bare lock-step, {n} processes"), 2 * index);
    }
    add("the hall, as processes".to_owned(), 0);
    add("the hall, in one process".to_owned(), 0);
    for round in 0..args.rounds {
        eprintln!("round {} of {}", round + 1, args.rounds);
        let mut results = Vec::new();
        for n in &args.robots {
            let ticks = (2 * args.ticks / *n as u64).max(500);
            results.push(raw_barrier(*n, ticks)?);
            results.push(bare(*n, ticks, scratch)?);
        }
        results.push(hall_processes(&args.scenario, args.ticks / 2, scratch)?);
        results.push(hall_local(&args.scenario, args.ticks / 2, scratch)?);
        for (subject, result) in subjects.iter_mut().zip(results) {
            subject.results.push(result);
        }
    }
    Ok(subjects)
}

fn print_table(subjects: &[Subject]) {
    let median = |results: &[f64]| {
        let mut sorted = results.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let mut table = Builder::default();
    table.push_record([
        "ticks per second",
        "median",
        "best",
        "worst",
        "of its floor",
    ]);
    for subject in subjects {
        let (best, worst) = subject
            .results
            .iter()
            .fold((0.0_f64, f64::MAX), |(b, w), r| (b.max(*r), w.min(*r)));
        // Pair by pair: the machine's speed drifts, and both drift with it.
        let pairs = subject.results.iter().zip(&subjects[subject.floor].results);
        let ratios: Vec<f64> = pairs.map(|(own, floor)| own / floor).collect();
        table.push_record([
            subject.name.clone(),
            format!("{:.0}", median(&subject.results)),
            format!("{best:.0}"),
            format!("{worst:.0}"),
            format!("{:.2}", median(&ratios)),
        ]);
    }
    let mut table = table.build();
    println!(
        "{}",
        table
            .with(Style::rounded())
            .modify(Columns::new(1..), Alignment::right())
    );
    println!("Floor of the hall: the raw barrier with {} processes.", 2);
}

/// A barrier with nothing in it: one write and one read for each process and tick.
fn raw_barrier(n: usize, ticks: u64) -> miette::Result<f64> {
    let listener = TcpListener::bind("127.0.0.1:0").into_diagnostic()?;
    let address = listener.local_addr().into_diagnostic()?.to_string();
    let me = std::env::current_exe().into_diagnostic()?;
    let start = |_| Command::new(&me).args(["bench-echo", &address]).spawn();
    let mut children: Vec<Child> = (0..n)
        .map(start)
        .collect::<Result<_, _>>()
        .into_diagnostic()?;
    let mut streams = Vec::new();
    for _ in 0..n {
        let (stream, _) = listener.accept().into_diagnostic()?;
        stream.set_nodelay(true).into_diagnostic()?;
        streams.push(stream);
    }
    let begun = Instant::now();
    let mut report = [0; REPORT_BYTES];
    for _ in 0..ticks {
        for stream in &mut streams {
            stream.write_all(&[1; CLOCK_BYTES]).into_diagnostic()?;
        }
        for stream in &mut streams {
            stream.read_exact(&mut report).into_diagnostic()?;
        }
    }
    let rate = ticks as f64 / begun.elapsed().as_secs_f64();
    drop(streams);
    children
        .iter_mut()
        .try_for_each(|child| child.wait().map(drop))
        .into_diagnostic()?;
    Ok(rate)
}

/// The other side of the raw barrier.
pub(crate) fn echo(address: &str) -> miette::Result<ExitCode> {
    let mut stream = TcpStream::connect(address).into_diagnostic()?;
    stream.set_nodelay(true).into_diagnostic()?;
    let mut clock = [0; CLOCK_BYTES];
    while stream.read_exact(&mut clock).is_ok() {
        stream.write_all(&[2; REPORT_BYTES]).into_diagnostic()?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Lock-step with robots that only answer.
fn bare(n: usize, ticks: u64, scratch: &Path) -> miette::Result<f64> {
    let mut text = format!("duration = \"{ticks} s\"\ntick = \"1 s\"\n");
    for i in 0..n {
        let (x, y) = (1 + i % 7 * 2, 1 + i / 7 * 2);
        text += &format!("[[robot]]\nname = \"r{i}\"\nat = [\"{x} m\", \"{y} m\"]\n");
    }
    let scenario = scratch.join("bare.toml");
    std::fs::write(&scenario, text).into_diagnostic()?;
    let robot = |i: usize| {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["bench-robot", "--name", &format!("r{i}")]);
        Ok::<Command, std::io::Error>(command)
    };
    let robots: Vec<Command> = (0..n)
        .map(robot)
        .collect::<Result<_, _>>()
        .into_diagnostic()?;
    processes(&scenario, ticks as f64, robots, scratch)
}

fn hall_processes(scenario: &Path, ticks: u64, scratch: &Path) -> miette::Result<f64> {
    let loaded = Scenario::load(scenario, &Changes::default())?;
    let robot = |(name, spec): (&RobotName, &simulator::scenario::RobotSpec)| {
        let mut command = Command::new(beside(&format!("cars-{}", spec.class.to_lowercase()))?);
        command.args(["--name", name.as_str()]);
        Ok(command)
    };
    let robots: Vec<Command> = loaded
        .robots
        .iter()
        .map(robot)
        .collect::<miette::Result<_>>()?;
    processes(scenario, ticks as f64 * loaded.tick_s, robots, scratch)
}

/// Starts a simulator and robots as processes and returns the rate that the simulator measured.
fn processes(
    scenario: &Path,
    duration_s: f64,
    robots: Vec<Command>,
    scratch: &Path,
) -> miette::Result<f64> {
    let port = TcpListener::bind("127.0.0.1:0")
        .and_then(|listener| listener.local_addr())
        .into_diagnostic()?
        .port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let mut simulator = Command::new(beside("cars-sim")?);
    simulator.arg(scenario).arg("--out").arg(scratch);
    simulator.args([
        "--run",
        "bench",
        "--listen",
        &endpoint,
        "--duration",
        &format!("{duration_s} s"),
    ]);
    let mut children = Vec::new();
    for mut command in std::iter::once(simulator).chain(robots) {
        command
            .env("CARS_RUN", "bench")
            .env("CARS_CONNECT", &endpoint)
            .env(RUNTIME_VARIABLE, ONE_THREAD);
        children.push(command.stdin(Stdio::null()).spawn().into_diagnostic()?);
    }
    for child in &mut children {
        let status = child.wait().into_diagnostic()?;
        if !status.success() {
            return Err(miette!("a process of the benchmark failed: {status}"));
        }
    }
    let text = std::fs::read_to_string(scratch.join("bench").join(SUMMARY)).into_diagnostic()?;
    let summary: Summary = serde_json::from_str(&text).into_diagnostic()?;
    Ok(summary.ticks as f64 / summary.wall.elapsed_s)
}

fn hall_local(scenario: &Path, ticks: u64, scratch: &Path) -> miette::Result<f64> {
    let mut scenario = Scenario::load(scenario, &Changes::default())?;
    scenario.ticks = ticks;
    let run = RunName::new("bench-local").into_diagnostic()?;
    let folder = RunFolder::new(scratch, &run);
    let _lock = folder.create(&scenario)?;
    let summary = crate::run::execute(scenario, &run, &folder, None)?;
    Ok(summary.ticks as f64 / summary.wall.elapsed_s)
}

/// A program of this project, beside this one.
fn beside(program: &str) -> miette::Result<PathBuf> {
    let path = std::env::current_exe()
        .into_diagnostic()?
        .with_file_name(program);
    if path.exists() {
        return Ok(path);
    }
    Err(miette!(
        help = "build all programs first: `cargo build --release`",
        "there is no {}",
        path.display()
    ))
}

/// A robot that only answers.
pub(crate) fn robot(args: &RobotArgs) -> miette::Result<ExitCode> {
    let names = args
        .names
        .iter()
        .map(|name| (name.clone(), Box::new(Idle) as Box<dyn Robot>));
    let host = robot::Host::connect(names.collect(), args.options()).into_diagnostic()?;
    host.run().into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}

struct Idle;

impl Robot for Idle {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        Action::stay(cars).emotion("CALM").behavior("IDLE")
    }
}
