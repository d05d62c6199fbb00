//! Butler, the waiter: wanders among the guests, offers treats, and, depending on his emotion, calls the refiller in
//! time, asks her to hurry, or drives to meet her.

mod appraisal;
mod checks;
mod deliberation;
mod parameters;
mod recruiting;
mod state;
mod tables;

use affect::behavior::{BehaviorGenerator, BehaviorState};
use affect::progress::{need_ratio, time_to_arrive_by_depot_s, time_to_arrive_s, time_to_empty_s};
use affect::{
    AffectFrame, DynamicGenerator, Dynamics, EmotionState, Feeling, StandardEmotion, Urgency,
};
use robot::{
    Action, BadParameters, Cars, CarsRobotInterface, Panel, ParametersCheck, Point, PublicState,
    Robot, RobotName, SensedRobot, StateVariables, Widget, control_cycle, read_parameters,
};
use serde::{Deserialize, Serialize};
use smol_str::{SmolStr, format_smolstr};

pub use deliberation::Deliberation;
pub use parameters::{Approach, ButlerParameters, Rate};
pub use tables::{ButlerAct, ButlerBehavior, ButlerContext, ButlerMeasures, TABLE, appraise};

use crate::belief::Encouragement;
use crate::closing::Closing;
use crate::commands::{GO_HOME, HURRY, REFILL, shortened};
use crate::drive::StraightDrive;
use crate::emotion::SwitchableGenerator;
use crate::frame::{self, publish_variables};
use crate::input::Input;
use crate::panel;
use crate::policy::{Policy, Urge};
use crate::published::text;
use deliberation::{Deliberator, FrustratedPlan, Prospects};
use state::ButlerMemory;

const JOKES: &[&str] = &[
    "I would tell you one about the canapes, but somebody took it.",
    "My tray is half full. I am an optimist with a counter.",
    "These are finger treats. Please keep the fingers.",
    "I used to serve soup. It was a short walk and a long cleaning.",
];

/// The waiter.
#[derive(Clone)]
pub struct Butler {
    parameters: ButlerParameters,
    emotion: SwitchableGenerator<ButlerMeasures, ButlerBehavior>,
    bsg: BehaviorGenerator<ButlerBehavior, ButlerContext, ButlerAct>,
    deliberator: Deliberator,
    state: ButlerMemory,
    /// His motion in this tick.
    motion: Action,
}

/// Everything that changes in Butler: restored from it, he continues identically.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ButlerState {
    state: ButlerMemory,
    emotion: EmotionState<StandardEmotion>,
    behavior: BehaviorState<ButlerBehavior>,
}

impl Default for Butler {
    /// A Butler with the default parameters; [`Robot::init`] replaces them with those of the scenario.
    fn default() -> Self {
        match Self::new(ButlerParameters::default()) {
            Ok(butler) => butler,
            Err(reason) => {
                unreachable!("the default parameters, which a test checks, are refused: {reason}")
            }
        }
    }
}

impl CarsRobotInterface for Butler {
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::new(cars.parameters()?).map_err(|reason| cars.bad_parameters(reason))?;
        self.state.begin(&self.parameters, cars);
        self.follow_episode(0.0);

