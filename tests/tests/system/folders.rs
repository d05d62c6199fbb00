//! What a command did not make stays as it is, byte for byte, whatever stands where it makes a folder.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{Read, Seek};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use nix::sys::signal::Signal;
use nix::unistd::Pid;
use system_tests::processes::{Running, nobody_is_left};
use system_tests::{Lab, eventually, free_port, programs, root};

const HALL: &str = "launch/hors_doeuvres.toml";
/// What writes one file: the subcommand, and its format.
const WRITERS: [(&str, Option<&str>); 5] = [
    ("report", None),
    ("diagram", None),
    ("export", Some("--shiviz")),
    ("export", Some("--trace")),
    ("export", Some("--emotionml")),
];
/// The name that is taken.
const TAKEN: &str = "taken";
/// A run beside it.
const PRECIOUS: &str = "precious";

/// What is at a path.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Entry {
    Folder,
    File(Vec<u8>),
    Link(PathBuf),
}

/// Everything below a folder.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Entry> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            let kind = path.symlink_metadata().unwrap();
            let content = if kind.is_symlink() {
                Entry::Link(std::fs::read_link(&path).unwrap())
            } else if kind.is_dir() {
                open.push(path.clone());
                Entry::Folder
            } else {
                Entry::File(std::fs::read(&path).unwrap())
            };
            found.insert(path, content);
        }
    }
    found
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for (path, entry) in tree(from) {
        let path = to.join(path.strip_prefix(from).unwrap());
        match entry {
            Entry::Folder => std::fs::create_dir_all(path).unwrap(),
            Entry::File(bytes) => {
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, bytes).unwrap();
            }
            Entry::Link(target) => symlink(target, path).unwrap(),
        }
    }
}

/// What stands where a run's folder is to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Obstacle {
    Nothing,
    FinishedRun,
    KilledRun,
    RunInProgress,
    LaunchInProgress,
    LinkToRun,
    LinkOutside,
    DanglingLink,
    File,
    ForeignFolder,
    RobotFolder,
    LinkedEvents,
    LinkedLogs,
    LinkedDraft,
    HardLinks,
}

const OBSTACLES: [Obstacle; 15] = [
    Obstacle::Nothing,
    Obstacle::FinishedRun,
    Obstacle::KilledRun,
    Obstacle::RunInProgress,
    Obstacle::LaunchInProgress,
    Obstacle::LinkToRun,
    Obstacle::LinkOutside,
    Obstacle::DanglingLink,
    Obstacle::File,
    Obstacle::ForeignFolder,
    Obstacle::RobotFolder,
    Obstacle::LinkedEvents,
    Obstacle::LinkedLogs,
    Obstacle::LinkedDraft,
    Obstacle::HardLinks,
];

impl Obstacle {
    /// Puts it there. What is returned is held while the command runs.
    fn place(self, lab: &Place) -> Option<File> {
        let at = lab.out().join(TAKEN);
        let precious = lab.out().join(PRECIOUS);
        match self {
            Self::Nothing => {}
            Self::FinishedRun => {
                copy(&precious, &at);
                std::fs::write(at.join("notes.txt"), "mine").unwrap();
            }
            Self::KilledRun => make_killed(&precious, &at),
            Self::RunInProgress | Self::LaunchInProgress => {
                copy(&precious, &at);
                let lock = if self == Self::RunInProgress {
                    ".lock"
                } else {
                    "launched.json"
                };
                let lock = File::open(at.join(lock)).unwrap();
                lock.try_lock().unwrap();
                return Some(lock);
            }
            Self::LinkToRun => symlink(PRECIOUS, &at).unwrap(),
            Self::LinkOutside => symlink(lab.outside(), &at).unwrap(),
            Self::DanglingLink => symlink("nowhere", &at).unwrap(),
            Self::File => std::fs::write(&at, "a file").unwrap(),
            Self::ForeignFolder => {
                std::fs::create_dir(&at).unwrap();
                std::fs::write(at.join("thesis.tex"), "years").unwrap();
            }
            Self::RobotFolder => {
                std::fs::create_dir(&at).unwrap();
                std::fs::write(at.join("scenario.toml"), "# by hand").unwrap();
            }
            Self::LinkedEvents => {
                make_killed(&precious, &at);
                std::fs::remove_file(at.join("events.jsonl")).unwrap();
                symlink(precious.join("events.jsonl"), at.join("events.jsonl")).unwrap();
            }
            Self::LinkedLogs => {
                make_killed(&precious, &at);
                std::fs::remove_dir_all(at.join("logs")).unwrap();
                symlink(precious.join("logs"), at.join("logs")).unwrap();
            }
            Self::LinkedDraft => {
                make_killed(&precious, &at);
                symlink(precious.join("cars.log"), at.join("events.jsonl.draft")).unwrap();
            }
            // As `cp -al` copies a folder.
            Self::HardLinks => {
                let original = lab.out().join("killed");
                make_killed(&precious, &original);
                for (path, entry) in tree(&original) {
                    let link = at.join(path.strip_prefix(&original).unwrap());
                    std::fs::create_dir_all(link.parent().unwrap()).unwrap();
                    if matches!(entry, Entry::File(_)) {
                        std::fs::hard_link(path, link).unwrap();
                    }
                }
            }
        }
        None
    }
}

