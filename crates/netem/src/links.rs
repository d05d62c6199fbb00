//! The interface of all kinds of links.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use launch::{LaunchError, ProcessLink, RunOptions};
use protocol::RunName;

use super::shape::LinkShape;

/// A launch to be started over links.
pub(super) struct Start<'a> {
    /// The launch file.
    pub(super) file: &'a Path,
    pub(super) run: &'a RunName,
    pub(super) options: &'a RunOptions,
    /// Further arguments of `cars launch`.
    pub(super) more: &'a [String],
}

impl Start<'_> {
    /// Arguments of `cars` for a launch over these links.
    pub(super) fn args(&self, links: &[ProcessLink]) -> Vec<OsString> {
        let mut args = vec!["launch".into(), self.file.as_os_str().to_owned()];
        args.extend(self.options.to_args(self.run));
        args.extend(links.iter().map(|link| format!("--link={link}").into()));
        args.extend(self.more.iter().map(OsString::from));
        args
    }
}

/// The path of this program, for programs that start it.
pub(super) fn own_path() -> Result<PathBuf, LaunchError> {
    std::env::current_exe().map_err(LaunchError::system("the path of this program is not known"))
}

/// The links of a launch, one for each process. They are removed on drop.
pub(super) trait Links {
    /// The command that starts the launch over these links.
    fn command(&self, start: &Start) -> Result<Command, LaunchError>;
    /// Changes the shape of a process's link.
    fn set(&mut self, process: &str, shape: LinkShape) -> Result<(), LaunchError>;
}
