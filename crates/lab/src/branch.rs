//! Branches: a run that is copied after any tick and goes on in several ways, in memory and without a record.
//!
//! A [`Trunk`] is a recorded run that is executed again; a [`Branch`] goes on from one of its ticks, or from tick 0 of a scenario.

use std::collections::BTreeMap;
use std::sync::Arc;

use config::Override;
use environment::medium::ForcedVerdict;
use environment::{Simulation, TickRecord};
use observe::Measured;
use protocol::messages::{End, Verdict};
use protocol::{Event, RobotName, RunName, Tick};
use record::{Entry, EpochFiles, Record, Summary};
use robot::{Cars, OpenTick};
use scenario::{ChanceKind, Scenario};

use crate::error::LabError;
use crate::reexecution::{Reexecution, cannot_copy, cannot_go_on};
use crate::run::{Local, RobotMaker, check_faults, make_robots_with};

/// A recorded run that is executed again, tick by tick, so that branches begin at it. Its record is read when it is opened.
pub struct Trunk {
    again: Reexecution,
    /// The ticks of the record, from tick 0 on, without its end.
    entries: Arc<Vec<Entry>>,
    /// The scenario before tick 0.
    scenario: Arc<Scenario>,
    verdicts: BTreeMap<String, Verdict>,
    summary: Option<Summary>,
    make: RobotMaker,
}

impl Trunk {
    /// Reads the record of an epoch and executes tick 0. `scenario` is the recorded one; what it expects and measures may be
    /// another. With `sums_up`, branches have summaries.
    ///
    /// # Errors
    /// If the record cannot be read, the scenario cannot be set up, or `make` does not make all of its robots.
    pub fn open(
        files: &EpochFiles,
        scenario: Scenario,
        make: RobotMaker,
        sums_up: bool,
    ) -> Result<Self, LabError> {
        let entries = Arc::new(read(files)?);
        Self::begin(entries, Arc::new(scenario), make, sums_up)
    }

    fn begin(
        entries: Arc<Vec<Entry>>,
        scenario: Arc<Scenario>,
        make: RobotMaker,
        sums_up: bool,
    ) -> Result<Self, LabError> {
        let again = Reexecution::with_robots(scenario.as_ref().clone(), 1, make.clone())?;
        if let Some(robot) = again.scripted.first() {
            return Err(cannot_go_on(robot));
        }
        let simulation = &again.local.simulation;
        let summary = sums_up.then(|| simulation.begin_summary(&RunName::unknown()));
        let mut trunk = Self {
            entries,
            again,
            scenario,
            verdicts: BTreeMap::new(),
            summary,
            make,
        };
        trunk.play(0)?;
        Ok(trunk)
    }

    /// The last tick of the record.
    #[must_use]
    pub fn last(&self) -> Tick {
        self.entries.last().map_or(0, |entry| entry.tick)
    }

    /// The events that the record has of a tick; none after its last one.
    #[must_use]
    pub fn events(&self, tick: Tick) -> &[Event] {
        let index = usize::try_from(tick).unwrap_or(usize::MAX);
        self.entries.get(index).map_or(&[], |entry| &entry.events)
    }

    /// The simulation after the last tick that was executed.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.again.local.simulation
    }

    /// The last tick that was executed.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.simulation().tick()
    }

    /// Executes up to a tick.
    ///
    /// # Errors
    /// If the record ends before, or a tick cannot be executed again with the same result.
    pub fn go_to(&mut self, tick: Tick) -> Result<(), LabError> {
        while self.tick() < tick {
            self.play(self.tick() + 1)?;
        }
        Ok(())
    }

    fn play(&mut self, tick: Tick) -> Result<(), LabError> {
        let entries = self.entries.clone();
        let index = usize::try_from(tick).unwrap_or(usize::MAX);
        let recorded = entries
            .get(index)
            .ok_or_else(|| LabError::record(format!("the record ends before tick {tick}")))?;

        let executed = self.again.play(recorded)?.record;
        let simulation = &self.again.local.simulation;
        note(&mut self.verdicts, &mut self.summary, simulation, &executed);
        if digest(&recorded.events) != digest(&executed.events) {
            return Err(LabError::record(format!(
                "executed again, the run differs from its record at tick {tick}"
            ))
            .with_help("`cars verify` compares the whole run with its record"));
        }
        Ok(())
    }

    /// A copy after the last tick, which can be executed further as this one. If a robot cannot be copied, the same run after tick 0
    /// instead, with robots made anew: [`Self::go_to`] executes it up to any tick.
    ///
    /// # Errors
    /// If the state of a robot is not known, or one cannot be made.
    pub fn snapshot(&self) -> Result<Self, LabError> {
        let Some(again) = self.again.snapshot()? else {
            let (entries, scenario) = (self.entries.clone(), self.scenario.clone());
            let sums_up = self.summary.is_some();
            return Self::begin(entries, scenario, self.make.clone(), sums_up);
        };
        Ok(Self {
            again,
            entries: self.entries.clone(),
            scenario: self.scenario.clone(),
            verdicts: self.verdicts.clone(),
            summary: self.summary.clone(),
            make: self.make.clone(),
        })
    }

    /// The run as a branch that goes on by itself after the last tick.
    ///
    /// # Errors
    /// If a robot cannot go on in this process.
    pub fn into_branch(self) -> Result<Branch, LabError> {
        let local = self.again.end().map_err(|robot| cannot_go_on(&robot))?;
        check_faults(local.simulation.scenario(), local.simulation.tick())?;
        Ok(Branch {
            local,
            open: None,
            verdicts: self.verdicts,
            summary: self.summary,
            make: self.make,
            run: RunName::unknown(),
            is_ended: false,
        })
    }
}

