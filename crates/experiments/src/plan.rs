//! The plan of an experiment: its units, in one fixed order, each with an identity that depends on nothing else in the file.
//!
//! A plan is one file with all that its units need, so that a process on another machine plays them from it alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use config::{Changes, FileError, Override, Source};
use lab::LabError;
use protocol::RobotName;
use record::folder::check_no_links;
use scenario::Scenario;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use super::case::Case;
use super::condition::{Condition, OWN_OPTIONS};
use super::file::{Arm, Experiment};
use super::own::{ByClass, OwnRobots, RobotSource};
use super::script;
use super::setting::Setting;
use crate::shell;
use export::draft::{self, unwritable};

/// The plan in the folder of an experiment.
pub const PLAN: &str = "plan.json";
/// The experiment file as it was planned, for people.
pub(super) const FILE: &str = "experiment.toml";
/// Folder of the files with the units that have been played.
pub(super) const UNITS: &str = "units";
/// How the name of a file with units ends.
pub(super) const UNITS_ENDING: &str = ".jsonl";
/// Largest program of a launch file that is a part of the identity of a unit.
const MAX_PROGRAM_BYTES: u64 = 256 << 20;
/// How units are measured. It is a part of the identity of a unit, so units that were measured otherwise are played again.
const MEASURING: u32 = 2;

/// An experiment and what its options change.
#[derive(Debug, Clone)]
pub struct Request {
    /// Name of the experiment.
    pub name: String,
    /// The experiment, with the scenario, the duration and the seeds of its options.
    pub experiment: Experiment,
    /// Further changes of the scenario in every arm.
    pub set: Vec<Override>,
    /// How its units are played.
    pub robots: Robots,
    /// Robots of the caller's own, where they play in this process.
    pub own: Option<OwnRobots>,
}

/// How the robots of a unit run. The run is the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Robots {
    /// In the process that plays the unit.
    InProcess,
    /// As processes of their own: the programs of the project, by their classes.
    Programs,
    /// As the processes of a launch file.
    Launched(LaunchText),
}

/// The units of an experiment.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The experiment, with the duration and the seeds of its options.
    pub experiment: Experiment,
    conditions: Vec<Condition>,
    written: WrittenPlan,
    cells: Vec<PlannedCell>,
    /// What makes robots of the caller's own; a plan that was read from a file has none.
    own: Option<Arc<dyn RobotSource>>,
}

/// `plan.json`: the plan, and a digest of it. A plan that is not as it was written would play one thing under the name of another.
#[derive(Debug, Serialize, Deserialize)]
struct Sealed {
    #[serde(flatten)]
    plan: WrittenPlan,
    seal: String,
}

/// A plan, as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct WrittenPlan {
    name: String,
    program: ProgramVersion,
    units: usize,
    duration_s: f64,
    seeds: Vec<u64>,
    set: Vec<String>,
    /// Digest of what is measured.
    measures: String,
    /// Text of the experiment file.
    file: String,
    /// Where the experiment file was: another one may have its name.
    #[serde(default)]
    origin: Option<String>,
    robots: Robots,
    /// Digests of robots of the caller's own, by their names or patterns.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    own_robots: BTreeMap<String, String>,
    /// Conditions and arms in the order of the units: the units of a cell are its seeds.
    cells: Vec<WrittenCell>,
}

/// An arm under a condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct WrittenCell {
    condition: String,
    arm: String,
    /// The scenario with all changes, without a seed.
    scenario: String,
}

/// A launch file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LaunchText {
    /// Its folder, where its relative paths begin.
    pub folder: PathBuf,
    /// Its text.
    pub text: String,
    /// Digests of the files that its commands name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
}

/// The program that plays the units: another one may give other runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProgramVersion {
    /// Its version.
    pub version: String,
    /// The commit that it was built from, if it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub commit: Option<String>,
}

/// An arm under a condition, as it is played.
#[derive(Debug, Clone)]
struct PlannedCell {
    /// Digest of all that its units have in common.
    content: u128,
    /// The cell whose emotions its robots show.
    yoked_to: Option<usize>,
    /// Its scenario with the seed of the first unit that was played.
    scenario: OnceLock<Scenario>,
}

