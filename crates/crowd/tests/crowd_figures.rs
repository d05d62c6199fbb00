//! The figure of `docs/crowd.md`: models of walking beside what was measured with people. With `CARS_UPDATE=1` the test writes it.

#[path = "../../pictures/tests/shipped/mod.rs"]
mod shipped;

use crowd::checks::{
    CheckOptions, CheckedRow, DENSITIES_PER_M2, GATE_FLOW_PER_S, KnownModel, SINGLE_FILE, SpeedData,
};
use pictures::{
    Chart, ChartPanel, IntervalRow, Intervals, PlottedEstimate, Trend, TrendLine, TrendPoint,
};

use shipped::assert_figure_is_shipped;

/// Colors of the model and of the three sets of data.
const MODEL: usize = 0;
const DATA: [usize; 3] = [1, 2, 3];

fn check(model: KnownModel, only: &str, runs: usize) -> Vec<CheckedRow> {
    let options = CheckOptions {
        runs,
        threads: 2,
        only: only.to_owned(),
        ..CheckOptions::default()
    };
    model.check(&options, &|_, _| {})
}

fn estimate(row: &CheckedRow) -> PlottedEstimate {
    PlottedEstimate {
        value: row.mean,
        interval: Some(row.interval),
        n: row.runs,
        is_filled: true,
    }
}

fn published(value: f64) -> PlottedEstimate {
    PlottedEstimate {
        value,
        interval: None,
        n: 0,
        is_filled: false,
    }
}

fn line(label: &str, arm: usize, points: Vec<(f64, PlottedEstimate)>) -> TrendLine {
    let point = |(x, estimate)| TrendPoint {
        x,
        estimate,
        runs: Vec::new(),
    };
    TrendLine {
        label: label.to_owned(),
        arm,
        points: points.into_iter().map(point).collect(),
    }
}

fn trend(heading: &str, x_axis: &str, top_mps: f64, lines: Vec<TrendLine>) -> ChartPanel {
    let levels = lines[0].points.iter();
    let trend = Trend {
        title: heading.to_owned(),
        x_axis: x_axis.to_owned(),
        y_axis: "Speed, m/s".to_owned(),
        levels: levels.map(|point| (point.x, point.x.to_string())).collect(),
        range: (0.0, top_mps),
        reference: None,
        lines,
    };
    ChartPanel::new(heading, Chart::Trend(trend))
}

fn speed_by_density(model: KnownModel, runs: usize) -> ChartPanel {
    let rows = check(model, "RiMEA 4", runs);
    let speeds = rows.iter().filter(|row| row.measured_mps.is_some());
    let points = DENSITIES_PER_M2.into_iter().zip(speeds.map(estimate));
    let mut lines = vec![line("model", MODEL, points.collect())];
    for (data, arm) in SpeedData::ALL.into_iter().zip(DATA) {
        let speeds = data.speeds_mps().map(published);
        let points = DENSITIES_PER_M2.into_iter().zip(speeds);
        lines.push(line(data.name(), arm, points.collect()));
    }
    let heading = format!("Speed by density, {}", model.name());
    trend(&heading, "Persons per m²", 1.6, lines)
}

fn single_file() -> ChartPanel {
    let rows = check(KnownModel::CollisionFree, "single file", 10);
    let densities = SINGLE_FILE.map(|(per_m, _)| per_m);
    let points = densities.into_iter().zip(rows.iter().map(estimate));
    let measured = SINGLE_FILE.map(|(per_m, speed_mps)| (per_m, published(speed_mps)));
    let lines = vec![
        line("model", MODEL, points.collect()),
        line("people", DATA[0], measured.to_vec()),
    ];
    trend("Single file, collision-free", "Persons per m", 1.2, lines)
}

fn gate() -> ChartPanel {
    let mut rows = Vec::new();
    for model in KnownModel::ALL {
        let checked = check(model, "gate", 10);
        rows.push(IntervalRow {
            label: model.name().to_owned(),
            arm: MODEL,
            estimate: Some(estimate(&checked[0])),
            runs: Vec::new(),
        });
    }
    let heading = "Flow through a gate of 0.5 m; line: people";
    let intervals = Intervals {
        title: heading.to_owned(),
        axis: "Persons per second".to_owned(),
        range: (0.0, 2.0),
        reference: Some(GATE_FLOW_PER_S),
        rows,
    };
    ChartPanel::new(heading, Chart::Intervals(intervals))
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_figure_of_the_crowd_is_up_to_date() {
    let panels = vec![
        speed_by_density(KnownModel::CollisionFree, 10),
        speed_by_density(KnownModel::SocialForce, 5),
        single_file(),
        gate(),
    ];
    let caption = "Models of walking with intervals of 95 %, and what was measured with people.";
    assert_figure_is_shipped("crowd", panels, caption);
}
