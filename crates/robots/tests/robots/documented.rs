//! What is documented of the two robots, as far as a robot or two on an open field can show it. The tests are numbered:
//! `t03`, `t04`, `t19` and `t22` are the affect library's, what takes whole halls (`t12`, `t13`, `t15`, `t20`, `t21`) is in
//! the system tests, `t24` is the EmotionML export's.

use super::stage::{self, FT_M, Role, Stage, feet, name};
use robots::butler::{self, ButlerAct};
use robots::leguin;
use robots::policy::Urge;

/// Loses every command.
fn deaf(seed: u64, butler: &str) -> Stage {
    let mut stage = Stage::new(
        seed,
        vec![
            Role::new("Butler", "Butler", feet(25.0, 25.0), butler),
            Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
        ],
    );
    stage.drops = Box::new(|_| true);
    stage.begin();
    stage
}

/// Butler with treats for ever, so that only the test tells Leguin what to do.
const CONTENT: &str = "treat_mean_s = 1e9";

#[test]
fn t01_both_start_happy_with_a_full_tray_and_at_rest() {
    let stage = Stage::pair(1, "", "");
    assert_eq!(
        (stage.emotion("Butler"), stage.behavior("Butler")),
        ("HAPPY", "SERVE")
    );
    assert_eq!(stage.number("Butler", "treats"), 30.0);
    assert_eq!(
        (stage.emotion("Leguin"), stage.behavior("Leguin")),
        ("HAPPY", "WAIT")
    );
    assert_eq!(stage.report("Leguin").speed_mps, 0.0);
}

#[test]
fn t02_without_a_refiller_emotions_rise_in_order_and_each_message_is_sent_once() {
    for seed in 0..32 {
        let mut stage = deaf(seed, "");
        let mut emotions = vec!["HAPPY".to_owned()];
        let intercepts = stage.step_until(120.0, |stage| {
            if emotions
                .last()
                .is_none_or(|last| last != stage.emotion("Butler"))
            {
                emotions.push(stage.emotion("Butler").to_owned());
            }
            stage.behavior("Butler") == "INTERCEPT"
        });
        assert!(intercepts, "seed {seed}");
        assert_eq!(
            emotions,
            ["HAPPY", "CONFIDENT", "CONCERNED", "FRUSTRATED"],
            "seed {seed}"
        );
        assert_eq!(
            stage.commands_of("Butler"),
            ["refill", "hurry"],
            "seed {seed}"
        );
    }
}

#[test]
fn t05_exchange_only_within_four_feet_and_in_need_and_it_fills_the_tray() {
    for seed in 0..16 {
        let mut stage = Stage::pair(seed, "", "");
        let mut exchanges = 0;
        for _ in 0..1200 {
            let (before, needed) = (
                stage.behavior("Butler").to_owned(),
                stage.flag("Butler", "need"),
            );
            stage.step();
            let now = stage.behavior("Butler");
            if now == "EXCHANGE" && before != "EXCHANGE" {
                assert!(
                    stage.apart_ft("Butler", "Leguin") <= 4.0 && needed,
                    "seed {seed}, tick {}",
                    stage.tick
                );
                assert_eq!(
                    stage.behavior("Leguin"),
                    "EXCHANGE",
                    "seed {seed}, tick {}",
                    stage.tick
                );
            }
            if before == "EXCHANGE" && now != "EXCHANGE" {
                assert_eq!(stage.number("Butler", "treats"), 30.0);
                assert!(!stage.flag("Butler", "need"));
                assert_eq!(stage.emotion("Butler"), "HAPPY");
                exchanges += 1;
            }
        }
        assert!(exchanges >= 10, "seed {seed}: {exchanges} exchanges");
    }
}

#[test]
fn t06_exchange_is_reached_from_serving_and_from_intercepting() {
    let before_exchange = |mut stage: Stage| {
        let mut before = String::new();
        let met = stage.step_until(200.0, |stage| {
            let is_met = stage.behavior("Butler") == "EXCHANGE";
            if !is_met {
                before = stage.behavior("Butler").to_owned();
            }
            is_met
        });
        assert!(met);
        before
    };
    assert_eq!(before_exchange(Stage::pair(1, "", "")), "SERVE");
    assert_eq!(before_exchange(deaf(1, "")), "INTERCEPT");
}

