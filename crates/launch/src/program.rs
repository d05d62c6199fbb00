//! Where a program of a launch file is found.

use std::path::{Path, PathBuf};

/// Places that were searched in vain.
#[derive(Debug, PartialEq)]
pub(super) struct NotFound(pub(super) Vec<String>);

/// Where programs are looked for.
#[derive(Debug, Clone)]
pub(super) struct Places {
    /// Folder of the running executable: what was built together runs together.
    pub(super) beside: Option<PathBuf>,
    /// Folder of the launch file, for programs that are given by a path.
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

    /// The program's absolute path.
    pub(super) fn find(&self, program: &str) -> Result<PathBuf, NotFound> {
        if program.contains('/') {
            let file = self.launch_file.join(program);
            let found = Some(&file)
                .filter(|file| is_program(file))
                .and_then(|file| std::path::absolute(file).ok());
            return found.ok_or_else(|| {
                NotFound(vec![format!(
                    "at {} (from the launch file)",
                    file.display()
                )])
            });
        }

        let beside = self.beside.iter().map(|folder| folder.join(program));
        let mut candidates = beside.chain(self.path.iter().map(|folder| folder.join(program)));
        let found = candidates
            .find(|file| is_program(file))
            .and_then(|file| std::path::absolute(file).ok());

        found.ok_or_else(|| {
            let beside = self
                .beside
                .iter()
                .map(|folder| format!("in {} (beside this program)", folder.display()));
            NotFound(
                beside
                    .chain(["in the folders of PATH".to_owned()])
                    .collect(),
            )
        })
    }
}

fn is_program(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    file.metadata()
        .is_ok_and(|metadata| metadata.is_file() && metadata.permissions().mode() & 0o111 != 0)
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
