//! The scenario file of a finding.

use std::fs::File;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use config::{FileError, shipped};
use experiments::shell;
use export::draft::{self, unwritable};
use lab::LabError;
use protocol::name::MAX_NAME_LEN;
use protocol::plain::escape_line;
use protocol::time::time_s;
use toml::Value;

use super::case::FaultCase;
use super::fault::PlannedFault;
use super::trial::{RUNS, Subject, TrialResult};

/// What the file of a finding tells beside its case.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heading<'a> {
    /// The expectation that fails.
    pub expectation: &'a str,
    /// Seed of the hunt.
    pub seed: u64,
    /// Number of the plan.
    pub plan: u64,
    /// How far the plan is shrunk, in a sentence.
    pub shrunk: &'a str,
}

/// Writes the scenario file of a finding by renaming, so that a file of this name is always complete.
pub(super) fn write(
    path: &Path,
    subject: &Subject,
    case: &FaultCase,
    played: &TrialResult,
    heading: Heading<'_>,
) -> Result<(), LabError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut content = subject.content_of(case)?;
    rename_parameter_files(&mut content, &subject.folder, folder)?;

    let mut text = comment(path, subject, case, played, heading);
    text += &toml::to_string(&content).map_err(LabError::failed)?;
    draft::write(path, text)?;
    Ok(())
}

/// Makes an empty file with this name, or with a number behind it where there is one already: findings of other hunts stay.
pub(super) fn reserve(path: &Path) -> Result<PathBuf, LabError> {
    for candidate in candidates(path) {
        match File::create_new(&candidate) {
            Ok(_) => return Ok(candidate),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(unwritable(&candidate, &error).into()),
        }
    }
    Err(LabError::refused(format!(
        "{}: all names are taken",
        path.display()
    )))
}

/// Removes a file where an earlier hunt has written the same one, but for its name; returns the one that stays.
pub(super) fn keep_one(path: PathBuf, named: &Path) -> Result<PathBuf, LabError> {
    let own = text_without_names(&path)?;
    for candidate in candidates(named) {
        if candidate == path {
            break;
        }
        if text_without_names(&candidate).is_ok_and(|text| text == own) {
            std::fs::remove_file(&path).map_err(LabError::failed)?;
            return Ok(candidate);
        }
    }
    Ok(path)
}

/// The text of a finding without the lines that have its name.
fn text_without_names(path: &Path) -> Result<String, LabError> {
    let text =
        std::fs::read_to_string(path).map_err(|error| FileError::unreadable(path, &error))?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let lines = text.lines().filter(|line| !line.contains(&*stem));
    Ok(lines.collect::<Vec<_>>().join("\n"))
}

/// The path of a finding, then with numbers; each can be the name of a run.
fn candidates(path: &Path) -> impl Iterator<Item = PathBuf> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let stem = stem.into_owned();
    let numbered = (2u64..).map(move |number| {
        let number = format!("-{number}");
        let kept = stem.len().min(MAX_NAME_LEN.saturating_sub(number.len()));
        format!("{}{number}.toml", &stem[..kept])
    });
    let folder = path.with_file_name("");
    std::iter::once(path.to_owned()).chain(numbered.map(move |name| folder.join(name)))
}

fn comment(
    path: &Path,
    subject: &Subject,
    case: &FaultCase,
    played: &TrialResult,
    heading: Heading<'_>,
) -> String {
    let tick_s = subject.scenario.tick_s;
    let scenario = subject.file.display().to_string();
    let mut lines = vec![format!("Expectation that fails: {}", heading.expectation)];
    if let Some(failure) = played.failed.get(heading.expectation) {
        lines.push(failure.because.clone());
    }

    lines.push(String::new());
    lines.push(format!("It fails in {scenario} with:"));
    for fault in &case.faults {
        lines.push(format!("- {}", described(fault, played, tick_s)));
    }
    for robot in &case.without {
        lines.push(format!(
            "{robot} does not take part: the robot is not needed for it."
        ));
    }
    if let Some(guests) = case.guests {
        lines.push(format!("{guests} guests suffice."));
    }

    lines.push(String::new());
    lines.push(format!(
        "Found by plan {} of `cars hunt` with the seed {}. {}",
        heading.plan, heading.seed, heading.shrunk
    ));
    let file = shell::path(path);
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    lines.push(String::new());
    lines.push(format!(
        "    cars run {file} --run {stem}    # fails again, with exit status 1"
    ));
    if heading.expectation != RUNS {
        let expectation = shell::word(heading.expectation);
        lines.push(format!("    cars why {stem} {expectation}"));
    }
    lines.push(format!("    cars diagram runs/{stem} -o {stem}.svg"));
    lines.push(format!("    cars-console --recording runs/{stem}"));

    let mut text = String::new();
    for line in lines {
        text += format!("# {}", escape_line(&line)).trim_end();
        text += "\n";
    }
    text + "\n"
}

