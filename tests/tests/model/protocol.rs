//! The protocol as a transition system: what may happen in a state.

use stateright::{Model, Property};

use crate::machine::{
    A, B, Budget, Clock, Fault, Member, NAMES, Name, Process, Rule, Simulator, State, Up,
};
use crate::robot::Seen;

/// What is checked: the protocol within bounds, perhaps with one rule broken.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Protocol {
    /// The run is over after this tick.
    pub(crate) last_tick: u8,
    pub(crate) budget: Budget,
    pub(crate) broken: Option<Rule>,
}

/// A direction of a process's links.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// To the simulator.
    Up,
    /// From it.
    Down,
    /// Commands to B.
    Out,
}

/// What can happen. A process is meant by its number in the order in which they were started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Action {
    Deliver(usize, Way),
    Lose(usize, Way),
    Duplicate(usize, Way),
    /// The simulator repeats the clock.
    Repeat,
    /// The deadline of the tick is over, and the scenario says `continue`.
    GoOnWithoutLate,
    /// A robot that waits for a command has waited long enough.
    GiveUpWaiting(usize),
    Crash(usize),
    /// The link of a process breaks; it lives on.
    Cut(usize),
    Heal(usize),
    /// A process of this robot is started and joins.
    Start(Name),
    /// A new epoch.
    Init,
}

impl Protocol {
    pub(crate) fn keeps(&self, rule: Rule) -> bool {
        self.broken != Some(rule)
    }

    fn is_quiet(state: &State) -> bool {
        let is_empty = |p: &Process| p.up.is_empty() && p.down.is_empty() && p.out.is_empty();
        state.processes.iter().all(is_empty)
    }

    fn deliver(&self, state: &mut State, number: usize, way: Way) {
        let recorded = state.recorded();
        let process = &mut state.processes[number];
        match way {
            Way::Up => {
                let name = process.name;
                match process.up.remove(0) {
                    Up::Report(report) => state.on_report(name, report, self),
                    Up::Token(is_there) => self.show(state, number, is_there),
                }
                state.settle(self);
            }
            Way::Down => {
                let clock = process.down.remove(0);
                let simulator = &state.simulator;
                let member = &simulator.members[process.name];
                let welcome =
                    (member.instance == number + 1).then_some((simulator.epoch, member.generation));
                note(state, number, |process| {
                    process.on_clock(clock, welcome, self, recorded)
                });
            }
            Way::Out => {
                let command = process.out.remove(0);
                for to in 0..state.processes.len() {
                    let process = &state.processes[to];
                    if process.name == B && process.is_alive && process.is_connected {
                        note(state, to, |process| {
                            process.on_command(command, self, state_of(&recorded))
                        });
                    }
                }
            }
        }
    }

    /// A token came or went at the router. Tokens of one name are one to whoever watches.
    fn show(&self, state: &mut State, number: usize, is_there: bool) {
        let name = state.processes[number].name;
        let is_known = |state: &State| state.processes.iter().any(|p| p.name == name && p.is_shown);
        let was_known = is_known(state);
        state.processes[number].is_shown = is_there;
        if is_known(state) != was_known {
            state.on_token(name, is_there, self);
        }
    }

    fn lose(state: &mut State, number: usize, way: Way) {
        state.left.losses -= 1;
        let process = &mut state.processes[number];
        match way {
            Way::Up => drop(process.up.remove(0)),
            Way::Down => drop(process.down.remove(0)),
            Way::Out => drop(process.out.remove(0)),
        }
    }

    fn duplicate(state: &mut State, number: usize, way: Way) {
        state.left.duplicates -= 1;
        let process = &mut state.processes[number];
        match way {
            Way::Up => process.up.push(process.up[0].clone()),
            Way::Down => process.down.push(process.down[0].clone()),
            Way::Out => process.out.push(process.out[0]),
        }
    }

    /// A process is gone: what it has sent still arrives, then its token goes.
    fn crash(state: &mut State, number: usize) {
        state.left.crashes -= 1;
        state.processes[number].end();
    }

    /// All that is on a link is lost, and the simulator sees the token go.
    fn cut(&self, state: &mut State, number: usize) {
        state.left.cuts -= 1;
        let process = &mut state.processes[number];
        process.is_connected = false;
        (process.up, process.down, process.out) = (Vec::new(), Vec::new(), Vec::new());
        self.show(state, number, false);
        state.settle(self);
    }

    fn heal(state: &mut State, number: usize) {
        let process = &mut state.processes[number];
        process.is_connected = true;
        process.up.push(Up::Token(true));
    }

    fn start(&self, state: &mut State, name: Name) {
        state.left.starts -= 1;
        let instance = state.processes.len() + 1;
        let last_seq = state.on_join(name, instance, self);
        let (member, epoch) = (&state.simulator.members[name], state.simulator.epoch);
        state
            .processes
            .push(Process::join(name, member, epoch, last_seq));
    }
}

/// A closure again, because each process is asked with its own.
fn state_of(recorded: &impl Fn(u8) -> Option<u8>) -> impl Fn(u8) -> Option<u8> + '_ {
    move |seq| recorded(seq)
}

