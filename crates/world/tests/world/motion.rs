//! One tick: the order of motion, the collision rule, and the verdicts.

use crate::halls::{
    FT, TestWorld, any_hall, check_promises, crowded, is_inside, movers, overlap, reception, rng,
};
use proptest::prelude::*;
use rand::{Rng, RngExt};
use world::{Blocker, Body, Hall, MoveOutcome, Point, Shapes, World};

/// The rules of a tick in their simplest form: every body is compared with every other.
struct Plain {
    obstacles: Vec<Point>,
    robots: usize,
    movers: Vec<Point>,
}

impl Plain {
    fn of(world: &TestWorld) -> Self {
        Self {
            obstacles: world.obstacles().to_vec(),
            robots: world.robots().len(),
            movers: movers(world),
        }
    }

    fn attempt(&mut self, world: &TestWorld, mover: usize, to: Point) -> Option<Blocker> {
        let field = world.field();
        if !field.contains(to) {
            return Some(Blocker::Edge);
        }

        for (index, &obstacle) in self.obstacles.iter().enumerate() {
            if overlap(field.body_m, obstacle, to) {
                return Some(Blocker::Body(Body::Obstacle(index)));
            }
        }

        for (other, &at) in self.movers.iter().enumerate() {
            if other != mover && overlap(field.body_m, at, to) {
                return Some(Blocker::Body(self.body(other)));
            }
        }

        self.movers[mover] = to;
        None
    }

    fn body(&self, mover: usize) -> Body {
        if mover < self.robots {
            Body::Robot(mover)
        } else {
            Body::Guest(mover - self.robots)
        }
    }

    fn judge(&mut self, world: &TestWorld, robot: usize, proposal: Option<Point>) -> MoveOutcome {
        let Some(to) = proposal else {
            return MoveOutcome::Stayed;
        };
        if !(to.x.is_finite() && to.y.is_finite()) {
            return MoveOutcome::NotFinite;
        }

        let step = to - self.movers[robot];
        let distance_m = (step.x * step.x + step.y * step.y).sqrt();
        if distance_m > world.stride_m() + 1e-9 {
            return MoveOutcome::TooFast;
        }

        match self.attempt(world, robot, to) {
            Some(by) => MoveOutcome::Blocked { by },
            None => MoveOutcome::Advanced,
        }
    }
}

/// Proposals that a faulty or hostile robot could make.
fn hostile(world: &TestWorld, rng: &mut impl Rng) -> Vec<Option<Point>> {
    let stride_m = world.stride_m();
    let all = movers(world);
    let mut proposals = Vec::new();

    for &at in world.robots() {
        let direction_rad = rng.random::<f64>() * 7.0;
        let away = Point::new(libm::cos(direction_rad), libm::sin(direction_rad));

        proposals.push(match rng.random_range(0..12) {
            0 => None,
            1 => Some(at),
            2 => Some(Point::new(f64::NAN, at.y)),
            3 => Some(Point::new(at.x, f64::NEG_INFINITY)),
            4 => Some(Point::new(-1e300, 1e300)),
            5 => Some(all[rng.random_range(0..all.len())]),
            6 => Some(at + away * (stride_m * 1.01 + 1e-6)),
            7 => Some(at + away * stride_m),
            _ => Some(at + away * (stride_m * rng.random::<f64>())),
        });
    }

    proposals
}

