//! The table `[guests]`.

use std::collections::BTreeSet;
use std::ops::Range as Span;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use config::units::{Angle, Length, Speed, Time};
use config::{FileError, Source, shipped};
use import::tracks::{self, MAX_RATE_HZ, TrackFormat, TrackPlacement, TrackSet, is_rate};
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::{CrowdModel, Field, Point};

use super::folders::Folders;
use super::numbers::{Range, positive, triangular};
use super::place::{Lengths, point};
use super::tracks::TracksTable;
use super::unplaced::unplaced;
use super::want::WantTable;
use crate::checked::check_guests;
use crate::files::RECORDING;
use crate::guests::{Faces, GuestMotion, GuestRules, ModeledGuests, RecordedGuests, Requests};
use crate::network::ticks;

/// Speed of strolling guests [I]. The paper names the distributions but no numbers.
const SPEED: Range<Speed> = Range {
    min: Speed(0.06096),
    mode: Speed(0.3048),
    max: Speed(0.6096),
};
/// Duration of a guest's straight walk [I].
const DURATION: Range<Time> = Range {
    min: Time(2.0),
    mode: Time(5.0),
    max: Time(10.0),
};
/// How near guests react to a face, and ask: 6 ft, as far as robots sense [I].
const RANGE: Length = Length(1.8288);
/// How long a guest waits until it is annoyed [I].
const PATIENCE: Time = Time(30.0);
/// How fast a recorded person goes back to where the record has it: half as fast again as people walk who have room, 1.34 m/s
/// (Weidmann 1993) [I].
const CATCH_UP: Speed = Speed(2.0);
/// Most faces in a list.
const MAX_FACES: usize = 64;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GuestsTable {
    count: Option<Spanned<usize>>,
    model: Option<Spanned<GuestModel>>,
    from: Option<Spanned<PathBuf>>,
    format: Option<TrackFormat>,
    unit: Option<Spanned<Length>>,
    rotate: Option<Angle>,
    offset: Option<Lengths>,
    rate: Option<Spanned<f64>>,
    start: Option<Spanned<RecordStart>>,
    #[serde(rename = "loop")]
    repeats: Option<bool>,
    catch_up: Option<Spanned<Speed>>,
    speed: Option<Spanned<Range<Speed>>>,
    duration: Option<Spanned<Range<Time>>>,
    faces: Option<Spanned<FacesTable>>,
    requests: Option<RequestsTable>,
    /// What guests want who walk by a model. They do by a default one if nothing else is said.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) wants: Vec<Spanned<WantTable>>,
}

/// What moves guests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum GuestModel {
    Random,
    Recorded,
    CollisionFree,
    SocialForce,
}

/// Time of the record at the start of the run.
#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
enum RecordStart {
    At(Time),
    /// Drawn from the guests' stream, so that each seed has another one.
    Random,
}

impl TryFrom<String> for RecordStart {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.as_str() {
            "random" => Ok(Self::Random),
            _ => text.parse().map(Self::At),
        }
    }
}

