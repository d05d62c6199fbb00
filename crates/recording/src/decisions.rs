//! The answers of `cars why` in the folder of a run.

use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use serde::Serialize;
use timeline::RunDecision;

/// Folder with the answers, in the folder of the run.
pub const ANSWERS: &str = "why";
/// Most answers of a run that are shown.
const MAX_ANSWERS: usize = 16;
/// Most bytes of an answer.
const MAX_BYTES: u64 = 2 << 20;

/// The answers about a run.
#[derive(Debug, Default, Serialize)]
pub struct RunDecisions {
    /// Those that can be shown, in the order of their files' names.
    pub all: Vec<RunDecision>,
    /// What cannot be shown, a sentence each.
    pub notes: Vec<String>,
}

impl RunDecisions {
    /// Reads the answers in the folder of a run. They may be of another epoch, or of a run that was here before: their digests tell.
    #[must_use]
    pub fn read(run: &Path) -> Self {
        let mut found = Self::default();
        let mut files = match answer_files(&run.join(ANSWERS)) {
            Ok(files) => files,
            Err(error) => {
                found
                    .notes
                    .push(format!("The folder {ANSWERS} cannot be read: {error}."));
                return found;
            }
        };
        if files.len() > MAX_ANSWERS {
            let beyond = files.split_off(MAX_ANSWERS).len();
            found
                .notes
                .push(format!("{beyond} more answers of cars why are not shown."));
        }

        for file in files {
            match read_answer(&file) {
                Ok(decision) => found.all.push(decision),
                Err(reason) => {
                    let name = file.file_name().unwrap_or_default().to_string_lossy();
                    found.notes.push(format!(
                        "{ANSWERS}/{name} cannot be shown: {reason}. cars why writes it anew."
                    ));
                }
            }
        }
        found
    }
}

/// The files of answers in a folder, by name; none if there is no folder.
fn answer_files(folder: &Path) -> Result<Vec<PathBuf>, std::io::Error> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    let mut files = Vec::new();
    for entry in entries {
        let file = entry?.path();
        if file
            .extension()
            .is_some_and(|extension| extension == "json")
        {
            files.push(file);
        }
    }
    files.sort();
    Ok(files)
}

fn read_answer(file: &Path) -> Result<RunDecision, String> {
    // No link is followed: the folder of a run may come from elsewhere.
    let kind = fs::symlink_metadata(file).map_err(|error| error.to_string())?;
    if !kind.is_file() {
        return Err("it is not a file".to_owned());
    }

    let mut text = Vec::new();
    let opened = File::open(file).map_err(|error| error.to_string())?;
    let read = opened.take(MAX_BYTES + 1).read_to_end(&mut text);
    read.map_err(|error| error.to_string())?;
    if text.len() as u64 > MAX_BYTES {
        return Err(format!("it has more than {MAX_BYTES} bytes"));
    }

    let decision: RunDecision = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
    decision.check()?;
    Ok(decision)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer with what is not shown, as `cars why` writes it.
    const ANSWER: &str = r#"{
        "version": "0.1.0", "run": "hall", "digest": "ab",
        "question": {"kind": "condition", "condition": "{ robot = \"Butler\" }"},
        "is_share": true, "recorded": 1.0, "tick_s": 0.5, "last": 20,
        "curve": [{"tick": 0, "n": 64, "value": 0.5, "low": 0.38, "high": 0.62}, {"tick": 20, "n": 1, "value": 1.0, "low": null, "high": null}],
        "jumps": [], "kinds": [], "planned": [], "least_jump": 0.1, "forks": 64, "is_complete": true,
        "sentence": "Nothing decided it."
    }"#;

    #[test]
    fn answers_are_read_and_what_is_damaged_is_said() {
        let run = tempfile::tempdir().unwrap();
        assert!(RunDecisions::read(run.path()).notes.is_empty());
        let folder = run.path().join(ANSWERS);
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("a.json"), ANSWER).unwrap();
        fs::write(folder.join("a.jsonl"), "{}").unwrap();
        fs::write(folder.join("b.json"), &ANSWER[..80]).unwrap();
        fs::write(
            folder.join("c.json"),
            ANSWER.replace("\"last\": 20", "\"last\": 19"),
        )
        .unwrap();
        fs::write(folder.join("d.json"), " ".repeat(MAX_BYTES as usize + 1)).unwrap();
        std::os::unix::fs::symlink("a.json", folder.join("e.json")).unwrap();

        let found = RunDecisions::read(run.path());
        assert_eq!(found.all.len(), 1);
        assert_eq!(found.all[0].question.name, "{ robot = \"Butler\" }");
        assert_eq!(found.all[0].curve[1].outcome.n, 1);
        let words = ["EOF", "after the last", "bytes", "not a file"];
        assert_eq!(found.notes.len(), words.len(), "{:?}", found.notes);
        for (note, words) in found.notes.iter().zip(words) {
            assert!(note.contains(words), "{note}");
        }
    }

    #[test]
    fn no_more_answers_than_can_be_shown_are_read() {
        let run = tempfile::tempdir().unwrap();
        let folder = run.path().join(ANSWERS);
        fs::create_dir(&folder).unwrap();
        for index in 10..10 + MAX_ANSWERS + 3 {
            fs::write(folder.join(format!("{index}.json")), ANSWER).unwrap();
        }
        let found = RunDecisions::read(run.path());
        assert_eq!(found.all.len(), MAX_ANSWERS);
        assert_eq!(found.notes, ["3 more answers of cars why are not shown."]);
    }
}
