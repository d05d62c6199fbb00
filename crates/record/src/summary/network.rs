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
    #[serde(skip)]
    radio: RadioContacts,
}

/// Which others robots could query in a tick.
#[derive(Debug, Clone, Copy)]
pub struct QueryReach<'a> {
    /// Those that each could not query, other than for the range of radios.
    pub unreachable: &'a BTreeMap<RobotName, Vec<RobotName>>,
    /// Those within the range of the radio of each robot; `None` where distance does not matter.
    pub in_range: Option<&'a BTreeMap<RobotName, Vec<RobotName>>>,
}

/// Metrics of one directed link.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LinkSummary {
    /// Counts of its commands.
    #[serde(flatten)]
    pub counts: LinkCounts,
    /// Ticks in which the sender could not query the target.
    pub unreachable_ticks: u64,
    /// Longest time for which the sender could not query the target, simulated seconds.
    pub longest_stale_s: f64,
    #[serde(skip)]
    stale_ticks: u64,
}

/// Which robots could query each other in the ticks in which radios have a range. Contacts are counted and not their absence, which is
/// that of all pairs.
#[derive(Debug, Clone, PartialEq, Default)]
struct RadioContacts {
    /// Number of these ticks.
    ticks: u64,
    robots: BTreeSet<RobotName>,
    /// By asker and target.
    pairs: BTreeMap<(RobotName, RobotName), Contact>,
}

/// The contact of a robot with another one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Contact {
    /// Ticks in which it could query the other one.
    ticks: u64,
    /// The last one of these, among the ticks in which radios have a range, from 1; 0 if there was none.
    last: u64,
    /// Most ticks between two of them.
    longest_gap: u64,
    /// Whether a query within the range was not possible.
    was_lost: bool,
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
    pub(super) fn count(&mut self, tick_s: f64, reach: QueryReach<'_>, tick: Tick, event: &Event) {
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
            Event::Tick { .. } => match reach.in_range {
                Some(in_range) => self.radio.count(in_range, reach.unreachable),
                None => self.count_staleness(tick_s, reach.unreachable),
            },
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
            | Event::GuestEntered { .. }
            | Event::GuestLeft { .. }
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

    /// Adds the counts of commands, and of the contacts by radio of links that have messages or lost a query.
    pub(super) fn add_counts(
        &mut self,
        links: BTreeMap<(RobotName, RobotName), LinkCounts>,
        tick_s: f64,
    ) {
        let mut counted = self.radio.lost_pairs();
        for ((from, to), counts) in links {
            self.link(&from, &to).counts = counts;
            counted.insert((from, to));
        }

        let radio = std::mem::take(&mut self.radio);
        for pair in counted {
            let Some(contact) = radio.contact(&pair) else {
                continue;
            };
            let longest_ticks = contact.longest_gap.max(radio.ticks - contact.last);
            let link = self.link(&pair.0, &pair.1);
            link.unreachable_ticks += radio.ticks - contact.ticks;
            link.longest_stale_s = link.longest_stale_s.max(time_s(longest_ticks, tick_s));
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

impl RadioContacts {
    /// Counts a tick in which radios have a range.
    fn count(
        &mut self,
        in_range: &BTreeMap<RobotName, Vec<RobotName>>,
        unreachable: &BTreeMap<RobotName, Vec<RobotName>>,
    ) {
        self.ticks += 1;
        if self.robots.is_empty() {
            self.robots = in_range.keys().cloned().collect();
        }

        for (asker, targets) in in_range {
            let lost = unreachable.get(asker);
            for target in targets {
                let pair = (asker.clone(), target.clone());
                let contact = self.pairs.entry(pair).or_default();
                if lost.is_some_and(|lost| lost.contains(target)) {
                    contact.was_lost = true;
                    continue;
                }
                contact.longest_gap = contact.longest_gap.max(self.ticks - 1 - contact.last);
                contact.ticks += 1;
                contact.last = self.ticks;
            }
        }
    }

    /// The contact of two robots; `None` where radios have no range, and for others, such as the operator.
    fn contact(&self, pair: &(RobotName, RobotName)) -> Option<Contact> {
        let are_robots = self.robots.contains(&pair.0) && self.robots.contains(&pair.1);
        are_robots.then(|| self.pairs.get(pair).copied().unwrap_or_default())
    }

    fn lost_pairs(&self) -> BTreeSet<(RobotName, RobotName)> {
        let lost = self.pairs.iter().filter(|(_, contact)| contact.was_lost);
        lost.map(|(pair, _)| pair.clone()).collect()
    }
}

fn key(from: &RobotName, to: &RobotName) -> String {
    format!("{from} -> {to}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robots(names: &[(&str, &[&str])]) -> BTreeMap<RobotName, Vec<RobotName>> {
        let name = |text: &str| RobotName::new(text).unwrap();
        let each = names.iter();
        each.map(|(of, others)| (name(of), others.iter().map(|other| name(other)).collect()))
            .collect()
    }

    #[test]
    fn ticks_out_of_the_range_of_radios_are_unreachable() {
        let near = robots(&[("A", &["B"]), ("B", &["A"]), ("C", &[])]);
        let apart = robots(&[("A", &[]), ("B", &[]), ("C", &[])]);
        let a_loses = robots(&[("A", &["B"])]);
        let none = BTreeMap::new();

        let mut network = NetworkSummary::default();
        let ticks = [
            (&apart, &none),
            (&near, &none),
            (&near, &a_loses),
            (&apart, &none),
            (&apart, &none),
            (&near, &none),
        ];
        for (tick, (in_range, unreachable)) in ticks.into_iter().enumerate() {
            let reach = QueryReach {
                unreachable,
                in_range: Some(in_range),
            };
            let event = Event::Tick {
                digest: String::new(),
                seal: None,
            };
            network.count(0.5, reach, tick as Tick, &event);
        }
        let name = |text: &str| RobotName::new(text).unwrap();
        let sent = [("B", "A"), ("A", "C"), ("operator", "A")]
            .map(|(from, to)| ((name(from), name(to)), LinkCounts::default()));
        network.add_counts(sent.into(), 0.5);

        let of = |link: &str| {
            let link = &network.links[link];
            (link.unreachable_ticks, link.longest_stale_s)
        };
        assert_eq!(
            of("A -> B"),
            (4, 1.5),
            "three ticks in a row, one of them by chance"
        );
        assert_eq!(of("B -> A"), (3, 1.0));
        assert_eq!(of("A -> C"), (6, 3.0), "never in range");
        assert_eq!(of("operator -> A"), (0, 0.0));
        assert_eq!(
            network.links.len(),
            4,
            "links without messages and losses are left out"
        );
    }
}
