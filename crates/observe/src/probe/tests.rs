//! Measures of made-up runs.

use proptest::prelude::*;
use protocol::messages::{Point, StateVariables, Variable};
use serde_json::json;

use super::*;
use crate::RobotState;

/// Length of a tick, seconds.
const TICK_S: f64 = 0.5;

fn name(robot: &str) -> RobotName {
    RobotName::new(robot).unwrap()
}

fn enters(robot: &str, from: &str, to: &str) -> Event {
    Event::Behavior {
        robot: name(robot),
        from: Some(from.to_owned()),
        to: to.to_owned(),
    }
}

fn feels(robot: &str, to: &str) -> Event {
    Event::Emotion {
        robot: name(robot),
        from: None,
        to: to.to_owned(),
    }
}

fn setting(roster: &[RobotName]) -> RunSetting {
    RunSetting {
        tick_s: TICK_S,
        ticks: 100,
        field_m: [10.0, 10.0],
        body_m: 0.5,
        inradius_m: BTreeMap::new(),
        radio_range_m: None,
        roster: roster.to_vec(),
        sites: BTreeMap::new(),
        layers: Vec::new(),
    }
}

fn measure(text: &str) -> Measure {
    toml::from_str(&format!("name = 'x'\n{text}")).unwrap()
}

/// What happens in a tick, and the variable `v` of robot A after it, of which the flag `is_high` depends.
#[derive(Debug, Clone, Default)]
struct Tick {
    events: Vec<Event>,
    v: Option<f64>,
}

fn happens(events: &[&Event]) -> Tick {
    Tick {
        events: events.iter().copied().cloned().collect(),
        v: None,
    }
}

fn has(v: f64) -> Tick {
    Tick {
        events: Vec::new(),
        v: Some(v),
    }
}

/// Takes a measure of a run with these ticks, the last of which is observed again at the end. The condition lasts from
/// 1 s to 2 s.
fn take(text: &str, ticks: &[Tick]) -> Measured {
    take_at(TICK_S, text, ticks)
}

/// The same with ticks of another length.
fn take_at(tick_s: f64, text: &str, ticks: &[Tick]) -> Measured {
    let measure = measure(text);
    let mut probe = Probe::new(&measure, &setting(&[name("A")]), (1.0, 2.0));
    let mut variables = BTreeMap::new();
    for (tick, happening) in ticks.iter().enumerate() {
        let mut state_variables = StateVariables::new();
        if let Some(v) = happening.v {
            state_variables.insert("v", Variable::Number(v));
            state_variables.insert("is_high", Variable::Flag(v > 3.0));
        }
        variables.insert(name("A"), state_variables);
        observe(&mut probe, tick_s, tick, &happening.events, &variables);
    }

    observe(&mut probe, tick_s, ticks.len() - 1, &[], &variables);
    probe.measured(&Value::Null, &BTreeMap::new())
}

fn observe(
    probe: &mut Probe,
    tick_s: f64,
    tick: usize,
    events: &[Event],
    variables: &BTreeMap<RobotName, StateVariables>,
) {
    probe.observe(&Observation {
        tick: tick as u64,
        tick_s,
        events,
        state: &|robot| {
            variables.get(robot).map(|state_variables| RobotState {
                location: Point::new(0.0, 0.0),
                state_variables,
                emotion_state: "",
                behavior_state: "",
            })
        },
        site: &|_| None,
        layer: &|_| None,
    });
}

fn reason_of(measured: Measured) -> String {
    let Measured::Missing { reason } = measured else {
        panic!("{measured:?}");
    };
    reason
}

fn certain_of(text: &str, ticks: &[Tick]) -> f64 {
    let measured = take(text, ticks);
    let Measured::Value { value } = measured else {
        panic!("{text}: {measured:?}");
    };
    value
}

/// Jain's index of the values that robots of these names have at the end.
fn jain(values: &[(&str, f64)]) -> Measured {
    let measure = measure("jain = { robot = 'S*', name = 'v' }");
    let mut roster = Vec::new();
    let mut variables = BTreeMap::new();
    for (robot, value) in values {
        roster.push(name(robot));
        let mut state_variables = StateVariables::new();
        state_variables.insert("v", Variable::Number(*value));
        variables.insert(name(robot), state_variables);
    }
    let mut probe = Probe::new(&measure, &setting(&roster), (0.0, 1.0));
    observe(&mut probe, TICK_S, 0, &[], &variables);
    probe.measured(&Value::Null, &BTreeMap::new())
}