/// The identity of a unit: units of one key are the same run and are measured alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key(u128);

/// One run of an experiment.
#[derive(Debug, Clone, Copy)]
pub struct Unit<'a> {
    /// Its number in the plan, from 0.
    pub number: usize,
    /// Its identity.
    pub key: Key,
    /// Its condition.
    pub condition: &'a Condition,
    /// Its arm.
    pub arm: &'a Arm,
    /// Its seed.
    pub seed: u64,
    /// The cell and the seed of the run whose emotions its robots show.
    pub(super) yoke: Option<(usize, u64)>,
    pub(super) cell: usize,
}

impl WrittenPlan {
    /// Whether another plan is the same, wherever its experiment file was.
    fn is_same(&self, other: &Self) -> bool {
        let other = Self {
            origin: self.origin.clone(),
            ..other.clone()
        };
        *self == other
    }

    /// Checks that a new plan is one of the same experiment file: the file may have been edited, or moved, but not both.
    fn check_same_file(&self, new: &Self, folder: &Path) -> Result<(), LabError> {
        let (Some(before), Some(now)) = (&self.origin, &new.origin) else {
            return Ok(());
        };
        let has_same_content =
            self.file == new.file && self.measures == new.measures && self.cells == new.cells;
        if before == now || has_same_content {
            return Ok(());
        }
        Err(LabError::refused(format!(
            "{} is the folder of another experiment, that of {before}",
            folder.display()
        ))
        .with_help("choose another folder with -o"))
    }
}

/// The absolute path of an experiment file.
fn origin_of(source: &Source) -> Option<String> {
    let path = std::path::absolute(&source.name).ok()?;
    Some(path.display().to_string())
}

impl ProgramVersion {
    /// This program.
    #[must_use]
    pub fn this() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: option_env!("CARS_COMMIT").map(str::to_owned),
        }
    }
}

impl std::fmt::Display for ProgramVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.commit {
            Some(commit) => write!(f, "{} ({commit})", self.version),
            None => f.write_str(&self.version),
        }
    }
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl std::str::FromStr for Key {
    type Err = std::num::ParseIntError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        u128::from_str_radix(text, 16).map(Self)
    }
}

impl Unit<'_> {
    /// The seed of the run whose emotions its robots show.
    #[must_use]
    pub fn yoked_to_seed(&self) -> Option<u64> {
        self.yoke.map(|(_, seed)| seed)
    }

    /// Names the unit for people.
    #[must_use]
    pub fn describe(&self) -> String {
        format!(
            "unit {} (condition \"{}\", arm \"{}\", seed {})",
            self.number, self.condition.name, self.arm.name, self.seed
        )
    }
}

impl Plan {
    /// Plans an experiment.
    ///
    /// # Errors
    /// If a condition cannot be played, two of the changes set the same value, or a scenario cannot be used.
    pub fn new(request: &Request) -> Result<Self, LabError> {
        let mut experiment = request.experiment.clone();
        check_own_options(&request.set)?;
        let conditions = list_conditions(&experiment)?;

        let mut cells = Vec::new();
        for condition in &conditions {
            for arm in &experiment.arms {
                cells.push(WrittenCell {
                    condition: condition.name.clone(),
                    arm: arm.name.clone(),
                    scenario: scenario_of(request, condition, arm)?,
                });
            }
        }

        take_measures(&mut experiment, &cells)?;

        let mut set = Vec::new();
        for change in &request.set {
            set.push(change.to_string());
        }
        let units = cells.len() * experiment.seeds.len();
        experiment.report.check_units(experiment.source(), units)?;
        let written = WrittenPlan {
            name: request.name.clone(),
            program: ProgramVersion::this(),
            units,
            duration_s: experiment.duration_s,
            seeds: experiment.seeds.clone(),
            set,
            measures: digest_of_measures(&experiment),
            file: experiment.source().text.clone(),
            origin: origin_of(experiment.source()),
            robots: request.robots.clone(),
            own_robots: request
                .own
                .as_ref()
                .map_or_else(BTreeMap::new, |own| own.digests.clone()),
            cells,
        };
        let mut plan = Self::of(written, experiment)?;
        plan.own = request.own.as_ref().map(|own| own.source.clone());
        Ok(plan)
    }

