//! The table of what the paper names of affect (`docs/affect-table.md`): each file and each test of it exists, and each word
//! occurs in 64 runs as often as the table says.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use protocol::Event;
use protocol::messages::Variable;
use system_tests::root;

use crate::components::{CROWD, PANTRY, PARTITION};
use crate::paper::{Change, FT_M, HALL, is_state_of_figure_6, watch_seeds};

/// Seeds 1 to 64.
const SEEDS: u64 = 64;
const PAGE: &str = "docs/affect-table.md";
const ROBOTS: [&str; 2] = ["Butler", "Leguin"];
/// A cell of what does not occur by its nature, and of what is measured elsewhere.
const NOT_COUNTED: [&str; 2] = ["", "…"];

/// A scenario as the table names it, its file, and its changes.
type Setting = (&'static str, &'static str, &'static [&'static str]);

const IN_HALL: Setting = ("`hors_doeuvres`", HALL, &[]);
const IN_CROWD: Setting = ("`crowded_hall`", CROWD, &[]);
const IN_PANTRY: Setting = ("`pantry`", PANTRY, &[]);
const IN_MUSEUM: Setting = ("`museum`", "configs/museum.toml", &[]);
const WITH_PARTITION: Setting = ("`partition`", PARTITION, &[]);
const WITH_PLANS: Setting = ("`deliberate`", "configs/deliberate.toml", &[]);
const WITH_ANGER: Setting = (
    "`hors_doeuvres`, akr4",
    HALL,
    &[
        "robot.Butler.params.dynamics.state_set=akr4",
        "robot.Leguin.params.dynamics.state_set=akr4",
    ],
);

enum Unit {
    /// Ticks in which it is so, as a share of all ticks.
    Share,
    /// Ticks in which it happens, as a number in a run.
    Times,
}

/// A word of the paper, and when a robot does it, or is so, in a tick.
struct Row {
    word: String,
    setting: Setting,
    robots: &'static [&'static str],
    unit: Unit,
    occurs: Box<Occurs>,
}

/// Whether it is so for this robot in this tick.
type Occurs = dyn Fn(&Change<'_>, &str) -> bool + Sync;

const BOTH: &[&str] = &ROBOTS;
const BUTLER: &[&str] = &["Butler"];
const LEGUIN: &[&str] = &["Leguin"];

/// What a robot is, or does, for a share of all ticks.
fn share(
    word: impl Into<String>,
    setting: Setting,
    robots: &'static [&'static str],
    occurs: impl Fn(&Change<'_>, &str) -> bool + Sync + 'static,
) -> Row {
    Row {
        word: word.into(),
        setting,
        robots,
        unit: Unit::Share,
        occurs: Box::new(occurs),
    }
}

/// What happens to a robot a number of times in a run.
fn times(
    word: impl Into<String>,
    setting: Setting,
    robots: &'static [&'static str],
    occurs: impl Fn(&Change<'_>, &str) -> bool + Sync + 'static,
) -> Row {
    let unit = Unit::Times;
    Row {
        unit,
        ..share(word, setting, robots, occurs)
    }
}

/// Behavior of a robot before and after this tick.
fn behavior<'a>(change: &Change<'a>, robot: &str) -> (&'a str, &'a str) {
    match robot {
        "Butler" => change.butler,
        _ => change.leguin,
    }
}

fn becomes(change: &Change<'_>, robot: &str, was: &str, is: &str) -> bool {
    change.events.iter().any(|event| {
        matches!(event, Event::Emotion { robot: who, from: Some(from), to }
            if who.as_str() == robot && from == was && to == is)
    })
}

fn sends(change: &Change<'_>, robot: &str, what: &str) -> bool {
    change.events.iter().any(|event| {
        matches!(event, Event::CommandSent { from, command, .. }
            if from.as_str() == robot && command == what)
    })
}

