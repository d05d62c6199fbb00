//! Floor plans: an SVG drawing of rectangles, circles and straight lines, read as obstacles and walls.
//!
//! In a drawing y points down, in a hall up: the lower edge of the drawing is the lower edge of the hall. What a drawing cannot
//! mean as a floor plan is refused with its place in the file, and never left out in silence, but texts and what is not drawn.

use std::ops::Range;

use config::{FileError, Source};
use roxmltree::{Document, Node, ParsingOptions};
use world::{BODY_MIN_M, Point, Shape, WALLS_MAX, Wall};

/// Longest drawing, bytes.
pub const MAX_BYTES: usize = 4 << 20;
/// Most nodes of a drawing: elements, texts, comments.
const MAX_NODES: u32 = 200_000;
/// Deepest nesting of groups.
const MAX_DEPTH: usize = 64;

/// What a drawing has on it, in meters of the hall.
#[derive(Debug, Default, PartialEq)]
pub struct FloorPlan {
    /// Filled rectangles, and circles.
    pub obstacles: Vec<(Point, Shape)>,
    /// Lines, and the outlines of everything else.
    pub walls: Vec<Wall>,
}

/// How a drawing lies in a hall.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    /// Length of a unit of the drawing, meters; without it, what the drawing says itself.
    pub scale_m: Option<f64>,
    /// Where its lower left corner is, meters.
    pub at: Point,
}

/// Reads a drawing.
///
/// # Errors
/// [`FileError`] with line and caret.
pub fn read(source: &Source, placement: Placement) -> Result<FloorPlan, FileError> {
    if source.text.len() > MAX_BYTES {
        let reason = format!("a floor plan of more than {MAX_BYTES} bytes");
        return Err(FileError::at(source, None, &reason));
    }

    let options = ParsingOptions {
        nodes_limit: MAX_NODES,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&source.text, options)
        .map_err(|error| not_xml(source, &error))?;
    let root = document.root_element();
    let refuse = |error: RefusedElement| {
        let RefusedElement(range, reason) = error;
        FileError::at(source, Some(range), &reason)
    };
    let page = Drawing::of(root, placement).map_err(refuse)?;
    root.descendants()
        .try_for_each(check_sheet)
        .map_err(refuse)?;

    let mut plan = FloorPlan::default();
    let mut open = vec![(root, DrawnSolids::default())];
    while let Some((node, drawn)) = open.pop() {
        // Backward, so that the first one is taken next: walls and obstacles are in the order of the drawing.
        let children: Vec<_> = node.children().filter(Node::is_element).collect();
        for child in children.into_iter().rev() {
            if let Some(drawn) = drawn.within(child).map_err(refuse)? {
                open.push((child, drawn));
            }
        }
        if node != root {
            plan.add(node, drawn, &page).map_err(refuse)?;
        }
        if plan.walls.len() > WALLS_MAX || plan.obstacles.len() > WALLS_MAX {
            let reason = format!("more than {WALLS_MAX} walls or bodies");
            return Err(refuse(RefusedElement::at(node, reason)));
        }
    }
    Ok(plan)
}

fn not_xml(source: &Source, error: &roxmltree::Error) -> FileError {
    let at = error.pos();
    let lines = source.text.split_inclusive('\n');
    let before: usize = lines
        .take(at.row.saturating_sub(1) as usize)
        .map(str::len)
        .sum();
    let offset = (before + at.col.saturating_sub(1) as usize).min(source.text.len());
    FileError::at(
        source,
        Some(offset..offset),
        &format!("not an SVG drawing: {error}"),
    )
}

/// Why an element is refused, and where it is.
struct RefusedElement(Range<usize>, String);

impl RefusedElement {
    fn at(node: Node<'_, '_>, reason: String) -> Self {
        let document = node.document();
        let name = node.tag_name().name();
        let same = document
            .descendants()
            .filter(|other| other.is_element() && other.tag_name().name() == name);
        let number = same.take_while(|other| *other != node).count();
        let tag = tags(document.input_text())
            .filter(|(_, tag)| *tag == name)
            .nth(number);
        let (at, _) = tag.unwrap_or((0, ""));
        Self(at..at + name.len(), reason)
    }
}