        let refiller = &self.parameters.refiller;
        let roster = &cars.welcome().roster;
        let reason = if self.recruits() && self.refillers(cars).is_empty() {
            "no robot is one of the refillers".to_owned()
        } else if !self.recruits() && !roster.iter().any(|robot| robot.as_str() == refiller) {
            format!("no robot is called {refiller}")
        } else {
            return Ok(());
        };
        cars.log(format!("error: {reason}; the tray will not be refilled"));
        Ok(())
    }

    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) {
        self.state.at = location;
    }

    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
        if self.recruits() && self.state.recruiter.hear(from.as_str(), command) {
            return;
        }
        let text = shortened(command);
        cars.log(format!("takes no commands, not even {text:?} from {from}"));
    }

    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        let tick_s = cars.tick_s();
        self.bsg.advance(tick_s);
        self.state.advance(tick_s);
        let [served, missed] = [self.state.served, self.state.missed];
        self.serve(tick_s);
        if self.recruits() {
            self.recruit(cars);
        }
        let state = &mut self.state;
        let asked = [state.served - served, state.missed - missed];
        let has_treats = state.treats > 0;
        let recent_s = self.parameters.appraisal.recent_s;
        state.checks.count(asked, has_treats, recent_s, tick_s);
        self.observe_refiller(cars);
        self.believe(cars);
        self.measure(cars);
    }

    fn update_emotion_state(&mut self, cars: &mut Cars<'_>) {
        let progress = self
            .emotion
            .update(&self.state.measures, self.bsg.current(), cars);
        self.state.inputs.record(progress);
        self.check(cars);
        // A plan is a matter of what he feels.
        if self.deliberator.plans() && self.parameters.policy() == Policy::Emotion {
            self.plan(cars);
        }
        self.state.record(self.feeling());
    }

    fn update_behavior_state(&mut self, cars: &mut Cars<'_>) {
        let context = self.context(cars);
        for act in self.bsg.update(&context).actions {
            self.perform(act, cars);
        }
        if self.behavior() == ButlerBehavior::Exchange {
            self.state.recruiter.arrive();
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
        let mut variables = self.state.published(self.behavior());
        self.publish_recruiting(&mut variables);
        publish_variables(self.frame(), variables)
    }

    fn emotion_state(&self) -> &str {
        self.emotion.name()
    }

    fn behavior_state(&self) -> &str {
        self.behavior().name()
    }
}

