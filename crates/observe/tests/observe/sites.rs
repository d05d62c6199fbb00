//! The states of sites in conditions, expectations, measures and patterns of events.

use std::collections::BTreeMap;

use observe::{
    Expectation, Measure, Measured, Measurements, Monitors, Observation, Probe, RunSetting,
    ScenarioMeasure, SiteStates, TickCondition,
};
use proptest::prelude::*;
use protocol::messages::{SiteRefusal, StateVariables, Variable};
use protocol::{Event, RobotName};
use serde::Deserialize;
use serde_json::Value;

use super::written;

/// Sites T1 to T3 and U. Each task has a stock, and whether it is done; U has a label as well.
fn setting() -> RunSetting {
    let task = |stock: f64| StateVariables::from([("stock", stock.into()), ("done", false.into())]);
    let mut u = task(5.0);
    u.insert("label", "A".into());
    let sites = [("T1", task(1.0)), ("T2", task(2.0)), ("T3", task(3.0))];
    let mut sites: BTreeMap<String, StateVariables> = sites
        .into_iter()
        .map(|(name, state)| (name.to_owned(), state))
        .collect();
    sites.insert("U".to_owned(), u);
    RunSetting {
        tick_s: 0.5,
        ticks: 20,
        field_m: [4.0, 2.0],
        radio_range_m: None,
        body_m: 0.5,
        inradius_m: BTreeMap::new(),
        roster: vec![RobotName::new("R1").unwrap(), RobotName::new("R2").unwrap()],
        sites,
        layers: Vec::new(),
    }
}

fn changes(site: &str, key: &str, to: impl Into<Variable>) -> Event {
    Event::SiteChanged {
        robot: RobotName::new("R1").unwrap(),
        site: site.to_owned(),
        key: key.to_owned(),
        from: false.into(),
        to: to.into(),
    }
}

