//! What is said of each thing in its title.

use protocol::Tick;
use protocol::event::Cause;
use protocol::messages::FaultKind;
use protocol::time::time_s;
use timeline::{
    Absence, ChangeSpan, CommandSpan, CutSpan, FaultSpan, Joined, MissedTicks, Period, QueriesLost,
    StateSpan,
};

use crate::diagram::items::{HeldTick, SiteMark};
use crate::labels::shortened;

/// Most letters of a text from a robot in a title.
const TITLE_LETTERS: usize = 300;
/// Most links that the title of a cut names.
const MAX_CUTS: usize = 12;

/// Simulated seconds, in the fewest digits: to the millisecond, unless ticks are shorter.
pub(crate) fn seconds(tick: Tick, tick_s: f64) -> String {
    let time_s = time_s(tick, tick_s);
    if tick_s < 0.001 {
        return format!("{time_s} s");
    }
    format!("{} s", (time_s * 1000.0).round() / 1000.0)
}

/// Why a message was lost, in few words.
pub(crate) fn cause(cause: Cause) -> &'static str {
    match cause {
        Cause::Loss => "by chance",
        Cause::Burst => "burst",
        Cause::Partition => "partition",
        Cause::OutOfRange => "out of range",
        Cause::Missed => "tick missed",
        Cause::Overflow => "too much",
        Cause::Unknown => "no such robot",
        Cause::Scripted => "scripted",
        Cause::Distance => "distance",
        Cause::Wall => "wall",
        Cause::Body => "body",
        Cause::Shadowing => "shadowing",
        Cause::Fading => "fading",
        Cause::Queue => "queue",
    }
}

/// What happened to a process.
pub(crate) fn fault_name(kind: FaultKind) -> &'static str {
    match kind {
        FaultKind::Crash => "crash",
        FaultKind::Hang => "hang",
        FaultKind::Slow => "slow",
        FaultKind::Restart => "restart",
    }
}

/// Titles, with times in ticks and seconds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Titles {
    pub(crate) tick_s: f64,
}

impl Titles {
    fn tick(self, tick: Tick) -> String {
        format!("tick {tick} ({})", seconds(tick, self.tick_s))
    }

    fn period(self, period: Period) -> String {
        let begin = self.tick(period.begin);
        match period.end {
            Some(end) => format!("{begin} to {}", self.tick(end)),
            None => format!("from {begin} on"),
        }
    }

    pub(crate) fn band(self, band: &StateSpan) -> String {
        let kind = band.kind.as_str();
        let name = shortened(&band.name, TITLE_LETTERS);
        let period = self.period(band.period);
        format!("{}: {kind} {name}, {period}", band.robot)
    }

    pub(crate) fn command(self, command: &CommandSpan) -> String {
        let (from, to, seq) = (&command.from, &command.to, command.seq);
        let performative = command.performative;
        let text = shortened(&command.text, TITLE_LETTERS);
        let sent = self.tick(command.sent);
        let mut title =
            format!("{from} → {to}, command {seq}: {performative} “{text}”; sent in {sent}");

        if let Some(until) = command.until {
            title += &format!("; held back until {}", self.tick(until));
        }
        if command.is_doubled {
            title += "; doubled";
        }
        if let Some(because) = command.because {
            title += &format!(", {because}");
        }
        for end in &command.ends {
            let tick = self.tick(end.tick);
            title += &match end.lost {
                None => format!("; arrives in {tick}"),
                Some(because) => format!("; lost in {tick}, {because}"),
            };
        }
        if command.ends.len() < command.copies() {
            title += "; under way at the end of the window";
        }
        title
    }

    pub(crate) fn cuts(self, cuts: &[&CutSpan]) -> String {
        let mut title = "cut:".to_owned();
        for cut in cuts.iter().take(MAX_CUTS) {
            let what = match (cut.commands, cut.queries) {
                (true, true) => "commands and queries",
                (true, false) => "commands",
                _ => "queries",
            };
            let period = self.period(cut.period);
            title += &format!(" {} → {}, {what}, {period};", cut.from, cut.to);
        }
        if cuts.len() > MAX_CUTS {
            title += &format!(" and {} more links", cuts.len() - MAX_CUTS);
        }
        title
    }

    pub(crate) fn fault(self, fault: &FaultSpan) -> String {
        let what = match fault.kind {
            FaultKind::Crash => "the process is killed, and started again at the end",
            FaultKind::Hang => "the process is stopped",
            FaultKind::Slow => "the process is stopped for most of the time",
            FaultKind::Restart => "the process is killed and started again",
        };
        let (name, period) = (fault_name(fault.kind), self.period(fault.period));
        format!("{}: {name}: {what}; {period}", fault.robot)
    }

    pub(crate) fn missed(self, missed: &MissedTicks) -> String {
        let begin = missed.period.begin;
        let last = begin + missed.period.ticks(begin + 1) - 1;
        let (robot, first) = (&missed.robot, self.tick(begin));
        if last == begin {
            return format!("{robot}: missed {first}");
        }
        format!(
            "{robot}: missed every tick from {first} to {}",
            self.tick(last)
        )
    }

    pub(crate) fn absence(self, absence: &Absence) -> String {
        let period = self.period(absence.period);
        format!("{}: lost, takes no part; {period}", absence.robot)
    }

    pub(crate) fn joined(self, joined: &Joined) -> String {
        let (robot, tick) = (&joined.robot, self.tick(joined.tick));
        match joined.generation {
            Some(generation) => format!("{robot}: back as incarnation {generation} in {tick}"),
            None => format!("{robot}: takes part from {tick} on"),
        }
    }

    pub(crate) fn queries(self, lost: &QueriesLost) -> String {
        let (from, to, because) = (&lost.from, &lost.to, lost.because);
        let ticks = lost.period.ticks(lost.period.begin + 1);
        let tick = self.tick(lost.period.begin);
        format!("{from} cannot query {to}, {because}: {ticks} ticks from {tick} on")
    }

    pub(crate) fn change(self, change: &ChangeSpan) -> String {
        format!("{}: from now on {}", self.tick(change.tick), change.set)
    }

    pub(crate) fn sites(self, mark: &SiteMark) -> String {
        let words = shortened(&mark.words.join("; "), TITLE_LETTERS);
        format!("{} in {}: {words}", mark.robot, self.tick(mark.tick))
    }

    pub(crate) fn held_up(self, held: &HeldTick) -> String {
        let awaited = &held.awaited;
        format!(
            "{}: the clock was held for {:.1} s of wall clock, because {} {}. Wall clock differs from run to run.",
            self.tick(held.tick),
            awaited.since_s,
            awaited.name,
            awaited.because
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_one_form() {
        assert_eq!(seconds(58, 0.5), "29 s");
        assert_eq!(seconds(3, 0.1), "0.3 s");
        assert_eq!(seconds(3, 0.025), "0.075 s");
        assert_eq!(seconds(1, 1.0 / 3.0), "0.333 s");
        assert_eq!(seconds(3, 0.000_5), "0.0015 s");
    }
}
