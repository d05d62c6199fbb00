//! Asking to take part, being refused, being ready.

use std::time::Duration;

use protocol::messages::{JoinAnswer, Refusal};

use super::Findings;
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Script, Straight, play};
use crate::stage::{Options, PATIENCE, START_PATIENCE, Stage};

/// For how long a welcome is held back, to see whether the robot waits for it.
const HELD_BACK: Duration = Duration::from_millis(200);
/// How often its place is taken before it is free.
const TAKEN: usize = 3;
/// How much longer than its patience a robot may try, and end.
const GRACE: Duration = Duration::from_secs(10);

/// Everything is declared before the token, and the token comes after the welcome.
pub(super) fn ready_last(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = Stage::open(kit, Options::default())?;
    stage.prepare()?;
    let joining = stage.next_join(START_PATIENCE)?;
    stage.settle(HELD_BACK);
    if stage.is_present() {
        return Err(Failure::new(
            "its liveliness token after the welcome",
            "it came before",
        ));
    }
    let welcome = stage.welcome();
    stage.answer_join(&joining, &JoinAnswer::Welcome(Box::new(welcome.clone())));
    stage.until_ready()?;
    let subject = kit.subject();
    let commands = stage.keys.command(&subject, &kit.sender());
    for (what, key) in [("clocks", stage.keys.clock()), ("commands", commands)] {
        if !stage.is_heard(&kit.bus, &key)? {
            let expected = format!("{what} are subscribed to before the token is declared");
            return Err(Failure::new(
                expected,
                format!("the token is there, and nobody hears {key}"),
            ));
        }
    }
    play(&mut stage, &welcome, &Script::quiet(2), &mut Straight).map(drop)
}

/// Refused for good, it ends and says why; refused because its place is taken, it tries again until its patience is over.
pub(super) fn refused(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    refused_for_good(kit)?;
    taken_for_a_while(kit)?;
    taken_for_ever(kit)
}

fn refused_for_good(kit: &Kit) -> Result<(), Failure> {
    let mut stage = Stage::open(kit, Options::default())?;
    let joining = stage.next_join(START_PATIENCE)?;
    let explanation = format!("no robot of {} has this name", stage.run);
    stage.refuse_join(&joining, Refusal::UnknownName, &explanation);
    let expected = "its process ends when it is refused with unknown_name";
    let status = stage.until_ended(expected, PATIENCE)?;
    if status.success() {
        return Err(Failure::new(
            "an exit status other than 0 when it is refused",
            format!("{status}"),
        ));
    }
    // Programs break long lines, and draw frames around them.
    let bare = |text: &str| {
        text.chars()
            .filter(char::is_ascii_graphic)
            .collect::<String>()
    };
    if !bare(&stage.process.errors()).contains(&bare(&explanation)) {
        let expected = format!("the explanation on its standard error: {explanation}");
        return Err(Failure::new(expected, stage.process.fate()));
    }
    Ok(())
}

fn taken_for_a_while(kit: &Kit) -> Result<(), Failure> {
    let mut stage = Stage::open(kit, Options::default())?;
    stage.prepare()?;
    for _ in 0..TAKEN {
        let joining = stage.next_join(START_PATIENCE)?;
        stage.refuse_join(
            &joining,
            Refusal::NameTaken,
            "another living process is it already",
        );
    }
    let welcome = stage.welcome();
    let joining = stage.next_join(PATIENCE).map_err(|failure| {
        Failure::new(
            "another request to join after its place was taken (name_taken)",
            failure.came,
        )
    })?;
    stage.answer_join(&joining, &JoinAnswer::Welcome(Box::new(welcome.clone())));
    stage.until_ready()?;
    play(&mut stage, &welcome, &Script::quiet(2), &mut Straight).map(drop)
}

fn taken_for_ever(kit: &Kit) -> Result<(), Failure> {
    let options = Options {
        patience_s: 2,
        ..Options::default()
    };
    let patience = Duration::from_secs(u64::from(options.patience_s)) + GRACE;
    let mut stage = Stage::open(kit, options)?;
    let explanation = "another living process is it already";
    let expected = "its process ends when its place stays taken for longer than CARS_PATIENCE_S";
    let first = stage.next_join(START_PATIENCE)?;
    stage.refuse_join(&first, Refusal::NameTaken, explanation);
    let begun = std::time::Instant::now();
    while stage.process.ended().is_none() && begun.elapsed() < patience {
        if let Ok(joining) = stage.next_join(Duration::from_millis(100)) {
            stage.refuse_join(&joining, Refusal::NameTaken, explanation);
        }
    }
    let status = stage.until_ended(expected, Duration::ZERO)?;
    if status.success() {
        return Err(Failure::new(
            "an exit status other than 0 when it gives up",
            format!("{status}"),
        ));
    }
    Ok(())
}
