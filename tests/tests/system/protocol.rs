//! `docs/protocol.md` agrees with the code: keys, limits, times, variables, rules, examples, random streams.

use std::collections::BTreeSet;
use std::path::Path;

use clap::CommandFactory;
use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Answer, Clock, Command, Control, ControlAnswer, FaultOrder, JoinAnswer, JoinRequest, LogRecord,
    MAX_ENTRIES, MAX_KNOWN_SITES, MAX_LAYER_ACTIONS, MAX_LINE_BYTES, MAX_PAYLOAD_BYTES,
    MAX_PAYLOAD_DEPTH, MAX_SITE_ACTIONS, MAX_SITE_VARIABLES, MAX_TEXT_BYTES, MAX_WIDGETS, Panel,
    PublicState, Report, TickUpdate, Waiting, WorldFrame,
};
use protocol::name::MAX_NAME_LEN;
use protocol::random::{MAX_SEED, stream, unit};
use protocol::{Malformed, Message, PROTOCOL_VERSION, RobotName, RunName, decode};
use rand_xoshiro::rand_core::Rng;
use serde_json::Value;
use system_tests::root;

use crate::book::anchor;

fn page() -> String {
    std::fs::read_to_string(root().join("docs/protocol.md")).unwrap()
}

/// The rows of the table whose header begins with this cell, cell by cell.
fn table(page: &str, header: &str) -> Vec<Vec<String>> {
    let begin = format!("| {header} |");
    let rows = page
        .lines()
        .skip_while(|line| !line.starts_with(&begin))
        .take_while(|line| line.starts_with('|'));
    let rows: Vec<Vec<String>> = rows.skip(2).map(cells).collect();
    assert!(!rows.is_empty(), "there is no table with {header:?}");

    rows
}

fn cells(row: &str) -> Vec<String> {
    let cells = row.trim_matches('|').split(" | ");

    cells.map(|cell| cell.trim().to_owned()).collect()
}

/// The text of all source files in a folder.
fn sources(folder: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &sources(&path);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            text += &std::fs::read_to_string(&path).unwrap();
        }
    }

    text
}

/// The text between the first two backticks.
fn code(text: &str) -> &str {
    text.split('`')
        .nth(1)
        .unwrap_or_else(|| panic!("no code in {text:?}"))
}

/// Names of the schemas that a text links to.
fn schemas(text: &str) -> Vec<&str> {
    let links = text.split("(schemas/").skip(1);
    links
        .filter_map(|link| link.split_once(".json").map(|(name, _)| name))
        .collect()
}

#[test]
fn the_sections_have_the_names_that_others_link_to() {
    let page = page();
    let sections: Vec<String> = page
        .lines()
        .filter_map(|line| line.strip_prefix("## "))
        .map(anchor)
        .collect();
    let expected = [
        "words-and-transport",
        "keys",
        "joining",
        "a-tick",
        "commands",
        "queries",
        "repeated-and-late-messages",
        "epochs",
        "incarnations",
        "the-end",
        "tolerance",
        "numbers-and-chance",
        "robots-over-stdin-and-stdout",
        "versions",
        "test-vectors",
    ];

    assert_eq!(sections, expected);
}

/// `cars conform` names these rules: each is one sentence of the page.
#[test]
fn the_rules_are_there_once_each() {
    const RULES: [&str; 42] = [
        "wire.qos",
        "wire.keys",
        "join.request",
        "join.ready-last",
        "join.refused",
        "tick.answer",
        "tick.correction",
        "tick.initial",
        "tick.state-first",
        "tick.velocity",
        "news.wait",
        "tick.newest",
        "command.order",
        "command.twice",
        "command.sent",
        "command.payload",
        "operator.commands",
        "query.asking",
        "query.reply",
        "query.again",
        "query.waiting",
        "query.tick",
        "query.at-once",
        "query.once",
        "query.unknown",
        "clock.duplicate",
        "clock.late",
        "epoch.init",
        "epoch.late",
        "determinism.seed",
        "return.generation",
        "return.rejoin",
        "return.replaced",
        "return.own-joined",
        "end.clock",
        "end.sigterm",
        "end.gone",
        "compat.unknown-fields",
        "robust.malformed",
        "number.angles",
        "number.finite",
        "number.integers",
    ];

    // Of programs that `cars exec` runs.
    const STDIO: [&str; 3] = ["stdio.fields", "stdio.log", "stdio.end"];

    let page = page();
    let mut found: Vec<&str> = page
        .split("**`")
        .skip(1)
        .filter_map(|rest| rest.split_once("`**").map(|(rule, _)| rule))
        .collect();
    found.sort_unstable();
    let mut rules = [&RULES[..], &STDIO].concat();
    rules.sort_unstable();
    assert_eq!(found, rules);
}

