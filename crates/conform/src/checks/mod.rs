//! The checks: each takes one process of the robot, or several, through something, and returns what it finds.

mod commands;
mod computing;
mod ends;
mod epochs;
mod joining;
mod news;
mod peers;
mod queries;
mod repeated;
mod returns;
mod run;
mod stdio;
mod ticks;
mod tolerance;
mod waiting;
mod wire;

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, ScopedJoinHandle};

use harness::HarnessOptions;
use harness::findings::{Findings, VerdictsByRule};
use harness::kit::{CannotRun, Kit};
use harness::load::is_machine_busy;
use harness::report::{
    AnswerTimes, CheckReport, KitPart, PlayedRun, RuleFailure, RuleOutcome, RuleVerdict,
};
use harness::rules::{self, ProtocolRule};
use harness::script::{PlayScript, Straight, play, with_robot};
use harness::setting::CheckSetting;

/// What a check does.
type RunCheck = fn(&Kit, &mut Findings) -> Result<(), RuleFailure>;

/// A check, with its rules; the first one gets the failure that breaks it off.
struct Check {
    rules: &'static [&'static str],
    run: RunCheck,
    /// The parts of the kit that it is of.
    parts: &'static [KitPart],
    /// Whether it mostly waits in the first part, so that it is played beside the others.
    is_long: bool,
}

/// The parts in which one thing happens at a time; what fails later counts only where nothing fails before.
const PARTS: [KitPart; 3] = [KitPart::Alone, KitPart::LaterEpoch, KitPart::Rejoined];

const fn rules(rules: &'static [&'static str], run: RunCheck) -> Check {
    Check {
        rules,
        run,
        parts: &PARTS,
        is_long: false,
    }
}

impl Check {
    /// The same check, in these parts only.
    const fn only(self, parts: &'static [KitPart]) -> Self {
        Self { parts, ..self }
    }

    /// The same check, which waits long.
    const fn long(self) -> Self {
        Self {
            is_long: true,
            ..self
        }
    }

    /// What it finds of a robot.
    fn found(&self, kit: &Kit) -> Findings {
        let mut found = Findings::default();
        let end = (self.run)(kit, &mut found);
        found.close(self.rules, end);
        found
    }
}

/// Those of a process as it starts, of what begins another epoch or incarnation, and of a process that has joined again.
const START: [KitPart; 1] = [KitPart::Alone];
const EPOCHS: [KitPart; 2] = [KitPart::Alone, KitPart::LaterEpoch];
const RETURN: [KitPart; 1] = [KitPart::Rejoined];
/// Those of checks that take place in several epochs anyway.
const SAME_EPOCHS: [KitPart; 2] = [KitPart::Alone, KitPart::Rejoined];

/// Checks that need nothing but the usual ticks before; those that take longest begin.
const CHECKS: [Check; 44] = [
    rules(&["epoch.init", "determinism.seed"], epochs::streams),
    rules(&["return.rejoin"], returns::rejoin)
        .only(&EPOCHS)
        .long(),
    rules(&["join.refused"], joining::refused).only(&START),
    rules(&["news.wait"], news::wait).long(),
    rules(&["command.order"], commands::order).only(&SAME_EPOCHS),
    rules(&["end.gone"], ends::gone_for_a_while),
    rules(&["end.gone"], ends::gone_forever),
    rules(&["end.gone"], ends::back_in_time),
    rules(&["end.gone"], ends::paused).only(&START).long(),
    rules(&["query.again"], peers::patient).long(),
    rules(&["tick.newest"], peers::newest),
    rules(&["tick.newest"], peers::newer),
    rules(&["query.reply"], peers::reply),
    rules(&["query.again"], peers::again),
    rules(&["query.waiting"], peers::waiting),
    rules(&["return.own-joined"], peers::own_joined),
    rules(&["query.at-once"], queries::at_once),
    rules(&["query.once"], queries::once),
    rules(&["end.clock"], ends::clock),
    rules(&["epoch.init"], epochs::init).only(&EPOCHS),
    rules(&["epoch.init"], epochs::after_rejoining).only(&RETURN),
    rules(&["epoch.init"], epochs::other_welcome).only(&EPOCHS),
    rules(&["epoch.init"], epochs::while_waiting).only(&EPOCHS),
    rules(&["epoch.late"], epochs::late).only(&EPOCHS),
    rules(&["determinism.seed"], epochs::among_many).only(&START),
    rules(&["return.generation"], returns::generation).only(&START),
    rules(&["return.generation"], returns::commanded).only(&START),
    rules(&["join.ready-last"], joining::ready_last).only(&START),
    rules(
        &[
            "query.tick",
            "tick.initial",
            "tick.correction",
            "tick.state-first",
        ],
        queries::by_tick,
    ),
    rules(&["query.asking"], queries::asking),
    rules(&["query.asking"], queries::unreachable),
    rules(&["query.unknown"], queries::unknown),
    rules(&["command.twice", "command.sent"], commands::many).only(&SAME_EPOCHS),
    rules(&["command.payload"], commands::payload).only(&SAME_EPOCHS),
    rules(&["operator.commands"], commands::from_operator).only(&SAME_EPOCHS),
    rules(&["clock.duplicate"], repeated::duplicate),
    rules(&["clock.late"], repeated::late),
    rules(&["return.replaced"], returns::replaced),
    rules(&["end.sigterm"], ends::sigterm),
    rules(&["compat.unknown-fields"], tolerance::unknown_fields),
    rules(&["number.integers"], tolerance::integers),
    rules(&["robust.malformed"], tolerance::malformed),
    rules(&["wire.keys"], tolerance::commands_of_others),
    rules(&["tick.answer"], ticks::unasked),
];

