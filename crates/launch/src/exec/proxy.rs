//! The robot that lets a program decide. Its whole exchange with the program happens once a tick.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};

use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::messages::{Panel, Performative};
use protocol::random::unit;
use robot::{Action, BadParameters, CallError, Cars, ReceivedCommand, Robot};
use serde_json::Value;

use super::line::{Answered, Arrived, Done, Query, Said, Told, quote};
use super::program::{Heard, MAX_LINE, Program};

/// Most lines that a program may say in a tick.
const MAX_LINES: usize = 1 << 16;
/// Most commands that it may send in a tick: what a report holds.
const MAX_COMMANDS: usize = protocol::messages::MAX_ENTRIES;
/// Most bytes of its lines that become part of the report, with room for what the report adds.
const MAX_REPORTED: usize = MAX_MESSAGE_BYTES - (1 << 17);

/// A robot whose program is another process.
pub(super) struct Proxy {
    program: Arc<Program>,
    heard: Receiver<Heard>,
    /// Whether the line `init` was the last one that the program was sent, so that it may be answering it.
    is_initializing: bool,
    /// What the program said last.
    done: Done,
    panel: Panel,
}

impl Proxy {
    pub(super) fn new(program: Arc<Program>, heard: Receiver<Heard>) -> Self {
        Self {
            program,
            heard,
            is_initializing: false,
            done: Done::default(),
            panel: Panel::default(),
        }
    }

    /// Tells the program something.
    fn tell(&self, told: &Told<'_>) -> Result<(), String> {
        self.program.tell(told).map_err(|error| {
            self.program.account_or(&format!(
                "its program has closed its standard input ({error})"
            ))
        })
    }

    /// Begins a tick: nothing may have been said since the last one.
    fn begin(&self, told: &Told<'_>) -> Result<(), String> {
        match self.heard.try_recv() {
            Err(TryRecvError::Empty) => self.tell(told),
            Err(TryRecvError::Disconnected) => Err(self.mishap(Heard::Ended)),
            Ok(Heard::Line(line)) => Err(format!(
                "its program said {} outside a tick; it may speak between a line init or tick and its own line done only",
                quote(&line)
            )),
            Ok(heard) => Err(self.mishap(heard)),
        }
    }

    /// Heeds what the program says, until it is done.
    fn converse(&mut self, cars: &mut Cars<'_>) -> Result<Done, String> {
        let (mut commands, mut reported) = (0, 0);
        for _ in 0..MAX_LINES {
            let line = match self.heard.recv() {
                Ok(Heard::Line(line)) => line,
                other => return Err(self.mishap(other.unwrap_or(Heard::Ended))),
            };
            let said = Said::read(&line)?;
            reported += if said.is_reported() { line.len() } else { 0 };
            commands += usize::from(matches!(said, Said::Command(_)));
            if commands > MAX_COMMANDS || reported > MAX_REPORTED {
                return Err(format!(
                    "its program said too much for one tick: {commands} commands and {reported} bytes of commands, log \
                     lines and done; allowed are {MAX_COMMANDS} and {MAX_REPORTED}"
                ));
            }
            if let Some(done) = self.heed(cars, said)? {
                return Ok(done);
            }
        }
        Err(format!(
            "its program said more than {MAX_LINES} lines in one tick and not done"
        ))
    }

    fn heed(&mut self, cars: &mut Cars<'_>, said: Said) -> Result<Option<Done>, String> {
        match said {
            Said::Query(query) => self.answer(ask(cars, &query))?,
            Said::Percept => {
                let bodies = serde_json::json!({ "bodies": cars.bodies() });
                self.answer(Ok(bodies))?;
            }
            Said::Random => self.answer(Ok(unit(cars.random()).into()))?,
            Said::Command(order) => {
                if let Err(error) = cars.set_robot_command(&order.to, order.command) {
                    cars.log(format!("error: a command is not sent: {error}"));
                }
            }
            Said::Log(log) => cars.log(log.text),
            Said::Panel(panel) => self.panel = panel,
            Said::Done(done) => return Ok(Some(done)),
        }
        Ok(None)
    }

    fn answer(&self, result: Result<Value, &'static str>) -> Result<(), String> {
        self.tell(&Told::Answer {
            result: result.map_or_else(Answered::Error, Answered::Value),
        })
    }

    /// Why the program cannot go on.
    fn mishap(&self, heard: Heard) -> String {
        match heard {
            Heard::TooLong(line) => {
                format!("its line {} is longer than {MAX_LINE} bytes", quote(&line))
            }
            Heard::Interrupted => "it is asked to end".to_owned(),
            Heard::Closed => self
                .program
                .account_or("its program has closed its standard output"),
            Heard::Line(_) | Heard::Ended => self.program.account_or("its program is over"),
        }
    }

    /// One tick of the program. Tick 0 has begun with the line `init`.
    fn exchange(&mut self, cars: &mut Cars<'_>) -> Result<Done, String> {
        if cars.tick() > 0 {
            let commands: Vec<Arrived> = cars.commands().iter().map(arrived).collect();
            let told = Told::Tick {
                tick: cars.tick(),
                location: cars.location(),
                blocked: cars.was_blocked(),
                commands: &commands,
                sensed: cars.sensed_robots(),
            };

            // What the program says after an `init` in the middle of a run may arrive before this line is sent.
            if self.is_initializing {
                self.tell(&told)?;
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
    }
}

/// The answer to a query of the program.
fn ask(cars: &mut Cars<'_>, query: &Query) -> Result<Value, &'static str> {
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

impl Robot for Proxy {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.done = Done::default();
        self.panel = Panel::default();

        let welcome = cars.welcome();
        let begun = self.begin(&Told::init(welcome, cars.tick(), cars.sensed_robots()));
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
        }
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn panel(&self) -> Panel {
        self.panel.clone()
    }
}
