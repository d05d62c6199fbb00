//! Each rule of the dynamics, and the invariants that hold for any input.

use affect::StandardEmotion::{
    Angry, Concerned, Confident, Discouraged, Frustrated, Happy, Hopeful,
};
use affect::{
    Belief, Caution, Dynamics, DynamicsParameters, EmotionState, Feeling, Ladder, MoodParameters,
    ProgressEvent, Rung, StandardEmotion, StateSet, StepInput, Stimulus, Urgency,
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
        Self::with_dynamics(dynamics(state_set))
    }

    fn with_caution(caution: f64) -> Self {
        let parameters = DynamicsParameters::default();
        let caution = Caution::saturating(caution);

        Self::with_dynamics(Dynamics::standard(&parameters, caution).unwrap())
    }

    fn with_dynamics(dynamics: Dynamics<StandardEmotion>) -> Self {
        let state = dynamics.start();

        Self { dynamics, state }
    }

    fn step(&mut self, stimulus: Stimulus) -> StandardEmotion {
        self.dynamics.step(&mut self.state, &stimulus, DT_S);
        self.state.feeling().emotion
    }

    /// Steps for `seconds` and returns the emotions that were entered.
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

    fn urgency(&self) -> f64 {
        self.state.feeling().urgency.value()
    }
}

fn importance(value: f64) -> Urgency {
    Urgency::new(value).unwrap()
}

#[test]
fn positive_input_keeps_happy_and_negative_leads_to_frustrated() {
    let mut robot = Robot::new(StateSet::Murphy4);
    assert_eq!(robot.entered(Stimulus::need(0.1), 60.0), []);
    assert_eq!(
        robot.entered(Stimulus::need(9.0), 60.0),
        [Confident, Concerned, Frustrated]
    );
    assert_eq!(robot.entered(Stimulus::rest(), 60.0), []);
    assert_eq!(
        robot.entered(easing(StepInput::Rest), 60.0),
        [Concerned, Confident, Happy]
    );
}

/// A drive that falls because of progress.
fn easing(drive: StepInput) -> Stimulus {
    Stimulus::new(drive).with_event(Some(ProgressEvent::Easing))
}

#[test]
fn frustration_without_a_positive_input_does_not_end() {
    let mut robot = Robot::new(StateSet::Murphy4);
    robot.entered(Stimulus::need(9.0), 60.0);
    assert_eq!(robot.entered(Stimulus::rest(), 3600.0), []);

    // It is felt less: down to where it would be left.
    assert_eq!(robot.urgency(), 0.75 - 0.08);
    assert_eq!(robot.state.progress(), None);
}

#[test]
fn after_frustration_the_way_down_ends_where_the_importance_ends() {
    for (value, expected) in [
        (0.2, vec![]),
        (0.4, vec![Concerned]),
        (0.7, vec![Confident, Happy]),
    ] {
        let mut robot = Robot::new(StateSet::Murphy4);
        robot.entered(Stimulus::need(9.0), 60.0);
        let event = Some(ProgressEvent::Positive(importance(value)));
        let mut entered = robot.entered(Stimulus::rest().with_event(event), DT_S);
        entered.extend(robot.entered(Stimulus::rest(), 600.0));
        assert_eq!(entered, expected, "importance {value}");
    }
}

#[test]
fn concern_that_was_no_frustration_ends_by_itself() {
    let mut robot = Robot::new(StateSet::Murphy4);
    robot.entered(Stimulus::need(1.2), 60.0);
    assert_eq!(robot.entered(Stimulus::rest(), 60.0), [Confident, Happy]);
}

#[test]
fn easing_is_progress_only_where_the_pressure_is_below_the_urgency() {
    let mut robot = Robot::new(StateSet::Murphy4);
    let pressure = |value: f64| StepInput::Pressure(importance(value));
    robot.step(easing(pressure(0.5)));
    let signed = |robot: &Robot| {
        robot
            .state
            .progress()
            .map(|progress| (progress.signed, progress.is_event))
    };
    assert_eq!(signed(&robot), Some((-0.5, false)));

    robot.entered(Stimulus::new(pressure(1.0)), 60.0);
    robot.step(easing(pressure(0.25)));
    assert_eq!(signed(&robot), Some((0.75, true)));
    // What follows without progress goes no further than it led.
    robot.entered(Stimulus::rest(), 60.0);
    assert_eq!(
        robot.state.feeling().emotion,
        Happy,
        "CONFIDENT is pleasant, and frees it"
    );

    let mut robot = Robot::new(StateSet::Murphy4);
    robot.entered(Stimulus::new(pressure(1.0)), 60.0);
    robot.step(easing(pressure(0.5)));
    robot.entered(Stimulus::rest(), 60.0);
    assert_eq!(
        (robot.state.feeling().emotion, robot.urgency()),
        (Concerned, 0.5)
    );
}

