//! `cars export --emotionml`: documents are valid by W3C's schema, use terms of the vocabularies that they name, and have what the
//! record has.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::Command;

use roxmltree::{Document, Node};
use system_tests::tools::{lacks_tool, skip};
use system_tests::{Lab, root};

const HALL: &str = "configs/hors_doeuvres.toml";
const TICK_MS: u64 = 500;

/// The items of W3C's vocabularies that are used (Working Group Note, 1 April 2014).
const W3C: [(&str, &str); 8] = [
    (
        "everyday-categories",
        "affectionate afraid amused angry bored confident content disappointed excited happy interested loving pleased \
         relaxed sad satisfied worried",
    ),
    (
        "fsre-categories",
        "anger anxiety being-hurt compassion contempt contentment despair disappointment disgust fear guilt happiness hate \
         interest irritation jealousy joy love pleasure pride sadness shame stress surprise",
    ),
    (
        "frijda-categories",
        "anger arrogance desire disgust enjoyment fear humility indifference interest resignation shock surprise",
    ),
    (
        "occ-categories",
        "admiration anger disappointment distress fear fears-confirmed gloating gratification gratitude happy-for hate hope \
         joy love pity pride relief remorse reproach resentment satisfaction shame",
    ),
    (
        "fsre-dimensions",
        "valence potency arousal unpredictability",
    ),
    ("intensity-dimension", "intensity"),
    (
        "ema-appraisals",
        "relevance desirability agency blame likelihood unexpectedness urgency ego-involvement controllability \
         changeability power adaptability",
    ),
    (
        "frijda-action-tendencies",
        "approach avoidance being-with attending rejecting nonattending agonistic interrupting dominating submitting",
    ),
];

/// An `<emotion>`, as far as it is compared with the record.
#[derive(Debug, Clone, PartialEq)]
struct Emotion {
    robot: String,
    category: Option<String>,
    tendency: Option<String>,
    begin_ms: u64,
    duration_ms: u64,
    trace: Option<Vec<f64>>,
    values: BTreeMap<String, f64>,
    target: Option<String>,
}

/// Exports a run, and returns what the document has, with the notes.
#[track_caller]
fn export(lab: &Lab, run: &str, more: &[&str]) -> (Vec<Emotion>, String) {
    let args = [&["export", run, "--emotionml"], more].concat();
    let output = lab.cars(&args).output().unwrap();
    let notes = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{args:?}: {notes}");

    let text = String::from_utf8(output.stdout).unwrap();
    assert_valid(lab, &text);
    let document = Document::parse(&text).unwrap();
    assert_terms_are_known(&document);
    let nodes = document.root_element().children();
    let emotions = nodes.filter(|node| node.tag_name().name() == "emotion");
    (emotions.map(read).collect(), notes)
}

fn read(node: Node) -> Emotion {
    let elements = |name: &'static str| {
        node.children()
            .filter(move |child| child.tag_name().name() == name)
    };
    let name = |node: Node| node.attribute("name").unwrap().to_owned();
    let robot = |role: &str| {
        let found = elements("reference").find(|one| one.attribute("role") == Some(role))?;
        let uri = found.attribute("uri").unwrap();
        Some(uri.rsplit('/').next().unwrap().to_owned())
    };
    let number = |name: &str| node.attribute(name).unwrap().parse().unwrap();
    let mut descendants = node.descendants();
    let samples = descendants.find_map(|node| node.attribute("samples"));
    let values = elements("dimension").chain(elements("appraisal"));

    Emotion {
        robot: robot("experiencedBy").unwrap(),
        category: elements("category").next().map(name),
        tendency: elements("action-tendency").next().map(name),
        begin_ms: number("offset-to-start"),
        duration_ms: number("duration"),
        trace: samples.map(|samples| samples.split(' ').map(|one| one.parse().unwrap()).collect()),
        values: values
            .filter_map(|node| Some((name(node), node.attribute("value")?.parse().unwrap())))
            .collect(),
        target: robot("targetedAt"),
    }
}

/// Asserts that a document is valid by W3C's XML schema, where it and `xmllint` are at hand. It is no part of this project.
#[track_caller]
fn assert_valid(lab: &Lab, document: &str) {
    let given = std::env::var_os("CARS_EMOTIONML_XSD").map(PathBuf::from);
    let schema = given.unwrap_or_else(|| root().join("../shared/data/emotionml/emotionml.xsd"));
    if !schema.exists() {
        let get = "get emotionml.xsd and emotionml-fragments.xsd of https://www.w3.org/TR/emotionml/ and let \
                   CARS_EMOTIONML_XSD name the first";
        return skip("the schema of EmotionML", get);
    }

    let file = lab.write("document.xml", document);
    let mut xmllint = Command::new("xmllint");
    xmllint.args(["--noout", "--nonet", "--schema"]);
    match xmllint.arg(schema).arg(file).output() {
        Ok(output) => {
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{errors}");
        }
        Err(_) => lacks_tool("the schema of EmotionML", "`apt-get install libxml2-utils`"),
    }
}