fn text(change: &Change<'_>, robot: &str, variable: &str) -> String {
    change.hall.variables(robot)[variable].to_string()
}

/// Whether a robot begins this behavior.
fn begins(change: &Change<'_>, robot: &str, what: &str) -> bool {
    let (before, now) = behavior(change, robot);
    before != what && now == what
}

fn components() -> Vec<Row> {
    let mut rows = Vec::new();
    for face in ["happy", "neutral", "fearful", "angry"] {
        let word = format!("facial expression: {face}");
        rows.push(share(word, IN_HALL, BOTH, move |change, robot| {
            text(change, robot, "facial_expression") == face
        }));
    }
    let is_sad =
        |change: &Change<'_>, robot: &str| text(change, robot, "facial_expression") == "sad";
    rows.push(share("facial expression: sad", IN_PANTRY, BOTH, is_sad));

    for (word, sign) in [("valence: positive", 1.0), ("valence: negative", -1.0)] {
        rows.push(share(word, IN_HALL, BOTH, move |change, robot| {
            sign * change.hall.number(robot, "valence") > 0.0
        }));
    }
    for (label, from, to, setting) in [
        ("very high", 0.8, 2.0, IN_HALL),
        ("high", 0.6, 0.8, IN_HALL),
        ("medium", 0.4, 0.6, IN_HALL),
        ("low", 0.2, 0.4, IN_HALL),
        ("very low", 0.0, 0.2, IN_HALL),
        ("very low", 0.0, 0.2, IN_PANTRY),
    ] {
        let word = format!("intensity: {label}");
        rows.push(share(word, setting, BOTH, move |change, robot| {
            (from..to).contains(&change.hall.number(robot, "intensity"))
        }));
    }

    let lasts = |change: &Change<'_>, robot: &str| change.hall.number(robot, "duration_s") >= 60.0;
    rows.push(share("duration: a minute or more", IN_HALL, BOTH, lasts));
    for event in ["the exchange", "the delay", "the blocked way"] {
        let word = format!("focality: {event}");
        rows.push(share(word, IN_HALL, BOTH, move |change, robot| {
            text(change, robot, "focality") == format!("event: {event}")
        }));
    }
    let is_own = |change: &Change<'_>, robot: &str| text(change, robot, "agency") == "self";
    rows.push(share("agency: self", IN_HALL, BOTH, is_own));
    rows.push(share(
        "agency: other",
        IN_HALL,
        BOTH,
        move |change, robot| !is_own(change, robot),
    ));

    for (word, variable, below, setting) in [
        ("controllability below 0.5", "controllability", 0.5, IN_HALL),
        ("modifiability below 1", "modifiability", 1.0, IN_HALL),
        ("certainty below 1", "certainty", 1.0, WITH_PARTITION),
        ("external norms below 0.9", "external_norms", 0.9, IN_HALL),
        (
            "internal standards below 0.9",
            "internal_standards",
            0.9,
            IN_HALL,
        ),
        ("goal congruence below 0", "goal_congruence", 0.0, IN_HALL),
    ] {
        rows.push(share(word, setting, BOTH, move |change, robot| {
            change.hall.number(robot, variable) < below
        }));
    }
    for (word, variable, least) in [
        ("urgency 0.75 or more", "urgency", 0.75),
        ("novelty 0.5 or more", "novelty", 0.5),
    ] {
        rows.push(share(word, IN_HALL, BOTH, move |change, robot| {
            change.hall.number(robot, variable) >= least
        }));
    }

    for (kind, setting) in [
        ("goal", IN_HALL),
        ("achieved goal", IN_HALL),
        ("lost goal", IN_PANTRY),
    ] {
        let word = format!("causal chain: {kind}");
        rows.push(share(word, setting, BOTH, move |change, robot| {
            let chain = text(change, robot, "causal_chain");
            chain
                .split("; ")
                .any(|clause| clause.starts_with(&format!("{kind}: ")))
        }));
    }

    rows
}