/// A copy of a run whose simulator was killed.
fn make_killed(run: &Path, at: &Path) {
    copy(run, at);
    let events = at.join("events.jsonl");
    let text = std::fs::read_to_string(&events).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let kept = lines.len() / 2;
    std::fs::write(events, lines[..kept].join("\n") + "\n").unwrap();
    std::fs::remove_file(at.join("summary.json")).unwrap();
}

/// A folder of runs with a precious one, and a folder outside of it.
struct Place {
    lab: Lab,
}

impl Place {
    fn of(master: &Lab) -> Self {
        let lab = Lab::new();
        copy(
            &master.out().join(PRECIOUS),
            &lab.out().join("runs").join(PRECIOUS),
        );
        copy(&master.out().join(PRECIOUS), &lab.out().join("outside"));
        copy(
            &master.out().join("study"),
            &lab.out().join("runs/experiments/study"),
        );
        symlink(PRECIOUS, lab.out().join("runs/latest")).unwrap();
        Self { lab }
    }

    fn out(&self) -> PathBuf {
        self.lab.out().join("runs")
    }

    fn outside(&self) -> PathBuf {
        self.lab.out().join("outside")
    }
}

/// A run and an experiment that all places have copies of.
fn master() -> Lab {
    let lab = Lab::new();
    let launch = ["launch", HALL, "--speed", "max", "--no-console", "--quiet"];
    lab.ok(&[&launch[..], &["--duration", "4 s", "--run", PRECIOUS]].concat());
    let study = lab.out().join("study");
    let output = program("cars")
        .args([
            "experiment",
            "run",
            "deadlock",
            "--seeds",
            "2",
            "--duration",
            "2 s",
            "-o",
        ])
        .arg(&study)
        .output()
        .unwrap();
    assert!(study.join("plan.json").exists(), "{}", said(&output));
    lab
}

fn program(name: &str) -> Command {
    let mut command = Command::new(programs().join(name));
    command
        .current_dir(root())
        .stdin(Stdio::null())
        .env("COLUMNS", "400")
        .env_remove("CARS_RUN")
        .env_remove("CARS_CONNECT");
    command
}

/// A text whose lines are not broken for people.
fn in_one_line(text: &str) -> String {
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    words.join(" ")
}

fn said(output: &Output) -> String {
    let streams = [&output.stdout, &output.stderr];
    streams.map(|text| String::from_utf8_lossy(text)).concat()
}

/// A command that makes a run's folder, and whether it takes the next free name; or one that writes at a path, or reads what is there.
struct Making {
    name: &'static str,
    program: &'static str,
    args: &'static [&'static str],
    numbers: bool,
}

const MAKING: [Making; 17] = [
    Making {
        name: "run",
        program: "cars",
        args: &["run", HALL, "--duration", "2 s", "-q", "--run", TAKEN],
        numbers: true,
    },
    Making {
        name: "run --replace",
        program: "cars",
        args: &[
            "run",
            HALL,
            "--duration",
            "2 s",
            "-q",
            "--run",
            TAKEN,
            "--replace",
        ],
        numbers: false,
    },
    Making {
        name: "launch",
        program: "cars",
        args: &[
            "launch",
            HALL,
            "--duration",
            "2 s",
            "--speed",
            "max",
            "--no-console",
            "-q",
            "--run",
            TAKEN,
        ],
        numbers: true,
    },
    Making {
        name: "launch --replace",
        program: "cars",
        args: &[
            "launch",
            HALL,
            "--duration",
            "2 s",
            "--speed",
            "max",
            "--no-console",
            "-q",
            "--run",
            TAKEN,
            "--replace",
        ],
        numbers: false,
    },
    Making {
        name: "fork",
        program: "cars",
        args: &[
            "fork",
            "precious@2",
            "--set",
            "network.commands.loss=0.5",
            "-q",
            "--run",
            TAKEN,
        ],
        numbers: true,
    },
    Making {
        name: "fork --replace",
        program: "cars",
        args: &[
            "fork",
            "precious@2",
            "--set",
            "network.commands.loss=0.5",
            "-q",
            "--run",
            TAKEN,
            "--replace",
        ],
        numbers: false,
    },
    Making {
        name: "experiment replay",
        program: "cars",
        args: &[
            "experiment",
            "replay",
            "EXPERIMENT",
            "0",
            "-q",
            "--run",
            TAKEN,
        ],
        numbers: true,
    },
    Making {
        name: "resume",
        program: "cars",
        args: &[
            "launch",
            "--resume",
            TAKEN,
            "--speed",
            "max",
            "--no-console",
            "-q",
        ],
        numbers: false,
    },
    // It has no robots, and ends by itself: the folder is made when it listens.
    Making {
        name: "simulator",
        program: "cars-sim",
        args: &[
            "configs/hors_doeuvres.toml",
            "--run",
            TAKEN,
            "--listen",
            "ENDPOINT",
        ],
        numbers: false,
    },
    Making {
        name: "replay",
        program: "cars",
        args: &["replay", "AT", "--speed", "max", "--listen", "ENDPOINT"],
        numbers: false,
    },
    Making {
        name: "verify",
        program: "cars",
        args: &["verify", "AT"],
        numbers: false,
    },
    Making {
        name: "verify --processes",
        program: "cars",
        args: &["verify", "AT", "--processes"],
        numbers: false,
    },
    Making {
        name: "hunt",
        program: "cars",
        args: &[
            "hunt",
            HALL,
            "--plans",
            "20",
            "--set",
            "robot.Butler.params.policy=neither",
            "-o",
            "AT",
        ],
        numbers: false,
    },
    Making {
        name: "experiment run",
        program: "cars",
        args: &[
            "experiment",
            "run",
            "deadlock",
            "--seeds",
            "1",
            "--duration",
            "2 s",
            "-o",
            "AT",
        ],
        numbers: false,
    },
    Making {
        name: "new robot",
        program: "cars",
        args: &["new", "robot", TAKEN, "--lang", "python", "--out", "RUNS"],
        numbers: false,
    },
    Making {
        name: "report",
        program: "cars",
        args: &["report", "PRECIOUS", "-o", "AT"],
        numbers: false,
    },
    Making {
        name: "conform",
        program: "cars",
        args: &[
            "conform",
            "--rule",
            "news.wait",
            "--scenario",
            HALL,
            "--name",
            "Butler",
            "--",
            "ROBOT",
        ],
        numbers: false,
    },
];

