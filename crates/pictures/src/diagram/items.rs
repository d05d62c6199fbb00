//! The things that a diagram shows.

use protocol::Tick;
use protocol::messages::Awaited;

use timeline::{
    Absence, ChangeSpan, CommandSpan, CutSpan, FaultSpan, Joined, MissedTicks, Period, QueriesLost,
    Span, StateSpan,
};

/// A tick for which the clock was held.
#[derive(Debug, Clone)]
pub(crate) struct HeldTick {
    pub(crate) tick: Tick,
    pub(crate) awaited: Awaited,
}

/// Everything in a window.
#[derive(Debug, Clone, Default)]
pub(crate) struct Items {
    pub(crate) bands: Vec<StateSpan>,
    pub(crate) commands: Vec<CommandSpan>,
    pub(crate) cuts: Vec<CutSpan>,
    pub(crate) faults: Vec<FaultSpan>,
    pub(crate) missed: Vec<MissedTicks>,
    pub(crate) absences: Vec<Absence>,
    pub(crate) joined: Vec<Joined>,
    pub(crate) queries: Vec<QueriesLost>,
    pub(crate) held_up: Vec<HeldTick>,
    pub(crate) changes: Vec<ChangeSpan>,
}

impl Items {
    /// Number of all of them.
    pub(crate) fn count(&self) -> usize {
        let states = self.bands.len() + self.missed.len() + self.absences.len() + self.joined.len();
        let network = self.commands.len() + self.cuts.len() + self.queries.len();
        states + network + self.faults.len() + self.held_up.len() + self.changes.len()
    }

    /// Adds one.
    pub(crate) fn push(&mut self, span: Span) {
        match span {
            Span::Stay(stay) => self.bands.push(stay),
            Span::Absence(absence) => self.absences.push(absence),
            Span::Missed(missed) => self.missed.push(missed),
            Span::Fault(fault) => self.faults.push(fault),
            Span::Cut(cut) => self.cuts.push(cut),
            Span::QueriesLost(lost) => self.queries.push(lost),
            Span::Command(command) => self.commands.push(command),
            Span::Joined(joined) => self.joined.push(joined),
            Span::Change(change) => self.changes.push(change),
        }
    }

    /// When things began and were over.
    pub(crate) fn periods(&self) -> impl Iterator<Item = Period> {
        let states = self.bands.iter().map(|band| band.period);
        let cuts = self.cuts.iter().map(|cut| cut.period);
        let faults = self.faults.iter().map(|fault| fault.period);
        let missed = self.missed.iter().map(|missed| missed.period);
        let absences = self.absences.iter().map(|absence| absence.period);
        let queries = self.queries.iter().map(|lost| lost.period);
        let of_robots = states.chain(faults).chain(missed).chain(absences);
        of_robots.chain(cuts).chain(queries)
    }

    /// Adds those of another list.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.bands.append(&mut other.bands);
        self.commands.append(&mut other.commands);
        self.cuts.append(&mut other.cuts);
        self.faults.append(&mut other.faults);
        self.missed.append(&mut other.missed);
        self.absences.append(&mut other.absences);
        self.joined.append(&mut other.joined);
        self.queries.append(&mut other.queries);
        self.held_up.append(&mut other.held_up);
        self.changes.append(&mut other.changes);
    }
}
