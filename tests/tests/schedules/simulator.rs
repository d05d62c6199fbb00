//! The simulator's process: what `simulator::server::Server` does, with simulated time and without a bus, and what is
//! demanded of every tick that it completes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use environment::{Event as Recorded, Simulation, TickRecord};
use lockstep::{Barrier, BarrierOutput, LatePolicy, Membership, Sent, Stamp, Timer, Timing};
use protocol::messages::{
    Clock, Command, CommandText, End, JoinAnswer, JoinRequest, MAX_ENTRIES, OnLate, PublicState,
    Report, Target, Waiting,
};
use protocol::{Epoch, Generation, RobotName, RunName, Tick, encode};
use record::Entry;

use crate::again::Again;
use crate::plan::{Family, Flaw, MS, Micros, Plan, Point, S};
use crate::reference::{Reference, Reports};
use crate::star::{Bytes, Message};
use crate::world::{BOUND, Event, World};

/// A robot whose process goes on is asked to join again this often.
const NUDGE: Micros = 100 * MS;
/// How long the simulator waits at the end of a run for the robots to leave.
const GOODBYE: Micros = S;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The robots are awaited: to join, or to report.
    Robots,
    /// The next tick is awaited, at this time.
    Grant(Micros),
}

pub(crate) struct Simulator {
    pub(crate) barrier: Barrier<Arc<Report>, CommandText>,
    outputs: Vec<BarrierOutput<Arc<Report>, CommandText>>,
    pub(crate) simulation: Simulation,
    timers: BTreeMap<Timer, Micros>,
    stage: Stage,
    /// Whether robots join and tick 0 is not complete: the operator's `init` is refused.
    pub(crate) is_gathering: bool,
    /// The tick before which the last order of the scenario was carried out.
    ordered: Option<Tick>,
    /// The record of the epoch.
    recorded: Vec<Entry>,
    with_bodies: BTreeSet<RobotName>,
    operator: Vec<(RobotName, String)>,
    /// Commands of the operator that the next tick's record must show.
    passed_on: usize,
    /// The same run without a network; `None` once a robot has missed a tick.
    reference: Option<Reference>,
    pub(crate) joined: Vec<(Epoch, Tick, RobotName, Generation)>,
    pub(crate) had_commands: bool,
    pub(crate) ended: Option<(End, Micros)>,
    /// Whether the session is closed.
    pub(crate) is_closed: bool,
    goodbye: Vec<RobotName>,
}

impl Simulator {
    pub(crate) fn new(plan: &Plan, scenario: &scenario::Scenario) -> Self {
        let barrier = Barrier::new(
            scenario.robots.keys().cloned(),
            plan.lateness.clone(),
            Timing::default(),
            MAX_ENTRIES as u32,
        );

        Self {
            barrier,
            outputs: Vec::new(),
            simulation: Simulation::new(scenario.clone(), 1).expect("the hall can be set up"),
            timers: BTreeMap::new(),
            stage: Stage::Robots,
            is_gathering: true,
            ordered: None,
            recorded: Vec::new(),
            with_bodies: BTreeSet::new(),
            operator: Vec::new(),
            passed_on: 0,
            reference: None,
            joined: Vec::new(),
            had_commands: false,
            ended: None,
            is_closed: false,
            goodbye: Vec::new(),
        }
    }

    pub(crate) fn has_reference(&self) -> bool {
        self.reference.is_some()
    }
}

impl World {
    /// Begins an epoch.
    pub(crate) fn begin_epoch(&mut self, epoch: Epoch) {
        let halls = self.halls.clone();
        let scenario = &self.plan.scenario(&halls, epoch);
        self.check_again();
        let simulator = &mut self.simulator;
        simulator.recorded.clear();
        simulator.ordered = None;
        simulator.simulation =
            Simulation::new(scenario.clone(), epoch).expect("the hall can be set up");
        simulator.reference = Some(Reference::new(scenario, epoch));
        simulator.operator.clear();
        simulator.outputs.clear();
        simulator.joined.clear();
        simulator.passed_on = 0;
        simulator.had_commands = false;
        for name in &simulator.with_bodies {
            simulator.simulation.list_bodies(name, true);
        }
        simulator.stage = Stage::Robots;
        simulator.is_gathering = true;
        let lateness = self.plan.lateness.clone();
        simulator
            .barrier
            .gather(epoch, lateness, &mut simulator.outputs);
    }

