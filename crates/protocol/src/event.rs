//! What happened in a run: simulated facts only, no wall clock, no process ids. The same seed gives the same events,
//! byte for byte.

use serde::{Deserialize, Serialize};

use crate::messages::is_false;
use crate::messages::{
    End, Fate, FaultKind, Flight, GuestMood, LayerRefusal, LogKind, LogRecord, Payload,
    Performative, Point, Reason, SiteRefusal, Variable, Verdict,
};
use crate::name::RobotName;
use crate::plain::escape_line;
use crate::time::{seconds, time_s};
use crate::{Epoch, Generation, Seq, Tick};

/// Longest line of the log about a change.
const MAX_CHANGE_CHARS: usize = 400;

/// One line of `events.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Line {
    /// When.
    pub tick: Tick,
    /// What.
    #[serde(flatten)]
    pub event: Event,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The run begins.
    Init {
        /// Its seed.
        seed: u64,
        /// Version of the simulator.
        version: String,
        /// Version of the contract with the robots.
        protocol: u32,
        /// Length of a tick, simulated seconds.
        tick_s: f64,
    },
    /// A robot takes part from this tick on.
    Joined {
        /// Who.
        robot: RobotName,
        /// Its incarnation; not said of those who were there from the beginning.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        generation: Option<Generation>,
        /// Where it stands.
        at: Point,
    },
    /// A robot takes part no more; its body stays.
    Lost {
        /// Who.
        robot: RobotName,
    },
    /// A robot did not report this tick, and the clock went on without it; its body stays where it is.
    Missed {
        /// Who.
        robot: RobotName,
    },
    /// A robot that has missed ticks takes part again as the same incarnation, and did some of them too late: what it reported
    /// for them did not count.
    DoneLate {
        /// Who.
        robot: RobotName,
        /// Which ticks.
        ticks: Vec<Tick>,
    },
    /// A robot's move was refused; it stays where it is.
    Blocked {
        /// Who.
        robot: RobotName,
        /// By what.
        by: Blocker,
        /// Where it stays.
        at: Point,
    },
    /// A robot's emotion changed.
    Emotion {
        /// Who.
        robot: RobotName,
        /// Emotion before; none at the beginning.
        from: Option<String>,
        /// Emotion now.
        to: String,
    },
    /// A robot's behavior changed.
    Behavior {
        /// Who.
        robot: RobotName,
        /// Behavior before; none at the beginning.
        from: Option<String>,
        /// Behavior now.
        to: String,
    },
    /// A command was sent.
    CommandSent {
        /// By whom.
        from: RobotName,
        /// To whom.
        to: RobotName,
        /// Its number among the sender's.
        seq: Seq,
        /// What it is meant to do.
        performative: Performative,
        /// What it says.
        command: String,
        /// Its payload, if it has one that is not recorded with an earlier command.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        payload: Option<Payload>,
        /// The number of an earlier command of this sender in this tick, with which the same payload is recorded: a payload that a
        /// robot sends to many others is in the record once.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        payload_of: Option<Seq>,
    },
    /// A command arrives now.
    CommandDelivered {
        /// By whom.
        from: RobotName,
        /// To whom.
        to: RobotName,
        /// Its number among the sender's.
        seq: Seq,
    },
    /// The medium lost a command.
    CommandDropped {
        /// By whom.
        from: RobotName,
        /// To whom.
        to: RobotName,
        /// Its number among the sender's.
        seq: Seq,
        /// Why.
        because: Cause,
    },
    /// The medium holds a command back.
    CommandDelayed {
        /// By whom.
        from: RobotName,
        /// To whom.
        to: RobotName,
        /// Its number among the sender's.
        seq: Seq,
        /// Tick at which it will arrive, or leave the queue of its sender's radio.
        until: Tick,
        /// `Scripted` if the scenario names this command, `Queue` if it waits for others of its sender; none by chance.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        because: Option<Cause>,
    },
    /// The medium doubled a command: it arrives twice in the same tick.
    CommandDuplicated {
        /// By whom.
        from: RobotName,
        /// To whom.
        to: RobotName,
        /// Its number among the sender's.
        seq: Seq,
        /// `Scripted` if the scenario names this command; none by chance.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        because: Option<Cause>,
    },
    /// The medium lost what a robot might ask another one in this tick, by chance; cuts are told when they change.
    QueryLost {
        /// Who would ask.
        from: RobotName,
        /// Who would be asked.
        to: RobotName,
        /// Why.
        because: Cause,
    },
    /// From this tick on the medium lets these messages from one robot to another through no more.
    LinkCut {
        /// Who cannot reach the other.
        from: RobotName,
        /// The other.
        to: RobotName,
        /// Whether commands are cut.
        commands: bool,
        /// Whether queries are cut.
        queries: bool,
    },
    /// From this tick on messages from one robot to another pass again.
    LinkHealed {
        /// Who reaches the other again.
        from: RobotName,
        /// The other.
        to: RobotName,
    },
    /// What the scenario has the launcher do to a robot's process begins, or is over.
    Fault {
        /// Whose process.
        robot: RobotName,
        /// Which fault.
        kind: FaultKind,
        /// Whether it begins; else it is over.
        begins: bool,
    },
    /// The scenario changes from this tick on.
    Changed {
        /// What is set, as `path=value`.
        set: String,
        /// Whether a person did it, and not the scenario.
        #[serde(default, skip_serializing_if = "is_false")]
        by_hand: bool,
    },
    /// A robot wrote a line to the log.
    Say {
        /// Who.
        robot: RobotName,
        /// The line.
        text: String,
    },
    /// A guest is in another mood. All are content at the beginning.
    Guest {
        /// Which, counted from 0.
        guest: u32,
        /// Its mood now.
        mood: GuestMood,
    },
    /// A guest has entered the field. Guests that are placed at the beginning are there without it.
    GuestEntered {
        /// Which, counted from 0.
        guest: u32,
        /// Where, meters.
        at: Point,
    },
    /// A guest has left the field.
    GuestLeft {
        /// Which, counted from 0.
        guest: u32,
        /// From where, meters.
        at: Point,
    },
    /// A robot changed a variable of a site.
    SiteChanged {
        /// Who.
        robot: RobotName,
        /// Name of the site.
        site: String,
        /// The variable.
        key: String,
        /// Its value before.
        from: Variable,
        /// Its value now.
        to: Variable,
    },
    /// A robot's action on a site was refused.
    SiteRefused {
        /// Who.
        robot: RobotName,
        /// Name of the site, as the robot has it.
        site: String,
        /// Why.
        because: SiteRefusal,
    },
    /// A robot changed cells of a layer.
    LayerChanged {
        /// Who.
        robot: RobotName,
        /// Name of the layer.
        layer: String,
        /// How many cells have another number than before.
        cells: u32,
        /// What was added to the sum of the layer.
        change: f64,
    },
    /// A robot's action on a layer was refused.
    LayerRefused {
        /// Who.
        robot: RobotName,
        /// Name of the layer, as the robot has it.
        layer: String,
        /// Why.
        because: LayerRefusal,
    },
    /// The simulator refuses what a robot does. It says so once for each reason, and how often at the end of the run.
    Warned {
        /// Who.
        robot: RobotName,
        /// What is refused, and the limit.
        text: String,
    },
    /// It is decided whether the run has done what its scenario expects of it.
    Judged {
        /// Name of the expectation.
        expectation: String,
        /// What is decided.
        verdict: Verdict,
        /// Why.
        because: String,
    },
    /// The tick is complete.
    Tick {
        /// Digest over everything up to and including this tick: bodies and reports.
        digest: String,
        /// In a file: XXH3-64 of all its bytes before this field, and a closing brace.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seal: Option<String>,
    },
    /// The run is over.
    End {
        /// How.
        reason: End,
        /// If it has finished before its last tick: what of the scenario's `end_when` held, in words.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        because: Option<String>,
        /// If it was aborted, the robots for which the clock waited then.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        waited_for: Vec<WaitedFor>,
        /// Digest of the run: that of its last complete tick.
        digest: String,
        /// In a file: XXH3-64 of all its bytes before this field, and a closing brace.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seal: Option<String>,
    },
}

