//! Charts of any data are well-formed SVG, with as many marks as the data have.

use std::collections::BTreeMap;

use pictures::{
    Band, BandRow, Bands, Cell, Chart, ChartPanel, Curve, CurveStep, Figure, Floor, IntervalRow,
    Intervals, Matrix, MatrixCell, MatrixLabel, OutcomeCurve, Page, PlottedEstimate, Steps, Table,
    Text, Trend, TrendLine, TrendPoint, state_look,
};
use protocol::messages::{BodyShape, StaticWorld};
use roxmltree::{Document, Node, ParsingOptions};
use timeline::{
    DecisionCause, DecisionJump, DecisionPoint, DecisionQuestion, ForkOutcomes, RunDecision,
    StateKind, StateOrder,
};

/// A text that would leave its place if it were not escaped.
const HOSTILE: &str = "</svg><script>alert(\"1\")</script>&amp;'\u{1b}[31m\u{202e}\u{0}]]>";

/// Parses a chart and checks what all charts have.
fn parsed(svg: &str) -> Document<'_> {
    let document = Document::parse(svg).unwrap_or_else(|error| panic!("{error}: {svg}"));
    let root = document.root_element();
    assert_eq!(root.tag_name().name(), "svg");
    let mut children = root.children().filter(Node::is_element);
    assert_eq!(children.next().unwrap().tag_name().name(), "title");
    assert_eq!(children.next().unwrap().tag_name().name(), "desc");
    assert!(!of_tag(&document, "script"), "{svg}");
    for wrong in ["NaN", "inf"] {
        let numbers = root.descendants().flat_map(|node| node.attributes());
        for attribute in numbers {
            assert!(!attribute.value().contains(wrong), "{attribute:?}");
        }
    }
    document
}

fn of_tag(document: &Document<'_>, tag: &str) -> bool {
    document
        .descendants()
        .any(|node| node.tag_name().name() == tag)
}

fn of_class<'a>(document: &'a Document<'_>, class: &str) -> Vec<Node<'a, 'a>> {
    let has_class = |node: &Node<'_, '_>| {
        let classes = node.attribute("class").unwrap_or_default();
        classes.split(' ').any(|one| one == class)
    };
    document.descendants().filter(has_class).collect()
}

fn estimate(value: f64) -> PlottedEstimate {
    PlottedEstimate {
        value,
        interval: Some((value - 1.0, value + 2.0)),
        n: 32,
        is_filled: true,
    }
}

#[test]
fn bands_are_as_many_as_the_states() {
    let mut bands = Vec::new();
    for index in 0..40 {
        let name = if index % 2 == 0 { "HAPPY" } else { HOSTILE };
        bands.push(Band {
            name: name.to_owned(),
            begin_s: f64::from(index),
            end_s: f64::from(index + 1),
        });
    }
    let chart = Bands {
        title: HOSTILE.to_owned(),
        kind: StateKind::Emotion,
        end_s: 40.0,
        rows: vec![BandRow {
            label: HOSTILE.to_owned(),
            bands,
        }],
        names: StateOrder::default(),
    };
    let svg = chart.draw();
    let document = parsed(&svg);
    let mut drawn = 0;
    for state in of_class(&document, "state") {
        let path = state.children().find(|node| node.has_tag_name("path"));
        drawn += path.unwrap().attribute("d").unwrap().matches('M').count();
    }
    assert_eq!(drawn, 40);
}

#[test]
fn a_long_row_has_a_bounded_size() {
    let mut bands = Vec::new();
    for index in 0..500_000 {
        bands.push(Band {
            name: format!("S{}", index % 7),
            begin_s: f64::from(index),
            end_s: f64::from(index + 1),
        });
    }
    let chart = Bands {
        title: "long".to_owned(),
        kind: StateKind::Behavior,
        end_s: 500_000.0,
        rows: vec![BandRow {
            label: "one".to_owned(),
            bands,
        }],
        names: StateOrder::default(),
    };
    let svg = chart.draw();
    parsed(&svg);
    assert!(svg.len() < 100_000, "{}", svg.len());
}

