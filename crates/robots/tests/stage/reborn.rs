//! Robots that are replaced in mid-run by new ones: made from all that the old ones saved, through text, or only told what
//! the old ones had published last, as after the loss of a process.

use robot::{BadParameters, Cars, Panel, Point, Robot, RobotName, StateVariables};

macro_rules! reborn {
    ($name:ident, $saved:ty) => {
        pub(crate) struct $name {
            inner: robots::$name,
            at_tick: u64,
            is_lost: bool,
        }

        impl $name {
            /// Saved and restored at this tick.
            pub(crate) fn saved(at_tick: u64) -> Self {
                Self {
                    inner: robots::$name::default(),
                    at_tick,
                    is_lost: false,
                }
            }

            /// Lost and resumed at this tick.
            pub(crate) fn lost(at_tick: u64) -> Self {
                Self {
                    is_lost: true,
                    ..Self::saved(at_tick)
                }
            }

            fn maybe_reborn(&mut self, cars: &mut Cars<'_>) {
                if cars.tick() != self.at_tick {
                    return;
                }
                if self.is_lost {
                    let last = self.inner.state_variables();
                    self.inner = robots::$name::default();
                    self.inner.init_robot(cars).unwrap();
                    self.inner.resume(cars, &last);
                } else {
                    let text = serde_json::to_string(&self.inner.save()).unwrap();
                    let saved: $saved = serde_json::from_str(&text).unwrap();
                    self.inner = robots::$name::new(cars.parameters().unwrap()).unwrap();
                    self.inner.restore(saved).unwrap();
                }
            }
        }

        impl Robot for $name {
            fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
                self.inner.init_robot(cars)
            }
            fn speed(&self) -> f64 {
                self.inner.speed()
            }
            fn direction(&self) -> f64 {
                self.inner.direction()
            }
            fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
                self.inner.update_state_variables(cars);
            }
            fn state_variables(&self) -> StateVariables {
                self.inner.state_variables()
            }
            fn current_location(&self) -> Point {
                self.inner.current_location()
            }
            fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
                self.inner.project_location(cars)
            }
            fn set_current_location(&mut self, cars: &mut Cars<'_>, location: Point) {
                self.maybe_reborn(cars);
                self.inner.set_current_location(cars, location);
            }
            fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
                self.inner.set_command(cars, from, command);
            }
            fn update_emotion_state(&mut self, cars: &mut Cars<'_>) {
                self.inner.update_emotion_state(cars);
            }
            fn emotion_state(&self) -> &str {
                self.inner.emotion_state()
            }
            fn update_behavior_state(&mut self, cars: &mut Cars<'_>) {
                self.inner.update_behavior_state(cars);
            }
            fn behavior_state(&self) -> &str {
                self.inner.behavior_state()
            }
            fn panel(&self) -> Panel {
                self.inner.panel()
            }
        }
    };
}

reborn!(Butler, robots::butler::Saved);
reborn!(Leguin, robots::leguin::Saved);
