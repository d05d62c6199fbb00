//! The checks: each takes one process of the robot, or several, through something, and returns what it finds.

mod commands;
mod computing;
mod ends;
mod epochs;
mod joining;
mod news;
mod queries;
mod repeated;
mod returns;
mod stdio;
mod ticks;
mod tolerance;
mod waiting;
mod wire;

use std::process::Command;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::Builder;

use crate::findings::{Findings, VerdictsByRule};
use crate::kit::{CannotRun, Kit};
use crate::report::{AnswerTimes, CheckReport, RuleFailure, RuleOutcome, RuleVerdict};
use crate::rules::{self, ProtocolRule};
use crate::setting::CheckSetting;

/// A check, with its rules; the first one gets the failure that breaks it off.
struct Check {
    rules: &'static [&'static str],
    run: fn(&Kit, &mut Findings) -> Result<(), RuleFailure>,
}

const fn rules(
    rules: &'static [&'static str],
    run: fn(&Kit, &mut Findings) -> Result<(), RuleFailure>,
) -> Check {
    Check { rules, run }
}

/// Checks that need nothing but the usual ticks before; those that take longest begin.
const CHECKS: [Check; 27] = [
    rules(&["join.refused"], joining::refused),
    rules(&["end.gone"], ends::gone),
    rules(&["query.at-once"], queries::at_once),
    rules(&["query.once"], queries::once),
    rules(&["end.clock"], ends::clock),
    rules(&["news.wait"], news::wait),
    rules(&["epoch.init"], epochs::init),
    rules(&["epoch.late"], epochs::late),
    rules(&["return.generation"], returns::generation),
    rules(&["return.rejoin"], returns::rejoin),
    rules(&["join.ready-last"], joining::ready_last),
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
    rules(&["query.unknown"], queries::unknown),
    rules(&["command.order"], commands::order),
    rules(&["command.twice"], commands::twice),
    rules(&["command.payload"], commands::payload),
    rules(&["operator.commands"], commands::from_operator),
    rules(&["clock.duplicate"], repeated::duplicate),
    rules(&["clock.late"], repeated::late),
    rules(&["return.replaced"], returns::replaced),
    rules(&["end.sigterm"], ends::sigterm),
    rules(&["compat.unknown-fields"], tolerance::unknown_fields),
    rules(&["number.integers"], tolerance::integers),
    rules(&["robust.malformed"], tolerance::malformed),
    rules(&["tick.answer"], ticks::unasked),
    rules(&["determinism.seed"], epochs::streams),
];

/// Checks of programs that `cars exec` runs.
const STDIO_CHECKS: [Check; 1] = [rules(&[rules::STDIO_END], stdio::end)];

/// Processes of the robot that run at the same time.
const WORKERS: usize = 4;

/// Checks the robot that `command` starts: all rules, or those in `rules`.
///
/// # Errors
/// [`CannotRun`] if the command cannot be started, or the robot never asks to join.
pub fn check(
    command: &Command,
    setting: &CheckSetting,
    rules: &[ProtocolRule],
) -> Result<CheckReport, CannotRun> {
    let kit = Kit::open(command, setting)?;
    let (mut verdicts, answers) = all(&kit, rules)?;

    let mut outcomes = Vec::new();
    for rule in rules::rules() {
        let is_shown = if rules.is_empty() {
            kit.stdio.is_program() || !rules::STDIO_RULES.contains(&rule)
        } else {
            rules.contains(&rule)
        };
        if !is_shown {
            continue;
        }
        let verdict = verdicts.remove(rule.name);
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
    })
}

/// Takes the robot through all checks that the wanted rules need.
fn all(
    kit: &Kit,
    wanted: &[ProtocolRule],
) -> Result<(VerdictsByRule, Option<AnswerTimes>), CannotRun> {
    let mut findings = Findings::default();
    // First and alone: all other checks compare with these ticks, and a robot that does not get through
    // them shows nothing else.
    let (broken, times) = ticks::usual(kit, &mut findings)?;
    if let Some(rule) = broken {
        let reason = format!("the robot does not get through the usual ticks, see {rule}");
        stdio::judge(kit, &mut findings);
        for rule in rules::rules() {
            findings.skip(rule.name, &reason);
        }
        return Ok((findings.0, times));
    }
    // Then whether the robot repeats itself: if not, differences mean nothing.
    let again = epochs::same_seed(kit, &mut findings);
    findings.close(&["determinism.seed"], again);

    let due: Vec<&Check> = CHECKS
        .iter()
        .chain(&STDIO_CHECKS)
        .filter(|check| {
            wanted.is_empty() || wanted.iter().any(|rule| check.rules.contains(&rule.name))
        })
        .collect();
    let next = AtomicUsize::new(0);
    let all = Mutex::new(findings);
    let work = || {
        while let Some(check) = due.get(next.fetch_add(1, Ordering::Relaxed)) {
            let mut own = Findings::default();
            let end = (check.run)(kit, &mut own);
            // Each check finds for itself, and is merged as a whole: the order in which they end
            // changes nothing.
            own.close(check.rules, end);
            all.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .merge(own);
        }
    };
    std::thread::scope(|scope| {
        // This thread is a worker, too, so the checks are made even if the system starts no other one.
        for _ in 1..WORKERS {
            let _fewer_at_once = Builder::new().spawn_scoped(scope, work);
        }
        work();
    });

    let mut findings = all.into_inner().unwrap_or_else(PoisonError::into_inner);
    stdio::judge(kit, &mut findings);
    Ok((findings.0, times))
}

#[cfg(test)]
mod tests {
    use super::*;

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