#[test]
fn a_matrix_has_a_cell_for_each_value() {
    let names = StateOrder::default();
    for size in [1, 3, 8, 24, 60] {
        let labels: Vec<MatrixLabel> = (0..size)
            .map(|index| MatrixLabel {
                text: format!("{HOSTILE}{index}"),
                look: Some(state_look(StateKind::Behavior, "WAIT", &names)),
            })
            .collect();
        let mut cells = Vec::new();
        for row in 0..size {
            let cell = |column: usize| {
                (column != row).then(|| MatrixCell {
                    share: column as f64 / size as f64,
                    text: column.to_string(),
                    remark: "50 %".to_owned(),
                })
            };
            cells.push((0..size).map(cell).collect());
        }
        let chart = Matrix {
            title: "transitions".to_owned(),
            rows_title: "from".to_owned(),
            columns_title: "to".to_owned(),
            rows: labels.clone(),
            columns: labels,
            cells,
        };
        let shown = size.min(24);
        let svg = chart.draw();
        let document = parsed(&svg);
        assert_eq!(of_class(&document, "cell").len(), shown * shown - shown);
        assert_eq!(of_class(&document, "none").len(), shown);
    }
}

#[test]
fn a_floor_has_a_square_for_each_part() {
    let mut times_s = BTreeMap::new();
    for part in 0..50 {
        times_s.insert((part, part), f64::from(part) + 0.5);
    }
    let chart = Floor {
        title: "where".to_owned(),
        field_m: [15.0, 10.0],
        body_m: 0.6,
        obstacles: vec![[1.0, 1.0], [3.0, 4.0]],
        static_world: Default::default(),
        part_m: 0.3,
        times_s,
    };
    let svg = chart.draw();
    let document = parsed(&svg);
    let paths = document.descendants().filter(|node| {
        let class = node.attribute("class").unwrap_or_default();
        node.has_tag_name("path") && class.starts_with('h')
    });
    let squares: usize = paths
        .map(|path| path.attribute("d").unwrap().matches('M').count())
        .sum();
    assert_eq!(squares, 50);
    // Each obstacle is a group with a square.
    assert_eq!(of_class(&document, "obstacle").len(), 4);
    assert_eq!(of_class(&document, "wall").len(), 0);
}

#[test]
fn a_floor_has_walls_and_the_shapes_of_obstacles() {
    let chart = Floor {
        title: "where".to_owned(),
        field_m: [10.0, 10.0],
        body_m: 0.5,
        obstacles: vec![[1.0, 1.0], [3.0, 4.0], [7.0, 7.0]],
        static_world: StaticWorld {
            walls: vec![
                vec![[0.0, 5.0], [5.0, 5.0], [5.0, 9.0]],
                vec![[8.0, 1.0], [9.0, 1.0]],
            ],
            obstacle_shapes: vec![
                None,
                Some(BodyShape::Rectangle([3.0, 1.0])),
                Some(BodyShape::Disc(1.5)),
            ],
            ..StaticWorld::default()
        },
        part_m: 0.3,
        times_s: BTreeMap::new(),
    };
    let svg = chart.draw();
    let document = parsed(&svg);
    let mut obstacles = of_class(&document, "obstacle");
    obstacles.retain(|node| !node.has_tag_name("g"));
    let size = |index: usize, name: &str| -> f64 {
        obstacles[index].attribute(name).unwrap().parse().unwrap()
    };
    let px_per_m = size(0, "width") / 0.5;
    assert!((size(1, "width") / px_per_m - 3.0).abs() < 0.02, "{svg}");
    assert!((size(1, "height") / px_per_m - 1.0).abs() < 0.02, "{svg}");
    let disc = obstacles[2].attribute("d").unwrap();
    let radius: f64 = disc.split(['a', ' ']).nth(2).unwrap().parse().unwrap();
    assert!((radius / px_per_m - 1.5).abs() < 0.02, "{disc}");

    let walls = of_class(&document, "wall");
    let path = walls[0].attribute("d").unwrap();
    assert_eq!((walls.len(), path.matches('M').count()), (1, 2), "{path}");
    assert_eq!(path.matches('L').count(), 3, "{path}");
}

