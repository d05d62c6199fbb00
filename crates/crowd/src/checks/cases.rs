//! The cases: each plays one run of a model and returns the numbers of its rows.

use crate::checks::published::{DENSITIES_PER_M2, SINGLE_FILE, SpeedData};
use crate::checks::scene::{RunChance, add, add_way, crowd, flow_per_s, line, walls};
use crate::itinerary::{AtEnd, Itinerary, Waypoint};
use crate::model::WalkingModel;
use crate::pedestrian::Pedestrian;
use crate::pedestrians::Pedestrians;
use crate::premises::{Premises, WallLine};
use crate::vector::Vector;

/// A frame of the trajectories that cases look at, s. \[I\]
const FRAME_S: f64 = 0.1;
/// People who walk at this speed have started, m/s. \[I\]
const STARTED_MPS: f64 = 0.05;
/// The way is this much longer or the person beyond a wall, m, before it counts. \[I\]
const TOLERANCE_M: f64 = 1e-6;

/// Ages of RiMEA 7, and the speeds between which a group's mean is, m/s. \[D\]
pub(crate) const AGES: [(&str, f64, f64); 4] = [
    ("20 to 30 years", 0.58, 1.61),
    ("30 to 50 years", 1.41, 1.54),
    ("50 to 80 years", 0.68, 1.41),
    ("handicapped", 0.46, 0.76),
];

/// RiMEA 1: one person on 40 m. Time, length of the way over 40 m, and how far they go on after they have arrived, m.
pub(crate) fn single_person<M: WalkingModel + Clone>(
    model: &M,
    chance: &mut RunChance,
) -> Vec<f64> {
    let premises = Premises {
        walls: [
            walls(&[(-2.0, 0.0), (44.0, 0.0)]),
            walls(&[(-2.0, 2.0), (44.0, 2.0)]),
        ]
        .concat(),
        ..Premises::default()
    };
    let mut crowd = crowd(model, &premises);
    let radius_m = model.body_radius_m();
    let y = chance.places.between(radius_m, 2.0 - radius_m);
    let goal = Vector::new(40.0, y);
    let way = Itinerary {
        waypoints: vec![Waypoint::Place {
            at: goal,
            within_m: 0.1,
        }],
        at_end: AtEnd::Stand,
    };
    let way = add_way(&mut crowd, way);
    let id = add(
        &mut crowd,
        Pedestrian {
            radius_m,
            desired_mps: 1.33,
            itinerary: way,
            ..Pedestrian::at(Vector::new(0.0, y))
        },
    );

    let mut walked_m = 0.0;
    let mut last = Vector::new(0.0, y);
    while !crowd.has_arrived(id) && crowd.now_s() < 60.0 {
        crowd.advance(FRAME_S, 1);
        let here = position(&crowd, id);
        walked_m += (here - last).length();
        last = here;
    }
    let time_s = crowd.now_s();
    let arrived = last;
    crowd.advance(5.0, 1);
    let drift_m = (position(&crowd, id) - arrived).length();
    vec![time_s, walked_m / 40.0, drift_m]
}

/// RiMEA 4: a corridor of 26 m by 2 m that repeats itself, 70 s, of which the first 10 s do not count. The mean speeds at the
/// densities of [`DENSITIES_PER_M2`] and at 6 persons per m²; root mean square distances to the three sets of data; the share of
/// time that people walk backward, and the deepest overlap of two bodies over their diameter, both at 3 persons per m².
pub(crate) fn corridor<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let mut values = Vec::new();
    let mut backward = 0.0;
    let mut overlap = 0.0;
    for density in DENSITIES_PER_M2 {
        let walked = ring(model, chance, 26.0, 2.0, (density * 52.0).round() as usize);
        values.push(walked.speed_mps);
        backward = walked.backward;
        overlap = walked.overlap;
    }
    let jam = ring(model, chance, 26.0, 2.0, 312);

    let speeds_mps = values.clone();
    values.push(jam.speed_mps);
    for data in SpeedData::ALL {
        let mut sum = 0.0;
        for (speed, published) in speeds_mps.iter().zip(data.speeds_mps()) {
            sum += (speed - published) * (speed - published);
        }
        values.push((sum / speeds_mps.len() as f64).sqrt());
    }
    values.extend([backward, overlap]);
    values
}

