//! The simulated network between robots: it decides which commands arrive and when, and which robots can query each other.
//!
//! Each decision draws from a stream named after it (seed, tick, sender, target, number), so no further robot and no message of
//! another one changes the fate of a message. The fading of radios is that of the tick and the two robots alone.

use std::collections::{BTreeMap, BTreeSet};
use std::iter::{repeat_with, zip};

use protocol::event::{Cause, Event};
use protocol::messages::{CommandText, Cut, Delivery, Payload, Point};
use protocol::random::{Stream, key, stream, unit};
use protocol::{RobotName, Seq, Tick};
use radio::{LinkGeometry, LossTerm, RadioModel, SendQueue, Transmitter};

use scenario::Network;
use scenario::network::{Burst, Channel, Counted, NamedFate, Radio, ticks};
use world::Crossed;

/// A command that a robot or the operator has sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentCommand {
    /// The target.
    pub to: RobotName,
    /// The sender.
    pub from: RobotName,
    /// Number among the sender's commands.
    pub seq: Seq,
    /// Performative, text and payload.
    pub text: CommandText,
}

impl SentCommand {
    /// The events `CommandSent` of commands that one sender has sent in a tick. A payload that several in a row have is in the first
    /// of their events.
    #[must_use]
    pub fn events(sent: &[Self]) -> Vec<Event> {
        let mut events = Vec::with_capacity(sent.len());
        let mut recorded: Option<(Seq, &Payload)> = None;

        for command in sent {
            let payload = command.text.payload.as_ref();
            let payload_of = recorded
                .filter(|(_, recorded)| Some(*recorded) == payload)
                .map(|(seq, _)| seq);
            if payload_of.is_none() {
                recorded = payload.map(|payload| (command.seq, payload));
            }

            events.push(Event::CommandSent {
                from: command.from.clone(),
                to: command.to.clone(),
                seq: command.seq,
                performative: command.text.performative,
                command: command.text.command.clone(),
                payload: payload.filter(|_| payload_of.is_none()).cloned(),
                payload_of,
            });
        }
        events
    }

    /// The event `CommandDropped`.
    fn dropped(&self, because: Cause) -> Event {
        Event::CommandDropped {
            from: self.from.clone(),
            to: self.to.clone(),
            seq: self.seq,
            because,
        }
    }

    fn arrival(&self) -> Arrival {
        Arrival {
            seq: self.seq,
            delivery: Delivery {
                from: self.from.clone(),
                performative: self.text.performative,
                command: self.text.command.clone(),
                payload: self.text.payload.clone(),
            },
        }
    }

    /// Size of what its radio sends beside the overhead, bytes: its text and its payload as JSON.
    fn content_bytes(&self) -> usize {
        let payload = self.text.payload.as_ref();
        self.text.command.len() + payload.map_or(0, |payload| payload.as_json().len())
    }

    /// Whether it is sent in the same transmission as the command before: a broadcast, whose targets are in the order of names.
    fn is_sent_with(&self, before: &Self) -> bool {
        self.from == before.from && self.to > before.to && self.text == before.text
    }

    /// Size of its delivery in the news of its target, bytes.
    fn encoded_bytes(&self) -> usize {
        let text_bytes = serde_json::to_string(&self.text.command).map_or(0, |json| json.len());
        let payload = self.text.payload.as_ref();
        let payload_bytes = payload.map_or(0, |payload| payload.as_json().len() + FIELD_BYTES);
        text_bytes + payload_bytes + self.from.as_str().len() + DELIVERY_BYTES
    }
}

/// A command that arrives at its target.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Arrival {
    /// Number among the sender's commands.
    pub seq: Seq,
    /// The entry in the news of the target.
    pub delivery: Delivery,
}

/// Size of a delivery without its sender and its text, bytes.
const DELIVERY_BYTES: usize = 64;
/// Size of the field of a payload without the payload.
const FIELD_BYTES: usize = ",\"payload\":".len();
/// Most bytes of commands that arrive at a robot in a tick, so that its news fit into a message.
const MAX_DELIVERED_BYTES: usize = 512 * 1024;

/// How much later than at the end of a tick a transmission may end to count as ended, ticks: its time is a sum of rounded numbers.
const TICK_TOLERANCE: f64 = 1e-9;

