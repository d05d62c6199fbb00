//! What a robot must bear: fields that it does not know, and messages that are none.

use protocol::messages::{Clock, MAX_TEXT_BYTES};

use super::{Findings, seated, usual};
use crate::comparison::demand_same;
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Script, Straight, Twist, play};
use crate::stage::{Options, Stage};

/// Later versions of the contract add fields: everything the robot hears carries some.
pub(super) fn unknown_fields(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(
        kit,
        Options {
            has_extras: true,
            ..Options::default()
        },
    )?;
    let welcome = stage.welcome();
    let played = play(&mut stage, &welcome, &Script::usual(kit), &mut Straight)?;
    demand_same(kit, "a field that nobody knows", usual(kit)?, &played)
}

/// Messages that cannot be understood change nothing.
pub(super) fn malformed(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    struct Rubbish;
    impl Twist for Rubbish {
        fn before(&mut self, stage: &mut Stage<'_>, clock: &Clock) -> Result<(), Failure> {
            if clock.tick % 4 != 1 {
                return Ok(());
            }
            let (tick, subject) = (clock.tick, stage.kit.subject());
            for rubbish in clocks(tick, subject.as_str()) {
                stage.put_as_clock(&rubbish)?;
            }
            let key = stage.keys.command(&subject, &stage.kit.sender());
            for rubbish in commands(tick) {
                stage.kit.bus.put(&key, rubbish)?;
            }
            Ok(())
        }
    }
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let played = play(&mut stage, &welcome, &Script::usual(kit), &mut Rubbish)?;
    demand_same(
        kit,
        "a message that cannot be understood",
        usual(kit)?,
        &played,
    )
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

fn clocks(tick: u64, subject: &str) -> Vec<Vec<u8>> {
    let mut rubbish = common();
    for text in [
        format!("{{\"epoch\":\"1\",\"tick\":{tick}}}"),
        format!("{{\"epoch\":1,\"tick\":\"{tick}\"}}"),
        "{\"epoch\":1,\"tick\":-1}".to_owned(),
        format!("{{\"epoch\":1,\"tick\":{tick}.5}}"),
        "{\"epoch\":1,\"tick\":9007199254740993}".to_owned(),
        format!("{{\"epoch\":1,\"tick\":{tick},\"news\":[]}}"),
        format!("{{\"epoch\":1,\"tick\":{tick},\"news\":{{\"{subject}\":7}}}}"),
        format!(
            "{{\"epoch\":1,\"tick\":{tick},\"news\":{{\"{subject}\":{{\"correction\":{{\"location\":{{\"x\":\"left\"}}}}}}}}}}"
        ),
        format!(
            "{{\"epoch\":1,\"tick\":{tick},\"news\":{{\"{subject}\":{{\"commands\":[{{\"from\":7,\"seq\":1}}]}}}}}}"
        ),
        format!("{{\"epoch\":1,\"tick\":{tick},\"end\":\"somehow\"}}"),
        format!("{{\"epoch\":1,\"tick\":{tick}}} and more"),
    ] {
        rubbish.push(text.into_bytes());
    }
    rubbish
}

fn commands(tick: u64) -> Vec<Vec<u8>> {
    let mut rubbish = common();
    for text in [
        format!("{{\"epoch\":1,\"tick\":{tick},\"seq\":1}}"),
        format!("{{\"epoch\":1,\"tick\":{tick},\"seq\":-1,\"command\":\"x\"}}"),
        format!("{{\"epoch\":1,\"tick\":{tick},\"seq\":\"1\",\"command\":\"x\"}}"),
        format!("{{\"epoch\":1,\"tick\":{tick},\"seq\":1,\"command\":{{}}}}"),
        format!(
            "{{\"epoch\":1,\"tick\":{tick},\"seq\":1,\"command\":\"{}\"}}",
            "x".repeat(MAX_TEXT_BYTES + 1)
        ),
        format!(
            "{{\"epoch\":1,\"tick\":{tick},\"seq\":2,\"performative\":\"sing\",\"command\":\"x\"}}"
        ),
    ] {
        rubbish.push(text.into_bytes());
    }
    rubbish
}