#[test]
fn jains_index_is_one_where_all_have_the_same_and_1_over_n_where_one_has_all() {
    let of = |values: &[f64]| {
        let names = ["S1", "S2", "S3", "S4"];
        let named: Vec<_> = names.into_iter().zip(values.iter().copied()).collect();
        jain(&named)
    };
    assert_eq!(of(&[3.0; 4]), Measured::from(1.0));
    assert_eq!(of(&[0.0, 7.0, 0.0, 0.0]), Measured::from(0.25));
    // (1 + 2 + 3)^2 / (3 (1 + 4 + 9))
    assert_eq!(of(&[1.0, 2.0, 3.0]), Measured::from(36.0 / 42.0));
    assert_eq!(of(&[5.0]), Measured::from(1.0));
    let others = [("S1", 1.0), ("Butler", 99.0), ("S2", 1.0)];
    assert_eq!(jain(&others), Measured::from(1.0), "of those that match");

    assert!(reason_of(of(&[0.0, 0.0])).contains("every robot has 0"));
    assert!(reason_of(of(&[1.0, -1.0])).contains("the number of S2 is -1"));
    let missing = "jain = { robot = 'A', name = 'w' }";
    assert!(reason_of(take(missing, &[has(1.0)])).contains("A has no number `w`"));
}