/// The names of all start tags of a text, each with where it begins, without what is in comments.
fn tags(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            at += text[at..].find('<')?;
            let rest = &text[at..];
            if rest.starts_with("<!--") || rest.starts_with("<![CDATA[") {
                let end = if rest.starts_with("<!--") {
                    "-->"
                } else {
                    "]]>"
                };
                at += rest.find(end)?;
                continue;
            }

            at += 1;
            let name = &text[at..];
            let is_end = |c: char| c.is_whitespace() || matches!(c, '/' | '>');
            let name = &name[..name.find(is_end)?];
            if name.is_empty() || name.starts_with(['!', '?']) {
                continue;
            }
            let local = name.rsplit(':').next().unwrap_or(name);
            return Some((at + name.len() - local.len(), local));
        }
    })
}

/// Properties that decide what a drawing means as a floor plan.
const PROPERTIES: [&str; 4] = ["display", "fill", "transform", "visibility"];

/// Refuses a style sheet that would change what a drawing means: it is not applied.
fn check_sheet(node: Node<'_, '_>) -> Result<(), RefusedElement> {
    if node.tag_name().name() != "style" {
        return Ok(());
    }

    let texts: String = node.children().filter_map(|child| child.text()).collect();
    let is_end = |c: char| !c.is_ascii_alphanumeric() && c != '-';
    let mut words = texts.split(is_end);
    match words.find(|word| PROPERTIES.contains(word)) {
        None => Ok(()),
        Some(word) => {
            let reason = format!(
                "a style sheet with {word} cannot be read: write {word} as an attribute of each element"
            );
            Err(RefusedElement::at(node, reason))
        }
    }
}

/// The drawing's coordinates.
struct Drawing {
    /// Its left and lower edge.
    origin: (f64, f64),
    unit_m: f64,
    at: Point,
}

impl Drawing {
    fn of(root: Node<'_, '_>, placement: Placement) -> Result<Self, RefusedElement> {
        if root.tag_name().name() != "svg" {
            let reason = format!("<{}> is not an SVG drawing", root.tag_name().name());
            return Err(RefusedElement::at(root, reason));
        }

        let view_box = root.attribute("viewBox").map(numbers);
        let [left, top, width, height] = match view_box {
            Some(Some(list)) if list.len() == 4 => [list[0], list[1], list[2], list[3]],
            Some(_) => {
                return Err(RefusedElement::at(
                    root,
                    "viewBox is not four numbers".to_owned(),
                ));
            }
            None => {
                let side = |name| root.attribute(name).and_then(|text| text.parse().ok());
                match (side("width"), side("height")) {
                    (Some(width), Some(height)) => [0.0, 0.0, width, height],
                    _ => {
                        let reason = "a floor plan needs a viewBox, which says where it ends";
                        return Err(RefusedElement::at(root, reason.to_owned()));
                    }
                }
            }
        };

        let physical_m = root.attribute("width").and_then(length_m);
        let own_m = physical_m.map(|width_m| width_m / width);
        let unit_m = placement.scale_m.or(own_m).unwrap_or(1.0);
        if !(unit_m > 0.0 && unit_m.is_finite() && width > 0.0 && height > 0.0) {
            let reason = "the width, the height and the scale of a floor plan are more than zero";
            return Err(RefusedElement::at(root, reason.to_owned()));
        }

        Ok(Self {
            origin: (left, top + height),
            unit_m,
            at: placement.at,
        })
    }

    /// A point of the drawing in the hall.
    fn place(&self, drawn: DrawnSolids, x: f64, y: f64) -> Point {
        let x = x * drawn.scale.0 + drawn.shift.0;
        let y = y * drawn.scale.1 + drawn.shift.1;
        let offset = Point::new(x - self.origin.0, self.origin.1 - y);
        self.at + offset * self.unit_m
    }
}

/// What holds for an element and all that is in it.
#[derive(Debug, Clone, Copy)]
struct DrawnSolids {
    scale: (f64, f64),
    shift: (f64, f64),
    is_filled: bool,
    depth: usize,
}

