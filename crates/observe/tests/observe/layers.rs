//! Layers in conditions, expectations and measures.

use std::collections::BTreeMap;

use observe::{Expectation, Measured, Observation, RunSetting, TickCondition};
use protocol::RobotName;
use serde::Deserialize;

use super::written;

fn setting() -> RunSetting {
    RunSetting {
        tick_s: 0.5,
        ticks: 20,
        field_m: [4.0, 2.0],
        radio_range_m: None,
        body_m: 0.5,
        inradius_m: BTreeMap::new(),
        roster: vec![RobotName::new("R1").unwrap()],
        sites: BTreeMap::new(),
        layers: vec!["dust".to_owned(), "heat".to_owned()],
    }
}

/// The dust after each tick.
const DUST: [[f64; 4]; 3] = [
    [4.0, 2.0, 0.0, 1.0],
    [3.0, 1.0, 0.0, 0.0],
    [1.0, 0.0, -1.0, 0.0],
];

/// Shows a run with this dust, whose last tick is shown again at the end.
fn show(mut see: impl FnMut(&Observation<'_>)) {
    for tick in [0, 1, 2, 2] {
        see(&Observation {
            tick: tick as u64,
            tick_s: 0.5,
            events: &[],
            state: &|_| None,
            site: &|_| None,
            layer: &|name| (name == "dust").then_some(&DUST[tick][..]),
        });
    }
}

fn condition(text: &str) -> Result<TickCondition, String> {
    written::condition(text, &setting())
}

fn holds_in(text: &str) -> Vec<u64> {
    written::holds_in(text, &setting(), |see| show(see)).0
}

fn measured(text: &str) -> Measured {
    written::measured(text, &setting(), |see| show(see))
}

#[test]
fn a_condition_compares_one_number_of_the_cells() {
    for (text, ticks) in [
        (
            "{ layer = { name = 'dust', by = 'sum' }, at_most = 4 }",
            vec![1, 2],
        ),
        (
            "{ layer = { name = 'dust', by = 'mean' }, is = 1.75 }",
            vec![0],
        ),
        (
            "{ layer = { name = 'dust', by = 'max' }, above = 3 }",
            vec![0],
        ),
        (
            "{ layer = { name = 'dust', by = 'min' }, below = 0 }",
            vec![2],
        ),
        (
            "{ layer = { name = 'dust', by = 'mean', each = { below = 1 } }, at_least = 0.5 }",
            vec![1, 2],
        ),
        (
            "{ layer = { name = 'dust', by = 'count', each = { above = 0 } }, is = 2 }",
            vec![1],
        ),
        (
            "{ layer = { name = 'dust', by = 'all', each = { at_most = 1 } } }",
            vec![2],
        ),
        (
            "{ layer = { name = 'dust', by = 'any', each = { is = [4, 5] } } }",
            vec![0],
        ),
        (
            "{ layer = { name = 'dust', by = 'sum' }, at_most = 4, for = '0.5 s' }",
            vec![2],
        ),
        // It has no cells to be seen.
        (
            "{ layer = { name = 'heat', by = 'sum' }, at_least = 0 }",
            vec![],
        ),
    ] {
        assert_eq!(holds_in(text), ticks, "{text}");
    }
}

#[test]
fn a_measure_takes_one_number_of_the_cells_over_the_run() {
    for (text, value) in [
        ("layer = { name = 'dust', by = 'sum' }", 0.0),
        ("layer = { name = 'dust', by = 'sum', as = 'max' }", 7.0),
        (
            "layer = { name = 'dust', by = 'mean', each = { below = 1 }, as = 'end' }",
            0.75,
        ),
        ("layer = { name = 'dust', by = 'max', as = 'min' }", 1.0),
    ] {
        assert_eq!(measured(text), Measured::Value { value }, "{text}");
    }
    let time = "time = { to = { layer = { name = 'dust', by = 'sum' }, below = 5 } }";
    assert_eq!(measured(time), Measured::Reached { time_s: 0.5 });
}

#[test]
fn what_no_layer_has_is_refused_with_its_reason() {
    for (text, reason) in [
        (
            "{ layer = { name = 'mist', by = 'sum' }, above = 1 }",
            "no layer of this scenario is called mist; it has dust, heat",
        ),
        (
            "{ layer = { name = 'dust' }, above = 1 }",
            "become one number by \"sum\", \"mean\", \"max\" or \"min\"",
        ),
        (
            "{ layer = { name = 'dust', by = 'jain' }, above = 1 }",
            "become one number by \"sum\"",
        ),
        (
            "{ layer = { name = 'dust', by = 'count' }, above = 1 }",
            "become one number by \"sum\"",
        ),
        (
            "{ layer = { name = 'dust', by = 'sum', each = { above = 1 } }, above = 1 }",
            "by \"mean\", \"count\", \"all\" or \"any\"",
        ),
        (
            "{ layer = { name = 'dust', by = 'mean', each = {} }, above = 1 }",
            "`each` needs",
        ),
        (
            "{ layer = { by = 'sum' }, above = 1 }",
            "`layer` needs the `name` of a layer",
        ),
        (
            "{ layer = { name = 'dust', robots = '*', by = 'sum' }, above = 1 }",
            "`layer` has no `robots`",
        ),
        (
            "{ layer = { name = 'dust', range = '1 m', by = 'sum' }, above = 1 }",
            "`layer` has no `range`",
        ),
        (
            "{ covered = { robots = '*', radius = '1 m', cell = '1 m', name = 'dust' }, above = 1 }",
            "`covered` has no `name`",
        ),
        (
            "{ layer = { name = 'dust', by = 'sum' } }",
            "`layer` needs `at_least`",
        ),
        (
            "{ layer = { name = 'dust', by = 'all', each = { above = 1 } }, above = 1 }",
            "is true or false",
        ),
    ] {
        let error = condition(text).unwrap_err();
        assert!(error.contains(reason), "{text}: {error}");
    }
}

#[test]
fn expectations_on_layers_need_what_robots_reported() {
    #[derive(Deserialize)]
    struct Expectations {
        expect: Vec<Expectation>,
    }
    let text = "[[expect]]\nname = 'clean'\neventually = { layer = { name = 'dust', by = 'max' }, below = 1 }\nwithin = '5 s'\n";
    let file: Expectations = toml::from_str(text).unwrap();
    assert!(file.expect[0].needs_states());
}
