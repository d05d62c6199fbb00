//! Forks: a recorded run is executed again up to a tick, and goes on from there with changes.

use std::time::Instant;

use config::{Changes, Override, Source};
use protocol::{Event, RunName, Tick};
use record::difference::between;
use record::{Entry, Record};
use record::{EpochFiles, RunFolder, Summary};
use recorder::Recorder;
use scenario::{ChanceKind, Parent, Scenario};

use crate::error::LabError;
use crate::reexecution::{Reexecution, cannot_go_on};
use crate::run::{RobotMaker, check_faults, check_parameters, go_on, observe};

/// Tables of a scenario that hold for the whole run and can be other ones in a fork.
const OF_THE_RUN: [&str; 3] = ["duration", "end_when", "record"];

/// What a fork is of, and what it changes.
#[derive(Debug)]
pub struct Fork<'a> {
    /// Name of the recorded run.
    pub parent: &'a RunName,
    /// The record of one of its epochs.
    pub files: &'a EpochFiles,
    /// The last tick that both have.
    pub tick: Tick,
    /// What is changed from the next tick on; `duration`, `end_when` and what is below `record` hold for the whole fork.
    pub set: Vec<Override>,
    /// Another duration, simulated seconds.
    pub duration_s: Option<f64>,
    /// The seed of what is drawn from the next tick on, and the kinds that are drawn anew: all, if none is named.
    pub reseed: Option<(u64, Vec<ChanceKind>)>,
}

impl Fork<'_> {
    /// The name of the fork, unless it is given another one: RUN-fork-TICK, with -seed-N after it if it is re-seeded.
    #[must_use]
    pub fn name(&self) -> RunName {
        let mut suffix = format!("-fork-{}", self.tick);
        if let Some((seed, _)) = self.reseed {
            suffix += &format!("-seed-{seed}");
        }
        self.parent.with_suffix(&suffix)
    }

    /// The scenario of the fork: that of the recorded run, with the changes as a `[[change]]`.
    ///
    /// # Errors
    /// If the record has no such tick, or a change cannot be made.
    pub fn scenario(&self) -> Result<Scenario, LabError> {
        let parent = Parent {
            run: self.parent.clone(),
            tick: self.tick,
            digest: self.digest()?,
        };
        let mut changes = Changes {
            duration_s: self.duration_s,
            ..Changes::default()
        };
        let mut set = Vec::new();
        for change in &self.set {
            if OF_THE_RUN.contains(&change.top()) {
                changes.set.push(change.clone());
            } else {
                set.push(toml::Value::String(change.to_string()));
            }
        }

        let before = Scenario::load(&self.files.scenario, &Changes::default())?;
        let source = changes.apply(&Source::read(&self.files.scenario)?)?;
        let mut content: toml::Table = source.parse()?;
        content.insert("parent".to_owned(), parent_table(&parent));
        let next_s = (self.tick + 1) as f64 * before.tick_s;
        if !set.is_empty() {
            add_change(&mut content, next_s, set);
        }
        if let Some((seed, of)) = &self.reseed {
            if of.is_empty() {
                // All chance is another one from then on, also where the recorded run would be re-seeded later.
                let earlier = before.reseeds.partition_point(|one| one.at <= self.tick);
                let tables = content.get_mut("reseed");
                if let Some(tables) = tables.and_then(toml::Value::as_array_mut) {
                    tables.truncate(earlier);
                }
            }
            add_reseed(&mut content, next_s, *seed, of);
        }
        let source = Source {
            name: format!("{} (forked)", self.files.scenario.display()),
            text: toml::to_string(&content).map_err(LabError::failed)?,
        };
        let folder = self.files.scenario.parent().unwrap_or("".as_ref());
        let scenario = Scenario::parse(&source, folder)?;

        if scenario.ticks <= self.tick {
            return Err(LabError::refused(format!(
                "the run ends at tick {}: nothing is left after tick {}",
                scenario.ticks, self.tick
            ))
            .with_help("fork it earlier, or give a longer --duration"));
        }
        check_faults(&scenario, self.tick)?;
        check_parameters(&scenario, self.tick)?;
        Ok(scenario)
    }

    /// Digest of the recorded run at the tick.
    fn digest(&self) -> Result<String, LabError> {
        let mut record = Record::of_events(&self.files.events)?;
        let mut last = None;
        while let Some(entry) = record.next_entry()? {
            if let Some(Event::Tick { digest, .. }) = entry.events.last()
                && entry.tick == self.tick
            {
                return Ok(digest.clone());
            }
            last = Some(entry.tick);
        }

        let events = self.files.events.display();
        Err(match last {
            Some(last) => LabError::record(format!(
                "{events} ends at tick {last}, before tick {}",
                self.tick
            )),
            None => LabError::record(format!("{events} has no complete tick")),
        })
    }

    /// Executes the fork and records it in a folder that [`RunFolder::create`] made for its scenario. `make` makes the robots;
    /// `goes_on` is called in each tick, and its error ends the fork.
    ///
    /// # Errors
    /// If the recorded run cannot be executed again with the same result, a robot cannot go on in this process, a robot ends
    /// the run, or the record cannot be written.
    pub fn execute(
        &self,
        scenario: Scenario,
        run: &RunName,
        folder: &RunFolder,
        make: &RobotMaker,
        mut goes_on: impl FnMut() -> Result<(), LabError>,
    ) -> Result<Summary, LabError> {
        let mut record = Record::open(self.files)?;
        let mut again = Reexecution::with_robots(scenario, 1, make.clone())?;
        let mut recorder = Recorder::begin(folder, run, &again.local.simulation)?;
        loop {
            goes_on()?;
            let opened = Instant::now();
            let recorded = record.next_entry()?;
            let recorded =
                recorded.ok_or_else(|| LabError::record("the record has become shorter"))?;
            let executed = again.play(&recorded)?;
            observe(&mut recorder, &again.local, opened);
            recorder.write(&again.local.simulation, &executed.record)?;
            check_same(&recorded, &executed.into_entry())?;
            if recorded.tick == self.tick {
                break;
            }
        }

        let mut local = again.end().map_err(|robot| cannot_go_on(&robot))?;
        if local.simulation.is_over() {
            let tick = self.tick;
            let reason = format!("the run ends at tick {tick} by its `end_when`");
            return Err(LabError::refused(reason)
                .with_help("fork it earlier, or give another condition: --set 'end_when=…'"));
        }
        go_on(&mut local, run, &**make, |local, record, opened| {
            goes_on()?;
            observe(&mut recorder, local, opened);
            recorder.write(&local.simulation, record)?;
            Ok(())
        })?;
        Ok(recorder.finish(&local.simulation)?)
    }
}

