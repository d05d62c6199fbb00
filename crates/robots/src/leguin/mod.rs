//! Leguin, the refiller: waits at the table until she is called, brings treats, hurries when she is asked to, and goes home
//! when she is sent home or is frustrated.

mod appraisal;
mod checks;
mod helping;
mod parameters;
mod state;
mod tables;

use affect::behavior::{BehaviorGenerator, BehaviorState};
use affect::levels::{SensoryMotor, SensoryMotorParameters};
use affect::{AffectFrame, DynamicGenerator, Dynamics, EmotionState, Feeling, StandardEmotion};
use robot::{
    Action, BadParameters, Cars, CarsRobotInterface, Panel, ParametersCheck, Point, Robot,
    RobotName, StateVariables, Widget, control_cycle, read_parameters,
};
use serde::{Deserialize, Serialize};
use smol_str::{SmolStr, format_smolstr};

pub use parameters::LeguinParameters;
pub use tables::{
    Errand, LeguinAct, LeguinBehavior, LeguinContext, LeguinMeasures, TABLE, appraise, urgency,
};

use crate::belief::Encouragement;
use crate::closing::Closing;
use crate::commands::{GO_HOME, HURRY, REFILL, shortened};
use crate::drive::StraightDrive;
use crate::emotion::SwitchableGenerator;
use crate::frame::{self, publish_variables};
use crate::input::Input;
use crate::panel;
use crate::policy::Policy;
use crate::published::{flag, text};
use state::LeguinMemory;

const JOKES: &[&str] = &[
    "Waiting is easy. I have it in my state table.",
    "I asked the table for a joke. It said the spread was good enough.",
    "My favorite distance is four feet.",
    "They say a watched pot never boils. Nobody has tried it with a watched robot.",
];

/// The refiller.
#[derive(Clone)]
pub struct Leguin {
    parameters: LeguinParameters,
    emotion: SwitchableGenerator<LeguinMeasures, LeguinBehavior>,
    bsg: BehaviorGenerator<LeguinBehavior, LeguinContext, LeguinAct>,
    haste: SensoryMotor,
    state: LeguinMemory,
    /// Her motion in this tick.
    motion: Action,
}

/// Everything that changes in Leguin: restored from it, she continues identically.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeguinState {
    state: LeguinMemory,
    emotion: EmotionState<StandardEmotion>,
    behavior: BehaviorState<LeguinBehavior>,
}

impl Default for Leguin {
    /// A Leguin with the default parameters; [`Robot::init`] replaces them with those of the scenario.
    fn default() -> Self {
        match Self::new(LeguinParameters::default()) {
            Ok(leguin) => leguin,
            Err(reason) => {
                unreachable!("the default parameters, which a test checks, are refused: {reason}")
            }
        }
    }
}

