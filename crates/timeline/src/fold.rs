//! The fold over the events of a run.

use std::collections::BTreeMap;

use protocol::event::Cause;
use protocol::messages::FaultKind;
use protocol::{Event, RobotName, Seq, Tick};

use crate::names::StateOrder;
use crate::span::{
    Absence, ChangeSpan, CommandEnd, CommandSpan, CutSpan, ExpectationSpan, FaultSpan, GuestVisit,
    Joined, MissedTicks, Period, QueriesLost, Span, StateKind, StateSpan,
};

/// What is in progress after an event of a run. Memory is bounded by what is in progress, whatever the length of the run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timeline {
    robots: BTreeMap<RobotName, RobotProgress>,
    /// Commands under way, by sender and number.
    commands: BTreeMap<(RobotName, Seq), CommandSpan>,
    cuts: BTreeMap<(RobotName, RobotName), CutSpan>,
    /// The last lost queries of each pair.
    queries: BTreeMap<(RobotName, RobotName), QueriesLost>,
    /// Since when guests are on the field that have entered.
    guests: BTreeMap<u32, Tick>,
    /// The last change of each part of the scenario, by its path.
    set: BTreeMap<String, String>,
    names: StateOrder,
}

/// What is in progress at a robot.
#[derive(Debug, Clone, PartialEq, Default)]
struct RobotProgress {
    emotion: Option<StateSince>,
    behavior: Option<StateSince>,
    /// Since when it takes no part.
    lost: Option<Tick>,
    /// The last ticks that it missed.
    missed: Option<Period>,
    /// In the order of their beginnings.
    faults: Vec<(FaultKind, Tick)>,
}

/// A state, and the tick in which it began or the robot took part again.
#[derive(Debug, Clone, PartialEq)]
struct StateSince {
    name: String,
    begin: Tick,
}

impl Timeline {
    /// The timeline before tick 0 of a run of these robots. Others are added when they first occur in an event.
    #[must_use]
    pub fn new(robots: &[RobotName]) -> Self {
        let mut timeline = Self::default();
        for name in robots {
            timeline.robot(name);
        }
        timeline
    }

    /// Applies the events of a tick. Returns what is over with them.
    pub fn tick(&mut self, tick: Tick, events: &[Event]) -> Vec<Span> {
        let mut over = Vec::new();
        for event in events {
            over.extend(self.apply(tick, event));
        }
        over
    }

