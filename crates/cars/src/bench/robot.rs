//! The robot of the bare lock-step: it only answers.

use std::process::ExitCode;

use miette::IntoDiagnostic;
use robot::{BadParameters, Cars, Host, Point, Robot, RobotArgs, RobotName, StateVariables};

/// `cars bench-robot`.
pub(crate) fn take_part(args: &RobotArgs) -> miette::Result<ExitCode> {
    let mut robots: Vec<(RobotName, Box<dyn Robot>)> = Vec::new();
    for name in &args.names {
        robots.push((name.clone(), Box::<Idle>::default()));
    }
    let host = Host::connect(robots, args.options()).into_diagnostic()?;
    host.run().into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}

/// Stands where it was placed.
#[derive(Default)]
struct Idle(Point);

impl Robot for Idle {
    fn init_robot(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }
    fn speed(&self) -> f64 {
        0.0
    }
    fn direction(&self) -> f64 {
        0.0
    }
    fn update_state_variables(&mut self, _: &mut Cars<'_>) {}
    fn state_variables(&self) -> StateVariables {
        StateVariables::new()
    }
    fn current_location(&self) -> Point {
        self.0
    }
    fn project_location(&mut self, _: &mut Cars<'_>) -> Point {
        self.0
    }
    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) {
        self.0 = location;
    }
    fn set_command(&mut self, _: &mut Cars<'_>, _: &RobotName, _: &str) {}
    fn update_emotion_state(&mut self, _: &mut Cars<'_>) {}
    fn emotion_state(&self) -> &str {
        "CALM"
    }
    fn update_behavior_state(&mut self, _: &mut Cars<'_>) {}
    fn behavior_state(&self) -> &str {
        "IDLE"
    }
}
