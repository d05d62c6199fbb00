//! Shapes as an SVG file that needs no style sheet, with its size in millimeters.

use crate::markup::{Markup, Tag, number};
use crate::print::shapes::{PrintedShape, PrintedText, Segment};
use crate::print::sheet::{Color, Paint};
use crate::print::size::PrintSize;

/// Fonts of the texts: that of the PDF first, then those of the same widths.
const FONTS: &str = "'Liberation Sans', Helvetica, Arial, sans-serif";

/// A picture of these shapes.
pub(crate) fn svg(
    shapes: &[PrintedShape],
    size: &PrintSize,
    title: &str,
    description: &str,
) -> String {
    let mut svg = Markup::default();
    let view = format!("0 0 {} {}", number(size.width_px), number(size.height_px));
    let mm = |px: f64| format!("{:.2}mm", px * size.mm_per_px());
    svg.tag("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("width", &mm(size.width_px))
        .with("height", &mm(size.height_px))
        .with("viewBox", &view)
        .with("font-family", FONTS)
        .with("role", "img")
        .open();
    svg.title(title);
    svg.tag("desc").content(description);
    svg.add("\n");
    for shape in shapes {
        match shape {
            PrintedShape::Path(path, paint) => {
                let tag = svg.tag("path").with("d", &data(path));
                painted(tag, paint).empty();
            }
            PrintedShape::Text(text) => write_text(&mut svg, text),
        }
        svg.add("\n");
    }
    svg.close("svg");
    svg.finish()
}

fn data(path: &[Segment]) -> String {
    let mut data = String::new();
    for segment in path {
        data += &match *segment {
            Segment::Move(x, y) => format!("M{} {}", number(x), number(y)),
            Segment::Line(x, y) => format!("L{} {}", number(x), number(y)),
            Segment::Curve(points) => format!("C{}", points.map(number).join(" ")),
            Segment::Close => "z".to_owned(),
        };
    }
    data
}

fn hex([red, green, blue]: Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn painted<'a>(mut tag: Tag<'a>, paint: &Paint) -> Tag<'a> {
    tag = tag.with("fill", &paint.fill.map_or("none".to_owned(), hex));
    if paint.fill_opacity < 1.0 {
        tag = tag.with("fill-opacity", &paint.fill_opacity.to_string());
    }
    let Some(stroke) = paint.stroke else {
        return tag;
    };
    tag = tag.with("stroke", &hex(stroke));
    tag = tag.with("stroke-width", &paint.width.to_string());
    if paint.stroke_opacity < 1.0 {
        tag = tag.with("stroke-opacity", &paint.stroke_opacity.to_string());
    }
    if !paint.dashes.is_empty() {
        let dashes: Vec<String> = paint.dashes.iter().map(f64::to_string).collect();
        tag = tag.with("stroke-dasharray", &dashes.join(" "));
    }
    if paint.is_round {
        tag = tag.with("stroke-linejoin", "round");
    }
    if paint.has_round_ends {
        tag = tag.with("stroke-linecap", "round");
    }
    if paint.is_stroke_behind {
        tag = tag.with("paint-order", "stroke");
    }
    tag
}

fn write_text(svg: &mut Markup, text: &PrintedText) {
    let Some((paint, _)) = text.runs.first() else {
        return;
    };
    let mut tag = svg.tag("text");
    tag = match text.is_upward {
        false => tag.at("x", text.x).at("y", text.y),
        true => tag.with(
            "transform",
            &format!(
                "translate({} {}) rotate(-90)",
                number(text.x),
                number(text.y)
            ),
        ),
    };
    tag = tag.with("font-size", &paint.font_px.to_string());
    if paint.is_bold {
        tag = tag.with("font-weight", "bold");
    }
    tag = tag.anchor(match text.before {
        0.5 => "middle",
        1.0 => "end",
        _ => "start",
    });
    if let [(paint, words)] = &text.runs[..] {
        painted(tag, paint).content(words);
        return;
    }

    // Some programs drop the space at the end of a part otherwise.
    tag.with("xml:space", "preserve").open();
    for (paint, words) in &text.runs {
        painted(svg.tag("tspan"), paint).content(words);
    }
    svg.close("text");
}
