//! The table `[network]` as written in the file.

use std::collections::{BTreeMap, BTreeSet};

use config::units::Time;
use config::{FileError, Source};
use protocol::RobotName;
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::Triangular;

use super::super::checked::RobotSpec;
use super::super::network::{
    Burst, Channel, Counted, LinkRule, NamedCommand, NamedFate, Network, Partition, ticks,
};
use super::numbers::Range;
use super::radio_table::RadioTable;
use super::times;
use super::times::Times;
use super::unplaced::unplaced;

/// Longest delay of a command, ticks.
const MAX_DELAY_TICKS: u64 = 1000;
/// Most links, partitions and commands of each fate.
const MAX_ENTRIES: usize = 10_000;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NetworkTable {
    commands: Option<Spanned<ChannelTable>>,
    queries: Option<Spanned<ChannelTable>>,
    radio: Option<Spanned<RadioTable>>,
    #[serde(default, rename = "link", skip_serializing_if = "Vec::is_empty")]
    links: Vec<Spanned<LinkTable>>,
    #[serde(default, rename = "partition", skip_serializing_if = "Vec::is_empty")]
    partitions: Vec<Spanned<PartitionTable>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lose: Vec<CommandTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    delay: Vec<DelayTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    duplicate: Vec<CommandTable>,
}

#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct ChannelTable {
    loss: Option<f64>,
    duplication: Option<f64>,
    delay: Option<Delay>,
    burst: Option<BurstTable>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(untagged, expecting = "a delay is a time, or { min, mode, max }")]
enum Delay {
    Constant(Time),
    Triangular(Range<Time>),
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct BurstTable {
    enter: f64,
    leave: f64,
    loss: Option<f64>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct LinkTable {
    from: Spanned<RobotName>,
    to: Spanned<RobotName>,
    commands: Option<Spanned<ChannelTable>>,
    queries: Option<Spanned<ChannelTable>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct PartitionTable {
    groups: Vec<Vec<Spanned<RobotName>>>,
    from: Spanned<Time>,
    until: Option<Spanned<Time>>,
    one_way: Option<bool>,
    cuts: Option<Vec<Cuts>>,
}

/// A command that is lost, or arrives twice.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct CommandTable {
    from: Spanned<RobotName>,
    to: Spanned<RobotName>,
    number: Spanned<u64>,
    text: Option<String>,
}

/// A command that is late.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct DelayTable {
    from: Spanned<RobotName>,
    to: Spanned<RobotName>,
    number: Spanned<u64>,
    text: Option<String>,
    by: Spanned<Time>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
enum Cuts {
    Commands,
    Queries,
}

/// What a network is checked against: the file, the roster, the length of a tick.
struct Checker<'a> {
    source: &'a Source,
    robots: &'a BTreeMap<RobotName, RobotSpec>,
    tick_s: f64,
}

/// Checks the network: all links are between robots of the roster, and all probabilities between 0 and 1.
pub(super) fn check(
    raw: Option<Spanned<NetworkTable>>,
    robots: &BTreeMap<RobotName, RobotSpec>,
    tick_s: f64,
    source: &Source,
) -> Result<Network, FileError> {
    let Some(raw) = raw else {
        return Ok(Network::default());
    };

    let span = Some(raw.span());
    let raw = raw.into_inner();
    let most = [
        raw.links.len(),
        raw.partitions.len(),
        raw.lose.len(),
        raw.delay.len(),
        raw.duplicate.len(),
    ];
    if most.into_iter().any(|entries| entries > MAX_ENTRIES) {
        let text = format!(
            "more than {MAX_ENTRIES} links, partitions, or commands that are lost, delayed or duplicated"
        );
        return Err(FileError::at(source, span, &text));
    }

    let checker = Checker {
        source,
        robots,
        tick_s,
    };
    let mut network = Network {
        commands: checker.commands(raw.commands)?.unwrap_or_default(),
        queries: checker.queries(raw.queries)?.unwrap_or_default(),
        radio: match raw.radio {
            Some(radio) => Some(radio.get_ref().check(radio.span(), source)?),
            None => None,
        },
        ..Network::default()
    };
    for link in raw.links {
        network.links.push(checker.link(link.into_inner())?);
    }
    for partition in raw.partitions {
        network.partitions.push(checker.partition(partition)?);
    }
    for lost in raw.lose {
        network.named.push(checker.named(lost, NamedFate::Lost)?);
    }
    for late in raw.delay {
        network.named.push(checker.late(late)?);
    }
    for doubled in raw.duplicate {
        network
            .named
            .push(checker.named(doubled, NamedFate::Doubled)?);
    }
    Ok(network)
}

impl Checker<'_> {
    fn refuse(&self, span: std::ops::Range<usize>, reason: &str) -> FileError {
        FileError::at(self.source, Some(span), reason)
    }

