//! Tests of experiment files: what is read, and what is refused, where and why.

use config::Changes;

use super::super::presentation::{Example, Shown};
use super::*;

#[test]
fn the_shipped_experiments_can_be_played() {
    for (name, conditions, arms) in [
        ("affect", 9, 8),
        ("crowd", 9, 3),
        ("deadlock", 5, 5),
        ("partition", 4, 5),
    ] {
        let experiment = Experiment::find(Path::new(name)).unwrap();
        let found = experiment.list_conditions().unwrap().len();
        assert_eq!(found, conditions, "{name}");
        assert_eq!(experiment.arms.len(), arms, "{name}");
        Scenario::load(&experiment.scenario, &Changes::default()).unwrap();
    }
    assert!(Experiment::find(Path::new("none")).is_err());
}

/// An experiment with everything that can be wrong.
const GOOD: &str = r#"
question = "?"
scenario = "../hors_doeuvres.toml"
duration = "600 s"
seeds = 16
baseline = "one"

[[condition]]
name = "crash"
from = "120 s"
until = "180 s"
set = ['fault=[{ robot = "Leguin", do = "crash", at = "{from}", until = "{until}" }]']

[[condition]]
name = "none"

[[factor]]
name = "guests"
values = [10, 20]
path = "guests.count"

[[factor]]
name = "cut"
values = ["0 s", "60 s"]
begins = "200 s"
set = ['network.partition=[{ from = "{from}", until = "{until}" }]']
set_at_zero = ["network.partition=[]"]

[[arm]]
name = "one"
set = ["robot.Butler.params.policy=emotion"]

[[arm]]
name = "two"
yoked_to = "one"

[[measure]]
name = "served"
variable = { robot = "Butler", name = "served", as = "end" }

[[measure]]
name = "exchanges"
count = { event = "behavior", robot = "Butler", to = "EXCHANGE" }
when = "after"

[[expect]]
name = "exchange"
eventually = { robot = "Butler", behavior = "EXCHANGE" }
within = "60 s"

[report]
measures = ["exchanges", "served"]
x = "guests"
show = ["estimates", "heat maps", "floor"]
runs = ["worst", 17]
"#;

fn parse(text: &str) -> Result<Experiment, FileError> {
    let source = Source {
        name: "experiment.toml".to_owned(),
        text: text.to_owned(),
    };
    Experiment::parse(&source, Path::new("configs/experiments"))
}

#[test]
fn conditions_and_factors_make_a_grid() {
    let experiment = parse(GOOD).unwrap();
    let conditions = experiment.list_conditions().unwrap();
    assert_eq!(conditions.len(), 8);
    assert_eq!(conditions[1].name, "crash, guests 10, cut 60 s");
    assert_eq!(conditions[1].set[1].change.to_string(), "guests.count=10");
    assert_eq!(conditions[1].time_s, Some((120.0, 260.0)));
    assert_eq!(experiment.explained(), "");
}

#[test]
fn a_report_shows_what_is_named_or_everything() {
    let report = parse(GOOD).unwrap().report;
    assert_eq!(report.measures, ["exchanges", "served"]);
    assert_eq!(report.x.as_deref(), Some("guests"));
    assert!(report.shows(Shown::HeatMaps) && !report.shows(Shown::Survival));
    assert_eq!(report.runs, [Example::Worst, Example::Unit(17)]);

    let (without, _) = GOOD.split_once("[report]").unwrap();
    let report = parse(without).unwrap().report;
    assert_eq!(report.measures, ["served", "exchanges"]);
    assert_eq!(report.x, None);
    assert!(report.shows(Shown::Estimates) && report.shows(Shown::Floor));
    assert_eq!(report.runs, [Example::Typical, Example::Worst]);
}

#[test]
fn seeds_are_a_count_a_list_or_a_range() {
    for (text, seeds) in [
        ("3", vec![1, 2, 3]),
        ("[3, 5, 8]", vec![3, 5, 8]),
        ("\"65..=67\"", vec![65, 66, 67]),
    ] {
        let text = GOOD.replace("seeds = 16", &format!("seeds = {text}"));
        assert_eq!(parse(&text).unwrap().seeds, seeds);
    }
}

/// A file with one mistake: what of [`GOOD`] is replaced, by what, what the line of the error contains, and its reason.
type Wrong<'a> = (&'a str, &'a str, &'a str, &'a str);