/// A pair of robots, in the direction of the message.
type Pair = (RobotName, RobotName);

/// The decisions of the network at the beginning of a tick.
#[derive(Debug, Default)]
pub struct NetworkDecisions {
    /// Commands that arrive in this tick, by target, ordered by sender and number. A duplicated command is in the list twice.
    pub delivered: BTreeMap<RobotName, Vec<Arrival>>,
    /// The robots that the radio of each reaches in this tick, in the order of names; `None` where distance does not matter.
    pub in_range: Option<BTreeMap<RobotName, Vec<RobotName>>>,
    /// Robots that each robot cannot query in this tick though its radio reaches them, in the order of names.
    pub unreachable: BTreeMap<RobotName, Vec<RobotName>>,
    /// All decisions in a fixed order.
    pub events: Vec<Event>,
}

/// What the network decides in the next tick whatever it draws: the counterfactual of one event.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ForcedVerdict {
    /// The sender, or the robot that queries.
    pub from: RobotName,
    /// The target.
    pub to: RobotName,
    /// What is forced.
    pub verdict: NetworkVerdict,
}

/// What the network decides about a message in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NetworkVerdict {
    /// The command with this number arrives in the tick, once.
    Arrives(Seq),
    /// The command with this number is lost, also if it has been under way.
    IsLost(Seq),
    /// The target can be queried.
    IsAnswered,
}

/// The network. Commands arrive in the tick after they were sent, unless the scenario delays or loses them.
#[derive(Debug, Clone)]
pub struct Medium {
    seed: u64,
    /// Seed of the streams of links with bursts, which last.
    burst_seed: u64,
    /// Seed of shadowing, which belongs to places: it stays when chance is drawn anew.
    shadowing_seed: u64,
    tick_s: f64,
    network: Network,
    roster: Vec<RobotName>,
    /// Commands of the last tick, on which nothing is decided yet.
    sent: Vec<SentCommand>,
    /// The queue of each sender's radio.
    queues: BTreeMap<RobotName, SendQueue>,
    /// Commands that wait in these queues, with what the scenario says of each, by the tick in which they are transmitted.
    waiting: BTreeMap<Tick, Vec<(SentCommand, NamedFates)>>,
    /// Commands under way with their numbers of copies, by tick of arrival.
    arrivals: BTreeMap<Tick, Vec<(SentCommand, usize)>>,
    /// States of the links with bursts.
    bursts: BTreeMap<(MessageKind, Pair), BurstState>,
    /// Links that are cut now.
    cut: BTreeMap<Pair, Scope>,
    /// Number of commands sent so far on each link, and of those with texts that the scenario names.
    counts: BTreeMap<Counted, u64>,
    /// What is decided in the next tick whatever is drawn.
    forced: Vec<ForcedVerdict>,
    /// How many commands between two robots have been judged in the tick, where there is a radio.
    judged: BTreeMap<Pair, u64>,
}

/// Where messages pass in a tick.
struct RadioScene<'a> {
    /// Where the robots of the roster stand; empty if that does not matter.
    places: Vec<Point>,
    /// What is between two of them, by their numbers.
    crossed: &'a dyn Fn(usize, usize) -> Crossed,
}

/// What the queue of a radio makes of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Transmission {
    /// Its last bit is sent before this tick begins.
    Before(Tick),
    /// It has no room.
    NoRoom,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum MessageKind {
    Commands,
    Queries,
}

impl MessageKind {
    const ALL: [Self; 2] = [Self::Commands, Self::Queries];

    /// Name in the names of streams.
    fn name(self) -> &'static str {
        match self {
            Self::Commands => "commands",
            Self::Queries => "queries",
        }
    }
}

/// The state of a link with bursts.
#[derive(Debug, Clone)]
struct BurstState {
    is_bad: bool,
    chance: Stream,
}

/// The kinds of messages that a cut affects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Scope {
    commands: bool,
    queries: bool,
}

impl Scope {
    fn contains(self, kind: MessageKind) -> bool {
        match kind {
            MessageKind::Commands => self.commands,
            MessageKind::Queries => self.queries,
        }
    }
}

