//! Robots of Python in a run of processes.

use std::sync::Once;

use clap::Parser;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use robot::{End, Host, HostError as RobotHostError, Robot, RobotArgs, RobotName};

use crate::error::HostError;
use crate::interrupt::interruptible;
use crate::processes::use_one_thread;
use crate::runner::{FirstException, PythonRobot};

type Robots = Vec<(RobotName, Box<dyn Robot>)>;

/// Runs a robot's program, and returns its exit status: 0 if the run ended, 1 if an error ended it, 2 for wrong arguments. `make` is
/// called with a name and returns the robot; the first of the arguments is the name of the program.
#[pyfunction]
pub(crate) fn main(
    py: Python<'_>,
    default_name: &str,
    make: &Bound<'_, PyAny>,
    arguments: Vec<String>,
) -> PyResult<i32> {
    let mut args = match RobotArgs::try_parse_from(arguments) {
        Ok(args) => args,
        Err(error) => {
            // Nobody is there to read it.
            let _unprinted = error.print();
            return Ok(error.exit_code());
        }
    };
    if args.names.is_empty() {
        args.names.extend(RobotName::new(default_name));
    }
    print_diagnostics();

    let failure = FirstException::default();
    let mut robots: Robots = Vec::new();
    for name in &args.names {
        let object = make.call1((name.as_str(),))?;
        robots.push((name.clone(), Box::new(PythonRobot::new(&object, &failure)?)));
    }
    let Err(error) = play(py, robots, &args, &failure) else {
        return Ok(0);
    };
    if error.is_instance_of::<crate::error::Error>(py) {
        terminal::note(format_args!("error: {}", error.value(py)));
    } else {
        error.print(py);
    }
    Ok(1)
}

/// Takes part in a run with these robots until it ends, and returns how it ended. The arguments are those of a robot's program.
#[pyfunction]
pub(crate) fn take_part(
    py: Python<'_>,
    robots: Vec<(String, Bound<'_, PyAny>)>,
    arguments: Vec<String>,
) -> PyResult<&'static str> {
    let args = RobotArgs::try_parse_from(arguments)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;

    let failure = FirstException::default();
    let mut robots_to_play: Robots = Vec::new();
    for (name, object) in robots {
        let name = RobotName::new(&name).map_err(crate::error::plain)?;
        robots_to_play.push((name, Box::new(PythonRobot::new(&object, &failure)?)));
    }

    play(py, robots_to_play, &args, &failure)
}

fn play(
    py: Python<'_>,
    robots: Robots,
    args: &RobotArgs,
    failure: &FirstException,
) -> PyResult<&'static str> {
    use_one_thread(py)?;

    let options = args.options();
    let connected = interruptible(py, move || Host::connect(robots, options), || {})?;
    let host = connected.map_err(|error| exception(&error, failure))?;

    let stopper = host.stopper();
    let ended = interruptible(py, move || host.run(), || stopper.stop())?;
    match ended {
        Ok(End::Finished) => Ok("finished"),
        Ok(End::Stopped) => Ok("stopped"),
        Ok(End::Aborted) => Ok("aborted"),
        Err(error) => Err(exception(&error, failure)),
    }
}

/// What a robot raised, or why it cannot go on.
fn exception(error: &RobotHostError, failure: &FirstException) -> PyErr {
    let raised = failure.take();
    raised.unwrap_or_else(|| HostError::new_err(error.to_string()))
}

/// Prints diagnostics to the standard error, from the first call on.
fn print_diagnostics() {
    static PRINTS: Once = Once::new();
    PRINTS.call_once(|| terminal::print_diagnostics("warn"));
}
