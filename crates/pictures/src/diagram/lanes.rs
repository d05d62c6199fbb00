//! The vertical layout: a lane for each robot, and a thin one for the operator if it sends commands.

use std::collections::BTreeSet;
use std::ops::Range;

use protocol::RobotName;

use crate::labels::width_px;

/// Height of the process strip above the bands, pixels.
pub(crate) const STRIP_PX: f64 = 5.0;
/// Height of the band of emotions, pixels.
pub(crate) const EMOTION_PX: f64 = 17.0;
/// Height of the band of behaviors, pixels.
pub(crate) const BEHAVIOR_PX: f64 = 13.0;
/// Height of the operator's lane, pixels.
const OPERATOR_PX: f64 = 10.0;
/// Space above the first lane, pixels.
const TOP_PX: f64 = 46.0;
/// Space below the last lane, pixels.
const BOTTOM_PX: f64 = 26.0;
/// Space between two of a few lanes, pixels.
const GAP_PX: f64 = 84.0;
/// Space between two of many lanes, or between two that no message crosses, pixels.
const MIN_GAP_PX: f64 = 28.0;
/// All spaces between many lanes together, pixels.
const GAPS_PX: f64 = 800.0;
/// Font of the names, pixels.
const NAME_PX: f64 = 12.0;
/// Most width of the names, pixels.
const MAX_NAME_PX: f64 = 150.0;

/// A lane.
#[derive(Debug, Clone)]
pub(crate) struct Lane {
    pub(crate) name: RobotName,
    pub(crate) top: f64,
    pub(crate) bottom: f64,
}

impl Lane {
    pub(crate) fn middle(&self) -> f64 {
        (self.top + self.bottom) / 2.0
    }
}

/// The lanes, from top to bottom.
#[derive(Debug)]
pub(crate) struct Lanes {
    pub(crate) all: Vec<Lane>,
    /// Where the lanes begin, pixels from the left.
    pub(crate) left_px: f64,
    /// The lower end of the part of the picture that has lanes.
    pub(crate) bottom: f64,
}

impl Lanes {
    /// Lanes with these names. Between those of `links` there are lines, which need space.
    pub(crate) fn new(names: &[RobotName], links: &BTreeSet<(&RobotName, &RobotName)>) -> Self {
        let mut is_crossed = vec![false; names.len()];
        let index = |name: &RobotName| names.iter().position(|other| other == name);
        for (from, to) in links {
            if let (Some(from), Some(to)) = (index(from), index(to)) {
                is_crossed[from.min(to)..from.max(to)].fill(true);
            }
        }
        let gaps = is_crossed.iter().filter(|is_crossed| **is_crossed).count();
        let gap_px = (GAPS_PX / gaps.max(1) as f64).clamp(MIN_GAP_PX, GAP_PX);

        let mut all = Vec::new();
        let mut names_px: f64 = 46.0;
        let mut top = TOP_PX;
        for (name, is_crossed) in names.iter().zip(is_crossed) {
            let height = if name.is_operator() {
                OPERATOR_PX
            } else {
                STRIP_PX + EMOTION_PX + BEHAVIOR_PX
            };
            names_px = names_px.max(width_px(name.as_str(), NAME_PX));
            let bottom = top + height;
            all.push(Lane {
                name: name.clone(),
                top,
                bottom,
            });
            top = bottom + if is_crossed { gap_px } else { MIN_GAP_PX };
        }

        let last = all.last().map_or(TOP_PX, |lane| lane.bottom);
        Self {
            all,
            left_px: names_px.min(MAX_NAME_PX) + 26.0,
            bottom: last + BOTTOM_PX,
        }
    }

    /// The upper end of the part of the picture that has lanes.
    pub(crate) fn top(&self) -> f64 {
        TOP_PX - 4.0
    }

    pub(crate) fn index(&self, name: &RobotName) -> Option<usize> {
        self.all.iter().position(|lane| lane.name == *name)
    }

    pub(crate) fn lane(&self, name: &RobotName) -> Option<&Lane> {
        self.all.iter().find(|lane| lane.name == *name)
    }

    /// The lanes below which a line between two others crosses the space.
    pub(crate) fn between(&self, from: &RobotName, to: &RobotName) -> Option<Range<usize>> {
        let (from, to) = (self.index(from)?, self.index(to)?);
        Some(from.min(to)..from.max(to))
    }
}
