//! A scenario file as written. Unknown keys are refused; errors show the place in the file.

mod bulk_name;
pub(super) mod change;
mod drawn;
mod drive;
mod expect;
pub(super) mod fault;
pub(super) mod folders;
mod guests;
mod layer;
pub(super) mod mood;
mod network;
mod numbers;
mod place;
mod radio_table;
mod reseed;
mod sensing;
mod site;
mod solids;
mod times;
mod tracks;
mod unplaced;
mod want;
pub(super) mod words;

use std::collections::BTreeMap;
use std::ops::Range as Span;
use std::path::PathBuf;

use config::bulk::member;
use config::overrides::merge;
use config::units::{Dimension, Length, Speed, Time, quantity};
use config::{FileError, FixedList, Source, seed, shipped};
use observe::{Expectation, RunSetting, ScenarioMeasure, TickCondition};
use protocol::messages::{DisplayUnit, OnLate, Parameters};
use protocol::{RobotName, Tick};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use bulk_name::BulkName;
use change::{ChangeTable, ParentTable};
use drawn::DrawnTable;
use drive::DriveTable;
use fault::FaultTable;
use folders::Folders;
use guests::{GuestsTable, RecordSetting};
use layer::LayerTable;
use network::NetworkTable;
use numbers::positive;
use place::StartPlace;
use reseed::ReseedTable;
use sensing::SensingTable;
use site::SiteTable;
use solids::{Fixed, FloorPlanTable, ObstacleTable, Size, WallTable};
use times::Times;
use tracks::TracksTable;
use unplaced::unplaced;
use want::WantSetting;

pub(super) use expect::Expectations;

use super::change::Parent;
use super::checked::{self, DEFAULT_SEED, RecordContents, RobotSpec, inradii_m, to_wire, to_world};
use super::guests::GuestMotion;
use super::lateness::Lateness;
use super::network::Radio;
use super::placing::{self, PlacingCause, PlacingError};
use super::sites::start_states;

