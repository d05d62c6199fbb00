//! How the two find each other: the handshake of need and exchange at every offset, silence, lost messages, obstacles.

use super::stage::{FT_M, Role, Stage, feet};

/// Counts how often either side begins an exchange, until `limit_s` is over.
fn count_exchanges(stage: &mut Stage, limit_s: f64) -> (u32, u32) {
    let (mut butlers, mut leguins) = (0, 0);
    let mut before = (String::new(), String::new());
    stage.step_until(limit_s, |stage| {
        let now = (
            stage.behavior("Butler").to_owned(),
            stage.behavior("Leguin").to_owned(),
        );
        butlers += u32::from(now.0 == "EXCHANGE" && before.0 != "EXCHANGE");
        leguins += u32::from(now.1 == "EXCHANGE" && before.1 != "EXCHANGE");
        before = now;
        false
    });
    (butlers, leguins)
}

/// The tick of the first exchange on the usual stage.
fn first_meeting(seed: u64) -> u64 {
    let mut stage = Stage::pair(seed, "", "");
    assert!(stage.step_until(200.0, |stage| stage.behavior("Butler") == "EXCHANGE"));
    stage.tick
}

#[test]
fn a_need_that_arises_beside_a_waiting_leguin_is_met_at_once_by_both() {
    // Every phase of the random walk in which he can become needy while she is near.
    for seed in 0..32 {
        let mut stage = Stage::new(
            seed,
            vec![
                Role::new(
                    "Butler",
                    "Butler",
                    feet(25.0, 25.0),
                    "v_serve_mps = 0.1\nv_refill_mps = 0.02",
                ),
                Role::new("Leguin", "Leguin", feet(25.0, 28.0), ""),
            ],
        );
        stage.begin();
        assert!(
            stage.step_until(120.0, |stage| stage.behavior("Butler") == "EXCHANGE"),
            "seed {seed}"
        );
        assert_eq!(stage.behavior("Leguin"), "EXCHANGE", "seed {seed}");
    }
}

#[test]
fn an_exchange_that_one_side_enters_is_entered_by_the_other_at_any_cut() {
    for seed in [1, 2] {
        let meeting = first_meeting(seed);
        for asker in ["Butler", "Leguin"] {
            for first in meeting.saturating_sub(6)..meeting + 6 {
                for lasting in [1, 2, 5, 15, 40] {
                    let mut stage = Stage::pair(seed, "", "");
                    stage.cuts = Box::new(move |tick, from, _| {
                        from == asker && (first..first + lasting).contains(&tick)
                    });
                    let (butlers, leguins) = count_exchanges(&mut stage, 150.0);
                    let what =
                        format!("seed {seed}: {asker} cut off from {first} for {lasting} ticks");
                    assert!(
                        butlers >= 2 && leguins >= 2,
                        "{what}: {butlers}, {leguins} exchanges"
                    );
                    assert!(
                        butlers.abs_diff(leguins) <= 1,
                        "{what}: {butlers}, {leguins} exchanges"
                    );
                }
            }
        }
    }
}

#[test]
fn commands_that_come_a_tick_early_or_late_leave_no_robot_waiting() {
    // Each command is lost, and sent again by an operator some ticks later.
    for delay in 1..12 {
        let mut stage = Stage::pair(11, "", "");
        stage.drops = Box::new(|_| true);
        let (mut butlers, mut known, mut due) = (0, 0, Vec::new());
        for _ in 0..600 {
            let before = stage.behavior("Butler").to_owned();
            stage.step();
            butlers += u32::from(stage.behavior("Butler") == "EXCHANGE" && before != "EXCHANGE");
            due.extend(
                stage.sent[known..]
                    .iter()
                    .map(|sent| (sent.tick + delay, sent.command.clone())),
            );
            known = stage.sent.len();
            let now = stage.tick;
            for (_, command) in due.iter().filter(|(tick, _)| *tick == now) {
                stage.command("Leguin", command);
            }
        }
        assert!(butlers >= 4, "delay {delay}: {butlers} exchanges");
    }
}

#[test]
fn silence_raises_concern_and_ends_in_interception() {
    let mut stage = Stage::pair(12, "", "");
    stage.cuts = Box::new(|tick, _, _| tick > 4);
    stage.drops = Box::new(|_| true);
    stage.step_until(2.0, |_| false);
    let before_s = stage.number("Butler", "time_to_refill_s");
    stage.step_until(8.0, |_| false);
    assert!(stage.number("Butler", "time_to_refill_s") > 3.0 * before_s);
    assert!(stage.step_until(60.0, |stage| stage.behavior("Butler") == "INTERCEPT"));
    assert!(stage.step_until(60.0, |stage| stage.behavior("Butler") == "EXCHANGE"));
}

#[test]
fn two_who_never_hear_of_each_other_still_work_together_by_sight() {
    let table = format!("table = [{}, {}]", 4.0 * FT_M, 4.0 * FT_M);
    for seed in 0..8 {
        let mut stage = Stage::pair(seed, &table, "");
        stage.cuts = Box::new(|_, _, _| true);
        stage.drops = Box::new(|_| true);
        let (butlers, leguins) = count_exchanges(&mut stage, 600.0);
        assert!(
            butlers >= 3 && butlers.abs_diff(leguins) <= 1,
            "seed {seed}: {butlers}, {leguins} exchanges"
        );
    }
}

