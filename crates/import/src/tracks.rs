//! Recorded people: files of trajectories, read into tracks in meters and milliseconds, and the text that a record has of them.
//!
//! A line of a file is an observation: a person, a frame, a place. Lines may come in any order. Times are counted from the first
//! frame of the file on.

use std::collections::BTreeMap;
use std::num::NonZeroU64;
use std::ops::Range;
use std::path::Path;

use config::{FileError, Source};
use recording::{Recording, Ticks};
use serde::{Deserialize, Serialize};
use world::{Point, Track, TrackPoint};
use xxhash_rust::xxh3::xxh3_128;

/// Most people of a record.
const MAX_PEOPLE: usize = 20_000;
/// Most observations of a record.
const MAX_OBSERVATIONS: usize = 1_000_000;
/// Most frames in a second: times are whole milliseconds.
pub const MAX_RATE_HZ: f64 = 1000.0;
/// Longest record, milliseconds: a hundred days.
const MAX_LENGTH_MS: u64 = 8_640_000_000;
/// Farthest from the origin, millimeters: the longest side of a field.
const MAX_MM: f64 = 1e9;

/// How the observations of a file are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TrackFormat {
    /// `frame id x y` (UCY).
    Ucy,
    /// Eight columns: frame, id, x, height, y, and velocities (ETH).
    Obsmat,
    /// `id frame x y`, with or without z and more, and comments with frame rate and unit (Jülich, JuPedSim, PedPy).
    Juelich,
}

/// How a record lies in a hall.
#[derive(Debug, Clone, Copy)]
pub struct TrackPlacement {
    /// Format of the file; without it, what its first lines look like.
    pub format: Option<TrackFormat>,
    /// Length of a unit of the file, meters; without it, what the file says itself.
    pub unit_m: Option<f64>,
    /// Turn about the origin, counter-clockwise, rad, before the offset.
    pub rotate_rad: f64,
    /// Where the origin of the file is, meters.
    pub offset: Point,
    /// Frames per second; without it, what the file says itself.
    pub rate_hz: Option<f64>,
}

/// Where people were.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackSet {
    /// One for each person.
    pub tracks: Vec<Track>,
    /// From the first frame to the one after the last.
    pub length_ms: NonZeroU64,
}

/// Places in whole millimeters by whole milliseconds, of one person.
type Observations = BTreeMap<u64, [i64; 2]>;

/// Reads a file.
///
/// # Errors
/// [`FileError`] with line and caret.
pub fn read(source: &Source, placement: &TrackPlacement) -> Result<TrackSet, FileError> {
    let refuse = |refused: RefusedText| refused.in_file(source);
    let head = TrackHead::of(&source.text, placement).map_err(refuse)?;

    let mut people: BTreeMap<u64, BTreeMap<u64, [i64; 2]>> = BTreeMap::new();
    let mut count = 0;
    for line in observations(&source.text) {
        let row = head.row(line, &source.text).map_err(refuse)?;
        let at = placement.place(row.at, head.unit_m);
        let at = at.ok_or_else(|| refuse(RefusedText::of(line, &source.text, FAR)))?;
        count += 1;
        if count > MAX_OBSERVATIONS {
            let reason =
                format!("these are more than {MAX_OBSERVATIONS} observations: leave frames out");
            return Err(refuse(RefusedText::of(line, &source.text, &reason)));
        }

        let person = people.entry(row.person).or_default();
        if person.insert(row.frame, at).is_some() {
            let reason = format!("person {} is in frame {} twice", row.person, row.frame);
            return Err(refuse(RefusedText::of(line, &source.text, &reason)));
        }
        if people.len() > MAX_PEOPLE {
            let reason = format!("more than {MAX_PEOPLE} people");
            return Err(refuse(RefusedText::of(line, &source.text, &reason)));
        }
    }

    of_frames(people, head.rate_hz).map_err(|reason| FileError::at(source, None, &reason))
}

/// Turns frames into times.
fn of_frames(
    people: BTreeMap<u64, BTreeMap<u64, [i64; 2]>>,
    rate_hz: f64,
) -> Result<TrackSet, String> {
    let mut frames: Vec<u64> = people.values().flat_map(BTreeMap::keys).copied().collect();
    frames.sort_unstable();
    frames.dedup();
    let (Some(&first), Some(&last)) = (frames.first(), frames.last()) else {
        return Err("there is no observation in this file".to_owned());
    };

    let steps = frames.windows(2).map(|pair| pair[1] - pair[0]);
    let step = steps.min().unwrap_or(1);
    let time_ms = |frame: u64| ((frame - first) as f64 * 1000.0 / rate_hz).round();
    let length_ms = time_ms(last.saturating_add(step));
    if length_ms > MAX_LENGTH_MS as f64 {
        return Err(
            "the record lasts for more than a hundred days: is the frame rate right?".to_owned(),
        );
    }

    let mut all = Vec::new();
    for person in people.into_values() {
        let times = person.into_iter();
        all.push(
            times
                .map(|(frame, at)| (time_ms(frame) as u64, at))
                .collect(),
        );
    }
    track_set(all, length_ms as u64)
}