    /// Reads the plan in the folder of an experiment.
    ///
    /// # Errors
    /// If there is none, it cannot be read, or it was made by a program that measures otherwise.
    pub fn load(folder: &Path) -> Result<Self, LabError> {
        let Some(written) = read(folder)? else {
            let help = match has_units(folder) {
                true => again(folder),
                false => "make one with `cars experiment run`".to_owned(),
            };
            return Err(LabError::record(format!(
                "{} is not the folder of an experiment: it has no {PLAN}",
                folder.display()
            ))
            .with_help(help));
        };

        let path = folder.join(PLAN);
        let source = Source {
            name: path.display().to_string(),
            text: written.file.clone(),
        };
        let mut experiment = Experiment::parse(&source, Path::new(""))?;
        experiment.duration_s = written.duration_s;
        experiment.seeds.clone_from(&written.seeds);
        take_measures(&mut experiment, &written.cells)
            .and_then(|()| Self::of(written, experiment))
            .map_err(|error| LabError::record(format!("{}: {error}", path.display())))
    }

    fn of(written: WrittenPlan, experiment: Experiment) -> Result<Self, LabError> {
        let conditions = list_conditions(&experiment)?;
        let arms = &experiment.arms;
        let are_all_there = written.cells.len() == conditions.len() * arms.len();
        if !are_all_there || written.units != written.cells.len() * written.seeds.len() {
            return Err(LabError::record("the plan is not that of its experiment"));
        }

        let mut cells = Vec::new();
        for (index, cell) in written.cells.iter().enumerate() {
            let condition = &conditions[index / arms.len()];
            let arm = &arms[index % arms.len()];
            if cell.condition != condition.name || cell.arm != arm.name {
                return Err(LabError::record("the plan is not that of its experiment"));
            }

            let mut content = Xxh3::new();
            add_text(&mut content, &written.program.to_string());
            add_text(&mut content, &written.measures);
            add_text(&mut content, &format!("{:?}", condition.time_s));
            add_text(&mut content, &cell.scenario);
            if let Robots::Launched(launch) = &written.robots {
                add_text(&mut content, &launch.text);
                for (file, digest) in &launch.files {
                    add_text(&mut content, file);
                    add_text(&mut content, digest);
                }
            }
            for (robots, digest) in &written.own_robots {
                add_text(&mut content, robots);
                add_text(&mut content, digest);
            }
            let mut yoked_to = None;
            if let Some(other) = &arm.yoked_to {
                let arm = arms.iter().position(|arm| arm.name == *other);
                let arm = arm.ok_or_else(|| LabError::record("the arm of the yoke is missing"))?;
                let other = index / arms.len() * arms.len() + arm;
                add_text(&mut content, &written.cells[other].scenario);
                yoked_to = Some(other);
            }
            cells.push(PlannedCell {
                content: content.digest128(),
                yoked_to,
                scenario: OnceLock::new(),
            });
        }
        Ok(Self {
            experiment,
            conditions,
            written,
            cells,
            own: None,
        })
    }

    /// Checks that this program plays its units as the one that made the plan.
    ///
    /// # Errors
    /// If it is another program.
    pub fn check_program(&self) -> Result<(), LabError> {
        let this = ProgramVersion::this();
        if this != self.written.program {
            return Err(LabError::refused(format!(
                "the experiment was planned by cars {}, and this is cars {this}",
                self.written.program
            ))
            .with_help("plan it again with `cars experiment run`"));
        }
        Ok(())
    }

    /// Writes the plan into the folder of the experiment, which is made if it does not exist.
    ///
    /// # Errors
    /// If the folder has other content, or a file cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), LabError> {
        if !folder.join(PLAN).exists() && has_files(folder) && !has_units(folder) {
            return Err(LabError::refused(format!(
                "{} is there and is not the folder of an experiment",
                folder.display()
            ))
            .with_help("choose another folder with -o, or move it away"));
        }

        check_no_links(folder)?;
        // One that cannot be read is made again.
        if let Ok(Some(before)) = read(folder) {
            before.check_same_file(&self.written, folder)?;
        }

