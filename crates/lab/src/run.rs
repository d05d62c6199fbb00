//! Runs a scenario in this process: the same simulation and the same robots as a launch, without a network.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use environment::{Simulation, TickRecord};
use protocol::messages::{End, FaultKind, OnLate};
use protocol::{Epoch, RobotName, RunName, Tick};
use record::{RunFolder, Summary};
use recorder::Recorder;
use robot::{BadParameters, LocalHost, Robot, RobotError, Welcome};
use scenario::FaultEnd;
use scenario::Scenario;

use crate::error::LabError;

/// Longest sleep of a run that is not as fast as possible, before it looks whether it is to go on.
const NAP: Duration = Duration::from_millis(50);

/// Runs a scenario to its end and records it in a folder that [`RunFolder::create`] made. `speed` is in simulated seconds
/// per second; `None` is as fast as possible.
///
/// # Errors
/// If a robot cannot run in this process, a robot ends the run, or the record cannot be written.
pub fn execute(
    scenario: Scenario,
    run: &RunName,
    folder: &RunFolder,
    speed: Option<f64>,
) -> Result<Summary, LabError> {
    execute_with(scenario, run, folder, speed, &of_class, || Ok(()))
}

/// Runs a scenario as [`execute`] does. `make` makes the robots; `goes_on` is called in every tick and while the run sleeps, and
/// ends the run by an error.
///
/// # Errors
/// As [`execute`], and the first error of `goes_on`.
pub fn execute_with(
    scenario: Scenario,
    run: &RunName,
    folder: &RunFolder,
    speed: Option<f64>,
    make: Make<'_>,
    mut goes_on: impl FnMut() -> Result<(), LabError>,
) -> Result<Summary, LabError> {
    let mut recorder = None;
    let begun = Instant::now();
    let simulation = play_with_robots(scenario, run, make, |local, record, opened| {
        let simulation = &local.simulation;
        let recorder = match &mut recorder {
            Some(recorder) => recorder,
            none => none.insert(Recorder::begin(folder, run, simulation)?),
        };
        observe(recorder, local, opened);
        recorder.write(simulation, record)?;
        goes_on()?;
        if let Some(speed) = speed {
            let due_s = simulation.time_s(simulation.tick()) / speed;
            wait_until(begun, due_s, &mut goes_on)?;
        }
        Ok(())
    })?;

    let mut recorder = recorder.ok_or_else(|| LabError::failed("the run has not begun"))?;

    Ok(recorder.finish(&simulation)?)
}

/// Observes a tick for the recording: its time, and the robots' panels.
pub(crate) fn observe(recorder: &mut Recorder, local: &Local, opened: Instant) {
    let Some(observed) = recorder.observed() else {
        return;
    };
    observed.opened = Some(opened);

    if local.simulation.scenario().record.has_panels() {
        observed.panels = local.robots.panels();
    }
}

/// Sleeps until this many seconds after `begun`.
fn wait_until(
    begun: Instant,
    due_s: f64,
    goes_on: &mut impl FnMut() -> Result<(), LabError>,
) -> Result<(), LabError> {
    let due = Duration::try_from_secs_f64(due_s).unwrap_or(Duration::MAX);
    loop {
        let left = due.saturating_sub(begun.elapsed());
        if left.is_zero() {
            return Ok(());
        }

        std::thread::sleep(left.min(NAP));
        goes_on()?;
    }
}

/// Plays a scenario to its end in this process and calls `each` after every tick and after the end of the run. Crashes and hangs
/// of the scenario's `[[fault]]` are played; the record is that of a launch.
///
/// # Errors
/// As [`execute`], the first error of `each`, and for a fault that needs a process ([`check_faults`]).
pub fn play(
    scenario: Scenario,
    run: &RunName,
    each: impl FnMut(&Simulation, &TickRecord) -> Result<(), LabError>,
) -> Result<Simulation, LabError> {
    play_with(scenario, run, &of_class, each)
}