/// Those of them that make no run.
const OTHERS: [&str; 8] = [
    "replay",
    "verify",
    "verify --processes",
    "hunt",
    "experiment run",
    "new robot",
    "report",
    "conform",
];

impl Making {
    fn play(&self, place: &Place) -> Output {
        let mut command = Command::new("timeout");
        command
            .args(["--signal=TERM", "60"])
            .arg(programs().join(self.program))
            .current_dir(root())
            .stdin(Stdio::null())
            .env("COLUMNS", "400");
        for arg in self.args {
            match *arg {
                "EXPERIMENT" => command.arg(place.out().join("experiments/study")),
                "ENDPOINT" => command.arg(format!("tcp/127.0.0.1:{}", free_port())),
                "AT" => command.arg(place.out().join(TAKEN)),
                "RUNS" => command.arg(place.out()),
                "PRECIOUS" => command.arg(place.out().join(PRECIOUS)),
                "ROBOT" => command.arg(programs().join("cars-butler")),
                arg => command.arg(arg),
            };
        }
        if !OTHERS.contains(&self.name) {
            command.arg("--out").arg(place.out());
        }
        match self.name {
            "simulator" | "replay" => output_until_it_speaks(&mut command),
            _ => command.output().unwrap(),
        }
    }

    /// Whether the command may change what stands there.
    fn may_change(&self, obstacle: Obstacle) -> bool {
        match self.name {
            "resume" => obstacle == Obstacle::KilledRun,
            name => {
                let is_over = matches!(obstacle, Obstacle::FinishedRun | Obstacle::KilledRun);
                // A report is a file, and replaces a file.
                let is_report = name == "report" && obstacle == Obstacle::File;
                is_report || name.ends_with("--replace") && is_over
            }
        }
    }
}

/// What a program prints that would not end by itself: it is stopped after its first words, which it says when its folder is made.
fn output_until_it_speaks(command: &mut Command) -> Output {
    let mut printed = tempfile::tempfile().unwrap();
    let mut child = command
        .stdout(printed.try_clone().unwrap())
        .stderr(printed.try_clone().unwrap())
        .spawn()
        .unwrap();
    let is_over = eventually("the program has ended or said something", || {
        let is_over = child.try_wait().unwrap().is_some();
        let has_spoken = printed.metadata().unwrap().len() > 0;
        (is_over || has_spoken).then_some(is_over)
    });
    if !is_over {
        kill(&child, Signal::SIGTERM);
    }

    let status = child.wait().unwrap();
    let mut stdout = Vec::new();
    printed.rewind().unwrap();
    printed.read_to_end(&mut stdout).unwrap();
    Output {
        status,
        stdout,
        stderr: Vec::new(),
    }
}

/// Checks that of what there was nothing has changed but what a command may.
fn assert_kept(
    before: &BTreeMap<PathBuf, Entry>,
    place: &Place,
    may_change: Option<&Path>,
    what: &str,
) {
    let after = tree(place.lab.out());
    let latest = place.out().join("latest");
    for (path, entry) in before {
        let is_free = may_change.is_some_and(|folder| path.starts_with(folder));
        let is_notes = path.ends_with("notes.txt");
        if *path == latest || (is_free && !is_notes) {
            continue;
        }
        assert!(
            after.get(path) == Some(entry),
            "{what}: {} has changed",
            path.display()
        );
    }
    if let Some(latest) = after.get(&latest) {
        assert!(matches!(latest, Entry::Link(_)), "{what}: latest");
    }
}

/// One of each kind: a new name, the place of a run that is over, a run that goes on, and a program by itself.
const USUAL: [&str; 4] = ["run", "run --replace", "resume", "simulator"];

