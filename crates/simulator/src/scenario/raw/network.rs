//! `[network]` as it is written.

use std::collections::BTreeMap;

use config::units::Time;
use config::{FileError, Source};
use protocol::RobotName;
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::Triangular;

use super::super::checked::RobotSpec;
use super::super::network::{Burst, Channel, LinkRule, Network, Partition, ticks};
use super::range::Range;

/// Longest time for which a command can be held back: whoever sends it must be able to repeat it until then.
const MAX_DELAY_TICKS: u64 = 1000;
/// Most links and partitions.
const MAX_ENTRIES: usize = 10_000;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NetworkTable {
    commands: Option<Spanned<ChannelTable>>,
    queries: Option<Spanned<ChannelTable>>,
    #[serde(default, rename = "link", skip_serializing_if = "Vec::is_empty")]
    links: Vec<Spanned<LinkTable>>,
    #[serde(default, rename = "partition", skip_serializing_if = "Vec::is_empty")]
    partitions: Vec<Spanned<PartitionTable>>,
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
    from: Time,
    until: Option<Time>,
    one_way: Option<bool>,
    cuts: Option<Vec<Cuts>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
enum Cuts {
    Commands,
    Queries,
}

/// Where a network is checked: the file, the roster, the length of a tick.
struct Checker<'a> {
    source: &'a Source,
    robots: &'a BTreeMap<RobotName, RobotSpec>,
    tick_s: f64,
}

/// The network, every link between two robots of the roster, every probability one.
pub(super) fn check(
    raw: Option<Spanned<NetworkTable>>,
    robots: &BTreeMap<RobotName, RobotSpec>,
    tick_s: f64,
    source: &Source,
) -> Result<Network, FileError> {
    let Some(raw) = raw else {
        return Ok(Network::default());
    };

    let (span, raw) = (raw.span(), raw.into_inner());
    if raw.links.len().max(raw.partitions.len()) > MAX_ENTRIES {
        return Err(FileError::at(
            source,
            Some(span),
            "more than 10000 links or partitions",
        ));
    }

    let checker = Checker {
        source,
        robots,
        tick_s,
    };
    let commands = checker.commands(raw.commands)?.unwrap_or_default();
    let queries = checker.queries(raw.queries)?.unwrap_or_default();
    let links = raw
        .links
        .into_iter()
        .map(|link| checker.link(link.into_inner()));
    let links = links.collect::<Result<_, _>>()?;
    let partitions = raw
        .partitions
        .into_iter()
        .map(|partition| checker.partition(partition));

    Ok(Network {
        commands,
        queries,
        links,
        partitions: partitions.collect::<Result<_, _>>()?,
    })
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
        let (commands, queries) = (self.commands(raw.commands)?, self.queries(raw.queries)?);
        Ok(LinkRule {
            from: self.known(raw.from)?,
            to: self.known(raw.to)?,
            commands,
            queries,
        })
    }

    fn commands(&self, raw: Option<Spanned<ChannelTable>>) -> Result<Option<Channel>, FileError> {
        raw.map(|raw| self.channel(raw.span(), raw.get_ref()))
            .transpose()
    }

    fn queries(&self, raw: Option<Spanned<ChannelTable>>) -> Result<Option<Channel>, FileError> {
        let Some(raw) = raw else { return Ok(None) };
        if raw.get_ref().delay.is_some() || raw.get_ref().duplication.is_some() {
            let reason = "queries are answered within their tick or not at all: only loss and bursts befall them";
            return Err(self.refuse(raw.span(), reason));
        }
        self.channel(raw.span(), raw.get_ref()).map(Some)
    }

    fn channel(
        &self,
        span: std::ops::Range<usize>,
        raw: &ChannelTable,
    ) -> Result<Channel, FileError> {
        let refuse = |reason: &str| self.refuse(span.clone(), reason);
        let probability =
            |what: &str, value: Option<f64>, default: f64| match value.unwrap_or(default) {
                value if (0.0..=1.0).contains(&value) => Ok(value),
                _ => Err(refuse(&format!("{what} is a probability, from 0 to 1"))),
            };
        let burst = |burst: &BurstTable| {
            Ok(Burst {
                enter: probability("burst.enter", Some(burst.enter), 0.0)?,
                leave: probability("burst.leave", Some(burst.leave), 0.0)?,
                loss: probability("burst.loss", burst.loss, 1.0)?,
            })
        };
        let delay = |delay: &Delay| {
            let Range { min, mode, max } = match delay {
                Delay::Constant(time) => Range {
                    min: *time,
                    mode: *time,
                    max: *time,
                },
                Delay::Triangular(range) => *range,
            };
            if ticks(max.0, self.tick_s) > MAX_DELAY_TICKS {
                return Err(refuse("a delay is at most 1000 ticks"));
            }
            Triangular::new(min.0, mode.0, max.0)
                .map_err(|error| refuse(&format!("delay: {error}")))
        };

        Ok(Channel {
            loss: probability("loss", raw.loss, 0.0)?,
            duplication: probability("duplication", raw.duplication, 0.0)?,
            delay_s: raw.delay.as_ref().map(delay).transpose()?,
            burst: raw.burst.as_ref().map(burst).transpose()?,
        })
    }

    fn partition(&self, raw: Spanned<PartitionTable>) -> Result<Partition, FileError> {
        let span = raw.span();
        let raw = raw.into_inner();
        let groups: Vec<Vec<RobotName>> = raw
            .groups
            .into_iter()
            .map(|group| group.into_iter().map(|name| self.known(name)).collect())
            .collect::<Result<_, _>>()?;
        let mut named: Vec<&RobotName> = groups.iter().flatten().collect();
        named.sort();

        if let Some(twice) = named.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(self.refuse(span, &format!("{} is in two groups", twice[0])));
        }

        if groups.iter().filter(|group| !group.is_empty()).count() < 2 {
            return Err(self.refuse(
                span,
                "a partition needs two groups, for example [[\"Butler\"], [\"Leguin\"]]",
            ));
        }

        let (from, until) = (
            self.tick(&span, raw.from)?,
            raw.until.map(|time| self.tick(&span, time)),
        );
        let until = until.transpose()?;
        if until.is_some_and(|until| until <= from) {
            return Err(self.refuse(span, "it ends before it begins: `until` comes after `from`"));
        }

        let cuts = raw
            .cuts
            .unwrap_or_else(|| vec![Cuts::Commands, Cuts::Queries]);
        if cuts.is_empty() {
            return Err(self.refuse(
                span,
                "it cuts nothing: name \"commands\", \"queries\" or both",
            ));
        }

        let is_cut = |what| cuts.contains(&what);
        let (commands, queries) = (is_cut(Cuts::Commands), is_cut(Cuts::Queries));

        Ok(Partition {
            groups,
            from,
            until,
            one_way: raw.one_way.unwrap_or(false),
            commands,
            queries,
        })
    }

    fn tick(&self, span: &std::ops::Range<usize>, time: Time) -> Result<u64, FileError> {
        if time.0 >= 0.0 && time.0.is_finite() {
            return Ok(ticks(time.0, self.tick_s));
        }
        Err(self.refuse(span.clone(), "a time is not before the beginning"))
    }
}

