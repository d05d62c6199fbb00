//! Layers: how they change by themselves, what robots sense of them, what they do to them, and in which order.

use base64::Engine;
use environment::layers::Layers;
use environment::{Event, Simulation, recorded};
use proptest::prelude::*;
use protocol::RunName;
use protocol::messages::{
    LayerAction, LayerFrame, LayerRefusal, LayerResult, MAX_SENSED_CELLS, Point, Report,
};

use crate::actors::Actors;
use crate::common::{name, parse, scenario};

/// A layer of 6 by 4 cells of 1 m, with a spike of 16 in column 2 and row 1, and one that no robot reaches.
const FILE: &str = r#"
tick = "0.5 s"
duration = "10 s"
[field]
size = ["6 m", "4 m"]
body = "0.5 m"
[[layer]]
name = "dust"
cell = "1 m"
range = "1 m"
peaks = [{ at = ["2.5 m", "1.5 m"], radius = "0.5 m", height = 16 }]
[[layer]]
name = "heat"
cell = "2 m"
value = 1
[[robot]]
name = "A"
at = ["2.5 m", "1.5 m"]
[[robot]]
name = "B"
at = ["3.5 m", "1.5 m"]
[[robot]]
name = "C"
at = ["5.5 m", "3.5 m"]
"#;
const COLUMNS: usize = 6;

fn dust(layers: &Layers) -> Vec<f64> {
    layers.cells("dust").unwrap().to_vec()
}

/// The cells of the dust that are not 0, by column and row.
fn filled(layers: &Layers) -> Vec<(usize, usize, f64)> {
    let cells = dust(layers).into_iter().enumerate();
    let filled = cells.filter(|(_, cell)| *cell != 0.0);
    filled
        .map(|(index, cell)| (index % COLUMNS, index / COLUMNS, cell))
        .collect()
}

/// With these keys of the dust.
fn with(keys: &str) -> String {
    FILE.replace("range = \"1 m\"", &format!("range = \"1 m\"\n{keys}"))
}

#[test]
fn what_decays_loses_the_same_share_in_each_tick() {
    // Half of it in half a second.
    let mut layers = Layers::new(&scenario(&with("decay = 1")));
    for tick in 1..=30 {
        layers.pass_tick();
        assert_eq!(filled(&layers), [(2, 1, 16.0 / f64::from(1 << tick))]);
    }
    // 16 / 2^34 is less than 1e-9.
    for _ in 0..4 {
        layers.pass_tick();
    }
    assert_eq!(filled(&layers), []);

    // It stays within its bounds.
    let mut layers = Layers::new(&scenario(&with("decay = 1\nmin = 3\nvalue = 3")));
    for _ in 0..9 {
        layers.pass_tick();
    }
    assert_eq!(dust(&layers), [3.0; 24]);
}

#[test]
fn what_diffuses_goes_to_the_neighbors_and_stays() {
    // A quarter of each difference in a tick.
    let text = with("diffuse = 0.5");
    let mut layers = Layers::new(&scenario(&text));
    layers.pass_tick();
    let around = [(2, 0, 4.0), (1, 1, 4.0), (3, 1, 4.0), (2, 2, 4.0)];
    assert_eq!(filled(&layers), around);

    // Nothing leaves over a corner.
    let corner = text.replace(
        "[\"2.5 m\", \"1.5 m\"], radius",
        "[\"0.5 m\", \"0.5 m\"], radius",
    );
    let mut layers = Layers::new(&scenario(&corner));
    layers.pass_tick();
    assert_eq!(filled(&layers), [(0, 0, 8.0), (1, 0, 4.0), (0, 1, 4.0)]);
    for _ in 0..200 {
        layers.pass_tick();
        let sum: f64 = dust(&layers).iter().sum();
        assert!((sum - 16.0).abs() < 1e-12, "{sum}");
    }
    let even = dust(&layers)
        .into_iter()
        .map(|cell| (cell - 16.0 / 24.0).abs());
    assert!(even.fold(0.0, f64::max) < 1e-3);
}