#[test]
fn no_command_changes_what_it_did_not_make() {
    commands_keep_what_they_did_not_make(|making| USUAL.contains(&making.name));
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn no_other_command_changes_what_it_did_not_make() {
    commands_keep_what_they_did_not_make(|making| !USUAL.contains(&making.name));
}

fn commands_keep_what_they_did_not_make(is_meant: fn(&Making) -> bool) {
    let master = master();
    let mut failed = Vec::new();
    for making in MAKING.iter().filter(|making| is_meant(making)) {
        for obstacle in OBSTACLES {
            let what = format!("{} where there is {obstacle:?}", making.name);
            let place = Place::of(&master);
            let held = obstacle.place(&place);
            let before = tree(place.lab.out());
            let output = making.play(&place);
            let printed = said(&output);
            drop(held);

            assert!(!printed.contains("panicked"), "{what}: {printed}");
            let taken = place.out().join(TAKEN);
            let changed = making.may_change(obstacle).then_some(&*taken);
            assert_kept(&before, &place, changed, &what);
            if OTHERS.contains(&making.name) {
                continue;
            }

            // A run that finds no free name says what to do; any other one is recorded.
            let is_made = match obstacle {
                Obstacle::Nothing => making.name != "resume",
                _ => making.numbers || making.may_change(obstacle),
            };
            let name = match obstacle {
                Obstacle::Nothing => TAKEN.to_owned(),
                _ if making.numbers => format!("{TAKEN}-2"),
                _ => TAKEN.to_owned(),
            };
            let folder = place.out().join(&name);
            let was_made = match making.name {
                "simulator" => folder.join(".lock").exists() && !printed.contains("exists already"),
                _ => {
                    let events = folder.join("events.jsonl");
                    let is_own = !folder.is_symlink() && folder.join("summary.json").exists();
                    let there = before.get(&events).cloned();
                    is_own && tree(&folder).get(&events).cloned() != there
                }
            };
            if is_made != was_made {
                failed.push(format!("{what}: {} {printed}", output.status));
            }
            if making.numbers && obstacle != Obstacle::Nothing && !printed.contains(&name) {
                failed.push(format!("{what}: no word about {name}: {printed}"));
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn processes_that_begin_at_the_same_moment_get_folders_of_their_own() {
    const COUNT: usize = 6;
    let lab = Lab::new();
    let mut running = Vec::new();
    for _ in 0..COUNT {
        let mut command = program("cars");
        command
            .args([
                "run",
                HALL,
                "--duration",
                "5 s",
                "-q",
                "--run",
                "same",
                "--out",
            ])
            .arg(lab.out());
        running.push(command.stderr(Stdio::null()).spawn().unwrap());
    }
    for mut one in running {
        one.wait().unwrap();
    }

    for number in 1..=COUNT {
        let name = match number {
            1 => "same".to_owned(),
            number => format!("same-{number}"),
        };
        assert_eq!(lab.bytes(&name), lab.bytes("same"), "{name}");
        let folder = lab.out().join(&name);
        let (code, text) = lab.cars_without_out(&["check", folder.to_str().unwrap()]);
        assert_eq!(code, 0, "{name}: {text}");
    }
    let latest = std::fs::read_link(lab.out().join("latest")).unwrap();
    assert!(latest.to_str().unwrap().starts_with("same"));
    let left = tree(lab.out()).into_keys();
    let mut left = left.filter(|path| path.to_string_lossy().contains(".latest"));
    assert_eq!(left.next(), None);
}

#[test]
fn reserved_names_are_refused_everywhere_with_what_to_do() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "2 s", "-q", "--run", PRECIOUS]);
    let file = lab.write(
        "latest.toml",
        "[[robot]]\nname = \"Butler\"\nat = [\"25 ft\", \"25 ft\"]\n",
    );
    let butler = "[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n";
    let text = format!("scenario = \"latest.toml\"\n{butler}");
    let launch = lab.write("experiments.toml", &text);
    let text = format!("scenario = \"latest.toml\"\nrun = \"latest\"\n{butler}");
    let named = lab.write("named.toml", &text);
    let before = tree(lab.out());
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    let [file, launch, named] = [&file, &launch, &named].map(|file| path(file));

    for args in [
        &["run", &file, "-q"][..],
        &["run", HALL, "--run", "latest"],
        &["run", HALL, "--run", "experiments"],
        &["launch", &launch],
        &["launch", &named],
        &["launch", HALL, "--run", "latest"],
        &["fork", "precious@1", "--run", "latest"],
        &["ctl", "status", "--run", "latest"],
        &["net", "play", HALL, "--via", "proxy", "--run", "latest"],
    ] {
        let (_, text) = lab.fails(args);
        assert!(
            in_one_line(&text).contains("choose another name"),
            "{args:?}: {text}"
        );
    }
    for args in [
        &["check", &file][..],
        &["check", &launch],
        &["check", &named],
    ] {
        let (code, text) = lab.cars_without_out(args);
        assert_eq!(code, 1, "{args:?}: {text}");
        assert!(
            in_one_line(&text).contains("choose another name"),
            "{args:?}: {text}"
        );
    }
    let simulator = program("cars-sim")
        .args(["configs/hors_doeuvres.toml", "--run", "latest"])
        .output()
        .unwrap();
    assert!(in_one_line(&said(&simulator)).contains("choose another name"));
    assert_eq!(tree(lab.out()), before);
}

#[test]
fn every_reader_takes_a_copy_with_any_name() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "4 s", "-q", "--run", "one"]);
    let elsewhere = tempfile::tempdir().unwrap();
    let names: [&[u8]; 4] = [
        "a copy (1)".as_bytes(),
        "latest".as_bytes(),
        "ä".as_bytes(),
        b"\xff",
    ];
    for name in names {
        let folder = elsewhere.path().join(OsStr::from_bytes(name));
        copy(&lab.out().join("one"), &folder);
        let before = tree(&folder);
        let file = elsewhere.path().join("file");
        let readers: &[&[&str]] = &[
            &["check", "FOLDER"],
            &["verify", "FOLDER"],
            &["diff", "FOLDER", "FOLDER"],
            &["expect", "FOLDER"],
            &["log", "FOLDER"],
            &["export", "FOLDER", "--csv", "-o", "INTO"],
            &["export", "FOLDER", "--shiviz", "-o", "INTO/file"],
            &["export", "FOLDER", "--trace", "-o", "INTO/file"],
            &["export", "FOLDER", "--emotionml", "-o", "INTO/file"],
            &["diagram", "FOLDER", "-o", "INTO/file"],
            &["report", "FOLDER", "-o", "INTO/file"],
        ];
        for args in readers {
            let mut command = program("cars");
            for arg in *args {
                match *arg {
                    "FOLDER" => command.arg(&folder),
                    "INTO" => command.arg(elsewhere.path()),
                    "INTO/file" => command.arg(&file),
                    arg => command.arg(arg),
                };
            }
            let output = command.output().unwrap();
            let is_verdict = args[0] == "expect" && output.status.code() == Some(2);
            assert!(
                output.status.success() || is_verdict,
                "{args:?} of {folder:?}: {}",
                said(&output)
            );
        }
        let mut at = folder.clone().into_os_string();
        at.push("@2");
        let out = elsewhere.path().join("out");
        let forked = program("cars")
            .arg("fork")
            .arg(at)
            .arg("-q")
            .arg("--out")
            .arg(&out)
            .output();
        let forked = forked.unwrap();
        if folder.to_str().is_some() {
            assert!(
                out.join("latest/events.jsonl").exists(),
                "{}",
                said(&forked)
            );
        }
        assert!(!said(&forked).contains("panicked"), "{}", said(&forked));
        assert_eq!(tree(&folder), before, "{folder:?}");
    }
}

