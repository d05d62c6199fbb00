//! Emotions as signals: what a robot does at the emotion that the other one shows, and that it does not without `signals`.

use super::stage::{Role, Stage, feet};

/// A script of one emotion from the beginning, as a parameter.
fn script(emotion: &str) -> String {
    format!("script = [{{ at_s = 0.0, emotion = \"{emotion}\", urgency = 0.8 }}]")
}

/// Butler and Leguin, without any command arriving.
fn deaf(butler: &str, leguin: &str) -> Stage {
    let mut stage = Stage::pair(1, butler, leguin);
    stage.drops = Box::new(|_| true);
    stage
}

#[test]
fn leguin_sets_out_and_hurries_by_what_butler_shows() {
    for (emotion, signals, behavior, hurried) in [
        ("CONCERNED", "on", "REFILL", false),
        ("FRUSTRATED", "on", "REFILL", true),
        ("CONFIDENT", "on", "WAIT", false),
        ("HAPPY", "on", "WAIT", false),
        ("FRUSTRATED", "off", "WAIT", false),
    ] {
        let shown = format!("{}\nscripted = \"shown\"", script(emotion));
        let mut stage = deaf(&shown, &format!("signals = \"{signals}\""));
        for _ in 0..8 {
            stage.step();
        }
        assert_eq!(stage.emotion("Butler"), emotion);
        assert_eq!(stage.behavior("Leguin"), behavior, "{emotion}, {signals}");
        assert_eq!(
            stage.flag("Leguin", "hurried"),
            hurried,
            "{emotion}, {signals}"
        );
    }
}

#[test]
fn leguin_on_her_way_hurries_when_butler_grows_frustrated() {
    let later = "script = [{ at_s = 0.0, emotion = \"CONCERNED\" }, { at_s = 10.0, emotion = \"FRUSTRATED\" }]\n\
                 scripted = \"shown\"";
    let mut stage = deaf(later, "signals = \"on\"");
    for _ in 0..18 {
        stage.step();
    }
    assert_eq!(stage.behavior("Leguin"), "REFILL");
    assert!(!stage.flag("Leguin", "hurried"));
    for _ in 0..8 {
        stage.step();
    }
    assert!(stage.flag("Leguin", "hurried"));
    assert_eq!(stage.emotion("Leguin"), "CONCERNED");
}

#[test]
fn leguin_does_not_heed_a_butler_who_calls_another() {
    let mut stage = Stage::new(
        1,
        vec![
            Role::new(
                "Butler",
                "Butler",
                feet(25.0, 25.0),
                &format!("refiller = \"Vonda\"\n{}", script("FRUSTRATED")),
            ),
            Role::new("Leguin", "Leguin", feet(4.0, 4.0), "signals = \"on\""),
            Role::new("Vonda", "Leguin", feet(46.0, 46.0), "signals = \"on\""),
        ],
    );
    stage.drops = Box::new(|_| true);
    stage.begin();
    for _ in 0..8 {
        stage.step();
    }
    assert_eq!(stage.behavior("Leguin"), "WAIT");
    assert_eq!(stage.behavior("Vonda"), "REFILL");
}

#[test]
fn butler_meets_a_frustrated_leguin_when_he_needs_her() {
    for (signals, intercepts) in [("on", true), ("off", false)] {
        // His own emotion does not make him intercept: its threshold is never reached.
        let butler = format!("signals = \"{signals}\"\n[dynamics]\nth_frustrated = 1.0");
        let leguin = format!("{}\nscripted = \"shown\"", script("FRUSTRATED"));
        let mut stage = Stage::pair(1, &butler, &leguin);
        let mut has_intercepted = false;
        let mut has_needed = false;
        for _ in 0..120 {
            stage.step();
            has_needed |= stage.flag("Butler", "need");
            assert!(stage.flag("Butler", "need") || stage.behavior("Butler") != "INTERCEPT");
            has_intercepted |= stage.behavior("Butler") == "INTERCEPT";
        }
        assert!(has_needed);
        assert_eq!(has_intercepted, intercepts, "signals {signals}");
    }
}

#[test]
fn what_is_shown_only_changes_nothing_that_the_robot_does() {
    let mut own = Stage::pair(7, "", "");
    let mut masked = Stage::pair(
        7,
        &format!("{}\nscripted = \"shown\"", script("FRUSTRATED")),
        "",
    );
    for _ in 0..200 {
        own.step();
        masked.step();
        assert_eq!(own.at("Butler"), masked.at("Butler"));
        assert_eq!(own.at("Leguin"), masked.at("Leguin"));
        assert_eq!(own.behavior("Butler"), masked.behavior("Butler"));
        assert_eq!(masked.emotion("Butler"), "FRUSTRATED");
    }
}