/// Single file: a corridor of 24 m that repeats itself, 0.2 m broader than a body, so that no two walk side by side. \[I\] The
/// mean speeds at the densities of [`SINGLE_FILE`].
pub(crate) fn single_file<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let breadth_m = 2.0 * model.body_radius_m() + 0.2;
    let mut values = Vec::new();
    for (per_m, _) in SINGLE_FILE {
        let count = (per_m * 24.0).round() as usize;
        values.push(ring(model, chance, 24.0, breadth_m, count).speed_mps);
    }
    values
}

/// What was measured of a corridor that repeats itself.
struct RingWalk {
    /// Mean velocity along the corridor, m/s.
    speed_mps: f64,
    /// Share of time in which people walk backward.
    backward: f64,
    /// Deepest overlap of two bodies over their diameter.
    overlap: f64,
}

fn ring<M: WalkingModel + Clone>(
    model: &M,
    chance: &mut RunChance,
    length_m: f64,
    breadth_m: f64,
    count: usize,
) -> RingWalk {
    let premises = Premises {
        walls: [
            walls(&[(-9.0, 0.0), (length_m + 9.0, 0.0)]),
            walls(&[(-9.0, breadth_m), (length_m + 9.0, breadth_m)]),
        ]
        .concat(),
        period_m: Some(length_m),
        ..Premises::default()
    };
    let mut crowd = crowd(model, &premises);
    let way = add_way(&mut crowd, Itinerary::along(Vector::new(1.0, 0.0)));
    let radius_m = model.body_radius_m();
    for place in chance.ring_places(length_m, breadth_m, count, radius_m) {
        add(&mut crowd, chance.person(place, radius_m, way));
    }

    crowd.advance(10.0, 1);
    let mut sum_mps = 0.0;
    let mut backward = 0_usize;
    let mut seen = 0_usize;
    while crowd.now_s() < 70.0 - FRAME_S {
        crowd.advance(5.0 * FRAME_S, 1);
        for person in crowd.iter() {
            sum_mps += person.velocity.x;
            backward += usize::from(person.velocity.x < -STARTED_MPS);
            seen += 1;
        }
    }
    RingWalk {
        speed_mps: sum_mps / seen.max(1) as f64,
        backward: backward as f64 / seen.max(1) as f64,
        overlap: deepest_overlap(&crowd, length_m),
    }
}

/// The deepest overlap of two bodies over their diameter.
fn deepest_overlap<M: WalkingModel>(crowd: &Pedestrians<M>, period_m: f64) -> f64 {
    let people: Vec<&Pedestrian> = crowd.iter().collect();
    let mut deepest = 0.0_f64;
    for (index, one) in people.iter().enumerate() {
        for other in &people[index + 1..] {
            let mut offset = other.position - one.position;
            offset.x -= (offset.x / period_m).round() * period_m;
            let diameter_m = one.radius_m + other.radius_m;
            deepest = deepest.max(1.0 - offset.length() / diameter_m);
        }
    }
    deepest
}

