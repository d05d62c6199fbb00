//! Butler, the waiter: wanders through the guests, offers treats, and calls the refiller in time, asks her to hurry, or
//! goes to meet her, as he feels.

mod parameters;
mod state;
mod tables;

use affect::behavior::{BehaviorGenerator, BehaviorState};
use affect::progress::{need_ratio, time_to_arrive_by_depot_s, time_to_arrive_s, time_to_empty_s};
use affect::{
    Circumstances, DynamicGenerator, Dynamics, EmotionGenerator, EmotionLabel, EmotionState,
    Feeling, Intensity, StandardEmotion,
};
use robot::{BadParameters, Cars, Panel, Point, Robot, RobotName, StateVariables, Widget};
use serde::{Deserialize, Serialize};

pub use parameters::{Approach, Parameters, Rate};
pub use tables::{Act, Behavior, Context, Measures, TABLE, appraise};

use crate::drive::Course;
use crate::panel::{self, NEUTRAL};
use crate::{GO_HOME, HURRY, REFILL, shortened};
use state::State;

const JOKES: &[&str] = &[
    "I would tell you one about the canapes, but somebody took it.",
    "My tray is half full. I am an optimist with a counter.",
    "These are finger treats. Please keep the fingers.",
    "I used to serve soup. It was a short walk and a long cleaning.",
];

/// The waiter.
pub struct Butler {
    parameters: Parameters,
    /// Without emotions it never runs, and stays as it starts.
    esg: DynamicGenerator<Measures, Behavior, StandardEmotion>,
    bsg: BehaviorGenerator<Behavior, Context, Act>,
    state: State,
}

/// All that changes in Butler; a Butler that is restored from it continues identically.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saved {
    state: State,
    emotion: EmotionState<StandardEmotion>,
    behavior: BehaviorState<Behavior>,
}

impl Default for Butler {
    /// A Butler with the default parameters. The simulation's own come with [`Robot::init_robot`].
    fn default() -> Self {
        match Self::new(Parameters::default()) {
            Ok(butler) => butler,
            Err(reason) => {
                unreachable!("the default parameters, which a test checks, are refused: {reason}")
            }
        }
    }
}

impl Butler {
    /// A Butler before his first tick.
    ///
    /// # Errors
    /// What is wrong with the parameters.
    pub fn new(parameters: Parameters) -> Result<Self, String> {
        parameters.check()?;
        let state = State::new(&parameters).map_err(|error| error.to_string())?;
        let dynamics = Dynamics::standard(&parameters.dynamics, parameters.caution);
        let dynamics = dynamics.map_err(|error| error.to_string())?;
        let esg = DynamicGenerator::new(dynamics, appraise);
        Ok(Self {
            parameters,
            esg,
            bsg: BehaviorGenerator::new(TABLE, Behavior::Serve),
            state,
        })
    }

    /// What he feels; without emotions a steady state without intensity.
    #[must_use]
    pub fn feeling(&self) -> Feeling<StandardEmotion> {
        self.esg.feeling()
    }

    /// What he does.
    #[must_use]
    pub fn behavior(&self) -> Behavior {
        *self.bsg.current()
    }

    /// All that changes in him.
    #[must_use]
    pub fn save(&self) -> Saved {
        Saved {
            state: self.state.clone(),
            emotion: self.esg.state().clone(),
            behavior: self.bsg.state().clone(),
        }
    }

    /// Continues from a saved state; the parameters must be those it was saved with.
    ///
    /// # Errors
    /// The saved emotion is none that a Butler of these parameters can have.
    pub fn restore(&mut self, saved: Saved) -> Result<(), String> {
        let is_possible = if self.parameters.affect.is_on() {
            self.esg.dynamics().accepts(&saved.emotion)
        } else {
            saved.emotion == *self.esg.state()
        };
        if !is_possible {
            return Err("the saved emotion does not fit these parameters".to_owned());
        }
        self.esg.restore(saved.emotion);
        self.bsg.restore(saved.behavior);
        self.state = saved.state;
        Ok(())
    }

