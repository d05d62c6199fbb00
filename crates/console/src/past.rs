//! The recorded past of a run: the recordings in its folder, of which the last one may grow.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use protocol::{Epoch, RunName};
use recording::{RecordingError, RunDecisions};

use crate::playback::{OpenError, RecordedEpoch};

/// Recordings of earlier epochs that are kept open.
const MAX_EARLIER: usize = 4;
/// Most epochs that are listed, the newest ones.
const MAX_EPOCHS: usize = 100;

/// The recorded epochs of a run.
#[derive(Debug)]
pub(crate) struct RecordedEpochs {
    place: RecordingSource,
    open: Mutex<Open>,
}

/// Where the recordings are.
#[derive(Debug)]
enum RecordingSource {
    /// A run that is over, or the recording of one epoch.
    Finished {
        /// Folder of the other epochs; none if one epoch was asked for.
        folder: Option<PathBuf>,
    },
    /// The folder of a run in progress.
    Growing {
        /// The folder, which may not be there yet.
        folder: PathBuf,
        /// The run.
        run: RunName,
    },
}

#[derive(Debug, Default)]
struct Open {
    last: Option<Arc<RecordedEpoch>>,
    earlier: BTreeMap<Epoch, Arc<RecordedEpoch>>,
    /// Number of recordings that were the last one so far.
    number: u64,
}

impl RecordedEpochs {
    /// The recording in a run's folder and those of its earlier epochs, or a recording alone: `RUN/run-epoch1.mcap`.
    ///
    /// # Errors
    /// [`OpenError`] names the file.
    pub(crate) fn finished(path: &Path) -> Result<Self, OpenError> {
        let (file, folder) = if path.is_dir() {
            (path.join(recording::FILE), Some(path.to_owned()))
        } else {
            (path.to_owned(), None)
        };

        let last = Arc::new(RecordedEpoch::open(&file, 1)?);
        Ok(Self {
            place: RecordingSource::Finished { folder },
            open: Mutex::new(Open {
                last: Some(last),
                ..Open::default()
            }),
        })
    }

    /// What a run in progress has recorded in its folder.
    pub(crate) fn growing(folder: PathBuf, run: RunName) -> Self {
        Self {
            place: RecordingSource::Growing { folder, run },
            open: Mutex::default(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The recording of the last epoch, as far as it is complete now.
    ///
    /// # Errors
    /// [`OpenError`] if there is none, or it cannot be read.
    pub(crate) fn last(&self) -> Result<Arc<RecordedEpoch>, OpenError> {
        // One look at a time: two requests that find the file grown would read it twice.
        let mut open = self.lock();
        let RecordingSource::Growing { folder, run } = &self.place else {
            return open.last.clone().ok_or(OpenError::NoEpoch);
        };

        let file = folder.join(recording::FILE);
        // By its identity, not by its name: `init` and a further run put another file in its place.
        if let Some(last) = open.last.as_ref().filter(|last| last.is_at(&file)) {
            last.grow()?;
            return Ok(last.clone());
        }

        open.last = None;
        let opened = RecordedEpoch::open(&file, open.number + 1);
        let last = opened.map_err(|error| match error {
            OpenError::Unreadable(RecordingError::Damaged { .. }) => error,
            _ => OpenError::NotYet,
        })?;

        // The folder may have been copied or renamed: its recording is then of another run.
        if last.run() != run.as_str() {
            return Err(OpenError::OtherRun(file.display().to_string()));
        }
        // A page that shows the recording before finds another number, and starts anew.
        open.number += 1;
        open.earlier.clear();
        Ok(open.last.insert(Arc::new(last)).clone())
    }

    /// The recording of an epoch; of the last one without a number.
    ///
    /// # Errors
    /// [`OpenError`] if there is none, or it cannot be read.
    pub(crate) fn epoch(&self, epoch: Option<Epoch>) -> Result<Arc<RecordedEpoch>, OpenError> {
        // Outside of the lock below, which this takes itself.
        let last = self.last();
        let Some(epoch) = epoch else {
            return last;
        };
        if let Ok(last) = last
            && last.epoch() == epoch
        {
            return Ok(last);
        }

        let mut open = self.lock();
        if let Some(known) = open.earlier.get(&epoch) {
            return Ok(known.clone());
        }
        let folder = self.folder().ok_or(OpenError::NoEpoch)?;
        let file = folder.join(earlier_name(epoch));
        let earlier = Arc::new(RecordedEpoch::open(&file, open.number)?);
        // The oldest epoch makes room: opening a recording again is cheap.
        if open.earlier.len() == MAX_EARLIER {
            open.earlier.pop_first();
        }
        open.earlier.insert(epoch, earlier.clone());
        Ok(earlier)
    }

    /// The answers of `cars why` about an epoch; `None` if the folder of the run or the recording of the epoch is not there.
    pub(crate) fn decisions(&self, epoch: Option<Epoch>) -> Option<RunDecisions> {
        let mut found = RunDecisions::read(self.folder()?);
        if !found.all.is_empty() {
            let recorded = self.epoch(epoch).ok()?;
            found.all.retain(|decision| recorded.is_of(decision));
        }
        Some(found)
    }

    /// The epochs that have a recording, in order: the newest [`MAX_EPOCHS`]. One that has just begun may have none yet.
    pub(crate) fn epochs(&self) -> Vec<Epoch> {
        let last = self.last().ok().map(|last| last.epoch());
        // Between two epochs there may be no last one: then the earlier ones are counted.
        let next = last.or_else(|| (1..).find(|epoch| !self.has_earlier(*epoch)));

        let earlier = (1..next.unwrap_or(1)).rev().take(MAX_EPOCHS);
        let mut epochs: Vec<Epoch> = earlier.filter(|epoch| self.has_earlier(*epoch)).collect();
        epochs.reverse();
        epochs.extend(last);
        epochs
    }

    /// Whether there is a recording of an epoch that `init` has ended.
    fn has_earlier(&self, epoch: Epoch) -> bool {
        let file = self.folder().map(|folder| folder.join(earlier_name(epoch)));
        file.is_some_and(|file| file.exists())
    }

    fn folder(&self) -> Option<&Path> {
        match &self.place {
            RecordingSource::Finished { folder } => folder.as_deref(),
            RecordingSource::Growing { folder, .. } => Some(folder),
        }
    }
}

/// The recording of an epoch that `init` has ended.
fn earlier_name(epoch: Epoch) -> String {
    let stem = recording::FILE.trim_end_matches(".mcap");
    format!("{stem}-epoch{epoch}.mcap")
}
