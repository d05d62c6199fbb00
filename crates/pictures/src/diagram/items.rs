//! The things that a diagram shows.

use protocol::messages::Awaited;
use protocol::{Event, RobotName, Tick};

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

/// What a robot did to sites in a tick.
#[derive(Debug, Clone)]
pub(crate) struct SiteMark {
    pub(crate) robot: RobotName,
    pub(crate) tick: Tick,
    /// What it did, in words. The title names them all, the label the first one.
    pub(crate) words: Vec<String>,
}

impl SiteMark {
    /// Whether all that it did was refused.
    pub(crate) fn is_refused(&self) -> bool {
        self.words.iter().all(|words| words.contains(" refused: "))
    }
}

/// Most ticks in which robots act on sites that are drawn; of more, their number.
const MAX_SITE_MARKS: usize = 2000;

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
    pub(crate) sites: Vec<SiteMark>,
    /// How many marks of sites are left out.
    pub(crate) sites_left_out: usize,
}

impl Items {
    /// Number of all of them.
    pub(crate) fn count(&self) -> usize {
        let states = self.bands.len() + self.missed.len() + self.absences.len() + self.joined.len();
        let network = self.commands.len() + self.cuts.len() + self.queries.len();
        states + network + self.faults.len() + self.held_up.len() + self.changes.len()
    }

    /// Adds what an event of a tick says about sites.
    pub(crate) fn push_site(&mut self, tick: Tick, event: &Event) {
        let (robot, words) = match event {
            Event::SiteChanged {
                robot,
                site,
                key,
                to,
                ..
            } => (robot, format!("{site} {key} {to}")),
            Event::SiteRefused {
                robot,
                site,
                because,
            } => (robot, format!("{site} refused: {}", because.name())),
            _ => return,
        };
        let last = self.sites.iter_mut().rev();
        let mut of_tick = last.take_while(|mark| mark.tick == tick);
        match of_tick.find(|mark| mark.robot == *robot) {
            Some(mark) => mark.words.push(words),
            None => self.sites.push(SiteMark {
                robot: robot.clone(),
                tick,
                words: vec![words],
            }),
        }
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
            // Guests and expectations have no line of their own in a diagram.
            Span::Guest(_) | Span::Judged(_) => {}
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
        let kept = MAX_SITE_MARKS.saturating_sub(self.sites.len());
        let left_out = other.sites.len().saturating_sub(kept);
        other.sites.truncate(kept);
        self.sites.append(&mut other.sites);
        self.sites_left_out += left_out + other.sites_left_out;
    }
}