    fn known(&self, name: Spanned<RobotName>) -> Result<RobotName, FileError> {
        let span = name.span();
        let name = name.into_inner();
        if self.robots.contains_key(&name) {
            return Ok(name);
        }
        Err(self.refuse(span, &format!("no robot of this scenario is called {name}")))
    }

    fn link(&self, raw: LinkTable) -> Result<LinkRule, FileError> {
        Ok(LinkRule {
            commands: self.commands(raw.commands)?,
            queries: self.queries(raw.queries)?,
            from: self.known(raw.from)?,
            to: self.known(raw.to)?,
        })
    }

    fn named(&self, raw: CommandTable, fate: NamedFate) -> Result<NamedCommand, FileError> {
        let number = *raw.number.get_ref();
        if number == 0 {
            let reason = "commands are counted from 1";
            return Err(self.refuse(raw.number.span(), reason));
        }

        Ok(NamedCommand {
            counted: Counted {
                from: self.known(raw.from)?,
                to: self.known(raw.to)?,
                text: raw.text,
            },
            number,
            fate,
        })
    }

    fn late(&self, raw: DelayTable) -> Result<NamedCommand, FileError> {
        let Time(by_s) = *raw.by.get_ref();
        let by = ticks(by_s, self.tick_s);
        if by_s.is_nan() || !(1..=MAX_DELAY_TICKS).contains(&by) {
            let most_s = MAX_DELAY_TICKS as f64 * self.tick_s;
            let reason = format!(
                "a command is delayed by 1 to {MAX_DELAY_TICKS} ticks: {} s to {most_s} s",
                self.tick_s
            );
            return Err(self.refuse(raw.by.span(), &reason));
        }

        let command = CommandTable {
            from: raw.from,
            to: raw.to,
            number: raw.number,
            text: raw.text,
        };
        self.named(command, NamedFate::Late(by))
    }

    fn commands(&self, raw: Option<Spanned<ChannelTable>>) -> Result<Option<Channel>, FileError> {
        raw.map(|raw| self.channel(raw.span(), raw.get_ref()))
            .transpose()
    }

    fn queries(&self, raw: Option<Spanned<ChannelTable>>) -> Result<Option<Channel>, FileError> {
        let Some(raw) = raw else { return Ok(None) };
        if raw.get_ref().delay.is_some() || raw.get_ref().duplication.is_some() {
            let reason = "queries are answered within their tick or not at all: they have only loss and bursts";
            return Err(self.refuse(raw.span(), reason));
        }
        self.channel(raw.span(), raw.get_ref()).map(Some)
    }

    fn channel(
        &self,
        span: std::ops::Range<usize>,
        raw: &ChannelTable,
    ) -> Result<Channel, FileError> {
        self.try_channel(raw)
            .map_err(|reason| self.refuse(span, &reason))
    }