#[test]
fn no_command_panics_where_a_path_is_not_utf8() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "2 s", "-q", "--run", "one"]);
    let odd = lab.out().join(OsStr::from_bytes(b"odd\xff"));
    std::fs::create_dir(&odd).unwrap();
    let scenario = odd.join(OsStr::from_bytes(b"\xfe.toml"));
    std::fs::copy(root().join("configs/three_robots.toml"), &scenario).unwrap();

    let played = odd.join("played");
    let odd = odd.as_os_str();
    let commands: &[&[&OsStr]] = &[
        &[
            "run".as_ref(),
            HALL.as_ref(),
            "--duration".as_ref(),
            "1 s".as_ref(),
            "--out".as_ref(),
            odd,
        ],
        &["run".as_ref(), scenario.as_ref()],
        &[
            "launch".as_ref(),
            HALL.as_ref(),
            "--no-console".as_ref(),
            "--speed".as_ref(),
            "max".as_ref(),
            "--duration".as_ref(),
            "1 s".as_ref(),
            "--out".as_ref(),
            odd,
        ],
        &["launch".as_ref(), scenario.as_ref()],
        &["launch".as_ref(), "--roster".as_ref(), scenario.as_ref()],
        &["launch".as_ref(), "--resume".as_ref(), odd],
        &["launch".as_ref(), HALL.as_ref(), "--secure".as_ref(), odd],
        &["check".as_ref(), scenario.as_ref(), odd],
        &["init".as_ref(), odd],
        &[
            "new".as_ref(),
            "robot".as_ref(),
            "Rosie".as_ref(),
            "--lang".as_ref(),
            "bash".as_ref(),
            "--out".as_ref(),
            odd,
        ],
        &[
            "hunt".as_ref(),
            HALL.as_ref(),
            "--plans".as_ref(),
            "1".as_ref(),
            "--json".as_ref(),
            "--out".as_ref(),
            odd,
        ],
        &[
            "experiment".as_ref(),
            "run".as_ref(),
            "deadlock".as_ref(),
            "--plan-only".as_ref(),
            "-o".as_ref(),
            odd,
        ],
        &[
            "experiment".as_ref(),
            "run".as_ref(),
            "deadlock".as_ref(),
            "--seeds".as_ref(),
            "2".as_ref(),
            "--duration".as_ref(),
            "1 s".as_ref(),
            "-o".as_ref(),
            played.as_os_str(),
        ],
        &["experiment".as_ref(), "run".as_ref(), scenario.as_ref()],
        &["man".as_ref(), odd],
        &["verify".as_ref(), odd],
        &["log".as_ref(), odd],
        &[
            "report".as_ref(),
            "one".as_ref(),
            "--out".as_ref(),
            lab.out().as_ref(),
            "-o".as_ref(),
            scenario.as_ref(),
        ],
        &[
            "secure".as_ref(),
            "init".as_ref(),
            odd,
            "--robots".as_ref(),
            "Butler".as_ref(),
        ],
        &[
            "net".as_ref(),
            "play".as_ref(),
            scenario.as_ref(),
            "--via".as_ref(),
            "proxy".as_ref(),
        ],
        &["ctl".as_ref(), "status".as_ref(), "--out".as_ref(), odd],
        &["replay".as_ref(), odd],
    ];
    for args in commands {
        let mut command = Command::new("timeout");
        command.arg("60").arg(programs().join("cars")).args(*args);
        let output = command
            .current_dir(lab.out())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let text = said(&output);
        assert!(!text.contains("panicked"), "{args:?}: {text}");
        assert_ne!(output.status.code(), Some(101), "{args:?}: {text}");
        assert_ne!(
            output.status.code(),
            Some(124),
            "{args:?} does not end: {text}"
        );
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn no_output_replaces_a_part_of_a_record() {
    let master = master();
    let place = Place::of(&master);
    let other = place.out().join("other");
    copy(&place.out().join(PRECIOUS), &other);
    let study = place.out().join("experiments/study");
    let link = place.lab.out().join("link");
    symlink(other.join("events.jsonl"), &link).unwrap();

    let mut targets = vec![link];
    for folder in [&other, &other.join("logs"), &study, &study.join("units")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            targets.extend(path.is_file().then_some(path));
        }
    }
    assert!(targets.len() > 12, "{targets:?}");

    let before = tree(place.lab.out());
    for (command, format) in WRITERS {
        for target in &targets {
            for run in [PRECIOUS, "other"] {
                let output = program("cars")
                    .args([command, run])
                    .args(format)
                    .arg("-o")
                    .arg(target)
                    .arg("--out")
                    .arg(place.out())
                    .output()
                    .unwrap();
                let what = format!("{command} {run} {format:?} {}", target.display());
                let printed = in_one_line(&said(&output));
                assert!(!output.status.success(), "{what}: {printed}");
                assert!(
                    printed.contains("choose another --output"),
                    "{what}: {printed}"
                );
            }
        }
    }
    assert!(tree(place.lab.out()) == before, "something has changed");

    // Beside the record there is room.
    let beside = other.join("report.html");
    let output = program("cars")
        .arg("report")
        .arg(&other)
        .arg("-o")
        .arg(&beside)
        .output()
        .unwrap();
    assert!(
        output.status.success() && beside.exists(),
        "{}",
        said(&output)
    );

    // A log may be called what a table is called.
    let name = "record.log_name=states.csv";
    place.lab.ok(&[
        "run",
        HALL,
        "--duration",
        "2 s",
        "-q",
        "--run",
        "logged",
        "--set",
        name,
    ]);
    let logged = place.lab.out().join("logged");
    let before = tree(&logged);
    let into = logged.to_str().unwrap();
    let (_, printed) = place.lab.fails(&["export", "logged", "--csv", "-o", into]);
    let printed = in_one_line(&printed);
    assert!(printed.contains("is part of the record"), "{printed}");
    assert!(tree(&logged) == before, "something has changed");
}