fn parent_table(parent: &Parent) -> toml::Value {
    let mut table = toml::Table::new();
    table.insert("run".to_owned(), parent.run.to_string().into());
    let tick = i64::try_from(parent.tick).unwrap_or(i64::MAX);
    table.insert("tick".to_owned(), tick.into());
    table.insert("digest".to_owned(), parent.digest.clone().into());
    table.into()
}

fn add_change(content: &mut toml::Table, at_s: f64, set: Vec<toml::Value>) {
    let mut change = toml::Table::new();
    change.insert("at".to_owned(), format!("{at_s} s").into());
    change.insert("set".to_owned(), set.into());
    add(content, "change", change);
}

fn add_reseed(content: &mut toml::Table, at_s: f64, seed: u64, of: &[ChanceKind]) {
    let mut reseed = toml::Table::new();
    reseed.insert("at".to_owned(), format!("{at_s} s").into());
    let seed = i64::try_from(seed).unwrap_or(i64::MAX);
    reseed.insert("seed".to_owned(), seed.into());
    if !of.is_empty() {
        let of: Vec<String> = of.iter().map(ToString::to_string).collect();
        reseed.insert("of".to_owned(), of.into());
    }
    add(content, "reseed", reseed);
}

/// Adds a table to an array of tables.
fn add(content: &mut toml::Table, name: &str, table: toml::Table) {
    let tables = content
        .entry(name)
        .or_insert_with(|| toml::Value::Array(Vec::new()));
    if let toml::Value::Array(tables) = tables {
        tables.push(table.into());
    }
}

fn check_same(recorded: &Entry, executed: &Entry) -> Result<(), LabError> {
    let Some(difference) = between(recorded, executed) else {
        return Ok(());
    };

    Err(LabError::record(format!(
        "the run cannot be forked: executed again, it differs from its record at {difference} (recorded: {}; executed: {})",
        difference.value(0),
        difference.value(1)
    ))
    .with_help("`cars verify` compares the whole run with its record"))
}