#[test]
fn intervals_have_a_marker_for_each_estimate() {
    let mut rows = Vec::new();
    for arm in 0..20 {
        rows.push(IntervalRow {
            label: format!("{HOSTILE} {arm}"),
            arm,
            estimate: (arm != 3).then(|| PlottedEstimate {
                is_filled: arm % 2 == 0,
                ..estimate(arm as f64)
            }),
            runs: vec![arm as f64; 10 * arm],
        });
    }
    let chart = Intervals {
        title: "served".to_owned(),
        axis: "served".to_owned(),
        range: (0.0, 20.0),
        reference: Some(0.0),
        rows,
    };
    let svg = chart.draw();
    let document = parsed(&svg);
    assert_eq!(of_class(&document, "mark").len(), 19);
    assert_eq!(of_class(&document, "hollow").len(), 10 - 1);

    // A point for each run behind them, of at most 100.
    let dots = of_class(&document, "dots");
    let dots = dots.iter().map(|path| path.attribute("d").unwrap());
    let dots: Vec<usize> = dots.map(|path| path.matches('M').count()).collect();
    let runs = (1..20).map(|arm| (10 * arm).min(100));
    assert_eq!(dots, Vec::from_iter(runs));
}

#[test]
fn a_trend_has_a_marker_for_each_estimate_and_each_name() {
    let levels = [0.0, 0.1, 0.25, 0.5, 1.0];
    let mut lines = Vec::new();
    for arm in 0..5 {
        let point = |x: &f64| TrendPoint {
            x: *x,
            estimate: estimate(100.0 * x + arm as f64),
            runs: vec![100.0 * x; 3],
        };
        lines.push(TrendLine {
            label: format!("arm {arm}"),
            arm,
            points: levels.iter().map(point).collect(),
        });
    }
    let chart = Trend {
        title: "served over loss".to_owned(),
        x_axis: "loss".to_owned(),
        y_axis: "served".to_owned(),
        levels: levels.iter().map(|x| (*x, x.to_string())).collect(),
        range: (0.0, 110.0),
        reference: None,
        lines,
    };
    let svg = chart.draw();
    let document = parsed(&svg);
    assert_eq!(of_class(&document, "mark").len(), 5 * levels.len() + 5);
    assert_eq!(of_class(&document, "dots").len(), 5 * levels.len());
}

#[test]
fn the_arms_at_a_value_are_nearer_to_it_than_to_the_next_one() {
    let levels = [0.0, 0.1, 1.0];
    let mut lines = Vec::new();
    for _ in 0..8 {
        let point = |x: &f64| TrendPoint {
            x: *x,
            estimate: estimate(*x),
            runs: Vec::new(),
        };
        lines.push(TrendLine {
            label: String::new(),
            arm: 0,
            points: levels.iter().map(point).collect(),
        });
    }
    let chart = Trend {
        title: String::new(),
        x_axis: String::new(),
        y_axis: String::new(),
        levels: levels.iter().map(|x| (*x, x.to_string())).collect(),
        range: (0.0, 1.0),
        reference: None,
        lines,
    };

    // The markers of a line are at growing values.
    let svg = chart.draw();
    let document = parsed(&svg);
    let mut places = vec![Vec::new(); levels.len()];
    for line in of_class(&document, "curve") {
        let data = line.attribute("d").unwrap();
        let points: Vec<&str> = data.split(['M', 'L']).skip(1).collect();
        if points.len() == levels.len() {
            for (place, point) in places.iter_mut().zip(points) {
                let x = point.split_whitespace().next().unwrap();
                place.push(x.parse::<f64>().unwrap());
            }
        }
    }
    let most = |places: &[f64]| places.iter().copied().fold(f64::MIN, f64::max);
    let least = |places: &[f64]| places.iter().copied().fold(f64::MAX, f64::min);
    assert_eq!(places[0].len(), 8);
    assert!(most(&places[0]) < least(&places[1]), "{places:?}");
    assert!(most(&places[1]) < least(&places[2]), "{places:?}");
}