#[test]
fn what_is_missing_or_of_another_run_is_named_and_a_pipe_is_not_waited_for() {
    let lab = Lab::new();
    for (run, seed) in [("one", "1"), ("two", "2")] {
        lab.ok(&[
            "run",
            HALL,
            "--duration",
            "4 s",
            "-q",
            "--run",
            run,
            "--seed",
            seed,
        ]);
    }
    let whole = lab.out().join("one");
    let check = |folder: &Path| lab.cars_without_out(&["check", folder.to_str().unwrap()]);
    assert_eq!(check(&whole).0, 0);

    let summary = lab.out().join("two/summary.json");
    for (name, expected) in [
        ("summary.json", "the run has ended, and"),
        ("cars.log", "the run was logged, and"),
        ("run.mcap", "the run was recorded, and"),
    ] {
        let folder = lab.out().join(format!("without-{name}"));
        copy(&whole, &folder);
        std::fs::remove_file(folder.join(name)).unwrap();
        let (code, printed) = check(&folder);
        assert_eq!(code, 1, "{name}: {printed}");
        assert!(
            in_one_line(&printed).contains(expected),
            "{name}: {printed}"
        );

        nix::unistd::mkfifo(&folder.join(name), nix::sys::stat::Mode::S_IRUSR).unwrap();
        let (code, printed) = check(&folder);
        assert_eq!(code, 1, "{name}: {printed}");
        assert!(
            in_one_line(&printed).contains("is not a file"),
            "{name}: {printed}"
        );
    }

    let other = lab.out().join("other-summary");
    copy(&whole, &other);
    std::fs::copy(summary, other.join("summary.json")).unwrap();
    let (code, printed) = check(&other);
    assert_eq!(code, 1, "{printed}");
    assert!(
        in_one_line(&printed).contains("is that of another run"),
        "{printed}"
    );
}

#[test]
fn a_run_that_ended_before_tick_0_is_whole() {
    let lab = Lab::new();
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let mut simulator = program("cars-sim")
        .args([
            "configs/hors_doeuvres.toml",
            "--run",
            "early",
            "--listen",
            &endpoint,
            "--out",
        ])
        .arg(lab.out())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let folder = lab.out().join("early");
    // It is written after the signal's handler is there.
    eventually("the endpoint", || {
        folder.join("endpoint").exists().then_some(())
    });
    kill(&simulator, Signal::SIGTERM);
    simulator.wait().unwrap();

    let (code, printed) = lab.cars_without_out(&["check", folder.to_str().unwrap()]);
    assert_eq!(code, 0, "{printed}");
}

/// A finished run that is to be replaced, with a file of a person beside its record.
fn with_a_run() -> Lab {
    let lab = Lab::new();
    let args = ["run", HALL, "--duration", "2 s", "-q", "--run"];
    lab.ok(&[&args[..], &[PRECIOUS]].concat());
    lab.ok(&[&args[..], &[TAKEN]].concat());
    lab.write(&format!("{TAKEN}/notes.txt"), "mine");
    lab
}

