//! The units of an experiment that have been played, in files of lines.
//!
//! Every process appends to a file of its own, one line for each unit, and each line is sealed. A process that is killed leaves
//! at most a line without an end, which counts for nothing. Lines are found by the key of their unit, so it does not matter
//! which process wrote which line, nor how often: the same unit gives the same line.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use config::FileError;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::plan::{Key, Plan, UNITS, UNITS_ENDING};
use super::unit::{Played, UnitResult};
use export::draft::unwritable;

/// What a seal begins with, in the last field of a line.
const SEAL: &[u8] = b",\"seal\":\"";
/// Hexadecimal digits of a seal.
const DIGITS: usize = 16;
/// What a line begins with, before the key of its unit.
const KEY: &[u8] = b"{\"key\":\"";
/// Hexadecimal digits of a key.
const KEY_DIGITS: usize = 32;

/// The units that have been played.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    /// How far each file has been read.
    read: BTreeMap<PathBuf, ReadUpTo>,
    units: BTreeMap<Key, UnitResult>,
    damages: Vec<Damage>,
    conflicts: Vec<Key>,
    /// The file of this process; none before its first unit.
    own: Option<(PathBuf, File)>,
}

#[derive(Debug, Clone, Copy, Default)]
struct ReadUpTo {
    bytes: u64,
    lines: usize,
}

/// A line that is not as it was written.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Damage {
    file: PathBuf,
    /// Number of the line, from 1.
    line: usize,
    /// The key of its unit, as far as the line has one.
    key: Option<Key>,
}

/// A line of a file.
#[derive(Debug, Serialize, Deserialize)]
struct StoreLine {
    key: String,
    #[serde(flatten)]
    content: Content,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Content {
    Played(Played),
    Failed { failed: String },
}

impl Store {
    /// Reads the units that have been played, of which there may be none.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be read.
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        let mut store = Self {
            folder: folder.join(UNITS),
            read: BTreeMap::new(),
            units: BTreeMap::new(),
            damages: Vec::new(),
            conflicts: Vec::new(),
            own: None,
        };
        store.refresh()?;
        Ok(store)
    }

    /// Reads what other processes have written since.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be read.
    pub fn refresh(&mut self) -> Result<(), FileError> {
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(FileError::unreadable(&self.folder, &error)),
        };