    fn try_channel(&self, raw: &ChannelTable) -> Result<Channel, String> {
        Ok(Channel {
            loss: probability("loss", raw.loss.unwrap_or(0.0))?,
            duplication: probability("duplication", raw.duplication.unwrap_or(0.0))?,
            delay_s: raw.delay.as_ref().map(|raw| self.delay(raw)).transpose()?,
            burst: raw.burst.as_ref().map(burst).transpose()?,
        })
    }

    fn delay(&self, raw: &Delay) -> Result<Triangular, String> {
        let Range { min, mode, max } = match raw {
            Delay::Constant(time) => Range {
                min: *time,
                mode: *time,
                max: *time,
            },
            Delay::Triangular(range) => *range,
        };

        if ticks(max.0, self.tick_s) > MAX_DELAY_TICKS {
            return Err(format!("a delay is at most {MAX_DELAY_TICKS} ticks"));
        }
        Triangular::new(min.0, mode.0, max.0).map_err(|error| format!("delay: {error}"))
    }

    fn partition(&self, raw: Spanned<PartitionTable>) -> Result<Partition, FileError> {
        let span = raw.span();
        let raw = raw.into_inner();
        let groups = self.groups(&span, raw.groups)?;

        let from = self.tick(&raw.from)?;
        let until = raw.until.as_ref().map(|time| self.tick(time)).transpose()?;
        if let Some(until_time) = &raw.until
            && until.is_some_and(|until| until <= from)
        {
            let (begin, end) = (*raw.from.get_ref(), *until_time.get_ref());
            let reason = times::no_tick_between("from", begin, end, self.tick_s);
            return Err(self.refuse(until_time.span(), &reason));
        }

        let cuts = raw
            .cuts
            .unwrap_or_else(|| vec![Cuts::Commands, Cuts::Queries]);
        if cuts.is_empty() {
            let reason = "it cuts nothing: name \"commands\", \"queries\" or both";
            return Err(self.refuse(span, reason));
        }

        Ok(Partition {
            groups,
            from,
            until,
            one_way: raw.one_way.unwrap_or(false),
            commands: cuts.contains(&Cuts::Commands),
            queries: cuts.contains(&Cuts::Queries),
        })
    }

    /// Checks that there are at least two groups, and that no robot is in two of them.
    fn groups(
        &self,
        span: &std::ops::Range<usize>,
        raw: Vec<Vec<Spanned<RobotName>>>,
    ) -> Result<Vec<Vec<RobotName>>, FileError> {
        let mut groups = Vec::new();
        let mut named = BTreeSet::new();
        for raw_group in raw {
            let mut group = Vec::new();
            for name in raw_group {
                let name = self.known(name)?;
                if !named.insert(name.clone()) {
                    return Err(self.refuse(span.clone(), &format!("{name} is in two groups")));
                }
                group.push(name);
            }
            groups.push(group);
        }

        if groups.iter().filter(|group| !group.is_empty()).count() < 2 {
            let reason = "a partition needs two groups, for example [[\"Butler\"], [\"Leguin\"]]";
            return Err(self.refuse(span.clone(), reason));
        }
        Ok(groups)
    }

    fn tick(&self, time: &Spanned<Time>) -> Result<u64, FileError> {
        let Time(time_s) = *time.get_ref();
        if time_s >= 0.0 && time_s.is_finite() {
            return Ok(ticks(time_s, self.tick_s));
        }
        Err(self.refuse(time.span(), "a time is not before the beginning"))
    }
}

impl NetworkTable {
    /// Remarks about its radio, and about the times of its partitions.
    pub(super) fn remark(&self, times: &mut Times<'_>) {
        if let Some(radio) = &self.radio {
            let remark = radio.get_ref().remark(times.source);
            times.remarks.extend(remark);
        }
        for partition in &self.partitions {
            let partition = partition.get_ref();
            times.begins("partition", &partition.from);
            if let Some(until) = &partition.until {
                times.on_tick(until);
            }
        }
    }