impl Medium {
    /// The network of a run with this seed, between these robots, which are in the order of their names.
    #[must_use]
    pub fn new(seed: u64, tick_s: f64, network: Network, roster: Vec<RobotName>) -> Self {
        let mut medium = Self {
            seed,
            burst_seed: seed,
            shadowing_seed: seed,
            tick_s,
            network: Network::default(),
            roster,
            sent: Vec::new(),
            queues: BTreeMap::new(),
            waiting: BTreeMap::new(),
            arrivals: BTreeMap::new(),
            bursts: BTreeMap::new(),
            cut: BTreeMap::new(),
            counts: BTreeMap::new(),
            forced: Vec::new(),
            judged: BTreeMap::new(),
        };

        medium.count_for(&network);
        medium.network = network;
        medium
    }

    /// Counts from now on the commands with texts that a network names; those on a link are counted anyway. A network that takes
    /// effect in the middle of a run is given at the beginning, because it names commands by their number in the run.
    pub fn count_for(&mut self, network: &Network) {
        for named in &network.named {
            if named.counted.text.is_some() {
                self.counts.entry(named.counted.clone()).or_default();
            }
        }
    }

    /// Whether all commands among which a network names single ones have been counted from the beginning.
    #[must_use]
    pub fn has_counted_for(&self, network: &Network) -> bool {
        let mut counted = network.named.iter().map(|named| &named.counted);
        counted.all(|counted| counted.text.is_none() || self.counts.contains_key(counted))
    }

    /// Number of commands of a set on which has been decided.
    #[must_use]
    pub fn count(&self, counted: &Counted) -> u64 {
        self.counts.get(counted).copied().unwrap_or_default()
    }

    /// Replaces the rules of the network, from the next decision on. Commands under way stay under way.
    pub fn set_network(&mut self, network: Network) {
        self.network = network;
    }

    /// Draws from other streams from the next decision on: those of `seed`, and of `burst_seed` whether a link is in a burst. Links
    /// stay as they are.
    pub fn reseed(&mut self, [seed, burst_seed]: [u64; 2]) {
        self.seed = seed;
        self.burst_seed = burst_seed;
        for ((kind, pair), state) in &mut self.bursts {
            state.chance = BurstState::chance(burst_seed, *kind, pair);
        }
    }

    /// Has something decided in the next tick, whatever is drawn. All is drawn as without it.
    pub fn force(&mut self, verdict: ForcedVerdict) {
        self.forced.push(verdict);
    }

    /// Accepts a command that was sent in the last tick.
    pub fn accept(&mut self, command: SentCommand) {
        self.sent.push(command);
    }

    /// The decisions at the beginning of `tick`, in which the robots of the roster stand at these places and nothing is between them.
    pub fn decide(&mut self, tick: Tick, places: Vec<Point>) -> NetworkDecisions {
        self.decide_among(tick, places, &|_, _| Crossed::default())
    }

    /// The decisions at the beginning of `tick`, in which the robots of the roster stand at these places. `crossed` is what is
    /// between two robots, by their numbers in the roster.
    pub fn decide_among(
        &mut self,
        tick: Tick,
        places: Vec<Point>,
        crossed: &dyn Fn(usize, usize) -> Crossed,
    ) -> NetworkDecisions {
        let around = RadioScene { places, crossed };
        let mut decision = NetworkDecisions::default();
        // Cuts come first, so that a command which is sent or arrives in the tick in which a cut begins is lost. Bursts advance before
        // any command draws. What arrives in this tick includes what was decided in it.
        self.update_cuts(tick, &mut decision.events);
        self.advance_bursts();
        for (command, named) in self.waiting.remove(&tick).unwrap_or_default() {
            self.transmit(tick, command, named, &around, &mut decision.events);
        }
        let sent = std::mem::take(&mut self.sent);
        let transmissions = self.queue(tick, &sent);
        for (command, transmission) in zip(sent, transmissions) {
            self.dispatch(tick, command, transmission, &around, &mut decision.events);
        }
        self.deliver(tick, &mut decision);
        self.decide_queries(tick, &around, &mut decision);
        self.forced.clear();
        self.judged.clear();
        decision
    }