fn moods_and_beliefs() -> Vec<Row> {
    let mut rows = Vec::new();
    for (word, sign) in [("positive mood", 1.0), ("negative mood", -1.0)] {
        rows.push(share(word, IN_MUSEUM, BOTH, move |change, robot| {
            sign * change.hall.number(robot, "mood") > 0.0
        }));
    }
    rows.push(share("negative mood", IN_PANTRY, BOTH, |change, robot| {
        change.hall.number(robot, "mood") < 0.0
    }));
    for (word, belief) in [
        ("belief: \"I can't do this\", with its cause", "cannot"),
        ("belief: \"I can indeed do this\", with its cause", "can"),
    ] {
        rows.push(share(word, IN_PANTRY, BOTH, move |change, robot| {
            let variables = change.hall.variables(robot);
            let has = |name: &str| variables.get(name).and_then(Variable::as_str);
            let is_explained = has("belief_because").is_some_and(|cause| !cause.is_empty());
            has("belief") == Some(belief) && is_explained
        }));
    }

    rows
}

fn emotions() -> Vec<Row> {
    let mut rows = Vec::new();
    for (emotion, setting, robots) in [
        ("HAPPY", IN_HALL, BOTH),
        ("CONFIDENT", IN_HALL, BOTH),
        ("CONCERNED", IN_HALL, BOTH),
        ("FRUSTRATED", IN_HALL, BOTH),
        ("FRUSTRATED", IN_CROWD, BOTH),
        ("ANGRY", WITH_ANGER, BOTH),
        ("DISCOURAGED", IN_PANTRY, BOTH),
        ("HOPEFUL", IN_PANTRY, BOTH),
    ] {
        rows.push(share(emotion, setting, robots, move |change, robot| {
            change.hall.emotion(robot) == emotion
        }));
    }
    for (from, to, setting, robots) in [
        ("HAPPY", "CONFIDENT", IN_HALL, BOTH),
        ("HAPPY", "CONCERNED", WITH_ANGER, BOTH),
        ("CONFIDENT", "CONCERNED", IN_HALL, BOTH),
        ("CONCERNED", "FRUSTRATED", IN_HALL, BOTH),
        ("CONCERNED", "FRUSTRATED", IN_CROWD, BOTH),
        ("FRUSTRATED", "ANGRY", WITH_ANGER, BOTH),
        ("FRUSTRATED", "CONCERNED", IN_HALL, BOTH),
        ("FRUSTRATED", "CONCERNED", IN_CROWD, BOTH),
        ("FRUSTRATED", "HAPPY", IN_HALL, BOTH),
        ("FRUSTRATED", "HAPPY", IN_CROWD, BOTH),
        ("FRUSTRATED", "DISCOURAGED", IN_PANTRY, BOTH),
        ("DISCOURAGED", "HOPEFUL", IN_PANTRY, BOTH),
    ] {
        let word = format!("{from} → {to}");
        rows.push(times(word, setting, robots, move |change, robot| {
            becomes(change, robot, from, to)
        }));
    }
    rows.push(share(
        "HAPPY after a positive input",
        IN_HALL,
        BOTH,
        |change, robot| {
            let progress = change.hall.variables(robot).get("progress");
            let is_positive = progress
                .and_then(Variable::as_f64)
                .is_some_and(|value| value > 0.0);
            is_positive && change.hall.emotion(robot) == "HAPPY"
        },
    ));
    rows.push(times(
        "exchange → HAPPY",
        IN_HALL,
        BOTH,
        |change, robot| {
            let (before, now) = behavior(change, robot);
            before == "EXCHANGE" && now != before && change.hall.emotion(robot) == "HAPPY"
        },
    ));
    rows.push(times(
        "DISCOURAGED → any other than HOPEFUL",
        IN_PANTRY,
        BOTH,
        |change, robot| {
            change.events.iter().any(|event| {
                matches!(event, Event::Emotion { robot: who, from: Some(from), to }
                if who.as_str() == robot && from == "DISCOURAGED" && to != "HOPEFUL")
            })
        },
    ));

    rows
}

