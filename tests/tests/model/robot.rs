//! A robot's process: `robot::host` and `robot::link`.

use std::collections::BTreeMap;

use crate::machine::{A, B, Clock, Command, Fault, Member, Process, Report, Rule, Up};
use crate::protocol::Protocol;

/// What a process learns while it handles something, beside what it sends.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) fault: Option<Fault>,
}

impl Process {
    fn nobody(name: usize) -> Self {
        Self {
            name,
            is_alive: false,
            is_connected: false,
            is_shown: false,
            epoch: 0,
            generation: 0,
            is_seated: false,
            current: (0, 0),
            last_seq: 0,
            last: None,
            waits: None,
            held: BTreeMap::new(),
            sent: Vec::new(),
            handed: Vec::new(),
            up: Vec::new(),
            down: Vec::new(),
            out: Vec::new(),
        }
    }

    /// `Host::join_over`: welcomed, then its token.
    pub(crate) fn join(name: usize, member: &Member, epoch: u8, last_seq: u8) -> Self {
        let (generation, up) = (member.generation, vec![Up::Token(true)]);
        let here = Self {
            is_alive: true,
            is_connected: true,
            ..Self::nobody(name)
        };
        Self {
            epoch,
            generation,
            last_seq,
            up,
            ..here
        }
    }

    /// `Link::file_clock`, `Link::is_interrupted`, then `Host::on_clock`. `welcome` is what `Host::join` would get in
    /// a new epoch.
    pub(crate) fn on_clock(
        &mut self,
        clock: Clock,
        welcome: Option<(u8, u8)>,
        protocol: &Protocol,
        recorded: impl Fn(u8) -> Option<u8>,
    ) -> Seen {
        let mut seen = Seen::default();
        let asked = (clock.epoch, clock.tick);
        if asked == self.current {
            self.repeat_commands(protocol);
        }
        if let Some(waited) = self.waits.take() {
            if asked <= self.current {
                self.waits = Some(waited);
                return seen;
            }
            // The clock has gone on without it: it ends its tick without the command.
            self.finish(&waited, true, protocol, &recorded, &mut seen);
        }
        if asked < self.current {
            return seen;
        }
        if asked > self.current {
            self.begin(asked);
        }
        if clock.tick == 0 && self.epoch < clock.epoch {
            match welcome {
                Some((epoch, generation)) if epoch == clock.epoch => {
                    (self.epoch, self.generation, self.last_seq) = (epoch, generation, 0);
                    (self.is_seated, self.last) = (false, None);
                    self.handed.clear();
                }
                Some(_) => {}
                // Another process has its place.
                None => {
                    self.end();
                    return seen;
                }
            }
        }
        self.answer(clock, protocol, &recorded, &mut seen);
        seen
    }

    /// Its end. What it has sent is still under way.
    pub(crate) fn end(&mut self) {
        let (up, out) = (std::mem::take(&mut self.up), std::mem::take(&mut self.out));
        let Self {
            name,
            is_connected,
            is_shown,
            ..
        } = *self;
        *self = Self {
            is_connected,
            is_shown,
            up,
            out,
            ..Self::nobody(name)
        };
        if is_connected {
            self.up.push(Up::Token(false));
        }
    }

    /// `Link::begin`.
    fn begin(&mut self, (epoch, tick): (u8, u8)) {
        if epoch != self.current.0 {
            self.held.retain(|_, command| command.epoch >= epoch);
            self.sent.clear();
        }
        self.current = (epoch, tick);
        self.sent.retain(|command| command.tick + 2 > tick);
    }

    fn repeat_commands(&mut self, protocol: &Protocol) {
        if protocol.keeps(Rule::RepeatsCommands) {
            for command in self.sent.clone() {
                self.send(command);
            }
        }
    }

    /// What is on a link already need not be on it twice.
    fn send(&mut self, command: Command) {
        if self.is_connected && !self.out.contains(&command) {
            self.out.push(command);
        }
    }

    fn report(&mut self, report: Report) {
        let up = Up::Report(report);
        if self.is_connected && self.up.last() != Some(&up) {
            self.up.push(up);
        }
    }

