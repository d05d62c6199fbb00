//! A run in progress, from a shell: its buttons, the calls between robots, its log.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use bus::{Bus, Reply, Role};
use clap::{Args, Subcommand, ValueEnum};
use config::units::Time;
use config::{Changes, Speed};
use miette::{IntoDiagnostic, miette};
use protocol::event::log_line;
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{Command, Control, ControlAnswer, LogRecord, OnLate, Presence, Status};
use protocol::{Message, RobotName, RunName, decode, encode};
use simulator::recorder::{ENDPOINT, LATEST, OPERATOR_CONFIG};
use simulator::{RunFolder, Scenario};

/// How long to try to reach a run.
const PATIENCE: Duration = Duration::from_secs(2);
/// A step may take as long as its ticks take.
const STEP_PATIENCE: Duration = Duration::from_secs(3600);
/// Lines of the past that `log -f` begins with.
const TAIL: usize = 10;

/// Which run is meant.
#[derive(Debug, Args)]
pub(crate) struct RunRef {
    /// The run; without it the one that was started last.
    #[arg(long, global = true, env = "CARS_RUN")]
    run: Option<RunName>,
    /// Where its simulator listens; without it, as its folder says.
    #[arg(long, global = true, env = "CARS_CONNECT", value_name = "ENDPOINT")]
    connect: Option<String>,
    /// Where run folders are made.
    #[arg(long, global = true, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Configuration file for a secured run, for example that of the operator; without it, as its folder says.
    #[arg(long, global = true, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
}

impl RunRef {
    fn run(&self) -> miette::Result<RunName> {
        if let Some(run) = &self.run {
            return Ok(run.clone());
        }

        let link = self.out.join(LATEST);
        let target = std::fs::read_link(&link).map_err(|_| {
            miette!(
                help = "name it with --run, or start one with `cars launch`",
                "no run is known in {}",
                self.out.display()
            )
        })?;

        RunName::new(&target.to_string_lossy()).into_diagnostic()
    }

    fn folder(&self) -> miette::Result<RunFolder> {
        Ok(RunFolder::new(&self.out, &self.run()?))
    }

    fn endpoint(&self) -> miette::Result<String> {
        if let Some(connect) = &self.connect {
            return Ok(connect.clone());
        }

        let (run, file) = (self.run()?, self.folder()?.file(ENDPOINT));
        let text = std::fs::read_to_string(&file).map_err(|_| {
            let help =
                "start one with `cars launch`, or say where its simulator listens with --connect";
            miette!(
                help = help,
                "run {run} is not in progress: there is no {}",
                file.display()
            )
        })?;

        Ok(text.trim().to_owned())
    }

    /// What is needed to be let in: as said, or as the folder of the run says if it is found by its folder.
    fn config(&self) -> miette::Result<Option<PathBuf>> {
        if self.zenoh_config.is_some() || self.connect.is_some() {
            return Ok(self.zenoh_config.clone());
        }
        let noted = std::fs::read_to_string(self.folder()?.file(OPERATOR_CONFIG));
        Ok(noted.ok().map(|text| PathBuf::from(text.trim())))
    }

    fn open(&self) -> miette::Result<(Bus, Keys)> {
        let (connect, config) = (self.endpoint()?, self.config()?);
        let role = Role::Client {
            connect,
            patience: PATIENCE,
        };
        Ok((
            Bus::open(&role, config.as_ref()).into_diagnostic()?,
            Keys::new(&self.run()?),
        ))
    }
}

/// `cars ctl`.
#[derive(Debug, Args)]
pub(crate) struct CtlArgs {
    #[command(subcommand)]
    button: Button,
    #[command(flatten)]
    run: RunRef,
    /// Print the answer as JSON.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Button {
    /// Back to tick 0, with the same processes.
    Init {
        /// Another seed.
        #[arg(long)]
        seed: Option<u64>,
    },
    /// Let the clock run.
    Start,
    /// Hold the clock.
    Pause,
    /// Grant ticks one by one.
    Step {
        /// How many.
        #[arg(default_value_t = 1)]
        n: u64,
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
        /// What it does.
        #[arg(value_enum)]
        on_late: Option<LateMode>,
        /// For this robot only; without it for all that have no rule of their own.
        #[arg(long)]
        robot: Option<RobotName>,
        /// After how long without a report a robot is late, wall clock, for example "2 s".
        #[arg(long, value_name = "TIME")]
        deadline: Option<Time>,
    },
    /// Say how things stand.
    Status,
    /// Back to tick 0 with another scenario for the same robots.
    Load {
        /// The scenario file.
        file: PathBuf,
    },
    /// Print the scenario of the run as a file.
    Scenario,
}

