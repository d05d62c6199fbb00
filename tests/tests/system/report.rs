//! `cars report` over real runs: the numbers on the page are those of the record.

use std::collections::BTreeMap;

use roxmltree::{Document, Node, ParsingOptions};
use serde_json::{Value, json};
use system_tests::Lab;

/// Most bytes of a report.
const MAX_BYTES: usize = 8_000_000;

fn parsed(html: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(html, options).unwrap()
}

fn text_of(node: Node<'_, '_>) -> String {
    let texts = node
        .descendants()
        .filter_map(|part| part.text().filter(|_| part.is_text()));
    texts.collect()
}

/// The rows of the first table whose head begins with these columns: texts, and numbers with all their decimals.
fn table(document: &Document<'_>, head: &[&str]) -> Vec<Vec<String>> {
    let tables = document
        .descendants()
        .filter(|node| node.has_tag_name("table"));
    for table in tables {
        let mut rows = table.descendants().filter(|node| node.has_tag_name("tr"));
        let columns = cells(rows.next().unwrap());
        if columns.len() >= head.len() && columns.iter().zip(head).all(|(a, b)| a == b) {
            return rows.map(cells).collect();
        }
    }
    panic!("there is no table {head:?}");
}

fn cells(row: Node<'_, '_>) -> Vec<String> {
    let cells = row.children().filter(Node::is_element);
    let text = |cell: Node<'_, '_>| {
        let number = cell.children().find(|node| node.has_tag_name("data"));
        match number {
            Some(number) => number.attribute("value").unwrap().to_owned(),
            None => text_of(cell),
        }
    };
    cells.map(text).collect()
}

fn assert_close(text: &str, expected: f64) {
    let found: f64 = text.parse().unwrap();
    assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
}

fn count(events: &[Value], kind: &str) -> usize {
    events.iter().filter(|event| event["event"] == kind).count()
}

/// Plays the hall into a run.
fn play(lab: &Lab, run: &str, more: &[&str]) {
    lab.ok(&[&["run", "configs/hors_doeuvres.toml", "--run", run], more].concat());
}