    /// `Member::answer` of the SDK.
    fn answer(
        &mut self,
        clock: Clock,
        protocol: &Protocol,
        recorded: &impl Fn(u8) -> Option<u8>,
        seen: &mut Seen,
    ) {
        if clock.epoch != self.epoch {
            return;
        }
        let joined = clock.joined[self.name];
        if joined > self.generation {
            return self.end(); // Replaced.
        }
        if let Some(last) = self
            .last
            .clone()
            .filter(|_| protocol.keeps(Rule::DoesTicksOnce))
        {
            let done = (last.epoch, last.tick);
            if done >= (clock.epoch, clock.tick) {
                if done == (clock.epoch, clock.tick) {
                    self.repeat_commands(protocol);
                    if protocol.keeps(Rule::RepeatsReport) {
                        self.report(last);
                    }
                }
                return;
            }
        }
        if !self.is_seated && clock.tick > 0 && joined != self.generation {
            return;
        }
        self.is_seated = true;
        self.try_to_finish(clock, protocol, recorded, seen);
    }

    /// `Seat::tick`: waits for the command that the clock names.
    fn try_to_finish(
        &mut self,
        clock: Clock,
        protocol: &Protocol,
        recorded: &impl Fn(u8) -> Option<u8>,
        seen: &mut Seen,
    ) {
        let is_here = |seq: &u8| {
            self.held
                .get(seq)
                .is_some_and(|command| command.epoch == clock.epoch)
        };
        if self.name == B && clock.named.is_some_and(|seq| !is_here(&seq)) {
            self.waits = Some(clock);
        } else {
            self.finish(&clock, false, protocol, recorded, seen);
        }
    }

    /// `Link::file_command`.
    pub(crate) fn on_command(
        &mut self,
        command: Command,
        protocol: &Protocol,
        recorded: impl Fn(u8) -> Option<u8>,
    ) -> Seen {
        let mut seen = Seen::default();
        if command.epoch < self.current.0 {
            return seen;
        }
        self.held.insert(command.seq, command);
        if let Some(clock) = self.waits.take() {
            self.try_to_finish(clock, protocol, &recorded, &mut seen);
        }
        seen
    }

    /// `COMMAND_PATIENCE` is over.
    pub(crate) fn give_up_waiting(&mut self, protocol: &Protocol) -> Seen {
        let mut seen = Seen::default();
        if let Some(clock) = self.waits.take() {
            self.finish(&clock, true, protocol, &|_| None, &mut seen);
        }
        seen
    }

    /// The end of a tick: commands, then the report.
    fn finish(
        &mut self,
        clock: &Clock,
        is_missing: bool,
        protocol: &Protocol,
        recorded: &impl Fn(u8) -> Option<u8>,
        seen: &mut Seen,
    ) {
        if let (B, Some(seq), false) = (self.name, clock.named, is_missing) {
            // A robot that does a tick again is handed its commands again; its memory of them is in the way no more.
            let command = if protocol.keeps(Rule::DoesTicksOnce) {
                self.held.remove(&seq)
            } else {
                self.held.get(&seq).copied()
            };
            if self.handed.contains(&seq) {
                seen.fault = Some(Fault::DeliveredTwice);
            }
            if let (Some(command), Some(expected)) = (command, recorded(seq))
                && command.generation != expected
            {
                seen.fault = Some(Fault::OtherCommand);
            }
            self.handed.push(seq);
        }
        let mut sent = None;
        if self.name == A && clock.tick < protocol.last_tick {
            self.last_seq += 1;
            let (epoch, tick, seq, generation) =
                (clock.epoch, clock.tick, self.last_seq, self.generation);
            let command = Command {
                epoch,
                tick,
                seq,
                generation,
            };
            self.send(command);
            self.sent.push(command);
            sent = Some(command);
        }
        let (epoch, tick, generation) = (clock.epoch, clock.tick, self.generation);
        let report = Report {
            epoch,
            tick,
            generation,
            sent,
            is_missing,
        };
        self.report(report.clone());
        self.last = Some(report);
    }
}
