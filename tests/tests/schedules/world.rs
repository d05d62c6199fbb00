//! One schedule: simulated time, everything that is going to happen, and what is demanded of all of it. One thread, one source
//! of chance: a seed gives the same schedule every time.

use std::collections::BTreeMap;
use std::sync::Arc;

use lockstep::{Leave, Sent, Timer};
use protocol::messages::{CommandText, End, OnLate, PublicState, Refusal, Report};
use protocol::{Epoch, RobotName, Tick};

use crate::chance::Chance;
use crate::hall::{Halls, TICKS};
use crate::plan::{Death, Family, MS, Micros, Plan, Point, S, What};
use crate::process::{Life, PATIENCE, Process};
use crate::simulator::Simulator;
use crate::star::{GetId, Link, Way};

/// Longest simulated time from one tick to the next, and until a robot is back, when nothing is broken any more: longer than
/// any timer that repairs something.
pub(crate) const BOUND: Micros = 12 * S;
/// Links are quiet from this time on, however far the run is.
const QUIET_AT: Micros = 300 * S;
/// The longest schedule, events.
const MAX_EVENTS: u64 = 5_000_000;

/// What is going to happen.
#[derive(Debug)]
pub(crate) enum Event {
    Start(RobotName),
    Arrive { link: usize, way: Way, session: u64 },
    NoticeAbove { link: usize, session: u64 },
    NoticeBelow { link: usize, session: u64 },
    Heal { link: usize, session: u64 },
    Expire { link: usize, session: u64 },
    Wake { process: usize },
    Computed { process: usize },
    GetTimeout { process: usize, get: GetId },
    Resume { process: usize },
    Timer(Timer),
    Grant,
    Blow(usize),
    Close,
}

/// What a process has made of a tick.
pub(crate) struct Made {
    pub(crate) report: Arc<Report>,
    pub(crate) commands: Vec<Sent<CommandText>>,
    /// An answer that it was given wrongly.
    pub(crate) wrong: Option<String>,
}

/// What is wrong with a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Failure {
    /// It does not go on.
    Stuck(String),
    /// Its record is not what it must be.
    Wrong(String),
}

/// What happened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) schedules: u64,
    pub(crate) ticks: u64,
    pub(crate) events: u64,
    pub(crate) cuts: u64,
    pub(crate) losses: u64,
    pub(crate) duplicates: u64,
    pub(crate) naps: u64,
    pub(crate) held_back: u64,
    pub(crate) crashes: u64,
    pub(crate) hangs: u64,
    pub(crate) stopped: u64,
    pub(crate) inits: u64,
    pub(crate) operator: u64,
    pub(crate) commands: u64,
    pub(crate) joined: u64,
    pub(crate) lost: u64,
    pub(crate) missed: u64,
    pub(crate) aborted: u64,
    /// Ticks 0 that a robot missed, or in which one was replaced.
    pub(crate) first_ticks: u64,
    /// Robots that joined and missed the same tick.
    pub(crate) joined_and_missed: u64,
    /// Forks of records that came to the end of the record.
    pub(crate) forks: u64,
}

impl Counts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.schedules += other.schedules;
        self.ticks += other.ticks;
        self.events += other.events;
        self.cuts += other.cuts;
        self.losses += other.losses;
        self.duplicates += other.duplicates;
        self.naps += other.naps;
        self.held_back += other.held_back;
        self.crashes += other.crashes;
        self.hangs += other.hangs;
        self.stopped += other.stopped;
        self.inits += other.inits;
        self.operator += other.operator;
        self.commands += other.commands;
        self.joined += other.joined;
        self.lost += other.lost;
        self.missed += other.missed;
        self.aborted += other.aborted;
        self.first_ticks += other.first_ticks;
        self.joined_and_missed += other.joined_and_missed;
        self.forks += other.forks;
    }
}

/// What a schedule came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Came {
    pub(crate) digest: String,
    /// A hash of everything that happened.
    pub(crate) trace: u64,
    pub(crate) counts: Counts,
    pub(crate) failure: Option<Failure>,
}