fn track_set(people: Vec<Observations>, length_ms: u64) -> Result<TrackSet, String> {
    let mut tracks = Vec::with_capacity(people.len());
    for person in people {
        let waypoints = person
            .into_iter()
            .map(|(time_ms, [x_mm, y_mm])| TrackPoint {
                at_us: time_ms * 1000,
                at: Point::new(x_mm as f64 / 1000.0, y_mm as f64 / 1000.0),
            });
        let track = Track::new(waypoints.collect());
        tracks.push(track.ok_or("a person without an observation")?);
    }
    let length_ms = NonZeroU64::new(length_ms).ok_or("the record has no length")?;
    Ok(TrackSet { tracks, length_ms })
}

/// Reads the guests of a recorded run. One that left and came back is two people.
///
/// # Errors
/// In words, if the run has no recording, or none that can be read.
pub fn read_run(folder: &Path, placement: &TrackPlacement) -> Result<TrackSet, String> {
    let path = folder.join(recording::FILE);
    let recording = Recording::open(&path).map_err(|error| error.to_string())?;
    let tick_s = recording.header().tick_s;
    let time_ms = |tick: u64| (tick as f64 * tick_s * 1000.0).round() as u64;
    let len = recording.len();
    let mut ticks = Ticks::of(recording);

    let mut people: Vec<Observations> = Vec::new();
    // By the number of a guest: its last tick, and which one of the people it is.
    let mut open: BTreeMap<u32, (u64, usize)> = BTreeMap::new();
    let mut count = 0;
    while let Some(tick) = ticks.next_tick().map_err(|error| error.to_string())? {
        let now = tick.tick();
        count += tick.frame.guests_mm.len() / 2;
        if count > MAX_OBSERVATIONS {
            return Err(format!(
                "the guests of this run are at more than {MAX_OBSERVATIONS} places: take a shorter run"
            ));
        }

        for (number, at) in tick.frame.guests() {
            let at = placement.place(at, 1.0).ok_or(FAR)?;

            let goes_on = open.get(&number).filter(|(last, _)| last + 1 == now);
            let person = goes_on.map_or(people.len(), |(_, person)| *person);
            if person == people.len() {
                people.push(Observations::new());
            }
            people[person].insert(time_ms(now), at);
            open.insert(number, (now, person));
        }
        if people.len() > MAX_PEOPLE {
            return Err(format!("more than {MAX_PEOPLE} people"));
        }
    }
    if people.is_empty() {
        return Err("this run has no guests".to_owned());
    }
    track_set(people, time_ms(len))
}

const FAR: &str = "this place is more than 1000 km from the origin: is the unit right?";

impl TrackPlacement {
    /// A place of the file in whole millimeters of the hall; `None` if it is too far away.
    fn place(&self, [x, y]: [f64; 2], unit_m: f64) -> Option<[i64; 2]> {
        let (sin, cos) = libm::sincos(self.rotate_rad);
        let (x_m, y_m) = (x * unit_m, y * unit_m);
        let turned = Point::new(x_m * cos - y_m * sin, x_m * sin + y_m * cos);
        let at = turned + self.offset;

        let millimeters = |length_m: f64| {
            let mm = (length_m * 1000.0).round();
            (mm.abs() <= MAX_MM).then_some(mm as i64)
        };
        Some([millimeters(at.x)?, millimeters(at.y)?])
    }
}

/// A part of a text that cannot be used, and why.
struct RefusedText {
    span: Range<usize>,
    reason: String,
}

