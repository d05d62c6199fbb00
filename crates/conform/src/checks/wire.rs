//! How messages are put.

use crate::findings::Findings;
use crate::report::Failure;
use crate::stage::Stage;

/// All that came on a stage so far was put as ticks need it.
pub(super) fn check(stage: &Stage<'_>, findings: &mut Findings) {
    if let Some(wrong) = stage.seen.wrong_qos.first() {
        let expected = "put with congestion control block, not express, with the default priority";
        findings.fail("wire.qos", Failure::new(expected, wrong));
    }
}
