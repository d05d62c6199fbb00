//! What a robot must tolerate: unknown fields and malformed messages.

use protocol::Tick;
use protocol::messages::MAX_TEXT_BYTES;

use harness::findings::Findings;
use harness::kit::Kit;
use harness::report::RuleFailure;
use harness::script::{Disturbance, Straight, demand_usual, with_robot};
use harness::{Harness, HarnessOptions};

/// Later versions of the contract add fields: everything that the robot receives carries some.
pub(super) fn unknown_fields(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(
        kit,
        HarnessOptions {
            has_extras: true,
            ..HarnessOptions::default()
        },
    )?;
    demand_usual(&mut harness, "an unknown field", &mut Straight)
}

/// JSON does not distinguish 7 from 7.0: everything that the robot receives has whole numbers without a fraction.
pub(super) fn integers(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(
        kit,
        HarnessOptions {
            writes_integers: true,
            ..HarnessOptions::default()
        },
    )?;
    demand_usual(&mut harness, "that 7.0 is written as 7", &mut Straight)
}

/// Messages that cannot be understood change nothing, and are reported.
pub(super) fn malformed(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct Rubbish;
    impl Disturbance for Rubbish {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            if tick % 4 != 1 {
                return Ok(());
            }
            for rubbish in clocks(tick) {
                harness.put_as_clock(&rubbish)?;
            }
            for rubbish in news(tick) {
                harness.put_as_news(&rubbish)?;
            }
            harness.delete_keys()
        }
    }

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    // What it has printed when it started does not count.
    let before = harness.process.error_bytes();
    let what = "a message that cannot be understood";
    demand_usual(&mut harness, what, &mut Rubbish)?;

    if harness.process.error_bytes() == before {
        return Err(RuleFailure::new(
            "messages that cannot be understood are reported on its standard error",
            "nothing",
        ));
    }
    Ok(())
}

/// Commands on their way to the medium are not the robot's: it executes those in its news only.
pub(super) fn commands_of_others(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct Sending;
    impl Disturbance for Sending {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            if tick % 4 != 1 {
                return Ok(());
            }
            harness.send_to_medium()
        }
    }

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let what = "a command that others put for the medium, and that is not in its news";
    demand_usual(&mut harness, what, &mut Sending)
}

/// Not JSON, not an object, not all of it, not the right kinds.
fn common() -> Vec<Vec<u8>> {
    let texts = [
        "",
        "not json",
        "[]",
        "null",
        "7",
        "{",
        "{}",
        "{\"epoch\":1}",
        "\"clock\"",
    ];

    let mut rubbish: Vec<Vec<u8>> = texts.iter().map(|text| text.as_bytes().to_vec()).collect();
    rubbish.push(vec![0xff, 0xfe, 0x00, 0x80]);
    rubbish
}

fn clocks(tick: Tick) -> Vec<Vec<u8>> {
    let mut rubbish = common();

    for text in [
        format!("{{\"epoch\":\"1\",\"tick\":{tick}}}"),
        format!("{{\"epoch\":1,\"tick\":\"{tick}\"}}"),
        "{\"epoch\":1,\"tick\":-1}".to_owned(),
        format!("{{\"epoch\":1,\"tick\":{tick}.5}}"),
        "{\"epoch\":1,\"tick\":9007199254740993}".to_owned(),
        format!("{{\"epoch\":1,\"tick\":{tick},\"news\":[]}}"),
        format!("{{\"epoch\":1,\"tick\":{tick},\"news\":-1}}"),
        format!("{{\"epoch\":1,\"tick\":{tick},\"end\":\"somehow\"}}"),
        format!("{{\"epoch\":1,\"tick\":{tick}}} and more"),
    ] {
        rubbish.push(text.into_bytes());
    }

    rubbish
}

fn news(tick: Tick) -> Vec<Vec<u8>> {
    let mut rubbish = common();
    let start = format!("{{\"epoch\":1,\"tick\":{tick}");
    for text in [
        format!("{{\"epoch\":1,\"tick\":\"{tick}\"}}"),
        format!("{start},\"joined\":\"2\"}}"),
        format!("{start},\"correction\":{{\"location\":{{\"x\":\"left\",\"y\":1}}}}}}"),
        format!("{start},\"commands\":[{{\"from\":7,\"command\":\"x\"}}]}}"),
        format!("{start},\"commands\":[{{\"from\":\"operator\"}}]}}"),
        format!(
            "{start},\"commands\":[{{\"from\":\"operator\",\"command\":\"{}\"}}]}}",
            "x".repeat(MAX_TEXT_BYTES + 1)
        ),
        format!("{start},\"unreachable\":\"all\"}}"),
        start.to_string(),
    ] {
        rubbish.push(text.into_bytes());
    }

    rubbish
}