#[test]
fn intervals_with_one_range_have_one_axis() {
    let chart = |value: f64| Intervals {
        title: String::new(),
        axis: String::new(),
        range: (-400.0, 100.0),
        reference: Some(0.0),
        rows: vec![IntervalRow {
            label: "arm".to_owned(),
            arm: 0,
            estimate: Some(estimate(value)),
            runs: Vec::new(),
        }],
    };
    let axis = |value: f64| {
        let svg = chart(value).draw();
        let document = parsed(&svg);
        let axis = of_class(&document, "axis")[0].attribute("d").unwrap();
        axis.to_owned()
    };
    assert_eq!(axis(0.0), axis(-380.0));
}

#[test]
fn a_matrix_is_as_wide_as_its_numbers_need() {
    for (columns, is_wide) in [(5, false), (12, true)] {
        let labels = |count: usize| {
            let label = |index: usize| MatrixLabel {
                text: format!("{index}"),
                look: None,
            };
            (0..count).map(label).collect::<Vec<MatrixLabel>>()
        };
        let cell = MatrixCell {
            share: 0.5,
            text: "64/64".to_owned(),
            remark: String::new(),
        };
        let chart = Matrix {
            title: String::new(),
            rows_title: "arm".to_owned(),
            columns_title: "condition".to_owned(),
            rows: labels(2),
            columns: labels(columns),
            cells: vec![vec![Some(cell); columns]; 2],
        };
        assert_eq!(chart.is_wide(), is_wide);
        let numbers = chart.draw().matches(">64/64<").count();
        assert_eq!(numbers, 2 * columns);
    }
}

#[test]
fn numbers_stay_with_their_units_and_relations() {
    let mut page = Page::new("kind", "title");
    page.paragraph(Text::from("n = 32, p < 0.05, 95 %").code("a = 1 %"));
    let html = page.finish();
    assert!(html.contains("n\u{a0}=\u{a0}32, p\u{a0}&lt;\u{a0}0.05, 95\u{a0}%"));
    assert!(html.contains("a = 1 %"));
}

#[test]
fn curves_are_thinned_to_what_can_be_seen() {
    let mut steps = Vec::new();
    for index in 0..100_000 {
        let x = f64::from(index) / 100.0;
        let y = 1.0 - x / 1000.0;
        steps.push(CurveStep {
            x,
            y,
            band: Some(((y - 0.1).max(0.0), (y + 0.1).min(1.0))),
        });
    }
    let curve = Curve {
        label: HOSTILE.to_owned(),
        arm: 1,
        begin: 1.0,
        steps,
        end: 1000.0,
        censored: (0..1000).map(f64::from).collect(),
        at_risk: vec![32, 16],
    };
    let chart = Steps {
        title: "survival".to_owned(),
        x_axis: "time, s".to_owned(),
        y_axis: "without deadlock".to_owned(),
        range: (0.0, 1000.0),
        at_risk: Some(vec![0.0, 500.0]),
        curves: vec![curve],
    };
    let svg = chart.draw();
    parsed(&svg);
    assert!(svg.len() < 100_000, "{}", svg.len());
}

