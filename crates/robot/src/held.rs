//! Commands that have arrived and wait for a clock to name them.

use std::collections::BTreeMap;

use protocol::messages::{Command, CommandId};
use protocol::{Epoch, RobotName, Seq};

/// Commands that are held for one robot. Beyond that the oldest of whoever has most of them here makes room, so that
/// who floods a robot loses its own.
const MAX_COMMANDS: usize = 16_384;

/// The commands for one robot, by sender.
#[derive(Debug, Default)]
pub(crate) struct Held {
    by_sender: BTreeMap<RobotName, BTreeMap<Seq, Command>>,
    count: usize,
}

impl Held {
    /// Holds a command; a repetition changes nothing.
    pub(crate) fn hold(&mut self, from: RobotName, command: Command) {
        if self
            .by_sender
            .entry(from)
            .or_default()
            .insert(command.seq, command)
            .is_some()
        {
            return;
        }
        self.count += 1;
        if self.count > MAX_COMMANDS {
            self.make_room();
        }
    }

    /// The command that a clock names, if it is of this epoch.
    pub(crate) fn take(&mut self, id: &CommandId, epoch: Epoch) -> Option<Command> {
        let own = self.by_sender.get_mut(&id.from)?;
        if own.get(&id.seq)?.epoch != epoch {
            return None;
        }
        self.count -= 1;
        own.remove(&id.seq)
    }

    /// Forgets what was sent in epochs before this one.
    pub(crate) fn begin(&mut self, epoch: Epoch) {
        for own in self.by_sender.values_mut() {
            own.retain(|_, command| command.epoch >= epoch);
        }
        self.by_sender.retain(|_, own| !own.is_empty());
        self.count = self.by_sender.values().map(BTreeMap::len).sum();
    }

    fn make_room(&mut self) {
        let most = self.by_sender.iter().max_by_key(|(_, own)| own.len());
        let Some(from) = most.map(|(from, _)| from.clone()) else {
            return;
        };
        let Some(own) = self.by_sender.get_mut(&from) else {
            return;
        };
        if own.pop_first().is_some() {
            self.count -= 1;
            tracing::warn!(%from, "too many commands are waiting; the oldest one is dropped");
        }
        // Names are as easily made up as commands: nobody is remembered for nothing.
        if own.is_empty() {
            self.by_sender.remove(&from);
        }
    }
}

#[cfg(test)]
mod tests {
    use protocol::messages::Performative;

    use super::*;

    fn command(seq: Seq, epoch: Epoch) -> Command {
        Command {
            epoch,
            tick: 1,
            seq,
            performative: Performative::Achieve,
            command: String::new(),
        }
    }

    fn id(from: &str, seq: Seq) -> CommandId {
        CommandId {
            from: RobotName::new(from).unwrap(),
            seq,
        }
    }

    #[test]
    fn who_floods_loses_its_own() {
        let mut held = Held::default();
        held.hold(id("Quiet", 1).from, command(1, 1));
        for seq in 1..=2 * MAX_COMMANDS as u64 {
            held.hold(id("Flood", seq).from, command(seq, 1));
        }
        assert_eq!(held.count, MAX_COMMANDS);
        assert!(held.take(&id("Quiet", 1), 1).is_some());
        assert!(held.take(&id("Flood", 1), 1).is_none());
        assert!(
            held.take(&id("Flood", 2 * MAX_COMMANDS as u64), 1)
                .is_some()
        );
    }

    #[test]
    fn who_floods_under_many_names_is_forgotten() {
        let mut held = Held::default();
        for sender in 0..MAX_COMMANDS + 500 {
            held.hold(id(&format!("Flood{sender}"), 1).from, command(1, 1));
        }
        assert_eq!(
            (held.count, held.by_sender.len()),
            (MAX_COMMANDS, MAX_COMMANDS)
        );
    }

    #[test]
    fn a_command_is_taken_once_and_only_in_its_epoch() {
        let mut held = Held::default();
        held.hold(id("A", 1).from, command(1, 1));
        held.hold(id("A", 1).from, command(1, 1));
        assert!(held.take(&id("A", 1), 2).is_none());
        assert!(held.take(&id("A", 1), 1).is_some());
        assert!(held.take(&id("A", 1), 1).is_none());
        held.hold(id("A", 2).from, command(2, 1));
        held.hold(id("A", 1).from, command(1, 2));
        held.begin(2);
        assert!(held.take(&id("A", 2), 1).is_none() && held.take(&id("A", 1), 2).is_some());
        assert_eq!(held.count, 0);
    }
}