    /// Guests take treats: exponential times from one to the next.
    fn serve(&mut self, tick_s: f64) {
        let State {
            treats,
            served,
            missed,
            taps,
            until_tap_s,
            rate,
            ..
        } = &mut self.state;
        if !self.parameters.consume_in.contains(self.bsg.current()) {
            return;
        }
        let mut taken = 0;
        *until_tap_s -= tick_s;
        while *until_tap_s <= 0.0 {
            if *treats > 0 {
                *treats -= 1;
                taken += 1;
            } else {
                *missed = missed.saturating_add(1);
            }
            *until_tap_s += taps.exponential(self.parameters.treat_mean_s);
        }
        *served = served.saturating_add(taken);
        rate.advance(tick_s, taken);
    }

    /// Asks and looks for the refiller, and learns how fast she comes.
    fn watch_refiller(&mut self, cars: &mut Cars<'_>) {
        let State {
            refiller,
            refiller_left,
            approach,
            at,
            ..
        } = &mut self.state;
        let news = refiller.look(cars, *at);
        let is_called = refiller.behavior(self.parameters.query_stale_s) == Some("REFILL");
        // While she still prepares at the table, her speed says nothing about how fast she will come.
        let moves = news.state.is_some_and(|state| state.speed_mps > 0.0);
        *refiller_left = is_called && (*refiller_left || moves);
        let is_coming = *refiller_left;
        match (news.seen_after_s, refiller.place()) {
            (Some(after_s), Some(place)) => {
                approach.observe(at.distance_m(place), is_coming, after_s)
            }
            _ => approach.observe_silence(cars.tick_s()),
        }
    }

    fn measure(&mut self, cars: &Cars<'_>) {
        let (state, parameters) = (&self.state, &self.parameters);
        let rate_per_s = state.rate.per_second();
        let time_to_empty_s = time_to_empty_s(f64::from(state.treats), rate_per_s);
        let time_to_refill_s = self.time_to_refill_s(cars);
        self.state.measures = Measures {
            rate_per_s,
            time_to_empty_s,
            time_to_refill_s,
            need_ratio: need_ratio(time_to_refill_s, time_to_empty_s, rate_per_s),
            exchange_is_over: self.behavior() == Behavior::Exchange
                && self.bsg.has_lasted(parameters.exchange_s),
        };
    }

    /// How long until the refiller can be here: straight, or by way of her table where she first has to go home.
    fn time_to_refill_s(&self, cars: &Cars<'_>) -> f64 {
        let (state, parameters) = (&self.state, &self.parameters);
        let refiller = state.refiller.behavior(parameters.query_stale_s);
        let is_busy = matches!(refiller, Some("EXCHANGE" | "AWAIT_GO_HOME" | "GO_HOME"));
        if is_busy && let (Some(place), Some(table)) = (state.refiller.place(), self.table()) {
            let (to_m, from_m) = (place.distance_m(table), table.distance_m(state.at));
            let (reload_s, speed_mps) = (parameters.reload_s, parameters.v_refill_mps);
            return time_to_arrive_by_depot_s(to_m, reload_s, from_m, speed_mps);
        }
        let reach_m = parameters.exchange_radius_m;
        let straight_s = state.approach.arrival_s(reach_m);
        straight_s.unwrap_or_else(|| {
            // Nothing was ever known of her: she may be at her table, or else anywhere on the field [I].
            let [width_m, height_m] = cars.welcome().field_m;
            let farthest_m = (width_m * width_m + height_m * height_m).sqrt();
            let away_m = self
                .table()
                .map_or(farthest_m, |table| table.distance_m(state.at));
            time_to_arrive_s(
                away_m - reach_m,
                state
                    .approach
                    .speed_mps()
                    .max(parameters.approach.floor_mps),
            )
        })
    }

    /// Where the refiller's table is: as he was told, or where he first knew her to be.
    fn table(&self) -> Option<Point> {
        let told = self.parameters.table.map(|[x, y]| Point::new(x, y));
        told.or(self.state.table)
            .or(self.state.refiller.first_place())
    }

