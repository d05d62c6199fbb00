//! The files that come with the programs: launch files, scenarios, experiments, parameters of robots, people, faults of links. They are
//! read like any file, at paths below a folder that is in the programs and not on the disk.

use std::path::{Component, Path, PathBuf};

/// The folder of these files. It is absolute, so that a path into it means the same in every process.
const FOLDER: &str = "/built-in";

/// Where launch files are.
pub const LAUNCHES: &str = "launch";
/// Where scenarios are.
pub const SCENARIOS: &str = "configs";
/// Where experiments are.
pub const EXPERIMENTS: &str = "configs/experiments";
/// Where parameters of robots are.
pub const PARAMETERS: &str = "configs/robots";
/// Where plans of faults of real links are.
pub const LINKS: &str = "configs/links";

/// Paths, as in the project's folder, and texts.
macro_rules! texts {
    ($($path:literal,)*) => {
        [$(($path, include_str!(concat!("../../../", $path)))),*]
    };
}

/// All but the launch files that start programs of the project's folder.
const FILES: &[(&str, &str)] = &texts![
    "configs/any_language.toml",
    "configs/auction.toml",
    "configs/crowded_hall.toml",
    "configs/deliberate.toml",
    "configs/experiments/affect.toml",
    "configs/experiments/auction.toml",
    "configs/experiments/crowd.toml",
    "configs/experiments/deadlock.toml",
    "configs/experiments/guests.toml",
    "configs/experiments/partition.toml",
    "configs/experiments/radios.toml",
    "configs/experiments/recruitment.toml",
    "configs/experiments/signals.toml",
    "configs/experiments/swarm.toml",
    "configs/experiments/teams.toml",
    "configs/experiments/tune_thresholds.toml",
    "configs/experiments/tune_timer.toml",
    "configs/hors_doeuvres.toml",
    "configs/links/cut_leguin.toml",
    "configs/museum.toml",
    "configs/pantry.toml",
    "configs/partition.toml",
    "configs/people/reception.txt",
    "configs/recorded_hall.toml",
    "configs/recruitment.toml",
    "configs/robots/butler.toml",
    "configs/robots/leguin.toml",
    "configs/signals.toml",
    "configs/swarm.toml",
    "configs/three_robots.toml",
    "configs/waiter.toml",
    "configs/walled_hall.toml",
    "launch/auction.toml",
    "launch/hors_doeuvres.toml",
    "launch/museum.toml",
    "launch/partition.toml",
    "launch/recorded_hall.toml",
    "launch/swarm.toml",
    "launch/three_robots.toml",
];

/// All files: the path of each below the folder, with `/` between its parts, and its text.
pub fn files() -> impl Iterator<Item = (&'static str, &'static str)> {
    FILES.iter().copied()
}

/// The file that a person means: the one at this path, or, if there is none, the one of this name in the first of these folders
/// that has one. Any other path stays as it is.
#[must_use]
pub fn find(given: &Path, folders: &[&str]) -> PathBuf {
    let is_name = given.extension().is_none() && given.components().count() == 1;
    if !is_name || given.is_file() {
        return given.to_owned();
    }

    folders
        .iter()
        .map(|folder| path(folder).join(given).with_extension("toml"))
        .find(|path| text(path).is_some())
        .unwrap_or_else(|| given.to_owned())
}

/// The names in one of the folders, in their order.
pub fn names(folder: &str) -> impl Iterator<Item = &'static str> {
    files().filter_map(move |(path, _)| {
        let name = path.strip_prefix(folder)?.strip_prefix('/')?;
        name.strip_suffix(".toml")
            .filter(|name| !name.contains('/'))
    })
}

/// The path of a file or folder that comes with the programs.
#[must_use]
pub fn path(name: &str) -> PathBuf {
    Path::new(FOLDER).join(name)
}

/// Whether a path leads to one of these files.
#[must_use]
pub fn contains(path: &Path) -> bool {
    text(path).is_some()
}

/// The text at a path; `None` if there is none, or the path is on the disk.
pub(crate) fn text(path: &Path) -> Option<&'static str> {
    let path = without_dots(path);
    let name = path.strip_prefix(FOLDER).ok()?;
    let (_, text) = files().find(|(known, _)| Path::new(known) == name)?;
    Some(text)
}

/// The path without `.` and `..`: there are no symbolic links among these files.
fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            _ => plain.push(part),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;

    use super::*;

    /// Launch files that start programs of the project's folder.
    const NOT_BUILT_IN: [&str; 3] = [
        "launch/any_language.toml",
        "launch/leguin_in_python.toml",
        "launch/mixed.toml",
    ];

    fn collect(folder: &Path, below: &str, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder.join(below)).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{below}/{}", entry.file_name().to_str().unwrap());
            if entry.path().is_dir() {
                collect(folder, &name, found);
            } else if name.ends_with(".toml") || name.ends_with(".txt") {
                found.insert(name);
            }
        }
    }

    #[test]
    fn every_file_of_the_project_is_built_in() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut expected = BTreeSet::new();
        collect(&root, "configs", &mut expected);
        collect(&root, "launch", &mut expected);
        for name in NOT_BUILT_IN {
            assert!(expected.remove(name), "{name}");
        }

        let found: BTreeSet<String> = files().map(|(path, _)| path.to_owned()).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_name_means_the_file_of_the_first_folder_that_has_it() {
        let folders = [LAUNCHES, SCENARIOS];
        let found = |given: &str| find(Path::new(given), &folders).display().to_string();
        assert_eq!(found("partition"), "/built-in/launch/partition.toml");
        assert_eq!(found("deliberate"), "/built-in/configs/deliberate.toml");
        assert_eq!(found("nothing"), "nothing");
        assert_eq!(found("partition.toml"), "partition.toml");
        assert_eq!(found("configs/partition"), "configs/partition");
    }

    #[test]
    fn a_file_is_found_however_it_is_named() {
        let text_at = |path: &str| text(Path::new(path));
        let scenario = text_at("/built-in/configs/partition.toml");
        assert!(scenario.is_some());
        let through = "/built-in/launch/../configs/./partition.toml";
        assert_eq!(text_at(through), scenario);
        assert_eq!(text_at("/built-in/configs"), None);
        assert_eq!(text_at("/built-in/../configs/partition.toml"), None);
        assert_eq!(text_at("configs/partition.toml"), None);
    }

    #[test]
    fn names_are_those_of_one_folder() {
        let names: Vec<&str> = names(EXPERIMENTS).collect();
        let experiments = [
            "affect",
            "auction",
            "crowd",
            "deadlock",
            "guests",
            "partition",
            "radios",
            "recruitment",
            "signals",
            "swarm",
            "teams",
            "tune_thresholds",
            "tune_timer",
        ];
        assert_eq!(names, experiments);
        assert!(!super::names(SCENARIOS).any(|name| name.contains('/')));
    }
}
