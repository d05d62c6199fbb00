//! Comparison of two recorded epochs: where they differ first, and how they go on.

use std::collections::BTreeMap;

use protocol::{Event, Tick};
use record::EpochFiles;
use record::difference::{Difference, between};
use record::{Entry, Record};
use serde::Serialize;

use crate::error::LabError;

/// What came of a comparison.
#[derive(Debug, Default, Serialize)]
pub struct Comparison {
    /// The first difference; `None` if there is none in the ticks that both have.
    pub first: Option<Difference>,
    /// Number of ticks that both have, tick 0 included.
    pub ticks: u64,
    /// Number of these that differ in an event or a report.
    pub differing: u64,
    /// Last tick of each run.
    pub last: [Tick; 2],
    /// Events that one run has in a tick and the other has not: by kind, how many of each run.
    pub only_in: BTreeMap<String, [u64; 2]>,
}

impl Comparison {
    /// Whether the runs are the same.
    #[must_use]
    pub fn are_same(&self) -> bool {
        self.first.is_none() && self.last[0] == self.last[1]
    }
}

/// Compares two epochs.
///
/// # Errors
/// If a record cannot be read.
pub fn compare(a: &EpochFiles, b: &EpochFiles) -> Result<Comparison, LabError> {
    let mut records = [Record::open(a)?, Record::open(b)?];
    let mut comparison = Comparison::default();
    loop {
        let entries = [records[0].next_entry()?, records[1].next_entry()?];
        for (last, entry) in comparison.last.iter_mut().zip(&entries) {
            *last = entry.as_ref().map_or(*last, |entry| entry.tick);
        }

        match &entries {
            [None, None] => return Ok(comparison),
            [Some(one), Some(other)] if one.tick == other.tick => comparison.add(one, other),
            // One run is longer, or one has ended.
            _ => comparison.add_rest(&entries),
        }
    }
}

impl Comparison {
    fn add(&mut self, one: &Entry, other: &Entry) {
        if !one.is_end() && !other.is_end() {
            self.ticks += 1;
        }
        // Digest and field follow from everything up to their tick, so they hardly agree again.
        let difference = if self.first.is_none() {
            between(one, other)
        } else {
            between(&one.without_past(), &other.without_past())
        };
        let Some(difference) = difference else {
            return;
        };

        self.differing += u64::from(!one.is_end());
        self.count_events(0, one, other);
        self.count_events(1, other, one);
        self.first.get_or_insert(difference);
    }

    fn add_rest(&mut self, entries: &[Option<Entry>; 2]) {
        let none = Entry::default();
        for (index, entry) in entries.iter().enumerate() {
            if let Some(entry) = entry {
                self.count_events(index, entry, &none);
            }
        }
    }

    /// Counts the events of an entry that another one has not.
    fn count_events(&mut self, index: usize, entry: &Entry, other: &Entry) {
        let mut rest: Vec<&Event> = other.events.iter().collect();
        for event in &entry.events {
            if let Some(found) = rest.iter().position(|one| *one == event) {
                rest.swap_remove(found);
                continue;
            }
            if !matches!(event, Event::Tick { .. } | Event::End { .. }) {
                self.only_in.entry(event.kind().to_owned()).or_default()[index] += 1;
            }
        }
    }
}
