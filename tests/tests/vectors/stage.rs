//! A run of the real state machines: the simulator's [`Barrier`] and [`Simulation`], and a [`Process`] for each robot. Every
//! message goes from one to the other by a function call, in its encoded form, and the transcript gets what one robot
//! receives and puts.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use environment::Simulation;
use lockstep::{
    Admission, Barrier, BarrierOutput, Ignored, IncarnationNotice, Leave, ParticipantOutput, Sent,
    Stamp, StateQuery, TickAnswer, Timing, Turn,
};
use protocol::keys::{Keys, STATE};
use protocol::messages::{
    Clock, Command, CommandText, End, JoinAnswer, JoinRequest, MAX_ENTRIES, PublicState, Report,
    Target, TickUpdate,
};
use protocol::{Epoch, Message, RobotName, RunName, Tick, decode, encode};
use robot::Robot;
use scenario::Changes;
use scenario::Scenario;
use system_tests::root;

use crate::process::{Machine, MachineAction, Others, Process};
use crate::transcript::{Query, Transcript};

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn read<M: Message>(bytes: &[u8]) -> M {
    decode("a key", "a sender", bytes).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) struct Stage {
    run: RunName,
    keys: Keys,
    barrier: Barrier<Arc<Report>, CommandText>,
    outputs: Vec<BarrierOutput<Arc<Report>, CommandText>>,
    simulation: Simulation,
    clock: Clock,
    processes: BTreeMap<RobotName, Process>,
    /// The robot whose transcript is written.
    robot: RobotName,
    transcript: Transcript,
}

impl Stage {
    /// A run of a scenario of the project that no robot has joined. `robot` is the one whose transcript is written.
    pub(super) fn new(scenario: &str, set: &[&str], robot: &str) -> Self {
        let run = RunName::new("vectors").unwrap();
        let mut changes = Changes::default();
        for change in set {
            changes.set.push(change.parse().expect("a legal change"));
        }
        let loaded = Scenario::load(&root().join(Path::new(scenario)), &changes)
            .unwrap_or_else(|error| panic!("{error}"));
        let barrier = Barrier::new(
            loaded.robots.keys().cloned(),
            loaded.lateness.to_lockstep(),
            Timing::default(),
            MAX_ENTRIES as u32,
        );

        let mut stage = Self {
            keys: Keys::new(&run),
            run,
            barrier,
            outputs: Vec::new(),
            simulation: Simulation::new(loaded, 1).unwrap(),
            clock: Clock::default(),
            processes: BTreeMap::new(),
            robot: name(robot),
            transcript: Transcript::new(robot, scenario),
        };
        stage.gather();
        stage
    }

    /// Starts a robot's process. When all robots of the roster are connected, tick 0 follows.
    pub(super) fn start(&mut self, robot: &str, instance: &str, make: fn() -> Box<dyn Robot>) {
        let name = name(robot);
        let mut actions = Vec::new();
        let process = Process::new(&self.run, &name, instance, make(), &mut actions);
        self.processes.insert(name.clone(), process);

        self.carry_out_all(&name, actions);
        self.settle();
    }

    /// Kills the process of the robot whose transcript is written.
    pub(super) fn kill(&mut self) {
        self.processes.remove(&self.robot);
        self.barrier.token(&self.robot, false, &mut self.outputs);
        self.settle();
    }

    /// Steps to this tick.
    pub(super) fn step_to(&mut self, last: Tick) {
        while self.simulation.tick() < last {
            let tick = self.simulation.begin_tick();
            self.open(tick);
            self.settle();
            assert!(!self.barrier.is_open(), "every robot has reported {tick}");
        }
    }

    /// Begins the next epoch with another seed.
    pub(super) fn init(&mut self, seed: u64) {
        let epoch: Epoch = self.simulation.epoch() + 1;
        let scenario = Scenario {
            seed,
            ..self.simulation.scenario().clone()
        };
        self.simulation = Simulation::new(scenario, epoch).unwrap();
        for (name, process) in &self.processes {
            self.simulation.list_bodies(name, process.request.bodies);
        }

        self.gather();
        self.settle();
    }

    /// Sends a command to the robot as an operator does.
    pub(super) fn command_as_operator(&mut self, command: &str) {
        self.simulation.command(Sent {
            to: Target::Robot(self.robot.clone()),
            command: CommandText::named(command),
        });
    }

