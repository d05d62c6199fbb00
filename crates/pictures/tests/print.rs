//! Printed figures: sizes, letters, files that can be read, and specifications that fit their data.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

use std::collections::{BTreeMap, BTreeSet};

use pictures::diagram::{Diagram, DiagramOptions};
use pictures::{
    Band, BandRow, Bands, Chart, ChartPanel, CourseLine, Curve, CurveStep, Figure, Floor,
    IntervalRow, Intervals, LEAST_LETTERS_PT, Matrix, MatrixCell, MatrixLabel, PlottedEstimate,
    PrintedFigure, Steps, TimeCourse, Trend, TrendLine, TrendPoint,
};
use protocol::{Event, RobotName};
use roxmltree::{Document, Node};
use serde_json::Value;
use timeline::{StateKind, StateOrder, Timeline};

fn estimate(value: f64) -> PlottedEstimate {
    PlottedEstimate {
        value,
        interval: Some((value - 1.0, value + 2.0)),
        n: 3,
        is_filled: true,
    }
}

/// A chart of each kind.
fn charts() -> Vec<Chart> {
    let bands = Bands {
        title: "emotions".to_owned(),
        kind: StateKind::Emotion,
        end_s: 10.0,
        rows: vec![BandRow {
            label: "Butler".to_owned(),
            bands: vec![Band {
                name: "HAPPY".to_owned(),
                begin_s: 0.0,
                end_s: 10.0,
            }],
        }],
        names: StateOrder::default(),
    };
    let course = TimeCourse {
        title: "treats".to_owned(),
        axis: "treats".to_owned(),
        end_s: 10.0,
        rows: vec!["Butler".to_owned()],
        range: (0.0, 30.0),
        lines: vec![CourseLine {
            label: "Butler".to_owned(),
            arm: 0,
            values: vec![(0.0, Some(30.0)), (4.0, None), (5.0, Some(2.0))],
        }],
    };
    let floor = Floor {
        title: "floor".to_owned(),
        field_m: [10.0, 5.0],
        body_m: 0.6,
        obstacles: vec![[1.0, 1.0]],
        part_m: 0.2,
        times_s: BTreeMap::from([((3, 4), 2.5)]),
    };
    let intervals = Intervals {
        title: "served".to_owned(),
        axis: "served minus \"emotions\", a − b".to_owned(),
        range: (-4.0, 4.0),
        reference: Some(0.0),
        rows: vec![IntervalRow {
            label: "rules".to_owned(),
            arm: 1,
            estimate: Some(estimate(1.0)),
            runs: vec![0.5, 1.5],
        }],
    };
    let label = |text: &str| MatrixLabel::from(text);
    let matrix = Matrix {
        title: "transitions".to_owned(),
        rows_title: "from".to_owned(),
        columns_title: "to".to_owned(),
        rows: vec![label("HAPPY"), label("ANGRY")],
        columns: vec![label("HAPPY"), label("ANGRY")],
        cells: vec![
            vec![
                None,
                Some(MatrixCell {
                    share: 1.0,
                    text: "3".to_owned(),
                    remark: "100 %".to_owned(),
                }),
            ],
            vec![None, None],
        ],
    };
    let steps = Steps {
        title: "survival".to_owned(),
        x_axis: "time, s".to_owned(),
        y_axis: "share".to_owned(),
        range: (0.0, 10.0),
        at_risk: Some(vec![0.0, 5.0]),
        curves: vec![Curve {
            label: "rules".to_owned(),
            arm: 1,
            begin: 1.0,
            steps: vec![CurveStep {
                x: 4.0,
                y: 0.5,
                band: Some((0.2, 0.8)),
            }],
            end: 10.0,
            censored: vec![6.0],
            at_risk: vec![2, 1],
        }],
    };
    let trend = Trend {
        title: "served over loss".to_owned(),
        x_axis: "loss".to_owned(),
        y_axis: "served".to_owned(),
        levels: vec![(0.0, "0".to_owned()), (1.0, "1".to_owned())],
        range: (0.0, 10.0),
        reference: None,
        lines: vec![TrendLine {
            label: "rules".to_owned(),
            arm: 1,
            points: vec![TrendPoint {
                x: 0.0,
                estimate: estimate(4.0),
                runs: vec![3.0, 5.0],
            }],
        }],
    };
    vec![
        Chart::Bands(bands),
        Chart::Course(course),
        Chart::Floor(floor),
        Chart::Intervals(intervals),
        Chart::Matrix(matrix),
        Chart::Steps(steps),
        Chart::Trend(trend),
        Chart::Diagram(Box::new(diagram())),
    ]
}

fn diagram() -> Diagram {
    let options = DiagramOptions {
        has_legend: false,
        has_style: false,
        width: Some((720.0, 20)),
        ..DiagramOptions::default()
    };
    let mut diagram = Diagram::new(Timeline::default(), 0.5, 0, options);
    let robots: [RobotName; 2] = ["Butler", "Leguin"].map(|name| name.parse().unwrap());
    let mut events = Vec::new();
    for robot in &robots {
        events.push(Event::Emotion {
            robot: robot.clone(),
            from: None,
            to: "HAPPY".to_owned(),
        });
    }
    diagram.tick(0, &events, &[]);
    diagram.tick(20, &[], &[]);
    diagram
}