    /// Begins and ends partitions.
    fn update_cuts(&mut self, tick: Tick, events: &mut Vec<Event>) {
        // Links that are cut are compared with partitions that may have changed by hand, so that each change is one event.
        if self.network.partitions.is_empty() && self.cut.is_empty() {
            return;
        }

        let now = self.cuts_at(tick);
        let before = std::mem::replace(&mut self.cut, now);
        // In the order of names, so that the events are, too.
        let concerned: BTreeSet<&Pair> = before.keys().chain(self.cut.keys()).collect();
        for pair in concerned {
            let was = before.get(pair).copied().unwrap_or_default();
            let is = self.cut.get(pair).copied().unwrap_or_default();
            if was == is {
                continue;
            }

            let (from, to) = pair.clone();
            events.push(if is == Scope::default() {
                Event::LinkHealed { from, to }
            } else {
                Event::LinkCut {
                    from,
                    to,
                    commands: is.commands,
                    queries: is.queries,
                }
            });
        }
    }

    fn cuts_at(&self, tick: Tick) -> BTreeMap<Pair, Scope> {
        let mut cuts: BTreeMap<Pair, Scope> = BTreeMap::new();
        for partition in &self.network.partitions {
            if !partition.lasts_at(tick) {
                continue;
            }

            for (from, to) in pairs(&self.roster) {
                if partition.separates(&from, &to) {
                    let scope = cuts.entry((from, to)).or_default();
                    scope.commands |= partition.commands;
                    scope.queries |= partition.queries;
                }
            }
        }

        cuts
    }

    /// Begins and ends bursts. Each link draws once a tick from a stream of its own.
    fn advance_bursts(&mut self) {
        if !self.network.has_bursts() {
            return;
        }

        for pair in pairs(&self.roster) {
            for kind in MessageKind::ALL {
                let channel = self.channel(kind, &pair);
                let Some(Burst { enter, leave, .. }) = channel.burst else {
                    continue;
                };

                // A link that gets bursts in the middle of a run is good then, and draws from the beginning of its stream: the tick of
                // the change is in the record, so a run that is executed again does the same.
                let seed = self.burst_seed;
                let state = self
                    .bursts
                    .entry((kind, pair.clone()))
                    .or_insert_with(|| BurstState::good(seed, kind, &pair));
                let probability = if state.is_bad { leave } else { enter };
                state.is_bad ^= unit(&mut state.chance) < probability;
            }
        }
    }

    fn channel(&self, kind: MessageKind, (from, to): &Pair) -> Channel {
        match kind {
            MessageKind::Commands => self.network.commands(from, to),
            MessageKind::Queries => self.network.queries(from, to),
        }
    }

    /// Puts commands into the queues of their senders' radios. A broadcast is transmitted once.
    fn queue(&mut self, tick: Tick, sent: &[SentCommand]) -> Vec<Transmission> {
        let radio = self.network.radio.as_ref();
        let Some(transmitter) = radio.and_then(|radio| radio.transmitter) else {
            return vec![Transmission::Before(tick); sent.len()];
        };

        let mut transmissions: Vec<Transmission> = Vec::with_capacity(sent.len());
        for (index, command) in sent.iter().enumerate() {
            let before = index.checked_sub(1).map(|before| &sent[before]);
            let transmission = match (before, transmissions.last()) {
                (Some(before), Some(shared)) if command.is_sent_with(before) => *shared,
                _ => self.queue_one(tick, command, &transmitter),
            };
            transmissions.push(transmission);
        }
        transmissions
    }

    fn queue_one(&mut self, tick: Tick, command: &SentCommand, by: &Transmitter) -> Transmission {
        // Robots send at the end of a tick, so all of the next one is time to transmit before their commands arrive as usual.
        let now_s = tick.saturating_sub(1) as f64 * self.tick_s;
        let queue = self.queues.entry(command.from.clone()).or_default();
        let Some(sent_s) = queue.offer(now_s, command.content_bytes(), by) else {
            return Transmission::NoRoom;
        };
        let at = (sent_s / self.tick_s - TICK_TOLERANCE).ceil() as Tick;
        Transmission::Before(at.max(tick))
    }