#[test]
fn who_takes_over_an_unpleasant_emotion_needs_a_positive_input() {
    for (emotion, urgency, keeps) in [
        (Happy, 0.1, false),
        (Concerned, 0.5, true),
        (Frustrated, 0.9, true),
        (Discouraged, 0.9, true),
    ] {
        let mut robot = Robot::new(StateSet::Murphy4);
        let feeling = Feeling {
            emotion,
            urgency: importance(urgency),
        };
        robot.state = robot.dynamics.taken_over(feeling);
        assert!(robot.dynamics.accepts(&robot.state));
        assert_eq!(robot.state.feeling(), feeling);

        robot.entered(Stimulus::rest(), 60.0);
        let negative = robot.state.feeling().affect().signed() < 0.0;
        assert_eq!(negative, keeps, "{emotion:?}");
    }

    let akr4 = dynamics(StateSet::Akr4);
    let confident = Feeling {
        emotion: Confident,
        urgency: importance(0.3),
    };
    assert_eq!(akr4.taken_over(confident), akr4.start());
}

#[test]
fn the_filter_rises_with_the_gain_and_falls_without_it() {
    let parameters = DynamicsParameters::default();

    for (caution, gain) in [(0.0, 0.5), (1.0, 1.5)] {
        let dynamics = Dynamics::standard(&parameters, Caution::new(caution).unwrap()).unwrap();
        let mut state = dynamics.start();

        dynamics.step(&mut state, &Stimulus::need(1.0), DT_S);
        let risen = gain * 0.5 * filter_share(1.5 / gain);
        assert_eq!(state.feeling().urgency.value(), risen);

        dynamics.step(&mut state, &Stimulus::rest(), DT_S);
        let fallen = risen * (1.0 - filter_share(3.0));
        assert!((state.feeling().urgency.value() - fallen).abs() < 1e-15);
    }
}

/// The share of the remaining difference that a filter covers in one step.
fn filter_share(tau_s: f64) -> f64 {
    1.0 - libm::exp(-DT_S / tau_s)
}

#[test]
fn urgency_does_not_change_without_a_measure() {
    let mut robot = Robot::new(StateSet::Murphy4);
    robot.entered(Stimulus::need(1.0), 5.0);
    let before = robot.state.feeling();

    for stimulus in [Stimulus::new(StepInput::Hold), Stimulus::need(f64::NAN)] {
        assert_eq!(robot.entered(stimulus, 5.0), []);
        assert_eq!(robot.state.feeling(), before);
    }

    robot.entered(Stimulus::need(f64::INFINITY), 60.0);
    assert!(robot.urgency() > 0.999);
}

#[test]
fn t18_a_positive_input_leads_back_by_its_importance() {
    for (value, expected) in [
        (0.1, Frustrated),
        (0.4, Concerned),
        (0.7, Confident),
        (0.9, Happy),
    ] {
        let mut robot = Robot::new(StateSet::Murphy4);
        robot.entered(Stimulus::need(9.0), 60.0);

        let event = ProgressEvent::Positive(importance(value));
        let emotion = robot.step(Stimulus::new(StepInput::Hold).with_event(Some(event)));

        assert_eq!(
            emotion,
            expected,
            "importance {value}, urgency {}",
            robot.urgency()
        );
    }
}

#[test]
fn a_setback_is_multiplied_by_the_gain() {
    let mut robot = Robot::new(StateSet::Murphy4);
    let event = ProgressEvent::Negative(importance(0.3));
    robot.step(Stimulus::new(StepInput::Hold).with_event(Some(event)));
    assert_eq!(robot.urgency(), 0.3);
}

