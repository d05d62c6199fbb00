//! The robot of `docs/new-robot.md`: the page shows the code that is compiled here, and the robot does what the page says.

#[path = "../../examples/vera.rs"]
#[expect(dead_code, reason = "its `main` is for the process")]
mod vera;

use std::sync::Arc;

use super::stage::{self, Role, Stage, feet};
use lockstep::{Begin, Turn};
use robot::{
    PeerNetwork, PublicState, RobotName, Runner, SensedBody, SensedKind, Tick, TickUpdate,
    Undelivered, Widget,
};

const PAGE: &str = include_str!("../../../../docs/new-robot.md");

/// The text that the page shows for a file.
fn shown(file: &str) -> &'static str {
    let (_, after) = PAGE.split_once(&format!("**`{file}`**")).unwrap();
    let (_, block) = after.split_once("\n```").unwrap();
    let (_, text) = block.split_once('\n').unwrap();
    &text[..=text.find("\n```").unwrap()]
}

#[test]
fn the_page_shows_the_files_as_they_are() {
    let code = include_str!("../../examples/vera.rs");
    assert_eq!(shown("crates/robots/examples/vera.rs"), code);
    assert_eq!(
        shown("crates/robots/examples/vera.toml"),
        include_str!("../../examples/vera.toml")
    );
    assert!(code.lines().count() < 100, "{} lines", code.lines().count());
    for (lines, file) in [
        (code, "Rust"),
        (include_str!("../../examples/vera.toml"), "that say"),
    ] {
        let words = format!("{} lines", lines.lines().count());
        assert!(
            PAGE.contains(&words),
            "the page does not speak of {words} of {file}"
        );
    }
}

/// Vera, 20 ft from a party in the middle of the field.
fn party(parameters: &str) -> Stage {
    let (robot, at, party) = (
        Box::new(vera::Vera::default()),
        feet(5.0, 25.0),
        feet(25.0, 25.0),
    );
    let text = format!(
        "speed_mps = 1.0\nparty_m = {{ x = {}, y = {} }}\n{parameters}",
        party.x, party.y
    );
    let mut stage = Stage::new(1, vec![Role::played_by(robot, "Vera", at, &text)]);
    stage.guests = [
        (22.0, 28.0),
        (22.0, 22.0),
        (28.0, 28.0),
        (28.0, 22.0),
        (25.0, 30.0),
    ]
    .map(|(x, y)| feet(x, y))
    .into();
    stage.begin();
    stage
}

/// Her emotion, her behavior and her distance from the party, over one minute.
fn minute(mut stage: Stage) -> Vec<(String, String, f64)> {
    let mut minute = Vec::new();
    for _ in 0..120 {
        stage.step();
        let away_m = stage.at("Vera").distance_m(feet(25.0, 25.0));
        minute.push((
            stage.emotion("Vera").to_owned(),
            stage.behavior("Vera").to_owned(),
            away_m,
        ));
    }
    minute
}

#[test]
fn vera_becomes_shy_where_too_many_stand_and_hides_until_she_is_calm() {
    let minute = minute(party("bearable = 4"));
    let mut states: Vec<(&str, &str)> = minute
        .iter()
        .map(|(emotion, behavior, _)| (emotion.as_str(), behavior.as_str()))
        .collect();
    states.dedup();
    assert_eq!(
        states[..3],
        [("CALM", "MINGLE"), ("SHY", "HIDE"), ("CALM", "MINGLE")]
    );
    let shy = minute
        .iter()
        .position(|(emotion, ..)| emotion == "SHY")
        .unwrap();
    let calm = shy
        + minute[shy..]
            .iter()
            .position(|(emotion, ..)| emotion == "CALM")
            .unwrap();
    assert!(minute[shy].2 < minute[0].2, "she came nearer");
    assert!(minute[calm].2 > minute[shy].2 + 1.0, "she went away");
}

#[test]
fn vera_publishes_what_she_feels_and_why() {
    let mut stage = party("bearable = 4");
    assert!(stage.step_until(60.0, |stage| stage.emotion("Vera") == "SHY"));

    assert_eq!(stage.number("Vera", "valence"), -1.0);
    assert_eq!(stage.number("Vera", "goal_congruence"), -1.0);
    let agency = stage.report("Vera").state_variables.get("agency").cloned();
    assert_eq!(agency, Some("the crowd".into()));

    assert!(stage.step_until(60.0, |stage| stage.emotion("Vera") == "CALM"));
    assert!(stage.number("Vera", "valence") > 0.7);
}

#[test]
fn vera_who_can_bear_more_stays() {
    let minute = minute(party("bearable = 50"));
    assert!(
        minute.iter().all(
            |(emotion, behavior, _)| (emotion.as_str(), behavior.as_str()) == ("CALM", "MINGLE")
        )
    );
    let (_, _, away_m) = minute.last().unwrap();
    assert!(*away_m < 1e-9, "she is in the middle, {away_m} m from it");
}

#[test]
#[should_panic(expected = "bareable")]
fn a_misspelled_parameter_of_vera_is_refused() {
    party("bearable = 4\nbareable = 5");
}

/// No robot but her.
struct Alone;

impl PeerNetwork for Alone {
    fn state_of(&mut self, _: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        Err(Undelivered::Lost)
    }
}

/// A tick with so many guests around her.
fn turn(tick: Tick, near: usize) -> Turn<TickUpdate> {
    let guest = SensedBody {
        kind: SensedKind::Guest,
        location: feet(30.0, 30.0),
    };
    let news = TickUpdate {
        epoch: 1,
        tick,
        bodies: vec![guest; near],
        ..TickUpdate::default()
    };

    Turn {
        epoch: 1,
        tick,
        begin: if tick == 0 { Begin::Init } else { Begin::GoOn },
        news: Some(news),
    }
}

#[test]
fn vera_accounts_for_what_she_feels() {
    let text = "bearable = 4\nspeed_mps = 1.0\nparty_m = { x = 1.0, y = 1.0 }";
    let welcome = stage::welcome(
        "Vera",
        feet(5.0, 5.0),
        1,
        &[stage::name("Vera")],
        stage::parameters(text),
    );
    let mut runner = Runner::new(Box::new(vera::Vera::default()), welcome);
    runner.run(&turn(0, 0), &mut Alone).unwrap();
    let mut why = |tick, near| {
        runner.run(&turn(tick, near), &mut Alone).unwrap();
        match runner.panel().widgets.as_slice() {
            [Widget::Text { text, .. }] => text.clone(),
            widgets => panic!("{widgets:?}"),
        }
    };
    assert_eq!(why(1, 3), "I have room.");
    assert_eq!(
        why(2, 4),
        "4 are around me; because of this I want to hide."
    );
}
