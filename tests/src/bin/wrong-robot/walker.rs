//! The robot itself.

use lockstep::Sent;
use protocol::messages::{CommandText, Point, Welcome};
use protocol::random::{Stream, stream};
use serde_json::Value;

use crate::wrong::Wrong;

/// Its parameter `step_m` where there is none.
const STEP_M: f64 = 0.2;

/// Walks at random, counts commands and replies to them, and queries another robot in some ticks.
pub(crate) struct Walker {
    pub(crate) random: Stream,
    /// How many `reseeds` it has followed.
    pub(crate) reseeded: usize,
    pub(crate) at: Point,
    pub(crate) proposal: Point,
    /// Side of the square in which a step ends, meters.
    pub(crate) step_m: f64,
    /// Height of the field, meters.
    pub(crate) height_m: f64,
    pub(crate) received: u32,
    pub(crate) sent: u32,
    pub(crate) last: String,
    /// Whether the last word was `rest`, and not `fly`.
    pub(crate) is_asleep: bool,
    /// Answers that it puts off to the next tick.
    pub(crate) put_off: Vec<Sent<CommandText>>,
}

impl Walker {
    pub(crate) fn new(welcome: &Welcome, wrong: &Wrong) -> Self {
        let is_none = welcome.seed == 0 && wrong.is("epoch.init:seed");
        let seed = if wrong.is("determinism.seed") || is_none {
            std::process::id().into()
        } else {
            welcome.seed
        };
        let seed = if wrong.is("return.rejoin:asked") && welcome.generation > 1 {
            seed ^ welcome.tick
        } else {
            seed
        };
        let name = if wrong.is("determinism.seed:stream") || wrong.is("determinism.seed:rarely") {
            welcome.name.as_str()
        } else {
            &welcome.stream
        };

        let name = if wrong.is("determinism.seed:second-stream") && welcome.generation > 1 {
            format!("robot/{}#2", welcome.name)
        } else {
            name.to_owned()
        };
        let parameters = match welcome.earlier_parameters.first() {
            Some(earlier) if wrong.is("return.rejoin:earlier") => earlier,
            _ => &welcome.parameters,
        };
        let step_m = parameters.get("step_m").and_then(Value::as_f64);

        Self {
            random: stream(seed, &name),
            reseeded: 0,
            at: welcome.location,
            proposal: welcome.location,
            step_m: step_m.unwrap_or(STEP_M),
            height_m: welcome.field_m[1],
            received: 0,
            sent: 0,
            last: String::new(),
            is_asleep: false,
            put_off: Vec::new(),
        }
    }
}
