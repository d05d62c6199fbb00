//! The simulated star: the barrier, the processes, the links between them, and what may happen.

use std::collections::BTreeSet;
use std::time::Duration;

use protocol::messages::{Clock, End, FaultKind, OnLate};
use protocol::{Epoch, RobotName, Tick};
use stateright::{Model, Property};

use super::mutants::{MaybeWrongRobot, Mutant, Simulator};
use super::process::{Around, Down, ModelProcess, Up};
use super::simulation::{ModelReport, ModelSimulation, ModelUpdate, Order, Ordered, Violation};
use crate::{
    BarrierOutput, IncarnationNotice, LatePolicy, Membership, RobotTimer, TickOutcome, Timer,
};

/// How often each thing may still happen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(super) struct ModelBudget {
    /// Single messages lost, which TCP never does.
    pub(super) losses: u8,
    /// Messages that come again, after all others on their link.
    pub(super) duplicates: u8,
    /// Links that break and take the token with them.
    pub(super) cuts: u8,
    /// Links that break and are back before the router noticed: what is on them is lost.
    pub(super) blips: u8,
    /// Links of stopped processes that die; the router notices later.
    pub(super) lapses: u8,
    /// Processes that die.
    pub(super) crashes: u8,
    /// Processes started while another one of the same name is cut off.
    pub(super) successors: u8,
    /// Processes started while another one of the same name is connected.
    pub(super) rivals: u8,
    /// Timers that fire while messages are under way.
    pub(super) early: u8,
    /// New epochs.
    pub(super) inits: u8,
    /// Clocks of an epoch that has not begun, from elsewhere.
    pub(super) strays: u8,
}

/// What is explored: bounds, and perhaps what is done wrong.
#[derive(Debug, Clone)]
pub(super) struct Star {
    pub(super) last_tick: Tick,
    pub(super) on_late: OnLate,
    pub(super) lose_after: u32,
    /// Whether a tick takes time, so that things happen meanwhile.
    pub(super) is_slow: bool,
    pub(super) scenario: Option<Ordered>,
    /// The only robot whose links break and whose place is taken; `None` for both.
    pub(super) victim: Option<&'static str>,
    /// A robot for which the clock waits whatever it does about others.
    pub(super) waits_for: Option<&'static str>,
    /// Whether the exploration begins when tick 0 is granted.
    pub(super) is_gathered: bool,
    pub(super) budget: ModelBudget,
    pub(super) mutant: Option<Mutant>,
}

/// One state of everything.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct ModelState {
    pub(super) barrier: Simulator,
    pub(super) simulation: ModelSimulation,
    /// By the order in which they were started; `None` if nothing of them remains.
    pub(super) processes: Vec<Option<ModelProcess>>,
    /// Robots for which [`Timer::Token`] is set.
    reserved: BTreeSet<RobotName>,
    left: ModelBudget,
    pub(super) violation: Option<Violation>,
}

/// The processes of one name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kin {
    None,
    CutOff,
    Connected,
}

/// A direction of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    Up,
    Down,
}

/// What may happen. A process is meant by its number in the order in which they were started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ModelStep {
    Deliver(usize, Way),
    Lose(usize, Way),
    Duplicate(usize, Way),
    /// A process has done its tick.
    Done(usize),
    /// A process asks to join again.
    AskAgain(usize),
    /// A request to join gets no answer.
    Unanswered(usize),
    Cut(usize),
    Blip(usize),
    Lapse(usize),
    /// The router notices that a link is dead.
    Notice(usize),
    Heal(usize),
    Crash(usize),
    Start(RobotName),
    /// A timer of the barrier fires.
    Fire(Timer),
    /// The simulator repeats the last clock while it waits for a robot to be back.
    RepeatBetween,
    Init,
    /// A clock of a later epoch, which is not the simulator's, is on the link of a process.
    Stray(usize),
}

impl ModelStep {
    /// Whether it happens sooner or later when nothing goes wrong any more.
    pub(super) fn is_fair(&self) -> bool {
        matches!(
            self,
            Self::Deliver(..)
                | Self::Done(_)
                | Self::AskAgain(_)
                | Self::Unanswered(_)
                | Self::Heal(_)
                | Self::Notice(_)
                | Self::Start(_)
                | Self::Fire(Timer::Repeat | Timer::Token(_))
                | Self::RepeatBetween
        )
    }
}

