//! Leguin, the refiller: waits at the table until she is called, brings treats, hurries when she is asked to, and goes home
//! when she is sent or has had enough.

mod parameters;
mod state;
mod tables;

use affect::behavior::{BehaviorGenerator, BehaviorState};
use affect::levels::{SensoryMotor, SensoryMotorParameters};
use affect::{
    Circumstances, EmotionGenerator, EmotionLabel, Feeling, RuleGenerator, StandardEmotion,
};
use robot::{BadParameters, Cars, Panel, Point, Robot, RobotName, StateVariables, Widget};
use serde::{Deserialize, Serialize};

pub use parameters::{Feelings, Parameters};
pub use tables::{Act, Behavior, Context, EMOTIONS, Errand, Measures, TABLE, intensity};

use crate::drive::Course;
use crate::panel::{self, NEUTRAL};
use crate::{GO_HOME, HURRY, REFILL, shortened};
use state::State;

const JOKES: &[&str] = &[
    "Waiting is easy. I have it in my state table.",
    "I asked the table for a joke. It said the spread was good enough.",
    "My favorite distance is four feet.",
    "They say a watched pot never boils. Nobody has tried it with a watched robot.",
];

/// The refiller.
pub struct Leguin {
    parameters: Parameters,
    /// Without emotions it never runs, and stays as it starts.
    esg: RuleGenerator<Measures, Behavior, StandardEmotion>,
    bsg: BehaviorGenerator<Behavior, Context, Act>,
    haste: SensoryMotor,
    state: State,
}

/// All that changes in Leguin; a Leguin that is restored from it continues identically.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saved {
    state: State,
    feeling: Feeling<StandardEmotion>,
    behavior: BehaviorState<Behavior>,
}

impl Default for Leguin {
    /// A Leguin with the default parameters. The simulation's own come with [`Robot::init_robot`].
    fn default() -> Self {
        match Self::new(Parameters::default()) {
            Ok(leguin) => leguin,
            Err(reason) => {
                unreachable!("the default parameters, which a test checks, are refused: {reason}")
            }
        }
    }
}

impl Leguin {
    /// A Leguin before her first tick.
    ///
    /// # Errors
    /// What is wrong with the parameters.
    pub fn new(parameters: Parameters) -> Result<Self, String> {
        parameters.check()?;
        let esg = RuleGenerator::new(EMOTIONS, intensity, StandardEmotion::Happy);
        // The sensory-motor level: concern speeds her up at once, nothing else changes her speed.
        let onset = parameters.dynamics.th_concerned;
        let haste = SensoryMotorParameters {
            negative_gain: parameters.hurry_mult,
            positive_gain: 1.0,
            onset,
            full: onset,
        };
        let haste = SensoryMotor::new(haste).map_err(|error| error.to_string())?;
        let state = State::new(&parameters);
        Ok(Self {
            parameters,
            esg,
            bsg: BehaviorGenerator::new(TABLE, Behavior::Wait),
            haste,
            state,
        })
    }

    /// What she feels; without emotions a steady state without intensity.
    #[must_use]
    pub fn feeling(&self) -> Feeling<StandardEmotion> {
        self.esg.feeling()
    }

    /// What she does.
    #[must_use]
    pub fn behavior(&self) -> Behavior {
        *self.bsg.current()
    }

    /// All that changes in her.
    #[must_use]
    pub fn save(&self) -> Saved {
        Saved {
            state: self.state.clone(),
            feeling: self.feeling(),
            behavior: self.bsg.state().clone(),
        }
    }

    /// Continues from a saved state; the parameters must be those it was saved with.
    ///
    /// # Errors
    /// The saved emotion is none that a Leguin of these parameters can have.
    pub fn restore(&mut self, saved: Saved) -> Result<(), String> {
        if !self.parameters.affect.is_on() && saved.feeling != self.feeling() {
            return Err("the saved emotion does not fit these parameters".to_owned());
        }
        self.esg.restore(saved.feeling);
        self.bsg.restore(saved.behavior);
        self.state = saved.state;
        Ok(())
    }

    fn watch_waiter(&mut self, cars: &mut Cars<'_>) {
        let state = &mut self.state;
        if let Some(waiter) = state.waiter.look(cars, state.at).state {
            let said = &waiter.state_variables;
            state.waiter_needs = said
                .get("need")
                .and_then(robot::Variable::as_bool)
                .unwrap_or(false);
            state.waiter_calls = said
                .get("refiller")
                .and_then(|name| name.as_str())
                .map(str::to_owned);
        }
    }

