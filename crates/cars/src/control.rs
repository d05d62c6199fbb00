//! Commands for a run in progress: `cars ctl` and `cars log`.

use bus::{Bus, Reply, Role};
use clap::{Args, Subcommand, ValueEnum};
use config::units::Time;
use config::{Changes, Speed};
use lab::folder::find;
use protocol::event::log_line;
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Command, Control, ControlAnswer, FaultKind, Intervention, LogRecord, OnLate, Payload, Presence,
    Status,
};
use protocol::time::seconds;
use protocol::{Message, RobotName, RunName, Tick, decode, encode};
use record::RunFolder;
use record::names::{ENDPOINT, LATEST, OPERATOR_CONFIG};
use scenario::Scenario;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use crate::errors::{Result, refusal};

/// How long to wait for the simulator or a robot. They reply at once, but a machine under load may keep them from it.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long to wait for a step, which takes as long as its ticks.
const STEP_PATIENCE: Duration = Duration::from_secs(3600);
/// Number of past lines that `log -f` begins with.
const TAIL: usize = 10;

/// Options that name the run and how to reach it.
#[derive(Debug, Clone, Args)]
pub(crate) struct RunRef {
    /// Name of the run; without it the latest run.
    #[arg(long, global = true, env = "CARS_RUN")]
    run: Option<RunName>,
    /// Where its simulator listens; without it, the endpoint in the folder of the run.
    #[arg(long, global = true, env = "CARS_CONNECT", value_name = "ENDPOINT")]
    connect: Option<String>,
    /// Where run folders are made.
    #[arg(long, global = true, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Configuration file for a secured run, for example that of the operator; without it, the one named in the folder of
    /// the run.
    #[arg(long, global = true, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
}

impl RunRef {
    fn run(&self) -> Result<RunName> {
        if let Some(run) = &self.run {
            return Ok(run.clone());
        }

        let link = self.out.join(LATEST);
        let target = std::fs::read_link(&link).map_err(|_| {
            refusal!(
                help = "name it with --run, or start one with `cars launch`",
                "there is no run in {}",
                self.out.display()
            )
        })?;

        Ok(RunName::new(&target.to_string_lossy())?)
    }

    fn folder(&self) -> Result<RunFolder> {
        Ok(RunFolder::new(&self.out, &self.run()?))
    }

    fn endpoint(&self) -> Result<String> {
        if let Some(connect) = &self.connect {
            return Ok(connect.clone());
        }

        let run = self.run()?;
        let file = self.folder()?.file(ENDPOINT);
        let text = std::fs::read_to_string(&file).map_err(|_| {
            let help =
                "start one with `cars launch`, or give the endpoint of its simulator with --connect";
            refusal!(
                help = help,
                "run {run} is not in progress: there is no {}",
                file.display()
            )
        })?;

        Ok(text.trim().to_owned())
    }

    /// The configuration file: from the command line, or, for a run that is found by its folder, the one noted there.
    fn config(&self) -> Result<Option<PathBuf>> {
        if self.zenoh_config.is_some() || self.connect.is_some() {
            return Ok(self.zenoh_config.clone());
        }
        let noted = std::fs::read_to_string(self.folder()?.file(OPERATOR_CONFIG));
        Ok(noted.ok().map(|text| PathBuf::from(text.trim())))
    }

    /// The same, as options of another program.
    pub(crate) fn options(&self) -> Result<Vec<String>> {
        let mut options = vec![
            format!("--run={}", self.run()?),
            format!("--connect={}", self.endpoint()?),
        ];
        if let Some(file) = self.config()? {
            options.push(format!("--zenoh-config={}", file.display()));
        }
        Ok(options)
    }

    fn open(&self) -> Result<(Bus, Keys)> {
        let role = Role::Client {
            connect: self.endpoint()?,
            patience: PATIENCE,
        };
        let config = self.config()?;
        let bus = Bus::open(&role, config.as_ref())?;

        Ok((bus, Keys::new(&self.run()?)))
    }
}

