//! Golden vectors for a waiter with 30 treats, one of which is taken every second, and a refiller 30 ft away.
//!
//! The times have not been published. They were computed by an independent model of the same rules [I], and verify
//! the order of evaluation as well as the formulas.

use super::waiter::{Act, Change, DT_S, FT_M, Waiter};
use affect::DynamicsParameters;
use affect::StandardEmotion::{self, Concerned, Confident, Frustrated, Happy};

fn emotions(changes: &[Change]) -> Vec<StandardEmotion> {
    changes.iter().map(|change| change.1).collect()
}

fn assert_within_a_tick(got: &[Change], expected: &[Change], what: &str) {
    assert_eq!(emotions(got), emotions(expected), "{what}: {got:?}");

    for (got, expected) in got.iter().zip(expected) {
        assert!(
            (got.0 - expected.0).abs() <= DT_S,
            "{what}: {got:?} is not {expected:?}"
        );
        assert!(
            got.2.abs_diff(expected.2) <= 1,
            "{what}: {got:?} is not {expected:?}"
        );
    }
}

/// Runs until the refiller arrives, or for `limit_s` seconds.
fn run(caution: f64, closing_ft_s: f64, limit_s: f64) -> Waiter {
    let mut waiter = Waiter::new(&DynamicsParameters::default(), caution);

    while waiter.time_s() < limit_s && !waiter.has_met() {
        waiter.tick(closing_ft_s * FT_M);
    }

    waiter
}

#[test]
fn t03_the_refiller_never_moves() {
    let table = [
        (0.00, [(24.0, 6), (26.0, 4), (28.5, 2)]),
        (0.25, [(19.0, 11), (21.0, 9), (23.0, 7)]),
        (0.50, [(14.5, 16), (16.5, 14), (18.0, 12)]),
        (0.75, [(10.0, 20), (12.0, 18), (13.5, 17)]),
        (1.00, [(6.0, 24), (8.0, 22), (9.5, 21)]),
    ];

    for (caution, row) in table {
        let expected: Vec<Change> = row
            .iter()
            .zip([Confident, Concerned, Frustrated])
            .map(|(&(time_s, treats), emotion)| (time_s, emotion, treats))
            .collect();

        let waiter = run(caution, 0.0, 60.0);
        assert_within_a_tick(&waiter.changes, &expected, &format!("caution {caution}"));
        // The requirement is one tick; in fact, the vectors match exactly.
        assert_eq!(waiter.changes, expected);
    }
}

#[test]
fn t03_the_refiller_comes_when_called() {
    let waiter = run(0.5, 3.0, 60.0);
    assert_within_a_tick(
        &waiter.changes,
        &[(14.5, Confident, 16), (22.0, Happy, 8)],
        "caution 0.5",
    );
    assert_eq!(
        (waiter.time_s(), waiter.treats(), waiter.has_met()),
        (23.5, 7, true)
    );

    let waiter = run(0.0, 3.0, 60.0);
    assert_within_a_tick(
        &waiter.changes,
        &[(24.0, Confident, 6), (29.0, Concerned, 1)],
        "caution 0",
    );
    assert_eq!(
        (waiter.time_s(), waiter.treats(), waiter.has_met()),
        (33.0, 0, true)
    );
}

#[test]
fn t02_emotions_come_in_order_and_each_message_once() {
    for caution in [0.0, 0.3, 0.7, 1.0] {
        let waiter = run(caution, 0.0, 120.0);

        assert_eq!(
            emotions(&waiter.changes),
            [Confident, Concerned, Frustrated]
        );
        assert_eq!(waiter.acts, [Act::Refill, Act::Hurry]);
    }
}

#[test]
fn t04_more_caution_is_never_later() {
    let runs: Vec<Waiter> = (0..=50)
        .map(|step| run(f64::from(step) / 50.0, 0.0, 120.0))
        .collect();

    for pair in runs.windows(2) {
        for emotion in [Confident, Concerned, Frustrated] {
            let less_cautious_s = time_of(emotion, &pair[0].changes);
            let more_cautious_s = time_of(emotion, &pair[1].changes);

            assert!(more_cautious_s <= less_cautious_s, "{:?}", pair[1].changes);
        }
    }
}

/// When the emotion was entered, in seconds.
fn time_of(emotion: StandardEmotion, changes: &[Change]) -> f64 {
    let change = changes.iter().find(|change| change.1 == emotion);
    change.unwrap().0
}

#[test]
fn t23_a_run_saved_at_any_tick_continues_identically() {
    for closing_ft_s in [0.0, 3.0] {
        let straight = run(0.5, closing_ft_s, 40.0);

        for save_tick in 0..80 {
            let mut waiter = Waiter::new(&DynamicsParameters::default(), 0.5);

            for tick in 0..80 {
                if tick == save_tick {
                    waiter.through_text();
                }
                if !waiter.has_met() {
                    waiter.tick(closing_ft_s * FT_M);
                }
            }

            assert_eq!(
                waiter.changes, straight.changes,
                "saved at tick {save_tick}"
            );
            assert_eq!(
                waiter.esg.state(),
                straight.esg.state(),
                "saved at tick {save_tick}"
            );
        }
    }
}