impl ModelState {
    fn process(&mut self, number: usize) -> &mut ModelProcess {
        let process = self.processes[number].as_mut();

        process.unwrap_or_else(|| unreachable!("a step of a process that is gone"))
    }

    /// Processes that may still do something, with their numbers.
    pub(super) fn living(&self) -> impl Iterator<Item = (usize, &ModelProcess)> {
        self.processes
            .iter()
            .enumerate()
            .filter_map(|(number, process)| Some((number, process.as_ref()?)))
            .filter(|(_, process)| process.is_alive)
    }

    /// Whether nothing is under way.
    fn is_quiet(&self) -> bool {
        self.processes.iter().flatten().all(|process| {
            let is_idle = process.down.is_empty() && process.running.is_none();
            process.up.is_empty() && (is_idle || process.is_stopped)
        })
    }

    /// Whether a connected process lives on although another one has taken its place.
    pub(super) fn has_replaced_process(&self) -> bool {
        self.living().any(|(_, process)| {
            let present = self.barrier.presence(&process.name).0;
            let own = process.robot.admission();
            process.is_connected && own.is_some_and(|own| own.generation < present)
        })
    }

    /// Whether two living processes of one name were admitted as the same incarnation.
    fn has_twins(&self) -> bool {
        let mut admitted = BTreeSet::new();
        self.living().any(|(_, process)| {
            let own = process.robot.admission();
            own.is_some_and(|own| !admitted.insert((&process.name, own.generation)))
        })
    }

    fn kin(&self, name: &RobotName) -> Kin {
        let mut kin = Kin::None;
        for (_, process) in self.living() {
            if process.name == *name {
                let is_connected = process.is_connected || kin == Kin::Connected;
                kin = if is_connected {
                    Kin::Connected
                } else {
                    Kin::CutOff
                };
            }
        }
        kin
    }

    fn note(&mut self, violation: Option<Violation>) {
        self.violation = self.violation.or(violation);
    }
}

impl Star {
    /// The same within another budget.
    pub(super) fn with(self, budget: ModelBudget) -> Self {
        Self { budget, ..self }
    }

    fn lateness(&self) -> LatePolicy {
        LatePolicy {
            on_late: self.on_late,
            own: self
                .waits_for
                .map(|robot| (super::name(robot), OnLate::Wait))
                .into_iter()
                .collect(),
            deadline: Duration::from_secs(1),
            lose_after: self.lose_after,
        }
    }

    fn feed(
        &self,
        state: &mut ModelState,
        number: usize,
        input: impl FnOnce(&mut ModelProcess, Around) -> Option<Violation>,
    ) {
        let ModelState {
            simulation,
            processes,
            ..
        } = state;
        let around = Around {
            simulation,
            is_slow: self.is_slow,
            mutant: self.mutant,
        };
        let violation = processes[number]
            .as_mut()
            .and_then(|process| input(process, around));

        state.note(violation);
    }

    /// Feeds the barrier, and carries out what it wants done.
    fn feed_barrier(
        &self,
        state: &mut ModelState,
        input: impl FnOnce(&mut Simulator, &mut Vec<BarrierOutput<ModelReport, Order>>),
    ) {
        let mut out = Vec::new();
        input(&mut state.barrier, &mut out);
        self.carry_out(state, out);

        // A tick is granted when the faults before it are carried out.
        while let Some(tick) = state.simulation.next
            && self.is_carried_out(state, tick)
        {
            state.simulation.open(tick);
            let names: BTreeSet<RobotName> = state.simulation.news.keys().cloned().collect();
            let mut out = Vec::new();
            if tick == 0 {
                for (name, part) in &mut state.simulation.parts {
                    part.generation = state.barrier.presence(name).0;
                }
            }
            state.barrier.open(tick, names, &mut out);
            self.carry_out(state, out);
        }
        Self::observe(state);
    }

