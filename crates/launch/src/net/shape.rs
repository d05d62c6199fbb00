//! What a link does to what is sent over it.

use std::str::FromStr;
use std::time::Duration;

use config::units::Time;
use serde::Serialize;

/// Whether anything comes through.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Flow {
    /// Everything.
    #[default]
    Open,
    /// Nothing, and nobody is told: a cable that is pulled.
    Cut,
    /// Nothing, and both sides are told: a box in the middle that is restarted.
    Closed,
}

/// What a link does to what is sent over it; by default nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shape {
    /// Whether anything comes through.
    pub flow: Flow,
    /// Added to the way of every byte, in both directions.
    pub delay: Duration,
    /// At most this much more, drawn anew for every piece; nothing overtakes anything.
    pub jitter: Duration,
    /// Bits per second in each direction, if limited.
    pub bandwidth_bps: Option<u64>,
}

impl Shape {
    /// Both at the same time.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            flow: self.flow.max(other.flow),
            delay: self.delay + other.delay,
            jitter: self.jitter + other.jitter,
            bandwidth_bps: self
                .bandwidth_bps
                .into_iter()
                .chain(other.bandwidth_bps)
                .min(),
        }
    }

    /// Whether it is nothing but open or cut.
    pub(super) fn is_plain_cut(self) -> bool {
        self == Self {
            flow: self.flow,
            ..Self::default()
        } && self.flow != Flow::Closed
    }
}

impl std::fmt::Display for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut parts = Vec::new();
        match self.flow {
            Flow::Open => {}
            Flow::Cut => parts.push("cut".to_owned()),
            Flow::Closed => parts.push("closed".to_owned()),
        }

        if !self.delay.is_zero() {
            parts.push(format!("delay {:?}", self.delay));
        }

        if !self.jitter.is_zero() {
            parts.push(format!("jitter {:?}", self.jitter));
        }

        parts.extend(
            self.bandwidth_bps
                .map(|bps| format!("bandwidth {bps} bit/s")),
        );
        f.write_str(if parts.is_empty() { "whole" } else { "" })?;

        f.write_str(&parts.join(", "))
    }
}

impl Serialize for Shape {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A change that a person types.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// Whether anything comes through.
    Flow(Flow),
    /// How late everything is.
    Delay {
        /// Added to the way of every byte.
        delay: Duration,
        /// At most this much more.
        jitter: Duration,
    },
    /// Bits per second, if limited.
    Bandwidth(Option<u64>),
    /// Nothing changes.
    Status,
}

/// A line is not an order.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OrderError {
    /// No order begins like this.
    #[error("{0:?} is none of: {ORDERS}")]
    Unknown(String),
    /// A bandwidth is a whole number of bits per second.
    #[error("{0:?} is not a number of bits per second above zero")]
    Bandwidth(String),
    /// A time has a unit and is not below zero.
    #[error("{0}")]
    Time(String),
}

/// All that can be typed.
const ORDERS: &str = "cut, close, heal, delay TIME [JITTER], bandwidth BITS_PER_SECOND|off, status";

impl Order {
    /// The link with this change.
    #[must_use]
    pub fn apply(self, shape: Shape) -> Shape {
        match self {
            Self::Flow(flow) => Shape { flow, ..shape },
            Self::Delay { delay, jitter } => Shape {
                delay,
                jitter,
                ..shape
            },
            Self::Bandwidth(bandwidth_bps) => Shape {
                bandwidth_bps,
                ..shape
            },
            Self::Status => shape,
        }
    }
}

impl FromStr for Order {
    type Err = OrderError;

    fn from_str(line: &str) -> Result<Self, OrderError> {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["cut"] => Ok(Self::Flow(Flow::Cut)),
            ["close"] => Ok(Self::Flow(Flow::Closed)),
            ["heal"] => Ok(Self::Flow(Flow::Open)),
            ["delay", delay] => Ok(Self::Delay {
                delay: time(delay)?,
                jitter: Duration::ZERO,
            }),
            ["delay", delay, jitter] => Ok(Self::Delay {
                delay: time(delay)?,
                jitter: time(jitter)?,
            }),
            ["bandwidth", "off"] => Ok(Self::Bandwidth(None)),
            ["bandwidth", bps] => match bps.parse() {
                Ok(bps @ 1..) => Ok(Self::Bandwidth(Some(bps))),
                _ => Err(OrderError::Bandwidth((*bps).to_owned())),
            },
            ["status"] => Ok(Self::Status),
            _ => Err(OrderError::Unknown(line.to_owned())),
        }
    }
}

fn time(text: &str) -> Result<Duration, OrderError> {
    let time = text.parse().map_err(OrderError::Time)?;
    duration(time).map_err(OrderError::Time)
}

/// A time that is not below zero.
pub(super) fn duration(time: Time) -> Result<Duration, String> {
    Duration::try_from_secs_f64(time.0).map_err(|_| "a time here is zero or more".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn what_is_typed_changes_one_thing_and_leaves_the_others() {
        let mut shape = Shape::default();
        for (line, shown) in [
            ("delay 50ms 10ms", "delay 50ms, jitter 10ms"),
            ("cut", "cut, delay 50ms, jitter 10ms"),
            (
                "bandwidth 64000",
                "cut, delay 50ms, jitter 10ms, bandwidth 64000 bit/s",
            ),
            (
                "status",
                "cut, delay 50ms, jitter 10ms, bandwidth 64000 bit/s",
            ),
            ("heal", "delay 50ms, jitter 10ms, bandwidth 64000 bit/s"),
            ("bandwidth off", "delay 50ms, jitter 10ms"),
            ("delay 0s", "whole"),
            ("close", "closed"),
        ] {
            shape = line.parse::<Order>().unwrap().apply(shape);
            assert_eq!(shape.to_string(), shown, "after {line}");
        }

        for line in [
            "",
            "cut it",
            "delay",
            "delay -1s",
            "delay 5",
            "bandwidth 0",
            "bandwidth -1",
        ] {
            assert!(line.parse::<Order>().is_err(), "{line:?}");
        }
    }

    #[test]
    fn of_two_faults_at_once_both_are_felt() {
        let slow = Shape {
            delay: 50 * MS,
            bandwidth_bps: Some(1000),
            ..Shape::default()
        };
        let cut = Shape {
            flow: Flow::Cut,
            delay: MS,
            bandwidth_bps: Some(10),
            ..Shape::default()
        };
        let both = Shape {
            flow: Flow::Cut,
            delay: 51 * MS,
            bandwidth_bps: Some(10),
            ..Shape::default()
        };

        assert_eq!(slow.and(cut), both);
        assert_eq!(cut.and(slow), both);
        assert!(
            !both.is_plain_cut()
                && Shape {
                    flow: Flow::Cut,
                    ..Shape::default()
                }
                .is_plain_cut()
        );
    }
}