impl CarsRobotInterface for Leguin {
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::new(cars.parameters()?).map_err(|reason| cars.bad_parameters(reason))?;
        self.state.begin(&self.parameters, cars);
        self.begin_helping(cars);
        self.follow_episode(0.0);
        Ok(())
    }

    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) {
        self.state.at = location;
    }

    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
        if self.answer(cars, from, command) {
            return;
        }

        let behavior = self.behavior();
        let state = &mut self.state;
        if matches!(command, REFILL | HURRY) && behavior != LeguinBehavior::Exchange {
            state.checks.owe();
        }
        match (command, behavior) {
            // A call to come is obsolete once she is there.
            (REFILL | HURRY, LeguinBehavior::Exchange) | (REFILL, LeguinBehavior::Refill) => {}
            (REFILL, _) => state.pending = state.pending.or(Some(Errand::Refill)),
            (HURRY, _) => state.pending = Some(Errand::Hurry),
            // The waiter may complete the exchange a tick before her.
            (GO_HOME, LeguinBehavior::Exchange | LeguinBehavior::AwaitGoHome) => {
                state.sent_home = true;
            }
            (GO_HOME, _) => {}
            _ => {
                let text = shortened(command);
                cars.log(format!("does not understand {text:?} from {from}"));
            }
        }
    }

    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        let behavior = self.behavior();
        let tick_s = cars.tick_s();
        self.bsg.advance(tick_s);
        self.state.advance(behavior, tick_s);
        let recent_s = self.parameters.appraisal.recent_s;
        let answer_s = self.parameters.answer_s;
        self.state.checks.advance(answer_s, recent_s, tick_s);
        self.observe_waiter(cars);
        self.heed_signals();
        self.observe_way(tick_s);
        self.believe(cars);
        self.measure(behavior);
    }

    fn update_emotion_state(&mut self, cars: &mut Cars<'_>) {
        let progress = self
            .emotion
            .update(&self.state.measures, self.bsg.current(), cars);
        self.state.inputs.record(progress);
        if progress.is_some_and(|progress| progress.signed > 0.0) {
            self.state.checks.progress();
        }
        self.check(cars);
    }

    fn update_behavior_state(&mut self, cars: &mut Cars<'_>) {
        let context = self.context(cars);
        for act in self.bsg.update(&context).actions {
            self.perform(act, cars);
        }
    }

    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
        self.motion = self.drive(cars);
        self.motion.proposal
    }

    fn name(&self) -> &str {
        &self.state.name
    }

    fn current_location(&self) -> Point {
        self.state.at
    }

    fn speed(&self) -> f64 {
        self.motion.speed_mps
    }

    fn direction(&self) -> f64 {
        self.motion.direction_rad
    }

    fn state_variables(&self) -> StateVariables {
        let mut variables = self.state.published(self.behavior(), self.goal());
        self.publish_shame(&mut variables);
        publish_variables(self.frame(), variables)
    }

    fn emotion_state(&self) -> &str {
        self.emotion.name()
    }

    fn behavior_state(&self) -> &str {
        self.behavior().name()
    }
}

impl Robot for Leguin {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.init_robot(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        control_cycle(self, cars)
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        let beliefs = self.parameters.deliberation;
        self.state.take_over(last, beliefs);
        self.emotion.take_over(last, beliefs.beliefs.is_on());
        self.resume_shame(last);

        let name = text(last, "behavior");
        let behavior = LeguinBehavior::ALL
            .into_iter()
            .find(|behavior| Some(behavior.name()) == name);
        self.bsg = BehaviorGenerator::new(TABLE, behavior.unwrap_or(LeguinBehavior::GoHome));
        cars.log("is back, and takes over where the last one was lost");
    }

    fn parameters_check(&self) -> Option<ParametersCheck> {
        Some(|parameters| Self::new(read_parameters(parameters)?).map(drop))
    }

    fn reseed(&mut self, cars: &mut Cars<'_>) {
        self.state.reseed(cars.random());
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }

    fn is_quick(&self) -> bool {
        true
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn panel(&self) -> Panel {
        let cuts = &self.parameters.dynamics.label_cuts;
        let mut widgets = panel::affect(self.frame().as_ref(), cuts);
        widgets.push(panel::behavior(self.behavior().name()));
        widgets.push(self.progress_table());
        widgets.extend([REFILL, HURRY, GO_HOME].map(|command| Widget::Button {
            label: SmolStr::new_static(command),
            command: SmolStr::new_static(command),
        }));
        Panel { widgets }
    }
}

impl Leguin {
    /// A Leguin before her first tick.
    ///
    /// # Errors
    /// What is wrong with the parameters.
    pub fn new(parameters: LeguinParameters) -> Result<Self, String> {
        parameters.check()?;
        let dynamics = Dynamics::standard(&parameters.dynamics, parameters.caution)
            .and_then(|dynamics| dynamics.with_mood(parameters.mood))
            .map_err(|error| error.to_string())?;
        let esg = DynamicGenerator::new(dynamics, appraise);

        // The sensory-motor level: the stronger her concern, the faster she is; nothing else changes her speed.
        let haste = SensoryMotor::new(SensoryMotorParameters {
            negative_gain: parameters.hurry_mult,
            positive_gain: 1.0,
            onset: parameters.haste_onset,
            full: parameters.haste_full,
        })
        .map_err(|error| error.to_string())?;

        Ok(Self {
            motion: Action::default(),
            emotion: SwitchableGenerator::new(parameters.affect, parameters.script(), esg),
            bsg: BehaviorGenerator::new(TABLE, LeguinBehavior::Wait),
            haste,
            state: LeguinMemory::new(&parameters),
            parameters,
        })
    }

