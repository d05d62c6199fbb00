//! Charts as data and as views of Vega-Lite (version 5), so that a figure can be drawn anew by others.

use protocol::messages::BodyShape;
use protocol::time::time_s;
use serde_json::{Value, json};
use timeline::StateKind;

use crate::chart::PlottedEstimate;
use crate::chart::bands::Bands;
use crate::chart::course::TimeCourse;
use crate::chart::floor::Floor;
use crate::chart::intervals::Intervals;
use crate::chart::matrix::{Matrix, MatrixLabel};
use crate::chart::outcome::OutcomeCurve;
use crate::chart::steps::Steps;
use crate::chart::trend::Trend;
use crate::data::{DataRow, digits};
use crate::diagram::Diagram;
use crate::palette::{ARM_SHADES, ARMS, state_look};

/// What a panel shows.
#[derive(Debug, Clone)]
pub enum Chart {
    /// States over time.
    Bands(Bands),
    /// Numbers over time.
    Course(TimeCourse),
    /// Where a robot was.
    Floor(Floor),
    /// Estimates in rows.
    Intervals(Intervals),
    /// Shaded cells.
    Matrix(Matrix),
    /// What decided a run.
    Outcome(OutcomeCurve),
    /// Step functions.
    Steps(Steps),
    /// Estimates over a factor.
    Trend(Trend),
    /// A space-time diagram.
    Diagram(Box<Diagram>),
}

impl Chart {
    /// The numbers that it shows.
    pub(crate) fn data(&self) -> Vec<DataRow> {
        match self {
            Self::Bands(chart) => bands(chart),
            Self::Course(chart) => course(chart),
            Self::Floor(chart) => floor(chart),
            Self::Intervals(chart) => intervals(chart),
            Self::Matrix(chart) => matrix(chart),
            Self::Outcome(chart) => outcome(chart),
            Self::Steps(chart) => steps(chart),
            Self::Trend(chart) => trend(chart),
            Self::Diagram(chart) => chart.data(),
        }
    }

    /// A view of its data.
    fn view(&self) -> Value {
        match self {
            Self::Bands(chart) => bands_view(chart),
            Self::Course(chart) => course_view(chart),
            Self::Floor(chart) => floor_view(chart),
            Self::Intervals(chart) => intervals_view(chart),
            Self::Matrix(chart) => matrix_view(chart),
            Self::Outcome(chart) => outcome_view(chart),
            Self::Steps(chart) => steps_view(chart),
            Self::Trend(chart) => trend_view(chart),
            Self::Diagram(chart) => diagram_view(chart),
        }
    }
}

/// A chart of a figure.
pub(crate) struct PanelView<'a> {
    pub(crate) heading: &'a str,
    pub(crate) chart: &'a Chart,
    pub(crate) is_wide: bool,
}

/// The specification of a figure over its data: a view for each panel.
pub(crate) fn spec(panels: &[PanelView<'_>], data: &str, description: &str) -> String {
    let mut views = Vec::new();
    for (index, panel) in panels.iter().enumerate() {
        let mut view = panel.chart.view();
        view["transform"] = json!([{ "filter": { "field": "panel", "equal": index + 1 } }]);
        view["width"] = json!(if panel.is_wide { 480 } else { 240 });
        if !panel.heading.is_empty() {
            view["title"] = json!(panel.heading);
        }
        views.push(view);
    }

    let is_wide = panels.iter().any(|panel| panel.is_wide);
    let spec = json!({
        "$schema": "https://vega.github.io/schema/vega-lite/v5.json",
        "description": description,
        "data": { "url": data, "format": { "type": "csv" } },
        "columns": if is_wide { 1 } else { 2 },
        "concat": views,
        "resolve": { "scale": { "color": "independent" } },
        "config": { "background": "white", "font": "Helvetica, Arial, sans-serif" },
    });
    format!("{spec:#}\n")
}

fn number(field: &str, title: &str, (from, to): (f64, f64)) -> Value {
    json!({
        "field": field,
        "type": "quantitative",
        "title": title,
        "scale": { "domain": [from, to], "zero": false },
    })
}

fn name(field: &str) -> Value {
    json!({ "field": field, "type": "nominal", "sort": null, "title": null })
}

/// The color of arms or robots, each with its index.
fn arm_colors<'a>(field: &str, arms: impl Iterator<Item = (&'a String, usize)>) -> Value {
    let (names, colors): (Vec<_>, Vec<_>) = arms
        .map(|(name, arm)| (name, ARM_SHADES[arm % ARMS].light))
        .unzip();
    json!({
        "field": field,
        "type": "nominal",
        "title": null,
        "scale": { "domain": names, "range": colors },
    })
}

