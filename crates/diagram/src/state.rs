//! What is in progress after a tick: states of the robots, commands under way, cuts, faults. Events begin and end it.

use std::collections::BTreeMap;

use protocol::event::Cause;
use protocol::messages::FaultKind;
use protocol::{Event, RobotName, Seq, Tick};

use crate::items::{
    Absence, Band, BandKind, Change, Command, CommandEnd, Cut, Fault, Items, Joined, Missed,
    Period, QueriesLost,
};

/// What is in progress after a tick of a run. Memory is bounded by what is in progress, whatever the length of the run.
#[derive(Debug, Clone, Default)]
pub struct State {
    /// The robots, by name. A name that first occurs in an event is added.
    robots: BTreeMap<RobotName, RobotState>,
    /// Commands under way, by sender and number.
    commands: BTreeMap<(RobotName, Seq), Command>,
    cuts: BTreeMap<(RobotName, RobotName), Cut>,
    /// The last lost queries of each pair.
    queries: BTreeMap<(RobotName, RobotName), QueriesLost>,
    /// The last change of each part of the scenario, by its path.
    set: BTreeMap<String, String>,
}

/// What is in progress at a robot, each with the tick in which it began.
#[derive(Debug, Clone, Default)]
struct RobotState {
    emotion: Option<(String, Tick)>,
    behavior: Option<(String, Tick)>,
    /// Since when it does not take part.
    lost: Option<Tick>,
    /// The last ticks that it missed.
    missed: Option<Period>,
    faults: Vec<(FaultKind, Tick)>,
}

impl State {
    /// The state before tick 0 of a run of these robots.
    #[must_use]
    pub fn new(robots: &[RobotName]) -> Self {
        let mut state = Self::default();
        for robot in robots {
            state.robots.insert(robot.clone(), RobotState::default());
        }
        state
    }

    /// Applies the events of a tick before the window.
    pub fn skip(&mut self, tick: Tick, events: &[Event]) {
        let mut over = Items::default();
        for event in events {
            self.apply(tick, event, &mut over);
        }
    }

    /// The robots, in the order of their names.
    pub(crate) fn robots(&self) -> Vec<RobotName> {
        self.robots.keys().cloned().collect()
    }

    /// Applies an event. What is over with it goes to `items`.
    pub(crate) fn apply(&mut self, tick: Tick, event: &Event, items: &mut Items) {
        match event {
            Event::Joined {
                robot, generation, ..
            } => {
                self.end_absence(robot, tick, items);
                if tick > 0 || generation.is_some() {
                    items.joined.push(Joined {
                        robot: robot.clone(),
                        generation: *generation,
                        tick,
                    });
                }
            }
            Event::Lost { robot } => self.lose(robot, tick, items),
            Event::Missed { robot } => self.miss(robot, tick, items),
            Event::Emotion { robot, to, .. } => {
                self.change(robot, BandKind::Emotion, to, tick, items);
            }
            Event::Behavior { robot, to, .. } => {
                self.change(robot, BandKind::Behavior, to, tick, items);
            }
            Event::Fault {
                robot,
                kind,
                begins,
            } => self.fault(robot, *kind, *begins, tick, items),
            Event::LinkCut {
                from,
                to,
                commands,
                queries,
            } => {
                self.heal(from, to, tick, items);

                let cut = Cut {
                    from: from.clone(),
                    to: to.clone(),
                    commands: *commands,
                    queries: *queries,
                    period: since(tick),
                };
                self.cuts.insert((from.clone(), to.clone()), cut);
            }
            Event::LinkHealed { from, to } => self.heal(from, to, tick, items),
            Event::QueryLost { from, to, because } => {
                self.lose_query(from, to, *because, tick, items);
            }
            Event::CommandSent { .. }
            | Event::CommandDelayed { .. }
            | Event::CommandDuplicated { .. }
            | Event::CommandDelivered { .. }
            | Event::CommandDropped { .. } => self.command(tick, event, items),
            Event::Changed { set, .. } => items.changes.push(Change {
                tick,
                before: self.replace_setting(set),
                set: set.clone(),
            }),
            Event::Init { .. }
            | Event::DoneLate { .. }
            | Event::Blocked { .. }
            | Event::Say { .. }
            | Event::Warned { .. }
            | Event::Judged { .. }
            | Event::Tick { .. }
            | Event::End { .. } => {}
        }
    }