    /// Her feeling; without emotions a steady one.
    #[must_use]
    pub fn feeling(&self) -> Feeling<StandardEmotion> {
        self.emotion.feeling()
    }

    /// What she feels and why, as she publishes it; `None` without emotions.
    #[must_use]
    pub fn frame(&self) -> Option<AffectFrame<'_>> {
        let state = &self.state;
        frame::of(
            &self.emotion,
            state.appraisal,
            &state.checks.episode,
            self.parameters.caution,
        )
    }

    /// Her behavior.
    #[must_use]
    pub fn behavior(&self) -> LeguinBehavior {
        *self.bsg.current()
    }

    /// Everything that changes in her.
    #[must_use]
    pub fn save(&self) -> LeguinState {
        LeguinState {
            state: self.state.clone(),
            emotion: self.emotion.save(),
            behavior: self.bsg.state().clone(),
        }
    }

    /// Continues from a saved state; the parameters must be those it was saved with.
    ///
    /// # Errors
    /// A Leguin of these parameters cannot have the saved emotion.
    pub fn restore(&mut self, saved: LeguinState) -> Result<(), String> {
        self.emotion.restore(saved.emotion)?;
        self.bsg.restore(saved.behavior);
        self.state = saved.state;
        Ok(())
    }

    /// What she believes of herself: the waiter within sensing range encourages her, and so does one who comes to meet her.
    fn believe(&mut self, cars: &Cars<'_>) {
        let state = &mut self.state;
        let sensing_range_m = cars.welcome().sensing_range_m;
        let comes = state.waiter.behavior(self.parameters.query_stale_s) == Some("INTERCEPT");
        let is_near = state.waiter.is_within(sensing_range_m, cars);

        let parameters = self.parameters.deliberation;
        let waiter = state.waiter.name();
        let beliefs = &mut state.beliefs;
        if beliefs.update(
            parameters,
            "errand",
            waiter,
            Encouragement::of(is_near, comes),
        ) {
            state.inputs.note(Input::Encouraged);
        }
    }

    fn measure(&mut self, behavior: LeguinBehavior) {
        let parameters = &self.parameters;
        let gain = parameters.gain();
        let blocked = if behavior == LeguinBehavior::Refill {
            self.state.way.stalled_s() * gain / parameters.block_patience_s
        } else {
            0.0
        };
        let errand = if self.state.hurried {
            parameters.hurry_pressure.max(parameters.errand_pressure)
        } else {
            parameters.errand_pressure
        };

        let measured = match (behavior, self.state.comes_nearer) {
            (LeguinBehavior::Exchange, _) if self.bsg.has_lasted(parameters.exchange_s) => {
                Some(Input::ExchangeOver)
            }
            (LeguinBehavior::Refill, true) => Some(Input::ComesNearer),
            (LeguinBehavior::GoHome, true) => Some(Input::NearerHome),
            _ => None,
        };
        let event = self.state.inputs.show(measured, &parameters.dynamics);

        self.state.measures = LeguinMeasures {
            hurried: self.state.hurried,
            errand,
            blocked,
            waiting: self.state.waiting_s * gain / parameters.await_patience_s,
            event,
            belief: self.state.beliefs.stated(parameters.deliberation),
            th_concerned: parameters.dynamics.th_concerned,
        };
    }

    /// Measures progress on the way: whether she is nearer to its goal than ever before.
    fn observe_way(&mut self, tick_s: f64) {
        let distance_m = self.goal().map(|goal| self.state.at.distance_m(goal));
        let is_on_the_way = match self.behavior() {
            LeguinBehavior::Refill => self.bsg.has_lasted(self.parameters.prep_s),
            LeguinBehavior::GoHome => true,
            LeguinBehavior::Wait | LeguinBehavior::Exchange | LeguinBehavior::AwaitGoHome => false,
        };

        if is_on_the_way {
            let progress_m = self.parameters.progress_m;
            let way = &mut self.state.way;
            self.state.comes_nearer = way.observe(distance_m, progress_m, tick_s);
        } else {
            self.state.way = Closing::default();
            self.state.comes_nearer = false;
        }
    }

