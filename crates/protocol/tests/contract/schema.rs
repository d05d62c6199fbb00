//! JSON Schemas of all messages, for authors in other languages. Generated from the types; `schemas/` holds them as
//! files, and a test keeps both equal.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, schema_for};

use protocol::messages::{
    Answer, Clock, Command, Control, ControlAnswer, FaultOrder, JoinAnswer, JoinRequest, LogRecord,
    Panel, ParametersAnswer, ParametersOffer, PublicState, Report, TickUpdate, Waiting, WorldFrame,
};

/// The schema of every message, by the name of its file.
#[must_use]
pub(crate) fn all() -> BTreeMap<&'static str, Schema> {
    fn one<M: JsonSchema>() -> Schema {
        schema_for!(M)
    }

    [
        ("answer", one::<Answer>()),
        ("clock", one::<Clock>()),
        ("command", one::<Command>()),
        ("control", one::<Control>()),
        ("control_answer", one::<ControlAnswer>()),
        ("event", one::<protocol::Line>()),
        ("fault_order", one::<FaultOrder>()),
        ("join_answer", one::<JoinAnswer>()),
        ("join_request", one::<JoinRequest>()),
        ("news", one::<TickUpdate>()),
        ("log_record", one::<LogRecord>()),
        ("panel", one::<Panel>()),
        ("parameters_answer", one::<ParametersAnswer>()),
        ("parameters_offer", one::<ParametersOffer>()),
        ("public_state", one::<PublicState>()),
        ("report", one::<Report>()),
        ("waiting", one::<Waiting>()),
        ("world_frame", one::<WorldFrame>()),
    ]
    .into()
}
