//! Printed figures: sizes, letters, files that can be read, and specifications that fit their data.

use std::collections::{BTreeMap, BTreeSet};

use miniz_oxide::inflate::decompress_to_vec_zlib;
use pictures::diagram::{Diagram, DiagramOptions};
use pictures::{
    Band, BandRow, Bands, Chart, ChartPanel, CourseLine, Curve, CurveStep, Figure, Floor,
    IntervalRow, Intervals, MIN_LETTERS_PT, Matrix, MatrixCell, MatrixLabel, PlottedEstimate,
    PrintedFigure, Steps, TimeCourse, Trend, TrendLine, TrendPoint, width_px,
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
        static_world: Default::default(),
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
                assert!(px * points_per_px >= MIN_LETTERS_PT, "{kind}: {px} px");
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

/// A PDF as its readers see it: its objects by the table of their places.
struct PdfFile {
    /// Text before a stream, or all of an object.
    objects: BTreeMap<usize, String>,
    streams: BTreeMap<usize, Vec<u8>>,
}

impl PdfFile {
    fn read(file: &[u8]) -> Self {
        let find = |from: usize, what: &str| {
            let mut windows = file[from..].windows(what.len());
            from + windows.position(|one| one == what.as_bytes()).unwrap()
        };
        let text = |from: usize, to: usize| String::from_utf8_lossy(&file[from..to]).into_owned();
        assert!(file.starts_with(b"%PDF-1.4\n"));
        assert!(file[10..14].iter().all(|byte| *byte > 127), "it is binary");
        let end = text(file.len() - 40, file.len());
        let (_, end) = end.rsplit_once("startxref\n").unwrap();
        let table: usize = end.lines().next().unwrap().parse().unwrap();
        let table = text(table, file.len());
        let mut lines = table.lines();
        assert_eq!(lines.next(), Some("xref"));
        let count: usize = lines.next().unwrap()[2..].parse().unwrap();

        let mut objects = BTreeMap::new();
        let mut streams = BTreeMap::new();
        for (number, line) in lines.take(count).enumerate().skip(1) {
            let begin: usize = line[..10].parse().unwrap();
            let head = format!("{number} 0 obj\n");
            assert!(file[begin..].starts_with(head.as_bytes()), "{number}");
            let mut end = find(begin, "\nendobj\n");
            if let Some((before, _)) = text(begin, end).split_once("\nstream\n") {
                let from = begin + before.len() + "\nstream\n".len();
                let to = from + number_after(before, "/Length ") as usize;
                assert!(file[to..].starts_with(b"\nendstream\nendobj\n"), "{number}");
                streams.insert(number, file[from..to].to_vec());
                end = begin + before.len();
            }
            objects.insert(number, text(begin + head.len(), end));
        }
        Self { objects, streams }
    }

    /// The number of the object that the first one after a name refers to.
    fn reference(&self, object: usize, name: &str) -> usize {
        number_after(&self.objects[&object], name) as usize
    }

    fn content(&self) -> String {
        let contents = self.reference(3, "/Contents ");
        String::from_utf8(self.streams[&contents].clone()).unwrap()
    }

    /// The fonts of the page by their names: object, widths by code, and letters by code.
    fn fonts(&self) -> BTreeMap<String, PdfFont> {
        let (_, fonts) = self.objects[&3].split_once("/Font << ").unwrap();
        let fonts = fonts.split_once(" >>").unwrap().0;
        let words: Vec<&str> = fonts.split(' ').collect();
        let fonts = words.chunks(4).map(|font| {
            let object = font[1].parse().unwrap();
            let map = &self.streams[&self.reference(object, "/ToUnicode ")];
            let font_of = PdfFont {
                object,
                widths: widths(&self.objects[&object]),
                letters: letters(std::str::from_utf8(map).unwrap()),
            };
            (font[0].to_owned(), font_of)
        });
        fonts.collect()
    }

    /// The texts that are filled: where each begins, its letters, and its width.
    fn texts(&self) -> Vec<((f64, f64), String, f64)> {
        let fonts = self.fonts();
        let content = self.content();
        let mut texts = Vec::new();
        for text in content.split("BT ").skip(1) {
            let text = text.split_once("ET ").unwrap().0;
            let Some((matrix, runs)) = text.split_once(" Tm 0 Tr ") else {
                continue;
            };
            let matrix: Vec<f64> = matrix.split(' ').map(|one| one.parse().unwrap()).collect();
            let mut words = String::new();
            let mut width = 0.0;
            let mut font = ("", 0.0);
            let tokens: Vec<&str> = runs.split_whitespace().collect();
            for (index, token) in tokens.iter().enumerate() {
                match *token {
                    "Tf" => font = (tokens[index - 2], tokens[index - 1].parse().unwrap()),
                    "Tj" => {
                        let font_of = &fonts[font.0];
                        for pair in tokens[index - 1]
                            .trim_matches(['<', '>'])
                            .as_bytes()
                            .chunks(2)
                        {
                            let code = hex(std::str::from_utf8(pair).unwrap());
                            words.push(font_of.letters[&code]);
                            width += f64::from(font_of.widths[&code]) / 1000.0 * font.1;
                        }
                    }
                    _ => {}
                }
            }
            texts.push(((matrix[4], matrix[5]), words, width));
        }
        texts
    }
}

struct PdfFont {
    object: usize,
    /// Thousandths of its size.
    widths: BTreeMap<u32, u16>,
    letters: BTreeMap<u32, char>,
}

fn number_after(text: &str, name: &str) -> f64 {
    let (_, rest) = text
        .split_once(name)
        .unwrap_or_else(|| panic!("no {name}in {text}"));
    let end = rest.find([' ', '\n', ']']).unwrap_or(rest.len());
    rest[..end].parse().unwrap()
}

fn hex(digits: &str) -> u32 {
    u32::from_str_radix(digits, 16).unwrap()
}

fn widths(font: &str) -> BTreeMap<u32, u16> {
    let (_, list) = font.split_once("/Widths [").unwrap();
    let list = list.split_once(']').unwrap().0.split(' ');
    let widths: BTreeMap<u32, u16> = (number_after(font, "/FirstChar ") as u32..)
        .zip(list.map(|width| width.parse().unwrap()))
        .collect();
    assert_eq!(
        widths.keys().last().copied(),
        Some(number_after(font, "/LastChar ") as u32)
    );
    widths
}

/// The letters of codes, by a ToUnicode map.
fn letters(map: &str) -> BTreeMap<u32, char> {
    let section = |name: &str| {
        let (_, lines) = map.split_once(&format!("begin{name}\n")).unwrap();
        lines.split_once(&format!("end{name}")).unwrap().0
    };
    let values = |line: &str| -> Vec<u32> {
        let values = line.split(['<', '>']).filter(|one| !one.trim().is_empty());
        values.map(hex).collect()
    };
    let mut letters = BTreeMap::new();
    for line in section("bfrange").lines() {
        let [first, last, letter] = values(line)[..] else {
            panic!("{line}");
        };
        for code in first..=last {
            letters.insert(code, char::from_u32(letter + code - first).unwrap());
        }
    }
    for line in section("bfchar").lines() {
        let [code, letter] = values(line)[..] else {
            panic!("{line}");
        };
        letters.insert(code, char::from_u32(letter).unwrap());
    }
    letters
}

/// The widths of a TrueType font by code, thousandths of its size: those of a symbolic font, whose codes begin at 0xF000.
fn widths_of_file(file: &[u8]) -> BTreeMap<u32, u16> {
    let short = |at: usize| u16::from_be_bytes([file[at], file[at + 1]]);
    let long = |at: usize| usize::from(short(at)) << 16 | usize::from(short(at + 2));
    let table = |name: &str| {
        let mut entries = (0..usize::from(short(4))).map(|index| 12 + 16 * index);
        let entry = entries.find(|at| &file[*at..*at + 4] == name.as_bytes());
        long(entry.unwrap_or_else(|| panic!("no table {name}")) + 8)
    };
    let em = u32::from(short(table("head") + 18));
    let metrics = usize::from(short(table("hhea") + 34));
    let map = table("cmap");
    assert_eq!((short(map + 2), short(map + 4), short(map + 6)), (1, 3, 0));
    let map = map + long(map + 8);
    assert_eq!(short(map), 4);

    let segments = usize::from(short(map + 6)) / 2;
    let mut widths = BTreeMap::new();
    for segment in 0..segments - 1 {
        let field = |index: usize| {
            map + 14 + 2 * (segment + segments * index) + if index > 0 { 2 } else { 0 }
        };
        for code in short(field(1))..=short(field(0)) {
            let offset = short(field(3));
            let glyph = match offset {
                0 => code.wrapping_add(short(field(2))),
                _ => {
                    short(field(3) + usize::from(offset) + 2 * usize::from(code - short(field(1))))
                }
            };
            assert!(glyph > 0, "{code:x}");
            let advance = short(table("hmtx") + 4 * usize::from(glyph).min(metrics - 1));
            let width = (u32::from(advance) * 1000 + em / 2) / em;
            widths.insert(u32::from(code) - 0xf000, width as u16);
        }
    }
    widths
}

#[test]
fn every_font_of_a_pdf_is_embedded_with_its_widths_and_letters() {
    let mut embedded = BTreeSet::new();
    for chart in charts() {
        let picture = printed(chart, None).pictures.remove(0);
        let pdf = PdfFile::read(&picture.pdf);
        let content = pdf.content();
        let tokens: Vec<&str> = content.split_whitespace().collect();
        let used = tokens.windows(3).filter(|three| three[2] == "Tf");
        let used: BTreeSet<&str> = used.map(|three| three[0]).collect();
        let fonts = pdf.fonts();
        assert!(
            fonts.keys().map(String::as_str).eq(used),
            "as many as are used"
        );

        for font in fonts.values() {
            let text = &pdf.objects[&font.object];
            assert!(text.contains("/Subtype /TrueType"), "{text}");
            let descriptor = pdf.reference(font.object, "/FontDescriptor ");
            let file = pdf.reference(descriptor, "/FontFile2 ");
            assert!(pdf.objects[&file].contains("/Filter /FlateDecode"));
            let font_file = decompress_to_vec_zlib(&pdf.streams[&file]).unwrap();
            let length = number_after(&pdf.objects[&file], "/Length1 ");
            assert_eq!(font_file.len(), length as usize);

            assert_eq!(font.widths, widths_of_file(&font_file));
            assert!(font.widths.keys().eq(font.letters.keys()));
            // The tag of a subset, and a name of its own.
            let (_, name) = text.split_once("/BaseFont /").unwrap();
            let name = name.split(' ').next().unwrap();
            assert_eq!(name.find('+'), Some(6), "{name}");
            assert!(pdf.objects[&descriptor].contains(&format!("/FontName /{name} ")));
            embedded.insert(name.to_owned());
        }
    }
    assert_eq!(embedded.len(), 2, "{embedded:?}");
}

#[test]
fn texts_of_a_pdf_are_those_of_the_svg_and_where_they_are() {
    let mut anchors = BTreeSet::new();
    for chart in charts() {
        let picture = printed(chart, None).pictures.remove(0);
        let document = Document::parse(&picture.svg).unwrap();
        let texts = PdfFile::read(&picture.pdf).texts();
        let nodes = document
            .descendants()
            .filter(|node| node.has_tag_name("text"));
        let nodes: Vec<Node<'_, '_>> = nodes.collect();
        assert_eq!(nodes.len(), texts.len());
        for (node, ((x, y), words, width)) in nodes.into_iter().zip(texts) {
            let expected: String = node
                .descendants()
                .filter_map(|one| one.text().filter(|_| one.is_text()))
                .collect();
            assert_eq!(words, expected);
            let anchor = node.attribute("text-anchor").unwrap_or("start");
            let before = match anchor {
                "middle" => width / 2.0,
                "end" => width,
                _ => 0.0,
            };
            if let Some(place) = node.attribute("x") {
                let place: f64 = place.parse().unwrap();
                assert!(
                    (place - before - x).abs() < 0.02,
                    "{words}: {place} - {before}, {x}"
                );
            } else {
                let transform = node.attribute("transform").unwrap();
                let place: f64 = transform.split([' ', ')']).nth(1).unwrap().parse().unwrap();
                assert!(
                    (place + before - y).abs() < 0.02,
                    "{words}: {place} + {before}, {y}"
                );
            }
            anchors.insert(anchor.to_owned());

            // The charts leave place for so much, with distances that are more than what a word of capitals is wider.
            let font_px: f64 = node.attribute("font-size").unwrap().parse().unwrap();
            assert!(
                width <= 1.03 * width_px(&words, font_px),
                "{words}: {width}"
            );
        }
    }
    assert_eq!(anchors.len(), 3, "{anchors:?}");
}

#[test]
fn letters_that_the_fonts_lack_are_question_marks_in_a_pdf() {
    let label = "Čapek Ω é € → ≈ \u{a0}漢 “×−∞”";
    let trend = Trend {
        title: String::new(),
        x_axis: label.to_owned(),
        y_axis: "served".to_owned(),
        levels: vec![(0.0, "0".to_owned()), (1.0, "1".to_owned())],
        range: (0.0, 10.0),
        reference: None,
        lines: Vec::new(),
    };
    let picture = printed(Chart::Trend(trend), None).pictures.remove(0);
    assert!(picture.svg.contains(label), "an SVG has them");
    let texts = PdfFile::read(&picture.pdf).texts();
    let words: Vec<String> = texts.into_iter().map(|(_, words, _)| words).collect();
    let expected = "?apek ? é € → ? \u{a0}? “×−∞”".to_owned();
    assert!(words.contains(&expected), "{words:?}");
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