    /// Decides what becomes of a command that was sent in the last tick.
    fn dispatch(
        &mut self,
        tick: Tick,
        command: SentCommand,
        transmission: Transmission,
        around: &RadioScene<'_>,
        events: &mut Vec<Event>,
    ) {
        if self.roster.binary_search(&command.to).is_err() {
            events.push(command.dropped(Cause::Unknown));
            return;
        }

        // The operator is not on the robots' network.
        if command.from.is_operator() {
            self.arrivals.entry(tick).or_default().push((command, 1));
            return;
        }

        let named = self.named_fates(&command);
        match transmission {
            Transmission::Before(until) if until <= tick => {
                self.transmit(tick, command, named, around, events);
            }
            // Whether it is forced or named, it has taken its time.
            _ if named.is_lost || self.forced_verdict(&command).is_some() => {
                self.transmit(tick, command, named, around, events);
            }
            Transmission::NoRoom => events.push(command.dropped(Cause::Queue)),
            Transmission::Before(until) => {
                events.push(Event::CommandDelayed {
                    from: command.from.clone(),
                    to: command.to.clone(),
                    seq: command.seq,
                    until,
                    because: Some(Cause::Queue),
                });
                self.waiting
                    .entry(until)
                    .or_default()
                    .push((command, named));
            }
        }
    }

    /// Decides the fate of a command that its sender has transmitted. Afterwards only a cut while it is under way can change it.
    fn transmit(
        &mut self,
        tick: Tick,
        command: SentCommand,
        named: NamedFates,
        around: &RadioScene<'_>,
        events: &mut Vec<Event>,
    ) {
        // First of all, so that the number does not depend on what becomes of the commands before it.
        let pair = (command.from.clone(), command.to.clone());
        let number = self.number_judged(&pair);
        let forced = self.forced_verdict(&command);
        // Where the fate is certain nothing is drawn. No other command notices: each has a stream of its own.
        let is_lost = named.is_lost && forced.is_none();
        if is_lost || forced == Some(NetworkVerdict::IsLost(command.seq)) {
            events.push(command.dropped(Cause::Scripted));
            return;
        }
        if forced.is_some() {
            self.arrivals.entry(tick).or_default().push((command, 1));
            return;
        }

        let to = command.to.clone();
        let from = command.from.clone();
        let seq = command.seq;
        let channel = self.network.commands(&from, &to);
        // A stream for this command alone: that another robot sends more, or less, changes nothing of its fate.
        let mut chance = stream(self.seed, &format!("medium/{}/{from}/{to}/{seq}", tick - 1));

        // Always in the same order, and the delay last, so that each decision is independent of the other settings.
        let [loss, duplication] = std::array::from_fn(|_| unit(&mut chance));
        let delay_s = match &channel.delay_s {
            Some(delay_s) => delay_s.sample(&mut chance),
            None => 0.0,
        };
        // A loss by rule comes first. The radio, which is asked for the others only, has a stream of its own, and its number is taken.
        let by_rule = self.loss(MessageKind::Commands, &channel, &pair, loss, around);
        let lost = by_rule.or_else(|| {
            let name = format!("radio/{}/{from}/{to}/{number}", tick - 1);
            self.radio_loss(&pair, &name, around)
        });
        if let Some(because) = lost {
            events.push(command.dropped(because));
            return;
        }

        let late = ticks(delay_s, self.tick_s) + named.late;
        let until = tick + late;
        if late > 0 {
            events.push(Event::CommandDelayed {
                from: from.clone(),
                to: to.clone(),
                seq,
                until,
                because: (named.late > 0).then_some(Cause::Scripted),
            });
        }

        let mut copies = 1;
        if duplication < channel.duplication || named.is_doubled {
            copies = 2;
            events.push(Event::CommandDuplicated {
                from,
                to,
                seq,
                because: named.is_doubled.then_some(Cause::Scripted),
            });
        }
        let arrivals = self.arrivals.entry(until).or_default();
        arrivals.push((command, copies));
    }

    /// The number of a command among those between the same robots that are judged in this tick, from 1: with it fading is drawn, so
    /// that no message to another robot or in another tick changes it.
    fn number_judged(&mut self, pair: &Pair) -> u64 {
        if self.network.radio.is_none() {
            return 0;
        }
        let judged = self.judged.entry(pair.clone()).or_default();
        *judged += 1;
        *judged
    }

    /// What is forced of a command.
    fn forced_verdict(&self, command: &SentCommand) -> Option<NetworkVerdict> {
        let mut forced = self.forced.iter();
        let own = forced.find(|forced| {
            let is_own = [
                NetworkVerdict::Arrives(command.seq),
                NetworkVerdict::IsLost(command.seq),
            ]
            .contains(&forced.verdict);
            is_own && forced.from == command.from && forced.to == command.to
        });
        own.map(|forced| forced.verdict)
    }

