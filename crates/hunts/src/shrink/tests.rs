//! Shrinking of cases over made-up trials.

use std::sync::atomic::AtomicU64;

use proptest::prelude::*;

use crate::fault::AbsenceReason;

use super::*;
use crate::sent::Link;
use crate::trial::FailedExpectation;
use lab::LabError;

const NAME: &str = "all is well";

/// A run that fails if it has all the messages of one of the sets among those lost.
struct Synthetic {
    causes: Vec<BTreeSet<u64>>,
    played: AtomicU64,
}

fn lose(number: u64) -> PlannedFault {
    PlannedFault::Lose {
        link: link(),
        number,
    }
}

fn link() -> Link {
    Link {
        from: RobotName::new("A").unwrap(),
        to: RobotName::new("B").unwrap(),
    }
}

fn numbers(case: &FaultCase) -> BTreeSet<u64> {
    let mut numbers = BTreeSet::new();
    for fault in &case.faults {
        match fault {
            PlannedFault::Lose { number, .. } => _ = numbers.insert(*number),
            // Any other fault loses the messages 0 to 9 while it lasts.
            PlannedFault::Absence { span, .. } => {
                numbers.extend((0..10).filter(|n| (span.from..span.until).contains(n)));
            }
            _ => {}
        }
    }
    numbers
}

impl Synthetic {
    fn of(causes: &[&[u64]]) -> Self {
        Self {
            causes: causes
                .iter()
                .map(|set| set.iter().copied().collect())
                .collect(),
            played: AtomicU64::new(0),
        }
    }

    fn fails(&self, lost: &BTreeSet<u64>) -> bool {
        self.causes.iter().any(|cause| cause.is_subset(lost))
    }
}

impl Trial for Synthetic {
    fn play(&self, case: &FaultCase, _: &BTreeSet<String>) -> Result<TrialResult, LabError> {
        self.played.fetch_add(1, Ordering::Relaxed);
        let lost = numbers(case);
        let mut played = TrialResult::default();
        for number in 0..10 {
            played.sent.push(SentMessage {
                tick: number,
                link: link(),
                number,
                text: String::new(),
                is_lost: lost.contains(&number),
                late: 0,
                is_doubled: false,
            });
        }
        if self.fails(&lost) {
            played.failed.insert(NAME.to_owned(), failure(10));
        }
        Ok(played)
    }
}

/// Runs that fail at a tick if their faults are as the function says.
struct FailsAt<F>(Tick, F);

impl<F: Fn(&FaultCase) -> bool + Sync> Trial for FailsAt<F> {
    fn play(&self, case: &FaultCase, _: &BTreeSet<String>) -> Result<TrialResult, LabError> {
        let Self(tick, does_fail) = self;
        let mut played = TrialResult::default();
        if does_fail(case) {
            played.failed.insert(NAME.to_owned(), failure(*tick));
        }
        Ok(played)
    }
}

fn failure(tick: Tick) -> FailedExpectation {
    FailedExpectation {
        tick,
        because: String::new(),
    }
}

fn crash(from: Tick, until: Tick) -> PlannedFault {
    PlannedFault::Absence {
        robot: RobotName::new("A").unwrap(),
        why: AbsenceReason::Crash,
        span: TickSpan { from, until },
    }
}

fn shrunk(trial: &impl Trial, case: FaultCase, runs: u64, jobs: usize) -> Shrunk {
    shrunk_with(trial, case, &ScenarioParts::default(), runs, jobs)
}

fn shrunk_with(
    trial: &impl Trial,
    case: FaultCase,
    parts: &ScenarioParts,
    runs: u64,
    jobs: usize,
) -> Shrunk {
    let played = trial.play(&case, &BTreeSet::new()).unwrap();
    assert!(played.failed.contains_key(NAME), "it fails before");
    let bounds = Bounds {
        runs,
        jobs,
        stop: &AtomicBool::new(false),
    };
    shrink(trial, NAME, case, played, parts, bounds)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the causes: the result fails, no fault of it can be left out, and jobs do not change it.
    #[test]
    fn the_result_is_minimal_and_fails(
        causes in prop::collection::vec(prop::collection::btree_set(0_u64..30, 1..5), 1..4),
        more in prop::collection::btree_set(0_u64..30, 0..20),
        jobs in 2..5_usize,
    ) {
        let mut all = more;
        all.extend(causes[0].iter());
        let trial = Synthetic { causes, played: AtomicU64::new(0) };
        let case = FaultCase::of(all.into_iter().map(lose).collect());
        let one = shrunk(&trial, case.clone(), 10_000, 1);

        prop_assert!(one.is_minimal);
        prop_assert!(trial.fails(&numbers(&one.case)));
        for index in 0..one.case.faults.len() {
            let mut faults = one.case.faults.clone();
            faults.remove(index);
            let fewer = FaultCase::of(faults);
            prop_assert!(!trial.fails(&numbers(&fewer)), "{fewer:?} fails, too");
        }

        let other = shrunk(&trial, case, 10_000, jobs);
        prop_assert_eq!(one, other);
    }

    /// However few runs are allowed, the result fails, and no more runs are counted than allowed.
    #[test]
    fn a_result_within_bounds_fails(runs in 0_u64..40, cause in prop::collection::btree_set(0_u64..30, 1..4)) {
        let trial = Synthetic { causes: vec![cause], played: AtomicU64::new(0) };
        let case = FaultCase::of((0..30).map(lose).collect());
        let one = shrunk(&trial, case, runs, 1);
        prop_assert!(trial.fails(&numbers(&one.case)));
        prop_assert!(one.runs <= runs);
    }
}