impl From<RecordStart> for String {
    fn from(start: RecordStart) -> Self {
        match start {
            RecordStart::At(Time(time_s)) => format!("{time_s} s"),
            RecordStart::Random => "random".to_owned(),
        }
    }
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct FacesTable {
    range: Option<Spanned<Length>>,
    #[serde(default)]
    make_way: BTreeSet<String>,
    #[serde(default)]
    approach: BTreeSet<String>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RequestsTable {
    range: Option<Spanned<Length>>,
    patience: Option<Spanned<Time>>,
    stop: Option<Spanned<Time>>,
    come_closer: Option<bool>,
}

/// How guests walk; the number of recorded ones is that of the record.
pub(super) fn walks(
    table: Option<&Spanned<GuestsTable>>,
    recorded: Option<&RecordedGuests>,
    source: &Source,
) -> Result<world::Guests, FileError> {
    let span = table.map(Spanned::span);
    let table = table.map(Spanned::get_ref);
    let written = table.and_then(|table| table.count.as_ref());
    if let Some(count) = written {
        check_guests(*count.get_ref())
            .map_err(|reason| FileError::at(source, Some(count.span()), &reason))?;
    }
    if table.is_some() && written.is_none() && recorded.is_none() {
        return Err(FileError::at(source, span, "missing field `count`"));
    }

    let written = written.map_or(0, |count| *count.get_ref());
    let count = recorded.map_or(written, |recorded| recorded.tracks.len());
    let speed = table.and_then(|table| table.speed.as_ref());
    let duration = table.and_then(|table| table.duration.as_ref());
    Ok(world::Guests {
        count,
        speed_mps: triangular(source, speed, SPEED)?,
        duration_s: triangular(source, duration, DURATION)?,
    })
}

/// Where the record of guests is.
#[derive(Clone, Copy)]
pub(super) struct RecordSetting<'a> {
    /// Where files and runs are that the scenario names; a scenario from outside names none.
    pub(super) folders: Option<Folders<'a>>,
    /// Tracks that are written out.
    pub(super) tracks: Option<&'a Spanned<TracksTable>>,
    /// The field on which people are.
    pub(super) field: Field,
    pub(super) source: &'a Source,
}

/// What moves the guests.
pub(super) fn motion(
    table: Option<&GuestsTable>,
    setting: RecordSetting<'_>,
) -> Result<GuestMotion, FileError> {
    let Some(table) = table else {
        return Ok(GuestMotion::Random);
    };
    let model = match table.model(setting.tracks) {
        GuestModel::CollisionFree => CrowdModel::CollisionFree,
        GuestModel::SocialForce => CrowdModel::SocialForce,
        GuestModel::Random | GuestModel::Recorded if !table.wants.is_empty() => {
            let model = table.model.as_ref().map(Spanned::span);
            let reason =
                "guests who want something walk by a model, \"collision-free\" or \"social-force\"";
            let span = model.or(table.wants.first().map(Spanned::span));
            return Err(FileError::at(setting.source, span, reason));
        }
        GuestModel::Random => return Ok(GuestMotion::Random),
        GuestModel::Recorded => return Ok(GuestMotion::Recorded(recorded(table, setting)?)),
    };
    // What they want is read when sites and robots are known.
    Ok(GuestMotion::Crowd(ModeledGuests {
        model,
        wants: Vec::new(),
    }))
}

fn recorded(table: &GuestsTable, setting: RecordSetting<'_>) -> Result<RecordedGuests, FileError> {
    let source = setting.source;

    let (set, span) = match setting.tracks {
        Some(tracks) => {
            table.check_written_out(tracks, source)?;
            (tracks.get_ref().read(tracks.span(), source)?, tracks.span())
        }
        None => table.read(setting.folders, source)?,
    };
    let repeats = table.repeats.unwrap_or(false);
    let start_ms = match table.start.as_ref().map(Spanned::get_ref) {
        None => Ok(Some(0)),
        Some(RecordStart::At(Time(start_s))) if (0.0..1e9).contains(start_s) => {
            Ok(Some((start_s * 1000.0).round() as u64))
        }
        Some(RecordStart::At(_)) => {
            Err("the time of the record at the start of the run must be 0 or more")
        }
        Some(RecordStart::Random) if repeats => Ok(None),
        Some(RecordStart::Random) => {
            Err("a record that starts anywhere must begin again: set `loop = true`")
        }
    };
    let start_ms = start_ms
        .map_err(|reason| FileError::at(source, table.start.as_ref().map(Spanned::span), reason))?;
    let catch_up = table.catch_up.as_ref();
    let from = table.from.as_ref().map(Spanned::get_ref);
    let recorded = RecordedGuests {
        from: from.map_or_else(String::new, |from| from.display().to_string()),
        tracks: Arc::new(set.tracks),
        length_ms: set.length_ms,
        start_ms,
        repeats,
        catch_up_mps: positive(source, catch_up, CATCH_UP, "the speed back to the record")?.0,
    };
    check_seen(&recorded, &setting.field)
        .map_err(|reason| FileError::at(source, Some(span), &reason))?;
    Ok(recorded)
}

/// Checks that a guest is on the field at some time.
fn check_seen(recorded: &RecordedGuests, field: &Field) -> Result<(), String> {
    let start_us = recorded.start_ms.unwrap_or(0).saturating_mul(1000);
    let tracks = recorded.tracks.iter();
    let mut points = tracks.flat_map(world::Track::points);
    let is_seen = |point: &world::TrackPoint| {
        field.contains(point.at) && (recorded.repeats || point.at_us >= start_us)
    };
    if points.any(is_seen) {
        return Ok(());
    }

    let mut low = Point::new(f64::INFINITY, f64::INFINITY);
    let mut high = Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY);
    for point in recorded.tracks.iter().flat_map(world::Track::points) {
        low = Point::new(low.x.min(point.at.x), low.y.min(point.at.y));
        high = Point::new(high.x.max(point.at.x), high.y.max(point.at.y));
    }
    let (width_m, height_m) = field.size_m;
    Err(format!(
        "none of these people is ever on the field, which is {width_m} m by {height_m} m: they are from {low} m to {high} m, for \
         {} s; `unit`, `rotate` and `offset` move them, `start` and `loop` say when they are there",
        recorded.length_ms.get() as f64 / 1000.0
    ))
}