/// Plays a scenario as [`play`] does; `make` makes the robots.
///
/// # Errors
/// As [`play`].
pub fn play_with(
    scenario: Scenario,
    run: &RunName,
    make: Make<'_>,
    mut each: impl FnMut(&Simulation, &TickRecord) -> Result<(), LabError>,
) -> Result<Simulation, LabError> {
    play_with_robots(scenario, run, make, |local, record, _| {
        each(&local.simulation, record)
    })
}

/// Plays a scenario as [`play`] does; `each` also sees the robots, and when the tick was opened.
fn play_with_robots(
    scenario: Scenario,
    run: &RunName,
    make: Make<'_>,
    mut each: impl FnMut(&Local, &TickRecord, Instant) -> Result<(), LabError>,
) -> Result<Simulation, LabError> {
    check_faults(&scenario, 0)?;
    let robots = make_robots_with(&scenario, Path::new("the scenario"), make)?;
    let mut local = Local::with_robots(scenario, 1, run, robots)?;
    let opened = Instant::now();
    let record = local.simulation.init(&mut local.robots)?;
    each(&local, &record, opened)?;

    go_on(&mut local, run, make, each)?;
    Ok(local.simulation)
}

/// Plays a scenario from the last complete tick to its end and calls `each` as [`play`] does; `make` makes the robots that come back.
///
/// # Errors
/// As [`play`].
pub(crate) fn go_on(
    local: &mut Local,
    run: &RunName,
    make: Make<'_>,
    mut each: impl FnMut(&Local, &TickRecord, Instant) -> Result<(), LabError>,
) -> Result<(), LabError> {
    while !local.simulation.is_over() {
        let opened = Instant::now();
        local.carry_out_faults_with(run, make)?;
        let record = local.simulation.step(&mut local.robots)?;
        each(local, &record, opened)?;
    }

    let end = local.simulation.end(End::Finished);
    each(local, &end, Instant::now())?;
    local.robots.report_left_out();
    Ok(())
}

/// A simulation and its robots in this process.
pub struct Local {
    /// The simulation.
    pub simulation: Simulation,
    /// Its robots.
    pub robots: LocalHost,
}

impl Local {
    /// Creates the simulation of a scenario and its robots.
    ///
    /// # Errors
    /// If the scenario cannot be set up, or a class of robots cannot run in this process.
    pub fn new(scenario: Scenario, run: &RunName) -> Result<Self, LabError> {
        let robots = make_robots(&scenario, Path::new("the scenario"))?;
        Self::with_robots(scenario, 1, run, robots)
    }

    /// A copy that goes on as this one does, between two ticks.
    ///
    /// # Errors
    /// The first robot that cannot be copied.
    pub fn snapshot(&self) -> Result<Self, RobotName> {
        Ok(Self {
            robots: self.robots.snapshot()?,
            simulation: self.simulation.clone(),
        })
    }

    /// Goes on from the last tick as a run of another scenario, which is the same up to then. Where it is re-seeded later, robots are
    /// told.
    pub fn go_on_as(&mut self, scenario: Scenario) {
        for name in scenario.robots.keys() {
            let reseeds = scenario.stream_reseeds(name, self.simulation.tick());
            self.robots.set_reseeds(name, reseeds);
        }
        self.simulation.go_on_as(scenario);
    }

    /// Creates the simulation of an epoch with these robots.
    ///
    /// # Errors
    /// If the scenario cannot be set up.
    pub fn with_robots(
        scenario: Scenario,
        epoch: Epoch,
        run: &RunName,
        robots: BTreeMap<RobotName, Box<dyn Robot>>,
    ) -> Result<Self, LabError> {
        Self::with_runners(scenario, epoch, |simulation| {
            runners(simulation, run, robots)
        })
    }

