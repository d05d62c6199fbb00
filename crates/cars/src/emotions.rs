//! `cars emotions`: the taxonomy of a robot's emotions, and where in it a robot of a recorded run is.

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use affect::frame::{CAUSAL_CHAIN, MEANINGS, MOOD, VALENCE, word};
use affect::{CausalChain, IntensityLabel, Node, Schemata};
use clap::Args;
use config::Changes;
use lab::folder::{find, recorded_epoch, recording, run_name};
use protocol::messages::{Report, StateVariables, Variable};
use protocol::time::seconds;
use protocol::{Epoch, RobotName, RunName, Tick};
use scenario::Scenario;

use crate::errors::{Result, refusal};
use crate::fork::TickOfRun;
use crate::named;

/// Columns of a terminal.
const WIDTH: usize = 80;
/// Columns of the names of components.
const NAMES: usize = 22;
/// What robots with beliefs publish of them, and what it means.
const BELIEFS: [(&str, &str); 2] = [
    ("belief", "whether the robot believes that it can"),
    ("belief_because", "what made it believe so"),
];
/// Where unmarked emotions of a valence belong.
const POSITIVE: &str = "positive emotion";
const NEGATIVE: &str = "negative emotion";

/// `cars emotions`.
#[derive(Debug, Args)]
pub(crate) struct EmotionsArgs {
    /// A robot of the scenario or of the run, or a class that comes with the programs; without it all robots.
    robot: Option<String>,
    /// The scenario of the robot: a file, or the name of one that comes with the programs.
    #[arg(long, value_name = "FILE", default_value = "hors_doeuvres", value_parser = named::run(), conflicts_with = "at")]
    scenario: PathBuf,
    /// Show what the robots of a recorded run feel in a tick, for example `latest@62`, or `latest@31s`.
    #[arg(long, value_name = "RUN@TICK")]
    at: Option<TickOfRun>,
    /// The epoch, in a run in which `init` began several; without it the last one.
    #[arg(long, value_name = "N", requires = "at")]
    epoch: Option<Epoch>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Prints the taxonomy, or a moment of a run in it.
pub(crate) fn emotions(args: &EmotionsArgs) -> Result<ExitCode> {
    let text = match &args.at {
        Some(at) => moment(args, at)?,
        None => taxonomy(args)?,
    };

    terminal::print_line(text.trim_end())?;
    Ok(ExitCode::SUCCESS)
}

/// The tree of the emotions that the robots can have.
fn taxonomy(args: &EmotionsArgs) -> Result<String> {
    let file = launch::scenario_file(&args.scenario)?;
    let scenario = Scenario::load(&file, &Changes::default())?;

    let mut whose = Vec::new();
    match &args.robot {
        Some(robot) => {
            let found = scenario
                .robots
                .iter()
                .find(|(name, _)| name.as_str() == robot);
            let class = found.map_or(robot.as_str(), |(_, spec)| spec.class.as_str());
            if !robots::AFFECTIVE.contains(&class) {
                return Err(unknown_robot(robot, class, &scenario));
            }
            whose.push(robot.clone());
        }
        None => {
            for (name, spec) in &scenario.robots {
                if robots::AFFECTIVE.contains(&spec.class.as_str()) {
                    whose.push(name.to_string());
                }
            }
        }
    }
    if whose.is_empty() {
        return Err(refusal!(
            help = "what robots of your own feel is known in a recorded run: cars emotions --at latest@100",
            "no robot of {} is of a class with emotions that comes with the programs",
            args.scenario.display()
        ));
    }

    let mut text = format!(
        "Affective states of {}\n[D] documented, [I] chosen here: docs/affect.md\n",
        whose.join(", ")
    );
    let schemata = Schemata::standard();
    for (depth, node) in schemata.tree() {
        text += &describe(schemata, depth, node);
    }
    Ok(text)
}

fn unknown_robot(robot: &str, class: &str, scenario: &Scenario) -> Box<dyn Error + Send + Sync> {
    let names: Vec<&str> = scenario.robots.keys().map(RobotName::as_str).collect();
    if robot == class {
        refusal!(
            help =
                "--scenario names the scenario of a robot, and --at a run in which it was recorded",
            "{robot} is neither a robot of the scenario ({}) nor a class with emotions that comes with the programs ({})",
            names.join(", "),
            robots::AFFECTIVE.join(", ")
        )
    } else {
        refusal!(
            help = format!("cars emotions {robot} --at latest@100 shows what it has published"),
            "{robot} is of the class {class}, whose emotions are known only when it runs"
        )
    }
}

/// A node: its level, what it states with marks, and what it inherits.
fn describe(schemata: &Schemata, depth: usize, node: &Node) -> String {
    let indent = "  ".repeat(depth);
    let mark = |key: &str| node.marks.get(key).map_or("", String::as_str);
    let mut text = format!("\n{indent}{} ({})\n", node.name, node.level.name());
    if let Some(parent) = &node.parent {
        let parent = format!("{parent} {}", mark("parent"));
        text += &line(&format!("{indent}  "), "parent", parent.trim_end());
    }

    let own = node.own.entries();
    for (key, value) in &own {
        let value = format!("{value} {}", mark(key));
        text += &line(&format!("{indent}  "), key, value.trim_end());
    }

    let mut inherited: Vec<(&str, Vec<String>)> = Vec::new();
    for (key, value) in node.all.entries() {
        let origin = schemata
            .origin(node, key)
            .map(|origin| origin.name.as_str());
        let Some(origin) = origin.filter(|origin| *origin != node.name) else {
            continue;
        };
        let value = match key {
            "measured" => "what is measured".to_owned(),
            _ => format!("{key} {value}"),
        };
        match inherited.iter_mut().find(|(name, _)| *name == origin) {
            Some((_, values)) => values.push(value),
            None => inherited.push((origin, vec![value])),
        }
    }
    for (origin, values) in inherited {
        let values = values.join(", ");
        text += &line(&format!("{indent}  "), &format!("from {origin}"), &values);
    }

    text
}

/// A name and a value, wrapped.
fn line(indent: &str, name: &str, value: &str) -> String {
    let column = indent.len() + NAMES;
    let mut text = format!("{indent}{name:<NAMES$}");
    let mut at = text.chars().count();
    if at > column {
        text.push(' ');
        at += 1;
    }

    let mut is_first = true;
    for word in value.split_whitespace() {
        let length = word.chars().count();
        if !is_first && at + 1 + length > WIDTH {
            text += &format!("\n{}", " ".repeat(column));
            at = column;
        } else if !is_first {
            text.push(' ');
            at += 1;
        }
        text += word;
        at += length;
        is_first = false;
    }
    text.push('\n');
    text
}

/// What robots of a run feel in a tick.
fn moment(args: &EmotionsArgs, at: &TickOfRun) -> Result<String> {
    let folder = find(&args.out, &at.run)?;
    let files = recorded_epoch(&folder, args.epoch)?;
    let run = run_name(&folder.resolved()?);
    let recording = recording(&files)?;
    let tick_s = recording.header().tick_s;
    let tick = at.moment.tick(tick_s);

    let recorded = recording.read(tick, tick + 1)?;
    let Some(recorded) = recorded
        .into_iter()
        .find(|recorded| recorded.tick() == tick)
    else {
        return Err(refusal!(
            help = format!("name an earlier tick, or a time such as {run}@31s"),
            "the recording of {run} has no tick {tick}: its last one is {}",
            recording.len().saturating_sub(1)
        ));
    };
    if let Some(robot) = &args.robot
        && !recorded.reports.keys().any(|name| name.as_str() == robot)
    {
        let names: Vec<&str> = recorded.reports.keys().map(RobotName::as_str).collect();
        return Err(refusal!(
            help = "name one of these, or none for all",
            "no robot called {robot} reported in tick {tick} of {run}; {} did",
            names.join(", ")
        ));
    }

    let mut text = String::new();
    for (robot, report) in &recorded.reports {
        if args
            .robot
            .as_deref()
            .is_none_or(|one| one == robot.as_str())
        {
            text += &felt(&run, tick, tick_s, robot, report);
        }
    }
    Ok(text)
}

/// A robot's place in the tree, and the components of its emotion.
fn felt(run: &RunName, tick: Tick, tick_s: f64, robot: &RobotName, report: &Report) -> String {
    let emotion = &report.emotion_state;
    let time = seconds(tick as f64 * tick_s, tick_s);
    let mut text = format!("{robot} at {time} s (tick {tick}) of {run}\n\n");
    let variables = &report.state_variables;
    let Some(valence) = variables.get(VALENCE).and_then(Variable::as_f64) else {
        return text + &format!("{emotion:?}: it publishes no components of an emotion.\n\n");
    };

    text += &place(emotion, valence);
    if let Some(mood) = variables.get(MOOD).and_then(Variable::as_f64) {
        text += &place_of_mood(mood, valence);
    }
    text.push('\n');
    text += &components(variables);
    text.push('\n');
    text
}

/// The general nodes of the tree, and below them the emotions of this kind, with a mark at the present one.
fn place(emotion: &str, valence: f64) -> String {
    let schemata = Schemata::standard();
    let general = if valence < 0.0 { NEGATIVE } else { POSITIVE };
    let known = schemata.node(emotion);
    let parent = known
        .and_then(|node| node.parent.as_deref())
        .unwrap_or(general);

    let mut text = String::new();
    for (depth, node) in schemata.path(parent).into_iter().enumerate() {
        text += &format!("  {}{}\n", "  ".repeat(depth), node.name);
    }
    let depth = schemata.path(parent).len();
    let mut names: Vec<&str> = schemata
        .below(Some(parent))
        .map(|node| node.name.as_str())
        .collect();
    if known.is_none() {
        names.push(emotion);
    }
    for name in names {
        let mark = if name == emotion { "> " } else { "  " };
        text += &format!("{mark}{}{name}\n", "  ".repeat(depth));
    }
    text
}

/// The node of a mood in the tree, with a mark, below the one of its valence, which is there already if the emotion has the same
/// one; empty for a mood of 0, which is neither.
fn place_of_mood(mood: f64, valence: f64) -> String {
    let name = match mood {
        _ if mood < 0.0 => "negative mood",
        _ if mood > 0.0 => "positive mood",
        _ => return String::new(),
    };
    let path = Schemata::standard().path(name);
    let shown = if (mood < 0.0) == (valence < 0.0) {
        2
    } else {
        1
    };

    let mut text = String::new();
    for (depth, node) in path.iter().enumerate().skip(shown) {
        let mark = if node.name == name { "> " } else { "  " };
        text += &format!("{mark}{}{}\n", "  ".repeat(depth), node.name);
    }
    text
}

/// Each component with its word and what it means.
fn components(variables: &StateVariables) -> String {
    let mut text = String::new();
    for meaning in MEANINGS {
        let Some(value) = variables.get(meaning.variable) else {
            continue;
        };
        if meaning.variable == CAUSAL_CHAIN {
            continue;
        }

        let value = match value {
            Variable::Number(number) => {
                let word = word(meaning.variable, *number, &IntensityLabel::CUTS);
                let word = word.map(|word| format!(", {word}")).unwrap_or_default();
                let decimals = if number.abs() < 0.005 { 4 } else { 2 };
                format!("{number:.decimals$}{word}")
            }
            other => protocol::plain::escape_line(&other.to_string()),
        };
        text += &line(
            "  ",
            meaning.variable,
            &format!("{value}: {}", meaning.meaning),
        );
    }

    for (variable, meaning) in BELIEFS {
        if let Some(value) = variables.get(variable).and_then(Variable::as_str) {
            let value = protocol::plain::escape_line(value);
            text += &line("  ", variable, &format!("{value}: {meaning}"));
        }
    }

    let chain = variables.get(CAUSAL_CHAIN).and_then(Variable::as_str);
    if let Some(chain) = chain.and_then(CausalChain::read) {
        text += "\n  why\n";
        for clause in chain.clauses() {
            text += &line(
                "  ",
                clause.kind.name(),
                &protocol::plain::escape_line(&clause.text),
            );
        }
    }
    text
}
