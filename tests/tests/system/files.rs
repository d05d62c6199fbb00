//! Damaged scenario and launch files: reading one gives what it says, or an error that names the file; nothing else ever
//! happens. Damage is drawn anew each time; what once failed is kept beside this file and tried first.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use scenario::Scenario;
use scenario::diagnostic::Source;
use system_tests::{programs, root};

/// One thing that goes wrong in a file.
#[derive(Debug, Clone)]
enum Damage {
    DropLine(Index),
    RepeatLine(Index),
    /// Another value behind one of the equals signs.
    Value(Index, String),
    /// Another key before one of them.
    Key(Index, String),
    Insert(Index, char),
    CutOff(Index),
}

/// Values that tend to be handled wrongly.
const ODD: &[&str] = &[
    "0",
    "-1",
    "1e308",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "1000000000",
    "\"\"",
    "\"0 s\"",
    "\"-1 ft\"",
    "\"1e308 m\"",
    "\"1e-300 m\"",
    "\"nan s\"",
    "\"../../../etc/passwd\"",
    "\"/dev/zero\"",
    "\"\\u0000\"",
    "\"operator\"",
    "[]",
    "[[]]",
    "[\"1 m\"]",
    "[\"1 km\", \"1 km\"]",
    "[\"0 m\", \"0 m\"]",
    "[\"\"]",
    "{}",
    "{ a = 1 }",
    "{ min = \"2 s\", mode = \"1 s\", max = \"0 s\" }",
    "{ command = [] }",
    "true",
    "1979-05-27",
    "max",
];

fn damage() -> impl Strategy<Value = Damage> {
    let odd = prop_oneof![
        8 => prop::sample::select(ODD).prop_map(str::to_owned),
        1 => "\\PC{0,20}",
        1 => Just(format!("\"{}\"", "x".repeat(10_000))),
    ];

    prop_oneof![
        1 => any::<Index>().prop_map(Damage::DropLine),
        1 => any::<Index>().prop_map(Damage::RepeatLine),
        5 => (any::<Index>(), odd).prop_map(|(at, value)| Damage::Value(at, value)),
        1 => (any::<Index>(), "[a-z_]{1,8}").prop_map(|(at, key)| Damage::Key(at, key)),
        1 => (any::<Index>(), any::<char>()).prop_map(|(at, with)| Damage::Insert(at, with)),
        1 => any::<Index>().prop_map(Damage::CutOff),
    ]
}

impl Damage {
    fn apply(&self, text: &str) -> String {
        let lines: Vec<&str> = text.lines().collect();
        let is_pair = |line: &&str| line.contains('=') && !line.starts_with('#');
        let pairs: Vec<usize> = (0..lines.len()).filter(|i| is_pair(&lines[*i])).collect();
        let with_line = |at: usize, change: &dyn Fn(&str) -> String| {
            let changed = |(i, line): (usize, &&str)| {
                if i == at {
                    change(line)
                } else {
                    format!("{line}\n")
                }
            };
            lines.iter().enumerate().map(changed).collect::<String>()
        };

        let in_pair = |at: &Index, change: &dyn Fn(&str, &str) -> String| match pairs.as_slice() {
            [] => text.to_owned(),
            pairs => with_line(*at.get(pairs), &|line| {
                let (key, value) = line.split_once('=').unwrap();
                change(key, value)
            }),
        };

        match self {
            _ if lines.is_empty() => text.to_owned(),
            Self::DropLine(at) => with_line(at.index(lines.len()), &|_| String::new()),
            Self::RepeatLine(at) => {
                with_line(at.index(lines.len()), &|line| format!("{line}\n{line}\n"))
            }
            Self::Value(at, odd) => in_pair(at, &|key, _| format!("{key}= {odd}\n")),
            Self::Key(at, odd) => in_pair(at, &|_, value| format!("{odd} ={value}\n")),
            Self::Insert(at, with) => {
                let places: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
                let (before, after) = text.split_at(*at.get(&places));
                format!("{before}{with}{after}")
            }
            Self::CutOff(at) => {
                let places: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
                text[..*at.get(&places)].to_owned()
            }
        }
    }
}

fn shipped(folder: &str) -> Vec<PathBuf> {
    let files = std::fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = files
        .filter(|file| file.extension().is_some_and(|end| end == "toml"))
        .collect();
    files.sort();
    files
}