impl Default for DrawnSolids {
    fn default() -> Self {
        Self {
            scale: (1.0, 1.0),
            shift: (0.0, 0.0),
            is_filled: true,
            depth: 0,
        }
    }
}

impl DrawnSolids {
    /// What holds for an element in this one; `None` if it is not drawn, or is a text.
    fn within(self, node: Node<'_, '_>) -> Result<Option<Self>, RefusedElement> {
        let is_svg = matches!(
            node.tag_name().namespace(),
            None | Some("http://www.w3.org/2000/svg")
        );
        let is_left_out = matches!(
            node.tag_name().name(),
            "title" | "desc" | "metadata" | "defs" | "style" | "text"
        );
        let is_hidden = property(node, "display") == Some("none")
            || matches!(property(node, "visibility"), Some("hidden" | "collapse"));
        if !is_svg || is_left_out || is_hidden {
            return Ok(None);
        }
        if self.depth == MAX_DEPTH {
            let reason = format!("groups in more than {MAX_DEPTH} groups");
            return Err(RefusedElement::at(node, reason));
        }

        let mut drawn = Self {
            depth: self.depth + 1,
            ..self
        };
        if let Some(fill) = property(node, "fill") {
            drawn.is_filled = fill != "none";
        }
        for name in ["transform", "transform-origin"] {
            let of_attribute = node.attribute(name).filter(|_| name == "transform");
            if property(node, name) != of_attribute.map(str::trim) {
                let reason = format!(
                    "{name} is read as the attribute transform only, with the corner of the drawing as its origin"
                );
                return Err(RefusedElement::at(node, reason));
            }
        }
        if let Some(text) = node.attribute("transform") {
            drawn
                .transform(text)
                .map_err(|reason| RefusedElement::at(node, reason))?;
        }
        Ok(Some(drawn))
    }

    /// Applies `translate`, `scale`, and `matrix` without a turn, from the left to the right.
    fn transform(&mut self, text: &str) -> Result<(), String> {
        let mut rest = text.trim_matches(|c: char| c.is_whitespace() || c == ',');
        while !rest.is_empty() {
            let refused = || {
                format!(
                    "transform {text:?}: only translate, scale, and matrix without a turn can be read"
                )
            };
            let (name, after) = rest.split_once('(').ok_or_else(refused)?;
            let (list, after) = after.split_once(')').ok_or_else(refused)?;
            let list = numbers(list).ok_or_else(refused)?;
            let (scale, shift) = match (name.trim(), list.as_slice()) {
                ("translate", [x]) => ((1.0, 1.0), (*x, 0.0)),
                ("translate", [x, y]) => ((1.0, 1.0), (*x, *y)),
                ("scale", [both]) => ((*both, *both), (0.0, 0.0)),
                ("scale", [x, y]) => ((*x, *y), (0.0, 0.0)),
                ("matrix", [a, b, c, d, e, f]) if *b == 0.0 && *c == 0.0 => ((*a, *d), (*e, *f)),
                _ => return Err(refused()),
            };
            self.shift.0 += self.scale.0 * shift.0;
            self.shift.1 += self.scale.1 * shift.1;
            self.scale.0 *= scale.0;
            self.scale.1 *= scale.1;
            rest = after.trim_matches(|c: char| c.is_whitespace() || c == ',');
        }
        Ok(())
    }
}

