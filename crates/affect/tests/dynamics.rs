//! The rules of the dynamics, one by one, and what must hold under any input.

#![expect(
    clippy::unwrap_used,
    reason = "helpers of tests, where a panic is the failure"
)]

use affect::StandardEmotion::{
    Angry, Concerned, Confident, Discouraged, Frustrated, Happy, Hopeful,
};
use affect::{
    Belief, Caution, Drive, Dynamics, DynamicsParameters, EmotionState, Intensity, Ladder,
    ProgressEvent, StandardEmotion, StateSet, Stimulus, Trend,
};
use proptest::prelude::*;

const DT_S: f64 = 0.5;

fn dynamics(state_set: StateSet) -> Dynamics<StandardEmotion> {
    let parameters = DynamicsParameters {
        state_set,
        ..Default::default()
    };
    Dynamics::standard(&parameters, Caution::default()).unwrap()
}

struct Robot {
    dynamics: Dynamics<StandardEmotion>,
    state: EmotionState<StandardEmotion>,
}

impl Robot {
    fn new(state_set: StateSet) -> Self {
        let dynamics = dynamics(state_set);
        let state = dynamics.start();
        Self { dynamics, state }
    }

    fn step(&mut self, stimulus: Stimulus) -> StandardEmotion {
        self.dynamics.step(&mut self.state, &stimulus, DT_S);
        self.state.feeling().emotion
    }

    /// Steps for `seconds` and gives every emotion that was entered.
    fn entered(&mut self, stimulus: Stimulus, seconds: f64) -> Vec<StandardEmotion> {
        let mut entered = Vec::new();
        for _ in 0..(seconds / DT_S) as u32 {
            let before = self.state.feeling().emotion;
            if self.step(stimulus) != before {
                entered.push(self.state.feeling().emotion);
            }
        }
        entered
    }

    fn intensity(&self) -> f64 {
        self.state.feeling().intensity.value()
    }
}

fn importance(value: f64) -> Intensity {
    Intensity::new(value).unwrap()
}

#[test]
fn positive_input_keeps_happy_and_negative_leads_to_frustrated() {
    let mut robot = Robot::new(StateSet::Murphy4);
    assert_eq!(robot.entered(Stimulus::need(0.1), 60.0), []);
    assert_eq!(
        robot.entered(Stimulus::need(9.0), 60.0),
        [Confident, Concerned, Frustrated]
    );
    assert_eq!(
        robot.entered(Stimulus::rest(), 60.0),
        [Concerned, Confident, Happy]
    );
}

#[test]
fn the_filter_rises_with_caution_and_falls_without() {
    let parameters = DynamicsParameters::default();
    let share = |seconds: f64| 1.0 - libm::exp(-DT_S / seconds);
    for (caution, gain) in [(0.0, 0.5), (1.0, 1.5)] {
        let dynamics = Dynamics::standard(&parameters, Caution::new(caution).unwrap()).unwrap();
        let mut state = dynamics.start();
        dynamics.step(&mut state, &Stimulus::need(1.0), DT_S);
        let risen = gain * 0.5 * share(1.5 / gain);
        assert_eq!(state.feeling().intensity.value(), risen);
        dynamics.step(&mut state, &Stimulus::rest(), DT_S);
        assert!((state.feeling().intensity.value() - risen * (1.0 - share(3.0))).abs() < 1e-15);
    }
}

#[test]
fn without_a_measure_intensity_stays() {
    let mut robot = Robot::new(StateSet::Murphy4);
    robot.entered(Stimulus::need(1.0), 5.0);
    let before = robot.state.feeling();
    for stimulus in [Stimulus::new(Drive::Hold), Stimulus::need(f64::NAN)] {
        assert_eq!(robot.entered(stimulus, 5.0), []);
        assert_eq!(robot.state.feeling(), before);
    }
    robot.entered(Stimulus::need(f64::INFINITY), 60.0);
    assert!(robot.intensity() > 0.999);
}