/// Whether Leguin drives to Butler faster than she does without emotion.
fn speeds_up(change: &Change<'_>) -> bool {
    change.leguin == ("REFILL", "REFILL") && change.hall.speed_mps("Leguin") > 3.03 * FT_M
}

fn behaviors() -> Vec<Row> {
    vec![
        share("serve", IN_HALL, BUTLER, |change, _| {
            change.butler.1 == "SERVE"
        }),
        times("joke", IN_HALL, BOTH, |change, robot| {
            change.events.iter().any(|event| {
                matches!(event, Event::Say { robot: who, text }
                    if who.as_str() == robot && text.starts_with("jokes: "))
            })
        }),
        times("call for refill", IN_HALL, BUTLER, |change, _| {
            sends(change, "Butler", "refill")
        }),
        times(
            "serve (the refiller): she sets out",
            IN_HALL,
            LEGUIN,
            |change, _| change.leguin == ("WAIT", "REFILL"),
        ),
        times("ask to hurry", IN_HALL, BUTLER, |change, _| {
            sends(change, "Butler", "hurry")
        }),
        share("increase speed", IN_HALL, LEGUIN, |change, _| {
            speeds_up(change)
        }),
        times("intercept", IN_HALL, BUTLER, |change, robot| {
            begins(change, robot, "INTERCEPT")
        }),
        times("intercept", IN_CROWD, BUTLER, |change, robot| {
            begins(change, robot, "INTERCEPT")
        }),
        times(
            "blocked by a crowd → FRUSTRATED → intercept",
            IN_CROWD,
            BUTLER,
            |change, robot| {
                let is_blocked =
                    change.leguin.1 == "REFILL" && change.hall.number("Leguin", "blocked_s") > 0.0;
                is_blocked
                    && begins(change, robot, "INTERCEPT")
                    && change.hall.emotion(robot) == "FRUSTRATED"
            },
        ),
        times("go home, FRUSTRATED", IN_HALL, LEGUIN, |change, _| {
            change.leguin == ("REFILL", "GO_HOME")
        }),
        times("go home, FRUSTRATED", IN_CROWD, LEGUIN, |change, _| {
            change.leguin == ("REFILL", "GO_HOME")
        }),
        times(
            "exchange, begun in intercept mode",
            IN_HALL,
            BUTLER,
            |change, robot| begins(change, robot, "EXCHANGE") && change.butler.0 == "INTERCEPT",
        ),
        times(
            "exchange, begun in another mode",
            IN_HALL,
            BUTLER,
            |change, robot| begins(change, robot, "EXCHANGE") && change.butler.0 != "INTERCEPT",
        ),
        times(
            "stops and waits after the exchange",
            IN_HALL,
            LEGUIN,
            |change, robot| begins(change, robot, "AWAIT_GO_HOME"),
        ),
        times("\"go home\"", IN_HALL, BUTLER, |change, _| {
            sends(change, "Butler", "go home")
        }),
        times("go back", IN_HALL, BUTLER, |change, robot| {
            begins(change, robot, "GO_BACK")
        }),
        times("serves again at the start", IN_HALL, BUTLER, |change, _| {
            change.butler == ("GO_BACK", "SERVE")
        }),
        share(
            "treats exhausted before that",
            IN_HALL,
            BUTLER,
            |change, _| {
                change.butler.1 == "GO_BACK" && change.hall.number("Butler", "treats") == 0.0
            },
        ),
        times("waits at the table again", IN_HALL, LEGUIN, |change, _| {
            change.leguin == ("GO_HOME", "WAIT")
        }),
        share("the state of Figure 6", IN_HALL, BUTLER, |change, _| {
            is_state_of_figure_6(change)
        }),
        share(
            "conceptual: another plan than intercept",
            WITH_PLANS,
            BUTLER,
            |change, robot| {
                let variables = change.hall.variables(robot);
                variables
                    .get("plan")
                    .is_some_and(|plan| plan.as_str() != Some("intercept"))
            },
        ),
    ]
}