/// A shipped file of this folder, damaged: its text.
pub(crate) fn damaged(folder: &str) -> impl Strategy<Value = String> + use<> {
    let texts: Vec<String> = shipped(folder)
        .iter()
        .map(|file| std::fs::read_to_string(file).unwrap())
        .collect();
    let damages = prop::collection::vec(damage(), 1..5);

    (prop::sample::select(texts), damages).prop_map(|(text, damages)| {
        damages
            .iter()
            .fold(text, |text, damage| damage.apply(&text))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    /// What is accepted is a hall that can be made, and says the same when it is written and read again.
    #[test]
    fn a_damaged_scenario_is_read_or_refused(text in damaged("configs")) {
        let source = Source { name: "damaged.toml".to_owned(), text };
        match Scenario::parse(&source, &root().join("configs")) {
            Ok(scenario) => {
                let text = scenario.to_toml().unwrap();
                let again = Source { name: "again.toml".to_owned(), text: text.clone() };
                let again = Scenario::parse(&again, Path::new(".")).and_then(|scenario| scenario.to_toml());
                prop_assert_eq!(again.map_err(|error| error.in_words()), Ok(text));
            }
            Err(error) => prop_assert!(!error.in_words().is_empty()),
        }
    }
}

/// Makes a folder for damaged files of one kind. Launch files find their scenarios beside them, and scenarios their robots'
/// parameters.
pub(crate) fn make_surroundings(folder: &Path, kind: &str, others: &str) {
    for name in [kind, others, "configs/robots"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    for file in shipped(others).into_iter().chain(shipped("configs/robots")) {
        let copy = folder.join(file.strip_prefix(root()).unwrap());
        std::fs::copy(&file, copy).unwrap();
    }
}

/// The real program, with the errors as people see them.
#[test]
fn the_program_survives_damaged_files() {
    const FILES: usize = 300;

    let folder = tempfile::tempdir().unwrap();

    for (kind, others) in [("launch", "configs"), ("configs", "launch")] {
        make_surroundings(folder.path(), kind, others);
        let (mut runner, strategy) = (TestRunner::default(), damaged(kind));
        let files: Vec<PathBuf> = (0..FILES)
            .map(|i| {
                let file = folder.path().join(kind).join(format!("damaged-{i}.toml"));
                std::fs::write(&file, strategy.new_tree(&mut runner).unwrap().current()).unwrap();
                file
            })
            .collect();
        let output = Command::new(programs().join("cars"))
            .arg("check")
            .args(&files)
            .output()
            .unwrap();
        assert_eq!(
            output.status.code(),
            Some(1),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let said = [output.stdout, output.stderr]
            .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
            .concat();
        // Long lines are broken for people.
        let said = said.replace(|c: char| c.is_whitespace() || c == '│', "");
        assert!(!said.contains("panicked"), "{said}");
        for file in &files {
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(
                said.contains(name),
                "nothing is said about {name}:\n{}",
                std::fs::read_to_string(file).unwrap()
            );
        }
        println!("{} damaged files in {kind}", files.len());
    }
}

/// Runs `cars check` on a scenario, but not for ever. Returns its exit status and its output.
fn check(folder: &Path, name: &str, text: &str) -> (Option<i32>, String) {
    let file = folder.join(name);
    std::fs::write(&file, text).unwrap();
    let mut check = Command::new(programs().join("cars"));
    check.arg("check").arg(&file);

    ends_within(Duration::from_secs(20), check, &format!("checking {name}"))
}

/// Runs a program that must end within `limit`. Returns its exit status and its output, whose lines are not broken.
pub(crate) fn ends_within(
    limit: Duration,
    mut command: Command,
    what: &str,
) -> (Option<i32>, String) {
    let mut child = command
        .env("COLUMNS", "400")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();

    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > limit {
            child.kill().unwrap();
            panic!("{what} does not end within {limit:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().unwrap();
    let streams = [&output.stdout, &output.stderr];
    let printed = streams.map(|bytes| String::from_utf8_lossy(bytes)).concat();
    (output.status.code(), printed)
}

#[test]
fn a_file_named_by_another_is_a_regular_one() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("pipe");
    assert!(
        Command::new("mkfifo")
            .arg(&fifo)
            .status()
            .unwrap()
            .success()
    );

    for named in ["pipe", "/dev/zero", "/dev/tty", "."] {
        let robot = "[[robot]]\nname = \"Butler\"\nat = [\"25 ft\", \"25 ft\"]\n";
        let text = format!("{robot}params_from = \"{named}\"\n");
        let (code, printed) = check(folder.path(), "named.toml", &text);
        assert_eq!(code, Some(1), "{printed}");
        for part in ["named.toml:4:15", &format!("{named} is not a regular file")] {
            assert!(printed.contains(part), "no {part:?} in\n{printed}");
        }

        let text = format!("scenario = \"{named}\"\n");
        let (code, printed) = check(folder.path(), "launch.toml", &text);
        assert_eq!(code, Some(1), "{printed}");
        assert!(printed.contains("launch.toml:1:12"), "{printed}");
    }
}

#[test]
fn the_number_of_guests_has_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let text = |count: usize| {
        format!("[field]\nsize = [\"4000 m\", \"4000 m\"]\n[guests]\ncount = {count}\n")
    };
    let most = scenario::MAX_GUESTS;
    let (code, printed) = check(folder.path(), "most.toml", &text(most));
    assert_eq!(code, Some(0), "{printed}");

    for count in [most + 1, 16_000_000] {
        let (code, printed) = check(folder.path(), "more.toml", &text(count));
        let expected = format!("{count} guests, more than the {most} allowed");
        assert_eq!(code, Some(1));
        assert!(
            printed.contains("more.toml:4:9") && printed.contains(&expected),
            "{printed}"
        );
    }
}

#[test]
fn the_excerpt_of_a_file_cannot_steer_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let text = "seed = 1 # \u{202e}\nguests = \"\u{9b}\u{1b}[2J\"\n";
    let (code, printed) = check(folder.path(), "bad.toml", text);
    assert_eq!(code, Some(1));
    assert!(printed.contains("bad.toml:2:"), "{printed}");
    assert!(printed.contains(r"seed = 1 # \u{202e}"), "{printed}");
    assert!(
        printed.contains(r#"guests = "\u{9b}\u{1b}[2J""#),
        "{printed}"
    );
    let rest = printed.replace('\n', "");
    assert!(
        !rest.contains(char::is_control) && !rest.contains('\u{202e}'),
        "{printed:?}"
    );
}
