//! Vera likes parties and is shy: where too many stand around her she goes back to where she came from, until she is calm.

use affect::behavior::{BehaviorGenerator, Row, Then::Go};
use affect::{
    Circumstances, EmotionGenerator, EmotionLabel, EmotionRow, Intensity, RuleGenerator, Schemata,
};
use robot::{BadParameters, Cars, Panel, Point, Robot, RobotName, StateVariables, Widget};
use robots::drive::{Course, Legs};

#[derive(Clone, Copy, Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    bearable: f64,  // bodies around her that are too many
    speed_mps: f64, // m/s
    party_m: Point, // where the party is, m
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[rustfmt::skip]
enum Emotion { Calm, Shy }
use Emotion::{Calm, Shy};
#[rustfmt::skip]
impl EmotionLabel for Emotion {
    fn name(self) -> &'static str { if self == Shy { "SHY" } else { "CALM" } }
    fn valence(self) -> affect::akr::Valence {
        if self == Shy { affect::akr::Valence::Negative } else { affect::akr::Valence::Positive }
    }
}

const MINGLE: &str = "MINGLE";
const HIDE: &str = "HIDE";

/// Emotion state generator, over her one measure of progress: bodies around her, as a share of those that are too many.
const FEEL: &[EmotionRow<f64, &str, Emotion>] = &[
    EmotionRow {
        during: &[MINGLE],
        when: |crowding| *crowding >= 1.0,
        feel: Shy,
    },
    EmotionRow {
        during: &[HIDE],
        when: |crowding| *crowding < 0.25,
        feel: Calm,
    },
];

/// Behavior state generator: from this behavior, when this is felt, go over to that one.
const BEHAVE: &[Row<&str, Emotion, ()>] = &[
    Row {
        from: &[MINGLE],
        when: |felt| *felt == Shy,
        act: &[],
        then: Go(HIDE),
    },
    Row {
        from: &[HIDE],
        when: |felt| *felt == Calm,
        act: &[],
        then: Go(MINGLE),
    },
];

pub(crate) struct Vera {
    parameters: Parameters,
    schemata: Schemata,
    esg: RuleGenerator<f64, &'static str, Emotion>,
    bsg: BehaviorGenerator<&'static str, Emotion, ()>,
    legs: Legs,
    at: Point,
    near: f64,
}

impl Default for Vera {
    fn default() -> Self {
        let esg = RuleGenerator::new(
            FEEL,
            |crowding, _| Intensity::saturating(crowding / 2.0),
            Calm,
        );
        let (parameters, schemata, legs, at, near) = Default::default();
        Self {
            parameters,
            schemata,
            esg,
            bsg: BehaviorGenerator::new(BEHAVE, MINGLE),
            legs,
            at,
            near,
        }
    }
}

#[rustfmt::skip]
impl Robot for Vera {
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let bad = |reason| BadParameters { robot: cars.name().clone(), reason };
        let schemata = Schemata::from_toml(include_str!("vera.toml")).map_err(|error| bad(error.to_string()))?;
        *self = Self { parameters: cars.parameters()?, schemata, ..Self::default() };
        Ok(())
    }
    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) { self.at = location; }
    fn set_command(&mut self, _: &mut Cars<'_>, _: &RobotName, _: &str) {}
    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        self.near = cars.percept().unwrap_or_default().bodies.len() as f64;
    }
    fn update_emotion_state(&mut self, cars: &mut Cars<'_>) {
        self.esg.update(&(self.near / self.parameters.bearable), self.bsg.current(), cars.tick_s());
    }
    fn update_behavior_state(&mut self, _: &mut Cars<'_>) { self.bsg.update(&self.esg.feeling().emotion); }
    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
        let Parameters { speed_mps, party_m, .. } = self.parameters;
        let goal = if *self.bsg.current() == HIDE { cars.welcome().location } else { party_m };
        self.legs.drive(cars, self.at, Course { goal, stop_m: 0.0, speed_mps, look_s: 2.0 })
    }
    fn current_location(&self) -> Point { self.at }
    fn speed(&self) -> f64 { self.legs.speed_mps() }
    fn direction(&self) -> f64 { self.legs.direction_rad() }
    fn state_variables(&self) -> StateVariables { [("near".into(), self.near.into())].into() }
    fn emotion_state(&self) -> &str { self.esg.feeling().emotion.name() }
    fn behavior_state(&self) -> &str { self.bsg.current() }
    fn panel(&self) -> Panel {
        let near = self.near.to_string();
        let words = Circumstances { amount: Some(&near), ..Circumstances::default() };
        let why = self.schemata.get(self.emotion_state()).map(|schema| schema.account(&words).spoken());
        Panel { widgets: vec![Widget::Text { label: "why".into(), text: why.unwrap_or_default() }] }
    }
}

fn main() -> std::process::ExitCode {
    robot::main("Vera", |_| Box::new(Vera::default()))
}
