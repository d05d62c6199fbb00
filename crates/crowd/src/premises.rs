//! What does not give way: walls, and discs such as columns and robots.

use crate::vector::Vector;

/// Corrections of a proposed place, after which a person stays where they are: in a corner each wall corrects the other's.
const CORRECTIONS: usize = 6;
/// Distances that differ by less are equal, m.
const ROUNDING_M: f64 = 1e-9;

/// A straight line of no breadth: a wall, or a door to walk through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallLine {
    /// One end, m.
    pub from: Vector,
    /// The other end, m.
    pub to: Vector,
}

impl WallLine {
    /// The line between two places.
    #[must_use]
    pub const fn new(from: Vector, to: Vector) -> Self {
        Self { from, to }
    }

    /// The place of the line that is closest to another place, m.
    #[must_use]
    pub fn closest_to(&self, place: Vector) -> Vector {
        let along = self.to - self.from;
        let length_squared = along.length_squared();
        if length_squared == 0.0 {
            return self.from;
        }
        let part = (place - self.from).dot(along) / length_squared;
        self.from + along * part.clamp(0.0, 1.0)
    }

    /// Whether a straight path touches the line.
    #[must_use]
    pub fn is_met(&self, from: Vector, to: Vector) -> bool {
        let along = self.to - self.from;
        let path = to - from;
        let begin = along.cross(from - self.from);
        let end = along.cross(to - self.from);
        let first = path.cross(self.from - from);
        let second = path.cross(self.to - from);
        if begin == 0.0 && end == 0.0 {
            return self.is_between(from, path);
        }
        begin * end <= 0.0 && first * second <= 0.0
    }

    /// Whether a path along the line's own direction has a part of it.
    fn is_between(&self, from: Vector, path: Vector) -> bool {
        let along = self.to - self.from;
        let length_squared = along.length_squared();
        let begin = (from - self.from).dot(along);
        let end = begin + path.dot(along);
        begin.min(end) <= length_squared && begin.max(end) >= 0.0
    }
}

/// A round body that does not give way: a column, or a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Its middle, m.
    pub center: Vector,
    /// Its radius, m.
    pub radius_m: f64,
    /// How it moves, m/s.
    pub velocity: Vector,
}

/// What stands still, and whether the world repeats itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Premises {
    /// Walls. In a world that repeats itself they have to reach beyond both its ends.
    pub walls: Vec<WallLine>,
    /// Columns and the like.
    pub columns: Vec<Disc>,
    /// Length after which the world repeats itself to the right, m, from x = 0 on.
    pub period_m: Option<f64>,
}

/// The place that a person comes to who would like to go from one place to another, and whether a wall was on the way.
///
/// The rule, for every model: no person's middle crosses a wall, and no person comes closer to a wall or a disc than their own radius,
/// or than they are already. The proposed place is moved away from what it is too close to; where that leads nowhere, the person
/// stays. \[I\]
pub(crate) fn permitted<'a>(
    from: Vector,
    to: Vector,
    radius_m: f64,
    mut walls: impl Iterator<Item = &'a WallLine> + Clone,
    mut discs: impl Iterator<Item = &'a Disc> + Clone,
) -> (Vector, bool) {
    let is_through_wall = walls.clone().any(|wall| wall.is_met(from, to));
    let mut place = to;
    for _ in 0..CORRECTIONS {
        let before = place;
        for wall in walls.clone() {
            place = beside_wall(from, place, radius_m, wall);
        }
        for disc in discs.clone() {
            place = beside_disc(from, place, radius_m, disc);
        }
        if place == before {
            return (place, is_through_wall);
        }
    }

    let is_free = walls.all(|wall| beside_wall(from, place, radius_m, wall) == place)
        && discs.all(|disc| beside_disc(from, place, radius_m, disc) == place);
    (if is_free { place } else { from }, is_through_wall)
}

