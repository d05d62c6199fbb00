//! What is drawn before a schedule begins: how bad its links are, and what befalls its processes.

use std::time::Duration;

use lockstep::LatePolicy;
use protocol::messages::{FaultKind, OnLate};
use protocol::{Epoch, RobotName, Tick};
use scenario::{Fault, FaultEnd, Scenario};

use crate::chance::Chance;
use crate::hall::{Halls, TICKS};

/// Simulated time since the beginning of a schedule, microseconds.
pub(crate) type Micros = u64;

pub(crate) const MS: Micros = 1_000;
pub(crate) const S: Micros = 1_000_000;

/// What a schedule may contain, and so what is demanded of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Family {
    /// The clock waits, and processes live: the run is that of one process.
    Links,
    /// The clock waits, and one process dies at a known point: the run depends on that point only.
    Death,
    /// The clock waits, and processes die, hang and are replaced at any moment: the run depends on who joined when.
    Processes,
    /// The clock goes on without late robots, or ends the run.
    Late,
    /// The clock goes on, and the scenario stops one process: the run depends on the scenario only.
    Stopped,
}

/// How links behave.
#[derive(Debug, Clone)]
pub(crate) struct Links {
    /// Longest time that a message takes beside its size.
    pub(crate) latency: Micros,
    pub(crate) bytes_per_ms: u64,
    /// Bytes that a direction of a link holds; what does not fit waits in its sender.
    pub(crate) room: usize,
    /// Probabilities, per message.
    pub(crate) loss: f64,
    pub(crate) duplicates: f64,
    pub(crate) naps: f64,
    pub(crate) cuts: f64,
    pub(crate) longest_nap: Micros,
    pub(crate) longest_cut: Micros,
    /// The probabilities are 0 from this tick of the last epoch on.
    pub(crate) noisy_until: Tick,
}

/// Something that happens once.
#[derive(Debug, Clone)]
pub(crate) struct Blow {
    /// When this tick of this epoch is opened; `None` is the beginning.
    pub(crate) at: Option<(Epoch, Tick)>,
    pub(crate) after: Micros,
    pub(crate) what: What,
}

#[derive(Debug, Clone)]
pub(crate) enum What {
    /// The link of a robot is cut for so long.
    Cut(RobotName, Micros),
    /// A process dies, and the next one starts after so long.
    Crash {
        robot: RobotName,
        is_abrupt: bool,
        back_after: Micros,
    },
    /// A process stops for so long; another one may be started meanwhile.
    Hang {
        robot: RobotName,
        lasts: Micros,
        has_successor: bool,
    },
    /// The operator starts the next epoch.
    Init,
    /// The operator changes what the clock does about late robots.
    Late(Box<LatePolicy>),
    /// The operator commands a robot.
    Command(RobotName, String),
}

/// A point in a robot's tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Point {
    /// Before the robot runs.
    BeforeRun,
    /// The robot has run, and nothing is put.
    AfterRun,
    /// The commands are put.
    AfterCommands,
    /// The state is put, the report is not.
    AfterState,
    /// The report counts.
    Counted,
}

/// A process that dies at a known point of the run.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Death {
    pub(crate) robot: RobotName,
    pub(crate) epoch: Epoch,
    pub(crate) tick: Tick,
    pub(crate) point: Point,
}

/// The scenario stops the process of a robot.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Stop {
    pub(crate) robot: RobotName,
    /// First tick without it.
    pub(crate) from: Tick,
    /// First tick after that.
    pub(crate) until: Tick,
    /// After this many missed ticks it is lost.
    pub(crate) lose_after: u32,
}

/// A defect of the star or of the hosts' loop, to show that it would be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flaw {
    None,
    /// A host takes a clock of a later epoch for an `init` only if its tick is 0.
    InitAtTickZeroOnly,
    /// A message that is larger than a queue never fits, also if the queue is empty.
    QueueWithoutRoom,
    /// The state of a robot that cannot answer is not put on its behalf.
    NobodyStandsIn,
}

#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) seed: u64,
    pub(crate) hall: usize,
    pub(crate) family: Family,
    pub(crate) links: Links,
    /// Simulated pause between ticks.
    pub(crate) pace: Micros,
    /// Longest time that a robot takes to run a tick.
    pub(crate) compute: Micros,
    /// After this long without a sign of life the router closes a link.
    pub(crate) lease: Micros,
    pub(crate) lateness: LatePolicy,
    pub(crate) blows: Vec<Blow>,
    pub(crate) death: Option<Death>,
    pub(crate) stop: Option<Stop>,
    pub(crate) flaw: Flaw,
}

