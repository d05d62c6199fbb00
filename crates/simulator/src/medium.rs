//! The simulated network between robots: it decides which commands arrive, and when, and who can ask whom.
//!
//! Everything is drawn by counter from streams that are named after what they decide (seed, tick, sender, target,
//! number), so that no message and no further robot changes the fate of another.

use std::collections::{BTreeMap, BTreeSet};

use protocol::event::{Cause, Event};
use protocol::messages::{CommandText, Cut, Delivery};
use protocol::random::{Stream, stream, unit};
use protocol::{RobotName, Seq, Tick};

use crate::scenario::Network;
use crate::scenario::network::{Burst, Channel, ticks};

/// A command on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Underway {
    /// To whom.
    pub to: RobotName,
    /// By whom.
    pub from: RobotName,
    /// Its number among the sender's.
    pub seq: Seq,
    /// What it says.
    pub text: CommandText,
}

impl Underway {
    /// The event that it was sent.
    #[must_use]
    pub fn event(&self) -> Event {
        Event::CommandSent {
            from: self.from.clone(),
            to: self.to.clone(),
            seq: self.seq,
            performative: self.text.performative,
            command: self.text.command.clone(),
        }
    }

    /// Bytes that its delivery takes in the news of its target.
    fn encoded_bytes(&self) -> usize {
        let text_bytes = serde_json::to_string(&self.text.command).map_or(0, |json| json.len());

        text_bytes + self.from.as_str().len() + DELIVERY_BYTES
    }
}

/// A command that arrives.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Arrival {
    /// Its number among the sender's.
    pub seq: Seq,
    /// What its target gets.
    pub delivery: Delivery,
}

/// Bytes of a delivery beside its sender and its text.
const DELIVERY_BYTES: usize = 64;
/// Most bytes of commands that arrive at a robot in a tick: the news must fit into a message with everything else.
const MAX_DELIVERED_BYTES: usize = 512 * 1024;

/// A pair of robots, in the direction of the message.
type Pair = (RobotName, RobotName);

/// What the network does at the beginning of a tick.
#[derive(Debug, Default)]
pub struct Decision {
    /// Commands that arrive now, by target, each list ordered by sender and number; one that arrives twice is there twice.
    pub delivered: BTreeMap<RobotName, Vec<Arrival>>,
    /// Whom each robot cannot ask during this tick, in the order of names.
    pub unreachable: BTreeMap<RobotName, Vec<RobotName>>,
    /// All that was decided, in a fixed order.
    pub events: Vec<Event>,
}

/// The network: what is sent in a tick arrives at the next, unless the scenario says otherwise.
#[derive(Debug, Clone)]
pub struct Medium {
    seed: u64,
    tick_s: f64,
    network: Network,
    roster: Vec<RobotName>,
    /// Sent in the tick before, with nothing decided yet.
    sent: Vec<Underway>,
    /// On their way, with the number of copies that arrive.
    arrivals: BTreeMap<Tick, Vec<(Underway, usize)>>,
    /// Links with bursts that are bad now, and their chance.
    bad: BTreeMap<(Kind, Pair), Weather>,
    /// What is cut now.
    cut: BTreeMap<Pair, Scope>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Commands,
    Queries,
}

/// The state of a link with bursts.
#[derive(Debug, Clone)]
struct Weather {
    is_bad: bool,
    chance: Stream,
}

/// What of a link is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Scope {
    commands: bool,
    queries: bool,
}

impl Medium {
    /// The network of a run with this seed, between these robots.
    #[must_use]
    pub fn new(seed: u64, tick_s: f64, network: Network, roster: Vec<RobotName>) -> Self {
        let (bad, cut) = (BTreeMap::new(), BTreeMap::new());
        Self {
            seed,
            tick_s,
            network,
            roster,
            sent: Vec::new(),
            arrivals: BTreeMap::new(),
            bad,
            cut,
        }
    }

    /// Takes over a command that was sent in the tick that has just ended.
    pub fn accept(&mut self, command: Underway) {
        self.sent.push(command);
    }

    /// What happens at the beginning of `tick`.
    pub fn decide(&mut self, tick: Tick) -> Decision {
        let mut decision = Decision::default();
        self.cut_and_heal(tick, &mut decision.events);
        self.change_weather();
        for command in std::mem::take(&mut self.sent) {
            self.dispatch(tick, command, &mut decision.events);
        }
        self.deliver(tick, &mut decision);
        self.judge_queries(tick, &mut decision);
        decision
    }