fn rows() -> Vec<Row> {
    let mut rows = components();
    rows.extend(emotions());
    rows.extend(moods_and_beliefs());
    rows.extend(behaviors());
    rows
}

/// What a run shows: its ticks, and in how many of them each robot is so, row by row.
#[derive(Default)]
struct Counts {
    ticks: u32,
    rows: Vec<[u32; 2]>,
}

/// How often a row occurs, as the table says it: how much, and in how many of the seeds.
fn frequency(runs: &[Counts], row: usize, robot: usize, unit: &Unit) -> String {
    let counts = runs.iter().map(|run| run.rows[row][robot]);
    let seeds = counts.clone().filter(|count| *count > 0).count();
    if seeds == 0 {
        return "never".to_owned();
    }

    let total = f64::from(counts.sum::<u32>());
    match unit {
        Unit::Share => {
            let ticks = f64::from(runs.iter().map(|run| run.ticks).sum::<u32>());
            let percent = 100.0 * total / ticks;
            if percent < 0.01 {
                format!("below 0.01 %, {seeds}")
            } else {
                format!("{percent:.2} %, {seeds}")
            }
        }
        Unit::Times => format!("{:.2}, {seeds}", total / runs.len() as f64),
    }
}

/// The cells of both robots for each word in each scenario.
fn measured() -> BTreeMap<(String, String), [String; 2]> {
    let mut by_setting: BTreeMap<Setting, Vec<Row>> = BTreeMap::new();
    for row in rows() {
        by_setting.entry(row.setting).or_default().push(row);
    }

    let mut cells = BTreeMap::new();
    for ((name, file, set), rows) in by_setting {
        let runs = watch_seeds(SEEDS, file, set, |counts: &mut Counts, change| {
            counts.ticks += 1;
            counts.rows.resize(rows.len(), [0, 0]);
            for (row, counts) in rows.iter().zip(&mut counts.rows) {
                for (robot, count) in ROBOTS.iter().zip(counts) {
                    let is_counted = row.robots.contains(robot);
                    *count += u32::from(is_counted && (row.occurs)(change, robot));
                }
            }
        });
        for (index, row) in rows.into_iter().enumerate() {
            let cell = |robot: usize| {
                if row.robots.contains(&ROBOTS[robot]) {
                    frequency(&runs, index, robot, &row.unit)
                } else {
                    String::new()
                }
            };
            let both = [cell(0), cell(1)];
            println!("{}, {name}: {both:?}", row.word);
            let before = cells.insert((row.word, name.to_owned()), both);
            assert!(before.is_none(), "a row is there twice");
        }
    }

    cells
}

/// A line of a table of the page: word, mark, files, tests, scenario, Butler, Leguin.
fn cells(line: &str) -> Option<[&str; 7]> {
    let inside = line.strip_prefix("| ")?.strip_suffix('|')?;
    let cells: Vec<&str> = inside.split('|').map(str::trim).collect();
    let cells: [&str; 7] = cells.try_into().ok()?;
    let is_row = !cells[0].starts_with("---") && cells[1] != "Mark";

    is_row.then_some(cells)
}

