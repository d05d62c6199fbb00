//! How the programs beside `cars` begin.

use std::io::Write;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};

/// Goes on as the `cars` beside this program, under the name of this program: the process, its arguments and its environment stay.
/// So what the programs share is compiled once and stored once. Returns only if that `cars` cannot be run.
pub(crate) fn exec_cars(program: &str) -> ExitCode {
    let own = std::env::current_exe().unwrap_or_else(|_| program.into());
    let cars = own.with_file_name("cars");

    let error = Command::new(&cars)
        .arg0(program)
        .args(std::env::args_os().skip(1))
        .exec();
    let place = cars.display();
    // Nobody is there to read it.
    let _unprinted = writeln!(
        std::io::stderr(),
        "error: {program} needs the program {place}, which cannot be run: {error}\n  help: install all programs of CARS in one folder"
    );
    ExitCode::FAILURE
}