    fn context(&self, cars: &Cars<'_>) -> Context {
        let (state, parameters) = (&self.state, &self.parameters);
        let acts_by_emotion = parameters.acts_by_emotion();
        let stale_s = parameters.query_stale_s;
        let refiller = state.refiller.behavior(stale_s);
        // She may see the two of them meet a tick before he does, and then already exchanges.
        let is_ready = state.refiller.is_unknown(stale_s)
            || matches!(refiller, Some("WAIT" | "REFILL" | "EXCHANGE"));
        let radius_m = parameters.exchange_radius_m;
        let is_here = state
            .refiller
            .is_within(radius_m, state.at, cars.welcome().sensing_range_m);
        let is_due = |since_s: f64| parameters.resend.is_on() && since_s >= parameters.resend_s;
        Context {
            emotion: acts_by_emotion.then(|| self.feeling().emotion),
            is_pressed: !acts_by_emotion && self.pressure() >= parameters.dynamics.th_confident,
            need: state.need,
            called: state.called,
            hurried: state.hurried,
            refiller_is_ready_here: is_here && is_ready,
            refiller_comes: refiller == Some("REFILL"),
            intercept_any: parameters.intercept_any,
            exchange_is_over: state.measures.exchange_is_over,
            is_at_start: state.at.distance_m(state.start) <= parameters.arrive_m,
            repeats_call: is_due(state.since_call_s) && state.need && refiller == Some("WAIT"),
            repeats_go_home: is_due(state.since_go_home_s) && refiller == Some("AWAIT_GO_HOME"),
            has_joke: state.until_joke_s <= 0.0,
        }
    }

    /// The need as his emotion would take it in: with his gain, saturated.
    fn pressure(&self) -> f64 {
        let dynamics = &self.parameters.dynamics;
        let need = self.state.measures.need_ratio;
        Intensity::saturating(dynamics.gain(self.parameters.caution) * need / dynamics.rho_max)
            .value()
    }

    fn perform(&mut self, act: Act, cars: &mut Cars<'_>) {
        match act {
            Act::RaiseNeed => self.state.need = true,
            Act::CallRefill => {
                (self.state.called, self.state.since_call_s) = (true, 0.0);
                self.say_to_refiller(REFILL, cars);
            }
            Act::CallHurry => {
                (
                    self.state.called,
                    self.state.hurried,
                    self.state.since_call_s,
                ) = (true, true, 0.0);
                self.say_to_refiller(HURRY, cars);
            }
            Act::SendHome => {
                self.state.since_go_home_s = 0.0;
                self.say_to_refiller(GO_HOME, cars);
            }
            Act::Replenish => self.state.replenish(self.parameters.treat_capacity),
            Act::Joke => {
                let state = &mut self.state;
                cars.log(format!("jokes: {}", JOKES[state.jokes.one_of(JOKES.len())]));
                state.until_joke_s = state.jokes.exponential(self.parameters.joke_mean_s);
            }
        }
    }

    fn say_to_refiller(&mut self, command: &str, cars: &mut Cars<'_>) {
        // A refiller who is not in the roster was already complained about; there is nobody to send to.
        if cars
            .set_robot_command(&self.parameters.refiller, command)
            .is_ok()
        {
            self.state.messages += 1;
        }
    }

    /// Where to look for the refiller: where she was last known to be, and then at her table, to which she returns. `None`
    /// if nothing was ever known of her.
    fn quarry(&self) -> Option<Point> {
        let refiller = &self.state.refiller;
        if refiller.is_missing() {
            self.table()
        } else {
            refiller.place().or(self.table())
        }
    }

    /// Whether the refiller is known to have something else to do than to come.
    fn refiller_is_busy(&self) -> bool {
        let refiller = self.state.refiller.behavior(self.parameters.query_stale_s);
        matches!(refiller, Some("AWAIT_GO_HOME" | "GO_HOME"))
    }

    fn intercept(&mut self, cars: &mut Cars<'_>) -> Point {
        let (parameters, at) = (&self.parameters, self.state.at);
        let speed_mps = parameters.v_intercept_mps;
        // Who comes too near to a refiller on her way home stands in her way.
        let is_busy = self.refiller_is_busy();
        let stop_m = if is_busy {
            parameters.leave_room_m
        } else {
            parameters.stand_off_m
        };
        let Some(goal) = self.quarry() else {
            let State { legs, turns, .. } = &mut self.state;
            return legs.walk(cars, at, speed_mps, self.parameters.turn_mean_s, turns);
        };
        let course = Course {
            goal,
            stop_m,
            speed_mps,
            look_s: parameters.look_s,
        };
        self.state.legs.drive(cars, at, course)
    }
}

