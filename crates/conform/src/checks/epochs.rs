//! Starting over, and repeating oneself.

use protocol::messages::Welcome;

use super::{Findings, played, seated, usual};
use crate::comparison::{demand_same, difference};
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Script, Straight, Transcript, play};
use crate::stage::{Options, Stage};

/// Another process, the same seed: the same reports.
pub(super) fn same_seed(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let again = played(kit, &Script::usual(kit))?;
    let found = difference(usual(kit)?, &again);
    if kit.is_deterministic.set(found.is_none()).is_err() {
        unreachable!("it is asked once whether the robot repeats itself");
    }
    match found {
        None => Ok(()),
        Some((one, two)) => {
            Err(Failure::new(format!("another process reports the same for the same seed: {one}"), two))
        }
    }
}

/// The clock of a higher epoch: it joins again, and goes through the same ticks as a fresh process.
pub(super) fn init(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let [text, _] = kit.texts();
    play(&mut stage, &welcome, &Script::quiet(7), &mut Straight)?;
    // A command of the old epoch that was never named: it must not be taken for one of the new epoch.
    stage.put_command(&kit.sender(), 1, (1, 7), &format!("{text}, of an epoch that is over"))?;
    let welcome = Welcome { epoch: 2, ..welcome };
    stage.rejoin = Some(welcome.clone());
    let again = play(&mut stage, &welcome, &Script::usual(kit), &mut Straight);
    demand_joined_again(&stage)?;
    let mut again = again?;
    demand_epoch(&again)?;
    again.iter_mut().for_each(|entry| entry.report.epoch = 1);
    demand_same(kit, "to start over in a further epoch instead of a new process", usual(kit)?, &again)
}

/// It asked to join again, once, as the process that it is.
fn demand_joined_again(stage: &Stage<'_>) -> Result<(), Failure> {
    let expected = "one more request to join, by the same robot, when a clock begins a higher epoch";
    match &stage.seen.rejoined[..] {
        [Ok(request)] if request.name == stage.kit.subject() => Ok(()),
        [Ok(request)] => Err(Failure::new(expected, format!("{} asks to join", request.name))),
        [Err(error)] => Err(Failure::new(expected, error)),
        requests => Err(Failure::new(expected, format!("{} requests", requests.len()))),
    }
}

fn demand_epoch(transcript: &Transcript) -> Result<(), Failure> {
    match transcript.iter().find(|entry| entry.report.epoch != entry.clock.epoch) {
        None => Ok(()),
        Some(entry) => {
            let came = format!("epoch {}", entry.report.epoch);
            Err(Failure::new(format!("reports of epoch {}", entry.clock.epoch), came))
        }
    }
}