#[test]
fn t07_after_the_exchange_leguin_stands_until_she_is_sent_home() {
    let mut stage = Stage::pair(3, "", "");
    stage.drops = Box::new(|sent| sent.command == "go home");
    assert!(stage.step_until(120.0, |stage| stage.behavior("Leguin") == "AWAIT_GO_HOME"));
    let at = stage.at("Leguin");
    for _ in 0..10 {
        assert_eq!(stage.behavior("Butler"), "GO_BACK");
        assert_eq!(
            (stage.behavior("Leguin"), stage.report("Leguin").speed_mps),
            ("AWAIT_GO_HOME", 0.0)
        );
        stage.step();
    }
    assert_eq!(stage.at("Leguin"), at);
    let sent_home = stage
        .commands_of("Butler")
        .into_iter()
        .filter(|command| *command == "go home");
    assert_eq!(sent_home.count(), 1);
    stage.command("Leguin", "go home");
    stage.step();
    assert_eq!(stage.behavior("Leguin"), "GO_HOME");
}

#[test]
fn t08_at_the_table_leguin_waits_for_refill_or_hurry() {
    for (command, emotion) in [("refill", "CONFIDENT"), ("hurry", "CONCERNED")] {
        let mut stage = Stage::pair(4, CONTENT, "");
        assert!(!stage.step_until(30.0, |stage| stage.behavior("Leguin") != "WAIT"));
        assert_eq!(
            (stage.at("Leguin"), stage.report("Leguin").speed_mps),
            (feet(4.0, 4.0), 0.0)
        );
        stage.command("Leguin", command);
        stage.step();
        assert_eq!(stage.behavior("Leguin"), "REFILL", "{command}");
        // The urgency rises to the pressure of the errand.
        assert!(stage.step_until(2.5, |stage| stage.emotion("Leguin") == emotion));
        stage.step();
        assert!(stage.report("Leguin").speed_mps > 0.0);
    }
}

#[test]
fn t08_other_words_do_not_move_her() {
    let mut stage = Stage::pair(4, CONTENT, "");
    for command in ["go home", "REFILL", "come", &"x".repeat(4096)] {
        stage.command("Leguin", command);
        stage.step();
        assert_eq!(stage.behavior("Leguin"), "WAIT", "{command}");
        assert!(
            stage
                .report("Leguin")
                .log
                .iter()
                .all(|line| line.len() < 200)
        );
    }
}

#[test]
fn t09_hurry_on_the_way_makes_her_concerned_and_faster() {
    let mut stage = Stage::pair(5, CONTENT, "");
    stage.command("Leguin", "refill");
    assert!(stage.step_until(5.0, |stage| stage.emotion("Leguin") == "CONFIDENT"));
    let speed_mps = stage.report("Leguin").speed_mps;
    assert_eq!(speed_mps, 3.0 * FT_M);
    stage.command("Leguin", "hurry");
    stage.step();
    stage.step();
    assert_eq!(
        (stage.emotion("Leguin"), stage.behavior("Leguin")),
        ("CONCERNED", "REFILL")
    );
    assert!(stage.report("Leguin").speed_mps / speed_mps > 1.3);
    assert!(
        stage.step_until(1.5, |stage| stage.report("Leguin").speed_mps / speed_mps
            > 1.5 - 1e-12)
    );
}

#[test]
fn t10_intercepting_brings_them_nearer_and_serves_no_guest() {
    for seed in 0..16 {
        let mut stage = deaf(seed, "");
        assert!(stage.step_until(120.0, |stage| stage.behavior("Butler") == "INTERCEPT"));
        let mut apart_ft = stage.apart_ft("Butler", "Leguin");
        let treats = stage.number("Butler", "treats");
        let met = stage.step_until(60.0, |stage| {
            let now_ft = stage.apart_ft("Butler", "Leguin");
            assert!(now_ft <= apart_ft, "seed {seed}, tick {}", stage.tick);
            apart_ft = now_ft;
            if stage.behavior("Butler") == "INTERCEPT" {
                assert_eq!(stage.number("Butler", "treats"), treats);
            }
            stage.behavior("Butler") == "EXCHANGE"
        });
        assert!(met, "seed {seed}");
    }
}

