//! `cars emotionml` over real runs: the documents keep the rules of EmotionML and say what the run's record says.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod rules;
mod schema;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use protocol::messages::{Point, Report};
use protocol::{RobotName, RunName, Tick};
use recording::{Frame, Header, PlacedRobot, RecordedTick, Recording, Wall, Writer};
use roxmltree::{Document, Node};
use serde_json::{Value, json};

/// A place for runs, and the means to make and export them.
struct Lab(tempfile::TempDir);

impl Lab {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn cars(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cars"));
        command
            .current_dir(self.0.path())
            .args(args)
            .arg("--out")
            .arg(self.0.path())
            .env("NO_COLOR", "1");
        command
    }

    /// Runs one of the project's scenarios under a name.
    #[track_caller]
    fn run(&self, scenario: &str, name: &str, changes: &[&str]) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../configs")
            .join(scenario);
        let mut command = self.cars(&["run", "--quiet", "--run", name]);
        command.arg(file);
        // Not all of these runs do what is expected of the hall.
        command.args(["--set", "expect=[]"]);

        for change in changes {
            command.args(["--set", change]);
        }

        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
    }

    fn output(&self, args: &[&str]) -> Output {
        self.cars(&["emotionml"]).args(args).output().unwrap()
    }

    /// Exports, and demands that this succeeds and keeps the rules.
    #[track_caller]
    fn export(&self, args: &[&str]) -> (String, String) {
        let output = self.output(args);
        assert!(output.status.success(), "{}", stderr(&output));

        let document = String::from_utf8(output.stdout.clone()).unwrap();
        assert_eq!(rules::broken(&document), [].into(), "{args:?}: {document}");
        assert_ne!(
            schema::is_valid(&document, self.0.path()),
            Some(false),
            "{args:?}"
        );

        (document, stderr(&output))
    }

    /// Exports, and demands that this is refused.
    #[track_caller]
    fn refusal(&self, args: &[&str]) -> String {
        let output = self.output(args);
        assert!(!output.status.success());
        stderr(&output)
    }

    fn recording(&self, run: &str) -> PathBuf {
        self.path(run).join("run.mcap")
    }

    /// Writes a recording of its own making: the robots of each tick.
    fn record(&self, name: &str, ticks: &[Value]) {
        std::fs::create_dir_all(self.path(name)).unwrap();
        let ticks = (0..).zip(ticks);
        write(
            &self.recording(name),
            &header(),
            ticks.map(|(tick, robots)| recorded(tick, robots)),
        );
    }

    /// The ticks of a recording, each with its robots.
    fn ticks(&self, run: &str) -> Vec<Value> {
        let recording = Recording::open(&self.recording(run)).unwrap();
        let mut ticks = Vec::new();
        for tick in recording.read(0, recording.len()).unwrap() {
            let mut robots = Vec::new();
            for (name, report) in &tick.reports {
                let mut robot = serde_json::to_value(report).unwrap();
                robot["name"] = name.as_str().into();
                robots.push(robot);
            }
            ticks.push(json!({"tick": tick.tick(), "robots": robots}));
        }
        ticks
    }

    fn lines(&self, run: &str, file: &str) -> Vec<Value> {
        let text = std::fs::read_to_string(self.path(run).join(file)).unwrap();
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }
}

