//! What a person does to a run in progress: put into the words of the scenario, checked, and added as a change of it.

use std::collections::{BTreeMap, BTreeSet};

use config::{FileError, Override, Source};
use protocol::messages::{FaultKind, Intervention, OnLate};
use protocol::{RobotName, Tick};

use super::change::Change;
use super::checked::Scenario;
use super::fault::{Fault, FaultEnd};
use super::network::{Counted, NamedCommand, NamedFate, Network, Partition, ticks};
use super::raw;
use super::raw::change::MAX_CHANGES;
use super::raw::words;

/// A link, in the direction of its messages.
type Link = (RobotName, RobotName);

impl Scenario {
    /// An intervention in the words of the scenario: what it sets from a tick on. `sent` is how many commands the network has
    /// decided on so far, of a set.
    ///
    /// # Errors
    /// In words, if there is nothing to do, or a robot is unknown.
    pub fn words_of(
        &self,
        what: &Intervention,
        at: Tick,
        sent: impl Fn(&Counted) -> u64,
    ) -> Result<Vec<Override>, String> {
        let words = match what {
            Intervention::Cut { from, to, one_way } => {
                words::partitions(&self.with_cut(from, to, *one_way, at)?, self.tick_s)?
            }
            Intervention::Heal { from, to, one_way } => {
                words::partitions(&self.with_healed(from, to, *one_way, at)?, self.tick_s)?
            }
            Intervention::Lose { from, to } => {
                self.words_of_next(NamedFate::Lost, from, to, at, sent)?
            }
            Intervention::Delay { from, to, by_s } => {
                let fate = NamedFate::Late(ticks(*by_s, self.tick_s));
                self.words_of_next(fate, from, to, at, sent)?
            }
            Intervention::Duplicate { from, to } => {
                self.words_of_next(NamedFate::Doubled, from, to, at, sent)?
            }
            Intervention::Fault { robot, kind, for_s } => {
                let faults = self.with_fault(robot, *kind, *for_s, at)?;
                words::faults(&faults, self.tick_s)?
            }
            Intervention::Recover { robot } => {
                words::faults(&self.with_recovery(robot, at)?, self.tick_s)?
            }
            Intervention::Set { set } => {
                let set: Result<Vec<Override>, String> =
                    set.iter().map(|one| one.parse()).collect();
                return set.and_then(|set| {
                    if set.is_empty() {
                        Err("nothing is to be set".to_owned())
                    } else {
                        Ok(set)
                    }
                });
            }
        };

        Ok(vec![words])
    }

    /// The end, before a tick, of the last fault of a robot that the wall clock would end, in the words of the scenario.
    ///
    /// # Errors
    /// In words, if the last fault of the robot does not last for a time of wall clock.
    pub fn words_of_early_end(&self, robot: &RobotName, at: Tick) -> Result<Override, String> {
        let mut faults = self.faults_at(at).to_vec();
        let begun = faults
            .iter_mut()
            .filter(|fault| fault.robot == *robot && fault.at < at);
        let last = begun.max_by_key(|fault| fault.at);

        match last {
            Some(last) if matches!(last.end, FaultEnd::After(_)) => last.end = FaultEnd::At(at),
            _ => return Err(no_fault_holds(robot)),
        }
        words::faults(&faults, self.tick_s)
    }

    /// The scenario without one of the partitions that are known in a tick, in its words.
    ///
    /// # Errors
    /// In words, if it cannot be written.
    pub fn words_without_partition(&self, index: usize, at: Tick) -> Result<Override, String> {
        let mut network = self.network_at(at).clone();
        if index < network.partitions.len() {
            network.partitions.remove(index);
        }
        words::partitions(&network, self.tick_s)
    }

    /// The scenario without one of the faults that are known in a tick, in its words.
    ///
    /// # Errors
    /// In words, if it cannot be written.
    pub fn words_without_fault(&self, index: usize, at: Tick) -> Result<Override, String> {
        let mut faults = self.faults_at(at).to_vec();
        if index < faults.len() {
            faults.remove(index);
        }
        words::faults(&faults, self.tick_s)
    }

    /// A rule for late robots, or for one of them, in the words of the scenario.
    ///
    /// # Errors
    /// In words, if it cannot be written.
    pub fn words_of_lateness(
        robot: Option<&RobotName>,
        on_late: OnLate,
    ) -> Result<Override, String> {
        match robot {
            Some(robot) => words::on_late(&["robot", robot.as_str(), "on_late"], on_late),
            None => words::on_late(&["on_late"], on_late),
        }
    }

