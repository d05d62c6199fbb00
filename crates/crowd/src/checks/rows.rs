//! Which cases there are, what their numbers mean, and what is asked of them.

use crate::checks::cases::{
    AGES, ages, corner, corridor, doors, gate, reaction, single_file, single_person, two_rooms,
};
use crate::checks::published::{DENSITIES_PER_M2, GATE_FLOW_PER_S, SINGLE_FILE, SpeedData};
use crate::checks::scene::RunChance;
use crate::model::WalkingModel;

/// Which number of a row is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// The mean of all runs.
    Mean,
    /// The values that 95 % of the runs do not exceed, and do not fall below. \[D\] IMO MSC.1/Circ.1238, for times.
    Most,
    /// Each run.
    All,
}

/// Between which numbers a row has to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Requirement {
    /// Which number of the row.
    pub judged: Judged,
    /// Lowest one.
    pub from: f64,
    /// Highest one.
    pub to: f64,
}

impl Requirement {
    pub(crate) fn holds(&self, value: f64) -> bool {
        (self.from..=self.to).contains(&value)
    }
}

/// What a number of a case means.
#[derive(Clone, Debug)]
pub(crate) struct RowSpec {
    pub(crate) measure: String,
    pub(crate) published: Option<f64>,
    pub(crate) measured_mps: Option<[f64; 3]>,
    pub(crate) requirement: Option<Requirement>,
}

/// A case: what plays one run, and the meaning of the numbers that it returns.
pub(crate) struct CrowdCase<M> {
    pub(crate) title: &'static str,
    pub(crate) rows: Vec<RowSpec>,
    pub(crate) play: fn(&M, &mut RunChance) -> Vec<f64>,
}

/// All cases, in the order of the table.
pub(crate) fn cases<M: WalkingModel + Clone>(against: SpeedData) -> Vec<CrowdCase<M>> {
    let case = |title, rows, play| CrowdCase { title, rows, play };
    vec![
        case("RiMEA 1, one person", single_person_rows(), single_person),
        case("RiMEA 4, corridor", corridor_rows(against), corridor),
        case("single file", single_file_rows(), single_file),
        case(
            "RiMEA 5, reaction",
            vec![all("latest start, frames", 0.0, 2.0)],
            reaction,
        ),
        case("RiMEA 6, corner", corner_rows(), corner),
        case("RiMEA 7, ages", ages_rows(), ages),
        case("RiMEA 9, doors", doors_rows(), doors),
        case("RiMEA 12, two rooms", two_rooms_rows(), two_rooms),
        case("gate of 0.5 m", gate_rows(), gate),
    ]
}

fn single_person_rows() -> Vec<RowSpec> {
    vec![
        RowSpec {
            published: Some(40.0 / 1.33),
            ..most("time for 40 m, s", 26.0, 34.0)
        },
        // The longest way that is no detour, and the longest way to stop. [I]
        all("way walked over 40 m", 0.95, 1.02),
        all("way after arrival, m", 0.0, 1.0),
    ]
}

fn corridor_rows(against: SpeedData) -> Vec<RowSpec> {
    let mut rows = Vec::new();
    for (index, density) in DENSITIES_PER_M2.iter().enumerate() {
        let measure = format!("speed at {density}/m², m/s");
        let speeds_mps = SpeedData::ALL.map(|data| data.speeds_mps()[index]);
        rows.push(RowSpec {
            measured_mps: Some(speeds_mps),
            ..near(&measure, against.speeds_mps()[index], 0.10)
        });
    }
    rows.push(mean("speed at 6/m², m/s", 0.0, 0.25));
    for data in SpeedData::ALL {
        rows.push(shown(&format!("rms from {}, m/s", data.name())));
    }
    rows.extend([
        // Some step back where it is crowded; nobody who is calm walks so, or through others. [I]
        mean("backward, share", 0.0, 0.05),
        mean("overlap, diameters", -1.0, 0.25),
    ]);
    rows
}

fn single_file_rows() -> Vec<RowSpec> {
    let mut rows = Vec::new();
    for (per_m, speed_mps) in SINGLE_FILE {
        rows.push(RowSpec {
            requirement: None,
            ..near(&format!("speed at {per_m}/m, m/s"), speed_mps, 0.10)
        });
    }
    rows
}

fn corner_rows() -> Vec<RowSpec> {
    vec![
        all("places beyond a wall", 0.0, 0.0),
        all("steps through a wall", 0.0, 0.0),
        all("arrived of 20", 20.0, 20.0),
    ]
}

fn ages_rows() -> Vec<RowSpec> {
    AGES.iter()
        .map(|(ages, low_mps, high_mps)| {
            let mut row = all("", *low_mps, *high_mps);
            row.measure = format!("{ages}, m/s");
            row
        })
        .collect()
}

fn doors_rows() -> Vec<RowSpec> {
    vec![
        shown("time by 4 doors, s"),
        shown("time by 2 doors, s"),
        RowSpec {
            published: Some(2.0),
            ..most("ratio of the times", 1.6, 2.4)
        },
    ]
}

fn two_rooms_rows() -> Vec<RowSpec> {
    vec![
        shown("flow in, 1/s"),
        shown("flow out, 1/s"),
        mean("flow in less out, 1/s", -0.05, f64::INFINITY),
    ]
}

fn gate_rows() -> Vec<RowSpec> {
    vec![
        near("flow, 1/s", GATE_FLOW_PER_S, 0.10 * GATE_FLOW_PER_S),
        RowSpec {
            published: Some(1.16),
            ..shown("flow, middle 60 %, 1/s")
        },
    ]
}

fn row(measure: &str, requirement: Option<Requirement>) -> RowSpec {
    RowSpec {
        measure: measure.to_owned(),
        published: None,
        measured_mps: None,
        requirement,
    }
}

/// A number that is shown and not judged.
fn shown(measure: &str) -> RowSpec {
    row(measure, None)
}

fn judged(measure: &str, judged: Judged, from: f64, to: f64) -> RowSpec {
    row(measure, Some(Requirement { judged, from, to }))
}

fn mean(measure: &str, from: f64, to: f64) -> RowSpec {
    judged(measure, Judged::Mean, from, to)
}

fn most(measure: &str, from: f64, to: f64) -> RowSpec {
    judged(measure, Judged::Most, from, to)
}

fn all(measure: &str, from: f64, to: f64) -> RowSpec {
    judged(measure, Judged::All, from, to)
}

/// A mean at most `distance` from what was published.
fn near(measure: &str, published: f64, distance: f64) -> RowSpec {
    RowSpec {
        published: Some(published),
        ..mean(measure, published - distance, published + distance)
    }
}