fn filter(field: &str, value: &str) -> Value {
    json!([{ "filter": { "field": field, "equal": value } }])
}

/// An estimate in the columns that all of them have.
fn estimate_row(estimate: &PlottedEstimate) -> DataRow {
    let [low, high] = match estimate.interval {
        Some((low, high)) => [low, high].map(digits),
        None => Default::default(),
    };
    vec![
        ("kind", "estimate".to_owned()),
        ("value", digits(estimate.value)),
        ("low", low),
        ("high", high),
        ("n", estimate.n.to_string()),
        ("filled", estimate.is_filled.to_string()),
    ]
}

fn run_row(value: f64) -> DataRow {
    vec![("kind", "run".to_owned()), ("value", digits(value))]
}

fn intervals(chart: &Intervals) -> Vec<DataRow> {
    let mut rows = Vec::new();
    for row in &chart.rows {
        let arm = || vec![("arm", row.label.clone())];
        rows.extend(
            row.estimate
                .iter()
                .map(|one| [arm(), estimate_row(one)].concat()),
        );
        rows.extend(row.runs.iter().map(|run| [arm(), run_row(*run)].concat()));
    }
    rows
}

fn intervals_view(chart: &Intervals) -> Value {
    let mut color = arm_colors("arm", chart.rows.iter().map(|row| (&row.label, row.arm)));
    color["legend"] = Value::Null;
    let x = number("value", &chart.axis, chart.range);
    let low = number("low", &chart.axis, chart.range);
    json!({
        "encoding": { "y": name("arm"), "color": color },
        "layer": [
            { "transform": filter("kind", "run"), "mark": { "type": "point", "filled": true, "size": 8 }, "encoding": { "x": x } },
            { "transform": filter("kind", "estimate"), "mark": "rule", "encoding": { "x": low, "x2": { "field": "high" } } },
            { "transform": filter("kind", "estimate"), "mark": { "type": "point", "filled": true, "size": 50 }, "encoding": { "x": x } },
        ],
    })
}

fn trend(chart: &Trend) -> Vec<DataRow> {
    let mut rows = Vec::new();
    for line in &chart.lines {
        for point in &line.points {
            let place = || vec![("arm", line.label.clone()), ("x", digits(point.x))];
            rows.push([place(), estimate_row(&point.estimate)].concat());
            rows.extend(
                point
                    .runs
                    .iter()
                    .map(|run| [place(), run_row(*run)].concat()),
            );
        }
    }
    rows
}

fn trend_view(chart: &Trend) -> Value {
    let y = number("value", &chart.y_axis, chart.range);
    let low = number("low", &chart.y_axis, chart.range);
    let lines = chart.lines.iter();
    json!({
        "encoding": {
            "x": { "field": "x", "type": "quantitative", "title": chart.x_axis },
            "color": arm_colors("arm", lines.map(|line| (&line.label, line.arm))),
        },
        "layer": [
            { "transform": filter("kind", "run"), "mark": { "type": "point", "filled": true, "size": 8 }, "encoding": { "y": y } },
            { "transform": filter("kind", "estimate"), "mark": "rule", "encoding": { "y": low, "y2": { "field": "high" } } },
            { "transform": filter("kind", "estimate"), "mark": { "type": "line", "point": true }, "encoding": { "y": y } },
        ],
    })
}