/// The ticks of a record. What robots reported is kept only where a robot's state may not be known otherwise: after a tick that
/// one has missed.
fn read(files: &EpochFiles) -> Result<Vec<Entry>, LabError> {
    let mut record = Record::open(files)?;
    let mut entries = Vec::new();
    let mut has_missed = false;
    while let Some(mut entry) = record.next_entry()? {
        if entry.is_end() {
            break;
        }
        has_missed |= entry.missed().next().is_some();
        if !has_missed {
            entry.reports = None;
        }
        entry.frame = None;
        entry.recorded_events = None;
        entries.push(entry);
    }
    Ok(entries)
}

/// A run that goes on in memory. Copies go on as it does, until they are re-seeded or changed.
///
/// A tick has two halves: [`Branch::begin_tick`], after which it is decided what robots perceive, and [`Branch::end_tick`], in which they
/// act. [`Branch::step`] is both.
pub struct Branch {
    local: Local,
    /// The tick that has begun and not ended.
    open: Option<OpenTick>,
    /// Judgments so far, by the names of the expectations.
    verdicts: BTreeMap<String, Verdict>,
    summary: Option<Summary>,
    make: RobotMaker,
    run: RunName,
    is_ended: bool,
}

impl Branch {
    /// A run of a scenario after its tick 0.
    ///
    /// # Errors
    /// If the scenario cannot be set up or played in this process.
    pub fn start(scenario: Scenario, make: RobotMaker) -> Result<Self, LabError> {
        let mut branch = Self::begin(scenario, &RunName::unknown(), make)?;
        branch.end_tick()?;
        Ok(branch)
    }

    /// A run of a scenario in whose tick 0 no robot has acted.
    ///
    /// # Errors
    /// If the scenario cannot be set up or played in this process.
    pub fn begin(scenario: Scenario, run: &RunName, make: RobotMaker) -> Result<Self, LabError> {
        check_faults(&scenario, 0)?;
        let robots = make_robots_with(&scenario, "the scenario".as_ref(), &*make)?;
        let mut local = Local::with_robots(scenario, 1, run, robots)?;
        local.simulation.begin_init();
        let open = local.robots.open(0, &local.simulation);
        Ok(Self {
            local,
            open: Some(open),
            verdicts: BTreeMap::new(),
            summary: None,
            make,
            run: run.clone(),
            is_ended: false,
        })
    }

    /// A copy that goes on as this one does, between two ticks.
    ///
    /// # Errors
    /// If a robot cannot be copied.
    pub fn snapshot(&self) -> Result<Self, LabError> {
        debug_assert!(self.open.is_none(), "robots are copied between two ticks");
        Ok(Self {
            open: None,
            local: self.local.snapshot().map_err(|robot| cannot_copy(&robot))?,
            verdicts: self.verdicts.clone(),
            summary: self.summary.clone(),
            make: self.make.clone(),
            run: self.run.clone(),
            is_ended: self.is_ended,
        })
    }

    /// Has chance be another one from the next tick on; `of` names its kinds, and without any it is all of it.
    pub fn reseed(&mut self, seed: u64, of: &[ChanceKind]) {
        let Local { simulation, robots } = &mut self.local;
        simulation.reseed(seed, of);
        let scenario = simulation.scenario();
        for name in simulation.names() {
            robots.set_reseeds(name, scenario.stream_reseeds(name, simulation.tick()));
        }
    }