/// `cars ctl`.
#[derive(Debug, Args)]
pub(crate) struct CtlArgs {
    #[command(subcommand)]
    request: ControlRequest,
    #[command(flatten)]
    run: RunRef,
    /// Print the answer as JSON.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum ControlRequest {
    #[command(flatten)]
    Control(CtlRequest),
    /// Query a robot, for example `cars ctl query Leguin emotion_state`.
    Query {
        /// Name of the robot.
        robot: RobotName,
        /// The query; without it the whole state.
        #[arg(value_parser = QUERIES, default_value = None)]
        what: Option<String>,
    },
    /// Send a robot a command, for example `cars ctl command Leguin refill`.
    Command {
        /// Name of the robot that receives the command.
        robot: RobotName,
        /// Text of the command, for example `refill`.
        command: String,
        /// A payload beside it: JSON, of at most 64 KiB.
        #[arg(long, value_name = "JSON", value_parser = read_payload)]
        payload: Option<Payload>,
    },
}

/// What the simulator is asked for.
#[derive(Debug, Subcommand)]
enum CtlRequest {
    /// Return to tick 0 with the same processes.
    Init {
        /// Another seed.
        #[arg(long)]
        seed: Option<u64>,
    },
    /// Let the clock run.
    Start,
    /// Hold the clock.
    Pause,
    /// Grant a number of ticks, then hold the clock.
    Step {
        /// Number of ticks.
        #[arg(default_value_t = 1)]
        n: u64,
    },
    /// Go to a tick of a replay, back or forward.
    Seek {
        /// The tick.
        tick: Tick,
    },
    /// End the run.
    Stop,
    /// Set simulated seconds per second.
    Speed {
        /// A number, or `max`.
        factor: Speed,
    },
    /// Change what the clock does about robots that are late.
    Late {
        /// The new rule.
        #[arg(value_enum)]
        on_late: Option<LateMode>,
        /// The rule of this robot only; without it the rule of all robots without one of their own.
        #[arg(long)]
        robot: Option<RobotName>,
        /// Time without a report after which a robot is late, wall clock, for example "2 s".
        #[arg(long, value_name = "TIME")]
        deadline: Option<Time>,
    },
    #[command(flatten)]
    Intervene(ByHand),
    /// Print tick, phase and robots.
    Status,
    /// Return to tick 0 with another scenario for the same robots.
    Load {
        /// The scenario file.
        file: PathBuf,
    },
    /// Print the scenario of the run as a file, with what was done by hand as `[[change]]`.
    Scenario,
}

/// What is done to a run by hand.
#[derive(Debug, Subcommand)]
enum ByHand {
    /// Cut the links between two robots, or two groups of robots.
    Cut {
        /// A robot, or several, separated by commas.
        #[arg(required = true, value_delimiter = ',', num_args = 1)]
        from: Vec<RobotName>,
        /// Another one, or several.
        #[arg(required = true, value_delimiter = ',', num_args = 1)]
        to: Vec<RobotName>,
        /// Cut only messages from the former to the latter.
        #[arg(long)]
        one_way: bool,
    },
    /// Heal links that are cut: between two robots or groups, all of one, or without robots all.
    Heal {
        /// A robot, or several, separated by commas.
        #[arg(value_delimiter = ',', num_args = 0..=1)]
        from: Vec<RobotName>,
        /// Another one, or several.
        #[arg(value_delimiter = ',', num_args = 0..=1)]
        to: Vec<RobotName>,
        /// Only messages from the former to the latter pass again.
        #[arg(long)]
        one_way: bool,
    },
    /// Lose the next command from one robot to another.
    Lose {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
    },
    /// Delay the next command from one robot to another.
    Delay {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
        /// How much later it arrives, simulated time, for example "5 s"; at most 1000 ticks.
        by: Time,
    },
    /// Have the next command from one robot to another arrive twice.
    Duplicate {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
    },
    /// Kill the process of a robot.
    Crash(FaultArgs),
    /// Stop the process of a robot.
    Hang(FaultArgs),
    /// Kill the process of a robot and start it again, between two ticks.
    Restart {
        /// Name of the robot.
        robot: RobotName,
    },
    /// Let the process of a robot go on that is stopped, or start it that is killed.
    Recover {
        /// Name of the robot.
        robot: RobotName,
    },
    /// Change parameters, network or faults from the next tick on, as a `[[change]]` of the scenario does.
    Set {
        /// For example `robot.Butler.params.policy=rules`.
        #[arg(required = true, value_name = "PATH=VALUE")]
        set: Vec<String>,
    },
}