/// Checks of programs that `cars exec` runs.
const STDIO_CHECKS: [Check; 1] = [rules(&[rules::STDIO_END], stdio::end).only(&START)];
/// Rules whose checks presume that the robot keeps another one: without it they show nothing.
const PRESUMED: [(&str, &str); 24] = [
    // On a loaded machine a clock may come again in any check.
    ("news.wait", "clock.duplicate"),
    ("epoch.late", "clock.duplicate"),
    ("query.reply", "clock.duplicate"),
    ("return.rejoin", "clock.duplicate"),
    ("return.rejoin", "return.generation"),
    ("command.order", "command.payload"),
    ("operator.commands", "command.payload"),
    ("end.gone", "clock.duplicate"),
    ("command.order", "operator.commands"),
    // They are played in several epochs.
    ("command.order", "epoch.init"),
    ("command.twice", "epoch.init"),
    ("command.sent", "epoch.init"),
    ("command.payload", "epoch.init"),
    ("operator.commands", "epoch.init"),
    ("epoch.init", "clock.duplicate"),
    ("epoch.init", "tick.initial"),
    ("epoch.init", "news.wait"),
    ("epoch.init", "tick.newest"),
    ("epoch.init", "query.reply"),
    ("epoch.init", "return.rejoin"),
    ("return.replaced", "return.rejoin"),
    ("tick.newest", "news.wait"),
    ("query.reply", "news.wait"),
    ("query.reply", "query.again"),
];

/// Processes of the robot that run at the same time.
const WORKERS: usize = 12;

/// Checks the robot that `command` starts: all rules, or those in `rules`. Tells how many checks are done, and of how many.
///
/// # Errors
/// [`CannotRun`] if the command cannot be started, or the robot never asks to join.
pub fn check(
    command: &Command,
    setting: &CheckSetting,
    rules: &[ProtocolRule],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<CheckReport, CannotRun> {
    let kit = Kit::open(command, setting)?;
    let AllFindings {
        mut verdicts,
        answers,
        in_run,
        once_more,
    } = all(&kit, rules, progress)?;

    // A rule that is broken in a check may keep another one from being looked at.
    let is_incomplete = rules.iter().any(|rule| !verdicts.contains_key(rule.name));
    let mut outcomes = Vec::new();
    for rule in rules::rules() {
        let verdict = verdicts.remove(rule.name);
        let is_due = if rules.is_empty() {
            kit.stdio.is_program() || !rules::STDIO_RULES.contains(&rule)
        } else {
            // What keeps the robot from getting to the wanted rules after joining again is shown, too.
            let is_shown =
                |failure: &RuleFailure| failure.part == KitPart::Rejoined || is_incomplete;
            rules.contains(&rule)
                || matches!(&verdict, Some(RuleVerdict::Failed(failure)) if is_shown(failure))
        };
        if !is_due {
            continue;
        }
        outcomes.push(RuleOutcome {
            rule,
            verdict: verdict.unwrap_or_else(|| RuleVerdict::Skipped {
                reason: "no check of it was run".to_owned(),
            }),
        });
    }

    Ok(CheckReport {
        name: kit.subject(),
        sdk: kit.sdk(),
        outcomes,
        answers,
        in_run,
        once_more,
    })
}

/// What all checks found.
struct AllFindings {
    verdicts: VerdictsByRule,
    answers: Option<AnswerTimes>,
    in_run: Option<PlayedRun>,
    once_more: BTreeSet<&'static str>,
}

/// The checks that are due, each with the kit of its part, and what they found.
struct Checks<'k> {
    alone: Vec<(&'k Check, &'k Kit)>,
    /// Those of the first part that mostly wait.
    long: Vec<(&'k Check, &'k Kit)>,
    later: Vec<(&'k Check, &'k Kit)>,
    /// In each part, in the order in which it counts.
    found: Mutex<BTreeMap<KitPart, Findings>>,
    once_more: Mutex<BTreeSet<&'static str>>,
    done: AtomicUsize,
    progress: &'k (dyn Fn(usize, usize) + Sync),
}

