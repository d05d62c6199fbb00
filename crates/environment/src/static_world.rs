//! What observers and recordings have of the world that does not change in an epoch.

use protocol::messages::{BodyShape, SensingLimits, StaticWorld};
use scenario::{Scenario, Sensing};
use world::{Shape, Wall};

/// Lengths that are shown are in steps of 0.1 mm, so that they are short in messages: those in feet have such a length.
const STEPS_PER_M: f64 = 10_000.0;

/// Walls, shapes of bodies, and where robots look.
#[must_use]
pub fn static_world(scenario: &Scenario) -> StaticWorld {
    let mut of_scenario = StaticWorld {
        walls: lines(&scenario.walls),
        sensing: sensing_limits(&scenario.sensing),
        guest_sample: guest_sample(scenario.guests.count),
        ..StaticWorld::default()
    };
    for obstacle in &scenario.obstacles {
        of_scenario.obstacle_shapes.push(obstacle.shape.map(shape));
    }
    if of_scenario.obstacle_shapes.iter().all(Option::is_none) {
        of_scenario.obstacle_shapes.clear();
    }
    for (name, robot) in &scenario.robots {
        if let Some(of_robot) = robot.shape {
            let of_robot = shape(of_robot);
            of_scenario.robot_shapes.insert(name.clone(), of_robot);
        }
    }
    of_scenario
}

/// Most guests of a frame, so that it fits into a message.
const MAX_FRAME_GUESTS: usize = 20_000;

/// Frames have every so manyth of so many guests; `None` if they have all.
pub(crate) fn guest_sample(guests: usize) -> Option<u32> {
    let step = guests.div_ceil(MAX_FRAME_GUESTS);
    u32::try_from(step).ok().filter(|step| *step > 1)
}

/// Walls of which one begins where the one before ends are one line.
fn lines(walls: &[Wall]) -> Vec<Vec<[f64; 2]>> {
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut end = None;
    for wall in walls {
        let to = [shown_m(wall.to.x), shown_m(wall.to.y)];
        match lines.last_mut() {
            Some(line) if end == Some(wall.from) => line.push(to),
            _ => lines.push(vec![[shown_m(wall.from.x), shown_m(wall.from.y)], to]),
        }
        end = Some(wall.to);
    }
    lines
}

fn sensing_limits(sensing: &Sensing) -> Option<SensingLimits> {
    let Sensing {
        range_m,
        field_of_view_rad,
        rays,
        ..
    } = *sensing;
    let is_limited = field_of_view_rad.is_some() || rays.is_some();
    is_limited.then_some(SensingLimits {
        range_m,
        field_of_view_rad,
        rays,
    })
}

fn shape(shape: Shape) -> BodyShape {
    match shape {
        Shape::Rectangle { width_m, height_m } => {
            BodyShape::Rectangle([shown_m(width_m), shown_m(height_m)])
        }
        Shape::Disc { radius_m } => BodyShape::Disc(shown_m(radius_m)),
    }
}

fn shown_m(length_m: f64) -> f64 {
    (length_m * STEPS_PER_M).round() / STEPS_PER_M
}

#[cfg(test)]
mod tests {
    use config::diagnostic::Source;
    use serde_json::json;

    use super::*;

    fn of(lines: &str) -> serde_json::Value {
        let text = format!("[field]\nsize = [\"10 m\", \"10 m\"]\n{lines}");
        let source = Source {
            name: "test".to_owned(),
            text,
        };
        let scenario = Scenario::parse_alone(&source).unwrap();
        serde_json::to_value(static_world(&scenario)).unwrap()
    }

    #[test]
    fn a_hall_of_squares_has_nothing() {
        let robot = "[[obstacle]]\nat = [\"1 m\", \"1 m\"]\n[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]";
        assert_eq!(of(robot), json!({}));
    }

    #[test]
    fn walls_that_meet_are_one_line_and_each_shape_is_with_its_body() {
        let hall = r#"
            [[wall]]
            points = [["0 m", "4 m"], ["5 ft", "4 m"], ["5 ft", "2 m"]]
            [[wall]]
            points = [["8 m", "0 m"], ["8 m", "6 m"]]
            [[obstacle]]
            at = ["1 m", "1 m"]
            [[obstacle]]
            at = ["6 m", "8 m"]
            radius = "0.9 m"
            [sensing]
            range = "3 m"
            rays = { count = 8, range = "4 m" }
            [[robot]]
            name = "A"
            at = ["5 m", "5 m"]
            size = ["2 m", "1 m"]
            [[robot]]
            name = "B"
            at = ["2 m", "7 m"]
        "#;
        let expected = json!({
            "walls": [[[0.0, 4.0], [1.524, 4.0], [1.524, 2.0]], [[8.0, 0.0], [8.0, 6.0]]],
            "obstacle_shapes": [null, { "disc": 0.9 }],
            "robot_shapes": { "A": { "rectangle": [2.0, 1.0] } },
            "sensing": { "range_m": 3.0, "rays": { "count": 8, "range_m": 4.0 } },
        });
        assert_eq!(of(hall), expected);
    }
}
