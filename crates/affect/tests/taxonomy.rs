//! What the taxonomy allows and refuses, and the schemata of the standard emotions.

#![expect(
    clippy::unwrap_used,
    reason = "helpers of tests, where a panic is the failure"
)]

use affect::akr::{
    Affect, Agency, Components, Duration, Emotion, FacialExpression, Focality, Mood, Personality,
    Preference, Refusal, Signal, Strategy, TABLE_2, Trait, Valence,
};
use affect::{
    Caution, Circumstances, EmotionLabel, Intensity, IntensityLabel, SchemaError, Schemata,
    StandardEmotion,
};

const OTHER: Circumstances<'static> = Circumstances {
    other: Some("Leguin"),
    goal: Some("to serve the guests"),
    amount: Some("7 treats"),
    valence: None,
};

fn emotion(name: &str) -> Emotion {
    Schemata::standard()
        .emotion(name, Intensity::new(0.5).unwrap(), &OTHER)
        .unwrap()
}

fn refused(name: &str, change: impl Fn(&mut Components)) -> String {
    let mut components = emotion(name).components().clone();
    change(&mut components);
    Emotion::new(components).unwrap_err().to_string()
}

#[test]
fn t22_every_standard_emotion_has_legal_components() {
    assert_eq!(
        Schemata::standard().names().count(),
        StandardEmotion::ALL.len()
    );
    for label in StandardEmotion::ALL {
        let emotion = emotion(label.name());
        let components = emotion.components();
        assert_eq!(components.duration, Duration::Minutes);
        assert_eq!(
            components.valence,
            label.valence(),
            "{}: schema and label disagree",
            label.name()
        );
        assert_ne!(components.focality, Focality::Global);
        assert_eq!(components.intensity.label(), IntensityLabel::Medium);
        assert!(!components.causal_chain.clauses.is_empty());
        assert!(!components.causal_chain.spoken().contains(['{', '}']));
    }
}

#[test]
fn t22_frustrated_points_to_the_other_and_happy_to_the_self() {
    assert_eq!(
        emotion("FRUSTRATED").components().agency,
        Agency::Other("Leguin".to_owned())
    );
    assert_eq!(emotion("HAPPY").components().agency, Agency::Oneself);
    let nobody = Circumstances::default();
    let refusal = Schemata::standard().emotion("FRUSTRATED", Intensity::MAX, &nobody);
    let expected = Refusal::AgentUnnamed {
        name: "FRUSTRATED".to_owned(),
    };
    assert_eq!(refusal, Err(SchemaError::Refused(expected)));
}

#[test]
fn schemata_have_the_tendencies_of_table_2() {
    for row in TABLE_2 {
        assert_eq!(
            emotion(row.emotion.name()).components().action_tendency,
            row.tendency
        );
    }
}

#[test]
fn an_emotion_signals_what_its_tendency_inclines_to() {
    let signal = |name| emotion(name).components().causal_chain.goal.signal();
    for name in ["HAPPY", "CONFIDENT", "CONCERNED", "HOPEFUL"] {
        assert_eq!(signal(name), Signal::Continue, "{name}");
    }
    assert_eq!(
        (signal("FRUSTRATED"), signal("ANGRY")),
        (Signal::ChangeCourse, Signal::ChangeCourse)
    );
    assert_eq!(signal("DISCOURAGED"), Signal::Disengage);
}

#[test]
fn an_emotion_is_neither_mood_nor_personality() {
    assert!(refused("ANGRY", |c| c.duration = Duration::Lifetime).contains("ANGRY lasts minutes"));
    assert!(
        refused("ANGRY", |c| c.duration = Duration::Days).contains("what lasts days is a mood")
    );
    assert!(
        refused("ANGRY", |c| c.focality = Focality::Global).contains("about an event or an object")
    );
    assert!(
        refused("ANGRY", |c| c.agency = Agency::Other(String::new())).contains("must be named")
    );
    assert_eq!(
        refused("ANGRY", |c| c.name.clear()),
        "an emotion has a name"
    );
}

#[test]
fn a_face_does_not_contradict_the_valence() {
    let expected = "HAPPY is Negative, which a Happy face contradicts";
    assert_eq!(
        refused("HAPPY", |c| c.valence = Valence::Negative),
        expected
    );
    assert!(
        refused("ANGRY", |c| c.facial_expression = FacialExpression::Happy).contains("contradicts")
    );
    for valence in [Valence::Positive, Valence::Negative] {
        let mut components = emotion("ANGRY").components().clone();
        components.facial_expression = FacialExpression::Surprised;
        components.valence = valence;
        assert!(Emotion::new(components).is_ok());
    }
}

#[test]
fn an_emotion_read_from_text_is_checked_too() {
    let text = serde_json::to_string(&emotion("CONCERNED")).unwrap();
    assert_eq!(
        serde_json::from_str::<Emotion>(&text).unwrap(),
        emotion("CONCERNED")
    );
    for (from, to) in [
        ("minutes", "lifetime"),
        ("\"event\",\"novelty", "\"global\",\"novelty"),
        ("0.5", "1.5"),
    ] {
        let wrong = text.replace(from, to);
        assert_ne!(wrong, text);
        assert!(serde_json::from_str::<Emotion>(&wrong).is_err(), "{wrong}");
    }
}