    /// Adds what is still in progress. Ticks that a robot missed one after the other are over when it has not missed the next
    /// one, which is known only then; the same with lost queries.
    pub(crate) fn add_unfinished(&self, items: &mut Items) {
        for (name, robot) in &self.robots {
            if robot.lost.is_none() {
                let emotion = robot.emotion.as_ref();
                items
                    .bands
                    .extend(emotion.map(|state| band(name, BandKind::Emotion, state, None)));
                let behavior = robot.behavior.as_ref();
                items
                    .bands
                    .extend(behavior.map(|state| band(name, BandKind::Behavior, state, None)));
            }
            if let Some(begin) = robot.lost {
                items.absences.push(Absence {
                    robot: name.clone(),
                    period: since(begin),
                });
            }
            if let Some(period) = robot.missed {
                items.missed.push(Missed {
                    robot: name.clone(),
                    period,
                });
            }
            for (kind, begin) in &robot.faults {
                items.faults.push(Fault {
                    robot: name.clone(),
                    kind: *kind,
                    period: since(*begin),
                });
            }
        }

        items.commands.extend(self.commands.values().cloned());
        items.cuts.extend(self.cuts.values().cloned());
        items.queries.extend(self.queries.values().cloned());
    }

    /// Notes a change; returns the last one of the same part of the scenario.
    fn replace_setting(&mut self, set: &str) -> Option<String> {
        let (path, _) = set.split_once('=')?;
        let below = format!("{path}.");
        self.set.retain(|other, _| !other.starts_with(&below));
        self.set.insert(path.to_owned(), set.to_owned())
    }

    fn robot(&mut self, name: &RobotName) -> &mut RobotState {
        self.robots.entry(name.clone()).or_default()
    }

    fn change(
        &mut self,
        name: &RobotName,
        kind: BandKind,
        to: &str,
        tick: Tick,
        items: &mut Items,
    ) {
        let robot = self.robot(name);
        let is_absent = robot.lost.is_some();
        let place = match kind {
            BandKind::Emotion => &mut robot.emotion,
            BandKind::Behavior => &mut robot.behavior,
        };

        let before = place.replace((to.to_owned(), tick));
        if let Some(before) = before
            && !is_absent
        {
            items.bands.push(band(name, kind, &before, Some(tick)));
        }
    }

    fn lose(&mut self, name: &RobotName, tick: Tick, items: &mut Items) {
        let robot = self.robot(name);
        if robot.lost.is_some() {
            return;
        }

        robot.lost = Some(tick);
        let bands = [
            (BandKind::Emotion, &robot.emotion),
            (BandKind::Behavior, &robot.behavior),
        ];
        for (kind, state) in bands {
            let ended = state
                .as_ref()
                .map(|state| band(name, kind, state, Some(tick)));
            items.bands.extend(ended);
        }
    }

    /// A robot is back. Its emotion and its behavior go on unless an event changes them.
    fn end_absence(&mut self, name: &RobotName, tick: Tick, items: &mut Items) {
        let robot = self.robot(name);
        let Some(begin) = robot.lost.take() else {
            return;
        };

        let states = [&mut robot.emotion, &mut robot.behavior];
        for (_, begin) in states.into_iter().flatten() {
            *begin = tick;
        }
        items.absences.push(Absence {
            robot: name.clone(),
            period: Period {
                begin,
                end: Some(tick),
            },
        });
    }

    fn miss(&mut self, name: &RobotName, tick: Tick, items: &mut Items) {
        let last = &mut self.robot(name).missed;
        if let Some(period) = last
            && period.end == Some(tick)
        {
            period.end = Some(tick + 1);
            return;
        }

        let before = last.replace(only(tick));
        items.missed.extend(before.map(|period| Missed {
            robot: name.clone(),
            period,
        }));
    }

