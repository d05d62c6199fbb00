//! The three levels, each alone, together, and switched off one by one.

#![expect(
    clippy::unwrap_used,
    reason = "helpers of tests, where a panic is the failure"
)]

use affect::StandardEmotion::{self, Concerned, Frustrated, Happy};
use affect::akr::{ActionTendency, Affect, Personality, Preference, Valence};
use affect::levels::{
    Candidate, CandidateError, Choice, Conceptual, ConceptualParameters, Levels, Memory,
    MultilevelProcess, Outcome, Schematic, SensoryMotor, SensoryMotorParameters,
};
use affect::{Feeling, Intensity};
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
    Feeling {
        emotion,
        intensity: Intensity::new(intensity).unwrap(),
    }
}

fn outcome(probability: f64, after_s: f64, signed: f64) -> Outcome {
    Outcome {
        probability,
        after_s,
        anticipated: affect(signed),
    }
}

fn candidate(action: Behavior, outcomes: &[Outcome]) -> Candidate<Behavior> {
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
    assert_eq!(
        [
            ramp.gain(affect(-0.2)),
            ramp.gain(affect(-0.6)),
            ramp.gain(affect(0.6))
        ],
        [1.0, 1.5, 0.5]
    );
    assert!((ramp.gain(affect(-0.4)) - 1.25).abs() < 1e-12);
    let wrong = SensoryMotorParameters {
        onset: 0.8,
        full: 0.6,
        ..Default::default()
    };
    assert!(SensoryMotor::new(wrong).is_err());
}

#[test]
fn a_calm_agent_weighs_all_and_takes_the_first_of_equals() {
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
    assert_eq!((choice.weighed.len(), choice.dropped.len()), (3, 0));
    assert_eq!(
        level().deliberate(
            feeling(Happy, 0.0),
            None,
            &[],
            &Memory::<_, Behavior>::default()
        ),
        None
    );
}

#[test]
fn pressure_drops_the_negligible() {
    let candidates = [
        candidate("risk", &[outcome(0.9, 1.0, 0.5), outcome(0.1, 1.0, -1.0)]),
        candidate("safe", &[outcome(1.0, 1.0, 0.4)]),
    ];
    assert_eq!(chosen(feeling(Happy, 1.0), &candidates).action, "safe");
    assert_eq!(chosen(feeling(Frustrated, 0.4), &candidates).action, "safe");
    assert_eq!(chosen(feeling(Frustrated, 0.6), &candidates).action, "risk");
}