    /// Carries out what the barrier wants done, and opens the next tick when it is due.
    pub(crate) fn turn(&mut self) {
        loop {
            for output in std::mem::take(&mut self.simulator.outputs) {
                self.carry_out_simulator(output);
            }
            if self.simulator.ended.is_some() || self.failure.is_some() {
                return;
            }
            if !self.simulator.outputs.is_empty() {
                continue;
            }

            let Stage::Grant(due) = self.simulator.stage else {
                return;
            };
            if self.simulator.simulation.is_over() {
                return self.end(End::Finished);
            }
            if self.now < due {
                return;
            }
            if self.has_faults_carried_out() {
                self.open();
            }
        }
    }

    /// Has the scenario's orders carried out that are due before the next tick. The clock is held until a robot that went on
    /// can take part again.
    fn has_faults_carried_out(&mut self) -> bool {
        let Some(stop) = self.plan.stop.clone() else {
            return true;
        };
        let next = self.simulator.simulation.tick() + 1;
        if (stop.from..=stop.until).contains(&next) {
            self.disturb(0);
        }
        let is_due = next == stop.from || next == stop.until;
        if is_due && self.simulator.ordered != Some(next) {
            self.simulator.ordered = Some(next);
            let begins = next == stop.from;
            let orders = self.simulator.simulation.faults_due();
            let simulation = &mut self.simulator.simulation;
            simulation.note_faults(&orders, |_| OnLate::Continue);
            for order in &orders {
                let barrier = &mut self.simulator.barrier;
                barrier.fault(&order.robot, order.lasting());
            }
            self.stop_robot(&stop.robot, begins);
        }
        if next != stop.until || self.simulator.barrier.is_back(&stop.robot) {
            return true;
        }

        let simulator = &mut self.simulator;
        simulator.barrier.repeat(&mut simulator.outputs);
        simulator.stage = Stage::Grant(self.now + NUDGE);
        self.schedule(NUDGE, Event::Grant);
        false
    }

    fn open(&mut self) {
        let simulator = &mut self.simulator;
        for (to, command) in std::mem::take(&mut simulator.operator) {
            let command = Sent {
                to: Target::Robot(to),
                command: CommandText::named(command),
            };
            simulator.simulation.command(command.clone());
            simulator.passed_on += 1;
            simulator.had_commands = true;
            if let Some(reference) = &mut simulator.reference {
                reference.command(command);
            }
        }
        let tick = simulator.simulation.begin_tick();
        simulator.stage = Stage::Robots;
        let news = simulator.simulation.robots_with_news();
        simulator.barrier.open(tick, news, &mut simulator.outputs);
        self.on_opened(tick);
    }

    fn carry_out_simulator(&mut self, output: BarrierOutput<Arc<Report>, CommandText>) {
        if self.simulator.ended.is_some() {
            return;
        }
        match output {
            BarrierOutput::Gathered => {
                let simulator = &mut self.simulator;
                simulator.simulation.begin_init();
                let news = simulator.simulation.robots_with_news();
                simulator.barrier.open(0, news, &mut simulator.outputs);
                self.on_opened(0);
            }
            BarrierOutput::Grant { news, clock } => {
                for (name, notice) in news {
                    let news = self.simulator.simulation.news(&name, notice);
                    self.put_down(Some(&name), &Message::News(encode(&news).into()));
                }
                self.put_down(None, &Message::Clock(encode(&clock).into()));
            }
            BarrierOutput::StandIn(robot) => self.stand_in(&robot),
            BarrierOutput::Complete(outcome) => self.complete(&outcome),
            BarrierOutput::Aborted => self.end(End::Aborted),
            BarrierOutput::SetTimer(timer, after) => self.set_timer(timer, after),
            BarrierOutput::Held | BarrierOutput::Released | BarrierOutput::Ignored(..) => {}
        }
    }

    /// Puts the state of a robot that cannot answer, to those that follow it.
    fn stand_in(&mut self, robot: &RobotName) {
        let state = self.simulator.simulation.last_state(robot);
        if let Some(state) = state.filter(|_| self.plan.flaw != Flaw::NobodyStandsIn) {
            self.put_state(robot, &encode(&state).into());
        }
    }

    fn set_timer(&mut self, timer: Timer, after: Duration) {
        let after = after.as_micros() as Micros;
        self.simulator
            .timers
            .insert(timer.clone(), self.now + after);
        self.schedule(after, Event::Timer(timer));
    }