const WRONG: [Wrong<'_>; 67] = [
    (
        "robot.Butler.params.policy=emotion",
        "seed=7",
        "set = [\"seed=7\"]",
        "would have no effect",
    ),
    (
        "path = \"guests.count\"",
        "path = \"seed\"",
        "values = [10, 20]",
        "would have no effect",
    ),
    (
        "when = \"after\"",
        "share = { robot = \"Butler\", emotion = \"HAPPY\" }",
        "[[measure]]",
        "",
    ),
    (
        "eventually = { robot = \"Butler\", behavior = \"EXCHANGE\" }",
        "",
        "[[expect]]",
        "",
    ),
    ("question", "qestion", "qestion", "unknown field"),
    ("question = \"?\"", "", "", "missing field `question`"),
    (
        "duration = \"600 s\"",
        "duration = 600",
        "duration",
        "a time such as",
    ),
    (
        "duration = \"600 s\"",
        "duration = \"0 s\"",
        "duration",
        "more than 0 s",
    ),
    (
        "duration = \"600 s\"",
        "duration = \"100 s\"",
        "[[condition]]",
        "begins at 120 s",
    ),
    (
        "duration = \"600 s\"",
        "duration = \"150 s\"",
        "[[condition]]",
        "lasts until 180 s",
    ),
    (
        "duration = \"600 s\"",
        "duration = \"250 s\"",
        "values = [\"0 s\"",
        "lasts until 260 s",
    ),
    ("seeds = 16", "seeds = 1", "seeds", "at least 2 seeds"),
    ("seeds = 16", "seeds = -3", "seeds", "a count such as 64"),
    (
        "seeds = 16",
        "seeds = [3, 5, 3]",
        "seeds",
        "the seed 3 is there twice",
    ),
    ("seeds = 16", "seeds = []", "seeds", "at least 2 seeds"),
    (
        "seeds = 16",
        "seeds = \"5..9\"",
        "seeds",
        "not a range such as",
    ),
    (
        "seeds = 16",
        "seeds = \"9..=5\"",
        "seeds",
        "not a range such as",
    ),
    (
        "seeds = 16",
        "seeds = [1, 9007199254740993]",
        "seeds",
        "2^53",
    ),
    (
        "seeds = 16",
        "seeds = \"1..=9007199254740991\"",
        "seeds",
        "at most 1000000 runs",
    ),
    (
        "seeds = 16",
        "seeds = 70000",
        "seeds",
        "8 conditions, 2 arms and 70000 seeds are more than 1000000 runs",
    ),
    (
        "baseline = \"one\"",
        "baseline = \"x\"",
        "baseline",
        "no arm \"x\"",
    ),
    (
        "until = \"180 s\"\n",
        "",
        "name = \"crash\"",
        "both `from` and `until`",
    ),
    (
        "until = \"180 s\"",
        "until = \"100 s\"",
        "[[condition]]",
        "ends before it begins",
    ),
    (
        "name = \"none\"",
        "name = \"crash\"",
        "[[condition]]",
        "\"crash\" is there twice",
    ),
    (
        "name = \"none\"",
        "name = \"\"",
        "name = \"\"",
        "1 to 100 bytes",
    ),
    (
        "name = \"none\"",
        "name = \"none\"\nset = [\"x={until}\"]",
        "x={until}",
        "the condition has none",
    ),
    (
        "name = \"none\"",
        "name = \"none\"\nset = [\n\"guests={}\",\n\"guests.count=1\"]",
        "guests.count=1",
        "set the same value",
    ),
    (
        "name = \"none\"",
        "name = \"none\"\nset = [\"guests={}\"]",
        "[[factor]]",
        "`guests={}` and `guests.count=10` set the same value",
    ),
    (
        "path = \"guests.count\"",
        "",
        "[[factor]]",
        "either `path` or `set`",
    ),
    (
        "path = \"guests.count\"",
        "path = \"guests.count\"\nset = []",
        "[[factor]]",
        "either `path` or `set`",
    ),
    (
        "path = \"guests.count\"",
        "path = \"guests.count\"\nbegins = \"1 s\"",
        "begins = \"1 s\"",
        "with `begins` has `set`",
    ),
    (
        "path = \"guests.count\"",
        "path = \"guests.count\"\nset_at_zero = []",
        "set_at_zero",
        "the factor has a `path`",
    ),
    (
        "path = \"guests.count\"",
        "path = \"guests.count=1\"",
        "path",
        "names a value",
    ),
    (
        "path = \"guests.count\"",
        "path = \"guests..count\"",
        "values",
        "is empty",
    ),
    (
        "path = \"guests.count\"",
        "set = [\"guests.count=5\"]",
        "values",
        "the same changes",
    ),
    (
        "values = [10, 20]",
        "values = [10, 10.0]",
        "values",
        "\"10\" is there twice",
    ),
    (
        "values = [10, 20]",
        "values = []",
        "values",
        "1 to 1000 values",
    ),
    (
        "values = [10, 20]",
        "values = [10, nan]",
        "values",
        "not a finite number",
    ),
    (
        "values = [10, 20]",
        "values = [10, [20]]",
        "values",
        "a value is a number",
    ),
    (
        "[\"0 s\", \"60 s\"]",
        "[\"0 s\", 60]",
        "values",
        "60 is not a time",
    ),
    (
        "name = \"cut\"",
        "name = \"guests\"",
        "name",
        "two factors \"guests\"",
    ),
    (
        "name = \"cut\"",
        "name = \"arm\"",
        "name",
        "a column \"arm\" already",
    ),
    (
        "set_at_zero = [\"network.partition=[]\"]",
        "set_at_zero = [\"guests.count=7\"]",
        "[[factor]]",
        "set the same value",
    ),
    (
        "network.partition=[{",
        "network.partition[{",
        "values",
        "path=value",
    ),
    (
        "params.policy=emotion",
        "params.policy",
        "params.policy",
        "path=value",
    ),
    (
        "\"robot.Butler.params.policy=emotion\"",
        "\"guests.count=3\"",
        "guests.count=3",
        "set the same value",
    ),
    (
        "name = \"two\"",
        "name = \"one\"",
        "name",
        "two arms \"one\"",
    ),
    (
        "yoked_to = \"one\"",
        "yoked_to = \"x\"",
        "yoked_to",
        "no arm \"x\"",
    ),
    (
        "yoked_to = \"one\"",
        "yoked_to = \"two\"",
        "yoked_to",
        "yoked itself",
    ),
    (
        "name = \"served\"",
        "name = \"exchanges\"",
        "count",
        "two measures",
    ),
    (
        "name = \"served\"",
        "name = \"guests\"",
        "variable",
        "a column \"guests\" already",
    ),
    (
        "name = \"served\"",
        "name = \"seed\"",
        "variable",
        "a column \"seed\" already",
    ),
    (
        "as = \"end\"",
        "as = \"last\"",
        "as = \"last\"",
        "unknown variant `last`",
    ),
    (
        "event = \"behavior\"",
        "event = \"behaviour\"",
        "count",
        "no event \"behaviour\"",
    ),
    (
        "to = \"EXCHANGE\" }",
        "too = \"EXCHANGE\" }",
        "count",
        "no field `too`",
    ),
    (
        "within = \"60 s\"",
        "",
        "[[expect]]",
        "`eventually` needs a time",
    ),
    (
        "event = \"behavior\", robot = \"Butler\", to = \"EXCHANGE\"",
        "event = \"blocked\", by = \"gest\"",
        "count",
        "is never \"gest\": it is one of edge, wall, obstacle, guest, too_fast, or a table",
    ),
    (
        "count = {",
        "summary = \"ticks\"\ncount = {",
        "[[measure]]",
        "exactly one of",
    ),
    (
        "measures = [\"exchanges\", \"served\"]",
        "measures = [\n\"exchanges\",\n\"server\"]",
        "\"server\"",
        "no measure \"server\"; there are served, exchanges",
    ),
    (
        "measures = [\"exchanges\", \"served\"]",
        "measures = [\n\"served\",\n\"served\"]",
        "\"served\"]",
        "it is there twice",
    ),
    (
        "x = \"guests\"",
        "x = \"guest\"",
        "x = ",
        "no factor \"guest\"",
    ),
    (
        "values = [10, 20]",
        "values = [10]",
        "x = ",
        "at least two numbers or times",
    ),
    (
        "show = [\"estimates\", \"heat maps\", \"floor\"]",
        "show = [\n\"estimates\",\n\"heatmaps\"]",
        "\"heatmaps\"",
        "unknown variant `heatmaps`, expected one of `estimates`, `heat maps`",
    ),
    (
        "runs = [\"worst\", 17]",
        "runs = [\n\"worst\",\n\"best\"]",
        "\"best\"",
        "a run is \"typical\", \"worst\", or the number of a unit",
    ),
    (
        "runs = [\"worst\", 17]",
        "runs = [\n\"worst\",\n-1]",
        "-1",
        "a run is \"typical\", \"worst\", or the number of a unit",
    ),
    (
        "runs = [\"worst\", 17]",
        "runs = [0, 1, 2, 3, 4, 5, 6, 7,\n8]",
        "8]",
        "at most 8 runs",
    ),
    (
        "runs = [\"worst\", 17]",
        "page = 1",
        "page",
        "unknown field `page`",
    ),
];

