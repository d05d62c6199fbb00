//! What the network did to the robots' messages, and what they could know of one another meanwhile.

use std::collections::{BTreeMap, BTreeSet};

use protocol::event::Cause;
use protocol::{Event, RobotName, Tick};
use serde::{Deserialize, Serialize};

use crate::simulation::Simulation;

/// Metrics of the network of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct NetworkSummary {
    /// What became of messages, by `Sender -> Target`; links over which nothing was said and of which nothing was
    /// missed are left out.
    pub links: BTreeMap<String, LinkSummary>,
    /// Every cut link, in the order in which they were cut.
    pub cuts: Vec<CutSummary>,
}

/// What became of the messages of one directed link.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LinkSummary {
    /// Commands that were sent.
    pub sent: u64,
    /// Commands that arrived; one that came twice counts twice.
    pub delivered: u64,
    /// Commands that the medium lost, by cause.
    pub dropped: BTreeMap<Cause, u64>,
    /// Commands that the medium held back.
    pub delayed: u64,
    /// Commands that the medium doubled.
    pub duplicated: u64,
    /// Ticks in which the sender could not ask the target anything.
    pub unreachable_ticks: u64,
    /// Longest time for which what the sender knew of the target by asking was out of date, simulated seconds.
    pub longest_stale_s: f64,
    #[serde(skip)]
    stale_ticks: u64,
}

/// A cut link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CutSummary {
    /// Who could not reach the other.
    pub from: RobotName,
    /// The other.
    pub to: RobotName,
    /// When it was cut, simulated seconds.
    pub from_s: f64,
    /// When it was healed; absent if it was not.
    pub until_s: Option<f64>,
    /// How long after the cut the first message did not come through, simulated seconds; absent if none was sent. Where
    /// queries are cut, who asks every tick knows at once.
    pub detected_after_s: Option<f64>,
    /// How long after the healing the first command came through, simulated seconds; absent if none was sent.
    pub healed_after_s: Option<f64>,
}

impl NetworkSummary {
    /// Counts an event.
    pub(super) fn count(&mut self, simulation: &Simulation, tick: Tick, event: &Event) {
        let now_s = simulation.time_s(tick);

        match event {
            Event::CommandSent { from, to, .. } => self.link(from, to).sent += 1,
            Event::CommandDelivered { from, to, .. } => {
                self.link(from, to).delivered += 1;
                let cut = self.cuts.iter_mut().rev().find(|cut| cut.is_of(from, to));
                if let Some((cut, until_s)) =
                    cut.and_then(|cut| cut.until_s.map(|until_s| (cut, until_s)))
                {
                    cut.healed_after_s.get_or_insert(now_s - until_s);
                }
            }
            Event::CommandDropped {
                from, to, because, ..
            } => {
                *self.link(from, to).dropped.entry(*because).or_default() += 1;
                if let (Cause::Partition, Some(cut)) = (because, self.open_cut(from, to)) {
                    cut.detected_after_s.get_or_insert(now_s - cut.from_s);
                }
            }
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
            Event::Tick { .. } => self.count_staleness(simulation),
            _ => {}
        }
    }

    fn begin_cut(&mut self, from: &RobotName, to: &RobotName, from_s: f64, queries: bool) {
        let cut = match self.open_cut(from, to) {
            Some(cut) => cut,
            None => {
                let (from, to) = (from.clone(), to.clone());
                let (until_s, detected_after_s, healed_after_s) = (None, None, None);
                self.cuts.push(CutSummary {
                    from,
                    to,
                    from_s,
                    until_s,
                    detected_after_s,
                    healed_after_s,
                });
                let last = self.cuts.len() - 1;
                &mut self.cuts[last]
            }
        };

        if queries {
            cut.detected_after_s.get_or_insert(from_s - cut.from_s);
        }
    }

    /// Ages what each robot knows of those it cannot ask in this tick.
    fn count_staleness(&mut self, simulation: &Simulation) {
        let tick_s = simulation.scenario().tick_s;
        let mut aged = BTreeSet::new();
        for (asker, targets) in simulation.unreachable() {
            for target in targets {
                let link = self.link(asker, target);
                link.unreachable_ticks += 1;
                link.stale_ticks += 1;
                link.longest_stale_s = link.longest_stale_s.max(link.stale_ticks as f64 * tick_s);
                aged.insert(key(asker, target));
            }
        }

        let fresh = self
            .links
            .iter_mut()
            .filter(|(name, _)| !aged.contains(*name));
        fresh.for_each(|(_, link)| link.stale_ticks = 0);
    }

    fn link(&mut self, from: &RobotName, to: &RobotName) -> &mut LinkSummary {
        self.links.entry(key(from, to)).or_default()
    }

    fn open_cut(&mut self, from: &RobotName, to: &RobotName) -> Option<&mut CutSummary> {
        self.cuts
            .iter_mut()
            .rev()
            .find(|cut| cut.is_of(from, to) && cut.until_s.is_none())
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
