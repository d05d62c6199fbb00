//! The shapes of a picture, read from its SVG: what is printed is what the page shows.

use roxmltree::{Document, Node};

use crate::print::sheet::{Paint, Sheet};

/// A piece of a path, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Segment {
    Move(f64, f64),
    Line(f64, f64),
    /// Two handles and the end.
    Curve([f64; 6]),
    Close,
}

/// A text with one anchor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PrintedText {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Which part of its width is before its place: 0 begins there, 1 ends there.
    pub(crate) before: f64,
    pub(crate) is_upward: bool,
    /// Parts with paints of their own.
    pub(crate) runs: Vec<(Paint, String)>,
}

/// A shape.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum PrintedShape {
    Path(Vec<Segment>, Paint),
    Text(PrintedText),
}

impl PrintedShape {
    /// A rectangle.
    pub(crate) fn rect(x: f64, y: f64, width: f64, height: f64, paint: Paint) -> Self {
        let (right, bottom) = (x + width, y + height);
        let corners = [(right, y), (right, bottom), (x, bottom)];
        let mut path = vec![Segment::Move(x, y)];
        path.extend(corners.map(|(x, y)| Segment::Line(x, y)));
        path.push(Segment::Close);
        Self::Path(path, paint)
    }
}

/// The shapes of a picture of this crate, moved by so many pixels. What is not such a picture has none.
pub(crate) fn shapes(svg: &str, sheet: &Sheet, (dx, dy): (f64, f64)) -> Vec<PrintedShape> {
    let mut shapes = Vec::new();
    if let Ok(document) = Document::parse(svg) {
        let root = document.root_element();
        add(root, sheet, &Paint::default(), &mut shapes);
    }
    for shape in &mut shapes {
        shape.move_by(dx, dy);
    }
    shapes
}

/// Adds the shapes of an element and of those in it.
fn add(element: Node<'_, '_>, sheet: &Sheet, parent: &Paint, shapes: &mut Vec<PrintedShape>) {
    let paint = sheet.paint(element, parent);
    let at = |name: &str| -> f64 {
        let value = element.attribute(name).and_then(|value| value.parse().ok());
        value.unwrap_or(0.0)
    };

    match element.tag_name().name() {
        "path" => {
            let data = element.attribute("d").unwrap_or_default();
            shapes.push(PrintedShape::Path(segments(data), paint));
        }
        "rect" => {
            let (width, height) = (at("width"), at("height"));
            shapes.push(PrintedShape::rect(at("x"), at("y"), width, height, paint));
        }
        "circle" => {
            let (x, y, r) = (at("cx"), at("cy"), at("r"));
            let around = format!(
                "M{} {y}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 -{} 0z",
                x - r,
                2.0 * r,
                2.0 * r
            );
            shapes.push(PrintedShape::Path(segments(&around), paint));
        }
        "text" => shapes.push(PrintedShape::Text(text(element, sheet, &paint))),
        "svg" | "g" => {
            for child in element.children().filter(Node::is_element) {
                add(child, sheet, &paint, shapes);
            }
        }
        _ => {}
    }
}

fn text(element: Node<'_, '_>, sheet: &Sheet, paint: &Paint) -> PrintedText {
    let mut runs = Vec::new();
    for child in element.children() {
        let of_child = match child.is_element() {
            true => sheet.paint(child, paint),
            false => paint.clone(),
        };
        let words = child
            .descendants()
            .filter_map(|node| node.text().filter(|_| node.is_text()));
        let words: String = words.collect();
        // SVG has no line breaks in texts.
        runs.push((of_child, words.replace('\n', " ")));
    }

    // Text that runs upward has its place in its transformation: `translate(X Y) rotate(-90)`.
    let upward = element.attribute("transform").and_then(|transform| {
        let place = transform.strip_prefix("translate(")?.split(')').next()?;
        let (x, y) = place.split_once(' ')?;
        Some((x.parse().ok()?, y.parse().ok()?))
    });
    let at = |name: &str| element.attribute(name).and_then(|value| value.parse().ok());
    let place = (at("x").unwrap_or(0.0), at("y").unwrap_or(0.0));
    let (x, y) = upward.unwrap_or(place);
    PrintedText {
        x,
        y,
        before: match element.attribute("text-anchor") {
            Some("middle") => 0.5,
            Some("end") => 1.0,
            _ => 0.0,
        },
        is_upward: upward.is_some(),
        runs,
    }
}