impl Plan {
    pub(crate) fn draw(seed: u64, halls: &Halls) -> Self {
        let mut chance = Chance::new(seed, "plan");
        let hall = chance.below(halls.count() as u64) as usize;
        let family = chance.one_of(&[
            Family::Links,
            Family::Death,
            Family::Processes,
            Family::Late,
            Family::Stopped,
        ]);
        let is_late = family == Family::Late;

        let mut plan = Self {
            seed,
            hall,
            family,
            links: draw_links(&mut chance),
            pace: if is_late {
                S
            } else {
                chance.one_of(&[0, 0, 100, 20 * MS])
            },
            compute: chance.one_of(&[0, 200, 5 * MS]),
            lease: chance.magnitude(S / 2, 10 * S),
            lateness: lateness(OnLate::Wait, 5 * S, 3),
            blows: Vec::new(),
            death: None,
            stop: None,
            flaw: Flaw::None,
        };
        let roster = halls.scenario(hall, 1).roster();
        if is_late {
            plan.lateness = draw_lateness(&mut chance, &roster);
        }
        if is_late && chance.happens(0.2) {
            plan.draw_silence(&mut chance, &roster);
            return plan;
        }
        if family == Family::Stopped {
            plan.draw_stop(&mut chance, &roster);
            return plan;
        }
        plan.draw_operator(&mut chance, &roster);
        plan.draw_cuts(&mut chance, &roster);
        match family {
            Family::Links | Family::Stopped => plan.draw_hangs(&mut chance, &roster, false),
            Family::Death => plan.draw_death(&mut chance, &roster),
            Family::Processes | Family::Late => {
                plan.draw_crashes(&mut chance, &roster);
                plan.draw_hangs(&mut chance, &roster, true);
            }
        }
        plan
    }

    /// The scenario of an epoch, with the fault that it has in store.
    pub(crate) fn scenario(&self, halls: &Halls, epoch: Epoch) -> Scenario {
        let mut scenario = halls.scenario(self.hall, epoch).clone();
        if let Some(stop) = &self.stop {
            scenario.lateness.on_late = OnLate::Continue;
            scenario.lateness.lose_after = stop.lose_after;
            scenario.faults.push(Fault {
                robot: stop.robot.clone(),
                kind: FaultKind::Hang,
                at: stop.from,
                end: FaultEnd::At(stop.until),
            });
        }
        scenario
    }

    /// The epoch that is the last one, if everything goes as planned.
    pub(crate) fn last_epoch(&self) -> Epoch {
        let inits = self
            .blows
            .iter()
            .filter(|blow| matches!(blow.what, What::Init));

        1 + inits.count() as Epoch
    }

    fn blow(&mut self, at: Option<(Epoch, Tick)>, after: Micros, what: What) {
        self.blows.push(Blow { at, after, what });
    }

    fn draw_operator(&mut self, chance: &mut Chance, roster: &[RobotName]) {
        // A death at a known point is one of a run that is otherwise the same.
        if self.family == Family::Death {
            return;
        }

        if chance.happens(0.3) {
            let tick = chance.below(TICKS);
            self.blow(Some((1, tick)), chance.magnitude(1, 10 * MS), What::Init);
            if chance.happens(0.6) {
                // Cut off where an epoch begins: before, during or after its tick 0.
                let robot = chance.one_of(roster);
                let at = chance.one_of(&[(1, tick), (2, 0), (2, 1)]);
                let lasts = chance.magnitude(MS, 8 * S);
                self.blow(
                    Some(at),
                    chance.magnitude(1, 10 * MS),
                    What::Cut(robot, lasts),
                );
            }
        }
        if chance.happens(0.3) {
            for _ in 0..=chance.below(3) {
                let at = (self.last_epoch(), chance.below(TICKS));
                let robot = chance.one_of(roster);
                let text = chance.one_of(&["REFILL", "HURRY", "GO HOME"]).to_owned();
                self.blow(
                    Some(at),
                    chance.magnitude(1, 10 * MS),
                    What::Command(robot, text),
                );
            }
        }
        if self.family == Family::Late && chance.happens(0.3) {
            let at = (1, chance.below(TICKS));
            let lateness = draw_lateness(chance, roster);
            self.blow(
                Some(at),
                chance.magnitude(1, 10 * MS),
                What::Late(Box::new(lateness)),
            );
        }
    }

    fn draw_cuts(&mut self, chance: &mut Chance, roster: &[RobotName]) {
        for _ in 0..chance.below(3) {
            let robot = chance.one_of(roster);
            let lasts = chance.magnitude(100, 15 * S);
            let at = self.draw_moment(chance);
            self.blow(at, chance.magnitude(1, 10 * MS), What::Cut(robot, lasts));
        }
    }

