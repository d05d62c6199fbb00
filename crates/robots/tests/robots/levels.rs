//! The levels at which an emotion acts (the paper's Table 3), each switched off in a robot for an experiment: the emotion
//! stays, its effect goes.

use super::stage::{Role, Stage, feet};
use robots::FT_M;

/// Obstacles around her, without a gap.
fn wall() -> Vec<robot::Point> {
    (0..8)
        .flat_map(|i| [feet(2.0 * f64::from(i), 8.0), feet(8.0, 2.0 * f64::from(i))])
        .collect()
}

/// Butler in the middle, and Leguin behind a wall.
fn walled(seed: u64, butler: &str, leguin: &str) -> Stage {
    let cast = vec![
        Role::new("Butler", "Butler", feet(25.0, 25.0), butler),
        Role::new("Leguin", "Leguin", feet(4.0, 4.0), leguin),
    ];
    let mut stage = Stage::new(seed, cast);
    stage.obstacles = wall();
    stage.begin();
    stage
}

/// Location, behavior and sent commands of all robots, for ten minutes.
fn deeds(mut stage: Stage) -> Vec<String> {
    let mut deeds = Vec::new();
    for _ in 0..1200 {
        stage.step();
        for (robot, report) in &stage.reports {
            deeds.push(format!(
                "{robot} {:?} {}",
                report.proposal, report.behavior_state
            ));
        }
    }

    for sent in &stage.sent {
        deeds.push(format!("{sent:?}"));
    }
    deeds
}

#[test]
fn without_the_sensory_motor_level_concern_does_not_speed_leguin_up() {
    for (level, factor) in [("on", 1.5), ("off", 1.0)] {
        let mut stage = Stage::pair(
            5,
            "treat_mean_s = 1e9",
            &format!("sensory_motor = \"{level}\""),
        );
        stage.command("Leguin", "hurry");
        let is_fully_concerned = |stage: &Stage| stage.number("Leguin", "urgency") >= 0.55;
        assert!(stage.step_until(10.0, is_fully_concerned));
        stage.step();
        assert_eq!(
            (stage.emotion("Leguin"), stage.behavior("Leguin")),
            ("CONCERNED", "REFILL")
        );
        let speed_mps = stage.report("Leguin").speed_mps;
        assert!(
            (speed_mps - factor * 3.0 * FT_M).abs() < 1e-12,
            "{level}: {speed_mps} m/s"
        );
    }
}

#[test]
fn without_the_schematic_level_leguin_is_frustrated_and_goes_on() {
    for (level, behavior) in [("on", "GO_HOME"), ("off", "REFILL")] {
        let leguin = format!("block_patience_s = 10.0\nschematic = \"{level}\"");
        let mut stage = walled(17, "treat_mean_s = 1e9", &leguin);
        stage.command("Leguin", "hurry");
        assert!(
            stage.step_until(60.0, |stage| stage.emotion("Leguin") == "FRUSTRATED"),
            "{level}"
        );
        assert_eq!(stage.behavior("Leguin"), behavior, "{level}");
        if level == "off" {
            // What she feels still follows her progress.
            stage.obstacles.clear();
            assert!(stage.step_until(20.0, |stage| stage.emotion("Leguin") == "CONCERNED"));
            assert_eq!(stage.behavior("Leguin"), "REFILL");
        }
    }
}

#[test]
fn without_the_schematic_level_butler_is_frustrated_and_serves_on() {
    for (level, said, intercepts) in [
        ("on", vec!["refill", "hurry"], true),
        ("off", vec!["refill"], false),
    ] {
        let mut stage = walled(3, &format!("schematic = \"{level}\""), "");
        assert!(
            stage.step_until(120.0, |stage| stage.emotion("Butler") == "FRUSTRATED"),
            "{level}"
        );
        assert_eq!(stage.commands_of("Butler"), said, "{level}");
        let is_seen = stage.step_until(10.0, |stage| stage.behavior("Butler") == "INTERCEPT");
        assert_eq!(
            is_seen || stage.behavior("Butler") == "INTERCEPT",
            intercepts,
            "{level}"
        );
        assert!(
            stage.number("Butler", "intensity") > 0.5,
            "{level}: he feels it all the same"
        );
    }
}

#[test]
fn with_every_level_off_they_act_as_if_they_had_no_emotions_and_have_them() {
    let levels_off = "sensory_motor = \"off\"\nschematic = \"off\"";
    for seed in 0..4 {
        let felt = || Stage::pair(seed, "schematic = \"off\"", levels_off);
        let affectless = Stage::pair(seed, "affect = \"off\"", "affect = \"off\"");
        assert!(deeds(felt()) == deeds(affectless), "seed {seed}");
        let mut stage = felt();
        assert!(
            stage.step_until(120.0, |stage| stage.emotion("Butler") == "CONCERNED"),
            "seed {seed}"
        );
    }
}

#[test]
fn any_levels_together_make_a_team_that_works() {
    let mut distinct = Vec::new();
    for number in 0..8 {
        let [butler, sensory_motor, schematic] =
            [1, 2, 4].map(|bit| if number & bit == 0 { "on" } else { "off" });
        let leguin = format!("sensory_motor = \"{sensory_motor}\"\nschematic = \"{schematic}\"");
        let make = || Stage::pair(7, &format!("schematic = \"{butler}\""), &leguin);
        let mut stage = make();
        stage.step_until(600.0, |_| false);
        let exchanges = stage.number("Butler", "exchanges");
        assert!(
            exchanges >= 5.0,
            "Butler {butler}, Leguin {leguin}: {exchanges} exchanges"
        );
        distinct.push(deeds(make()));
    }
    // Butler's word and Leguin's speed are the levels that show on an open field, where no robot has to give up.
    distinct.sort();
    distinct.dedup();
    assert!(distinct.len() >= 3, "{} different runs", distinct.len());
}
