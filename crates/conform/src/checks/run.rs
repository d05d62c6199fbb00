//! The second part of the kit, "in a run": a run of at least three robots, whose clock goes on without robots that do not
//! report, with all that happens to a robot there.
//!
//! The run is played twice, and once without what must make no difference: the other robots then answer at once, nothing
//! is early and nothing is lost. Each tick has at most one disturbance, and each belongs to a rule: the first tick in which
//! the plays differ names the rule that is broken. Which ticks the robot misses is the kit's decision, and never the
//! deadline's: a robot that a loaded machine does not let run misses none.

use std::thread::Builder;
use std::time::Duration;

use nix::sys::signal::Signal;
use protocol::messages::TickUpdate;
use protocol::{RobotName, Tick};

use super::{ticks, wire};
use harness::comparison::difference;
use harness::fake_peers::Unhelpful;
use harness::findings::Findings;
use harness::kit::{Kit, KitRoster};
use harness::report::{KitPart, PlayedRun, RuleFailure};
use harness::script::{Disturbance, PlayScript, inherit, step, with_robot};
use harness::transcript::{PlayedTick, Transcript};
use harness::{Harness, HarnessOptions};

/// The rules that the part in a run can find broken.
pub(super) const RULES: [&str; 13] = [
    "command.sent",
    "news.wait",
    "query.reply",
    "query.again",
    "return.own-joined",
    "return.generation",
    "return.rejoin",
    "end.gone",
    "determinism.seed",
    "number.angles",
    "wire.qos",
    "wire.keys",
    "tick.answer",
];

/// Ticks of the run after the first.
const TICKS: Tick = 46;
/// The ticks after which the process hangs and is killed, and the ticks that it misses each time.
const HANG_AFTER: Tick = 11;
const CRASH_AFTER: Tick = 26;
const MISSED: Tick = 2;
/// The tick after which the simulator's token is gone, and for how long: longer than any lease, as after a cut.
const CUT_AFTER: Tick = 36;
const CUT: Duration = Duration::from_secs(7);
/// How long the robot is to wait for it, seconds: so long that no machine uses it up meanwhile.
const GONE_PATIENCE_S: u32 = 60;
/// How often the run is played with all of this.
const PLAYS: usize = 2;
/// What was put has arrived after this time, also at a robot that rests.
const ARRIVED: Duration = Duration::from_millis(100);
/// How late the others answer: a robot says after 0.25 s that it waits.
const LATE: Duration = Duration::from_millis(300);

/// What is different in a tick, and must make no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TickDisturbance {
    /// Nothing.
    Quiet,
    /// The states of the others for this tick arrive before its news.
    EarlyStates,
    /// The others answer late.
    LateAnswers,
    /// They answer first with a refusal, with nothing, or with the state of an earlier tick.
    Unhelpful(Unhelpful),
    /// The clock has the flags of all robots, and the news come after it.
    AllFlags,
    /// The news name the robot's own generation, or a lower one if it is a further incarnation.
    Joined,
}

impl TickDisturbance {
    /// That of a tick.
    fn of(tick: Tick) -> Self {
        let begins = [0, HANG_AFTER, CRASH_AFTER];
        let is_quiet = begins
            .into_iter()
            .any(|after| (after..=after + MISSED + 2).contains(&tick))
            || tick == CUT_AFTER + 1;
        if is_quiet {
            return Self::Quiet;
        }

        match tick % 7 {
            0 => Self::EarlyStates,
            1 => Self::Unhelpful(Unhelpful::Refusal),
            2 => Self::Joined,
            3 => Self::Unhelpful(Unhelpful::EarlierState),
            // In tick 18, in which all others can be queried; in tick 40, an even one of the others, none can.
            4 => Self::LateAnswers,
            5 => Self::AllFlags,
            _ => Self::Unhelpful(Unhelpful::Silence),
        }
    }

    /// The rule by which it makes no difference; none for quiet ticks.
    fn rule(self) -> Option<&'static str> {
        match self {
            Self::Quiet => None,
            Self::EarlyStates | Self::Unhelpful(Unhelpful::EarlierState) => Some("query.reply"),
            Self::LateAnswers | Self::Unhelpful(_) => Some("query.again"),
            Self::AllFlags => Some("news.wait"),
            Self::Joined => Some("return.own-joined"),
        }
    }
}

/// The rule that a difference in a tick breaks: that of what happened last.
fn rule_of(tick: Tick) -> &'static str {
    for tick in (0..=tick).rev() {
        if tick == CUT_AFTER + 1 {
            return "end.gone";
        }
        if tick == CRASH_AFTER {
            return "return.generation";
        }
        if tick == HANG_AFTER {
            return "return.rejoin";
        }
        if let Some(rule) = TickDisturbance::of(tick).rule() {
            return rule;
        }
    }
    "determinism.seed"
}

