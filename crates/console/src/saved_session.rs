//! What a console leaves for the one that is started after it, in a file that only its owner can read.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::net::SocketAddr;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::guard::Guard;

/// Others may not read the file: it has the token.
const OWN: u32 = 0o600;

/// Address and secrets of a console.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedSession {
    pub(crate) address: SocketAddr,
    pub(crate) token: String,
    pub(crate) path: String,
}

impl SavedSession {
    /// What a console leaves.
    pub(crate) fn of(guard: &Guard) -> Self {
        Self {
            address: guard.address(),
            token: guard.token().to_owned(),
            path: guard.path().to_owned(),
        }
    }

    /// What the console before has left; `None` if there was none, or others could have read or written it.
    pub(crate) fn read(file: &Path) -> Option<Self> {
        // A token that others could have read is not used again, and one that they could have written
        // is theirs.
        let found = fs::symlink_metadata(file).ok()?;
        if !found.is_file() || found.permissions().mode() & 0o077 != 0 {
            return None;
        }
        Self::parse(&fs::read(file).ok()?)
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let kept: Self = serde_json::from_slice(bytes).ok()?;
        kept.is_sound().then_some(kept)
    }

    /// Whether token and path are such as a console draws: a path with something else would be another route.
    fn is_sound(&self) -> bool {
        let is_hex = |text: &str| text.len() >= 16 && text.bytes().all(|b| b.is_ascii_hexdigit());
        let path = self.path.strip_prefix('/');
        let path = path.and_then(|path| path.strip_suffix('/'));
        is_hex(&self.token) && path.is_some_and(is_hex)
    }

    /// Checks that a file which is not what a console has left for this one may be replaced: it has to be what a console leaves and
    /// others could read.
    pub(crate) fn check_replaceable(file: &Path) -> Result<(), String> {
        let failed = |error| format!("cannot read {}: {error}", file.display());
        match file.symlink_metadata() {
            // A link, a device and a pipe are not even read.
            Ok(found) if found.is_file() => {
                let bytes = fs::read(file).map_err(failed)?;
                if Self::parse(&bytes).is_some() {
                    return Ok(());
                }
            }
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(failed(error)),
        }

        Err(format!(
            "{} is there, and is not what a console keeps: name another file by --keep",
            file.display()
        ))
    }

    /// Leaves it for the console after this one.
    pub(crate) fn write(&self, file: &Path) -> std::io::Result<()> {
        let text = serde_json::to_vec(self)?;
        // Nobody else's: two consoles are two processes.
        let mut unfinished = file.as_os_str().to_owned();
        unfinished.push(format!(".{}.new", std::process::id()));

        let mut options = OpenOptions::new();
        let mut to = options
            .write(true)
            .create_new(true)
            .mode(OWN)
            .open(&unfinished)?;

        to.write_all(&text)?;
        fs::rename(&unfinished, file).inspect_err(|_| {
            let _is_not_there = fs::remove_file(&unfinished);
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_read_again_only_where_nobody_else_could_read_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("console.kept");
        let guard = Guard::new("127.0.0.1:7007".parse().unwrap()).unwrap();
        let kept = SavedSession::of(&guard);
        kept.write(&file).unwrap();
        assert_eq!(SavedSession::read(&file), Some(kept));

        fs::set_permissions(&file, fs::Permissions::from_mode(0o644)).unwrap();
        assert_eq!(SavedSession::read(&file), None);
        assert_eq!(SavedSession::read(&folder.path().join("none")), None);
        assert_eq!(SavedSession::check_replaceable(&file), Ok(()));
        assert_eq!(
            SavedSession::check_replaceable(&folder.path().join("none")),
            Ok(())
        );

        assert!(SavedSession::check_replaceable(Path::new("/dev/null")).is_err());
        fs::write(&file, "").unwrap();
        assert!(SavedSession::check_replaceable(&file).is_err());
        fs::write(&file, "{\"tick\":0}\n").unwrap();
        let refused = SavedSession::check_replaceable(&file).unwrap_err();
        assert!(refused.contains("is not what a console keeps"), "{refused}");
    }

    #[test]
    fn a_path_that_no_console_draws_is_not_served() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("console.kept");
        for path in ["/", "//", "/{*x}/", "/assets/", "0123456789abcdef"] {
            let kept = SavedSession {
                address: "127.0.0.1:7007".parse().unwrap(),
                token: "0123456789abcdef".to_owned(),
                path: path.to_owned(),
            };
            kept.write(&file).unwrap();
            assert_eq!(SavedSession::read(&file), None, "{path}");
        }
    }
}