#[test]
fn a_mood_lasts_days_is_global_and_has_no_agency() {
    let mood = Mood::new(Affect {
        valence: Valence::Negative,
        intensity: Intensity::MAX,
    });
    assert_eq!(
        (mood.duration(), mood.focality()),
        (Duration::Days, Focality::Global)
    );
    let text = serde_json::to_string(&mood).unwrap();
    assert_eq!(serde_json::from_str::<Mood>(&text).unwrap(), mood);
    let refusal = |line: &str| {
        let text = format!("valence = 'negative'\nintensity = 1.0\n{line}");
        toml::from_str::<Mood>(&text).unwrap_err().to_string()
    };
    assert!(refusal("agency = { other = 'Leguin' }").contains("a mood has no agency"));
    assert!(refusal("duration = 'minutes'").contains("a mood lasts days"));
    assert!(refusal("focality = 'event'").contains("a mood is global"));
    assert!(refusal("novelty = 'match'").contains("unknown field"));
}

#[test]
fn a_personality_lasts_a_lifetime() {
    let personality = Personality::with_caution(Caution::MAX);
    assert_eq!(
        (personality.duration(), personality.focality()),
        (Duration::Lifetime, Focality::Global)
    );
    assert!(
        personality.cares_about(Valence::Negative) && personality.cares_about(Valence::Positive)
    );
    let text = "caution = 0.2\ntraits = ['prudent', { other = 'shy' }]\nstrategy = 'tit_for_tat'\n\
                preferences = ['like_positive']";
    let read: Personality = toml::from_str(text).unwrap();
    assert_eq!(
        read.traits.iter().collect::<Vec<_>>(),
        [&Trait::Prudent, &Trait::Other("shy".to_owned())]
    );
    assert_eq!(read.strategy, Strategy::TitForTat);
    assert_eq!(
        read.preferences.iter().collect::<Vec<_>>(),
        [&Preference::LikePositive]
    );
    assert!(!read.cares_about(Valence::Negative));
    let json = serde_json::to_string(&read).unwrap();
    assert_eq!(serde_json::from_str::<Personality>(&json).unwrap(), read);
    for wrong in [
        "duration = 'days'",
        "focality = 'event'",
        "caution = 1.5",
        "agency = 'self'",
    ] {
        assert!(toml::from_str::<Personality>(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn a_clause_about_something_unknown_is_left_out() {
    let knowing = Circumstances {
        goal: Some("to explore"),
        other: Some("Vonda"),
        ..Default::default()
    };
    let concerned = Schemata::standard()
        .emotion("CONCERNED", Intensity::MIN, &knowing)
        .unwrap();
    let spoken = concerned.components().causal_chain.spoken();
    assert!(
        spoken.starts_with("I want to explore; Vonda is not here;"),
        "{spoken}"
    );
    assert!(spoken.ends_with("I feel bad."));
    // Words are put in once, whatever they look like.
    let odd = Circumstances {
        goal: Some("{a} and {x"),
        other: Some("Vonda"),
        ..Default::default()
    };
    let spoken = Schemata::standard()
        .get("CONFIDENT")
        .unwrap()
        .account(&odd)
        .spoken();
    assert!(spoken.starts_with("I want {a} and {x;"), "{spoken}");
}

/// A schema of one's own, with one line replaced.
fn own(from: &str, to: &str) -> Result<Schemata, SchemaError> {
    let text = r#"
        [AMAZED]
        facial_expression = "surprised"
        valence = "either"
        agency = "self"
        focality = "object"
        novelty = "mismatch"
        controllability = "none"
        modifiability = "none"
        certainty = "uncertain"
        external_norms = "compatible"
        internal_standards = "compatible"
        action_tendency = "approach"
        goal = "expected"
        causal_chain = [{ kind = "event", text = "I did not know {n}" }]
    "#;
    assert!(text.contains(from));
    Schemata::from_toml(&text.replace(from, to))
}

#[test]
fn surprise_alone_may_be_either() {
    let schemata = own("", "").unwrap().with(Schemata::standard().clone());
    assert_eq!(schemata.names().count(), 8);
    let either = |valence| {
        let circumstances = Circumstances {
            valence,
            amount: Some("this"),
            ..Default::default()
        };
        schemata.emotion("AMAZED", Intensity::MAX, &circumstances)
    };
    for valence in [Valence::Positive, Valence::Negative] {
        assert_eq!(either(Some(valence)).unwrap().components().valence, valence);
    }
    assert!(
        either(None)
            .unwrap_err()
            .to_string()
            .contains("AMAZED needs a valence of its own")
    );
    assert!(own("\"surprised\"", "\"happy\"").is_err());
    assert!(schemata.emotion("BORED", Intensity::MAX, &OTHER).is_err());
}

#[test]
fn a_schema_that_no_instance_could_fit_is_refused_when_it_is_read() {
    let refusal = |from: &str, to: &str| own(from, to).unwrap_err().to_string();
    assert!(refusal("\"object\"", "\"global\"").contains("AMAZED is about an event or an object"));
    assert!(refusal("goal =", "duration = \"days\"\ngoal =").contains("AMAZED lasts minutes"));
    assert!(refusal("{n}", "{m}").contains("asks for {m}"));
    assert!(refusal("{n}", "{n").contains("brace is not closed"));
    assert!(refusal("{n}", "n}").contains("brace is not closed"));
    assert!(refusal("agency = \"self\"", "").contains("agency"));
    assert!(refusal("goal =", "gaol = 1\ngoal =").contains("gaol"));
    let happy = own("\"surprised\"", "\"happy\"").unwrap_err();
    assert_eq!(
        happy,
        SchemaError::Refused(Refusal::ValenceOpen {
            name: "AMAZED".to_owned()
        })
    );
}