#[test]
fn a_ratio_is_one_number_over_another() {
    let variable = "variable = { robot = 'A', name = 'v', as = 'end' }";
    let ratio = |of: &str, by: &str| format!("ratio = {{ of = {{ {of} }}, by = {{ {by} }} }}");
    let ticks = [has(2.0), has(8.0)];
    let largest = "variable = { robot = 'A', name = 'v', as = 'max' }";
    let area = "variable = { robot = 'A', name = 'v', as = 'area' }";
    assert_eq!(certain_of(&ratio(variable, largest), &ticks), 1.0);
    assert_eq!(certain_of(&ratio(variable, area), &ticks), 8.0);
    let count = "count = { event = 'behavior', to = 'X' }, when = 'after'";
    assert_eq!(certain_of(&ratio(count, variable), &ticks), 0.0);

    let both = format!("ratio = {{ of = [{{ {variable} }}, {{ {area} }}], by = {{ {largest} }} }}");
    assert_eq!(certain_of(&both, &ticks), 1.125);

    let time = "time = { to = { event = 'behavior', to = 'X' } }";
    let none = "summary = 'a.b'";
    for (of, by, reason) in [
        (variable, count, "divided by 0"),
        (time, variable, "what is divided is not reached"),
        (variable, none, "what it is divided by is missing"),
    ] {
        let error = reason_of(take(&ratio(of, by), &ticks));
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn a_path_in_the_summary_is_followed_and_a_star_is_a_sum() {
    let summary = json!({ "robots": { "A": { "sent": { "x": 2, "y": 3 } }, "B": { "sent": {} } } });
    let at = |path: &str| {
        let measure = measure(&format!("summary = '{path}'"));
        let probe = Probe::new(&measure, &setting(&[]), (0.0, 1.0));
        probe.measured(&summary, &BTreeMap::new())
    };
    assert_eq!(at("robots.A.sent.x"), Measured::from(2.0));
    assert_eq!(at("robots.*.sent.*"), Measured::from(5.0));
    // What did not occur has no entry, and is 0.
    assert_eq!(at("robots.B.sent.x"), Measured::from(0.0));
    assert_eq!(at("robots.*.sent.y"), Measured::from(3.0));
    assert_eq!(at("robots.*.sent.z"), Measured::from(0.0));
    assert_eq!(at("robots.A*.sent.*"), Measured::from(5.0));
    assert_eq!(at("robots.{1..2}.sent.*"), Measured::from(0.0));
    for missing in ["robots.A.sent", "robots.A.x", "robots.C.sent.x"] {
        let error = reason_of(at(missing));
        assert!(error.contains(missing), "{error}");
    }
}

#[test]
fn events_count_in_their_part_of_the_run() {
    let enters = enters("A", "X", "Y");
    let mut ticks = vec![Tick::default(); 6];
    ticks[0] = happens(&[&enters]);
    // The condition lasts from tick 2 until tick 4.
    ticks[2] = happens(&[&enters, &enters]);
    ticks[3] = happens(&[&enters, &feels("A", "Y")]);
    ticks[4] = happens(&[&enters]);
    ticks[5] = happens(&[&enters]);

    let count = "count = { event = 'behavior', robot = 'A', to = 'Y' }";
    assert_eq!(certain_of(count, &ticks), 6.0);
    assert_eq!(
        certain_of(&format!("{count}\nwhen = 'during'"), &ticks),
        3.0
    );
    assert_eq!(certain_of(&format!("{count}\nwhen = 'after'"), &ticks), 2.0);
    assert_eq!(certain_of(count, &[Tick::default()]), 0.0);
    let other = "count = { event = 'behavior', robot = 'B' }";
    assert_eq!(certain_of(other, &ticks), 0.0);
}

#[test]
fn a_time_ends_with_the_first_event_or_is_censored_at_the_end() {
    let to_y = "time = { to = { event = 'behavior', to = 'Y' } }";
    let after_z = "time = { to = { event = 'behavior', robot = '*', to = 'Y' }, \
                   after = { event = 'behavior', robot = '*', to = 'Z' } }";
    let y = enters("A", "X", "Y");
    let z = enters("A", "X", "Z");
    let come = |time_s| Measured::Reached { time_s };
    let waited = |waited_s| Measured::NotReached { waited_s };
    let nothing = Tick::default();
    let both = happens(&[&y, &z]);
    let y = happens(&[&y]);
    let z = happens(&[&z]);

    for (text, ticks, expected) in [
        (to_y, vec![&y, &nothing, &y], come(0.0)),
        (to_y, vec![&nothing, &nothing, &y], come(1.0)),
        (to_y, vec![&nothing, &nothing, &nothing], waited(1.0)),
        (after_z, vec![&y, &z, &nothing, &y, &y], come(1.0)),
        (after_z, vec![&nothing, &z, &z, &y], come(1.0)),
        // The events of a tick happen at the same time, whatever their order in the record.
        (after_z, vec![&nothing, &both], come(0.0)),
        (after_z, vec![&nothing, &z, &nothing, &nothing], waited(1.0)),
        (after_z, vec![&nothing, &z], waited(0.0)),
        (after_z, vec![&y, &nothing, &nothing], Measured::NotAtRisk),
    ] {
        let ticks: Vec<Tick> = ticks.into_iter().cloned().collect();
        assert_eq!(take(text, &ticks), expected, "{text}: {ticks:?}");
    }
}

#[test]
fn durations_are_taken_between_pairs() {
    let numbers = |ticks: &[Tick]| {
        ["mean", "max", "sum", "count"].map(|number| {
            let text = format!(
                "between = {{ begin = {{ event = 'behavior', robot = 'A', to = 'Y' }}, \
                 end = {{ event = 'behavior', robot = 'A', from = 'Y' }}, as = '{number}' }}"
            );
            take(&text, ticks)
        })
    };
    let values = |values: [f64; 4]| values.map(Measured::from);
    let begin = enters("A", "X", "Y");
    let end = enters("A", "Y", "X");
    let again = enters("A", "Y", "Y");
    let nothing = Tick::default();

    let no_pair = [Measured::NoPair, Measured::NoPair, 0.0.into(), 0.0.into()];
    assert_eq!(numbers(&[nothing.clone(), happens(&[&end])]), no_pair);
    let mut pairs = vec![
        happens(&[&begin]),
        happens(&[&begin]), // One is open.
        happens(&[&end, &begin]),
        nothing.clone(),
        nothing.clone(),
        happens(&[&end]),
        happens(&[&end]),
    ];
    assert_eq!(numbers(&pairs), values([1.25, 1.5, 2.5, 2.0]));
    // Both in one tick, in the order of the record.
    let at_once = [Tick::default(), happens(&[&begin, &end]), Tick::default()];
    assert_eq!(numbers(&at_once), values([0.0, 0.0, 0.0, 1.0]));

    // How long a pair lasts that is open at the end is not known, also where it begins there.
    let unfinished = |[mean, max, sum]: [f64; 3], count: f64| {
        let [mean, max, sum] = [mean, max, sum].map(|at_least| Measured::Unfinished { at_least });
        [mean, max, sum, count.into()]
    };
    let open = [happens(&[&begin]), nothing.clone(), nothing.clone()];
    assert_eq!(numbers(&open), unfinished([1.0, 1.0, 1.0], 0.0));
    let at_end = [nothing.clone(), happens(&[&begin])];
    assert_eq!(numbers(&at_end), unfinished([0.0, 0.0, 0.0], 0.0));
    pairs.push(happens(&[&begin]));
    pairs.push(nothing);
    assert_eq!(numbers(&pairs), unfinished([1.0, 1.5, 3.0], 2.0));
    let until_end = "between = { begin = { event = 'behavior', robot = 'A', to = 'Y' }, \
                     end = { event = 'lost', robot = 'A' }, as = 'count', until_end = true }";
    assert_eq!(certain_of(until_end, &pairs), 1.0);
    let until_end = until_end.replace("count", "sum");
    assert_eq!(certain_of(&until_end, &pairs), 4.0);
    // One event may end a pair and begin the next.
    let chain = [happens(&[&begin]), happens(&[&again]), Tick::default()];
    assert_eq!(numbers(&chain), unfinished([0.5, 0.5, 1.0], 1.0));
}

/// Times are ticks times the length of a tick: 0.4 s - 0.1 s is not 0.3 s in floating-point numbers.
#[test]
fn times_are_the_shortest_decimals_that_are_right() {
    let x = enters("A", "Y", "X");
    let y = enters("A", "X", "Y");
    let mut ticks = vec![Tick::default(); 9];
    ticks[1] = happens(&[&y]);
    ticks[4] = happens(&[&x]);
    ticks[5] = happens(&[&y]);
    ticks[8] = happens(&[&x]);

    let begin = "{ event = 'behavior', robot = 'A', to = 'Y' }";
    let end = "{ event = 'behavior', robot = 'A', to = 'X' }";
    let other = "{ event = 'behavior', robot = 'A', to = 'Z' }";
    let time = format!("time = {{ after = {begin}, to = {end} }}");
    let waits = format!("time = {{ after = {end}, to = {other} }}");
    let pairs = |number| format!("between = {{ begin = {begin}, end = {end}, as = '{number}' }}");
    let reached = |time_s| Measured::Reached { time_s };
    let waited = |waited_s| Measured::NotReached { waited_s };
    for (tick_s, text, expected) in [
        (0.1, time.clone(), reached(0.3)),
        (1.0 / 3.0, time, reached(1.0)),
        (0.1, waits, waited(0.4)),
        (0.1, pairs("max"), 0.3.into()),
        (0.1, pairs("sum"), 0.6.into()),
        (0.1, pairs("mean"), 0.3.into()),
        (0.025, pairs("max"), 0.075.into()),
    ] {
        assert_eq!(take_at(tick_s, &text, &ticks), expected, "{tick_s}: {text}");
    }
}

#[test]
fn a_share_is_of_the_time_of_the_run() {
    let sad = "share = { robot = 'A', emotion = ['SAD', 'WORRIED'] }";
    let behavior = "share = { robot = 'A', behavior = 'Y' }";
    let ticks = [
        happens(&[&feels("A", "SAD"), &enters("A", "X", "Y")]),
        happens(&[&feels("A", "WORRIED"), &feels("B", "HAPPY")]),
        happens(&[&feels("A", "HAPPY"), &enters("B", "Y", "X")]),
        happens(&[&feels("B", "SAD")]),
        happens(&[&feels("A", "SAD")]),
    ];
    assert_eq!(certain_of(sad, &ticks), 0.5);
    assert_eq!(certain_of(behavior, &ticks), 1.0);
    assert_eq!(certain_of(sad, &[Tick::default(), Tick::default()]), 0.0);
    let at_once = take(sad, &ticks[..1]);
    assert!(reason_of(at_once).contains("tick 0"));
}

/// From the tick in which it is lost on a robot is in no state; the share is of the whole run nevertheless.
#[test]
fn a_robot_that_is_lost_is_in_no_state() {
    let lost = Event::Lost { robot: name("A") };
    let back = Event::Joined {
        robot: name("A"),
        generation: None,
        at: Default::default(),
    };
    let mut ticks = vec![Tick::default(); 11];
    ticks[0] = happens(&[&feels("A", "SAD")]);
    ticks[3] = happens(&[&lost]);
    let sad = "share = { robot = 'A', emotion = 'SAD' }";
    assert_eq!(certain_of(sad, &ticks), 0.3);

    ticks[8] = happens(&[&back]);
    assert_eq!(certain_of(sad, &ticks), 0.5);
    ticks[8] = happens(&[&back, &feels("A", "HAPPY")]);
    assert_eq!(certain_of(sad, &ticks), 0.3);
}

#[test]
fn a_variable_keeps_its_value_until_the_next_report() {
    let numbers = |ticks: &[Tick]| {
        ["end", "max", "mean", "area"].map(|number| {
            let text = format!("variable = {{ robot = 'A', name = 'v', as = '{number}' }}");
            certain_of(&text, ticks)
        })
    };
    let ticks = [has(2.0), has(6.0), Tick::default(), has(1.0), has(4.0)];
    assert_eq!(numbers(&ticks), [4.0, 6.0, 3.75, 7.5]);
    let is_high = "variable = { robot = 'A', name = 'is_high', as = 'mean' }";
    assert_eq!(certain_of(is_high, &ticks), 0.5);
    assert_eq!(numbers(&[has(-3.0)]), [-3.0, -3.0, -3.0, 0.0]);
    // The mean is over the time since the first value.
    assert_eq!(
        numbers(&[Tick::default(), has(2.0), has(2.0)]),
        [2.0, 2.0, 2.0, 1.0]
    );

    for (robot, variable) in [("A", "w"), ("B", "v")] {
        let text = format!("variable = {{ robot = '{robot}', name = '{variable}', as = 'end' }}");
        let error = reason_of(take(&text, &ticks));
        let expected = format!("{robot} has no number `{variable}`");
        assert!(error.contains(&expected), "{error}");
    }
}

/// A standstill of 2 s in a run in which `v` rises in these ticks.
fn stalled(rises: &[usize], ticks: usize) -> Measured {
    let mut v = 0.0;
    let mut run = Vec::new();
    for tick in 0..=ticks {
        if rises.contains(&tick) {
            v += 1.0;
        }
        run.push(has(v));
    }
    take("stalled = { progress = ['A.v'], for = '2 s' }", &run)
}

#[test]
fn a_standstill_lasts_until_the_end() {
    let at = |time_s| Measured::Reached { time_s };
    let not_by = |waited_s| Measured::NotReached { waited_s };
    assert_eq!(stalled(&[2, 6], 10), at(3.0));
    assert_eq!(stalled(&[2, 7], 10), not_by(5.0));
    assert_eq!(stalled(&[10], 10), not_by(5.0));
    // The first value is no progress.
    assert_eq!(stalled(&[], 10), at(0.0));
    assert_eq!(stalled(&[], 3), not_by(1.5));

    let error = take("stalled = { progress = ['A.w'], for = '2 s' }", &[has(1.0)]);
    let error = reason_of(error);
    assert!(error.contains("A has no number `w`"), "{error}");
}

proptest! {
    /// Measures that can be counted tick by tick, too: behaviors of a robot and a variable that changes with them.
    #[test]
    fn measures_agree_with_a_count_of_ticks(behaviors in prop::collection::vec(0..3_u8, 2..60)) {
        let word = |behavior: u8| ["X", "Y", "Z"][usize::from(behavior)];
        let mut ticks = Vec::new();
        for (tick, behavior) in behaviors.iter().enumerate() {
            let before = tick.checked_sub(1).map(|before| behaviors[before]);
            let mut happening = has(f64::from(*behavior));
            if before != Some(*behavior) {
                happening.events.push(Event::Behavior {
                    robot: name("A"),
                    from: before.map(|before| word(before).to_owned()),
                    to: word(*behavior).to_owned(),
                });
            }
            ticks.push(happening);
        }

        // The state of a tick lasts until the next one.
        let lasting = &behaviors[..behaviors.len() - 1];
        let in_y = lasting.iter().filter(|behavior| **behavior == 1).count() as f64;
        let area: u32 = lasting.iter().map(|behavior| u32::from(*behavior)).sum();
        let run_s = lasting.len() as f64 * TICK_S;

        let stays = "begin = { event = 'behavior', robot = '*', to = 'Y' }, \
                     end = { event = 'behavior', robot = '*', from = 'Y' }";
        let share = in_y / lasting.len() as f64;
        let area = f64::from(area) * TICK_S;
        let entered = certain_of("count = { event = 'behavior', to = 'Y' }", &ticks);
        let is_open = behaviors.last() == Some(&1);
        let ended = entered - f64::from(u8::from(is_open));

        let sum = take(&format!("between = {{ {stays}, as = 'sum' }}"), &ticks);
        let expected = in_y * TICK_S;
        let is_right = match sum {
            Measured::Value { value } => !is_open && (value - expected).abs() < 1e-9,
            Measured::Unfinished { at_least } => is_open && (at_least - expected).abs() < 1e-9,
            _ => false,
        };
        prop_assert!(is_right, "{sum:?}");

        for (text, expected) in [
            ("share = { robot = 'A', behavior = 'Y' }".to_owned(), share),
            (format!("between = {{ {stays}, as = 'count' }}"), ended),
            ("variable = { robot = 'A', name = 'v', as = 'area' }".to_owned(), area),
            ("variable = { robot = 'A', name = 'v', as = 'mean' }".to_owned(), area / run_s),
        ] {
            let found = certain_of(&text, &ticks);
            prop_assert!((found - expected).abs() < 1e-9, "{}: {} is not {}", text, found, expected);
        }
    }
}
