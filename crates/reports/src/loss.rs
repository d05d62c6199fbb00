//! Which share of the commands was lost, by the distance between sender and target.

use std::collections::BTreeMap;

use pictures::{
    Cell, Chart, ChartPanel, Figure, PlottedEstimate, Table, Trend, TrendLine, TrendPoint,
};
use protocol::event::Cause;
use protocol::messages::Point;
use protocol::{RobotName, Tick};
use recording::PlacedRobot;
use statistics::Estimate;
use timeline::CommandSpan;

/// Most commands whose distance is looked for.
const MAX_COMMANDS: usize = 500_000;
/// Most ranges of distance that are shown.
const RANGES: f64 = 14.0;

/// The commands of a run, and what the network made of them by distance.
#[derive(Debug, Default)]
pub(super) struct LossByDistance {
    /// What became of the commands of each tick: sender, target, whether the network lost it.
    fates: BTreeMap<Tick, Vec<(RobotName, RobotName, bool)>>,
    count: usize,
    /// Whether distance matters in the run: a radio lost a message.
    has_radio: bool,
    /// Commands and those of them that were lost, by whole meters of distance.
    by_meter: BTreeMap<u32, (u64, u64)>,
}

impl LossByDistance {
    /// Notes what became of the copies of a command.
    pub(super) fn add(&mut self, command: &CommandSpan) {
        for end in &command.ends {
            let is_of_radio = end.lost.is_some_and(is_of_radio);
            self.has_radio |= is_of_radio;
            // Other losses are not of the way from one place to another.
            if (end.lost.is_some() && !is_of_radio) || self.count == MAX_COMMANDS {
                continue;
            }

            self.count += 1;
            let fates = self.fates.entry(end.tick).or_default();
            fates.push((command.from.clone(), command.to.clone(), is_of_radio));
        }
    }

    /// Adds the distances of the commands of a tick.
    pub(super) fn measure(&mut self, tick: Tick, robots: &[PlacedRobot]) {
        let fates = self.fates.remove(&tick).unwrap_or_default();
        if !self.has_radio || fates.is_empty() {
            return;
        }
        let places: BTreeMap<&RobotName, Point> = robots
            .iter()
            .map(|robot| (&robot.name, robot.location))
            .collect();
        for (from, to, is_lost) in fates {
            // The operator has no place.
            let (Some(from), Some(to)) = (places.get(&from), places.get(&to)) else {
                continue;
            };
            let counts = self
                .by_meter
                .entry(from.distance_m(*to) as u32)
                .or_default();
            counts.0 += 1;
            counts.1 += u64::from(is_lost);
        }
    }

    /// The figure of these runs; `None` if no radio lost a message in them.
    pub(super) fn figure<'a>(runs: impl Iterator<Item = &'a Self>) -> Option<Figure> {
        let mut by_meter: BTreeMap<u32, (u64, u64)> = BTreeMap::new();
        for (meter, counts) in runs.flat_map(|run| &run.by_meter) {
            let sum = by_meter.entry(*meter).or_default();
            sum.0 += counts.0;
            sum.1 += counts.1;
        }
        let (longest, _) = by_meter.last_key_value()?;
        let range_m = (f64::from(*longest + 1) / RANGES).ceil() as u32;

        let mut table = Table::new("Distance, m | commands | lost | share lost | 95 % interval");
        let mut points = Vec::new();
        let mut levels = Vec::new();
        let mut first = 0;
        while first <= *longest {
            let next = first + range_m;
            let mut counts = (0, 0);
            for (_, (commands, lost)) in by_meter.range(first..next) {
                counts.0 += commands;
                counts.1 += lost;
            }
            if counts.0 > 0 {
                let middle_m = f64::from(first + next) / 2.0;
                let share = Estimate::share(counts.1 as usize, counts.0 as usize);
                levels.push((middle_m, middle_m.to_string()));
                points.push(point(middle_m, &share));
                table.row(row(&format!("{first} to {next}"), counts, &share));
            }
            first = next;
        }

        let trend = Trend {
            title: "Share of commands that the radio lost, by distance".to_owned(),
            x_axis: "Distance, m".to_owned(),
            y_axis: "Share lost".to_owned(),
            levels,
            range: (0.0, 1.0),
            reference: None,
            lines: vec![TrendLine {
                label: "lost".to_owned(),
                arm: 0,
                points,
            }],
        };
        let panels = vec![ChartPanel::new("Loss by distance", Chart::Trend(trend))];
        let caption = "The share of the commands that the radio lost, by the distance between sender and target in the tick in which they arrived or \
                       were lost, with intervals of 95 % (Wilson 1927).";
        Some(Figure::new(panels, caption, Some(table)))
    }
}

/// Whether it has to do with the places of both robots.
fn is_of_radio(because: Cause) -> bool {
    matches!(
        because,
        Cause::OutOfRange
            | Cause::Distance
            | Cause::Wall
            | Cause::Body
            | Cause::Shadowing
            | Cause::Fading
    )
}

fn point(middle_m: f64, share: &Estimate) -> TrendPoint {
    TrendPoint {
        x: middle_m,
        estimate: PlottedEstimate {
            value: share.value,
            interval: share.bounds(),
            n: share.n,
            is_filled: true,
        },
        runs: Vec::new(),
    }
}

fn row(distance: &str, (commands, lost): (u64, u64), share: &Estimate) -> [Cell; 5] {
    let interval = share.bounds().map_or(Cell::Empty, |(low, high)| {
        format!("{low:.3} to {high:.3}").into()
    });
    [
        distance.into(),
        commands.into(),
        lost.into(),
        Cell::Number(share.value, 3),
        interval,
    ]
}
