//! Starting over, and repeating oneself.

use protocol::messages::{JoinRequest, Welcome};

use super::{Findings, seated, usual};
use crate::comparison::{demand_same, difference};
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Script, Straight, Transcript, play};
use crate::stage::{Options, Stage};

/// Another process, the same seed: the same reports.
pub(super) fn same_seed(kit: &Kit, findings: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let again = play(&mut stage, &welcome, &Script::usual(kit), &mut Straight)?;
    if let [Ok(request)] = &stage.seen.requests[..]
        && request.instance == kit.first_instance()
    {
        let came = format!("two processes have {:?}", request.instance);
        findings.fail(
            "join.request",
            Failure::new("an instance that no other process has", came),
        );
    }
    let found = difference(usual(kit)?, &again);
    if kit.is_deterministic.set(found.is_none()).is_err() {
        unreachable!("it is asked once whether the robot repeats itself");
    }
    match found {
        None => Ok(()),
        Some((one, two)) => Err(Failure::new(
            format!("another process reports the same for the same seed: {one}"),
            two,
        )),
    }
}

/// The clock of a higher epoch: it joins again, and goes through the same ticks as a fresh process.
pub(super) fn init(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let [text, _] = kit.texts();
    play(&mut stage, &welcome, &Script::quiet(7), &mut Straight)?;
    // A command of the old epoch that was never named: it must not be taken for one of the new epoch.
    stage.put_command(
        &kit.sender(),
        1,
        (1, 7),
        &format!("{text}, of an epoch that is over"),
    )?;
    let welcome = Welcome {
        epoch: 2,
        ..welcome
    };
    stage.rejoin = Some(welcome.clone());
    let again = play(&mut stage, &welcome, &Script::usual(kit), &mut Straight);
    demand_joined_again(&stage)?;
    let mut again = again?;
    demand_epoch(&again)?;
    again.iter_mut().for_each(|entry| entry.report.epoch = 1);
    demand_same(
        kit,
        "to start over in a further epoch instead of a new process",
        usual(kit)?,
        &again,
    )
}

/// It asked to join again, once, as the process that it is.
fn demand_joined_again(stage: &Stage<'_>) -> Result<(), Failure> {
    let expected = "one more request to join, with the same name and instance, when a clock begins a higher epoch";
    let who =
        |request: &JoinRequest| format!("{} with instance {:?}", request.name, request.instance);
    match &stage.seen.requests[..] {
        [Ok(first), Ok(again)] if who(first) == who(again) => Ok(()),
        [Ok(first), Ok(again)] => Err(Failure::new(
            expected,
            format!("{} and before {}", who(again), who(first)),
        )),
        [.., Err(error)] => Err(Failure::new(expected, error)),
        requests => Err(Failure::new(
            expected,
            format!("{} more requests", requests.len().saturating_sub(1)),
        )),
    }
}

fn demand_epoch(transcript: &Transcript) -> Result<(), Failure> {
    match transcript
        .iter()
        .find(|entry| entry.report.epoch != entry.clock.epoch)
    {
        None => Ok(()),
        Some(entry) => {
            let came = format!("epoch {}", entry.report.epoch);
            Err(Failure::new(
                format!("reports of epoch {}", entry.clock.epoch),
                came,
            ))
        }
    }
}