impl Robot for Butler {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.init_robot(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        control_cycle(self, cars)
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        let beliefs = self.parameters.deliberation.beliefs();
        self.state
            .take_over(last, self.parameters.treat_capacity, beliefs);
        self.emotion.take_over(last, beliefs.beliefs.is_on());
        self.resume_recruiting(last);

        // An exchange cannot be resumed in the middle; its need is still there, and the refiller may still be near.
        let was_going_back = text(last, "behavior") == Some(ButlerBehavior::GoBack.name());
        let behavior = if was_going_back {
            ButlerBehavior::GoBack
        } else {
            ButlerBehavior::Serve
        };
        self.bsg = BehaviorGenerator::new(TABLE, behavior);
        cars.log("is back, and takes over where the last one was lost");
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

    fn parameters_check(&self) -> Option<ParametersCheck> {
        Some(|parameters| Self::new(read_parameters(parameters)?).map(drop))
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn panel(&self) -> Panel {
        let cuts = &self.parameters.dynamics.label_cuts;
        let mut widgets = panel::affect(self.frame().as_ref(), cuts);
        widgets.push(panel::behavior(self.behavior().name()));
        widgets.push(Widget::Bar {
            label: self.parameters.goods.as_str().into(),
            value: f64::from(self.state.treats),
            min: 0.0,
            max: f64::from(self.parameters.treat_capacity),
        });
        widgets.push(Widget::Sparkline {
            label: SmolStr::new_static("valence"),
            values: self.state.valences.iter().copied().collect(),
        });
        widgets.push(self.progress_table());

        Panel { widgets }
    }
}

impl Butler {
    /// A Butler before his first tick.
    ///
    /// # Errors
    /// What is wrong with the parameters.
    pub fn new(parameters: ButlerParameters) -> Result<Self, String> {
        parameters.check()?;

        let state = ButlerMemory::new(&parameters).map_err(|error| error.to_string())?;
        let dynamics = Dynamics::standard(&parameters.dynamics, parameters.caution)
            .and_then(|dynamics| dynamics.with_mood(parameters.mood))
            .map_err(|error| error.to_string())?;
        let deliberator = Deliberator::new(
            parameters.deliberation.clone(),
            parameters.caution,
            dynamics.gain(),
            parameters.dynamics.rho_max,
        )?;
        let esg = DynamicGenerator::new(dynamics, appraise);

        Ok(Self {
            motion: Action::default(),
            emotion: SwitchableGenerator::new(parameters.affect, parameters.script(), esg),
            bsg: BehaviorGenerator::new(TABLE, ButlerBehavior::Serve),
            deliberator,
            state,
            parameters,
        })
    }

    /// His feeling; without emotions a steady one.
    #[must_use]
    pub fn feeling(&self) -> Feeling<StandardEmotion> {
        self.emotion.feeling()
    }

    /// What he feels and why, as he publishes it; `None` without emotions.
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

    /// His behavior.
    #[must_use]
    pub fn behavior(&self) -> ButlerBehavior {
        *self.bsg.current()
    }

    /// Everything that changes in him.
    #[must_use]
    pub fn save(&self) -> ButlerState {
        ButlerState {
            state: self.state.clone(),
            emotion: self.emotion.save(),
            behavior: self.bsg.state().clone(),
        }
    }

    /// Continues from a saved state; the parameters must be those it was saved with.
    ///
    /// # Errors
    /// A Butler of these parameters cannot have the saved emotion.
    pub fn restore(&mut self, saved: ButlerState) -> Result<(), String> {
        self.emotion.restore(saved.emotion)?;
        self.bsg.restore(saved.behavior);
        self.state = saved.state;
        Ok(())
    }

    /// Lets guests take treats, at exponentially distributed intervals.
    fn serve(&mut self, tick_s: f64) {
        if !self.parameters.consume_in.contains(self.bsg.current()) {
            return;
        }

        let state = &mut self.state;
        let mut taken = 0;
        state.until_tap_s -= tick_s;
        while state.until_tap_s <= 0.0 {
            if state.treats > 0 {
                state.treats -= 1;
                taken += 1;
            } else {
                state.missed = state.missed.saturating_add(1);
            }
            state.until_tap_s += state.taps.exponential(self.parameters.treat_mean_s);
        }
        state.served = state.served.saturating_add(taken);
        state.rate.advance(tick_s, taken);
    }

    /// Queries and senses the refiller, and estimates how fast she approaches.
    fn observe_refiller(&mut self, cars: &mut Cars<'_>) {
        let here = cars.location();
        let before = self.state.refiller.location();
        let observation = self.state.refiller.observe(cars);
        let distance_m = observation
            .located_after_s
            .and(self.state.refiller.location())
            .map(|location| here.distance_m(location));
        self.note_answer(observation.state.as_deref());

        // Whether she comes is a matter of her motion, not of his.
        let state = &mut self.state;
        if let (Some(before), Some(distance_m)) = (before, distance_m) {
            let distance_before_m = here.distance_m(before);
            state.approach.measure_from(distance_before_m);
            state.come_m += distance_before_m - distance_m;
        }
        match (observation.located_after_s, distance_m) {
            (Some(after_s), Some(distance_m)) => {
                state
                    .approach
                    .observe(distance_m, state.refiller_left, after_s);
            }
            _ => state.approach.observe_silence(cars.tick_s()),
        }

        self.watch_progress(distance_m, cars.tick_s());
    }

    /// Notes what the refiller does, by her answer, or by the one before if there is none.
    fn note_answer(&mut self, answer: Option<&PublicState>) {
        let is_exchanging = self.behavior() == ButlerBehavior::Exchange;
        let state = &mut self.state;
        let behavior = state.refiller.behavior(self.parameters.query_stale_s);
        let is_coming = behavior == Some("REFILL");
        let has_turned = matches!(behavior, Some("WAIT" | "GO_HOME"));

        // While she still prepares at the table, her speed does not show how fast she will come.
        let moves = answer.is_some_and(|refiller| refiller.speed_mps > 0.0);
        state.refiller_left = is_coming && (state.refiller_left || moves);
        if let Some(refiller) = answer {
            let pending = text(&refiller.state_variables, "pending");
            state.refiller_is_called = pending.is_some_and(|errand| !errand.is_empty());
        }

        // She was on her way and is not any more: she has given up, and forgotten his calls.
        state.refiller_came |= state.called && is_coming;
        if state.refiller_came && has_turned && !state.refiller_is_called && !is_exchanging {
            state.forget_calls();
            state.recruiter.release();
        }
    }

    /// Watches whether the refiller comes nearer by herself while he needs her, and whether he does while he intercepts or goes
    /// back.
    fn watch_progress(&mut self, distance_m: Option<f64>, tick_s: f64) {
        let is_intercepting = self.behavior() == ButlerBehavior::Intercept;
        let is_going_back = self.behavior() == ButlerBehavior::GoBack;
        let progress_m = self.parameters.progress_m;
        let state = &mut self.state;

        if is_going_back {
            let start_m = state.at.distance_m(state.start);
            state.way_back.observe(Some(start_m), progress_m, tick_s);
        } else {
            state.way_back = Closing::default();
        }

        let behavior = state.refiller.behavior(self.parameters.query_stale_s);
        let mut comes_nearer = false;
        if state.need && !is_busy(behavior) {
            let way_to_go_m = distance_m.map(|_| -state.come_m);
            comes_nearer = state.errand.observe(way_to_go_m, progress_m, tick_s);
        } else {
            state.come_m = 0.0;
            state.errand = Closing::default();
        }

        if is_intercepting {
            comes_nearer |= state.chase.observe(distance_m, progress_m, tick_s);
        } else {
            state.chase = Closing::default();
        }
        state.comes_nearer = comes_nearer;
    }

    fn measure(&mut self, cars: &Cars<'_>) {
        let rate_per_s = self.state.rate.per_second();
        let time_to_empty_s = time_to_empty_s(f64::from(self.state.treats), rate_per_s);
        // A refiller who has come no nearer for a while is expected to take at least as long again [I].
        let stalled_s = self.state.errand.stalled_s();
        let time_to_refill_s = self.time_to_refill_s(cars).max(stalled_s);
        let exchange_is_over = self.behavior() == ButlerBehavior::Exchange
            && self.bsg.has_lasted(self.parameters.exchange_s);

        let measured = match (exchange_is_over, self.state.comes_nearer) {
            (true, _) => Some(Input::ExchangeOver),
            (false, true) => Some(Input::ComesNearer),
            (false, false) => None,
        };
        let event = self.state.inputs.show(measured, &self.parameters.dynamics);

        self.state.measures = ButlerMeasures {
            rate_per_s,
            time_to_empty_s,
            time_to_refill_s,
            need_ratio: need_ratio(time_to_refill_s, time_to_empty_s, rate_per_s),
            exchange_is_over,
            event,
            belief: self
                .state
                .mind
                .beliefs
                .stated(self.parameters.deliberation.beliefs()),
        };
    }

    /// What he believes of himself: the refiller within sensing range encourages him, and so does one who comes nearer at
    /// more than his own pace.
    fn believe(&mut self, cars: &Cars<'_>) {
        let state = &mut self.state;
        let sensing_range_m = cars.welcome().sensing_range_m;
        let comes_nearer =
            state.refiller_left && state.approach.speed_mps() > self.parameters.v_serve_mps;
        let is_near = state.refiller.is_within(sensing_range_m, cars);

        let parameters = self.parameters.deliberation.beliefs();
        let refiller = state.refiller.name();
        let beliefs = &mut state.mind.beliefs;
        if beliefs.update(
            parameters,
            "chase",
            refiller,
            Encouragement::of(is_near, comes_nearer),
        ) {
            state.inputs.note(Input::Encouraged);
        }
    }

    /// What he plans while he is FRUSTRATED.
    fn plan(&mut self, cars: &Cars<'_>) {
        let feeling = self.feeling();
        let prospects = self.prospects(cars);
        let mind = &mut self.state.mind;
        self.deliberator
            .plan(mind, feeling, &prospects, cars.tick_s());
    }

    /// When he can be refilled, by what he may do.
    fn prospects(&self, cars: &Cars<'_>) -> Prospects {
        let state = &self.state;
        let parameters = &self.parameters;
        let refiller = state.refiller.location();
        let reach_m = parameters.exchange_radius_m;
        let distance_m = refiller.map(|refiller| cars.location().distance_m(refiller));
        let start_m = refiller.map(|refiller| state.start.distance_m(refiller));

        // She needs as much longer to his start as it is farther away.
        let serve_on_s = state.measures.time_to_refill_s;
        let wait_at_start_s = match (start_m, distance_m) {
            (Some(start_m), Some(distance_m)) => {
                serve_on_s * (start_m / distance_m.max(reach_m)).max(0.0)
            }
            _ => serve_on_s,
        };

        let speed_mps = parameters
            .v_intercept_mps
            .max(parameters.approach.floor_mps);
        let straight_s =
            distance_m.map(|distance_m| time_to_arrive_s(distance_m - reach_m, speed_mps));
        Prospects {
            treats: f64::from(state.treats),
            rate_per_s: state.measures.rate_per_s,
            serve_on_s,
            wait_at_start_s,
            intercept_s: straight_s.filter(|_| self.context(cars).may_intercept()),
        }
    }

    /// Time until the refiller can be here: straight, or by way of her table if she has to go home first.
    fn time_to_refill_s(&self, cars: &Cars<'_>) -> f64 {
        let state = &self.state;
        let parameters = &self.parameters;
        let here = cars.location();

        let refiller = state.refiller.behavior(parameters.query_stale_s);
        if is_busy(refiller)
            && let (Some(location), Some(table)) = (state.refiller.location(), self.table())
        {
            return time_to_arrive_by_depot_s(
                location.distance_m(table),
                parameters.reload_s,
                table.distance_m(here),
                parameters.v_refill_mps,
            );
        }

        let reach_m = parameters.exchange_radius_m;
        if let Some(straight_s) = state.approach.arrival_s(reach_m) {
            return straight_s;
        }

        // Nothing was ever known of her: she may be at her table, or else anywhere on the field [I].
        let [width_m, height_m] = cars.welcome().field_m;
        let farthest_m = (width_m * width_m + height_m * height_m).sqrt();
        let distance_m = self
            .table()
            .map_or(farthest_m, |table| table.distance_m(here));
        let speed_mps = state
            .approach
            .speed_mps()
            .max(parameters.approach.floor_mps);
        time_to_arrive_s(distance_m - reach_m, speed_mps)
    }

    /// The location of the refiller's table: as the parameters give it, or where she was first known to be.
    fn table(&self) -> Option<Point> {
        self.parameters
            .table
            .map(|[x, y]| Point::new(x, y))
            .or(self.state.table)
            .or(self.state.refiller.first_location())
    }

    fn context(&self, cars: &Cars<'_>) -> ButlerContext {
        let state = &self.state;
        let parameters = &self.parameters;
        let stale_s = parameters.query_stale_s;
        let refiller = state.refiller.behavior(stale_s);

        // She may see the two of them meet a tick before he does, and then already exchanges.
        let is_ready = state.refiller.is_unknown(stale_s)
            || matches!(refiller, Some("WAIT" | "REFILL" | "EXCHANGE"));
        let is_here = state.refiller.is_within(parameters.exchange_radius_m, cars);
        let repeats_call = self.is_due(state.since_call_s)
            && state.need
            && !self.emotion.despairs(parameters.policy());

        ButlerContext {
            urge: self.urge(),
            is_happy: parameters.schematic.is_on() && self.emotion.is_happy(),
            need: state.need,
            called: state.called,
            hurried: state.hurried,
            refiller_is_ready_here: is_here && is_ready && self.has_refiller(),
            refiller_comes: refiller == Some("REFILL"),
            refiller_is_busy: matches!(refiller, Some("AWAIT_GO_HOME" | "GO_HOME")),
            intercept_any: parameters.intercept_any,
            is_stuck: state.chase.stalled_s() >= parameters.intercept_patience_s,
            rests: state.rest_s > 0.0 || !self.has_refiller(),
            exchange_is_over: state.measures.exchange_is_over,
            is_at_start: self.is_at_start(cars),
            repeats_call: repeats_call && refiller == Some("WAIT") && !state.refiller_is_called,
            repeats_go_home: self.is_due(state.since_go_home_s)
                && refiller == Some("AWAIT_GO_HOME"),
            has_joke: state.jokes.are_due(),
        }
    }

    /// Whether he is back: at his start, or where he comes no nearer to it and a robot stands nearby. Guests leave, and so does the
    /// refiller who has just come.
    fn is_at_start(&self, cars: &Cars<'_>) -> bool {
        let state = &self.state;
        let parameters = &self.parameters;
        let is_kept_away = state.way_back.stalled_s() >= parameters.settle_s;
        let is_in_the_way = |robot: &SensedRobot| {
            robot.name.as_str() != state.refiller.name()
                && state.at.distance_m(robot.location) <= parameters.settle_m
        };

        state.at.distance_m(state.start) <= parameters.arrive_m
            || (is_kept_away && cars.sensed_robots().iter().any(is_in_the_way))
    }

    /// How far the emotion that the refiller shows makes him go, if he sees such signals: one who is FRUSTRATED on an errand of
    /// his needs to be met \[I\].
    fn signaled_urge(&self) -> Urge {
        let shown = self.state.refiller.emotion(self.parameters.query_stale_s);
        let is_signaled = self.parameters.signals.is_on()
            && self.state.need
            && !self.emotion.despairs(self.parameters.policy())
            && shown == Some(StandardEmotion::Frustrated);
        if is_signaled {
            Urge::Intercept
        } else {
            Urge::None
        }
    }

    /// How far he goes to be refilled, by his policy.
    fn urge(&self) -> Urge {
        let parameters = &self.parameters;
        let dynamics = &parameters.dynamics;
        let is_pressed = self.pressure() >= dynamics.th_confident;
        let needed_s = self.state.needed_s;

        match parameters.policy() {
            Policy::Emotion => {
                let emotion = self.feeling().emotion;
                let own = self
                    .deliberator
                    .urge(emotion, &self.state.mind, self.state.need);
                own.max(self.signaled_urge())
            }
            Policy::Rules => Urge::at(
                self.pressure(),
                [
                    dynamics.th_confident,
                    dynamics.th_concerned,
                    dynamics.th_frustrated,
                ],
            ),
            Policy::Timer if self.state.need && needed_s >= parameters.intercept_after_s => {
                Urge::Intercept
            }
            Policy::Timer if self.state.need && needed_s >= parameters.hurry_after_s => Urge::Hurry,
            Policy::Timer if self.state.need || is_pressed => Urge::Call,
            Policy::Neither if is_pressed => Urge::Call,
            Policy::Timer | Policy::Neither => Urge::None,
        }
    }

    /// Whether a message that was sent so long ago is to be repeated.
    fn is_due(&self, since_s: f64) -> bool {
        self.parameters.resend.is_on() && since_s >= self.parameters.resend_s
    }

    /// The need as his emotion would appraise it: with his gain, saturated.
    fn pressure(&self) -> f64 {
        let dynamics = &self.parameters.dynamics;
        let need = self.state.measures.need_ratio;
        let gain = dynamics.gain(self.parameters.caution);
        Urgency::saturating(gain * need / dynamics.rho_max).value()
    }

    fn perform(&mut self, act: ButlerAct, cars: &mut Cars<'_>) {
        let state = &mut self.state;
        match act {
            ButlerAct::RaiseNeed => state.raise_need(),
            ButlerAct::CallRefill => {
                state.called = true;
                state.since_call_s = 0.0;
                if !self.calls_for_help() {
                    self.send_to_refiller(REFILL, cars);
                }
            }
            ButlerAct::CallHurry => {
                state.called = true;
                state.since_call_s = 0.0;
                // Until one has accepted there is nobody to hurry.
                if !self.calls_for_help() {
                    self.state.hurried = true;
                    self.send_to_refiller(HURRY, cars);
                }
            }
            ButlerAct::SendHome => {
                state.since_go_home_s = 0.0;
                self.send_to_refiller(GO_HOME, cars);
            }
            ButlerAct::Replenish => {
                state.replenish(self.parameters.treat_capacity);
                state.recruiter.release();
            }
            ButlerAct::GiveUp => {
                state.gave_up = state.gave_up.saturating_add(1);
                state.rest_s = self.parameters.intercept_again_s;
                state.mind.beliefs.give_up();
                state.inputs.note(Input::GivesUp);
            }
            ButlerAct::Joke => {
                state.jokes.tell(JOKES, self.parameters.joke_mean_s, cars);
            }
        }
    }

    fn send_to_refiller(&mut self, command: &str, cars: &mut Cars<'_>) {
        let refiller = self.state.refiller.name().to_owned();
        self.send(&refiller, command, cars);
    }

    /// The motion that his behavior wants.
    fn drive(&mut self, cars: &mut Cars<'_>) -> Action {
        match self.behavior() {
            ButlerBehavior::Serve
                if self.state.mind.plan() == Some(FrustratedPlan::WaitAtStart) =>
            {
                self.go_to_start(cars, self.parameters.v_serve_mps)
            }
            ButlerBehavior::Serve => self.wander(cars, self.parameters.v_serve_mps),
            ButlerBehavior::Intercept => self.intercept(cars),
            ButlerBehavior::Exchange => self.state.drive.stay(cars),
            ButlerBehavior::GoBack => self.go_to_start(cars, self.parameters.v_goback_mps),
        }
    }

    fn go_to_start(&mut self, cars: &mut Cars<'_>, speed_mps: f64) -> Action {
        let course = StraightDrive {
            goal: self.state.start,
            stop_m: 0.0,
            speed_mps,
            look_s: self.parameters.look_s,
        };
        self.state.drive.follow(cars, course)
    }

    fn wander(&mut self, cars: &Cars<'_>, speed_mps: f64) -> Action {
        let turn_mean_s = self.parameters.turn_mean_s;
        let state = &mut self.state;
        state
            .drive
            .wander(cars, speed_mps, turn_mean_s, &mut state.turns)
    }

    fn intercept(&mut self, cars: &mut Cars<'_>) -> Action {
        let parameters = &self.parameters;
        let Some(goal) = self.refiller_or_table() else {
            return self.wander(cars, parameters.v_intercept_mps);
        };

        let course = StraightDrive {
            goal,
            stop_m: parameters.stand_off_m,
            speed_mps: parameters.v_intercept_mps,
            look_s: parameters.look_s,
        };
        self.state.drive.follow(cars, course)
    }

    /// Where to look for the refiller: where she was last known to be, and then at her table, to which she returns. `None`
    /// if nothing was ever known of her.
    fn refiller_or_table(&self) -> Option<Point> {
        let refiller = &self.state.refiller;
        if refiller.is_missing() {
            self.table()
        } else {
            refiller.location().or(self.table())
        }
    }

    fn progress_table(&self) -> Widget {
        let state = &self.state;
        let measures = &state.measures;
        let called = panel::yes(state.called);
        let hurried = panel::yes(state.hurried);

        panel::table([
            (
                "time to empty",
                panel::number(measures.time_to_empty_s, 1, " s"),
            ),
            (
                "time to refill",
                panel::number(measures.time_to_refill_s, 1, " s"),
            ),
            ("need ratio", panel::number(measures.need_ratio, 2, "")),
            ("refiller", state.refiller.name().into()),
            ("called, hurried", format_smolstr!("{called}, {hurried}")),
            (
                "served, missed",
                format_smolstr!("{}, {}", state.served, state.missed),
            ),
            (
                "exchanges, given up",
                format_smolstr!("{}, {}", state.exchanges, state.gave_up),
            ),
        ])
    }
}

/// Whether a refiller with this behavior has something else to do before she can come.
fn is_busy(refiller: Option<&str>) -> bool {
    matches!(refiller, Some("EXCHANGE" | "AWAIT_GO_HOME" | "GO_HOME"))
}