#[test]
fn errors_show_line_and_reason() {
    assert!(parse(GOOD).is_ok());
    for (from, to, line, reason) in WRONG {
        let text = GOOD.replacen(from, to, 1);
        assert_ne!(text, GOOD, "{from}");
        let error = parse(&text).unwrap_err().in_words();
        assert!(
            error.contains(reason),
            "{to}: {error:?} does not contain {reason:?}"
        );

        let number = error
            .strip_prefix("line ")
            .and_then(|rest| rest.split_once(':'));
        let number: usize = number.unwrap().0.parse().unwrap();
        let found = text.lines().nth(number - 1).unwrap_or_default();
        assert!(
            found.contains(line),
            "{to}: {error:?} is shown at {found:?}"
        );
    }
}

#[test]
fn robots_that_the_scenario_does_not_have_are_shown() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scenario = Scenario::load(
        &root.join("configs/hors_doeuvres.toml"),
        &config::Changes::default(),
    );
    let mut scenario = scenario.unwrap();
    let complete = parse(GOOD).unwrap().complete(scenario.clone()).unwrap();
    assert_eq!(complete.expectations.last().unwrap().name, "exchange");

    for (from, to) in [
        ("{ robot = \"Butler\", name", "{ robot = \"Buttler\", name"),
        (
            "event = \"behavior\", robot = \"Butler\"",
            "event = \"behavior\", robot = \"Buttler\"",
        ),
    ] {
        let text = GOOD.replace(from, to);
        let error = parse(&text)
            .unwrap()
            .complete(scenario.clone())
            .unwrap_err();
        let line = text
            .lines()
            .position(|line| line.contains("Buttler"))
            .unwrap()
            + 1;
        let expected =
            format!("line {line}: the scenario has no robot \"Buttler\"; it has Butler, Leguin");
        assert_eq!(error.in_words(), expected);
    }

    let count = "event = \"behavior\", robot = \"Butler\"";
    let verdict = "event = \"judged\", expectation = \"exchnge\"";
    for (from, to, reason) in [
        (
            count,
            verdict,
            "there is no expectation \"exchnge\"; there are ",
        ),
        (
            "variable = {",
            "summary = \"robots.*.emotion_s.HAPPY\" #",
            "a summary has no number `robots.*.emotion_s.HAPPY`; it has robots.*.emotions_s.*, ",
        ),
    ] {
        let text = GOOD.replacen(from, to, 1).replacen(
            ", to = \"EXCHANGE\" }",
            " }",
            usize::from(from == count),
        );
        let error = parse(&text)
            .unwrap()
            .complete(scenario.clone())
            .unwrap_err();
        assert!(error.in_words().contains(reason), "{}", error.in_words());
    }

    let text = GOOD.replace(
        "eventually = { robot = \"Butler\"",
        "eventually = { robot = \"Buttler\"",
    );
    let error = parse(&text)
        .unwrap()
        .complete(scenario.clone())
        .unwrap_err();
    let error = error.in_words();
    assert!(
        error.contains("no robot of this scenario is called Buttler"),
        "{error}"
    );

    scenario.expectations = parse(GOOD).unwrap().expectations;
    let error = parse(GOOD).unwrap().complete(scenario).unwrap_err();
    let error = error.in_words();
    assert!(
        error.contains("a second expectation called \"exchange\""),
        "{error}"
    );
}