/// What the clock does about a robot that is late.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum LateMode {
    /// Hold, and say for whom.
    Wait,
    /// Go on without it.
    Continue,
    /// End the run.
    Abort,
}

impl Button {
    fn control(&self) -> miette::Result<Control> {
        Ok(match self {
            Self::Init { seed } => Control::Init {
                seed: *seed,
                setup: None,
            },
            Self::Start => Control::Start,
            Self::Pause => Control::Pause,
            Self::Step { n } => Control::Step { n: *n },
            Self::Stop => Control::Stop,
            Self::Speed { factor } => Control::Speed { factor: factor.0 },
            Self::Late {
                on_late,
                robot,
                deadline,
            } => Control::Late {
                robot: robot.clone(),
                on_late: on_late.map(|mode| match mode {
                    LateMode::Wait => OnLate::Wait,
                    LateMode::Continue => OnLate::Continue,
                    LateMode::Abort => OnLate::Abort,
                }),
                deadline_s: deadline.map(|deadline| deadline.0),
            },
            Self::Status => Control::Status,
            // Resolved here, where the files are that it names.
            Self::Load { file } => Control::Load {
                scenario: Scenario::load(file, &Changes::default())?.to_toml()?,
            },
            Self::Scenario => Control::Setup,
        })
    }
}

/// Presses a button of a run in progress.
pub(crate) fn ctl(args: &CtlArgs) -> miette::Result<ExitCode> {
    let status = match ask(&args.run, &args.button.control()?)? {
        ControlAnswer::Done(status) => *status,
        ControlAnswer::Setup(answer) => {
            print!("{}", answer.scenario);
            return Ok(ExitCode::SUCCESS);
        }
        refusal @ ControlAnswer::Refused { .. } => return Err(refused(&refusal)),
    };

    if args.json {
        println!("{}", serde_json::to_string(&status).into_diagnostic()?);
    } else {
        print!("{}", describe(&status));
    }

    Ok(ExitCode::SUCCESS)
}

/// Why what was asked for was not done.
fn refused(answer: &ControlAnswer) -> miette::Report {
    match answer {
        ControlAnswer::Refused { explanation, .. } => miette!("refused: {explanation}"),
        _ => miette!("the simulator answers something else than was asked"),
    }
}

/// Asks the simulator for something.
fn ask(run: &RunRef, control: &Control) -> miette::Result<ControlAnswer> {
    let (bus, keys) = run.open()?;
    let answer = ask_over(&bus, &keys, run, control);
    bus.close();
    answer
}

/// The same over a session that is open.
fn ask_over(
    bus: &Bus,
    keys: &Keys,
    run: &RunRef,
    control: &Control,
) -> miette::Result<ControlAnswer> {
    let patience = if matches!(control, Control::Step { .. }) {
        STEP_PATIENCE
    } else {
        PATIENCE
    };

    let answer = bus
        .get_within(&keys.control(), "", Some(encode(control)), patience)
        .into_diagnostic()?;
    let bytes = bytes_of(
        answer,
        &format!("no simulator of run {} answers", run.run()?),
    )?;

    decode(&keys.control(), "simulator", &bytes).into_diagnostic()
}

fn bytes_of(answer: Option<Reply>, nobody: &str) -> miette::Result<Vec<u8>> {
    let answer = answer.ok_or_else(|| miette!("{nobody}"))?;
    answer.result.map_err(|reason| miette!("refused: {reason}"))
}

fn describe(status: &Status) -> String {
    let speed = status
        .speed
        .map_or("max".to_owned(), |speed| format!("{speed}x"));
    let mut text = format!(
        "{} {}  tick {}  {:.1} of {:.1} s  speed {speed}  seed {}  epoch {}\n",
        status.run,
        status.phase,
        status.tick,
        status.time_s,
        status.duration_s,
        status.seed,
        status.epoch
    );

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
        text += &format!("ignored {count} messages: {reason}\n");
    }

    text
}

