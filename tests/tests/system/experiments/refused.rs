//! Experiments that cannot be played as they are written.

use std::fs;

use system_tests::{Lab, root};

use super::{cars, yoked};

#[test]
fn an_experiment_that_would_not_be_played_as_it_says_is_refused() {
    let lab = Lab::new();
    let out = lab.out().join("results");
    let cases: [(&[&str], &str); 8] = [
        (&["partition", "--duration", "100 s"], "begins at 120 s"),
        (&["partition", "--duration", "300 s"], "lasts until 360 s"),
        (&["affect", "--duration", "200 s"], "lasts until 240 s"),
        (
            &["deadlock", "--set", "network.commands.loss=0.5"],
            "the condition \"0\" sets network.commands",
        ),
        (
            &["deadlock", "--set", "seed=7"],
            "the seed of a run is the experiment's",
        ),
        (&["deadlock", "--seeds", "1"], "not a number of seeds"),
        (&["deadlock", "--seeds", "9..=8"], "not a number of seeds"),
        (&["nothing"], "nothing"),
    ];

    for (args, reason) in cases {
        let args = [&["run"], args, &["-o", out.to_str().unwrap()]].concat();
        let (code, notes) = cars(&args);
        assert!(code == 1 || code == 2, "{args:?}: {notes}");
        assert!(notes.contains(reason), "{args:?}: {notes}");
        assert!(!out.exists(), "{args:?}");
    }
}

#[test]
fn a_change_of_the_command_line_that_an_arm_makes_is_refused() {
    for change in [
        "robot.Butler.params.policy=rules",
        "robot.0.params.policy=rules",
    ] {
        let (code, notes) = cars(&["run", "deadlock", "--set", change]);
        assert_eq!(code, 1, "{notes}");
        assert!(notes.contains("--set sets robot."), "{notes}");
        assert!(notes.contains("\"emotions\" sets"), "{notes}");
    }
}

/// A folder with other content is left alone.
#[test]
fn results_are_not_written_among_other_files() {
    let lab = Lab::new();
    lab.write("diary.txt", "mine");
    let out = lab.out().to_str().unwrap();
    let args = [
        "run",
        "deadlock",
        "--seeds",
        "2",
        "--duration",
        "10 s",
        "-o",
        out,
    ];
    let (code, notes) = cars(&args);
    assert_eq!(code, 1, "{notes}");
    assert!(
        notes.contains("is not the folder of an experiment"),
        "{notes}"
    );
    assert_eq!(fs::read_dir(lab.out()).unwrap().count(), 1);

    for subcommand in ["status", "merge"] {
        let (code, notes) = cars(&[subcommand, out]);
        assert_eq!(code, 1, "{notes}");
        assert!(notes.contains("it has no plan.json"), "{notes}");
    }
}

#[test]
fn cars_check_reads_experiments() {
    let lab = Lab::new();
    let (code, text) = lab.cars_without_out(&["check", "configs/experiments/affect.toml"]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("8 arms, 9 conditions, 64 seeds"), "{text}");

    let broken = yoked().replace("crash\", at", "die\", at");
    let broken = lab.write("broken.toml", &broken);
    let (code, text) = lab.cars_without_out(&["check", broken.to_str().unwrap()]);
    assert_eq!(code, 1, "{text}");
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    assert!(words.join(" ").contains("condition \"crash\""), "{text}");
}

/// What only the robots know is refused before anything runs, too.
#[test]
fn parameters_that_a_robot_refuses_are_refused_before_anything_runs() {
    let lab = Lab::new();
    let out = lab.out().join("results");
    for (set, reason) in [
        ("robot.Butler.params.cauton=0.5", "cauton"),
        ("robot.Butler.params.policy=angry", "angry"),
        ("robot.Butler.params.treat_mean_s=-1 s", "treat_mean_s"),
    ] {
        let file = lab.write(
            "wrong.toml",
            &format!(
                "question = '?'\nscenario = '{}'\nduration = '60 s'\nseeds = 2\n\
                 [[arm]]\nname = 'right'\n[[arm]]\nname = 'wrong'\nset = ['{set}']\n\
                 [[measure]]\nname = 'ticks'\nsummary = 'ticks'\n",
                root().join("configs/hors_doeuvres.toml").display()
            ),
        );
        let args = ["run", file.to_str().unwrap(), "-o", out.to_str().unwrap()];
        let (code, notes) = cars(&args);
        assert_eq!(code, 1, "{notes}");
        assert!(notes.contains("arm \"wrong\""), "{notes}");
        assert!(notes.contains(reason), "{notes}");
        assert!(!out.exists(), "{notes}");
    }
}
