//! Numbers of teams and places, as measures and in conditions, with values that were computed by hand.

use std::collections::BTreeMap;

use observe::{
    Evaluation, Measure, Measured, Observation, Probe, RobotState, RunSetting, TickCondition,
};
use proptest::prelude::*;
use protocol::messages::{End, Point, StateVariables, Variable};
use protocol::{Event, RobotName};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a robot reports in a tick.
#[derive(Debug, Clone, Default)]
struct Report {
    at: Point,
    variables: StateVariables,
    behavior: &'static str,
}

/// What each robot has reported last, tick by tick; robots are called R0, R1 and so on.
#[derive(Debug, Clone, Default)]
struct Run {
    ticks: Vec<(Vec<Option<Report>>, Vec<Event>)>,
}

fn robot(index: usize) -> RobotName {
    RobotName::new(&format!("R{index}")).unwrap()
}

fn setting(robots: usize) -> RunSetting {
    RunSetting {
        tick_s: 0.5,
        ticks: 20,
        field_m: [4.0, 2.0],
        body_m: 0.5,
        inradius_m: BTreeMap::new(),
        radio_range_m: Some(3.0),
        roster: (0..robots).map(robot).collect(),
        sites: BTreeMap::new(),
        layers: Vec::new(),
    }
}

fn at(x: f64, y: f64) -> Option<Report> {
    Some(Report {
        at: Point::new(x, y),
        ..Report::default()
    })
}

fn has(v: f64) -> Option<Report> {
    let mut variables = StateVariables::new();
    variables.insert("v", Variable::Number(v));
    variables.insert("is_done", Variable::Flag(v >= 2.0));
    Some(Report {
        variables,
        ..Report::default()
    })
}

impl Run {
    fn of(ticks: &[&[Option<Report>]]) -> Self {
        let ticks = ticks.iter().map(|robots| (robots.to_vec(), Vec::new()));
        Self {
            ticks: ticks.collect(),
        }
    }

    fn robots(&self) -> usize {
        self.ticks
            .iter()
            .map(|(robots, _)| robots.len())
            .max()
            .unwrap()
    }