    /// Applies an event of a tick. Returns what is over with it.
    pub fn apply(&mut self, tick: Tick, event: &Event) -> Vec<Span> {
        match event {
            Event::Emotion { robot, to, .. } => self.enter(robot, StateKind::Emotion, to, tick),
            Event::Behavior { robot, to, .. } => self.enter(robot, StateKind::Behavior, to, tick),
            Event::Joined {
                robot, generation, ..
            } => {
                let mut over = self.join(robot, tick);
                // That all robots take part from tick 0 on is no span of its own.
                if tick > 0 || generation.is_some() {
                    over.push(Span::Joined(Joined {
                        robot: robot.clone(),
                        generation: *generation,
                        tick,
                    }));
                }
                over
            }
            Event::Lost { robot } => self.lose(robot, tick),
            Event::Missed { robot } => self.miss(robot, tick),
            Event::Fault {
                robot,
                kind,
                begins,
            } => self.fault(robot, *kind, *begins, tick),

            Event::LinkCut {
                from,
                to,
                commands,
                queries,
            } => {
                // A cut that goes on with another scope is another span.
                let over = self.heal(from, to, tick);
                let cut = CutSpan {
                    from: from.clone(),
                    to: to.clone(),
                    commands: *commands,
                    queries: *queries,
                    period: Period::since(tick),
                };
                self.cuts.insert((from.clone(), to.clone()), cut);
                over
            }
            Event::LinkHealed { from, to } => self.heal(from, to, tick),
            Event::QueryLost { from, to, because } => self.lose_query(from, to, *because, tick),
            Event::CommandSent {
                from,
                to,
                seq,
                performative,
                command,
                payload: _,
                payload_of: _,
            } => {
                let sent = CommandSpan {
                    from: from.clone(),
                    to: to.clone(),
                    seq: *seq,
                    performative: *performative,
                    text: command.clone(),
                    sent: tick,
                    until: None,
                    is_doubled: false,
                    because: None,
                    ends: Vec::new(),
                };
                // Numbers are unique within an epoch. Should one come again, the command before is
                // given out as it is, and none is lost.
                let before = self.commands.insert((from.clone(), *seq), sent);
                before.map(Span::Command).into_iter().collect()
            }
            Event::CommandDelayed {
                from,
                seq,
                until,
                because,
                ..
            } => self.change_command(from, *seq, |command| {
                command.until = Some(*until);
                command.because = because.or(command.because);
            }),
            Event::CommandDuplicated {
                from, seq, because, ..
            } => self.change_command(from, *seq, |command| {
                command.is_doubled = true;
                command.because = because.or(command.because);
            }),
            Event::CommandDelivered { from, seq, .. } => {
                let end = CommandEnd { tick, lost: None };
                self.change_command(from, *seq, |command| command.ends.push(end))
            }
            Event::CommandDropped {
                from, seq, because, ..
            } => {
                let lost = Some(*because);
                let end = CommandEnd { tick, lost };
                self.change_command(from, *seq, |command| command.ends.push(end))
            }
            Event::GuestEntered { guest, .. } => {
                // One that enters again without having left ends a visit all the same.
                let over = self.end_visit(*guest, tick);
                self.guests.insert(*guest, tick);
                over
            }
            Event::GuestLeft { guest, .. } => self.end_visit(*guest, tick),
            Event::Changed { set, .. } => vec![Span::Change(ChangeSpan {
                tick,
                before: self.replace_setting(set),
                set: set.clone(),
            })],
            Event::Judged {
                expectation,
                verdict,
                because,
            } => vec![Span::Judged(ExpectationSpan {
                tick,
                expectation: expectation.clone(),
                verdict: *verdict,
                because: because.clone(),
            })],
            // Named one by one, so that a new event has to be decided about here. These say nothing
            // about what lasts.
            Event::Init { .. }
            | Event::DoneLate { .. }
            | Event::Blocked { .. }
            | Event::Say { .. }
            | Event::Guest { .. }
            | Event::SiteChanged { .. }
            | Event::SiteRefused { .. }
            | Event::LayerChanged { .. }
            | Event::LayerRefused { .. }
            | Event::Warned { .. }
            | Event::Tick { .. }
            | Event::End { .. } => Vec::new(),
        }
    }

    /// What is in progress, without an end. Ticks that a robot missed one after the other have one: they are over when it has not
    /// missed the next tick, which is known only then. Lost queries as well.
    #[must_use]
    pub fn in_progress(&self) -> Vec<Span> {
        let mut spans = Vec::new();
        for (name, robot) in &self.robots {
            spans.extend(robot.in_progress(name));
        }
        spans.extend(self.commands.values().cloned().map(Span::Command));
        spans.extend(self.cuts.values().cloned().map(Span::Cut));
        spans.extend(self.queries.values().cloned().map(Span::QueriesLost));
        for (&guest, &begin) in &self.guests {
            let period = Period::since(begin);
            spans.push(Span::Guest(GuestVisit { guest, period }));
        }
        spans
    }

    /// The robots, in the order of their names.
    pub fn robots(&self) -> impl Iterator<Item = &RobotName> {
        self.robots.keys()
    }

    /// The emotion or behavior that a robot has reported last, whether it takes part or not; `None` if it has none.
    #[must_use]
    pub fn state(&self, robot: &RobotName, kind: StateKind) -> Option<&str> {
        let state = self.robots.get(robot)?.state(kind);
        state.map(|state| state.name.as_str())
    }

    /// The emotions and behaviors that the robots have had so far.
    #[must_use]
    pub fn names(&self) -> &StateOrder {
        &self.names
    }

    /// Since when a robot takes no part; `None` if it does.
    #[must_use]
    pub fn lost_since(&self, robot: &RobotName) -> Option<Tick> {
        self.robots.get(robot)?.lost
    }