/// The blocks of TOML in the page about experiment files.
fn blocks_of_the_page() -> Vec<&'static str> {
    let page = include_str!("../../../../docs/experiment-files.md");
    let blocks = page.split("```toml\n").skip(1);
    blocks
        .filter_map(|block| block.split("```").next())
        .collect()
}

#[test]
fn every_example_of_the_page_is_good() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let blocks = blocks_of_the_page();
    assert!(blocks.len() > 10);

    // The first one is a whole file; the others are parts of one.
    for block in &blocks[1..] {
        let mut text = "question = '?'\nscenario = 'x'\nduration = '600 s'\nseeds = 2\n\
                        [[arm]]\nname = 'emotions'\n"
            .to_owned();
        if !block.contains("[[measure]]") {
            text += "[[measure]]\nname = 'ticks'\nsummary = 'ticks'\n";
        }
        text += block;

        let experiment = parse(&text).unwrap_or_else(|error| panic!("{block}: {error:?}"));
        for condition in experiment.list_conditions().unwrap() {
            for arm in &experiment.arms {
                let settings = [condition.set.clone(), arm.set.clone()].concat();
                let mut set: Vec<config::Override> =
                    settings.into_iter().map(|setting| setting.change).collect();
                // Examples of sites are about a scenario that has some.
                if block.contains("sites = ") {
                    let sites = r#"site=[{ name = "T{1..9}", at = "random", state = { stock = 1, done = false } }]"#;
                    set.push(sites.parse().unwrap());
                }
                // Examples of measures without a kind are about a scenario that has them.
                if block.contains("\"all_done\"") {
                    let measures =
                        r#"measure=[{ name = "all_done", walked = { robots = "*", by = "sum" } }]"#;
                    set.push(measures.parse().unwrap());
                }
                let changes = config::Changes {
                    set,
                    ..config::Changes::default()
                };
                // Examples with robots in bulk are about a scenario that has some.
                let file = match ["robot.S.", "\"S*\"", "\"S1\""]
                    .iter()
                    .any(|name| block.contains(name))
                {
                    true => "configs/recruitment.toml",
                    false => "configs/hors_doeuvres.toml",
                };
                let scenario = Scenario::load(&root.join(file), &changes);
                let complete = scenario.and_then(|scenario| experiment.complete(scenario));
                assert!(complete.is_ok(), "{block}: {:?}", complete.err());
            }
        }
    }
}

