//! Robots who deliberate: beliefs, personality and the conceptual level each change what Butler does, with a refiller who is
//! walled in; and beliefs what Leguin does.

use std::collections::BTreeSet;

use super::stage::{self, Role, Stage, feet, reborn};
use robot::Robot;

const SEEDS: std::ops::Range<u64> = 0..8;

const BELIEFS: &str = "[deliberation]\nbeliefs = \"on\"";
const CONCEPTUAL: &str = "[deliberation]\nconceptual = \"on\"";
const BOTH: &str = "[deliberation]\nbeliefs = \"on\"\nconceptual = \"on\"";

/// Obstacles around the refiller's table, without a gap.
fn wall() -> Vec<robot::Point> {
    (0..8)
        .flat_map(|i| [feet(2.0 * f64::from(i), 8.0), feet(8.0, 2.0 * f64::from(i))])
        .collect()
}

/// Butler in the middle, and Leguin behind a wall.
fn walled(seed: u64, butler: Box<dyn Robot>, parameters: &str) -> Stage {
    let cast = vec![
        Role::played_by(butler, "Butler", feet(25.0, 25.0), parameters),
        Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
    ];
    let mut stage = Stage::new(seed, cast);
    stage.obstacles = wall();
    stage.begin();
    stage
}

fn butler() -> Box<dyn Robot> {
    Box::new(robots::Butler::default())
}

/// What Butler did and felt in ten minutes.
#[derive(Debug, Default, PartialEq)]
struct Deeds {
    intercept_ticks: usize,
    served: f64,
    commands: usize,
    emotions: BTreeSet<String>,
    plans: BTreeSet<String>,
    course: Vec<String>,
}

fn deeds(mut stage: Stage) -> Deeds {
    let mut deeds = Deeds::default();
    for _ in 0..1200 {
        stage.step();
        let report = stage.report("Butler");

        deeds.intercept_ticks += usize::from(report.behavior_state == "INTERCEPT");
        deeds.emotions.insert(report.emotion_state.clone());
        let plan = report.state_variables.get("plan");
        deeds
            .plans
            .extend(plan.and_then(|plan| Some(plan.as_str()?.to_owned())));
        deeds.course.push(format!("{report:?}"));
    }

    deeds.served = stage.number("Butler", "served");
    deeds.commands = stage.commands_of("Butler").len();
    deeds
}

/// The deeds of each seed.
fn arm(parameters: &str) -> Vec<Deeds> {
    SEEDS
        .map(|seed| deeds(walled(seed, butler(), parameters)))
        .collect()
}

fn sum(arm: &[Deeds], count: impl Fn(&Deeds) -> usize) -> usize {
    arm.iter().map(count).sum()
}

/// Number of seeds in which he spent another time intercepting.
fn differing(one: &[Deeds], other: &[Deeds]) -> usize {
    let pairs = one.iter().zip(other);
    pairs
        .filter(|(one, other)| one.intercept_ticks != other.intercept_ticks)
        .count()
}

#[test]
fn without_deliberation_he_has_no_beliefs_and_no_plans() {
    for deeds in arm("") {
        assert!(!deeds.emotions.contains("DISCOURAGED"));
        assert!(deeds.plans.is_empty());
    }
}

#[test]
fn a_butler_who_believes_that_he_cannot_is_discouraged_and_stops_calling_and_intercepting() {
    let reactive = arm("");
    let believing = arm(BELIEFS);

    for deeds in &believing {
        assert!(
            deeds.emotions.contains("DISCOURAGED"),
            "{:?}",
            deeds.emotions
        );
    }
    let intercept_ticks = |deeds: &Deeds| deeds.intercept_ticks;
    let believing_ticks = sum(&believing, intercept_ticks);
    let reactive_ticks = sum(&reactive, intercept_ticks);
    assert!(
        4 * believing_ticks < 3 * reactive_ticks,
        "{believing_ticks} of {reactive_ticks} ticks"
    );
    let commands = |deeds: &Deeds| deeds.commands;
    assert!(sum(&believing, commands) < sum(&reactive, commands));
}