/// What guests do beside walking.
pub(super) fn rules(
    table: Option<&GuestsTable>,
    tick_s: f64,
    source: &Source,
) -> Result<GuestRules, FileError> {
    let Some(table) = table else {
        return Ok(GuestRules::default());
    };

    let mut rules = GuestRules::default();
    if let Some(spanned) = &table.faces {
        let faces = spanned.get_ref();
        let refused = |reason: &str| FileError::at(source, Some(spanned.span()), reason);
        if faces.make_way.len() + faces.approach.len() > MAX_FACES {
            return Err(refused(&format!("these are more than {MAX_FACES} faces")));
        }
        if let Some(both) = faces.make_way.intersection(&faces.approach).next() {
            return Err(refused(&format!(
                "guests cannot make way for a face \"{both}\" and approach it: name it once"
            )));
        }
        rules.faces = Some(Faces {
            range_m: range_m(source, faces.range.as_ref())?,
            make_way: faces.make_way.clone(),
            approach: faces.approach.clone(),
        });
    }
    if let Some(requests) = &table.requests {
        let patience = requests.patience.as_ref();
        let patience_s = positive(source, patience, PATIENCE, "the patience of a guest")?.0;
        let mut stop = 0;
        if let Some(time) = &requests.stop {
            let time = positive(source, Some(time), Time(0.0), "how long a guest stops")?;
            stop = ticks(time.0, tick_s).max(1);
        }
        rules.requests = Some(Requests {
            range_m: range_m(source, requests.range.as_ref())?,
            patience: ticks(patience_s, tick_s).max(1),
            stop,
            comes_closer: requests.come_closer.unwrap_or(false),
        });
    }
    Ok(rules)
}

fn range_m(source: &Source, range: Option<&Spanned<Length>>) -> Result<f64, FileError> {
    Ok(positive(source, range, RANGE, "a range")?.0)
}

impl GuestsTable {
    fn model(&self, tracks: Option<&Spanned<TracksTable>>) -> GuestModel {
        match &self.model {
            Some(model) => *model.get_ref(),
            None if self.from.is_some() || tracks.is_some() => GuestModel::Recorded,
            None if !self.wants.is_empty() => GuestModel::CollisionFree,
            None => GuestModel::Random,
        }
    }

    /// Refuses what tracks that are written out do not need: it would be without effect.
    fn check_written_out(
        &self,
        tracks: &Spanned<TracksTable>,
        source: &Source,
    ) -> Result<(), FileError> {
        let is_moved = self.unit.is_some()
            || self.rate.is_some()
            || self.rotate.is_some()
            || self.offset.is_some()
            || self.format.is_some();
        if is_moved {
            let reason = "these tracks are in the hall already: `unit`, `rate`, `rotate`, `offset` and `format` are for files";
            return Err(FileError::at(source, Some(tracks.span()), reason));
        }
        Ok(())
    }

    /// Reads the file or the run that the table names. Returns also where it does so.
    fn read(
        &self,
        folders: Option<Folders<'_>>,
        source: &Source,
    ) -> Result<(TrackSet, Span<usize>), FileError> {
        let Some(from) = &self.from else {
            let span = self.model.as_ref().map(Spanned::span);
            let reason =
                "recorded guests need a record: set `from` to a file of trajectories or a run";
            return Err(FileError::at(source, span, reason));
        };
        let span = from.span();
        let placement = self.placement(source)?;
        let from = from.get_ref();
        if let Some(run) = folders.and_then(|folders| run_folder(from, folders)) {
            let set = tracks::read_run(&run, &placement)
                .map_err(|reason| FileError::at(source, Some(span.clone()), &reason))?;
            return Ok((set, span));
        }

        let shipped = shipped::path(shipped::SCENARIOS);
        let folder = folders.map_or(shipped.as_path(), |folders| folders.files);
        let path = folder.join(from);
        if folders.is_none() && !shipped::contains(&path) {
            let reason = "a scenario from outside names no record of guests but those that come with the programs: write it out as a record of a run has it, in [tracks]";
            return Err(FileError::at(source, Some(span), reason));
        }
        source.check_named(span.clone(), &path)?;
        if is_sqlite(&path) {
            let reason = "this is a database: docs/guests.md has the lines that write its trajectories as text";
            return Err(FileError::at(source, Some(span), reason));
        }
        let file = Source::read(&path).map_err(|error| error.named_by(&source.name))?;
        let set = tracks::read(&file, &placement).map_err(|error| error.named_by(&source.name))?;
        Ok((set, span))
    }