/// Asserts that names are items of the vocabularies in the `*-set` attributes, which no XML schema can say.
#[track_caller]
fn assert_terms_are_known(document: &Document) {
    let mut known = BTreeMap::new();
    for (id, items) in W3C {
        let uri = format!("http://www.w3.org/TR/emotion-voc/xml#{id}");
        let items: BTreeSet<&str> = items.split_whitespace().collect();
        known.insert(uri, items);
    }
    let elements = || document.descendants().filter(Node::is_element);
    for vocabulary in elements().filter(|node| node.tag_name().name() == "vocabulary") {
        let items = vocabulary.children().filter(Node::is_element);
        let items = items.map(|item| item.attribute("name").unwrap());
        let uri = format!("#{}", vocabulary.attribute("id").unwrap());
        known.insert(uri, items.collect());
    }

    for node in elements() {
        let set = format!("{}-set", node.tag_name().name());
        let emotion = node.parent_element();
        if let Some(uri) = emotion.and_then(|emotion| emotion.attribute(set.as_str())) {
            let name = node.attribute("name").unwrap();
            assert!(known[uri].contains(name), "{name} of {uri}");
        }
    }
}

#[test]
fn t24_documents_are_valid_and_have_what_the_record_has() {
    let lab = Lab::new();
    let akr = "robot.Butler.params.dynamics.state_set=akr4";
    for (run, changes) in [
        ("hall", &[][..]),
        ("lossy", &["network.commands.loss=0.8", akr]),
        ("butler-without", &["robot.Butler.params.affect=off"]),
    ] {
        let mut args = vec!["run", HALL, "-q", "--run", run, "--set", "expect=[]"];
        args.extend(changes.iter().flat_map(|change| ["--set", change]));
        lab.ok(&args);

        let (own, notes) = export(&lab, run, &[]);
        assert_same_as_record(&lab, run, &own);
        let is_noted = notes.contains("Butler has a state without emotion, \"NEUTRAL\"");
        assert_eq!(is_noted, run == "butler-without", "{notes}");

        // The other view has the same emotions in other words.
        let (standard, _) = export(&lab, run, &["--standard"]);
        let without_words = |emotions: &[Emotion]| -> Vec<Emotion> {
            let mut emotions = emotions.to_vec();
            for one in &mut emotions {
                one.category = None;
                one.tendency = None;
            }
            emotions
        };
        assert_eq!(without_words(&standard), without_words(&own), "{run}");
        let count = |emotions: &[Emotion], name: &str| {
            let names = emotions.iter().filter_map(|one| one.category.as_deref());
            names.filter(|one| *one == name).count()
        };
        assert_eq!(count(&own, "ANGRY"), count(&standard, "angry"), "{run}");
        assert_eq!(count(&own, "ANGRY") > 0, run == "lossy", "{run}");

        let (leguin, _) = export(&lab, run, &["--robot", "Leguin"]);
        let mut of_leguin = own.clone();
        of_leguin.retain(|one| one.robot == "Leguin");
        assert_eq!(leguin, of_leguin);
    }
}