        std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
        let sealed = Sealed {
            plan: self.written.clone(),
            seal: self.written.seal()?,
        };
        let mut text = serde_json::to_string_pretty(&sealed).map_err(LabError::failed)?;
        text.push('\n');
        draft::write(&folder.join(PLAN), &text)?;
        draft::write(&folder.join(FILE), &self.written.file)?;
        Ok(())
    }

    /// Whether the plan in the folder is this one.
    ///
    /// # Errors
    /// If the plan that is there cannot be read.
    pub fn is_in(&self, folder: &Path) -> Result<bool, LabError> {
        Ok(read(folder)?.is_some_and(|there| there.is_same(&self.written)))
    }

    /// The arms that play the same runs under every condition, by two: a comparison of them shows nothing.
    #[must_use]
    pub fn equal_arms(&self) -> Vec<(&str, &str)> {
        let arms = &self.experiment.arms;
        let mut equal = Vec::new();
        for (place, arm) in arms.iter().enumerate() {
            let same = (0..place).find(|other| {
                let mut cells = (0..self.conditions.len()).map(|number| number * arms.len());
                cells.all(|first| {
                    self.cells[first + place].content == self.cells[first + other].content
                })
            });
            equal.extend(same.map(|other| (arms[other].name.as_str(), arm.name.as_str())));
        }
        equal
    }

    /// What of the plan that was in the folder before has changed, so that its units are played again, or cannot be read: a
    /// sentence each.
    #[must_use]
    pub fn changes_since(&self, folder: &Path) -> Vec<String> {
        let before = match read(folder) {
            Ok(Some(before)) => before,
            Ok(None) if has_units(folder) => {
                return vec![format!(
                    "{} has units and no {PLAN}: it is made again",
                    folder.display()
                )];
            }
            Ok(None) => return Vec::new(),
            Err(reason) => return vec![format!("{reason}: it is made again")],
        };

        let now = &self.written;
        let mut changes = Vec::new();
        if before.program != now.program {
            changes.push(format!(
                "the program is {} and was {}: every unit is another one",
                now.program, before.program
            ));
        }
        if before.measures != now.measures {
            changes.push("the measures have changed: every unit is another one".to_owned());
        }
        let files = |plan: &WrittenPlan| match &plan.robots {
            Robots::Launched(launch) => Some(launch.files.clone()),
            Robots::InProcess | Robots::Programs => None,
        };
        let have_changed = match (files(&before), files(now)) {
            (Some(before), Some(now)) => before != now,
            _ => false,
        };
        if before.own_robots != now.own_robots || have_changed {
            changes.push("the robots have changed: every unit is another one".to_owned());
        }
        let mut changed = Vec::new();
        for cell in &now.cells {
            let mut others = before.cells.iter();
            let other =
                others.find(|other| other.condition == cell.condition && other.arm == cell.arm);
            if other.is_some_and(|other| other.scenario != cell.scenario) {
                changed.push(cell);
            }
        }
        if let Some((first, others)) = changed.split_first() {
            changes.push(format!(
                "the scenario of the arm \"{}\" under the condition \"{}\" has changed, and that of {} others",
                first.arm,
                first.condition,
                others.len()
            ));
        }
        changes
    }

    /// Name of the experiment.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.written.name
    }

    /// The program that plays the units.
    #[must_use]
    pub fn program(&self) -> &ProgramVersion {
        &self.written.program
    }

    /// How the robots of its units run.
    #[must_use]
    pub fn robots(&self) -> &Robots {
        &self.written.robots
    }

    /// The names or patterns of the robots that only the program that has planned the experiment can make.
    #[must_use]
    pub fn own_robots(&self) -> Vec<&str> {
        self.written.own_robots.keys().map(String::as_str).collect()
    }

    /// Checks that robots of the caller's own can be made.
    ///
    /// # Errors
    /// If another program has planned the experiment, with robots that this one does not know.
    pub fn check_own_robots(&self) -> Result<(), LabError> {
        let own = self.own_robots();
        if own.is_empty() || self.own.is_some() {
            return Ok(());
        }
        Err(LabError::refused(format!(
            "this experiment has robots of a program of its own: {}",
            own.join(", ")
        ))
        .with_help("play it as it was planned: `cars.experiment(FILE, robots={…})` in Python"))
    }

    /// The robots of all its scenarios.
    ///
    /// # Errors
    /// If a scenario cannot be used.
    pub fn roster(&self) -> Result<BTreeSet<RobotName>, FileError> {
        let mut roster = BTreeSet::new();
        for cell in 0..self.cells.len() {
            let scenario = self.scenario(cell, self.unit(0).seed, Vec::new())?;
            roster.extend(scenario.robots.into_keys());
        }
        Ok(roster)
    }

    /// What makes the robots that play in this process.
    pub(super) fn robot_source(&self) -> Arc<dyn RobotSource> {
        self.own.clone().unwrap_or_else(ByClass::of_project)
    }

    /// The conditions, in the order of the units.
    #[must_use]
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Number of units.
    #[must_use]
    pub fn units(&self) -> usize {
        self.written.units
    }

    /// A unit by its number, which must be less than [`Self::units`].
    #[must_use]
    pub fn unit(&self, number: usize) -> Unit<'_> {
        let seeds = &self.written.seeds;
        let arms = &self.experiment.arms;
        let cell = number / seeds.len();
        let place = number % seeds.len();
        let seed = seeds[place];
        let mut key = Xxh3::new();
        key.update(&self.cells[cell].content.to_le_bytes());
        key.update(&seed.to_le_bytes());

        let mut yoke = None;
        if let Some(other) = self.cells[cell].yoked_to {
            let next = seeds[(place + 1) % seeds.len()];
            key.update(&next.to_le_bytes());
            yoke = Some((other, next));
        }
        Unit {
            number,
            key: Key(key.digest128()),
            condition: &self.conditions[cell / arms.len()],
            arm: &arms[cell % arms.len()],
            seed,
            yoke,
            cell,
        }
    }

    /// Describes the runs, the arms and the conditions, for people.
    #[must_use]
    pub fn compared(&self) -> String {
        let experiment = &self.experiment;
        let file = experiment.scenario.file_name().unwrap_or_default();
        let mut text = format!(
            "{}: {} runs of {} s for each line, {}. Runs with the same seed begin alike\n\
             and have the same chance in every arm. {}\n\
             Mean and 95 % confidence interval over the seeds.\n\n",
            file.display(),
            experiment.seeds.len(),
            experiment.duration_s,
            describe_seeds(&experiment.seeds),
            experiment.explained(),
        );

        let mut named = Vec::new();
        for arm in &experiment.arms {
            named.push((&arm.name, &arm.what));
        }
        for condition in &self.conditions {
            if !condition.what.is_empty() {
                named.push((&condition.name, &condition.what));
            }
        }
        let width = named.iter().map(|(name, _)| name.len()).max();
        let width = width.unwrap_or_default();
        for (name, what) in named {
            text += &format!("  {name:<width$}  {what}\n");
        }

        for measure in &experiment.measures {
            if let Some(meaning) = measure.explained() {
                text += &format!("\n{meaning}\n");
            }
        }
        text
    }

    /// An arm under a condition.
    ///
    /// # Errors
    /// If its changes cannot be written into a scenario.
    pub(super) fn case(&self, cell: usize) -> Result<Case<'_>, LabError> {
        let mut options = Vec::new();
        for change in &self.written.set {
            let change = change.parse::<Override>();
            options.push(change.map_err(LabError::refused)?);
        }

        let arms = &self.experiment.arms;
        let condition = &self.conditions[cell / arms.len()];
        Case::new(
            &self.experiment,
            &options,
            condition,
            &arms[cell % arms.len()],
        )
    }

    /// The scenario of a cell with a seed and further changes.
    ///
    /// # Errors
    /// If the scenario cannot be used with them.
    pub(super) fn scenario(
        &self,
        cell: usize,
        seed: u64,
        set: Vec<Override>,
    ) -> Result<Scenario, FileError> {
        let known = self.cells[cell].scenario.get();
        if let Some(known) = known.filter(|_| set.is_empty()) {
            return known.clone().with_seed(seed);
        }

        let written = &self.written.cells[cell];
        let source = Source {
            name: format!(
                "the scenario of the arm \"{}\" under the condition \"{}\"",
                written.arm, written.condition
            ),
            text: written.scenario.clone(),
        };
        let changes = Changes {
            seed: Some(seed),
            set,
            ..Changes::default()
        };
        let scenario = Scenario::parse(&changes.apply(&source)?, Path::new(""))?;
        if changes.set.is_empty() {
            // Two threads read the same.
            let _known = self.cells[cell].scenario.set(scenario.clone());
        }
        Ok(scenario)
    }
}