#[test]
fn a_discouraged_butler_does_nothing_about_it_until_the_refiller_comes_nearer() {
    for seed in SEEDS {
        let mut stage = walled(seed, butler(), BELIEFS);
        assert!(stage.step_until(600.0, |stage| stage.emotion("Butler") == "DISCOURAGED"));

        let sent = stage.commands_of("Butler").len();
        let mut calm_ticks = 0;
        while calm_ticks < 60 && stage.emotion("Butler") == "DISCOURAGED" {
            stage.step();
            calm_ticks += 1;
            assert_ne!(stage.behavior("Butler"), "INTERCEPT", "seed {seed}");
        }
        assert_eq!(stage.commands_of("Butler").len(), sent, "seed {seed}");

        // The wall falls, and a person sends her.
        stage.obstacles.clear();
        stage.command("Leguin", "hurry");
        let exchanges = stage.number("Butler", "exchanges");
        assert!(
            stage.step_until(60.0, |stage| stage.emotion("Butler") == "HOPEFUL"),
            "seed {seed}"
        );
        assert!(
            stage.step_until(120.0, |stage| stage.number("Butler", "exchanges")
                > exchanges),
            "seed {seed}"
        );
        assert!(
            stage.step_until(60.0, |stage| stage.emotion("Butler") == "HAPPY"),
            "seed {seed}"
        );
    }
}

#[test]
fn the_conceptual_level_finds_other_strategies_than_the_action_tendency() {
    let reactive = arm("");
    let planning = arm(CONCEPTUAL);

    let mut plans = BTreeSet::new();
    for deeds in &planning {
        assert!(deeds.emotions.contains("FRUSTRATED"));
        plans.extend(deeds.plans.iter().map(String::as_str));
    }
    assert!(plans.len() >= 2, "{plans:?}");
    assert!(differing(&planning, &reactive) >= 6);

    // He learns that it leads nowhere, and intercepts less.
    let intercept_ticks = |deeds: &Deeds| deeds.intercept_ticks;
    assert!(sum(&planning, intercept_ticks) < sum(&reactive, intercept_ticks));
}

#[test]
fn preferences_change_his_plans() {
    let seeking = arm(&format!("{CONCEPTUAL}\npreferences = [\"seek_positive\"]"));
    let avoiding = arm(&format!("{CONCEPTUAL}\npreferences = [\"avoid_negative\"]"));

    assert!(differing(&seeking, &avoiding) >= 6);
}

#[test]
fn caution_changes_what_a_deliberating_butler_does() {
    let careless = arm(&format!("caution = 0.1\n{BOTH}"));
    let careful = arm(&format!("caution = 0.9\n{BOTH}"));

    assert!(differing(&careless, &careful) >= 6);
}

#[test]
fn saved_and_restored_he_deliberates_identically() {
    let straight = deeds(walled(3, butler(), BOTH));
    assert!(straight.emotions.contains("DISCOURAGED"));
    assert!(!straight.plans.is_empty());

    for at_tick in (1..400).step_by(7) {
        let butler = Box::new(reborn::Butler::saved(at_tick));
        let saved = deeds(walled(3, butler, BOTH));
        assert!(saved == straight, "saved at tick {at_tick}");
    }
}

#[test]
fn a_later_incarnation_believes_what_the_lost_one_did() {
    let mut straight = walled(3, butler(), BELIEFS);
    assert!(straight.step_until(600.0, |stage| stage.emotion("Butler") == "DISCOURAGED"));

    let lost_at = straight.tick + 2;
    let lost = Box::new(reborn::Butler::lost(lost_at));
    let mut stage = walled(3, lost, BELIEFS);
    while stage.tick + 1 < lost_at {
        stage.step();
    }
    let belief = |stage: &Stage| {
        let belief = stage.report("Butler").state_variables.get("belief");
        belief.and_then(|belief| Some(belief.as_str()?.to_owned()))
    };
    assert_eq!(belief(&stage).as_deref(), Some("cannot"));

    stage.step();
    assert_eq!(stage.emotion("Butler"), "DISCOURAGED");
    assert_eq!(belief(&stage).as_deref(), Some("cannot"));
}

#[test]
fn deliberation_without_sense_is_refused() {
    for (wrong, reason) in [
        (
            "discouraged_after = 0",
            "discouraged_after must be at least 1",
        ),
        ("plan_s = 0.0", "plan_s must be above 0"),
        (
            "level = { readiness = -1.0 }",
            "deliberation.level: readiness",
        ),
    ] {
        let text = format!("[deliberation]\n{wrong}");
        let parameters: robots::butler::ButlerParameters = toml::from_str(&text).unwrap();
        let error = robots::Butler::new(parameters).err().unwrap_or_default();
        assert!(error.contains(reason), "{error}");
    }
}

/// The texts of a robot's belief and of what led to it; empty without one.
fn belief(stage: &Stage, robot: &str) -> [String; 2] {
    let variables = &stage.report(robot).state_variables;
    ["belief", "belief_because"].map(|name| {
        let text = variables.get(name).and_then(|value| value.as_str());
        text.unwrap_or_default().to_owned()
    })
}