fn stderr(output: &Output) -> String {
    // The terminal's line breaks are no part of what is said.
    let text = String::from_utf8_lossy(&output.stderr).replace('\u{2502}', " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// An `<emotion>`, as far as it is compared with the record.
#[derive(Debug, Clone, PartialEq)]
struct Emotion {
    id: String,
    robot: String,
    category: Option<String>,
    offset_ms: u64,
    duration_ms: u64,
    trace: Option<Vec<f64>>,
    values: BTreeMap<String, f64>,
    tendency: Option<String>,
    target: Option<String>,
    info: String,
    face: bool,
}

fn emotions(document: &str) -> Vec<Emotion> {
    let document = Document::parse(document).unwrap();
    let nodes = document
        .root_element()
        .children()
        .filter(|node| node.tag_name().name() == "emotion");
    nodes.map(emotion).collect()
}

fn emotion(node: Node) -> Emotion {
    let named = |name: &'static str| {
        node.children()
            .filter(move |child| child.tag_name().name() == name)
    };
    let reference = |role: &str| {
        let found =
            named("reference").find(|reference| reference.attribute("role") == Some(role))?;
        found
            .attribute("uri")?
            .rsplit('/')
            .next()
            .map(str::to_owned)
    };
    let own = |node: Node| node.attribute("name").unwrap().to_owned();
    let values = named("dimension")
        .chain(named("appraisal"))
        .filter_map(|node| Some((own(node), node.attribute("value")?.parse().unwrap())));
    let trace = node
        .descendants()
        .find_map(|node| node.attribute("samples"));

    Emotion {
        id: node.attribute("id").unwrap().to_owned(),
        robot: reference("experiencedBy").unwrap(),
        category: named("category").next().map(own),
        offset_ms: node.attribute("offset-to-start").unwrap().parse().unwrap(),
        duration_ms: node.attribute("duration").unwrap().parse().unwrap(),
        trace: trace.map(|samples| {
            samples
                .split(' ')
                .map(|sample| sample.parse().unwrap())
                .collect()
        }),
        values: values.collect(),
        tendency: named("action-tendency").next().map(own),
        target: reference("targetedAt"),
        info: named("info")
            .next()
            .and_then(|info| info.text())
            .unwrap_or("")
            .to_owned(),
        face: node.attribute("expressed-through") == Some("face"),
    }
}

fn category<'a>(emotions: &'a [Emotion], robot: &str, name: &str) -> Vec<&'a Emotion> {
    let is_it = |one: &&Emotion| one.robot == robot && one.category.as_deref() == Some(name);
    emotions.iter().filter(is_it).collect()
}

/// The runs of test 24: name, scenario, changes.
const RUNS: [(&str, &str, &[&str]); 4] = [
    ("hall", "hors_doeuvres.toml", &[]),
    (
        "three",
        "three_robots.toml",
        &["robot.Butler.params.refiller=Vonda"],
    ),
    (
        "affectless",
        "hors_doeuvres.toml",
        &[
            "robot.Butler.params.affect=off",
            "robot.Leguin.params.affect=off",
        ],
    ),
    (
        "lossy",
        "hors_doeuvres.toml",
        &[
            "network.commands.loss=0.8",
            "robot.Butler.params.dynamics.state_set=akr4",
        ],
    ),
];

#[test]
fn t24_exports_of_real_runs_keep_the_rules_and_say_what_the_record_says() {
    let lab = Lab::new();

    for (run, scenario, changes) in RUNS {
        lab.run(scenario, run, changes);
        let (document, _) = lab.export(&[run]);
        let own = emotions(&document);
        says_what_the_record_says(&lab, run, &own);
        // The other view has the same episodes, told in other words.
        let (document, _) = lab.export(&[run, "--standard"]);
        let told = |emotions: &[Emotion]| -> Vec<Emotion> {
            let no_words = |one: &Emotion| Emotion {
                category: None,
                tendency: None,
                ..one.clone()
            };
            emotions.iter().map(no_words).collect()
        };
        let standard = emotions(&document);
        assert_eq!(told(&standard), told(&own), "{run}");
        let angry = category(&own, "Butler", "ANGRY").len();
        assert_eq!(category(&standard, "Butler", "angry").len(), angry);
        assert_eq!(angry > 0, run == "lossy", "{run}");
        assert_eq!(own.is_empty(), run == "affectless", "{run}");
    }
}

