//! `cars conform`: checks a robot program in any language against the rules of the protocol.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Duration;

use clap::Args;
use config::Changes;
use conform::{CheckReport, CheckSetting, PlayedLayer, ProtocolRule, RosterRobot};
use indicatif::{ProgressBar, ProgressStyle};
use protocol::messages::KnownSite;
use protocol::{RobotName, Tick};
use scenario::Scenario;
use terminal::OutputError;

use crate::errors::{Result, refusal, render};
use crate::named;
use crate::why::INTERRUPTED;

/// How often the spinner turns.
const SPIN: Duration = Duration::from_millis(100);

/// `cars conform`.
///
/// Starts the robot COMMAND several times, acts as its simulator, and checks the rules of docs/protocol.md one by one: alone, and where
/// nothing fails in a later epoch of the process, after it has joined again, and in a run of three robots with all that happens to a
/// robot there. Failures say in which of these parts they were seen.
/// Exit status: 0 all passed, 1 some failed, 2 nothing could be checked.
#[derive(Debug, Args)]
pub(crate) struct ConformArgs {
    /// Name under which the robot must join; without it any name is accepted.
    #[arg(long)]
    name: Option<RobotName>,
    /// A scenario, or a launch file with one, for parameters, field and roster. The other robots behave as in a run of this
    /// scenario.
    #[arg(long, value_name = "FILE", value_parser = named::run())]
    scenario: Option<PathBuf>,
    /// Report in the Test Anything Protocol (the default).
    #[arg(long, conflicts_with = "json")]
    tap: bool,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
    /// Check only this rule; may be repeated.
    #[arg(long = "rule", value_name = "NAME", value_parser = parse_rule)]
    rules: Vec<ProtocolRule>,
    /// Ticks of the longer checks.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(24..=100_000))]
    ticks: Option<Tick>,
    /// A command that the robot understands; may be repeated. Two of them show in which order it executes them.
    #[arg(long = "say", value_name = "TEXT")]
    says: Vec<String>,
    /// The robot's program and its arguments.
    #[arg(last = true, required = true, value_name = "COMMAND")]
    command: Vec<String>,
}

fn parse_rule(name: &str) -> Result<ProtocolRule, String> {
    ProtocolRule::named(name).ok_or_else(|| {
        let names: Vec<&str> = conform::rules().map(|rule| rule.name).collect();
        let names = names.join(", ");
        format!("there is no such rule; the rules are {names}")
    })
}

/// Checks a robot and prints the report.
pub(crate) fn conform(args: &ConformArgs) -> Result<ExitCode> {
    let report = match check(args) {
        Ok(report) => report,
        Err(error) => {
            terminal::note(format_args!("Error: {}", render(error.as_ref())));
            return Ok(ExitCode::from(2));
        }
    };

    let printed = if args.json {
        terminal::data(format_args!("{:#}\n", report.to_json()))
    } else {
        terminal::print(report.to_tap())
    };
    // The exit status is that of the checks also where a reader has seen enough of them.
    OutputError::unless_closed(printed)?;

    if report.is_passed() {
        Ok(ExitCode::SUCCESS)
    } else {
        Ok(ExitCode::FAILURE)
    }
}

fn check(args: &ConformArgs) -> Result<CheckReport> {
    let setting = setting(args)?;
    let (program, arguments) = args
        .command
        .split_first()
        .ok_or_else(|| refusal!("no command is given"))?;
    let mut command = Command::new(program);
    command.args(arguments);

    // Each robot is in a group of its own, which no signal of a terminal reaches.
    ctrlc::set_handler(|| {
        conform::kill_all();
        std::process::exit(INTERRUPTED);
    })?;
    let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed}")?;
    let bar = ProgressBar::new_spinner().with_style(style);
    bar.set_message("the usual ticks");
    bar.enable_steady_tick(SPIN);
    let progress = |done, of| bar.set_message(format!("{done} of {of} checks"));

    let report = conform::check(&command, &setting, &args.rules, &progress);
    bar.finish_and_clear();
    report.map_err(|error| refusal!("{program}: {error}"))
}

/// The setting of the checks: the default one, with what the command line and its scenario change.
fn setting(args: &ConformArgs) -> Result<CheckSetting> {
    let mut setting = CheckSetting {
        name: args.name.clone(),
        ..CheckSetting::default()
    };
    if let Some(ticks) = args.ticks {
        setting.ticks = ticks;
    }

    if let Some(file) = &args.scenario {
        take_scenario(&mut setting, &launch::scenario_file(file)?)?;
    }

    // Commands of the command line come before those of the scenario.
    for role in setting.fake_peers.values_mut() {
        role.understands.splice(0..0, args.says.iter().cloned());
    }

    setting.commands.splice(0..0, args.says.iter().cloned());
    Ok(setting)
}

/// The sites that every robot knows of.
fn known_sites(scenario: &Scenario) -> Vec<KnownSite> {
    let mut known = Vec::new();
    for (name, site) in &scenario.sites {
        if site.is_known {
            known.push(KnownSite {
                name: name.clone(),
                kind: site.kind.clone(),
                location: site.at,
            });
        }
    }
    known
}

/// The layers that robots sense, with their numbers at the start.
fn sensed_layers(scenario: &Scenario) -> Vec<PlayedLayer> {
    let mut sensed = Vec::new();
    for (name, layer) in &scenario.layers {
        if layer.range_m.is_some() {
            sensed.push(PlayedLayer {
                name: name.clone(),
                cell_m: layer.cell_m,
                value: layer.value,
            });
        }
    }
    sensed
}

/// Takes field, roster and parameters from a scenario. The states and commands of the other robots are those of a run of
/// the scenario in this process; if a class cannot run here, the other robots stand still.
fn take_scenario(setting: &mut CheckSetting, file: &Path) -> Result<()> {
    let scenario = Scenario::load(file, &Changes::default())?;
    setting.seed = scenario.seed;
    setting.tick_s = scenario.tick_s;
    setting.field_m = scenario.field_m;
    setting.body_m = scenario.body_m;
    setting.sensing_range_m = scenario.sensing.range_m;
    setting.rays = scenario.sensing.rays;
    setting.known_sites = known_sites(&scenario);
    setting.layers = sensed_layers(&scenario);

    setting.fake_peers.clear();
    for (name, spec) in &scenario.robots {
        let role = RosterRobot {
            location: spec.at,
            parameters: spec.parameters.clone(),
            drive: spec
                .wheels
                .map(|wheels| environment::drive_limits(&wheels, scenario.max_speed_mps)),
            heading_rad: spec.wheels.map_or(0.0, |wheels| wheels.heading_rad),
            ..RosterRobot::default()
        };
        setting.fake_peers.insert(name.clone(), role);
    }

    let performances = lab::performances(scenario, setting.ticks)?;
    for (name, performance) in performances.into_iter().flatten() {
        if let Some(role) = setting.fake_peers.get_mut(&name) {
            role.understands = performance.commands;
            role.states = performance.states;
        }
    }
    Ok(())
}
