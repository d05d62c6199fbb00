//! The components of an emotion: each has the direction that its name says, in the situation that names it.

use super::stage::{self, Role, Stage, feet};
use affect::{CausalChain, ClauseKind};

/// Butler in the middle, Leguin at the table, and all commands lost.
fn deaf(seed: u64) -> Stage {
    let mut stage = Stage::new(
        seed,
        vec![
            Role::new(
                "Butler",
                "Butler",
                feet(25.0, 25.0),
                "intercept_any = false",
            ),
            Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
        ],
    );
    stage.drops = Box::new(|_| true);
    stage.begin();
    stage
}

fn text(stage: &Stage, robot: &str, variable: &str) -> String {
    stage.report(robot).state_variables[variable].to_string()
}

fn is(emotion: &'static str, robot: &'static str) -> impl FnMut(&Stage) -> bool {
    move |stage| stage.emotion(robot) == emotion
}

#[test]
fn a_butler_who_serves_owes_nothing_and_nothing_is_new() {
    let mut stage = Stage::pair(1, "", "");
    for _ in 0..12 {
        stage.step();
    }

    assert_eq!(stage.emotion("Butler"), "HAPPY");
    assert_eq!(text(&stage, "Butler", "agency"), "self");
    assert_eq!(text(&stage, "Butler", "focality"), "event: the service");
    assert_eq!(text(&stage, "Butler", "duration"), "minutes");
    assert_eq!(stage.number("Butler", "duration_s"), 6.0);
    assert_eq!(stage.number("Butler", "caution"), 0.5);
    assert_eq!(stage.number("Butler", "external_norms"), 1.0);
    assert_eq!(stage.number("Butler", "internal_standards"), 1.0);
    assert!(stage.number("Butler", "novelty") < 0.1);
    // Leguin does not come without a call.
    assert_eq!(stage.number("Butler", "modifiability"), 0.0);
    assert_eq!(stage.number("Butler", "controllability"), 1.0);

    // She waits for one, which others send.
    assert_eq!(text(&stage, "Leguin", "focality"), "event: the rest");
    assert_eq!(stage.number("Leguin", "modifiability"), 1.0);
}

#[test]
fn a_butler_who_is_let_down_blames_leguin_and_falls_short() {
    for seed in 0..8 {
        let mut stage = deaf(seed);
        assert!(stage.step_until(120.0, is("FRUSTRATED", "Butler")));
        assert_eq!(text(&stage, "Butler", "agency"), "Leguin");
        assert_eq!(text(&stage, "Butler", "focality"), "event: the delay");
        assert!(stage.number("Butler", "goal_congruence") < -0.5);
        assert_eq!(stage.number("Butler", "controllability"), 0.0);
        assert_eq!(
            stage.number("Butler", "modifiability"),
            0.0,
            "no call has reached her"
        );

        // His tray is empty now: guests ask in vain.
        stage.step_until(60.0, |_| false);
        assert_eq!(stage.number("Butler", "treats"), 0.0);
        assert!(stage.number("Butler", "external_norms") < 0.7);
        assert!(stage.number("Butler", "internal_standards") < 0.7);
    }
}

#[test]
fn an_akr4_butler_blames_leguin_for_his_frustration_and_anger_from_the_beginning() {
    let mut stage = Stage::pair(3, "dynamics.state_set = 'akr4'\nintercept_any = false", "");
    stage.drops = Box::new(|_| true);
    assert!(stage.step_until(120.0, is("FRUSTRATED", "Butler")));
    assert_eq!(text(&stage, "Butler", "agency"), "Leguin");
    assert!(stage.step_until(120.0, is("ANGRY", "Butler")));
    assert_eq!(text(&stage, "Butler", "agency"), "Leguin");
    assert_eq!(stage.number("Butler", "duration_s"), 0.0);
}

