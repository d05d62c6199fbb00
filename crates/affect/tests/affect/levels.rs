//! The sensory-motor and the conceptual level.

use affect::StandardEmotion::{self, Concerned, Frustrated, Happy};
use affect::akr::{ActionTendency, Affect, Personality, Preference, Valence};
use affect::levels::{
    ActionOutcome, Candidate, CandidateError, Choice, Conceptual, ConceptualParameters, Memory,
    SensoryMotor, SensoryMotorParameters,
};
use affect::{EmotionLabel, Feeling, Intensity, Urgency};
use std::collections::BTreeSet;

type Behavior = &'static str;

fn affect(signed: f64) -> Affect {
    let valence = if signed < 0.0 {
        Valence::Negative
    } else {
        Valence::Positive
    };

    Affect {
        valence,
        intensity: Intensity::new(signed.abs()).unwrap(),
    }
}

fn feeling(emotion: StandardEmotion, intensity: f64) -> Feeling<StandardEmotion> {
    let urgency = match emotion.valence() {
        Valence::Positive => 1.0 - intensity,
        Valence::Negative => intensity,
    };

    Feeling {
        emotion,
        urgency: Urgency::new(urgency).unwrap(),
    }
}

fn outcome(probability: f64, after_s: f64, signed: f64) -> ActionOutcome {
    ActionOutcome {
        probability,
        after_s,
        anticipated: affect(signed),
    }
}

fn candidate(action: Behavior, outcomes: &[ActionOutcome]) -> Candidate<Behavior> {
    Candidate::new(action, None, outcomes.to_vec()).unwrap()
}

fn level() -> Conceptual {
    Conceptual::new(ConceptualParameters::default(), &Personality::default()).unwrap()
}

fn chosen(felt: Feeling<StandardEmotion>, candidates: &[Candidate<Behavior>]) -> Choice<Behavior> {
    level()
        .deliberate(felt, None, candidates, &Memory::default())
        .unwrap()
}

#[test]
fn sensory_motor_output_depends_on_valence_and_intensity_alone() {
    let step = SensoryMotor::new(SensoryMotorParameters::default()).unwrap();
    assert_eq!(step.gain(affect(-0.44)), 1.0);
    assert_eq!(step.gain(affect(-0.45)), 1.5);
    assert_eq!(step.gain(affect(0.9)), 1.0);

    let ramp = SensoryMotorParameters {
        onset: 0.2,
        full: 0.6,
        positive_gain: 0.5,
        ..Default::default()
    };
    let ramp = SensoryMotor::new(ramp).unwrap();
    assert_eq!(ramp.gain(affect(-0.2)), 1.0);
    assert_eq!(ramp.gain(affect(-0.6)), 1.5);
    assert_eq!(ramp.gain(affect(0.6)), 0.5);
    assert!((ramp.gain(affect(-0.4)) - 1.25).abs() < 1e-12);

    let wrong = SensoryMotorParameters {
        onset: 0.8,
        full: 0.6,
        ..Default::default()
    };
    assert!(SensoryMotor::new(wrong).is_err());
}

#[test]
fn a_calm_agent_evaluates_all_and_takes_the_first_of_equals() {
    let candidates = [
        candidate("wait", &[outcome(1.0, 5.0, 0.2)]),
        candidate("call", &[outcome(0.9, 5.0, 0.5), outcome(0.1, 5.0, -0.9)]),
        candidate(
            "call again",
            &[outcome(0.9, 5.0, 0.5), outcome(0.1, 5.0, -0.9)],
        ),
    ];

    let choice = chosen(feeling(Happy, 0.9), &candidates);
    assert_eq!(choice.action, "call");
    assert!((choice.value - 0.36).abs() < 1e-12);
    assert_eq!(choice.weighed.len(), 3);
    assert_eq!(choice.dropped.len(), 0);

    let memory = Memory::<_, Behavior>::default();
    let choice = level().deliberate(feeling(Happy, 0.0), None, &[], &memory);
    assert_eq!(choice, None);
}

#[test]
fn pressure_ignores_negligible_outcomes() {
    let candidates = [
        candidate("risk", &[outcome(0.9, 1.0, 0.5), outcome(0.1, 1.0, -1.0)]),
        candidate("safe", &[outcome(1.0, 1.0, 0.4)]),
    ];
    assert_eq!(chosen(feeling(Happy, 1.0), &candidates).action, "safe");
    assert_eq!(chosen(feeling(Frustrated, 0.4), &candidates).action, "safe");
    assert_eq!(chosen(feeling(Frustrated, 0.6), &candidates).action, "risk");
}

