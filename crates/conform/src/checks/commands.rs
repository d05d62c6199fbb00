//! Commands: in the order the clock names, when it names them, as often as it names them.

use protocol::Tick;
use protocol::messages::CommandId;

use super::{Findings, played, seated};
use crate::comparison::{demand_same, difference, is_same};
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Delivery, Script, Straight, Transcript, play};
use crate::stage::Options;

/// When the commands of these checks are named, and for how long the robot is watched after it.
const NAMED: Tick = 6;
const TICKS: Tick = 12;
/// A robot may wait so long for a command that was named and does not come; robots of this project wait 10 s.
const MISSING_PATIENCE: std::time::Duration = std::time::Duration::from_secs(25);

/// The command `text` with number `seq`, put before the clock of tick `sent`.
fn delivery(kit: &Kit, seq: u64, text: &str, sent: Tick) -> Delivery {
    Delivery {
        from: kit.sender(),
        seq,
        text: text.to_owned(),
        sent: Some(sent),
        named: NAMED,
        times: 1,
    }
}

fn script(deliveries: Vec<Delivery>) -> Script {
    Script::with(TICKS, deliveries)
}

/// What was named and had been put is not missing.
fn demand_none_missing(transcript: &Transcript) -> Result<(), Failure> {
    let missing = transcript
        .iter()
        .find(|entry| !entry.report.missing.is_empty());
    match missing {
        None => Ok(()),
        Some(entry) => {
            let expected = format!(
                "nothing is missing in tick {}: all had been sent",
                entry.clock.tick
            );
            Err(Failure::new(
                expected,
                format!("{:?}", names(&entry.report.missing)),
            ))
        }
    }
}

fn names(ids: &[CommandId]) -> Vec<String> {
    ids.iter()
        .map(|id| format!("{} {}", id.from, id.seq))
        .collect()
}

/// Two commands that arrive in one order and in the other are executed as the clock names them.
pub(super) fn order(kit: &Kit, findings: &mut Findings) -> Result<(), Failure> {
    for [one, two] in kit.pairs() {
        let (first, second) = (delivery(kit, 1, &one, 5), delivery(kit, 2, &two, 5));
        let straight = played(kit, &script(vec![first.clone(), second.clone()]))?;
        let crossed = played(kit, &script(vec![second, first]))?;
        demand_none_missing(&straight)?;
        demand_none_missing(&crossed)?;
        demand_same(
            kit,
            "the order in which two commands arrive",
            &straight,
            &crossed,
        )?;
        // Whether the robot would show it at all.
        let swapped = played(
            kit,
            &script(vec![delivery(kit, 1, &two, 5), delivery(kit, 2, &one, 5)]),
        )?;
        if !is_same(&straight, &swapped) {
            return Ok(());
        }
    }
    let reason = format!(
        "the robot reports the same in whatever order it is told {}; name commands that it understands with --say",
        shown(kit)
    );
    findings.skip("command.order", &reason);
    Ok(())
}

/// The pairs of commands that were tried.
fn shown(kit: &Kit) -> String {
    kit.pairs()
        .iter()
        .map(|[one, two]| format!("{one:?} and {two:?}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// A command that comes long before it is named does what one does that comes just in time.
pub(super) fn held(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let [text, _] = kit.texts();
    let in_time = played(kit, &script(vec![delivery(kit, 1, &text, NAMED)]))?;
    let early = played(kit, &script(vec![delivery(kit, 1, &text, 1)]))?;
    demand_none_missing(&in_time)?;
    demand_none_missing(&early)?;
    demand_same(
        kit,
        "that a command comes some ticks before it is named",
        &in_time,
        &early,
    )
}

/// One command that is named twice does what two do.
pub(super) fn twice(kit: &Kit, findings: &mut Findings) -> Result<(), Failure> {
    for [text, _] in kit.pairs() {
        let once = played(kit, &script(vec![delivery(kit, 1, &text, 5)]))?;
        let two = played(
            kit,
            &script(vec![delivery(kit, 1, &text, 5), delivery(kit, 2, &text, 5)]),
        )?;
        let doubled = played(
            kit,
            &script(vec![Delivery {
                times: 2,
                ..delivery(kit, 1, &text, 5)
            }]),
        )?;
        demand_none_missing(&doubled)?;
        if kit.is_deterministic.get() == Some(&false) {
            findings.skip(
                "command.twice",
                "the robot does not repeat itself, so that nothing can be compared",
            );
            return Ok(());
        }
        if is_same(&once, &two) {
            continue;
        }
        if is_same(&once, &doubled) {
            let (wanted, came) = difference(&two, &doubled).unwrap_or_default();
            let expected =
                format!("a command that is named twice in a row is executed twice: {wanted}");
            return Err(Failure::new(expected, came));
        }
        return Ok(());
    }
    let reason = format!(
        "the robot reports the same for one command and for two of them, of {}",
        shown(kit)
    );
    findings.skip("command.twice", &reason);
    Ok(())
}

/// A command that is named and never comes is reported missing, alone, and the next tick is answered.
pub(super) fn missing(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let [text, _] = kit.texts();
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let mut twist = Straight;
    play(&mut stage, &welcome, &Script::quiet(NAMED - 1), &mut twist)?;
    let from = kit.sender();
    let id = |seq| CommandId {
        from: from.clone(),
        seq,
    };
    stage.put_command(&from, 1, (1, NAMED - 1), &text)?;
    let news = protocol::messages::News {
        commands: vec![id(1), id(99)],
        ..Default::default()
    };
    let news = std::collections::BTreeMap::from([(kit.subject(), news)]);
    let clock = protocol::messages::Clock {
        epoch: 1,
        tick: NAMED,
        news,
        end: None,
    };
    let (index, _) = stage.tick_within(&clock, MISSING_PATIENCE)?;
    let missing = stage
        .seen
        .answers
        .get(index)
        .map(|answer| answer.reading.report.missing.clone());
    let missing = missing.unwrap_or_default();
    if missing != [id(99)] {
        let expected = format!("missing: {:?}", names(&[id(99)]));
        return Err(Failure::new(
            expected,
            format!("missing: {:?}", names(&missing)),
        ));
    }
    let next = protocol::messages::Clock {
        epoch: 1,
        tick: NAMED + 1,
        ..Default::default()
    };
    stage.tick(&next).map(drop)
}