    pub(crate) fn on_timer(&mut self, timer: &Timer) {
        let due = self.simulator.timers.get(timer).copied();
        if due == Some(self.now) && self.simulator.ended.is_none() {
            self.simulator.timers.remove(timer);
            let simulator = &mut self.simulator;
            simulator.barrier.timer(timer, &mut simulator.outputs);
        }
    }

    /// A tick is complete: this is where a wrong run shows.
    fn complete(&mut self, outcome: &Reports) {
        let epoch = self.simulator.simulation.epoch();
        let expected = self.simulator.barrier_tick(outcome);
        self.check_reports(outcome, epoch);
        self.progress_at = self.now;
        self.simulator.is_gathering = false;

        let record = self.simulator.simulation.end_tick(outcome.clone());
        self.simulator.recorded.push(entry(outcome, &record));
        if let Some(tick) = expected
            && record.tick != tick
        {
            self.fail_wrong(format!(
                "tick {} is completed with reports of tick {tick}",
                record.tick
            ));
        }
        self.check_commands(outcome, &record);
        self.check_membership(outcome, record.tick, epoch);
        self.compare(outcome, &record);
        self.note_facts(outcome, record.tick, epoch);
        self.note_trace(self.simulator.simulation.digest().as_bytes());

        let due = self.now + self.plan.pace;
        self.simulator.stage = Stage::Grant(due);
        self.schedule(self.plan.pace, Event::Grant);
    }

    /// Every report is one that the robot has made for this tick, with its commands and with the right answers.
    fn check_reports(&mut self, outcome: &Reports, epoch: Epoch) {
        let mut wrong = None;
        for (name, (report, commands)) in &outcome.reports {
            let made = self.made.get(&(epoch, report.tick, name.clone()));
            let found = made.into_iter().flatten().find(|made| {
                made.report == *report && made.commands == *commands && report.epoch == epoch
            });
            match found {
                None => {
                    wrong = Some(format!(
                        "tick {}: no process of {name} has made this report: {report:?}, {commands:?}",
                        report.tick
                    ));
                }
                Some(made) => wrong = wrong.or_else(|| made.wrong.clone()),
            }
        }

        if let Some(wrong) = wrong {
            self.fail_wrong(wrong);
        }
    }

    /// Each command that was sent is recorded once.
    fn check_commands(&mut self, outcome: &Reports, record: &TickRecord) {
        let mut recorded: BTreeMap<RobotName, usize> = BTreeMap::new();
        for event in record.events.iter() {
            if let Recorded::CommandSent { from, .. } = event {
                *recorded.entry(from.clone()).or_default() += 1;
            }
        }
        let mut sent = BTreeMap::new();
        for (name, (_, commands)) in &outcome.reports {
            // A broadcast is recorded as a command to each other robot.
            let others = self.simulator.barrier.roster().count() - 1;
            let count = commands.iter().map(|sent| match sent.to {
                Target::Robot(_) => 1,
                Target::Others => others,
            });
            let count: usize = count.sum();
            if count > 0 {
                sent.insert(name.clone(), count);
            }
        }
        let passed_on = std::mem::take(&mut self.simulator.passed_on);
        if passed_on > 0 {
            sent.insert(RobotName::operator(), passed_on);
        }

        self.counts.commands += sent.values().sum::<usize>() as u64;
        if recorded != sent {
            self.fail_wrong(format!(
                "tick {}: commands {sent:?} are recorded as {recorded:?}",
                record.tick
            ));
        }
    }

    fn check_membership(&mut self, outcome: &Reports, tick: Tick, epoch: Epoch) {
        for change in &outcome.membership {
            match change {
                Membership::Joined(robot, generation) => {
                    let joined = (epoch, tick, robot.clone(), *generation);
                    self.simulator.joined.push(joined);
                    self.counts.joined += 1;
                    let has_missed = !outcome.reports.contains_key(robot);
                    self.counts.joined_and_missed += u64::from(has_missed);
                }
                Membership::Lost(_) => self.counts.lost += 1,
            }
        }

        let missing: Vec<RobotName> = self
            .simulator
            .simulation
            .names()
            .iter()
            .filter(|name| !outcome.reports.contains_key(*name))
            .cloned()
            .collect();
        let is_plain = missing.is_empty() && outcome.membership.is_empty();
        self.counts.first_ticks += u64::from(tick == 0 && !is_plain);
        if missing.is_empty() {
            return;
        }
        self.counts.missed += 1;
        if !matches!(self.plan.family, Family::Late | Family::Stopped) {
            self.fail_wrong(format!("tick {tick} is completed without {missing:?}"));
        }
        if self.now > self.disturbed_until + BOUND {
            let since = (self.now - self.disturbed_until) / MS;
            self.fail_stuck(format!(
                "{missing:?} are not back in tick {tick}, {since} ms after the last fault"
            ));
        }
    }

