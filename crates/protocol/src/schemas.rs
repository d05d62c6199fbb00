//! JSON Schemas of what the files of a run contain. The tests of the contract keep them equal to the types: to derive them in
//! every build takes longer than anything else that is compiled of this crate.

/// A line of `events.jsonl`.
pub const EVENT: &str = include_str!("../../../docs/schemas/event.json");
/// The report of a robot.
pub const REPORT: &str = include_str!("../../../docs/schemas/report.json");
/// The field after a tick.
pub const FRAME: &str = include_str!("../../../docs/schemas/recording/frame.json");
/// What does not change during an epoch.
pub const HEADER: &str = include_str!("../../../docs/schemas/recording/header.json");
/// What people see of a robot.
pub const PANEL: &str = include_str!("../../../docs/schemas/recording/panel.json");
/// The wall-clock times of a tick.
pub const WALL: &str = include_str!("../../../docs/schemas/recording/wall.json");