#[test]
fn t11_going_back_ends_at_the_start_and_may_come_too_late() {
    let mut was_too_late = false;
    for seed in 0..32 {
        // A short supply, so that the way back matters; a refiller who is met far from the start.
        let mut stage = Stage::pair(seed, "treat_mean_s = 0.2\ntreat_capacity = 10", "");
        stage.drops = Box::new(|sent| sent.command != "go home");
        assert!(
            stage.step_until(120.0, |stage| stage.behavior("Butler") == "GO_BACK"),
            "seed {seed}"
        );
        let is_back = stage.step_until(60.0, |stage| {
            was_too_late |=
                stage.behavior("Butler") == "GO_BACK" && stage.number("Butler", "treats") == 0.0;
            stage.behavior("Butler") != "GO_BACK"
        });
        if is_back && stage.behavior("Butler") == "SERVE" {
            assert!(
                stage.at("Butler").distance_m(feet(25.0, 25.0)) <= 1.5 * FT_M,
                "seed {seed}"
            );
        } else {
            assert_eq!(stage.behavior("Butler"), "EXCHANGE", "seed {seed}");
        }
    }
    assert!(was_too_late);
}

/// The hall with a third robot.
fn trio(seed: u64, butler: &str) -> Stage {
    let mut stage = Stage::new(
        seed,
        vec![
            Role::new("Butler", "Butler", feet(25.0, 25.0), butler),
            Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
            Role::new("Vonda", "Vonda", feet(46.0, 4.0), ""),
        ],
    );
    stage.begin();
    stage
}

#[test]
fn t14_vonda_stands_still_until_butler_calls_her() {
    for (called, idle) in [("Leguin", "Vonda"), ("Vonda", "Leguin")] {
        let mut stage = trio(6, &format!("refiller = \"{called}\""));
        let at = stage.at(idle);
        for _ in 0..1200 {
            stage.step();
            assert_eq!(
                (stage.emotion(idle), stage.behavior(idle)),
                ("HAPPY", "WAIT")
            );
            assert_eq!((stage.at(idle), stage.report(idle).speed_mps), (at, 0.0));
        }
        assert!(stage.number("Butler", "exchanges") >= 5.0, "{called}");
        assert!(stage.number(called, "trips") >= 5.0, "{called}");
    }
}

#[test]
fn t14_vonda_does_not_step_in_when_butler_passes_her_in_need_of_leguin() {
    // She stands where Butler serves, and Leguin never comes.
    let vonda = Role::new("Vonda", "Vonda", feet(25.0, 28.0), "");
    let leguin = Role::new("Leguin", "Leguin", feet(4.0, 4.0), "");
    let butler = Role::new(
        "Butler",
        "Butler",
        feet(25.0, 25.0),
        "v_serve_mps = 0.0\ncaution = 0.0",
    );
    let mut stage = Stage::new(1, vec![butler, leguin, vonda]);
    stage.drops = Box::new(|_| true);
    stage.begin();
    let needed = stage.step_until(60.0, |stage| {
        assert_eq!(stage.behavior("Vonda"), "WAIT");
        stage.flag("Butler", "need") && stage.behavior("Butler") == "SERVE"
    });
    assert!(needed && stage.apart_ft("Butler", "Vonda") <= 4.0);
    assert!(!stage.step_until(10.0, |stage| stage.behavior("Vonda") != "WAIT"));
}

#[test]
fn t14_a_third_robot_changes_nothing_for_the_other_two() {
    let trace = |mut stage: Stage| {
        let mut trace = Vec::new();
        for _ in 0..600 {
            stage.step();
            trace.push((
                stage.report("Butler").clone(),
                stage.report("Leguin").clone(),
            ));
        }
        trace
    };
    assert_eq!(trace(trio(6, "")), trace(Stage::pair(6, "", "")));
}