    /// The record is that of the same run without a network.
    fn compare(&mut self, outcome: &Reports, record: &TickRecord) {
        let is_whole = outcome.reports.len() == self.simulator.simulation.names().len();
        if !is_whole {
            self.simulator.reference = None;
        }
        let Some(reference) = &mut self.simulator.reference else {
            return;
        };

        let expected = reference.tick(record.tick, outcome);
        if expected.events != record.events {
            let differs = expected
                .events
                .iter()
                .zip(record.events.iter())
                .find(|(a, b)| a != b);
            self.fail_wrong(format!(
                "tick {}: expected and recorded: {differs:?}",
                record.tick
            ));
        }
    }

    /// What robots may learn of one another during the next tick.
    fn note_facts(&mut self, outcome: &Reports, tick: Tick, epoch: Epoch) {
        for (name, (report, _)) in &outcome.reports {
            let state = PublicState {
                epoch,
                tick,
                location: self.simulator.simulation.location(name).unwrap_or_default(),
                speed_mps: report.speed_mps,
                direction_rad: report.direction_rad,
                state_variables: report.state_variables.clone(),
                emotion_state: report.emotion_state.clone(),
                behavior_state: report.behavior_state.clone(),
            };
            self.facts
                .insert((epoch, tick, name.clone()), Arc::new(state));
        }
    }

    /// Puts the end of the run.
    pub(crate) fn end(&mut self, end: End) {
        let clock = self.simulator.barrier.end(end);
        self.simulator.ended = Some((end, self.now));
        self.put_clock(&clock);
        for name in self.simulator.barrier.roster() {
            if self.simulator.barrier.is_present(name) {
                self.simulator.goodbye.push(name.clone());
            }
        }
        self.schedule(GOODBYE, Event::Close);
    }

    fn put_clock(&mut self, clock: &Clock) {
        self.put_down(None, &Message::Clock(encode(clock).into()));
    }

    /// The simulator closes its session.
    pub(crate) fn close(&mut self) {
        for link in 0..self.links.len() {
            self.send(link, crate::star::Way::Down, Message::SimulatorToken(false));
        }
        self.simulator.is_closed = true;
    }

    /// The operator starts the next epoch.
    pub(crate) fn init(&mut self) {
        if self.simulator.ended.is_some() {
            return;
        }
        if self.simulator.is_gathering {
            // It is refused; the operator tries again.
            let index = self
                .plan
                .blows
                .iter()
                .position(|blow| matches!(blow.what, crate::plan::What::Init));
            self.schedule(50 * MS, Event::Blow(index.unwrap_or_default()));
            return;
        }
        self.counts.inits += 1;
        let epoch = self.simulator.simulation.epoch() + 1;
        self.begin_epoch(epoch);
    }

    /// The record of the epoch can be executed again, and forked.
    pub(crate) fn check_again(&mut self) {
        let recorded = std::mem::take(&mut self.simulator.recorded);
        if recorded.is_empty() || self.failure.is_some() {
            return;
        }

        let simulation = &self.simulator.simulation;
        let again = Again {
            scenario: simulation.scenario(),
            epoch: simulation.epoch(),
            digest: simulation.digest(),
            recorded,
        };
        match again.check() {
            Ok(forks) => self.counts.forks += forks,
            Err(wrong) => self.fail_wrong(wrong),
        }
    }

    pub(crate) fn set_lateness(&mut self, lateness: LatePolicy) {
        if self.simulator.ended.is_none() {
            let simulator = &mut self.simulator;
            simulator
                .barrier
                .set_lateness(lateness, &mut simulator.outputs);
        }
    }

    pub(crate) fn on_operator(&mut self, to: RobotName, command: String) {
        if self.simulator.ended.is_none() {
            self.counts.operator += 1;
            self.simulator.operator.push((to, command));
        }
    }

    pub(crate) fn on_token(&mut self, robot: &RobotName, is_present: bool) {
        if let Some((end, _)) = self.simulator.ended {
            if is_present {
                let clock = self.simulator.barrier.end(end);
                self.put_clock(&clock);
            } else {
                self.simulator.goodbye.retain(|name| name != robot);
            }
            return;
        }
        let simulator = &mut self.simulator;
        simulator
            .barrier
            .token(robot, is_present, &mut simulator.outputs);
    }

