//! What the taxonomy accepts and rejects, and the schemata of the standard emotions.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
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
fn t22_frustrated_blames_the_other_agent_and_happy_the_self() {
    assert_eq!(
        emotion("FRUSTRATED").components().agency,
        Agency::Other("Leguin".to_owned())
    );
    assert_eq!(emotion("HAPPY").components().agency, Agency::Oneself);

    let unknown = Circumstances::default();
    let refusal = Schemata::standard().emotion("FRUSTRATED", Intensity::MAX, &unknown);
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
fn the_signal_of_an_emotion_matches_its_tendency() {
    for (name, signal) in [
        ("HAPPY", Signal::Continue),
        ("CONFIDENT", Signal::Continue),
        ("CONCERNED", Signal::Continue),
        ("HOPEFUL", Signal::Continue),
        ("FRUSTRATED", Signal::ChangeCourse),
        ("ANGRY", Signal::ChangeCourse),
        ("DISCOURAGED", Signal::Disengage),
    ] {
        let emotion = emotion(name);
        let goal = emotion.components().causal_chain.goal;
        assert_eq!(goal.signal(), signal, "{name}");
    }
}

#[test]
fn an_emotion_is_neither_mood_nor_personality() {
    let refusal = refused("ANGRY", |c| c.duration = Duration::Lifetime);
    assert!(refusal.contains("ANGRY must last minutes"), "{refusal}");

    let refusal = refused("ANGRY", |c| c.duration = Duration::Days);
    assert!(refusal.contains("only moods last days"), "{refusal}");

    let refusal = refused("ANGRY", |c| c.focality = Focality::Global);
    assert!(refusal.contains("about an event or an object"), "{refusal}");

    let refusal = refused("ANGRY", |c| c.agency = Agency::Other(String::new()));
    assert!(refusal.contains("must be named"), "{refusal}");

    let refusal = refused("ANGRY", |c| c.name.clear());
    assert_eq!(refusal, "an emotion must have a name");
}

#[test]
fn a_face_does_not_contradict_the_valence() {
    let refusal = refused("HAPPY", |c| c.valence = Valence::Negative);
    assert_eq!(
        refusal,
        "HAPPY has Negative valence, which contradicts its Happy face"
    );

    let refusal = refused("ANGRY", |c| c.facial_expression = FacialExpression::Happy);
    assert!(refusal.contains("contradicts"), "{refusal}");

    for valence in [Valence::Positive, Valence::Negative] {
        let mut components = emotion("ANGRY").components().clone();
        components.facial_expression = FacialExpression::Surprised;
        components.valence = valence;
        assert!(Emotion::new(components).is_ok());
    }
}

#[test]
fn a_deserialized_emotion_is_validated_too() {
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
    assert_eq!(mood.duration(), Duration::Days);
    assert_eq!(mood.focality(), Focality::Global);

    let text = serde_json::to_string(&mood).unwrap();
    assert_eq!(serde_json::from_str::<Mood>(&text).unwrap(), mood);

    for (line, expected) in [
        ("agency = { other = 'Leguin' }", "a mood has no agency"),
        ("duration = 'minutes'", "a mood lasts days"),
        ("focality = 'event'", "a mood is global"),
        ("novelty = 'match'", "unknown field"),
    ] {
        let text = format!("valence = 'negative'\nintensity = 1.0\n{line}");
        let refusal = toml::from_str::<Mood>(&text).unwrap_err().to_string();
        assert!(refusal.contains(expected), "{refusal}");
    }
}

#[test]
fn a_personality_lasts_a_lifetime() {
    let personality = Personality::with_caution(Caution::MAX);
    assert_eq!(personality.duration(), Duration::Lifetime);
    assert_eq!(personality.focality(), Focality::Global);
    assert!(personality.cares_about(Valence::Negative));
    assert!(personality.cares_about(Valence::Positive));
}

#[test]
fn a_personality_can_be_read_from_a_file() {
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
fn a_clause_about_unknown_circumstances_is_left_out() {
    let known = Circumstances {
        goal: Some("to explore"),
        other: Some("Vonda"),
        ..Default::default()
    };
    let concerned = Schemata::standard()
        .emotion("CONCERNED", Intensity::MIN, &known)
        .unwrap();
    let spoken = concerned.components().causal_chain.spoken();
    assert!(
        spoken.starts_with("I want to explore; Vonda is not here;"),
        "{spoken}"
    );
    assert!(spoken.ends_with("I feel bad."));
}

#[test]
fn inserted_words_are_not_expanded_again() {
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

/// A custom schema in which `from` is replaced by `to`.
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
fn only_surprise_may_have_either_valence() {
    let schemata = own("", "").unwrap().with(Schemata::standard().clone());
    assert_eq!(schemata.names().count(), 8);

    for valence in [Valence::Positive, Valence::Negative] {
        let circumstances = Circumstances {
            valence: Some(valence),
            amount: Some("this"),
            ..Default::default()
        };
        let amazed = schemata.emotion("AMAZED", Intensity::MAX, &circumstances);
        assert_eq!(amazed.unwrap().components().valence, valence);
    }

    let error = schemata.emotion("AMAZED", Intensity::MAX, &OTHER);
    let error = error.unwrap_err().to_string();
    assert!(error.contains("AMAZED must have a valence"), "{error}");

    assert!(own("\"surprised\"", "\"happy\"").is_err());
    assert!(schemata.emotion("BORED", Intensity::MAX, &OTHER).is_err());
}

#[test]
fn a_schema_without_valid_instances_is_rejected_when_loaded() {
    for (from, to, expected) in [
        (
            "\"object\"",
            "\"global\"",
            "AMAZED must be about an event or an object",
        ),
        (
            "goal =",
            "duration = \"days\"\ngoal =",
            "AMAZED must last minutes",
        ),
        ("{n}", "{m}", "unknown placeholder {m}"),
        ("{n}", "{n", "unmatched brace"),
        ("{n}", "n}", "unmatched brace"),
        ("agency = \"self\"", "", "agency"),
        ("goal =", "gaol = 1\ngoal =", "gaol"),
    ] {
        let error = own(from, to).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }

    let happy = own("\"surprised\"", "\"happy\"").unwrap_err();
    assert_eq!(
        happy,
        SchemaError::Refused(Refusal::ValenceOpen {
            name: "AMAZED".to_owned()
        })
    );
}