/// A fault in words, with the text of the command that it concerns.
fn described(fault: &PlannedFault, played: &TrialResult, tick_s: f64) -> String {
    let words = fault.in_words(tick_s);
    let Some((link, number)) = fault.command() else {
        return words;
    };

    let mut sent = played.sent.iter();
    match sent.find(|message| message.is(link, number)) {
        Some(message) => format!(
            "{words}: \"{}\", sent at {} s",
            message.text,
            time_s(message.tick, tick_s)
        ),
        None => words,
    }
}

/// Makes the names of parameter files relative to the folder of the new file.
fn rename_parameter_files(
    content: &mut toml::Table,
    from: &Path,
    to: &Path,
) -> Result<(), LabError> {
    let robots = content.get_mut("robot").and_then(Value::as_array_mut);
    for robot in robots.into_iter().flatten() {
        let Some(file) = robot.get_mut("params_from") else {
            continue;
        };
        let Some(name) = file.as_str() else {
            continue;
        };

        let path = from.join(name);
        if shipped::contains(&path) {
            *file = path.display().to_string().into();
            continue;
        }

        let path = path.canonicalize().map_err(LabError::failed)?;
        let folder = to.canonicalize().map_err(LabError::failed)?;
        *file = relative(&path, &folder).display().to_string().into();
    }

    Ok(())
}

/// A path relative to a folder; both are absolute.
fn relative(path: &Path, folder: &Path) -> PathBuf {
    let path: Vec<Component<'_>> = path.components().collect();
    let folder: Vec<Component<'_>> = folder.components().collect();
    let mut shared = 0;
    while shared < path.len() && path.get(shared) == folder.get(shared) {
        shared += 1;
    }

    let mut relative = PathBuf::new();
    for _ in shared..folder.len() {
        relative.push("..");
    }
    relative.extend(&path[shared..]);
    relative
}

/// The name of the file of a finding, without its folder. Without its extension it can be the name of a run.
pub(super) fn name(scenario: &Path, expectation: &str, seed: u64, plan: u64) -> String {
    let stem = scenario.file_stem().unwrap_or_default().to_string_lossy();
    let stem = legal(&stem, |c| c == '_' || c == '-');
    let expectation = legal(&expectation.to_ascii_lowercase(), |_| false);
    let mut name = format!("{stem}-{expectation}");
    let number = format!("-{seed}-{plan}");
    while name.len() > MAX_NAME_LEN.saturating_sub(number.len()) {
        // Whole words: the name is read by people. A name of one word is cut anywhere.
        let end = name.rfind('-').unwrap_or(name.len() - 1);
        name.truncate(end);
    }
    format!("{name}{number}.toml")
}

/// The letters and digits of a text, and what else is allowed; the rest becomes single hyphens.
fn legal(text: &str, is_allowed: fn(char) -> bool) -> String {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && !is_allowed(c));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_made_relative() {
        for (path, folder, expected) in [
            ("/a/b/c.toml", "/a/b", "c.toml"),
            ("/a/b/c.toml", "/a/hunt", "../b/c.toml"),
            ("/b/c.toml", "/a/hunt", "../../b/c.toml"),
        ] {
            assert_eq!(
                relative(Path::new(path), Path::new(folder)),
                Path::new(expected)
            );
        }
    }

    #[test]
    fn names_of_files_are_names_of_runs() {
        let name = name(Path::new("configs/hall.toml"), "No robot: ../stalls!", 7, 9);
        assert_eq!(name, "hall-no-robot-stalls-7-9.toml");

        let long = super::name(Path::new("a ä.toml"), &"word ".repeat(50), 1 << 52, 1 << 40);
        let stem = long.strip_suffix(".toml").unwrap();
        let words: Vec<&str> = stem.split('-').collect();
        let [first, words @ .., _seed, _plan] = &words[..] else {
            panic!("{stem}");
        };
        assert_eq!(*first, "a");
        assert_eq!(words, vec!["word"; 6], "whole words only: {stem}");
        assert!(protocol::RunName::new(stem).is_ok(), "{stem}");
    }
}