fn steps(chart: &Steps) -> Vec<DataRow> {
    let mut rows = Vec::new();
    for curve in &chart.curves {
        let mut add = |kind: &str, x: f64, share: Option<f64>, band: Option<(f64, f64)>| {
            let band = band.map_or(Default::default(), |(low, high)| [low, high].map(digits));
            let [low, high] = band;
            rows.push(vec![
                ("arm", curve.label.clone()),
                ("kind", kind.to_owned()),
                ("x", digits(x)),
                ("share", share.map_or(String::new(), digits)),
                ("low", low),
                ("high", high),
            ]);
        };
        add("curve", chart.range.0, Some(curve.begin), None);
        for step in &curve.steps {
            add("curve", step.x, Some(step.y), step.band);
        }
        let last = curve.steps.last();
        let end = last.map_or(curve.begin, |step| step.y);
        add(
            "curve",
            curve.end,
            Some(end),
            last.and_then(|step| step.band),
        );
        for x in &curve.censored {
            add("censored", *x, Some(curve.at(*x)), None);
        }
        for (x, count) in chart.at_risk.iter().flatten().zip(&curve.at_risk) {
            rows.push(vec![
                ("arm", curve.label.clone()),
                ("kind", "at risk".to_owned()),
                ("x", digits(*x)),
                ("n", count.to_string()),
            ]);
        }
    }
    rows
}

fn steps_view(chart: &Steps) -> Value {
    let share = number("share", &chart.y_axis, (0.0, 1.0));
    let low = number("low", &chart.y_axis, (0.0, 1.0));
    let has_band = chart
        .curves
        .iter()
        .any(|curve| curve.steps.iter().any(|step| step.band.is_some()));
    let mut layers = Vec::new();
    if has_band {
        layers.push(json!({
            "transform": filter("kind", "curve"),
            "mark": { "type": "area", "interpolate": "step-after", "opacity": 0.15 },
            "encoding": { "y": low, "y2": { "field": "high" } },
        }));
    }
    layers.push(json!({
        "transform": filter("kind", "curve"),
        "mark": { "type": "line", "interpolate": "step-after" },
        "encoding": { "y": share },
    }));
    layers.push(json!({
        "transform": filter("kind", "censored"),
        "mark": { "type": "tick", "orient": "vertical", "size": 7 },
        "encoding": { "y": share },
    }));
    let curves = chart.curves.iter();
    json!({
        "encoding": {
            "x": number("x", &chart.x_axis, chart.range),
            "color": arm_colors("arm", curves.map(|curve| (&curve.label, curve.arm))),
        },
        "layer": layers,
    })
}

fn bands(chart: &Bands) -> Vec<DataRow> {
    let mut rows = Vec::new();
    for row in &chart.rows {
        for band in &row.bands {
            rows.push(vec![
                ("row", row.label.clone()),
                ("state", band.name.clone()),
                ("from_s", digits(band.begin_s)),
                ("to_s", digits(band.end_s)),
            ]);
        }
    }
    rows
}

/// The colors of states, in the order of their looks.
fn state_colors<'a>(
    kind: StateKind,
    names: &timeline::StateOrder,
    states: impl Iterator<Item = &'a String>,
) -> Value {
    let found: std::collections::BTreeSet<_> = states
        .map(|state| (state_look(kind, state, names), state))
        .collect();
    let colors: Vec<&str> = found.iter().map(|(look, _)| look.light()).collect();
    let states: Vec<&String> = found.into_iter().map(|(_, state)| state).collect();
    json!({
        "field": "state",
        "type": "nominal",
        "title": null,
        "scale": { "domain": states, "range": colors },
    })
}

fn bands_view(chart: &Bands) -> Value {
    let bands = chart.rows.iter().flat_map(|row| &row.bands);
    let color = state_colors(chart.kind, &chart.names, bands.map(|band| &band.name));
    json!({
        "mark": "bar",
        "encoding": {
            "x": number("from_s", "simulated time, s", (0.0, chart.end_s)),
            "x2": { "field": "to_s" },
            "y": name("row"),
            "color": color,
        },
    })
}

