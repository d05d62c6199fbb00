//! The fonts of PDF files: Liberation Sans, which has the widths of Helvetica, reduced to these letters (`fonts/subset.py`).

/// Code of the first letter, the space. Codes up to 0xff are letters.
pub(super) const FIRST: u8 = 0x20;
/// Letters with the codes from 0x7f to 0x9f. The other ones have those of Latin-1.
const OTHERS: &str = "−€∞‚ƒ„…†‡ˆ‰Š‹Œ↔Ž←→‘’“”•–—˜™š›œ↓žŸ";
/// Code of the first of them.
const FIRST_OTHER: u8 = 0x7f;

/// A font, as its descriptor in a file describes it.
pub(super) struct Font {
    pub(super) name: &'static str,
    /// Left, lower, right and upper end of all letters, thousandths of the size.
    pub(super) bounds: &'static str,
    /// Width of vertical stems, thousandths of the size. [I] Readers use it only for a font that is not embedded.
    pub(super) stem: u16,
    /// A TrueType font, compressed (zlib).
    pub(super) file: &'static [u8],
    /// Bytes of the font before it was compressed.
    pub(super) file_length: usize,
    /// Width of each letter, thousandths of the size.
    pub(super) widths: [u16; 224],
}

static REGULAR: Font = Font {
    name: "CARSAA+LiberationSans",
    bounds: "-203 -212 1000 878",
    stem: 88,
    file: include_bytes!("../../fonts/sans-regular.ttf.z"),
    file_length: 16552,
    widths: [
        278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556,
        556, 556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722,
        722, 667, 611, 778, 722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722,
        667, 944, 667, 667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278, 556,
        556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500,
        500, 334, 260, 334, 584, 584, 556, 713, 222, 556, 333, 1000, 556, 556, 333, 1000, 667, 333,
        1000, 1000, 611, 1000, 1000, 222, 222, 333, 333, 350, 556, 1000, 333, 1000, 500, 333, 944,
        500, 500, 667, 278, 333, 556, 556, 556, 556, 260, 556, 333, 737, 370, 556, 584, 333, 737,
        552, 400, 549, 333, 333, 333, 576, 537, 333, 333, 333, 365, 556, 834, 834, 834, 611, 667,
        667, 667, 667, 667, 667, 1000, 722, 667, 667, 667, 667, 278, 278, 278, 278, 722, 722, 778,
        778, 778, 778, 778, 584, 778, 722, 722, 722, 722, 667, 667, 611, 556, 556, 556, 556, 556,
        556, 889, 500, 556, 556, 556, 556, 278, 278, 278, 278, 556, 556, 556, 556, 556, 556, 556,
        549, 611, 556, 556, 556, 556, 500, 556, 500,
    ],
};

static BOLD: Font = Font {
    name: "CARSAB+LiberationSans-Bold",
    bounds: "-184 -222 1000 896",
    stem: 140,
    file: include_bytes!("../../fonts/sans-bold.ttf.z"),
    file_length: 16624,
    widths: [
        278, 333, 474, 556, 556, 889, 722, 238, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556,
        556, 556, 556, 556, 556, 556, 556, 556, 333, 333, 584, 584, 584, 611, 975, 722, 722, 722,
        722, 667, 611, 778, 722, 278, 556, 722, 611, 833, 722, 778, 667, 778, 722, 667, 611, 722,
        667, 944, 667, 667, 611, 333, 278, 333, 584, 556, 333, 556, 611, 556, 611, 556, 333, 611,
        611, 278, 278, 556, 278, 889, 611, 611, 611, 611, 389, 556, 333, 611, 556, 778, 556, 556,
        500, 389, 280, 389, 584, 584, 556, 713, 278, 556, 500, 1000, 556, 556, 333, 1000, 667, 333,
        1000, 1000, 611, 1000, 1000, 278, 278, 500, 500, 350, 556, 1000, 333, 1000, 556, 333, 944,
        500, 500, 667, 278, 333, 556, 556, 556, 556, 280, 556, 333, 737, 370, 556, 584, 333, 737,
        552, 400, 549, 333, 333, 333, 576, 556, 333, 333, 333, 365, 556, 834, 834, 834, 611, 722,
        722, 722, 722, 722, 722, 1000, 722, 667, 667, 667, 667, 278, 278, 278, 278, 722, 722, 778,
        778, 778, 778, 778, 584, 778, 722, 722, 722, 722, 667, 667, 611, 556, 556, 556, 556, 556,
        556, 889, 556, 556, 556, 556, 556, 278, 278, 278, 278, 611, 611, 611, 611, 611, 611, 611,
        549, 611, 611, 611, 611, 611, 556, 611, 556,
    ],
};

impl Font {
    pub(super) fn of(is_bold: bool) -> &'static Self {
        if is_bold { &BOLD } else { &REGULAR }
    }

    /// Width of a text, in sizes of its letters.
    pub(super) fn width_em(&self, words: &str) -> f64 {
        let widths = words
            .chars()
            .map(|c| self.widths[usize::from(code(c) - FIRST)]);
        widths.map(f64::from).sum::<f64>() / 1000.0
    }
}

/// The code of a letter. A letter that the fonts lack is a question mark.
pub(super) fn code(c: char) -> u8 {
    let other = OTHERS
        .chars()
        .zip(FIRST_OTHER..)
        .find(|(other, _)| *other == c);
    match (u8::try_from(c), other) {
        (Ok(code), _) if matches!(code, FIRST..FIRST_OTHER | 0xa0..) => code,
        (_, Some((_, code))) => code,
        _ => b'?',
    }
}

/// The map from codes to letters, for a reader that searches or copies texts (PDF 1.7, 9.10.3).
pub(super) fn to_unicode() -> String {
    let others = OTHERS.chars().zip(FIRST_OTHER..);
    let others: String = others
        .map(|(c, code)| format!("<{code:02X}> <{:04X}>\n", u32::from(c)))
        .collect();
    format!(
        "/CIDInit /ProcSet findresource begin\n12 dict begin\nbegincmap\n/CMapName /Letters def\n/CMapType 2 def\n\
         1 begincodespacerange\n<00> <FF>\nendcodespacerange\n\
         2 beginbfrange\n<20> <7E> <0020>\n<A0> <FF> <00A0>\nendbfrange\n\
         {} beginbfchar\n{others}endbfchar\n\
         endcmap\nCMapName currentdict /CMap defineresource pop\nend\nend",
        OTHERS.chars().count()
    )
}
