//! `[tracks]` of a record: where recorded guests were, in the hall, so that a run does not need the file that it took them from.

use std::ops::Range as Span;

use config::units::Time;
use config::{FileError, Source};
use import::tracks::{self, TrackSet};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::unplaced::unplaced;
use crate::guests::RecordedGuests;

/// The table.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TracksTable {
    /// Digest of all that follows: tracks that were edited by mistake would make another run of the same record.
    digest: Spanned<String>,
    /// From the first frame to the one after the last.
    length: Spanned<Time>,
    /// For each person: time in ms, x and y in mm of the first point, then the differences of the others.
    people: Vec<Spanned<String>>,
}

impl TracksTable {
    pub(super) fn of(recorded: &RecordedGuests) -> Self {
        let texts: Vec<String> = recorded.tracks.iter().map(tracks::to_text).collect();
        let borrowed: Vec<&str> = texts.iter().map(String::as_str).collect();
        let length_ms = recorded.length_ms.get();
        Self {
            digest: unplaced(tracks::digest(&borrowed, length_ms)),
            length: unplaced(Time(length_ms as f64 / 1000.0)),
            people: texts.into_iter().map(unplaced).collect(),
        }
    }

    /// Reads the tracks, and checks that they are those of the digest.
    pub(super) fn read(&self, span: Span<usize>, source: &Source) -> Result<TrackSet, FileError> {
        let length_s = self.length.get_ref().0;
        let length_ms = (length_s * 1000.0).round();
        if !(1.0..=1e15).contains(&length_ms) {
            let reason = "the length of a record must be more than zero";
            return Err(FileError::at(source, Some(self.length.span()), reason));
        }
        let length_ms = length_ms as u64;

        let texts: Vec<&str> = self
            .people
            .iter()
            .map(|text| text.get_ref().as_str())
            .collect();
        let digest = tracks::digest(&texts, length_ms);
        if digest != *self.digest.get_ref() {
            let reason = format!(
                "these tracks are not those that the run had: their digest is {digest}. Take the record as it was written, or take \
                 this table out and set `from` of [guests]"
            );
            return Err(FileError::at(source, Some(self.digest.span()), &reason));
        }
        tracks::of_texts(texts.into_iter(), length_ms).map_err(|(index, reason)| {
            let place = index.and_then(|index| self.people.get(index));
            let span = place.map_or(span, Spanned::span);
            FileError::at(source, Some(span), &reason)
        })
    }
}
