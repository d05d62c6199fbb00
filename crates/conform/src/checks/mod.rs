//! The checks: each takes a process of the robot, or several, through something and says what it finds.

mod commands;
mod ends;
mod epochs;
mod joining;
mod news;
mod queries;
mod repeated;
mod returns;
mod ticks;
mod tolerance;

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::kit::{CannotRun, Kit};
use crate::report::{AnswerTimes, Failure, Verdict};
use crate::rules::{RULES, Rule};
use crate::script::{Script, Straight, Transcript, play};
use crate::stage::{Options, Stage};

/// What was found, by rule.
pub(crate) type Verdicts = BTreeMap<&'static str, Verdict>;

/// What one check finds.
#[derive(Default)]
pub(crate) struct Findings(Verdicts);

impl Findings {
    /// The rule is broken. The first failure of a rule is the one that is told.
    fn fail(&mut self, rule: &'static str, failure: Failure) {
        if !matches!(self.0.get(rule), Some(Verdict::Failed(_))) {
            self.0.insert(rule, Verdict::Failed(failure));
        }
    }

    /// The rule holds, unless it was found broken.
    fn pass(&mut self, rule: &'static str) {
        self.0.entry(rule).or_insert(Verdict::Passed);
    }

    /// The rule holds, or is broken.
    fn settle(&mut self, rule: &'static str, result: Result<(), Failure>) {
        match result {
            Ok(()) => self.pass(rule),
            Err(failure) => self.fail(rule, failure),
        }
    }

    /// This robot gives no occasion to see it.
    fn skip(&mut self, rule: &'static str, reason: &str) {
        self.0.entry(rule).or_insert_with(|| Verdict::Skipped {
            reason: reason.to_owned(),
        });
    }

    /// Adds what another check found: the worse verdict counts.
    fn merge(&mut self, other: Self) {
        for (rule, verdict) in other.0 {
            match verdict {
                Verdict::Failed(failure) => self.fail(rule, failure),
                Verdict::Passed => match self.0.get(rule) {
                    None | Some(Verdict::Skipped { .. }) => {
                        self.0.insert(rule, verdict);
                    }
                    _ => {}
                },
                Verdict::Skipped { reason } => self.skip(rule, &reason),
            }
        }
    }

    /// A check of these rules came to its end, or broke off: then the first rule tells why, and nothing is known of the
    /// others.
    fn close(&mut self, rules: &[&'static str], end: Result<(), Failure>) {
        let lead = rules.first().copied().unwrap_or_default();
        match end {
            Ok(()) => rules.iter().for_each(|rule| self.pass(rule)),
            Err(failure) => {
                self.fail(lead, failure);
                let reason = format!("the check did not get so far, see {lead}");
                rules.iter().for_each(|rule| self.skip(rule, &reason));
            }
        }
    }
}

/// A check, with its rules; the first one is told what breaks it off.
struct Check {
    rules: &'static [&'static str],
    run: fn(&Kit, &mut Findings) -> Result<(), Failure>,
}

const fn check(
    rules: &'static [&'static str],
    run: fn(&Kit, &mut Findings) -> Result<(), Failure>,
) -> Check {
    Check { rules, run }
}

/// Checks that need nothing but the usual ticks before; those that take longest begin.
const CHECKS: [Check; 25] = [
    check(&["join.refused"], joining::refused),
    check(&["end.gone"], ends::gone),
    check(&["query.at-once"], queries::at_once),
    check(&["query.once"], queries::once),
    check(&["end.clock"], ends::clock),
    check(&["news.wait"], news::wait),
    check(&["epoch.init"], epochs::init),
    check(&["epoch.late"], epochs::late),
    check(&["return.generation"], returns::generation),
    check(&["return.rejoin"], returns::rejoin),
    check(&["join.ready-last"], joining::ready_last),
    check(
        &[
            "query.tick",
            "tick.initial",
            "tick.correction",
            "tick.state-first",
        ],
        queries::by_tick,
    ),
    check(&["query.asking"], queries::asking),
    check(&["query.unknown"], queries::unknown),
    check(&["command.order"], commands::order),
    check(&["command.twice"], commands::twice),
    check(&["operator.commands"], commands::from_operator),
    check(&["clock.duplicate"], repeated::duplicate),
    check(&["clock.late"], repeated::late),
    check(&["return.replaced"], returns::replaced),
    check(&["end.sigterm"], ends::sigterm),
    check(&["compat.unknown-fields"], tolerance::unknown_fields),
    check(&["robust.malformed"], tolerance::malformed),
    check(&["tick.answer"], ticks::unasked),
    check(&["determinism.seed"], epochs::streams),
];

/// Takes the robot through all checks that the wanted rules need.
pub(crate) fn all(
    kit: &Kit,
    wanted: &[Rule],
    workers: usize,
) -> Result<(Verdicts, Option<AnswerTimes>), CannotRun> {
    let mut findings = Findings::default();
    let (broken, times) = ticks::usual(kit, &mut findings)?;
    if let Some(rule) = broken {
        let reason = format!("the robot does not get through the usual ticks, see {rule}");
        let reason = &reason;
        RULES
            .iter()
            .for_each(|rule| findings.skip(rule.name, reason));
        return Ok((findings.0, times));
    }
    let again = epochs::same_seed(kit, &mut findings);
    findings.close(&["determinism.seed"], again);

    let is_wanted = |check: &&Check| {
        wanted.is_empty() || wanted.iter().any(|rule| check.rules.contains(&rule.name))
    };
    let due: Vec<&Check> = CHECKS.iter().filter(is_wanted).collect();
    let (next, all) = (AtomicUsize::new(0), Mutex::new(findings));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(check) = due.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let mut own = Findings::default();
                    let end = (check.run)(kit, &mut own);
                    own.close(check.rules, end);
                    all.lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .merge(own);
                }
            });
        }
    });
    Ok((
        all.into_inner().unwrap_or_else(PoisonError::into_inner).0,
        times,
    ))
}

/// A robot that has joined a run of its own, ready for its first clock.
fn seated(kit: &Kit, options: Options) -> Result<Stage<'_>, Failure> {
    let mut stage = Stage::open_run(kit, options)?;
    stage.join()?;
    Ok(stage)
}

/// A process of its own, taken straight through a script.
fn played(kit: &Kit, script: &Script) -> Result<Transcript, Failure> {
    let mut stage = seated(kit, Options::default())?;
    play(&mut stage, script, &mut Straight)
}

/// The usual ticks, as the robot went through them without any disturbance.
fn usual(kit: &Kit) -> Result<&Transcript, Failure> {
    let missing = || Failure::new("the usual ticks are played first", "they were not");
    kit.usual.get().ok_or_else(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rule_has_a_check() {
        let mut checked: Vec<&str> = CHECKS
            .iter()
            .flat_map(|check| check.rules)
            .chain(&ticks::USUAL)
            .copied()
            .collect();
        checked.sort_unstable();
        checked.dedup();

        let mut rules: Vec<&str> = RULES.iter().map(|rule| rule.name).collect();
        rules.sort_unstable();
        assert_eq!(checked, rules);
    }

    #[test]
    fn the_worse_verdict_counts() {
        let broken = || Verdict::Failed(Failure::new("a", "b"));
        let mut findings = Findings::default();
        findings.skip("x", "nothing to see");
        findings.merge(Findings([("x", Verdict::Passed)].into()));
        assert_eq!(findings.0["x"], Verdict::Passed);
        findings.merge(Findings([("x", broken())].into()));
        findings.merge(Findings([("x", Verdict::Passed)].into()));
        assert_eq!(findings.0["x"], broken());
    }
}