fn note(state: &mut State, number: usize, act: impl FnOnce(&mut Process) -> Seen) {
    let seen = act(&mut state.processes[number]);
    state.fault = seen.fault.or(state.fault);
}

impl Model for Protocol {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let clock = Clock {
            epoch: 0,
            tick: 0,
            joined: [0, 0],
            named: None,
        };
        let simulator = Simulator {
            members: [Member::default(), Member::default()],
            epoch: 1,
            is_gathering: true,
            is_over: false,
            is_open: false,
            clock,
            reports: [None, None],
            underway: None,
            recorded: Default::default(),
        };
        let left = Budget {
            starts: self.budget.starts + 2,
            ..self.budget
        };
        let mut state = State {
            simulator,
            processes: Vec::new(),
            left,
            fault: None,
        };
        NAMES
            .into_iter()
            .for_each(|name| self.start(&mut state, name));
        vec![state]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        let left = &state.left;
        if state.simulator.is_over || state.fault.is_some() {
            return;
        }
        for (number, process) in state.processes.iter().enumerate() {
            // A token is not lost but with its link.
            let is_report = matches!(process.up.first(), Some(Up::Report(_)));
            let links = [
                (Way::Up, !process.up.is_empty(), is_report),
                (
                    Way::Down,
                    !process.down.is_empty(),
                    !process.down.is_empty(),
                ),
                (Way::Out, !process.out.is_empty(), !process.out.is_empty()),
            ];
            for (way, has_some, can_fail) in links {
                actions.extend(has_some.then_some(Action::Deliver(number, way)));
                actions.extend((can_fail && left.losses > 0).then_some(Action::Lose(number, way)));
                actions.extend(
                    (can_fail && left.duplicates > 0).then_some(Action::Duplicate(number, way)),
                );
            }
            if !process.is_alive {
                continue;
            }
            actions.extend((left.crashes > 0).then_some(Action::Crash(number)));
            actions.extend((process.is_connected && left.cuts > 0).then_some(Action::Cut(number)));
            actions.extend((!process.is_connected).then_some(Action::Heal(number)));
            // Its patience is that of several repetitions: nobody who still has the command was asked in vain.
            let is_with_sender = |p: &Process| {
                p.name == A
                    && p.is_alive
                    && p.sent
                        .iter()
                        .any(|c| Some(c.seq) == process.waits.as_ref().and_then(|w| w.named))
            };
            let is_hopeless =
                process.waits.is_some() && !state.processes.iter().any(is_with_sender);
            actions.extend(
                (is_hopeless && Self::is_quiet(state)).then_some(Action::GiveUpWaiting(number)),
            );
        }
        if state.is_held() {
            actions.extend((Self::is_quiet(state) || left.repeats > 0).then_some(Action::Repeat));
            actions.extend((left.lates > 0).then_some(Action::GoOnWithoutLate));
        }
        for name in NAMES {
            if left.starts > 0 && !state.is_taken(name) {
                actions.push(Action::Start(name));
            }
        }
        let can_init =
            !state.simulator.is_gathering && state.simulator.clock.tick > 0 && left.inits > 0;
        actions.extend(can_init.then_some(Action::Init));
    }

    fn next_state(&self, state: &State, action: Action) -> Option<State> {
        let mut next = state.clone();
        match action {
            Action::Deliver(number, way) => self.deliver(&mut next, number, way),
            Action::Lose(number, way) => Self::lose(&mut next, number, way),
            Action::Duplicate(number, way) => Self::duplicate(&mut next, number, way),
            Action::Repeat => {
                if !Self::is_quiet(state) {
                    next.left.repeats -= 1;
                }
                next.repeat_clock(self);
            }
            Action::GoOnWithoutLate => {
                next.left.lates -= 1;
                next.give_up_late();
                if self.keeps(Rule::LooksAfterAll) {
                    next.settle_late(self);
                }
            }
            Action::GiveUpWaiting(number) => {
                note(&mut next, number, |process| process.give_up_waiting(self));
            }
            Action::Crash(number) => Self::crash(&mut next, number),
            Action::Cut(number) => self.cut(&mut next, number),
            Action::Heal(number) => Self::heal(&mut next, number),
            Action::Start(name) => self.start(&mut next, name),
            Action::Init => {
                next.left.inits -= 1;
                next.init();
                next.settle(self);
            }
        }
        (next != *state).then_some(next)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always("the clock never waits for nobody", |_, state: &State| {
                !state.waits_for_nobody()
            }),
            Property::always("a tick has a verdict on every robot", |_, state: &State| {
                state.fault != Some(Fault::NoVerdict)
            }),
            Property::always("no command is delivered twice", |_, state: &State| {
                state.fault != Some(Fault::DeliveredTwice)
            }),
            Property::always("nothing stale is counted", |_, state: &State| {
                state.fault != Some(Fault::StaleCounted)
            }),
            Property::always(
                "what is delivered is what was recorded",
                |_, state: &State| state.fault != Some(Fault::OtherCommand),
            ),
            Property::sometimes("the run ends", |_, state: &State| state.simulator.is_over),
        ]
    }
}
