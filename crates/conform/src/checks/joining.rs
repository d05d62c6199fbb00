//! Asking to take part, being refused, being ready.

use std::time::Duration;

use protocol::keys::{QUERIES, STATE};
use protocol::messages::Refusal;

use harness::findings::Findings;
use harness::kit::Kit;
use harness::patience::{Limit, PATIENCE, START_PATIENCE};
use harness::report::RuleFailure;
use harness::script::{PlayScript, Straight, play};
use harness::{Harness, HarnessOptions};

/// For how long a welcome is held back, to see whether the robot waits for it.
const HELD_BACK: Duration = Duration::from_millis(200);
/// Reasons after which no other attempt can succeed.
const FOR_GOOD: [Refusal; 5] = [
    Refusal::UnknownName,
    Refusal::OtherProtocol,
    Refusal::OtherRun,
    Refusal::Malformed,
    Refusal::Ended,
];
/// How often its place is taken before it is free.
const TAKEN: usize = 25;
/// How much longer than its patience a robot may try, and end.
const GRACE: Duration = Duration::from_secs(10);

/// Everything is declared before the token, and the token comes after the welcome.
pub(super) fn ready_last(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = Harness::open_run(kit, HarnessOptions::default())?;
    harness.prepare()?;
    let joining = harness.next_join(START_PATIENCE)?;
    // The welcome is held back: a robot that declares its token anyway does not wait for it.
    harness.settle(HELD_BACK);
    if harness.is_present() {
        return Err(RuleFailure::new(
            "its liveliness token after the welcome",
            "it came before",
        ));
    }
    harness.admit(joining);
    harness.keeps_requests = false;
    harness.until_ready()?;

    // First what is known here at once: while queries are answered, a robot under load declares what it should have declared before.
    let subject = kit.subject();
    for key in [harness.keys.clock(), harness.keys.news(&subject)] {
        if !harness.has_subscriber(&key)? {
            let expected = format!("a subscriber of {key} is declared before the token");
            return Err(RuleFailure::new(expected, "the token without it"));
        }
    }
    for what in QUERIES.iter().chain([&STATE]) {
        if harness.ask(what, "")?.is_none() {
            let expected = format!("a queryable of {what} is declared before the token");
            return Err(RuleFailure::new(expected, "the token without it"));
        }
    }
    play(&mut harness, &PlayScript::quiet(2), &mut Straight).map(drop)
}

/// Refused for good, it ends with the reason on its standard error; refused because its place is taken, it tries again until its patience is over.
pub(super) fn refused(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    for reason in FOR_GOOD {
        refused_for_good(kit, reason)?;
    }
    taken_for_a_while(kit)?;
    taken_forever(kit)
}

fn refused_for_good(kit: &Kit, reason: Refusal) -> Result<(), RuleFailure> {
    let mut harness = Harness::open_run(kit, HarnessOptions::default())?;
    let joining = harness.next_join(START_PATIENCE)?;
    let explanation = format!("{} wants no robot of this name", harness.run);
    harness.refuse_join(joining, reason, &explanation);
    let expected = format!("its process ends when it is refused: {reason:?}");
    let status = harness.until_ended(&expected, PATIENCE)?;
    if status.success() {
        return Err(RuleFailure::new(
            "an exit status other than 0 when it is refused",
            format!("{status}"),
        ));
    }

    if !bare(&harness.process.errors()).contains(&bare(&explanation)) {
        let expected = format!("the explanation on its standard error: {explanation}");
        return Err(RuleFailure::new(expected, harness.process.fate()));
    }
    Ok(())
}

/// A text without spaces and frames: programs break long lines, and draw frames around them.
fn bare(text: &str) -> String {
    text.chars().filter(char::is_ascii_graphic).collect()
}

fn taken_for_a_while(kit: &Kit) -> Result<(), RuleFailure> {
    let mut harness = Harness::open_run(kit, HarnessOptions::default())?;
    harness.prepare()?;
    for _ in 0..TAKEN {
        let joining = harness.next_join(START_PATIENCE)?;
        harness.refuse_join(joining, Refusal::NameTaken, "another process is this robot");
    }

    let joining = harness.next_join(PATIENCE).map_err(|failure| RuleFailure {
        expected: "another request to join after its place was taken (name_taken)".to_owned(),
        ..failure
    })?;
    harness.admit(joining);
    harness.keeps_requests = false;
    harness.until_ready()?;
    play(&mut harness, &PlayScript::quiet(2), &mut Straight).map(drop)
}

fn taken_forever(kit: &Kit) -> Result<(), RuleFailure> {
    let options = HarnessOptions {
        patience_s: 2,
        ..HarnessOptions::default()
    };
    let patience = Duration::from_secs(u64::from(options.patience_s)) + GRACE;
    let mut harness = Harness::open_run(kit, options)?;
    let explanation = "another process is this robot";
    let expected = "its process ends when its place stays taken for longer than CARS_PATIENCE_S";
    let first = harness.next_join(START_PATIENCE)?;
    harness.refuse_join(first, Refusal::NameTaken, explanation);

    let mut limit = Limit::new(patience);
    // Each request is refused, as long as the robot asks: only its own patience ends this.
    while harness.process.ended().is_none() && !limit.is_over(&harness.process) {
        if let Ok(joining) = harness.next_join(Duration::from_millis(100)) {
            harness.refuse_join(joining, Refusal::NameTaken, explanation);
        }
    }
    let status = harness.until_ended(expected, Duration::ZERO)?;
    if status.success() {
        return Err(RuleFailure::new(
            "an exit status other than 0 when it gives up",
            format!("{status}"),
        ));
    }
    Ok(())
}
