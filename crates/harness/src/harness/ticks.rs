//! Ticks: granted, waited for, repeated, missed.

use std::collections::BTreeSet;
use std::time::Instant;

use lockstep::LatePolicy;
use protocol::messages::{Clock, Command, End, OnLate, Report, Target, TickUpdate};
use protocol::{RobotName, Tick};

use super::{CompleteTick, Harness, patient};
use crate::flushing;
use crate::patience::PATIENCE;
use crate::report::RuleFailure;
use crate::seen::ReportedCommand;

/// A robot that has put its report so often without all commands that it states does not put them at all.
const INCOMPLETE: usize = 3;

impl Harness<'_> {
    /// Whether the tick that was granted last is open.
    pub fn is_open(&self) -> bool {
        self.barrier.is_open()
    }

    /// Whether the robot has put a report for a tick of the epoch under way.
    pub fn has_answered(&self, tick: Tick) -> bool {
        self.seen.answers.iter().any(|answer| {
            let report = &answer.reading.report;
            (report.epoch, report.tick) == (self.epoch, tick)
        })
    }

    /// The robot's flag in clocks.
    pub fn flag(&self) -> u32 {
        let subject = self.kit.subject();
        let index = self.barrier.roster().position(|name| *name == subject);

        1 << (index.unwrap_or_default() % protocol::messages::NEWS_FLAGS)
    }

    /// Puts a clock.
    pub fn put_clock(&self, clock: &Clock) -> Result<(), RuleFailure> {
        self.put_as_clock(&self.fake_peers.dress(clock))
    }

    /// Puts something else on the key of clocks.
    pub fn put_as_clock(&self, bytes: &[u8]) -> Result<(), RuleFailure> {
        self.wire.put_clock(bytes.to_vec())
    }

    /// Puts news for the robot.
    pub fn put_news(&self, news: &TickUpdate) -> Result<(), RuleFailure> {
        self.put_as_news(&self.fake_peers.dress(news))
    }

    /// Puts something else on the key of its news.
    pub fn put_as_news(&self, bytes: &[u8]) -> Result<(), RuleFailure> {
        self.wire.put_news(&self.kit.subject(), bytes.to_vec())
    }

    /// Puts commands to the robot as the operator and another robot do, for the medium, which here delivers none of them.
    pub fn send_to_medium(&self) -> Result<(), RuleFailure> {
        let subject = self.kit.subject();
        let sender = self.kit.sender();
        for text in self.kit.texts() {
            let command = Command {
                command: text,
                ..Command::default()
            };
            self.wire.put_command(
                &self.keys.command(&subject, &RobotName::operator()),
                &command,
            )?;

            let stamped = Command {
                epoch: self.epoch,
                tick: self.next,
                generation: self.generation(),
                number: 1,
                to: Some(Target::Robot(subject.clone())),
                ..command
            };
            for key in [
                self.keys.command(&subject, &sender),
                self.keys.outbox(&sender),
            ] {
                self.wire.put_command(&key, &stamped)?;
            }
        }
        Ok(())
    }

    /// Deletes the keys of clocks and of the robot's news.
    pub fn delete_keys(&self) -> Result<(), RuleFailure> {
        self.wire.delete(&self.kit.subject())
    }

    /// Puts the last clock and its news again.
    pub fn repeat(&mut self) {
        self.drive(lockstep::Barrier::repeat);
    }

    /// The news of the open tick, as they are put.
    pub fn open_news(&self) -> TickUpdate {
        let generation = self.generation();
        TickUpdate {
            epoch: self.epoch,
            tick: self.next.saturating_sub(1),
            // A further incarnation is always named.
            joined: self.news.joined.or((generation > 1).then_some(generation)),
            ..self.news.clone()
        }
    }

    /// Puts the news of the open tick that were withheld. If a broken link loses them, they are put again with their clock.
    pub fn release_news(&mut self) -> Result<(), RuleFailure> {
        self.withholds_news = false;
        self.put_news(&self.open_news())
    }

    /// Grants the next tick with these news.
    pub fn open(&mut self, news: &TickUpdate) -> Result<(), RuleFailure> {
        self.until("all robots are connected", PATIENCE, |harness| {
            harness.is_gathered.then_some(())
        })?;

        let tick = self.next;
        let news = self.with_senses(news.clone());
        let mut named = BTreeSet::new();
        if !news.is_empty() {
            named.insert(self.kit.subject());
        }

        self.news = news;
        self.next += 1;
        // Before the barrier opens the tick, which it may complete at once: where the robot is lost.
        self.outcome = None;
        self.begun = Instant::now();
        self.drive(|barrier, out| barrier.open(tick, named, out));
        Ok(())
    }

    /// Whether the robot senses something in every tick, so that there is no tick without news for it.
    pub fn has_steady_senses(&self) -> bool {
        !self.with_senses(TickUpdate::default()).is_empty()
    }

    /// News with what the robot senses in every tick: its pose if it drives, its rays, and layers.
    fn with_senses(&self, news: TickUpdate) -> TickUpdate {
        let drives = self.template.drive.is_some();
        TickUpdate {
            pose: drives.then(|| self.body.pose()),
            ranges: self.kit.ranges_m(),
            layers: self.kit.layers_at(self.body.stands),
            ..news
        }
    }

    /// Waits until the robot has reported, or has asked another one that holds its answer back.
    pub fn until_asking(&mut self) -> Result<(), RuleFailure> {
        self.until("a report or a query", PATIENCE, |harness| {
            (harness.fake_peers.has_held() || !harness.is_open()).then_some(())
        })
    }

    /// Waits until the open tick is complete.
    pub fn complete(&mut self) -> Result<CompleteTick, RuleFailure> {
        let tick = self.next.saturating_sub(1);
        let expected = format!("a report for tick {tick} of epoch {}", self.epoch);
        let came = self.until(&expected, PATIENCE, |harness| {
            if let Some(outcome) = harness.outcome.take() {
                return Some(Ok(outcome));
            }
            // What can never become right ends the wait at once, with a better reason than time.
            harness.hopeless(tick).map(Err)
        });
        let mut outcome = match came {
            Ok(came) => came?,
            Err(mut failure) => {
                let reason = self.seen.unreadable.last().cloned();
                if let Some(reason) = reason.or_else(|| self.unflushed()) {
                    failure.came = format!("{}; {reason}", failure.came);
                }
                return Err(failure);
            }
        };

        let subject = self.kit.subject();
        let own = outcome.reports.remove(&subject);
        let came = own.and_then(|(index, commands)| {
            let answer = self.seen.answers.get(index)?;
            Some((index, commands, answer))
        });
        let Some((index, commands, answer)) = came else {
            return Err(RuleFailure::new(expected, "the clock went on without one"));
        };

        Ok(CompleteTick {
            report: answer.reading.report.clone(),
            commands: commands.into_iter().map(|put| put.command).collect(),
            index,
            took: answer.at.saturating_duration_since(self.begun),
        })
    }

    /// Why a program behind `cars exec` does not answer, if it rests: it does not compute, and waits for what never comes.
    fn unflushed(&mut self) -> Option<String> {
        let program = flushing::program_of(&self.kit.command)?;
        let is_waiting = self.process.ended().is_none() && self.process.is_idle();
        is_waiting.then(|| flushing::unflushed(&program))
    }

    /// Why the open tick will never be complete, if that is known.
    fn hopeless(&self, tick: Tick) -> Option<RuleFailure> {
        let (generation, _) = self.barrier.presence(&self.kit.subject());
        let reports = self
            .seen
            .answers
            .iter()
            .map(|answer| &answer.reading.report);
        let wrong = reports
            .filter(|report| report.tick == tick)
            .find(|report| report.generation != generation && report.epoch == self.epoch);
        if let Some(report) = wrong {
            return Some(RuleFailure::new(
                format!("a report of generation {generation} for tick {tick}"),
                format!("one of generation {}", report.generation),
            ));
        }

        if let Some(sent) = self.misstamped() {
            return Some(RuleFailure::new(
                format!("commands of generation {generation} in tick {tick}, as its report is"),
                sent,
            ));
        }

        let stated = self.incomplete()?;
        Some(RuleFailure::new(
            format!("{stated} commands, put before the report of tick {tick} that states so many"),
            self.commands_of(tick),
        ))
    }

    /// Whether the commands of the open tick are not those that the report states, or not of the robot's generation.
    pub fn has_wrong_commands(&self) -> bool {
        self.incomplete().is_some() || self.misstamped().is_some()
    }

    /// A command of the open tick that has another generation than the robot, in words.
    fn misstamped(&self) -> Option<String> {
        let generation = self.generation();
        let at = (self.epoch, self.next.saturating_sub(1));
        self.seen
            .commands
            .iter()
            .filter_map(|sent| sent.command.as_ref().ok())
            .find(|command| (command.epoch, command.tick) == at && command.generation != generation)
            .map(|command| {
                format!(
                    "number {} of generation {}",
                    command.number, command.generation
                )
            })
    }

    /// How many commands the robot states for the open tick again and again, and does not put.
    pub fn incomplete(&self) -> Option<u32> {
        if !self.barrier.is_open() {
            return None;
        }

        let at = (self.epoch, self.next.saturating_sub(1));
        let of_tick: Vec<&Report> = self
            .seen
            .answers
            .iter()
            .map(|answer| &answer.reading.report)
            .filter(|report| (report.epoch, report.tick) == at && report.commands > 0)
            .collect();
        let stated = of_tick.first()?.commands;
        (of_tick.len() >= INCOMPLETE).then_some(stated)
    }

    /// The commands of a tick as they came, in words.
    fn commands_of(&self, tick: Tick) -> String {
        let numbers: BTreeSet<u32> = self
            .seen
            .commands
            .iter()
            .filter(|sent| sent.tick() == Some(tick))
            .filter_map(ReportedCommand::number)
            .collect();

        format!("commands with the numbers {numbers:?}")
    }

    /// Grants the next tick while the robot is cut off, and goes on without it: it is lost.
    pub fn miss(&mut self) -> Result<(), RuleFailure> {
        self.is_cut_off = true;
        self.go_on_without()?;
        self.is_cut_off = false;
        Ok(())
    }

    /// Grants the next tick, which the robot cannot answer, and goes on without it: it is lost.
    pub fn go_on_without(&mut self) -> Result<(), RuleFailure> {
        let impatient = LatePolicy {
            on_late: OnLate::Continue,
            ..patient()
        };
        self.drive(|barrier, out| barrier.set_lateness(impatient, out));
        self.open(&TickUpdate::default())?;
        self.until("the clock goes on", PATIENCE, |harness| {
            harness.outcome.take()
        })?;

        // From here on the barrier waits again, whatever happens.
        self.drive(|barrier, out| barrier.set_lateness(patient(), out));
        Ok(())
    }

    /// Ends the run. Returns the clock that says so.
    pub fn end(&mut self, end: End) -> Clock {
        self.barrier.end(end)
    }

    /// Undeclares the simulator's liveliness token, or declares it again. Returns when that is done.
    pub fn show_simulator(&mut self, is_present: bool) -> Result<Instant, RuleFailure> {
        self.wire.show_simulator(is_present)?;
        Ok(Instant::now())
    }
}