    pub(crate) fn on_report(&mut self, robot: &RobotName, bytes: &[u8]) {
        let report: Report = self.read(bytes);
        let stamp = Stamp::from(&report);
        let commands = report.commands;
        let simulator = &mut self.simulator;
        let is_of_epoch = stamp.epoch == simulator.simulation.epoch();
        if is_of_epoch && simulator.barrier.is_behind(robot, stamp.generation) {
            simulator.simulation.done_late(robot, stamp.tick);
        }
        simulator.barrier.report(
            robot,
            stamp,
            commands,
            Arc::new(report),
            &mut simulator.outputs,
        );

        self.die_counted(robot, stamp);
    }

    fn is_awaited(&self, robot: &RobotName) -> bool {
        self.simulator
            .barrier
            .awaited()
            .iter()
            .any(|(name, _)| name == robot)
    }

    /// The robot whose report counts now dies, if that is planned.
    fn die_counted(&mut self, robot: &RobotName, stamp: Stamp) {
        let outputs = &self.simulator.outputs;
        let is_complete = outputs
            .iter()
            .any(|output| matches!(output, BarrierOutput::Complete(_)));
        let has_counted = self.simulator.barrier.is_open() && !self.is_awaited(robot);
        if !is_complete && !has_counted {
            return;
        }

        let processes = 0..self.processes.len();
        let alive: Vec<usize> = processes
            .filter(|process| self.is_alive(*process, robot))
            .collect();
        for process in alive {
            self.dies(process, stamp.epoch, stamp.tick, Point::Counted);
        }
    }

    pub(crate) fn on_command(&mut self, from: &RobotName, bytes: &[u8]) {
        let command: Command = self.read(bytes);
        let stamp = Stamp::from(&command);
        let number = command.number;
        let to = command.to.clone().expect("an outbox names the target");
        let sent = Sent::new(to, command);

        let simulator = &mut self.simulator;
        simulator
            .barrier
            .command(from, stamp, number, sent, &mut simulator.outputs);
        // A report counts with the last of its commands, which may have been lost before it.
        self.die_counted(from, stamp);
    }

    pub(crate) fn on_waiting(&mut self, robot: &RobotName, bytes: &[u8]) {
        let waiting: Waiting = self.read(bytes);
        let simulator = &mut self.simulator;
        simulator.barrier.waiting(
            robot,
            waiting.epoch,
            waiting.tick,
            &waiting.on,
            &mut simulator.outputs,
        );
    }

    pub(crate) fn on_join(&mut self, bytes: &[u8]) -> Option<Bytes> {
        let request: JoinRequest = self.read(bytes);
        let name = &request.name;
        let simulator = &mut self.simulator;
        let joined = simulator
            .barrier
            .join(name, &request.instance, &mut simulator.outputs);
        let answer = match joined {
            Ok(admission) => {
                if request.bodies {
                    simulator.with_bodies.insert(name.clone());
                } else {
                    simulator.with_bodies.remove(name);
                }
                simulator.simulation.list_bodies(name, request.bodies);
                let open = simulator.barrier.open_report(name).map(AsRef::as_ref);
                let run = RunName::new("schedule").expect("a legal name");
                let welcome =
                    simulator
                        .simulation
                        .welcome(&run, name, admission.generation, open)?;
                JoinAnswer::Welcome(Box::new(welcome))
            }
            Err(refused) => JoinAnswer::Refused {
                reason: refused.into(),
                explanation: String::new(),
            },
        };

        Some(encode(&answer).into())
    }
}

/// A tick as a record has it.
fn entry(outcome: &Reports, record: &TickRecord) -> Entry {
    let mut reports = BTreeMap::new();
    for (name, (report, _)) in &outcome.reports {
        reports.insert(name.clone(), report.as_ref().clone());
    }

    Entry {
        tick: record.tick,
        events: record.events.to_vec(),
        reports: Some(reports),
        ..Entry::default()
    }
}

impl Simulator {
    /// The tick that the reports are of, if there are any and they agree.
    fn barrier_tick(&self, outcome: &Reports) -> Option<Tick> {
        let mut ticks: Vec<Tick> = outcome
            .reports
            .values()
            .map(|(report, _)| report.tick)
            .collect();
        ticks.dedup();

        match ticks[..] {
            [] => None,
            [tick] => Some(tick),
            _ => Some(Tick::MAX),
        }
    }
}