#[test]
fn the_numbers_on_the_page_are_those_of_the_record() {
    let lab = Lab::new();
    play(&lab, "hall", &["--set", "network.commands.loss=0.3"]);
    let html = lab.ok(&["report", "hall"]);
    assert_eq!(
        lab.ok(&["report", "hall"]),
        html,
        "the same run gives the same bytes"
    );

    let document = parsed(&html);
    let events = lab.events("hall");
    let summary = std::fs::read_to_string(lab.file("hall", "summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_states(&document, &summary);
    assert_transitions(&document, &events, "emotion", "Butler");
    assert_transitions(&document, &events, "behavior", "Leguin");

    let links = table(&document, &["Link", "sent", "arrived", "lost"]);
    let counts: Vec<usize> = links[0][1..4]
        .iter()
        .map(|cell| cell.parse().unwrap())
        .collect();
    let kinds = ["command_sent", "command_delivered", "command_dropped"];
    assert_eq!(counts, kinds.map(|kind| count(&events, kind)));
    assert!(counts[2] > 0);

    for row in table(
        &document,
        &["Robot", "sent", "arrived", "lost", "moves refused"],
    ) {
        let robot = &summary["robots"][&row[0]];
        assert_eq!(row[2], robot["received"].to_string());
        assert_eq!(row[3], robot["dropped"].to_string());
        assert_eq!(row[4], robot["blocked"].to_string());
    }
    for row in table(&document, &["Robot", "variable", "value"]) {
        let variable = &summary["robots"][&row[0]]["state_variables"][&row[1]];
        assert_close(&row[2], variable.as_f64().unwrap());
    }
    for row in table(&document, &["Robot", "parts visited", "time, s"]) {
        assert_close(&row[2], 600.0);
    }
}

/// The table of emotions and that of behaviors are those of the summary.
fn assert_states(document: &Document<'_>, summary: &Value) {
    let mut found: BTreeMap<(String, String), (f64, String)> = BTreeMap::new();
    let tables = document
        .descendants()
        .filter(|node| node.has_tag_name("table"));
    for table in tables {
        let mut rows = table.descendants().filter(|node| node.has_tag_name("tr"));
        if cells(rows.next().unwrap())
            .get(1)
            .is_none_or(|column| column != "state")
        {
            continue;
        }
        for row in rows.map(cells) {
            let time_s = row[2].parse().unwrap();
            found.insert((row[0].clone(), row[1].clone()), (time_s, row[4].clone()));
        }
    }

    let mut expected = 0;
    for robot in ["Butler", "Leguin"] {
        let of_robot = &summary["robots"][robot];
        for states in ["emotions_s", "behaviors_s"] {
            for (state, time_s) in of_robot[states].as_object().unwrap() {
                let (found_s, entered) = &found[&(robot.to_owned(), state.clone())];
                assert!(
                    (found_s - time_s.as_f64().unwrap()).abs() < 1e-6,
                    "{robot} {state}"
                );
                if states == "behaviors_s" {
                    assert_eq!(*entered, of_robot["entered"][state].to_string());
                }
                expected += 1;
            }
        }
    }
    assert_eq!(found.len(), expected);
}

/// The table of transitions of a robot, and its matrix, have as many as the events.
fn assert_transitions(document: &Document<'_>, events: &[Value], kind: &str, robot: &str) {
    let mut expected: BTreeMap<(String, String), usize> = BTreeMap::new();
    for event in events {
        if event["event"] == kind && event["robot"] == robot && event["from"].is_string() {
            let from = event["from"].as_str().unwrap().to_owned();
            let to = event["to"].as_str().unwrap().to_owned();
            *expected.entry((from, to)).or_insert(0) += 1;
        }
    }
    let title = format!("Transitions between {kind}s of {robot}");
    let chart = document
        .descendants()
        .find(|node| node.has_tag_name("title") && node.text() == Some(&title));
    let chart = chart.unwrap().parent().unwrap();
    let cells: Vec<String> = chart
        .descendants()
        .filter(|node| node.attribute("class") == Some("cell"))
        .map(|cell| {
            text_of(
                cell.children()
                    .find(|node| node.has_tag_name("title"))
                    .unwrap(),
            )
        })
        .collect();
    assert_eq!(cells.len(), expected.len());
    for ((from, to), count) in expected {
        let begin = format!("{from} → {to}: {count} ");
        assert!(
            cells.iter().any(|cell| cell.starts_with(&begin)),
            "{begin}{cells:?}"
        );
    }
}

#[test]
fn cuts_and_crashes_have_their_times() {
    let lab = Lab::new();
    let crash = r#"fault=[{ robot = "Leguin", do = "crash", at = "60 s", until = "90 s" }]"#;
    let cut = r#"network.partition=[{ groups = [["Butler"], ["Leguin"]], from = "120 s", until = "150 s" }]"#;
    let set = ["--set", crash, "--set", "on_late=continue", "--set", cut];
    play(&lab, "faults", &set);
    let html = lab.ok(&["report", "faults"]);
    let document = parsed(&html);
    let rows = table(&document, &["Run", "what", "of", "from, s", "until, s"]);
    let times = |what: &str, of: &str| {
        let row = rows.iter().find(|row| row[1] == what && row[2] == of);
        let row = row.unwrap_or_else(|| panic!("{what} of {of} is not among {rows:?}"));
        [row[3].clone(), row[4].clone()]
    };
    assert_eq!(times("crash", "Leguin"), ["60.0", "90.0"]);
    assert_eq!(times("cut", "Butler → Leguin"), ["120.0", "150.0"]);
    assert_eq!(times("cut", "Leguin → Butler"), ["120.0", "150.0"]);
    let absence = times("takes no part", "Leguin");
    assert!(absence[1].parse::<f64>().unwrap() >= 90.0, "{absence:?}");
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_report_of_sixty_four_runs_has_a_bounded_size() {
    let lab = Lab::new();
    let mut names = Vec::new();
    for seed in 1..=64 {
        let name = format!("s{seed}");
        play(&lab, &name, &["--seed", &seed.to_string()]);
        names.push(name);
    }
    let mut args = vec!["report"];
    args.extend(names.iter().map(String::as_str));
    let html = lab.ok(&args);
    assert!(html.len() < MAX_BYTES, "{} bytes", html.len());
    assert!(html.contains("The diagrams of the other 62 runs are left out"));

    let document = parsed(&html);
    let runs = table(&document, &["Run", "seed", "end", "time, s", "sent"]);
    assert_eq!(runs.len(), 64);
    let variables = table(
        &document,
        &["Robot", "variable", "n", "least", "median", "mean", "most"],
    );
    let served = variables.iter().find(|row| row[1] == "served").unwrap();
    assert_eq!(served[2], "64");
    let mut sum = 0.0;
    for name in &names {
        let summary = std::fs::read_to_string(lab.file(name, "summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        let served = &summary["robots"]["Butler"]["state_variables"]["served"];
        sum += served.as_f64().unwrap();
    }
    assert_close(&served[5], sum / 64.0);

    args.push("s1");
    let (_, text) = lab.fails(&args);
    assert!(text.contains("at most 64 runs"), "{text}");
}

#[test]
fn texts_of_others_stay_texts() {
    let lab = Lab::new();
    play(&lab, "hall", &["--duration", "60 s"]);
    let hostile = "<script>alert(1)</script>";
    let folder = lab.out().join(hostile.replace('/', "")).join("hall");
    std::fs::create_dir(folder.parent().unwrap()).unwrap();
    std::fs::rename(lab.out().join("hall"), &folder).unwrap();
    let scenario = folder.join("scenario.toml");
    let mut text = std::fs::read_to_string(&scenario).unwrap();
    text += "# </pre></details><script>alert(2)</script> \u{1b}[31m \u{202e}\n";
    std::fs::write(&scenario, text).unwrap();

    let html = lab.ok(&["report", folder.to_str().unwrap()]);
    let document = parsed(&html);
    assert!(
        !document
            .descendants()
            .any(|node| node.has_tag_name("script"))
    );
    assert!(html.contains("&lt;script&gt;alert(1)") && html.contains("&lt;script&gt;alert(2)"));
    assert!(!html.contains('\u{1b}') && !html.contains('\u{202e}'));
}

#[test]
fn what_is_missing_is_named() {
    let lab = Lab::new();
    let args = ["--duration", "60 s", "--set", "record.frames=false"];
    play(&lab, "bare", &args);
    let html = lab.ok(&["report", "bare"]);
    assert!(html.contains("nor the occupancy of the floor is known"));
    assert!(!html.contains("Occupancy of the floor"));

    let events = lab.file("bare", "events.jsonl");
    let bytes = std::fs::read(&events).unwrap();
    std::fs::write(&events, &bytes[..bytes.len() / 2]).unwrap();
    let html = lab.ok(&["report", "bare"]);
    assert!(html.contains("The record has no end"));

    let output = lab.out().join("bare/events.jsonl");
    let (_, text) = lab.fails(&["report", "bare", "-o", output.to_str().unwrap()]);
    assert!(text.contains("is part of the record"), "{text}");
    let (_, text) = lab.fails(&["report", "nothing"]);
    assert!(text.contains("there is no run nothing"), "{text}");
    let empty = lab.out().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let (_, text) = lab.fails(&["report", empty.to_str().unwrap()]);
    assert!(text.contains("is not the folder of a run"), "{text}");
}

/// Plays an experiment into a folder of the lab and returns the folder.
fn play_experiment(lab: &Lab, file: &str, more: &[&str]) -> String {
    let folder = lab.out().join("experiment");
    let folder = folder.to_str().unwrap().to_owned();
    let args = [&["experiment", "run", file, "-o", &folder], more].concat();
    let (status, text) = lab.cars_without_out(&args);
    assert_eq!(status, 0, "{text}");
    folder
}

/// `runs.csv` of an experiment without texts in quotes: each row by the names of its columns.
fn runs_csv(folder: &str) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(format!("{folder}/runs.csv")).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells = line.split(',').map(str::to_owned);
        head.iter()
            .map(|name| (*name).to_owned())
            .zip(cells)
            .collect()
    };
    lines.map(row).collect()
}

/// The numbers of a column in the runs of an arm under a condition, by seed.
fn numbers<'a>(
    runs: &'a [BTreeMap<String, String>],
    [condition, arm]: [&str; 2],
    column: &str,
) -> BTreeMap<&'a str, f64> {
    let mut numbers = BTreeMap::new();
    for run in runs {
        if run["condition"] == condition && run["arm"] == arm {
            numbers.insert(run["seed"].as_str(), run[column].parse().unwrap());
        }
    }
    numbers
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    values.sum::<f64>() / count as f64
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_numbers_of_an_experiment_are_those_of_its_runs() {
    let lab = Lab::new();
    let args = ["--seeds", "8", "--duration", "200 s"];
    let folder = play_experiment(&lab, "deadlock", &args);
    let html = lab.ok(&["report", &folder]);
    assert_eq!(
        lab.ok(&["report", &folder]),
        html,
        "the same results give the same bytes"
    );

    let document = parsed(&html);
    let runs = runs_csv(&folder);
    let condition = |heading: &str| heading.strip_prefix("loss ").unwrap().to_owned();
    let rows = table(&document, &["Condition", "arm", "n", "mean"]);
    assert_eq!(rows.len(), 5 * 5, "arms under conditions");
    for row in &rows {
        let served = numbers(&runs, [&condition(&row[0]), &row[1]], "served");
        assert_eq!(row[2], served.len().to_string());
        assert_close(&row[3], mean(served.into_values()));
    }
    let rows = table(&document, &["Condition", "arm", "pairs", "difference"]);
    assert_eq!(
        rows.len(),
        5 * 4,
        "arms other than the baseline under conditions"
    );
    for row in &rows {
        let condition = condition(&row[0]);
        let served = numbers(&runs, [&condition, &row[1]], "served");
        let baseline = numbers(&runs, [&condition, "emotions"], "served");
        let differences: Vec<f64> = served
            .iter()
            .map(|(seed, value)| value - baseline[seed])
            .collect();
        assert_close(&row[3], mean(differences.into_iter()));
    }
    for row in table(&document, &["Condition", "arm", "n", "with it"]) {
        let condition = condition(&row[0]);
        let of_cell = runs
            .iter()
            .filter(|run| run["condition"] == condition && run["arm"] == row[1]);
        let deadlocked = of_cell
            .filter(|run| run["deadlock_state"] == "reached")
            .count();
        assert_eq!(row[3], deadlocked.to_string());
    }

    let marks = |class: &str| {
        let charts = document
            .descendants()
            .filter(|node| node.attribute("class") == Some(class));
        let first = charts.into_iter().next().unwrap();
        let rows = first
            .descendants()
            .filter(|node| node.attribute("class") == Some("row"));
        rows.count()
    };
    assert_eq!(marks("chart trend"), 25);
    assert_eq!(
        marks("chart intervals"),
        4,
        "differences under one condition"
    );
    assert_has_two_runs(&document, &html, &folder);
}

/// The typical and the worst run have their diagrams and the commands that record them.
fn assert_has_two_runs(document: &Document<'_>, html: &str, folder: &str) {
    let diagrams = document.descendants().filter(|node| {
        let class = node.attribute("class").unwrap_or_default();
        node.has_tag_name("svg") && class == "cars-diagram"
    });
    assert!(diagrams.count() >= 2);
    assert_eq!(
        html.matches(&format!("cars experiment replay {folder} "))
            .count(),
        2 + 1
    );
    assert!(!html.contains("It cannot be shown"));
    let question = document.descendants().find(|node| node.has_tag_name("h1"));
    assert_eq!(
        text_of(question.unwrap()),
        "Which team stops working when commands between its robots are lost?"
    );
}

/// An experiment with two factors, two arms, four measures and 36 units: three seeds, the fewest that are compared.
fn small_experiment(report: &str) -> String {
    let scenario = system_tests::root().join("configs/hors_doeuvres.toml");
    let mut file = format!(
        "question = \"What is shown?\"\nscenario = {scenario:?}\nseeds = 3\nduration = \"20 s\"\nbaseline = \"a\"\n{report}\n\
         [[factor]]\nname = \"guests\"\npath = \"guests.count\"\nvalues = [5, 10, 15]\n\
         [[factor]]\nname = \"loss\"\nset = [\"network.commands={{ loss = {{value}} }}\"]\nvalues = [0, 0.5]\n\
         [[arm]]\nname = \"a\"\n[[arm]]\nname = \"b\"\nset = [\"robot.Butler.params.caution=0.9\"]\n\
         [[measure]]\nname = \"first\"\ncontrast = true\n[measure.time]\nto = {{ event = \"behavior\", robot = \"Butler\" }}\n"
    );
    for name in ["treats", "ticks", "more"] {
        file += &format!(
            "[[measure]]\nname = \"{name}\"\ncontrast = true\nsummary = \"robots.Butler.state_variables.treats\"\n"
        );
    }
    file
}

/// Headings of a page.
fn headings(html: &str, tag: &str) -> Vec<String> {
    let document = parsed(html);
    let found = document.descendants().filter(|node| node.has_tag_name(tag));
    found.map(text_of).collect()
}

#[test]
fn the_answer_is_a_sentence_and_its_figure_and_zeros_are_left_out() {
    let lab = Lab::new();
    let mut file = small_experiment("");
    for (name, key) in [("never", "Leguin.missed"), ("lost", "Leguin.dropped")] {
        file += &format!("[[measure]]\nname = \"{name}\"\nsummary = \"robots.{key}\"\n");
    }
    let file = lab.write("zeros.toml", &file);
    let folder = play_experiment(&lab, file.to_str().unwrap(), &[]);
    let html = lab.ok(&["report", &folder]);
    let document = parsed(&html);

    let lead = document
        .descendants()
        .filter(|node| node.attribute("class") == Some("lead"));
    let lead: Vec<String> = lead.map(text_of).collect();
    assert_eq!(lead.len(), 1);
    assert_eq!(lead[0].matches(". ").count(), 0, "{lead:?}");
    assert!(
        lead[0].ends_with("pairs each, which are too few to show one)."),
        "{lead:?}"
    );
    let answer = document
        .descendants()
        .find(|node| node.attribute("id") == Some("section-1"));
    let mut parts = answer.unwrap().children().filter(Node::is_element);
    assert_eq!(text_of(parts.next().unwrap()), "Answer");
    assert_eq!(parts.next().unwrap().attribute("id"), Some("figure-1"));
    let points = document.descendants();
    assert!(
        points
            .filter(|node| node
                .attribute("class")
                .is_some_and(|class| class.starts_with("dots")))
            .count()
            > 0
    );

    // A measure that is zero everywhere has no section, and a condition in which it is zero has no panel.
    assert!(!headings(&html, "h2").contains(&"Never".to_owned()));
    assert!(html.contains("Zero in every run, and therefore not shown: never."));
    assert!(headings(&html, "h2").contains(&"Lost".to_owned()));
    let zero = "Where lost is zero in every run, nothing is drawn: guests 5, loss 0; ";
    assert!(html.contains(zero));
}

#[test]
fn a_report_shows_what_its_experiment_names_and_results_stay_as_they_are() {
    let lab = Lab::new();
    let file = lab.write("small.toml", &small_experiment(""));
    let file = file.to_str().unwrap();
    let folder = play_experiment(&lab, file, &[]);
    let results = || {
        ["runs.csv", "results.json"]
            .map(|name| std::fs::read_to_string(format!("{folder}/{name}")).unwrap())
    };
    let before = results();
    let html = lab.ok(&["report", &folder]);
    assert_eq!(
        headings(&html, "h2"),
        [
            "Answer",
            "Design",
            "First",
            "Treats",
            "Ticks",
            "More",
            "Expectations",
            "Example runs",
            "Reproduction"
        ]
    );
    let examples = ["The typical run", "The worst run"];
    assert!(headings(&html, "h3").ends_with(&examples.map(str::to_owned)));
    assert!(!html.contains("class=\"chart trend\""));
    for class in ["chart steps", "chart floor", "cars-diagram"] {
        assert!(html.contains(&format!("class=\"{class}\"")), "{class}");
    }

    let report = "[report]\nmeasures = [\"ticks\", \"first\"]\nx = \"guests\"\n\
                  show = [\"estimates\", \"heat maps\", \"floor\"]\nruns = [17, \"typical\"]";
    lab.write("small.toml", &small_experiment(report));
    let (status, text) = lab.cars_without_out(&["experiment", "run", file, "-o", &folder]);
    assert_eq!(status, 0, "{text}");
    assert!(text.contains("36 are there, 0 to play"), "{text}");
    assert_eq!(results(), before);

    let html = lab.ok(&["report", &folder]);
    let sections = [
        "Answer",
        "Design",
        "Ticks",
        "First",
        "Example runs",
        "Reproduction",
    ];
    assert_eq!(headings(&html, "h2"), sections);
    let examples = ["Unit 17", "The typical run"];
    assert!(headings(&html, "h3").ends_with(&examples.map(str::to_owned)));
    assert!(html.contains("not shown by choice of the experiment file: treats, more."));
    let document = parsed(&html);
    let charts = |class: &str| {
        let found = document.descendants();
        found
            .filter(|node| node.attribute("class") == Some(class))
            .count()
    };
    assert_eq!(
        charts("chart trend"),
        2 * 2 * 2,
        "measures, values of loss, differences"
    );
    assert_eq!(charts("chart matrix"), 2 * 2, "measures, arms");
    assert_eq!(charts("chart floor"), 2 * 2, "runs, robots");
    for class in [
        "chart steps",
        "chart intervals",
        "chart bands",
        "cars-diagram",
    ] {
        assert_eq!(charts(class), 0, "{class}");
    }
}

#[test]
fn a_report_of_what_there_is_not_is_refused_before_anything_runs() {
    let lab = Lab::new();
    let folder = lab.out().join("none");
    let folder = folder.to_str().unwrap();
    for (report, reason) in [
        ("measures = [\"served\"]", "there is no measure \"served\""),
        ("show = [\"all\"]", "unknown variant `all`"),
        ("runs = [36]", "there is no unit 36"),
    ] {
        let text = small_experiment(&format!("[report]\n{report}"));
        let file = lab.write("small.toml", &text);
        let file = file.to_str().unwrap();
        for args in [
            &["check", file][..],
            &["experiment", "run", file, "-o", folder],
        ] {
            let (status, text) = lab.cars_without_out(args);
            assert_ne!(status, 0, "{report}");
            assert!(text.contains(reason), "{text}");
            assert!(text.contains("small.toml:7:"), "{text}");
        }
        assert!(!std::path::Path::new(folder).exists());
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn ten_thousand_runs_over_two_factors_are_a_page_of_a_bounded_size() {
    let lab = Lab::new();
    let scenario = system_tests::root().join("configs/hors_doeuvres.toml");
    let mut file = format!(
        "question = \"How large is <b>this</b>?\"\nscenario = {scenario:?}\nseeds = 100\nduration = \"5 s\"\n\
         baseline = \"a0\"\n\
         [[factor]]\nname = \"guests\"\npath = \"guests.count\"\nvalues = [1, 2, 3, 4, 5]\n\
         [[factor]]\nname = \"loss\"\nset = [\"network.commands={{ loss = {{value}} }}\"]\nvalues = [0, 0.1, 0.2, 0.3, 0.4]\n"
    );
    for arm in 0..4 {
        let caution = 1.0 - f64::from(arm) / 10.0;
        file += &format!(
            "[[arm]]\nname = \"a{arm}\"\nset = [\"robot.Butler.params.caution={caution}\"]\n"
        );
    }
    for measure in 0..3 {
        file += &format!(
            "[[measure]]\nname = \"m{measure}\"\ncontrast = true\nsummary = \"robots.Butler.state_variables.treats\"\n"
        );
    }
    file += "[[measure]]\nname = \"first\"\ncontrast = true\n[measure.time]\nto = { event = \"behavior\", robot = \"Butler\" }\n";
    let file = lab.write("large.toml", &file);
    let folder = play_experiment(&lab, file.to_str().unwrap(), &[]);

    let html = lab.ok(&["report", &folder]);
    assert!(html.len() < MAX_BYTES, "{} bytes", html.len());
    let document = parsed(&html);
    let maps = document
        .descendants()
        .filter(|node| node.attribute("class") == Some("chart matrix"));
    let cells = maps.map(|map| {
        map.descendants()
            .filter(|node| node.attribute("class") == Some("cell"))
            .count()
    });
    let mut expected = vec![25; 4 * 4];
    expected.extend([24 * 4; 6]);
    assert_eq!(
        cells.collect::<Vec<usize>>(),
        expected,
        "a map for each measure and arm, and one for each expectation"
    );
    assert!(html.contains("The first 24 of 25 conditions are drawn"));
}

#[test]
fn what_is_no_run_and_no_experiment_is_refused_by_name() {
    let lab = Lab::new();
    let (_, text) = lab.fails(&["report", "configs/experiments/deadlock.toml"]);
    assert!(text.contains("is a file"), "{text}");
    assert!(text.contains("cars experiment run"), "{text}");

    play(&lab, "hall", &["--duration", "10 s"]);
    let folder = lab.out().join("planned");
    let folder = folder.to_str().unwrap();
    let args = ["experiment", "run", "deadlock", "--plan-only", "-o", folder];
    let (status, text) = lab.cars_without_out(&args);
    assert_eq!(status, 0, "{text}");
    let (_, text) = lab.fails(&["report", folder]);
    assert!(text.contains("no unit of the experiment"), "{text}");
    let (_, text) = lab.fails(&["report", "hall", folder]);
    assert!(text.contains("runs or one experiment"), "{text}");
}

#[test]
fn figures_are_files_of_their_own_and_replace_nothing_unasked() {
    let lab = Lab::new();
    play(&lab, "hall", &["--duration", "60 s"]);
    let folder = lab.out().join("figures");
    let into = folder.to_str().unwrap();
    let printed = lab.ok(&["report", "hall", "--figures", into]);
    assert!(!printed.contains("<html"), "the page is not asked for");

    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    // The course, behaviors, the diagram, transitions between emotions and between behaviors, and the floor.
    let mut expected = Vec::new();
    for number in 1..=6 {
        for end in ["csv", "pdf", "svg", "vl.json"] {
            expected.push(format!("figure-{number}.{end}"));
        }
    }
    assert_eq!(names, expected);
    let csv = std::fs::read_to_string(folder.join("figure-1.csv")).unwrap();
    assert!(
        csv.starts_with("panel,heading,row,state,from_s,to_s,robot,time_s,value\n"),
        "{csv}"
    );
    let treats = csv.lines().filter(|line| line.ends_with(",30")).count();
    assert!(treats > 0, "{csv}");
    let number_of_figures = lab.ok(&["report", "hall"]).matches("<figure id=").count();
    assert_eq!(
        number_of_figures, 6,
        "a figure has its number in the report"
    );

    let own = folder.join("figure-1.svg");
    std::fs::write(&own, "mine").unwrap();
    let (_, text) = lab.fails(&["report", "hall", "--figures", into]);
    assert!(text.contains("is not empty"), "{text}");
    assert_eq!(std::fs::read_to_string(&own).unwrap(), "mine");
    let printed = lab.ok(&[
        "report",
        "hall",
        "--figures",
        into,
        "--replace",
        "--width-mm",
        "120",
    ]);
    assert!(std::fs::read_to_string(&own).unwrap().starts_with("<svg"));
    let narrow = "figure-1: 180 mm: narrower, its letters would be too small";
    assert!(printed.contains(narrow), "{printed}");
    let (_, text) = lab.fails(&[
        "report",
        "hall",
        "--figures",
        into,
        "--replace",
        "--width-mm",
        "50",
    ]);
    assert!(text.contains("from 86 to 400 mm"), "{text}");
    let run = lab.out().join("hall");
    let (_, text) = lab.fails(&["report", "hall", "--figures", run.to_str().unwrap()]);
    assert!(text.contains("is not empty"), "{text}");
}

/// A run of robots without emotions.
#[test]
fn the_first_figure_of_robots_without_emotions_is_of_their_behaviors() {
    let lab = Lab::new();
    lab.ok(&["run", "auction", "--run", "auction"]);
    let html = lab.ok(&["report", "auction"]);
    let document = parsed(&html);
    let figure = document
        .descendants()
        .find(|node| node.attribute("id") == Some("figure-1"));
    let text = text_of(figure.unwrap());
    assert!(
        text.contains("Behaviors over time") && text.contains("WORK"),
        "{text}"
    );
    let states = table(&document, &["Robot", "state", "time, s"]);
    assert!(states.iter().all(|row| !row[1].is_empty()), "{states:?}");
    let summary = lab.summary("auction");
    assert_eq!(summary["robots"]["B1"]["emotions_s"], serde_json::json!({}));
}

/// Where every run reaches a time, the percentage of the runs that do says nothing.
#[test]
fn a_time_that_every_run_reaches_is_shown_as_a_number() {
    let lab = Lab::new();
    let scenario = system_tests::root().join("configs/auction.toml");
    let text = r#"question = "When are all tasks done?"
duration = "120 s"
seeds = 4
baseline = "much"
[[arm]]
name = "much"
[[arm]]
name = "never"
set = ["robot.B*.params.sends=never"]
[[measure]]
name = "finished"
contrast = true
time = { to = { sites = "T*", by = "all", variable = "done" } }
"#;
    let file = lab.write("reached.toml", &format!("scenario = {scenario:?}\n{text}"));
    let folder = play_experiment(&lab, file.to_str().unwrap(), &[]);
    let html = lab.ok(&["report", &folder]);
    let figure = parsed(&html)
        .descendants()
        .find(|node| node.attribute("id") == Some("figure-1"))
        .map(text_of)
        .unwrap();
    assert!(
        figure.contains("mean time to finished, in seconds"),
        "{figure}"
    );
    assert!(!html.contains("runs with finished, %"));

    let document = parsed(&html);
    let rows = table(&document, &["Condition", "arm", "n", "mean"]);
    let of_much = runs_csv(&folder)
        .into_iter()
        .filter(|run| run["arm"] == "much");
    let times: Vec<f64> = of_much
        .map(|run| run["finished"].parse().unwrap())
        .collect();
    assert_eq!(times.len(), 4);
    assert_close(&rows[0][3], mean(times.into_iter()));
}

/// Writes an answer of `cars why` about a run: its outcome jumps in tick 60.
pub(crate) fn explain(lab: &Lab, run: &str) {
    let events = lab.events(run);
    let tick = events
        .iter()
        .rfind(|event| event["event"] == "tick")
        .unwrap();
    let outcomes =
        |value: f64| json!({"n": 200, "value": value, "low": value - 0.05, "high": value + 0.05});
    let point = |tick: u64, value: f64| json!({"tick": tick, "n": 64, "value": value, "low": value - 0.05, "high": value + 0.05});
    let answer = json!({
        "digest": tick["digest"],
        "question": {"kind": "expectation", "name": "a call is answered", "or_undecided": false},
        "is_share": true, "recorded": 1.0, "tick_s": 0.5, "last": tick["tick"], "sentence": "It was decided at 30 s.",
        "curve": [point(0, 0.12), point(59, 0.12), point(60, 0.9), point(100, 0.9)],
        "jumps": [{
            "tick": 60, "before": outcomes(0.12), "after": outcomes(0.9), "p": 0.001, "events": ["command 9 is lost"], "tried": [],
            "cause": {"what": "command 9 was lost", "is_event": true, "without": outcomes(0.1)},
        }],
        "kinds": [], "planned": [], "forks": 1000,
    });
    let folder = lab.file(run, "why");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("a-call.json"), answer.to_string()).unwrap();
}

#[test]
fn what_decided_the_run_is_a_curve_and_a_table_of_its_jumps() {
    let lab = Lab::new();
    play(&lab, "hall", &["--duration", "100 s"]);
    let without = lab.ok(&["report", "hall"]);
    assert!(!without.contains("What decided it"));

    explain(&lab, "hall");
    let html = lab.ok(&["report", "hall"]);
    let document = parsed(&html);
    assert!(html.contains("It was decided at 30 s."));
    let rows = table(&document, &["Tick", "time, s", "before", "after", "forks"]);
    let expected = [
        "60",
        "30.0",
        "12 % (7 % to 17 %)",
        "90 % (85 % to 95 %)",
        "200",
        "command 9 was lost",
        "10 % (5 % to 15 %)",
    ];
    assert_eq!(rows, [expected]);
    let has_class = |node: &Node<'_, '_>, class| node.attribute("class") == Some(class);
    let mut nodes = document.descendants();
    assert!(nodes.any(|node| has_class(&node, "chart outcome")));

    // What is damaged is said, and what is of another run is left out.
    let file = lab.file("hall", "why/a-call.json");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(
        lab.file("hall", "why/other.json"),
        text.replace("\"digest\":\"", "\"digest\":\"0"),
    )
    .unwrap();
    std::fs::write(lab.file("hall", "why/worse.json"), &text[..50]).unwrap();
    let damaged = lab.ok(&["report", "hall"]);
    assert!(damaged.contains("why/worse.json cannot be shown"));
    assert_eq!(
        damaged.matches("chart outcome").count(),
        html.matches("chart outcome").count()
    );
}