impl LaunchText {
    /// Reads a launch file.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let source = Source::read(path)?;
        // Of a bare name the parent is an empty path, which is none for the operating system.
        let file = std::path::absolute(path);
        let folder = file
            .map(|file| file.parent().unwrap_or(Path::new("/")).to_owned())
            .map_err(|error| FileError::unreadable(path, &error))?;
        let files = digests_of_commands(&source.text, &folder);
        Ok(Self {
            folder,
            text: source.text,
            files,
        })
    }
}

/// Digests of the files that the commands of a launch file name: programs with a `/`, which are in its folder, and arguments.
fn digests_of_commands(text: &str, folder: &Path) -> BTreeMap<String, String> {
    let mut digests = BTreeMap::new();
    let table: toml::Table = toml::from_str(text).unwrap_or_default();
    let processes = table.get("process").and_then(toml::Value::as_array);
    for process in processes.into_iter().flatten() {
        let command = process.get("command").and_then(toml::Value::as_array);
        for word in command
            .into_iter()
            .flatten()
            .filter_map(toml::Value::as_str)
        {
            let own = folder.join(word);
            let file = if word.contains('/') && own.is_file() {
                own
            } else {
                PathBuf::from(word)
            };
            let is_read = file
                .metadata()
                .is_ok_and(|found| found.is_file() && found.len() <= MAX_PROGRAM_BYTES);
            if is_read && let Ok(bytes) = std::fs::read(&file) {
                digests.insert(word.to_owned(), format!("{:032x}", xxh3_128(&bytes)));
            }
        }
    }
    digests
}

