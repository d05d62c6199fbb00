//! Limits that keep a report small, whatever is reported.

use pictures::Panel;

/// Most panels of a figure.
pub(super) const MAX_PANELS: usize = 24;
/// Most bytes of the charts of a figure, beside its first one.
const MAX_FIGURE_BYTES: usize = 600_000;

/// The first panels of a figure, as many as are allowed, and a sentence about what is left out. `all` is how many there could be.
pub(super) fn limited(panels: Vec<Panel>, all: usize, what: &str) -> (Vec<Panel>, String) {
    let mut kept = Vec::new();
    let mut bytes = 0;
    for panel in panels {
        bytes += panel.svg.len();
        let fits = kept.is_empty() || bytes <= MAX_FIGURE_BYTES;
        if !fits || kept.len() == MAX_PANELS {
            break;
        }
        kept.push(panel);
    }

    let mut sentence = String::new();
    if kept.len() < all {
        sentence = format!(" The first {} of {all} {what} are drawn.", kept.len());
    }
    (kept, sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_named() {
        let panel = |bytes| Panel {
            heading: String::new(),
            svg: "x".repeat(bytes),
            is_wide: false,
        };
        let (kept, sentence) = limited(vec![panel(10), panel(10)], 2, "robots");
        assert_eq!((kept.len(), sentence.as_str()), (2, ""));

        let (kept, sentence) = limited(vec![panel(900_000), panel(10)], 2, "robots");
        assert_eq!(kept.len(), 1);
        assert_eq!(sentence, " The first 1 of 2 robots are drawn.");

        let many = (0..30).map(|_| panel(10)).collect();
        let (kept, sentence) = limited(many, 60, "conditions");
        assert_eq!(kept.len(), MAX_PANELS);
        assert_eq!(sentence, " The first 24 of 60 conditions are drawn.");
    }
}