    fn carry_out(&self, state: &mut ModelState, out: Vec<BarrierOutput<ModelReport, Order>>) {
        for output in out {
            match output {
                BarrierOutput::Gathered => state.simulation.next = Some(0),
                BarrierOutput::Grant { news, clock } => Self::put(state, news, clock),
                BarrierOutput::Complete(outcome) => {
                    let accident = self
                        .lost_by_accident(state, &outcome.membership)
                        .or_else(|| self.remembers_hang(&outcome));

                    let barrier = &state.barrier;
                    let is_stopped = self.has_fault(state.simulation.tick);
                    let violation = state.simulation.record(outcome, |name| {
                        // A hang decides alone, whatever the token does.
                        let is_hang = self.budget.lapses > 0;
                        let is_out = !barrier.is_present(name) && !is_hang || is_stopped;
                        is_out && barrier.lateness().of(name) == OnLate::Continue
                    });

                    state.note(accident);
                    state.note(violation);
                    self.go_on(state);
                }
                BarrierOutput::Aborted => Self::end(state, End::Aborted),
                BarrierOutput::SetTimer(Timer::Token(name), _) => {
                    state.reserved.insert(name);
                }
                _ => {}
            }
        }
    }

    /// Where nothing but a hang happens, the scenario alone decides when its robot is lost.
    fn lost_by_accident(&self, state: &ModelState, membership: &[Membership]) -> Option<Violation> {
        let fault = self.scenario?;
        let tick = fault.from + Tick::from(self.lose_after) - 1;
        let is_due = state.simulation.tick == tick && tick < fault.until;
        let is_lost = membership
            .iter()
            .any(|change| matches!(change, Membership::Lost(_)));
        let decides_alone = self.budget.lapses > 0 && !state.simulation.is_late;

        (decides_alone && is_lost && !is_due).then_some(Violation::LostByAccident)
    }

    /// What a robot does after a hang does not depend on what its process made of the clocks before its end.
    fn remembers_hang(&self, outcome: &TickOutcome<ModelReport, Order>) -> Option<Violation> {
        let fault = self
            .scenario
            .filter(|fault| fault.kind == FaultKind::Hang)?;
        let (report, _) = outcome.reports.get(&super::name("B"))?;
        let is_after = report.tick >= fault.until;

        (is_after && report.since < fault.until).then_some(Violation::OldState)
    }

    /// The news each to its robot, then the clock to all, as [`Output::Grant`] wants it.
    fn put(state: &mut ModelState, news: Vec<(RobotName, IncarnationNotice)>, clock: Clock) {
        let simulation = &mut state.simulation;
        for (name, notice) in news {
            let content = ModelUpdate {
                epoch: clock.epoch,
                tick: clock.tick,
                orders: simulation.news.get(&name).cloned().unwrap_or_default(),
            };

            if let (Some(generation), Some(part)) = (notice.joined, simulation.parts.get_mut(&name))
            {
                part.named = Some((clock.epoch, clock.tick, generation));
            }

            for process in state.processes.iter_mut().flatten() {
                if process.name == name && process.is_alive && process.is_connected {
                    process.down.push_back(Down::News(
                        clock.epoch,
                        clock.tick,
                        notice,
                        content.clone(),
                    ));
                }
            }
        }

        for process in state.processes.iter_mut().flatten() {
            if process.is_alive && process.is_connected {
                process.down.push_back(Down::Clock(clock));
            }
        }
    }

    /// A tick is complete: the end, or the faults before the next one.
    fn go_on(&self, state: &mut ModelState) {
        let Some(next) = state.simulation.next else {
            return;
        };
        if next > self.last_tick {
            Self::end(state, End::Finished);
            return;
        }
        let Some(fault) = self.scenario else { return };

        let name = super::name("B");
        let begins = fault.from == next;
        if begins || fault.until == next {
            state.barrier.fault(&name, begins.then_some(fault.kind));
            for process in state.processes.iter_mut().flatten() {
                if process.name != name || !process.is_alive {
                    continue;
                }
                match fault.kind {
                    FaultKind::Crash if begins => process.end(),
                    FaultKind::Hang => process.is_stopped = begins,
                    _ => {}
                }
            }
        }
    }

    /// Whether the scenario's fault lasts in this tick.
    fn has_fault(&self, tick: Tick) -> bool {
        self.scenario
            .is_some_and(|fault| (fault.from..fault.until).contains(&tick))
    }