    /// The table of a network; a perfect one needs none.
    pub(super) fn of(network: &Network, tick_s: f64) -> Option<Spanned<Self>> {
        if *network == Network::default() {
            return None;
        }

        let mut lose = Vec::new();
        let mut delay = Vec::new();
        let mut duplicate = Vec::new();
        for named in &network.named {
            match named.fate {
                NamedFate::Lost => lose.push(named.into()),
                NamedFate::Late(by) => delay.push(DelayTable::of(named, by, tick_s)),
                NamedFate::Doubled => duplicate.push(named.into()),
            }
        }

        let links = network.links.iter().map(LinkTable::from);
        let partitions = network.partitions.iter();
        let partitions = partitions.map(|partition| PartitionTable::of(partition, tick_s));
        Some(unplaced(Self {
            commands: Some(unplaced(network.commands.into())),
            queries: Some(unplaced(network.queries.into())),
            radio: network.radio.as_ref().map(|radio| unplaced(radio.into())),
            links: links.map(unplaced).collect(),
            partitions: partitions.map(unplaced).collect(),
            lose,
            delay,
            duplicate,
        }))
    }
}

impl From<&LinkRule> for LinkTable {
    fn from(link: &LinkRule) -> Self {
        let channel = |channel: Channel| unplaced(channel.into());
        Self {
            from: unplaced(link.from.clone()),
            to: unplaced(link.to.clone()),
            commands: link.commands.map(channel),
            queries: link.queries.map(channel),
        }
    }
}

impl From<&NamedCommand> for CommandTable {
    fn from(named: &NamedCommand) -> Self {
        Self {
            from: unplaced(named.counted.from.clone()),
            to: unplaced(named.counted.to.clone()),
            number: unplaced(named.number),
            text: named.counted.text.clone(),
        }
    }
}

impl DelayTable {
    fn of(named: &NamedCommand, by: u64, tick_s: f64) -> Self {
        let CommandTable {
            from,
            to,
            number,
            text,
        } = named.into();
        Self {
            from,
            to,
            number,
            text,
            by: unplaced(Time(by as f64 * tick_s)),
        }
    }
}

impl PartitionTable {
    fn of(partition: &Partition, tick_s: f64) -> Self {
        let mut groups = Vec::new();
        for group in &partition.groups {
            groups.push(group.iter().cloned().map(unplaced).collect());
        }

        let mut cuts = Vec::new();
        if partition.commands {
            cuts.push(Cuts::Commands);
        }
        if partition.queries {
            cuts.push(Cuts::Queries);
        }

        let time = |tick: u64| unplaced(Time(tick as f64 * tick_s));
        Self {
            groups,
            from: time(partition.from),
            until: partition.until.map(time),
            one_way: Some(partition.one_way),
            cuts: Some(cuts),
        }
    }
}

fn probability(what: &str, value: f64) -> Result<f64, String> {
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(format!("{what} is a probability, from 0 to 1"))
    }
}

fn burst(raw: &BurstTable) -> Result<Burst, String> {
    Ok(Burst {
        enter: probability("burst.enter", raw.enter)?,
        leave: probability("burst.leave", raw.leave)?,
        loss: probability("burst.loss", raw.loss.unwrap_or(1.0))?,
    })
}

impl From<Channel> for ChannelTable {
    fn from(channel: Channel) -> Self {
        let delay = channel.delay_s.map(|delay| Range {
            min: Time(delay.min()),
            mode: Time(delay.mode()),
            max: Time(delay.max()),
        });

        Self {
            loss: Some(channel.loss).filter(|loss| *loss > 0.0),
            duplication: Some(channel.duplication).filter(|duplication| *duplication > 0.0),
            delay: delay.map(Delay::Triangular),
            burst: channel.burst.map(|burst| BurstTable {
                enter: burst.enter,
                leave: burst.leave,
                loss: Some(burst.loss),
            }),
        }
    }
}