#[test]
fn t16_whatever_is_felt_behavior_takes_only_the_ways_of_the_table() {
    let legal = [
        ("SERVE", "INTERCEPT"),
        ("SERVE", "EXCHANGE"),
        ("INTERCEPT", "EXCHANGE"),
        ("INTERCEPT", "SERVE"),
        ("GO_BACK", "EXCHANGE"),
        ("EXCHANGE", "GO_BACK"),
        ("GO_BACK", "SERVE"),
    ];
    for urge in Urge::ALL {
        for bits in 0..32_768_u32 {
            let bit = |index: u32| bits >> index & 1 == 1;
            let context = butler::ButlerContext {
                urge,
                is_happy: bit(0),
                need: bit(1),
                called: bit(2),
                hurried: bit(3),
                refiller_is_ready_here: bit(4),
                refiller_comes: bit(5),
                intercept_any: bit(6),
                exchange_is_over: bit(7),
                is_at_start: bit(8),
                repeats_call: bit(9),
                repeats_go_home: bit(10),
                has_joke: bit(11),
                refiller_is_busy: bit(12),
                is_stuck: bit(13),
                rests: bit(14),
            };
            for state in butler::ButlerBehavior::ALL {
                let decision = affect::behavior::decide(butler::TABLE, &state, &context);
                if let Some(next) = decision.next {
                    assert!(
                        legal.contains(&(state.name(), next.name())),
                        "{state:?} -> {next:?}: {context:?}"
                    );
                    assert!(
                        next != butler::ButlerBehavior::Exchange || context.need,
                        "{context:?}"
                    );
                }
                let calls = decision
                    .actions
                    .iter()
                    .filter(|act| matches!(act, ButlerAct::CallRefill | ButlerAct::CallHurry));
                assert!(urge >= Urge::Hurry || !decision.actions.contains(&ButlerAct::CallHurry));
                let begins = decision.next == Some(butler::ButlerBehavior::Intercept);
                assert!(!begins || (urge == Urge::Intercept && !context.refiller_is_busy));
                assert!(calls.count() <= 2);
            }
        }
    }
}

#[test]
fn t16_with_a_constant_emotion_the_task_still_goes_on() {
    let mut stage = Stage::pair(7, "affect = \"off\"", "affect = \"off\"");
    for _ in 0..1200 {
        stage.step();
        assert_eq!(
            (stage.emotion("Butler"), stage.emotion("Leguin")),
            ("NEUTRAL", "NEUTRAL")
        );
    }
    assert!(stage.number("Butler", "exchanges") >= 5.0);
    assert!(!stage.commands_of("Butler").contains(&"hurry"));
}

#[test]
fn t17_a_query_tells_what_its_owner_publishes_and_nothing_else() {
    let published = |stage: &Stage, robot: &str| -> Vec<String> {
        stage
            .report(robot)
            .state_variables
            .iter()
            .map(|(name, _)| name.to_owned())
            .collect()
    };
    let mut stage = Stage::pair(8, "", "");
    stage.step();
    let (butler, leguin) = (published(&stage, "Butler"), published(&stage, "Leguin"));
    assert!(butler.contains(&"treats".to_owned()) && !leguin.contains(&"treats".to_owned()));
    assert!(leguin.contains(&"blocked_s".to_owned()) && !butler.contains(&"blocked_s".to_owned()));
    // A robot that asks gets exactly these.
    let asked = stage::asker::answers(8, "Leguin");
    let names = asked
        .state_variables
        .iter()
        .map(|(name, _)| name.to_owned());
    assert_eq!(names.collect::<Vec<_>>(), leguin);
    assert_eq!(
        (asked.emotion_state.as_str(), asked.behavior_state.as_str()),
        ("HAPPY", "WAIT")
    );
    assert_eq!(asked.location, feet(4.0, 4.0));
}

#[test]
fn t18_a_completed_exchange_makes_butler_happy_at_once() {
    let mut stage = deaf(9, "");
    assert!(stage.step_until(200.0, |stage| stage.behavior("Butler") == "EXCHANGE"));
    assert!(stage.step_until(2.0, |stage| stage.behavior("Butler") == "GO_BACK"));
    assert_eq!(
        (stage.emotion("Butler"), stage.number("Butler", "urgency")),
        ("HAPPY", 0.0)
    );
}