    /// Partitions begin and end.
    fn cut_and_heal(&mut self, tick: Tick, events: &mut Vec<Event>) {
        if self.network.partitions.is_empty() {
            return;
        }

        let mut now: BTreeMap<Pair, Scope> = BTreeMap::new();
        for partition in self
            .network
            .partitions
            .iter()
            .filter(|partition| partition.lasts_at(tick))
        {
            for pair in pairs(&self.roster).filter(|(from, to)| partition.separates(from, to)) {
                let scope = now.entry(pair).or_default();
                scope.commands |= partition.commands;
                scope.queries |= partition.queries;
            }
        }

        let before = std::mem::replace(&mut self.cut, now);
        let concerned: BTreeSet<&Pair> = before.keys().chain(self.cut.keys()).collect();
        for pair in concerned {
            let scope = |of: &BTreeMap<Pair, Scope>| of.get(pair).copied().unwrap_or_default();
            let (was, is) = (scope(&before), scope(&self.cut));
            if was != is {
                let (from, to) = pair.clone();
                let Scope { commands, queries } = is;
                events.push(if is == Scope::default() {
                    Event::LinkHealed { from, to }
                } else {
                    Event::LinkCut {
                        from,
                        to,
                        commands,
                        queries,
                    }
                });
            }
        }
    }

    /// Links with bursts turn bad and good; each draws once a tick, from a stream of its own.
    fn change_weather(&mut self) {
        if !self.network.has_bursts() {
            return;
        }

        for pair in pairs(&self.roster) {
            for (kind, channel) in [
                (Kind::Commands, self.network.commands(&pair.0, &pair.1)),
                (Kind::Queries, self.network.queries(&pair.0, &pair.1)),
            ] {
                let Some(Burst { enter, leave, .. }) = channel.burst else {
                    continue;
                };
                let (from, to) = &pair;
                let kind_name = if kind == Kind::Commands {
                    "commands"
                } else {
                    "queries"
                };
                let weather = self
                    .bad
                    .entry((kind, pair.clone()))
                    .or_insert_with(|| Weather {
                        is_bad: false,
                        chance: stream(self.seed, &format!("medium/burst/{kind_name}/{from}/{to}")),
                    });
                let changes =
                    unit(&mut weather.chance) < if weather.is_bad { leave } else { enter };
                weather.is_bad ^= changes;
            }
        }
    }

    /// Decides what becomes of a command, once and for all but for a cut while it is on its way.
    fn dispatch(&mut self, tick: Tick, command: Underway, events: &mut Vec<Event>) {
        let to = command.to.clone();
        let from = command.from.clone();
        let seq = command.seq;

        if !self.roster.contains(&to) {
            events.push(Event::CommandDropped {
                from,
                to,
                seq,
                because: Cause::Unknown,
            });
            return;
        }

        // A person at the console is not on the robots' network.
        if from.is_operator() {
            self.arrivals.entry(tick).or_default().push((command, 1));
            return;
        }

        let channel = self.network.commands(&from, &to);
        let mut chance = stream(self.seed, &format!("medium/{}/{from}/{to}/{seq}", tick - 1));

        // Always three draws in one order, so that each decision is the same whatever else the scenario says.
        let [loss, duplication, delay] = std::array::from_fn(|_| unit(&mut chance));
        let pair = (from.clone(), to.clone());
        if let Some(because) = self.loses(Kind::Commands, &channel, &pair, loss) {
            events.push(Event::CommandDropped {
                from,
                to,
                seq,
                because,
            });
            return;
        }

        let late = channel
            .delay_s
            .map_or(0, |delay_s| ticks(delay_s.quantile(delay), self.tick_s));
        if late > 0 {
            events.push(Event::CommandDelayed {
                from: from.clone(),
                to: to.clone(),
                seq,
                until: tick + late,
            });
        }

        let copies = if duplication < channel.duplication {
            2
        } else {
            1
        };

        if copies > 1 {
            events.push(Event::CommandDuplicated { from, to, seq });
        }

        self.arrivals
            .entry(tick + late)
            .or_default()
            .push((command, copies));
    }