/// A fault of a process.
#[derive(Debug, Args)]
struct FaultArgs {
    /// Name of the robot.
    robot: RobotName,
    /// How long it lasts, wall clock, at most an hour, where the clock waits for the robot; otherwise it lasts until `recover`.
    #[arg(long = "for", value_name = "TIME")]
    lasting: Option<Time>,
}

impl FaultArgs {
    fn intervention(self, kind: FaultKind) -> Intervention {
        Intervention::Fault {
            robot: self.robot,
            kind,
            for_s: self.lasting.map(|lasting| lasting.0),
        }
    }
}

/// What the clock does about a robot that is late.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum LateMode {
    /// Hold the clock and name the robot.
    Wait,
    /// Continue without the robot.
    Continue,
    /// End the run.
    Abort,
}

impl From<LateMode> for OnLate {
    fn from(mode: LateMode) -> Self {
        match mode {
            LateMode::Wait => Self::Wait,
            LateMode::Continue => Self::Continue,
            LateMode::Abort => Self::Abort,
        }
    }
}

impl CtlRequest {
    fn control(self) -> Result<Control> {
        Ok(match self {
            Self::Init { seed } => Control::Init {
                seed,
                setup: None,
                epoch: None,
            },
            Self::Start => Control::Start,
            Self::Pause => Control::Pause,
            Self::Step { n } => Control::Step { n },
            Self::Seek { tick } => Control::Seek { tick },
            Self::Stop => Control::Stop,
            Self::Speed { factor } => Control::Speed { factor: factor.0 },
            Self::Late {
                on_late,
                robot,
                deadline,
            } => Control::Late {
                robot,
                on_late: on_late.map(OnLate::from),
                deadline_s: deadline.map(|deadline| deadline.0),
            },
            Self::Intervene(intervention) => Control::Intervene {
                what: intervention.into(),
            },
            Self::Status => Control::Status,
            // The simulator cannot read the files that the scenario names, so they are read here.
            Self::Load { file } => Control::Load {
                scenario: Scenario::load(&file, &Changes::default())?.to_toml()?,
            },
            Self::Scenario => Control::Setup,
        })
    }
}

impl From<ByHand> for Intervention {
    fn from(by_hand: ByHand) -> Self {
        match by_hand {
            ByHand::Cut { from, to, one_way } => Self::Cut { from, to, one_way },
            ByHand::Heal { from, to, one_way } => Self::Heal { from, to, one_way },
            ByHand::Lose { from, to } => Self::Lose { from, to },
            ByHand::Delay { from, to, by } => Self::Delay {
                from,
                to,
                by_s: by.0,
            },
            ByHand::Duplicate { from, to } => Self::Duplicate { from, to },
            ByHand::Crash(fault) => fault.intervention(FaultKind::Crash),
            ByHand::Hang(fault) => fault.intervention(FaultKind::Hang),
            ByHand::Restart { robot } => Self::Fault {
                robot,
                kind: FaultKind::Restart,
                for_s: None,
            },
            ByHand::Recover { robot } => Self::Recover { robot },
            ByHand::Set { set } => Self::Set { set },
        }
    }
}

/// Carries out a request and prints its answer.
pub(crate) fn ctl(args: CtlArgs) -> Result<ExitCode> {
    match args.request {
        ControlRequest::Query { robot, what } => query(&args.run, &robot, what.as_deref()),
        ControlRequest::Command {
            robot,
            command,
            payload,
        } => send_command(&args.run, &robot, command, payload),
        ControlRequest::Control(request) => {
            let control = request.control()?;
            print_answer(&args.run, &control, args.json)
        }
    }
}