    /// Whether the robots are as the scenario wants them before this tick.
    fn is_carried_out(&self, state: &ModelState, tick: Tick) -> bool {
        let name = super::name("B");

        match self.scenario {
            Some(fault) if fault.from == tick && fault.kind == FaultKind::Crash => {
                !state.barrier.is_present(&name)
            }
            Some(fault) if fault.until == tick => state.barrier.is_back(&name),
            _ => true,
        }
    }

    fn may_strike(&self, robot: &RobotName) -> bool {
        self.victim.is_none_or(|victim| victim == robot.as_str())
    }

    fn end(state: &mut ModelState, end: End) {
        state.barrier.end(end);
        state.simulation.is_over = true;
        state.simulation.is_full |= end == End::Aborted;
        state.simulation.next = None;
    }

    /// What must hold after everything that happens at the simulator.
    fn observe(state: &mut ModelState) {
        if !state.barrier.is_open() {
            return;
        }
        let awaited = state.barrier.awaited();
        if awaited.is_empty() {
            state.note(Some(Violation::WaitsForNone));
        }

        for (name, part) in &mut state.simulation.parts {
            let is_awaited = awaited.iter().any(|(other, _)| other == name);
            let has_report = state.barrier.open_report(name).is_some();
            part.is_given_up |= !is_awaited && !has_report;
        }
    }

    /// A message arrived at the simulator.
    fn receive(&self, state: &mut ModelState, number: usize, message: Up) {
        let name = state.process(number).name.clone();
        match message {
            Up::Join => {
                let mut answer = None;
                self.feed_barrier(state, |barrier, out| {
                    answer = Some(barrier.join(&name, &number.to_string(), out));
                });

                let process = state.process(number);
                if let Some(answer) = answer
                    && process.is_connected
                    && process.is_alive
                {
                    process.down.push_back(Down::Answer(answer));
                }
            }
            Up::Token(is_declared) => self.show(state, number, is_declared),
            Up::Command(stamp, count, command) => self.feed_barrier(state, |barrier, out| {
                barrier.command(&name, stamp, count, command, out);
            }),
            Up::Report(stamp, count, report) => self.feed_barrier(state, |barrier, out| {
                barrier.report(&name, stamp, count, report, out);
            }),
        }
    }

    /// A token is declared or undeclared at the router. Tokens of one name are one to the simulator.
    fn show(&self, state: &mut ModelState, number: usize, is_declared: bool) {
        let name = state.process(number).name.clone();
        let was_known = Self::is_known(state, &name);
        let process = state.process(number);
        process.is_known = is_declared;
        process.is_unnoticed &= !is_declared;
        let is_known = Self::is_known(state, &name);

        if was_known != is_known {
            if is_known {
                state.reserved.remove(&name);
            }
            self.feed_barrier(state, |barrier, out| barrier.token(&name, is_known, out));
        }
    }

    fn is_known(state: &ModelState, name: &RobotName) -> bool {
        let mut processes = state.processes.iter().flatten();

        processes.any(|process| process.name == *name && process.is_known)
    }

    fn start(&self, state: &mut ModelState, name: RobotName) {
        let around = Around {
            simulation: &state.simulation,
            is_slow: self.is_slow,
            mutant: self.mutant,
        };
        let (process, violation) = ModelProcess::start(name, around);

        state.processes.push(Some(process));
        state.note(violation);
    }

    fn steps_of(
        &self,
        state: &ModelState,
        number: usize,
        process: &ModelProcess,
        steps: &mut Vec<ModelStep>,
    ) {
        let left = &state.left;

        if let Some(message) = process.up.front() {
            steps.push(ModelStep::Deliver(number, Way::Up));
            let is_token = matches!(message, Up::Token(_));
            if left.losses > 0 && !is_token {
                steps.push(ModelStep::Lose(number, Way::Up));
            }
            if left.duplicates > 0 && !is_token && *message != Up::Join {
                steps.push(ModelStep::Duplicate(number, Way::Up));
            }
        }

        if !process.is_alive {
            return;
        }

        if process.is_connected && self.may_strike(&process.name) {
            if left.cuts > 0 {
                steps.push(ModelStep::Cut(number));
            }
            if left.blips > 0 && !(process.up.is_empty() && process.down.is_empty()) {
                steps.push(ModelStep::Blip(number));
            }
        }
        if left.strays > 0 && process.is_connected {
            steps.push(ModelStep::Stray(number));
        }
        if process.is_unnoticed {
            steps.push(ModelStep::Notice(number));
        }

        if process.is_stopped {
            if left.lapses > 0 && process.is_connected {
                steps.push(ModelStep::Lapse(number));
            }
            return;
        }

        if !process.is_connected {
            steps.push(ModelStep::Heal(number));
        }
        if let Some(message) = process.down.front() {
            steps.push(ModelStep::Deliver(number, Way::Down));
            if left.losses > 0 {
                steps.push(ModelStep::Lose(number, Way::Down));
            }
            if left.duplicates > 0 && !matches!(message, Down::Answer(_)) {
                steps.push(ModelStep::Duplicate(number, Way::Down));
            }
        }

        if process.running.is_some() {
            steps.push(ModelStep::Done(number));
        }
        if process.is_unanswered() {
            steps.push(ModelStep::Unanswered(number));
        }
        if process.asks_again && process.is_connected {
            steps.push(ModelStep::AskAgain(number));
        }
        if left.crashes > 0 && self.may_strike(&process.name) {
            steps.push(ModelStep::Crash(number));
        }
    }

