//! Metrics of the network: losses, delays, cuts, and how old the robots' knowledge of each other was.

use std::collections::{BTreeMap, BTreeSet};

use protocol::event::Cause;
use protocol::time::{between_s, time_s};
use protocol::{Event, RobotName, Tick};
use serde::{Deserialize, Serialize};

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
    /// Commands that were sent.
    pub sent: u64,
    /// Commands that arrived; a duplicated command counts twice.
    pub delivered: u64,
    /// Commands that were lost, by cause.
    pub dropped: BTreeMap<Cause, u64>,
    /// Commands that were delayed.
    pub delayed: u64,
    /// Commands that were duplicated.
    pub duplicated: u64,
    /// Ticks in which the sender could not query the target.
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
            Event::CommandSent { from, to, .. } => self.link(from, to).sent += 1,
            Event::CommandDelivered { from, to, .. } => self.count_delivered(from, to, now_s),
            Event::CommandDropped {
                from, to, because, ..
            } => self.count_dropped(from, to, *because, now_s),
            Event::CommandDelayed { from, to, .. } => self.link(from, to).delayed += 1,
            Event::CommandDuplicated { from, to, .. } => self.link(from, to).duplicated += 1,
            Event::LinkCut {
                from, to, queries, ..
            } => self.begin_cut(from, to, now_s, *queries),
            Event::LinkHealed { from, to } => {
                if let Some(cut) = self.open_cut(from, to) {
                    cut.until_s = Some(now_s);
                }
            }
            Event::Tick { .. } => self.count_staleness(tick_s, unreachable),
            _ => {}
        }
    }

    fn count_delivered(&mut self, from: &RobotName, to: &RobotName, now_s: f64) {
        self.link(from, to).delivered += 1;

        let last_first = self.cuts.iter_mut().rev();
        if let Some(cut) = last_first.into_iter().find(|cut| cut.is_of(from, to))
            && let Some(until_s) = cut.until_s
        {
            cut.healed_after_s.get_or_insert(between_s(until_s, now_s));
        }
    }

    fn count_dropped(&mut self, from: &RobotName, to: &RobotName, because: Cause, now_s: f64) {
        *self.link(from, to).dropped.entry(because).or_default() += 1;

        if because == Cause::Partition
            && let Some(cut) = self.open_cut(from, to)
        {
            cut.detected_after_s
                .get_or_insert(between_s(cut.from_s, now_s));
        }
    }

    fn begin_cut(&mut self, from: &RobotName, to: &RobotName, now_s: f64, queries: bool) {
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

        if queries && let Some(cut) = self.open_cut(from, to) {
            cut.detected_after_s
                .get_or_insert(between_s(cut.from_s, now_s));
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
            if !aged.contains(name) {
                link.stale_ticks = 0;
            }
        }
    }

    fn link(&mut self, from: &RobotName, to: &RobotName) -> &mut LinkSummary {
        self.links.entry(key(from, to)).or_default()
    }

    fn open_cut(&mut self, from: &RobotName, to: &RobotName) -> Option<&mut CutSummary> {
        let mut last_first = self.cuts.iter_mut().rev();
        last_first.find(|cut| cut.is_of(from, to) && cut.until_s.is_none())
    }
}

impl CutSummary {
    fn is_of(&self, from: &RobotName, to: &RobotName) -> bool {
        self.from == *from && self.to == *to
    }
}

fn key(from: &RobotName, to: &RobotName) -> String {
    format!("{from} -> {to}")
}
