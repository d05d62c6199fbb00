//! JSON Schemas of all messages, for authors in other languages. Generated from the types; `docs/schemas/` holds them as
//! files, and a test keeps both equal.

use protocol::Line;
use protocol::messages::{
    Answer, Clock, Command, Control, ControlAnswer, FaultOrder, JoinAnswer, JoinRequest, LogRecord,
    Panel, ParametersAnswer, ParametersOffer, PublicState, Report, TickPanel, TickUpdate, Waiting,
    WorldFrame,
};
use protocol::recorded::{Frame, Header, WallTimes};
use schemars::generate::SchemaGenerator;
use schemars::{JsonSchema, Schema, schema_for};

/// A message and its schema.
pub(crate) struct MessageSchema {
    /// Name of its file.
    pub(crate) name: &'static str,
    /// The schema by itself.
    pub(crate) whole: fn() -> Schema,
    /// The schema as a part of a document.
    pub(crate) part: fn(&mut SchemaGenerator) -> Schema,
}

const fn of<M: JsonSchema>(name: &'static str) -> MessageSchema {
    MessageSchema {
        name,
        whole: || {
            let mut schema = schema_for!(M);
            describe_integers(&mut schema);
            schema
        },
        part: |schemas| schemas.subschema_for::<M>(),
    }
}

/// What a schema cannot say, and validators of it do not check.
pub(crate) const INTEGERS: &str = "Integers are written without a fraction: `7.0` is an integer for JSON Schema, and is refused here.";

/// Says what is true of integers beside a message that has some. A comment, because the descriptions are those of the types.
fn describe_integers(schema: &mut Schema) {
    if schema.as_value().to_string().contains(r#""integer""#) {
        schema.insert("$comment".to_owned(), INTEGERS.into());
    }
}

/// What only files have, and no message has.
pub(crate) const EVENT: MessageSchema = of::<Line>("event");

/// What only recordings have, beside events and reports.
pub(crate) const RECORDED: [MessageSchema; 4] = [
    of::<Frame>("frame"),
    of::<Header>("header"),
    of::<Panel>("panel"),
    of::<WallTimes>("wall"),
];

/// Every message that travels.
pub(crate) const MESSAGES: [MessageSchema; 17] = [
    of::<Answer>("answer"),
    of::<Clock>("clock"),
    of::<Command>("command"),
    of::<Control>("control"),
    of::<ControlAnswer>("control_answer"),
    of::<FaultOrder>("fault_order"),
    of::<JoinAnswer>("join_answer"),
    of::<JoinRequest>("join_request"),
    of::<LogRecord>("log_record"),
    of::<TickPanel>("panel"),
    of::<ParametersAnswer>("parameters_answer"),
    of::<ParametersOffer>("parameters_offer"),
    of::<TickUpdate>("news"),
    of::<PublicState>("public_state"),
    of::<Report>("report"),
    of::<Waiting>("waiting"),
    of::<WorldFrame>("world_frame"),
];
