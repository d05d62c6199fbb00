//! Robots that are replaced in mid-run by new ones: restored from what the old ones saved, through text, or resumed from
//! what the old ones published last, as after the loss of a process.

use robot::{Action, BadParameters, Cars, Panel, Robot, StateVariables};

macro_rules! reborn {
    ($name:ident, $saved:ty) => {
        pub(crate) struct $name {
            inner: robots::$name,
            at_tick: u64,
            is_lost: bool,
            /// What it published last.
            last: StateVariables,
        }

        impl $name {
            /// Saved and restored at this tick.
            pub(crate) fn saved(at_tick: u64) -> Self {
                Self {
                    inner: robots::$name::default(),
                    at_tick,
                    is_lost: false,
                    last: StateVariables::new(),
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
                    self.inner = robots::$name::default();
                    self.inner.init(cars).unwrap();
                    self.inner.resume(cars, &self.last);
                } else {
                    let text = serde_json::to_string(&self.inner.save()).unwrap();
                    let saved: $saved = serde_json::from_str(&text).unwrap();
                    self.inner = robots::$name::new(cars.parameters().unwrap()).unwrap();
                    self.inner.restore(saved).unwrap();
                }
            }
        }

        impl Robot for $name {
            fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
                self.inner.init(cars)
            }

            fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
                self.maybe_reborn(cars);
                let action = self.inner.tick(cars);
                self.last = action.state_variables.clone();
                action
            }

            fn senses_bodies(&self) -> bool {
                self.inner.senses_bodies()
            }

            fn panel(&self) -> Panel {
                self.inner.panel()
            }
        }
    };
}

reborn!(Butler, robots::butler::ButlerState);
reborn!(Leguin, robots::leguin::LeguinState);