impl FloorPlan {
    fn add(
        &mut self,
        node: Node<'_, '_>,
        drawn: DrawnSolids,
        page: &Drawing,
    ) -> Result<(), RefusedElement> {
        let name = node.tag_name().name();
        let number = |name: &str| attribute(node, name);
        let size = |name: &str| match attribute(node, name)? {
            size if size >= 0.0 => Ok(size),
            size => {
                let reason = format!("{name} is {size}, less than zero");
                Err(RefusedElement::at(node, reason))
            }
        };
        match name {
            "g" => {}
            "rect" => {
                if number("rx")? != 0.0 || number("ry")? != 0.0 {
                    let reason = "a rectangle with rounded corners cannot be read";
                    return Err(RefusedElement::at(node, reason.to_owned()));
                }
                let (left, top) = (number("x")?, number("y")?);
                let (right, bottom) = (left + size("width")?, top + size("height")?);
                let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
                let corners = corners.map(|(x, y)| page.place(drawn, x, y));
                if drawn.is_filled {
                    let (one, other) = (corners[0], corners[2]);
                    let shape = Shape::Rectangle {
                        width_m: (other.x - one.x).abs(),
                        height_m: (other.y - one.y).abs(),
                    };
                    self.add_obstacle(node, (one + other) * 0.5, shape)?;
                } else {
                    self.add_line(&corners, true);
                }
            }
            "circle" => {
                let is_round = drawn.scale.0.abs() == drawn.scale.1.abs();
                if !drawn.is_filled || !is_round {
                    let reason = "only filled, round circles can be read";
                    return Err(RefusedElement::at(node, reason.to_owned()));
                }
                let at = page.place(drawn, number("cx")?, number("cy")?);
                let radius_m = size("r")? * drawn.scale.0.abs() * page.unit_m;
                self.add_obstacle(node, at, Shape::Disc { radius_m })?;
            }
            "line" => {
                let from = page.place(drawn, number("x1")?, number("y1")?);
                let to = page.place(drawn, number("x2")?, number("y2")?);
                self.add_line(&[from, to], false);
            }
            "polyline" | "polygon" => {
                let text = node.attribute("points").unwrap_or("");
                let list = numbers(text).filter(|list| list.len().is_multiple_of(2));
                let Some(list) = list else {
                    let reason = "points are not pairs of numbers";
                    return Err(RefusedElement::at(node, reason.to_owned()));
                };
                let points = list.chunks_exact(2);
                let points: Vec<_> = points.map(|at| page.place(drawn, at[0], at[1])).collect();
                self.add_line(&points, name == "polygon");
            }
            "path" => {
                let lines = path(node.attribute("d").unwrap_or(""))
                    .map_err(|reason| RefusedElement::at(node, reason))?;
                for (points, is_closed) in lines {
                    let points = points.into_iter();
                    let points: Vec<_> = points.map(|(x, y)| page.place(drawn, x, y)).collect();
                    self.add_line(&points, is_closed);
                }
            }
            _ => {
                let reason = format!(
                    "<{name}> cannot be read as part of a floor plan: use rect, circle, line, polyline, polygon, or path of straight lines"
                );
                return Err(RefusedElement::at(node, reason));
            }
        }
        Ok(())
    }

    /// Adds a body, which is refused here if it is too small: nothing later knows the line of the drawing.
    fn add_obstacle(
        &mut self,
        node: Node<'_, '_>,
        at: Point,
        shape: Shape,
    ) -> Result<(), RefusedElement> {
        let (half_x_m, half_y_m) = shape.half_m();
        let least_m = 2.0 * half_x_m.min(half_y_m);
        if least_m >= BODY_MIN_M {
            self.obstacles.push((at, shape));
            return Ok(());
        }
        let reason = format!(
            "a body of {least_m} m, less than {BODY_MIN_M} m: draw a line, or leave it out"
        );
        Err(RefusedElement::at(node, reason))
    }

    /// Adds walls from point to point. Points closer to the one before than 1 mm are none.
    fn add_line(&mut self, points: &[Point], is_closed: bool) {
        let first = points.first().filter(|_| is_closed);
        let mut points = points.iter().chain(first);
        let Some(mut from) = points.next().copied() else {
            return;
        };
        for &to in points {
            // One that is no number is kept, and refused as off the field.
            let is_same = from.distance_m(to) < BODY_MIN_M;
            if !is_same {
                self.walls.push(Wall { from, to });
                from = to;
            }
        }
    }
}

/// The lines of a path, each with whether it is closed, in the drawing's coordinates.
type Lines = Vec<(Vec<(f64, f64)>, bool)>;

