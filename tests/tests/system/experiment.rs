//! The experiment of the paper ("Experimental Results"), item by item, over many seeds of the shipped scenario.

use protocol::messages::Point;
use simulator::Event;
use system_tests::Lab;
use system_tests::hall::{Hall, scenario};

const HALL: &str = "configs/hors_doeuvres.toml";
const THREE: &str = "configs/three_robots.toml";
const FT_M: f64 = 0.3048;
const SEEDS: std::ops::RangeInclusive<u64> = 1..=12;

/// Behavior of one robot in two ticks in a row.
struct Change<'a> {
    hall: &'a Hall,
    events: &'a [Event],
    seed: u64,
    butler: (&'a str, &'a str),
    leguin: (&'a str, &'a str),
}

/// Plays the hall over all seeds and shows every tick to `look`.
fn watch(file: &str, set: &[&str], mut look: impl FnMut(&Change<'_>)) {
    for seed in SEEDS {
        let mut hall = Hall::new(scenario(file, seed, set));
        for _ in 0..hall.simulation.scenario().ticks {
            let (butler, leguin) = (hall.behavior("Butler"), hall.behavior("Leguin"));
            let events = hall.step();
            let now = (hall.behavior("Butler"), hall.behavior("Leguin"));
            look(&Change {
                hall: &hall,
                events: &events,
                seed,
                butler: (&butler, &now.0),
                leguin: (&leguin, &now.1),
            });
        }
    }
}

fn sent(events: &[Event], what: &str) -> usize {
    events
        .iter()
        .filter(|event| matches!(event, Event::CommandSent { command, .. } if command == what))
        .count()
}

#[test]
fn item_15_to_17_the_hall_is_that_of_the_paper() {
    let scenario = scenario(HALL, 1, &[]);
    assert_eq!(scenario.field_m, [50.0 * FT_M, 50.0 * FT_M]);
    assert_eq!((scenario.guests.count, scenario.body_m), (100, 2.0 * FT_M));
    let table = scenario.obstacles[0];
    let hall = Hall::new(scenario);
    assert!(hall.at("Leguin").distance_m(table) <= 4.0 * FT_M, "Leguin is at the table");
    assert!(hall.at("Butler").distance_m(Point::new(25.0 * FT_M, 25.0 * FT_M)) < 3.0 * FT_M);
    assert_eq!(hall.number("Butler", "treats"), 30.0);
    assert_eq!((hall.emotion("Butler"), hall.behavior("Butler")), ("HAPPY".into(), "SERVE".into()));
    assert_eq!((hall.emotion("Leguin"), hall.behavior("Leguin")), ("HAPPY".into(), "WAIT".into()));
}

#[test]
fn item_17_and_22_and_23_an_exchange_happens_within_four_feet_and_fills_the_tray() {
    let (mut exchanges, mut from_intercept) = (0, 0);
    watch(HALL, &[], |change| {
        let hall = change.hall;
        if change.butler.0 != "EXCHANGE" && change.butler.1 == "EXCHANGE" {
            exchanges += 1;
            from_intercept += u32::from(change.butler.0 == "INTERCEPT");
            // He knows where she was at the last tick; meanwhile each may have moved by one stride.
            let stride_m = 4.5 * FT_M * hall.simulation.scenario().tick_s;
            let apart_m = hall.at("Butler").distance_m(hall.at("Leguin"));
            assert!(apart_m <= 4.0 * FT_M + stride_m, "seed {}: {apart_m} m", change.seed);
        }
        if change.butler.0 == "EXCHANGE" && change.butler.1 != "EXCHANGE" {
            assert_eq!((change.butler.1, hall.number("Butler", "treats")), ("GO_BACK", 30.0));
            assert_eq!(sent(change.events, "go home"), 1, "he sends her home");
        } else {
            assert_eq!(sent(change.events, "go home"), 0, "only after an exchange");
        }
    });
    println!("{exchanges} exchanges, {from_intercept} of them begun from INTERCEPT");
    assert!(exchanges > 50 && from_intercept > 0);
}

#[test]
fn item_20_and_25_butler_goes_back_to_where_he_started_and_serves_again() {
    let start = Point::new(25.0 * FT_M, 25.0 * FT_M);
    let (mut returns, mut emptied) = (0, 0);
    watch(HALL, &[], |change| {
        if change.butler == ("GO_BACK", "SERVE") {
            returns += 1;
            let missed_m = change.hall.at("Butler").distance_m(start);
            assert!(missed_m <= 2.5 * FT_M, "seed {}: {missed_m} m from the start", change.seed);
        }
        emptied += u32::from(change.butler.1 == "GO_BACK" && change.hall.number("Butler", "treats") == 0.0);
    });
    println!("{returns} returns; in {emptied} ticks the tray was empty before the start was reached");
    assert!(returns > 50);
    assert!(emptied > 0, "sometimes the treats are gone before he is back");
}

#[test]
fn item_21_a_crowd_makes_butler_intercept_and_no_crowd_does_not() {
    let intercepts = |guests: &str| {
        let (mut exchanges, mut from_intercept) = (0.0, 0.0);
        watch(HALL, &[guests], |change| {
            if change.butler.0 != "EXCHANGE" && change.butler.1 == "EXCHANGE" {
                exchanges += 1.0;
                from_intercept += f64::from(u8::from(change.butler.0 == "INTERCEPT"));
            }
        });
        from_intercept / exchanges
    };
    let (none, some, many) =
        (intercepts("guests.count=0"), intercepts("guests.count=50"), intercepts("guests.count=100"));
    println!(
        "share of exchanges begun from INTERCEPT: {none:.2} without guests, {some:.2} with 50, {many:.2} with 100"
    );
    assert!(none <= 0.05, "{none}");
    assert!(none < some && some < many, "{none} {some} {many}");
}

#[test]
fn item_21_intercepting_is_moving_toward_leguin() {
    /// Share of the moves that brought Butler nearer to where Leguin was.
    fn share_toward(behavior: &str) -> f64 {
        let (mut nearer, mut moves) = (0_u32, 0_u32);
        let mut before: Option<(Point, Point)> = None;
        watch(HALL, &[], |change| {
            let now = (change.hall.at("Butler"), change.hall.at("Leguin"));
            let has_way_to_go = matches!(change.leguin.0, "REFILL" | "WAIT");
            if let (true, true, Some((butler, leguin))) = (
                change.butler == (behavior, behavior),
                has_way_to_go,
                before.filter(|before| before.0 != now.0),
            ) {
                moves += 1;
                nearer += u32::from(now.0.distance_m(leguin) < butler.distance_m(leguin));
            }
            before = Some(now);
        });
        f64::from(nearer) / f64::from(moves)
    }
    let (intercept, serve) = (share_toward("INTERCEPT"), share_toward("SERVE"));
    println!("share of moves toward Leguin: {intercept:.2} intercepting, {serve:.2} serving");
    assert!(intercept > 0.75, "he drives straight at her, around guests where he must: {intercept}");
    assert!(serve < 0.65, "serving is a random walk: {serve}");
}

#[test]
fn item_23_after_the_exchange_leguin_stands_until_she_is_sent_home() {
    let mut at: Option<Point> = None;
    let (mut waits, mut departures) = (0, 0);
    watch(HALL, &[], |change| {
        let delivered = change
            .events
            .iter()
            .any(|event| matches!(event, Event::CommandDelivered { to, .. } if to.as_str() == "Leguin"));
        // What she does in a tick moves her in the next: in the first tick of GO_HOME she still stands.
        if matches!(change.leguin, ("EXCHANGE" | "AWAIT_GO_HOME", "AWAIT_GO_HOME" | "GO_HOME")) {
            waits += 1;
            assert_eq!(Some(change.hall.at("Leguin")), at, "seed {}", change.seed);
        }
        if change.leguin == ("AWAIT_GO_HOME", "GO_HOME") {
            departures += 1;
            assert!(delivered, "seed {}: she left without having been sent", change.seed);
        }
        assert!(change.leguin != ("EXCHANGE", "GO_HOME"), "she stops and waits in between");
        at = Some(change.hall.at("Leguin"));
    });
    assert!(waits > 50 && departures > 50, "{waits} {departures}");
}

#[test]
fn item_24_at_the_table_leguin_waits_for_refill_or_hurry() {
    let mut starts = 0;
    let mut at: Option<Point> = None;
    watch(HALL, &[], |change| {
        if change.leguin == ("WAIT", "WAIT") {
            assert_eq!(
                Some(change.hall.at("Leguin")),
                at.or(Some(change.hall.at("Leguin"))),
                "seed {}",
                change.seed
            );
        }
        if change.leguin == ("WAIT", "REFILL") {
            starts += 1;
        }
        assert!(change.leguin != ("WAIT", "GO_HOME"));
        at = (change.leguin.1 == "WAIT").then(|| change.hall.at("Leguin"));
    });
    assert!(starts > 50);
}

#[test]
fn item_26_the_state_of_figure_6_is_reached() {
    let mut found = Vec::new();
    watch(HALL, &[], |change| {
        let hall = change.hall;
        let is_concerned = hall.emotion("Butler") == "CONCERNED" && hall.emotion("Leguin") == "CONCERNED";
        if !is_concerned || hall.number("Butler", "treats") != 7.0 {
            return;
        }
        let home = hall.simulation.scenario().robots.values().nth(1).unwrap().at;
        let (done_m, left_m) =
            (hall.at("Leguin").distance_m(home), hall.at("Leguin").distance_m(hall.at("Butler")));
        let part = done_m / (done_m + left_m);
        if (change.butler.1, change.leguin.1) == ("SERVE", "REFILL") && (0.3..=0.7).contains(&part) {
            found.push((change.seed, hall.simulation.tick(), part));
        }
    });
    println!("Figure 6 (seed, tick, part of the way): {found:?}");
    assert!(!found.is_empty());
}

#[test]
fn item_27_vonda_stands_still_unless_she_is_called() {
    let mut hall = Hall::new(scenario(THREE, 1, &[]));
    let (at, emotion, behavior) = (hall.at("Vonda"), hall.emotion("Vonda"), hall.behavior("Vonda"));
    for _ in 0..hall.simulation.scenario().ticks {
        hall.step();
        assert_eq!(
            (hall.at("Vonda"), hall.emotion("Vonda"), hall.behavior("Vonda")),
            (at, emotion.clone(), behavior.clone())
        );
    }
    assert!(hall.number("Butler", "exchanges") > 3.0, "Leguin works meanwhile");
}

#[test]
fn item_27_vonda_comes_in_leguins_place_when_butlers_parameter_names_her() {
    let mut hall = Hall::new(scenario(THREE, 1, &["robot.Butler.params.refiller=Vonda"]));
    let at = hall.at("Leguin");
    let mut vonda_worked = false;
    for _ in 0..hall.simulation.scenario().ticks {
        hall.step();
        assert_eq!((hall.at("Leguin"), hall.behavior("Leguin")), (at, "WAIT".into()));
        vonda_worked |= hall.behavior("Vonda") == "EXCHANGE";
    }
    assert!(vonda_worked && hall.number("Butler", "exchanges") > 3.0);
}

#[test]
fn the_readable_log_tells_the_story() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "story", "--duration", "300 s"]);
    let log = std::fs::read_to_string(lab.file("story", "cars.log")).unwrap();
    for part in
        ["emotion HAPPY -> CONFIDENT", "-> Leguin: refill", "behavior WAIT -> REFILL", "-> Leguin: go home"]
    {
        assert!(log.contains(part), "no {part:?} in\n{log}");
    }
}
