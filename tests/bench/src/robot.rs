//! The idle robot of the bare lock-step: it reports and does nothing else.

use std::process::ExitCode;

use miette::IntoDiagnostic;
use robot::{Action, BadParameters, Cars, Host, Robot, RobotArgs, RobotName};

/// `cars-bench robot`.
pub(crate) fn take_part(args: &RobotArgs) -> miette::Result<ExitCode> {
    let mut robots: Vec<(RobotName, Box<dyn Robot>)> = Vec::new();
    for name in &args.names {
        robots.push((name.clone(), Box::new(Idle)));
    }
    let host = Host::connect(robots, args.options()).into_diagnostic()?;
    host.run().into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}

/// Stays where it was placed.
struct Idle;

impl Robot for Idle {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        Action::stay(cars).emotion("CALM").behavior("IDLE")
    }

    fn is_quick(&self) -> bool {
        true
    }
}