impl RefusedText {
    /// `part` is a part of `text`.
    fn of(part: &str, text: &str, reason: &str) -> Self {
        let start = (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
        Self {
            span: start..start + part.len(),
            reason: reason.to_owned(),
        }
    }

    fn in_file(self, source: &Source) -> FileError {
        FileError::at(source, Some(self.span), &self.reason)
    }
}

/// The lines that are observations.
fn observations(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().map(str::trim);
    lines.filter(|line| !line.is_empty() && !line.starts_with('#'))
}

fn columns(line: &str) -> impl Iterator<Item = &str> {
    let separators = |c: char| c.is_whitespace() || c == ',' || c == ';';
    line.split(separators).filter(|column| !column.is_empty())
}

/// What the first lines of a file say about the others.
struct TrackHead {
    format: TrackFormat,
    columns: usize,
    unit_m: f64,
    rate_hz: f64,
}

/// An observation, in units of the file.
struct TrackRow {
    person: u64,
    frame: u64,
    at: [f64; 2],
}

impl TrackHead {
    fn of(text: &str, placement: &TrackPlacement) -> Result<Self, RefusedText> {
        let mut rate_hz = placement.rate_hz;
        let mut unit_m = placement.unit_m;
        let mut has_comments = false;
        let comments = text
            .lines()
            .filter(|line| line.trim_start().starts_with('#'));
        for comment in comments {
            has_comments = true;
            let lower = comment.to_ascii_lowercase();
            if rate_hz.is_none() && lower.contains("framerate") {
                rate_hz = Some(stated_rate_hz(comment, text)?);
            }
            unit_m = unit_m.or_else(|| stated_unit_m(&lower));
        }

        let first = observations(text).next();
        let first = first.ok_or_else(|| {
            RefusedText::of(&text[..0], text, "there is no observation in this file")
        })?;
        let columns = columns(first).count();
        let format = match (placement.format, columns) {
            (Some(format), _) => format,
            (None, 4 | 5 | 9..) if has_comments => TrackFormat::Juelich,
            (None, 5) => TrackFormat::Juelich,
            (None, 8) => TrackFormat::Obsmat,
            (None, 4) => TrackFormat::Ucy,
            (None, count) => {
                let reason = format!(
                    "{count} columns: observations are `frame id x y`, the eight columns of obsmat, or `id frame x y z`; \
                     `format` of [guests] says which"
                );
                return Err(RefusedText::of(first, text, &reason));
            }
        };
        let fits = match format {
            TrackFormat::Ucy => columns == 4,
            TrackFormat::Obsmat => columns == 8,
            TrackFormat::Juelich => columns >= 4,
        };
        if !fits {
            let reason = format!("{columns} columns, which is not {}", format.in_words());
            return Err(RefusedText::of(first, text, &reason));
        }

        let rate_hz = rate_hz.ok_or_else(|| {
            let reason = "this file does not say how many frames there are in a second: set `rate` of [guests], such as 25";
            RefusedText::of(first, text, reason)
        })?;
        Ok(Self {
            format,
            columns,
            unit_m: unit_m.unwrap_or(1.0),
            rate_hz,
        })
    }

    fn row(&self, line: &str, text: &str) -> Result<TrackRow, RefusedText> {
        let all: Vec<&str> = columns(line).collect();
        if all.len() != self.columns {
            let reason = format!(
                "{} columns, where the first observation has {}",
                all.len(),
                self.columns
            );
            return Err(RefusedText::of(line, text, &reason));
        }

        let [person, frame, x, y] = match self.format {
            TrackFormat::Ucy => [1, 0, 2, 3],
            TrackFormat::Obsmat => [1, 0, 2, 4],
            TrackFormat::Juelich => [0, 1, 2, 3],
        };
        Ok(TrackRow {
            person: whole(all[person], text)?,
            frame: whole(all[frame], text)?,
            at: [number(all[x], text)?, number(all[y], text)?],
        })
    }
}

impl TrackFormat {
    fn in_words(self) -> &'static str {
        match self {
            Self::Ucy => "`frame id x y`",
            Self::Obsmat => "the eight columns of obsmat",
            Self::Juelich => "`id frame x y z`",
        }
    }
}

/// The frame rate in a comment such as `# framerate: 25 fps`.
fn stated_rate_hz(comment: &str, text: &str) -> Result<f64, RefusedText> {
    let words = comment.split(|c: char| c.is_whitespace() || c == ':' || c == '=');
    let mut numbers = words.filter_map(|word| word.parse::<f64>().ok());
    let rate_hz = numbers.next().filter(|rate| is_rate(*rate));
    rate_hz.ok_or_else(|| {
        let reason = format!("a frame rate is a number above 0, and at most {MAX_RATE_HZ}");
        RefusedText::of(comment.trim(), text, &reason)
    })
}

/// Whether there can be so many frames in a second.
#[must_use]
pub fn is_rate(rate_hz: f64) -> bool {
    rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ
}

