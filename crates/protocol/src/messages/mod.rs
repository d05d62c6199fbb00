//! The messages, one module for each pair of participants.

mod control;
mod drive;
mod layer;
mod limits;
mod log;
mod numbers;
mod observe;
mod payload;
mod performative;
mod point;
mod sensing;
mod site;
mod state;
mod static_world;
mod step;
mod target;
mod variables;

pub use crate::codec::FieldError;
pub use control::{
    Awaited, Control, ControlAnswer, FaultKind, FaultOrder, Intervention, LogFile, OnLate, Phase,
    Presence, ProcessOrder, Range, Reason, RobotStatus, Setup, SetupAnswer, Status,
};
pub use drive::{DriveLimits, Pose, Velocity};
pub use layer::{
    LayerAction, LayerFrame, LayerRefusal, LayerResult, MAX_LAYER_ACTIONS, MAX_LAYER_CELLS,
    MAX_LAYER_VALUE, MAX_LAYERS, MAX_SENSED_CELLS, SensedCell, SensedLayer, SensedRow, cell_center,
};
pub(crate) use limits::is_false;
pub use limits::{MAX_ENTRIES, MAX_LINE_BYTES, MAX_TEXT_BYTES};
pub use log::{LogKind, LogRecord};
pub use numbers::{Epoch, Generation, Seq, Tick};
pub use observe::{
    Cut, DisplayUnit, Face, Fate, Flight, GuestMood, HeldProcess, MAX_FLIGHTS, MAX_WIDGETS, Panel,
    RobotFrame, Standing, TickPanel, Tone, Verdict, Widget, WorldFrame,
};
pub use payload::{MAX_PAYLOAD_BYTES, MAX_PAYLOAD_DEPTH, Payload};
pub use performative::Performative;
pub use point::Point;
pub use sensing::{MAX_RAYS, Rays};
pub use site::{
    KnownSite, MAX_KNOWN_SITES, MAX_SITE_ACTIONS, MAX_SITE_TEXT_BYTES, MAX_SITE_VARIABLES,
    MAX_SITES, MAX_SITES_BYTES, SensedSite, SiteAction, SiteFrame, SiteRefusal, SiteResult,
    site_bytes,
};
pub use state::{Answer, PublicState};
pub use static_world::{BodyShape, SensingLimits, StaticWorld};
pub use step::{
    Clock, Command, CommandText, Correction, Delivery, End, JoinAnswer, JoinRequest, NEWS_FLAGS,
    Parameters, ParametersAnswer, ParametersOffer, Refusal, Report, SensedBody, SensedKind,
    SensedRobot, StreamReseed, TickUpdate, Waiting, Welcome,
};
pub use target::{OTHERS, Target};
pub use variables::{StateVariables, Variable};
