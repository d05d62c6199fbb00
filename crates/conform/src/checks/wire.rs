//! How messages are put, and where.

use harness::Harness;
use harness::findings::Findings;
use harness::report::RuleFailure;

/// All that came on a harness so far was put as ticks need it, and on keys of the robot.
pub(super) fn check(harness: &Harness<'_>, findings: &mut Findings) {
    if let Some(wrong) = harness.seen.wrong_qos.first() {
        let expected = "put with congestion control block, not express, with the default priority";
        findings.fail("wire.qos", RuleFailure::new(expected, wrong));
    }

    if let Some(key) = harness.seen.foreign.first() {
        let expected = "nothing is put or declared at keys of the simulator and of other robots";
        findings.fail("wire.keys", RuleFailure::new(expected, key));
    }
}