    /// The same for an epoch that was recorded: the robots of then had no objection to what the scenario planned.
    ///
    /// # Errors
    /// If the scenario cannot be set up.
    pub fn recorded(
        scenario: Scenario,
        epoch: Epoch,
        run: &RunName,
        robots: BTreeMap<RobotName, Box<dyn Robot>>,
    ) -> Result<Self, LabError> {
        Self::with_runners(scenario, epoch, |simulation| {
            let mut runners = runners(simulation, run, robots);
            for (_, welcome) in &mut runners {
                welcome.later_parameters.clear();
            }
            runners
        })
    }

    fn with_runners(
        scenario: Scenario,
        epoch: Epoch,
        runners: impl FnOnce(&mut Simulation) -> Vec<(Box<dyn Robot>, Welcome)>,
    ) -> Result<Self, LabError> {
        let mut simulation = Simulation::new(scenario, epoch).map_err(LabError::refused)?;
        let runners = runners(&mut simulation);
        Ok(Self {
            simulation,
            robots: LocalHost::new(runners),
        })
    }

    /// Carries out the crashes and hangs that the scenario has for the time before the next tick, their ends, and restarts.
    ///
    /// # Errors
    /// If a robot that comes back is of a class that cannot run in this process.
    pub fn carry_out_faults(&mut self, run: &RunName) -> Result<(), LabError> {
        self.carry_out_faults_with(run, &of_class)
    }

    /// Carries out faults as [`Self::carry_out_faults`] does; `make` makes the robots that come back.
    ///
    /// # Errors
    /// As [`Self::carry_out_faults`].
    pub fn carry_out_faults_with(&mut self, run: &RunName, make: Make<'_>) -> Result<(), LabError> {
        let orders = self.simulation.faults_due();
        let next = self.simulation.tick() + 1;
        let lateness = self.simulation.scenario().lateness_at(next).clone();
        self.simulation
            .note_faults(&orders, |robot| lateness.of(robot));

        for order in orders {
            let goes_on = lateness.of(&order.robot) == OnLate::Continue;
            match (order.begins, order.kind) {
                // The clock waits until the wall clock ends the fault: a process that was killed is back in the same tick, and
                // one that was stopped has missed nothing.
                (true, FaultKind::Crash) if !goes_on => {
                    self.robots.crash(&order.robot);
                    self.start(&order.robot, run, make)?;
                }
                (true, _) if !goes_on => {}
                (true, FaultKind::Hang) => self.robots.hang(&order.robot, lateness.lose_after),
                (true, _) => self.robots.crash(&order.robot),
                (false, _) => self.start(&order.robot, run, make)?,
            }
        }
        for robot in self.simulation.restarts_due() {
            self.robots.crash(&robot);
            self.start(&robot, run, make)?;
        }
        Ok(())
    }

    /// Starts a robot that is stopped, as a further incarnation.
    fn start(&mut self, name: &RobotName, run: &RunName, make: Make<'_>) -> Result<(), LabError> {
        let scenario = self.simulation.scenario();
        let mut robots = make_robots_with(scenario, Path::new("the scenario"), make)?;
        if let Some(robot) = robots.remove(name) {
            let simulation = &self.simulation;
            self.robots.bring_back(name, robot, |generation| {
                simulation.welcome(run, name, generation, None)
            });
        }
        Ok(())
    }
}

/// The robots with their welcomes.
fn runners(
    simulation: &mut Simulation,
    run: &RunName,
    robots: BTreeMap<RobotName, Box<dyn Robot>>,
) -> Vec<(Box<dyn Robot>, Welcome)> {
    let mut runners = Vec::new();
    for (name, robot) in robots {
        simulation.list_bodies(&name, robot.senses_bodies());
        simulation.list_ranges(&name, robot.senses_ranges());
        if let Some(welcome) = simulation.welcome(run, &name, 1, None) {
            runners.push((robot, welcome));
        }
    }
    runners
}

