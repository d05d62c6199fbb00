//! The collision-free speed model.

use crate::model::{NearWall, Neighbor, Surroundings, WalkingModel};
use crate::vector::Vector;

/// The collision-free speed model: direction from repulsion, speed from the gap in front. \[D\] Tordeux, Chraibi, Seyfried 2016,
/// "Collision-free speed model for pedestrian dynamics", eq. 1 to 4.
///
/// Direction: e = unit(e0 - sum a exp((l - s)/D) n), with the distance s to each neighbor in direction n, and l the sum of both
/// radii. Speed: V = min(v0, max(0, (s - l)/T)), with the distance s to the closest neighbor in front. No step is longer than the
/// gap, so in continuous time no two bodies touch.
///
/// The default parameters are calibrated, all of them at once, to the line of Weidmann (1993) between 0.5 and 3 persons per m² in a
/// corridor of 2 m, with Weidmann's spread of desired speeds, and to the flow through a gate of 0.5 m. Three rules are added:
/// `anticipation_s`, because people behind a gate walk away from those who follow; `breadth` and `breadth_left`, because people
/// who meet in front of it go one after the other; `turns`, because people of different speeds overtake each other. \[I\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollisionFree {
    /// T, the time gap to who is in front, s. \[D\] 1.0, here calibrated.
    pub time_gap_s: f64,
    /// τ, how far ahead people think of who walks away from them, s. Who is followed at the gap s - l, and walks at u, is followed at
    /// (s - l + τ u)/(T + τ), if that is more than (s - l)/T. Where all walk at the same speed this changes nothing. \[D\] 0. \[I\]
    pub anticipation_s: f64,
    /// a, strength of the repulsion by neighbors. \[D\] 5.
    pub repulsion: f64,
    /// D, range of the repulsion by neighbors, m. \[D\] 0.1.
    pub range_m: f64,
    /// Strength of the repulsion by walls. \[D\] 5, in JuPedSim.
    pub wall_repulsion: f64,
    /// Range of the repulsion by walls, m. \[D\] 0.02, in JuPedSim.
    pub wall_range_m: f64,
    /// Share of l within which a neighbor to the right of the way ahead is in front. \[D\] 1.
    pub breadth: f64,
    /// The same to the left. Where it is smaller, people let those from the right go first, and two in front of a door do not wait
    /// for each other. \[D\] 1. \[I\] People have a side preference: Moussaïd et al. 2009.
    pub breadth_left: f64,
    /// Number of directions to each side, 15 degrees apart, that people who are slowed down look at, and of which they take the
    /// one in which they come closest to where they want to go. Up to 6. \[D\] 0; the rule is that of Moussaïd, Helbing, Theraulaz
    /// 2011, "How simple rules determine pedestrian behavior", with the gap as the free distance. \[I\]
    pub turns: usize,
    /// Radius of bodies, m. \[D\] 0.15 (l = 0.3 m), here calibrated.
    pub radius_m: f64,
}

/// Ranges of repulsion after which it is left out: a exp(-8) is 0.002. \[I\]
const RANGES: f64 = 8.0;

/// Cosine and sine of 15, 30, …, 90 degrees.
const TURNS: [(f64, f64); 6] = [
    (0.965_925_826_289_068_3, 0.258_819_045_102_520_76),
    (0.866_025_403_784_438_6, 0.5),
    (
        std::f64::consts::FRAC_1_SQRT_2,
        std::f64::consts::FRAC_1_SQRT_2,
    ),
    (0.5, 0.866_025_403_784_438_6),
    (0.258_819_045_102_520_76, 0.965_925_826_289_068_3),
    (0.0, 1.0),
];

/// Cosine of the widest angle to the first direction at which a person may be in front in one of the turned ones, and a bit less, by the
/// number of turns: 30, 45, …, 120 degrees.
const CONES: [f64; 7] = [0.86, 0.70, 0.49, 0.25, -0.01, -0.26, -0.51];

/// Most people who are looked at.
const AHEAD_MAX: usize = 256;

/// People whose places matter for the speed.
struct Ahead<'a> {
    others: &'a [Neighbor],
    indices: [u16; AHEAD_MAX],
    count: usize,
}

impl<'a> Ahead<'a> {
    fn of(others: &'a [Neighbor]) -> Self {
        Self {
            others: &others[..others.len().min(AHEAD_MAX)],
            indices: [0; AHEAD_MAX],
            count: 0,
        }
    }

    fn iter(&self) -> impl Iterator<Item = &Neighbor> {
        let indices = self.indices[..self.count].iter();
        indices.map(|index| &self.others[usize::from(*index)])
    }
}

impl CollisionFree {
    /// The parameters of the source. \[D\]
    #[must_use]
    pub const fn published() -> Self {
        Self {
            time_gap_s: 1.0,
            anticipation_s: 0.0,
            repulsion: 5.0,
            range_m: 0.1,
            wall_repulsion: 5.0,
            wall_range_m: 0.02,
            breadth: 1.0,
            breadth_left: 1.0,
            turns: 0,
            radius_m: 0.15,
        }
    }