/// Most ticks of a scenario.
const MAX_TICKS: f64 = 1e9;
/// Longest run, simulated seconds: a recording counts nanoseconds in 64 bits.
const MAX_DURATION_S: f64 = 18_446_744_073.0;
/// Most robots of a scenario.
const MAX_ROBOTS: usize = 1024;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScenarioFile {
    seed: Option<Spanned<u64>>,
    tick: Option<Spanned<Time>>,
    duration: Option<Spanned<Time>>,
    on_late: Option<OnLate>,
    deadline: Option<Spanned<Time>>,
    lose_after: Option<Spanned<u32>>,
    field: Option<Spanned<FieldTable>>,
    sensing: Option<SensingTable>,
    guests: Option<Spanned<GuestsTable>>,
    network: Option<Spanned<NetworkTable>>,
    record: Option<RecordTable>,
    #[serde(default, rename = "fault", skip_serializing_if = "Vec::is_empty")]
    faults: Vec<Spanned<FaultTable>>,
    #[serde(default, rename = "change", skip_serializing_if = "Vec::is_empty")]
    changes: Vec<Spanned<ChangeTable>>,
    #[serde(default, rename = "expect", skip_serializing_if = "Vec::is_empty")]
    expectations: Vec<Spanned<Expectation>>,
    #[serde(default, rename = "measure", skip_serializing_if = "Vec::is_empty")]
    measures: Vec<Spanned<ScenarioMeasure>>,
    end_when: Option<Spanned<TickCondition>>,
    parent: Option<ParentTable>,
    #[serde(default, rename = "reseed", skip_serializing_if = "Vec::is_empty")]
    reseeds: Vec<Spanned<ReseedTable>>,
    drawn: Option<Spanned<DrawnTable>>,
    #[serde(default, rename = "obstacle", skip_serializing_if = "Vec::is_empty")]
    obstacles: Vec<ObstacleTable>,
    #[serde(default, rename = "site", skip_serializing_if = "Vec::is_empty")]
    sites: Vec<Spanned<SiteTable>>,
    #[serde(default, rename = "layer", skip_serializing_if = "Vec::is_empty")]
    layers: Vec<Spanned<LayerTable>>,
    #[serde(default, rename = "wall", skip_serializing_if = "Vec::is_empty")]
    walls: Vec<WallTable>,
    floor_plan: Option<Spanned<FloorPlanTable>>,
    #[serde(default, rename = "robot", skip_serializing_if = "Vec::is_empty")]
    robots: Vec<Spanned<RawRobot>>,
    tracks: Option<Spanned<TracksTable>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct FieldTable {
    size: Option<FixedList<Length, 2>>,
    body: Option<Length>,
    display_unit: Option<DisplayUnit>,
    max_speed: Option<Speed>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RecordTable {
    log: Option<bool>,
    log_name: Option<Spanned<String>>,
    frames: Option<bool>,
    panels: Option<bool>,
    sync: Option<checked::SyncPoint>,
}

#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    name: BulkName,
    /// So many robots, whose names are this one and a number.
    count: Option<usize>,
    class: Option<String>,
    at: StartPlace,
    size: Option<Spanned<Size>>,
    radius: Option<Spanned<Length>>,
    drive: Option<DriveTable>,
    on_late: Option<OnLate>,
    params_from: Option<Spanned<PathBuf>>,
    #[serde(default)]
    params: toml::Table,
}

/// Length of a tick [I].
const TICK: Time = Time(0.5);
/// Duration of a run [I].
const DURATION: Time = Time(600.0);
/// Side of every body, 2 ft [D: paper, "Obstacles"].
const BODY: Length = Length(0.6096);
/// Size of the field, 50 ft by 50 ft [D: paper, "Experimental Results"].
const FIELD: FixedList<Length, 2> = FixedList([Length(15.24), Length(15.24)]);
/// Highest speed, 10 ft/s [I]. The fastest shipped robot drives at 4.5 ft/s.
const MAX_SPEED: Speed = Speed(3.048);
/// Time without a report after which a robot is late, seconds of wall clock [I].
const DEADLINE: Time = Time(2.0);
/// Consecutive missed ticks after which a robot is lost [I].
const LOSE_AFTER: u32 = 10;

impl ScenarioFile {
    pub(super) fn to_toml(&self) -> Result<String, FileError> {
        toml::to_string(self).map_err(|error| FileError::new(error.to_string()))
    }

    /// Takes out the seed, and what follows from it.
    pub(super) fn without_seed(mut self) -> Self {
        self.seed = None;
        self.drawn = None;
        for robot in &mut self.robots {
            robot.as_mut().at.forget();
        }
        for site in &mut self.sites {
            site.as_mut().forget_place();
        }
        for layer in &mut self.layers {
            layer.as_mut().forget_places();
        }
        for obstacle in &mut self.obstacles {
            obstacle.forget();
        }
        self
    }

    /// Checks the scenario and fills in defaults. Without folders, which is for untrusted texts, it must not name files.
    pub(super) fn check(
        self,
        source: &Source,
        folders: Option<Folders<'_>>,
    ) -> Result<checked::Scenario, FileError> {
        self.check_from(source, folders, 0)
    }

    /// Remarks about a scenario that can be used: times that are rounded, and what never begins.
    pub(super) fn remarks(&self, source: &Source) -> Result<Vec<FileError>, FileError> {
        let tick_s = self.tick_s(source)?;
        let mut times = Times::new(source, tick_s, self.ticks(source, tick_s)?);

        if let Some(duration) = &self.duration {
            times.duration(duration);
        }
        for fault in &self.faults {
            fault.get_ref().remark(&mut times);
        }
        if let Some(network) = &self.network {
            network.get_ref().remark(&mut times);
        }
        for change in &self.changes {
            change.get_ref().remark(&mut times);
        }
        for reseed in &self.reseeds {
            reseed.get_ref().remark(&mut times);
        }
        Ok(times.remarks)
    }

    /// Checks the scenario of a run in which tick `settled` is the next one: what was checked before the run began is not
    /// checked again.
    pub(super) fn check_from(
        mut self,
        source: &Source,
        folders: Option<Folders<'_>>,
        settled: Tick,
    ) -> Result<checked::Scenario, FileError> {
        self.robots = single_robots(self.robots, source)?;
        let seed = self.seed(source)?;
        let tick_s = self.tick_s(source)?;
        let ticks = self.ticks(source, tick_s)?;
        let lateness = self.lateness(source)?;
        let sensing = sensing::check(self.sensing.as_ref(), source)?;
        let guests = self.guests.as_ref().map(Spanned::get_ref);
        let guest_rules = guests::rules(guests, tick_s, source)?;
        let mut fixed = Fixed::read(&self.obstacles, &self.walls, source)?;
        if let Some(plan) = &self.floor_plan {
            fixed.add_plan(plan, folders.map(|folders| folders.files), source)?;
        }
        let places = FilePlaces::of(&self, &fixed);

        let field = self.field.as_ref().map(Spanned::get_ref);
        let size = field.and_then(|field| field.size).unwrap_or(FIELD);
        let body = field.and_then(|field| field.body).unwrap_or(BODY);
        let [width, height] = size.0;
        let record_setting = RecordSetting {
            folders,
            tracks: self.tracks.as_ref(),
            field: world::Field {
                size_m: (width.0, height.0),
                body_m: body.0,
            },
            source,
        };
        let mut guest_motion = guests::motion(guests, record_setting)?;
        let wants = guests.map_or(&[][..], |table| &table.wants);
        let guests = guests::walks(self.guests.as_ref(), guest_motion.recorded(), source)?;
        let max_speed = field.and_then(|field| field.max_speed);
        let display_unit = field.and_then(|field| field.display_unit);

        let robots = robots(self.robots, source, folders)?;
        let (sites, site_spans) = site::check(
            self.sites,
            size.0.map(|length| length.0),
            Length(sensing.range_m),
            &robots.keys().cloned().collect(),
            source,
        )?;
        let (layers, layer_spans) = layer::check(
            &self.layers,
            layer::LayerSetting {
                field_m: size.0.map(|length| length.0),
                tick_s,
                source,
            },
        )?;
        if let GuestMotion::Crowd(guests) = &mut guest_motion {
            guests.wants = want::check(
                wants,
                &WantSetting {
                    sites: &sites,
                    robots: &robots,
                    field_m: size.0.map(|length| length.0),
                    has_requests: guest_rules.requests.is_some(),
                    tick_s,
                    source,
                },
            )?;
        }
        let record = record(self.record, source)?;
        let network = network::check(self.network, &robots, tick_s, source)?;
        let faults = fault::check(self.faults, &robots, &lateness, tick_s, settled, source)?;
        let reseeds = reseed::check(self.reseeds, &robots, tick_s, source)?;
        let setting = RunSetting {
            tick_s,
            ticks,
            field_m: size.0.map(|length| length.0),
            body_m: body.0,
            inradius_m: inradii_m(&robots),
            radio_range_m: network.radio.as_ref().and_then(Radio::reach_m),
            roster: robots.keys().cloned().collect(),
            sites: start_states(&sites),
            layers: layers.keys().cloned().collect(),
        };
        let expectations = expect::check(self.expectations, &setting, source)?;
        let measures = expect::check_measures(self.measures, &expectations, &setting, source)?;
        let end_when = expect::check_end(self.end_when, &setting, source)?;
        let mut scenario = checked::Scenario {
            seed,
            tick_s,
            ticks,
            field_m: size.0.map(|length| length.0),
            body_m: body.0,
            display_unit: display_unit.unwrap_or_default(),
            max_speed_mps: max_speed.unwrap_or(MAX_SPEED).0,
            sensing,
            guests,
            guest_motion,
            guest_rules,
            obstacles: fixed
                .obstacles
                .into_iter()
                .map(|(obstacle, _)| obstacle)
                .collect(),
            walls: fixed.walls.into_iter().map(|(wall, _)| wall).collect(),
            sites,
            layers,
            lateness,
            robots,
            network,
            faults,
            changes: Vec::new(),
            reseeds,
            expectations,
            measures,
            end_when,
            record,
            parent: self.parent.map(Parent::from),
        };

        // A hall that cannot be placed is refused before anything starts.
        let refuse = |error: PlacingError| {
            FileError::at(source, places.of_error(&error), &error.to_string())
        };
        placing::place_at_random(&mut scenario).map_err(refuse)?;
        placing::place_sites_at_random(&mut scenario).map_err(|(site, reason)| {
            FileError::at(source, site_spans.get(&site).cloned(), &reason)
        })?;
        placing::place_peaks_at_random(&mut scenario).map_err(|(layer, reason)| {
            FileError::at(source, layer_spans.get(&layer).cloned(), &reason)
        })?;
        if let Some(drawn) = &self.drawn {
            let noted = drawn.get_ref().note(&mut scenario);
            noted.map_err(|reason| FileError::at(source, Some(drawn.span()), &reason))?;
        }
        if settled == 0 {
            placing::check(&scenario).map_err(refuse)?;
        }
        scenario.changes = change::check(self.changes, &scenario, source, |changed, at| {
            changed.parse::<Self>()?.check_from(changed, folders, at)
        })?;
        Ok(scenario)
    }

    fn seed(&self, source: &Source) -> Result<u64, FileError> {
        let Some(seed) = &self.seed else {
            return Ok(DEFAULT_SEED);
        };
        seed::check(*seed.get_ref())
            .map_err(|error| FileError::at(source, Some(seed.span()), &error.to_string()))
    }

    fn tick_s(&self, source: &Source) -> Result<f64, FileError> {
        Ok(positive(source, self.tick.as_ref(), TICK, "a tick")?.0)
    }

    fn ticks(&self, source: &Source, tick_s: f64) -> Result<Tick, FileError> {
        let duration = self.duration.as_ref();
        let duration_s = positive(source, duration, DURATION, "the duration")?.0;
        let ticks = (duration_s / tick_s).round();

        let tick_span = self.tick.as_ref().map(Spanned::span);
        let span = duration.map(Spanned::span).or(tick_span);
        let refuse = |reason: &str| Err(FileError::at(source, span, reason));
        if ticks > MAX_TICKS {
            return refuse("more than a billion ticks");
        }
        if ticks < 1.0 {
            return refuse(&format!(
                "the run lasts {duration_s} s, less than a tick, which lasts {tick_s} s"
            ));
        }
        if ticks * tick_s > MAX_DURATION_S {
            return refuse(&format!(
                "a run lasts at most {MAX_DURATION_S} s: its times are recorded in nanoseconds, in 64 bits"
            ));
        }
        Ok(ticks as Tick)
    }

    fn lateness(&self, source: &Source) -> Result<Lateness, FileError> {
        let mut own = BTreeMap::new();
        for robot in &self.robots {
            let robot = robot.get_ref();
            if let Some(on_late) = robot.on_late {
                own.insert(robot.name.name.clone(), on_late);
            }
        }

        let deadline = self.deadline.as_ref();
        Ok(Lateness {
            on_late: self.on_late.unwrap_or(OnLate::Wait),
            own,
            deadline_s: positive(source, deadline, DEADLINE, "the deadline")?.0,
            lose_after: positive(source, self.lose_after.as_ref(), LOSE_AFTER, "lose_after")?,
        })
    }
}

fn record(raw: Option<RecordTable>, source: &Source) -> Result<RecordContents, FileError> {
    let default = RecordContents::default();
    let Some(raw) = raw else {
        return Ok(default);
    };

    if let Some(name) = &raw.log_name {
        crate::files::check_log_name(name.get_ref())
            .map_err(|error| FileError::at(source, Some(name.span()), &error.to_string()))?;
    }

    Ok(RecordContents {
        log: raw.log.unwrap_or(default.log),
        log_name: raw.log_name.map_or(default.log_name, Spanned::into_inner),
        frames: raw.frames.unwrap_or(default.frames),
        panels: raw.panels.unwrap_or(default.panels),
        sync: raw.sync.unwrap_or(default.sync),
    })
}

/// A table for each robot, in the place of those with a count.
fn single_robots(
    raw: Vec<Spanned<RawRobot>>,
    source: &Source,
) -> Result<Vec<Spanned<RawRobot>>, FileError> {
    let mut robots = Vec::new();
    for entry in raw {
        let span = entry.span();
        let refuse = |reason: &str| FileError::at(source, Some(span.clone()), reason);
        let written = entry.get_ref();
        let numbers = written.name.numbers(written.count).map_err(refuse)?;
        let Some(numbers) = numbers else {
            if robots.len() == MAX_ROBOTS {
                return Err(refuse(&too_many_robots()));
            }
            robots.push(entry);
            continue;
        };
        let count = numbers.clone().count();
        if count > MAX_ROBOTS - robots.len() {
            return Err(refuse(&too_many_robots()));
        }

        let table = entry.into_inner();
        let base = table.name.name.as_str();
        for (number, place) in numbers.zip(1..) {
            let name = RobotName::new(&member(base, number))
                .map_err(|error| refuse(&error.to_string()))?;
            let class = table.class.clone();
            let robot = RawRobot {
                count: None,
                class: class.or_else(|| Some(base.to_owned())),
                name: name.into(),
                at: table.at.member(place, count),
                ..table.clone()
            };
            robots.push(Spanned::new(span.clone(), robot));
        }
    }
    Ok(robots)
}

fn too_many_robots() -> String {
    format!("more than {MAX_ROBOTS} robots")
}

fn robots(
    raw: Vec<Spanned<RawRobot>>,
    source: &Source,
    folders: Option<Folders<'_>>,
) -> Result<BTreeMap<RobotName, RobotSpec>, FileError> {
    let mut robots = BTreeMap::new();
    for entry in raw {
        let span = entry.span();
        let robot = entry.into_inner();
        if robot.name.name.is_operator() {
            let reason = "the name `operator` is kept for commands from outside the roster";
            return Err(FileError::at(source, Some(span), reason));
        }

        let name = robot.name.name.clone();
        let spec = spec(robot, span.clone(), source, folders)?;
        if robots.insert(name.clone(), spec).is_some() {
            let reason = format!("a second robot called {name}");
            return Err(FileError::at(source, Some(span), &reason));
        }
    }
    Ok(robots)
}

/// The specification of a robot. Its own parameters replace those of the file that it names, key by key, also within tables.
fn spec(
    robot: RawRobot,
    span: Span<usize>,
    source: &Source,
    folders: Option<Folders<'_>>,
) -> Result<RobotSpec, FileError> {
    let mut parameters = toml::Table::new();
    if let Some(file) = &robot.params_from {
        parameters = named_parameters(file, source, folders)?;
    }
    check_units(&robot.params)
        .map_err(|reason| FileError::at(source, Some(span.clone()), &reason))?;
    merge(&mut parameters, &robot.params);
    mood::carry_over(
        &mut parameters,
        &robot.name.name,
        folders.map(|folders| folders.runs),
    )
    .map_err(|reason| FileError::at(source, Some(span), &reason))?;

    let class = robot.class;
    let (at, drawn) = robot.at.resolve();
    Ok(RobotSpec {
        class: class.unwrap_or_else(|| robot.name.name.to_string()),
        at: to_wire(at),
        drawn,
        shape: solids::shape(robot.size.as_ref(), robot.radius.as_ref(), source)?,
        wheels: drive::check(robot.drive.as_ref(), source)?,
        parameters: to_parameters(&parameters),
    })
}

/// The parameters of a file that a robot names. In a text from outside they are those of the files that come with the programs.
fn named_parameters(
    file: &Spanned<PathBuf>,
    source: &Source,
    folders: Option<Folders<'_>>,
) -> Result<toml::Table, FileError> {
    let shipped = shipped::path(shipped::SCENARIOS);
    let folder = folders.map_or(shipped.as_path(), |folders| folders.files);
    let path = folder.join(file.get_ref());
    if folders.is_none() && !shipped::contains(&path) {
        let names: Vec<_> = shipped::names(shipped::PARAMETERS).collect();
        let reason = format!(
            "`params_from` of a scenario from outside names robots/{}.toml; write other parameters out under `params`",
            names.join(".toml or robots/")
        );
        return Err(FileError::at(source, Some(file.span()), &reason));
    }

    source.check_named(file.span(), &path)?;
    let read = Source::read(&path).and_then(|file| {
        let parameters = file.parse()?;
        check_units(&parameters).map_err(|reason| FileError::at(&file, None, &reason))?;
        Ok(parameters)
    });
    read.map_err(|error| error.named_by(&source.name))
}

/// Refuses a quantity under the name of a parameter that ends in the unit of another dimension: as a number it would be taken
/// for what the name says.
fn check_units(parameters: &toml::Table) -> Result<(), String> {
    parameters
        .iter()
        .try_for_each(|(name, value)| check_unit(name, value))
}

fn check_unit(name: &str, value: &toml::Value) -> Result<(), String> {
    match value {
        toml::Value::Table(table) => check_units(table),
        toml::Value::Array(values) => values.iter().try_for_each(|value| check_unit(name, value)),
        toml::Value::String(text) => match (Dimension::of_name(name), quantity(text)) {
            (Some(named), Some((_, written))) if named != written => Err(format!(
                "the parameter `{name}` is {text:?}, but by its name it is {}",
                named.name()
            )),
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

/// Where in the file is what can keep a hall from being placed.
struct FilePlaces {
    tick: Option<Span<usize>>,
    field: Option<Span<usize>>,
    guests: Option<Span<usize>>,
    obstacles: Vec<Span<usize>>,
    walls: Vec<Span<usize>>,
    robots: BTreeMap<RobotName, Span<usize>>,
}

impl FilePlaces {
    fn of(raw: &ScenarioFile, fixed: &Fixed) -> Self {
        let obstacles = fixed.obstacles.iter();
        let walls = fixed.walls.iter();
        let robots = raw.robots.iter();
        Self {
            tick: raw.tick.as_ref().map(Spanned::span),
            field: raw.field.as_ref().map(Spanned::span),
            guests: raw.guests.as_ref().map(Spanned::span),
            obstacles: obstacles.map(|(_, span)| span.clone()).collect(),
            walls: walls.map(|(_, span)| span.clone()).collect(),
            robots: robots
                .map(|robot| (robot.get_ref().name.name.clone(), robot.span()))
                .collect(),
        }
    }

    fn of_error(&self, error: &PlacingError) -> Option<Span<usize>> {
        match error.cause() {
            PlacingCause::Tick => self.tick.clone(),
            PlacingCause::Field => self.field.clone(),
            PlacingCause::Guests => self.guests.clone(),
            PlacingCause::Obstacle(index) => self.obstacles.get(index).cloned(),
            PlacingCause::Wall(index) => self.walls.get(index).cloned(),
            PlacingCause::Robot(name) => self.robots.get(name).cloned(),
        }
    }
}

/// Parameters as JSON for the welcome of a robot. Texts that are quantities become SI numbers.
fn to_parameters(table: &toml::Table) -> Parameters {
    let entries = table.iter();
    entries
        .map(|(key, value)| (key.clone(), to_json(value)))
        .collect()
}

fn to_json(value: &toml::Value) -> serde_json::Value {
    match value {
        toml::Value::String(text) => match quantity(text) {
            Some((number, _)) => number.into(),
            None => text.clone().into(),
        },
        toml::Value::Integer(number) => (*number).into(),
        toml::Value::Float(number) => (*number).into(),
        toml::Value::Boolean(flag) => (*flag).into(),
        toml::Value::Datetime(date) => date.to_string().into(),
        toml::Value::Array(values) => values.iter().map(to_json).collect(),
        toml::Value::Table(table) => table
            .iter()
            .map(|(key, value)| (key.clone(), to_json(value)))
            .collect(),
    }
}

impl From<&checked::Scenario> for ScenarioFile {
    fn from(scenario: &checked::Scenario) -> Self {
        let tick_s = scenario.tick_s;
        let lateness = &scenario.lateness;
        let field = FieldTable {
            size: Some(FixedList(scenario.field_m.map(Length))),
            body: Some(Length(scenario.body_m)),
            display_unit: Some(scenario.display_unit),
            max_speed: Some(Speed(scenario.max_speed_mps)),
        };
        let record = RecordTable {
            log: Some(scenario.record.log),
            log_name: Some(unplaced(scenario.record.log_name.clone())),
            frames: Some(scenario.record.frames),
            panels: Some(scenario.record.panels),
            sync: Some(scenario.record.sync),
        };

        let faults = scenario.faults.iter();
        let faults = faults.map(|fault| unplaced(FaultTable::of(fault, tick_s)));
        let changes = scenario.changes.iter();
        let changes = changes.map(|change| unplaced(ChangeTable::of(change, tick_s)));
        let reseeds = scenario.reseeds.iter();
        let reseeds = reseeds.map(|reseed| unplaced(ReseedTable::of(reseed, tick_s)));
        let expectations = scenario.expectations.iter().cloned().map(unplaced);
        let obstacles = scenario.obstacles.iter().map(ObstacleTable::of);
        let sites = scenario.sites.iter();
        let sites = sites.filter_map(|(name, spec)| SiteTable::of(name, spec));
        let layers = scenario.layers.iter();
        let layers = layers.map(|(name, spec)| unplaced(LayerTable::of(name, spec)));
        let robots = scenario.robots.iter();
        let robots = robots.map(|(name, spec)| unplaced(RawRobot::of(name, spec, lateness)));

        Self {
            seed: Some(unplaced(scenario.seed)),
            tick: Some(unplaced(Time(tick_s))),
            duration: Some(unplaced(Time(scenario.duration_s()))),
            on_late: Some(lateness.on_late),
            deadline: Some(unplaced(Time(lateness.deadline_s))),
            lose_after: Some(unplaced(lateness.lose_after)),
            field: Some(unplaced(field)),
            sensing: Some(SensingTable::from(&scenario.sensing)),
            guests: Some(unplaced(GuestsTable::of(
                &scenario.guests,
                &scenario.guest_motion,
                &scenario.guest_rules,
                tick_s,
            ))),
            network: NetworkTable::of(&scenario.network, tick_s),
            record: Some(record),
            faults: faults.collect(),
            changes: changes.collect(),
            expectations: expectations.collect(),
            measures: scenario.measures.iter().cloned().map(unplaced).collect(),
            end_when: scenario.end_when.clone().map(unplaced),
            parent: scenario.parent.as_ref().map(ParentTable::from),
            reseeds: reseeds.collect(),
            drawn: DrawnTable::of(scenario).map(unplaced),
            obstacles: obstacles.collect(),
            sites: sites.map(unplaced).collect(),
            layers: layers.collect(),
            walls: WallTable::of_all(&scenario.walls),
            // The record has what is on it, and does not need the drawing.
            floor_plan: None,
            robots: robots.collect(),
            tracks: scenario
                .guest_motion
                .recorded()
                .map(|recorded| unplaced(TracksTable::of(recorded))),
        }
    }
}

impl RawRobot {
    fn of(name: &RobotName, spec: &RobotSpec, lateness: &Lateness) -> Self {
        let (size, radius) = solids::keys(spec.shape);
        let parameters = spec.parameters.iter();
        let params = parameters.filter_map(|(key, value)| Some((key.clone(), to_toml(value)?)));
        Self {
            name: name.clone().into(),
            count: None,
            class: Some(spec.class.clone()),
            at: StartPlace::of(to_world(spec.at), spec.drawn),
            size,
            radius,
            drive: spec.wheels.as_ref().map(DriveTable::of),
            on_late: lateness.own.get(name).copied(),
            params_from: None,
            params: params.collect(),
        }
    }
}

/// The inverse of [`to_json`]; parameters come from TOML, which has no `null`.
fn to_toml(value: &serde_json::Value) -> Option<toml::Value> {
    toml::Value::try_from(value).ok()
}
