//! The Python package of this checkout, with the module of this build.

use std::io::ErrorKind;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use crate::{eventually, programs, root};

/// A folder in which Python finds the package `cars`: its sources, and the module that this build has made.
///
/// # Panics
/// If the folder cannot be made.
#[must_use]
pub fn package() -> &'static Path {
    static PACKAGE: OnceLock<PathBuf> = OnceLock::new();

    PACKAGE.get_or_init(|| {
        let folder = programs().join("python");
        let package = folder.join("cars");
        std::fs::create_dir_all(&package).unwrap();
        let sources = root().join("sdk/python/src/cars");
        for entry in std::fs::read_dir(sources).unwrap() {
            let entry = entry.unwrap();
            link(&entry.path(), &package.join(entry.file_name()));
        }
        // A copy: whoever builds the wheel makes the module of this build anew. Its name is given when it is complete.
        let module = package.join(format!("_cars.{}", std::process::id()));
        eventually("the module", || {
            std::fs::copy(programs().join("lib_cars.so"), &module).ok()
        });
        std::fs::rename(module, package.join("_cars.abi3.so")).unwrap();
        folder
    })
}

/// Other test programs do the same at the same time.
fn link(file: &Path, name: &Path) {
    match symlink(file, name) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
        linked => linked.unwrap(),
    }
}

/// A Python that knows the package, in the project's root, without variables of other runs.
#[must_use]
pub fn python() -> Command {
    let mut python = Command::new("python3");
    python
        .current_dir(root())
        .env("PYTHONPATH", package())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stdin(Stdio::null());
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CARS_")) {
        python.env_remove(name);
    }

    python
}
