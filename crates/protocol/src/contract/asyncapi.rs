//! The contract as an `AsyncAPI` 3.0 document, for tools and for authors in other languages: keys as channels, what a robot
//! does with them as operations, messages with their schemas. Generated from the types; `docs/asyncapi.json` holds it as a
//! file, and a test keeps both equal.

use protocol::keys::{Keys, QUERIES, STATE};
use protocol::name::{RobotName, RunName};
use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde_json::{Map, Value, json};

use super::schema::MESSAGES;

/// Names that stand for what an address leaves open. They are legal names, so that [`Keys`] builds the addresses.
const PLACEHOLDERS: [(&str, &str); 3] =
    [("RUN-", "{run}"), ("NAME-", "{name}"), ("FROM-", "{from}")];

/// Where something is said, by what a robot does there.
struct ChannelEntry {
    name: &'static str,
    key: String,
    what: &'static str,
    messages: &'static [&'static str],
    operations: &'static [Operation],
}

/// What a robot does with a channel.
enum Operation {
    /// It puts a message.
    Send(&'static str),
    /// A message comes to it, because it subscribes.
    Receive(&'static str),
    /// It asks, and is answered.
    Ask {
        with: &'static str,
        answer: &'static str,
    },
    /// It is asked, and answers.
    Answer {
        to: &'static str,
        with: &'static str,
    },
}
use Operation::{Answer as Replies, Ask, Receive, Send};

/// The keys of a run, with placeholders for what is open.
fn channels() -> Vec<ChannelEntry> {
    let keys = Keys::new(&RunName::new("RUN-").unwrap());
    let robot = RobotName::new("NAME-").unwrap();
    let from = RobotName::new("FROM-").unwrap();

    let channel = |name, key, what, messages, operations| ChannelEntry {
        name,
        key,
        what,
        messages,
        operations,
    };

    let mut channels = vec![
        channel(
            "clock",
            keys.clock(),
            "A tick is granted.",
            &["clock"],
            &[Receive("clock")],
        ),
        channel(
            "join",
            keys.join_as(&robot),
            "A robot asks the simulator to take part.",
            &["join_request", "join_answer"],
            &[Ask {
                with: "join_request",
                answer: "join_answer",
            }],
        ),
        channel(
            "report",
            keys.report(&robot),
            "A robot has done its tick.",
            &["report"],
            &[Send("report")],
        ),
        channel(
            "waiting",
            keys.waiting(&robot),
            "A robot says for whose answer it waits.",
            &["waiting"],
            &[Send("waiting")],
        ),
        channel(
            "command",
            keys.command(&robot, &from),
            "A command from one robot to another, for the medium; the news of its target deliver it.",
            &["command"],
            &[Send("command")],
        ),
        channel(
            "outbox",
            keys.outbox(&robot),
            "Commands that name their targets themselves, for the medium: to one robot, or to all others.",
            &["command"],
            &[Send("command")],
        ),
        channel(
            "state",
            keys.query(&robot, STATE),
            "All that a robot lets others know, served by itself and put for those who follow. Parameters tick and epoch.",
            &["query", "public_state"],
            &[
                Ask {
                    with: "query",
                    answer: "public_state",
                },
                Replies {
                    to: "query",
                    with: "public_state",
                },
                Send("public_state"),
                Receive("public_state"),
            ],
        ),
        channel(
            "news",
            keys.news(&robot),
            "What is new for one robot in a tick, before the clock of the tick.",
            &["news"],
            &[Receive("news")],
        ),
        channel(
            "parameters",
            keys.parameters(&robot),
            "The simulator asks a robot whether it can work with other parameters. Robots need not answer.",
            &["parameters_offer", "parameters_answer"],
            &[Replies {
                to: "parameters_offer",
                with: "parameters_answer",
            }],
        ),
        channel(
            "panel",
            keys.panel(&robot),
            "What people see of a robot.",
            &["panel"],
            &[Send("panel")],
        ),
        channel(
            "control",
            keys.control(),
            "People ask the simulator for something; robots do not.",
            &["control", "control_answer"],
            &[],
        ),
        channel(
            "world",
            keys.world(),
            "The picture, for observers.",
            &["world_frame"],
            &[],
        ),
        channel(
            "log",
            keys.log(),
            "What changes, as lines, for observers.",
            &["log_record"],
            &[],
        ),
        channel(
            "faults",
            keys.faults(),
            "What the launcher does to processes.",
            &["fault_order"],
            &[],
        ),
        channel(
            "alive_robot",
            keys.alive_robot(&robot),
            "Liveliness token of a robot: it is ready.",
            &[],
            &[],
        ),
        channel(
            "alive_sim",
            keys.alive_sim(),
            "Liveliness token of the simulator.",
            &[],
            &[],
        ),
        channel(
            "alive_viewer",
            keys.alive_viewer(),
            "Liveliness token of a console, while a browser shows the run there.",
            &[],
            &[],
        ),
    ];

    let query = |name| {
        let what = "One field of what a robot lets others know. Parameters tick and epoch.";
        channel(
            name,
            keys.query(&robot, name),
            what,
            &["query", "answer"],
            &[Replies {
                to: "query",
                with: "answer",
            }],
        )
    };
    channels.extend(QUERIES.map(query));
    channels
}

/// The address of a channel, with the names of its parameters in it.
fn address(key: &str) -> String {
    PLACEHOLDERS
        .iter()
        .fold(key.to_owned(), |address, (name, parameter)| {
            address.replace(name, parameter)
        })
}

fn parameters(address: &str) -> Value {
    let all = [
        ("run", "Name of the run."),
        ("name", "Name of the robot that it is about."),
        ("from", "Name of the sender, or `operator`."),
    ];
    let named = all
        .into_iter()
        .filter(|(name, _)| address.contains(&format!("{{{name}}}")));
    named
        .map(|(name, description)| (name.to_owned(), json!({ "description": description })))
        .collect()
}

fn reference(path: &[&str]) -> Value {
    json!({ "$ref": format!("#/{}", path.join("/")) })
}

impl ChannelEntry {
    fn document(&self) -> Value {
        let address = address(&self.key);
        let message = |name: &&str| {
            (
                (*name).to_owned(),
                reference(&["components", "messages", name]),
            )
        };

        json!({
            "parameters": parameters(&address),
            "address": address,
            "description": self.what,
            "messages": self.messages.iter().map(message).collect::<Map<_, _>>(),
        })
    }

    fn operation(&self, operation: &Operation) -> (String, Value) {
        let channel = || reference(&["channels", self.name]);
        let message = |name: &str| json!([reference(&["channels", self.name, "messages", name])]);

        let plain = |verb: &str, action: &str, name: &str| {
            let operation =
                json!({ "action": action, "channel": channel(), "messages": message(name) });
            (format!("{verb}_{}", self.name), operation)
        };

        let query = |verb: &str, action: &str, with: &str, answer: &str| {
            let (name, mut operation) = plain(verb, action, with);
            operation["reply"] = json!({ "channel": channel(), "messages": message(answer) });
            (name, operation)
        };

        match operation {
            Send(name) => plain("put", "send", name),
            Receive(name) => plain("receive", "receive", name),
            Ask { with, answer } => query("ask", "send", with, answer),
            Replies { to, with } => query("answer", "receive", to, with),
        }
    }
}

/// The messages by name, with their schemas.
fn messages(schemas: &mut SchemaGenerator) -> Map<String, Value> {
    let described = MESSAGES.iter().map(|message| {
        let payload = (message.part)(schemas);
        (message.name.to_owned(), json!({ "payload": payload }))
    });
    let mut messages: Map<String, Value> = described.collect();

    let summary =
        "A query without a payload; its parameters say as of which tick: `tick=12;epoch=1`.";
    messages.insert("query".to_owned(), json!({ "summary": summary }));
    messages
}

/// The document.
pub(crate) fn document() -> Value {
    // The schemas of AsyncAPI are those of draft 7.
    let mut settings = SchemaSettings::draft07();
    settings.definitions_path = "/components/schemas".into();
    settings.meta_schema = None;
    let mut schemas = settings.into_generator();

    let messages = messages(&mut schemas);
    let channels = channels();
    let operations = channels.iter().flat_map(|channel| {
        channel
            .operations
            .iter()
            .map(|operation| channel.operation(operation))
    });

    json!({
        "asyncapi": "3.0.0",
        "info": {
            "title": "CARS",
            "version": protocol::PROTOCOL_VERSION.to_string(),
            "description": "The contract between simulator and robots, from a robot's point of view. What it means, and \
                            the order in which things happen, is in protocol.md. Channels are key expressions of zenoh. \
                            Integers are written without a fraction: `7.0` is an integer for JSON Schema, and is refused here.",
        },
        "defaultContentType": "application/json",
        "servers": {
            "simulator": {
                "host": protocol::DEFAULT_ENDPOINT.rsplit('/').next(),
                "protocol": "zenoh",
                "description": "The simulator is a router of its own; robots are clients of it.",
            },
        },
        "channels": channels
            .iter()
            .map(|channel| (channel.name.to_owned(), channel.document()))
            .collect::<Map<_, _>>(),
        "operations": operations.collect::<Map<_, _>>(),
        "components": { "messages": messages, "schemas": schemas.take_definitions(true) },
    })
}