    /// Why a message is lost, if it is; `drawn` is its chance.
    fn loses(&self, kind: Kind, channel: &Channel, pair: &Pair, drawn: f64) -> Option<Cause> {
        let cut = self.cut.get(pair).copied().unwrap_or_default();
        let is_cut = if kind == Kind::Commands {
            cut.commands
        } else {
            cut.queries
        };

        let is_bad = self
            .bad
            .get(&(kind, pair.clone()))
            .is_some_and(|weather| weather.is_bad);
        let bad = channel.burst.filter(|_| is_bad);
        match bad {
            _ if is_cut => Some(Cause::Partition),
            _ if drawn < channel.loss => Some(Cause::Loss),
            Some(burst) if drawn < burst.loss => Some(Cause::Burst),
            _ => None,
        }
    }

    fn deliver(&mut self, tick: Tick, decision: &mut Decision) {
        let mut arrivals = self.arrivals.remove(&tick).unwrap_or_default();
        arrivals.sort_by(|(one, _), (other, _)| {
            (&one.to, &one.from, one.seq).cmp(&(&other.to, &other.from, other.seq))
        });

        let mut bytes: BTreeMap<RobotName, usize> = BTreeMap::new();
        for (command, copies) in arrivals {
            let encoded_bytes = command.encoded_bytes();
            let Underway {
                to,
                from,
                seq,
                text,
            } = command;
            // A cable that is cut loses what is in it, too.
            let scope = self.cut.get(&(from.clone(), to.clone()));
            if scope.is_some_and(|scope| scope.commands) {
                decision.events.push(Event::CommandDropped {
                    from,
                    to,
                    seq,
                    because: Cause::Partition,
                });
                continue;
            }

            for _ in 0..copies {
                let used = bytes.entry(to.clone()).or_default();
                if *used + encoded_bytes > MAX_DELIVERED_BYTES {
                    decision.events.push(Event::CommandDropped {
                        from: from.clone(),
                        to: to.clone(),
                        seq,
                        because: Cause::Overflow,
                    });
                    continue;
                }
                *used += encoded_bytes;
                let delivery = Delivery {
                    from: from.clone(),
                    performative: text.performative,
                    command: text.command.clone(),
                };
                decision
                    .delivered
                    .entry(to.clone())
                    .or_default()
                    .push(Arrival { seq, delivery });
            }
        }
    }

    /// One verdict for each asker, target and tick. A query and its answer need both directions.
    fn judge_queries(&self, tick: Tick, decision: &mut Decision) {
        let is_perfect = self.cut.is_empty() && !self.network.touches_queries();
        if is_perfect {
            return;
        }

        for (asker, target) in pairs(&self.roster) {
            let back_is_cut = self
                .cut
                .get(&(target.clone(), asker.clone()))
                .is_some_and(|scope| scope.queries);
            let channel = self.network.queries(&asker, &target);
            let drawn = unit(&mut stream(
                self.seed,
                &format!("medium/query/{tick}/{asker}/{target}"),
            ));
            let pair = (asker.clone(), target.clone());
            let lost = self.loses(Kind::Queries, &channel, &pair, drawn);
            if lost.is_none() && !back_is_cut {
                continue;
            }
            // A partition says once that it begins; chance must be told every time.
            if let Some(because @ (Cause::Loss | Cause::Burst)) = lost.filter(|_| !back_is_cut) {
                let (from, to) = (asker.clone(), target.clone());
                decision.events.push(Event::QueryLost { from, to, because });
            }
            decision.unreachable.entry(asker).or_default().push(target);
        }
    }

    /// Pairs of robots between which something is cut now.
    #[must_use]
    pub fn cuts(&self) -> Vec<Cut> {
        let cut = |((from, to), scope): (&Pair, &Scope)| Cut {
            from: from.clone(),
            to: to.clone(),
            commands: scope.commands,
            queries: scope.queries,
        };
        self.cut.iter().map(cut).collect()
    }
}

/// All ordered pairs of different robots.
fn pairs(roster: &[RobotName]) -> impl Iterator<Item = Pair> {
    let with = |from: &RobotName| {
        let from = from.clone();
        roster
            .iter()
            .filter(move |to| **to != from)
            .cloned()
            .collect::<Vec<_>>()
    };

    roster
        .iter()
        .flat_map(move |from| with(from).into_iter().map(|to| (from.clone(), to)))
}