/// Sends a request to the simulator of a run and prints its answer.
fn print_answer(run: &RunRef, control: &Control, is_json: bool) -> Result<ExitCode> {
    let (bus, keys) = run.open()?;
    let answer = ask(&bus, &keys, run, control);
    bus.close();

    match answer? {
        ControlAnswer::Done(status) if is_json => {
            let status = serde_json::to_string(&status)?;
            terminal::data(format_args!("{status}\n"))?;
        }
        ControlAnswer::Done(status) => {
            if matches!(control, Control::Intervene { .. }) {
                terminal::print("asked: it takes effect before the next tick; now:\n")?;
            }
            terminal::print(describe(&status))?;
        }
        ControlAnswer::Setup(answer) => terminal::data(answer.scenario)?,
        ControlAnswer::Log { lines } => {
            for line in &lines {
                terminal::print(log_line(line))?;
            }
        }
        ControlAnswer::Refused { explanation, .. } => {
            return Err(refusal!("refused: {explanation}"));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Gets the simulator's answer to a control request.
fn ask(bus: &Bus, keys: &Keys, run: &RunRef, control: &Control) -> Result<ControlAnswer> {
    let patience = if matches!(control, Control::Step { .. }) {
        STEP_PATIENCE
    } else {
        PATIENCE
    };

    let key = keys.control();
    let reply = bus.get_within(&key, "", Some(encode(control)), patience)?;
    let run = run.run()?;
    let reply = reply.ok_or_else(|| refusal!("no simulator of run {run} answers"))?;

    Ok(decode(&key, "simulator", &body(reply)?)?)
}

/// The body of a reply.
///
/// # Errors
/// The reason of an error reply.
fn body(reply: Reply) -> Result<Vec<u8>> {
    reply.result.map_err(|reason| refusal!("refused: {reason}"))
}

/// The status of a run as lines of text.
fn describe(status: &Status) -> String {
    let mut text = headline(status);
    if let Some(run) = &status.replay_of {
        text += &format!("a replay of run {run}\n");
    }
    if status.pending_steps > 0 {
        text += &format!("{} steps are pending\n", status.pending_steps);
    }

    for awaited in &status.awaiting {
        text += &format!(
            "waiting for {} since {:.1} s: it {}\n",
            awaited.name, awaited.since_s, awaited.because
        );
    }

    for robot in &status.robots {
        let presence = match robot.presence {
            Presence::Here => "present",
            Presence::Gone => "absent",
            Presence::Lost => "lost",
        };
        text += &format!(
            "  {:<12} {presence}, incarnation {}\n",
            robot.name, robot.generation
        );
    }

    for (reason, count) in &status.ignored {
        let messages = if *count == 1 { "message" } else { "messages" };
        text += &format!("ignored {count} {messages}: {reason}\n");
    }

    text
}

fn headline(status: &Status) -> String {
    let speed = status
        .speed
        .map_or("max".to_owned(), |speed| format!("{speed}x"));

    format!(
        "{} {}  tick {}  {} of {} s  speed {speed}  seed {}  epoch {}\n",
        status.run,
        status.phase,
        status.tick,
        seconds(status.time_s, status.tick_s),
        seconds(status.duration_s, status.tick_s),
        status.seed,
        status.epoch
    )
}

/// Queries a robot of a run in progress, as another robot can, and prints the answer.
fn query(run: &RunRef, robot: &RobotName, what: Option<&str>) -> Result<ExitCode> {
    let (bus, keys) = run.open()?;
    let key = keys.query(robot, what.unwrap_or(STATE));
    let reply = bus.get_within(&key, "", None, PATIENCE)?;
    bus.close();

    let run = run.run()?;
    let reply = reply.ok_or_else(|| refusal!("no robot called {robot} answers in run {run}"))?;
    let answer: serde_json::Value = serde_json::from_slice(&body(reply)?)?;

    // Epoch and tick around the value are for programs.
    let value = answer.get("value").unwrap_or(&answer);
    match value.as_str() {
        Some(text) => terminal::print_line(text)?,
        None => {
            let value = serde_json::to_string_pretty(value)?;
            terminal::data(format_args!("{value}\n"))?;
        }
    }

    Ok(ExitCode::SUCCESS)
}

/// Reads the payload of a command.
fn read_payload(json: &str) -> Result<Payload, String> {
    let payload: Payload = serde_json::from_str(json).map_err(|error| error.to_string())?;
    payload.check("payload").map_err(|error| error.reason)?;
    Ok(payload)
}

/// Sends a command from the operator. It takes effect at the next tick boundary and is part of the record.
fn send_command(
    run: &RunRef,
    robot: &RobotName,
    text: String,
    payload: Option<Payload>,
) -> Result<ExitCode> {
    let command = Command {
        command: text,
        payload,
        ..Command::default()
    };
    command
        .check()
        .map_err(|error| refusal!("{}: {}", error.field, error.reason))?;

    let (bus, keys) = run.open()?;
    let key = keys.command(robot, &RobotName::operator());
    bus.put(&key, encode(&command))?;
    // Samples of one session arrive in order, so a simulator that answers this get has received the command.
    let answer = ask(&bus, &keys, run, &Control::Status);
    bus.close();

    let ControlAnswer::Done(status) = answer? else {
        return Err(refusal!("the simulator does not answer with its status"));
    };
    if let Some(run) = &status.replay_of {
        return Err(refusal!(
            "refused: this is a replay of run {run}: its robots execute no commands"
        ));
    }
    if !status.robots.iter().any(|other| other.name == *robot) {
        return Err(refusal!("refused: no robot of this run is called {robot}"));
    }
    terminal::print_line(format_args!(
        "{robot} receives {:?} at the tick after {}",
        command.command, status.tick
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// `cars log`.
#[derive(Debug, Args)]
pub(crate) struct LogArgs {
    /// Name or folder of a run; without it that of `--run`, or the latest run.
    #[arg(value_name = "RUN")]
    of: Option<PathBuf>,
    /// Follow a run in progress until it ends.
    #[arg(short, long)]
    follow: bool,
    #[command(flatten)]
    run: RunRef,
}

impl LogArgs {
    /// The folder of the run, and how to reach the run.
    fn subject(&self) -> Result<(RunFolder, RunRef)> {
        let mut run = self.run.clone();
        let Some(of) = &self.of else {
            return Ok((run.folder()?, run));
        };

        let folder = find(&run.out, of)?;
        if self.follow {
            // A run in progress is known by the name of its folder.
            let folder = folder.resolved()?;
            run.run = Some(folder.name()?);
            run.out = folder.path().parent().unwrap_or(&run.out).to_owned();
        }
        Ok((folder, run))
    }
}

/// Shows the log of a run.
pub(crate) fn log(args: &LogArgs) -> Result<ExitCode> {
    let (folder, run) = args.subject()?;
    let file = folder.log();
    let past = std::fs::read_to_string(&file)
        .map_err(|error| refusal!("cannot read {}: {error}", file.display()));

    if args.follow {
        follow(&run, &past.unwrap_or_default())?;
    } else {
        terminal::print(past?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the end of the past log, then every line that the simulator puts until its token is undeclared.
fn follow(run: &RunRef, past: &str) -> Result<()> {
    let (bus, keys) = run.open()?;
    let (lines, received) = sync_channel(1024);
    let end = lines.clone();
    let _log = bus.subscribe(&keys.log(), move |key, bytes| {
        // A reader that is too slow misses lines instead of holding up the run; the file has all lines.
        if let Ok(line) = decode::<LogRecord>(key, "simulator", bytes) {
            let _is_full = lines.try_send(Some(line));
        }
    })?;
    let _token = bus.liveliness(&keys.alive_sim(), move |_, is_declared| {
        if !is_declared {
            let _has_ended = end.send(None);
        }
    })?;

    // The past log of a replay is that of the recorded run, to its end.
    let answer = ask(&bus, &keys, run, &Control::Status);
    let is_replay = matches!(answer, Ok(ControlAnswer::Done(s)) if s.replay_of.is_some());
    if !is_replay {
        let all: Vec<&str> = past.lines().collect();
        for line in all.iter().skip(all.len().saturating_sub(TAIL)) {
            terminal::print_line(line)?;
        }
    }
    while let Ok(Some(line)) = received.recv() {
        terminal::print_line(log_line(&line))?;
    }
    Ok(())
}