    fn fault(
        &mut self,
        name: &RobotName,
        kind: FaultKind,
        begins: bool,
        tick: Tick,
        items: &mut Items,
    ) {
        let faults = &mut self.robot(name).faults;
        let open = faults.iter().position(|(other, _)| *other == kind);
        if let Some(index) = open {
            let (kind, begin) = faults.remove(index);
            items.faults.push(Fault {
                robot: name.clone(),
                kind,
                period: Period {
                    begin,
                    end: Some(tick),
                },
            });
        }

        if begins {
            self.robot(name).faults.push((kind, tick));
        }
    }

    fn heal(&mut self, from: &RobotName, to: &RobotName, tick: Tick, items: &mut Items) {
        if let Some(mut cut) = self.cuts.remove(&(from.clone(), to.clone())) {
            cut.period.end = Some(tick);
            items.cuts.push(cut);
        }
    }

    fn lose_query(
        &mut self,
        from: &RobotName,
        to: &RobotName,
        because: Cause,
        tick: Tick,
        items: &mut Items,
    ) {
        let pair = (from.clone(), to.clone());
        if let Some(last) = self.queries.get_mut(&pair)
            && last.period.end == Some(tick)
            && last.because == because
        {
            last.period.end = Some(tick + 1);
            return;
        }

        let lost = QueriesLost {
            from: from.clone(),
            to: to.clone(),
            because,
            period: only(tick),
        };
        items.queries.extend(self.queries.insert(pair, lost));
    }

    /// Applies an event of a command.
    fn command(&mut self, tick: Tick, event: &Event, items: &mut Items) {
        match event {
            Event::CommandSent {
                from,
                to,
                seq,
                performative,
                command,
            } => {
                let sent = Command {
                    from: from.clone(),
                    to: to.clone(),
                    seq: *seq,
                    performative: *performative,
                    text: command.clone(),
                    sent: tick,
                    until: None,
                    is_doubled: false,
                    ends: Vec::new(),
                };

                let before = self.commands.insert((from.clone(), *seq), sent);
                items.commands.extend(before);
            }
            Event::CommandDelayed {
                from, seq, until, ..
            } => {
                if let Some(command) = self.commands.get_mut(&(from.clone(), *seq)) {
                    command.until = Some(*until);
                }
            }
            Event::CommandDuplicated { from, seq, .. } => {
                if let Some(command) = self.commands.get_mut(&(from.clone(), *seq)) {
                    command.is_doubled = true;
                }
            }
            Event::CommandDelivered { from, seq, .. } => {
                self.end_command((from.clone(), *seq), CommandEnd { tick, lost: None }, items);
            }
            Event::CommandDropped {
                from, seq, because, ..
            } => {
                let lost = Some(*because);
                self.end_command((from.clone(), *seq), CommandEnd { tick, lost }, items);
            }
            _ => {}
        }
    }

    /// A copy of a command has arrived, or is lost. A partition loses all copies with one event.
    fn end_command(&mut self, key: (RobotName, Seq), end: CommandEnd, items: &mut Items) {
        let Some(mut command) = self.commands.remove(&key) else {
            return;
        };

        command.ends.push(end);
        let is_whole_lost = end.lost == Some(Cause::Partition);
        if command.ends.len() < command.copies() && !is_whole_lost {
            self.commands.insert(key, command);
        } else {
            items.commands.push(command);
        }
    }
}

fn since(begin: Tick) -> Period {
    Period { begin, end: None }
}

fn only(tick: Tick) -> Period {
    Period {
        begin: tick,
        end: Some(tick + 1),
    }
}

fn band(robot: &RobotName, kind: BandKind, state: &(String, Tick), end: Option<Tick>) -> Band {
    let (name, begin) = state;
    Band {
        robot: robot.clone(),
        kind,
        name: name.clone(),
        period: Period { begin: *begin, end },
    }
}
