//! Echo's partner: it sends Echo enough commands for the medium to do everything that it can.

use protocol::Tick;
use protocol::messages::Point;
use robot::{Action, BadParameters, Cars, Robot};

/// The robot to which it sends its commands.
const TARGET: &str = "Echo";
/// Ticks of its way to and fro: it is sensed and queried with different results.
const PERIOD: u64 = 8;
/// The distance that it goes in a tick, meters.
const STEP_M: f64 = 0.1;

/// Walks to and fro, and sends commands by the tick.
#[derive(Default)]
pub(super) struct Caller;

impl Robot for Caller {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        for text in texts(cars.tick()) {
            cars.set_robot_command(TARGET, text)
                .unwrap_or_else(|error| panic!("{TARGET} is in the roster: {error}"));
        }

        let here = cars.location();
        let goes = cars.tick() % PERIOD < PERIOD / 2;
        let step_m = if goes { STEP_M } else { -STEP_M };
        let action = Action {
            proposal: Point::new(here.x + step_m, here.y),
            ..Action::default()
        };
        action
            .emotion("CALM")
            .behavior(if goes { "CALL" } else { "REST" })
    }
}

/// What it sends in a tick: nothing, one command, or several.
fn texts(tick: Tick) -> Vec<String> {
    match tick {
        0 => Vec::new(),
        6 => vec!["first".to_owned(), "second".to_owned()],
        9 => vec!["same".to_owned(), "same".to_owned()],
        tick if tick % 3 == 1 => vec![format!("ping {tick}")],
        _ => Vec::new(),
    }
}