    fn direction(&self, seen: &Surroundings<'_>) -> Vector {
        let mut sum = seen.toward;
        for other in seen.others {
            let contact_m = seen.person.radius_m + other.radius_m;
            let ranges = (other.distance_m - contact_m) / self.range_m;
            if ranges < RANGES {
                let strength = self.repulsion * libm::exp(-ranges);
                sum += other.offset * (-strength / other.distance_m);
            }
        }
        for wall in seen.walls {
            sum += self.away_from_wall(seen.person.radius_m, wall);
        }
        sum.unit()
    }

    fn away_from_wall(&self, radius_m: f64, wall: &NearWall) -> Vector {
        let ranges = (wall.distance_m - radius_m) / self.wall_range_m;
        if ranges < RANGES && wall.distance_m > 0.0 {
            let strength = self.wall_repulsion * libm::exp(-ranges);
            wall.offset * (-strength / wall.distance_m)
        } else {
            Vector::ZERO
        }
    }

    /// The way to the closest wall in a direction, m; infinite if there is none.
    fn wall_gap_m(&self, seen: &Surroundings<'_>, direction: Vector) -> f64 {
        let mut gap_m = f64::INFINITY;
        for wall in seen.walls {
            let approach_m = direction.dot(wall.offset);
            if approach_m > 0.0 {
                let free_m = (wall.distance_m - seen.person.radius_m).max(0.0);
                gap_m = gap_m.min(free_m * wall.distance_m / approach_m);
            }
        }
        gap_m
    }

    /// Those who may be in front in one of the directions that are looked at, around a direction.
    fn ahead<'a>(&self, seen: &Surroundings<'a>, direction: Vector) -> Ahead<'a> {
        let mut ahead = Ahead::of(seen.others);
        // Who is in front at more than twice this distance is at most 30 degrees beside the way.
        let breadth = self.breadth.max(self.breadth_left);
        let cosine = CONES[self.turns.min(TURNS.len())];
        let slowing_m = seen.desired_mps * self.time_gap_s;
        for (index, other) in ahead.others.iter().enumerate() {
            let contact_m = seen.person.radius_m + other.radius_m;
            let is_near = other.distance_m <= 2.0 * breadth * contact_m;
            let is_ahead = direction.dot(other.offset) >= cosine * other.distance_m;
            let slows = other.distance_m - contact_m < slowing_m;
            // Written in any case: whether it counts is no branch that a processor could guess.
            ahead.indices[ahead.count] = index as u16;
            ahead.count += usize::from(slows & (is_near | is_ahead));
        }
        ahead
    }

    /// How fast a person may walk in a direction, m/s: at the desired speed if no one is in front.
    fn speed_mps(&self, seen: &Surroundings<'_>, ahead: &Ahead<'_>, direction: Vector) -> f64 {
        let mut speed_mps = seen.desired_mps;
        for other in ahead.iter() {
            let contact_m = seen.person.radius_m + other.radius_m;
            let aside_m = direction.cross(other.offset);
            let breadth = if aside_m > 0.0 {
                self.breadth_left
            } else {
                self.breadth
            };
            if direction.dot(other.offset) > 0.0 && aside_m.abs() <= breadth * contact_m {
                let gap_m = other.distance_m - contact_m;
                let away_mps = direction.dot(other.velocity);
                speed_mps = speed_mps.min(self.following_mps(gap_m, away_mps, seen.step_s));
            }
        }
        speed_mps.max(0.0)
    }

    /// How fast a person is followed at a gap, while the one in front walks away at a speed, m/s. No step is longer than the gap.
    fn following_mps(&self, gap_m: f64, away_mps: f64, step_s: f64) -> f64 {
        let steady_mps = gap_m / self.time_gap_s;
        if away_mps <= steady_mps {
            return steady_mps;
        }
        let anticipated_m = gap_m + self.anticipation_s * away_mps;
        (anticipated_m / (self.time_gap_s + self.anticipation_s)).min(gap_m / step_s)
    }
}

impl Default for CollisionFree {
    fn default() -> Self {
        Self {
            time_gap_s: 1.4,
            anticipation_s: 0.25,
            repulsion: 1.2,
            range_m: 0.1,
            wall_repulsion: 1.6,
            wall_range_m: 0.1,
            breadth: 0.77,
            breadth_left: 0.66,
            turns: 2,
            radius_m: 0.17,
        }
    }
}

impl WalkingModel for CollisionFree {
    fn reach_m(&self) -> f64 {
        // Who walks at 1.5 m/s sees what slows them down; beyond it only faster people would begin to slow down earlier.
        let braking_m = 2.0 * self.radius_m + 1.5 * self.time_gap_s;
        let repelled_m = 2.0 * self.radius_m + RANGES * self.range_m;
        braking_m.max(repelled_m)
    }

    fn longest_step_s(&self) -> f64 {
        0.05
    }