/// `cars query`.
#[derive(Debug, Args)]
pub(crate) struct QueryArgs {
    /// Whom to ask.
    robot: RobotName,
    /// What to ask; without it everything.
    #[arg(value_parser = QUERIES, default_value = None)]
    what: Option<String>,
    #[command(flatten)]
    run: RunRef,
}

/// Asks a robot of a run in progress what the other robots may ask it.
pub(crate) fn query(args: &QueryArgs) -> miette::Result<ExitCode> {
    let (bus, keys) = args.run.open()?;
    let what = args.what.as_deref().unwrap_or(STATE);
    let answer = bus
        .get(&keys.query(&args.robot, what), "", None)
        .into_diagnostic()?;
    bus.close();
    let bytes = bytes_of(
        answer,
        &format!(
            "no robot called {} answers in run {}",
            args.robot,
            args.run.run()?
        ),
    )?;
    let answer: serde_json::Value = serde_json::from_slice(&bytes).into_diagnostic()?;

    // The value is what was asked for; the tick around it is for programs.
    let value = answer.get("value").unwrap_or(&answer);
    match value.as_str() {
        Some(text) => println!("{text}"),
        None => println!("{}", serde_json::to_string_pretty(value).into_diagnostic()?),
    }

    Ok(ExitCode::SUCCESS)
}

/// `cars command`.
#[derive(Debug, Args)]
pub(crate) struct CommandArgs {
    /// Whom to send it to.
    robot: RobotName,
    /// What it says, for example `refill`.
    command: String,
    #[command(flatten)]
    run: RunRef,
}

/// Sends a command from outside the roster; it takes effect at the next tick boundary and is part of the record.
pub(crate) fn command(args: &CommandArgs) -> miette::Result<ExitCode> {
    let (bus, keys) = args.run.open()?;
    let command = Command {
        command: args.command.clone(),
        ..Command::default()
    };
    command
        .check()
        .map_err(|error| miette!("{}: {}", error.field, error.reason))?;
    let key = keys.command(&args.robot, &RobotName::operator());
    bus.put(&key, encode(&command)).into_diagnostic()?;

    // On one session the command arrives before the question after it: who answers this has the command.
    let answer = ask_over(&bus, &keys, &args.run, &Control::Status);
    bus.close();
    let ControlAnswer::Done(status) = answer? else {
        return Err(miette!("the simulator does not answer with its status"));
    };
    let is_known = status.robots.iter().any(|robot| robot.name == args.robot);
    if !is_known {
        return Err(miette!(
            "refused: no robot of this run is called {}",
            args.robot
        ));
    }
    println!(
        "{} receives {:?} at the tick after {}",
        args.robot, args.command, status.tick
    );
    Ok(ExitCode::SUCCESS)
}

/// `cars log`.
#[derive(Debug, Args)]
pub(crate) struct LogArgs {
    /// Follow a run in progress until it ends.
    #[arg(short, long)]
    follow: bool,
    #[command(flatten)]
    run: RunRef,
}

/// Shows the log of a run.
pub(crate) fn log(args: &LogArgs) -> miette::Result<ExitCode> {
    let file = args.run.folder()?.log();
    let past = std::fs::read_to_string(&file)
        .map_err(|error| miette!("cannot read {}: {error}", file.display()));

    if !args.follow {
        print!("{}", past?);
        return Ok(ExitCode::SUCCESS);
    }

    let (bus, keys) = args.run.open()?;
    let (lines, received) = std::sync::mpsc::sync_channel(1024);
    let gone = lines.clone();
    let subscribed = bus.subscribe(&keys.log(), move |key, bytes| {
        // A reader that is too slow misses lines rather than hold the run; the file has them all.
        if let Ok(line) = decode::<LogRecord>(key, "simulator", bytes) {
            let _ = lines.try_send(Some(line));
        }
    });
    let watched = bus.liveliness(&keys.alive_sim(), move |_, is_there| {
        if !is_there {
            let _ = gone.send(None);
        }
    });
    let _declared = (subscribed.into_diagnostic()?, watched.into_diagnostic()?);
    let past = past.unwrap_or_default();
    let all: Vec<&str> = past.lines().collect();
    all.iter()
        .skip(all.len().saturating_sub(TAIL))
        .for_each(|line| println!("{line}"));

    while let Ok(Some(line)) = received.recv() {
        println!("{}", log_line(&line));
    }

    Ok(ExitCode::SUCCESS)
}