#[test]
fn t18_a_positive_input_leads_back_as_far_as_it_is_important() {
    for (value, expected) in [
        (0.1, Frustrated),
        (0.4, Concerned),
        (0.7, Confident),
        (0.9, Happy),
    ] {
        let mut robot = Robot::new(StateSet::Murphy4);
        robot.entered(Stimulus::need(9.0), 60.0);
        let event = ProgressEvent::Positive(importance(value));
        let emotion = robot.step(Stimulus::new(Drive::Hold).with_event(Some(event)));
        assert_eq!(
            emotion,
            expected,
            "importance {value}, intensity {}",
            robot.intensity()
        );
    }
}

#[test]
fn a_setback_counts_with_the_gain() {
    let mut robot = Robot::new(StateSet::Murphy4);
    let event = ProgressEvent::Negative(importance(0.3));
    robot.step(Stimulus::new(Drive::Hold).with_event(Some(event)));
    assert_eq!(robot.intensity(), 0.3);
}

#[test]
fn an_achieved_goal_makes_happy_at_once() {
    let mut robot = Robot::new(StateSet::Murphy4);
    while robot.step(Stimulus::need(9.0)) != Frustrated {}
    // Not even the dwell time holds it back.
    let emotion = robot.step(Stimulus::need(9.0).with_event(Some(ProgressEvent::GoalAchieved)));
    assert_eq!((emotion, robot.intensity()), (Happy, 0.0));
    assert_eq!(robot.step(Stimulus::need(9.0)), Happy);
}

#[test]
fn anger_needs_extreme_intensity_for_long_and_somebody_to_blame() {
    let blaming = Stimulus::need(9.0).with_blame(true);
    let mut robot = Robot::new(StateSet::Akr4);
    assert_eq!(
        robot.entered(Stimulus::need(9.0), 120.0),
        [Concerned, Frustrated]
    );
    assert_eq!(robot.entered(blaming, 14.5), []);
    assert_eq!(robot.entered(Stimulus::need(9.0), 0.5), []); // the blame ends: time starts anew
    assert_eq!(robot.entered(blaming, 14.5), []);
    assert_eq!(robot.entered(blaming, 0.5), [Angry]);
    assert_eq!(
        robot.entered(Stimulus::rest(), 120.0),
        [Frustrated, Concerned, Happy]
    );
    // murphy4 has no anger at all.
    assert!(
        !Robot::new(StateSet::Murphy4)
            .entered(blaming, 600.0)
            .contains(&Angry)
    );
}

#[test]
fn anger_begins_anew_after_another_emotion() {
    let blaming = Stimulus::need(9.0).with_blame(true);
    let mut robot = Robot::new(StateSet::Akr4);
    while robot.step(blaming) != Frustrated {}
    robot.entered(blaming, 14.0);
    assert_eq!(
        robot.entered(blaming.with_belief(Belief::Cannot), 1.0),
        [Discouraged]
    );
    assert_eq!(robot.step(blaming.with_belief(Belief::Can)), Hopeful);
    while robot.step(blaming) != Frustrated {}
    assert_eq!(robot.entered(blaming, 14.5), []);
    assert_eq!(robot.entered(blaming, 0.5), [Angry]);
}

#[test]
fn t19_cannot_keeps_discouraged_and_can_gives_hope() {
    for state_set in [StateSet::Murphy4, StateSet::Akr4] {
        let mut robot = Robot::new(state_set);
        robot.entered(Stimulus::need(9.0), 60.0);
        assert_eq!(
            robot.entered(Stimulus::need(9.0).with_belief(Belief::Cannot), 5.0),
            [Discouraged]
        );
        // For ever, whatever happens outside.
        let achieved = Stimulus::rest().with_event(Some(ProgressEvent::GoalAchieved));
        assert_eq!(robot.entered(achieved, 3600.0), []);
        assert_eq!(robot.entered(Stimulus::need(9.0), 3600.0), []);
        assert_eq!(
            robot.entered(Stimulus::rest().with_belief(Belief::Unstated), 60.0),
            []
        );
        assert_eq!(
            robot.step(Stimulus::rest().with_belief(Belief::Can)),
            Hopeful
        );
        assert_eq!(robot.state.belief(), Belief::Can);
    }
}

#[test]
fn cannot_discourages_only_who_is_frustrated() {
    let mut robot = Robot::new(StateSet::Murphy4);
    assert_eq!(
        robot.entered(Stimulus::need(1.2).with_belief(Belief::Cannot), 60.0),
        [Confident, Concerned]
    );
    assert_eq!(
        robot.entered(Stimulus::need(9.0), 60.0),
        [Frustrated, Discouraged]
    );
}

