//! Echo's partner, by hand and not by the SDK: it does on the wire what no correct robot does.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};

use bus::{Bus, Declared};
use protocol::keys::{Keys, STATE};
use protocol::messages::{
    Clock, Command, JoinAnswer, JoinRequest, Performative, Point, PublicState, Report, SentCommand,
    Welcome,
};
use protocol::{Epoch, PROTOCOL_VERSION, RobotName, RunName, Tick, decode, encode};

/// What becomes of a command on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    /// It is put, as it should be.
    Put,
    /// It is put twice, as after a repeated clock.
    PutTwice,
    /// It is put only when a clock has named it.
    PutLate,
    /// It is never put.
    Lost,
}

/// What Caller sends to Echo in which tick: many enough for the medium to do all that it can.
pub(super) fn script(tick: Tick) -> Vec<(String, Fate)> {
    match tick {
        0 => vec![],
        3 => vec![("late".to_owned(), Fate::PutLate)],
        6 => vec![
            ("never".to_owned(), Fate::Lost),
            ("after never".to_owned(), Fate::Put),
        ],
        9 => vec![("again".to_owned(), Fate::PutTwice)],
        tick if tick % 3 == 1 => vec![(format!("ping {tick}"), Fate::Put)],
        _ => vec![],
    }
}

type States = Arc<Mutex<BTreeMap<(Epoch, Tick), PublicState>>>;

pub(super) struct Caller {
    bus: Bus,
    keys: Keys,
    run: RunName,
    name: RobotName,
    target: RobotName,
    clocks: Receiver<Clock>,
    states: States,
    late: Vec<Command>,
    _declared: Vec<Declared>,
}

impl Caller {
    pub(super) fn new(bus: Bus, run: &RunName, name: &RobotName, target: &RobotName) -> Self {
        let (keys, states) = (Keys::new(run), States::default());
        let (sender, clocks) = channel();
        let heard = bus.subscribe(&keys.clock(), move |key, bytes| {
            let _ = sender.send(decode(key, "simulator", bytes).unwrap());
        });
        let shown = states.clone();
        let served = bus.queryable(&keys.query(name, STATE), move |query| {
            let number = |name: &str| {
                query
                    .parameter(name)
                    .and_then(|text| text.parse::<u64>().ok())
            };
            let (epoch, tick) = (number("epoch").unwrap() as Epoch, number("tick").unwrap());
            match shown.lock().unwrap().get(&(epoch, tick - 1)) {
                Some(state) => query.reply(query.key(), encode(state)),
                None => query.reply_err("that tick is over, or far away"),
            }
        });
        let declared = vec![heard.unwrap(), served.unwrap()];
        let (run, name, target) = (run.clone(), name.clone(), target.clone());
        Self {
            bus,
            keys,
            run,
            name,
            target,
            clocks,
            states,
            late: Vec::new(),
            _declared: declared,
        }
    }

    fn join(&self) -> Welcome {
        let request = JoinRequest {
            protocol: PROTOCOL_VERSION,
            run: self.run.clone(),
            name: self.name.clone(),
            instance: self.bus.id(),
            sdk: String::new(),
        };
        let answer = self
            .bus
            .get(&self.keys.join_as(&self.name), "", Some(encode(&request)))
            .unwrap()
            .expect("an answer");
        match decode("join", "simulator", &answer.result.unwrap()).unwrap() {
            JoinAnswer::Welcome(welcome) => *welcome,
            JoinAnswer::Refused { explanation, .. } => panic!("{explanation}"),
        }
    }

    /// Takes part until the run ends.
    pub(super) fn run(mut self) {
        let mut welcome = self.join();
        let _token = self.bus.token(&self.keys.alive_robot(&self.name)).unwrap();
        let (mut at, mut proposal, mut done, mut seq) =
            (welcome.location, welcome.location, None, 0);
        while let Ok(clock) = self.clocks.recv() {
            if clock.end.is_some() {
                break;
            }
            if done.is_some_and(|done| (clock.epoch, clock.tick) <= done) {
                continue;
            }
            if clock.epoch > welcome.epoch {
                welcome = self.join();
                (at, proposal, seq) = (welcome.location, welcome.location, 0);
            }
            if clock.tick > 0 {
                let news = clock.news.get(&self.name).cloned().unwrap_or_default();
                at = news
                    .correction
                    .map_or(proposal, |correction| correction.location);
            }
            proposal = walk(at, clock.tick);
            self.put_late(&clock);
            let sent = self.send(&clock, &mut seq);
            self.report(&clock, at, proposal, sent);
            done = Some((clock.epoch, clock.tick));
        }
        self.bus.close();
    }

    fn put(&self, command: &Command) {
        self.bus
            .put(
                &self.keys.command(&self.target, &self.name),
                encode(command),
            )
            .unwrap();
    }

    /// Commands that a clock names now and that were held back.
    fn put_late(&mut self, clock: &Clock) {
        let named = clock
            .news
            .get(&self.target)
            .map(|news| news.commands.clone())
            .unwrap_or_default();
        let is_named = |command: &Command| named.iter().any(|id| id.seq == command.seq);
        let (due, later) = std::mem::take(&mut self.late)
            .into_iter()
            .partition(is_named);
        self.late = later;
        let due: Vec<Command> = due;
        due.iter().for_each(|command| self.put(command));
    }

    fn send(&mut self, clock: &Clock, seq: &mut u64) -> Vec<SentCommand> {
        let (epoch, tick, performative) = (clock.epoch, clock.tick, Performative::Achieve);
        let mut sent = Vec::new();
        for (text, fate) in script(tick) {
            *seq += 1;
            let command = Command {
                epoch,
                tick,
                seq: *seq,
                performative,
                command: text.clone(),
            };
            match fate {
                Fate::Put => self.put(&command),
                Fate::PutTwice => [&command, &command]
                    .into_iter()
                    .for_each(|command| self.put(command)),
                Fate::PutLate => self.late.push(command),
                Fate::Lost => {}
            }
            sent.push(SentCommand {
                to: self.target.clone(),
                seq: *seq,
                performative,
                command: text,
            });
        }
        sent
    }

    fn report(&self, clock: &Clock, location: Point, proposal: Point, sent: Vec<SentCommand>) {
        let (epoch, tick) = (clock.epoch, clock.tick);
        let behavior_state = if tick % 8 < 4 { "CALL" } else { "REST" }.to_owned();
        let (speed_mps, direction_rad, emotion_state) = (0.0, 0.0, "CALM".to_owned());
        let state = PublicState {
            epoch,
            tick,
            location,
            speed_mps,
            direction_rad,
            state_variables: [].into(),
            emotion_state: emotion_state.clone(),
            behavior_state: behavior_state.clone(),
        };
        // Always put, so that whoever listens in has all of them.
        self.bus
            .put(&self.keys.query(&self.name, STATE), encode(&state))
            .unwrap();
        self.states.lock().unwrap().insert((epoch, tick), state);
        let report = Report {
            epoch,
            tick,
            generation: 1,
            proposal,
            speed_mps,
            direction_rad,
            emotion_state,
            behavior_state,
            state_variables: [].into(),
            sent,
            missing: vec![],
            log: vec![],
        };
        self.bus
            .put(&self.keys.report(&self.name), encode(&report))
            .unwrap();
    }
}

/// To and fro, so that it is sensed at times.
fn walk(at: Point, tick: Tick) -> Point {
    Point::new(at.x + if tick % 8 < 4 { 0.1 } else { -0.1 }, at.y)
}