/// Carries out what A does as it stands in the center of the spike.
fn act(layers: &mut Layers, actions: &[LayerAction]) -> Vec<Event> {
    layers.begin_actions();
    layers.carry_out(&name("A"), Point::new(2.5, 1.5), actions)
}

fn changed(cells: u32, change: f64) -> Event {
    Event::LayerChanged {
        robot: name("A"),
        layer: "dust".into(),
        cells,
        change,
    }
}

#[test]
fn an_action_changes_the_cells_whose_centers_are_within_its_radius() {
    let here = Point::new(2.5, 1.5);
    let mut layers = Layers::new(&scenario(&with("min = 0")));

    let events = act(&mut layers, &[LayerAction::add("dust", here, 0.0, -3.0)]);
    assert_eq!(events, [changed(1, -3.0)]);
    assert_eq!(filled(&layers), [(2, 1, 13.0)]);

    // The edge of the disc is in it: five cells, of which four were 0.
    let events = act(&mut layers, &[LayerAction::set("dust", here, 1.0, 2.0)]);
    assert_eq!(events, [changed(5, 4.0 * 2.0 - 11.0)]);
    let events = act(&mut layers, &[LayerAction::set("dust", here, 0.999, 1.0)]);
    assert_eq!(events, [changed(1, -1.0)]);

    // The cell in which the place is counts, also where its center is farther away.
    let corner = Point::new(2.01, 1.99);
    let events = act(&mut layers, &[LayerAction::set("dust", corner, 0.1, 5.0)]);
    assert_eq!(events, [changed(1, 4.0)]);

    // Nothing is less than the least, and what changes nothing is no event.
    let take = LayerAction::add("dust", here, 1.0, -9.0);
    let events = act(&mut layers, &[take.clone(), take]);
    assert_eq!(events, [changed(5, -13.0)]);
    let result = |change: f64| LayerResult {
        layer: "dust".into(),
        change,
        refused: None,
    };
    assert_eq!(layers.results(&name("A")), [result(-13.0), result(0.0)]);
    assert_eq!(filled(&layers), []);

    // What is set is set first.
    let both = LayerAction {
        add: Some(0.5),
        ..LayerAction::set("dust", here, 0.0, 7.0)
    };
    assert_eq!(act(&mut layers, &[both]), [changed(1, 7.5)]);

    // A place beyond the edge is in no cell.
    let outside = LayerAction::set("dust", Point::new(2.5, -0.1), 0.5, 7.0);
    layers.begin_actions();
    let robot = Point::new(2.5, 0.5);
    assert_eq!(layers.carry_out(&name("A"), robot, &[outside]), []);
}

#[test]
fn an_action_out_of_range_is_refused() {
    let here = Point::new(2.5, 1.5);
    for (action, refused) in [
        (
            LayerAction::set("dust", Point::new(3.5, 1.5), 1.0, 1.0),
            None,
        ),
        (
            LayerAction::set("dust", Point::new(3.500_001, 1.5), 0.0, 1.0),
            Some(LayerRefusal::OutOfRange),
        ),
        (
            LayerAction::set("dust", here, 1.000_001, 1.0),
            Some(LayerRefusal::OutOfRange),
        ),
        (
            LayerAction::set("heat", here, 0.0, 2.0),
            Some(LayerRefusal::OutOfRange),
        ),
        (
            LayerAction::set("mist", here, 0.0, 1.0),
            Some(LayerRefusal::UnknownLayer),
        ),
    ] {
        let mut layers = Layers::new(&scenario(FILE));
        let before = layers.frames();
        let events = act(&mut layers, std::slice::from_ref(&action));
        assert_eq!(layers.results(&name("A"))[0].refused, refused, "{action:?}");
        assert_eq!(layers.frames() == before, refused.is_some(), "{action:?}");
        let is_refusal = matches!(events[..], [Event::LayerRefused { .. }]);
        assert_eq!(is_refusal, refused.is_some(), "{events:?}");
    }
}