#[test]
fn an_achieved_goal_leads_to_happy_immediately() {
    let mut robot = Robot::new(StateSet::Murphy4);
    while robot.step(Stimulus::need(9.0)) != Frustrated {}

    // The dwell time does not delay it.
    let emotion = robot.step(Stimulus::need(9.0).with_event(Some(ProgressEvent::GoalAchieved)));
    assert_eq!((emotion, robot.urgency()), (Happy, 0.0));
    assert_eq!(robot.step(Stimulus::need(9.0)), Happy);
}

#[test]
fn anger_needs_lasting_extreme_urgency_and_an_agent_to_blame() {
    let blaming = Stimulus::need(9.0).with_blame(true);
    let mut robot = Robot::new(StateSet::Akr4);
    assert_eq!(
        robot.entered(Stimulus::need(9.0), 120.0),
        [Concerned, Frustrated]
    );

    assert_eq!(robot.entered(blaming, 14.5), []);
    // Without blame, the time starts over.
    assert_eq!(robot.entered(Stimulus::need(9.0), 0.5), []);
    assert_eq!(robot.entered(blaming, 14.5), []);
    assert_eq!(robot.entered(blaming, 0.5), [Angry]);
    assert_eq!(robot.entered(Stimulus::rest(), 120.0), [Frustrated]);
    assert_eq!(
        robot.entered(easing(StepInput::Rest), 120.0),
        [Concerned, Happy]
    );

    // There is no anger in murphy4.
    let mut robot = Robot::new(StateSet::Murphy4);
    assert!(!robot.entered(blaming, 600.0).contains(&Angry));
}

