//! A log for ShiViz (<https://bestchai.bitbucket.io/shiviz>): what robots did, in the order that commands impose on it.
//!
//! The first line is the regular expression by which ShiViz reads an event, the second one that of the line before each epoch.
//! Hosts are the robots and, if it sent commands, the operator. The vector clock of a host counts its events; a command that
//! arrives brings the clock of its sending. A command that was lost is sent and never received.

use std::collections::BTreeMap;
use std::io::Write;

use protocol::plain::escape_line;
use protocol::{Event, RobotName, Seq, Tick};
use record::EpochFiles;
use record::{Entry, Record};
use timeline::Timeline;

use crate::ExportError;

/// How an event is read.
const EVENT: &str = r"^(?<host>\S+) (?<clock>\{[^}]*\}) (?<tick>\d+) (?<event>.*)$";
/// How the line before an epoch is read.
const EPOCH: &str = r"^=== epoch (?<trace>\d+) ===$";

/// How many events of each host an event knows of, itself included. Hosts without any are left out.
type Clock = BTreeMap<RobotName, u64>;

/// Writes the log of epochs of a run.
///
/// # Errors
/// [`ExportError`] if a record cannot be read, or the log cannot be written.
pub fn write(epochs: &[EpochFiles], out: &mut impl Write) -> Result<(), ExportError> {
    writeln!(out, "{EVENT}\n{EPOCH}")?;
    for files in epochs {
        writeln!(out, "=== epoch {} ===", files.epoch)?;
        let mut record = Record::of_events(&files.events)?;
        let mut hosts = Hosts::default();
        while let Some(entry) = record.next_entry()? {
            for line in hosts.lines(&entry) {
                writeln!(out, "{line}")?;
            }
        }
    }

    Ok(())
}

/// The hosts of an epoch.
#[derive(Default)]
struct Hosts {
    clocks: BTreeMap<RobotName, Clock>,
    /// Clocks of commands under way, by sender and number.
    sent: BTreeMap<(RobotName, Seq), Clock>,
    timeline: Timeline,
}

impl Hosts {
    /// The lines of a tick.
    fn lines(&mut self, entry: &Entry) -> Vec<String> {
        let mut lines = Vec::new();
        for event in &entry.events {
            if let Some((host, text)) = self.host_event(event) {
                lines.push(self.line(&host, entry.tick, &text));
            }
            if let Event::CommandSent { from, seq, .. } = event {
                let clock = self.clocks.get(from).cloned().unwrap_or_default();
                self.sent.insert((from.clone(), *seq), clock);
            }
            self.timeline.apply(entry.tick, event);
        }

        let timeline = &self.timeline;
        self.sent
            .retain(|(from, seq), _| timeline.command(from, *seq).is_some());
        lines
    }

    /// The host of an event and what is said of it; `None` for an event of no host.
    fn host_event(&mut self, event: &Event) -> Option<(RobotName, String)> {
        let (host, text) = match event {
            Event::Joined {
                robot,
                generation: Some(generation),
                ..
            } => (robot, format!("is back as incarnation {generation}")),
            Event::Joined { robot, .. } => (robot, "takes part".to_owned()),
            Event::Lost { robot } => (robot, "is lost".to_owned()),
            Event::Emotion { robot, to, .. } => (robot, format!("emotion {to}")),
            Event::Behavior { robot, to, .. } => (robot, format!("behavior {to}")),
            Event::Say { robot, text } => (robot, format!("says: {text}")),
            Event::Warned { robot, text } => (robot, format!("warning: {text}")),
            Event::SiteChanged {
                robot,
                site,
                key,
                to,
                ..
            } => (robot, format!("sets {key} of site {site} to {to}")),
            Event::LayerChanged {
                robot,
                layer,
                change,
                ..
            } => (robot, format!("adds {change} to layer {layer}")),
            Event::CommandSent {
                from, to, command, ..
            } => (from, format!("sends {to}: {command}")),
            Event::CommandDelivered { from, to, seq } => (to, self.receive(from, to, *seq)),
            Event::Init { .. }
            | Event::Missed { .. }
            | Event::DoneLate { .. }
            | Event::Blocked { .. }
            | Event::Guest { .. }
            | Event::GuestEntered { .. }
            | Event::GuestLeft { .. }
            | Event::SiteRefused { .. }
            | Event::LayerRefused { .. }
            | Event::CommandDropped { .. }
            | Event::CommandDelayed { .. }
            | Event::CommandDuplicated { .. }
            | Event::QueryLost { .. }
            | Event::LinkCut { .. }
            | Event::LinkHealed { .. }
            | Event::Fault { .. }
            | Event::Changed { .. }
            | Event::Judged { .. }
            | Event::Tick { .. }
            | Event::End { .. } => return None,
        };
        Some((host.clone(), text))
    }

    /// Takes the clock of a command over. Returns the text of its arrival.
    fn receive(&mut self, from: &RobotName, to: &RobotName, seq: Seq) -> String {
        let Some(command) = self.timeline.command(from, seq) else {
            return format!("receives command {seq} of {from}");
        };

        let clock = self.clocks.entry(to.clone()).or_default();
        for (host, count) in self.sent.get(&(from.clone(), seq)).into_iter().flatten() {
            let known = clock.entry(host.clone()).or_default();
            *known = (*known).max(*count);
        }
        format!("receives from {from}: {}", command.text)
    }

    /// The line of an event of a host, which its clock counts.
    fn line(&mut self, host: &RobotName, tick: Tick, text: &str) -> String {
        let clock = self.clocks.entry(host.clone()).or_default();
        *clock.entry(host.clone()).or_default() += 1;

        let clock = serde_json::to_string(clock)
            .unwrap_or_else(|error| unreachable!("a clock is always JSON: {error}"));
        format!("{host} {clock} {tick} {}", escape_line(text))
    }
}