/// Every change of emotion is the beginning of an episode, episodes leave nothing out, and traces are what was recorded.
#[track_caller]
fn says_what_the_record_says(lab: &Lab, run: &str, emotions: &[Emotion]) {
    let mut begun: BTreeMap<(u64, String), String> = BTreeMap::new();
    for event in lab
        .lines(run, "events.jsonl")
        .iter()
        .filter(|event| event["event"] == "emotion")
    {
        let robot = event["robot"].as_str().unwrap().to_owned();
        let name = event["to"].as_str().unwrap().to_owned();
        begun.insert((event["tick"].as_u64().unwrap() * 500, robot), name);
    }
    begun.retain(|_, name| name != "NEUTRAL");
    let found = emotions.iter().map(|one| {
        (
            (one.offset_ms, one.robot.clone()),
            one.category.clone().unwrap(),
        )
    });
    assert_eq!(found.collect::<BTreeMap<_, _>>(), begun, "{run}");

    let mut recorded: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for robot in lab
        .ticks(run)
        .iter()
        .flat_map(|tick| tick["robots"].as_array().unwrap())
    {
        if robot["emotion_state"] != "NEUTRAL" {
            let intensity = robot["state_variables"]["intensity"].as_f64().unwrap();
            let rounded = (intensity * 1e6).round() / 1e6;
            recorded
                .entry(robot["name"].as_str().unwrap().to_owned())
                .or_default()
                .push(rounded);
        }
    }
    let end_ms = (lab.ticks(run).len() as u64 - 1) * 500;
    let mut exported: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for one in emotions {
        let trace = exported.entry(one.robot.clone()).or_default();
        assert_eq!(
            one.offset_ms,
            trace.len() as u64 * 500,
            "{run}: a gap before {}",
            one.id
        );
        trace.extend(one.trace.as_ref().unwrap());
        // An episode lasts until the next one, and the last one until the last tick.
        let lasted_ms = (trace.len() as u64 * 500).min(end_ms);
        assert_eq!(
            one.offset_ms + one.duration_ms,
            lasted_ms,
            "{run}: {}",
            one.id
        );
    }
    assert_eq!(exported, recorded, "{run}");
}

#[test]
fn an_emotion_carries_its_components() {
    let lab = Lab::new();
    lab.run("hors_doeuvres.toml", "hall", &[]);
    let all = emotions(&lab.export(&["hall"]).0);
    let standard = emotions(&lab.export(&["hall", "--standard"]).0);

    let happy = category(&all, "Butler", "HAPPY")[0];
    assert_eq!(
        (happy.target.as_deref(), happy.values["agency"], happy.face),
        (None, 1.0, true)
    );
    assert_eq!(happy.tendency.as_deref(), Some("free-activate"));
    assert!(happy.values["valence"] > 0.5);
    assert_eq!(
        happy.info,
        "Something good is happening; I wanted this: to serve the guests; because of this I feel good."
    );
    assert!(
        !category(&all, "Butler", "CONFIDENT")[0].face,
        "a neutral face expresses nothing"
    );

    let concerned = category(&all, "Butler", "CONCERNED")[0];
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let close = |a: f64, b: f64| (a - b).abs() < 2e-6;
    let valence = 0.5 - 0.5 * mean(concerned.trace.as_ref().unwrap());
    assert!(close(concerned.values["valence"], valence), "{concerned:?}");
    assert_eq!(concerned.target.as_deref(), Some("Leguin"));
    assert!(
        concerned
            .info
            .contains("treats are left; Leguin is not here"),
        "{}",
        concerned.info
    );
    assert_eq!(
        category(&standard, "Butler", "worried").len(),
        category(&all, "Butler", "CONCERNED").len()
    );
    assert_eq!(
        category(&standard, "Butler", "irritation").len(),
        category(&all, "Butler", "FRUSTRATED").len()
    );

    // Every number is the mean of what he published.
    let span = concerned.offset_ms / 500..(concerned.offset_ms + concerned.duration_ms) / 500;
    let ticks = lab.ticks("hall");
    let published = |name: &str| -> Vec<f64> {
        let variable = |tick: u64| {
            let butler = &ticks[usize::try_from(tick).unwrap()]["robots"][0];
            match &butler["state_variables"][name] {
                Value::String(agency) => f64::from(agency == "self"),
                value => value.as_f64().unwrap(),
            }
        };
        span.clone().map(variable).collect()
    };
    for (exported, expected) in [
        ("urgency", mean(&published("urgency"))),
        ("controllability", mean(&published("controllability"))),
        ("agency", mean(&published("agency"))),
        ("unpredictability", 1.0 - mean(&published("certainty"))),
        (
            "desirability",
            0.5 + 0.5 * mean(&published("goal_congruence")),
        ),
        ("valence", 0.5 + 0.5 * mean(&published("valence"))),
    ] {
        let value = concerned.values[exported];
        assert!(close(value, expected), "{exported}: {value}, {expected}");
    }
}

/// Mean of a number over the episodes of an emotion, weighted by their durations.
fn mean_of(emotions: &[&Emotion], name: &str) -> f64 {
    let mut sum = 0.0;
    let mut duration_ms = 0.0;
    for one in emotions {
        sum += one.values[name] * one.duration_ms as f64;
        duration_ms += one.duration_ms as f64;
    }
    sum / duration_ms
}