/// The unit in a comment such as `# id frame x/cm y/cm z/cm`, in small letters.
fn stated_unit_m(comment: &str) -> Option<f64> {
    [("cm", 0.01), ("mm", 0.001), ("m", 1.0)]
        .into_iter()
        .find(|(unit, _)| {
            let marks = [
                format!("x/{unit}"),
                format!("x[{unit}]"),
                format!("x [{unit}]"),
            ];
            let mut words = comment.split_whitespace();
            words.any(|word| marks.iter().any(|mark| mark == word)) || comment.contains(&marks[2])
        })
        .map(|(_, unit_m)| unit_m)
}

fn number(column: &str, text: &str) -> Result<f64, RefusedText> {
    let number = column.parse::<f64>().ok();
    let number = number.filter(|number| number.is_finite());
    number.ok_or_else(|| RefusedText::of(column, text, "this is not a number"))
}

/// The number of a person or a frame; some files have them as `1.0000000e+00`.
fn whole(column: &str, text: &str) -> Result<u64, RefusedText> {
    let value = number(column, text)?;
    if (0.0..9e15).contains(&value) && value.fract() == 0.0 {
        return Ok(value as u64);
    }
    let reason = "people and frames have whole numbers, 0 or more";
    Err(RefusedText::of(column, text, reason))
}

/// The text that a record has of a track: time in ms and place in mm of the first waypoint, then the differences of the others.
#[must_use]
pub fn to_text(track: &Track) -> String {
    let mut text = String::new();
    let mut before = [0; 3];
    for waypoint in track.points() {
        let millimeters = |length_m: f64| (length_m * 1000.0).round() as i64;
        let time_ms = (waypoint.at_us / 1000) as i64;
        let now = [
            time_ms,
            millimeters(waypoint.at.x),
            millimeters(waypoint.at.y),
        ];
        for (now, before) in now.into_iter().zip(before) {
            if !text.is_empty() {
                text.push(' ');
            }
            text += &(now - before).to_string();
        }
        before = now;
    }
    text
}

/// The inverse of [`to_text`]: times and places.
fn of_text(text: &str) -> Result<Observations, String> {
    let mut numbers = Vec::new();
    for word in text.split_ascii_whitespace() {
        let number: i64 = word
            .parse()
            .map_err(|_| format!("{word:?} is not a whole number"))?;
        numbers.push(number);
    }
    if numbers.is_empty() || numbers.len() % 3 != 0 {
        return Err("a track has a time and a place for each of its points".to_owned());
    }

    let mut observations = Observations::new();
    let mut now = [0_i64; 3];
    for (index, step) in numbers.chunks_exact(3).enumerate() {
        for (now, step) in now.iter_mut().zip(step) {
            *now = now.saturating_add(*step);
        }
        let [time_ms, x_mm, y_mm] = now;
        let is_later = index == 0 || step[0] > 0;
        let is_near = [x_mm, y_mm].iter().all(|mm| (*mm as f64).abs() <= MAX_MM);
        let time_ms = u64::try_from(time_ms).ok();
        let time_ms = time_ms.filter(|time| is_later && is_near && *time <= MAX_LENGTH_MS);
        let time_ms = time_ms.ok_or("times of a track rise, and its places are within 1000 km")?;
        observations.insert(time_ms, [x_mm, y_mm]);
    }
    Ok(observations)
}

/// Tracks from their texts.
///
/// # Errors
/// The number of the text that cannot be used, if it is one, and why.
pub fn of_texts<'a>(
    texts: impl Iterator<Item = &'a str>,
    length_ms: u64,
) -> Result<TrackSet, (Option<usize>, String)> {
    let mut people = Vec::new();
    let mut count = 0;
    for (index, text) in texts.enumerate() {
        let refuse = |reason: String| (Some(index), reason);
        let observations = of_text(text).map_err(refuse)?;
        count += observations.len();
        if people.len() == MAX_PEOPLE || count > MAX_OBSERVATIONS {
            return Err(refuse(format!(
                "more than {MAX_PEOPLE} people, or than {MAX_OBSERVATIONS} observations"
            )));
        }
        people.push(observations);
    }
    let length_ms = length_ms.min(MAX_LENGTH_MS);
    track_set(people, length_ms).map_err(|reason| (None, reason))
}

/// Digest of tracks: XXH3-128 of their texts, and of the length of the record.
#[must_use]
pub fn digest(texts: &[&str], length_ms: u64) -> String {
    let content = format!("{length_ms}\n{}", texts.join("\n"));
    format!("{:032x}", xxh3_128(content.as_bytes()))
}