#[test]
fn hope_ends_with_success_with_doubt_or_with_time() {
    let hopeful = || {
        let mut robot = Robot::new(StateSet::Murphy4);
        robot.entered(Stimulus::need(9.0).with_belief(Belief::Cannot), 60.0);
        robot.step(Stimulus::need(9.0).with_belief(Belief::Can));
        assert_eq!(robot.state.feeling().emotion, Hopeful);
        robot
    };
    let achieved = Stimulus::need(9.0).with_event(Some(ProgressEvent::GoalAchieved));
    assert_eq!(hopeful().step(achieved), Happy);
    assert_eq!(
        hopeful().entered(Stimulus::need(9.0).with_belief(Belief::Cannot), 5.0),
        [Discouraged]
    );
    let mut robot = hopeful();
    assert_eq!(robot.entered(Stimulus::need(9.0), 14.5), []);
    assert_eq!(robot.entered(Stimulus::need(9.0), 0.5), [Concerned]);
    let mut robot = hopeful();
    assert_eq!(robot.entered(Stimulus::rest(), 15.0), [Happy]);
}

#[test]
fn a_state_of_another_ladder_finds_its_place() {
    let other = Robot::new(StateSet::Murphy4);
    let mut robot = Robot::new(StateSet::Akr4);
    robot.state = other.state;
    robot.entered(Stimulus::need(9.0), 2.0);
    let json = r#"{"emotion":"CONFIDENT","intensity":0.5,"unchanged_s":0.0,"pressing_s":0.0,"belief":"unstated"}"#;
    robot.state = serde_json::from_str(json).unwrap();
    assert!(!robot.dynamics.accepts(&robot.state));
    assert_eq!(robot.step(Stimulus::new(Drive::Hold)), Concerned);
    let wrong = json.replace("0.5", "1.5");
    assert!(serde_json::from_str::<EmotionState<StandardEmotion>>(&wrong).is_err());
}

#[test]
fn progress_is_positive_or_negative_by_what_is_felt() {
    let mut robot = Robot::new(StateSet::Murphy4);
    assert_eq!(
        robot.dynamics.trend(&robot.state, Drive::Need(1.0)),
        Trend::Negative
    );
    assert_eq!(
        robot.dynamics.trend(&robot.state, Drive::Rest),
        Trend::Level
    );
    robot.entered(Stimulus::need(1.0), 5.0);
    assert_eq!(
        robot.dynamics.trend(&robot.state, Drive::Need(0.1)),
        Trend::Positive
    );
    assert_eq!(
        robot.dynamics.trend(&robot.state, Drive::Hold),
        Trend::Level
    );
}

fn rung(ladder: &Ladder<StandardEmotion>, emotion: StandardEmotion) -> usize {
    ladder
        .rungs()
        .iter()
        .position(|rung| rung.emotion == emotion)
        .unwrap()
}

/// Any course of needs, rests and events, with somebody to blame now and then.
fn any_course() -> impl Strategy<Value = Vec<Stimulus>> {
    let event = prop_oneof![
        8 => Just(None),
        1 => (0.0..=1.0).prop_map(|value| Some(ProgressEvent::Positive(Intensity::saturating(value)))),
        1 => (0.0..=1.0).prop_map(|value| Some(ProgressEvent::Negative(Intensity::saturating(value)))),
        1 => Just(Some(ProgressEvent::GoalAchieved)),
    ];
    let stimulus = (0.0..8.0, event, any::<bool>())
        .prop_map(|(need, event, blame)| Stimulus::need(need).with_event(event).with_blame(blame));
    // Each stimulus lasts for a while, so that the filter gets somewhere.
    prop::collection::vec((stimulus, 1_usize..12), 1..60).prop_map(|spans| {
        spans
            .into_iter()
            .flat_map(|(stimulus, n)| std::iter::repeat_n(stimulus, n))
            .collect()
    })
}

fn any_set() -> impl Strategy<Value = StateSet> {
    prop_oneof![Just(StateSet::Murphy4), Just(StateSet::Akr4)]
}