/// Checks the parameters that robots get after a tick, as far as their classes are of this process and can check them.
///
/// # Errors
/// If a robot refuses them.
pub fn check_parameters(scenario: &Scenario, after: Tick) -> Result<(), LabError> {
    for (name, parameters) in scenario.parameters_from(after + 1) {
        let robot = robots::make(&scenario.robots[&name].class);
        if let Some(check) = robot.and_then(|robot| robot.parameters_check()) {
            check(&parameters).map_err(|reason| {
                RobotError::from(BadParameters {
                    robot: name.clone(),
                    reason,
                })
            })?;
        }
    }
    Ok(())
}

/// Checks that the faults of a scenario that begin after a tick can be played without processes: crashes and hangs that end by
/// simulated time or not at all, where the clock goes on without the robot, and faults whose end the clock waits for.
///
/// # Errors
/// If there is another fault.
pub fn check_faults(scenario: &Scenario, after: Tick) -> Result<(), LabError> {
    let changed = scenario.changes.iter().flat_map(|change| &change.faults);
    for fault in scenario.faults.iter().chain(changed) {
        let is_simulated = !matches!(fault.end, FaultEnd::After(_));
        let lateness = scenario.lateness_at(fault.at);
        let is_absence = matches!(fault.kind, FaultKind::Crash | FaultKind::Hang);
        let is_played = match lateness.of(&fault.robot) {
            _ if fault.is_restart() => true,
            OnLate::Continue => is_absence && is_simulated,
            OnLate::Wait => fault.kind == FaultKind::Slow || !is_simulated,
            OnLate::Abort => false,
        };
        if fault.at > after && !is_played {
            return Err(LabError::refused(format!(
                "the fault of {} at tick {} needs a process of its own",
                fault.robot, fault.at
            ))
            .with_help(
                "play it with `cars launch`, or leave faults out with --set 'fault=[]'; a crash or hang can be played without a \
                 process with `until` under on_late = \"continue\", and with `for` under on_late = \"wait\"",
            ));
        }
    }

    Ok(())
}

/// Makes the robot of a name and a class; `None` if it makes no such robots.
pub type Make<'a> = &'a dyn Fn(&RobotName, &str) -> Option<Box<dyn Robot>>;

/// Makes robots as [`Make`] does, for as long as a run and its branches need them.
pub type RobotMaker = Arc<dyn Fn(&RobotName, &str) -> Option<Box<dyn Robot>> + Send + Sync>;

/// Makes the robots of the project.
#[must_use]
pub fn project_robots() -> RobotMaker {
    Arc::new(of_class)
}

/// Makes the robots of the project.
fn of_class(_: &RobotName, class: &str) -> Option<Box<dyn Robot>> {
    robots::make(class)
}

/// Creates the robots of a scenario by their classes; `file` is named in the error.
///
/// # Errors
/// If a class cannot run in this process.
pub fn make_robots(
    scenario: &Scenario,
    file: &Path,
) -> Result<BTreeMap<RobotName, Box<dyn Robot>>, LabError> {
    make_robots_with(scenario, file, &of_class)
}

/// Creates the robots of a scenario as [`make_robots`] does; `make` makes them.
///
/// # Errors
/// As [`make_robots`].
pub fn make_robots_with(
    scenario: &Scenario,
    file: &Path,
    make: Make<'_>,
) -> Result<BTreeMap<RobotName, Box<dyn Robot>>, LabError> {
    let mut robots = BTreeMap::new();
    for (name, spec) in &scenario.robots {
        let robot = make(name, &spec.class).ok_or_else(|| {
            LabError::refused(format!(
                "{}: robot {name} is of class {:?}, and only {} can run in this process",
                file.display(),
                spec.class,
                robots::CLASSES.join(", ")
            ))
            .with_help(
                "a robot of another kind runs as a process of its own: name it in a launch file and use `cars launch`",
            )
        })?;
        robots.insert(name.clone(), robot);
    }

    Ok(robots)
}