#[test]
fn an_exchange_after_a_delay_is_new_and_butlers_own_doing() {
    let mut stage = Stage::pair(1, "", "");
    stage.drops = Box::new(|sent| sent.command != "go home");
    let mut newest: f64 = 0.0;
    assert!(stage.step_until(120.0, |stage| stage.behavior("Butler") == "EXCHANGE"));
    assert!(stage.step_until(5.0, |stage| {
        newest = newest.max(stage.number("Butler", "novelty"));
        stage.behavior("Butler") == "GO_BACK"
    }));

    assert!(newest > 0.5, "{newest}");
    assert_eq!(stage.emotion("Butler"), "HAPPY");
    assert_eq!(text(&stage, "Butler", "agency"), "self");
    assert_eq!(text(&stage, "Butler", "focality"), "event: the exchange");
    assert_eq!(stage.number("Butler", "goal_congruence"), 1.0);
}

#[test]
fn a_refiller_who_comes_changes_the_situation_and_one_who_cannot_be_asked_may() {
    let mut stage = Stage::pair(1, "", "");
    assert!(stage.step_until(120.0, |stage| stage.behavior("Leguin") == "REFILL"));
    stage.step();
    assert_eq!(stage.number("Butler", "modifiability"), 1.0);
    assert_eq!(stage.number("Butler", "certainty"), 1.0);

    stage.cuts = Box::new(|_, _, _| true);
    stage.step_until(2.0, |_| false);
    let certainty = stage.number("Butler", "certainty");
    assert!(certainty > 0.0 && certainty < 1.0, "{certainty}");
    stage.cuts = Box::new(|_, _, _| true);
    if stage.step_until(8.0, |stage| stage.number("Butler", "certainty") == 0.0) {
        stage.step();
        assert_eq!(stage.number("Butler", "modifiability"), 0.5);
    } else {
        panic!("answers that he does not get stay certain");
    }
}

#[test]
fn a_leguin_who_is_told_to_hurry_holds_butler_responsible() {
    let mut stage = Stage::pair(1, "treat_mean_s = 1e9", "");
    stage.command("Leguin", "hurry");
    assert!(stage.step_until(10.0, is("CONCERNED", "Leguin")));
    assert_eq!(text(&stage, "Leguin", "agency"), "Butler");
    assert_eq!(text(&stage, "Leguin", "focality"), "event: the call");
    assert!(stage.number("Leguin", "goal_congruence") < 0.0);
    assert!(stage.number("Leguin", "novelty") > 0.3 || stage.tick < 12);
}

#[test]
fn a_leguin_who_is_blocked_holds_the_crowd_responsible_and_fails_her_own_standards() {
    let mut stage = Stage::walled_in("");
    assert!(stage.step_until(10.0, |stage| stage.behavior("Leguin") == "REFILL"));
    assert_eq!(stage.number("Leguin", "internal_standards"), 1.0);
    assert_eq!(stage.number("Leguin", "external_norms"), 1.0);

    assert!(stage.step_until(60.0, is("CONCERNED", "Leguin")));
    assert_eq!(text(&stage, "Leguin", "agency"), "the crowd");
    assert_eq!(text(&stage, "Leguin", "focality"), "event: the blocked way");
    assert!(stage.number("Leguin", "controllability") < 0.7);
    assert_eq!(
        stage.number("Leguin", "modifiability"),
        0.5,
        "a crowd may move"
    );

    assert!(stage.step_until(60.0, is("FRUSTRATED", "Leguin")));
    assert_eq!(text(&stage, "Leguin", "agency"), "the crowd");
    assert!(stage.number("Leguin", "controllability") < 0.3);

    assert_eq!(stage.behavior("Leguin"), "GO_HOME");
    stage.step();
    assert_eq!(stage.number("Leguin", "internal_standards"), 0.0);
    let norms = stage.number("Leguin", "external_norms");
    assert!(norms < 0.9, "his call is overdue: {norms}");
}

