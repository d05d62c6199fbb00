//! Robots that wait: for their news, or for another robot's answer.

use std::time::Duration;

use protocol::Tick;
use protocol::messages::{Correction, News};

use crate::kit::Kit;
use crate::patience::PATIENCE;
use crate::report::Failure;
use crate::script::{Script, Straight, play, seated};
use crate::stage::{Options, Stage};

/// After this time, a robot that received a clock is in its tick.
const UNDER_WAY: Duration = Duration::from_millis(50);
/// Ticks within which a robot that queries others at all does so.
const TICKS: Tick = 24;

/// A stage on which the other robots put no states, so that a robot that wants to know them must query.
pub(super) fn of_queries(kit: &Kit) -> Result<Stage<'_>, Failure> {
    seated(
        kit,
        Options {
            puts_states: false,
            ..Options::default()
        },
    )
}

/// A robot that waits for its news: the clock of the open tick has its flag, and its news are withheld.
pub(super) fn for_news(kit: &Kit) -> Result<Stage<'_>, Failure> {
    let mut stage = seated(kit, Options::default())?;
    play(&mut stage, &Script::quiet(3), &mut Straight)?;

    stage.withholds_news = true;
    stage.open(&News {
        correction: Some(Correction {
            location: stage.body.stands,
            blocked: true,
        }),
        ..News::default()
    })?;
    stage.settle(UNDER_WAY);
    Ok(stage)
}

/// A robot that waits for an answer that the others hold back, if it queries others at all. With it, whether it does: the
/// last tick is then open.
pub(super) fn for_another(kit: &Kit) -> Result<(Stage<'_>, bool), Failure> {
    let mut stage = of_queries(kit)?;
    stage.cast.hold();
    for _ in 0..TICKS {
        stage.open(&News::default())?;
        let came = stage.until("a report or a query", PATIENCE, |stage| {
            (stage.cast.has_held() || !stage.is_open()).then_some(())
        });
        if stage.cast.has_held() {
            stage.settle(UNDER_WAY);
            return Ok((stage, true));
        }
        came?;
        stage.complete()?;
    }

    Ok((stage, false))
}