fn course(chart: &TimeCourse) -> Vec<DataRow> {
    let mut rows = Vec::new();
    for line in &chart.lines {
        let last = line.values.last().map(|(_, value)| (chart.end_s, *value));
        for (time_s, value) in line.values.iter().copied().chain(last) {
            rows.push(vec![
                ("robot", line.label.clone()),
                ("time_s", digits(time_s)),
                ("value", value.map_or(String::new(), digits)),
            ]);
        }
    }
    rows
}

fn course_view(chart: &TimeCourse) -> Value {
    let lines = chart.lines.iter();
    json!({
        "mark": { "type": "line", "interpolate": "step-after" },
        "encoding": {
            "x": number("time_s", "simulated time, s", (0.0, chart.end_s)),
            "y": number("value", &chart.axis, chart.range),
            "color": arm_colors("robot", lines.map(|line| (&line.label, line.arm))),
        },
    })
}

fn outcome(chart: &OutcomeCurve) -> Vec<DataRow> {
    let decision = &chart.0;
    let seconds = |tick| digits(time_s(tick, decision.tick_s));
    let curve = decision.curve.iter().filter_map(|point| {
        let (low, high) = point.outcome.ends()?;
        Some(vec![
            ("kind", "curve".to_owned()),
            ("time_s", seconds(point.tick)),
            ("value", digits(point.outcome.value?)),
            ("low", digits(low)),
            ("high", digits(high)),
            ("n", point.outcome.n.to_string()),
        ])
    });
    let jumps = decision.jumps.iter().map(|jump| {
        vec![
            ("kind", "jump".to_owned()),
            ("time_s", seconds(jump.tick)),
            ("text", decision.told(jump)),
        ]
    });
    curve.chain(jumps).collect()
}

fn outcome_view(chart: &OutcomeCurve) -> Value {
    let decision = &chart.0;
    let (axis, range) = (decision.axis(), decision.range());
    let y = number("value", &axis, range);
    let low = number("low", &axis, range);
    json!({
        "encoding": { "x": number("time_s", "simulated time, s", (0.0, chart.end_s())) },
        "layer": [
            { "transform": filter("kind", "curve"), "mark": { "type": "area", "opacity": 0.15 }, "encoding": { "y": low, "y2": { "field": "high" } } },
            { "transform": filter("kind", "curve"), "mark": "line", "encoding": { "y": y } },
            { "transform": filter("kind", "jump"), "mark": { "type": "rule", "strokeDash": [2, 2] } },
        ],
    })
}

fn matrix(chart: &Matrix) -> Vec<DataRow> {
    let mut rows = Vec::new();
    for (label, cells) in chart.rows.iter().zip(&chart.cells) {
        for (column, cell) in chart.columns.iter().zip(cells) {
            let Some(cell) = cell else {
                continue;
            };
            rows.push(vec![
                ("row", label.text.clone()),
                ("column", column.text.clone()),
                ("shade", digits(cell.share)),
                ("text", cell.text.clone()),
                ("remark", cell.remark.clone()),
            ]);
        }
    }
    rows
}

fn matrix_view(chart: &Matrix) -> Value {
    let axis = |field: &str, title: &str, labels: &[MatrixLabel]| {
        let texts: Vec<&String> = labels.iter().map(|label| &label.text).collect();
        json!({ "field": field, "type": "nominal", "title": title, "sort": texts })
    };
    let shade = json!({
        "field": "shade",
        "type": "quantitative",
        "legend": null,
        "scale": { "domain": [0, 1], "scheme": "blues" },
    });
    json!({
        "encoding": {
            "y": axis("row", &chart.rows_title, &chart.rows),
            "x": axis("column", &chart.columns_title, &chart.columns),
        },
        "layer": [
            { "mark": "rect", "encoding": { "color": shade } },
            { "mark": "text", "encoding": { "text": { "field": "text", "type": "nominal" } } },
        ],
    })
}

