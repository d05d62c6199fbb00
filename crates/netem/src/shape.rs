//! The shape of a link: flow, delay, jitter and bandwidth.

use std::str::FromStr;
use std::time::Duration;

use config::units::Time;
use serde::Serialize;

/// Whether bytes pass a link.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Flow {
    /// All bytes pass.
    #[default]
    Open,
    /// No bytes pass and connections stay open, like a pulled cable.
    Cut,
    /// Connections are closed and new ones refused, like a restarting middlebox.
    Closed,
}

/// The shape of a link; by default it is open and unlimited.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LinkShape {
    /// Whether bytes pass.
    pub flow: Flow,
    /// Delay of every byte in each direction.
    pub delay: Duration,
    /// Most additional delay, drawn for every piece. Pieces keep their order.
    pub jitter: Duration,
    /// Bits per second in each direction, if limited.
    pub bandwidth_bps: Option<u64>,
}

impl LinkShape {
    /// A link with this flow, without delay and limit.
    pub(super) fn of_flow(flow: Flow) -> Self {
        Self {
            flow,
            ..Self::default()
        }
    }

    /// The shape of a link with two faults at the same time.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        let bandwidths = self.bandwidth_bps.into_iter().chain(other.bandwidth_bps);
        Self {
            flow: self.flow.max(other.flow),
            delay: self.delay + other.delay,
            jitter: self.jitter + other.jitter,
            bandwidth_bps: bandwidths.min(),
        }
    }

    /// Whether it is open or cut, without delay and limit.
    pub(super) fn is_plain_cut(self) -> bool {
        self.flow != Flow::Closed && self == Self::of_flow(self.flow)
    }
}

impl std::fmt::Display for LinkShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if *self == Self::default() {
            return f.write_str("whole");
        }

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
        if let Some(bps) = self.bandwidth_bps {
            parts.push(format!("bandwidth {bps} bit/s"));
        }

        f.write_str(&parts.join(", "))
    }
}

impl Serialize for LinkShape {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A change of a link that a person types.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LinkOrder {
    /// Whether bytes pass.
    Flow(Flow),
    /// Delay and jitter.
    Delay {
        /// Delay of every byte.
        delay: Duration,
        /// Most additional delay.
        jitter: Duration,
    },
    /// Bits per second, if limited.
    Bandwidth(Option<u64>),
    /// No change; the shape is printed.
    Status,
}

/// A line is not an order.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OrderError {
    /// There is no such order.
    #[error("{0:?} is not one of: {ORDERS}")]
    Unknown(String),
    /// A bandwidth is a whole number of bits per second.
    #[error("{0:?} is not a number of bits per second above zero")]
    Bandwidth(String),
    /// A time has a unit and is not below zero.
    #[error("{0}")]
    Time(String),
}

/// The syntax of all orders.
const ORDERS: &str = "cut, close, heal, delay TIME [JITTER], bandwidth BITS_PER_SECOND|off, status";

impl LinkOrder {
    /// The shape with this change.
    #[must_use]
    pub fn apply(self, mut shape: LinkShape) -> LinkShape {
        match self {
            Self::Flow(flow) => shape.flow = flow,
            Self::Delay { delay, jitter } => {
                shape.delay = delay;
                shape.jitter = jitter;
            }
            Self::Bandwidth(bandwidth_bps) => shape.bandwidth_bps = bandwidth_bps,
            Self::Status => {}
        }
        shape
    }
}

impl FromStr for LinkOrder {
    type Err = OrderError;

    fn from_str(line: &str) -> Result<Self, OrderError> {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["cut"] => Ok(Self::Flow(Flow::Cut)),
            ["close"] => Ok(Self::Flow(Flow::Closed)),
            ["heal"] => Ok(Self::Flow(Flow::Open)),
            ["delay", delay] => Self::delay(delay, "0s"),
            ["delay", delay, jitter] => Self::delay(delay, jitter),
            ["bandwidth", "off"] => Ok(Self::Bandwidth(None)),
            ["bandwidth", bps] => Self::bandwidth(bps),
            ["status"] => Ok(Self::Status),
            _ => Err(OrderError::Unknown(line.to_owned())),
        }
    }
}

impl LinkOrder {
    fn delay(delay: &str, jitter: &str) -> Result<Self, OrderError> {
        Ok(Self::Delay {
            delay: time(delay)?,
            jitter: time(jitter)?,
        })
    }

    fn bandwidth(bps: &str) -> Result<Self, OrderError> {
        match bps.parse() {
            Ok(bps @ 1..) => Ok(Self::Bandwidth(Some(bps))),
            _ => Err(OrderError::Bandwidth(bps.to_owned())),
        }
    }
}

fn time(text: &str) -> Result<Duration, OrderError> {
    let time = text.parse().map_err(OrderError::Time)?;
    duration(time).map_err(OrderError::Time)
}

/// A time that is not negative.
pub(super) fn duration(time: Time) -> Result<Duration, String> {
    Duration::try_from_secs_f64(time.0).map_err(|_| "a time here is zero or more".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn an_order_changes_one_property_and_keeps_the_others() {
        let mut shape = LinkShape::default();
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
            shape = line.parse::<LinkOrder>().unwrap().apply(shape);
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
            assert!(line.parse::<LinkOrder>().is_err(), "{line:?}");
        }
    }

    #[test]
    fn two_faults_at_the_same_time_add_up() {
        let slow = LinkShape {
            delay: 50 * MS,
            bandwidth_bps: Some(1000),
            ..LinkShape::default()
        };
        let cut = LinkShape {
            flow: Flow::Cut,
            delay: MS,
            bandwidth_bps: Some(10),
            ..LinkShape::default()
        };
        let both = LinkShape {
            flow: Flow::Cut,
            delay: 51 * MS,
            bandwidth_bps: Some(10),
            ..LinkShape::default()
        };

        assert_eq!(slow.and(cut), both);
        assert_eq!(cut.and(slow), both);
        assert!(!both.is_plain_cut());
        assert!(LinkShape::of_flow(Flow::Cut).is_plain_cut());
    }
}
