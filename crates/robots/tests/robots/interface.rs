//! The interface of the paper's Figure 7, as the shipped robots have it.

use super::stage::{Role, Stage, feet};
use robot::{Action, BadParameters, Cars, CarsRobotInterface, Robot};
use robots::{Butler, Leguin};

/// A robot whose methods are called one by one, in the order of the paper's Figure 5.
struct CalledOneByOne<R>(R);

impl<R: CarsRobotInterface + Send> Robot for CalledOneByOne<R> {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.0.init_robot(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let robot = &mut self.0;
        let location = cars.location();
        robot.set_current_location(cars, location);
        for command in cars.commands() {
            robot.set_command(cars, &command.from, &command.text);
        }

        if cars.tick() > 0 {
            robot.update_state_variables(cars);

            let behavior = robot.behavior_state().to_owned();
            robot.update_emotion_state(cars);
            assert_eq!(robot.behavior_state(), behavior, "emotion set a behavior");

            let emotion = robot.emotion_state().to_owned();
            robot.update_behavior_state(cars);
            assert_eq!(robot.emotion_state(), emotion, "behavior set an emotion");
        }

        assert_eq!(robot.name(), cars.name().as_str());
        assert_eq!(robot.current_location(), location);
        Action {
            proposal: robot.project_location(cars),
            speed_mps: robot.speed(),
            direction_rad: robot.direction(),
            emotion_state: robot.emotion_state().to_owned(),
            behavior_state: robot.behavior_state().to_owned(),
            state_variables: robot.state_variables(),
            ..Action::default()
        }
    }

    fn senses_bodies(&self) -> bool {
        true
    }
}

/// Alfred, a Butler, and Laila, a Leguin, who meet, wait and give up in the course of ten minutes.
fn alfred_and_laila(butler: Box<dyn Robot>, leguin: Box<dyn Robot>) -> Vec<String> {
    let cast = vec![
        Role::played_by(butler, "Alfred", feet(25.0, 25.0), "refiller = \"Laila\""),
        Role::played_by(leguin, "Laila", feet(4.0, 4.0), "waiter = \"Alfred\""),
    ];
    let mut stage = Stage::new(7, cast);
    stage.drops = Box::new(|sent| sent.tick % 3 == 0);
    stage.begin();

    let mut reports = Vec::new();
    stage.step_until(600.0, |stage| {
        for robot in ["Alfred", "Laila"] {
            reports.push(serde_json::to_string(stage.report(robot)).unwrap());
        }
        false
    });
    reports
}

#[test]
fn a_tick_is_the_control_cycle_and_neither_generator_sets_the_state_of_the_other() {
    let by_tick = alfred_and_laila(Box::new(Butler::default()), Box::new(Leguin::default()));
    let one_by_one = alfred_and_laila(
        Box::new(CalledOneByOne(Butler::default())),
        Box::new(CalledOneByOne(Leguin::default())),
    );

    assert!(by_tick == one_by_one, "they differ");
    for seen in [
        "\"EXCHANGE\"",
        "\"GO_BACK\"",
        "\"AWAIT_GO_HOME\"",
        "\"CONCERNED\"",
    ] {
        assert!(by_tick.iter().any(|report| report.contains(seen)), "{seen}");
    }
}

/// A Butler who was never told his name.
struct Nameless(Butler);

impl Robot for Nameless {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.0.tick(cars)
    }

    fn senses_bodies(&self) -> bool {
        true
    }
}

#[test]
#[should_panic(expected = "it calls itself")]
fn a_robot_that_goes_by_another_name_leaves_the_run() {
    let robot = Box::new(Nameless(Butler::default()));
    let role = Role::played_by(robot, "Alfred", feet(25.0, 25.0), "");
    Stage::new(7, vec![role]).begin();
}