/// A key with the names that the page has for its parts.
fn as_on_page(key: &str) -> String {
    key.replace("RUN", "{run}")
        .replace("NAME", "{name}")
        .replace("FROM", "{from}")
}

#[test]
fn the_table_of_keys_is_that_of_the_code() {
    let keys = Keys::new(&RunName::new("RUN").unwrap());
    let robot = RobotName::new("NAME").unwrap();
    let from = RobotName::new("FROM").unwrap();
    let mut expected = vec![
        keys.clock(),
        keys.join_as(&robot),
        keys.report(&robot),
        keys.waiting(&robot),
        keys.outbox(&robot),
        keys.command(&robot, &from),
        keys.query(&robot, STATE),
        keys.news(&robot),
        keys.panel(&robot),
        keys.parameters(&robot),
        keys.alive_robot(&robot),
        keys.alive_sim(),
        keys.alive_viewer(),
        keys.control(),
        keys.world(),
        keys.log(),
        keys.faults(),
    ];
    expected.extend(QUERIES.map(|what| keys.query(&robot, what)));
    let expected: BTreeSet<String> = expected.iter().map(|key| as_on_page(key)).collect();

    let page = page();
    let rows = table(&page, "Key");
    let found: BTreeSet<String> = rows.iter().map(|row| code(&row[0]).to_owned()).collect();
    assert_eq!(found, expected);
    assert_eq!(found.len(), rows.len(), "a key is in the table twice");

    // The same keys are in the AsyncAPI document, and all messages that travel are named.
    let document = std::fs::read(root().join("docs/asyncapi.json")).unwrap();
    let document: Value = serde_json::from_slice(&document).unwrap();
    let channels = document["channels"].as_object().unwrap().values();
    let addresses: BTreeSet<String> = channels
        .map(|c| c["address"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(addresses, found);

    let named: BTreeSet<&str> = rows
        .iter()
        .flat_map(|row| schemas(row.last().unwrap()))
        .collect();
    // The schemas on file are those of the types (crates/protocol/src/contract).
    let files = std::fs::read_dir(root().join("docs/schemas")).unwrap();
    let files: Vec<_> = files
        .map(|file| file.unwrap().path())
        .filter(|path| path.is_file())
        .collect();
    let stems = files.iter().map(|file| file.file_stem().unwrap());
    let mut travel: BTreeSet<&str> = stems.map(|stem| stem.to_str().unwrap()).collect();
    assert!(travel.remove("event"), "only files have events");
    assert_eq!(named, travel);
}

#[test]
fn limits_times_and_version_are_those_of_the_code() {
    let page = page();
    let rows = table(&page, "What");
    let limits: Vec<&str> = rows.iter().map(|row| row[1].as_str()).collect();
    let expected = [
        format!("{MAX_MESSAGE_BYTES} bytes"),
        format!(
            "{MAX_SITE_ACTIONS}, each with {MAX_SITE_VARIABLES} variables to set, to add to and to compare"
        ),
        MAX_KNOWN_SITES.to_string(),
        format!("{MAX_NAME_LEN} bytes"),
        MAX_LAYER_ACTIONS.to_string(),
        format!("{MAX_NAME_LEN} bytes"),
        format!("{MAX_TEXT_BYTES} bytes"),
        format!("{MAX_TEXT_BYTES} bytes"),
        format!("{MAX_LINE_BYTES} bytes"),
        MAX_ENTRIES.to_string(),
        MAX_ENTRIES.to_string(),
        format!(
            "{MAX_PAYLOAD_BYTES} bytes, {MAX_PAYLOAD_DEPTH} lists and objects within one another"
        ),
        "524288 bytes".to_owned(),
        MAX_WIDGETS.to_string(),
        format!("{MAX_NAME_LEN} bytes"),
        "below 2^53".to_owned(),
        MAX_SEED.to_string(),
    ];
    assert_eq!(limits, expected);
    assert!(page.contains(&format!(
        "The version of the protocol is {PROTOCOL_VERSION}."
    )));

    // Constants that no other crate needs stay private; the page names their values.
    let flat = page.split_whitespace().collect::<Vec<_>>().join(" ");
    for (crate_name, constant, sentence) in [
        (
            "lockstep",
            "WAITING_AFTER: Duration = Duration::from_millis(250)",
            "once for each query, after 0.25 s",
        ),
        (
            "lockstep",
            "QUERY_AGAIN: Duration = Duration::from_millis(500)",
            "try again every 0.5 s",
        ),
        (
            "lockstep",
            "JOIN_AGAIN: Duration = Duration::from_millis(100)",
            "about every 0.1 s",
        ),
        ("protocol", "NEWS_FLAGS: usize = 32", "more than 32 robots"),
        (
            "simulator",
            "PANEL_INTERVAL: Duration = Duration::from_millis(5)",
            "at most every 5 ms",
        ),
        (
            "simulator",
            "FRAME_INTERVAL: Duration = Duration::from_millis(33)",
            "at full speed every 33 ms",
        ),
        (
            "lockstep",
            "announce: Duration::from_millis(500)",
            "missing after 0.5 s",
        ),
        (
            "simulator",
            "REPEAT_AFTER: Duration = Duration::from_secs(2)",
            "with its news, again every 2 s",
        ),
        (
            "lockstep",
            "repeat_for_newcomers: Duration::from_millis(10)",
            "after 10 ms and then at doubling intervals",
        ),
        (
            "environment",
            "MAX_DELIVERED_BYTES: usize = 512 * 1024",
            "more than 524288 bytes arrive at one robot in one tick",
        ),
        (
            "lockstep",
            "token: Duration::from_secs(2)",
            "within 2 s of its welcome",
        ),
        (
            "bus",
            "QUERY_TIMEOUT: Duration = Duration::from_secs(2)",
            "timeout 2 s",
        ),
        (
            "bus",
            "\"transport/link/tx/lease\",\n        \"2000\"",
            "lease: 2000",
        ),
    ] {
        let source = sources(&root().join("crates").join(crate_name).join("src"));
        assert!(
            source.contains(constant),
            "{constant} is not in crate {crate_name} anymore: update the page and this list"
        );
        assert!(
            flat.contains(sentence),
            "{sentence:?} is not in the page anymore"
        );
    }
}

#[test]
fn the_variables_are_those_of_a_robot_program() {
    let page = page();
    let rows = table(&page, "Variable");
    let command = robot::RobotArgs::command();
    let mut count = 0;
    for argument in command.get_arguments() {
        let Some(variable) = argument.get_env() else {
            continue;
        };
        let variable = variable.to_str().unwrap();
        let row = rows.iter().find(|row| code(&row[0]) == variable);
        let row = row.unwrap_or_else(|| panic!("{variable} is not in the page"));
        let default = argument
            .get_default_values()
            .first()
            .map(|value| value.to_str().unwrap());
        assert_eq!(
            row[1].trim_matches('`'),
            default.unwrap_or("none"),
            "{variable}"
        );
        count += 1;
    }

    assert!(count >= 4, "{count}");
}

fn check<M: Message>(text: &str) -> Result<(), Malformed> {
    decode::<M>("an example", "the page", text.as_bytes()).map(drop)
}

fn check_as(schema: &str, text: &str) -> Result<(), Malformed> {
    match schema {
        "answer" => check::<Answer>(text),
        "clock" => check::<Clock>(text),
        "command" => check::<Command>(text),
        "control" => check::<Control>(text),
        "control_answer" => check::<ControlAnswer>(text),
        "fault_order" => check::<FaultOrder>(text),
        "join_answer" => check::<JoinAnswer>(text),
        "join_request" => check::<JoinRequest>(text),
        "log_record" => check::<LogRecord>(text),
        "news" => check::<TickUpdate>(text),
        "panel" => check::<Panel>(text),
        "public_state" => check::<PublicState>(text),
        "report" => check::<Report>(text),
        "waiting" => check::<Waiting>(text),
        "world_frame" => check::<WorldFrame>(text),
        other => panic!("an example of {other}?"),
    }
}

/// Whether a transcript has this message or answer.
fn is_recorded(file: &str, example: &Value) -> bool {
    let text = std::fs::read_to_string(root().join("docs/vectors").join(file)).unwrap();
    let mut lines = text
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.any(|line| line["message"] == *example || line["answer"] == *example)
}

#[test]
fn the_examples_are_messages_and_those_of_runs_were_recorded() {
    let page = page();
    let mut shown = BTreeSet::new();
    let mut recorded = 0;
    let mut blocks = page.split("\n```json\n");
    let mut before = blocks.next().unwrap();
    for block in blocks {
        let (example, rest) = block.split_once("\n```").unwrap();
        let caption = before.trim_end().lines().last().unwrap();
        let [schema] = schemas(caption)[..] else {
            panic!("which message is this? {caption}")
        };

        check_as(schema, example).unwrap_or_else(|error| panic!("{error}\n{example}"));
        if let Some((_, link)) = caption.split_once("(vectors/") {
            let file = link.split(')').next().unwrap();
            let example: Value = serde_json::from_str(example).unwrap();
            assert!(
                is_recorded(file, &example),
                "{file} has no such message: {example}"
            );
            recorded += 1;
        }

        shown.insert(schema);
        before = rest;
    }

    // The messages that robots put and receive are from recorded runs.
    assert!(recorded >= 9, "{recorded}");

    for schema in [
        "clock",
        "news",
        "join_request",
        "join_answer",
        "report",
        "waiting",
        "command",
        "public_state",
    ] {
        assert!(shown.contains(schema), "no example of {schema}");
    }
}

/// Decodes the messages of a line with this key. Tokens have none.
fn check_line(key: &str, line: &Value) -> Result<(), Malformed> {
    let message = line["message"].to_string();
    let answer = line["answer"].to_string();
    if key.contains("/alive/") {
        return Ok(());
    }
    if key.contains("/command/") || key.ends_with("/outbox") {
        return check::<Command>(&message);
    }
    if key.contains("/join") {
        return check::<JoinRequest>(&message).and(check::<JoinAnswer>(&answer));
    }

    match Keys::last_chunk(key) {
        "clock" => check::<Clock>(&message),
        "report" => check::<Report>(&message),
        "news" => check::<TickUpdate>(&message),
        _ if line["refused"].is_string() => Ok(()),
        STATE if line["way"] == "from" => check::<PublicState>(&message),
        STATE => check::<PublicState>(&answer),
        what => {
            assert!(QUERIES.contains(&what), "{key}");
            check::<Answer>(&answer)
        }
    }
}

/// Every line of the transcripts is a message of its key.
#[test]
fn the_transcripts_are_messages() {
    let mut count = 0;
    for file in ["leguin.jsonl", "echo.jsonl", "return.jsonl"] {
        let text = std::fs::read_to_string(root().join("docs/vectors").join(file)).unwrap();
        for line in text.lines() {
            let line: Value = serde_json::from_str(line).unwrap();
            let Some(key) = line["key"].as_str() else {
                continue;
            };
            check_line(key, &line).unwrap_or_else(|error| panic!("{file}: {error}\n{line}"));
            count += 1;
        }
    }

    assert!(count > 500, "{count}");
}

#[test]
fn the_random_streams_are_those_of_the_code() {
    let page = page();
    let rows = table(&page, "Seed");
    let vectors = std::fs::read_to_string(root().join("docs/vectors/streams.json")).unwrap();
    let vectors: Vec<Value> = serde_json::from_str(&vectors).unwrap();
    assert_eq!(rows.len(), vectors.len());

    for row in rows {
        let seed = row[0].parse().unwrap();
        let name = code(&row[1]);

        assert_eq!(row[2], stream(seed, name).next_u64().to_string(), "{name}");
        assert_eq!(
            row[3].parse::<f64>().unwrap().to_bits(),
            unit(&mut stream(seed, name)).to_bits(),
            "{name}"
        );
    }
}