#[test]
fn a_crash_becomes_the_message_that_it_lost() {
    let trial = Synthetic::of(&[&[7]]);
    let case = FaultCase::of(vec![lose(1), crash(2, 9)]);
    let result = shrunk(&trial, case, 10_000, 2);
    assert_eq!(result.case.faults, [lose(7)]);
}

#[test]
fn a_fault_that_no_message_replaces_becomes_short() {
    let absent = FailsAt(60, |case: &FaultCase| {
        case.faults.iter().any(|fault| match fault {
            PlannedFault::Absence { span, .. } => span.from <= 55 && span.until >= 60,
            _ => false,
        })
    });
    let case = FaultCase::of(vec![lose(1), crash(10, 300)]);
    let result = shrunk(&absent, case, 10_000, 2);
    assert_eq!(result.case.faults, [crash(55, 60)]);
    assert_eq!(result.case.ticks, Some(60));
}

/// A fault for which many times do becomes one at the earliest of them that steps lead to.
#[test]
fn a_fault_moves_to_an_earlier_time() {
    let later = FailsAt(60, |case: &FaultCase| {
        case.faults.iter().any(|fault| match fault {
            PlannedFault::Absence { span, .. } => span.from >= 12 && span.until - span.from >= 5,
            PlannedFault::Lose { number, .. } => *number >= 3,
            _ => false,
        })
    });
    for (fault, expected) in [
        (crash(180, 300), crash(12, 17)),
        (lose(29), lose(3)),
        (lose(3), lose(3)),
    ] {
        let result = shrunk(&later, FaultCase::of(vec![fault]), 10_000, 2);
        assert_eq!(result.case.faults, [expected]);
        assert!(result.is_minimal);
    }
}

#[test]
fn all_first_commands_and_some_others_are_tried() {
    assert_eq!(before(1, 1, 16), [] as [u64; 0]);
    assert_eq!(before(2, 1, 16), [1]);
    assert_eq!(before(17, 1, 16), (1..17).collect::<Vec<u64>>());
    assert_eq!(before(18, 1, 16), (1..18).collect::<Vec<u64>>());
    assert_eq!(before(81, 1, 1), [1, 11, 21, 31, 41, 51, 61, 71, 73, 80]);
    assert_eq!(before(1, 0, 1), [0]);
}

/// The expectation fails for the commands 3 and 11 of a link, and for none between them.
#[test]
fn a_command_becomes_an_earlier_one_for_which_it_fails_too() {
    let apart = FailsAt(60, |case: &FaultCase| {
        case.faults.contains(&lose(3)) || case.faults.contains(&lose(11))
    });
    let result = shrunk(&apart, FaultCase::of(vec![lose(11)]), 10_000, 2);
    assert_eq!(result.case.faults, [lose(3)]);
}

fn reseed(of: &[&str]) -> PlannedFault {
    PlannedFault::Reseed {
        at: 9,
        seed: 5,
        of: of.iter().map(|kind| (*kind).to_owned()).collect(),
    }
}

#[test]
fn other_chance_is_left_out_or_becomes_chance_of_one_kind() {
    let unneeded = FailsAt(60, |case: &FaultCase| case.faults.contains(&lose(3)));
    let case = FaultCase::of(vec![reseed(&[]), lose(3)]);
    let result = shrunk(&unneeded, case.clone(), 10_000, 2);
    assert_eq!(result.case.faults, [lose(3)]);

    let of_guests = FailsAt(60, |case: &FaultCase| {
        let mut faults = case.faults.iter();
        faults.any(|fault| *fault == reseed(&[]) || *fault == reseed(&["guests"]))
    });
    let result = shrunk(&of_guests, case, 10_000, 2);
    assert_eq!(result.case.faults, [reseed(&["guests"])]);
    assert!(result.is_minimal);
}

/// A run in which the command 7 is 5 ticks late, which is needed for 2 ticks, whatever delays it.
struct Delaying;

impl Trial for Delaying {
    fn play(&self, case: &FaultCase, _: &BTreeSet<String>) -> Result<TrialResult, LabError> {
        let mut played = TrialResult::default();
        let late = case.faults.iter().map(|fault| match fault {
            PlannedFault::Late { number: 7, by, .. } => *by,
            PlannedFault::Channel { .. } => 5,
            _ => 0,
        });
        let late = late.max().unwrap_or(0);
        played.sent.push(SentMessage {
            tick: 7,
            link: link(),
            number: 7,
            text: String::new(),
            is_lost: false,
            late,
            is_doubled: true,
        });
        if late >= 2 {
            played.failed.insert(NAME.to_owned(), failure(20));
        }
        Ok(played)
    }
}

#[test]
fn chance_becomes_the_command_that_it_delayed() {
    let delay = PlannedFault::Channel {
        link: None,
        of: Messages::Commands,
        effect: Effect::Delay(8),
        span: TickSpan { from: 0, until: 90 },
    };
    let result = shrunk(&Delaying, FaultCase::of(vec![delay]), 10_000, 2);
    let late = PlannedFault::Late {
        link: link(),
        number: 7,
        by: 2,
    };
    assert_eq!(result.case.faults, [late]);
}

/// A scenario that fails without faults is no smaller case of one in which a fault is the cause.
#[test]
fn what_is_left_of_the_scenario_does_not_fail_by_itself() {
    let lonely = FailsAt(5, |case: &FaultCase| {
        !case.without.is_empty() || case.faults.contains(&lose(3))
    });
    let case = FaultCase::of(vec![lose(3), lose(4)]);
    let parts = ScenarioParts {
        roster: vec![RobotName::new("C").unwrap()],
        guests: 100,
    };
    let result = shrunk_with(&lonely, case, &parts, 10_000, 1);
    assert_eq!(result.case.faults, [lose(3)]);
    assert_eq!(result.case.without, BTreeSet::new());
    assert_eq!(result.case.guests, Some(0));
}
