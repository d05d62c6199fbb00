//! A waiter that calls for a refiller, reduced to the inputs of the emotion: stock, distance, and two commands.
//!
//! In each tick the refiller moves, a treat may be taken, the state variables are updated, and the ESG and the BSG
//! run. A command takes effect in the next tick.

use affect::StandardEmotion::{self, Concerned, Confident};
use affect::behavior::{BehaviorGenerator, Row, Then::Stay};
use affect::progress::{
    ApproachEstimator, ApproachParameters, RateEstimator, RateParameters, need_ratio,
    time_to_empty_s,
};
use affect::{
    Caution, DynamicGenerator, Dynamics, DynamicsParameters, EmotionGenerator, EmotionState,
    Feeling, Stimulus,
};
use serde::{Deserialize, Serialize};

pub(crate) const DT_S: f64 = 0.5;
pub(crate) const FT_M: f64 = 0.3048;
const REACH_M: f64 = 4.0 * FT_M;

/// A change of emotion: time in seconds, new emotion, treats left.
pub(crate) type Change = (f64, StandardEmotion, u32);

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum Behavior {
    Serve,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Act {
    Refill,
    Hurry,
}

pub(crate) struct Context {
    feeling: Feeling<StandardEmotion>,
    is_called: bool,
    is_hurried: bool,
}

const TABLE: &[Row<Behavior, Context, Act>] = &[
    Row {
        from: &[Behavior::Serve],
        when: |c| c.feeling.emotion == Confident && !c.is_called,
        act: &[Act::Refill],
        then: Stay,
    },
    Row {
        from: &[Behavior::Serve],
        when: |c| c.feeling.emotion.reaches(Concerned) && !c.is_hurried,
        act: &[Act::Hurry],
        then: Stay,
    },
];

/// The progress measures.
#[derive(Clone)]
pub(crate) struct Measures {
    pub(crate) need_ratio: f64,
}

#[derive(Clone)]
pub(crate) struct Waiter {
    tick: u32,
    treats: u32,
    rate: RateEstimator,
    approach: ApproachEstimator,
    distance_m: f64,
    is_called: bool,
    is_hurried: bool,
    pub(crate) esg: DynamicGenerator<Measures, Behavior, StandardEmotion>,
    bsg: BehaviorGenerator<Behavior, Context, Act>,
    pub(crate) acts: Vec<Act>,
    pub(crate) changes: Vec<Change>,
}

impl Waiter {
    pub(crate) fn new(parameters: &DynamicsParameters, caution: f64) -> Self {
        let dynamics = Dynamics::standard(parameters, Caution::new(caution).unwrap()).unwrap();

        Self {
            tick: 0,
            treats: 30,
            rate: RateEstimator::new(RateParameters::default()).unwrap(),
            approach: ApproachEstimator::new(ApproachParameters::default()).unwrap(),
            distance_m: 30.0 * FT_M,
            is_called: false,
            is_hurried: false,
            esg: DynamicGenerator::new(dynamics, |measures: &Measures, Behavior::Serve| {
                Stimulus::need(measures.need_ratio).with_blame(true)
            }),
            bsg: BehaviorGenerator::new(TABLE, Behavior::Serve),
            acts: Vec::new(),
            changes: Vec::new(),
        }
    }

    pub(crate) fn time_s(&self) -> f64 {
        f64::from(self.tick) * DT_S
    }

    pub(crate) fn treats(&self) -> u32 {
        self.treats
    }

    pub(crate) fn has_met(&self) -> bool {
        self.distance_m <= REACH_M + 1e-9
    }

    /// Runs one tick. The refiller, once called, approaches at `closing_mps`.
    pub(crate) fn tick(&mut self, closing_mps: f64) {
        self.tick += 1;
        self.update_state_variables(closing_mps);

        let measures = Measures {
            need_ratio: self.need_ratio(),
        };
        let before = self.esg.feeling().emotion;
        let feeling = self.esg.update(&measures, self.bsg.current(), DT_S);
        if feeling.emotion != before {
            self.changes
                .push((self.time_s(), feeling.emotion, self.treats));
        }

        self.update_behavior(feeling);
    }

    fn update_state_variables(&mut self, closing_mps: f64) {
        if self.is_called {
            self.distance_m -= closing_mps * DT_S;
        }

        let taken = u32::from(self.tick.is_multiple_of(2) && self.treats > 0);
        self.treats -= taken;

        self.rate.advance(DT_S, taken);
        self.approach.observe(self.distance_m, self.is_called, DT_S);
        self.bsg.advance(DT_S);
    }

    fn need_ratio(&self) -> f64 {
        let per_second = self.rate.per_second();
        let empty_s = time_to_empty_s(f64::from(self.treats), per_second);
        let arrival_s = self.approach.arrival_s(REACH_M).unwrap();

        need_ratio(arrival_s, empty_s, per_second)
    }

    fn update_behavior(&mut self, feeling: Feeling<StandardEmotion>) {
        let context = Context {
            feeling,
            is_called: self.is_called,
            is_hurried: self.is_hurried,
        };

        for act in self.bsg.update(&context).actions {
            self.is_called = true;
            self.is_hurried |= act == Act::Hurry;
            self.acts.push(act);
        }
    }

    /// Saves the waiter as text and restores it.
    pub(crate) fn through_text(&mut self) {
        let text = serde_json::to_string(self.esg.state()).unwrap();
        let state: EmotionState<StandardEmotion> = serde_json::from_str(&text).unwrap();
        assert!(self.esg.dynamics().accepts(&state));
        self.esg.restore(state);

        let text = serde_json::to_string(&(&self.rate, &self.approach, self.bsg.state())).unwrap();
        let (rate, approach, behavior) = serde_json::from_str(&text).unwrap();
        self.rate = rate;
        self.approach = approach;
        self.bsg.restore(behavior);
    }
}
