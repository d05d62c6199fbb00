//! Sites in scenario files: what they mean, and what people are told when they are wrong.

use protocol::messages::{
    MAX_KNOWN_SITES, MAX_SITE_TEXT_BYTES, MAX_SITE_VARIABLES, MAX_SITES, MAX_SITES_BYTES, Point,
    StateVariables, Variable, site_bytes,
};
use scenario::diagnostic::FileError;
use scenario::{Changes, OnConflict, Scenario};

use super::{parse, shown, source};

const BULK: &str = "[[site]]\nname = \"T\"\ncount = 3\nkind = \"task\"\nat = \"random\"\nrange = \"1 m\"\n\
                    state = { stock = { start = 30, min = 0, max = 30 }, done = false, label = \"A\" }\n";

fn changed(text: &str, set: &[&str]) -> Result<Scenario, FileError> {
    let changes = Changes {
        set: set.iter().map(|change| change.parse().unwrap()).collect(),
        ..Changes::default()
    };
    parse(&changes.apply(&source(text))?.text)
}

#[test]
fn a_site_has_defaults_and_is_kept() {
    let text = "[sensing]\nrange = \"3 m\"\n[[site]]\nname = \"T\"\nat = [\"2 m\", \"3 m\"]\n";
    let scenario = parse(text).unwrap();
    let site = &scenario.sites["T"];
    assert_eq!(
        (site.kind.as_str(), site.at),
        ("site", Point::new(2.0, 3.0))
    );
    assert_eq!((site.range_m, site.on_conflict), (3.0, OnConflict::First));
    assert!(site.state.is_empty() && site.drawn.is_none());

    assert!(!site.is_known);

    let text = text.to_owned()
        + "known = true\non_conflict = \"refuse\"\nkind = \"task\"\nrange = \"1 m\"\n\
           state = { n = 7, x = { start = 0.5, max = 1 }, done = true, label = \"7 m\" }\n";
    let scenario = parse(&text).unwrap();
    assert!(scenario.sites["T"].is_known);
    let state = &scenario.sites["T"].state;
    assert_eq!(state["n"].start, Variable::Number(7.0));
    assert_eq!((state["x"].min, state["x"].max), (None, Some(1.0)));
    assert_eq!(state["label"].start, Variable::from("7 m"));
    let written = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(written.sites, scenario.sites);
}

#[test]
fn sites_in_bulk_stand_where_their_names_and_the_seed_have_them() {
    let scenario = parse(BULK).unwrap();
    let names: Vec<&str> = scenario.sites.keys().map(String::as_str).collect();
    assert_eq!(names, ["T1", "T2", "T3"]);
    let more = parse(&BULK.replace("count = 3", "count = 4")).unwrap();
    let moved = parse(&("seed = 2\n".to_owned() + BULK)).unwrap();
    let again = scenario.clone().with_seed(2).unwrap();
    for name in names {
        let at = scenario.sites[name].at;
        assert_eq!(more.sites[name].at, at, "one more moves none");
        assert_ne!(moved.sites[name].at, at);
        assert_eq!(again.sites[name].at, moved.sites[name].at);
    }
    let written = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(written.sites["T2"].at, scenario.sites["T2"].at);
    let template = scenario.to_toml_without_seed().unwrap();
    assert!(template.contains("random"), "{template}");
}

#[test]
fn changes_name_sites_of_a_table_one_by_one() {
    let scenario = changed(BULK, &["site.T2.state.stock=5", "site.T*.range=2 m"]).unwrap();
    let stock = |name: &str| scenario.sites[name].state["stock"].start.clone();
    assert_eq!([stock("T1"), stock("T2")], [30.0.into(), 5.0.into()]);
    assert_eq!(scenario.sites["T3"].range_m, 2.0);
    let scenario = changed(BULK, &["site.T.count=5"]).unwrap();
    assert_eq!(scenario.sites.len(), 5);
}

#[test]
fn a_site_that_cannot_be_is_refused_where_it_is_written() {
    let long = "x".repeat(MAX_SITE_TEXT_BYTES + 1);
    let many: Vec<String> = (0..=MAX_SITE_VARIABLES)
        .map(|i| format!("v{i} = 1"))
        .collect();
    for (text, line, reason) in [
        (
            BULK.replace("\"random\"", "[\"20 m\", \"1 m\"]"),
            5,
            "outside the field",
        ),
        (
            BULK.replace("range = \"1 m\"", "range = \"0 m\""),
            6,
            "more than zero",
        ),
        (
            BULK.replace("range", "solid = true\nrange"),
            6,
            "never solid",
        ),
        (
            BULK.replace("\"task\"", "\"a task\""),
            4,
            "a kind is a word",
        ),
        (
            BULK.replace("done =", "\"a b\" ="),
            7,
            "a key of the state is a word",
        ),
        (
            BULK.replace("false", "[1]"),
            7,
            "a variable of a site is a number, a text",
        ),
        (BULK.replace("false", "nan"), 7, "not a finite number"),
        (
            BULK.replace("start = 30", "start = 31"),
            7,
            "outside the bounds",
        ),
        (
            BULK.replace("min = 0", "least = 0"),
            7,
            "unknown field `least`",
        ),
        (
            BULK.replace("\"A\"", &format!("\"{long}\"")),
            7,
            "bytes of text",
        ),
        (
            BULK.replace("done = false", &many.join(", ")),
            7,
            "more than 16 variables",
        ),
        (
            BULK.replace("count = 3", &format!("count = {}", MAX_SITES + 1)),
            1,
            "more than 1024",
        ),
        (
            BULK.replace(
                "count = 3",
                &format!("count = {}\nknown = true", MAX_KNOWN_SITES + 1),
            ),
            4,
            "more than 512 sites with known = true",
        ),
        (
            format!("{BULK}[[site]]\nname = \"T2\"\nat = \"random\"\n"),
            8,
            "a second site called T2",
        ),
        (
            format!("{BULK}[[robot]]\nname = \"T2\"\nat = \"random\"\n"),
            1,
            "a robot is called T2",
        ),
        (
            format!("{BULK}[[change]]\nat = \"5 s\"\nset = [\"site.T.state.done=true\"]\n"),
            8,
            "only the network, faults",
        ),
    ] {
        let error = shown(&parse(&text).unwrap_err());
        let place = format!("hall.toml:{line}:");
        assert!(error.contains(&place) && error.contains(reason), "{error}");
    }
    let most = BULK.replace("count = 3", &format!("count = {MAX_SITES}"));
    assert_eq!(parse(&most).unwrap().sites.len(), MAX_SITES);
}