#[test]
fn valence_orders_the_emotions_and_appraisals_differ_between_episodes() {
    let lab = Lab::new();
    lab.run("hors_doeuvres.toml", "hall", &[]);
    let all = emotions(&lab.export(&["hall"]).0);

    let names = ["HAPPY", "CONFIDENT", "CONCERNED", "FRUSTRATED"];
    let episodes = names.map(|name| category(&all, "Butler", name));
    let valences = episodes.each_ref().map(|one| mean_of(one, "valence"));
    assert!(
        valences.is_sorted_by(|better, worse| better > worse),
        "{valences:?}"
    );
    assert!(valences[1] > 0.5 && valences[2] < 0.5, "{valences:?}");

    for (name, episodes) in names.iter().zip(&episodes) {
        for appraisal in ["desirability", "controllability", "agency"] {
            let mut values: Vec<f64> = episodes.iter().map(|one| one.values[appraisal]).collect();
            values.sort_by(f64::total_cmp);
            values.dedup();
            // The paper's example: a HAPPY robot holds itself responsible.
            let is_constant = (*name, appraisal) == ("HAPPY", "agency");
            assert_eq!(
                values.len() == 1,
                is_constant,
                "{name}, {appraisal}: {values:?}"
            );
        }
    }
}

#[test]
fn an_emotion_is_targeted_at_the_robot_that_is_held_responsible() {
    let robots = |emotion: &str, agency: &str| {
        let leguin = json!({"intensity": 1.0, "waiter": "Butler", "agency": agency});
        json!([
            robot("Butler", "HAPPY", "SERVE", &json!({})),
            robot("Leguin", emotion, "REFILL", &leguin)
        ])
    };

    for (agency, target, blamed) in [
        ("the crowd", None, "the crowd"),
        ("Butler", Some("Butler"), "Butler"),
        ("self", None, "Butler"),
    ] {
        let lab = Lab::new();
        let ticks = [robots("CONFIDENT", "self"), robots("FRUSTRATED", agency)];
        lab.record("way", &ticks);
        let all = emotions(&lab.export(&["way"]).0);

        let frustrated = category(&all, "Leguin", "FRUSTRATED")[0];
        assert_eq!(frustrated.target.as_deref(), target, "{agency}");
        let own_doing = f64::from(agency == "self");
        assert_eq!(frustrated.values["agency"], own_doing, "{agency}");
        assert!(
            frustrated.info.contains(&format!("{blamed} is not here")),
            "{}",
            frustrated.info
        );
    }
}

#[test]
fn a_robot_of_ones_own_is_exported_with_the_frame_that_it_publishes() {
    let lab = Lab::new();
    let variables = json!({"intensity": 0.75, "valence": -0.75, "urgency": 0.75, "goal_congruence": -0.5,
        "controllability": 0.25, "certainty": 1.0, "agency": "Butler", "action_tendency": "avoid",
        "face": "fearful"});
    let robots = json!([
        robot("Butler", "HAPPY", "SERVE", &json!({})),
        robot("Vera", "SHY", "HIDE", &variables)
    ]);
    lab.record("party", &[robots]);

    for view in [&["party"][..], &["party", "--standard"]] {
        let all = emotions(&lab.export(view).0);
        let vera = all.iter().find(|one| one.robot == "Vera").unwrap();
        let is_standard = view.len() > 1;

        let appraisals = ["urgency", "desirability", "controllability", "agency"];
        let values = appraisals.map(|name| vera.values[name]);
        assert_eq!(values, [0.75, 0.25, 0.25, 0.0]);
        assert_eq!(vera.values.contains_key("valence"), !is_standard);
        assert_eq!(vera.target.as_deref(), Some("Butler"));
        let tendency = if is_standard { "avoidance" } else { "avoid" };
        assert_eq!(vera.tendency.as_deref(), Some(tendency));
        assert!(vera.face);
    }
}

/// A robot of a recording.
fn robot(name: &str, emotion: &str, behavior: &str, variables: &Value) -> Value {
    json!({"name": name, "emotion_state": emotion, "behavior_state": behavior, "state_variables": variables})
}

