//! Commands that a report counts and that are not here.

use protocol::messages::OnLate;

use super::barrier::{Outputs, gathered, lateness, open, outcome, report, sent, stamp};
use super::name;
use crate::MissingCommand;

fn missing(robot: &str, counted: u32, number: u32) -> MissingCommand {
    MissingCommand {
        robot: name(robot),
        counted,
        number,
    }
}

#[test]
fn the_lowest_number_that_is_missing_is_named() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    let mut out = Outputs::new();
    let robot = name("A");
    // Numbered by target: the second one is taken for a repetition of the first.
    for _ in 0..2 {
        barrier.command(&robot, stamp(0, 1), 1, sent(), &mut out);
    }
    assert_eq!(barrier.missing_commands(), [], "nothing is counted yet");
    barrier.report(&robot, stamp(0, 1), 3, "report", &mut out);
    assert_eq!(barrier.missing_commands(), [missing("A", 3, 2)]);

    // Of another incarnation than the report, and so of no account.
    barrier.command(&robot, stamp(0, 9), 2, sent(), &mut out);
    assert_eq!(barrier.missing_commands(), [missing("A", 3, 2)]);

    barrier.command(&robot, stamp(0, 1), 2, sent(), &mut out);
    assert_eq!(barrier.missing_commands(), [missing("A", 3, 3)]);
    barrier.command(&robot, stamp(0, 1), 3, sent(), &mut out);
    assert_eq!(barrier.missing_commands(), []);

    assert!(outcome(report(&mut barrier, "B", 0)).is_some());
    assert_eq!(barrier.missing_commands(), [], "no tick is open");
}
