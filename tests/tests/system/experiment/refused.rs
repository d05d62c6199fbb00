//! Experiments that cannot be played as they are written.

use std::fs;

use system_tests::{Lab, root};

use super::{cars, in_one_line, yoked};

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

    let strange = format!(
        "question = '?'\nscenario = {:?}\nduration = '60 s'\nseeds = 2\n\
         [[arm]]\nname = 'it'\n[[measure]]\nname = 'ticks'\nsummary = 'ticks'\n",
        root().join("configs/any_language.toml")
    );
    let strange = lab.write("strange.toml", &strange);
    let (code, text) = lab.cars_without_out(&["check", strange.to_str().unwrap()]);
    assert_eq!(code, 0, "{text}");
    let reason = "can run in this process";
    assert!(
        text.contains("to be played with --processes") && text.contains(reason),
        "{text}"
    );

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

/// What only the scenario or a robot knows is refused before anything runs, too, at its place in the experiment file.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn what_the_scenario_or_a_robot_refuses_is_shown_where_the_experiment_says_it() {
    const GOOD: &str = r#"question = "?"
duration = "300 s"
seeds = 2

[[condition]]
name = "as it is"

[[condition]]
name = "odd"
set = [
    "on_late=continue",
    "@condition@",
]

[[factor]]
name = "level"
path = "robot.Butler.params.caution"
values = [0.25, 0.5, @value@]

[[factor]]
name = "pause"
begins = "100 s"
values = ["0 s", "@time@"]
set = ['network.partition=[{ from = "{from}", until = "{until}", @part@ }]']
set_at_zero = ["network.partition=[]"]

[[arm]]
name = "right"

[[arm]]
name = "wrong"
set = [
    "guests.count=10",
    "@arm@",
]

[[measure]]
name = "ticks"
summary = "ticks"
"#;
    let parts = [
        ("@condition@", "network.commands.loss=0.1"),
        ("@value@", "0.75"),
        ("@time@", "60 s"),
        ("@part@", "groups = [[\"Butler\"], [\"Leguin\"]]"),
        ("@arm@", "robot.Leguin.params.caution=1.0"),
    ];
    let lab = Lab::new();
    let out = lab.out().join("results");
    let scenario = root().join("configs/hors_doeuvres.toml");
    let head = format!("scenario = {scenario:?}\n");

    for (part, wrong, reason) in [
        ("", "", ""),
        ("@condition@", "network.commands.loss=1.5", "1.5"),
        ("@condition@", "network.comands.loss=0.5", "comands"),
        (
            "@condition@",
            "robot.Rosie.at=[\\\"1 m\\\", \\\"1 m\\\"]",
            "Rosie",
        ),
        ("@value@", "-3.0", "caution"),
        ("@value@", "\"much\"", "caution"),
        ("@part@", "groops = []", "groops"),
        ("@arm@", "guests.speed.mode=-1 ft/s", "speed"),
        ("@arm@", "robot.Butler.params.policy=angry", "angry"),
        ("@arm@", "robot.Butler.params.cauton=0.5", "cauton"),
    ] {
        let mut text = format!("{head}{GOOD}");
        for (name, good) in parts {
            text = text.replace(name, if name == part { wrong } else { good });
        }
        let file = lab.write("wrong.toml", &text);
        let file = file.to_str().unwrap();

        let run = cars(&["run", file, "--plan-only", "-o", out.to_str().unwrap()]);
        let (code, check) = lab.cars_without_out(&["check", file]);
        let check = (code, in_one_line(&check));
        if part.is_empty() {
            assert_eq!((run.0, check.0), (0, 0), "{run:?} {check:?}");
            fs::remove_dir_all(&out).unwrap();
            continue;
        }

        let place = if part == "@part@" { "\"60 s\"" } else { wrong };
        let before = &text[..text.find(place).unwrap()];
        let place = format!("wrong.toml:{}:", before.matches('\n').count() + 1);
        for (code, notes) in [run, check] {
            assert_eq!(code, 1, "{wrong}: {notes}");
            assert!(notes.contains(&place), "{wrong}, at {place}: {notes}");
            assert!(notes.contains(reason), "{wrong}: {notes}");
            assert!(notes.contains("arm \""), "{wrong}: {notes}");
        }
        assert!(!out.exists(), "{wrong}");
    }
}

/// The scenario itself is shown where it is wrong; the command line is named.
#[test]
fn what_the_scenario_refuses_without_the_experiment_is_shown_in_the_scenario() {
    let lab = Lab::new();
    let hall = fs::read_to_string(root().join("configs/museum.toml")).unwrap();
    let tick = hall
        .lines()
        .position(|line| line.starts_with("tick"))
        .unwrap();
    let odd = hall.lines().nth(tick).unwrap();
    lab.write("hall.toml", &hall.replace(odd, "tick = \"-1 s\""));
    let text = "question = '?'\nscenario = 'hall.toml'\nduration = '60 s'\nseeds = 2\n\
                [[arm]]\nname = 'it'\n[[measure]]\nname = 'ticks'\nsummary = 'ticks'\n";
    let file = lab.write("experiment.toml", text);
    let (code, notes) = cars(&["run", file.to_str().unwrap()]);
    assert_eq!(code, 1, "{notes}");
    assert!(
        notes.contains(&format!("hall.toml:{}:", tick + 1)),
        "{notes}"
    );

    lab.write("hall.toml", &hall);
    let option = "--set=guests.count=-3";
    let (code, notes) = cars(&["run", file.to_str().unwrap(), option]);
    assert_eq!(code, 1, "{notes}");
    assert!(
        notes.contains("the command line's guests.count=-3"),
        "{notes}"
    );
}
