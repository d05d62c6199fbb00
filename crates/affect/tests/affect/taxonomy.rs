//! The taxonomy: what a node inherits, the schemata of the standard emotions, what a file may not contain, and personality.

use affect::akr::{
    AffectiveLevel, Agency, Appraisal, Duration, Focality, Personality, Preference, TABLE_2,
    Valence,
};
use affect::frame::{ACTION_TENDENCY, DURATION, FACIAL_EXPRESSION};
use affect::{
    AffectFrame, Circumstances, EmotionLabel, Episode, EpisodeCause, SchemaError, Schemata,
    StandardEmotion, Urgency,
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

        let spoken = schema.causal_chain.filled(&circumstances).spoken();
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
fn two_episodes_of_an_emotion_differ_in_their_components() {
    let blocked = Appraisal::new(-0.9, 0.0, 1.0)
        .with_novelty(0.9)
        .with_modifiability(0.0)
        .with_standards(0.5, 0.4);
    let cut_off = Appraisal::new(-0.7, 1.0, 0.2)
        .with_novelty(0.1)
        .with_modifiability(0.5)
        .with_standards(1.0, 0.9);
    let began = |agency, name| {
        let mut episode = Episode::default();
        episode.update("FRUSTRATED", 0.5, |_| EpisodeCause {
            agency,
            focality: format!("event: {name}"),
            causal_chain: format!("belief: {name}"),
        });
        episode
    };
    let mut one = began(Agency::Other("Leguin".to_owned()), "the delay");
    let other = began(Agency::Oneself, "the way");
    one.update("FRUSTRATED", 0.5, |_| EpisodeCause::default());

    let first = frame("FRUSTRATED", 0.8, blocked).during(&one);
    let second = frame("FRUSTRATED", 0.9, cut_off).during(&other);
    let shared = [ACTION_TENDENCY, DURATION, FACIAL_EXPRESSION];
    for ((name, one), (_, other)) in first.components().zip(second.components()) {
        assert_eq!(one == other, shared.contains(&name), "{name}");
    }
}

#[test]
fn an_appraisal_stays_within_its_scales() {
    let beyond = Appraisal::new(7.0, -1.0, f64::INFINITY).with_standards(2.0, f64::NAN);
    assert_eq!(beyond.goal_congruence(), 1.0);
    assert_eq!(beyond.controllability(), 0.0);
    assert_eq!(beyond.certainty(), 1.0);
    assert_eq!(beyond.external_norms(), Some(1.0));
    assert_eq!(beyond.internal_standards(), Some(0.0));

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
    schema.causal_chain.filled(circumstances).spoken()
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
        parent = "positive emotion"
        facial_expression = "surprised"
        action_tendency = "approach"
        causal_chain = ["belief: I did not know {n}"]
    "#;
    assert!(text.contains(from));

    Schemata::from_toml(&text.replace(from, to))
}

#[test]
fn surprise_goes_with_either_valence() {
    assert!(own("", "").is_ok());
    assert!(own("positive emotion", "negative emotion").is_ok());
    assert!(own("\"surprised\"", "\"happy\"").is_ok());
}

#[test]
fn a_node_has_what_it_does_not_state_from_its_parent() {
    let schemata = Schemata::standard();
    let concerned = schemata.node("CONCERNED").unwrap();
    assert_eq!(concerned.level, AffectiveLevel::Emotion);
    assert_eq!(concerned.own.valence, None);
    assert_eq!(concerned.all.valence, Some(Valence::Negative));
    assert_eq!(concerned.all.duration, Some(Duration::Minutes));
    assert_eq!(concerned.all.focality, Some(Focality::Event));
    // The personality is inherited from the higher node, so any personality can have any emotion [D: S].
    assert_eq!(concerned.all.traits, Some(vec!["caution".to_owned()]));
    let origin = |key| {
        schemata
            .origin(concerned, key)
            .map(|node| node.name.as_str())
    };
    assert_eq!(origin("valence"), Some("negative affect"));
    assert_eq!(origin("duration"), Some("negative emotion"));
    assert_eq!(origin("facial_expression"), Some("CONCERNED"));

    let mood = schemata.node("negative mood").unwrap();
    assert_eq!(
        (mood.level, mood.all.duration),
        (AffectiveLevel::Mood, Some(Duration::Days))
    );
    assert_eq!(mood.all.focality, Some(Focality::Global));
    assert_eq!(mood.all.measured, Some(vec!["intensity".to_owned()]));
}

#[test]
fn an_emotion_can_refine_another_one() {
    let text = "[SEETHING]\nparent = 'ANGRY'\naction_tendency = 'avoid'";
    let schemata = Schemata::standard().extended(text).unwrap();
    let seething = schemata.get("SEETHING").unwrap();
    let angry = schemata.get("ANGRY").unwrap();
    assert_eq!(seething.causal_chain, angry.causal_chain);
    assert_ne!(seething.action_tendency, angry.action_tendency);

    // Without the standard emotions there is none to refine.
    let error = Schemata::from_toml(text).unwrap_err().to_string();
    assert!(
        error.contains("unknown parent \"ANGRY\" of SEETHING; there are SEETHING, negative affect"),
        "{error}"
    );
}

#[test]
fn the_tree_is_figure_1() {
    let tree = Schemata::standard().tree();
    let lines: Vec<String> = tree
        .iter()
        .map(|(depth, node)| format!("{}{}", "-".repeat(*depth), node.name))
        .collect();
    assert_eq!(
        lines,
        [
            "personality",
            "-negative affect",
            "--negative mood",
            "--negative emotion",
            "---CONCERNED",
            "---FRUSTRATED",
            "---ANGRY",
            "---DISCOURAGED",
            "-positive affect",
            "--positive mood",
            "--positive emotion",
            "---HAPPY",
            "---CONFIDENT",
            "---HOPEFUL",
        ]
    );
}

#[test]
fn every_value_of_the_standard_taxonomy_is_marked() {
    for (_, node) in Schemata::standard().tree() {
        let parent = node.parent.as_ref().map(|_| "parent");
        let stated = node.own.entries();
        for key in stated.iter().map(|(key, _)| *key).chain(parent) {
            let mark = node
                .marks
                .get(key)
                .unwrap_or_else(|| panic!("{}.{key}", node.name));
            assert!(mark.starts_with("[D") || mark.starts_with("[I]"), "{mark}");
        }
    }
}

#[test]
fn a_contradictory_schema_is_rejected_when_loaded() {
    for (from, to, expected) in [
        ("{n}", "{m}", "unknown placeholder {m}"),
        ("{n}", "{n", "unmatched brace"),
        ("{n}", "n}", "unmatched brace"),
        ("belief: ", "", "does not begin with its kind: `goal: `"),
        (
            "action_tendency = \"approach\"",
            "",
            "AMAZED has no `action_tendency`, and no node above it has",
        ),
        ("parent =", "parnet =", "parnet"),
        ("[AMAZED]", "[\"\"]", "an emotion must have a name"),
        (
            "parent = \"positive emotion\"",
            "",
            "AMAZED has no parent; add `parent = \"positive emotion\"`",
        ),
        (
            "positive emotion",
            "good emotion",
            "unknown parent \"good emotion\" of AMAZED; there are AMAZED, negative affect",
        ),
        ("positive emotion", "AMAZED", "AMAZED is its own ancestor"),
        (
            "positive emotion",
            "positive mood",
            "AMAZED is of the level mood, which does not have `facial_expression = \"surprised\"`; only an emotion has it",
        ),
        ("positive emotion", "personality", "only an emotion has it"),
        (
            "facial",
            "level = \"affect\"\nfacial",
            "AMAZED is of the level affect, which cannot be below positive emotion, of the level emotion",
        ),
        (
            "facial",
            "valence = \"negative\"\nfacial",
            "AMAZED has Negative valence and is below positive emotion",
        ),
        (
            "facial",
            "duration = \"days\"\nfacial",
            "AMAZED is of the level emotion, which does not have `duration = \"days\"`; it lasts \"minutes\"",
        ),
        (
            "facial",
            "focality = \"global\"\nfacial",
            "an emotion is about an event, an agent or an object",
        ),
        (
            "facial",
            "traits = [\"vain\"]\nfacial",
            "only a personality has it",
        ),
        (
            "facial",
            "measured = [\"pulse\"]\nfacial",
            "what is measured is one of intensity, agency",
        ),
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

#[test]
fn a_mood_has_no_agency_and_no_short_duration() {
    for (line, expected) in [
        (
            "measured = ['agency']",
            "GLOOM is of the level mood, which does not have `measured = \"agency\"`; a mood has no agency",
        ),
        ("duration = 'minutes'", "it lasts \"days\""),
        ("focality = 'event'", "it is \"global\""),
        ("causal_chain = []", "only an emotion has it"),
    ] {
        let text = format!("[GLOOM]\nparent = 'negative mood'\n{line}");
        let error = Schemata::from_toml(&text).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert!(Schemata::from_toml("[GLOOM]\nparent = 'negative mood'").is_ok());
}

#[test]
fn nodes_can_not_be_above_one_another() {
    let text = "[A]\nparent = 'B'\n[B]\nparent = 'A'";
    let error = Schemata::from_toml(text).unwrap_err().to_string();
    assert!(error.contains("is its own ancestor"), "{error}");
}

#[test]
fn a_personality_can_have_a_strategy_and_traits_of_its_own() {
    let text = "[personality]\nlevel = 'personality'\nduration = 'lifetime'\nfocality = 'global'\n\
                traits = ['vindictive']\ninteractive_strategy = 'tit-for-tat'";
    let schemata = Schemata::standard().extended(text).unwrap();
    let angry = schemata.node("ANGRY").unwrap();
    assert_eq!(
        angry.all.interactive_strategy.as_deref(),
        Some("tit-for-tat")
    );
}