/// Reads a path of straight lines: `M`, `L`, `H`, `V`, `Z`, and their relative forms.
fn path(text: &str) -> Result<Lines, String> {
    let mut lines: Lines = Vec::new();
    let (mut x, mut y) = (0.0, 0.0);
    let mut rest = text.trim();

    while let Some(command) = rest.chars().next() {
        rest = &rest[command.len_utf8()..];
        let end = rest.find(|c: char| c.is_ascii_alphabetic() && !matches!(c, 'e' | 'E'));
        let (list, after) = rest.split_at(end.unwrap_or(rest.len()));
        rest = after;
        let list = numbers(list)
            .ok_or_else(|| format!("a number of the path is not valid: {:?}", list.trim()))?;

        let is_relative = command.is_ascii_lowercase();
        let (base_x, base_y) = if is_relative { (1.0, 1.0) } else { (0.0, 0.0) };
        let size = match command.to_ascii_uppercase() {
            'M' | 'L' => 2,
            'H' | 'V' => 1,
            'Z' => {
                if let Some((points, is_closed)) = lines.last_mut() {
                    *is_closed = true;
                    (x, y) = points.first().copied().unwrap_or((x, y));
                }
                continue;
            }
            _ => {
                return Err(format!(
                    "the command {command} of the path is not a straight line"
                ));
            }
        };
        if list.is_empty() || !list.len().is_multiple_of(size) {
            return Err(format!("the command {command} of the path lacks numbers"));
        }

        for (index, given) in list.chunks_exact(size).enumerate() {
            match command.to_ascii_uppercase() {
                'H' => x = given[0] + base_x * x,
                'V' => y = given[0] + base_y * y,
                _ => (x, y) = (given[0] + base_x * x, given[1] + base_y * y),
            }
            // Pairs after the first one of a move are lines. After Z a line begins where the last one did.
            let is_move = index == 0 && command.eq_ignore_ascii_case(&'m');
            match lines.last_mut() {
                Some((points, false)) if !is_move => points.push((x, y)),
                Some((points, true)) if !is_move => {
                    let start = points.first().copied().unwrap_or((x, y));
                    lines.push((vec![start, (x, y)], false));
                }
                _ => lines.push((vec![(x, y)], false)),
            }
        }
    }
    Ok(lines)
}

/// A presentation property: of the attribute `style`, or an attribute of its own.
fn property<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let style = node.attribute("style").unwrap_or("").split(';');
    let mut of_style = style
        .filter_map(|entry| entry.split_once(':'))
        .filter(|(key, _)| key.trim() == name);
    let last = of_style.next_back().map(|(_, value)| value.trim());
    last.or(node.attribute(name).map(str::trim))
}

/// A number of an attribute; 0 without it.
fn attribute(node: Node<'_, '_>, name: &str) -> Result<f64, RefusedElement> {
    let text = node.attribute(name).unwrap_or("0");
    let number = text
        .trim()
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| {
        let reason = format!("{name} is {text:?}, and not a number in the units of the drawing");
        RefusedElement::at(node, reason)
    })
}

/// A list of numbers, separated by blanks, commas, or the sign of the next one.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let mut spaced = String::with_capacity(text.len());
    let mut before = ' ';
    for c in text.chars() {
        if c == '-' && !matches!(before, 'e' | 'E') {
            spaced.push(' ');
        }
        spaced.push(c);
        before = c;
    }

    let words = spaced.split(|c: char| c.is_whitespace() || c == ',');
    let numbers = words.filter(|word| !word.is_empty()).map(|word| {
        let number: f64 = word.parse().ok()?;
        number.is_finite().then_some(number)
    });
    numbers.collect()
}