    /// Sets something of the scenario from the next tick on.
    ///
    /// # Errors
    /// If it is nothing that can change while a run goes on, or cannot be played in this process.
    pub fn set(&mut self, set: &[Override]) -> Result<(), LabError> {
        let simulation = &mut self.local.simulation;
        simulation.change_by_hand(set).map_err(LabError::refused)?;
        check_faults(simulation.scenario(), simulation.tick())
    }

    /// Begins the next tick, unless one is open already. Returns whether there is one: the run may be over.
    ///
    /// # Errors
    /// If a robot that comes back cannot be made.
    pub fn begin_tick(&mut self) -> Result<bool, LabError> {
        if self.open.is_some() {
            return Ok(true);
        }
        if self.is_ended || self.local.simulation.is_over() {
            return Ok(false);
        }

        self.local.carry_out_faults_with(&self.run, &*self.make)?;
        let tick = self.local.simulation.begin_tick();
        self.open = Some(self.local.robots.open(tick, &self.local.simulation));
        Ok(true)
    }

    /// Shows what a robot perceives in the tick that has begun, before it acts. `None` if it does not run that tick, or none has begun.
    pub fn perceive<T>(
        &self,
        robot: &RobotName,
        see: impl FnOnce(&mut Cars<'_>) -> T,
    ) -> Option<T> {
        self.local.robots.perceive(self.open.as_ref()?, robot, see)
    }

    /// Has robots act in the tick that has begun, and ends it; if none has begun, ends the run. `None` after that.
    ///
    /// # Errors
    /// If a robot ends the run.
    pub fn end_tick(&mut self) -> Result<Option<TickRecord>, LabError> {
        if self.is_ended {
            return Ok(None);
        }

        let Local { simulation, robots } = &mut self.local;
        let record = if let Some(open) = self.open.take() {
            simulation.end_tick(robots.close(open)?)
        } else {
            self.is_ended = true;
            simulation.end(End::Finished)
        };
        note(&mut self.verdicts, &mut self.summary, simulation, &record);
        Ok(Some(record))
    }

    /// Plays the next tick, or the end of the run. `None` after that.
    ///
    /// # Errors
    /// If a robot ends the run, or one that comes back cannot be made.
    pub fn step(&mut self) -> Result<Option<TickRecord>, LabError> {
        self.begin_tick()?;
        self.end_tick()
    }

    /// Plays to the end of the run.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn play(&mut self) -> Result<(), LabError> {
        while self.step()?.is_some() {}
        Ok(())
    }

    /// Plays to the end of the run, or until an expectation is judged. Returns its verdict.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn judge(&mut self, expectation: &str) -> Result<Option<Verdict>, LabError> {
        loop {
            if let Some(verdict) = self.verdicts.get(expectation) {
                return Ok(Some(*verdict));
            }
            if self.step()?.is_none() {
                return Ok(None);
            }
        }
    }

    /// The simulation after the last tick.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.local.simulation
    }

    /// The simulation and its robots.
    pub(crate) fn local(&self) -> &Local {
        &self.local
    }

    /// Has the network decide something in the next tick, whatever it draws.
    pub fn force(&mut self, verdict: ForcedVerdict) {
        self.local.simulation.force(verdict);
    }

    /// The last tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.local.simulation.tick()
    }

    /// Digest of the run so far.
    #[must_use]
    pub fn digest(&self) -> String {
        self.local.simulation.digest()
    }

    /// Whether the run is over, and all of it judged.
    #[must_use]
    pub fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// The verdicts so far, by the names of the expectations.
    #[must_use]
    pub fn verdicts(&self) -> &BTreeMap<String, Verdict> {
        &self.verdicts
    }

    /// The summary of the run, if it ended with the last tick; `None` unless its trunk sums up.
    #[must_use]
    pub fn summary(&self) -> Option<Summary> {
        let mut summary = self.summary.clone()?;
        self.local.simulation.finish_summary(&mut summary);
        Some(summary)
    }

    /// The measures of the scenario, if the run ended with the last tick.
    #[must_use]
    pub fn measured(&self) -> BTreeMap<String, Measured> {
        self.local.simulation.measurements().measured()
    }
}

/// Notes what was judged in a tick, and counts its events.
fn note(
    verdicts: &mut BTreeMap<String, Verdict>,
    summary: &mut Option<Summary>,
    simulation: &Simulation,
    record: &TickRecord,
) {
    for event in record.events.iter() {
        if let Event::Judged {
            expectation,
            verdict,
            ..
        } = event
        {
            verdicts.insert(expectation.clone(), *verdict);
        }
        if let Some(summary) = summary {
            simulation.count(summary, record.tick, event);
        }
    }
}

fn digest(events: &[Event]) -> Option<&String> {
    match events.last() {
        Some(Event::Tick { digest, .. }) => Some(digest),
        _ => None,
    }
}