        let mut files = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|error| FileError::unreadable(&self.folder, &error))?;
            let is_own = self
                .own
                .as_ref()
                .is_some_and(|(own, _)| *own == entry.path());
            if entry.file_name().to_string_lossy().ends_with(UNITS_ENDING) && !is_own {
                files.push(entry.path());
            }
        }
        files.sort();
        for file in files {
            self.read_on(&file)
                .map_err(|error| FileError::unreadable(&file, &error))?;
        }
        Ok(())
    }

    /// Reads a file from where it was read to before.
    fn read_on(&mut self, path: &Path) -> std::io::Result<()> {
        let mut place = self.read.get(path).copied().unwrap_or_default();
        let mut file = File::open(path)?;
        if file.metadata()?.len() <= place.bytes {
            return Ok(());
        }

        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(place.bytes))?;
        file.read_to_end(&mut bytes)?;
        for line in bytes.split_inclusive(|byte| *byte == b'\n') {
            // A line without an end: its process was killed, or is writing it.
            let Some(line) = line.strip_suffix(b"\n") else {
                break;
            };
            place.bytes += line.len() as u64 + 1;
            place.lines += 1;
            match decode(line) {
                Some((key, result)) => self.insert(key, result),
                None => self.damages.push(Damage {
                    file: path.to_owned(),
                    line: place.lines,
                    key: key_of(line),
                }),
            }
        }
        self.read.insert(path.to_owned(), place);
        Ok(())
    }

    /// Whether a unit has been played, and how.
    #[must_use]
    pub fn get(&self, key: Key) -> Option<&UnitResult> {
        self.units.get(&key)
    }

    /// Names the lines that are not as they were written and are those of these units of a plan, or of an unknown unit; for
    /// people. There are none where no unit is missing.
    #[must_use]
    pub fn damages_of(&self, plan: &Plan, missing: &[usize]) -> Vec<String> {
        let mut named = Vec::new();
        if self.damages.is_empty() || missing.is_empty() {
            return named;
        }

        let mut units = BTreeMap::new();
        for number in missing {
            let unit = plan.unit(*number);
            units.insert(unit.key, unit);
        }
        for damage in &self.damages {
            let place = format!("{}, line {}", damage.file.display(), damage.line);
            match damage.key.and_then(|key| units.get(&key)) {
                Some(unit) => named.push(format!("{place} is damaged: {}", unit.describe())),
                // It has been played again.
                None if damage.key.is_some_and(|key| self.units.contains_key(&key)) => {}
                None => named.push(format!("{place} is damaged, and its unit is unknown")),
            }
        }
        named
    }

    /// Units that were played several times and gave different runs.
    #[must_use]
    pub fn conflicts(&self) -> &[Key] {
        &self.conflicts
    }

    /// Adds a unit that was played by this process.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be written.
    pub fn add(&mut self, key: Key, result: UnitResult) -> Result<(), FileError> {
        let line = encode(key, &result);
        if self.own.is_none() {
            self.own = Some(self.create()?);
        }
        if let Some((path, file)) = &mut self.own {
            // One call, so that another process never sees a part of it followed by another line.
            file.write_all(&line)
                .map_err(|error| unwritable(path, &error))?;
        }
        self.insert(key, result);
        Ok(())
    }

    /// Makes a file that no other process has, on any machine.
    fn create(&self) -> Result<(PathBuf, File), FileError> {
        std::fs::create_dir_all(&self.folder).map_err(|error| unwritable(&self.folder, &error))?;
        let made = tempfile::Builder::new()
            .prefix("")
            .rand_bytes(12)
            .suffix(UNITS_ENDING)
            .permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666))
            .tempfile_in(&self.folder);
        let (file, path) = made
            .and_then(|file| file.keep().map_err(|error| error.error))
            .map_err(|error| unwritable(&self.folder, &error))?;
        Ok((path, file))
    }

    /// Notes how a unit was played. A unit that failed once and was played another time was played; of two different runs the
    /// one that is written first in order is kept, so that the order of reading does not matter.
    fn insert(&mut self, key: Key, result: UnitResult) {
        let Some(known) = self.units.get_mut(&key) else {
            self.units.insert(key, result);
            return;
        };

        let is_conflict = matches!((&*known, &result), (Ok(known), Ok(other)) if known != other);
        if is_conflict && !self.conflicts.contains(&key) {
            self.conflicts.push(key);
        }
        let is_better = match (&*known, &result) {
            (Ok(_), Err(_)) => false,
            (Err(_), Ok(_)) => true,
            _ => encode(key, &result) < encode(key, known),
        };
        if is_better {
            *known = result;
        }
    }
}

/// The line of a unit, with its end.
fn encode(key: Key, result: &UnitResult) -> Vec<u8> {
    let content = match result {
        Ok(played) => Content::Played(played.clone()),
        Err(reason) => Content::Failed {
            failed: reason.clone(),
        },
    };
    let line = StoreLine {
        key: key.to_string(),
        content,
    };
    let mut bytes = serde_json::to_vec(&line)
        .unwrap_or_else(|error| unreachable!("its numbers are finite: {error}"));

    bytes.pop(); // The closing brace comes after the seal.
    let seal = format!("{:0DIGITS$x}", xxh3_64(&bytes));
    bytes.extend_from_slice(SEAL);
    bytes.extend_from_slice(seal.as_bytes());
    bytes.extend_from_slice(b"\"}\n");
    bytes
}