    /// Whether the waiter wants treats of her. Where he cannot be asked she takes it that he does, unless he is known to
    /// call for somebody else: Vonda does not step in for Leguin.
    fn is_needed(&self, cars: &Cars<'_>) -> bool {
        let state = &self.state;
        let calls_another = state
            .waiter_calls
            .as_deref()
            .is_some_and(|name| name != cars.name().as_str());
        !calls_another
            && (state.waiter_needs || state.waiter.is_unknown(self.parameters.query_stale_s))
    }

    /// Whether she is back at the table: at her place, or near it if somebody stands there and does not go.
    fn is_home(&self) -> bool {
        let (state, parameters) = (&self.state, &self.parameters);
        let away_m = state.at.distance_m(state.home);
        let is_kept_away = state.blocked_s >= parameters.settle_s;
        away_m <= parameters.arrive_m || (away_m <= parameters.settle_m && is_kept_away)
    }

    fn context(&self, cars: &Cars<'_>) -> Context {
        let (state, parameters) = (&self.state, &self.parameters);
        let (radius_m, range_m) = (parameters.exchange_radius_m, cars.welcome().sensing_range_m);
        Context {
            emotion: parameters.acts_by_emotion().then(|| self.feeling().emotion),
            pending: state.pending,
            waiter_is_needy_here: self.is_needed(cars)
                && state.waiter.is_within(radius_m, state.at, range_m),
            exchange_is_over: self.bsg.has_lasted(parameters.exchange_s),
            sent_home: state.sent_home,
            is_home: self.is_home(),
            has_joke: state.until_joke_s <= 0.0,
        }
    }

    fn perform(&mut self, act: Act, cars: &mut Cars<'_>) {
        let state = &mut self.state;
        match act {
            Act::TakeErrand => state.hurried = state.pending.take() == Some(Errand::Hurry),
            Act::Hurry => (state.hurried, state.pending) = (true, None),
            Act::FinishErrand => {
                (state.hurried, state.pending, state.sent_home) = (false, None, false)
            }
            Act::TurnHome => (state.trips, state.sent_home) = (state.trips + 1, false),
            Act::GiveUp => {
                (state.given_up, state.hurried) = (state.given_up + 1, false);
                state.begin_way();
            }
            Act::Joke => {
                cars.log(format!("jokes: {}", JOKES[state.jokes.one_of(JOKES.len())]));
                state.until_joke_s = state.jokes.exponential(self.parameters.joke_mean_s);
            }
        }
    }

    /// Where she is going.
    fn goal(&self) -> Option<Point> {
        match self.behavior() {
            Behavior::Refill => self
                .state
                .waiter
                .place()
                .filter(|_| !self.state.waiter.is_missing()),
            Behavior::GoHome => Some(self.state.home),
            Behavior::Wait | Behavior::Exchange | Behavior::AwaitGoHome => None,
        }
    }

    /// On the way to the waiter; if he is not where he was last known to be, in search of him.
    fn refill(&mut self, cars: &mut Cars<'_>) -> Point {
        let (parameters, goal) = (&self.parameters, self.goal());
        let haste = if parameters.sensory_motor.is_on() {
            self.haste.gain(self.feeling().affect())
        } else {
            1.0
        };
        let speed_mps = parameters.v_refill_mps * haste;
        let State {
            legs,
            turns,
            at,
            aim,
            ..
        } = &mut self.state;
        if !self.bsg.has_lasted(parameters.prep_s) {
            return legs.stay(*at);
        }
        let Some(goal) = goal else {
            // Toward nowhere: whatever she does now is no progress.
            *aim = Some((*at, speed_mps * cars.tick_s()));
            return legs.walk(cars, *at, speed_mps, parameters.turn_mean_s, turns);
        };
        self.approach(cars, goal, self.parameters.stand_off_m, speed_mps)
    }

    /// A step of the way, remembering what would be progress.
    fn approach(&mut self, cars: &mut Cars<'_>, goal: Point, stop_m: f64, speed_mps: f64) -> Point {
        let State { legs, at, aim, .. } = &mut self.state;
        let step_m = (speed_mps * cars.tick_s()).min(at.distance_m(goal) - stop_m);
        *aim = (step_m > 0.0).then_some((goal, step_m));
        legs.drive(
            cars,
            *at,
            Course {
                goal,
                stop_m,
                speed_mps,
                look_s: self.parameters.look_s,
            },
        )
    }
}

