//! Programs over standard input and output, as `cars exec` reports on them.

use protocol::messages::End;

use harness::HarnessOptions;
use harness::findings::Findings;
use harness::kit::Kit;
use harness::patience::in_each_attempt;
use harness::report::RuleFailure;
use harness::rules::{STDIO_END, STDIO_FIELDS, STDIO_LOG, STDIO_RULES};
use harness::script::{PlayScript, Straight, play, with_robot};
use harness::stdio::fault_in;

/// Rules that are about each line of such a program, whatever is checked.
pub(super) const ALWAYS: [&str; 2] = [STDIO_FIELDS, STDIO_LOG];

/// Why these rules are not about other robots.
const NOT_A_PROGRAM: &str = "the robot is not a program that `cars exec` runs";

/// Judges by what all processes of the robot did.
pub(super) fn judge(kit: &Kit, findings: &mut Findings) {
    for rule in STDIO_RULES {
        if !kit.stdio.is_program() {
            findings.skip(rule.name, NOT_A_PROGRAM);
        } else if ALWAYS.contains(&rule.name) {
            let failure = kit.stdio.failure(rule);
            findings.settle(rule.name, failure.map_or(Ok(()), Err));
        }
    }
}

/// The program exits as it should, however the run ends.
pub(super) fn end(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    if !kit.stdio.is_program() {
        findings.skip(STDIO_END, NOT_A_PROGRAM);
        return Ok(());
    }

    for (end, script) in [
        (End::Finished, PlayScript::usual(kit)),
        (End::Stopped, PlayScript::quiet(3)),
        (End::Aborted, PlayScript::quiet(0)),
    ] {
        // The time to exit is wall clock, so once is not enough.
        in_each_attempt(|_| ends_in_order(kit, end, &script))?;
    }
    Ok(())
}

fn ends_in_order(kit: &Kit, end: End, script: &PlayScript) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, script, &mut Straight)?;

    let clock = harness.end(end);
    let expected = format!("`cars exec` ends after a clock with end {end:?}");
    harness.until_ended_by(&clock, &expected)?;
    fault_in(&harness.process.output(), STDIO_END).map_or(Ok(()), Err)
}