    /// Counts a command; returns what the scenario says of it by its number.
    fn named_fates(&mut self, command: &SentCommand) -> NamedFates {
        let on_the_link = Counted {
            from: command.from.clone(),
            to: command.to.clone(),
            text: None,
        };
        let with_its_text = Counted {
            text: Some(command.text.command.clone()),
            ..on_the_link.clone()
        };
        // All links are counted: a change may name a command by its number later. Of texts only those that are named.
        self.counts.entry(on_the_link.clone()).or_default();

        let mut fates = NamedFates::default();
        for counted in [on_the_link, with_its_text] {
            let Some(count) = self.counts.get_mut(&counted) else {
                continue;
            };
            *count += 1;
            for named in &self.network.named {
                if named.number == *count && named.counted == counted {
                    fates.add(named.fate);
                }
            }
        }
        fates
    }

    /// The cause for which a rule loses a message, if one does. `drawn` is its random number.
    fn loss(
        &self,
        kind: MessageKind,
        channel: &Channel,
        pair: &Pair,
        drawn: f64,
        around: &RadioScene<'_>,
    ) -> Option<Cause> {
        let cut = self.cut.get(pair).copied().unwrap_or_default();
        if cut.contains(kind) {
            return Some(Cause::Partition);
        }
        if self.is_out_of_range(pair, around) {
            return Some(Cause::OutOfRange);
        }
        if drawn < channel.loss {
            return Some(Cause::Loss);
        }

        let state = self.bursts.get(&(kind, pair.clone()))?;
        let burst = channel.burst.filter(|_| state.is_bad)?;
        (drawn < burst.loss).then_some(Cause::Burst)
    }

    /// Whether two robots of the roster are farther apart than their radios may reach.
    fn is_out_of_range(&self, pair: &Pair, around: &RadioScene<'_>) -> bool {
        let range_m = self.network.radio.as_ref().and_then(|radio| radio.range_m);
        let ends = self.ends(pair, around);
        match (range_m, ends) {
            (Some(range_m), Some([(_, from), (_, to)])) => from.distance_m(to) > range_m,
            _ => false,
        }
    }

    /// The numbers and the places of two robots in the order of their names, which is the same for both directions; `None` where
    /// places do not matter.
    fn ends(&self, (from, to): &Pair, around: &RadioScene<'_>) -> Option<[(usize, Point); 2]> {
        let end = |robot| {
            let index = self.roster.binary_search(robot).ok()?;
            Some((index, *around.places.get(index)?))
        };
        Some([end(from.min(to))?, end(from.max(to))?])
    }

    /// Why a message has too little power, if it has. Its fading is drawn from the stream with this name.
    fn radio_loss(&self, pair: &Pair, name: &str, around: &RadioScene<'_>) -> Option<Cause> {
        let model = self.network.radio.as_ref()?.model.as_ref()?;
        let [(first, one), (second, other)] = self.ends(pair, around)?;
        let distance_m = one.distance_m(other);
        // What is between the two is looked for only where it costs power.
        let crossed = if model.walls_db > 0.0 || model.bodies_db > 0.0 {
            (around.crossed)(first, second)
        } else {
            Crossed::default()
        };
        let geometry = LinkGeometry {
            distance_m,
            walls: crossed.walls,
            bodies: crossed.bodies,
        };

        let shadowing_db = self.shadowing_db(model, [(first, one), (second, other)]);
        let mut chance = stream(self.seed, name);
        let gain = model.fading.gain(distance_m, || unit(&mut chance));
        let reception = model.reception(geometry, shadowing_db, gain);
        reception.lost.map(cause)
    }

    /// The loss by shadowing between two robots, dB. A function of the seed, their names and their places.
    fn shadowing_db(
        &self,
        model: &RadioModel,
        [(first, one), (second, other)]: [(usize, Point); 2],
    ) -> f64 {
        let Some(shadowing) = model.shadowing else {
            return 0.0;
        };
        let (first, second) = (&self.roster[first], &self.roster[second]);
        let key = key(
            self.shadowing_seed,
            &format!("radio/shadowing/{first}/{second}"),
        );
        shadowing.loss_db(key, [[one.x, one.y], [other.x, other.y]])
    }

