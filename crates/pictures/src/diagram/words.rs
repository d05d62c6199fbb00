//! Texts of a diagram: names and times, and what is said of each thing in its title.

use protocol::Tick;
use protocol::event::Cause;
use protocol::messages::FaultKind;
use protocol::time::time_s;

use crate::diagram::items::{
    Absence, Band, BandKind, Change, Command, CommandEnd, Cut, Fault, HeldUp, Joined, Missed,
    Period, QueriesLost,
};

/// Most letters of a command in a label.
const LABEL_LETTERS: usize = 24;
/// Most letters of a text from a robot in a title.
const TITLE_LETTERS: usize = 300;

/// Approximate width of a letter in ems of a sans-serif font. Rather too wide, because fonts differ.
fn letter_em(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | ' ' | 'I' => 0.32,
        'f' | 'r' | 't' | '(' | ')' | '-' => 0.42,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.9,
        'A'..='Z' => 0.7,
        c if c.is_ascii() => 0.6,
        _ => 1.05,
    }
}

/// Approximate width of a text in a sans-serif font, pixels. Rather too wide, because fonts differ.
#[must_use]
pub fn width_px(text: &str, font_px: f64) -> f64 {
    text.chars().map(letter_em).sum::<f64>() * font_px
}

/// The beginning of a text, with an ellipsis if letters are left out.
#[must_use]
pub fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// The text of a command in a label.
pub(crate) fn label(command: &Command) -> String {
    shortened(&command.text, LABEL_LETTERS)
}

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
        Cause::Missed => "tick missed",
        Cause::Overflow => "too much",
        Cause::Unknown => "no such robot",
        Cause::Scripted => "scripted",
    }
}

/// What happened to a process.
pub(crate) fn fault(kind: FaultKind) -> &'static str {
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

    pub(crate) fn band(self, band: &Band) -> String {
        let kind = match band.kind {
            BandKind::Emotion => "emotion",
            BandKind::Behavior => "behavior",
        };
        let name = shortened(&band.name, TITLE_LETTERS);
        format!(
            "{}: {kind} {name}, {}",
            band.robot,
            self.period(band.period)
        )
    }

    pub(crate) fn command(self, command: &Command) -> String {
        let Command {
            from,
            to,
            seq,
            performative,
            ..
        } = command;
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
        for CommandEnd { tick, lost } in &command.ends {
            title += &match lost {
                None => format!("; arrives in {}", self.tick(*tick)),
                Some(because) => format!("; lost in {}, {because}", self.tick(*tick)),
            };
        }
        if command.ends.len() < command.copies() {
            title += "; under way at the end of the window";
        }
        title
    }

    pub(crate) fn cuts(self, cuts: &[&Cut]) -> String {
        const MOST: usize = 12;

        let mut title = "cut:".to_owned();
        for cut in cuts.iter().take(MOST) {
            let what = match (cut.commands, cut.queries) {
                (true, true) => "commands and queries",
                (true, false) => "commands",
                _ => "queries",
            };
            title += &format!(
                " {} → {}, {what}, {};",
                cut.from,
                cut.to,
                self.period(cut.period)
            );
        }

        if cuts.len() > MOST {
            title += &format!(" and {} more links", cuts.len() - MOST);
        }

        title
    }

    pub(crate) fn fault(self, fault: &Fault) -> String {
        let what = match fault.kind {
            FaultKind::Crash => "crash: the process is killed, and started again at the end",
            FaultKind::Hang => "hang: the process is stopped",
            FaultKind::Slow => "slow: the process is stopped for most of the time",
            FaultKind::Restart => "restart: the process is killed and started again",
        };
        format!("{}: {what}; {}", fault.robot, self.period(fault.period))
    }

    pub(crate) fn missed(self, missed: &Missed) -> String {
        let Period { begin, end } = missed.period;
        let last = end.map_or(begin, |end| end - 1);
        if last == begin {
            return format!("{}: missed {}", missed.robot, self.tick(begin));
        }
        format!(
            "{}: missed every tick from {} to {}",
            missed.robot,
            self.tick(begin),
            self.tick(last)
        )
    }

    pub(crate) fn absence(self, absence: &Absence) -> String {
        format!(
            "{}: lost, takes no part; {}",
            absence.robot,
            self.period(absence.period)
        )
    }

    pub(crate) fn joined(self, joined: &Joined) -> String {
        let tick = self.tick(joined.tick);
        match joined.generation {
            Some(generation) => format!(
                "{}: back as incarnation {generation} in {tick}",
                joined.robot
            ),
            None => format!("{}: takes part from {tick} on", joined.robot),
        }
    }

    pub(crate) fn queries(self, lost: &QueriesLost) -> String {
        let QueriesLost {
            from,
            to,
            because,
            period,
        } = lost;
        let ticks = period.end.map_or(1, |end| end - period.begin);
        let tick = self.tick(period.begin);
        format!("{from} cannot query {to}, {because}: {ticks} ticks from {tick} on")
    }

    pub(crate) fn change(self, change: &Change) -> String {
        format!("{}: from now on {}", self.tick(change.tick), change.set)
    }

    pub(crate) fn held_up(self, held: &HeldUp) -> String {
        let HeldUp { tick, awaited } = held;
        format!(
            "{}: the clock was held for {:.1} s of wall clock, because {} {}. Wall clock differs from run to run.",
            self.tick(*tick),
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

    #[test]
    fn long_texts_are_shortened_between_letters() {
        assert_eq!(shortened("äöü", 3), "äöü");
        assert_eq!(shortened("äöüß", 3), "äöü…");
    }
}