#[test]
fn t18_butler_calms_down_when_leguin_gets_on_again() {
    // He stays where he is, so that all progress is hers.
    let butler = "v_serve_mps = 0.0\nv_intercept_mps = 0.0";
    for seed in 0..16 {
        let emotions = |is_unblocked: bool| {
            let cast = vec![
                Role::new("Butler", "Butler", feet(25.0, 25.0), butler),
                Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
            ];
            let mut stage = Stage::new(seed, cast);
            // Bodies all around her: she cannot get out.
            stage.obstacles = (0..8)
                .flat_map(|i| [feet(2.0 * f64::from(i), 8.0), feet(8.0, 2.0 * f64::from(i))])
                .collect();
            stage.begin();
            assert!(
                stage.step_until(120.0, |stage| stage.emotion("Butler") == "FRUSTRATED"),
                "seed {seed}"
            );
            if is_unblocked {
                stage.obstacles.clear();
            }
            let mut emotions = Vec::new();
            stage.step_until(30.0, |stage| {
                let is_met = stage.behavior("Butler") == "EXCHANGE";
                if !is_met {
                    emotions.push(stage.emotion("Butler").to_owned());
                }
                is_met
            });
            emotions.dedup();
            emotions
        };
        assert_eq!(
            emotions(false),
            ["FRUSTRATED"],
            "seed {seed}: nothing changes for the better"
        );
        let calmed = emotions(true);
        let is_lower =
            |emotion: &String| ["CONCERNED", "CONFIDENT", "HAPPY"].contains(&emotion.as_str());
        assert!(
            calmed[0] == "FRUSTRATED" && calmed.len() > 1,
            "seed {seed}: {calmed:?}"
        );
        assert!(calmed[1..].iter().all(is_lower), "seed {seed}: {calmed:?}");
    }
}

#[test]
fn t23_saved_and_restored_in_mid_run_both_continue_identically() {
    let run = |reborn_at: u64| {
        let mut stage = Stage::new(
            10,
            vec![
                Role {
                    robot: Box::new(stage::reborn::Butler::saved(reborn_at)),
                    ..Role::new("Butler", "Butler", feet(25.0, 25.0), "")
                },
                Role {
                    robot: Box::new(stage::reborn::Leguin::saved(reborn_at)),
                    ..Role::new("Leguin", "Leguin", feet(4.0, 4.0), "")
                },
            ],
        );
        stage.begin();
        (0..240)
            .map(|_| {
                stage.step();
                stage.reports.clone()
            })
            .collect::<Vec<_>>()
    };
    let straight = run(u64::MAX);
    let behaviors: std::collections::BTreeSet<&str> = straight
        .iter()
        .map(|reports| reports[&name("Leguin")].behavior_state.as_str())
        .collect();
    assert_eq!(
        behaviors.len(),
        leguin::LeguinBehavior::ALL.len(),
        "the run goes through every behavior"
    );
    for reborn_at in (1..240).step_by(7) {
        assert!(run(reborn_at) == straight, "saved at tick {reborn_at}");
    }
}

#[test]
fn t25_the_order_in_which_robots_act_changes_nothing() {
    let play = |order: [usize; 3]| {
        let mut cast: Vec<Option<Role>> = vec![
            Some(Role::new("Butler", "Butler", feet(25.0, 25.0), "")),
            Some(Role::new("Leguin", "Leguin", feet(4.0, 4.0), "")),
            Some(Role::new("Vonda", "Vonda", feet(46.0, 4.0), "")),
        ];
        let mut stage = Stage::new(
            11,
            order
                .into_iter()
                .filter_map(|index| cast[index].take())
                .collect(),
        );
        stage.begin();
        (0..600)
            .map(|_| {
                stage.step();
                (stage.places.clone(), stage.reports.clone())
            })
            .collect::<Vec<_>>()
    };
    let straight = play([0, 1, 2]);
    for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        assert!(play(order) == straight, "{order:?}");
    }
}