#[test]
fn a_run_that_a_robot_refuses_leaves_what_was_there() {
    let lab = with_a_run();
    let folder = lab.out().join(TAKEN);
    std::fs::write(folder.join("logs/Butler.log"), "earlier\n").unwrap();
    let before = tree(lab.out());

    for (command, own) in [
        ("run", &[][..]),
        ("run", &["--replace"]),
        ("launch", &["--replace", "--no-console", "--speed", "max"]),
    ] {
        let output = program("cars")
            .args([command, HALL, "--run", TAKEN])
            .args(["--set", "robot.Butler.params.no_such=1"])
            .args(own)
            .arg("--out")
            .arg(lab.out())
            .output()
            .unwrap();

        let printed = said(&output);
        assert_eq!(output.status.code(), Some(1), "{command}: {printed}");
        assert!(printed.contains("no_such"), "{command}: {printed}");
        let after = tree(lab.out());
        for path in before.keys().chain(after.keys()) {
            let place = path.display();
            assert_eq!(
                before.get(path),
                after.get(path),
                "{command} {own:?}: {place}"
            );
        }
    }

    // Accepted, it replaces the record.
    lab.ok(&["run", HALL, "--duration", "3 s", "-q", "--run", TAKEN]);
    assert!(!folder.join("logs/Butler.log").exists());
    assert!(!folder.join(".replaced").exists());
    assert_eq!(lab.summary(TAKEN)["ticks"], 6);
}

#[test]
fn a_simulator_that_does_not_begin_keeps_the_record_that_it_was_to_replace() {
    let lab = with_a_run();
    let before = tree(lab.out());
    let endpoint = lab.out().join(TAKEN).join("endpoint");
    // Killed it leaves the record aside, and the next one finds it there.
    for signal in [Signal::SIGKILL, Signal::SIGTERM] {
        let _left = std::fs::remove_file(&endpoint);
        let mut simulator = program("cars-sim")
            .args(["configs/hors_doeuvres.toml", "--run", TAKEN, "--replace"])
            .args(["--listen", &format!("tcp/127.0.0.1:{}", free_port())])
            .arg("--out")
            .arg(lab.out())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        eventually("the endpoint", || endpoint.exists().then_some(()));
        kill(&simulator, signal);
        simulator.wait().unwrap();
    }
    assert_eq!(tree(lab.out()), before);
}

fn kill(process: &Child, signal: Signal) {
    let pid = Pid::from_raw(i32::try_from(process.id()).unwrap());
    nix::sys::signal::kill(pid, signal).unwrap();
}

#[test]
fn a_file_that_cannot_be_written_to_its_end_is_as_it_was() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "60 s", "-q", "--run", "one"]);
    let into = lab.out().join("into");
    std::fs::create_dir(&into).unwrap();
    let file = into.join("file");
    let run = lab.out().join("one");
    for (command, format) in WRITERS {
        std::fs::write(&file, "earlier").unwrap();
        let mut little = Command::new("sh");
        little
            .args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$@\"", "sh"])
            .arg(programs().join("cars"))
            .args([command, run.to_str().unwrap()])
            .args(format)
            .arg("-o")
            .arg(&file);
        let output = little.output().unwrap();
        let text = said(&output);
        assert_eq!(output.status.code(), Some(1), "{command}: {text}");
        assert!(text.contains("cannot write"), "{command}: {text}");
        assert_eq!(
            std::fs::read_to_string(&file).unwrap(),
            "earlier",
            "{command}"
        );
        assert_eq!(tree(&into).len(), 1, "{command} leaves a draft");

        let output = program("cars")
            .args([command, run.to_str().unwrap()])
            .args(format)
            .args(["-o", "/dev/full"])
            .output()
            .unwrap();
        assert_eq!(
            output.status.code(),
            Some(1),
            "{command}: {}",
            said(&output)
        );
        let piped = program("cars")
            .args([command, run.to_str().unwrap()])
            .args(format)
            .args(["-o", "/dev/stdout"])
            .output()
            .unwrap();
        let plain = program("cars")
            .args([command, run.to_str().unwrap()])
            .args(format)
            .output()
            .unwrap();
        assert!(
            piped.status.success() && !plain.stdout.is_empty(),
            "{command}"
        );
        assert_eq!(piped.stdout, plain.stdout, "{command}");
        let output = program("cars")
            .args([command, run.to_str().unwrap()])
            .args(format)
            .arg("-o")
            .arg(&file)
            .output();
        assert!(output.unwrap().status.success());
        assert_eq!(std::fs::read(&file).unwrap(), plain.stdout, "{command}");
    }
}

#[test]
fn a_log_is_shown_by_the_name_or_the_folder_of_its_run() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "10 s", "-q", "--run", "one"]);
    lab.ok(&["run", HALL, "--duration", "5 s", "-q", "--run", "two"]);
    let log = std::fs::read_to_string(lab.file("one", "cars.log")).unwrap();
    let folder = lab.out().join("one");
    assert_eq!(lab.ok(&["log", "one"]), log);
    assert_eq!(lab.ok(&["log", "--run", "one"]), log);
    assert_eq!(lab.ok(&["log", folder.to_str().unwrap()]), log);
    assert_ne!(lab.ok(&["log", "latest"]), log);
    let (_, text) = lab.fails(&["log", "three"]);
    assert!(text.contains("there is no run three"), "{text}");
}