impl Robot for Butler {
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let bad = |reason| BadParameters {
            robot: cars.name().clone(),
            reason,
        };
        *self = Self::new(cars.parameters()?).map_err(bad)?;
        self.state.begin(&self.parameters, cars);
        let refiller = &self.parameters.refiller;
        if !cars
            .welcome()
            .roster
            .iter()
            .any(|robot| robot.as_str() == refiller)
        {
            cars.log(format!(
                "error: no robot is called {refiller}; nobody will refill the tray"
            ));
        }
        Ok(())
    }

    fn speed(&self) -> f64 {
        self.state.legs.speed_mps()
    }

    fn direction(&self) -> f64 {
        self.state.legs.direction_rad()
    }

    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        let tick_s = cars.tick_s();
        self.bsg.advance(tick_s);
        self.state.pass(tick_s);
        self.serve(tick_s);
        self.watch_refiller(cars);
        self.measure(cars);
    }

    fn state_variables(&self) -> StateVariables {
        self.state
            .published(self.feeling().intensity, self.behavior())
    }

    fn current_location(&self) -> Point {
        self.state.at
    }

    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
        let (behavior, parameters) = (self.behavior(), &self.parameters);
        let State {
            legs,
            turns,
            at,
            start,
            ..
        } = &mut self.state;
        match behavior {
            Behavior::Serve => legs.walk(
                cars,
                *at,
                parameters.v_serve_mps,
                parameters.turn_mean_s,
                turns,
            ),
            Behavior::Intercept => self.intercept(cars),
            Behavior::Exchange => legs.stay(*at),
            Behavior::GoBack => {
                let (speed_mps, look_s) = (parameters.v_goback_mps, parameters.look_s);
                legs.drive(
                    cars,
                    *at,
                    Course {
                        goal: *start,
                        stop_m: 0.0,
                        speed_mps,
                        look_s,
                    },
                )
            }
        }
    }

    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) {
        self.state.at = location;
    }

    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
        cars.log(format!(
            "takes no commands, not even {:?} from {from}",
            shortened(command)
        ));
    }

    fn update_emotion_state(&mut self, cars: &mut Cars<'_>) {
        if self.parameters.affect.is_on() {
            self.esg
                .update(&self.state.measures, self.bsg.current(), cars.tick_s());
        }
        self.state.remember(self.esg.feeling());
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
        let (state, goods) = (&self.state, self.parameters.goods.as_str());
        let amount = format!("{} {goods}", state.treats);
        let circumstances = Circumstances {
            other: Some(&self.parameters.refiller),
            goal: Some(&self.parameters.goal),
            amount: Some(&amount),
            valence: None,
        };
        let feeling = self.parameters.affect.is_on().then(|| self.feeling());
        let mut widgets = panel::feeling(
            feeling,
            &self.parameters.dynamics.label_cuts,
            &circumstances,
        );
        widgets.push(panel::behavior(self.behavior().name()));
        let (value, max) = (
            f64::from(state.treats),
            f64::from(self.parameters.treat_capacity),
        );
        widgets.push(Widget::Bar {
            label: goods.to_owned(),
            value,
            min: 0.0,
            max,
        });
        widgets.push(Widget::Sparkline {
            label: "intensity".to_owned(),
            values: state.intensities.iter().copied().collect(),
        });
        widgets.push(panel::table(&[
            (
                "time to empty",
                panel::seconds(state.measures.time_to_empty_s),
            ),
            (
                "time to refill",
                panel::seconds(state.measures.time_to_refill_s),
            ),
            ("need ratio", format!("{:.2}", state.measures.need_ratio)),
            ("refiller", self.parameters.refiller.clone()),
            (
                "called, hurried",
                format!(
                    "{}, {}",
                    panel::yes(state.called),
                    panel::yes(state.hurried)
                ),
            ),
            (
                "served, missed",
                format!("{}, {}", state.served, state.missed),
            ),
            ("exchanges", state.exchanges.to_string()),
        ]));
        Panel { widgets }
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        self.state.take_over(last, self.parameters.treat_capacity);
        // An exchange cannot be resumed in the middle; its need is still there, and she may still be near.
        let was_going_back = last.get("behavior").and_then(|name| name.as_str()) == Some("GO_BACK");
        let behavior = if was_going_back {
            Behavior::GoBack
        } else {
            Behavior::Serve
        };
        self.bsg = BehaviorGenerator::new(TABLE, behavior);
        cars.log("is back, and takes over where the last one was lost");
    }
}
