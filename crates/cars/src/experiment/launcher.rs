//! How units of an experiment are launched as processes.

use std::process::Command;

use launch::child::{self, AtExit};

/// The command `cars`, whose process ends in order with the thread that starts it.
pub(super) fn launcher() -> Command {
    child::command(AtExit::Terminate, child::own_program())
}