#[test]
fn pressure_makes_short_sighted() {
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
fn pressure_leaves_unweighed_what_a_glance_finds_inferior() {
    let names = ["a", "b", "c", "d"];
    let candidates = names.map(|name| candidate(name, &[outcome(1.0, 1.0, 0.1)]));
    let mut memory = Memory::default();
    memory.remember(Frustrated, &"d", affect(0.4));
    memory.remember(Frustrated, &"a", affect(-0.4));
    let dropped = |intensity| {
        level()
            .deliberate(feeling(Frustrated, intensity), None, &candidates, &memory)
            .unwrap()
            .dropped
    };
    assert_eq!(dropped(0.0), [""; 0]);
    assert_eq!(dropped(0.5), ["a"]);
    assert_eq!(dropped(1.0), ["a", "c"]);
    assert_eq!(chosen(feeling(Happy, 1.0), &candidates).dropped, [""; 0]);
}

#[test]
fn an_emotion_has_its_action_tendency_ready() {
    let change = Some(ActionTendency::ChangeCurrentStrategy);
    let candidates = [
        candidate("serve", &[outcome(1.0, 1.0, 0.3)]),
        Candidate::new("intercept", change, vec![outcome(1.0, 1.0, 0.2)]).unwrap(),
    ];
    let choose = |tendency| {
        level()
            .deliberate(
                feeling(Frustrated, 0.9),
                tendency,
                &candidates,
                &Memory::default(),
            )
            .unwrap()
            .action
    };
    // Without a tendency no bonus, also not for candidates that follow none.
    assert_eq!(choose(None), "serve");
    assert_eq!(choose(change), "intercept");
}

#[test]
fn experience_corrects_anticipation_for_the_emotion_it_was_made_under() {
    let candidates = [
        candidate("call", &[outcome(1.0, 1.0, 0.5)]),
        candidate("wait", &[outcome(1.0, 1.0, 0.3)]),
    ];
    let mut memory = Memory::default();
    for _ in 0..3 {
        memory.remember(Concerned, &"call", affect(-0.5));
    }
    assert_eq!(
        memory
            .recall(Concerned, &"call")
            .map(|one| (one.mean, one.times)),
        Some((-0.5, 3))
    );
    let choose = |emotion| {
        level()
            .deliberate(feeling(emotion, 0.3), None, &candidates, &memory)
            .unwrap()
            .action
    };
    assert_eq!(choose(Concerned), "wait");
    assert_eq!(choose(Happy), "call");
}

#[test]
fn what_a_personality_does_not_care_about_has_no_value() {
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
fn a_candidate_with_impossible_outcomes_is_refused() {
    let refusal = |outcomes: &[Outcome]| Candidate::new("x", None, outcomes.to_vec()).unwrap_err();
    assert_eq!(
        refusal(&[outcome(1.5, 0.0, 0.0)]),
        CandidateError::Probability(1.5)
    );
    assert_eq!(
        refusal(&[outcome(0.5, -1.0, 0.0)]),
        CandidateError::Time(-1.0)
    );
    assert_eq!(
        refusal(&[outcome(0.8, 0.0, 0.0), outcome(0.8, 0.0, 0.0)]),
        CandidateError::Sum(1.6)
    );
    assert!(Candidate::new("x", None, vec![outcome(0.1, 0.0, 0.0); 10]).is_ok());
}

#[test]
fn each_level_works_alone_and_together() {
    let process = |levels| MultilevelProcess {
        sensory_motor: SensoryMotor::new(SensoryMotorParameters::default()).unwrap(),
        schematic: Schematic::new(vec!["serve", "call"])
            .with(Frustrated, vec!["call", "intercept"]),
        conceptual: level(),
        levels,
    };
    let candidates = [
        candidate("serve", &[outcome(1.0, 1.0, 0.9)]),
        candidate("call", &[outcome(1.0, 1.0, 0.1)]),
        candidate("intercept", &[outcome(1.0, 1.0, 0.5)]),
    ];
    let mut seen = Vec::new();
    for number in 0..8_u8 {
        let [sensory_motor, schematic, conceptual] = [1, 2, 4].map(|bit| number & bit != 0);
        let levels = Levels {
            sensory_motor,
            schematic,
            conceptual,
        };
        let influence = process(levels).influence(
            feeling(Frustrated, 0.9),
            None,
            &candidates,
            &Memory::default(),
        );
        assert_eq!(influence.motor_gain, if sensory_motor { 1.5 } else { 1.0 });
        assert_eq!(
            influence.active,
            if schematic {
                ["call", "intercept"]
            } else {
                ["serve", "call"]
            }
        );
        let best = if schematic { "intercept" } else { "serve" };
        assert_eq!(
            influence.choice.as_ref().map(|choice| choice.action),
            conceptual.then_some(best)
        );
        assert!(!seen.contains(&influence));
        seen.push(influence);
    }
}

#[test]
fn levels_are_switched_by_a_file() {
    let levels: Levels = toml::from_str("conceptual = false").unwrap();
    assert_eq!(
        levels,
        Levels {
            conceptual: false,
            ..Default::default()
        }
    );
    assert!(toml::from_str::<Levels>("conceptal = false").is_err());
}

#[test]
fn memory_is_saved_with_the_rest() {
    let mut memory: Memory<StandardEmotion, String> = Memory::default();
    memory.remember(Concerned, &"call".to_owned(), affect(-0.3));
    memory.remember(Concerned, &"call".to_owned(), affect(0.1));
    let text = serde_json::to_string(&memory).unwrap();
    assert_eq!(
        serde_json::from_str::<Memory<StandardEmotion, String>>(&text).unwrap(),
        memory
    );
}