/// Whether a folder has files. Drafts that a killed process left, whose names begin with a point, are none.
fn has_files(folder: &Path) -> bool {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names = entries.map(|entry| entry.file_name());
    names.any(|name| !name.to_string_lossy().starts_with('.'))
}

/// Whether a folder has units that have been played. They are whole by themselves.
fn has_units(folder: &Path) -> bool {
    let entries = std::fs::read_dir(folder.join(UNITS));
    let mut names = entries
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.file_name());
    names.any(|name| name.to_string_lossy().ends_with(UNITS_ENDING))
}

/// What to do where a plan is lost or damaged.
fn again(folder: &Path) -> String {
    format!(
        "`cars experiment run FILE --out {}` with the same experiment file makes it again, and uses the units that have been played",
        shell::path(folder)
    )
}

/// Reads the plan of a folder; `None` if it has none.
fn read(folder: &Path) -> Result<Option<WrittenPlan>, LabError> {
    let path = folder.join(PLAN);
    if !path.exists() {
        return Ok(None);
    }

    let refused = |reason: &str| {
        LabError::record(format!("{} {reason}", path.display())).with_help(again(folder))
    };
    let text = std::fs::read(&path).map_err(|error| FileError::unreadable(&path, &error))?;
    let value: serde_json::Value = match serde_json::from_slice(&text) {
        Ok(value) => value,
        Err(_) if text.is_empty() => return Err(refused("is empty")),
        Err(error) => return Err(refused(&format!("is damaged: {error}"))),
    };
    if value.get("seal").is_none() {
        return Err(refused(
            "has no seal: it is damaged, or of another version of cars",
        ));
    }
    let sealed: Sealed =
        serde_json::from_value(value).map_err(|error| refused(&format!("is damaged: {error}")))?;
    if sealed.plan.seal()? != sealed.seal {
        return Err(refused("is damaged: it is not as it was written"));
    }
    Ok(Some(sealed.plan))
}

impl WrittenPlan {
    /// Digest of all that the plan has.
    fn seal(&self) -> Result<String, LabError> {
        let text = serde_json::to_vec(self).map_err(LabError::failed)?;
        let mut hash = Xxh3::new();
        hash.update(&text);
        Ok(format!("{:032x}", hash.digest128()))
    }
}

