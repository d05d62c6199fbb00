//! Shapes as a PDF file of one page, in fonts that every reader has: Helvetica, and Symbol for arrows and infinity.
//!
//! Written here because it is little: paths and texts, uncompressed. A library that turns any SVG into PDF takes 160 s of processor time
//! to build.

use std::fmt::Write;

use crate::print::shapes::{PrintedShape, PrintedText, Segment};
use crate::print::sheet::Paint;
use crate::print::size::PrintSize;

/// Points of a millimeter.
pub(crate) const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// Widths of the letters of Helvetica from the space to `~`, thousandths of its size.
const REGULAR: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667,
    611, 778, 722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667,
    667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500,
    222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];
/// The same of Helvetica-Bold.
const BOLD: [u16; 95] = [
    278, 333, 474, 556, 556, 889, 722, 238, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 556, 333, 333, 584, 584, 584, 611, 975, 722, 722, 722, 722, 667,
    611, 778, 722, 278, 556, 722, 611, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667,
    667, 611, 333, 278, 333, 584, 556, 333, 556, 611, 556, 611, 556, 333, 611, 611, 278, 278, 556,
    278, 889, 611, 611, 611, 611, 389, 556, 333, 611, 556, 778, 556, 556, 500, 389, 280, 389, 584,
];
/// Letters outside of ASCII that have a code of their own, with their widths. The first of them has no code in PDF's usual encoding, and gets
/// one that is free there.
const OTHERS: [(char, u8, u16); 13] = [
    ('\u{2212}', 0x7f, 584),
    ('\u{2026}', 0x85, 1000),
    ('\u{2018}', 0x91, 222),
    ('\u{2019}', 0x92, 222),
    ('\u{201c}', 0x93, 333),
    ('\u{201d}', 0x94, 333),
    ('\u{2022}', 0x95, 350),
    ('\u{2013}', 0x96, 556),
    ('\u{2014}', 0x97, 1000),
    ('\u{a0}', 0xa0, 278),
    ('\u{b1}', 0xb1, 584),
    ('\u{b7}', 0xb7, 278),
    ('\u{d7}', 0xd7, 584),
];
/// Letters of the font Symbol, with their codes and widths.
const SYMBOLS: [(char, u8, u16); 5] = [
    ('∞', 0xa5, 713),
    ('↔', 0xab, 1042),
    ('←', 0xac, 987),
    ('→', 0xae, 987),
    ('↓', 0xaf, 603),
];

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
    let font = |name: &str, encoding: &str| {
        format!("<< /Type /Font /Subtype /Type1 /BaseFont /{name}{encoding} >>")
    };
    let latin = " /Encoding << /BaseEncoding /WinAnsiEncoding /Differences [127 /minus] >>";
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R /Resources << \
             /Font << /F0 5 0 R /F1 6 0 R /F2 7 0 R >> /ExtGState << {states}>> >> >>"
        ),
        format!(
            "<< /Length {} >>\nstream\n{content}endstream",
            content.len()
        ),
        font("Helvetica", latin),
        font("Helvetica-Bold", latin),
        font("Symbol", ""),
        format!("<< /Title {} >>", utf16(title)),
    ];
    file(&objects)
}

/// Puts objects, of which the last one is the information about the file, into a file with the table of their places.
fn file(objects: &[String]) -> Vec<u8> {
    let mut file = "%PDF-1.4\n".to_owned();
    let mut places = String::new();
    for (index, object) in objects.iter().enumerate() {
        places += &format!("{:010} 00000 n \n", file.len());
        file += &format!("{} 0 obj\n{object}\nendobj\n", index + 1);
    }

    let count = objects.len() + 1;
    let table = file.len();
    file += &format!("xref\n0 {count}\n0000000000 65535 f \n{places}");
    file += &format!(
        "trailer\n<< /Size {count} /Root 1 0 R /Info {} 0 R >>\nstartxref\n{table}\n%%EOF\n",
        count - 1
    );
    file.into_bytes()
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
    let width: f64 = runs.map(|(paint, words)| width_px(words, paint)).sum();
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
    let size = point(paint.font_px);
    let mut font = 9;
    for c in words.chars() {
        let (code, _, is_symbol) = glyph(c, paint.is_bold);
        let wanted = if is_symbol {
            2
        } else {
            u8::from(paint.is_bold)
        };
        if wanted != font {
            if font != 9 {
                *content += "> Tj ";
            }
            font = wanted;
            *content += &format!("/F{font} {size} Tf <");
        }
        *content += &format!("{code:02X}");
    }
    if font != 9 {
        *content += "> Tj ";
    }
}

/// Width of a text, pixels.
pub(crate) fn width_px(words: &str, paint: &Paint) -> f64 {
    let widths = words.chars().map(|c| f64::from(glyph(c, paint.is_bold).1));
    widths.sum::<f64>() / 1000.0 * paint.font_px
}

/// The code of a letter, its width in thousandths, and whether it is one of the font Symbol. A letter that no font has is a question mark.
fn glyph(c: char, is_bold: bool) -> (u8, u16, bool) {
    let widths = if is_bold { &BOLD } else { &REGULAR };
    let ascii = |c: char| widths.get((c as usize).wrapping_sub(0x20)).copied();
    if let Some(width) = ascii(c) {
        return (c as u8, width, false);
    }
    let find = |table: &[(char, u8, u16)]| {
        let found = table.iter().find(|(letter, ..)| *letter == c);
        found.map(|(_, code, width)| (*code, *width))
    };
    if let Some((code, width)) = find(&OTHERS) {
        return (code, width, false);
    }
    if let Some((code, width)) = find(&SYMBOLS) {
        return (code, width, true);
    }
    // Letters of western languages, which are about as wide as most.
    if matches!(c, '\u{a1}'..='\u{ff}') {
        return (c as u32 as u8, 556, false);
    }
    (b'?', 556, false)
}