    fn steps_of_simulator(&self, state: &ModelState, steps: &mut Vec<ModelStep>) {
        let left = &state.left;
        let may_fire = state.is_quiet() || left.early > 0;

        if state.barrier.is_open() && may_fire {
            steps.push(ModelStep::Fire(Timer::Repeat));
            if self.on_late != OnLate::Wait {
                steps.push(ModelStep::Fire(Timer::Deadline));
            }
        }
        if state.simulation.next.is_some() && may_fire {
            steps.push(ModelStep::RepeatBetween);
        }
        if may_fire {
            let timers = state.reserved.iter().cloned().map(Timer::Token);
            steps.extend(timers.map(ModelStep::Fire));
        }

        if left.inits > 0 {
            steps.push(ModelStep::Init);
        }

        let tick = state.simulation.next.unwrap_or(state.simulation.tick);
        for name in state.simulation.parts.keys() {
            let kin = state.kin(name);
            let may_start = match kin {
                Kin::None => true,
                Kin::CutOff => left.successors > 0 && self.may_strike(name),
                Kin::Connected => left.rivals > 0 && self.may_strike(name),
            };
            let is_stopped = self.has_fault(tick) && name.as_str() == "B";
            if may_start && !is_stopped {
                steps.push(ModelStep::Start(name.clone()));
            }
        }
    }

    fn take(&self, state: &mut ModelState, step: ModelStep) {
        match step {
            ModelStep::Deliver(number, Way::Up) => {
                if let Some(message) = state.process(number).up.pop_front() {
                    self.receive(state, number, message);
                }
            }
            ModelStep::Deliver(number, Way::Down) => {
                if let Some(message) = state.process(number).down.pop_front() {
                    self.feed(state, number, |process, around| {
                        process.receive(message, around)
                    });
                }
            }
            ModelStep::Lose(number, way) => {
                state.left.losses -= 1;
                let process = state.process(number);
                match way {
                    Way::Up => drop(process.up.pop_front()),
                    Way::Down => drop(process.down.pop_front()),
                }
            }
            ModelStep::Duplicate(number, way) => {
                state.left.duplicates -= 1;
                let process = state.process(number);
                match way {
                    Way::Up => process.up.push_back(process.up[0].clone()),
                    Way::Down => process.down.push_back(process.down[0].clone()),
                }
            }
            ModelStep::Done(number) => self.feed(state, number, ModelProcess::finish),
            ModelStep::AskAgain(number) => {
                state.process(number).asks_again = false;
                self.feed(state, number, |process, around| {
                    process.feed(around, |robot, out| {
                        robot.timer(RobotTimer::Join, out);
                    })
                });
            }
            ModelStep::Unanswered(number) => {
                state.process(number).is_asking = false;
                self.feed(state, number, |process, around| {
                    process.feed(around, MaybeWrongRobot::unanswered)
                });
            }
            ModelStep::Cut(number) => {
                state.left.cuts -= 1;
                let process = state.process(number);
                process.clear_link();
                process.is_connected = false;
                self.show(state, number, false);
            }
            ModelStep::Blip(number) => {
                state.left.blips -= 1;
                let process = state.process(number);
                process.clear_link();
                process.heal();
            }
            ModelStep::Lapse(number) => {
                state.left.lapses -= 1;
                let process = state.process(number);
                process.clear_link();
                process.is_connected = false;
                process.is_unnoticed = process.is_known;
            }
            ModelStep::Notice(number) => {
                state.process(number).is_unnoticed = false;
                self.show(state, number, false);
            }
            ModelStep::Heal(number) => state.process(number).heal(),
            ModelStep::Stray(number) => {
                state.left.strays -= 1;
                let clock = Clock {
                    epoch: state.simulation.epoch + 1,
                    ..Clock::default()
                };
                state.process(number).down.push_back(Down::Clock(clock));
            }
            ModelStep::Crash(number) => {
                state.left.crashes -= 1;
                state.process(number).end();
            }
            step => self.take_at_simulator(state, step),
        }

        for process in &mut state.processes {
            if process.as_ref().is_some_and(ModelProcess::is_gone) {
                *process = None;
            }
        }
        if state.has_twins() {
            state.note(Some(Violation::SameIncarnation));
        }
    }