/// RiMEA 5: ten people with reaction times of 10, 20, …, 100 s. How far the start of one is from their reaction time at most,
/// in frames.
pub(crate) fn reaction<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let premises = Premises {
        walls: walls(&[
            (8.0, 2.0),
            (8.0, 0.0),
            (0.0, 0.0),
            (0.0, 5.0),
            (8.0, 5.0),
            (8.0, 3.0),
        ]),
        ..Premises::default()
    };
    let mut crowd = crowd(model, &premises);
    let exit = line((8.0, 2.0), (8.0, 3.0));
    let way = add_way(&mut crowd, Itinerary::leaving_by(&[exit]));
    let radius_m = model.body_radius_m();
    let mut places = chance.places(Vector::new(0.5, 0.5), Vector::new(5.0, 4.5), 10, radius_m);
    // Who is closest to the exit goes first, so nobody has to wait for those who stand.
    places.sort_by(|one, other| other.x.total_cmp(&one.x));
    let mut started_s = Vec::new();
    for (index, place) in places.into_iter().enumerate() {
        add(
            &mut crowd,
            Pedestrian {
                starts_s: 10.0 * (index + 1) as f64,
                ..chance.person(place, radius_m, way)
            },
        );
        started_s.push(None);
    }

    while crowd.now_s() < 105.0 {
        crowd.advance(FRAME_S, 1);
        for person in crowd.iter() {
            if person.velocity.length() > STARTED_MPS {
                started_s[person.id as usize].get_or_insert(crowd.now_s());
            }
        }
    }
    let mut worst_frames = 0.0_f64;
    for (index, started_s) in started_s.iter().enumerate() {
        let expected_s = 10.0 * (index + 1) as f64;
        // Who never starts is as late as the case is long.
        let started_s: f64 = started_s.unwrap_or(105.0);
        worst_frames = worst_frames.max((started_s - expected_s).abs() / FRAME_S);
    }
    vec![worst_frames]
}

/// RiMEA 6: 20 people round a corner. How many were beyond a wall, how many steps of the model went through one, and how many
/// people arrived.
pub(crate) fn corner<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let premises = Premises {
        walls: [
            walls(&[(10.0, 12.0), (10.0, 2.0), (0.0, 2.0), (0.0, 0.0)]),
            walls(&[(0.0, 0.0), (12.0, 0.0), (12.0, 12.0)]),
        ]
        .concat(),
        ..Premises::default()
    };
    let mut crowd = crowd(model, &premises);
    let turn = line((10.0, 2.0), (12.0, 0.0));
    let end = line((10.0, 12.0), (12.0, 12.0));
    let way = add_way(&mut crowd, Itinerary::leaving_by(&[turn, end]));
    let radius_m = model.body_radius_m();
    for place in chance.places(Vector::ZERO, Vector::new(6.0, 2.0), 20, radius_m) {
        add(&mut crowd, chance.person(place, radius_m, way));
    }

    let mut beyond = 0;
    while !crowd.is_empty() && crowd.now_s() < 120.0 {
        crowd.advance(FRAME_S, 1);
        for person in crowd.iter() {
            beyond += usize::from(!is_in_corner(person.position));
        }
    }
    vec![
        beyond as f64,
        crowd.through_walls() as f64,
        (20 - crowd.len()) as f64,
    ]
}

fn is_in_corner(place: Vector) -> bool {
    let within =
        |value: f64, low: f64, high: f64| value >= low - TOLERANCE_M && value <= high + TOLERANCE_M;
    within(place.x, 0.0, 12.0) && within(place.y, 0.0, 2.0)
        || within(place.x, 10.0, 12.0) && within(place.y, 0.0, 12.0)
}

/// RiMEA 7: groups of 50, each person on a way of their own. The mean speed of each group over 10 s after the
/// first 5 s, m/s.
pub(crate) fn ages<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let mut values = Vec::new();
    for (_, low_mps, high_mps) in AGES {
        let mut crowd = crowd(model, &Premises::default());
        let way = add_way(&mut crowd, Itinerary::along(Vector::new(1.0, 0.0)));
        for index in 0..50 {
            // The middle half of the range: its ends are those of means of whole groups.
            let quarter_mps = (high_mps - low_mps) / 4.0;
            let desired_mps = chance
                .people
                .between(low_mps + quarter_mps, high_mps - quarter_mps);
            add(
                &mut crowd,
                Pedestrian {
                    radius_m: model.body_radius_m(),
                    desired_mps,
                    itinerary: way,
                    ..Pedestrian::at(Vector::new(0.0, 4.0 * f64::from(index)))
                },
            );
        }
        // They have sped up by then.
        crowd.advance(5.0, 1);
        let walked_m =
            |crowd: &Pedestrians<M>| -> f64 { crowd.iter().map(|person| person.position.x).sum() };
        let before_m = walked_m(&crowd);
        crowd.advance(10.0, 1);
        values.push((walked_m(&crowd) - before_m) / 50.0 / 10.0);
    }
    values
}