fn list_conditions(experiment: &Experiment) -> Result<Vec<Condition>, LabError> {
    let conditions = experiment.list_conditions();
    conditions.map_err(LabError::refused)
}

fn check_own_options(set: &[Override]) -> Result<(), LabError> {
    for change in set {
        let option = change.top();
        if OWN_OPTIONS.contains(&option) {
            return Err(LabError::refused(format!(
                "--set {change} would have no effect: the {option} of a run is the experiment's"
            ))
            .with_help("use --seeds and --duration"));
        }
    }
    Ok(())
}

/// The scenario of an arm under a condition, without a seed.
fn scenario_of(request: &Request, condition: &Condition, arm: &Arm) -> Result<String, LabError> {
    let experiment = &request.experiment;
    let sources = [
        ("the option --set".to_owned(), request.set.clone()),
        (format!("the arm \"{}\"", arm.name), changes_of(&arm.set)),
        (
            format!("the condition \"{}\"", condition.name),
            changes_of(&condition.set),
        ),
    ];
    check_overlaps(&sources)?;

    let case = Case::new(experiment, &request.set, condition, arm)?;
    let scenario = experiment.complete(case.scenario()?)?;

    if arm.yoked_to.is_some() {
        let mut yoke = Vec::new();
        for robot in scenario.robots.keys() {
            yoke.push(script::change(robot, "[]").map_err(LabError::refused)?);
        }
        let yoke = (format!("the yoke of \"{}\"", arm.name), yoke);
        for source in sources {
            check_overlaps(&[source, yoke.clone()])?;
        }
    }

    Ok(scenario.to_toml_without_seed()?)
}

fn changes_of(settings: &[Setting]) -> Vec<Override> {
    let mut changes = Vec::new();
    for setting in settings {
        changes.push(setting.change.clone());
    }
    changes
}

/// Checks that no two of these sources set the same value: one would silently override the other.
fn check_overlaps(sources: &[(String, Vec<Override>)]) -> Result<(), LabError> {
    for (index, (name, changes)) in sources.iter().enumerate() {
        for (other, others) in &sources[index + 1..] {
            for change in changes {
                if let Some(overridden) = others.iter().find(|own| own.overlaps(change)) {
                    return Err(LabError::refused(format!(
                        "{name} sets {change}, and {other} sets {overridden}"
                    ))
                    .with_help("an experiment sets each value in one place"));
                }
            }
        }
    }

    Ok(())
}

/// Names the seeds: the first and the last of them where they follow each other.
fn describe_seeds(seeds: &[u64]) -> String {
    let is_range = seeds.windows(2).all(|pair| pair[1] == pair[0] + 1);
    if let (true, [first, .., last]) = (is_range, seeds) {
        return format!("seeds {first} to {last}");
    }

    let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
    format!("seeds {}", seeds.join(", "))
}

/// Takes the sources of the scenario's measures, which are the same in all cells, for those that have none of their own.
fn take_measures(experiment: &mut Experiment, cells: &[WrittenCell]) -> Result<(), LabError> {
    let Some(cell) = cells.first() else {
        return Ok(());
    };
    let source = Source {
        name: "the scenario of the experiment".to_owned(),
        text: cell.scenario.clone(),
    };
    let scenario = Scenario::parse(&source, Path::new(""))?;
    Ok(experiment.take_measures(&scenario)?)
}

/// Digest of what is measured, without what is only shown.
fn digest_of_measures(experiment: &Experiment) -> String {
    let mut text = format!("{MEASURING}\n");
    for measure in &experiment.measures {
        let _infallible = writeln!(text, "{:?} {:?}", measure.name, measure.kind);
    }

    let mut hash = Xxh3::new();
    hash.update(text.as_bytes());
    format!("{:032x}", hash.digest128())
}

/// Adds a text to a digest, with its length, so that different pairs of adjacent texts have different digests.
fn add_text(hash: &mut Xxh3, text: &str) {
    hash.update(&(text.len() as u64).to_le_bytes());
    hash.update(text.as_bytes());
}