/// A length of paper, in meters; `None` for one in units of the screen.
fn length_m(text: &str) -> Option<f64> {
    let text = text.trim();
    let units = [("mm", 0.001), ("cm", 0.01), ("in", 0.0254)];
    let (number, unit_m) = units
        .into_iter()
        .find_map(|(unit, unit_m)| Some((text.strip_suffix(unit)?, unit_m)))?;
    Some(number.trim().parse::<f64>().ok()? * unit_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(drawing: &str) -> Result<FloorPlan, FileError> {
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 10 8'>\n{drawing}\n</svg>"
        );
        of_text(&text, None)
    }

    fn of_text(text: &str, scale_m: Option<f64>) -> Result<FloorPlan, FileError> {
        let source = Source {
            name: "plan.svg".into(),
            text: text.to_owned(),
        };
        let at = Point::default();
        read(&source, Placement { scale_m, at })
    }

    fn walls(plan: &FloorPlan) -> Vec<[f64; 4]> {
        let walls = plan.walls.iter();
        walls
            .map(|wall| [wall.from.x, wall.from.y, wall.to.x, wall.to.y])
            .collect()
    }

    #[test]
    fn shapes_and_lines_are_read_with_y_up() {
        let plan = plan(
            "<title>a room</title><text>kitchen</text>\n\
             <g transform='translate(1,1) scale(2)'><rect x='0' y='0' width='1' height='0.5'/></g>\n\
             <circle cx='5' cy='6' r='0.5'/>\n\
             <line x1='1' y1='8' x2='1' y2='7'/>\n\
             <polyline points='2,2 3,2 3,3'/>\n\
             <path d='M4 4h1v-1zm2,0L7-1e0'/>",
        )
        .unwrap();
        let slab = Shape::Rectangle {
            width_m: 2.0,
            height_m: 1.0,
        };
        let disc = Shape::Disc { radius_m: 0.5 };
        assert_eq!(
            plan.obstacles,
            [(Point::new(2.0, 6.5), slab), (Point::new(5.0, 2.0), disc)]
        );
        assert_eq!(
            walls(&plan),
            [
                [1.0, 0.0, 1.0, 1.0],
                [2.0, 6.0, 3.0, 6.0],
                [3.0, 6.0, 3.0, 5.0],
                [4.0, 4.0, 5.0, 4.0],
                [5.0, 4.0, 5.0, 5.0],
                [5.0, 5.0, 4.0, 4.0],
                [6.0, 4.0, 7.0, 9.0],
            ]
        );
    }

    #[test]
    fn rectangles_without_a_fill_are_rooms() {
        for drawing in [
            "<rect width='2' height='1' fill='none'/>",
            "<g style='stroke:#000;fill: none'><rect width='2' height='1'/></g>",
            "<polygon points='0 0 2 0 2 1 0 1' fill='red'/>",
        ] {
            let plan = plan(drawing).unwrap();
            assert_eq!(plan.obstacles, []);
            assert_eq!(
                walls(&plan),
                [
                    [0.0, 8.0, 2.0, 8.0],
                    [2.0, 8.0, 2.0, 7.0],
                    [2.0, 7.0, 0.0, 7.0],
                    [0.0, 7.0, 0.0, 8.0],
                ]
            );
        }
    }

    #[test]
    fn what_is_not_drawn_is_left_out() {
        let drawing = "<style>text { font-size: 2px }</style>\
                       <rect width='1' height='1' visibility='hidden'/>\
                       <g style='display:none'><rect width='1' height='1'/></g>\
                       <g style='visibility: hidden'><line x2='1'/></g>\
                       <defs><circle r='1'/></defs><text>fill</text>";
        assert_eq!(plan(drawing).unwrap(), FloorPlan::default());
    }

    #[test]
    fn a_point_that_is_no_number_is_not_lost() {
        let plan = plan("<g transform='scale(1e300)'><line x1='1e300' x2='-1e300'/></g>").unwrap();
        assert_eq!(plan.walls.len(), 1);
    }

    #[test]
    fn a_unit_is_what_the_file_says_then_what_the_drawing_says_then_a_meter() {
        let line = "<line x1='100' y1='50' x2='0' y2='50'/></svg>";
        for (size, scale_m, length_m) in [
            ("", None, 100.0),
            ("width='2000mm' height='1000mm'", None, 2.0),
            ("width='2000mm'", Some(0.1), 10.0),
            ("width='800px'", None, 100.0),
        ] {
            let text = format!("<svg {size} viewBox='-50 0 100 50'>{line}");
            let plan = of_text(&text, scale_m).unwrap();
            let [from_x, from_y, to_x, _] = walls(&plan)[0];
            assert_eq!((from_x - to_x, from_y), (length_m, 0.0), "{size}");
            assert_eq!(to_x, length_m / 2.0, "the left edge is at -50");
        }
    }

    #[test]
    fn what_cannot_be_read_is_refused_with_its_line() {
        for (drawing, reason) in [
            (
                "<ellipse rx='1' ry='2'/>",
                "<ellipse> cannot be read as part of a floor plan",
            ),
            ("<g><image/></g>", "<image> cannot be read"),
            (
                "<path d='M0 0C1 1 2 2 3 3'/>",
                "the command C of the path is not a straight line",
            ),
            ("<path d='M0'/>", "the command M of the path lacks numbers"),
            ("<path d='M0 0Lx y'/>", "the command L of the path lacks"),
            (
                "<g transform='rotate(45)'/>",
                "only translate, scale, and matrix",
            ),
            ("<rect width='1' height='1' rx='0.1'/>", "rounded corners"),
            ("<rect width='5%' height='1'/>", "width is \"5%\""),
            ("<circle r='1' fill='none'/>", "only filled, round circles"),
            ("<polygon points='1 2 3'/>", "points are not pairs"),
            (
                "<rect width='-1' height='1'/>",
                "width is -1, less than zero",
            ),
            (
                "<rect width='1' height='-1' fill='none'/>",
                "height is -1, less than zero",
            ),
            ("<circle cx='1' cy='1' r='-1'/>", "r is -1, less than zero"),
            ("<rect width='0' height='1'/>", "a body of 0 m"),
            ("<rect height='1'/>", "a body of 0 m"),
            (
                "<g transform='scale(1e-4)'><circle r='1'/></g>",
                "a body of 0.0002 m",
            ),
            (
                "<defs><style>.room { fill: none }</style></defs><rect class='room' width='1' height='1'/>",
                "a style sheet with fill cannot be read",
            ),
            (
                "<style><![CDATA[rect{display:none}]]></style>",
                "a style sheet with display",
            ),
            (
                "<g style='transform: scale(2)'/>",
                "transform is read as the attribute transform only",
            ),
            (
                "<g transform-origin='5 5' transform='scale(2)'/>",
                "transform-origin is read",
            ),
            ("<g>", "not an SVG drawing"),
            ("<!DOCTYPE a [<!ENTITY b 'c'>]>", "not an SVG drawing"),
        ] {
            let error = plan(drawing).unwrap_err();
            let shown = config::render_plain(&error, None, 200);
            assert!(shown.contains(reason), "no {reason:?} in\n{shown}");
            let is_third = shown.contains("plan.svg:3");
            assert!(shown.contains("plan.svg:2") || is_third, "{shown}");
        }
        assert!(
            of_text("<html/>", None)
                .unwrap_err()
                .reason()
                .contains("<html>")
        );
        let error = of_text("<svg><line/></svg>", None).unwrap_err();
        assert!(error.reason().contains("needs a viewBox"));
    }

    #[test]
    fn drawings_are_read_up_to_their_bounds() {
        let lines = |count| "<line x1='1' y1='1' x2='2' y2='2'/>".repeat(count);
        assert_eq!(plan(&lines(WALLS_MAX)).unwrap().walls.len(), WALLS_MAX);
        let error = plan(&lines(WALLS_MAX + 1)).unwrap_err();
        assert!(error.reason().contains("more than 4096"));

        let nested = |depth| "<g>".repeat(depth) + &"</g>".repeat(depth);
        assert!(plan(&nested(MAX_DEPTH)).is_ok());
        let error = plan(&nested(MAX_DEPTH + 1)).unwrap_err();
        assert!(error.reason().contains("more than 64 groups"));

        let long = |more: usize| {
            let head = "<svg viewBox='0 0 1 1'>";
            let rest = MAX_BYTES - head.len() - "</svg>".len() + more;
            format!("{head}{}</svg>", " ".repeat(rest))
        };
        assert!(of_text(&long(0), None).is_ok());
        let error = of_text(&long(1), None).unwrap_err();
        assert!(error.reason().contains("more than 4194304 bytes"));
    }
}
