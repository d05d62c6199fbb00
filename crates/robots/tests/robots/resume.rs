//! A robot whose process was lost: the next incarnation takes over what was published, and the task goes on.

use super::stage::{self, Role, Stage, feet};
use robot::Robot;

fn pair(butler: Box<dyn Robot>, leguin: Box<dyn Robot>) -> Stage {
    let mut stage = Stage::new(
        21,
        vec![
            Role {
                robot: butler,
                ..Role::new("Butler", "Butler", feet(25.0, 25.0), "")
            },
            Role {
                robot: leguin,
                ..Role::new("Leguin", "Leguin", feet(4.0, 4.0), "")
            },
        ],
    );
    stage.begin();
    stage
}

fn make(class: &str) -> Box<dyn Robot> {
    robots::make(class).unwrap_or_else(|| unreachable!("a class of its own"))
}

#[test]
fn butler_keeps_his_count_and_what_he_asked_for() {
    for at_tick in (1..240).step_by(3) {
        let mut stage = pair(
            Box::new(stage::reborn::Butler::lost(at_tick)),
            make("Leguin"),
        );
        while stage.tick + 1 < at_tick {
            stage.step();
        }
        let facts = |stage: &Stage| {
            let counts = ["served", "missed", "exchanges", "start_x_m", "start_y_m"];
            counts.map(|name| stage.number("Butler", name))
        };
        let (before, treats) = (facts(&stage), stage.number("Butler", "treats"));
        stage.step();
        let after = facts(&stage);
        assert!(after[0] - before[0] <= 10.0, "tick {at_tick}");
        assert_eq!(
            (after[2], after[3], after[4]),
            (before[2], before[3], before[4]),
            "tick {at_tick}"
        );
        assert!(stage.number("Butler", "treats") <= treats, "tick {at_tick}");
        stage.step_until(300.0, |_| false);
        assert!(
            stage.number("Butler", "exchanges") >= before[2] + 3.0,
            "tick {at_tick}"
        );
    }
}

#[test]
fn leguin_goes_on_with_what_she_was_doing() {
    for at_tick in (1..240).step_by(3) {
        let mut stage = pair(
            make("Butler"),
            Box::new(stage::reborn::Leguin::lost(at_tick)),
        );
        while stage.tick + 1 < at_tick {
            stage.step();
        }
        let (before, exchanges) = (
            stage.behavior("Leguin").to_owned(),
            stage.number("Butler", "exchanges"),
        );
        stage.step();
        let next = match before.as_str() {
            "WAIT" => ["WAIT", "REFILL", "EXCHANGE"],
            "REFILL" => ["REFILL", "EXCHANGE", "REFILL"],
            "EXCHANGE" => ["EXCHANGE", "AWAIT_GO_HOME", "EXCHANGE"],
            "AWAIT_GO_HOME" => ["AWAIT_GO_HOME", "GO_HOME", "AWAIT_GO_HOME"],
            _ => ["GO_HOME", "WAIT", "GO_HOME"],
        };
        assert!(
            next.contains(&stage.behavior("Leguin")),
            "tick {at_tick}: {before}"
        );
        stage.step_until(300.0, |_| false);
        assert!(
            stage.number("Butler", "exchanges") >= exchanges + 3.0,
            "tick {at_tick}"
        );
    }
}