fn header() -> Header {
    let names = ["Ada", "Butler", "Leguin", "Vera"];
    Header {
        run: RunName::new("made").unwrap(),
        epoch: 1,
        seed: 1,
        version: "1.2.3".to_owned(),
        commit: None,
        protocol: 2,
        tick_s: 0.5,
        duration_s: 600.0,
        field_m: [15.24, 15.24],
        body_m: 0.6096,
        obstacles: Vec::new(),
        robots: names.map(|name| RobotName::new(name).unwrap()).into(),
    }
}

/// A tick with robots that have all reported.
fn recorded(tick: Tick, robots: &Value) -> RecordedTick {
    let mut frame = Frame {
        tick,
        ..Frame::default()
    };
    let mut reports = BTreeMap::new();
    for robot in robots.as_array().unwrap() {
        let name = RobotName::new(robot["name"].as_str().unwrap()).unwrap();
        let location = Point::new(1.0, 1.0);
        let variables = robot["state_variables"].clone();
        let report = Report {
            epoch: 1,
            tick,
            generation: 1,
            proposal: location,
            speed_mps: 0.0,
            direction_rad: 0.0,
            emotion_state: robot["emotion_state"].as_str().unwrap().to_owned(),
            behavior_state: robot["behavior_state"].as_str().unwrap().to_owned(),
            state_variables: serde_json::from_value(variables).unwrap(),
            commands: 0,
            log: Vec::new(),
        };
        reports.insert(name.clone(), report);
        frame.robots.push(PlacedRobot {
            name,
            location,
            blocked: false,
            missed: None,
        });
    }

    RecordedTick {
        frame,
        events: Vec::new(),
        reports,
        panels: BTreeMap::new(),
        wall: Wall::default(),
    }
}