    fn body_radius_m(&self) -> f64 {
        self.radius_m
    }

    fn velocity(&self, seen: &Surroundings<'_>) -> Vector {
        if seen.desired_mps <= 0.0 {
            return Vector::ZERO;
        }
        let direction = self.direction(seen);
        let ahead = self.ahead(seen, direction);
        let speed_mps = self.speed_mps(seen, &ahead, direction);
        let mut best = direction * speed_mps;
        if speed_mps >= seen.desired_mps {
            return best;
        }

        let mut best_mps = best.dot(seen.toward);
        for (cosine, sine) in TURNS.iter().take(self.turns) {
            for sine in [*sine, -sine] {
                let turned = Vector::new(
                    direction.x * cosine - direction.y * sine,
                    direction.x * sine + direction.y * cosine,
                );
                let toward = turned.dot(seen.toward);
                if toward * seen.desired_mps <= best_mps {
                    continue;
                }
                let free_mps = self.wall_gap_m(seen, turned) / self.time_gap_s;
                let speed_mps = self.speed_mps(seen, &ahead, turned).min(free_mps);
                if speed_mps * toward > best_mps {
                    best = turned * speed_mps;
                    best_mps = speed_mps * toward;
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pedestrian::Pedestrian;

    fn velocity(model: &CollisionFree, others: &[Neighbor]) -> Vector {
        let person = Pedestrian::at(Vector::ZERO);
        model.velocity(&Surroundings {
            person: &person,
            toward: Vector::new(1.0, 0.0),
            desired_mps: 1.34,
            others,
            walls: &[],
            step_s: 0.05,
        })
    }

    fn at(x: f64, y: f64) -> Neighbor {
        let offset = Vector::new(x, y);
        Neighbor {
            offset,
            distance_m: offset.length(),
            radius_m: 0.18,
            velocity: Vector::ZERO,
        }
    }

    #[test]
    fn the_speed_is_the_gap_over_the_time_gap() {
        let model = CollisionFree::published();
        // Beyond the ranges of repulsion the direction is the desired one.
        let alone = velocity(&model, &[]);
        assert_eq!(alone, Vector::new(1.34, 0.0));
        let behind = velocity(&model, &[at(1.36, 0.0)]);
        assert!((behind.x - 1.0).abs() < 1e-12 && behind.y == 0.0);
        let far = velocity(&model, &[at(1.9, 0.0)]);
        assert_eq!(far, alone, "a gap of more than v0 T");
    }

    #[test]
    fn who_is_behind_or_beside_slows_nobody_down() {
        let model = CollisionFree::published();
        for other in [at(-1.3, 0.0), at(0.9, 0.97)] {
            assert!((velocity(&model, &[other]).length() - 1.34).abs() < 1e-12);
        }
        assert!(
            velocity(&model, &[at(1.3, 0.35)]).length() < 1.3,
            "in front"
        );
    }

    #[test]
    fn who_walks_away_is_followed_sooner_and_at_the_same_speed_as_before() {
        let model = CollisionFree {
            anticipation_s: 0.5,
            ..CollisionFree::published()
        };
        let following_mps = |gap_m, away_mps| model.following_mps(gap_m, away_mps, 0.05);
        // All walk at the same speed: what the source has.
        assert!((following_mps(0.8, 0.8) - 0.8).abs() < 1e-12);
        // (s - l + τ u)/(T + τ) for those who walk away, and (s - l)/T for those who stand or come closer.
        assert!((following_mps(0.4, 1.0) - 0.6).abs() < 1e-12);
        assert!((following_mps(0.4, 0.0) - 0.4).abs() < 1e-12);
        assert!((following_mps(0.4, -1.0) - 0.4).abs() < 1e-12);
        // No step is longer than the gap.
        assert!(following_mps(0.001, 1.3) <= 0.001 / 0.05);
        assert!(following_mps(0.0, 1.3) <= 0.0);
    }

    #[test]
    fn of_two_who_meet_the_one_from_the_right_goes_first() {
        let model = CollisionFree {
            repulsion: 0.0,
            turns: 0,
            ..CollisionFree::default()
        };
        // Beside the way by 0.7 l: within the breadth to the right, and not within that to the left.
        let beside_m = 0.7 * 0.36;
        let right = velocity(&model, &[at(0.3, -beside_m)]);
        let left = velocity(&model, &[at(0.3, beside_m)]);
        assert!(right.x < 0.1, "{right:?}");
        assert_eq!(left, Vector::new(1.34, 0.0));
    }

    #[test]
    fn who_touches_somebody_in_front_stands() {
        let model = CollisionFree::default();
        // The repulsion turns them around, and then nobody is in front.
        let push = CollisionFree {
            repulsion: 0.0,
            ..model
        };
        assert_eq!(velocity(&push, &[at(0.36, 0.0)]), Vector::ZERO);
        assert!(velocity(&model, &[at(0.36, 0.0)]).x < 0.0);
    }
}