    fn with_cut(
        &self,
        from: &[RobotName],
        to: &[RobotName],
        one_way: bool,
        at: Tick,
    ) -> Result<Network, String> {
        let mut cut = BTreeSet::new();
        for partition in &self.network_at(at).partitions {
            if partition.lasts_at(at) && partition.commands && partition.queries {
                cut.extend(Self::links_cut_by(partition));
            }
        }
        if self.links_between(from, to, one_way)?.is_subset(&cut) {
            return Err("all links between these robots are cut already".to_owned());
        }

        let mut network = self.network_from(at);
        network.partitions.push(Partition {
            groups: vec![from.to_vec(), to.to_vec()],
            from: at,
            until: None,
            one_way,
            commands: true,
            queries: true,
        });
        Ok(network)
    }

    /// The network without the cuts between two groups. What else a partition cuts stays cut, link by link.
    fn with_healed(
        &self,
        from: &[RobotName],
        to: &[RobotName],
        one_way: bool,
        at: Tick,
    ) -> Result<Network, String> {
        let healed = self.links_between(from, to, one_way)?;
        let mut network = self.network_from(at);
        let mut partitions = Vec::new();
        let mut has_healed = false;
        for partition in std::mem::take(&mut network.partitions) {
            let cut = Self::links_cut_by(&partition);
            if !partition.lasts_at(at) || cut.is_disjoint(&healed) {
                partitions.push(partition);
                continue;
            }

            has_healed = true;
            partitions.extend(cut.difference(&healed).map(|(from, to)| Partition {
                groups: vec![vec![from.clone()], vec![to.clone()]],
                from: at,
                one_way: true,
                ..partition.clone()
            }));
            if partition.from < at {
                partitions.push(Partition {
                    until: Some(at),
                    ..partition
                });
            }
        }

        if !has_healed {
            return Err("no link between these robots is cut".to_owned());
        }
        network.partitions = partitions;
        Ok(network)
    }

    /// The links between the robots of two groups; without names a group is all robots.
    fn links_between(
        &self,
        from: &[RobotName],
        to: &[RobotName],
        one_way: bool,
    ) -> Result<BTreeSet<Link>, String> {
        let all = self.roster();
        let group = |named: &[RobotName]| -> Result<Vec<RobotName>, String> {
            if let Some(unknown) = named.iter().find(|name| !self.robots.contains_key(*name)) {
                return Err(format!("no robot of this run is called {unknown}"));
            }
            Ok(if named.is_empty() {
                all.clone()
            } else {
                named.to_vec()
            })
        };

        let to = group(to)?;
        let mut links = BTreeSet::new();
        for from in group(from)? {
            for to in to.iter().filter(|to| **to != from) {
                links.insert((from.clone(), to.clone()));
                if !one_way {
                    links.insert((to.clone(), from.clone()));
                }
            }
        }
        Ok(links)
    }

    fn links_cut_by(partition: &Partition) -> BTreeSet<Link> {
        let members = || partition.groups.iter().flatten();
        let mut links = BTreeSet::new();
        for from in members() {
            let cut_off = members().filter(|to| partition.separates(from, to));
            links.extend(cut_off.map(|to| (from.clone(), to.clone())));
        }
        links
    }

    /// The words that give the next command on a link this fate: the first one that does not have it already, and is not lost.
    fn words_of_next(
        &self,
        fate: NamedFate,
        from: &RobotName,
        to: &RobotName,
        at: Tick,
        sent: impl Fn(&Counted) -> u64,
    ) -> Result<Override, String> {
        let mut network = self.network_from(at);
        network
            .named
            .retain(|named| named.number > sent(&named.counted));

        let counted = Counted {
            from: from.clone(),
            to: to.clone(),
            text: None,
        };
        let is_taken = |number: u64| {
            network.named.iter().any(|named| {
                let has_fate = named.fate == NamedFate::Lost || is_same_kind(named.fate, fate);
                has_fate && named.counted == counted && named.number == number
            })
        };
        let mut number = sent(&counted) + 1;
        while is_taken(number) {
            number += 1;
        }
        network.named.push(NamedCommand {
            counted,
            number,
            fate,
        });
        words::named(&network, fate, self.tick_s)
    }

    /// The network of a tick, without partitions that are over by then.
    fn network_from(&self, at: Tick) -> Network {
        let mut network = self.network_at(at).clone();
        network
            .partitions
            .retain(|partition| partition.until.is_none_or(|until| until >= at));
        network
    }