    /// Shows each tick, and the end of the run if it has one.
    fn show(&self, end: Option<Event>, mut see: impl FnMut(&Observation<'_>)) {
        let mut ticks = self.ticks.clone();
        let (robots, _) = ticks.last().cloned().unwrap();
        let last = ticks.len() - 1;
        ticks.extend(end.map(|end| (robots, vec![end])));
        for (tick, (robots, events)) in ticks.iter().enumerate() {
            let by_name: BTreeMap<RobotName, &Report> = robots
                .iter()
                .enumerate()
                .filter_map(|(index, report)| Some((robot(index), report.as_ref()?)))
                .collect();
            see(&Observation {
                tick: tick.min(last) as u64,
                tick_s: 0.5,
                events,
                state: &|name| {
                    by_name.get(name).map(|report| RobotState {
                        location: report.at,
                        state_variables: &report.variables,
                        emotion_state: "",
                        behavior_state: report.behavior,
                    })
                },
                site: &|_| None,
                layer: &|_| None,
            });
        }
    }

    fn measure_until(&self, text: &str, because: Option<&str>) -> Measured {
        let measure: Measure = toml::from_str(&format!("name = 'x'\n{text}")).unwrap();
        let setting = setting(self.robots());
        measure.check(&setting).unwrap();
        let mut probe = Probe::new(&measure, &setting, (0.0, 1.0));
        let end = Event::End {
            reason: End::Finished,
            because: because.map(str::to_owned),
            waited_for: Vec::new(),
            digest: String::new(),
            seal: None,
        };
        self.show(Some(end), |seen| probe.observe(seen));
        probe.measured(&Value::Null, &BTreeMap::new())
    }

    fn measure(&self, text: &str) -> Measured {
        self.measure_until(text, None)
    }

    /// The ticks in which a condition holds.
    fn holds_in(&self, text: &str) -> Vec<u64> {
        let condition = condition(text).unwrap();
        let setting = setting(self.robots());
        condition.check(&setting).unwrap();
        let mut evaluation = Evaluation::new(&condition, &setting);
        let mut ticks = Vec::new();
        self.show(None, |seen| {
            if evaluation.holds(seen).is_some() {
                ticks.push(seen.tick);
            }
        });
        ticks
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct File {
    c: TickCondition,
}

fn condition(text: &str) -> Result<TickCondition, String> {
    let file: Result<File, _> = toml::from_str(&format!("c = {text}"));
    file.map(|file| file.c)
        .map_err(|error| error.message().to_owned())
}

fn value(value: f64) -> Measured {
    Measured::Value { value }
}

#[test]
fn numbers_of_robots_are_combined_in_each_tick() {
    let run = Run::of(&[
        &[has(0.0), has(4.0), has(2.0)],
        &[has(1.0), has(1.0), has(4.0)],
    ]);
    for (by, taken, expected) in [
        ("sum", "end", 6.0),
        ("sum", "area", 3.0),
        ("mean", "end", 2.0),
        ("max", "min", 4.0),
        ("min", "max", 1.0),
        ("spread", "end", 3.0),
        ("spread", "max", 4.0),
        ("all", "end", 1.0),
        ("all", "min", 0.0),
        ("any", "min", 1.0),
        ("count", "min", 2.0),
        // 6² / (3 · 18)
        ("jain", "end", 36.0 / 54.0),
    ] {
        let text =
            format!("variable = {{ robots = '*', by = '{by}', name = 'v', as = '{taken}' }}");
        assert_eq!(run.measure(&text), value(expected), "{text}");
    }
    let some = "variable = { robots = ['R1', 'R2'], by = 'sum', name = 'v', as = 'end' }";
    assert_eq!(run.measure(some), value(5.0));

    let incomplete = Run::of(&[&[has(1.0), None], &[has(1.0), None]]);
    let sum = "variable = { robots = '*', by = 'sum', name = 'v', as = 'end' }";
    let Measured::Missing { reason } = incomplete.measure(sum) else {
        panic!("R1 has no number");
    };
    assert!(reason.contains("R1 has no number `v`"), "{reason}");
}

#[test]
fn places_are_measured() {
    // R0 walks 3, 4 and 0 m; R1 stands.
    let run = Run::of(&[
        &[at(0.0, 0.0), at(3.0, 0.0)],
        &[at(3.0, 0.0), at(3.0, 0.0)],
        &[at(3.0, 4.0), at(3.0, 0.0)],
        &[at(3.0, 4.0), at(3.0, 0.0)],
    ]);
    for (text, expected) in [
        ("walked = { robot = 'R0' }", 7.0),
        ("walked = { robot = 'R1' }", 0.0),
        ("walked = { robots = '*', by = 'sum' }", 7.0),
        ("walked = { robots = '*', by = 'mean', as = 'max' }", 3.5),
        ("distance = { robot = 'R0', to = ['3 m', '0 m'] }", 4.0),
        (
            "distance = { robot = 'R0', to = ['3 m', '0 m'], as = 'min' }",
            0.0,
        ),
        // 3, 0 and 4 m until the next tick; the last tick lasts for no time.
        (
            "distance = { robot = 'R0', to = ['3 m', '0 m'], as = 'mean' }",
            7.0 / 3.0,
        ),
        (
            "distance = { robots = '*', by = 'max', to = ['0 m', '0 m'] }",
            5.0,
        ),
        ("distance = { robot = 'R0', to = 'R1' }", 4.0),
        ("distance = { robots = '*', by = 'min', to = 'R1' }", 0.0),
        ("distance = { robots = '*', by = 'min' }", 4.0),
        ("distance = { robots = '*', by = 'mean', as = 'max' }", 4.0),
        ("distance = { robots = '*', by = 'max', as = 'min' }", 0.0),
        // Ticks 0, 1 and 2: 1, 1 and 0.
        (
            "inside = { robot = 'R0', rectangle = [['0 m', '1 m'], ['5 m', '0 m']], as = 'area' }",
            1.0,
        ),
        (
            "inside = { robot = 'R0', rectangle = [['0 m', '1 m'], ['5 m', '0 m']], as = 'mean' }",
            2.0 / 3.0,
        ),
        (
            "inside = { robots = '*', by = 'count', disc = { center = ['3 m', '0 m'], radius = '1 m' }, as = 'max' }",
            2.0,
        ),
        (
            "inside = { robots = '*', by = 'all', disc = { center = ['3 m', '0 m'], radius = '1 m' } }",
            0.0,
        ),
        ("components = { robots = '*', range = '3 m' }", 2.0),
        // That of the radios.
        ("components = { robots = '*' }", 2.0),
        (
            "components = { robots = '*', range = '4 m', as = 'max' }",
            1.0,
        ),
        (
            "components = { robots = '*', range = '3 m', as = 'mean' }",
            4.0 / 3.0,
        ),
        // Of 4 × 2 cells: from (0, 0) none but the first; from (3, 0) two more.
        (
            "covered = { robots = 'R0', radius = '0.8 m', cell = '1 m' }",
            3.0 / 8.0,
        ),
        // In the end it is outside.
        (
            "covered = { robots = 'R0', radius = '0.8 m', cell = '1 m', now = true }",
            0.0,
        ),
        (
            "covered = { robots = 'R0', radius = '0.8 m', cell = '1 m', now = true, as = 'max' }",
            2.0 / 8.0,
        ),
        (
            "covered = { robots = 'R1', radius = '0.8 m', cell = '1 m', as = 'min' }",
            2.0 / 8.0,
        ),
        (
            "covered = { robots = '*', radius = '9 m', cell = '1 m', as = 'mean' }",
            1.0,
        ),
    ] {
        assert_eq!(run.measure(text), value(expected), "{text}");
    }
}

#[test]
fn components_have_a_range_or_that_of_radios() {
    let measure: Measure = toml::from_str("name = 'x'\ncomponents = { robots = '*' }").unwrap();
    let setting = RunSetting {
        radio_range_m: None,
        ..setting(2)
    };
    let error = measure.check(&setting).unwrap_err().to_string();
    assert!(error.contains("`[network.radio]`"), "{error}");
}

#[test]
fn conditions_are_about_teams_and_places() {
    let run = Run::of(&[
        &[at(0.0, 0.0), at(3.0, 0.0)],
        &[at(1.0, 0.0), at(3.0, 0.0)],
        &[at(2.0, 0.0), at(3.0, 0.0)],
        &[at(3.0, 0.0), at(3.0, 1.0)],
    ]);
    for (text, ticks) in [
        (
            "{ distance = { robots = '*', by = 'min' }, at_most = 1 }",
            &[2, 3][..],
        ),
        (
            "{ distance = { robots = '*', by = 'min' }, at_most = 1, for = '0.5 s' }",
            &[3],
        ),
        ("{ walked = { robots = '*', by = 'sum' }, above = 2 }", &[3]),
        (
            "{ components = { robots = '*', range = '2 m' }, at_most = 1 }",
            &[1, 2, 3],
        ),
        (
            "{ covered = { robots = '*', radius = '0.8 m', cell = '1 m' }, above = 0.3 }",
            &[0, 1, 2, 3],
        ),
        (
            "{ inside = { robot = 'R0', disc = { center = ['0 m', '0 m'], radius = '1 m' } } }",
            &[0, 1],
        ),
        (
            "{ inside = { robots = '*', by = 'all', rectangle = [['2 m', '0 m'], ['4 m', '0 m']] } }",
            &[2],
        ),
        (
            "{ inside = { robots = '*', by = 'any', rectangle = [['2 m', '0 m'], ['4 m', '0 m']] } }",
            &[0, 1, 2, 3],
        ),
        (
            "{ inside = { robots = '*', by = 'count', rectangle = [['2 m', '0 m'], ['4 m', '0 m']] }, below = 2 }",
            &[0, 1, 3],
        ),
        (
            "{ all = [{ walked = { robot = 'R0' }, above = 0 }, { walked = { robot = 'R0' }, below = 3 }] }",
            &[1, 2],
        ),
        (
            "[{ walked = { robot = 'R1' }, above = 0 }, { walked = { robot = 'R0' }, at_most = 0 }]",
            &[0, 3],
        ),
        (
            "{ all = [{ inside = { robot = 'R0', disc = { center = ['2 m', '0 m'], radius = '1 m' } } }], for = '1 s' }",
            &[3],
        ),
    ] {
        assert_eq!(run.holds_in(text), ticks, "{text}");
        // What is written is what was read.
        let read = condition(text).unwrap();
        let written = serde_json::to_value(&read).unwrap();
        assert_eq!(TickCondition::try_from(written), Ok(read.clone()), "{text}");
        let file: File =
            toml::from_str(&toml::to_string(&File { c: read.clone() }).unwrap()).unwrap();
        assert_eq!(file.c, read);
    }

    let run = Run::of(&[
        &[has(0.0), has(2.0)],
        &[has(2.0), has(2.0)],
        &[has(5.0), has(2.0)],
    ]);
    for (text, ticks) in [
        (
            "{ robots = '*', by = 'sum', variable = 'v', at_least = 4 }",
            &[1, 2][..],
        ),
        (
            "{ robots = '*', by = 'all', variable = 'is_done' }",
            &[1, 2],
        ),
        (
            "{ robots = '*', by = 'any', variable = 'v', above = 2 }",
            &[2],
        ),
        (
            "{ robots = '*', by = 'all', variable = 'v', at_most = 2 }",
            &[0, 1],
        ),
        (
            "{ robots = '*', by = 'count', variable = 'is_done', at_most = 1 }",
            &[0],
        ),
        (
            "{ robots = '*', by = 'any', behavior = ['', 'DONE'] }",
            &[0, 1, 2],
        ),
        (
            "{ robots = 'R*', by = 'mean', behavior = 'DONE', below = 0.5 }",
            &[0, 1, 2],
        ),
    ] {
        assert_eq!(run.holds_in(text), ticks, "{text}");
        let read = condition(text).unwrap();
        let written = serde_json::to_value(&read).unwrap();
        assert_eq!(TickCondition::try_from(written), Ok(read), "{text}");
    }
}

#[test]
fn a_time_ends_with_a_condition_and_is_censored_at_the_planned_end() {
    let run = Run::of(&[
        &[has(0.0), has(0.0)],
        &[has(0.0), has(3.0)],
        &[has(2.0), has(3.0)],
    ]);
    let all = "time = { to = { robots = '*', by = 'all', variable = 'is_done' } }";
    assert_eq!(run.measure(all), Measured::Reached { time_s: 1.0 });
    let after = "time = { after = { robots = '*', by = 'any', variable = 'is_done' }, \
                 to = { robots = '*', by = 'all', variable = 'is_done' } }";
    assert_eq!(run.measure(after), Measured::Reached { time_s: 0.5 });

    // The run was planned for 20 ticks, and ended with tick 2.
    let never = "time = { to = { robot = 'R0', variable = 'v', above = 9 } }";
    let waited = |waited_s| Measured::NotReached { waited_s };
    assert_eq!(run.measure(never), waited(1.0), "stopped");
    assert_eq!(run.measure_until(never, Some("it is done")), waited(10.0));
    let since = "time = { after = { robots = '*', by = 'any', variable = 'is_done' }, \
                 to = { robot = 'R0', variable = 'v', above = 9 } }";
    assert_eq!(run.measure_until(since, Some("it is done")), waited(9.5));
    let stalled = "stalled = { progress = ['R0.v'], for = '2 s' }";
    assert_eq!(run.measure_until(stalled, Some("it is done")), waited(10.0));
    let none =
        "time = { after = { event = 'lost' }, to = { robot = 'R0', variable = 'v', above = 9 } }";
    assert_eq!(
        run.measure_until(none, Some("it is done")),
        Measured::NotAtRisk
    );

    let Measured::Missing { reason } =
        run.measure("time = { to = { robot = 'R0', variable = 'w', above = 9 } }")
    else {
        panic!("no robot has `w`");
    };
    assert!(reason.contains("R0 publishes no number `w`"), "{reason}");
}

#[test]
fn shares_are_of_several_robots() {
    let enters = |index, to: &str| Event::Behavior {
        robot: robot(index),
        from: None,
        to: to.to_owned(),
    };
    let mut run = Run::of(&[&[at(0.0, 0.0), at(1.0, 1.0)][..]; 5]);
    run.ticks[0].1 = vec![enters(0, "WAIT"), enters(1, "SERVE")];
    run.ticks[1].1 = vec![enters(1, "WAIT")];
    run.ticks[2].1 = vec![Event::Lost { robot: robot(0) }];
    run.ticks[3].1 = vec![enters(1, "SERVE")];
    // R0 waits in ticks 0 and 1, R1 in 1 and 2; the run lasts for four.
    for (by, expected) in [("mean", 0.5), ("any", 0.75), ("all", 0.25), ("count", 1.0)] {
        let text = format!("share = {{ robots = '*', by = '{by}', behavior = 'WAIT' }}");
        assert_eq!(run.measure(&text), value(expected), "{by}");
    }
}

#[test]
fn numbers_that_cannot_be_taken_are_refused() {
    let measure = |text: &str| {
        let measure: Result<Measure, _> = toml::from_str(&format!("name = 'x'\n{text}"));
        match measure {
            Ok(measure) => match measure.check(&setting(2)) {
                Ok(()) => "fine".to_owned(),
                Err(error) => error.to_string(),
            },
            Err(error) => error.message().to_owned(),
        }
    };
    for (text, reason) in [
        (
            "walked = {}",
            "`walked` is of `robot = NAME`, or of `robots`",
        ),
        ("walked = { robots = '*' }", "`robots` needs it: \"sum\""),
        (
            "walked = { robot = 'R0', by = 'sum' }",
            "`by` belongs to `robots`",
        ),
        (
            "walked = { robots = '*', by = 'all' }",
            "is taken by \"sum\"",
        ),
        (
            "walked = { robot = 'R0', range = '2 m' }",
            "`walked` has no `range`",
        ),
        ("walked = { robots = [], by = 'sum' }", "1 to 64 names"),
        (
            "walked = { robots = 'S*', by = 'sum' }",
            "no robot of this scenario is called S*",
        ),
        (
            "distance = { robots = '*', by = 'sum' }",
            "\"min\", \"mean\" or \"max\"",
        ),
        (
            "distance = { robots = 'R0', by = 'min' }",
            "two of them at least",
        ),
        ("inside = { robot = 'R0' }", "a `rectangle` or a `disc`"),
        (
            "inside = { robot = 'R0', disc = { center = ['1 m', '1 m'], radius = '0 m' } }",
            "`radius` is more than zero",
        ),
        (
            "inside = { robots = '*', by = 'sum', disc = { center = ['1 m', '1 m'], radius = '1 m' } }",
            "\"all\", \"any\"",
        ),
        (
            "covered = { robots = '*', radius = '1 m' }",
            "`cell` is more than zero",
        ),
        (
            "covered = { robots = '*', by = 'sum', radius = '1 m', cell = '1 m' }",
            "has no `by`",
        ),
        (
            "covered = { robots = '*', radius = '1 m', cell = '0.1 cm' }",
            "make `cell` larger",
        ),
        (
            "covered = { robot = 'R0', radius = '1 m', cell = '1 m' }",
            "is of `robots`",
        ),
        (
            "components = { robots = '*', range = '1 furlong' }",
            "is not a length",
        ),
        (
            "distance = { robot = 'R0', to = 'Nobody' }",
            "no robot of this scenario is called Nobody",
        ),
        (
            "distance = { robot = 'R0', to = 7 }",
            "or the name of a robot",
        ),
        ("expression = 'a +'", "something is missing at the end"),
        ("expression = 'a'\nsummary = 'ticks'", "exactly one of"),
        (
            "time = { to = { robots = 'S*', by = 'all', behavior = 'X' } }",
            "is called S*",
        ),
        (
            "share = { robots = '*', by = 'sum', behavior = 'X' }",
            "\"all\", \"any\"",
        ),
        (
            "variable = { robots = '*', name = 'v', as = 'end' }",
            "`robots` needs it",
        ),
    ] {
        let error = measure(text);
        assert!(error.contains(reason), "{text}: {error}");
    }

    for (text, reason) in [
        ("{ walked = { robot = 'R0' } }", "`walked` needs `at_least`"),
        (
            "{ walked = { robot = 'R0', as = 'end' }, above = 1 }",
            "leave `as` out",
        ),
        (
            "{ inside = { robot = 'R0', disc = { center = ['1 m', '1 m'], radius = '1 m' } }, above = 0 }",
            "leave the bounds out",
        ),
        ("{ robots = '*', behavior = 'X' }", "`robots` needs it"),
        (
            "{ robots = '*', by = 'count', behavior = 'X' }",
            "needs `at_least`",
        ),
        (
            "{ robots = '*', by = 'sum', variable = 'v', above = 2, below = 1 }",
            "no number is within",
        ),
        ("{ all = [] }", "1 to 64"),
        ("{ all = [{ robot = 'A' }] }", "a condition is an event"),
        (
            "{ walked = { robot = 'R0' }, distance = { robot = 'R0', to = ['1 m', '1 m'] }, above = 1 }",
            "a condition is an event",
        ),
        (
            "{ walked = { robot = 'R0' }, robot = 'R0', above = 1 }",
            "a condition is an event",
        ),
    ] {
        let error = condition(text).unwrap_err();
        assert!(error.contains(reason), "{text}: {error}");
    }
}

#[test]
fn conditions_in_conditions_are_bounded() {
    let leaf = "{ event = 'lost' }".to_owned();
    let nested =
        |depth: usize| (1..depth).fold(leaf.clone(), |inner, _| format!("{{ all = [{inner}] }}"));
    assert!(condition(&nested(8)).is_ok());
    assert!(condition(&nested(9)).unwrap_err().contains("8 deep"));

    let list = |count: usize| format!("[{}]", vec![leaf.as_str(); count].join(", "));
    // With the one around them: 1 + 4 · 63.
    let all = |count: usize| format!("{{ all = [{0}, {0}, {0}, {0}] }}", list(count));
    assert!(condition(&all(63)).is_ok());
    assert!(condition(&all(64)).unwrap_err().contains("at most 256"));
}

proptest! {
    /// The order of a list of robots does not matter, and sums are those of the robots.
    #[test]
    fn a_team_is_a_set(values in prop::collection::vec(-9.0..9.0_f64, 2..8)) {
        let reports: Vec<Option<Report>> = values.iter().map(|v| has(*v)).collect();
        let run = Run::of(&[&reports]);
        let names: Vec<String> = (0..values.len()).rev().map(|index| format!("'R{index}'")).collect();
        let of = |robots: &str, by: &str| {
            run.measure(&format!("variable = {{ robots = {robots}, by = '{by}', name = 'v', as = 'end' }}"))
        };
        let list = format!("[{}]", names.join(", "));
        for by in ["sum", "mean", "max", "min", "spread", "all", "any", "count"] {
            prop_assert_eq!(of(&list, by), of("'*'", by));
        }
        prop_assert_eq!(of("'*'", "sum"), value(values.iter().sum()));
    }
}