fn printed(chart: Chart, width_mm: Option<f64>) -> PrintedFigure {
    let panels = match chart {
        Chart::Diagram(diagram) => ChartPanel::diagram(vec![*diagram]),
        chart => vec![ChartPanel::new("a panel, named", chart)],
    };
    let figure = Figure::new(panels, "What it shows.", None);
    figure.print("figure-1", width_mm).unwrap()
}

#[test]
fn every_figure_has_the_width_of_a_column_and_letters_that_can_be_read() {
    for width_mm in [None, Some(86.0), Some(120.0), Some(400.0)] {
        for chart in charts() {
            let kind = format!("{chart:?}");
            let figure = printed(chart, width_mm);
            let document = Document::parse(&figure.pictures[0].svg).unwrap();
            let root = document.root_element();
            let width = root.attribute("width").unwrap().strip_suffix("mm").unwrap();
            let width: f64 = width.parse().unwrap();
            assert!((width - figure.width_mm).abs() < 0.01);
            if width_mm.is_none() {
                assert!([88.0, 180.0].contains(&width), "{kind}");
            }

            let view: Vec<f64> = root
                .attribute("viewBox")
                .unwrap()
                .split(' ')
                .map(|one| one.parse().unwrap())
                .collect();
            let points_per_px = width / view[2] * 72.0 / 25.4;
            let mut texts = 0;
            for node in document
                .descendants()
                .filter(|node| node.has_tag_name("text"))
            {
                let px: f64 = node.attribute("font-size").unwrap().parse().unwrap();
                assert!(px * points_per_px >= LEAST_LETTERS_PT, "{kind}: {px} px");
                texts += 1;
            }
            assert!(texts > 2, "{kind}");
            assert!(
                !figure.pictures[0].svg.contains("class="),
                "no style sheet is needed"
            );
            let mut children = root.children().filter(Node::is_element);
            assert_eq!(children.nth(1).unwrap().text(), Some("What it shows."));
            assert_eq!(children.next().unwrap().attribute("fill"), Some("#ffffff"));
        }
    }
}

#[test]
fn the_specification_names_columns_of_the_data() {
    for chart in charts() {
        let figure = printed(chart, None);
        let spec: Value = serde_json::from_str(&figure.spec).unwrap();
        assert_eq!(spec["data"]["url"], "figure-1.csv");
        let mut lines = figure.csv.lines();
        let columns: BTreeSet<&str> = lines.next().unwrap().split(',').collect();
        assert!(lines.count() > 0);

        let mut fields = BTreeSet::new();
        add_fields(&spec, &mut fields);
        assert!(fields.len() > 3, "{fields:?}");
        for field in fields {
            assert!(columns.contains(field.as_str()), "{field} of {columns:?}");
        }
    }
}

/// Adds the fields that a specification names.
fn add_fields(value: &Value, fields: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members {
                match member {
                    Value::String(field) if name == "field" => {
                        fields.insert(field.clone());
                    }
                    _ => add_fields(member, fields),
                }
            }
        }
        Value::Array(members) => {
            for member in members {
                add_fields(member, fields);
            }
        }
        _ => {}
    }
}

#[test]
fn a_pdf_finds_its_objects() {
    for chart in charts() {
        let figure = printed(chart, None);
        let pdf = String::from_utf8(figure.pictures[0].pdf.clone()).unwrap();
        assert!(pdf.starts_with("%PDF-1.4\n"));
        let (_, end) = pdf.rsplit_once("startxref\n").unwrap();
        let table: usize = end.lines().next().unwrap().parse().unwrap();
        let mut lines = pdf[table..].lines();
        assert_eq!(lines.next(), Some("xref"));
        let count: usize = lines.next().unwrap()[2..].parse().unwrap();
        for number in 1..count {
            let place: usize = lines.nth(usize::from(number == 1)).unwrap()[..10]
                .parse()
                .unwrap();
            assert!(
                pdf[place..].starts_with(&format!("{number} 0 obj\n")),
                "{number}"
            );
        }
        // Of the stream, its length.
        let (head, content) = pdf.split_once("stream\n").unwrap();
        let length = head
            .rsplit_once("/Length ")
            .unwrap()
            .1
            .split(' ')
            .next()
            .unwrap();
        let content = content.split_once("endstream").unwrap().0;
        assert_eq!(content.len(), length.parse::<usize>().unwrap());
    }
}

#[test]
fn a_figure_that_is_higher_than_a_page_is_several_pictures() {
    let lines: Vec<Diagram> = (0..12).map(|_| diagram()).collect();
    let figure = Figure::new(ChartPanel::diagram(lines), "", None);
    let printed = figure.print("figure-1", None).unwrap();
    assert!(printed.pictures.len() > 1);
    let heights = printed.pictures.iter().map(|picture| {
        let document = Document::parse(&picture.svg).unwrap();
        let height = document.root_element().attribute("height").unwrap();
        height.strip_suffix("mm").unwrap().parse::<f64>().unwrap()
    });
    assert!(heights.into_iter().all(|mm| mm < 240.0));
    // The last one has the legend of all.
    assert!(printed.pictures.last().unwrap().svg.contains(">emotion<"));
}