#[test]
fn what_decided_a_run_is_a_curve_with_its_jumps() {
    let outcomes = |value: f64| ForkOutcomes {
        n: 64,
        value: Some(value),
        low: Some(value - 0.1),
        high: Some(value + 0.1),
        failed: 0,
    };
    let mut decision = RunDecision {
        digest: String::new(),
        question: DecisionQuestion {
            kind: HOSTILE.to_owned(),
            name: HOSTILE.to_owned(),
        },
        is_share: true,
        tick_s: 0.5,
        last: 100,
        sentence: HOSTILE.to_owned(),
        curve: Vec::new(),
        jumps: Vec::new(),
    };
    for tick in 0..100 {
        let value = if tick < 40 { 0.2 } else { 0.8 };
        decision.curve.push(DecisionPoint {
            tick,
            outcome: outcomes(value),
        });
    }
    for tick in [40, 41, 90] {
        decision.jumps.push(DecisionJump {
            tick,
            before: outcomes(0.2),
            after: outcomes(0.8),
            events: vec![HOSTILE.to_owned()],
            cause: Some(DecisionCause {
                what: HOSTILE.to_owned(),
                is_event: true,
                without: outcomes(0.2),
            }),
        });
    }

    for is_share in [true, false] {
        decision.is_share = is_share;
        let svg = OutcomeCurve(decision.clone()).draw();
        let document = parsed(&svg);
        assert_eq!(of_class(&document, "ribbon").len(), 1);
        let jumps = of_class(&document, "jump");
        assert_eq!(jumps.len(), 3);
        // Of two beside each other one has a label; the other has its words under the pointer.
        let labels = jumps.iter().flat_map(roxmltree::Node::children);
        assert_eq!(labels.filter(|node| node.has_tag_name("text")).count(), 2);
    }
    decision.curve.clear();
    decision.jumps.clear();
    parsed(&OutcomeCurve(decision).draw());
}

#[test]
fn charts_of_nothing_are_drawn() {
    let bands = Bands {
        title: String::new(),
        kind: StateKind::Emotion,
        end_s: 0.0,
        rows: Vec::new(),
        names: StateOrder::default(),
    };
    parsed(&bands.draw());
    let steps = Steps {
        title: String::new(),
        x_axis: String::new(),
        y_axis: String::new(),
        range: (0.0, 0.0),
        at_risk: None,
        curves: Vec::new(),
    };
    parsed(&steps.draw());
    let trend = Trend {
        title: String::new(),
        x_axis: String::new(),
        y_axis: String::new(),
        levels: Vec::new(),
        range: (f64::INFINITY, f64::NEG_INFINITY),
        reference: Some(0.0),
        lines: Vec::new(),
    };
    parsed(&trend.draw());
}

#[test]
fn a_page_is_well_formed_and_loads_nothing() {
    let mut page = Page::new(HOSTILE, HOSTILE);
    page.lead(Text::from(HOSTILE).strong(HOSTILE));
    page.section(HOSTILE);
    let mut table = Table::new(&format!("{HOSTILE} | n"));
    table.row([HOSTILE.into(), Cell::Number(0.1 + 0.2, 1)]);
    table.row([Cell::Code(HOSTILE.to_owned()), Cell::Empty]);
    let chart = Bands {
        title: HOSTILE.to_owned(),
        kind: StateKind::Emotion,
        end_s: 1.0,
        rows: Vec::new(),
        names: StateOrder::default(),
    };
    let figure = Figure {
        panels: vec![ChartPanel::new(HOSTILE, Chart::Bands(chart))],
        caption: Text::default().code(HOSTILE),
        table: Some(table),
    };
    assert_eq!(page.figure(figure.clone()), 1);
    page.section("second");
    assert_eq!(page.figure(figure), 2);
    page.file(HOSTILE, "a\n\u{7}<b>");
    page.commands(&["cars report 'a b'".to_owned()]);
    let html = page.finish();

    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&html, options).unwrap();
    assert!(!of_tag(&document, "script"));
    for node in document.descendants() {
        for attribute in node.attributes() {
            let is_reference = ["src", "href"].contains(&attribute.name());
            assert!(
                !is_reference || attribute.value().starts_with('#'),
                "{attribute:?}"
            );
        }
    }
    assert!(html.contains("<data value=\"0.30000000000000004\">0.3</data>"));
    assert!(html.contains("a\n\\u{7}&lt;b&gt;"));
    assert!(html.contains("default-src 'none'"));
    for loading in ["url(", "@import", "http:"] {
        let found = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!found.contains(loading), "{loading}");
    }
}