/// Shows a run with these events in its ticks, the last of which is shown again without events at the end.
fn show(ticks: &[Vec<Event>], mut see: impl FnMut(&Observation<'_>)) {
    let mut states = SiteStates::new(&setting());
    let end = Vec::new();
    for (tick, events) in ticks.iter().chain([&end]).enumerate() {
        states.note(events);
        see(&Observation {
            tick: tick.min(ticks.len() - 1) as u64,
            tick_s: 0.5,
            events,
            state: &|_| None,
            site: &|site| states.of(site),
            layer: &|_| None,
        });
    }
}

fn condition(text: &str) -> Result<TickCondition, String> {
    written::condition(text, &setting())
}

fn holds_in(text: &str, ticks: &[Vec<Event>]) -> (Vec<u64>, String) {
    written::holds_in(text, &setting(), |see| show(ticks, see))
}

fn measure(text: &str) -> Result<Measure, String> {
    written::measure(text, &setting())
}

fn take(text: &str, ticks: &[Vec<Event>]) -> Measured {
    written::measured(text, &setting(), |see| show(ticks, see))
}

/// T1 is done in tick 1, all tasks in tick 3; the stock of U goes from 5 to 0, and its label from A to B.
fn work() -> Vec<Vec<Event>> {
    vec![
        vec![],
        vec![changes("T1", "done", true), changes("U", "stock", 2.0)],
        vec![changes("U", "label", "B")],
        vec![changes("T2", "done", true), changes("T3", "done", true)],
        vec![changes("U", "stock", 0.0), changes("T3", "done", false)],
    ]
}

#[test]
fn conditions_compare_the_states_of_sites() {
    for (text, ticks, because) in [
        (
            "{ site = 'U', variable = 'stock', below = 5 }",
            &[1, 2, 3, 4][..],
            "`stock` of the site U is 2",
        ),
        (
            "{ site = 'U', variable = 'stock', at_most = 2, above = 0 }",
            &[1, 2, 3],
            "`stock` of the site U is 2",
        ),
        (
            "{ site = 'U', variable = 'stock', is = 0 }",
            &[4],
            "`stock` of the site U is 0",
        ),
        (
            "{ site = 'U', variable = 'stock', is = [5, 0] }",
            &[0, 4],
            "`stock` of the site U is 5",
        ),
        (
            "{ site = 'U', variable = 'label', is = 'B' }",
            &[2, 3, 4],
            "`label` of the site U is B",
        ),
        (
            "{ site = 'T1', variable = 'done', is = true }",
            &[1, 2, 3, 4],
            "`done` of the site T1 is true",
        ),
        (
            "{ site = 'T1', variable = 'done', at_least = 1 }",
            &[1, 2, 3, 4],
            "`done` of the site T1 is 1",
        ),
        (
            "{ sites = 'T*', by = 'all', variable = 'done' }",
            &[3],
            "`done` of the sites T* (all) holds",
        ),
        (
            "{ sites = 'T{1..2}', by = 'all', variable = 'done', is = true }",
            &[3, 4],
            "`done` of the sites T{1..2} is true (all) holds",
        ),
        (
            "{ sites = ['T*', 'U'], by = 'any', variable = 'stock', at_least = 5 }",
            &[0],
            "`stock` of the sites T*, U at least 5 (any) holds",
        ),
        (
            "{ sites = '*', by = 'any', variable = 'stock', is = 0 }",
            &[4],
            "`stock` of the sites * is 0 (any) holds",
        ),
        (
            "{ sites = '*', by = 'all', variable = 'done', each = { is = false } }",
            &[0],
            "`done` of the sites * is false (all) holds",
        ),
        (
            "{ sites = 'T*', by = 'count', variable = 'done', at_least = 2 }",
            &[3, 4],
            "`done` of the sites T* (count) is 3",
        ),
        (
            "{ sites = 'T*', by = 'count', variable = 'done', each = { is = false }, is = 1 }",
            &[4],
            "`done` of the sites T* is false (count) is 1",
        ),
        (
            "{ sites = '*', by = 'count', variable = 'stock', each = { below = 3 }, at_least = 3 }",
            &[1, 2, 3, 4],
            "`stock` of the sites * below 3 (count) is 3",
        ),
        (
            "{ sites = '*', by = 'mean', variable = 'stock', each = { below = 3 }, above = 0.5 }",
            &[1, 2, 3, 4],
            "`stock` of the sites * below 3 (mean) is 0.75",
        ),
        (
            "{ sites = '*', by = 'sum', variable = 'stock', is = 6 }",
            &[4],
            "`stock` of the sites * (sum) is 6",
        ),
        (
            "{ site = 'U', variable = 'stock', is = 2, for = '1 s' }",
            &[3],
            "`stock` of the site U is 2 for 1 s, since tick 1 (0.5 s)",
        ),
        (
            "{ all = [{ site = 'T1', variable = 'done', is = true }, { site = 'U', variable = 'label', is = 'A' }] }",
            &[1],
            "`done` of the site T1 is true, and `label` of the site U is A",
        ),
    ] {
        let held = holds_in(text, &work());
        assert_eq!(held, (ticks.to_vec(), because.to_owned()), "{text}");
    }
}

#[test]
fn what_no_site_can_be_is_refused() {
    for (text, reason) in [
        (
            "{ site = 'T9', variable = 'done', is = true }",
            "no site of this scenario is called T9; it has T1, T2, T3, U",
        ),
        (
            "{ sites = 'X*', by = 'all', variable = 'done' }",
            "no site of this scenario is called X*",
        ),
        (
            "{ sites = 'T{4..9}', by = 'all', variable = 'done' }",
            "no site of this scenario is called T{4..9}",
        ),
        (
            "{ site = 'T1', variable = 'dome', is = true }",
            "the state of the site T1 has no `dome`; it has done, stock",
        ),
        (
            "{ sites = '*', by = 'any', variable = 'label', is = 'A' }",
            "the state of the site T1 has no `label`",
        ),
        (
            "{ site = 'U', variable = 'label', below = 3 }",
            "`label` of the site U is a text: compare it by `is`",
        ),
        (
            "{ sites = 'U', by = 'all', variable = 'label', below = 3 }",
            "`label` of the site U is a text: bounds are of numbers",
        ),
        (
            "{ site = 'U', variable = 'stock', is = 'A' }",
            "`stock` of the site U is a number: `is` has to name numbers",
        ),
        (
            "{ site = 'T1', variable = 'done', is = 'true' }",
            "`done` of the site T1 is true or false: `is` has to be true or false",
        ),
        (
            "{ site = 'U', variable = 'stock' }",
            "needs `at_least`, `at_most`, `above`, `below` or `is`",
        ),
        (
            "{ site = 'U', variable = 'stock', is = [] }",
            "`is` has 1 to 64 values",
        ),
        (
            "{ site = 'U', variable = 'stock', is = [1, 'A'] }",
            "`is` has 1 to 64 values",
        ),
        (
            "{ site = 'U', variable = 'stock', is = 1, at_least = 1 }",
            "leave one of them out",
        ),
        (
            "{ site = 'U', variable = 'stock', at_least = 2, below = 2 }",
            "no number is within",
        ),
        (
            "{ site = 'T*', variable = 'done', is = true }",
            "not a usable name",
        ),
        (
            "{ site = 'U', behavior = 'X' }",
            "a state of a site or of several",
        ),
        (
            "{ site = 'U', by = 'all', variable = 'done' }",
            "`by` belongs to `sites`",
        ),
        (
            "{ sites = 'T*', variable = 'done' }",
            "`by` belongs to `sites`",
        ),
        (
            "{ site = 'U', robot = 'R1', variable = 'done', is = true }",
            "of robots or of sites",
        ),
        (
            "{ site = 'U', sites = 'T*', variable = 'done', is = true }",
            "`site = NAME`, or of `sites`",
        ),
        (
            "{ sites = 'T*', by = 'count', variable = 'done', is = true }",
            "`each = { is = … }`",
        ),
        (
            "{ sites = 'T*', by = 'sum', variable = 'done', each = { is = true }, is = 1 }",
            "is taken by \"all\", \"any\", \"count\" or \"mean\"",
        ),
        (
            "{ sites = 'T*', by = 'all', variable = 'stock', each = { below = 2 }, above = 1 }",
            "`each` is for several",
        ),
        (
            "{ site = 'U', variable = 'stock', each = { below = 2 } }",
            "`each` is for several",
        ),
        (
            "{ sites = 'T*', by = 'count', variable = 'stock', each = {}, is = 1 }",
            "`each` needs",
        ),
        (
            "{ event = 'site_changed', site = 'X*' }",
            "no site of this scenario is called X*",
        ),
    ] {
        let error = condition(text).unwrap_err();
        assert!(error.contains(reason), "{text}: {error}");
    }
}

#[test]
fn measures_take_numbers_of_sites() {
    let value = |value: f64| Measured::Value { value };
    for (text, expected) in [
        (
            "variable = { site = 'U', name = 'stock', as = 'end' }",
            value(0.0),
        ),
        // 5 for a tick, then 2 for three.
        (
            "variable = { site = 'U', name = 'stock', as = 'mean' }",
            value(11.0 / 4.0),
        ),
        (
            "variable = { site = 'U', name = 'stock', as = 'area' }",
            value(5.5),
        ),
        (
            "variable = { site = 'U', name = 'stock', as = 'min' }",
            value(0.0),
        ),
        (
            "variable = { sites = '*', by = 'sum', name = 'stock', as = 'max' }",
            value(11.0),
        ),
        (
            "variable = { sites = '*', by = 'mean', name = 'stock', as = 'end' }",
            value(1.5),
        ),
        (
            "variable = { sites = '*', by = 'spread', name = 'stock', as = 'end' }",
            value(3.0),
        ),
        (
            "variable = { sites = 'T*', by = 'count', name = 'done', as = 'end' }",
            value(2.0),
        ),
        (
            "variable = { sites = 'T*', by = 'all', name = 'done', as = 'max' }",
            value(1.0),
        ),
        (
            "variable = { sites = 'T*', by = 'any', name = 'done', as = 'mean' }",
            value(0.75),
        ),
        (
            "variable = { site = 'U', name = 'label', each = { is = 'A' }, as = 'mean' }",
            value(0.5),
        ),
        (
            "variable = { sites = '*', by = 'mean', name = 'stock', each = { above = 2 }, as = 'end' }",
            value(0.25),
        ),
        (
            "count = { event = 'site_changed', site = 'T*' }",
            value(4.0),
        ),
        (
            "count = { event = 'site_changed', site = ['T{2..9}', 'U'], robot = 'R{1..2}' }",
            value(6.0),
        ),
        (
            "count = { event = 'site_changed', site = '*', robot = '*2' }",
            value(0.0),
        ),
        (
            "time = { to = { sites = 'T*', by = 'all', variable = 'done' } }",
            Measured::Reached { time_s: 1.5 },
        ),
        (
            "time = { to = { site = 'U', variable = 'label', is = 'C' } }",
            Measured::NotReached { waited_s: 2.0 },
        ),
        (
            "ratio = { of = { variable = { site = 'U', name = 'stock', as = 'max' } }, by = { variable = { site = 'T2', name = 'stock', as = 'end' } } }",
            value(2.5),
        ),
    ] {
        assert_eq!(take(text, &work()), expected, "{text}");
    }

    for (text, reason) in [
        (
            "variable = { site = 'U', name = 'label', as = 'end' }",
            "is a text",
        ),
        (
            "variable = { site = 'V', name = 'stock', as = 'end' }",
            "is called V",
        ),
        (
            "variable = { sites = 'T*', name = 'stock', as = 'end' }",
            "`by` belongs to `sites`",
        ),
        (
            "count = { event = 'site_changed', site = 'V' }",
            "is called V",
        ),
        (
            "between = { begin = { event = 'site_changed', robot = 'R1', site = 'V*' }, \
             end = { event = 'lost', robot = 'R1' }, as = 'sum' }",
            "is called V*",
        ),
    ] {
        let error = measure(text).unwrap_err();
        assert!(error.contains(reason), "{text}: {error}");
    }
    // An action may have named a site that is not there.
    assert!(measure("count = { event = 'site_refused', site = 'V' }").is_ok());
    let refused = vec![vec![Event::SiteRefused {
        robot: RobotName::new("R1").unwrap(),
        site: "V1".to_owned(),
        because: SiteRefusal::UnknownSite,
    }]];
    let counted = take("count = { event = 'site_refused', site = 'V*' }", &refused);
    assert_eq!(counted, value(1.0));
}

#[test]
fn expectations_are_about_sites() {
    let expectations: Vec<Expectation> = [
        "never = { site = 'U', variable = 'stock', below = 0 }",
        "always = { sites = 'T*', by = 'all', variable = 'stock', above = 0 }",
        "always = { site = 'U', variable = 'label', is = 'A' }",
        "eventually = { sites = 'T*', by = 'all', variable = 'done' }\nwithin = '1.5 s'",
        "eventually = { sites = 'T*', by = 'all', variable = 'done' }\nwithin = '1 s'",
        // What changed before the watch is seen in it.
        "after = { event = 'site_changed', site = 'T{2..3}' }\nnever = { site = 'U', variable = 'stock', is = 2 }\n\
         until = { site = 'T1', variable = 'done', is = false }",
    ]
    .iter()
    .enumerate()
    .map(|(index, text)| toml::from_str(&format!("name = '{index}'\n{text}")).unwrap())
    .collect();
    observe::expect::check_all(&expectations, &setting()).unwrap();
    assert!(expectations.iter().all(|one| !one.needs_states()));

    let mut ticks = work();
    ticks.insert(4, Vec::new());
    let mut monitors = Monitors::new(&expectations, &setting());
    let mut judged = Vec::new();
    show(&ticks, |seen| judged.extend(monitors.observe(seen)));
    judged.extend(monitors.end(protocol::messages::End::Finished));
    let mut verdicts = BTreeMap::new();
    for event in judged {
        let Event::Judged {
            expectation,
            verdict,
            ..
        } = event
        else {
            panic!("{event:?}");
        };
        verdicts.insert(expectation, verdict.name());
    }
    let verdicts: Vec<&str> = verdicts.into_values().collect();
    assert_eq!(verdicts, ["pass", "pass", "fail", "pass", "fail", "fail"]);
}

proptest! {
    /// Numbers that are kept until a site changes are those of the states in each tick.
    #[test]
    fn numbers_of_sites_are_those_of_their_states(
        run in prop::collection::vec(prop::collection::vec((1_usize..4, -5.0..5.0), 0..3), 1..12),
    ) {
        let mut ticks = Vec::new();
        let mut stocks = [1.0, 2.0, 3.0];
        let mut sums = Vec::new();
        let mut counts = Vec::new();
        for changed in &run {
            let mut events = Vec::new();
            for (site, stock) in changed {
                stocks[site - 1] = *stock;
                events.push(changes(&format!("T{site}"), "stock", *stock));
            }
            ticks.push(events);
            sums.push(stocks.iter().sum::<f64>());
            counts.push(stocks.iter().filter(|stock| **stock < 0.0).count());
        }

        let max = sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let text = "variable = { sites = 'T*', by = 'sum', name = 'stock', as = 'max' }";
        prop_assert_eq!(take(text, &ticks), Measured::Value { value: max });
        let text = "{ sites = 'T*', by = 'count', variable = 'stock', each = { below = 0 }, at_least = 2 }";
        let expected: Vec<u64> = (0..).zip(&counts).filter(|(_, count)| **count >= 2).map(|(tick, _)| tick).collect();
        prop_assert_eq!(holds_in(text, &ticks).0, expected);
    }
}

#[derive(Debug, Deserialize)]
struct Measures {
    measure: Vec<ScenarioMeasure>,
}

/// While a run goes on, its measures are those of a run that ends with the tick.
#[test]
fn measures_of_a_run_that_goes_on_are_those_of_one_that_ends() {
    let text = "[[measure]]\nname = 'sum'\nvariable = { sites = '*', by = 'sum', name = 'stock', as = 'mean' }\n\
                [[measure]]\nname = 'done'\ntime = { to = { sites = 'T*', by = 'all', variable = 'done' } }\n\
                [[measure]]\nname = 'acts'\ncount = { event = 'site_changed', site = 'T*' }\n\
                [[measure]]\nname = 'share'\nexpression = 'acts / (sum + 1)'\n";
    let measures: Measures = toml::from_str(text).unwrap();
    observe::check_measures(&measures.measure, &[], &setting()).unwrap();
    let mut live = Vec::new();
    let mut measurements = Measurements::new(&measures.measure, &setting());
    show(&work(), |seen| {
        measurements.observe(seen);
        live.push(measurements.measured());
    });

    for ticks in 1..=work().len() {
        let mut probes = Vec::new();
        for measure in &measures.measure {
            let probe = Probe::new(measure, &setting(), (0.0, f64::INFINITY));
            probes.push((measure.name.clone(), probe));
        }
        show(&work()[..ticks], |seen| {
            for (_, probe) in &mut probes {
                probe.observe(seen);
            }
        });
        let mut measured = BTreeMap::new();
        for (name, probe) in probes {
            let value = probe.measured(&Value::Null, &measured);
            measured.insert(name, value);
        }
        assert_eq!(live[ticks - 1], measured, "after {ticks} ticks");
    }
    let names: Vec<String> = measurements.numbers().into_keys().collect();
    assert_eq!(names, ["acts", "done", "share", "sum"]);
    assert!(!live[1].contains_key("none") && live[1]["done"].value().is_none());
}