const DESPAIRING: &str =
    "block_patience_s = 10.0\ndeliberation = { beliefs = 'on', discouraged_after = 1 }";

#[test]
fn a_leguin_who_believes_that_she_cannot_is_discouraged_and_does_not_set_out() {
    let mut stage = Stage::walled_in(DESPAIRING);
    assert!(stage.step_until(120.0, |stage| stage.emotion("Leguin") == "DISCOURAGED"));
    assert_eq!(belief(&stage, "Leguin"), ["cannot", "1 errand given up"]);
    assert_eq!(
        stage.report("Leguin").state_variables["agency"].to_string(),
        "self"
    );
    assert!(stage.step_until(60.0, |stage| stage.behavior("Leguin") == "WAIT"));

    // She remembers the call, and waits.
    stage.command("Leguin", "refill");
    assert!(!stage.step_until(60.0, |stage| stage.behavior("Leguin") != "WAIT"));
    assert_eq!(stage.emotion("Leguin"), "DISCOURAGED");
    assert_eq!(
        stage.report("Leguin").state_variables["pending"].to_string(),
        "refill"
    );
}

#[test]
fn a_discouraged_leguin_is_hopeful_and_sets_out_when_the_waiter_is_near() {
    let mut stage = Stage::walled_in(DESPAIRING);
    assert!(stage.step_until(120.0, |stage| stage.emotion("Leguin") == "DISCOURAGED"));
    assert!(stage.step_until(60.0, |stage| stage.behavior("Leguin") == "WAIT"));
    stage.command("Leguin", "refill");
    stage.step();

    // Butler stands next to her now: where he wanted to go is taken.
    stage.obstacles = vec![stage.report("Butler").proposal];
    stage.places.insert(stage::name("Butler"), feet(9.0, 4.0));
    assert!(stage.step_until(3.0, |stage| stage.emotion("Leguin") == "HOPEFUL"));
    assert_eq!(belief(&stage, "Leguin"), ["can", "Butler is near"]);
    let progress_by = stage.report("Leguin").state_variables["progress_by"].to_string();
    assert_eq!(
        progress_by, "encouraged",
        "that she can is a positive input"
    );
    assert!(stage.step_until(2.0, |stage| stage.behavior("Leguin") == "REFILL"));
}

#[test]
fn without_beliefs_leguin_sets_out_again_and_again() {
    let mut stage = Stage::walled_in("block_patience_s = 10.0");
    for _ in 0..3 {
        assert!(stage.step_until(60.0, |stage| stage.behavior("Leguin") == "GO_HOME"));
        assert!(stage.step_until(60.0, |stage| stage.behavior("Leguin") == "WAIT"));
        stage.command("Leguin", "refill");
        assert!(stage.step_until(2.0, |stage| stage.behavior("Leguin") == "REFILL"));
    }
    assert_eq!(belief(&stage, "Leguin"), ["", ""]);
}

#[test]
fn a_discouraged_robot_says_why_and_a_later_incarnation_still_knows() {
    let parameters = "[deliberation]\nbeliefs = \"on\"";
    let mut stage = walled(0, butler(), parameters);
    assert!(stage.step_until(600.0, |stage| stage.emotion("Butler") == "DISCOURAGED"));
    assert_eq!(belief(&stage, "Butler"), ["cannot", "2 chases given up"]);

    let at_tick = stage.tick + 1;
    let mut stage = walled(0, Box::new(reborn::Butler::lost(at_tick)), parameters);
    while stage.tick < at_tick {
        stage.step();
    }
    assert_eq!(belief(&stage, "Butler"), ["cannot", "2 chases given up"]);
}

#[test]
fn a_discouraged_butler_does_not_act_by_what_he_repeats_or_sees_either() {
    for more in ["resend = 'on'", "signals = 'on'"] {
        let parameters = format!("{more}\n{BELIEFS}");
        let mut stage = walled(0, butler(), &parameters);
        assert!(stage.step_until(600.0, |stage| stage.emotion("Butler") == "DISCOURAGED"));
        let sent = stage.commands_of("Butler").len();
        while stage.emotion("Butler") == "DISCOURAGED" && stage.tick < 2400 {
            stage.step();
            assert_ne!(stage.behavior("Butler"), "INTERCEPT", "{more}");
        }
        assert!(stage.commands_of("Butler").len() <= sent + 1, "{more}");
    }
}