    /// Puts the last clock again.
    pub(super) fn repeat_clock(&mut self) {
        self.put_clock(self.clock);
        self.settle();
    }

    /// Queries the robot.
    pub(super) fn ask(&mut self, what: &str, parameters: &str) {
        let participant = &self.processes[&self.robot].participant;
        let query = StateQuery::read(|name| parameter(parameters, name));
        let state =
            query.and_then(|query| participant.query(query).map_err(|none| none.to_string()));
        let reply = state.map(|state| match what {
            STATE => encode(state.as_ref()),
            _ => encode(&state.answer(what).expect("one of the six queries")),
        });

        self.transcript.asked(&Query {
            key: &self.keys.query(&self.robot, what),
            parameters,
            message: None,
            reply: &reply,
        });
    }

    /// Stops the run, and returns the transcript.
    pub(super) fn end(mut self) -> String {
        let clock = self.barrier.end(End::Stopped);
        self.put_clock(clock);

        self.transcript.text()
    }
}

/// A parameter of a query such as `tick=29;epoch=1`.
fn parameter<'a>(parameters: &'a str, name: &str) -> Option<&'a str> {
    let mut pairs = parameters
        .split(';')
        .filter_map(|pair| pair.split_once('='));
    let found = pairs.find(|(key, _)| *key == name)?;

    Some(found.1)
}

/// The simulator.
impl Stage {
    fn gather(&mut self) {
        let lateness = self.simulation.scenario().lateness.to_lockstep();
        self.barrier
            .gather(self.simulation.epoch(), lateness, &mut self.outputs);
    }

    fn open(&mut self, tick: Tick) {
        let news = self.simulation.robots_with_news();
        self.barrier.open(tick, news, &mut self.outputs);
    }

    /// Carries out what the barrier wants done.
    fn settle(&mut self) {
        while !self.outputs.is_empty() {
            for output in std::mem::take(&mut self.outputs) {
                self.carry_out_output(output);
            }
        }
    }

    fn carry_out_output(&mut self, output: BarrierOutput<Arc<Report>, CommandText>) {
        match output {
            BarrierOutput::Gathered => {
                self.simulation.begin_init();
                self.open(0);
            }
            BarrierOutput::Grant { news, clock } => {
                for (name, notice) in news {
                    self.put_news(&name, notice);
                }
                self.put_clock(clock);
            }
            BarrierOutput::Complete(outcome) => {
                self.simulation.end_tick(outcome);
            }
            // The robot repeats its report after a repeated clock.
            BarrierOutput::Ignored(Ignored::Stale, _) => {}
            // Every robot reports at once, so no timer fires.
            BarrierOutput::SetTimer(..) => {}
            other => unreachable!("{other:?}"),
        }
    }

    fn put_news(&mut self, name: &RobotName, notice: IncarnationNotice) {
        let bytes = encode(&self.simulation.news(name, notice));
        if *name == self.robot {
            self.transcript.received(&self.keys.news(name), &bytes);
        }

        let news: TickUpdate = read(&bytes);
        self.feed(name, |participant, actions| {
            participant.news(
                news.epoch,
                news.tick,
                IncarnationNotice::from(&news),
                news,
                actions,
            );
        });
    }

    fn put_clock(&mut self, clock: Clock) {
        self.clock = clock;
        self.transcript
            .received(&self.keys.clock(), &encode(&clock));

        let names: Vec<RobotName> = self.processes.keys().cloned().collect();
        for name in names {
            self.feed(&name, |participant, actions| {
                participant.clock(clock, actions);
            });
        }
    }

    /// Answers a request to join.
    fn admit(&mut self, request: &JoinRequest) -> JoinAnswer {
        let name = &request.name;
        let admission = self
            .barrier
            .join(name, &request.instance, &mut self.outputs)
            .expect("the place is free");
        self.simulation.list_bodies(name, request.bodies);

        let welcome = self
            .simulation
            .welcome(&self.run, name, admission.generation, None)
            .expect("it is in the roster");
        JoinAnswer::Welcome(Box::new(welcome))
    }
}

/// The robots.
impl Stage {
    fn feed(&mut self, name: &RobotName, feed: impl FnOnce(&mut Machine, &mut Vec<MachineAction>)) {
        let process = self.processes.get_mut(name).expect("it has been started");
        let mut actions = Vec::new();
        feed(&mut process.participant, &mut actions);

        self.carry_out_all(name, actions);
    }

