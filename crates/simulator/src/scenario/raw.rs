//! A scenario file as it is written. Unknown keys are refused; what is wrong is shown where it stands.

mod fault;
mod network;
mod range;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use config::units::{Length, Speed, Time, quantity};
use config::{FileError, Source, seed};
use protocol::RobotName;
use protocol::messages::{OnLate, Parameters, Point};
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::Triangular;

use fault::FaultTable;
use network::NetworkTable;
use range::Range;

use super::checked::{self, DEFAULT_SEED, Lateness, Record, RobotSpec};
use super::network::Network;
use super::placing;

/// Largest scenario: more than any experiment asks for, less than would exhaust a machine.
const MAX_TICKS: f64 = 1e9;
const MAX_ROBOTS: usize = 1024;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Scenario {
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
    #[serde(default, rename = "obstacle", skip_serializing_if = "Vec::is_empty")]
    obstacles: Vec<Obstacle>,
    #[serde(default, rename = "robot", skip_serializing_if = "Vec::is_empty")]
    robots: Vec<Spanned<Robot>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct FieldTable {
    size: [Length; 2],
    body: Option<Length>,
    max_speed: Option<Speed>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct SensingTable {
    range: Spanned<Length>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct GuestsTable {
    count: usize,
    speed: Option<Spanned<Range<Speed>>>,
    duration: Option<Spanned<Range<Time>>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RecordTable {
    log: Option<bool>,
    log_name: Option<Spanned<String>>,
    frames: Option<bool>,
}

/// A triangular distribution in SI units, not checked yet.
struct Triangle {
    min: f64,
    mode: f64,
    max: f64,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Obstacle {
    at: [Length; 2],
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Robot {
    name: RobotName,
    class: Option<String>,
    at: [Length; 2],
    on_late: Option<OnLate>,
    params_from: Option<PathBuf>,
    #[serde(default)]
    params: toml::Table,
}

/// Hors d'oeuvres at a reception: guests that stroll. [I] The seed names the distributions and no numbers.
const GUEST_SPEED: Range<Speed> = Range {
    min: Speed(0.06096),
    mode: Speed(0.3048),
    max: Speed(0.6096),
};
const GUEST_DURATION: Range<Time> = Range {
    min: Time(2.0),
    mode: Time(5.0),
    max: Time(10.0),
};
/// Everything occupies 2 ft by 2 ft [D: seed, "Obstacles"].
const BODY: Length = Length(0.6096);
/// 50 ft by 50 ft [D: seed, "Experimental Results"].
const FIELD: [Length; 2] = [Length(15.24), Length(15.24)];
/// 10 ft/s [I]: a brisk run; the fastest shipped robot drives at 4.5 ft/s.
const MAX_SPEED: Speed = Speed(3.048);
/// Seconds of wall clock [I].
const DEADLINE_S: f64 = 2.0;
/// Ticks [I].
const LOSE_AFTER: f64 = 10.0;
/// 6 ft [I].
const SENSING_RANGE: Length = Length(1.8288);

impl Scenario {
    /// Refuses to name files: what comes from outside must not make this process read them.
    pub(super) fn refuse_files(self, source: &Source) -> Result<Self, FileError> {
        match self
            .robots
            .iter()
            .find(|robot| robot.get_ref().params_from.is_some())
        {
            Some(robot) => {
                let reason = "`params_from` names a file; write its parameters out under `params`";
                Err(FileError::at(source, Some(robot.span()), reason))
            }
            None => Ok(self),
        }
    }

    /// From what is written to what it means.
    pub(super) fn check(
        self,
        source: &Source,
        folder: &Path,
    ) -> Result<checked::Scenario, FileError> {
        let seed = match &self.seed {
            Some(seed) => seed::check(*seed.get_ref())
                .map_err(|error| FileError::at(source, Some(seed.span()), &error.to_string()))?,
            None => DEFAULT_SEED,
        };
        let tick_s = positive(source, self.tick.as_ref(), 0.5, |time| time.0, "a tick")?;
        let duration_s = positive(
            source,
            self.duration.as_ref(),
            600.0,
            |time| time.0,
            "the duration",
        )?;
        let ticks = (duration_s / tick_s).round();
        if ticks > MAX_TICKS {
            let span = self.duration.as_ref().map(Spanned::span);
            return Err(FileError::at(source, span, "more than a billion ticks"));
        }

        let field = self.field.as_ref().map(Spanned::get_ref);
        let (speed, duration) = self.guest_courses(source)?;
        let sensing_range_m = positive(
            source,
            self.sensing.as_ref().map(|table| &table.range),
            SENSING_RANGE.0,
            |range| range.0,
            "the range",
        )?;
        let own = self.robots.iter().map(Spanned::get_ref);
        let lateness = Lateness {
            on_late: self.on_late.unwrap_or(OnLate::Wait),
            own: own
                .filter_map(|robot| Some((robot.name.clone(), robot.on_late?)))
                .collect(),
            deadline_s: positive(
                source,
                self.deadline.as_ref(),
                DEADLINE_S,
                |time| time.0,
                "the deadline",
            )?,
            lose_after: positive(
                source,
                self.lose_after.as_ref(),
                LOSE_AFTER,
                |n| f64::from(*n),
                "lose_after",
            )? as u32,
        };
        let scenario = checked::Scenario {
            seed,
            tick_s,
            ticks: ticks as u64,
            field_m: field
                .map_or(FIELD, |field| field.size)
                .map(|length| length.0),
            body_m: field.and_then(|field| field.body).unwrap_or(BODY).0,
            max_speed_mps: field
                .and_then(|field| field.max_speed)
                .unwrap_or(MAX_SPEED)
                .0,
            sensing_range_m,
            guests: world::Guests {
                count: self
                    .guests
                    .as_ref()
                    .map_or(0, |guests| guests.get_ref().count),
                speed_mps: speed,
                duration_s: duration,
            },
            obstacles: self
                .obstacles
                .iter()
                .map(|obstacle| point(obstacle.at))
                .collect(),
            lateness,
            robots: robots(self.robots, source, folder)?,
            network: Network::default(),
            faults: Vec::new(),
            record: record(self.record, source)?,
        };
        let network = network::check(self.network, &scenario.robots, tick_s, source)?;
        let faults = fault::check(
            self.faults,
            &scenario.robots,
            &scenario.lateness,
            tick_s,
            source,
        )?;
        let scenario = checked::Scenario {
            network,
            faults,
            ..scenario
        };

        check_hall(&scenario, source, self.guests.as_ref().map(Spanned::span))?;

        Ok(scenario)
    }

    fn guest_courses(&self, source: &Source) -> Result<(Triangular, Triangular), FileError> {
        let guests = self.guests.as_ref().map(Spanned::get_ref);
        let speed = guests.and_then(|guests| guests.speed.as_ref());
        let duration = guests.and_then(|guests| guests.duration.as_ref());
        let shape = |raw: Triangle, span| {
            Triangular::new(raw.min, raw.mode, raw.max)
                .map_err(|error| FileError::at(source, span, &error.to_string()))
        };
        let drawn = speed.map_or(GUEST_SPEED, |speed| *speed.get_ref());
        let speed = Triangle {
            min: drawn.min.0,
            mode: drawn.mode.0,
            max: drawn.max.0,
        };
        let speed = shape(
            speed,
            guests
                .and_then(|guests| guests.speed.as_ref())
                .map(Spanned::span),
        )?;
        let drawn = duration.map_or(GUEST_DURATION, |duration| *duration.get_ref());
        let lasting = Triangle {
            min: drawn.min.0,
            mode: drawn.mode.0,
            max: drawn.max.0,
        };

        Ok((speed, shape(lasting, duration.map(Spanned::span))?))
    }
}

/// Places everything once, so that a hall that cannot be placed is refused before anything starts.
fn check_hall(
    scenario: &checked::Scenario,
    source: &Source,
    guests: Option<std::ops::Range<usize>>,
) -> Result<(), FileError> {
    match placing::check(scenario) {
        Ok(()) => Ok(()),
        Err(error) => Err(FileError::at(source, guests, &error.to_string())),
    }
}

fn record(raw: Option<RecordTable>, source: &Source) -> Result<Record, FileError> {
    let standard = Record::default();
    let Some(raw) = raw else { return Ok(standard) };
    if let Some(name) = &raw.log_name {
        crate::files::check_log_name(name.get_ref())
            .map_err(|error| FileError::at(source, Some(name.span()), &error.to_string()))?;
    }

    Ok(Record {
        log: raw.log.unwrap_or(standard.log),
        log_name: raw.log_name.map_or(standard.log_name, Spanned::into_inner),
        frames: raw.frames.unwrap_or(standard.frames),
    })
}

fn robots(
    raw: Vec<Spanned<Robot>>,
    source: &Source,
    folder: &Path,
) -> Result<BTreeMap<RobotName, RobotSpec>, FileError> {
    let mut robots = BTreeMap::new();
    for entry in raw {
        let (span, robot) = (entry.span(), entry.into_inner());
        let refuse = |reason: &str| FileError::at(source, Some(span.clone()), reason);
        if robot.name.is_operator() {
            return Err(refuse(
                "the name `operator` is kept for commands from outside the roster",
            ));
        }
        if robots.len() == MAX_ROBOTS {
            return Err(refuse("more than 1024 robots"));
        }
        let mut parameters = Parameters::new();
        if let Some(file) = &robot.params_from {
            let read = Source::read(&folder.join(file)).and_then(|file| file.parse());
            parameters.extend(to_parameters(
                &read.map_err(|error| error.named_by(&source.name))?,
            ));
        }
        parameters.extend(to_parameters(&robot.params));
        let class = robot
            .class
            .unwrap_or_else(|| robot.name.as_str().to_owned());
        let spec = RobotSpec {
            class,
            at: point(robot.at),
            parameters,
        };
        if robots.insert(robot.name.clone(), spec).is_some() {
            return Err(refuse(&format!("a second robot called {}", robot.name)));
        }
    }

    Ok(robots)
}

fn point([x, y]: [Length; 2]) -> Point {
    Point::new(x.0, y.0)
}

/// A value that must be positive and finite, or its default.
fn positive<T>(
    source: &Source,
    value: Option<&Spanned<T>>,
    default: f64,
    number: impl Fn(&T) -> f64,
    what: &str,
) -> Result<f64, FileError> {
    let Some(spanned) = value else {
        return Ok(default);
    };

    let value = number(spanned.get_ref());
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }

    Err(FileError::at(
        source,
        Some(spanned.span()),
        &format!("{what} must be more than zero"),
    ))
}

/// Parameters as they travel: JSON, every text that is a quantity turned into its SI number.
fn to_parameters(table: &toml::Table) -> Parameters {
    table
        .iter()
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

impl From<&checked::Scenario> for Scenario {
    fn from(scenario: &checked::Scenario) -> Self {
        let spanned = |value| Some(Spanned::new(0..0, value));
        let range = |shape: &Triangular| (shape.min(), shape.mode(), shape.max());
        let (min, mode, max) = range(&scenario.guests.speed_mps);
        let speed = Range {
            min: Speed(min),
            mode: Speed(mode),
            max: Speed(max),
        };
        let (min, mode, max) = range(&scenario.guests.duration_s);
        let duration = Range {
            min: Time(min),
            mode: Time(mode),
            max: Time(max),
        };

        Self {
            seed: Some(Spanned::new(0..0, scenario.seed)),
            tick: spanned(Time(scenario.tick_s)),
            duration: spanned(Time(scenario.duration_s())),
            on_late: Some(scenario.lateness.on_late),
            deadline: spanned(Time(scenario.lateness.deadline_s)),
            lose_after: Some(Spanned::new(0..0, scenario.lateness.lose_after)),
            field: Some(Spanned::new(
                0..0,
                FieldTable {
                    size: scenario.field_m.map(Length),
                    body: Some(Length(scenario.body_m)),
                    max_speed: Some(Speed(scenario.max_speed_mps)),
                },
            )),
            sensing: Some(SensingTable {
                range: Spanned::new(0..0, Length(scenario.sensing_range_m)),
            }),
            guests: Some(Spanned::new(
                0..0,
                GuestsTable {
                    count: scenario.guests.count,
                    speed: Some(Spanned::new(0..0, speed)),
                    duration: Some(Spanned::new(0..0, duration)),
                },
            )),
            network: NetworkTable::of(&scenario.network, scenario.tick_s),
            faults: scenario
                .faults
                .iter()
                .map(|entry| Spanned::new(0..0, FaultTable::of(entry, scenario.tick_s)))
                .collect(),
            record: Some(RecordTable {
                log: Some(scenario.record.log),
                log_name: Some(Spanned::new(0..0, scenario.record.log_name.clone())),
                frames: Some(scenario.record.frames),
            }),
            obstacles: scenario
                .obstacles
                .iter()
                .map(|at| Obstacle {
                    at: [Length(at.x), Length(at.y)],
                })
                .collect(),
            robots: scenario
                .robots
                .iter()
                .map(|(name, spec)| {
                    let on_late = scenario.lateness.own.get(name).copied();
                    Spanned::new(
                        0..0,
                        Robot {
                            on_late,
                            ..Robot::from((name, spec))
                        },
                    )
                })
                .collect(),
        }
    }
}

impl From<(&RobotName, &RobotSpec)> for Robot {
    fn from((name, spec): (&RobotName, &RobotSpec)) -> Self {
        let params = spec
            .parameters
            .iter()
            .filter_map(|(key, value)| Some((key.clone(), to_toml(value)?)));
        Self {
            name: name.clone(),
            class: Some(spec.class.clone()),
            at: [Length(spec.at.x), Length(spec.at.y)],
            on_late: None,
            params_from: None,
            params: params.collect(),
        }
    }
}

/// The inverse of [`to_json`]; parameters come from TOML, which has no `null`.
fn to_toml(value: &serde_json::Value) -> Option<toml::Value> {
    toml::Value::try_from(value).ok()
}