    /// Whether a robot missed the tick, which is the last one of which events were applied.
    #[must_use]
    pub fn has_missed(&self, robot: &RobotName, tick: Tick) -> bool {
        let missed = self.robots.get(robot).and_then(|robot| robot.missed);
        missed.is_some_and(|period| period.end == Some(tick + 1))
    }

    /// A command of which a copy is under way, by its sender and number.
    #[must_use]
    pub fn command(&self, from: &RobotName, seq: Seq) -> Option<&CommandSpan> {
        self.commands.get(&(from.clone(), seq))
    }

    /// The commands of which a copy is under way, by sender and number.
    pub fn commands(&self) -> impl Iterator<Item = &CommandSpan> {
        self.commands.values()
    }

    /// The faults that hold processes of robots, by robot.
    pub fn faults(&self) -> impl Iterator<Item = (&RobotName, FaultKind)> {
        let robots = self.robots.iter();
        robots.flat_map(|(name, robot)| robot.faults.iter().map(move |(kind, _)| (name, *kind)))
    }

    fn robot(&mut self, name: &RobotName) -> &mut RobotProgress {
        self.robots.entry(name.clone()).or_default()
    }

    fn enter(&mut self, name: &RobotName, kind: StateKind, to: &str, tick: Tick) -> Vec<Span> {
        let next = StateSince {
            name: to.to_owned(),
            begin: tick,
        };
        // A robot without emotions reports an empty one, which is none.
        let next = (!to.is_empty()).then_some(next);
        if next.is_some() {
            self.names.add(kind, to);
        }
        let robot = self.robot(name);
        let state = match kind {
            StateKind::Emotion => &mut robot.emotion,
            StateKind::Behavior => &mut robot.behavior,
        };
        let before = std::mem::replace(state, next);

        // The stay of a robot that is lost has ended with its loss.
        let over = before.filter(|_| robot.lost.is_none());
        let stay = over.and_then(|before| before.until(name, kind, tick));
        stay.into_iter().collect()
    }

    fn lose(&mut self, name: &RobotName, tick: Tick) -> Vec<Span> {
        let robot = self.robot(name);
        if robot.lost.is_some() {
            return Vec::new();
        }

        robot.lost = Some(tick);
        let mut over = Vec::new();
        for kind in [StateKind::Emotion, StateKind::Behavior] {
            let state = robot.state(kind).cloned();
            over.extend(state.and_then(|state| state.until(name, kind, tick)));
        }
        over
    }

    fn join(&mut self, name: &RobotName, tick: Tick) -> Vec<Span> {
        let robot = self.robot(name);
        let Some(begin) = robot.lost.take() else {
            return Vec::new();
        };

        // It is in the states that it reported last, until it reports others: their stays begin anew.
        let states = [&mut robot.emotion, &mut robot.behavior];
        for state in states.into_iter().flatten() {
            state.begin = tick;
        }
        let period = Period {
            begin,
            end: Some(tick),
        };
        let robot = name.clone();
        vec![Span::Absence(Absence { robot, period })]
    }

    fn miss(&mut self, name: &RobotName, tick: Tick) -> Vec<Span> {
        let last = &mut self.robot(name).missed;
        // Ticks in a row are one span. It is given out when another tick is missed later, or with what
        // is in progress.
        if extend(last.as_mut(), tick) {
            return Vec::new();
        }

        let before = last.replace(Period::only(tick));
        let robot = name.clone();
        let over = before.map(|period| Span::Missed(MissedTicks { robot, period }));
        over.into_iter().collect()
    }

    fn fault(&mut self, name: &RobotName, kind: FaultKind, begins: bool, tick: Tick) -> Vec<Span> {
        let faults = &mut self.robot(name).faults;
        let mut over = Vec::new();
        // A fault that begins while one of its kind lasts ends that one: a process has each kind once.
        if let Some(index) = faults.iter().position(|(other, _)| *other == kind) {
            let (_, begin) = faults.remove(index);
            over.push(Span::Fault(FaultSpan {
                robot: name.clone(),
                kind,
                period: Period {
                    begin,
                    end: Some(tick),
                },
            }));
        }

        if begins {
            faults.push((kind, tick));
        }
        over
    }