    fn deliver(&mut self, tick: Tick, decision: &mut NetworkDecisions) {
        let mut arrivals = self.arrivals.remove(&tick).unwrap_or_default();
        // Some were decided in earlier ticks: the order in which a target reads them must not show when.
        arrivals.sort_by(|(one, _), (other, _)| {
            (&one.to, &one.from, one.seq).cmp(&(&other.to, &other.from, other.seq))
        });

        let mut bytes: BTreeMap<RobotName, usize> = BTreeMap::new();
        for (command, copies) in arrivals {
            // A cut also loses the commands that are under way.
            let forced = self.forced_verdict(&command);
            if forced == Some(NetworkVerdict::IsLost(command.seq)) {
                decision.events.push(command.dropped(Cause::Scripted));
                continue;
            }
            let is_cut = self.is_cut(&command.from, &command.to, MessageKind::Commands);
            if is_cut && forced.is_none() {
                decision.events.push(command.dropped(Cause::Partition));
                continue;
            }

            let to = &command.to;
            let encoded_bytes = command.encoded_bytes();
            for _ in 0..copies {
                let used = bytes.entry(to.clone()).or_default();
                if *used + encoded_bytes > MAX_DELIVERED_BYTES {
                    // Only this one: a shorter command after it may still have room.
                    decision.events.push(command.dropped(Cause::Overflow));
                    continue;
                }

                *used += encoded_bytes;
                let arrivals = decision.delivered.entry(to.clone()).or_default();
                arrivals.push(command.arrival());
            }
        }
    }

    fn is_cut(&self, from: &RobotName, to: &RobotName, kind: MessageKind) -> bool {
        let scope = self.cut.get(&(from.clone(), to.clone()));
        scope.is_some_and(|scope| scope.contains(kind))
    }

    /// Decides once for each asker, target and tick whether queries are answered, for which both directions are needed.
    fn decide_queries(&self, tick: Tick, around: &RadioScene<'_>, decision: &mut NetworkDecisions) {
        decision.in_range = self.in_range(around);
        // Those that fading alone keeps from being asked in this tick.
        let mut faded = BTreeSet::new();
        if let Some(in_range) = &mut decision.in_range
            && self.has_radio_model()
        {
            faded = self.decide_receptions(tick, around, in_range);
        }
        let is_drawn = self.network.touches_queries();
        if self.cut.is_empty() && !is_drawn && faded.is_empty() {
            return;
        }

        let pairs = match &decision.in_range {
            Some(in_range) => pairs_of(in_range),
            None => pairs(&self.roster),
        };
        for (asker, target) in pairs {
            // Nothing is drawn in turn, so it does not matter for which pairs, and in which ticks, this is reached.
            let answer_is_cut = self.is_cut(&target, &asker, MessageKind::Queries);
            let drawn = if is_drawn {
                let name = format!("medium/query/{tick}/{asker}/{target}");
                unit(&mut stream(self.seed, &name))
            } else {
                1.0
            };
            let pair = (asker.clone(), target.clone());
            let channel = self.channel(MessageKind::Queries, &pair);
            let by_rule = self.loss(MessageKind::Queries, &channel, &pair, drawn, around);
            let lost = by_rule.or(faded.contains(&pair).then_some(Cause::Fading));
            let is_forced = self.forced.iter().any(|forced| {
                forced.verdict == NetworkVerdict::IsAnswered
                    && forced.from == asker
                    && forced.to == target
            });
            if is_forced || (lost.is_none() && !answer_is_cut) {
                continue;
            }

            // A partition has its own events: only random losses are recorded.
            if let Some(because @ (Cause::Loss | Cause::Burst | Cause::Fading)) = lost
                && !answer_is_cut
            {
                decision.events.push(Event::QueryLost {
                    from: asker.clone(),
                    to: target.clone(),
                    because,
                });
            }
            decision.unreachable.entry(asker).or_default().push(target);
        }
    }

    /// Whether messages need power.
    fn has_radio_model(&self) -> bool {
        let radio = self.network.radio.as_ref();
        radio.is_some_and(|radio| radio.model.is_some())
    }

