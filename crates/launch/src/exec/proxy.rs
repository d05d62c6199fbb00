//! The robot whose decisions are made by a program: one exchange of lines in each tick.

use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::messages::{OTHERS, Panel, Performative};
use protocol::random::unit;
use robot::{Action, BadParameters, CallError, Cars, ReceivedCommand, Robot};
use serde_json::Value;

use super::faults::Faults;
use super::line::{
    Answered, Arrived, DoneLine, FromProgram, QueryLine, ReadLine, ToProgram, UnknownFields, quote,
};
use super::program::{MAX_LINE, Program, ProgramEvent};
use super::remarks::Remarks;

/// Most lines that a program may write in a tick.
const MAX_LINES: usize = 1 << 16;
/// Most commands that it may send in a tick, as a report allows.
const MAX_COMMANDS: usize = protocol::messages::MAX_ENTRIES;
/// Most bytes of its lines that become part of the report. The rest of a message is for the other fields of the report.
const MAX_REPORTED: usize = MAX_MESSAGE_BYTES - (1 << 17);

/// What to report, once, when the program does not answer for a time.
pub(super) struct SilenceNotice {
    pub(super) text: String,
    pub(super) after: Duration,
}

/// A robot whose program is another process.
pub(super) struct ProgramRobot {
    program: Arc<Program>,
    events: Receiver<ProgramEvent>,
    /// `None` once it has been reported.
    notice: Option<SilenceNotice>,
    /// Whether the line `init` was the last one that the program was sent, so that it may be answering it.
    is_initializing: bool,
    remarks: Remarks,
    faults: Arc<Mutex<Faults>>,
    /// The last line `done`.
    done: DoneLine,
    panel: Panel,
}

impl ProgramRobot {
    pub(super) fn new(
        program: Arc<Program>,
        events: Receiver<ProgramEvent>,
        notice: SilenceNotice,
        remarks: Remarks,
        faults: Arc<Mutex<Faults>>,
    ) -> Self {
        Self {
            program,
            events,
            notice: Some(notice),
            is_initializing: false,
            remarks,
            faults,
            done: DoneLine::default(),
            panel: Panel::default(),
        }
    }

    /// Sends a line to the program.
    fn send(&self, message: &ToProgram<'_>) -> Result<(), String> {
        self.program.send(message).map_err(|error| {
            let closed = format!("its program has closed its standard input ({error})");
            self.program.explain_end(&closed)
        })
    }

    /// Begins a tick. The program must not have written lines since the last one.
    fn begin(&self, message: &ToProgram<'_>) -> Result<(), String> {
        match self.events.try_recv() {
            // Whether a line outside a tick is noticed depends on time; what is noticed is an error in
            // any case.
            Err(TryRecvError::Empty) => self.send(message),
            Err(TryRecvError::Disconnected) => Err(self.failure(ProgramEvent::Ended)),
            Ok(ProgramEvent::Line(line)) => Err(format!(
                "its program said {} outside a tick; it may speak between a line init or tick and its own line done only",
                quote(&line)
            )),
            Ok(event) => Err(self.failure(event)),
        }
    }

    /// Carries out the lines of the program until its line `done`.
    fn converse(&mut self, cars: &mut Cars<'_>) -> Result<DoneLine, String> {
        let mut commands = 0;
        let mut reported = 0;
        // Bounded, because a program that writes for ever would hold the clock of the run.
        for _ in 0..MAX_LINES {
            let line = match self.next() {
                ProgramEvent::Line(line) => line,
                other => return Err(self.failure(other)),
            };

            let ReadLine { message, unknown } = ReadLine::of(&line)?;
            if let Some(unknown) = unknown {
                self.remark(cars, &unknown);
            }
            // Counted before the line is carried out: the report cannot grow beyond its limit.
            if message.is_reported() {
                reported += line.len();
            }
            if matches!(message, FromProgram::Command(_)) {
                commands += 1;
            }
            if commands > MAX_COMMANDS || reported > MAX_REPORTED {
                return Err(format!(
                    "its program said too much for one tick: {commands} commands and {reported} bytes of commands, log \
                     lines and done; allowed are {MAX_COMMANDS} and {MAX_REPORTED}"
                ));
            }
            if let Some(done) = self.carry_out(cars, message)? {
                self.check_log(cars);
                return Ok(done);
            }
        }
        Err(format!(
            "its program said more than {MAX_LINES} lines in one tick and not done"
        ))
    }

    /// Explains the first unknown fields of a type of lines in the log of the run.
    fn remark(&self, cars: &mut Cars<'_>, unknown: &UnknownFields) {
        let tick = cars.tick();
        self.faults()
            .unknown_fields(|| format!("{unknown}, in tick {tick}"));
        if self.remarks.add(unknown.kind) {
            cars.warn(&unknown.to_string());
        }
    }

    /// Reports that the program has written more to the log than is allowed.
    fn check_log(&self, cars: &Cars<'_>) {
        if let Some(warning) = cars.log_warning() {
            self.faults()
                .log_limits(|| format!("{warning}, in tick {}", cars.tick()));
        }
    }

    fn faults(&self) -> std::sync::MutexGuard<'_, Faults> {
        // A fault is reported in one step, so a panic leaves what was reported.
        self.faults.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next event of the program. The first long wait is reported.
    fn next(&mut self) -> ProgramEvent {
        if let Some(notice) = &self.notice {
            match self.events.recv_timeout(notice.after) {
                Ok(event) => return event,
                Err(RecvTimeoutError::Disconnected) => return ProgramEvent::Ended,
                Err(RecvTimeoutError::Timeout) => terminal::note(&notice.text),
            }
            self.notice = None;
        }

        // Without a limit: the clock waits for a robot as long as it takes. A signal or the program's
        // end comes through this queue, too.
        self.events.recv().unwrap_or(ProgramEvent::Ended)
    }

