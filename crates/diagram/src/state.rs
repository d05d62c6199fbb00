//! What is in progress after a tick: states of the robots, commands under way, cuts, faults. Events begin and end it.

use std::collections::BTreeMap;

use protocol::event::Cause;
use protocol::messages::FaultKind;
use protocol::{Event, RobotName, Seq, Tick};
use timeline::{Kind, States, Stay};

use crate::items::{
    Absence, Band, BandKind, Change, Command, CommandEnd, Cut, Fault, Items, Joined, Missed,
    Period, QueriesLost,
};

/// What is in progress after a tick of a run. Memory is bounded by what is in progress, whatever the length of the run.
#[derive(Debug, Clone, Default)]
pub struct State {
    /// The robots, by name. A name that first occurs in an event is added.
    robots: BTreeMap<RobotName, RobotState>,
    /// Their emotions and behaviors, and whether they take part.
    states: States,
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
        self.apply_to_states(tick, event, items);
        match event {
            Event::Joined {
                robot, generation, ..
            } => {
                if tick > 0 || generation.is_some() {
                    items.joined.push(Joined {
                        robot: robot.clone(),
                        generation: *generation,
                        tick,
                    });
                }
            }
            Event::Missed { robot } => self.miss(robot, tick, items),
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
            | Event::Lost { .. }
            | Event::Emotion { .. }
            | Event::Behavior { .. }
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
            if let Some(begin) = self.states.lost_since(name) {
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

        for stay in self.states.lasting(Tick::MAX) {
            let begin = stay.begin;
            let mut lasting = band(stay);
            lasting.period = since(begin);
            items.bands.push(lasting);
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

    /// Applies an event to the states of the robots. A robot that is back ends its absence.
    fn apply_to_states(&mut self, tick: Tick, event: &Event, items: &mut Items) {
        if let Event::Joined { robot, .. } = event
            && let Some(begin) = self.states.lost_since(robot)
        {
            items.absences.push(Absence {
                robot: robot.clone(),
                period: Period {
                    begin,
                    end: Some(tick),
                },
            });
        }
        if let Event::Joined { robot, .. }
        | Event::Lost { robot }
        | Event::Emotion { robot, .. }
        | Event::Behavior { robot, .. } = event
        {
            self.robot(robot);
        }

        let over = self.states.apply(tick, event);
        items.bands.extend(over.into_iter().map(band));
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

fn band(stay: Stay) -> Band {
    Band {
        robot: stay.robot,
        kind: match stay.kind {
            Kind::Emotion => BandKind::Emotion,
            Kind::Behavior => BandKind::Behavior,
        },
        name: stay.state,
        period: Period {
            begin: stay.begin,
            end: Some(stay.end),
        },
    }
}
