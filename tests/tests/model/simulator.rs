//! The simulator: `simulator::server` and the bookkeeping of `simulator::simulation`.

use crate::machine::{Clock, Fault, NAMES, Name, Report, Rule, State};
use crate::protocol::Protocol;

impl State {
    fn awaited(&self) -> impl Iterator<Item = Name> + '_ {
        let simulator = &self.simulator;
        NAMES.into_iter().filter(|name| {
            simulator.is_open
                && !simulator.members[*name].is_lost
                && simulator.reports[*name].is_none()
        })
    }

    /// Whether the barrier is open for nobody.
    pub(crate) fn waits_for_nobody(&self) -> bool {
        self.simulator.is_open && self.awaited().next().is_none()
    }

    /// Whether somebody is awaited.
    pub(crate) fn is_held(&self) -> bool {
        self.awaited().next().is_some()
    }

    /// `Server::gather`, as far as it goes.
    fn gather(&mut self, protocol: &Protocol) {
        let simulator = &mut self.simulator;
        if !simulator.is_gathering
            || simulator
                .members
                .iter()
                .any(|m| !m.is_present || m.instance == 0)
        {
            return;
        }
        simulator.is_gathering = false;
        for member in &mut simulator.members {
            (member.is_seated, member.is_pending, member.is_lost) = (true, false, false);
            (member.missed, member.has_returned) = (0, false);
        }
        self.begin_tick(0, protocol);
    }

    /// `Server::begin_tick`.
    fn begin_tick(&mut self, tick: u8, protocol: &Protocol) {
        let simulator = &mut self.simulator;
        let named = simulator.underway.take();
        let mut clock = Clock {
            epoch: simulator.epoch,
            tick,
            joined: [0, 0],
            named,
        };
        for name in NAMES {
            let member = &mut simulator.members[name];
            member.is_given_up = false;
            if let Some(generation) = member.take_pending() {
                clock.joined[name] = generation;
            }
            if std::mem::take(&mut member.has_predecessor) {
                clock.joined[name] = member.generation;
            }
        }
        (simulator.clock, simulator.is_open, simulator.reports) = (clock, true, [None, None]);
        self.put_clock();
        // A tick that waits for nobody is complete at once.
        self.settle(protocol);
    }

    /// To every process whose link is there; what is on a link already need not be on it twice.
    fn put_clock(&mut self) {
        let clock = &self.simulator.clock;
        for process in self
            .processes
            .iter_mut()
            .filter(|process| process.is_alive && process.is_connected)
        {
            if process.down.last() != Some(clock) {
                process.down.push(clock.clone());
            }
        }
    }

    /// `Server::repeat_clock`.
    pub(crate) fn repeat_clock(&mut self, protocol: &Protocol) {
        if protocol.keeps(Rule::RepeatsClock) {
            self.put_clock();
        }
    }

    /// `Server::exchange` after an event, and the record of a complete tick.
    pub(crate) fn settle(&mut self, protocol: &Protocol) {
        self.gather(protocol);
        let simulator = &mut self.simulator;
        let has_some = simulator.reports.iter().any(Option::is_some);
        let goes_early = !protocol.keeps(Rule::WaitsForAll) && has_some;
        if !(self.waits_for_nobody() || self.simulator.is_open && goes_early) {
            return;
        }
        self.complete(protocol);
    }

    /// The tick is complete, and the next one begins.
    fn complete(&mut self, protocol: &Protocol) {
        self.close_tick();
        match self.simulator.clock.tick {
            last if last == protocol.last_tick => self.simulator.is_over = true,
            tick => self.begin_tick(tick + 1, protocol),
        }
    }

    /// `Server::close_tick` and `Simulation::record`.
    fn close_tick(&mut self) {
        let simulator = &mut self.simulator;
        simulator.is_open = false;
        for name in NAMES {
            let member = &mut simulator.members[name];
            let has_reported = simulator.reports[name].is_some();
            if !(has_reported || member.is_lost || member.is_given_up) {
                self.fault = Some(Fault::NoVerdict);
            }
            if has_reported {
                member.missed = 0;
            }
        }
        let [a, b] = std::mem::take(&mut simulator.reports);
        if let (Some(seq), Some(b)) = (simulator.clock.named, b)
            && !b.is_missing
        {
            match simulator.recorded.get_mut(&seq) {
                Some((_, is_delivered)) if !*is_delivered => *is_delivered = true,
                _ => self.fault = Some(Fault::DeliveredTwice),
            }
        }
        if let Some(command) = a.and_then(|report| report.sent) {
            simulator.underway = Some(command.seq);
            if simulator
                .recorded
                .insert(command.seq, (command.generation, false))
                .is_some()
            {
                self.fault = Some(Fault::DeliveredTwice);
            }
        }
    }

    /// `Server::on_report`.
    pub(crate) fn on_report(&mut self, name: Name, report: Report, protocol: &Protocol) {
        let simulator = &mut self.simulator;
        let member = &mut simulator.members[name];
        if member.is_lost && report.generation == member.generation {
            member.has_returned = true;
            return;
        }
        member.has_predecessor |= report.generation < member.generation;
        let is_epoch = report.epoch == simulator.clock.epoch && !simulator.is_gathering;
        let is_tick = report.tick == simulator.clock.tick;
        let is_generation = report.generation == member.generation;
        let counts = simulator.is_open
            && (is_epoch || !protocol.keeps(Rule::ChecksEpoch))
            && (is_tick || !protocol.keeps(Rule::ChecksTick))
            && (is_generation || !protocol.keeps(Rule::ChecksGeneration));
        if !counts {
            return;
        }
        if !(is_epoch && is_tick && is_generation) {
            self.fault = Some(Fault::StaleCounted);
        }
        self.simulator.reports[name].get_or_insert(report);
    }

    /// `Server::on_token`.
    pub(crate) fn on_token(&mut self, name: Name, is_there: bool, protocol: &Protocol) {
        let simulator = &mut self.simulator;
        let is_open = simulator.is_open && simulator.reports[name].is_none();
        let member = &mut simulator.members[name];
        member.is_present = is_there;
        if !(is_there && is_open) {
            return;
        }
        if protocol.keeps(Rule::NamesInOpenClock)
            && let Some(generation) = member.take_pending()
        {
            simulator.clock.joined[name] = generation;
        }
        self.repeat_clock(protocol);
    }

    /// Whether another process is this robot, or is about to show its token: `Member::is_taken_from`.
    pub(crate) fn is_taken(&self, name: Name) -> bool {
        let member = &self.simulator.members[name];
        let process = member
            .instance
            .checked_sub(1)
            .map(|number| &self.processes[number]);
        member.is_present || process.is_some_and(|process| process.is_alive && process.is_connected)
    }

    /// `Server::judge_join` for a new process, with the number that its commands follow.
    pub(crate) fn on_join(&mut self, name: Name, instance: usize, protocol: &Protocol) -> u8 {
        let simulator = &mut self.simulator;
        let member = &mut simulator.members[name];
        member.instance = instance;
        if member.is_seated {
            member.generation += 1;
            member.is_pending = true;
        } else {
            member.generation = member.generation.max(1);
        }
        let open = simulator.reports[name]
            .as_ref()
            .and_then(|report| report.sent)
            .map(|command| command.seq);
        let recorded = open
            .max(simulator.recorded.keys().next_back().copied())
            .unwrap_or(0);
        let anew = SEQS_OF_A_GENERATION * (member.generation - 1) * u8::from(member.is_seated);
        if protocol.keeps(Rule::NumbersAnew) {
            anew
        } else {
            recorded
        }
    }

    /// `Server::go_on_without_late`.
    pub(crate) fn give_up_late(&mut self) {
        let late: Vec<Name> = self.awaited().collect();
        for name in late {
            let member = &mut self.simulator.members[name];
            member.missed += 1;
            member.is_given_up = true;
            member.is_lost = member.missed >= LOSE_AFTER || !member.is_present;
        }
    }

    /// The same, and the tick that is complete by it.
    pub(crate) fn settle_late(&mut self, protocol: &Protocol) {
        self.simulator.is_open = false;
        self.complete(protocol);
    }

    /// `init`: the open tick is given up, and everybody is gathered.
    pub(crate) fn init(&mut self) {
        let simulator = &mut self.simulator;
        simulator.epoch += 1;
        (simulator.is_open, simulator.is_gathering) = (false, true);
        (simulator.reports, simulator.underway) = ([None, None], None);
        simulator.recorded.clear();
    }

    /// What A's incarnation was that the record names for a command of B's clock.
    pub(crate) fn recorded(&self) -> impl Fn(u8) -> Option<u8> + use<> {
        let recorded = self.simulator.recorded.clone();
        move |seq| recorded.get(&seq).map(|(generation, _)| *generation)
    }
}

/// The numbers of an incarnation's commands are its own.
const SEQS_OF_A_GENERATION: u8 = 10;
/// Ticks in a row without a report after which a robot is lost.
const LOSE_AFTER: u8 = 2;

impl crate::machine::Member {
    fn take_pending(&mut self) -> Option<u8> {
        if !((self.is_pending || self.has_returned) && self.is_present) {
            return None;
        }
        (
            self.is_pending,
            self.has_returned,
            self.is_lost,
            self.missed,
        ) = (false, false, false, 0);
        Some(self.generation)
    }
}