/// Runs a world with hostile robots and compares every tick with [`Plain`].
fn check_run(world: &mut TestWorld, ticks: usize, seed: u64) {
    let mut rng = rng(seed);
    check_promises(world);

    for _ in 0..ticks {
        let proposals = hostile(world, &mut rng);
        let before = world.clone();
        let mut plain = Plain::of(world);
        let verdicts = world.advance(&proposals);

        for (robot, &proposal) in proposals.iter().enumerate() {
            assert_eq!(
                verdicts[robot],
                plain.judge(&before, robot, proposal),
                "robot {robot} {proposal:?}"
            );
        }

        for (guest, course) in world.courses().iter().enumerate() {
            let mover = plain.robots + guest;
            let to = plain.movers[mover] + course.step_m;
            assert_eq!(
                world.guest_blockers()[guest],
                plain.attempt(&before, mover, to),
                "guest {guest}"
            );
        }

        assert_eq!(movers(world), plain.movers);
        assert_eq!(world.obstacles(), plain.obstacles);
        check_promises(world);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// 24,000 ticks, in halls from empty to full.
    #[test]
    fn every_tick_follows_the_rules(mut hall in any_hall(), share in 0.0..=1.0, seed in any::<u64>()) {
        let mut world = crowded(&mut hall, share, seed);
        check_run(&mut world, 60, seed ^ 1);
    }

    #[test]
    fn same_seed_same_trajectory(mut hall in any_hall(), share in 0.0..=1.0, seed in any::<u64>()) {
        let mut world = crowded(&mut hall, share, seed);
        let mut again = World::new(&hall, rng(seed)).unwrap();
        let mut proposer = rng(seed ^ 2);

        for tick in 0..20 {
            let proposals = hostile(&world, &mut proposer);
            prop_assert_eq!(world.advance(&proposals), again.advance(&proposals));
            prop_assert_eq!(&world, &again);

            if tick == 10 {
                again = world.clone();
            }
        }
    }

    /// Robots do not affect the stream: the guests draw the same courses, whatever the robots do.
    #[test]
    fn courses_do_not_depend_on_robots(mut hall in any_hall(), seed in any::<u64>()) {
        let mut wild = crowded(&mut hall, 0.5, seed);
        let mut calm = wild.clone();
        let mut proposer = rng(seed);

        for _ in 0..40 {
            wild.advance(&hostile(&wild, &mut proposer));
            calm.advance(&vec![None; calm.robots().len()]);
            prop_assert_eq!(wild.courses(), calm.courses());
        }
    }
}

#[test]
fn the_reception_follows_the_rules_at_every_density() {
    for count in [0, 1, 25, 100, 200, 300, 350, 400, 500, 600, 620] {
        let mut hall = reception(count);
        hall.obstacles = vec![
            Point::new(3.0 * FT, 3.0 * FT),
            Point::new(5.0 * FT, 3.0 * FT),
        ];
        hall.robots = vec![
            Point::new(25.0 * FT, 25.0 * FT),
            Point::new(3.0 * FT, 5.0 * FT),
        ];

        let mut world = World::new(&hall, rng(count as u64)).unwrap();
        check_run(&mut world, 200, 7);
    }
}

#[test]
fn no_guest_moves_in_a_full_hall() {
    let mut world = World::new(&reception(625), rng(4)).unwrap();
    let before = world.guests().to_vec();

    for _ in 0..100 {
        world.advance(&[]);
        check_promises(&world);
        assert!(world.guest_blockers().iter().all(Option::is_some));
    }

    assert_eq!(world.guests(), before);
}

/// A hall of 10 m by 10 m without guests. Bodies are 1 m wide, and robots move up to 1 m per tick.
fn quiet(obstacles: &[(f64, f64)], robots: &[(f64, f64)]) -> TestWorld {
    let hall = Hall {
        field: world::Field {
            size_m: (10.0, 10.0),
            body_m: 1.0,
        },
        obstacles: points(obstacles),
        robots: points(robots),
        shapes: Shapes::default(),
        max_speed_mps: 10.0,
        ..reception(0)
    };

    World::new(&hall, rng(0)).unwrap()
}

fn points(places: &[(f64, f64)]) -> Vec<Point> {
    places.iter().map(|&(x, y)| Point::new(x, y)).collect()
}

fn go(x: f64, y: f64) -> Option<Point> {
    Some(Point::new(x, y))
}

fn blocked(body: Body) -> MoveOutcome {
    MoveOutcome::Blocked {
        by: Blocker::Body(body),
    }
}

#[test]
fn robots_move_in_index_order() {
    // The follower can take the leader's place if the leader moves first, and not otherwise.
    let mut world = quiet(&[], &[(5.5, 5.0), (4.5, 5.0)]);
    assert_eq!(
        world.advance(&[go(6.5, 5.0), go(5.5, 5.0)]),
        [MoveOutcome::Advanced, MoveOutcome::Advanced]
    );

    let mut world = quiet(&[], &[(4.5, 5.0), (5.5, 5.0)]);
    let verdicts = world.advance(&[go(5.5, 5.0), go(6.5, 5.0)]);
    assert_eq!(verdicts, [blocked(Body::Robot(1)), MoveOutcome::Advanced]);

    // The first of two robots that propose the same location gets it.
    let mut world = quiet(&[], &[(4.0, 5.0), (6.0, 5.0)]);
    let verdicts = world.advance(&[go(5.0, 5.0), go(5.0, 5.0)]);
    assert_eq!(verdicts, [MoveOutcome::Advanced, blocked(Body::Robot(0))]);
}

#[test]
fn robots_move_before_guests() {
    let mut tried = 0;

    for seed in 0..50 {
        let mut hall = Hall {
            shapes: Shapes::default(),
            max_speed_mps: 1000.0,
            ..reception(1)
        };
        hall.robots = vec![Point::new(1.0, 1.0)];
        let mut world = World::new(&hall, rng(seed)).unwrap();

        // Next to the guest, on the side that it is about to move to.
        let side_m = hall.field.body_m * world.courses()[0].step_m.x.signum();
        let to = world.guests()[0] + Point::new(side_m, 0.0);
        if !world.field().contains(to) {
            continue;
        }

        tried += 1;
        assert_eq!(world.advance(&[Some(to)]), [MoveOutcome::Advanced]);
        assert_eq!(
            world.guest_blockers(),
            [Some(Blocker::Body(Body::Robot(0)))]
        );
    }

    assert!(tried > 25, "{tried}");
}

#[test]
fn touching_is_not_colliding() {
    let mut world = quiet(&[(2.5, 5.0)], &[(4.0, 5.0), (4.0, 6.0)]);
    assert_eq!(
        world.advance(&[go(3.5, 5.0), go(3.5, 6.0)]),
        [MoveOutcome::Advanced, MoveOutcome::Advanced]
    );
    assert_eq!(
        world.advance(&[go(3.5 - 5e-10, 5.0), None]),
        [MoveOutcome::Advanced, MoveOutcome::Stayed]
    );
    let verdicts = world.advance(&[go(3.5 - 2e-9, 5.0), go(3.5, 6.0 - 2e-9)]);
    assert_eq!(
        verdicts,
        [blocked(Body::Obstacle(0)), blocked(Body::Robot(0))]
    );

    // The tolerance applies to positions, so it cannot accumulate over several ticks.
    for nanometers in 1..100 {
        world.advance(&[go(3.5 - f64::from(nanometers) * 1e-9, 5.0), None]);
    }
    check_promises(&world);
}

#[test]
fn robots_cannot_leave_the_field() {
    let mut world = quiet(&[], &[(0.5, 0.5), (9.5, 9.5)]);
    let edge = MoveOutcome::Blocked { by: Blocker::Edge };

    let past_left_and_right = [go(0.4, 0.5), go(9.6, 9.5)];
    assert_eq!(world.advance(&past_left_and_right), [edge, edge]);

    let past_bottom_and_top = [go(0.5, 0.4), go(9.5, 9.6)];
    assert_eq!(world.advance(&past_bottom_and_top), [edge, edge]);

    assert!(!is_inside(world.field(), Point::new(0.4, 0.5)));
    check_promises(&world);
}

#[test]
fn the_first_of_several_blockers_is_reported() {
    let mut world = quiet(&[(1.2, 4.5), (1.2, 5.5)], &[(2.5, 5.0), (1.9, 6.5)]);

    assert_eq!(
        world.advance(&[go(1.9, 5.2), None]),
        [blocked(Body::Obstacle(0)), MoveOutcome::Stayed]
    );
    assert_eq!(
        world.advance(&[go(2.5, 5.8), None]),
        [blocked(Body::Robot(1)), MoveOutcome::Stayed]
    );
}

#[test]
fn a_rejected_proposal_keeps_the_robot_in_place() {
    let mut world = quiet(&[], &[(5.0, 5.0)]);

    for (proposal, verdict) in [
        (None, MoveOutcome::Stayed),
        (go(6.0 + 1e-6, 5.0), MoveOutcome::TooFast),
        (go(5.8, 5.8), MoveOutcome::TooFast),
        (go(1e300, -1e300), MoveOutcome::TooFast),
        (go(f64::NAN, 5.0), MoveOutcome::NotFinite),
        (go(5.0, f64::INFINITY), MoveOutcome::NotFinite),
    ] {
        assert_eq!(world.advance(&[proposal]), [verdict]);
        assert_eq!(world.robots(), [Point::new(5.0, 5.0)]);
    }

    assert_eq!(world.advance(&[go(6.0, 5.0)]), [MoveOutcome::Advanced]);
    assert_eq!(world.robots(), [Point::new(6.0, 5.0)]);
}

#[test]
#[should_panic(expected = "one proposal for each robot")]
fn a_missing_proposal_panics() {
    quiet(&[], &[(5.0, 5.0)]).advance(&[]);
}