fn floor(chart: &Floor) -> Vec<DataRow> {
    let area = |kind: &str, [x, y]: [f64; 2], [x_to, y_to]: [f64; 2], time_s| -> DataRow {
        let time_s: Option<f64> = time_s;
        vec![
            ("kind", kind.to_owned()),
            ("x_from_m", digits(x)),
            ("x_to_m", digits(x_to)),
            ("y_from_m", digits(y)),
            ("y_to_m", digits(y_to)),
            ("time_s", time_s.map_or(String::new(), digits)),
        ]
    };
    let mut rows = Vec::new();
    for ((column, row), time_s) in &chart.times_s {
        let corner = [*column, *row].map(|part| f64::from(part) * chart.part_m);
        let other = corner.map(|place| place + chart.part_m);
        rows.push(area("part", corner, other, Some(*time_s)));
    }
    for (index, [x, y]) in chart.obstacles.iter().enumerate() {
        let [width_m, height_m] = chart.size_m(index);
        let corner = [x - width_m / 2.0, y - height_m / 2.0];
        let other = [corner[0] + width_m, corner[1] + height_m];
        let is_disc = matches!(chart.shape(index), Some(BodyShape::Disc(_)));
        let kind = if is_disc { "disc" } else { "obstacle" };
        rows.push(area(kind, corner, other, None));
    }
    for wall in &chart.static_world.walls {
        for ends in wall.windows(2) {
            rows.push(area("wall", ends[0], ends[1], None));
        }
    }
    rows
}

fn floor_view(chart: &Floor) -> Value {
    let [width_m, height_m] = chart.field_m;
    let color = json!({
        "field": "time_s",
        "type": "quantitative",
        "title": "time, s",
        "scale": { "type": "sqrt", "scheme": "teals" },
    });
    json!({
        "height": 240.0 * height_m / width_m,
        "encoding": {
            "x": number("x_from_m", "x, m", (0.0, width_m)),
            "x2": { "field": "x_to_m" },
            "y": number("y_from_m", "y, m", (0.0, height_m)),
            "y2": { "field": "y_to_m" },
        },
        "layer": [
            { "transform": filter("kind", "part"), "mark": "rect", "encoding": { "color": color } },
            { "transform": filter("kind", "obstacle"), "mark": { "type": "rect", "color": "#4a4a45" } },
            // A rectangle with such corners is an ellipse in the square around a disc.
            { "transform": filter("kind", "disc"), "mark": { "type": "rect", "color": "#4a4a45", "cornerRadius": 1000 } },
            { "transform": filter("kind", "wall"), "mark": { "type": "rule", "color": "#4a4a45", "strokeWidth": 1.5 } },
        ],
    })
}

fn diagram_view(diagram: &Diagram) -> Value {
    let (from_s, to_s) = diagram.window_s();
    let x = || number("from_s", "simulated time, s", (from_s, to_s));
    let colors =
        |kind, states: Vec<&String>| state_colors(kind, &diagram.names(), states.into_iter());
    let band = |kind: &str, offset: i32, height: u32, color: Value| {
        json!({
            "transform": filter("kind", kind),
            "mark": { "type": "bar", "height": height, "yOffset": offset },
            "encoding": { "x": x(), "x2": { "field": "to_s" }, "y": name("robot"), "color": color },
        })
    };
    let emotions = colors(StateKind::Emotion, diagram.states(StateKind::Emotion));
    let behaviors = colors(StateKind::Behavior, diagram.states(StateKind::Behavior));
    json!({
        "layer": [
            band("emotion", -7, 14, emotions),
            band("behavior", 6, 12, behaviors),
            {
                "transform": filter("kind", "command"),
                "mark": { "type": "rule", "color": "#33332f" },
                "encoding": {
                    "x": x(),
                    "x2": { "field": "to_s" },
                    "y": name("robot"),
                    "y2": { "field": "to_robot" },
                },
            },
        ],
        "resolve": { "scale": { "color": "independent" } },
    })
}
