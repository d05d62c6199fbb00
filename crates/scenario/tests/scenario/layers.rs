//! Layers in scenario files: what they mean, and what people are told when they are wrong.

use protocol::messages::{MAX_LAYER_CELLS, MAX_LAYER_VALUE, MAX_LAYERS, Point};
use scenario::{Changes, LayerSpec};

use super::{parse, shown, source};

const DUST: &str = "tick = \"0.5 s\"\n[field]\nsize = [\"10 m\", \"8 m\"]\n[[layer]]\nname = \"dust\"\ncell = \"0.5 m\"\n\
                    range = \"1 m\"\npeaks = [{ count = 3, at = \"random\", radius = \"2 m\", height = 4 }]\n";

fn layer(text: &str) -> LayerSpec {
    parse(text).unwrap().layers["dust"].clone()
}

#[test]
fn a_layer_has_defaults_and_is_kept() {
    let plain = layer(
        "[field]\nsize = [\"50 ft\", \"8.1 m\"]\n[[layer]]\nname = \"dust\"\ncell = \"1 ft\"\n",
    );
    // 50 ft are 50 cells of 1 ft, and not one more by rounding.
    assert_eq!((plain.columns, plain.rows), (50, 27));
    assert_eq!((plain.value, plain.range_m), (0.0, None));
    assert_eq!((plain.min, plain.max), (-MAX_LAYER_VALUE, MAX_LAYER_VALUE));
    assert_eq!((plain.decay_per_s, plain.diffuse_m2ps), (0.0, 0.0));
    assert_eq!(plain.start(), vec![0.0; 50 * 27]);

    let text = DUST.to_owned() + "value = 1\nmin = 0\nmax = 4.5\ndecay = 2\ndiffuse = 0.125\n";
    let scenario = parse(&text).unwrap();
    let written = parse(&scenario.to_toml().unwrap()).unwrap();
    let dust = &scenario.layers["dust"];
    assert_eq!(written.layers["dust"].start(), dust.start());
    assert_eq!((dust.len(), dust.peaks.len()), (20 * 16, 3));
    assert!(dust.start().iter().all(|cell| (1.0..=4.5).contains(cell)));
}

#[test]
fn a_peak_is_a_quartic_kernel() {
    // The peak is in the center of the cell in column 4 and row 3.
    let text = DUST.replace(
        "count = 3, at = \"random\"",
        "at = [\"2.25 m\", \"1.75 m\"]",
    );
    let dust = layer(&text);
    let start = dust.start();
    let cell = |column: usize, row: usize| start[row * 20 + column];
    assert_eq!(cell(4, 3), 4.0);
    // (1 - (1/4)²)² at 0.5 m, (1 - (1/2)²)² at 1 m, and 0 from 2 m on.
    assert_eq!([cell(5, 3), cell(4, 2)], [4.0 * 0.9375 * 0.9375; 2]);
    assert_eq!([cell(6, 3), cell(4, 1)], [4.0 * 0.5625; 2]);
    assert_eq!([cell(8, 3), cell(9, 3)], [0.0; 2]);
    assert!(cell(7, 3) > 0.0);

    // Peaks add up, and stay within the bounds.
    let twice = text.replace(
        "peaks = [",
        "max = 6\npeaks = [{ at = [\"2.25 m\", \"1.75 m\"], radius = \"2 m\", height = 4 }, ",
    );
    let start = layer(&twice).start();
    assert_eq!(start[3 * 20 + 4], 6.0);
    assert_eq!(start[3 * 20 + 6], 4.5);
}

#[test]
fn peaks_are_where_the_seed_has_them() {
    let places = |text: &str| -> Vec<Point> {
        let peaks = layer(text).peaks;
        peaks.iter().map(|peak| peak.at).collect()
    };
    let own = places(DUST);
    assert!(own[0] != own[1] && own[1] != own[2]);
    let more = places(&DUST.replace("count = 3", "count = 4"));
    assert_eq!(more[..3], own, "one more moves none");

    let moved = places(&("seed = 2\n".to_owned() + DUST));
    assert_ne!(moved, own);
    let scenario = parse(DUST).unwrap();
    let template = scenario.to_toml_without_seed().unwrap();
    assert!(template.contains("random"), "{template}");
    let again = scenario.with_seed(2).unwrap();
    let peaks = again.layers["dust"].peaks.iter();
    assert_eq!(peaks.map(|peak| peak.at).collect::<Vec<_>>(), moved);
}