#[test]
fn what_is_decided_when_an_episode_begins_is_kept_until_it_ends() {
    for seed in 0..8 {
        let mut stage = Stage::pair(seed, "", "");
        let decided = |stage: &Stage, robot: &str| {
            ["agency", "focality", "causal_chain"].map(|variable| text(stage, robot, variable))
        };

        for _ in 0..600 {
            let before = ["Butler", "Leguin"].map(|robot| {
                let lasted_s = stage.number(robot, "duration_s");
                (
                    stage.emotion(robot).to_owned(),
                    lasted_s,
                    decided(&stage, robot),
                )
            });
            stage.step();
            for (robot, (emotion, lasted_s, was)) in ["Butler", "Leguin"].into_iter().zip(before) {
                let now_s = stage.number(robot, "duration_s");
                if stage.emotion(robot) == emotion {
                    assert_eq!(now_s, lasted_s + stage::TICK_S, "seed {seed}, {robot}");
                    assert_eq!(decided(&stage, robot), was, "seed {seed}, {robot}");
                } else {
                    assert_eq!(now_s, 0.0, "seed {seed}, {robot}");
                }
                let is_happy = stage.emotion(robot) == "HAPPY";
                assert!(!is_happy || text(&stage, robot, "agency") == "self");
            }
        }
    }
}

#[test]
fn the_causal_chain_has_the_goal_and_whether_it_is_achieved() {
    let mut stage = deaf(2);
    let chain = |stage: &Stage| CausalChain::read(&text(stage, "Butler", "causal_chain")).unwrap();
    let kinds = |stage: &Stage| {
        let chain = chain(stage);
        let clauses = chain.clauses().iter();
        clauses.map(|clause| clause.kind).collect::<Vec<_>>()
    };
    assert!(kinds(&stage).contains(&ClauseKind::AchievedGoal));

    assert!(stage.step_until(120.0, is("CONCERNED", "Butler")));
    assert!(kinds(&stage).contains(&ClauseKind::Goal));
    let treats = stage.number("Butler", "treats");
    assert_eq!(
        chain(&stage).spoken(),
        format!(
            "I want to serve the guests; I have {treats} treats left; Leguin is not here; something bad can happen soon; I do \
             not want it; I do not know if it will happen; because of this I feel bad."
        )
    );
}

#[test]
fn a_mood_is_what_was_felt_and_a_bad_one_makes_a_robot_call_sooner() {
    let first_call_s = |start: f64| {
        let butler = format!("mood = {{ start = {start:?}, tau_s = 1e9, weight = 0.3 }}");
        let mut stage = Stage::pair(1, &butler, "");
        assert!((stage.number("Butler", "mood") - start).abs() < 1e-6);
        assert!(stage.step_until(120.0, |stage| !stage.commands_of("Butler").is_empty()));
        stage.tick as f64 * stage::TICK_S
    };
    let [bad, none, good] = [-0.8, 0.0, 0.8].map(first_call_s);
    assert!(bad < none && none < good, "{bad} s, {none} s, {good} s");

    // A mood is the slow mean of what is felt.
    for seed in 0..4 {
        let mut stage = deaf(seed);
        let quick = "mood = { tau_s = 30.0 }";
        let mut quick = Stage::new(
            seed,
            vec![Role::new("Butler", "Butler", feet(25.0, 25.0), quick)],
        );
        quick.begin();
        stage.step_until(120.0, |_| false);
        quick.step_until(120.0, |_| false);
        assert!(stage.number("Butler", "mood").abs() < 0.01, "a day is long");
        assert!(quick.number("Butler", "mood") < -0.5, "nobody comes");
    }
}

#[test]
fn a_mood_outlasts_the_process_of_its_robot() {
    let mut stage = Stage::new(
        3,
        vec![
            Role::played_by(
                Box::new(stage::reborn::Butler::lost(40)),
                "Butler",
                feet(25.0, 25.0),
                "mood = { start = -0.5 }",
            ),
            Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
        ],
    );
    stage.begin();
    for _ in 0..60 {
        let before = stage.number("Butler", "mood");
        stage.step();
        assert!((stage.number("Butler", "mood") - before).abs() < 1e-4);
    }
}