    fn placement(&self, source: &Source) -> Result<TrackPlacement, FileError> {
        let mut unit_m = None;
        if self.unit.is_some() {
            unit_m = Some(positive(source, self.unit.as_ref(), Length(1.0), "a unit")?.0);
        }
        if let Some(rate) = &self.rate
            && !is_rate(*rate.get_ref())
        {
            let reason = format!("a frame rate is a number above 0, and at most {MAX_RATE_HZ}");
            return Err(FileError::at(source, Some(rate.span()), &reason));
        }
        Ok(TrackPlacement {
            format: self.format,
            unit_m,
            rotate_rad: self.rotate.map_or(0.0, |angle| angle.0),
            offset: self.offset.map(point).unwrap_or_default(),
            rate_hz: self.rate.as_ref().map(|rate| *rate.get_ref()),
        })
    }

    /// The table as it is written from a scenario.
    pub(super) fn of(
        guests: &world::Guests,
        motion: &GuestMotion,
        rules: &GuestRules,
        tick_s: f64,
    ) -> Self {
        let speed = &guests.speed_mps;
        let duration = &guests.duration_s;
        let faces = rules.faces.as_ref().map(|faces| FacesTable {
            range: Some(unplaced(Length(faces.range_m))),
            make_way: faces.make_way.clone(),
            approach: faces.approach.clone(),
        });
        let requests = rules.requests.as_ref().map(|requests| RequestsTable {
            range: Some(unplaced(Length(requests.range_m))),
            patience: Some(unplaced(Time(requests.patience as f64 * tick_s))),
            stop: (requests.stop > 0).then(|| unplaced(Time(requests.stop as f64 * tick_s))),
            come_closer: requests.comes_closer.then_some(true),
        });

        let model = match motion {
            GuestMotion::Random => None,
            GuestMotion::Recorded(_) => Some(GuestModel::Recorded),
            GuestMotion::Crowd(guests) => Some(match guests.model {
                CrowdModel::CollisionFree => GuestModel::CollisionFree,
                CrowdModel::SocialForce => GuestModel::SocialForce,
            }),
        };
        let wants = match motion {
            GuestMotion::Crowd(guests) => guests.wants.as_slice(),
            GuestMotion::Random | GuestMotion::Recorded(_) => &[],
        };
        let recorded = motion.recorded();
        let from = recorded.filter(|recorded| !recorded.from.is_empty());
        let start = recorded.map(|recorded| match recorded.start_ms {
            Some(start_ms) => RecordStart::At(Time(start_ms as f64 / 1000.0)),
            None => RecordStart::Random,
        });
        let catch_up = recorded.map(|recorded| unplaced(Speed(recorded.catch_up_mps)));
        Self {
            count: Some(unplaced(guests.count)),
            model: model.map(unplaced),
            from: from.map(|recorded| unplaced(PathBuf::from(&recorded.from))),
            format: None,
            unit: None,
            rotate: None,
            offset: None,
            rate: None,
            start: start.map(unplaced),
            repeats: recorded.map(|recorded| recorded.repeats),
            catch_up,
            speed: Some(unplaced(Range {
                min: Speed(speed.min()),
                mode: Speed(speed.mode()),
                max: Speed(speed.max()),
            })),
            duration: Some(unplaced(Range {
                min: Time(duration.min()),
                mode: Time(duration.mode()),
                max: Time(duration.max()),
            })),
            faces: faces.map(unplaced),
            requests,
            wants: wants
                .iter()
                .map(|want| unplaced(WantTable::of(want, tick_s)))
                .collect(),
        }
    }
}

/// The folder of the run that a scenario names, by its name or its path; `None` if it names a file.
fn run_folder(from: &Path, folders: Folders<'_>) -> Option<PathBuf> {
    let candidates = [
        folders.runs.join(from),
        folders.files.join(from),
        from.to_owned(),
    ];
    candidates
        .into_iter()
        .find(|path| path.join(RECORDING).is_file())
}

/// Whether a file is a database of JuPedSim, which no text is.
fn is_sqlite(path: &Path) -> bool {
    path.extension().is_some_and(|ending| {
        ["sqlite", "db", "sqlite3"]
            .iter()
            .any(|known| ending == *known)
    })
}
