//! Figures that the book shows and a test draws. It is a part of the tests of each crate that measures what its figure shows.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use pictures::{ChartPanel, Figure};

/// Asserts that the pictures of a figure are those in `docs`: `NAME.svg`, and `NAME-2.svg` and so on if it is higher than a page. With
/// `CARS_UPDATE=1` it writes them.
pub(crate) fn assert_figure_is_shipped(name: &str, panels: Vec<ChartPanel>, caption: &str) {
    let printed = Figure::new(panels, caption, None)
        .print(name, None)
        .unwrap();
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    for (index, picture) in printed.pictures.iter().enumerate() {
        let file = docs.join(match index {
            0 => format!("{name}.svg"),
            index => format!("{name}-{}.svg", index + 1),
        });
        if std::env::var_os("CARS_UPDATE").is_some() {
            std::fs::write(&file, &picture.svg).unwrap();
        }
        let shipped = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(
            shipped == picture.svg,
            "{} is out of date: CARS_UPDATE=1 writes it",
            file.display()
        );
    }
}
