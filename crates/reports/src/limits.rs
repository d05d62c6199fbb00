//! Limits that keep a report small, whatever is reported.

use pictures::ChartPanel;

/// Most panels of a figure.
const MAX_PANELS: usize = 24;
/// Most bytes of the charts of a figure, beside its first one.
const MAX_FIGURE_BYTES: usize = 600_000;

/// The panels of a figure, one for each of these things, as many as are allowed, and a sentence about what is left out: empty, or
/// with a space before it.
pub(super) fn panels<T>(
    what: &str,
    things: Vec<T>,
    mut draw: impl FnMut(T) -> ChartPanel,
) -> (Vec<ChartPanel>, String) {
    let all = things.len();
    let mut panels = Vec::new();
    let mut bytes = 0;
    for thing in things.into_iter().take(MAX_PANELS) {
        let panel = draw(thing);
        bytes += panel.svg.len();
        if bytes > MAX_FIGURE_BYTES && !panels.is_empty() {
            break;
        }
        panels.push(panel);
    }

    let mut sentence = String::new();
    if panels.len() < all {
        let drawn = panels.len();
        sentence = format!(" The first {drawn} of {all} {what} are drawn.");
    }
    (panels, sentence)
}

#[cfg(test)]
mod tests {
    use pictures::{Bands, Chart};
    use timeline::{StateKind, StateOrder};

    use super::*;

    #[test]
    fn what_is_left_out_is_named() {
        let of_sizes = |what, sizes: Vec<usize>| {
            let (panels, sentence) = panels(what, sizes, |bytes| {
                let chart = Bands {
                    title: "x".repeat(bytes),
                    kind: StateKind::Emotion,
                    end_s: 1.0,
                    rows: Vec::new(),
                    names: StateOrder::default(),
                };
                ChartPanel::new("", Chart::Bands(chart))
            });
            (panels.len(), sentence)
        };
        let (count, sentence) = of_sizes("robots", vec![10, 10]);
        assert_eq!((count, sentence.as_str()), (2, ""));

        let (count, sentence) = of_sizes("robots", vec![900_000, 10]);
        assert_eq!(count, 1);
        assert_eq!(sentence, " The first 1 of 2 robots are drawn.");

        let (count, sentence) = of_sizes("conditions", vec![10; 60]);
        assert_eq!(count, MAX_PANELS);
        assert_eq!(sentence, " The first 24 of 60 conditions are drawn.");
    }
}