#[test]
fn changes_name_layers() {
    let changes = Changes {
        set: vec!["layer.dust.decay=0.25".parse().unwrap()],
        ..Changes::default()
    };
    let changed = changes.apply(&source(DUST)).unwrap();
    assert_eq!(layer(&changed.text).decay_per_s, 0.25);
}

#[test]
fn a_layer_that_cannot_be_is_refused_where_it_is_written() {
    let more = |name: &str, rest: &str| {
        format!("{DUST}[[layer]]\nname = \"{name}\"\ncell = \"1 m\"\n{rest}")
    };
    let many: String = (1..=MAX_LAYERS)
        .map(|number| format!("[[layer]]\nname = \"l{number}\"\ncell = \"1 m\"\n"))
        .collect();
    for (text, line, reason) in [
        (
            DUST.replace("\"dust\"", "\"a b\""),
            5,
            "the name of a layer is a word",
        ),
        (more("dust", ""), 10, "a second layer called dust"),
        (DUST.to_owned() + &many, 30, "more than 8 layers"),
        (
            DUST.replace("0.5 m", "0 m"),
            6,
            "a cell must be more than zero",
        ),
        (DUST.replace("0.5 m", "0.1 mm"), 6, "a quantity"),
        (
            DUST.replace("\"0.5 m\"", "\"0.001 cm\""),
            6,
            "more than the 131072 cells allowed",
        ),
        (
            DUST.replace("\"0.5 m\"", "\"2.4 cm\""),
            6,
            "139278 cells, more than the 131072",
        ),
        (
            DUST.replace("range = \"1 m\"", "range = \"0 m\""),
            7,
            "the range must be more than zero",
        ),
        (
            DUST.replace("range = \"1 m\"", "range = \"13 m\"\n")
                .replace("0.5 m", "0.1 m"),
            7,
            "cells, more than the 2048 allowed",
        ),
        (
            DUST.replace("count = 3", "count = 257"),
            8,
            "more than 256 peaks",
        ),
        (
            DUST.replace("\"2 m\", h", "\"0 m\", h"),
            8,
            "a radius must be more than zero",
        ),
        (
            DUST.replace("height = 4", "height = 2e12"),
            8,
            "at most 1e12 from zero",
        ),
        (
            DUST.to_owned() + "value = nan\n",
            9,
            "at most 1e12 from zero",
        ),
        (
            DUST.to_owned() + "min = 2\nmax = 1\n",
            9,
            "min, 2, is more than max, 1",
        ),
        (
            DUST.to_owned() + "max = 2\nvalue = 3\n",
            10,
            "the value, 3, is outside the bounds",
        ),
        (
            DUST.to_owned() + "decay = 2.1\n",
            9,
            "decay is from 0 to 2.0000 1/s",
        ),
        (DUST.to_owned() + "decay = -1\n", 9, "decay is from 0"),
        (
            DUST.to_owned() + "diffuse = 0.126\n",
            9,
            "diffuse is from 0 to 0.1250 m²/s",
        ),
        (
            DUST.to_owned() + "from = \"x.csv\"\n",
            9,
            "unknown field `from`",
        ),
        (
            format!("{DUST}[[change]]\nat = \"5 s\"\nset = [\"layer.dust.decay=1\"]\n"),
            9,
            "only the network, faults",
        ),
    ] {
        let error = match parse(&text) {
            Ok(_) => panic!("accepted: {text}"),
            Err(error) => shown(&error),
        };
        let is_unit = reason == "a quantity";
        let place = format!("hall.toml:{line}:");
        assert!(
            is_unit || (error.contains(&place) && error.contains(reason)),
            "{error}"
        );
    }
}

#[test]
fn the_most_cells_are_accepted() {
    // 512 columns and 256 rows.
    let text =
        "[field]\nsize = [\"51.2 m\", \"25.6 m\"]\n[[layer]]\nname = \"dust\"\ncell = \"0.1 m\"\n";
    assert_eq!(layer(text).len(), MAX_LAYER_CELLS);
}