impl NetworkTable {
    /// The table of a network; a perfect one needs none.
    pub(super) fn of(network: &Network, tick_s: f64) -> Option<Spanned<Self>> {
        if *network == Network::default() {
            return None;
        }

        let spanned = |channel| Spanned::new(0..0, ChannelTable::from(channel));
        let link = |link: &LinkRule| LinkTable {
            from: Spanned::new(0..0, link.from.clone()),
            to: Spanned::new(0..0, link.to.clone()),
            commands: link.commands.map(spanned),
            queries: link.queries.map(spanned),
        };
        let time = |tick: u64| Time(tick as f64 * tick_s);
        let partition = |partition: &Partition| PartitionTable {
            groups: partition
                .groups
                .iter()
                .map(|group| {
                    group
                        .iter()
                        .map(|name| Spanned::new(0..0, name.clone()))
                        .collect()
                })
                .collect(),
            from: time(partition.from),
            until: partition.until.map(time),
            one_way: Some(partition.one_way),
            cuts: Some(
                [
                    (partition.commands, Cuts::Commands),
                    (partition.queries, Cuts::Queries),
                ]
                .into_iter()
                .filter_map(|(is_cut, what)| is_cut.then_some(what))
                .collect(),
            ),
        };
        let table = Self {
            commands: Some(spanned(network.commands)),
            queries: Some(spanned(network.queries)),
            links: network
                .links
                .iter()
                .map(|entry| Spanned::new(0..0, link(entry)))
                .collect(),
            partitions: network
                .partitions
                .iter()
                .map(|entry| Spanned::new(0..0, partition(entry)))
                .collect(),
        };

        Some(Spanned::new(0..0, table))
    }
}

impl From<Channel> for ChannelTable {
    fn from(channel: Channel) -> Self {
        let delay = |delay: Triangular| {
            Delay::Triangular(Range {
                min: Time(delay.min()),
                mode: Time(delay.mode()),
                max: Time(delay.max()),
            })
        };
        let said = |value: f64| (value > 0.0).then_some(value);

        Self {
            loss: said(channel.loss),
            duplication: said(channel.duplication),
            delay: channel.delay_s.map(delay),
            burst: channel.burst.map(|burst| BurstTable {
                enter: burst.enter,
                leave: burst.leave,
                loss: Some(burst.loss),
            }),
        }
    }
}