/// RiMEA 9: 1,000 people leave a room of 30 m by 20 m by four doors of 1 m, and by two. The times until all have left, s, and
/// their ratio.
pub(crate) fn doors<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let four_s = leave_room(model, chance, true);
    let two_s = leave_room(model, chance, false);
    vec![four_s, two_s, two_s / four_s]
}

fn leave_room<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance, has_four: bool) -> f64 {
    let side = |y: f64, has_doors: bool| {
        if has_doors {
            [
                walls(&[(0.0, y), (7.0, y)]),
                walls(&[(8.0, y), (22.0, y)]),
                walls(&[(23.0, y), (30.0, y)]),
            ]
            .concat()
        } else {
            walls(&[(0.0, y), (30.0, y)])
        }
    };
    let premises = Premises {
        walls: [
            side(0.0, true),
            side(20.0, has_four),
            walls(&[(0.0, 0.0), (0.0, 20.0)]),
            walls(&[(30.0, 0.0), (30.0, 20.0)]),
        ]
        .concat(),
        ..Premises::default()
    };
    let mut crowd = crowd(model, &premises);
    let mut ways = Vec::new();
    for (y, beyond_y) in [(0.0, -2.0), (20.0, 22.0)] {
        for x in [7.0, 22.0] {
            let door = line((x, y), (x + 1.0, y));
            let beyond = line((x - 1.0, beyond_y), (x + 2.0, beyond_y));
            ways.push(add_way(&mut crowd, Itinerary::leaving_by(&[door, beyond])));
        }
    }
    let radius_m = model.body_radius_m();
    let size = Vector::new(30.0, 20.0);
    for place in chance.places(Vector::ZERO, size, 1000, radius_m) {
        let is_right = usize::from(place.x > 15.0);
        let is_upper = usize::from(has_four && place.y > 10.0);
        let way = ways[2 * is_upper + is_right];
        add(&mut crowd, chance.person(place, radius_m, way));
    }

    while !crowd.is_empty() && crowd.now_s() < 3600.0 {
        crowd.advance(10.0 * FRAME_S, 1);
    }
    crowd.now_s()
}

/// RiMEA 12: 150 people from a room of 10 m by 10 m through a corridor of 5 m by 1 m into another room, and away. The flow into
/// the corridor, the one out of it, and how much more goes in, 1/s.
pub(crate) fn two_rooms<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    let premises = Premises {
        walls: [
            walls(&[
                (10.0, 5.5),
                (10.0, 10.0),
                (0.0, 10.0),
                (0.0, 0.0),
                (10.0, 0.0),
                (10.0, 4.5),
                (15.0, 4.5),
                (15.0, 0.0),
                (25.0, 0.0),
                (25.0, 4.5),
            ]),
            walls(&[
                (10.0, 5.5),
                (15.0, 5.5),
                (15.0, 10.0),
                (25.0, 10.0),
                (25.0, 5.5),
            ]),
        ]
        .concat(),
        ..Premises::default()
    };
    let lines = [
        line((10.0, 4.5), (10.0, 5.5)),
        line((15.0, 4.5), (15.0, 5.5)),
        line((25.0, 4.5), (25.0, 5.5)),
        line((27.0, 4.0), (27.0, 6.0)),
    ];
    let size = Vector::new(10.0, 10.0);
    let times_s = flow_times(model, chance, &premises, &lines, (Vector::ZERO, size), 150);
    let flow_in_per_s = flow_per_s(&times_s[0]);
    let flow_out_per_s = flow_per_s(&times_s[1]);
    vec![
        flow_in_per_s,
        flow_out_per_s,
        flow_in_per_s - flow_out_per_s,
    ]
}

