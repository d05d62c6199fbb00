//! Vera likes parties and is shy: if too many bodies are around her, she returns to her start until she is calm.

use affect::akr::{Agency, Appraisal};
use affect::{AffectFrame, Circumstances, Episode, Schemata, Urgency};
use robot::{Action, BadParameters, Cars, Panel, Point, Robot, Widget};
use robots::drive::{Drive, StraightDrive};

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    bearable: f64,  // bodies around her that are too many
    speed_mps: f64, // m/s
    party_m: Point, // where the party is, m
}

const CALM: &str = "CALM";
const SHY: &str = "SHY";

/// The emotion state generator. Progress is one number: bodies around her, as a share of those that are too many.
fn feel(emotion: &'static str, crowding: f64) -> &'static str {
    match emotion {
        CALM if crowding >= 1.0 => SHY,
        SHY if crowding < 0.25 => CALM,
        _ => emotion,
    }
}

#[derive(Default)]
pub(crate) struct Vera {
    parameters: Parameters,
    schemata: Schemata,
    drive: Drive,
    near: f64, // bodies around her
    emotion: &'static str,
    episode: Episode, // of her emotion
}

impl Robot for Vera {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let schemata = Schemata::from_toml(include_str!("vera.toml"));
        *self = Self {
            parameters: cars.parameters()?,
            schemata: schemata.map_err(|error| cars.bad_parameters(error))?,
            emotion: CALM,
            ..Self::default()
        };
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.near = cars.bodies().len() as f64;
        let crowding = self.near / self.parameters.bearable;
        self.emotion = feel(self.emotion, crowding);
        self.episode.update(self.emotion, cars.tick_s(), |_| {
            let near = self.near.to_string();
            let words = Circumstances::default().with_amount(&near);
            let crowd = Agency::Other("the crowd".into());
            self.schemata
                .cause(self.emotion, crowd, "the party", &words)
        });

        // The behavior state generator.
        let (behavior, goal) = match self.emotion {
            SHY => ("HIDE", cars.welcome().location),
            _ => ("MINGLE", self.parameters.party_m),
        };
        let course = StraightDrive::to(goal, self.parameters.speed_mps);
        let action = self.drive.follow(cars, course);
        robots::frame::publish(self.frame(), action).behavior(behavior)
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn panel(&self) -> Panel {
        let widgets = vec![Widget::Text {
            label: "why".into(),
            text: self.episode.cause().spoken().into(),
        }];
        Panel { widgets }
    }
}

impl Vera {
    /// What she feels, and how she judges it: she can always leave, and sees all of it.
    fn frame(&self) -> Option<AffectFrame<'_>> {
        let crowding = self.near / self.parameters.bearable;
        let appraisal = Appraisal::new(1.0 - 2.0 * crowding, 1.0, 1.0);
        let urgency = Urgency::saturating(crowding);
        let frame = self.schemata.frame(self.emotion, urgency, appraisal)?;
        Some(frame.during(&self.episode))
    }
}

fn main() -> std::process::ExitCode {
    robot::main("Vera", |_| Box::new(Vera::default()))
}
