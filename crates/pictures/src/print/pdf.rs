//! Shapes as a PDF file of one page, with its fonts.
//!
//! Written here because it is little: paths and texts, uncompressed. A library that turns any SVG into PDF takes 160 s of processor time
//! to build.

use std::fmt::Write;

use crate::print::font::{FIRST, Font, code, to_unicode};
use crate::print::shapes::{PrintedShape, PrintedText, Segment};
use crate::print::sheet::Paint;
use crate::print::size::PrintSize;

/// Points of a millimeter.
pub(crate) const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// The fonts by their names in a file, and whether they are bold.
const FONTS: [(&str, bool); 2] = [("F0", false), ("F1", true)];

/// A file with these shapes.
pub(crate) fn pdf(shapes: &[PrintedShape], size: &PrintSize, title: &str) -> Vec<u8> {
    let scale = size.mm_per_px() * POINTS_PER_MM;
    let [width, height] = [size.width_px, size.height_px].map(|px| point(px * scale));
    // From pixels, whose y runs downward, to points.
    let mut content = format!("{} 0 0 -{} 0 {height} cm\n", fine(scale), fine(scale));
    let mut opacities: Vec<(f64, f64)> = Vec::new();
    for shape in shapes {
        content += "q ";
        match shape {
            PrintedShape::Path(path, paint) => {
                set_paint(&mut content, paint, &mut opacities);
                add_path(&mut content, path);
                content += match (paint.fill, paint.stroke) {
                    (Some(_), Some(_)) => "B",
                    (Some(_), None) => "f",
                    (None, Some(_)) => "S",
                    (None, None) => "n",
                };
            }
            PrintedShape::Text(text) => add_text(&mut content, text, &mut opacities),
        }
        content += " Q\n";
    }

    let mut states = String::new();
    for (index, (fill, stroke)) in opacities.iter().enumerate() {
        states += &format!("/G{index} << /ca {fill} /CA {stroke} >> ");
    }
    let mut objects = vec![
        "<< /Type /Catalog /Pages 2 0 R >>".into(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".into(),
        Vec::new(),
        stream("", content.as_bytes()),
        stream("", to_unicode().as_bytes()),
    ];
    let mut fonts = String::new();
    for (name, is_bold) in FONTS {
        if content.contains(&format!("/{name} ")) {
            fonts += &format!("/{name} {} 0 R ", objects.len() + 1);
            add_font(&mut objects, Font::of(is_bold));
        }
    }
    objects[2] = format!(
        "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R /Resources << \
         /Font << {fonts}>> /ExtGState << {states}>> >> >>"
    )
    .into();
    objects.push(format!("<< /Title {} >>", utf16(title)).into());
    file(&objects)
}

/// An object with content.
fn stream(entries: &str, content: &[u8]) -> Vec<u8> {
    let head = format!("<< {entries}/Length {} >>\nstream\n", content.len());
    [head.as_bytes(), content, b"\nendstream"].concat()
}

/// Adds a font, its descriptor and its file. Without an encoding, codes are those of the font's own table.
fn add_font(objects: &mut Vec<Vec<u8>>, font: &Font) {
    let Font {
        name,
        bounds,
        stem,
        file_length,
        ..
    } = font;
    let descriptor = objects.len() + 2;
    let widths = font.widths.map(|width| width.to_string()).join(" ");
    objects.push(
        format!(
            "<< /Type /Font /Subtype /TrueType /BaseFont /{name} /FirstChar {FIRST} /LastChar 255 /Widths [{widths}] \
             /FontDescriptor {descriptor} 0 R /ToUnicode 5 0 R >>"
        )
        .into(),
    );
    objects.push(
        format!(
            "<< /Type /FontDescriptor /FontName /{name} /Flags 4 /FontBBox [{bounds}] /ItalicAngle 0 /Ascent 905 \
             /Descent -212 /CapHeight 688 /StemV {stem} /FontFile2 {} 0 R >>",
            descriptor + 1
        )
        .into(),
    );
    let entries = format!("/Filter /FlateDecode /Length1 {file_length} ");
    objects.push(stream(&entries, font.file));
}

/// Puts objects, of which the last one is the information about the file, into a file with the table of their places.
fn file(objects: &[Vec<u8>]) -> Vec<u8> {
    // Four bytes above 127 tell programs that the file is not text.
    let mut file = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n".to_vec();
    let mut places = String::new();
    for (index, object) in objects.iter().enumerate() {
        places += &format!("{:010} 00000 n \n", file.len());
        file.extend(format!("{} 0 obj\n", index + 1).bytes());
        file.extend(object);
        file.extend(b"\nendobj\n");
    }

    let count = objects.len() + 1;
    let table = file.len();
    let end = format!(
        "xref\n0 {count}\n0000000000 65535 f \n{places}\
         trailer\n<< /Size {count} /Root 1 0 R /Info {} 0 R >>\nstartxref\n{table}\n%%EOF\n",
        count - 1
    );
    file.extend(end.bytes());
    file
}

/// A length, to the hundredth.
fn point(value: f64) -> String {
    let hundredths = (value * 100.0).round() / 100.0;
    // Not "-0".
    format!("{}", hundredths + 0.0)
}

fn fine(value: f64) -> String {
    format!("{value:.5}")
}

/// A text in any script, as the title of a file has it.
fn utf16(text: &str) -> String {
    let mut digits = "<FEFF".to_owned();
    for unit in text.encode_utf16() {
        // Infallible: it is written to memory.
        let _ = write!(digits, "{unit:04X}");
    }
    digits + ">"
}

fn set_paint(content: &mut String, paint: &Paint, opacities: &mut Vec<(f64, f64)>) {
    for (color, operator) in [(paint.fill, "rg"), (paint.stroke, "RG")] {
        if let Some(color) = color {
            let channels = color.map(|channel| format!("{:.3}", f64::from(channel) / 255.0));
            *content += &format!("{} {operator} ", channels.join(" "));
        }
    }
    if paint.stroke.is_some() {
        let dashes: Vec<String> = paint.dashes.iter().copied().map(point).collect();
        let cap = u8::from(paint.has_round_ends);
        let join = u8::from(paint.is_round);
        let (width, dashes) = (point(paint.width), dashes.join(" "));
        *content += &format!("{width} w {cap} J {join} j [{dashes}] 0 d ");
    }

    let opacity = (paint.fill_opacity, paint.stroke_opacity);
    if opacity != (1.0, 1.0) {
        let known = opacities.iter().position(|one| *one == opacity);
        let index = known.unwrap_or_else(|| {
            opacities.push(opacity);
            opacities.len() - 1
        });
        *content += &format!("/G{index} gs ");
    }
}

fn add_path(content: &mut String, path: &[Segment]) {
    for segment in path {
        *content += &match *segment {
            Segment::Move(x, y) => format!("{} {} m ", point(x), point(y)),
            Segment::Line(x, y) => format!("{} {} l ", point(x), point(y)),
            Segment::Curve(points) => format!("{} c ", points.map(point).join(" ")),
            Segment::Close => "h ".to_owned(),
        };
    }
}

fn add_text(content: &mut String, text: &PrintedText, opacities: &mut Vec<(f64, f64)>) {
    let runs = text.runs.iter();
    let widths = runs.map(|(paint, words)| Font::of(paint.is_bold).width_em(words) * paint.font_px);
    let width: f64 = widths.sum();
    let before = width * text.before;
    // Glyphs stand upright although y runs downward.
    let matrix = if text.is_upward {
        format!("0 -1 -1 0 {} {}", point(text.x), point(text.y + before))
    } else {
        format!("1 0 0 -1 {} {}", point(text.x - before), point(text.y))
    };

    let has_stroke = text
        .runs
        .iter()
        .any(|(paint, _)| paint.stroke.is_some() && paint.is_stroke_behind);
    let passes = if has_stroke { &[1, 0][..] } else { &[0][..] };
    for mode in passes {
        *content += &format!("BT {matrix} Tm {mode} Tr ");
        for (paint, words) in &text.runs {
            set_paint(content, paint, opacities);
            add_words(content, words, paint);
        }
        *content += "ET ";
    }
}

fn add_words(content: &mut String, words: &str, paint: &Paint) {
    let font = u8::from(paint.is_bold);
    let codes: String = words.chars().map(|c| format!("{:02X}", code(c))).collect();
    *content += &format!("/F{font} {} Tf <{codes}> Tj ", point(paint.font_px));
}