fn page() -> String {
    std::fs::read_to_string(root().join(PAGE)).unwrap()
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_frequencies_are_those_of_64_runs() {
    let mut measured = measured();
    let page = page();
    let mut lines = Vec::new();
    for line in page.lines() {
        let Some(cells) = cells(line).filter(|cells| !NOT_COUNTED.contains(&cells[4])) else {
            lines.push(line.to_owned());
            continue;
        };
        let [word, mark, files, tests, scenario, ..] = cells;
        let [butler, leguin] = measured
            .remove(&(word.to_owned(), scenario.to_owned()))
            .unwrap_or_else(|| panic!("{word}, {scenario} is not measured"));
        let row = [word, mark, files, tests, scenario, &butler, &leguin];
        lines.push(format!("| {} |", row.join(" | ")));
    }
    assert!(measured.is_empty(), "not on the page: {measured:?}");

    let now = lines.join("\n") + "\n";
    if std::env::var_os("CARS_UPDATE").is_some() {
        std::fs::write(root().join(PAGE), &now).unwrap();
    }
    let differences = lines.iter().zip(page.lines());
    for (now, on_page) in differences.filter(|(now, on_page)| now != on_page) {
        println!("on the page: {on_page}\nmeasured:    {now}");
    }
    assert!(
        now == self::page(),
        "out of date: run the test with CARS_UPDATE=1"
    );
}

/// All files of Rust below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }

    found
}

/// The names of all tests of the project.
fn tests() -> BTreeSet<String> {
    let mut tests = BTreeSet::new();
    for file in [
        sources(&root().join("crates")),
        sources(&root().join("tests")),
    ]
    .concat()
    {
        let text = std::fs::read_to_string(&file).unwrap();
        let mut is_test = false;
        for line in text.lines().map(str::trim_start) {
            is_test |= line == "#[test]";
            if let Some(rest) = line.strip_prefix("fn ").filter(|_| is_test) {
                tests.extend(rest.split_once('(').map(|(name, _)| name.to_owned()));
                is_test = false;
            }
        }
    }

    tests
}

/// What is between backticks.
fn code(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// The words of the paper's taxonomy, components, emotions, Table 2 and dynamics.
const WORDS: [&str; 41] = [
    "facial expression",
    "valence",
    "intensity",
    "urgency",
    "duration",
    "focality",
    "agency",
    "novelty",
    "controllability",
    "modifiability",
    "certainty",
    "external norms",
    "internal standards",
    "action tendency",
    "causal chain",
    "HAPPY",
    "CONFIDENT",
    "CONCERNED",
    "FRUSTRATED",
    "ANGRY",
    "DISCOURAGED",
    "HOPEFUL",
    "FreeActivate",
    "ContinueNormalActivity",
    "MonitorProgressClosely",
    "ChangeCurrentStrategy",
    "serve",
    "joke",
    "call for refill",
    "ask to hurry",
    "increase speed",
    "intercept",
    "go home",
    "exchange",
    "go back",
    "sensory-motor",
    "schematic",
    "conceptual",
    "caution",
    "interactive strategy",
    "preferences",
];

#[test]
fn the_table_names_files_and_tests_that_exist() {
    let page = page();
    let rows: Vec<[&str; 7]> = page.lines().filter_map(cells).collect();
    let tests = tests();

    for [word, mark, files, held_by, scenario, butler, leguin] in &rows {
        assert!(matches!(*mark, "[D]" | "[I]" | "[D: F2]"), "{word}: {mark}");
        for file in code(files) {
            assert!(root().join("crates").join(file).is_file(), "{word}: {file}");
        }
        for test in code(held_by) {
            assert!(tests.contains(test), "{word}: no test {test}");
        }

        let is_open = *scenario == "…";
        assert!(is_open || !code(files).is_empty(), "{word}: no file");
        assert!(is_open || !code(held_by).is_empty(), "{word}: no test");
        assert_eq!(
            NOT_COUNTED.contains(scenario),
            NOT_COUNTED.contains(butler) && NOT_COUNTED.contains(leguin),
            "{word}: a frequency has a scenario"
        );
    }

    for word in WORDS {
        let is_there = rows.iter().any(|row| row[0].contains(word));
        assert!(is_there, "{word} is in no row");
    }
}
