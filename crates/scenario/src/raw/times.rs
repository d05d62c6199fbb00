//! Times of a scenario beside its ticks. What is written is rounded to ticks, and what begins after the end does nothing: people
//! are told so.

use config::units::Time;
use config::{FileError, Source};
use protocol::Tick;
use toml::Spanned;

use super::super::network::ticks;

/// Largest difference between a time and its tick that counts as none, in ticks: numbers like 0.1 have no exact binary form.
const TOLERANCE: f64 = 1e-6;

/// Remarks about the times of a scenario.
pub(super) struct Times<'a> {
    pub(super) source: &'a Source,
    tick_s: f64,
    /// Last tick of the run.
    last: Tick,
    pub(super) remarks: Vec<FileError>,
}

impl<'a> Times<'a> {
    pub(super) fn new(source: &'a Source, tick_s: f64, last: Tick) -> Self {
        Self {
            source,
            tick_s,
            last,
            remarks: Vec::new(),
        }
    }

    /// Remarks that the run lasts for another time than its duration.
    pub(super) fn duration(&mut self, duration: &Spanned<Time>) {
        let lasts_s = self.last as f64 * self.tick_s;
        if !is_on_tick(*duration.get_ref(), self.tick_s) {
            let text = format!(
                "a tick lasts {} s: the run lasts {} s",
                self.tick_s,
                rounded(lasts_s)
            );
            self.remark(duration, &text);
        }
    }

    /// Remarks that something begins at another time, or never.
    pub(super) fn begins(&mut self, what: &str, at: &Spanned<Time>) {
        if ticks(at.get_ref().0, self.tick_s) > self.last {
            let end_s = rounded(self.last as f64 * self.tick_s);
            let text = format!("this {what} never begins: the run ends at {end_s} s");
            self.remark(at, &text);
        } else {
            self.on_tick(at);
        }
    }

    /// Remarks that a time is rounded.
    pub(super) fn on_tick(&mut self, time: &Spanned<Time>) {
        let Time(time_s) = *time.get_ref();
        if !is_on_tick(*time.get_ref(), self.tick_s) {
            let tick = ticks(time_s, self.tick_s);
            let at_s = rounded(tick as f64 * self.tick_s);
            let text = format!(
                "this is between two ticks of {} s: it counts as {at_s} s, tick {tick}",
                self.tick_s
            );
            self.remark(time, &text);
        }
    }

    fn remark(&mut self, at: &Spanned<Time>, text: &str) {
        self.remarks
            .push(FileError::warning(self.source, Some(at.span()), text));
    }
}

/// Why nothing lies between two times: they are in the wrong order, or between two ticks.
pub(super) fn no_tick_between(begin_key: &str, begin: Time, end: Time, tick_s: f64) -> String {
    if end.0 <= begin.0 {
        return format!("it ends before it begins: `until` comes after `{begin_key}`");
    }
    let tick = ticks(begin.0, tick_s);
    format!(
        "there is no tick from {} s to {} s: a tick lasts {tick_s} s, and both count as tick {tick}",
        begin.0, end.0
    )
}

fn is_on_tick(time: Time, tick_s: f64) -> bool {
    let in_ticks = time.0 / tick_s;
    (in_ticks - in_ticks.round()).abs() <= TOLERANCE
}

/// A number of seconds without the digits that only its binary form has.
fn rounded(time_s: f64) -> f64 {
    (time_s * 1e9).round() / 1e9
}