/// 75 people through a gate of 0.5 m at the end of a corridor of 5.6 m. The flow, and that of the middle 60 % of
/// them, 1/s.
pub(crate) fn gate<M: WalkingModel + Clone>(model: &M, chance: &mut RunChance) -> Vec<f64> {
    gate_with_way_behind(model, chance, 2.0)
}

/// The case of the gate, which people leave so far behind it, m.
fn gate_with_way_behind<M: WalkingModel + Clone>(
    model: &M,
    chance: &mut RunChance,
    behind_m: f64,
) -> Vec<f64> {
    let premises = Premises {
        walls: [
            walls(&[(8.0, 2.55), (8.0, 0.0), (-1.0, 0.0), (-1.0, 5.6)]),
            walls(&[(-1.0, 5.6), (8.0, 5.6), (8.0, 3.05)]),
        ]
        .concat(),
        ..Premises::default()
    };
    let lines = [
        line((8.0, 2.55), (8.0, 3.05)),
        line((8.0 + behind_m, 1.8), (8.0 + behind_m, 3.8)),
    ];
    let area = (Vector::ZERO, Vector::new(6.0, 5.6));
    let times_s = flow_times(model, chance, &premises, &lines, area, 75);
    let passed = &times_s[0];
    let cut = passed.len() / 5;
    vec![
        flow_per_s(passed),
        flow_per_s(&passed[cut..passed.len() - cut]),
    ]
}

/// Plays people who go through lines one after the other; returns, for each line, when they crossed it, s.
fn flow_times<M: WalkingModel + Clone>(
    model: &M,
    chance: &mut RunChance,
    premises: &Premises,
    lines: &[WallLine],
    area: (Vector, Vector),
    count: usize,
) -> Vec<Vec<f64>> {
    let mut crowd = crowd(model, premises);
    let way = add_way(&mut crowd, Itinerary::leaving_by(lines));
    let radius_m = model.body_radius_m();
    let mut reached = Vec::new();
    for place in chance.places(area.0, area.1, count, radius_m) {
        add(&mut crowd, chance.person(place, radius_m, way));
        reached.push(0_usize);
    }

    let mut times_s = vec![Vec::new(); lines.len()];
    while !crowd.is_empty() && crowd.now_s() < 600.0 {
        crowd.advance(FRAME_S, 1);
        for (id, reached) in reached.iter_mut().enumerate() {
            let now = crowd
                .get(id as u32)
                .map_or(lines.len(), |person| usize::from(person.reached));
            for times_s in &mut times_s[*reached..now] {
                times_s.push(crowd.now_s());
            }
            *reached = now;
        }
    }
    times_s
}

fn position<M: WalkingModel>(crowd: &Pedestrians<M>, id: u32) -> Vector {
    crowd.get(id).map_or(Vector::ZERO, |person| person.position)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision_free::CollisionFree;

    /// The mean flow through the gate, 1/s, if people leave the case so far behind it, m.
    fn mean_flow_per_s(behind_m: f64) -> f64 {
        let runs = 10;
        let mut sum_per_s = 0.0;
        for run in 0..runs {
            let mut chance = RunChance::new(2, run, 10);
            sum_per_s += gate_with_way_behind(&CollisionFree::default(), &mut chance, behind_m)[0];
        }
        sum_per_s / runs as f64
    }

    /// Who walks away behind the gate makes room, so people who vanish there would let more of them through.
    #[test]
    fn the_flow_through_the_gate_does_not_depend_on_where_people_leave_the_case() {
        let flow_per_s = mean_flow_per_s(2.0);
        let with_long_way_per_s = mean_flow_per_s(8.0);
        assert!(
            (flow_per_s - with_long_way_per_s).abs() <= 0.05,
            "{flow_per_s} {with_long_way_per_s}"
        );

        let with_short_way_per_s = mean_flow_per_s(0.5);
        assert!(
            with_short_way_per_s > flow_per_s + 0.2,
            "{flow_per_s} {with_short_way_per_s}"
        );
    }
}