pub(crate) struct World {
    pub(crate) plan: Plan,
    pub(crate) halls: Arc<Halls>,
    pub(crate) now: Micros,
    events: BTreeMap<(Micros, u64), Event>,
    last_id: u64,
    pub(crate) chance: Chance,
    pub(crate) links: Vec<Link>,
    pub(crate) processes: Vec<Process>,
    pub(crate) simulator: Simulator,
    /// What each robot published, in the record.
    pub(crate) facts: BTreeMap<(Epoch, Tick, RobotName), Arc<PublicState>>,
    pub(crate) made: BTreeMap<(Epoch, Tick, RobotName), Vec<Made>>,
    pub(crate) counts: Counts,
    /// When the last fault is over.
    pub(crate) disturbed_until: Micros,
    /// Until when faults may hold the clock.
    held_until: Micros,
    pub(crate) progress_at: Micros,
    has_died: bool,
    trace: u64,
    pub(crate) failure: Option<Failure>,
}

impl World {
    /// Executes a schedule to its end.
    pub(crate) fn execute(plan: Plan, halls: &Arc<Halls>) -> Came {
        let scenario = &plan.scenario(halls, 1);
        let mut world = Self {
            simulator: Simulator::new(&plan, scenario),
            chance: Chance::new(plan.seed, "schedule"),
            halls: halls.clone(),
            now: 0,
            events: BTreeMap::new(),
            last_id: 0,
            links: Vec::new(),
            processes: Vec::new(),
            facts: BTreeMap::new(),
            made: BTreeMap::new(),
            counts: Counts::default(),
            disturbed_until: 0,
            held_until: 0,
            progress_at: 0,
            has_died: false,
            trace: 0xcbf2_9ce4_8422_2325,
            failure: None,
            plan,
        };
        world.begin_epoch(1);
        for name in scenario.roster() {
            let after = world.chance.below(5 * MS);
            world.schedule(after, Event::Start(name));
        }
        world.schedule_blows(None);

        while world.failure.is_none() {
            let Some((at, event)) = world.events.pop_first() else {
                break;
            };
            world.now = at.0;
            world.counts.events += 1;
            world.note_trace(format!("{} {event:?}", world.now).as_bytes());
            world.happen(event);
            world.turn();
            world.check_liveness();
        }
        world.judge();
        world.check_again();
        world.came()
    }

    fn came(mut self) -> Came {
        self.counts.schedules = 1;
        self.counts.ticks = self.simulator.simulation.tick();

        Came {
            digest: self.simulator.simulation.digest(),
            trace: self.trace,
            counts: self.counts,
            failure: self.failure,
        }
    }

    pub(crate) fn next_id(&mut self) -> u64 {
        self.last_id += 1;
        self.last_id
    }

    pub(crate) fn schedule(&mut self, after: Micros, event: Event) {
        let id = self.next_id();
        self.events.insert((self.now + after, id), event);
    }