    fn carry_out(
        &mut self,
        cars: &mut Cars<'_>,
        message: FromProgram,
    ) -> Result<Option<DoneLine>, String> {
        match message {
            FromProgram::Query(query) => self.answer(ask(cars, &query))?,
            FromProgram::Percept => {
                let bodies = serde_json::json!({ "bodies": cars.bodies() });
                self.answer(Ok(bodies))?;
            }
            FromProgram::Ranges => {
                let ranges = serde_json::json!({ "ranges": cars.ranges() });
                self.answer(Ok(ranges))?;
            }
            FromProgram::Random => self.answer(Ok(unit(cars.random()).into()))?,
            FromProgram::Command(order) => {
                if order.to == OTHERS {
                    cars.broadcast(order.command, order.payload);
                } else if let Err(error) = cars.send(&order.to, order.command, order.payload) {
                    cars.log(format!("error: a command is not sent: {error}"));
                }
            }
            FromProgram::Log(log) => cars.log(log.text),
            FromProgram::Panel(panel) => self.panel = panel,
            FromProgram::Done(done) => return Ok(Some(done)),
        }

        Ok(None)
    }

    fn answer(&self, result: Result<Value, &'static str>) -> Result<(), String> {
        self.send(&ToProgram::Answer {
            result: result.map_or_else(Answered::Error, Answered::Value),
        })
    }

    /// Why the program cannot continue.
    fn failure(&self, event: ProgramEvent) -> String {
        match event {
            ProgramEvent::TooLong(line) => {
                format!("its line {} is longer than {MAX_LINE} bytes", quote(&line))
            }
            ProgramEvent::Interrupted => "it is asked to end".to_owned(),
            ProgramEvent::Closed => self
                .program
                .explain_end("its program has closed its standard output"),
            ProgramEvent::Line(_) | ProgramEvent::Ended => {
                self.program.explain_end("its program is over")
            }
        }
    }

    /// One tick of the program. Tick 0 has begun with the line `init`.
    fn exchange(&mut self, cars: &mut Cars<'_>) -> Result<DoneLine, String> {
        if cars.tick() > 0 {
            let commands: Vec<Arrived> = cars.commands().iter().map(arrived).collect();
            let told = ToProgram::Tick {
                tick: cars.tick(),
                location: cars.location(),
                pose: cars.pose(),
                blocked: cars.was_blocked(),
                commands: &commands,
                sensed: cars.sensed_robots(),
                sites: cars.sites(),
                site_results: cars.site_results(),
                layers: cars.layers(),
                layer_results: cars.layer_results(),
            };

            // What the program says after an `init` in the middle of a run may arrive before this line is sent.
            if self.is_initializing {
                self.send(&told)?;
            } else {
                self.begin(&told)?;
            }
        }

        self.is_initializing = false;
        self.converse(cars)
    }
}

fn arrived(command: &ReceivedCommand) -> Arrived {
    Arrived {
        from: command.from.clone(),
        performative: Performative::Achieve,
        command: command.text.clone(),
        payload: command.payload.clone(),
    }
}

/// The answer to a query of the program.
fn ask(cars: &mut Cars<'_>, query: &QueryLine) -> Result<Value, &'static str> {
    let state = cars
        .get_robot_state(&query.of)
        .map_err(|error| word_for(&error))?;
    if query.what == protocol::keys::STATE {
        return Ok(serde_json::json!(*state));
    }
    state
        .answer(&query.what)
        .map(|answer| answer.value)
        .ok_or("unknown query")
}

fn word_for(error: &CallError) -> &'static str {
    match error {
        CallError::UnknownRobot(_) => "unknown robot",
        CallError::Unreachable(_) => "unreachable",
        CallError::TooEarly => "too early",
        CallError::Interrupted => "interrupted",
    }
}

impl Robot for ProgramRobot {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        // As if nothing had been before: an incarnation does not inherit what another one has
        // published.
        self.done = DoneLine::default();
        self.panel = Panel::default();
        self.remarks.start_over();

        let welcome = cars.welcome();
        // What the program says to this is read in the tick that follows.
        let begun = self.begin(&ToProgram::init(
            welcome,
            cars.tick(),
            cars.pose(),
            cars.sensed_robots(),
            cars.sites(),
            cars.layers(),
        ));
        self.is_initializing = true;
        if let Err(reason) = begun {
            cars.give_up(reason);
        }

        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        match self.exchange(cars) {
            Ok(done) => self.done = done,
            Err(reason) => cars.give_up(reason),
        }

        Action {
            proposal: self.done.proposal.unwrap_or(cars.location()),
            speed_mps: self.done.speed_mps,
            direction_rad: self.done.direction_rad,
            emotion_state: self.done.emotion_state.clone(),
            behavior_state: self.done.behavior_state.clone(),
            state_variables: self.done.state_variables.clone(),
            site_actions: self.done.site_actions.clone(),
            layer_actions: self.done.layer_actions.clone(),
            velocity: self.done.velocity,
        }
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn senses_ranges(&self) -> bool {
        true
    }

    fn panel(&self) -> Panel {
        self.panel.clone()
    }
}
