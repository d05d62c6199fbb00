//! A recorded run is judged by expectations, its own or others. Nothing is executed again.

use std::collections::BTreeMap;

use observe::{Expectation, Monitors, Observation, SiteStates};
use protocol::messages::End;
use protocol::{Event, Tick};
use record::EpochFiles;
use record::Record;
use record::summary::ExpectationVerdict;
use recording::{Recording, Ticks};
use scenario::Scenario;

use crate::error::LabError;
use crate::folder::NOT_RECORDED;
use crate::states::LastStates;

/// What came of a recorded run.
#[derive(Debug, Default)]
pub struct Verdicts {
    /// The verdicts by the names of the expectations.
    pub expectations: BTreeMap<String, ExpectationVerdict>,
    /// The last tick that was judged.
    pub tick: Tick,
    /// Whether the record has the end of the run. What was open without one is undecided.
    pub has_end: bool,
}

/// Judges a recorded epoch of a scenario.
///
/// # Errors
/// If the record cannot be read, or has no reports and the expectations need them.
pub fn judge(
    files: &EpochFiles,
    scenario: &Scenario,
    expectations: &[Expectation],
) -> Result<Verdicts, LabError> {
    let mut record = Record::of_events(&files.events)?;
    let mut recorded = ReportsByTick::open(files, scenario, expectations)?;
    let setting = scenario.setting();
    let mut watches = Monitors::new(expectations, &setting);
    let mut sites = SiteStates::new(&setting);
    let mut verdicts = Verdicts::default();

    while let Some(entry) = record.next_entry()? {
        if let Some(Event::End { reason, .. }) = entry.events.last() {
            verdicts.has_end = true;
            verdicts.note(&watches.end(*reason));
            return Ok(verdicts);
        }
        if let Some(states) = &mut recorded
            && !states.advance()?
        {
            break;
        }
        verdicts.tick = entry.tick;
        sites.note(&entry.events);
        let judged = watches.observe(&Observation {
            tick: entry.tick,
            tick_s: scenario.tick_s,
            events: &entry.events,
            state: &|robot| recorded.as_ref().and_then(|states| states.last.of(robot)),
            site: &|site| sites.of(site),
            layer: &|layer| {
                recorded
                    .as_ref()
                    .and_then(|states| states.last.layer(layer))
            },
        });
        verdicts.note(&judged);
    }

    verdicts.note(&watches.end(End::Aborted));
    Ok(verdicts)
}

impl Verdicts {
    fn note(&mut self, judged: &[Event]) {
        for event in judged {
            if let Event::Judged {
                expectation,
                verdict,
                because,
            } = event
            {
                let judged = ExpectationVerdict {
                    verdict: *verdict,
                    tick: self.tick,
                    because: because.clone(),
                };
                self.expectations.insert(expectation.clone(), judged);
            }
        }
    }
}

/// What robots reported last, tick by tick, from a recording.
struct ReportsByTick {
    ticks: Ticks,
    last: LastStates,
}

impl ReportsByTick {
    /// Opens the recording, if the expectations need it.
    fn open(
        files: &EpochFiles,
        scenario: &Scenario,
        expectations: &[Expectation],
    ) -> Result<Option<Self>, LabError> {
        let mut needing = expectations.iter().filter(|one| one.needs_states());
        let Some(first) = needing.next() else {
            return Ok(None);
        };
        if !files.recording.exists() {
            return Err(LabError::record(format!(
                "{} is not there, and \"{}\" depends on what robots reported",
                files.recording.display(),
                first.name
            ))
            .with_help(NOT_RECORDED));
        }

        let recording = Recording::open(&files.recording)?;
        Ok(Some(Self {
            ticks: Ticks::of(recording),
            last: LastStates::new(scenario),
        }))
    }

    /// Goes on to the next tick. Returns whether the recording has it.
    fn advance(&mut self) -> Result<bool, LabError> {
        let Some(tick) = self.ticks.next_tick()? else {
            return Ok(false);
        };

        self.last.note(tick.tick(), tick.reports, tick.frame.robots);
        Ok(true)
    }
}