    fn end_visit(&mut self, guest: u32, tick: Tick) -> Vec<Span> {
        let Some(begin) = self.guests.remove(&guest) else {
            return Vec::new();
        };
        let end = Some(tick);
        let period = Period { begin, end };
        vec![Span::Guest(GuestVisit { guest, period })]
    }

    fn heal(&mut self, from: &RobotName, to: &RobotName, tick: Tick) -> Vec<Span> {
        let Some(mut cut) = self.cuts.remove(&(from.clone(), to.clone())) else {
            return Vec::new();
        };
        cut.period.end = Some(tick);
        vec![Span::Cut(cut)]
    }

    fn lose_query(
        &mut self,
        from: &RobotName,
        to: &RobotName,
        because: Cause,
        tick: Tick,
    ) -> Vec<Span> {
        let pair = (from.clone(), to.clone());
        let last = self.queries.get_mut(&pair);
        // Another cause is another span, also in the tick after.
        let last = last.filter(|last| last.because == because);
        if extend(last.map(|last| &mut last.period), tick) {
            return Vec::new();
        }

        let lost = QueriesLost {
            from: from.clone(),
            to: to.clone(),
            because,
            period: Period::only(tick),
        };
        let before = self.queries.insert(pair, lost);
        before.map(Span::QueriesLost).into_iter().collect()
    }

    /// Changes a command that is under way. Returns it if no copy is under way any more.
    fn change_command(
        &mut self,
        from: &RobotName,
        seq: Seq,
        change: impl FnOnce(&mut CommandSpan),
    ) -> Vec<Span> {
        let key = (from.clone(), seq);
        let Some(command) = self.commands.get_mut(&key) else {
            return Vec::new();
        };

        change(command);
        // What is over is forgotten: so memory does not grow with the run.
        let over = command.is_over().then(|| self.commands.remove(&key));
        over.flatten().map(Span::Command).into_iter().collect()
    }

    /// Notes a change; returns the last one of the same part of the scenario.
    fn replace_setting(&mut self, set: &str) -> Option<String> {
        let (path, _) = set.split_once('=')?;
        let below = format!("{path}.");
        // To set a table replaces what was set within it.
        self.set.retain(|other, _| !other.starts_with(&below));
        self.set.insert(path.to_owned(), set.to_owned())
    }
}

impl RobotProgress {
    fn state(&self, kind: StateKind) -> Option<&StateSince> {
        match kind {
            StateKind::Emotion => self.emotion.as_ref(),
            StateKind::Behavior => self.behavior.as_ref(),
        }
    }

    fn in_progress(&self, name: &RobotName) -> Vec<Span> {
        let mut spans = Vec::new();
        let robot = || name.clone();
        match self.lost {
            Some(begin) => spans.push(Span::Absence(Absence {
                robot: robot(),
                period: Period::since(begin),
            })),
            None => {
                for kind in [StateKind::Emotion, StateKind::Behavior] {
                    spans.extend(self.state(kind).map(|state| {
                        Span::Stay(StateSpan {
                            robot: robot(),
                            kind,
                            name: state.name.clone(),
                            period: Period::since(state.begin),
                        })
                    }));
                }
            }
        }

        spans.extend(self.missed.map(|period| {
            Span::Missed(MissedTicks {
                robot: robot(),
                period,
            })
        }));
        for (kind, begin) in &self.faults {
            spans.push(Span::Fault(FaultSpan {
                robot: robot(),
                kind: *kind,
                period: Period::since(*begin),
            }));
        }
        spans
    }
}

impl StateSince {
    /// The stay that is over in a tick; `None` if it has lasted for no tick.
    fn until(self, robot: &RobotName, kind: StateKind, end: Tick) -> Option<Span> {
        (self.begin < end).then(|| {
            Span::Stay(StateSpan {
                robot: robot.clone(),
                kind,
                name: self.name,
                period: Period {
                    begin: self.begin,
                    end: Some(end),
                },
            })
        })
    }
}

/// Adds a tick to a period that ends before it. Returns whether there is one.
fn extend(period: Option<&mut Period>, tick: Tick) -> bool {
    let Some(period) = period.filter(|period| period.end == Some(tick)) else {
        return false;
    };
    period.end = Some(tick + 1);
    true
}