impl Checks<'_> {
    /// What fails later would not count where something fails before, and takes as long again.
    fn play_all(&self, rejoined: &Kit) {
        self.play(&self.alone);
        let is_broken = lock(&self.found).values().any(Findings::is_broken);
        if is_broken || self.later.is_empty() {
            return;
        }

        // What a robot does that has joined again is compared with what it does then without any disturbance.
        let usual = self.again_if_busy("return.rejoin", || usual_again(rejoined));
        if usual.is_broken() {
            return self.add(rejoined, usual);
        }
        self.play(&self.later);
    }

    /// Takes the robot through checks side by side.
    fn play(&self, due: &[(&Check, &Kit)]) {
        let next = AtomicUsize::new(0);
        let work = || {
            while let Some((check, kit)) = due.get(next.fetch_add(1, Ordering::Relaxed)) {
                let found = self.again_if_busy(check.rules[0], || check.found(kit));
                self.add(kit, found);
                let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(done, self.alone.len() + self.long.len() + self.later.len());
            }
        };
        std::thread::scope(|scope| {
            // This thread is a worker, too, so the checks are made even if the system starts no other one.
            for _ in 1..WORKERS {
                let _fewer_at_once = Builder::new().spawn_scoped(scope, work);
            }
            work();
        });
    }

    /// What a check finds, the second time where the first may have failed because the machine is busy.
    fn again_if_busy(&self, rule: &'static str, check: impl Fn() -> Findings) -> Findings {
        let (found, is_again) = again_if(is_machine_busy, check);
        if is_again {
            lock(&self.once_more).insert(rule);
        }
        found
    }

    /// Each check finds for itself, and is merged as a whole: the order in which they end changes nothing.
    fn add(&self, kit: &Kit, mut own: Findings) {
        if kit.part() != KitPart::Alone {
            own = own.of_part(kit.part());
        }
        lock(&self.found).entry(kit.part()).or_default().merge(own);
    }
}

/// What a check finds, and whether it was made again. On a busy machine a link may break, or a process not start in time, where a robot
/// does nothing wrong: there such a failure counts only if it comes twice.
fn again_if(is_busy: impl Fn() -> bool, check: impl Fn() -> Findings) -> (Findings, bool) {
    let found = check();
    if found.may_be_load() && is_busy() {
        return (check(), true);
    }
    (found, false)
}

