//! A program that does not keep to the contract ends its robot, and the reason is named.

use system_tests::processes::nobody_is_left;

use super::stage::{Stage, says};

/// What a program does in tick 3, and what is said about it.
const MISHAPS: &[(&str, &str, &[&str])] = &[
    (
        "words",
        "say 'hello there'",
        &[
            "its line `hello there` is not understood: it is not valid JSON",
            "expected is one JSON object",
        ],
    ),
    (
        "list",
        "say '[1]'",
        &["its line `[1]` is", "it has no type"],
    ),
    (
        "type",
        r#"say '{"type":"dance"}'"#,
        &[
            r#"there is no type "dance"; expected is"#,
            "percept, ranges, random",
        ],
    ),
    (
        "field",
        r#"say '{"type":"query","of":"Butler"}'"#,
        &["missing field `what`"],
    ),
    (
        "speed",
        r#"say '{"type":"done","speed_mps":"fast"}'"#,
        &["field speed_mps: invalid type: string \"fast\""],
    ),
    (
        "place",
        r#"say '{"type":"done","proposal":{"x":1,"y":null}}'"#,
        &["field proposal.y: invalid type: null"],
    ),
    (
        "infinite",
        r#"say '{"type":"done","proposal":{"x":1,"y":1e999}}'"#,
        &["it is not valid JSON (number out of range"],
    ),
    (
        "variable",
        r#"say '{"type":"done","state_variables":{"n":[]}}'"#,
        &["field state_variables.n: a number, a text"],
    ),
    (
        "panel",
        r#"say '{"type":"panel","widgets":[{"widget":"dance"}]}'"#,
        &["field widgets[0]", "unknown variant `dance`"],
    ),
    // In one piece, so that both are there when the next tick begins.
    (
        "twice",
        r#"printf '{"type":"done"}\n{"type":"done"}\n'; continue"#,
        &[r#"its program said `{"type":"done"}` outside a tick"#],
    ),
    (
        "long",
        "head -c 3000000 /dev/zero | tr '\\0' x",
        &["its line `xxxx", "xxx...` is longer than 1048576 bytes"],
    ),
    (
        "chatter",
        r#"yes '{"type":"log","text":"again"}'"#,
        &["said too much for one tick: 0 commands and 917"],
    ),
    (
        "endless",
        r#"yes '{"type":"panel","widgets":[]}'"#,
        &["its program said more than 65536 lines in one tick and not done"],
    ),
    (
        "bulky",
        r#"text=$(head -c 5000 /dev/zero | tr '\0' x); say '{"type":"command","to":"Butler","command":"'"$text"'"}'"#,
        &["field command: 5000 bytes, more than the 4096 allowed"],
    ),
    (
        "orders",
        r#"for i in $(seq 1025); do say '{"type":"command","to":"Butler","command":"smile"}'; done"#,
        &[
            "said too much for one tick: 1025 commands",
            "allowed are 1024",
        ],
    ),
    (
        "exit",
        "echo 'out of memory' >&2; exit 3",
        &[
            "its program ended with exit status 3 before the run did",
            "  out of memory",
        ],
    ),
    (
        "leave",
        "exit 0",
        &["its program ended with exit status 0 before the run did, and wrote no errors"],
    ),
    (
        "kill",
        "kill -9 $$",
        &["its program was ended by SIGKILL before the run did"],
    ),
    (
        "deaf",
        "exec >&-; sleep 600",
        &["its program has closed its standard output"],
    ),
];

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_mishap_is_named_and_ends_the_robot() {
    std::thread::scope(|scope| {
        for (name, lines, expected) in MISHAPS {
            scope.spawn(move || {
                let lines =
                    format!(r#"case $json in *'"type":"tick","tick":3,'*) {lines} ;; esac"#);
                let (run, stage) = (format!("exec-mishap-{name}"), Stage::each_tick(&lines, ""));
                let mut launch = stage.start(&run, &["--speed", "20"]);
                let status = launch.wait();
                assert_eq!(status.code(), Some(1), "{name}: {}", launch.printed());
                says(&launch, &[&["Leguin gives up: "], *expected].concat());
                nobody_is_left(&run);
            });
        }
    });
}

#[test]
fn a_program_that_is_not_there_is_named() {
    let stage = Stage::new("", "");
    std::fs::remove_file(stage.lab.out().join("leguin.sh")).unwrap();
    let mut launch = stage.start("exec-nowhere", &[]);
    assert!(!launch.wait().success());
    says(&launch, &["there is no program ./leguin.sh"]);

    let args = [
        "exec",
        "--name",
        "Leguin",
        "--connect",
        "tcp/127.0.0.1:1",
        "--patience-s",
        "0.1",
        "--",
        "no-such-program",
    ];
    let (code, text) = stage.lab.cars_without_out(&args);
    assert_eq!(code, 1, "{text}");
    assert!(
        text.contains("Leguin: no-such-program cannot be started: No such file"),
        "{text}"
    );
}

#[test]
fn a_dead_program_is_lost_where_the_clock_goes_on() {
    let silent = r#"case $json in *'"type":"tick","tick":10,'*) exit 3 ;; esac"#;
    // A tick that it has answered counts. Nobody is given up for being slow here.
    let answering =
        r#"case $json in *'"type":"tick","tick":10,'*) say '{"type":"done"}'; exit 3 ;; esac"#;
    for (name, lines, tick) in [("silent", silent, 10), ("answering", answering, 11)] {
        let stage = Stage::each_tick(lines, "required = false");
        for time in 1..=2 {
            let run = format!("exec-lost-{name}-{time}");
            stage
                .start(
                    &run,
                    &["--set", "on_late=continue", "--set", "deadline=60 s"],
                )
                .finish();
            let mut lost = stage.lab.events(&run);
            lost.retain(|event| event["event"] == "lost");
            assert_eq!(lost.len(), 1, "{lost:?}");
            assert_eq!(
                (&lost[0]["robot"], &lost[0]["tick"]),
                (&"Leguin".into(), &tick.into()),
                "{name}"
            );
            let log = stage.log(&run);
            assert!(
                log.contains("its program ended with exit status 3"),
                "{log}"
            );
            nobody_is_left(&run);
        }
    }
}