/// Every change of emotion begins an `<emotion>`, these leave nothing out, and their numbers are what was recorded.
#[track_caller]
fn assert_same_as_record(lab: &Lab, run: &str, emotions: &[Emotion]) {
    let ticks = lab.recorded(run);
    let end = ticks.len() as u64 - 1;
    let mut begun = BTreeMap::new();
    for event in lab.events(run) {
        let tick = event["tick"].as_u64().unwrap();
        if event["event"] == "emotion" && event["to"] != "NEUTRAL" && tick < end {
            let robot = event["robot"].as_str().unwrap().to_owned();
            begun.insert(
                (tick * TICK_MS, robot),
                event["to"].as_str().unwrap().to_owned(),
            );
        }
    }
    let found = emotions.iter().map(|one| {
        let when = (one.begin_ms, one.robot.clone());
        (when, one.category.clone().unwrap())
    });
    assert_eq!(found.collect::<BTreeMap<_, _>>(), begun, "{run}");

    for one in emotions {
        let first = (one.begin_ms / TICK_MS) as usize;
        let after = ((one.begin_ms + one.duration_ms) / TICK_MS) as usize;
        let reports = ticks[first..after].iter().map(|tick| {
            let (_, report) = tick
                .reports
                .iter()
                .find(|(name, _)| name.as_str() == one.robot)
                .unwrap();
            report
        });
        let mut published: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for report in reports {
            for (name, value) in &report.state_variables {
                // Who is responsible, if it is a name.
                let own = || value.as_str().map(|agent| f64::from(agent == "self"));
                let number = value.as_f64().or_else(own);
                published.entry(name).or_default().extend(number);
            }
        }
        let rounded = |value: &f64| (value * 1e6).round() / 1e6;
        let intensity: Vec<f64> = published["intensity"].iter().map(rounded).collect();
        assert_eq!(one.trace.as_ref(), Some(&intensity), "{run}: {one:?}");

        let mean = |name: &str| published[name].iter().sum::<f64>() / published[name].len() as f64;
        for (name, expected) in [
            ("urgency", mean("urgency")),
            ("controllability", mean("controllability")),
            ("agency", mean("agency")),
            ("unpredictability", 1.0 - mean("certainty")),
            ("desirability", 0.5 + 0.5 * mean("goal_congruence")),
            ("valence", 0.5 + 0.5 * mean("valence")),
            ("unexpectedness", mean("novelty")),
            ("changeability", mean("modifiability")),
        ] {
            let value = one.values[name];
            assert!(
                (value - expected).abs() < 2e-6,
                "{run}, {name}: {value}, {expected}"
            );
        }
    }

    // Leguin is held responsible when she does not come.
    let mut frustrated = emotions
        .iter()
        .filter(|one| one.category.as_deref() == Some("FRUSTRATED"));
    assert!(
        run == "butler-without" || frustrated.any(|one| one.target.as_deref() == Some("Leguin")),
        "{run}"
    );
}

#[test]
fn robots_may_call_emotions_what_they_like_and_publish_nothing_of_them() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "-q", "--run", "hall", "--duration", "30 s"]);
    let events = lab.file("hall", "events.jsonl");
    let name = "tr\u{e8}s content & <\"happy\">\u{1}";
    let text = std::fs::read_to_string(&events).unwrap();
    let renamed = text.replace("\"HAPPY\"", &serde_json::to_string(name).unwrap());
    std::fs::write(&events, renamed).unwrap();

    let (emotions, _) = export(&lab, "hall", &[]);
    let first = emotions[0].category.as_deref();
    assert_eq!(
        first,
        Some("tr_xE8_s_x20_content_x20__x26__x20__x3C__x22_happy_x22__x3E__x1_")
    );
    // In W3C's words it has no category, and its intensity is a dimension.
    let (emotions, _) = export(&lab, "hall", &["--standard"]);
    assert!(emotions[0].category.is_none() && emotions[0].trace.is_some());

    // Without a recording there is nothing but the times.
    std::fs::remove_file(lab.file("hall", "run.mcap")).unwrap();
    let (emotions, notes) = export(&lab, "hall", &[]);
    assert!(notes.contains("there is no recording"), "{notes}");
    let is_bare = |one: &Emotion| one.trace.is_none() && one.values.is_empty();
    assert!(!emotions.is_empty() && emotions.iter().all(is_bare));
    let (emotions, notes) = export(&lab, "hall", &["--standard"]);
    assert!(emotions.iter().all(|one| one.category.is_some()));
    assert!(
        notes.contains("are left out: no standard vocabulary has a term"),
        "{notes}"
    );
}

#[test]
fn a_record_without_an_end_is_exported_as_far_as_it_goes_and_a_damaged_one_is_refused() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "-q", "--run", "hall"]);
    let (_, text) = lab.fails(&["export", "hall", "--emotionml", "--robot", "Nobody"]);
    assert!(
        text.contains("no robot of this run is called Nobody"),
        "{text}"
    );

    let recording = lab.file("hall", "run.mcap");
    let bytes = std::fs::read(&recording).unwrap();
    std::fs::write(&recording, &bytes[..bytes.len() / 2]).unwrap();
    let (emotions, notes) = export(&lab, "hall", &[]);
    assert!(notes.contains("what comes after tick"), "{notes}");
    assert!(emotions.iter().all(|one| one.trace.is_some()));

    let mut garbled = bytes.clone();
    // Enough of it that it is not only an index, which is not read.
    for byte in garbled.iter_mut().skip(bytes.len() / 2).take(4096) {
        *byte ^= 1;
    }
    std::fs::write(&recording, garbled).unwrap();
    let (_, text) = lab.fails(&["export", "hall", "--emotionml"]);
    assert!(text.contains("damaged"), "{text}");
}