#[test]
fn pressure_shortens_the_horizon() {
    let candidates = [
        candidate("invest", &[outcome(1.0, 40.0, 0.9)]),
        candidate("snatch", &[outcome(1.0, 2.0, 0.3)]),
    ];
    assert_eq!(
        chosen(feeling(Concerned, 0.3), &candidates).action,
        "invest"
    );
    assert_eq!(
        chosen(feeling(Concerned, 0.6), &candidates).action,
        "snatch"
    );
}

#[test]
fn pressure_dismisses_inferior_actions() {
    let names = ["a", "b", "c", "d"];
    let candidates = names.map(|name| candidate(name, &[outcome(1.0, 1.0, 0.1)]));
    let mut memory = Memory::default();
    memory.remember(Frustrated, &"d", affect(0.4));
    memory.remember(Frustrated, &"a", affect(-0.4));

    for (intensity, dropped) in [(0.0, vec![]), (0.5, vec!["a"]), (1.0, vec!["a", "c"])] {
        let felt = feeling(Frustrated, intensity);
        let choice = level().deliberate(felt, None, &candidates, &memory);
        assert_eq!(choice.unwrap().dropped, dropped);
    }

    assert_eq!(chosen(feeling(Happy, 1.0), &candidates).dropped, [""; 0]);
}

#[test]
fn an_emotion_favors_its_action_tendency() {
    let change = Some(ActionTendency::ChangeCurrentStrategy);
    let candidates = [
        candidate("serve", &[outcome(1.0, 1.0, 0.3)]),
        Candidate::new("intercept", change, vec![outcome(1.0, 1.0, 0.2)]).unwrap(),
    ];

    // Without a tendency there is no bonus, not even for candidates that follow none.
    for (tendency, action) in [(None, "serve"), (change, "intercept")] {
        let felt = feeling(Frustrated, 0.9);
        let choice = level().deliberate(felt, tendency, &candidates, &Memory::default());
        assert_eq!(choice.unwrap().action, action);
    }
}

#[test]
fn experience_corrects_anticipation_under_the_same_emotion() {
    let candidates = [
        candidate("call", &[outcome(1.0, 1.0, 0.5)]),
        candidate("wait", &[outcome(1.0, 1.0, 0.3)]),
    ];
    let mut memory = Memory::default();
    for _ in 0..3 {
        memory.remember(Concerned, &"call", affect(-0.5));
    }

    let experience = memory.recall(Concerned, &"call").unwrap();
    assert_eq!(experience.mean, -0.5);
    assert_eq!(experience.times, 3);

    for (emotion, action) in [(Concerned, "wait"), (Happy, "call")] {
        let choice = level().deliberate(feeling(emotion, 0.3), None, &candidates, &memory);
        assert_eq!(choice.unwrap().action, action);
    }
}

#[test]
fn affect_without_a_preference_has_no_value() {
    let careless = Personality {
        preferences: BTreeSet::from([Preference::SeekPositive]),
        ..Default::default()
    };
    let level = Conceptual::new(ConceptualParameters::default(), &careless).unwrap();

    let candidates = [
        candidate("safe", &[outcome(1.0, 1.0, 0.4)]),
        candidate("risk", &[outcome(0.5, 1.0, 0.9), outcome(0.5, 1.0, -0.9)]),
    ];

    let choice = level
        .deliberate(feeling(Happy, 0.5), None, &candidates, &Memory::default())
        .unwrap();
    assert_eq!(choice.action, "risk");
}

#[test]
fn a_candidate_with_impossible_outcomes_is_rejected() {
    for (outcomes, error) in [
        (
            vec![outcome(1.5, 0.0, 0.0)],
            CandidateError::Probability(1.5),
        ),
        (vec![outcome(0.5, -1.0, 0.0)], CandidateError::Time(-1.0)),
        (vec![outcome(0.8, 0.0, 0.0); 2], CandidateError::Sum(1.6)),
    ] {
        assert_eq!(Candidate::new("x", None, outcomes), Err(error));
    }

    assert!(Candidate::new("x", None, vec![outcome(0.1, 0.0, 0.0); 10]).is_ok());
}

#[test]
fn memory_can_be_saved_and_restored() {
    let mut memory: Memory<StandardEmotion, String> = Memory::default();
    memory.remember(Concerned, &"call".to_owned(), affect(-0.3));
    memory.remember(Concerned, &"call".to_owned(), affect(0.1));

    let text = serde_json::to_string(&memory).unwrap();
    assert_eq!(
        serde_json::from_str::<Memory<StandardEmotion, String>>(&text).unwrap(),
        memory
    );
}
