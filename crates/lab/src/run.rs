//! A scenario in this process: the same simulation and the same robots as a launch, without a network.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use miette::{IntoDiagnostic, miette};
use protocol::RunName;
use protocol::messages::End;
use robot::{LocalHost, Robot};
use simulator::{Recorder, RunFolder, Scenario, Simulation, Summary, TickRecord};

/// Runs a scenario to its end and records it in a folder that [`RunFolder::create`] made; `speed` is in simulated seconds
/// per second, `None` as fast as possible.
///
/// # Errors
/// If a robot cannot run in this process, if a robot ends the run, or if the record cannot be written.
pub fn execute(
    scenario: Scenario,
    run: &RunName,
    folder: &RunFolder,
    speed: Option<f64>,
) -> miette::Result<Summary> {
    let mut recorder = None;
    let begun = Instant::now();
    let simulation = play(scenario, run, |simulation, record| {
        let recorder = match &mut recorder {
            Some(recorder) => recorder,
            none => none.insert(Recorder::begin(folder, run, simulation)?),
        };
        recorder.write(simulation, record)?;
        if let Some(speed) = speed {
            let due = Duration::try_from_secs_f64(simulation.time_s(simulation.tick()) / speed);
            std::thread::sleep(due.unwrap_or(Duration::MAX).saturating_sub(begun.elapsed()));
        }
        Ok(())
    })?;
    let recorder = recorder.ok_or_else(|| miette!("the run has not begun"))?;

    Ok(recorder.finish(&simulation)?)
}

/// Plays a scenario to its end in this process and shows every tick to `each`, the end of the run included.
///
/// # Errors
/// As [`execute`], and the first error of `each`.
pub fn play(
    scenario: Scenario,
    run: &RunName,
    mut each: impl FnMut(&Simulation, &TickRecord) -> miette::Result<()>,
) -> miette::Result<Simulation> {
    let mut local = Local::new(scenario, run)?;
    let record = local.simulation.init(&mut local.robots).into_diagnostic()?;
    each(&local.simulation, &record)?;

    while local.simulation.tick() < local.simulation.scenario().ticks {
        let record = local.simulation.step(&mut local.robots).into_diagnostic()?;
        each(&local.simulation, &record)?;
    }
    each(&local.simulation, &local.simulation.end(End::Finished))?;
    Ok(local.simulation)
}

/// A simulation and its robots in this process, before tick 0.
pub struct Local {
    /// The simulation.
    pub simulation: Simulation,
    /// Its robots.
    pub robots: LocalHost,
}

impl Local {
    /// Sets a scenario up with the shipped robots.
    ///
    /// # Errors
    /// If the scenario cannot be set up, or a robot cannot run in this process.
    pub fn new(scenario: Scenario, run: &RunName) -> miette::Result<Self> {
        let robots = make_robots(&scenario, Path::new("the scenario"))?;
        let mut simulation = Simulation::new(scenario, 1).into_diagnostic()?;
        let mut seats = Vec::new();
        for (name, robot) in robots {
            simulation.list_bodies(&name, robot.senses_bodies());
            if let Some(welcome) = simulation.welcome(run, &name, 1, None) {
                seats.push((robot, welcome));
            }
        }

        Ok(Self {
            simulation,
            robots: LocalHost::new(seats),
        })
    }
}

/// One robot of the right class for each name of the roster; `file` is named in the error.
///
/// # Errors
/// If a class is not one of those that can run in this process.
pub fn make_robots(
    scenario: &Scenario,
    file: &Path,
) -> miette::Result<BTreeMap<protocol::RobotName, Box<dyn Robot>>> {
    let make = |(name, spec): (&protocol::RobotName, &simulator::scenario::RobotSpec)| {
        let robot = robots::make(&spec.class).ok_or_else(|| {
            miette!(
                help = "a robot of another kind runs as a process of its own: name it in a launch file and use `cars launch`",
                "{}: robot {name} is of class {:?}, and only {} can run in this process",
                file.display(),
                spec.class,
                robots::CLASSES.join(", ")
            )
        })?;
        Ok((name.clone(), robot))
    };

    scenario.robots.iter().map(make).collect()
}