/// What a thread does, or is done now if the system has not started it.
fn joined<T>(thread: io::Result<ScopedJoinHandle<'_, T>>, work: impl FnOnce() -> T) -> T {
    match thread.map(ScopedJoinHandle::join) {
        Ok(Ok(done)) => done,
        Ok(Err(panic)) => std::panic::resume_unwind(panic),
        Err(_) => work(),
    }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Plays the usual ticks in this part, for comparison. Finds the rule that keeps the robot from getting through them.
fn usual_again(kit: &Kit) -> Findings {
    let mut found = Findings::default();
    let mut harness = match with_robot(kit, HarnessOptions::default()) {
        Ok(harness) => harness,
        Err(failure) => {
            found.fail("return.rejoin", failure);
            return found;
        }
    };

    match play(&mut harness, &PlayScript::usual(kit), &mut Straight) {
        Ok(played) => {
            let is_first = kit.usual().set(played).is_ok();
            assert!(is_first, "they are played to their end once in each part");
        }
        Err(failure) if harness.has_wrong_commands() => found.fail("command.sent", failure),
        Err(failure) => found.fail("return.rejoin", failure),
    }
    found
}

/// Takes the robot through all checks that the wanted rules need.
fn all(
    kit: &Kit,
    wanted: &[ProtocolRule],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<AllFindings, CannotRun> {
    let mut findings = Findings::default();
    // First and alone: all other checks compare with these ticks, and a robot that does not get through
    // them shows nothing else.
    let (broken, answers) = ticks::usual(kit, &mut findings)?;
    if let Some(rule) = broken {
        let reason = format!("the robot does not get through the usual ticks, see {rule}");
        stdio::judge(kit, &mut findings);
        for rule in rules::rules() {
            findings.skip(rule.name, &reason);
        }
        return Ok(AllFindings {
            verdicts: findings.0,
            answers,
            in_run: None,
            once_more: BTreeSet::new(),
        });
    }
    // Then whether the robot repeats itself: if not, differences mean nothing.
    let again = epochs::same_seed(kit, &mut findings);
    findings.close(&["determinism.seed"], again);

    let is_wanted =
        |rules: &[&str]| wanted.is_empty() || wanted.iter().any(|rule| rules.contains(&rule.name));
    let kits = PARTS.map(|part| kit.of_part(part));
    let mut checks = Checks {
        alone: Vec::new(),
        long: Vec::new(),
        later: Vec::new(),
        found: Mutex::default(),
        once_more: Mutex::default(),
        done: AtomicUsize::new(0),
        progress,
    };
    for kit in &kits {
        for check in CHECKS.iter().chain(&STDIO_CHECKS) {
            if check.parts.contains(&kit.part()) && is_wanted(check.rules) {
                let due = match kit.part() {
                    KitPart::Alone if check.is_long => &mut checks.long,
                    KitPart::Alone => &mut checks.alone,
                    _ => &mut checks.later,
                };
                due.push((check, kit));
            }
        }
    }
    let play_run = || {
        is_wanted(&run::RULES).then(|| {
            checks.again_if_busy("determinism.seed", || {
                let mut own = Findings::default();
                run::check(kit, &mut own);
                own
            })
        })
    };
    let play_long = || checks.play(&checks.long);
    // They wait most of the time, beside the other checks.
    let found_in_run = std::thread::scope(|scope| {
        let run = Builder::new().spawn_scoped(scope, play_run);
        let long = Builder::new().spawn_scoped(scope, play_long);
        checks.play_all(&kit.of_part(KitPart::Rejoined));
        joined(long, play_long);
        joined(run, play_run)
    });

    // A robot that breaks a rule alone breaks others by it later and in a run, where nothing is for itself.
    let mut found = std::mem::take(&mut *lock(&checks.found));
    let once_more = std::mem::take(&mut *lock(&checks.once_more));
    let in_run = found_in_run.is_some().then(|| run::extent(kit));
    found.insert(KitPart::InRun, found_in_run.unwrap_or_default());
    for mut further in found.into_values() {
        further.presume(&PRESUMED);
        if !findings.is_broken() {
            findings.merge(further);
        }
    }
    stdio::judge(kit, &mut findings);
    Ok(AllFindings {
        verdicts: findings.0,
        answers,
        in_run,
        once_more,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_busy_machine_can_cause_is_checked_once_more() {
        let failures = [
            RuleFailure::maybe_of_load("a report", "it never came"),
            RuleFailure::new("the same moves", "others"),
        ];
        for (failure, is_busy, attempts) in [
            (&failures[0], true, 2),
            (&failures[0], false, 1),
            (&failures[1], true, 1),
        ] {
            let made = AtomicUsize::new(0);
            let (found, is_again) = again_if(
                || is_busy,
                || {
                    let mut found = Findings::default();
                    if made.fetch_add(1, Ordering::Relaxed) == 0 {
                        found.fail("tick.answer", failure.clone());
                    }
                    found
                },
            );
            assert_eq!(made.into_inner(), attempts, "{failure:?}");
            assert_eq!(
                (is_again, found.is_broken()),
                (attempts == 2, attempts == 1)
            );
        }
    }

    #[test]
    fn each_rule_has_a_check() {
        let mut checked: Vec<&str> = CHECKS
            .iter()
            .chain(&STDIO_CHECKS)
            .flat_map(|check| check.rules)
            .chain(&ticks::USUAL)
            .chain(&stdio::ALWAYS)
            .copied()
            .collect();
        checked.sort_unstable();
        checked.dedup();

        let mut rules: Vec<&str> = rules::rules().map(|rule| rule.name).collect();
        rules.sort_unstable();
        assert_eq!(checked, rules);
    }
}