    /// Leaves in the lists of each robot those whose answer it would receive in this tick, or fail to receive by fading alone: these
    /// are returned. The question and the answer have the same fading, because they follow each other at once.
    fn decide_receptions(
        &self,
        tick: Tick,
        around: &RadioScene<'_>,
        in_range: &mut BTreeMap<RobotName, Vec<RobotName>>,
    ) -> BTreeSet<Pair> {
        let mut faded = BTreeSet::new();
        for (asker, targets) in in_range {
            targets.retain(|target| {
                let pair = (asker.clone(), target.clone());
                let name = format!("radio/query/{tick}/{asker}/{target}");
                match self.radio_loss(&pair, &name, around) {
                    None => true,
                    Some(Cause::Fading) => faded.insert(pair),
                    Some(_) => false,
                }
            });
        }
        faded
    }

    /// The robots that the radio of each may reach: those within its range. Costs the pairs that are near in x, not all pairs.
    fn in_range(&self, around: &RadioScene<'_>) -> Option<BTreeMap<RobotName, Vec<RobotName>>> {
        let radio = self.network.radio.as_ref();
        let radio = radio.filter(|radio| radio.range_m.is_some() || radio.model.is_some())?;
        let Radio { range_m, .. } = radio;
        let range_m = range_m.unwrap_or(f64::INFINITY);
        let mut from_left: Vec<(&RobotName, Point)> =
            zip(&self.roster, around.places.iter().copied()).collect();
        from_left.sort_by(|(_, one), (_, other)| one.x.total_cmp(&other.x));

        let mut in_range: BTreeMap<RobotName, Vec<RobotName>> =
            zip(self.roster.iter().cloned(), repeat_with(Vec::new)).collect();
        for (index, (one, at)) in from_left.iter().enumerate() {
            let right = &from_left[index + 1..];
            let near = right
                .iter()
                .take_while(|(_, other)| other.x - at.x <= range_m);
            for (other, other_at) in near {
                if at.distance_m(*other_at) <= range_m {
                    for (from, to) in [(*one, *other), (*other, *one)] {
                        in_range.entry(from.clone()).or_default().push(to.clone());
                    }
                }
            }
        }

        in_range
            .values_mut()
            .for_each(|names| names.sort_unstable());
        Some(in_range)
    }

    /// Pairs of robots whose link is cut now.
    #[must_use]
    pub fn cuts(&self) -> Vec<Cut> {
        let mut cuts = Vec::new();
        for ((from, to), scope) in &self.cut {
            cuts.push(Cut {
                from: from.clone(),
                to: to.clone(),
                commands: scope.commands,
                queries: scope.queries,
            });
        }
        cuts
    }
}

/// The cause of a loss, as events name it.
fn cause(term: LossTerm) -> Cause {
    match term {
        LossTerm::Distance => Cause::Distance,
        LossTerm::Walls => Cause::Wall,
        LossTerm::Bodies => Cause::Body,
        LossTerm::Shadowing => Cause::Shadowing,
        LossTerm::Fading => Cause::Fading,
    }
}

/// What the scenario says of one command.
#[derive(Debug, Clone, Copy, Default)]
struct NamedFates {
    is_lost: bool,
    /// Ticks by which it is late; 0 if it is not.
    late: Tick,
    is_doubled: bool,
}

impl NamedFates {
    fn add(&mut self, fate: NamedFate) {
        match fate {
            NamedFate::Lost => self.is_lost = true,
            NamedFate::Late(ticks) => self.late = self.late.max(ticks),
            NamedFate::Doubled => self.is_doubled = true,
        }
    }
}

impl BurstState {
    /// A link that is good before its first tick.
    fn good(seed: u64, kind: MessageKind, pair: &Pair) -> Self {
        Self {
            is_bad: false,
            chance: Self::chance(seed, kind, pair),
        }
    }

    /// The stream of a link.
    fn chance(seed: u64, kind: MessageKind, (from, to): &Pair) -> Stream {
        let kind = kind.name();
        stream(seed, &format!("medium/burst/{kind}/{from}/{to}"))
    }
}

/// Each robot with each one that its radio reaches.
fn pairs_of(in_range: &BTreeMap<RobotName, Vec<RobotName>>) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (from, names) in in_range {
        pairs.extend(names.iter().map(|to| (from.clone(), to.clone())));
    }
    pairs
}

/// All ordered pairs of different robots.
fn pairs(roster: &[RobotName]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for from in roster {
        for to in roster {
            if from != to {
                pairs.push((from.clone(), to.clone()));
            }
        }
    }
    pairs
}
