//! `cars conform`: checks one robot, in whatever language, against the rules of the protocol.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use clap::Args;
use config::Changes;
use conform::{Report, Role, Rule, Setting};
use miette::miette;
use protocol::{RobotName, Tick};
use simulator::Scenario;

/// `cars conform`.
///
/// Plays simulator to the robot that COMMAND starts, several times, and checks the rules of docs/protocol.md one by one.
/// Exit status: 0 all passed, 1 some failed, 2 nothing could be checked.
#[derive(Debug, Args)]
pub(crate) struct ConformArgs {
    /// The name that the robot must ask for; without it any name will do.
    #[arg(long)]
    name: Option<RobotName>,
    /// A scenario, or a launch file whose scenario is meant: its parameters, field and roster. The other robots behave as
    /// they do in it.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Report in the Test Anything Protocol (the default).
    #[arg(long, conflicts_with = "json")]
    tap: bool,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
    /// Check this rule only; may be repeated.
    #[arg(long = "rule", value_name = "NAME", value_parser = parse_rule)]
    rules: Vec<Rule>,
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

fn parse_rule(name: &str) -> Result<Rule, String> {
    let names = || conform::RULES.map(|rule| rule.name).join(", ");
    Rule::named(name).ok_or_else(|| format!("there is no such rule; the rules are {}", names()))
}

/// Checks a robot.
pub(crate) fn conform(args: &ConformArgs) -> ExitCode {
    match check(args) {
        Ok(report) => {
            if args.json {
                println!("{:#}", report.to_json());
            } else {
                print!("{}", report.to_tap());
            }
            if report.is_passed() {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            }
        }
        Err(error) => {
            eprintln!("{error:?}");
            ExitCode::from(2)
        }
    }
}

fn check(args: &ConformArgs) -> miette::Result<Report> {
    let mut setting = Setting {
        name: args.name.clone(),
        ..Setting::default()
    };
    if let Some(ticks) = args.ticks {
        setting.ticks = ticks;
    }
    if let Some(file) = &args.scenario {
        stage(&mut setting, &launch::scenario_file(file)?)?;
    }
    // What the user says goes first.
    for role in setting.cast.values_mut() {
        role.understands.splice(0..0, args.says.iter().cloned());
    }
    setting.commands.splice(0..0, args.says.iter().cloned());
    let (program, arguments) = args
        .command
        .split_first()
        .ok_or_else(|| miette!("no command is given"))?;
    let mut command = Command::new(program);
    command.args(arguments);
    conform::check(&command, &setting, &args.rules).map_err(|error| miette!("{program}: {error}"))
}

/// Field and roster of a scenario. What the other robots do, and what they command, is what they do when the scenario is
/// run in this process; robots of classes that cannot run here stand still.
fn stage(setting: &mut Setting, file: &Path) -> miette::Result<()> {
    let scenario = Scenario::load(file, &Changes::default())?;
    setting.seed = scenario.seed;
    setting.tick_s = scenario.tick_s;
    setting.field_m = scenario.field_m;
    setting.body_m = scenario.body_m;
    setting.sensing_range_m = scenario.sensing_range_m;

    setting.cast.clear();
    for (name, spec) in &scenario.robots {
        let role = Role {
            location: spec.at,
            parameters: spec.parameters.clone(),
            ..Role::default()
        };
        setting.cast.insert(name.clone(), role);
    }

    let performances = lab::performances(scenario, setting.ticks)?;
    for (name, performance) in performances.into_iter().flatten() {
        if let Some(role) = setting.cast.get_mut(&name) {
            role.understands = performance.commands;
            role.states = performance.states;
        }
    }
    Ok(())
}
