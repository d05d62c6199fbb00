//! Vera likes parties and is shy: if too many bodies are around her, she returns to her start until she is calm.

use affect::{Circumstances, Schemata};
use robot::{Action, BadParameters, Cars, Panel, Point, Robot, Widget};
use robots::drive::{Course, Drive};

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    bearable: f64,  // bodies around her that are too many
    speed_mps: f64, // m/s
    party_m: Point, // where the party is, m
}

const CALM: &str = "CALM";
const SHY: &str = "SHY";

const MINGLE: &str = "MINGLE";
const HIDE: &str = "HIDE";

/// The emotion state generator. Progress is one number: bodies around her, as a share of those that are too many.
fn feel(emotion: &'static str, behavior: &str, crowding: f64) -> &'static str {
    match behavior {
        MINGLE if crowding >= 1.0 => SHY,
        HIDE if crowding < 0.25 => CALM,
        _ => emotion,
    }
}

/// The behavior state generator.
fn behave(emotion: &str) -> &'static str {
    if emotion == SHY { HIDE } else { MINGLE }
}

#[derive(Default)]
pub(crate) struct Vera {
    parameters: Parameters,
    schemata: Schemata,
    drive: Drive,
    near: f64, // bodies around her
    emotion: &'static str,
    behavior: &'static str,
}

impl Robot for Vera {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let schemata = Schemata::from_toml(include_str!("vera.toml"));
        *self = Self {
            parameters: cars.parameters()?,
            schemata: schemata.map_err(|error| cars.bad_parameters(error))?,
            emotion: CALM,
            behavior: MINGLE,
            ..Self::default()
        };
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.near = cars.bodies().len() as f64;
        let crowding = self.near / self.parameters.bearable;
        self.emotion = feel(self.emotion, self.behavior, crowding);
        self.behavior = behave(self.emotion);

        let goal = if self.behavior == HIDE {
            cars.welcome().location
        } else {
            self.parameters.party_m
        };
        self.drive
            .follow(cars, Course::to(goal, self.parameters.speed_mps))
            .emotion(self.emotion)
            .behavior(self.behavior)
            .variable("near", self.near)
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn panel(&self) -> Panel {
        let near = self.near.to_string();
        let circumstances = Circumstances {
            amount: Some(&near),
            ..Circumstances::default()
        };
        let schema = self.schemata.get(self.emotion);
        let why = schema.map(|schema| schema.account(&circumstances).spoken());
        Panel {
            widgets: vec![Widget::Text {
                label: "why".into(),
                text: why.unwrap_or_default(),
            }],
        }
    }
}

fn main() -> std::process::ExitCode {
    robot::main("Vera", |_| Box::new(Vera::default()))
}