/// The line that an error points to, from 1.
fn line_of(text: &str) -> usize {
    let words = parse(text).unwrap_err().in_words();
    let number = words.strip_prefix("line ").unwrap().split(':').next();
    number.unwrap().parse().unwrap()
}

#[test]
fn an_error_of_a_table_points_to_its_own_head() {
    let count = |text: &str| text.matches('\n').count();
    for broken in [
        "count = { event = \"behavior\", robot = \"Butler\", to = \"EXCHANGE\" }",
        "name = \"exchanges\"",
    ] {
        let place = GOOD.find("[[measure]]\nname = \"exchanges\"").unwrap();
        let text = GOOD.replace(broken, "");
        assert_eq!(line_of(&text), count(&GOOD[..place]) + 1, "{broken}");
    }

    // The second of two, and the third one is good.
    let more = "\n[[expect]]\nname = \"more\"\nnever = { overlap = \"any\" }\n";
    let wrong = "\n[[expect]]\nname = \"wrong\"\nwithin = \"5 s\"\n";
    let text = format!("{GOOD}{wrong}{more}");
    assert_eq!(line_of(&text), count(GOOD) + 2);
}

#[test]
fn texts_for_people_have_a_limit() {
    let with = |bytes: usize| {
        GOOD.replace(
            "question = \"?\"",
            &format!("question = \"{}\"", "?".repeat(bytes)),
        )
    };
    assert!(parse(&with(MAX_TEXT_BYTES)).is_ok());
    let error = parse(&with(MAX_TEXT_BYTES + 1)).unwrap_err();
    let error = error.in_words();
    assert!(error.contains("`question` has 2001 bytes"), "{error}");
}