#[test]
fn the_time_until_anger_starts_over_after_another_emotion() {
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
fn t19_discouragement_lasts_until_the_robot_believes_that_it_can() {
    for state_set in [StateSet::Murphy4, StateSet::Akr4] {
        let mut robot = Robot::new(state_set);
        robot.entered(Stimulus::need(9.0), 60.0);
        assert_eq!(
            robot.entered(Stimulus::need(9.0).with_belief(Belief::Cannot), 5.0),
            [Discouraged]
        );

        // External events have no effect.
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
fn only_a_frustrated_robot_becomes_discouraged() {
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
fn hope_ends_with_success_with_discouragement_or_with_time() {
    let achieved = Stimulus::need(9.0).with_event(Some(ProgressEvent::GoalAchieved));
    assert_eq!(hopeful_robot().step(achieved), Happy);

    let cannot = Stimulus::need(9.0).with_belief(Belief::Cannot);
    assert_eq!(hopeful_robot().entered(cannot, 5.0), [Discouraged]);

    let mut robot = hopeful_robot();
    assert_eq!(robot.entered(Stimulus::need(9.0), 14.5), []);
    assert_eq!(robot.entered(Stimulus::need(9.0), 0.5), [Concerned]);

    let mut robot = hopeful_robot();
    assert_eq!(robot.entered(Stimulus::rest(), 15.0), [Happy]);
}

fn hopeful_robot() -> Robot {
    let mut robot = Robot::new(StateSet::Murphy4);

    robot.entered(Stimulus::need(9.0).with_belief(Belief::Cannot), 60.0);
    robot.step(Stimulus::need(9.0).with_belief(Belief::Can));
    assert_eq!(robot.state.feeling().emotion, Hopeful);

    robot
}

#[test]
fn a_state_of_another_ladder_moves_to_a_rung() {
    let other = Robot::new(StateSet::Murphy4);
    let mut robot = Robot::new(StateSet::Akr4);
    robot.state = other.state;
    robot.entered(Stimulus::need(9.0), 2.0);

    let json = r#"{"emotion":"CONFIDENT","urgency":0.5,"floor":0.0,"progress":null,"unchanged_s":0.0,"pressing_s":0.0,"belief":"unstated","mood":0.0}"#;
    robot.state = serde_json::from_str(json).unwrap();
    assert!(!robot.dynamics.accepts(&robot.state));
    assert_eq!(robot.step(Stimulus::new(StepInput::Hold)), Concerned);

    let wrong = json.replace("0.5,", "1.5,");
    assert!(serde_json::from_str::<EmotionState<StandardEmotion>>(&wrong).is_err());
}

/// Dynamics with a mood of these constants that begins so.
fn moody(start: f64, tau_s: f64, weight: f64) -> Dynamics<StandardEmotion> {
    let mood = MoodParameters {
        start,
        tau_s,
        weight,
    };
    dynamics(StateSet::Murphy4).with_mood(mood).unwrap()
}

/// The feeling and the mood after some seconds of a need.
fn after(dynamics: &Dynamics<StandardEmotion>, need: f64, time_s: f64) -> (StandardEmotion, f64) {
    let mut state = dynamics.start();
    for _ in 0..(time_s / DT_S) as usize {
        dynamics.step(&mut state, &Stimulus::need(need), DT_S);
    }
    (state.feeling().emotion, state.mood())
}

#[test]
fn a_bad_mood_makes_the_same_need_worse_and_a_good_one_lighter() {
    let need = 0.8; // A pressure of 0.4: CONFIDENT.
    let never = 1e12;
    assert_eq!(after(&moody(0.0, never, 0.4), need, 60.0).0, Confident);
    assert_eq!(after(&moody(-1.0, never, 0.4), need, 60.0).0, Frustrated);
    assert_eq!(after(&moody(1.0, never, 0.4), need, 60.0).0, Happy);
    assert_eq!(
        after(&moody(-1.0, never, 0.0), need, 60.0).0,
        Confident,
        "no weight"
    );
}

#[test]
fn a_mood_follows_what_is_felt_and_an_achieved_goal_does_not_end_it() {
    let dynamics = moody(0.0, 300.0, 0.0);
    let (emotion, mood) = after(&dynamics, 9.0, 120.0);
    assert_eq!(emotion, Frustrated);
    assert!((-0.35..-0.25).contains(&mood), "{mood} after 120 s of 300");

    let mut state = dynamics.start().with_mood(mood);
    let goal = Stimulus::rest().with_event(Some(ProgressEvent::GoalAchieved));
    dynamics.step(&mut state, &goal, DT_S);
    assert_eq!(state.feeling().emotion, Happy);
    assert!(mood < state.mood() && state.mood() < mood + 0.01);
}

#[test]
fn moods_out_of_range_are_no_moods() {
    let state = dynamics(StateSet::Murphy4).start();
    for (given, mood) in [(2.0, 1.0), (-2.0, -1.0), (f64::NAN, 0.0), (0.3, 0.3)] {
        assert_eq!(state.clone().with_mood(given).mood(), mood);
    }

    let json = serde_json::to_string(&state).unwrap();
    let wrong = json.replace("\"mood\":0.0", "\"mood\":1.5");
    let wrong: EmotionState<StandardEmotion> = serde_json::from_str(&wrong).unwrap();
    assert!(!dynamics(StateSet::Murphy4).accepts(&wrong));
}

fn rung(ladder: &Ladder<StandardEmotion>, emotion: StandardEmotion) -> usize {
    ladder
        .rungs()
        .iter()
        .position(|rung| rung.emotion == emotion)
        .unwrap()
}

/// The first step of a course in which a pleasant emotion follows FRUSTRATED and no step between had a positive input.
fn first_groundless(dynamics: &Dynamics<StandardEmotion>, course: &[Stimulus]) -> Option<usize> {
    let mut state = dynamics.start();
    let mut owes = false;
    for (index, stimulus) in course.iter().enumerate() {
        let before = state.feeling().emotion;
        dynamics.step(&mut state, stimulus, DT_S);

        let progress = state.progress().map_or(0.0, |progress| progress.signed);
        owes &= progress <= 0.0;
        if owes && state.feeling().affect().signed() > 0.0 {
            return Some(index);
        }
        owes |= state.feeling().emotion == Frustrated && before != Frustrated;
    }
    None
}

/// The ladder of murphy4 whose FRUSTRATED ends by itself.
fn wrong_ladder() -> Dynamics<StandardEmotion> {
    let rungs = dynamics(StateSet::Murphy4).ladder().rungs().to_vec();
    let rungs = rungs.into_iter().map(|rung| Rung {
        needs_progress: false,
        ..rung
    });
    let ladder = Ladder::new(rungs.collect()).unwrap();
    Dynamics::new(ladder, &DynamicsParameters::default(), Caution::default()).unwrap()
}

#[test]
fn a_ladder_whose_frustration_ends_by_itself_is_found_out() {
    let mut course = vec![Stimulus::need(9.0); 40];
    course.extend([Stimulus::rest(); 40]);

    assert!(first_groundless(&wrong_ladder(), &course).is_some());
    assert_eq!(
        first_groundless(&dynamics(StateSet::Murphy4), &course),
        None
    );
}

/// Any sequence of needs and events, sometimes with an agent to blame.
fn any_course() -> impl Strategy<Value = Vec<Stimulus>> {
    let event = prop_oneof![
        8 => Just(None),
        1 => (0.0..=1.0).prop_map(|value| Some(ProgressEvent::Positive(Urgency::saturating(value)))),
        1 => (0.0..=1.0).prop_map(|value| Some(ProgressEvent::Negative(Urgency::saturating(value)))),
        1 => Just(Some(ProgressEvent::Easing)),
        1 => Just(Some(ProgressEvent::GoalAchieved)),
    ];
    let stimulus = (0.0..8.0, event, any::<bool>())
        .prop_map(|(need, event, blame)| Stimulus::need(need).with_event(event).with_blame(blame));

    // Each stimulus lasts for several steps, so that the filter makes progress.
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
    /// No move upward skips a rung. Every move except for an achieved goal waits for the dwell time and respects the
    /// thresholds and their hysteresis.
    #[test]
    fn moves_follow_the_ladder(course in any_course(), state_set in any_set(), dt_s in 0.05..1.0) {
        let dynamics = dynamics(state_set);
        let ladder = dynamics.ladder();
        let parameters = dynamics.parameters();

        let mut state = dynamics.start();
        for stimulus in course {
            let before = state.clone();
            dynamics.step(&mut state, &stimulus, dt_s);

            let urgency = state.feeling().urgency.value();
            let from = rung(ladder, before.feeling().emotion);
            let to = rung(ladder, state.feeling().emotion);
            if stimulus.event == Some(ProgressEvent::GoalAchieved) {
                prop_assert_eq!((to, urgency), (0, 0.0));
                continue;
            }
            if from == to {
                continue;
            }

            prop_assert!(before.unchanged_s() + dt_s + 1e-9 >= parameters.dwell_s);
            prop_assert!(to <= from + 1, "skipped from {} to {}", from, to);
            if to > from {
                prop_assert!(urgency >= ladder.rungs()[to].enter);
            } else {
                prop_assert!(urgency < ladder.rungs()[to + 1].enter - parameters.hysteresis);
            }
        }
    }

    /// Nothing but a positive input leads from FRUSTRATED to a pleasant emotion, by whatever way.
    #[test]
    fn frustration_ends_well_only_by_a_positive_input(course in any_course(), state_set in any_set()) {
        prop_assert_eq!(first_groundless(&dynamics(state_set), &course), None);
    }

    /// An urgency that oscillates around a threshold by less than the hysteresis changes the emotion once.
    #[test]
    fn small_oscillations_do_not_change_the_emotion(
        swings in prop::collection::vec(-1.0_f64..1.0, 1..200),
        index in 1_usize..4,
    ) {
        let dynamics = dynamics(StateSet::Murphy4);
        let enter = dynamics.ladder().rungs()[index].enter;
        let mut state = dynamics.start();

        // Settle slightly above the threshold. The gain is 1, so the need is the urgency times rho_max.
        for _ in 0..200 {
            dynamics.step(&mut state, &Stimulus::need((enter + 0.01) * 2.0), DT_S);
        }
        prop_assert_eq!(rung(dynamics.ladder(), state.feeling().emotion), index);

        for swing in swings {
            dynamics.step(&mut state, &Stimulus::need((enter + 0.039 * swing) * 2.0), DT_S);
            prop_assert_eq!(rung(dynamics.ladder(), state.feeling().emotion), index);
        }
    }

    /// While the same need grows, the urgency of a more cautious robot is never lower.
    #[test]
    fn t04_caution_never_slows_the_rise(low in 0.0..1.0, high in 0.0..1.0, slope in 0.01..1.0) {
        let mut calm = Robot::with_caution(f64::min(low, high));
        let mut anxious = Robot::with_caution(f64::max(low, high));

        for tick in 0..100 {
            let stimulus = Stimulus::need(slope * f64::from(tick) * DT_S);
            calm.step(stimulus);
            anxious.step(stimulus);

            prop_assert!(anxious.urgency() >= calm.urgency() - 1e-12);
        }
    }

    /// A state that is saved and restored at any time continues identically.
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
