//! The schemata of the standard emotions, what a schema may not contain, and personality.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

use affect::akr::{Agency, Appraisal, Personality, Preference, TABLE_2, Valence};
use affect::frame::{AGENCY, CERTAINTY, CONTROLLABILITY, GOAL_CONGRUENCE, INTENSITY, VALENCE};
use affect::{
    AffectFrame, Circumstances, EmotionLabel, SchemaError, Schemata, StandardEmotion, Urgency,
};

fn frame(name: &str, urgency: f64, appraisal: Appraisal) -> AffectFrame<'_> {
    let urgency = Urgency::new(urgency).unwrap();
    let frame = Schemata::standard().frame(name, urgency, appraisal);
    frame.unwrap()
}

#[test]
fn t22_every_standard_emotion_has_a_schema() {
    let schemata = Schemata::standard();
    assert_eq!(schemata.names().count(), StandardEmotion::ALL.len());

    let circumstances = Circumstances {
        other: Some("Leguin"),
        goal: Some("to serve the guests"),
        amount: Some("7 treats"),
    };
    for label in StandardEmotion::ALL {
        let name = label.name();
        let schema = schemata.get(name).unwrap();
        assert_eq!(schema.valence, label.valence(), "{name}");

        let spoken = schema.spoken(&circumstances);
        assert!(spoken.ends_with('.') && !spoken.contains(['{', '}']));
    }
}

#[test]
fn schemata_have_the_tendencies_of_table_2() {
    for row in TABLE_2 {
        let schema = Schemata::standard().get(row.emotion.name()).unwrap();
        assert_eq!(schema.action_tendency, row.tendency);
    }
}

#[test]
fn two_episodes_of_an_emotion_differ_in_their_appraisals() {
    let blocked = Appraisal::new(-0.9, 0.0, 1.0, Agency::Other("Leguin".to_owned()));
    let cut_off = Appraisal::new(-0.7, 1.0, 0.2, Agency::Oneself);
    let first = frame("FRUSTRATED", 0.8, blocked);
    let second = frame("FRUSTRATED", 0.9, cut_off);

    let [first_agency, ..] = first.texts();
    let [second_agency, ..] = second.texts();
    assert_eq!(first_agency, (AGENCY, "Leguin"));
    assert_eq!(second_agency, (AGENCY, "self"));

    let names = [
        VALENCE,
        INTENSITY,
        GOAL_CONGRUENCE,
        CONTROLLABILITY,
        CERTAINTY,
    ];
    for name in names {
        let value = |frame: &AffectFrame<'_>| {
            let all = frame.numbers();
            all.iter().find(|(own, _)| *own == name).unwrap().1
        };
        assert_ne!(value(&first), value(&second), "{name}");
    }
}

#[test]
fn an_appraisal_stays_within_its_scales() {
    let beyond = Appraisal::new(7.0, -1.0, f64::INFINITY, Agency::Oneself);
    assert_eq!(beyond.goal_congruence(), 1.0);
    assert_eq!(beyond.controllability(), 0.0);
    assert_eq!(beyond.certainty(), 1.0);

    let text = serde_json::to_string(&beyond).unwrap();
    assert_eq!(serde_json::from_str::<Appraisal>(&text).unwrap(), beyond);
}

#[test]
fn a_personality_can_be_read_from_a_file() {
    let read: Personality = toml::from_str("preferences = ['seek_positive']").unwrap();
    assert_eq!(read.preferences, [Preference::SeekPositive].into());
    assert!(!read.cares_about(Valence::Negative));

    let default = Personality::default();
    assert!(default.cares_about(Valence::Negative) && default.cares_about(Valence::Positive));

    for wrong in ["caution = 1.5", "traits = ['prudent']"] {
        assert!(toml::from_str::<Personality>(wrong).is_err(), "{wrong}");
    }
}

fn spoken(emotion: &str, circumstances: &Circumstances<'_>) -> String {
    let schema = Schemata::standard().get(emotion).unwrap();
    schema.spoken(circumstances)
}

#[test]
fn a_clause_about_unknown_circumstances_is_left_out() {
    let known = Circumstances {
        goal: Some("to explore"),
        other: Some("Vonda"),
        ..Default::default()
    };
    let spoken = spoken("CONCERNED", &known);
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
    let spoken = spoken("CONFIDENT", &odd);
    assert!(spoken.starts_with("I want {a} and {x;"), "{spoken}");
}

/// A schema of a robot's own in which `from` is replaced by `to`.
fn own(from: &str, to: &str) -> Result<Schemata, SchemaError> {
    let text = r#"
        [AMAZED]
        facial_expression = "surprised"
        valence = "positive"
        action_tendency = "approach"
        causal_chain = ["I did not know {n}"]
    "#;
    assert!(text.contains(from));

    Schemata::from_toml(&text.replace(from, to))
}

#[test]
fn surprise_goes_with_either_valence() {
    assert!(own("", "").is_ok());
    assert!(own("\"positive\"", "\"negative\"").is_ok());
    assert!(own("\"surprised\"", "\"happy\"").is_ok());
}

#[test]
fn a_contradictory_schema_is_rejected_when_loaded() {
    for (from, to, expected) in [
        ("{n}", "{m}", "unknown placeholder {m}"),
        ("{n}", "{n", "unmatched brace"),
        ("{n}", "n}", "unmatched brace"),
        ("valence = \"positive\"", "", "valence"),
        ("valence =", "valense = 1\nvalence =", "valense"),
        ("[AMAZED]", "[\"\"]", "an emotion must have a name"),
        (
            "\"surprised\"",
            "\"sad\"",
            "AMAZED has Positive valence, which contradicts its Sad face",
        ),
    ] {
        let error = own(from, to).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