#[test]
fn all_sites_together_fit_into_half_a_message() {
    let text = "x".repeat(200);
    let state = StateVariables::from_iter([("label", Variable::from(text.as_str()))]);
    // All names have the same length.
    let most = MAX_SITES_BYTES / site_bytes("T100", "site", &state);
    let sites = |count: usize| {
        let names = format!("T{{100..{}}}", 99 + count);
        format!(
            "[[site]]\nname = \"{names}\"\nat = \"random\"\nrange = \"1 m\"\nstate = {{ label = \"{text}\" }}\n"
        )
    };
    assert_eq!(parse(&sites(most)).unwrap().sites.len(), most);
    let error = shown(&parse(&sites(most + 1)).unwrap_err());
    let last = format!("the sites up to T{} take", 100 + most);
    assert!(
        error.contains(&last) && error.contains("hall.toml:1:"),
        "{error}"
    );
}

#[test]
fn conditions_of_sites_are_checked_where_they_are_written() {
    let state = |condition: &str| format!("end_when = {condition}\n{BULK}");
    for condition in [
        "{ sites = \"T*\", by = \"all\", variable = \"done\" }",
        "{ sites = \"T{1..3}\", by = \"count\", variable = \"stock\", each = { below = 3 }, at_least = 2 }",
        "{ site = \"T1\", variable = \"label\", is = [\"B\", \"C\"], for = \"2 s\" }",
    ] {
        let scenario = parse(&state(condition)).unwrap();
        let again = parse(&scenario.to_toml().unwrap()).unwrap();
        assert_eq!(again.end_when, scenario.end_when);
    }

    for (condition, reason) in [
        (
            "{ site = \"T4\", variable = \"done\", is = true }",
            "no site of this scenario is called T4; it has T1, T2, T3",
        ),
        (
            "{ sites = \"X*\", by = \"any\", variable = \"done\" }",
            "is called X*",
        ),
        (
            "{ site = \"T1\", variable = \"dome\", is = true }",
            "no `dome`; it has done, label, stock",
        ),
        (
            "{ site = \"T1\", variable = \"label\", below = 3 }",
            "is a text: compare it by `is`",
        ),
    ] {
        let error = shown(&parse(&state(condition)).unwrap_err());
        assert!(error.contains(reason), "{condition}: {error}");
        assert!(error.contains("hall.toml:1:12"), "{error}");
        assert!(
            error.contains(&format!("1 │ end_when = {condition}")),
            "{error}"
        );

        let text = format!("{BULK}[[expect]]\nname = \"it\"\nnever = {condition}\n");
        let error = shown(&parse(&text).unwrap_err());
        assert!(error.contains(reason), "{condition}: {error}");
        assert!(error.contains("hall.toml:8:1"), "{error}");
    }
}

#[test]
fn measures_of_a_scenario_are_checked_and_kept() {
    let measures = "[[measure]]\nname = \"left\"\nvariable = { sites = \"T*\", by = \"sum\", name = \"stock\", as = \"end\" }\n\
                    [[measure]]\nname = \"twice\"\nexpression = \"2 * left\"\n";
    let scenario = parse(&format!("{BULK}{measures}")).unwrap();
    assert_eq!(scenario.measures.len(), 2);
    let again = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(again.measures, scenario.measures);

    for (kind, reason) in [
        ("summary = \"ticks\"", "has no `summary`"),
        (
            "count = { event = \"say\" }\nwhen = \"after\"",
            "has no `when`",
        ),
        ("expression = \"left + 1\"", "no measure is before it"),
        (
            "variable = { site = \"X\", name = \"stock\", as = \"end\" }",
            "no site of this scenario is called X",
        ),
        (
            "count = { event = \"say\", robot = \"A\" }",
            "no robot of this scenario is called A",
        ),
        (
            "count = { event = \"judged\", expectation = \"it\" }",
            "there is no expectation \"it\"",
        ),
        ("", "exactly one of"),
    ] {
        let text = format!("{BULK}[[measure]]\nname = \"x\"\n{kind}\n");
        let error = shown(&parse(&text).unwrap_err());
        assert!(error.contains(reason), "{kind}: {error}");
        assert!(error.contains("hall.toml:8:1"), "{error}");
    }
    let twice = format!("{BULK}{measures}{measures}");
    let error = shown(&parse(&twice).unwrap_err());
    assert!(
        error.contains("a second measure called \"left\""),
        "{error}"
    );
    let change = format!("[[change]]\nat = \"1 s\"\nset = ['measure=[]']\n{BULK}{measures}");
    let error = shown(&parse(&change).unwrap_err());
    assert!(error.contains("can change while a run goes on"), "{error}");
}