#[test]
fn who_knows_nothing_of_the_refiller_searches_for_her() {
    let mut stage = Stage::pair(13, "", "");
    stage.cuts = Box::new(|_, _, _| true);
    assert!(stage.step_until(60.0, |stage| stage.behavior("Butler") == "INTERCEPT"));
    assert!(stage.report("Butler").speed_mps > 0.0);
}

#[test]
fn a_lost_go_home_is_repeated_only_by_the_timer() {
    for (resend, sent_home) in [("off", 1), ("on", 2)] {
        let butler = format!("resend = \"{resend}\"");
        let mut stage = Stage::pair(14, &butler, "await_patience_s = 1e6");
        assert!(stage.step_until(120.0, |stage| stage.behavior("Butler") == "EXCHANGE"));
        let lost_until = stage.tick + 6;
        stage.drops = Box::new(move |sent| sent.command == "go home" && sent.tick < lost_until);
        stage.step_until(9.0, |_| false);
        let said = stage
            .commands_of("Butler")
            .into_iter()
            .filter(|command| *command == "go home");
        assert_eq!(said.count(), sent_home, "resend {resend}");
        let is_going = stage.behavior("Leguin") == "GO_HOME";
        assert_eq!(is_going, resend == "on");
    }
}

#[test]
fn a_lost_call_is_repeated_while_she_is_seen_to_wait() {
    let arm = "affect = \"off\"\nresend = \"on\"";
    let mut stage = Stage::pair(15, arm, "affect = \"off\"");
    let is_early = |tick: u64| tick < 120;
    stage.drops = Box::new(move |sent| is_early(sent.tick));
    assert!(stage.step_until(120.0, |stage| stage.behavior("Butler") == "EXCHANGE"));
    let calls: Vec<u64> = stage
        .sent
        .iter()
        .filter(|sent| sent.command == "refill")
        .map(|sent| sent.tick)
        .collect();
    assert!(
        calls.len() >= 2 && calls.windows(2).all(|pair| pair[1] - pair[0] == 10),
        "{calls:?}"
    );
}

#[test]
fn without_emotions_one_lost_message_is_the_end() {
    let mut stage = Stage::pair(16, "affect = \"off\"", "affect = \"off\"");
    stage.drops = Box::new(|sent| sent.command == "go home");
    let (butlers, _) = count_exchanges(&mut stage, 600.0);
    assert_eq!((butlers, stage.behavior("Leguin")), (1, "AWAIT_GO_HOME"));
    assert!(stage.sent.iter().all(|sent| sent.command != "hurry"));

    let mut stage = Stage::pair(16, "", "");
    stage.drops = Box::new(|sent| sent.command == "go home");
    let (butlers, _) = count_exchanges(&mut stage, 600.0);
    assert!(butlers >= 3, "{butlers} exchanges with emotions");
}

#[test]
fn a_refiller_who_does_not_get_on_turns_back_frustrated() {
    let mut stage = Stage::pair(17, "treat_mean_s = 1e9", "block_patience_s = 10.0");
    // A wall around her, too wide to be passed.
    stage.obstacles = (0..8)
        .flat_map(|i| [feet(2.0 * f64::from(i), 8.0), feet(8.0, 2.0 * f64::from(i))])
        .collect();
    stage.command("Leguin", "refill");
    let mut was_frustrated = false;
    assert!(stage.step_until(60.0, |stage| {
        was_frustrated |= stage.emotion("Leguin") == "FRUSTRATED";
        stage.behavior("Leguin") == "GO_HOME"
    }));
    assert!(was_frustrated);
    assert!(stage.step_until(20.0, |stage| stage.behavior("Leguin") == "WAIT"));
    assert_eq!(stage.number("Leguin", "given_up"), 1.0);
}

#[test]
fn a_call_on_the_way_home_is_kept_for_later() {
    let mut stage = Stage::pair(18, "", "");
    assert!(stage.step_until(120.0, |stage| stage.behavior("Leguin") == "GO_HOME"));
    stage.command("Leguin", "hurry");
    stage.step();
    assert_eq!(stage.behavior("Leguin"), "GO_HOME");
    assert!(stage.step_until(30.0, |stage| stage.behavior("Leguin") == "WAIT"));
    stage.step();
    assert_eq!(
        (stage.behavior("Leguin"), stage.flag("Leguin", "hurried")),
        ("REFILL", true)
    );
}

#[test]
fn every_tray_is_accounted_for() {
    for seed in 0..8 {
        let mut stage = Stage::pair(seed, "", "");
        let mut given = 30.0;
        for _ in 0..1200 {
            let (treats, exchanges) = (
                stage.number("Butler", "treats"),
                stage.number("Butler", "exchanges"),
            );
            stage.step();
            if stage.number("Butler", "exchanges") > exchanges {
                given += 30.0 - treats;
            }
            assert_eq!(
                given - stage.number("Butler", "served"),
                stage.number("Butler", "treats")
            );
        }
        // Mean 1 s while serving: the count stays within five standard deviations of a Poisson count.
        let taps = stage.number("Butler", "served") + stage.number("Butler", "missed");
        assert!((400.0..650.0).contains(&taps), "seed {seed}: {taps}");
    }
}