    fn with_fault(
        &self,
        robot: &RobotName,
        kind: FaultKind,
        for_s: Option<f64>,
        at: Tick,
    ) -> Result<Vec<Fault>, String> {
        let mut faults = self.faults_at(at).to_vec();
        let holding = faults
            .iter()
            .find(|fault| fault.robot == *robot && fault.holds(at, false));
        if let Some(Fault { kind, .. }) = holding {
            let kind = kind_in_words(*kind);
            return Err(format!("{robot} {kind} already: let it go on first"));
        }

        // While the clock waits for a robot, only the wall clock can end its fault.
        let is_awaited = self.lateness_at(at).of(robot) == OnLate::Wait;
        let end = match for_s {
            Some(for_s) => FaultEnd::After(for_s),
            None if is_awaited && matches!(kind, FaultKind::Crash | FaultKind::Hang) => {
                FaultEnd::After(raw::fault::MAX_WALL_S)
            }
            None => FaultEnd::Never,
        };
        faults.push(Fault {
            robot: robot.clone(),
            kind,
            at,
            end,
        });
        Ok(faults)
    }

    fn with_recovery(&self, robot: &RobotName, at: Tick) -> Result<Vec<Fault>, String> {
        let mut faults = self.faults_at(at).to_vec();
        let found = faults
            .iter()
            .position(|fault| fault.robot == *robot && fault.holds(at, false));
        let Some(index) = found else {
            return Err(no_fault_holds(robot));
        };

        if faults[index].at == at {
            faults.remove(index); // It has not begun.
        } else {
            faults[index].end = FaultEnd::At(at);
        }
        Ok(faults)
    }

    /// The scenario with something more set from a tick on, by hand; nothing after that tick has been done by hand yet. The
    /// changes of the scenario from that tick on apply to what is set.
    ///
    /// # Errors
    /// [`FileError`] if it is not a change that can be made while a run goes on.
    pub fn with_change_by_hand(&self, at: Tick, set: &[Override]) -> Result<Self, FileError> {
        let mut kept = self.changes.clone();
        let mut later = kept.split_off(kept.partition_point(|change| change.at < at));
        let mut all = Vec::new();
        later.retain_mut(|change| {
            if change.is_by_hand {
                all = std::mem::take(&mut change.set);
            }
            !change.is_by_hand
        });
        if kept.len() + later.len() >= MAX_CHANGES {
            return Err(FileError::new(format!("more than {MAX_CHANGES} changes")));
        }
        for one in set {
            all.retain(|earlier| !earlier.has_path_of(one) || one.merges());
            all.push(one.clone());
        }

        // The words of later changes are applied once more, to what is set now.
        let mut now = self.as_of(at - 1);
        let own = later.partition_point(|change| change.at == at);
        later.insert(own, now.change_to(at, all));
        now.changes = later;
        let source = Source {
            name: "the scenario".to_owned(),
            text: now.to_toml()?,
        };
        let raw: raw::ScenarioFile = source.parse()?;
        let mut resolved = raw.check_from(&source, None, at)?.changes;
        if let Some(own) = resolved.get_mut(own) {
            own.is_by_hand = true;
        }
        kept.append(&mut resolved);
        Ok(Self {
            changes: kept,
            ..self.clone()
        })
    }

    /// The scenario as it is in a tick, without changes.
    fn as_of(&self, tick: Tick) -> Self {
        let mut scenario = self.clone();
        scenario.network.clone_from(self.network_at(tick));
        scenario.lateness.clone_from(self.lateness_at(tick));
        scenario.faults = self.faults_at(tick).to_vec();
        for (name, robot) in &mut scenario.robots {
            if let Some(parameters) = self.parameters_at(name, tick) {
                robot.parameters.clone_from(parameters);
            }
        }
        scenario.changes.clear();
        scenario
    }

    /// A change of the scenario of which only the words are known.
    fn change_to(&self, at: Tick, set: Vec<Override>) -> Change {
        Change {
            at,
            set,
            is_by_hand: false,
            network: self.network.clone(),
            lateness: self.lateness.clone(),
            faults: Vec::new(),
            parameters: BTreeMap::new(),
            restarted: Vec::new(),
        }
    }
}

fn is_same_kind(one: NamedFate, other: NamedFate) -> bool {
    std::mem::discriminant(&one) == std::mem::discriminant(&other)
}

fn no_fault_holds(robot: &RobotName) -> String {
    format!("no fault holds {robot}")
}

/// What a fault does to a robot, as the end of a sentence about it.
#[must_use]
pub fn kind_in_words(kind: FaultKind) -> &'static str {
    match kind {
        FaultKind::Crash => "is killed",
        FaultKind::Hang => "is stopped",
        FaultKind::Slow => "is slowed down",
        FaultKind::Restart => "starts again",
    }
}