fn write(file: &Path, header: &Header, ticks: impl IntoIterator<Item = RecordedTick>) {
    let mut writer = Writer::create(file, header, "").unwrap();
    for tick in ticks {
        writer.tick(&tick.view()).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn the_same_run_gives_the_same_document() {
    let (first, second) = (Lab::new(), Lab::new());
    for lab in [&first, &second] {
        lab.run("hors_doeuvres.toml", "hall", &[]);
    }

    for view in [
        &["hall"][..],
        &["hall", "--standard"],
        &["hall", "--robot", "Leguin"],
    ] {
        assert_eq!(first.export(view).0, second.export(view).0, "{view:?}");
    }

    // By its folder, as the latest run, and into a file, it is the same document.
    let (document, notes) = first.export(&["hall"]);
    assert_eq!(notes, "");
    assert_eq!(
        first.export(&[first.path("hall").to_str().unwrap()]).0,
        document
    );
    assert_eq!(first.export(&[]).0, document);

    let output = first.output(&["hall", "--output", "hall.xml"]);
    assert!(output.status.success() && output.stdout.is_empty());
    assert_eq!(
        std::fs::read_to_string(first.path("hall.xml")).unwrap(),
        document
    );
}

#[test]
fn one_robot_alone_can_be_exported() {
    let lab = Lab::new();
    lab.run("hors_doeuvres.toml", "hall", &[]);
    let of_leguin: Vec<Emotion> = emotions(&lab.export(&["hall"]).0)
        .into_iter()
        .filter(|one| one.robot == "Leguin")
        .collect();
    assert_eq!(
        emotions(&lab.export(&["hall", "--robot", "Leguin"]).0),
        of_leguin
    );

    let refusal = lab.refusal(&["hall", "--robot", "Nobody"]);
    assert!(
        refusal.contains("no robot of this run is called Nobody; there are Butler, Leguin"),
        "{refusal}"
    );
}

#[test]
fn without_recording_the_events_say_when_but_not_how_strongly() {
    let lab = Lab::new();
    lab.run("hors_doeuvres.toml", "hall", &[]);
    let recorded = emotions(&lab.export(&["hall"]).0);
    std::fs::remove_file(lab.recording("hall")).unwrap();
    let (document, notes) = lab.export(&["hall"]);
    assert!(
        notes.contains("has no run.mcap") && notes.contains("without intensities"),
        "{notes}"
    );

    let told = emotions(&document);
    assert!(
        told.iter()
            .all(|one| one.trace.is_none() && !one.values.contains_key("valence"))
    );

    let times = |emotions: &[Emotion]| -> Vec<(String, Option<String>, u64, u64)> {
        let time = |one: &Emotion| {
            (
                one.id.clone(),
                one.category.clone(),
                one.offset_ms,
                one.duration_ms,
            )
        };
        emotions.iter().map(time).collect()
    };

    assert_eq!(times(&told), times(&recorded));

    lab.export(&["hall", "--standard"]);
}

#[test]
fn robots_without_emotions_are_left_out_and_named() {
    let lab = Lab::new();
    lab.run(
        "hors_doeuvres.toml",
        "half",
        &["robot.Butler.params.affect=off"],
    );
    let (document, notes) = lab.export(&["half"]);

    assert!(emotions(&document).iter().all(|one| one.robot == "Leguin"));
    assert!(
        notes.contains("Butler has a state without emotion, \"NEUTRAL\""),
        "{notes}"
    );
}

#[test]
fn emotions_of_foreign_robots_are_told_whatever_their_names() {
    const NAMES: [&str; 4] = [
        "tr\u{e8}s content & <\"happy\">",
        "a_x20_b",
        "a b",
        "\u{0}\u{1F600}",
    ];
    let lab = Lab::new();
    lab.run("hors_doeuvres.toml", "hall", &[]);
    let recording = Recording::open(&lab.recording("hall")).unwrap();
    let mut ticks = recording.read(0, recording.len()).unwrap();
    let leguin = RobotName::new("Leguin").unwrap();
    for (at, tick) in ticks.iter_mut().enumerate() {
        let report = tick.reports.get_mut(&leguin).unwrap();
        report.emotion_state = NAMES[at / 10 % NAMES.len()].to_owned();
    }
    write(&lab.recording("hall"), recording.header(), ticks);

    let (document, _) = lab.export(&["hall", "--robot", "Leguin"]);
    let (all, tree) = (emotions(&document), Document::parse(&document).unwrap());
    let token = |at: usize| all[at].category.clone().unwrap();
    assert_eq!(
        token(0),
        "tr_xE8_s_x20_content_x20__x26__x20__x3C__x22_happy_x22__x3E_"
    );
    assert_eq!(
        [token(1), token(2), token(3)],
        ["a_x5F_x20_b", "a_x20_b", "_x0__x1F600_"]
    );
    assert_eq!(all[4].category, all[0].category);
    assert!(
        all[0].values.contains_key("valence")
            && all[0].trace.as_ref().unwrap().len() == 10
            && all[0].info.is_empty()
    );
    let infos: Vec<&str> = tree
        .descendants()
        .filter(|node| node.tag_name().name() == "info")
        .filter_map(|node| node.text())
        .collect();
    assert!(
        infos.contains(&format!("emotion state {}", NAMES[0]).as_str()),
        "{infos:?}"
    );
    // In W3C's words they have no category, and their intensity is a dimension.
    let all = emotions(&lab.export(&["hall", "--standard", "--robot", "Leguin"]).0);
    assert!(
        all.iter()
            .all(|one| one.category.is_none() && one.trace.is_some())
            && !all.is_empty()
    );
}

#[test]
fn a_robot_that_publishes_no_intensity_has_emotions_without() {
    let lab = Lab::new();
    let foreign = json!([robot("Ada", "CURIOUS", "LOOK", &json!({"intensity": 70.0}))]);
    lab.record("made", &[foreign]);
    let (document, notes) = lab.export(&["made"]);
    assert!(
        notes.contains("Ada does not publish `intensity` between 0 and 1"),
        "{notes}"
    );

    let all = emotions(&document);
    assert_eq!(
        (
            all[0].category.as_deref(),
            &all[0].trace,
            all[0].duration_ms
        ),
        (Some("CURIOUS"), &None, 0)
    );

    let (document, notes) = lab.export(&["made", "--standard"]);
    assert!(
        emotions(&document).is_empty() && notes.contains("1 episodes of \"CURIOUS\" are left out"),
        "{notes}"
    );
}

#[test]
fn what_a_crash_cut_off_is_left_out_and_damage_is_an_error() {
    let lab = Lab::new();
    let happy = json!([robot("Ada", "HAPPY", "", &json!({"intensity": 0.5}))]);
    lab.record("whole", &vec![happy.clone(); 10_000]);
    let all = emotions(&lab.export(&["whole"]).0);
    // 10,000 ticks, the last of which has no time.
    assert_eq!((all.len(), all[0].duration_ms), (1, 4_999_500));

    let bytes = std::fs::read(lab.recording("whole")).unwrap();
    lab.record("broken", &[]);
    std::fs::write(lab.recording("broken"), &bytes[..bytes.len() / 2]).unwrap();
    let (document, notes) = lab.export(&["broken"]);
    assert!(
        notes.contains("was not finished: what comes after tick"),
        "{notes}"
    );
    let kept_ms = emotions(&document)[0].duration_ms;
    assert!((500..5_000_000).contains(&kept_ms), "{kept_ms}");

    // In the content of a chunk, which begins with these bytes.
    let middle = bytes.len() / 2;
    let content = bytes[middle..].windows(4);
    let mut starts = content
        .enumerate()
        .filter(|(_, bytes)| *bytes == [0x28, 0xb5, 0x2f, 0xfd]);
    let start = starts.next().unwrap().0;
    let mut garbled = bytes.clone();
    garbled[middle + start + 100] ^= 1;
    std::fs::write(lab.recording("broken"), garbled).unwrap();
    let refusal = lab.refusal(&["broken"]);
    assert!(refusal.contains("damaged at byte"), "{refusal}");

    std::fs::write(lab.recording("broken"), "").unwrap();
    let refusal = lab.refusal(&["broken"]);
    assert!(refusal.contains("is not a recording of a run"), "{refusal}");
    lab.record("begun", &[]);
    assert!(lab.refusal(&["begun"]).contains("holds no tick yet"));
}

#[test]
fn what_cannot_be_exported_is_refused_with_a_reason() {
    let lab = Lab::new();
    let refusal = lab.refusal(&["nope"]);
    assert!(
        refusal.contains("there is no run nope") && refusal.contains("help:"),
        "{refusal}"
    );
    assert!(lab.refusal(&[]).contains("there is no run in"));

    std::fs::create_dir(lab.path("bare")).unwrap();
    assert!(
        lab.refusal(&["bare"])
            .contains("has neither run.mcap nor events.jsonl")
    );

    lab.run("hors_doeuvres.toml", "hall", &[]);
    let file = lab.recording("hall");
    let before = std::fs::read(&file).unwrap();
    let refusal = lab.refusal(&["hall", "--output", "hall/run.mcap"]);
    assert!(
        refusal.contains("choose another --output") && std::fs::read(&file).unwrap() == before,
        "{refusal}"
    );
}

/// The document is read in two parts: in between, the program waits for its output to be read, and has used the memory that
/// it needs for nearly all of the recording.
#[test]
#[cfg(target_os = "linux")]
fn a_huge_run_is_exported_as_it_is_read() {
    let lab = Lab::new();
    let ticks: u64 = 25_000;
    std::fs::create_dir_all(lab.path("huge")).unwrap();
    let padding = "x".repeat(4000);
    let robots = (0..ticks).map(|tick| {
        let variables = json!({"intensity": 0.5, "padding": padding});
        let is_happy = (tick / 5).is_multiple_of(2);
        let emotion = if is_happy { "HAPPY" } else { "CONCERNED" };
        recorded(tick, &json!([robot("Ada", emotion, "", &variables)]))
    });
    write(&lab.recording("huge"), &header(), robots);

    let mut child = lab
        .cars(&["emotionml", "huge"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut document = BufReader::new(child.stdout.take().unwrap());
    let episodes = ticks / 5;
    // What follows is more than a pipe holds.
    let mut found = 0;
    while found < episodes * 9 / 10 {
        let count = emotions_in_line(&mut document).unwrap();
        found += count;
    }

    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .unwrap();
    let peak_kib: u64 = peak.trim().trim_end_matches(" kB").parse().unwrap();
    assert!(
        peak_kib < 32 * 1024,
        "{peak_kib} KiB for a recording of 100 MB"
    );

    while let Some(count) = emotions_in_line(&mut document) {
        found += count;
    }
    assert_eq!(found, episodes);
    assert!(child.wait().unwrap().success());
}

/// How many emotions end in the next line of a document; `None` at its end.
#[cfg(target_os = "linux")]
fn emotions_in_line(document: &mut impl BufRead) -> Option<u64> {
    let mut line = String::new();
    let length = document.read_line(&mut line).unwrap();
    (length > 0).then(|| line.matches("</emotion>").count() as u64)
}
