//! What people are told about the lines of a program that are understood in part. The first line of a kind is explained in the
//! log of the run; the number of all of them is told at the end.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Counts what was remarked, by kind.
#[derive(Debug, Clone, Default)]
pub(super) struct Remarks(Arc<Mutex<BTreeMap<&'static str, RemarkCount>>>);

#[derive(Debug, Clone, Copy, Default)]
struct RemarkCount {
    total: u64,
    /// Whether it was explained in this epoch.
    is_explained: bool,
}

impl Remarks {
    /// Begins an epoch or an incarnation, whose log is to explain everything again.
    pub(super) fn start_over(&self) {
        self.with(|counts| {
            for count in counts.values_mut() {
                count.is_explained = false;
            }
        });
    }

    /// Counts a remark. Returns whether it is to be explained.
    pub(super) fn add(&self, kind: &'static str) -> bool {
        self.with(|counts| {
            let count = counts.entry(kind).or_default();
            count.total += 1;
            !std::mem::replace(&mut count.is_explained, true)
        })
    }

    /// A sentence for each kind that was remarked more than once.
    pub(super) fn in_words(&self) -> Vec<String> {
        self.with(|counts| {
            let repeated = counts.iter().filter(|(_, count)| count.total > 1);
            repeated
                .map(|(kind, count)| {
                    format!("{} of its lines `{kind}` had unknown fields", count.total)
                })
                .collect()
        })
    }

    fn with<T>(&self, act: impl FnOnce(&mut BTreeMap<&'static str, RemarkCount>) -> T) -> T {
        // Every change is a single step, so a panic leaves consistent counts.
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_explained_once_an_epoch_and_counted_for_all() {
        let remarks = Remarks::default();
        assert!(remarks.add("done"));
        assert!(!remarks.add("done"));
        assert!(remarks.add("query"));

        remarks.start_over();
        assert!(remarks.add("done"));
        assert_eq!(
            remarks.in_words(),
            ["3 of its lines `done` had unknown fields"]
        );
    }
}