#[test]
fn a_robot_senses_the_cells_whose_centers_are_within_range() {
    let layers = Layers::new(&scenario(FILE));
    let near = layers.near(Point::new(2.5, 1.5));
    // Not the heat, which has no range.
    assert_eq!(near.len(), 1);
    let cells: Vec<(u32, u32, f64)> = near[0]
        .cells()
        .map(|cell| (cell.column, cell.row, cell.value))
        .collect();
    let expected = [
        (2, 0, 0.0),
        (1, 1, 0.0),
        (2, 1, 16.0),
        (3, 1, 0.0),
        (2, 2, 0.0),
    ];
    assert_eq!(cells, expected);
    assert_eq!(near[0].cells().next().unwrap().center, Point::new(2.5, 0.5));
    assert_eq!(near[0].value_at(Point::new(2.0, 1.999)), Some(16.0));
    for (x, y) in [
        (0.5, 1.5),
        (4.0, 1.5),
        (1.5, 0.5),
        (2.5, -0.5),
        (f64::NAN, 1.5),
    ] {
        assert_eq!(near[0].value_at(Point::new(x, y)), None, "{x} {y}");
    }
    // In the corner.
    let cells = layers.near(Point::new(0.1, 0.1))[0].cells().count();
    assert_eq!(cells, 1);
}

fn act_on_layers(report: &mut Report, actions: Vec<LayerAction>) {
    report.layer_actions = actions;
}

/// A run in which robots do this, tick by tick.
fn run(
    text: &str,
    actions: &[(u64, &str, LayerAction)],
    ticks: u64,
) -> (Simulation, Actors<LayerAction>, Vec<String>) {
    let mut simulation = Simulation::new(scenario(text), 1).unwrap();
    let mut actors = Actors::of(&simulation, act_on_layers);
    for (tick, robot, action) in actions {
        let of_tick = actors.actions.entry((*tick, name(robot))).or_default();
        of_tick.push(action.clone());
    }

    let mut lines = Vec::new();
    for tick in 0..=ticks {
        let record = match tick {
            0 => simulation.init(&mut actors).unwrap(),
            _ => simulation.step(&mut actors).unwrap(),
        };
        lines.extend(record.lines().map(|line| line.to_json()));
    }
    (simulation, actors, lines)
}