impl PrintedShape {
    fn move_by(&mut self, dx: f64, dy: f64) {
        match self {
            Self::Text(text) => {
                text.x += dx;
                text.y += dy;
            }
            Self::Path(path, _) => {
                for segment in path {
                    *segment = match *segment {
                        Segment::Move(x, y) => Segment::Move(x + dx, y + dy),
                        Segment::Line(x, y) => Segment::Line(x + dx, y + dy),
                        Segment::Curve([a, b, c, d, x, y]) => {
                            Segment::Curve([a + dx, b + dy, c + dx, d + dy, x + dx, y + dy])
                        }
                        Segment::Close => Segment::Close,
                    };
                }
            }
        }
    }
}

/// The segments of a path as this crate writes it: lines, and half circles.
fn segments(data: &str) -> Vec<Segment> {
    let mut path = Vec::new();
    let mut start = (0.0, 0.0);
    let (mut x, mut y) = start;
    let mut rest = data;
    while let Some(command) = rest.chars().next() {
        let body = &rest[command.len_utf8()..];
        let end = body
            .find(|c: char| c.is_ascii_alphabetic())
            .unwrap_or(body.len());
        let numbers = body[..end].split_whitespace();
        let numbers: Vec<f64> = numbers.filter_map(|number| number.parse().ok()).collect();
        rest = &body[end..];

        let (from_x, from_y) = (x, y);
        match (command, &numbers[..]) {
            ('M', [to_x, to_y]) | ('L', [to_x, to_y]) => (x, y) = (*to_x, *to_y),
            ('l', [dx, dy]) => (x, y) = (x + dx, y + dy),
            ('H', [to]) => x = *to,
            ('h', [by]) => x += by,
            ('V', [to]) => y = *to,
            ('v', [by]) => y += by,
            ('a', [.., dx, dy]) => (x, y) = (x + dx, y + dy),
            _ => {}
        }
        match command {
            'M' => {
                start = (x, y);
                path.push(Segment::Move(x, y));
            }
            'z' => {
                (x, y) = start;
                path.push(Segment::Close);
            }
            'a' => path.extend(half_circle((from_x, from_y), (x, y))),
            _ => path.push(Segment::Line(x, y)),
        }
    }
    path
}

/// A half circle between two points, counterclockwise on the screen, as two curves.
fn half_circle(from: (f64, f64), to: (f64, f64)) -> [Segment; 2] {
    /// Length of the handles of a quarter of a circle with radius 1.
    const HANDLE: f64 = 0.5523;
    let center = (f64::midpoint(from.0, to.0), f64::midpoint(from.1, to.1));
    // From the center to the beginning, and the same turned by a quarter.
    let (out_x, out_y) = (from.0 - center.0, from.1 - center.1);
    let (side_x, side_y) = (out_y, -out_x);
    let at = |out: f64, side: f64| {
        let x = center.0 + out * out_x + side * side_x;
        let y = center.1 + out * out_y + side * side_y;
        [x, y]
    };
    let curve = |points: [[f64; 2]; 3]| {
        let [[a, b], [c, d], [x, y]] = points;
        Segment::Curve([a, b, c, d, x, y])
    };
    [
        curve([at(1.0, HANDLE), at(HANDLE, 1.0), at(0.0, 1.0)]),
        curve([at(-HANDLE, 1.0), at(-1.0, HANDLE), at(-1.0, 0.0)]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_read_as_they_are_written() {
        use Segment::{Close, Line, Move};
        let path = segments("M1 2.5H4V-3h2v1l-1 -1L0 0z");
        let expected = [
            Move(1.0, 2.5),
            Line(4.0, 2.5),
            Line(4.0, -3.0),
            Line(6.0, -3.0),
            Line(6.0, -2.0),
            Line(5.0, -3.0),
            Line(0.0, 0.0),
            Close,
        ];
        assert_eq!(path, expected);
    }

    #[test]
    fn a_circle_ends_where_it_began() {
        let path = segments("M6 10a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z");
        assert_eq!(path.len(), 6);
        let Segment::Curve([.., x, y]) = path[4] else {
            panic!("{path:?}");
        };
        assert!((x - 6.0).abs() < 1e-9 && (y - 10.0).abs() < 1e-9);
        // The first half is below, as an arc with this flag is on a screen.
        let Segment::Curve([.., y]) = path[1] else {
            panic!("{path:?}");
        };
        assert!((y - 14.0).abs() < 1e-9, "{path:?}");
    }
}