    fn take_at_simulator(&self, state: &mut ModelState, step: ModelStep) {
        match step {
            ModelStep::Start(name) => {
                match state.kin(&name) {
                    Kin::None => {}
                    Kin::CutOff => state.left.successors -= 1,
                    Kin::Connected => state.left.rivals -= 1,
                }

                self.start(state, name);
            }
            ModelStep::Fire(timer) => {
                if !state.is_quiet() {
                    state.left.early -= 1;
                }
                if let Timer::Token(name) = &timer {
                    state.reserved.remove(name);
                }
                state.simulation.is_late |= timer == Timer::Deadline;

                self.feed_barrier(state, |barrier, out| barrier.timer(&timer, out));
            }
            ModelStep::RepeatBetween => {
                if !state.is_quiet() {
                    state.left.early -= 1;
                }
                self.feed_barrier(state, Simulator::repeat);
            }
            ModelStep::Init => {
                state.left.inits -= 1;
                state.simulation.begin_epoch();
                let epoch: Epoch = state.simulation.epoch;
                for process in state.processes.iter_mut().flatten() {
                    process.is_stopped = false;
                }

                self.feed_barrier(state, |barrier, out| {
                    barrier.gather(epoch, self.lateness(), out);
                });
            }
            _ => unreachable!("{step:?} is a step of a process"),
        }
    }
}

impl Model for Star {
    type State = ModelState;
    type Action = ModelStep;

    fn init_states(&self) -> Vec<ModelState> {
        let roster = [super::name("A"), super::name("B")];
        let mut state = ModelState {
            barrier: Simulator::new(roster.clone(), self.lateness(), self.mutant),
            simulation: ModelSimulation::new(&roster),
            processes: Vec::new(),
            reserved: BTreeSet::new(),
            left: self.budget,
            violation: None,
        };

        self.feed_barrier(&mut state, |barrier, out| {
            barrier.gather(1, self.lateness(), out);
        });
        for name in roster {
            self.start(&mut state, name);
        }
        let mut steps = Vec::new();
        while self.is_gathered && !state.barrier.is_open() {
            self.actions(&state, &mut steps);
            let delivery = steps
                .drain(..)
                .find(|step| matches!(step, ModelStep::Deliver(..)));
            let Some(delivery) = delivery else { break };
            self.take(&mut state, delivery);
        }
        vec![state]
    }

    fn actions(&self, state: &ModelState, steps: &mut Vec<ModelStep>) {
        if state.simulation.is_over || state.violation.is_some() {
            return;
        }
        for (number, process) in state.processes.iter().enumerate() {
            if let Some(process) = process {
                self.steps_of(state, number, process, steps);
            }
        }
        self.steps_of_simulator(state, steps);
    }

    fn next_state(&self, state: &ModelState, step: ModelStep) -> Option<ModelState> {
        let mut next = state.clone();
        self.take(&mut next, step);

        (next != *state).then_some(next)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always(SAFE, |_, state: &ModelState| state.violation.is_none()),
            Property::sometimes(ENDS, |_, state: &ModelState| state.simulation.is_over),
        ]
    }
}

/// Nothing happens that must never happen.
pub(super) const SAFE: &str = "safe";
/// The run can end.
pub(super) const ENDS: &str = "ends";