    fn observe_waiter(&mut self, cars: &mut Cars<'_>) {
        let state = &mut self.state;
        if let Some(waiter) = state.waiter.observe(cars).state {
            state.waiter_needs = flag(&waiter.state_variables, "need");
            state.waiter_calls = text(&waiter.state_variables, "refiller").map(str::to_owned);
        }
    }

    /// What the emotion that the waiter shows makes her do, if she sees such signals: she sets out when he is CONCERNED and
    /// hurries when he is FRUSTRATED, as if he had commanded it \[I\].
    fn heed_signals(&mut self) {
        let stale_s = self.parameters.query_stale_s;
        if !self.parameters.signals.is_on() || self.calls_another() {
            return;
        }

        let state = &mut self.state;
        let signaled = match state.waiter.emotion(stale_s) {
            Some(StandardEmotion::Concerned) => Errand::Refill,
            Some(StandardEmotion::Frustrated | StandardEmotion::Angry) => Errand::Hurry,
            _ => return,
        };
        let is_new = match self.bsg.current() {
            LeguinBehavior::Wait => state.pending != Some(Errand::Hurry),
            LeguinBehavior::Refill => signaled == Errand::Hurry && !state.hurried,
            _ => false,
        };
        if is_new {
            state.pending = Some(signaled);
        }
    }

    /// Whether the waiter is known to call another robot.
    fn calls_another(&self) -> bool {
        let called = self.state.waiter_calls.as_deref();
        called.is_some_and(|name| *name != self.state.name)
    }

    /// Whether the waiter wants treats from her. If he cannot be queried she assumes that he does, unless he is known to
    /// call for another robot: Vonda does not step in for Leguin.
    fn is_needed(&self) -> bool {
        let state = &self.state;
        !self.calls_another()
            && (state.waiter_needs || state.waiter.is_unknown(self.parameters.query_stale_s))
    }

    /// Whether she is back at the table: at her place, or near it if a body stands there and does not leave.
    fn is_home(&self) -> bool {
        let state = &self.state;
        let parameters = &self.parameters;
        let distance_m = state.at.distance_m(state.home);
        let is_kept_away = state.way.stalled_s() >= parameters.settle_s;
        distance_m <= parameters.arrive_m || (distance_m <= parameters.settle_m && is_kept_away)
    }

    fn context(&self, cars: &Cars<'_>) -> LeguinContext {
        let state = &self.state;
        let parameters = &self.parameters;
        let waiter_is_here = state.waiter.is_within(parameters.exchange_radius_m, cars);

        LeguinContext {
            gives_up: self.gives_up(),
            is_happy: parameters.schematic.is_on() && self.emotion.is_happy(),
            pending: state.pending,
            despairs: self.emotion.despairs(parameters.policy()),
            waiter_is_needy_here: self.is_needed() && waiter_is_here,
            exchange_is_over: self.bsg.has_lasted(parameters.exchange_s),
            sent_home: state.sent_home,
            is_home: self.is_home(),
            has_joke: state.jokes.are_due(),
        }
    }

    /// Whether she turns back, by her policy. Not before she has set out: what frustrated her before is over.
    fn gives_up(&self) -> bool {
        if !self.bsg.has_lasted(self.parameters.prep_s) {
            return false;
        }

        let measures = &self.state.measures;
        let least = self.parameters.dynamics.th_frustrated;
        match self.parameters.policy() {
            Policy::Emotion => self.feeling().emotion == StandardEmotion::Frustrated,
            Policy::Rules | Policy::Timer => measures.blocked.max(measures.waiting) >= least,
            Policy::Neither => false,
        }
    }