    /// FNV-1a over everything that happens.
    pub(crate) fn note_trace(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.trace = (self.trace ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// A fault lasts for so long from now on.
    pub(crate) fn disturb(&mut self, lasts: Micros) {
        self.disturbed_until = self.disturbed_until.max(self.now + lasts);
        self.held_until = self.held_until.max(self.now + lasts);
    }

    /// Whether single messages are lost, and so on.
    pub(crate) fn is_noisy(&self) -> bool {
        let simulation = &self.simulator.simulation;
        let is_last = simulation.epoch() >= self.plan.last_epoch();

        self.now < QUIET_AT && !(is_last && simulation.tick() >= self.plan.links.noisy_until)
    }

    pub(crate) fn fail_wrong(&mut self, reason: String) {
        self.failure.get_or_insert(Failure::Wrong(reason));
    }

    pub(crate) fn fail_stuck(&mut self, reason: String) {
        self.failure.get_or_insert(Failure::Stuck(reason));
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Start(name) => self.start(name),
            Event::Arrive { link, way, session } => self.arrive(link, way, session),
            Event::NoticeAbove { link, session } if self.links[link].session == session => {
                self.close_above(link);
            }
            Event::NoticeBelow { link, session } if self.links[link].session == session => {
                self.close_below(link);
            }
            Event::Heal { link, session } => self.open_session(link, session),
            Event::Expire { link, session } => self.expire(link, session),
            Event::Wake { process } => self.advance(process),
            Event::Computed { process } => self.computed(process),
            Event::GetTimeout { process, get } => self.time_out(process, get),
            Event::Resume { process } => self.resume(process),
            Event::Timer(timer) => self.on_timer(&timer),
            Event::Blow(index) => self.strike(index),
            Event::Close => self.close(),
            Event::NoticeAbove { .. } | Event::NoticeBelow { .. } | Event::Grant => {}
        }
    }

    /// A process starts.
    fn start(&mut self, name: RobotName) {
        let class = self.simulator.simulation.scenario().robots[&name]
            .class
            .clone();
        let index = self.processes.len();
        self.links.push(Link::new(name.clone()));
        self.processes.push(Process::new(name, &class));
        self.begin(index);
        self.open_session(index, 0);
        self.advance(index);
    }

    fn schedule_blows(&mut self, at: Option<(Epoch, Tick)>) {
        for index in 0..self.plan.blows.len() {
            if self.plan.blows[index].at == at {
                self.schedule(self.plan.blows[index].after, Event::Blow(index));
            }
        }
    }

    /// A tick has been opened.
    pub(crate) fn on_opened(&mut self, tick: Tick) {
        let epoch = self.simulator.simulation.epoch();
        self.schedule_blows(Some((epoch, tick)));
    }

    fn strike(&mut self, index: usize) {
        match self.plan.blows[index].what.clone() {
            What::Cut(robot, lasts) => {
                if let Some(link) = self.find(&robot) {
                    self.cut(link, lasts);
                }
            }
            What::Crash {
                robot,
                is_abrupt,
                back_after,
            } => {
                if let Some(process) = self.find(&robot) {
                    self.kill(process, is_abrupt, back_after);
                }
            }
            What::Hang {
                robot,
                lasts,
                has_successor,
            } => {
                if let Some(process) = self.find(&robot) {
                    self.hang(process, lasts);
                    if has_successor {
                        let after = self.chance.below(lasts + 1);
                        self.schedule(after, Event::Start(robot));
                    }
                }
            }
            What::Init => self.init(),
            What::Late(lateness) => self.set_lateness(*lateness),
            What::Command(to, text) => self.on_operator(to, text),
        }
    }

    /// The process of a robot that has been alive for the longest time.
    fn find(&self, robot: &RobotName) -> Option<usize> {
        (0..self.processes.len()).find(|process| self.is_alive(*process, robot))
    }

    pub(crate) fn is_alive(&self, process: usize, robot: &RobotName) -> bool {
        self.processes[process].life == Life::Alive && self.processes[process].name == *robot
    }

    fn kill(&mut self, process: usize, is_abrupt: bool, back_after: Micros) {
        self.counts.crashes += 1;
        self.disturb(back_after);
        self.stop_for_good(process, is_abrupt);
        let name = self.processes[process].name.clone();
        self.schedule(back_after, Event::Start(name));
    }

    fn hang(&mut self, process: usize, lasts: Micros) {
        self.counts.hangs += 1;
        let name = self.processes[process].name.clone();
        let holds_for = if self.goes_on_without(&name) {
            lasts.min(self.simulator.barrier.lateness().deadline.as_micros() as Micros)
        } else {
            lasts
        };
        self.held_until = self.held_until.max(self.now + holds_for);
        self.disturbed_until = self.disturbed_until.max(self.now + lasts);
        self.stop(process);
        self.schedule(lasts, Event::Resume { process });
    }

    /// Whether ticks follow also while this robot is stopped.
    fn goes_on_without(&self, robot: &RobotName) -> bool {
        let has_change = self
            .plan
            .blows
            .iter()
            .any(|blow| matches!(blow.what, What::Init | What::Late(_)));
        let is_under_way = !self.simulator.is_gathering;

        is_under_way
            && !has_change
            && self.simulator.barrier.lateness().of(robot) == OnLate::Continue
    }

    fn stop(&mut self, process: usize) {
        self.processes[process].life = Life::Hung;
        let session = self.links[process].session;
        self.schedule(
            self.plan.lease,
            Event::Expire {
                link: process,
                session,
            },
        );
    }

    /// The scenario stops the process of a robot, or lets it go on.
    pub(crate) fn stop_robot(&mut self, robot: &RobotName, begins: bool) {
        let of_robot = |process: &Process| process.name == *robot;
        let Some(process) = self.processes.iter().position(of_robot) else {
            return;
        };
        if begins {
            self.counts.stopped += 1;
            self.stop(process);
        } else {
            self.resume(process);
        }
    }

    /// Whether a process dies here, as planned.
    pub(crate) fn dies(&mut self, process: usize, epoch: Epoch, tick: Tick, point: Point) -> bool {
        let here = Death {
            robot: self.processes[process].name.clone(),
            epoch,
            tick,
            point,
        };
        if self.has_died || self.plan.death.as_ref() != Some(&here) {
            return false;
        }

        self.has_died = true;
        let is_abrupt = self.chance.happens(0.5);
        let back_after = self.chance.magnitude(100, 5 * S);
        self.kill(process, is_abrupt, back_after);
        true
    }

    /// When the last fault is over, ticks follow, and at the end every process leaves.
    fn check_liveness(&mut self) {
        if self.counts.events > MAX_EVENTS {
            self.fail_stuck("it goes on for ever".to_owned());
        }
        let quiet = self
            .now
            .saturating_sub(self.held_until.max(self.progress_at));
        if self.simulator.ended.is_none() && quiet > BOUND {
            let awaited = self.simulator.barrier.awaited();
            let tick = self.simulator.simulation.tick();
            self.fail_stuck(format!(
                "no tick after {tick} within {} ms: {awaited:?}",
                quiet / MS
            ));
        }
    }

    /// What is demanded of a schedule at its end.
    fn judge(&mut self) {
        if self.failure.is_some() {
            return;
        }
        let Some((end, ended_at)) = self.simulator.ended else {
            return self.fail_stuck("nothing happens any more".to_owned());
        };
        let tick = self.simulator.simulation.tick();
        match end {
            End::Finished if tick == TICKS => {}
            End::Aborted if self.plan.family == Family::Late => self.counts.aborted += 1,
            _ => self.fail_wrong(format!("it is {end:?} after tick {tick}")),
        }
        if end == End::Finished {
            self.judge_digest();
            self.judge_death();
        }
        for process in 0..self.processes.len() {
            self.judge_process(process, end, ended_at);
        }
    }

    fn judge_digest(&mut self) {
        let epoch = self.simulator.simulation.epoch();
        let is_plain = self.simulator.has_reference()
            && self.simulator.joined.is_empty()
            && !self.simulator.had_commands;
        let digest = self.simulator.simulation.digest();
        let expected = self.halls.digest(self.plan.hall, epoch).to_owned();
        if is_plain && digest != expected {
            self.fail_wrong(format!("digest {digest} instead of {expected}"));
        }
        if self.plan.family == Family::Links && !self.simulator.joined.is_empty() {
            self.fail_wrong(format!("processes joined: {:?}", self.simulator.joined));
        }
    }

    /// A process that dies before its report counts is replaced in the same tick, later in the next one.
    fn judge_death(&mut self) {
        let Some(death) = self.plan.death.clone() else {
            return;
        };
        let joins_in = death.tick + Tick::from(death.point == Point::Counted);
        let mut joined = Vec::new();
        for (_, tick, robot, _) in &self.simulator.joined {
            joined.push((*tick, robot.clone()));
        }
        let expected = if joins_in > TICKS {
            Vec::new()
        } else {
            vec![(joins_in, death.robot.clone())]
        };

        if !self.has_died || joined != expected {
            self.fail_wrong(format!("{death:?}, and {joined:?} joined"));
        }
    }

    /// Every process leaves, for a reason that it can have.
    fn judge_process(&mut self, process: usize, end: End, ended_at: Micros) {
        let own = &self.processes[process];
        let has_other = self
            .processes
            .iter()
            .enumerate()
            .any(|(index, other)| index != process && other.name == own.name);
        let was_quiet = ended_at > self.disturbed_until + BOUND;
        let reason = match &own.life {
            Life::Dead => return,
            Life::Left(reason) => reason,
            Life::Alive | Life::Hung => {
                return self.fail_stuck(format!("a process of {} does not leave", own.name));
            }
        };
        let is_right = match reason {
            Leave::End(known) => *known == end,
            Leave::Replaced | Leave::Refused(Refusal::NameTaken) => has_other,
            Leave::Refused(Refusal::Ended) | Leave::NoSimulator | Leave::SimulatorGone => {
                !was_quiet
            }
            Leave::Refused(_) | Leave::Stopped => false,
        };
        if !is_right {
            self.fail_wrong(format!(
                "a process of {} leaves: {reason:?} (patience {PATIENCE:?})",
                own.name
            ));
        }
    }
}