/// A proposed place, moved to the near side of a wall.
fn beside_wall(from: Vector, to: Vector, radius_m: f64, wall: &WallLine) -> Vector {
    let was = (from - wall.closest_to(from)).length();
    let required_m = radius_m.min(was);
    if wall.is_met(from, to) {
        let normal = near_side(from, wall);
        let depth_m = (to - wall.from).dot(normal);
        return to + normal * (required_m - depth_m);
    }

    let away = to - wall.closest_to(to);
    let distance_m = away.length();
    if distance_m >= required_m - ROUNDING_M {
        return to;
    }
    to + away.unit() * (required_m - distance_m)
}

/// The direction from a wall to the side where a place is.
fn near_side(place: Vector, wall: &WallLine) -> Vector {
    let along = (wall.to - wall.from).unit();
    let normal = Vector::new(-along.y, along.x);
    let side = (place - wall.from).dot(normal);
    if side > 0.0 {
        normal
    } else if side < 0.0 {
        -normal
    } else {
        (place - wall.closest_to(place)).unit()
    }
}

/// A proposed place, moved out of a disc.
fn beside_disc(from: Vector, to: Vector, radius_m: f64, disc: &Disc) -> Vector {
    let was = (from - disc.center).length();
    let required_m = (radius_m + disc.radius_m).min(was);
    let away = to - disc.center;
    let distance_m = away.length();
    if distance_m >= required_m - ROUNDING_M {
        return to;
    }
    if distance_m == 0.0 {
        return from;
    }
    to + away * ((required_m - distance_m) / distance_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn place() -> impl Strategy<Value = Vector> {
        (-3.0..3.0, -3.0..3.0).prop_map(|(x, y)| Vector::new(x, y))
    }

    fn line() -> impl Strategy<Value = WallLine> {
        (place(), place()).prop_map(|(from, to)| WallLine::new(from, to))
    }

    #[test]
    fn a_path_meets_what_it_touches() {
        let wall = WallLine::new(Vector::new(0.0, 0.0), Vector::new(2.0, 0.0));
        let is_met = |a: (f64, f64), b: (f64, f64)| {
            wall.is_met(Vector::new(a.0, a.1), Vector::new(b.0, b.1))
        };
        assert!(is_met((1.0, 1.0), (1.0, -1.0)));
        assert!(is_met((1.0, 1.0), (1.0, 0.0)), "it ends there");
        assert!(is_met((2.0, 1.0), (2.0, -1.0)), "at its end");
        assert!(!is_met((2.1, 1.0), (2.1, -1.0)), "beside it");
        assert!(!is_met((1.0, 1.0), (1.0, 0.1)), "before it");
        assert!(is_met((-1.0, 0.0), (1.0, 0.0)), "along it");
        assert!(!is_met((3.0, 0.0), (4.0, 0.0)), "in its direction");
    }

    proptest! {
        #[test]
        fn nobody_crosses_a_wall_wherever_they_want_to(
            walls in prop::collection::vec(line(), 1..6),
            discs in prop::collection::vec((place(), 0.05..0.5), 0..3),
            from in place(),
            to in place(),
            radius_m in 0.05..0.5,
        ) {
            let discs: Vec<Disc> = discs
                .into_iter()
                .map(|(center, radius_m)| Disc { center, radius_m, velocity: Vector::ZERO })
                .collect();
            let (place, _) = permitted(from, to, radius_m, walls.iter(), discs.iter());
            for wall in &walls {
                prop_assert!(place == from || !wall.is_met(from, place), "{place:?}");
                let was = (from - wall.closest_to(from)).length();
                let is = (place - wall.closest_to(place)).length();
                prop_assert!(is >= was.min(radius_m) - 1e-8, "{was} {is}");
            }
            for disc in &discs {
                let was = (from - disc.center).length();
                let is = (place - disc.center).length();
                prop_assert!(is >= was.min(radius_m + disc.radius_m) - 1e-8, "{was} {is}");
            }
        }

        #[test]
        fn a_free_way_is_walked_as_proposed(from in place(), step in (-0.1..0.1, -0.1..0.1)) {
            let far = [WallLine::new(Vector::new(9.0, -9.0), Vector::new(9.0, 9.0))];
            let to = from + Vector::new(step.0, step.1);
            let (place, is_through_wall) = permitted(from, to, 0.2, far.iter(), [].iter());
            prop_assert_eq!(place, to);
            prop_assert!(!is_through_wall);
        }
    }
}
