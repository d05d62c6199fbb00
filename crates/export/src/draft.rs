//! A file that appears under its name only when it is complete.

use std::fs::Permissions;
use std::io::{BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use config::FileError;
use tempfile::{Builder, NamedTempFile};

/// Permissions of a new file.
const NEW_FILE: u32 = 0o666;

/// A file under a temporary name beside its final one. [`Draft::publish`] renames it; one that is dropped is removed.
#[derive(Debug)]
pub struct Draft {
    file: BufWriter<NamedTempFile>,
    path: PathBuf,
}

impl Draft {
    /// Begins the file that a person has named. Where the path is a symbolic link, its target is replaced, and not the link.
    ///
    /// # Errors
    /// [`FileError`] as [`Self::create`].
    pub fn follow(path: &Path) -> Result<Self, FileError> {
        Self::create(&path.canonicalize().unwrap_or_else(|_| path.to_owned()))
    }

    /// Begins a file, which replaces an earlier one with its name when it is published.
    ///
    /// # Errors
    /// [`FileError`] if no file can be made in its folder, or something else than a file has its name.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        if path.is_symlink() {
            return Err(unwritable(path, &"it is a link"));
        }
        let path = path.to_owned();
        if path.exists() && !path.is_file() {
            return Err(unwritable(&path, &"something else than a file is there"));
        }
        let Some(name) = path.file_name() else {
            return Err(unwritable(&path, &"it has no name of a file"));
        };

        let mut prefix = std::ffi::OsString::from(".");
        prefix.push(name);
        prefix.push(".");
        let folder = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let file = Builder::new()
            .prefix(&prefix)
            .suffix(".draft")
            // Those of any other file: the user's mask applies.
            .permissions(Permissions::from_mode(NEW_FILE))
            .tempfile_in(folder)
            .map_err(|error| unwritable(&path, &error))?;
        Ok(Self {
            file: BufWriter::new(file),
            path,
        })
    }

    /// The name that the file gets.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the file its name. Returns it.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be written to its end, or renamed.
    pub fn publish(self) -> Result<PathBuf, FileError> {
        let file = self
            .file
            .into_inner()
            .map_err(|error| unwritable(&self.path, &error.error()))?;
        if let Ok(replaced) = self.path.metadata() {
            file.as_file()
                .set_permissions(replaced.permissions())
                .map_err(|error| unwritable(&self.path, &error))?;
        }
        file.persist(&self.path)
            .map_err(|error| unwritable(&self.path, &error.error))?;
        Ok(self.path)
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// Writes a file that is seen whole or not at all, as [`Draft::create`].
///
/// # Errors
/// [`FileError`] if it cannot be written.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), FileError> {
    let mut draft = Draft::create(path)?;
    draft
        .write_all(content.as_ref())
        .map_err(|error| unwritable(path, &error))?;
    draft.publish()?;
    Ok(())
}

/// The error of a file that cannot be written.
pub fn unwritable(path: &Path, reason: &dyn std::fmt::Display) -> FileError {
    FileError::new(format!("cannot write {}: {reason}", path.display()))
}