    fn carry_out_all(&mut self, name: &RobotName, actions: Vec<MachineAction>) {
        for action in actions {
            self.carry_out(name, action);
        }
    }

    fn carry_out(&mut self, name: &RobotName, action: MachineAction) {
        match action {
            ParticipantOutput::Join => self.join(name),
            ParticipantOutput::DeclareToken => {
                if *name == self.robot {
                    self.transcript.token(&self.keys.alive_robot(name));
                }
                self.barrier.token(name, true, &mut self.outputs);
            }
            ParticipantOutput::Run(turn) => self.run_tick(name, &turn),
            ParticipantOutput::Put(answer) => self.put(name, &answer),
            ParticipantOutput::SetTimer(..) => {}
            ParticipantOutput::Leave(leave) => assert_eq!(leave, Leave::End(End::Stopped)),
            ParticipantOutput::Query { .. }
            | ParticipantOutput::Unfollow(_)
            | ParticipantOutput::PutWaiting { .. } => {
                unreachable!("a robot is called with the other robots' states")
            }
        }
    }

    fn join(&mut self, name: &RobotName) {
        let request = encode(&self.processes[name].request);
        let answer = encode(&self.admit(&read(&request)));
        if *name == self.robot {
            self.transcript.asks(&Query {
                key: &self.keys.join_as(name),
                parameters: "",
                message: Some(&request),
                reply: &Ok(answer.clone()),
            });
        }

        let JoinAnswer::Welcome(welcome) = read(&answer) else {
            unreachable!("it has been admitted");
        };
        let admission = Admission::from(welcome.as_ref());
        let states = welcome.states_before();
        let process = self.processes.get_mut(name).expect("it has been started");
        process.welcome = Some(*welcome);
        self.feed(name, |participant, actions| {
            participant.admitted(admission, states, actions);
        });
    }

    fn run_tick(&mut self, name: &RobotName, turn: &Turn<TickUpdate>) {
        if *name == self.robot && turn.tick > 0 {
            self.write_queries(turn);
        }

        let mut process = self.processes.remove(name).expect("it has been started");
        let mut others = Others {
            processes: &self.processes,
            query: query_in(turn),
        };
        let done = process.run(turn, &mut others);
        self.processes.insert(name.clone(), process);
        let report = encode(done.report.as_ref());
        self.feed(name, |participant, actions| {
            participant.done(done.commands, done.state, report, actions);
        });
    }

    /// Writes all queries that the robot can make in a tick, and the replies.
    fn write_queries(&mut self, turn: &Turn<TickUpdate>) {
        for (name, other) in &self.processes {
            let can_be_queried = turn.news.as_ref().is_none_or(|news| news.can_query(name));
            if *name == self.robot || !can_be_queried {
                continue;
            }
            let state = other.participant.query(query_in(turn));
            let state = state.expect("it has reported the tick before");
            self.transcript.asks(&Query {
                key: &self.keys.query(name, STATE),
                parameters: &format!("tick={};epoch={}", turn.tick, turn.epoch),
                message: None,
                reply: &Ok(encode(state.as_ref())),
            });
        }
    }

    /// Puts what came of a tick: the commands, the state, the report.
    fn put(
        &mut self,
        name: &RobotName,
        answer: &TickAnswer<Arc<PublicState>, CommandText, Vec<u8>>,
    ) {
        for (to, command) in answer.commands_from(1) {
            let bytes = encode(&command);
            self.write_put(name, &self.keys.outbox(name), &bytes);
            let command: Command = read(&bytes);
            let stamp = Stamp::from(&command);
            let number = command.number;
            let sent = Sent::new(to.clone(), command);
            self.barrier
                .command(name, stamp, number, sent, &mut self.outputs);
        }

        let state = encode(answer.state.as_ref());
        self.write_put(name, &self.keys.query(name, STATE), &state);

        self.write_put(name, &self.keys.report(name), &answer.report);
        let report: Report = read(&answer.report);
        let stamp = Stamp::from(&report);
        let commands = report.commands;
        self.barrier
            .report(name, stamp, commands, Arc::new(report), &mut self.outputs);
    }

    fn write_put(&mut self, name: &RobotName, key: &str, message: &[u8]) {
        if *name == self.robot {
            self.transcript.put(key, message);
        }
    }
}

fn query_in(turn: &Turn<TickUpdate>) -> StateQuery {
    StateQuery {
        tick: Some(turn.tick),
        epoch: Some(turn.epoch),
    }
}
