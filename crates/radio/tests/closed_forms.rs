//! Each model against its closed form, over at least 10^5 draws, within bounds of 99 %.

use radio::{
    Fading, LinkGeometry, LossTerm, NakagamiStep, PathLoss, RadioModel, SendQueue, Shadowing,
    Transmitter, outage, regularized_gamma,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

const DRAWS: u32 = 200_000;
/// Quantile of the normal distribution for bounds of 99 %.
const Z_99: f64 = 2.576;

fn units(seed: u64) -> impl FnMut() -> f64 {
    let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed);
    move || (stream.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Checks that a share of draws is within 99 % bounds of its probability.
#[track_caller]
fn check_share(what: &str, hits: u32, probability: f64) {
    let n = f64::from(DRAWS);
    let share = f64::from(hits) / n;
    let room = Z_99 * (probability * (1.0 - probability) / n).sqrt();
    assert!(
        (share - probability).abs() <= room,
        "{what}: {share} is not {probability} within {room}"
    );
}

fn model() -> RadioModel {
    RadioModel {
        transmit_dbm: 16.0,
        sensitivity_dbm: -84.0,
        path_loss: PathLoss::LogDistance {
            exponent: 3.0,
            reference_m: 1.0,
            reference_db: 40.0,
        },
        walls_db: 6.0,
        bodies_db: 3.0,
        shadowing: None,
        fading: Fading::None,
    }
}

fn at(distance_m: f64) -> LinkGeometry {
    LinkGeometry {
        distance_m,
        ..LinkGeometry::default()
    }
}

#[test]
fn path_losses_are_those_of_ns_3() {
    // ns-3, src/propagation/test/propagation-loss-model-test-suite.cc: received watts of a transmission with 0.05035702 W.
    let log_distance = PathLoss::LogDistance {
        exponent: 3.0,
        reference_m: 1.0,
        reference_db: 40.045_997,
    };
    // A wavelength of 0.125 m.
    let friis = PathLoss::Friis {
        frequency_hz: 2_398_339_664.0,
    };
    let vectors = [
        (log_distance, 10.0, 4.98265e-9),
        (log_distance, 20.0, 6.22831e-10),
        (log_distance, 40.0, 7.78539e-11),
        (log_distance, 80.0, 9.73173e-12),
        (friis, 100.0, 4.98265e-10),
        (friis, 500.0, 1.99306e-11),
        (friis, 1000.0, 4.98265e-12),
    ];
    for (loss, distance_m, watts) in vectors {
        let received = 0.050_357_02 * libm::pow(10.0, -loss.loss_db(distance_m) / 10.0);
        let relative = (received / watts - 1.0).abs();
        assert!(
            relative <= 1e-6,
            "{loss:?} at {distance_m} m: {received}, off by {relative}"
        );
    }
}

#[test]
fn the_reach_is_where_the_budget_is_used_up() {
    let near = PathLoss::LogDistance {
        exponent: 2.7,
        reference_m: 2.0,
        reference_db: 46.0,
    };
    let friis = PathLoss::Friis {
        frequency_hz: 868e6,
    };
    for loss in [near, friis] {
        for budget_db in [60.0, 85.0, 100.0] {
            let reach_m = loss.reach_m(budget_db);
            assert!((loss.loss_db(reach_m) - budget_db).abs() < 1e-9, "{loss:?}");
        }
        assert_eq!(loss.reach_m(-1.0), 0.0);
    }
    assert_eq!(near.loss_db(0.0), 46.0, "as at the reference distance");
    assert_eq!(friis.loss_db(0.0), 0.0, "never a gain");
    assert_eq!(near.reach_m(45.0), 0.0);
}

#[test]
fn the_incomplete_gamma_function_has_its_known_values() {
    // P(1, x) = 1 - exp(-x), P(1/2, x) = erf(√x), P(3, x) = 1 - exp(-x)(1 + x + x²/2).
    for x in [1e-6, 0.01, 0.5, 1.0, 1.49, 2.0, 3.99, 4.1, 10.0, 30.0] {
        let close = |one: f64, other: f64| {
            assert!((one - other).abs() < 1e-13, "{x}: {one} is not {other}");
        };
        close(regularized_gamma(1.0, x), 1.0 - libm::exp(-x));
        close(regularized_gamma(0.5, x), libm::erf(x.sqrt()));
        let tail = libm::exp(-x) * (1.0 + x + x * x / 2.0);
        close(regularized_gamma(3.0, x), 1.0 - tail);
    }
    assert_eq!(regularized_gamma(2.0, 0.0), 0.0);
}

#[test]
fn rayleigh_fading_has_its_outage() {
    let mut unit = units(1);
    let mut gains = Vec::new();
    for _ in 0..DRAWS {
        gains.push(Fading::Rayleigh.gain(5.0, &mut unit));
    }
    for share in [0.01, 0.1, 0.5, 1.0, 3.0] {
        let below = gains.iter().filter(|gain| **gain < share).count() as u32;
        check_share(&format!("below {share}"), below, outage::rayleigh(share));
    }
}

#[test]
fn nakagami_fading_has_its_outage_and_a_mean_of_1() {
    for (seed, m) in [(2, 0.5), (3, 0.75), (4, 1.5), (5, 4.0), (6, 1.0)] {
        let fading = Fading::Nakagami(vec![NakagamiStep { from_m: 0.0, m }]);
        let mut unit = units(seed);
        let mut gains = Vec::new();
        for _ in 0..DRAWS {
            gains.push(fading.gain(5.0, &mut unit));
        }
        for share in [0.05, 0.2, 1.0, 2.0] {
            let below = gains.iter().filter(|gain| **gain < share).count() as u32;
            check_share(
                &format!("m {m}, {share}"),
                below,
                outage::nakagami(m, share),
            );
        }

        // The variance of the gain is 1/m.
        let mean = gains.iter().sum::<f64>() / f64::from(DRAWS);
        let room = Z_99 * (1.0 / m / f64::from(DRAWS)).sqrt();
        assert!((mean - 1.0).abs() <= room, "m {m}: {mean}");
    }
}

#[test]
fn the_shape_of_nakagami_fading_is_that_of_its_distance() {
    // The defaults of ns-3: 1.5 up to 80 m, 0.75 beyond.
    let fading = Fading::Nakagami(vec![
        NakagamiStep {
            from_m: 0.0,
            m: 1.5,
        },
        NakagamiStep {
            from_m: 80.0,
            m: 0.75,
        },
    ]);
    let shapes = [0.0, 79.9, 80.0, 500.0].map(|distance_m| fading.shape(distance_m));
    assert_eq!(shapes, [Some(1.5), Some(1.5), Some(0.75), Some(0.75)]);
    assert_eq!(Fading::Rayleigh.shape(5.0), Some(1.0));
    assert_eq!(Fading::None.gain(5.0, || unreachable!()), 1.0);
}

/// A key for each pair, as named streams give them.
fn keys(seed: u64) -> impl FnMut() -> u64 {
    let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed);
    move || stream.next_u64()
}

#[test]
fn shadowing_has_its_outage_at_every_place() {
    let shadowing = Shadowing {
        sigma_db: 6.0,
        distance_m: 5.0,
    };
    // A corner of the grid, the middle of a side, and somewhere between.
    let pairs = [
        [[5.0, 10.0], [0.0, 20.0]],
        [[7.5, 10.0], [0.0, 20.0]],
        [[6.1, 13.7], [4.4, 21.9]],
    ];
    for (seed, places_m) in (102..).zip(pairs) {
        let mut key = keys(seed);
        let mut losses_db = Vec::new();
        for _ in 0..DRAWS {
            losses_db.push(shadowing.loss_db(key(), places_m));
        }
        for margin_db in [-3.0, 0.0, 4.0, 12.0] {
            let lost = losses_db.iter().filter(|loss| **loss > margin_db);
            let expected = outage::log_normal(margin_db, 6.0);
            check_share(&format!("{margin_db} dB"), lost.count() as u32, expected);
        }
    }
}

#[test]
fn shadowing_is_correlated_as_it_says() {
    let shadowing = Shadowing {
        sigma_db: 1.0,
        distance_m: 4.0,
    };
    let other = [12.0, 3.0];
    for (seed, fraction, squares) in [
        (20, 0.0, 0.0),
        (21, 0.25, 0.0),
        (22, 0.5, 0.0),
        (23, 0.0, 2.0),
    ] {
        let mut key = keys(seed);
        let mut products = 0.0;
        for _ in 0..DRAWS {
            let key = key();
            let moved_m = 8.0 + 4.0 * (fraction + squares);
            let one = shadowing.loss_db(key, [[8.0, 4.0], other]);
            products += one * shadowing.loss_db(key, [[moved_m, 4.0], other]);
        }
        let correlation = products / f64::from(DRAWS);
        let stays: f64 = 1.0 - fraction;
        let expected = if squares > 0.0 {
            0.0
        } else {
            stays / (stays * stays + fraction * fraction).sqrt()
        };
        // The variance of a product of standard normal numbers is at most 2.
        let room = Z_99 * (2.0 / f64::from(DRAWS)).sqrt();
        assert!((correlation - expected).abs() <= room, "{correlation}");
    }
}

#[test]
fn shadowing_and_fading_together_have_the_outage_of_their_mixture() {
    let model = RadioModel {
        shadowing: Some(Shadowing {
            sigma_db: 5.0,
            distance_m: 5.0,
        }),
        fading: Fading::Nakagami(vec![NakagamiStep {
            from_m: 0.0,
            m: 1.5,
        }]),
        ..model()
    };
    let shadowing = model.shadowing.expect("it has shadowing");
    let (mut key, mut unit) = (keys(30), units(31));
    for distance_m in [40.0, 100.0, 150.0] {
        let mut lost = 0;
        for _ in 0..DRAWS {
            let shadowing_db = shadowing.loss_db(key(), [[0.0, 0.0], [distance_m, 0.0]]);
            let gain = model.fading.gain(distance_m, &mut unit);
            let reception = model.reception(at(distance_m), shadowing_db, gain);
            lost += u32::from(reception.lost.is_some());
        }
        let expected = outage::at_distance(&model, distance_m);
        check_share(&format!("{distance_m} m"), lost, expected);
    }
}

#[test]
fn a_message_is_lost_by_the_term_after_which_it_stays_too_weak() {
    let model = model();
    assert!((model.nominal_range_m() - 100.0).abs() < 1e-9);
    // 10 dB are left at 46.4 m, and none at 100 m.
    let near_m = model.path_loss.reach_m(90.0);
    let crossed = |walls, bodies| LinkGeometry {
        distance_m: near_m,
        walls,
        bodies,
    };
    let cases = [
        (at(100.0), 0.0, 1.0, None),
        (at(100.1), 0.0, 1.0, Some(LossTerm::Distance)),
        (crossed(1, 1), 0.0, 1.0, None),
        (crossed(2, 0), 0.0, 1.0, Some(LossTerm::Walls)),
        (crossed(2, 1), 0.0, 1.0, Some(LossTerm::Walls)),
        (crossed(1, 2), 0.0, 1.0, Some(LossTerm::Bodies)),
        (crossed(0, 0), 10.5, 1.0, Some(LossTerm::Shadowing)),
        (crossed(0, 0), 10.5, 2.0, None),
        (crossed(0, 0), 5.0, 0.1, Some(LossTerm::Fading)),
        // Shadowing lifts it above the sensitivity, and fading puts it below again.
        (at(120.0), -10.0, 1.0, None),
        (at(120.0), -10.0, 0.01, Some(LossTerm::Fading)),
        // It never was above the sensitivity.
        (at(200.0), -1.0, 1.0, Some(LossTerm::Distance)),
        (at(1.0), 0.0, 0.0, Some(LossTerm::Fading)),
    ];
    for (geometry, shadowing_db, gain, lost) in cases {
        let reception = model.reception(geometry, shadowing_db, gain);
        assert_eq!(reception.lost, lost, "{geometry:?} {shadowing_db} {gain}");
        assert_eq!(lost.is_none(), reception.power_dbm >= -84.0);
    }

    let weak = RadioModel {
        transmit_dbm: -90.0,
        ..model
    };
    assert_eq!(weak.nominal_range_m(), 0.0);
    let reception = weak.reception(crossed(1, 1), 0.0, 1.0);
    assert_eq!(reception.lost, Some(LossTerm::Distance));
}

#[test]
fn messages_wait_in_the_queue_as_long_as_m_d_1_says() {
    // 1000 bits take 10 ms.
    let transmitter = Transmitter {
        bit_rate_bps: 100_000.0,
        queue_bytes: f64::INFINITY,
        overhead_bytes: 25.0,
    };
    let sending_s = 0.01;
    for (seed, load) in [(40, 0.3), (41, 0.6), (42, 0.8)] {
        // Waits of messages that follow each other are not independent: batches of 4000 nearly are.
        const BATCHES: usize = 200;
        const BATCH: usize = 4000;
        let mut unit = units(seed);
        let mut queue = SendQueue::default();
        let mut now_s = 0.0;
        let mut means_s = Vec::new();
        for _ in 0..BATCHES {
            let mut waited_s = 0.0;
            for _ in 0..BATCH {
                now_s += -libm::log(1.0 - unit()) * sending_s / load;
                let sent_s = queue.offer(now_s, 100, &transmitter).expect("it has room");
                waited_s += sent_s - sending_s - now_s;
            }
            means_s.push(waited_s / BATCH as f64);
        }

        let n = BATCHES as f64;
        let mean_s = means_s.iter().sum::<f64>() / n;
        let squares: f64 = means_s
            .iter()
            .map(|one| (one - mean_s) * (one - mean_s))
            .sum();
        let room_s = Z_99 * (squares / (n - 1.0) / n).sqrt();
        let expected_s = outage::waiting_s(load, sending_s);
        assert!(
            (mean_s - expected_s).abs() <= room_s,
            "load {load}: {mean_s} is not {expected_s} within {room_s}"
        );
        assert!(room_s < 0.05 * expected_s, "the bound says something");
    }
}

#[test]
fn a_queue_that_is_full_takes_nothing_and_empties() {
    // 1 byte takes 1 s.
    let transmitter = Transmitter {
        bit_rate_bps: 8.0,
        queue_bytes: 10.0,
        overhead_bytes: 1.0,
    };
    let mut queue = SendQueue::default();
    assert_eq!(queue.offer(0.0, 10, &transmitter), None, "it is longer");
    assert_eq!(queue.offer(0.0, 4, &transmitter), Some(5.0));
    assert_eq!(queue.offer(0.0, 4, &transmitter), Some(10.0));
    assert_eq!(queue.offer(0.0, 0, &transmitter), None);
    assert_eq!(queue.offer(1.0, 0, &transmitter), Some(11.0));
    assert_eq!(queue.backlog_s(5.0), 6.0);
    assert_eq!(
        queue.offer(20.0, 2, &transmitter),
        Some(23.0),
        "idle until then"
    );
}
