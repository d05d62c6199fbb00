//! Locates the programs of a launch file.

use std::path::{Path, PathBuf};

/// The programs that come with `cars`, and the packages that they are of.
pub const SIBLINGS: [(&str, &str); 7] = [
    ("cars-sim", "simulator"),
    ("cars-console", "console"),
    ("cars-butler", "robots"),
    ("cars-leguin", "robots"),
    ("cars-vonda", "robots"),
    ("cars-bidder", "robots"),
    ("cars-scout", "robots"),
];

/// The path of a program that comes with `cars`: beside this one, or in a folder of `PATH`.
#[must_use]
pub fn find_sibling(program: &str) -> Option<PathBuf> {
    Places::new(Path::new("/")).find(program).ok()
}

/// How to get a program that is not there.
pub(super) fn how_to_install(program: &str) -> String {
    let build = "the programs of this project are built by `cargo build --release`";
    match SIBLINGS.iter().find(|(name, _)| *name == program) {
        Some((_, package)) => format!(
            "{build}\nto install this one, from a checkout:\n`cargo install --locked --path crates/{package}`"
        ),
        None => build.to_owned(),
    }
}

/// A program was not found in these places.
#[derive(Debug, PartialEq)]
pub(super) struct NotFound(pub(super) Vec<String>);

/// Places to search for programs.
#[derive(Debug, Clone)]
pub(super) struct Places {
    /// Folder of this executable: programs of one build run together.
    pub(super) beside: Option<PathBuf>,
    /// Folder of the launch file, for programs with a `/`.
    pub(super) launch_file: PathBuf,
    /// Folders of `PATH`.
    pub(super) path: Vec<PathBuf>,
}

impl Places {
    /// The places of this process.
    pub(super) fn new(launch_file: &Path) -> Self {
        let own = std::env::current_exe().ok();
        let path = std::env::var_os("PATH").unwrap_or_default();
        Self {
            beside: own.and_then(|own| Some(own.parent()?.to_owned())),
            launch_file: launch_file.to_owned(),
            path: std::env::split_paths(&path).collect(),
        }
    }

    /// The absolute path of a program.
    pub(super) fn find(&self, program: &str) -> Result<PathBuf, NotFound> {
        if program.contains('/') {
            let file = self.launch_file.join(program);
            let place = format!("at {} (from the launch file)", file.display());
            return absolute(&file).ok_or(NotFound(vec![place]));
        }

        for folder in self.beside.iter().chain(&self.path) {
            if let Some(found) = absolute(&folder.join(program)) {
                return Ok(found);
            }
        }
        Err(NotFound(self.searched()))
    }

    fn searched(&self) -> Vec<String> {
        let mut places = Vec::new();
        if let Some(folder) = &self.beside {
            places.push(format!("in {} (beside this program)", folder.display()));
        }
        places.push("in the folders of PATH".to_owned());
        places
    }
}

/// The absolute path of a file, if it is a program.
fn absolute(file: &Path) -> Option<PathBuf> {
    if !is_program(file) {
        return None;
    }
    std::path::absolute(file).ok()
}

fn is_program(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    let Ok(metadata) = file.metadata() else {
        return false;
    };
    metadata.is_file() && metadata.permissions().mode() & 0o111 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beside_comes_before_path_and_a_slash_means_from_the_launch_file() {
        let places = Places {
            beside: Some("/bin".into()),
            launch_file: "/usr/../bin".into(),
            path: vec!["/usr/bin".into()],
        };

        assert_eq!(places.find("sh").unwrap(), Path::new("/bin/sh"));
        assert_eq!(places.find("./sh").unwrap(), Path::new("/usr/../bin/sh"));

        let elsewhere = Places {
            beside: Some("/nowhere".into()),
            ..places.clone()
        };
        assert_eq!(elsewhere.find("sh").unwrap(), Path::new("/usr/bin/sh"));

        let NotFound(places) = places.find("no-such-program").unwrap_err();
        assert_eq!(
            places,
            ["in /bin (beside this program)", "in the folders of PATH"]
        );
    }
}