    fn perform(&mut self, act: LeguinAct, cars: &mut Cars<'_>) {
        let state = &mut self.state;
        match act {
            LeguinAct::TakeErrand => {
                state.hurried = state.pending.take() == Some(Errand::Hurry);
                state.inputs.note(if state.hurried {
                    Input::Hurry
                } else {
                    Input::NewErrand
                });
                state.checks.begin_errand();
            }
            LeguinAct::Hurry => {
                state.hurried = true;
                state.pending = None;
                state.inputs.note(Input::Hurry);
            }
            LeguinAct::FinishErrand => {
                if state.beliefs.succeed() {
                    state.inputs.note(Input::Encouraged);
                }
                state.checks.complete_errand();
                state.hurried = false;
                state.pending = None;
                state.sent_home = false;
            }
            LeguinAct::TurnHome => {
                state.trips += 1;
                state.sent_home = false;
                state.inputs.note(Input::SentHome);
            }
            LeguinAct::ComeHome => state.inputs.note(Input::Home),
            LeguinAct::GiveUp => {
                if state.checks.give_up() {
                    state.beliefs.give_up();
                }
                state.given_up += 1;
                state.hurried = false;
                state.way = Closing::default();
                state.inputs.note(Input::GivesUp);
            }
            LeguinAct::Joke => {
                state.jokes.tell(JOKES, self.parameters.joke_mean_s, cars);
            }
        }
    }

    /// Where she is going.
    fn goal(&self) -> Option<Point> {
        let waiter = &self.state.waiter;
        match self.behavior() {
            LeguinBehavior::Refill if waiter.is_missing() => None,
            LeguinBehavior::Refill => waiter.location(),
            LeguinBehavior::GoHome => Some(self.state.home),
            LeguinBehavior::Wait | LeguinBehavior::Exchange | LeguinBehavior::AwaitGoHome => None,
        }
    }

    /// The motion that her behavior wants.
    fn drive(&mut self, cars: &mut Cars<'_>) -> Action {
        match self.behavior() {
            LeguinBehavior::Wait | LeguinBehavior::Exchange | LeguinBehavior::AwaitGoHome => {
                self.state.drive.stay(cars)
            }
            LeguinBehavior::Refill => self.refill(cars),
            LeguinBehavior::GoHome => {
                let course = StraightDrive {
                    goal: self.state.home,
                    stop_m: 0.0,
                    speed_mps: self.parameters.v_refill_mps,
                    look_s: self.parameters.look_s,
                };
                self.state.drive.follow(cars, course)
            }
        }
    }

    /// Drives to the waiter; searches for him if he is not where he was last known to be.
    fn refill(&mut self, cars: &mut Cars<'_>) -> Action {
        if !self.bsg.has_lasted(self.parameters.prep_s) {
            return self.state.drive.stay(cars);
        }

        let speed_mps = self.parameters.v_refill_mps * self.haste();
        if let Some(goal) = self.goal() {
            let course = StraightDrive {
                goal,
                stop_m: self.parameters.stand_off_m,
                speed_mps,
                look_s: self.parameters.look_s,
            };
            return self.state.drive.follow(cars, course);
        }

        let turn_mean_s = self.parameters.turn_mean_s;
        let state = &mut self.state;
        state
            .drive
            .wander(cars, speed_mps, turn_mean_s, &mut state.turns)
    }

    /// The factor on her speed, by her policy.
    fn haste(&self) -> f64 {
        let parameters = &self.parameters;
        let measures = &self.state.measures;
        let is_concerning = self.state.hurried || measures.blocked >= measures.th_concerned;
        match parameters.policy {
            Policy::Emotion if parameters.sensory_motor.is_on() => {
                self.haste.gain(self.feeling().affect())
            }
            Policy::Rules if is_concerning => parameters.hurry_mult,
            Policy::Timer if self.state.hurried => parameters.hurry_mult,
            Policy::Emotion | Policy::Rules | Policy::Timer | Policy::Neither => 1.0,
        }
    }

    fn progress_table(&self) -> Widget {
        let state = &self.state;
        let distance = match self.goal() {
            Some(goal) => panel::number(state.at.distance_m(goal), 1, " m"),
            None => SmolStr::new_static("-"),
        };

        panel::table([
            ("waiter", self.parameters.waiter.as_str().into()),
            ("way to go", distance),
            ("hurried", panel::yes(state.hurried).into()),
            ("blocked for", panel::number(state.way.stalled_s(), 1, " s")),
            ("kept waiting for", panel::number(state.waiting_s, 1, " s")),
            (
                "trips, given up",
                format_smolstr!("{}, {}", state.trips, state.given_up),
            ),
        ])
    }
}