/// A robot for which the clock waited when a run was aborted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct WaitedFor {
    /// Who.
    pub robot: RobotName,
    /// What was known of it.
    pub because: Reason,
}

impl std::fmt::Display for WaitedFor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.robot, self.because)
    }
}

/// What refused a move.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Blocker {
    /// The edge of the field.
    Edge,
    /// A wall.
    Wall,
    /// A fixed obstacle.
    Obstacle,
    /// A guest.
    Guest,
    /// The move was faster than the scenario allows.
    TooFast,
    /// Another robot.
    Robot(RobotName),
}

impl std::fmt::Display for Blocker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Edge => f.write_str("the edge"),
            Self::Wall => f.write_str("a wall"),
            Self::Obstacle => f.write_str("an obstacle"),
            Self::Guest => f.write_str("a guest"),
            Self::TooFast => f.write_str("too_fast"),
            Self::Robot(name) => write!(f, "{name}"),
        }
    }
}

/// Why the medium lost a message, delayed or doubled it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// By chance.
    Loss,
    /// By chance, in a burst.
    Burst,
    /// The two are cut off from each other.
    Partition,
    /// The two are farther apart than their radios reach.
    OutOfRange,
    /// The target missed the tick in which it arrived.
    Missed,
    /// More arrives at the target in this tick than its news hold.
    Overflow,
    /// No robot of the roster has the name of the target.
    Unknown,
    /// The scenario names this command.
    Scripted,
    /// It arrives with too little power after the distance.
    Distance,
    /// Walls between the two leave too little power.
    Wall,
    /// Bodies between the two leave too little power.
    Body,
    /// Shadowing leaves too little power.
    Shadowing,
    /// Fading leaves too little power.
    Fading,
    /// Messages before it wait in the queue of its sender's radio.
    Queue,
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Loss => "by chance",
            Self::Burst => "in a burst",
            Self::Partition => "in a partition",
            Self::OutOfRange => "out of range",
            Self::Missed => "because the robot missed the tick",
            Self::Overflow => "because too much arrives at once",
            Self::Unknown => "because there is no such robot",
            Self::Scripted => "as the scenario has it",
            Self::Distance => "too weak over the distance",
            Self::Wall => "too weak behind a wall",
            Self::Body => "too weak behind a body",
            Self::Shadowing => "too weak by shadowing",
            Self::Fading => "too weak by fading",
            Self::Queue => "in the queue of the sender's radio",
        })
    }
}