#[test]
fn robots_act_in_the_order_of_their_names_on_what_the_one_before_left() {
    let place = Point::new(2.5, 1.5);
    let set = LayerAction::set("dust", place, 0.0, 4.0);
    let halve = LayerAction::add("dust", place, 0.0, -1.0);
    for (a, b, last) in [(&set, &halve, 3.0), (&halve, &set, 4.0)] {
        let actions = [(1, "B", b.clone()), (1, "A", a.clone())];
        let (simulation, _, lines) = run(FILE, &actions, 1);
        assert_eq!(filled(simulation.layers()), [(2, 1, last)]);
        let robots: Vec<&String> = lines
            .iter()
            .filter(|line| line.contains("layer_changed"))
            .collect();
        assert!(robots[0].contains(r#""robot":"A""#), "{robots:?}");
        assert!(robots[1].contains(r#""robot":"B""#), "{robots:?}");
    }
}

#[test]
fn news_have_the_layer_after_the_decay_of_their_tick_and_what_became_of_actions() {
    let text = with("decay = 1");
    let add = LayerAction::add("dust", Point::new(2.5, 1.5), 0.0, 1.0);
    let far = [(1, "A", add.clone()), (1, "C", add)];
    let (simulation, actors, lines) = run(&text, &far, 3);

    // 16 at the start, half of it, then what A added, and so on.
    let sensed =
        |tick: usize| actors.news[tick][&name("A")].layers[0].value_at(Point::new(2.5, 1.5));
    let seen: Vec<Option<f64>> = (0..=3).map(sensed).collect();
    assert_eq!(seen, [16.0, 8.0, 4.5, 2.25].map(Some));
    assert_eq!(filled(simulation.layers()), [(2, 1, 2.25)]);

    let results = |tick: usize, robot: &str| &actors.news[tick][&name(robot)].layer_results;
    assert_eq!(results(2, "A")[0].change, 1.0);
    assert_eq!(results(2, "C")[0].refused, Some(LayerRefusal::OutOfRange));
    assert!(results(3, "A").is_empty(), "results come once");

    for line in [
        r#"{"tick":1,"event":"layer_changed","robot":"A","layer":"dust","cells":1,"change":1.0}"#,
        r#"{"tick":1,"event":"layer_refused","robot":"C","layer":"dust","because":"out_of_range"}"#,
    ] {
        assert!(lines.contains(&line.to_owned()), "{lines:?}");
    }
}

#[test]
fn the_digest_of_a_run_covers_each_cell_of_each_layer() {
    let digest = |text: &str| run(text, &[], 2).0.digest();
    let own = digest(FILE);
    assert_eq!(own, digest(FILE));
    // In a corner that no robot senses, and in the layer that none does.
    for other in [
        FILE.replace(
            "peaks = [",
            "peaks = [{ at = [\"5.5 m\", \"0.5 m\"], radius = \"0.5 m\", height = 1e-9 }, ",
        ),
        FILE.replace("value = 1", "value = 1.0000000000000002"),
        FILE.replace("\"heat\"", "\"warmth\""),
    ] {
        assert_ne!(digest(&other), own);
    }
    // Who changed it belongs to a run, too.
    let by = |robot| {
        let set = LayerAction::set("dust", Point::new(3.0, 1.5), 0.0, 1.0);
        run(FILE, &[(1, robot, set)], 1).0.digest()
    };
    assert_ne!(by("A"), by("B"));
}

/// The numbers of a frame.
fn numbers(frame: &LayerFrame) -> Vec<f64> {
    let levels = base64::engine::general_purpose::STANDARD.decode(&frame.levels);
    let range = frame.max - frame.min;
    let levels = levels.unwrap().into_iter();
    levels
        .map(|level| frame.min + range * f64::from(level) / 255.0)
        .collect()
}

#[test]
fn frames_have_the_whole_layer_in_256_levels() {
    let text = with("decay = 0.5\ndiffuse = 0.3");
    let mut layers = Layers::new(&scenario(&text));
    assert_eq!(layers.changed(), []);
    for _ in 0..5 {
        layers.pass_tick();
        let frame = &layers.frames()[0];
        assert_eq!((frame.columns, frame.rows, frame.cell_m), (6, 4, 1.0));
        let cells = dust(&layers);
        assert_eq!(frame.max, cells.iter().copied().fold(0.0, f64::max));
        // The scale does not shrink with what is left.
        assert_eq!(frame.scale, [0.0, 16.0]);
        for (shown, cell) in numbers(frame).iter().zip(&cells) {
            assert!((shown - cell).abs() <= (frame.max - frame.min) / 510.0 + 1e-12);
        }
        let changed = layers.changed();
        assert_eq!(changed.len(), 1, "the heat is as it was");
    }
    let bounded = Layers::new(&scenario(&with("min = -1\nmax = 20")));
    assert_eq!(bounded.frames()[0].scale, [-1.0, 20.0]);
    // All cells are the same.
    assert_eq!(numbers(&layers.frames()[1]), [1.0; 6]);
}

#[test]
fn a_recorded_tick_has_the_layers_after_it() {
    let take = LayerAction::add("dust", Point::new(2.5, 1.5), 0.0, -5.0);
    let mut simulation = Simulation::new(scenario(FILE), 1).unwrap();
    let header = recorded::header(&RunName::new("r").unwrap(), &simulation);
    assert_eq!(header.layers, simulation.layers().frames());

    let mut actors = Actors::of(&simulation, act_on_layers);
    actors.actions.insert((2, name("A")), vec![take]);
    simulation.init(&mut actors).unwrap();
    for tick in 1..4 {
        let record = simulation.step(&mut actors).unwrap();
        let frame = recorded::frame(&simulation, &record);
        // Those that are as at the start need no place in the recording.
        assert_eq!(frame.layers.len(), usize::from(tick >= 2));
        assert_eq!(header.layers_of(&frame), simulation.layers().frames());
    }
}

proptest! {
    #[test]
    fn news_of_an_accepted_layer_are_bounded(
        cells_in_range in 0.5_f64..40.0,
        x in 0.0_f64..60.0,
        y in 0.0_f64..60.0,
        spread in -1e12_f64..1e12,
    ) {
        let text = format!(
            "[field]\nsize = [\"60 m\", \"60 m\"]\n[[layer]]\nname = \"dust\"\ncell = \"1 m\"\nrange = \"{cells_in_range} m\"\n\
             value = {spread:?}\n"
        );
        match parse(&text) {
            Ok(scenario) => {
                let near = Layers::new(&scenario).near(Point::new(x, y));
                let cells: usize = near.iter().map(|layer| layer.cells().count()).sum();
                prop_assert!(cells <= MAX_SENSED_CELLS);
                let bytes = serde_json::to_vec(&near).unwrap().len();
                prop_assert!(bytes < 64 * 1024, "{bytes}");
            }
            // A disc of 26 cells has 2124 cells.
            Err(_) => prop_assert!(cells_in_range > 24.5, "{cells_in_range}"),
        }
    }

    #[test]
    fn a_radius_takes_the_cells_that_a_simple_count_takes(
        x in 0.0_f64..6.0,
        y in 0.0_f64..4.0,
        radius_m in 0.0_f64..1.0,
    ) {
        let mut layers = Layers::new(&scenario(FILE));
        let at = Point::new(x, y);
        layers.begin_actions();
        layers.carry_out(&name("A"), at, &[LayerAction::set("dust", at, radius_m, -1.0)]);
        for (index, cell) in dust(&layers).into_iter().enumerate() {
            let (column, row) = (index % COLUMNS, index / COLUMNS);
            let center = Point::new(column as f64 + 0.5, row as f64 + 0.5);
            let is_own = (x as usize, y as usize) == (column, row);
            let is_changed = is_own || center.distance_m(at) <= radius_m;
            prop_assert_eq!(cell == -1.0, is_changed, "{} {}", column, row);
        }
    }

    #[test]
    fn the_fastest_diffusion_that_is_accepted_keeps_the_sum_and_the_bounds(
        columns in 1_u32..40,
        rows in 1_u32..40,
        cell_m in 0.1_f64..3.0,
        tick_s in 0.01_f64..2.0,
        heights in prop::collection::vec(((0.0..1.0, 0.0..1.0_f64), -1e12..1e12_f64), 1..5),
        share in prop_oneof![Just(1.0), 0.0..1.0_f64],
    ) {
        let fastest = cell_m * cell_m / (4.0 * tick_s);
        let size_m = [f64::from(columns) * cell_m, f64::from(rows) * cell_m];
        let mut text = format!(
            "tick = \"{tick_s} s\"\n[field]\nsize = [\"{} m\", \"{} m\"]\nbody = \"0.1 cm\"\n\
             [[layer]]\nname = \"dust\"\ncell = \"{cell_m} m\"\ndiffuse = {:?}\n",
            size_m[0], size_m[1], fastest * share
        );
        for ((x, y), height) in heights {
            text += &format!(
                "[[layer.peaks]]\nat = [\"{} m\", \"{} m\"]\nradius = \"{} m\"\nheight = {height:?}\n",
                x * size_m[0], y * size_m[1], 2.0 * cell_m
            );
        }
        let scenario = scenario(&text);
        let mut layers = Layers::new(&scenario);
        prop_assert_eq!(dust(&layers).len(), (columns * rows) as usize);

        let ends = |cells: &[f64]| {
            let low = cells.iter().copied().fold(f64::INFINITY, f64::min);
            let high = cells.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            (low, high)
        };
        let start = dust(&layers);
        let (low, high) = ends(&start);
        let scale = low.abs().max(high.abs()).max(1.0);
        let sum: f64 = start.iter().sum();
        for _ in 0..300 {
            layers.pass_tick();
            let cells = dust(&layers);
            let now = ends(&cells);
            prop_assert!(now.0 >= low - 1e-9 * scale && now.1 <= high + 1e-9 * scale, "{:?}", now);
            let now: f64 = cells.iter().sum();
            prop_assert!((now - sum).abs() <= 1e-9 * scale * cells.len() as f64, "{} {}", now, sum);
        }
        for frame in layers.frames() {
            prop_assert_eq!(frame.levels.len(), start.len().div_ceil(3) * 4);
        }
    }
}