impl Robot for Leguin {
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let bad = |reason| BadParameters {
            robot: cars.name().clone(),
            reason,
        };
        *self = Self::new(cars.parameters()?).map_err(bad)?;
        self.state.begin(&self.parameters, cars);
        Ok(())
    }

    fn speed(&self) -> f64 {
        self.state.legs.speed_mps()
    }

    fn direction(&self) -> f64 {
        self.state.legs.direction_rad()
    }

    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        let (behavior, parameters) = (self.behavior(), &self.parameters);
        self.bsg.advance(cars.tick_s());
        self.state
            .pass(behavior, parameters.progress_share, cars.tick_s());
        let gain = parameters.gain();
        self.state.measures = Measures {
            hurried: self.state.hurried,
            blocked: if behavior == Behavior::Refill {
                self.state.blocked_s * gain / parameters.block_patience_s
            } else {
                0.0
            },
            waiting: self.state.waiting_s * gain / parameters.await_patience_s,
            th_concerned: parameters.dynamics.th_concerned,
        };
        self.watch_waiter(cars);
    }

    fn state_variables(&self) -> StateVariables {
        self.state
            .published(self.feeling().intensity, self.behavior(), self.goal())
    }

    fn current_location(&self) -> Point {
        self.state.at
    }

    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
        (self.state.before, self.state.aim) = (self.state.at, None);
        match self.behavior() {
            Behavior::Wait | Behavior::Exchange | Behavior::AwaitGoHome => {
                self.state.legs.stay(self.state.at)
            }
            Behavior::Refill => self.refill(cars),
            Behavior::GoHome => {
                self.approach(cars, self.state.home, 0.0, self.parameters.v_refill_mps)
            }
        }
    }

    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) {
        self.state.at = location;
    }

    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
        let (behavior, state) = (self.behavior(), &mut self.state);
        match (command, behavior) {
            // What was meant to bring her about is over once she is there.
            (REFILL | HURRY, Behavior::Exchange) | (REFILL, Behavior::Refill) => {}
            (REFILL, _) => state.pending = state.pending.or(Some(Errand::Refill)),
            (HURRY, _) => state.pending = Some(Errand::Hurry),
            // The waiter may be done with the exchange a tick before her.
            (GO_HOME, Behavior::Exchange | Behavior::AwaitGoHome) => state.sent_home = true,
            (GO_HOME, _) => {}
            _ => cars.log(format!(
                "does not understand {:?} from {from}",
                shortened(command)
            )),
        }
    }

    fn update_emotion_state(&mut self, cars: &mut Cars<'_>) {
        if self.parameters.affect.is_on() {
            self.esg
                .update(&self.state.measures, self.bsg.current(), cars.tick_s());
        }
    }

    fn emotion_state(&self) -> &str {
        if self.parameters.affect.is_on() {
            self.feeling().emotion.name()
        } else {
            NEUTRAL
        }
    }

    fn update_behavior_state(&mut self, cars: &mut Cars<'_>) {
        let context = self.context(cars);
        for act in self.bsg.update(&context).actions {
            self.perform(act, cars);
        }
    }

    fn behavior_state(&self) -> &str {
        self.behavior().name()
    }

    fn panel(&self) -> Panel {
        let (state, behavior) = (&self.state, self.behavior());
        // On the way it is the crowd that blocks her, unless it is the waiter who presses.
        let is_crowd = behavior == Behavior::Refill && !state.hurried;
        let other = if is_crowd {
            "the crowd"
        } else {
            self.parameters.waiter.as_str()
        };
        let goal = format!(
            "to bring {} to {}",
            self.parameters.goods, self.parameters.waiter
        );
        let circumstances = Circumstances {
            other: Some(other),
            goal: Some(&goal),
            ..Circumstances::default()
        };
        let feeling = self.parameters.affect.is_on().then(|| self.feeling());
        let mut widgets = panel::feeling(
            feeling,
            &self.parameters.dynamics.label_cuts,
            &circumstances,
        );
        widgets.push(panel::behavior(behavior.name()));
        let distance = self.goal().map_or("-".to_owned(), |goal| {
            format!("{:.1} m", state.at.distance_m(goal))
        });
        widgets.push(panel::table(&[
            ("waiter", self.parameters.waiter.clone()),
            ("way to go", distance),
            ("hurried", panel::yes(state.hurried).to_owned()),
            ("blocked for", panel::seconds(state.blocked_s)),
            ("kept waiting for", panel::seconds(state.waiting_s)),
            (
                "trips, given up",
                format!("{}, {}", state.trips, state.given_up),
            ),
        ]));
        widgets.extend([REFILL, HURRY, GO_HOME].map(|command| Widget::Button {
            label: command.to_owned(),
            command: command.to_owned(),
        }));
        Panel { widgets }
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        self.state.take_over(last);
        let name = last.get("behavior").and_then(|name| name.as_str());
        let behavior = Behavior::ALL
            .into_iter()
            .find(|behavior| Some(behavior.name()) == name);
        self.bsg = BehaviorGenerator::new(TABLE, behavior.unwrap_or(Behavior::GoHome));
        cars.log("is back, and takes over where the last one was lost");
    }
}
