//! What links of a launch are, whatever they are made of.

use std::path::Path;
use std::process::Command;

use protocol::RunName;

use super::shape::Shape;
use crate::link::Link;
use crate::options::RunOptions;

/// A launch to be started.
pub(super) struct Start<'a> {
    pub(super) file: &'a Path,
    pub(super) run: &'a RunName,
    pub(super) options: &'a RunOptions,
    pub(super) more: &'a [String],
}

impl Start<'_> {
    /// Arguments of `cars`, to launch over these links.
    pub(super) fn args(&self, links: &[Link]) -> Vec<String> {
        let mut args = vec!["launch".to_owned(), self.file.display().to_string()];
        args.extend(self.options.to_args(self.run));
        args.extend(links.iter().map(|link| format!("--link={link}")));
        args.extend(self.more.iter().cloned());
        args
    }
}

/// Links of a launch, one for each process; dropped, they are gone.
pub(super) trait Links {
    /// What launches over them.
    fn command(&self, start: &Start) -> miette::Result<Command>;
    /// From now on the link of this process is like this.
    fn set(&mut self, process: &str, shape: Shape) -> miette::Result<()>;
}