/// The unit of a line, which is given without its end; `None` if the line is damaged.
fn decode(line: &[u8]) -> Option<(Key, UnitResult)> {
    let tail = SEAL.len() + DIGITS + b"\"}".len();
    let (body, tail) = line.split_at_checked(line.len().checked_sub(tail)?)?;
    let seal = tail.strip_prefix(SEAL)?.strip_suffix(b"\"}")?;
    if seal != format!("{:0DIGITS$x}", xxh3_64(body)).as_bytes() {
        return None;
    }

    let line: StoreLine = serde_json::from_slice(line).ok()?;
    let result = match line.content {
        Content::Played(played) => Ok(played),
        Content::Failed { failed } => Err(failed),
    };
    Some((line.key.parse().ok()?, result))
}

/// The key of a damaged line, if that part of it can be read.
fn key_of(line: &[u8]) -> Option<Key> {
    let digits = line.strip_prefix(KEY)?.get(..KEY_DIGITS)?;
    Key::from_str(std::str::from_utf8(digits).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use observe::Measured;

    use super::*;

    fn key(number: u8) -> Key {
        Key::from_str(&format!("{number:032x}")).unwrap()
    }

    fn played(value: f64) -> UnitResult {
        let measured = Measured::Value { value };
        Ok(Played {
            digest: "d".to_owned(),
            measures: BTreeMap::from([("m".to_owned(), measured)]),
            verdicts: BTreeMap::new(),
            unheard: Vec::new(),
        })
    }

    /// The one file of units.
    fn file(folder: &Path) -> PathBuf {
        let mut files = std::fs::read_dir(folder.join(UNITS)).unwrap();
        let file = files.next().unwrap().unwrap().path();
        assert!(files.next().is_none());
        file
    }

    #[test]
    fn a_cut_line_counts_for_nothing_and_a_damaged_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Store::open(folder.path()).unwrap();
        store.add(key(1), played(0.1)).unwrap();
        store
            .add(key(2), Err("it \"failed\"\n".to_owned()))
            .unwrap();
        store.add(key(3), played(3.0)).unwrap();
        let path = file(folder.path());
        let whole = std::fs::read(&path).unwrap();

        for end in 0..=whole.len() {
            std::fs::write(&path, &whole[..end]).unwrap();
            let found = Store::open(folder.path()).unwrap();
            let lines = whole[..end].iter().filter(|byte| **byte == b'\n').count();
            assert_eq!(found.units.len(), lines, "{end}");
            assert_eq!(found.damages, []);
        }

        for place in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[place] ^= 1;
            std::fs::write(&path, &damaged).unwrap();
            let found = Store::open(folder.path()).unwrap();
            assert!(
                !found.damages.is_empty() || found.units.len() < 3,
                "{place}"
            );
            for (key, result) in &found.units {
                assert_eq!(store.get(*key), Some(result), "{place}");
            }
        }
        let mut damaged = whole.clone();
        let middle = damaged.iter().position(|byte| *byte == b'\n').unwrap() + 50;
        damaged[middle] ^= 1;
        std::fs::write(&path, &damaged).unwrap();
        let found = Store::open(folder.path()).unwrap();
        let named = Damage {
            file: path,
            line: 2,
            key: Some(key(2)),
        };
        assert_eq!(found.damages, [named]);
    }

    #[test]
    fn units_of_several_processes_are_the_same_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut one = Store::open(folder.path()).unwrap();
        let mut other = Store::open(folder.path()).unwrap();
        one.add(key(1), Err("failed".to_owned())).unwrap();
        other.add(key(1), played(1.0)).unwrap();
        one.add(key(2), played(2.0)).unwrap();
        other.add(key(2), played(2.0)).unwrap();
        one.add(key(3), played(3.0)).unwrap();
        other.add(key(3), played(4.0)).unwrap();
        one.refresh().unwrap();
        other.refresh().unwrap();

        assert_eq!(one.units, other.units);
        assert_eq!(one.get(key(1)), Some(&played(1.0)));
        assert_eq!(one.conflicts(), [key(3)]);
        assert_eq!(other.conflicts(), [key(3)]);
    }
}
