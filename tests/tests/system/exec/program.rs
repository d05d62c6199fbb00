//! A program takes part as any robot does.

use system_tests::assert_same;
use system_tests::processes::nobody_is_left;

use super::stage::{Stage, says};

/// Walks to and fro by chance, asks, looks around, commands and says what it hears.
const WALKER: &str = r#"
while hear; do
    if is end; then echo "heard $json" >&2; exit 0; fi
    told=$json
    if is init; then ticks=0; echo "heard $told in $$, with $1" >&2; say '{"type":"panel","widgets":[]}'; fi
    ticks=$((ticks + 1))
    x=${told#*'"location":{"x":'}; x=${x%%,*}
    y=${told#*'"location":{"x":'}; y=${y#*'"y":'}; y=${y%%\}*}
    ask '{"type":"random"}'; chance=${json#*:*:}; chance=${chance%\}}
    ask '{"type":"query","of":"Butler","what":"emotion_state","unknown":"fields are ignored"}'
    butler=${json#*:*:}; butler=${butler%\}}
    ask '{"type":"percept"}'; say '{"type":"log","text":"I see '"$(printf %s "$json" | tr -d '"')"'"}'
    case $told in *'"commands":'*) say '{"type":"log","text":"I was told something"}' ;; esac
    if [ $((ticks % 20)) = 7 ]; then
        say '{"type":"command","to":"Butler","command":"smile"}'
        say '{"type":"command","to":"Nobody","command":"smile"}'
    fi
    if [ $((ticks % 2)) = 0 ]; then y=$y"1"; fi
    say '{"type":"done","proposal":{"x":'"$x"',"y":'"$y"'},"speed_mps":0.25,"direction_rad":1.5707963,"emotion_state":"E'$((ticks / 9))'","behavior_state":"WALK","state_variables":{"ticks":'"$ticks"',"chance":'"$chance"',"butler":'"$butler"',"is_well":true}}'
done
"#;

#[test]
fn a_script_takes_part_and_two_launches_are_the_same() {
    let stage = Stage::new(WALKER, "");
    for run in ["exec-first", "exec-second"] {
        stage.start(run, &[]).finish();
        nobody_is_left(run);
    }
    let [first, second] = ["exec-first", "exec-second"].map(|run| stage.lab.bytes(run));
    assert_same(("the first launch", &first), ("the second launch", &second));

    let log = std::fs::read_to_string(stage.lab.file("exec-first", "cars.log")).unwrap();
    for part in [
        "behavior WALK",
        "emotion E2 -> E3",
        "-> Butler: smile",
        "no robot is called \"Nobody\"",
        "I was told something",
        "I see {type:answer,value:{bodies:[",
    ] {
        assert!(log.contains(part), "no {part:?} in\n{log}");
    }
    // What it writes as errors is in the log of its process, and is no part of the run.
    let process = stage.log("exec-first");
    for part in [
        "Leguin: heard {\"type\":\"init\",\"protocol\":2,\"run\":\"exec-first\",\"name\":\"Leguin\",\"generation\":1,",
        "with an argument",
        "Leguin: heard {\"type\":\"end\",\"reason\":\"finished\"}",
    ] {
        assert!(process.contains(part), "no {part:?} in\n{process}");
    }
    assert!(!String::from_utf8(first).unwrap().contains("heard"));
}

#[test]
fn questions_that_have_no_answer_say_why() {
    let stage = Stage::each_tick(
        r#"
        case $json in *'"tick":0,'*|*'"tick":3,'*)
            for query in '"of":"Butler","what":"speed"' '"of":"Nobody","what":"speed"' '"of":"Butler","what":"mood"' \
                '"of":"Butler","what":"state"'; do
                ask '{"type":"query",'"$query"'}'; echo "answer $query: $json" >&2
            done ;;
        esac"#,
        "",
    );
    stage.start("exec-queries", &[]).finish();
    let log = stage.log("exec-queries");
    let answers: Vec<&str> = log
        .lines()
        .filter_map(|line| line.split_once("answer "))
        .map(|(_, a)| a)
        .collect();
    assert_eq!(answers.len(), 8, "{log}");
    for (at, error) in [
        (0, "too early"),
        (1, "unknown robot"),
        (5, "unknown robot"),
        (6, "unknown query"),
    ] {
        let expected = format!("{{\"type\":\"answer\",\"error\":\"{error}\"}}");
        assert!(
            answers[at].ends_with(&expected),
            "answer {at}: {}",
            answers[at]
        );
    }
    assert!(
        answers[4].contains("{\"type\":\"answer\",\"value\":"),
        "{}",
        answers[4]
    );
    assert!(
        answers[7].contains("\"behavior_state\":\"SERVE\""),
        "{}",
        answers[7]
    );
}

#[test]
fn a_slow_program_is_late_and_named_and_changes_nothing() {
    let slow = r#"case $json in *'"type":"tick","tick":5,'*) sleep 2 ;; esac"#;
    let stage = Stage::each_tick(slow, "");
    let mut launch = stage.start("exec-slow", &[]);
    launch.finish();
    says(&launch, &["waiting for Leguin"]);
    let held_s = stage.lab.summary("exec-slow")["wall"]["held_up_by"]["Leguin"]["longest_s"]
        .as_f64()
        .unwrap();
    assert!(
        held_s > 1.0,
        "the summary says who held up the run: {held_s}"
    );
    assert!(
        stage
            .lab
            .events("exec-slow")
            .iter()
            .all(|event| event["event"] != "lost")
    );

    let quick = Stage::each_tick("", "");
    quick.start("exec-quick", &[]).finish();
    assert_same(
        ("slow", &stage.lab.bytes("exec-slow")),
        ("quick", &quick.lab.bytes("exec-quick")),
    );
}

#[test]
fn init_starts_the_same_process_over() {
    let stage = Stage::each_tick(r#"if is init; then echo "init in $$: $json" >&2; fi"#, "");
    let mut launch = stage.start("exec-again", &["--paused"]);
    let lab = &stage.lab;
    lab.until_ready("exec-again");
    lab.step("exec-again", 3);
    lab.ok(&["ctl", "init", "--run", "exec-again"]);
    lab.ok(&["ctl", "start", "--run", "exec-again"]);
    launch.finish();
    let log = stage.log("exec-again");
    let inits: Vec<(&str, &str)> = log
        .lines()
        .filter_map(|line| line.split_once("init in ")?.1.split_once(':'))
        .collect();
    let [first, second] = inits[..] else {
        panic!("two lines init are expected:\n{log}")
    };
    assert_eq!(first.0, second.0, "the process is the same");
    assert!(
        first.1.contains("\"epoch\":1,") && second.1.contains("\"epoch\":2,"),
        "{log}"
    );
    nobody_is_left("exec-again");
}

#[test]
fn a_program_that_does_not_flush_is_told_once_and_waited_for() {
    // sed keeps what it writes to a pipe back.
    let stage = Stage::new(
        r#"while hear; do say '{"type":"done"}'; done | sed 's/x/x/'"#,
        "env = { CARS_FLUSH_NOTICE_S = \"0.3\" }",
    );
    let mut launch = stage.start("exec-unflushed", &[]);
    launch.prints("Leguin: its program has not flushed its standard output");
    let once = launch.prints("sed -u, grep --line-buffered, stdbuf -oL");
    launch.prints_after("waiting for Leguin", None);

    std::thread::sleep(std::time::Duration::from_secs(1));
    assert_eq!(
        launch.prints("has not flushed"),
        once,
        "it is the same line"
    );
    assert_eq!(launch.printed().matches("has not flushed").count(), 1);
    launch.signal(nix::sys::signal::Signal::SIGTERM);
    launch.wait();
    nobody_is_left("exec-unflushed");
}
