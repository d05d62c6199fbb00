//! Robots in bulk and at random places, and refillers who are recruited.

use system_tests::hall::{Hall, scenario};
use system_tests::{Lab, assert_same};

const SCENARIO: &str = "configs/recruitment.toml";

/// The scenario with so many refillers, recruited in this way, and this share of the commands lost.
fn hall(seed: u64, refillers: usize, by: &str, loss: f64) -> Hall {
    let count = format!("robot.S.count={refillers}");
    let by = format!("robot.*.params.recruitment.by={by}");
    let loss = format!("network.commands={{ loss = {loss:?} }}");
    Hall::new(scenario(SCENARIO, seed, &[&count, &by, &loss]))
}

fn play(hall: &mut Hall, until_s: f64) {
    while hall.time_s() < until_s {
        hall.step();
    }
}

#[test]
fn refillers_are_recruited_in_each_way_also_if_commands_are_lost() {
    for by in ["affective", "greedy", "random"] {
        for (refillers, loss) in [(4, 0.25), (16, 0.0)] {
            let mut hall = hall(3, refillers, by, loss);
            play(&mut hall, 300.0);
            let number = |name: &str| hall.number("Butler", name);
            let what = format!("{by}, {refillers} refillers, loss {loss}");

            assert!(
                number("arrivals") >= 4.0,
                "{what}: {} arrivals",
                number("arrivals")
            );
            assert!(number("requests") - number("arrivals") <= 1.0, "{what}");
            assert_eq!(number("arrivals"), number("exchanges"), "{what}");
            // A trip counts when "go home" arrives.
            let trips: f64 = (1..=refillers)
                .map(|robot| hall.number(&format!("S{robot}"), "trips"))
                .sum();
            let are_all_counted = (trips - number("exchanges")).abs() <= 1.0;
            assert!(loss > 0.0 || are_all_counted, "{what}: {trips} trips");
        }
    }
}

#[test]
fn as_many_refillers_as_the_scenario_is_made_for_are_recruited() {
    let mut hall = hall(1, 64, "affective", 0.0);
    play(&mut hall, 120.0);
    assert!(hall.number("Butler", "arrivals") >= 1.0);
    let shames = (1..=64).map(|robot| hall.number(&format!("S{robot}"), "shame"));
    assert!(shames.into_iter().all(|shame| (0.0..=1.0).contains(&shame)));
}

#[test]
fn butler_gets_away_from_refillers_who_stand_in_his_way_back() {
    // Here three of them stand around the way to his start.
    let mut hall = hall(33, 32, "affective", 0.0);
    play(&mut hall, 300.0);
    assert!(hall.number("Butler", "exchanges") >= 5.0);
}

#[test]
fn a_run_of_robots_in_bulk_is_the_same_as_processes_again_and_forked() {
    let lab = Lab::new();
    let scenario = system_tests::root().join(SCENARIO);
    let launch = lab.write(
        "bulk.toml",
        &format!(
            "scenario = {:?}\n[console]\nenabled = false\n\
             [[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n\
             [[process]]\nname = \"*1\"\ncommand = [\"cars-leguin\"]\n\
             [[process]]\nname = \"others\"\ncommand = [\"cars-leguin\"]\nrobots = [\"S2\", \"S*3\"]\n",
            scenario.display().to_string()
        ),
    );
    let launch = launch.display().to_string();
    let changes = [
        "--set",
        "robot.S.count=3",
        "--set",
        "robot.S*.params.caution=0.6",
    ];
    let short = ["--duration", "60 s", "--seed", "7"];

    let mut args = vec!["run", SCENARIO, "--run", "alone", "-q"];
    args.extend(changes.iter().chain(&short));
    lab.ok(&args);
    let mut args = vec!["launch", &launch, "--run", "bulk"];
    args.extend(changes.iter().chain(&short));
    lab.ok(&args);
    assert_same(
        ("in one process", &lab.bytes("alone")),
        ("as processes", &lab.bytes("bulk")),
    );

    for run in ["alone", "bulk"] {
        let said = lab.ok(&["verify", run]);
        assert!(said.contains("the same, 120 ticks to the end"), "{said}");
    }
    lab.ok(&["fork", "alone@40", "--run", "fork", "-q"]);
    let ticks = |run: &str| {
        let events = lab.events(run);
        let digests = events.iter().filter(|event| event["event"] == "tick");
        digests
            .map(|event| event["digest"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(ticks("fork"), ticks("alone"));
    let changed = [
        "fork",
        "alone@40",
        "--run",
        "changed",
        "-q",
        "--set",
        "robot.S*.params.caution=0.1",
    ];
    lab.ok(&changed);
    let said = lab.ok(&["verify", "changed"]);
    assert!(said.contains("the same"), "{said}");
}