/// What is broken, and the rule.
type BrokenRule = (&'static str, RuleFailure);

/// One play of the run.
struct RunPlay {
    is_disturbed: bool,
}

impl Disturbance for RunPlay {
    fn news(&mut self, harness: &Harness<'_>, news: &mut TickUpdate) {
        // In the undisturbed run, too: a robot that is placed where it stands may take notice.
        let tick = harness.next_tick();
        let kind = TickDisturbance::of(tick);
        if kind == TickDisturbance::Quiet {
            return;
        }
        news.correction = news.correction.or(Some(harness.body.confirmed()));
        if kind == TickDisturbance::Joined && self.is_disturbed && !harness.takes_over() {
            let generation = harness.generation();
            news.joined = Some(generation.saturating_sub(1).max(1));
        }
    }

    fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
        let kind = if self.is_disturbed {
            TickDisturbance::of(tick)
        } else {
            TickDisturbance::Quiet
        };
        harness.withholds_news = matches!(
            kind,
            TickDisturbance::EarlyStates | TickDisturbance::AllFlags
        );
        harness.more_flags = if kind == TickDisturbance::AllFlags {
            u32::MAX
        } else {
            0
        };
        // Where states are put, a robot that follows the others need not query them.
        harness.set_puts_states(!matches!(
            kind,
            TickDisturbance::LateAnswers | TickDisturbance::Unhelpful(_)
        ));

        match kind {
            TickDisturbance::Unhelpful(reply) => harness.fake_peers.be_unhelpful(&[reply]),
            TickDisturbance::LateAnswers => harness.fake_peers.hold(),
            _ => harness.fake_peers.be_unhelpful(&[]),
        }
        Ok(())
    }

    fn during(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
        if !self.is_disturbed {
            return Ok(());
        }

        match TickDisturbance::of(tick) {
            TickDisturbance::EarlyStates => {
                harness.put_early_states()?;
                harness.pass(ARRIVED);
                harness.release_news()
            }
            TickDisturbance::AllFlags => {
                harness.settle(ARRIVED);
                if harness.has_answered(tick) {
                    return Err(RuleFailure::new(
                        format!(
                            "no report for tick {tick}, whose clock has the flags of all robots, before its news"
                        ),
                        "a report",
                    ));
                }
                harness.release_news()
            }
            TickDisturbance::LateAnswers => {
                harness.until_asking()?;
                // The simulator is gone meanwhile: nothing else tells a robot that it may stop asking.
                harness.show_simulator(false)?;
                if harness.is_open() {
                    harness.pass(LATE);
                }
                harness.show_simulator(true)?;
                harness.fake_peers.release();
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn after(&mut self, harness: &mut Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
        if let Some(of) = harness.fake_peers.given_up() {
            return Err(RuleFailure::new(
                format!("queries of {of} in tick {} until it answers", entry.tick),
                "the report, after a query that had no answer",
            ));
        }
        if self.is_disturbed && entry.tick == CUT_AFTER {
            harness.show_simulator(false)?;
            harness.pass(CUT);
            harness.show_simulator(true)?;
        }
        Ok(())
    }
}

/// Commands of both words in turn, from all others at once, to the end: whichever of the words sends a robot to sleep, it is
/// awake in half of the ticks.
fn script(kit: &Kit) -> PlayScript {
    let senders: Vec<RobotName> = kit.others(KitRoster::InRun).into_keys().collect();
    PlayScript::in_turn(kit, &senders, TICKS)
}

/// Plays the run: until its end, or until something is broken.
fn played(kit: &Kit, is_disturbed: bool) -> Result<(Transcript, Findings), BrokenRule> {
    let options = HarnessOptions {
        gone_patience_s: GONE_PATIENCE_S,
        roster: KitRoster::InRun,
        ..HarnessOptions::default()
    };
    let mut harness = with_robot(kit, options).map_err(|failure| ("tick.answer", failure))?;
    harness.asks_early = is_disturbed;
    let mut play = RunPlay { is_disturbed };
    let script = script(kit);

    let mut transcript = Transcript::new();
    while harness.next_tick() <= TICKS {
        let tick = harness.next_tick();
        match played_tick(&mut harness, &script, &mut play, &transcript) {
            Ok(entry) => transcript.push(entry),
            Err(failure) => {
                let rule = if harness.has_wrong_commands() {
                    "command.sent"
                } else if is_disturbed {
                    rule_of(tick)
                } else if tick > CRASH_AFTER {
                    "return.generation"
                } else if tick > HANG_AFTER {
                    "return.rejoin"
                } else {
                    "tick.answer"
                };
                return Err((rule, failure));
            }
        }
    }

    let mut findings = Findings::default();
    wire::check(&harness, &mut findings);
    ticks::check_numbers(&harness, &transcript, &mut findings);
    for entry in &transcript {
        ticks::check_tick(&harness, entry).map_err(|failure| ("command.sent", failure))?;
    }
    Ok((transcript, findings))
}

/// Plays the next tick, and before it what happens to the process.
fn played_tick(
    harness: &mut Harness<'_>,
    script: &PlayScript,
    play: &mut RunPlay,
    transcript: &Transcript,
) -> Result<PlayedTick, RuleFailure> {
    let before = harness.next_tick().checked_sub(1);
    if before == Some(HANG_AFTER) {
        hang(harness, play.is_disturbed, transcript)?;
    }
    if before == Some(CRASH_AFTER) {
        crash(harness, transcript)?;
    }
    step(harness, script, play)
}

/// The process is stopped, misses ticks, goes on, and joins again as a further incarnation. Where the run is not disturbed, it
/// is cut off instead: it must make no difference which clocks wait for it.
fn hang(
    harness: &mut Harness<'_>,
    is_disturbed: bool,
    transcript: &Transcript,
) -> Result<(), RuleFailure> {
    let generation = harness.generation();
    inherit(harness, transcript, generation + 1);
    if is_disturbed {
        harness.hang()?;
        for _ in 0..MISSED {
            harness.go_on_without()?;
        }
        harness.process.signal(Signal::SIGCONT);
    } else {
        for _ in 0..MISSED {
            harness.miss()?;
        }
    }

    // The clock that asks it to join again does not wait for it, either.
    harness.open(&TickUpdate::default())?;
    harness.until_rejoined(generation)
}

/// The process is killed, misses ticks, and another one follows.
fn crash(harness: &mut Harness<'_>, transcript: &Transcript) -> Result<(), RuleFailure> {
    let generation = harness.generation();
    inherit(harness, transcript, generation + 1);
    harness.crash()?;
    for _ in 0..MISSED {
        harness.go_on_without()?;
    }
    harness.restart()
}

/// The robot in a run: its records are the same, and those that the rules demand.
pub(super) fn check(kit: &Kit, findings: &mut Findings) {
    let mut plays = Vec::new();
    std::thread::scope(|scope| {
        let mut others = Vec::new();
        for is_disturbed in [false, true] {
            let work = move || played(kit, is_disturbed);
            others.push((is_disturbed, Builder::new().spawn_scoped(scope, work)));
        }
        let own = played(kit, true);
        for (is_disturbed, other) in others {
            // Where the system starts no other thread, this one plays.
            let play = match other.map(std::thread::ScopedJoinHandle::join) {
                Ok(Ok(play)) => play,
                Ok(Err(panic)) => std::panic::resume_unwind(panic),
                Err(_) => played(kit, is_disturbed),
            };
            plays.push(play);
        }
        plays.push(own);
    });

    if let Err((rule, mut failure)) = judged(kit, plays, findings) {
        failure.part = KitPart::InRun;
        findings.fail(rule, failure);
    }
}

/// What it consists of.
pub(super) fn extent(kit: &Kit) -> PlayedRun {
    PlayedRun {
        robots: kit.others(KitRoster::InRun).len() + 1,
        ticks: TICKS,
        plays: PLAYS,
    }
}

/// The undisturbed play is the first.
fn judged(
    kit: &Kit,
    plays: Vec<Result<(Transcript, Findings), BrokenRule>>,
    findings: &mut Findings,
) -> Result<(), BrokenRule> {
    let mut records = Vec::new();
    for play in plays {
        let (record, own) = play?;
        findings.merge(own.of_part(KitPart::InRun));
        records.push(record);
    }
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(());
    }

    let mut records = records.iter();
    let Some(wanted) = records.next() else {
        return Ok(());
    };
    for record in records {
        if let Some(found) = difference(wanted, record) {
            let rule = found.tick.map_or("tick.answer", rule_of);
            let expected = format!("as in the undisturbed run, {}", found.first);
            return Err((rule, RuleFailure::new(expected, found.second)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_disturbance_comes_in_even_and_odd_ticks_and_names_its_rule() {
        for rule in RULES[1..5].iter().chain(&RULES[5..8]) {
            let mut of_rule = (0..=TICKS).filter(|tick| rule_of(*tick) == *rule);
            assert!(of_rule.next().is_some(), "{rule}");
        }
        for wanted in 0..7 {
            let of_kind: Vec<Tick> = (1..=TICKS)
                .filter(|tick| tick % 7 == wanted)
                .filter(|tick| TickDisturbance::of(*tick) != TickDisturbance::Quiet)
                .collect();
            assert!(of_kind.iter().any(|tick| tick % 2 == 0), "{of_kind:?}");
            assert!(of_kind.iter().any(|tick| tick % 2 == 1), "{of_kind:?}");
        }
    }
}