/// A cause at the end of a sentence; nothing for chance.
fn reason(because: Option<Cause>) -> String {
    because.map_or_else(String::new, |because| format!(", {because}"))
}

impl Line {
    /// The line of `events.jsonl`, without its end of line.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self)
            .unwrap_or_else(|error| unreachable!("an event is always JSON: {error}"))
    }

    /// Reads a line of `events.jsonl`.
    ///
    /// # Errors
    /// What is wrong with the JSON.
    pub fn from_json(json: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(json)
    }
}

impl Event {
    /// Its kind, as in the field `event` of its line.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Init { .. } => "init",
            Self::Joined { .. } => "joined",
            Self::Lost { .. } => "lost",
            Self::Missed { .. } => "missed",
            Self::DoneLate { .. } => "done_late",
            Self::Blocked { .. } => "blocked",
            Self::Emotion { .. } => "emotion",
            Self::Behavior { .. } => "behavior",
            Self::CommandSent { .. } => "command_sent",
            Self::CommandDelivered { .. } => "command_delivered",
            Self::CommandDropped { .. } => "command_dropped",
            Self::CommandDelayed { .. } => "command_delayed",
            Self::CommandDuplicated { .. } => "command_duplicated",
            Self::QueryLost { .. } => "query_lost",
            Self::LinkCut { .. } => "link_cut",
            Self::LinkHealed { .. } => "link_healed",
            Self::Fault { .. } => "fault",
            Self::Changed { .. } => "changed",
            Self::Say { .. } => "say",
            Self::Guest { .. } => "guest",
            Self::GuestEntered { .. } => "guest_entered",
            Self::GuestLeft { .. } => "guest_left",
            Self::SiteChanged { .. } => "site_changed",
            Self::SiteRefused { .. } => "site_refused",
            Self::LayerChanged { .. } => "layer_changed",
            Self::LayerRefused { .. } => "layer_refused",
            Self::Warned { .. } => "warned",
            Self::Judged { .. } => "judged",
            Self::Tick { .. } => "tick",
            Self::End { .. } => "end",
        }
    }

    /// Whether it ends a tick or the run. In a file such a line has a seal.
    #[must_use]
    pub fn is_sealed(&self) -> bool {
        matches!(self, Self::Tick { .. } | Self::End { .. })
    }

    /// The event as a line of the readable log of a run whose ticks last `tick_s`; `None` for what only machines read.
    #[must_use]
    pub fn log_record(&self, epoch: Epoch, tick: Tick, tick_s: f64) -> Option<LogRecord> {
        let (source, kind, text) = self.readable()?;
        let record = LogRecord {
            epoch,
            tick,
            time_s: time_s(tick, tick_s),
            tick_s,
            source,
            kind,
            text,
        };
        Some(record.fitted())
    }

    /// The command that the event is about, and its fate, as frames show it; `None` for other events.
    #[must_use]
    pub fn flight(&self, tick: Tick) -> Option<Flight> {
        let (from, to, seq, command, fate, because) = match self {
            Self::CommandSent {
                from,
                to,
                seq,
                command,
                ..
            } => (from, to, seq, command.as_str(), Fate::Sent, None),
            Self::CommandDelivered { from, to, seq } => (from, to, seq, "", Fate::Delivered, None),
            Self::CommandDropped {
                from,
                to,
                seq,
                because,
            } => (from, to, seq, "", Fate::Dropped, Some(because.to_string())),
            _ => return None,
        };

        Some(Flight {
            tick,
            from: from.clone(),
            to: to.clone(),
            seq: *seq,
            command: command.to_owned(),
            fate,
            because,
        })
    }

    /// Source, kind and text of the line of the readable log; `None` for what only machines read.
    fn readable(&self) -> Option<(String, LogKind, String)> {
        let simulator = |kind, text: String| Some(("simulator".to_owned(), kind, text));
        let says = |robot: &RobotName, kind, text: String| Some((robot.to_string(), kind, text));

        match self {
            Self::Init { seed, .. } => simulator(LogKind::Run, format!("initialized, seed {seed}")),
            Self::Joined {
                robot,
                generation: None,
                at,
            } => says(
                robot,
                LogKind::Membership,
                format!("takes part, at {:.2} m, {:.2} m", at.x, at.y),
            ),
            Self::Joined {
                robot,
                generation: Some(generation),
                ..
            } => says(
                robot,
                LogKind::Membership,
                format!("is back as incarnation {generation}"),
            ),
            Self::Lost { robot } => says(robot, LogKind::Membership, "is lost".to_owned()),
            Self::Missed { robot } => {
                says(robot, LogKind::Membership, "missed the tick".to_owned())
            }
            Self::Fault {
                robot,
                kind,
                begins,
            } => {
                let what = match kind {
                    FaultKind::Crash => "the process is killed",
                    FaultKind::Hang => "the process is stopped",
                    FaultKind::Slow => "the process is slowed down",
                    FaultKind::Restart => "the process is killed and started again",
                };
                let text = if *begins {
                    format!("fault: {what}")
                } else {
                    format!("fault over: {what} no more")
                };

                says(robot, LogKind::Membership, text)
            }
            // A robot without emotions or behaviors begins with an empty name: nothing to read.
            Self::Emotion { from: None, to, .. } | Self::Behavior { from: None, to, .. }
                if to.is_empty() =>
            {
                None
            }
            Self::Emotion { robot, from, to } => says(
                robot,
                LogKind::Emotion,
                change("emotion", from.as_ref(), to),
            ),
            Self::Behavior { robot, from, to } => says(
                robot,
                LogKind::Behavior,
                change("behavior", from.as_ref(), to),
            ),
            Self::CommandSent {
                from,
                to,
                performative,
                command,
                ..
            } => says(
                from,
                LogKind::Command,
                format!("-> {to}: {command} ({performative})"),
            ),
            Self::CommandDelivered { from, to, seq } => says(
                to,
                LogKind::Command,
                format!("receives command {seq} of {from}"),
            ),
            Self::CommandDropped {
                from,
                to,
                seq,
                because,
            } => says(
                to,
                LogKind::Command,
                format!("command {seq} of {from} was lost on the way, {because}"),
            ),
            Self::CommandDelayed {
                from,
                to,
                seq,
                until,
                because,
            } => says(
                to,
                LogKind::Command,
                format!(
                    "command {seq} of {from} is held back until tick {until}{}",
                    reason(*because)
                ),
            ),
            Self::CommandDuplicated {
                from,
                to,
                seq,
                because,
            } => says(
                to,
                LogKind::Command,
                format!("command {seq} of {from} comes twice{}", reason(*because)),
            ),
            Self::LinkCut {
                from,
                to,
                commands,
                queries,
            } => {
                let what = match (commands, queries) {
                    (true, true) => "commands and queries",
                    (true, false) => "commands",
                    _ => "queries",
                };
                simulator(
                    LogKind::Network,
                    format!("{what} from {from} to {to} are cut"),
                )
            }
            Self::LinkHealed { from, to } => simulator(
                LogKind::Network,
                format!("messages from {from} to {to} pass again"),
            ),
            Self::Changed { set, by_hand } => {
                let who = if *by_hand { "by hand, " } else { "" };
                simulator(LogKind::Run, shorten(format!("{who}from now on {set}")))
            }
            Self::Say { robot, text } => says(robot, LogKind::Say, text.clone()),
            Self::SiteChanged {
                robot,
                site,
                key,
                from,
                to,
            } => says(
                robot,
                LogKind::Site,
                format!("site {site}: {key} {from} -> {to}"),
            ),
            Self::SiteRefused {
                robot,
                site,
                because,
            } => says(
                robot,
                LogKind::Site,
                format!("site {site} is not changed: {because}"),
            ),
            Self::LayerChanged {
                robot,
                layer,
                cells,
                change,
            } => says(
                robot,
                LogKind::Layer,
                format!("layer {layer}: {change:+.3} in {cells} cells"),
            ),
            Self::LayerRefused {
                robot,
                layer,
                because,
            } => says(
                robot,
                LogKind::Layer,
                format!("layer {layer} is not changed: {because}"),
            ),
            Self::Warned { robot, text } => says(robot, LogKind::Say, format!("warning: {text}")),
            Self::Judged {
                expectation,
                verdict,
                because,
            } => simulator(
                LogKind::Verdict,
                format!("{verdict}: {expectation} ({because})"),
            ),
            Self::End {
                reason,
                because,
                waited_for,
                digest,
                ..
            } => {
                let how = match reason {
                    End::Finished => "finished",
                    End::Stopped => "stopped",
                    End::Aborted => "aborted",
                };
                let why = match because {
                    Some(because) => format!(", because {because}"),
                    None => in_words(waited_for),
                };
                simulator(LogKind::Run, format!("{how}{why}, digest {digest}"))
            }
            // A blocked robot tries again every tick; the log would be nothing else. So with a lossy network.
            Self::DoneLate { .. }
            | Self::Blocked { .. }
            | Self::QueryLost { .. }
            | Self::Guest { .. }
            | Self::GuestEntered { .. }
            | Self::GuestLeft { .. }
            | Self::Tick { .. } => None,
        }
    }
}

/// The robots for which the clock waited when the run was aborted, as the middle of a sentence.
fn in_words(waited_for: &[WaitedFor]) -> String {
    if waited_for.is_empty() {
        return String::new();
    }

    let robots: Vec<String> = waited_for.iter().map(WaitedFor::to_string).collect();
    shorten(format!(" because {}", robots.join(", and ")))
}

/// Cuts a line that is longer than the log has use for: lists of robots can be any length.
fn shorten(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(MAX_CHANGE_CHARS) {
        text.truncate(end);
        text.push('…');
    }
    text
}

fn change(what: &str, from: Option<&String>, to: &str) -> String {
    let named = |name: &str| if name.is_empty() { "none" } else { name }.to_owned();
    match from {
        Some(from) => format!("{what} {} -> {}", named(from), named(to)),
        None => format!("{what} {to}"),
    }
}

/// A line of the readable log, in columns: simulated time, source, text. Robots write parts of it, so it is escaped.
#[must_use]
pub fn log_line(record: &LogRecord) -> String {
    let source = escape_line(&record.source);
    let text = escape_line(&record.text);
    let time = seconds(record.time_s, record.tick_s);
    format!("{time:>9} s  {source:<12} {text}")
}