    fn draw_hangs(&mut self, chance: &mut Chance, roster: &[RobotName], may_be_replaced: bool) {
        for _ in 0..chance.below(3) {
            let robot = chance.one_of(roster);
            let at = self.draw_moment(chance);
            let what = What::Hang {
                robot,
                lasts: chance.magnitude(MS, 30 * S),
                has_successor: may_be_replaced && chance.happens(0.5),
            };
            self.blow(at, chance.magnitude(1, 10 * MS), what);
        }
    }

    /// A robot is stopped for long while others make their first queries. The clock waits for those, and not for it.
    fn draw_silence(&mut self, chance: &mut Chance, roster: &[RobotName]) {
        let robot = chance.one_of(roster);
        self.lateness.on_late = OnLate::Wait;
        self.lateness.own = [(robot.clone(), OnLate::Continue)].into();
        let what = What::Hang {
            robot,
            lasts: 60 * S,
            has_successor: false,
        };
        let at = (1, chance.below(4));
        self.blow(Some(at), chance.magnitude(1, 10 * MS), what);
    }

    fn draw_crashes(&mut self, chance: &mut Chance, roster: &[RobotName]) {
        for _ in 0..chance.below(4) {
            let robot = chance.one_of(roster);
            let at = self.draw_moment(chance);
            let what = What::Crash {
                robot,
                is_abrupt: chance.happens(0.5),
                back_after: chance.magnitude(100, 5 * S),
            };
            self.blow(at, chance.magnitude(1, 20 * MS), what);
        }
    }

    fn draw_death(&mut self, chance: &mut Chance, roster: &[RobotName]) {
        let points = [
            Point::BeforeRun,
            Point::AfterRun,
            Point::AfterCommands,
            Point::AfterState,
            Point::Counted,
        ];

        // Few ways to die, so that several schedules share each.
        self.death = Some(Death {
            robot: chance.one_of(roster),
            epoch: 1,
            tick: chance.one_of(&[0, 1, 2, 9, 17, TICKS - 1]),
            point: chance.one_of(&points),
        });
    }

    fn draw_stop(&mut self, chance: &mut Chance, roster: &[RobotName]) {
        // Few ways to be stopped, so that several schedules share each.
        let (from, until) = chance.one_of(&[(3, 4), (3, 20), (12, 30)]);
        let stop = Stop {
            robot: chance.one_of(roster),
            from,
            until,
            lose_after: chance.one_of(&[3, 50]),
        };

        // Where the clock goes on, a link that is cut and a robot that is late decide what the run becomes.
        self.links.cuts = 0.0;
        self.lateness = lateness(OnLate::Continue, 3_600 * S, stop.lose_after);
        self.stop = Some(stop);
    }

    fn draw_moment(&self, chance: &mut Chance) -> Option<(Epoch, Tick)> {
        if chance.happens(0.15) {
            return None;
        }
        // Where the clock goes on, the end of the run must be quiet enough for robots to come back.
        let most = if self.family == Family::Late {
            10
        } else {
            TICKS
        };
        let epoch = 1 + chance.below(u64::from(self.last_epoch())) as Epoch;

        Some((epoch, chance.below(most)))
    }
}

fn draw_links(chance: &mut Chance) -> Links {
    // Some links are quiet, so that what befalls processes is also seen alone.
    let badness = chance.one_of(&[0.0, 0.1, 1.0, 1.0]);

    Links {
        latency: chance.magnitude(10, 2 * MS),
        bytes_per_ms: chance.magnitude(10_000, 1_000_000),
        room: chance.magnitude(1_000, 1 << 20) as usize,
        loss: chance.up_to(0.03) * badness,
        duplicates: chance.up_to(0.05) * badness,
        naps: chance.up_to(0.03) * badness,
        cuts: chance.up_to(0.006) * badness,
        longest_nap: chance.magnitude(MS, 3 * S),
        longest_cut: chance.magnitude(MS, 15 * S),
        noisy_until: chance.below(TICKS / 2),
    }
}

fn draw_lateness(chance: &mut Chance, roster: &[RobotName]) -> LatePolicy {
    let policies = [
        OnLate::Continue,
        OnLate::Continue,
        OnLate::Continue,
        OnLate::Wait,
        OnLate::Abort,
    ];
    // Longer than a tick takes on links that are whole, with one query that is repeated.
    let deadline = chance.magnitude(S, 5 * S);
    let mut drawn = lateness(
        chance.one_of(&policies),
        deadline,
        1 + chance.below(5) as u32,
    );
    if chance.happens(0.3) {
        let robot = chance.one_of(roster);
        let policy = chance.one_of(&[OnLate::Wait, OnLate::Continue]);
        drawn.own.insert(robot, policy);
    }

    drawn
}

fn lateness(on_late: OnLate, deadline: Micros, lose_after: u32) -> LatePolicy {
    LatePolicy {
        on_late,
        own: std::collections::BTreeMap::new(),
        deadline: Duration::from_micros(deadline),
        lose_after,
    }
}