#[test]
fn an_experiment_keeps_the_folder_of_another_one_with_its_name() {
    let lab = Lab::new();
    let text = std::fs::read_to_string(root().join("configs/experiments/deadlock.toml")).unwrap();
    let scenario = root().join("configs/three_robots.toml");
    let mut files = Vec::new();
    for folder in ["a", "b"] {
        std::fs::create_dir(lab.out().join(folder)).unwrap();
        let mut text: toml::Table = toml::from_str(&text).unwrap();
        text.insert("scenario".to_owned(), scenario.to_str().unwrap().into());
        if folder == "b" {
            text.insert("question".to_owned(), "Another one?".into());
        }
        let file = lab.out().join(folder).join("study.toml");
        std::fs::write(&file, toml::to_string(&text).unwrap()).unwrap();
        files.push(file);
    }
    let plan = |file: &Path| {
        let mut command = program("cars");
        command
            .args([
                "experiment",
                "run",
                "--plan-only",
                "--seeds",
                "2",
                "--duration",
                "2 s",
            ])
            .arg(file)
            .current_dir(lab.out());
        command.output().unwrap()
    };

    let output = plan(&files[0]);
    assert!(output.status.success(), "{}", said(&output));
    let before = tree(&lab.out().join("runs"));
    let output = plan(&files[1]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("another experiment") && text.contains("-o"),
        "{text}"
    );
    assert_eq!(tree(&lab.out().join("runs")), before);

    // The file itself may be edited, and a copy of it may be anywhere.
    std::fs::copy(&files[0], &files[1]).unwrap();
    assert!(plan(&files[1]).status.success());
    let edited = std::fs::read_to_string(&files[1]).unwrap() + "\n# edited\n";
    std::fs::write(&files[1], edited).unwrap();
    assert!(plan(&files[1]).status.success());
}

#[test]
fn what_a_killed_experiment_leaves_in_the_temporary_folder_is_removed() {
    let lab = Lab::new();
    let temporary = lab.out().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    let text = format!(
        "question = \"Is anything left?\"\nscenario = {:?}\nseeds = 2\nduration = \"30 s\"\nbaseline = \"a\"\n\
         [[arm]]\nname = \"a\"\n[[measure]]\nname = \"treats\"\n\
         summary = \"robots.Butler.state_variables.treats\"\n",
        root().join("configs/hors_doeuvres.toml")
    );
    let file = lab.write("small.toml", &text);
    let command = |seeds: &str| {
        let mut command = program("cars");
        command
            .args(["experiment", "run"])
            .arg(&file)
            .args(["--processes", "--jobs", "1", "--seeds", seeds, "-o"])
            .arg(lab.out().join("study"))
            .env("TMPDIR", &temporary);
        command
    };
    let count = || std::fs::read_dir(&temporary).unwrap().count();

    let mut killed = command("50")
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // Before it has its lock, nobody can tell a folder that was just made from one that was left.
    let is_locked = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.is_ok_and(|entry| entry.path().join("in-use.lock").exists())
    };
    eventually("a unit", || {
        let mut folders = std::fs::read_dir(&temporary).unwrap();
        folders.any(is_locked).then_some(())
    });
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(count() > 0, "it was not killed in the middle of a unit");
    nobody_is_left("unit");

    let output = command("2").output().unwrap();
    assert!(!said(&output).contains("failed"), "{}", said(&output));
    assert_eq!(count(), 0);
}

#[test]
fn a_new_robot_has_runs_of_its_own_name_and_no_reserved_one() {
    let lab = Lab::new();
    for name in ["operator", "simulator", "console", "latest"] {
        let (code, text) = lab.fails(&["new", "robot", name, "--lang", "bash"]);
        assert_eq!(code, 1, "{text}");
        assert!(
            in_one_line(&text).contains("choose another name"),
            "{name}: {text}"
        );
        assert!(!lab.out().join(name).exists());
    }

    lab.ok(&["new", "robot", "Rosie", "--lang", "bash"]);
    let launch = lab.out().join("Rosie/launch.toml");
    let launch = launch.to_str().unwrap();
    let runs = lab.out().join("runs");
    for name in ["Rosie", "Rosie-2"] {
        let output = program("cars")
            .args([
                "launch",
                launch,
                "--no-console",
                "--speed",
                "max",
                "--duration",
                "2 s",
                "--out",
            ])
            .arg(&runs)
            .output()
            .unwrap();
        // What is said about the run, before the lines of its log.
        let notes = String::from_utf8_lossy(&output.stderr).into_owned();
        let first = notes.lines().next().unwrap_or_default();
        assert!(
            runs.join(name).join("summary.json").exists(),
            "{}",
            said(&output)
        );
        assert!(first.contains(name), "{first}");
    }
}

#[test]
fn a_run_in_progress_is_found_by_the_name_that_it_got() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "2 s", "-q", "--run", "hall"]);
    let mut command = program("cars");
    command
        .args(["launch", HALL, "--paused", "--speed", "max", "--no-console"])
        .args(["--run", "hall", "--out"])
        .arg(lab.out());
    let launch = Running::start(command, "hall-2", lab.out().join("hall-2"));
    lab.until_ready("hall-2");

    let (_, text) = lab.fails(&["run", HALL, "-q", "--run", "hall-2"]);
    assert!(text.contains("in progress"), "{text}");
    let (_, text) = lab.fails(&["launch", "--resume", "hall-2"]);
    assert!(text.contains("in progress"), "{text}");
    lab.ctl("hall-2", &["stop"]);
    drop(launch);
}