/// Two columns of a table never have one name: whatever gives the second one is refused at its line.
#[test]
fn no_name_is_that_of_another_column() {
    let factor = "name = \"guests\"";
    let measure = "name = \"exchanges\"\ncount";
    let timed = "name = \"exchanges\"\ntime = { to = { event = \"end\" } }\n[[measure]]\nname = \"m\"\ncount";
    let expectation = "name = \"exchange\"";
    for (name, texts) in [
        ("failed", &[factor, measure, expectation][..]),
        ("unit", &[factor, measure, expectation]),
        ("digest", &[factor, measure, expectation]),
        ("arm", &[factor, measure, expectation]),
        ("guests", &[measure, expectation]),
        ("served", &[factor, measure, expectation]),
        ("served_state", &[factor, measure, expectation]),
        ("exchanges", &[factor, expectation]),
    ] {
        for text in texts {
            let old = text.split('"').nth(1).unwrap();
            let new = text.replacen(old, name, 1);
            let file = GOOD.replacen(text, &new, 1);
            // The report names measures and a factor by their old names.
            let (file, _) = file.split_once("[report]").unwrap();
            let error = parse(file).unwrap_err().in_words();
            let is_measure_twice = name == "served" && *text == measure;
            let reason = if is_measure_twice {
                "there are two measures"
            } else {
                "have a column"
            };
            assert!(error.contains(reason), "{name}, {text}: {error}");
        }
    }
    let (without_report, _) = GOOD.split_once("[report]").unwrap();
    parse(&without_report.replacen(measure, timed, 1)).unwrap();

    // Heads of columns in the table for people.
    for (one, other) in [("served", "served"), ("arm", "x")] {
        let with = |name: &str, column: &str| format!("name = \"{name}\"\ncolumn = \"{column}\"");
        let file = without_report
            .replacen("name = \"served\"", &with("served", one), 1)
            .replacen("name = \"exchanges\"", &with("exchanges", other), 1);
        let error = parse(&file).unwrap_err().in_words();
        assert!(error.contains("a table has a column"), "{error}");
    }
}

#[test]
fn an_empty_file_is_no_experiment() {
    for text in ["", " \n", "# a comment\n"] {
        let error = parse(text).unwrap_err().in_words();
        assert!(
            error.contains("is empty: it is not an experiment"),
            "{error}"
        );
    }
    for name in [" ", "\u{3000}", " one"] {
        let text = GOOD.replace("name = \"one\"", &format!("name = \"{name}\""));
        let error = parse(&text).unwrap_err().in_words();
        assert!(error.contains("no blanks before or after"), "{error}");
    }
}

/// A measure of the scenario is taken by its name, with the states that it has there.
#[test]
fn measures_of_the_scenario_are_taken_by_their_names() {
    let source = |text: &str| Source {
        name: "scenario.toml".to_owned(),
        text: text.to_owned(),
    };
    let text = "[[robot]]\nname = \"Butler\"\nat = [\"5 m\", \"5 m\"]\n\
                [[robot]]\nname = \"Leguin\"\nat = [\"9 m\", \"5 m\"]\n\
                [[measure]]\nname = \"served\"\nunit = \"treats\"\nvariable = { robot = \"Butler\", name = \"served\", as = \"max\" }\n\
                [[measure]]\nname = \"met\"\ntime = { to = { distance = { robot = \"Butler\", to = \"Leguin\" }, below = 1 } }\n";
    let scenario = Scenario::parse(&source(text), Path::new("")).unwrap();
    let variable = "variable = { robot = \"Butler\", name = \"served\", as = \"end\" }\n";
    let good = GOOD.replacen(
        variable,
        "[[measure]]\nname = \"meeting\"\nsummary = \"met\"\n",
        1,
    );

    let mut experiment = parse(&good).unwrap();
    experiment.take_measures(&scenario).unwrap();
    let [served, meeting, _] = &experiment.measures[..] else {
        panic!("{:?}", experiment.measures);
    };
    assert_eq!(served.kind, scenario.measures[0].kind);
    assert_eq!(served.title(), "served, treats");
    assert!(meeting.is_time(), "a time may be censored");
    parse(&good).unwrap().complete(scenario.clone()).unwrap();

    for (text, reason) in [
        (
            good.replacen("name = \"served\"", "name = \"seved\"", 1),
            "that has served, met, and not \"seved\"",
        ),
        (
            good.replacen("summary = \"met\"", "summary = \"mett\"", 1),
            "a summary has no number `mett`",
        ),
    ] {
        // The report names measures, too.
        let text = text.replace("\"exchanges\", \"served\"", "\"exchanges\"");
        let error = parse(&text)
            .unwrap()
            .complete(scenario.clone())
            .unwrap_err();
        let error = error.in_words();
        assert!(error.contains(reason), "{error}");
    }
}
