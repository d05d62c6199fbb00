//! Metrics of the network: losses, delays, cuts, and how old the robots' knowledge of each other was.

use std::collections::{BTreeMap, BTreeSet};

use protocol::event::Cause;
use protocol::time::{between_s, time_s};
use protocol::{Event, RobotName, Tick};
use serde::{Deserialize, Serialize};
use timeline::LinkCounts;

/// Metrics of the network of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct NetworkSummary {
    /// Metrics of the links, by `Sender -> Target`. Links without messages are left out.
    pub links: BTreeMap<String, LinkSummary>,
    /// All cuts in their order.
    pub cuts: Vec<CutSummary>,
}

/// Metrics of one directed link.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LinkSummary {
    /// Counts of its commands.
    #[serde(flatten)]
    pub counts: LinkCounts,
    /// Ticks in which the sender could not query the target, other than for the range of radios.
    pub unreachable_ticks: u64,
    /// Longest time for which the sender could not query the target, simulated seconds.
    pub longest_stale_s: f64,
    #[serde(skip)]
    stale_ticks: u64,
}

/// A cut of a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CutSummary {
    /// Sender of the lost messages.
    pub from: RobotName,
    /// Their target.
    pub to: RobotName,
    /// Begin of the cut, simulated seconds.
    pub from_s: f64,
    /// End of the cut, simulated seconds; absent if it did not end.
    pub until_s: Option<f64>,
    /// Time from the begin to the first lost message, simulated seconds; absent if none was sent. It is 0 if queries are
    /// cut, because a robot that queries every tick notices at once.
    pub detected_after_s: Option<f64>,
    /// Time from the end to the first delivered command, simulated seconds; absent if none was sent.
    pub healed_after_s: Option<f64>,
}

impl NetworkSummary {
    /// Counts an event.
    pub(super) fn count(
        &mut self,
        tick_s: f64,
        unreachable: &BTreeMap<RobotName, Vec<RobotName>>,
        tick: Tick,
        event: &Event,
    ) {
        let now_s = time_s(tick, tick_s);

        match event {
            Event::CommandDelivered { from, to, .. } => self.notice_healed(from, to, now_s),
            Event::CommandDropped {
                from,
                to,
                because: Cause::Partition,
                ..
            } => self.notice_cut(from, to, now_s),
            Event::LinkCut {
                from, to, queries, ..
            } => self.begin_cut(from, to, now_s, *queries),
            Event::LinkHealed { from, to } => {
                if let Some(cut) = self.open_cut(from, to) {
                    cut.until_s = Some(now_s);
                }
            }
            Event::Tick { .. } => self.count_staleness(tick_s, unreachable),
            Event::Init { .. }
            | Event::Joined { .. }
            | Event::Lost { .. }
            | Event::Missed { .. }
            | Event::DoneLate { .. }
            | Event::Fault { .. }
            | Event::Emotion { .. }
            | Event::Behavior { .. }
            | Event::Blocked { .. }
            | Event::Say { .. }
            | Event::Guest { .. }
            | Event::SiteChanged { .. }
            | Event::SiteRefused { .. }
            | Event::LayerChanged { .. }
            | Event::LayerRefused { .. }
            | Event::Warned { .. }
            | Event::CommandSent { .. }
            | Event::CommandDelayed { .. }
            | Event::CommandDuplicated { .. }
            | Event::CommandDropped { .. }
            | Event::QueryLost { .. }
            | Event::Changed { .. }
            | Event::Judged { .. }
            | Event::End { .. } => {}
        }
    }

    /// Adds the counts of commands.
    pub(super) fn add_counts(&mut self, links: BTreeMap<(RobotName, RobotName), LinkCounts>) {
        for ((from, to), counts) in links {
            self.link(&from, &to).counts = counts;
        }
    }

    /// A command has arrived.
    fn notice_healed(&mut self, from: &RobotName, to: &RobotName, now_s: f64) {
        if let Some(cut) = self.last_cut(from, to)
            && let Some(until_s) = cut.until_s
        {
            cut.healed_after_s.get_or_insert(between_s(until_s, now_s));
        }
    }

    /// A message is lost in a cut.
    fn notice_cut(&mut self, from: &RobotName, to: &RobotName, now_s: f64) {
        if let Some(cut) = self.open_cut(from, to) {
            cut.detected_after_s
                .get_or_insert(between_s(cut.from_s, now_s));
        }
    }

    fn begin_cut(&mut self, from: &RobotName, to: &RobotName, now_s: f64, queries: bool) {
        // Where a cut goes on with another scope, it is the same one.
        if self.open_cut(from, to).is_none() {
            self.cuts.push(CutSummary {
                from: from.clone(),
                to: to.clone(),
                from_s: now_s,
                until_s: None,
                detected_after_s: None,
                healed_after_s: None,
            });
        }

        if queries {
            self.notice_cut(from, to, now_s);
        }
    }

    /// Counts for each pair of robots the ticks since the last one in which a query was possible.
    fn count_staleness(&mut self, tick_s: f64, unreachable: &BTreeMap<RobotName, Vec<RobotName>>) {
        let mut aged = BTreeSet::new();
        for (asker, targets) in unreachable {
            for target in targets {
                let link = self.link(asker, target);
                link.unreachable_ticks += 1;
                link.stale_ticks += 1;
                link.longest_stale_s = link.longest_stale_s.max(time_s(link.stale_ticks, tick_s));
                aged.insert(key(asker, target));
            }
        }

        for (name, link) in &mut self.links {
            // A query was possible in this tick: the age begins anew.
            if !aged.contains(name) {
                link.stale_ticks = 0;
            }
        }
    }

    fn link(&mut self, from: &RobotName, to: &RobotName) -> &mut LinkSummary {
        self.links.entry(key(from, to)).or_default()
    }

    fn last_cut(&mut self, from: &RobotName, to: &RobotName) -> Option<&mut CutSummary> {
        let mut last_first = self.cuts.iter_mut().rev();
        last_first.find(|cut| cut.from == *from && cut.to == *to)
    }

    /// A link has one cut at a time.
    fn open_cut(&mut self, from: &RobotName, to: &RobotName) -> Option<&mut CutSummary> {
        self.last_cut(from, to).filter(|cut| cut.until_s.is_none())
    }
}

fn key(from: &RobotName, to: &RobotName) -> String {
    format!("{from} -> {to}")
}