proptest! {
    /// No up-move skips a rung; every move but an achieved goal waits for the dwell time and respects the
    /// thresholds with their hysteresis.
    #[test]
    fn moves_follow_the_ladder(course in any_course(), state_set in any_set(), dt_s in 0.05..1.0) {
        let dynamics = dynamics(state_set);
        let (ladder, parameters) = (dynamics.ladder(), dynamics.parameters());
        let mut state = dynamics.start();
        for stimulus in course {
            let before = state.clone();
            dynamics.step(&mut state, &stimulus, dt_s);
            let intensity = state.feeling().intensity.value();
            let from = rung(ladder, before.feeling().emotion);
            let to = rung(ladder, state.feeling().emotion);
            if stimulus.event == Some(ProgressEvent::GoalAchieved) {
                prop_assert_eq!((to, intensity), (0, 0.0));
                continue;
            }
            if from == to {
                continue;
            }
            prop_assert!(before.unchanged_s() + dt_s + 1e-9 >= parameters.dwell_s);
            prop_assert!(to <= from + 1, "skipped from {} to {}", from, to);
            if to > from {
                prop_assert!(intensity >= ladder.rungs()[to].enter);
            } else {
                prop_assert!(intensity < ladder.rungs()[to + 1].enter - parameters.hysteresis);
            }
        }
    }

    /// An intensity that swings by less than the hysteresis around a threshold changes the emotion once.
    #[test]
    fn a_small_swing_does_not_flap(
        swings in prop::collection::vec(-1.0_f64..1.0, 1..200),
        index in 1_usize..4,
    ) {
        let dynamics = dynamics(StateSet::Murphy4);
        let enter = dynamics.ladder().rungs()[index].enter;
        let mut state = dynamics.start();
        // Climb to the threshold and settle a little above it; gain is 1, so need = intensity * rho_max.
        for _ in 0..200 {
            dynamics.step(&mut state, &Stimulus::need((enter + 0.01) * 2.0), DT_S);
        }
        prop_assert_eq!(rung(dynamics.ladder(), state.feeling().emotion), index);
        for swing in swings {
            dynamics.step(&mut state, &Stimulus::need((enter + 0.039 * swing) * 2.0), DT_S);
            prop_assert_eq!(rung(dynamics.ladder(), state.feeling().emotion), index);
        }
    }

    /// For one and the same course of need, a more cautious robot never feels less while need grows.
    #[test]
    fn t04_caution_never_slows_the_rise(low in 0.0..1.0, high in 0.0..1.0, slope in 0.01..1.0) {
        let (low, high) = if low <= high { (low, high) } else { (high, low) };
        let parameters = DynamicsParameters::default();
        let make = |caution| Dynamics::standard(&parameters, Caution::saturating(caution)).unwrap();
        let (calm, anxious) = (make(low), make(high));
        let (mut calm_state, mut anxious_state) = (calm.start(), anxious.start());
        for tick in 0..100 {
            let stimulus = Stimulus::need(slope * f64::from(tick) * DT_S);
            calm.step(&mut calm_state, &stimulus, DT_S);
            anxious.step(&mut anxious_state, &stimulus, DT_S);
            let intensity = |state: &EmotionState<StandardEmotion>| state.feeling().intensity.value();
            prop_assert!(intensity(&anxious_state) >= intensity(&calm_state) - 1e-12);
        }
    }

    /// Whatever the moment, what was written down and read again continues identically.
    #[test]
    fn t23_a_saved_state_continues(course in any_course(), cut in 0.0..1.0, state_set in any_set()) {
        let dynamics = dynamics(state_set);
        let cut = (course.len() as f64 * cut) as usize;
        let mut state = dynamics.start();
        for stimulus in &course[..cut] {
            dynamics.step(&mut state, stimulus, DT_S);
        }
        let text = serde_json::to_string(&state).unwrap();
        let mut restored: EmotionState<StandardEmotion> = serde_json::from_str(&text).unwrap();
        for stimulus in &course[cut..] {
            dynamics.step(&mut state, stimulus, DT_S);
            dynamics.step(&mut restored, stimulus, DT_S);
            prop_assert_eq!(&restored, &state);
        }
    }
}
