//! `cars new robot`: what it makes is built and launched as its README says.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use system_tests::processes::{Running, nobody_is_left};
use system_tests::python::package;
use system_tests::tools::lacks_tool;
use system_tests::{Lab, assert_same, cargo, programs, root};

/// A new robot in a folder of its own.
struct Robot {
    lab: Lab,
    folder: PathBuf,
}

impl Robot {
    fn new(language: &str) -> Self {
        let lab = Lab::new();
        let out = lab.out().to_owned();
        Self::new_in(&out, lab, language)
    }

    fn new_in(out: &Path, lab: Lab, language: &str) -> Self {
        let (root, out) = (root(), out.to_str().unwrap());
        let args = [
            "new",
            "robot",
            "Rosie",
            "--lang",
            language,
            "--out",
            out,
            "--cars",
            root.to_str().unwrap(),
        ];
        let (code, text) = lab.cars_without_out(&args);
        assert_eq!(code, 0, "{text}");
        assert!(
            text.contains("launch.toml"),
            "it says what comes next: {text}"
        );

        let folder = Path::new(out).join("Rosie");
        Self { lab, folder }
    }

    /// Starts a launch of it.
    fn start(&self, run: &str, more: &[&str]) -> Running {
        let file = self.folder.join("launch.toml");
        let mut command = self.lab.cars(&[
            "launch",
            file.to_str().unwrap(),
            "--no-console",
            "--speed",
            "max",
            "--run",
            run,
        ]);

        command.args(more).env("PYTHONPATH", python_path());
        Running::start(command, run, self.lab.out().join(run))
    }

    fn cars_log(&self, run: &str) -> String {
        std::fs::read_to_string(self.lab.file(run, "cars.log")).unwrap()
    }

    /// It moves and feels, twice in the same way; it obeys; and it starts over. Returns its events.
    fn plays(&self, language: &str) -> Vec<u8> {
        let runs = ["first", "second"].map(|which| format!("new-{language}-{which}"));
        for run in &runs {
            self.start(run, &[]).finish();
            nobody_is_left(run);
        }

        let [first, second] = runs.each_ref().map(|run| self.lab.bytes(run));
        assert_same(("the first launch", &first), ("the second launch", &second));

        let log = self.cars_log(&runs[0]);

        for part in [
            "behavior STROLL",
            "emotion HAPPY -> FRUSTRATED",
            "emotion FRUSTRATED -> HAPPY",
        ] {
            assert!(log.contains(part), "{language}: no {part:?} in\n{log}");
        }

        let ticks = self.lab.recorded(&runs[0]);
        let mut places = ticks.iter().flat_map(|tick| &tick.frame.robots);
        assert!(
            places.any(|robot| robot.location.x == 12.192),
            "it reaches the end of its way"
        );

        self.obeys(language);
        self.conforms();
        first
    }

    /// The conformance kit, called as its README says, finds no fault.
    fn conforms(&self) {
        let readme = std::fs::read_to_string(self.folder.join("README.md")).unwrap();
        self.conforms_as(&readme, Path::new("."));
    }

    /// The same, called in a folder as a page says.
    fn conforms_as(&self, page: &str, folder: &Path) {
        let command = page
            .lines()
            .find(|line| line.starts_with("cars conform "))
            .unwrap();
        let others = std::env::var_os("PATH").unwrap_or_default();
        let path = [programs().to_owned()]
            .into_iter()
            .chain(std::env::split_paths(&others));

        let output = Command::new("sh")
            .args(["-c", command])
            .current_dir(folder)
            .env("PATH", std::env::join_paths(path).unwrap())
            .env("PYTHONPATH", python_path())
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success()
                && printed.contains("# Rosie: ")
                && printed.contains(" 0 failed"),
            "{command}: {printed}\n{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }

    /// Replaces methods of a robot in Python with those of a text.
    fn replace_methods(&self, text: &str) {
        let file = self.folder.join("robot.py");
        let mut robot = std::fs::read_to_string(&file).unwrap();
        for method in methods(text) {
            let head = method.lines().next();
            let mut old = methods(&robot);
            old.retain(|old| old.lines().next() == head);
            let [old] = &old[..] else {
                panic!("{} methods begin with {head:?}", old.len())
            };
            robot = robot.replace(old, &method);
        }
        std::fs::write(file, robot).unwrap();
    }

    fn obeys(&self, language: &str) {
        let run = format!("new-{language}-orders");
        let mut launch = self.start(&run, &["--paused"]);
        let cars = |args: &[&str]| {
            self.lab
                .cars(&[args, &["--run", &run]].concat())
                .output()
                .unwrap()
        };
        self.lab.until_ready(&run);
        for order in ["rest", r#"say "boo" \ backwards"#] {
            assert!(cars(&["ctl", "command", "Rosie", order]).status.success());
        }
        self.lab.step(&run, 9);
        assert!(
            cars(&["ctl", "command", "Rosie", "stroll"])
                .status
                .success()
        );
        self.lab.step(&run, 9);
        let log = self.cars_log(&run);
        for part in [
            "obeys operator: rest",
            "behavior STROLL -> REST",
            "does not know how to say \"boo\" \\ backwards",
            "obeys operator: stroll",
            "behavior REST -> STROLL",
        ] {
            assert!(log.contains(part), "{language}: no {part:?} in\n{log}");
        }
        // The next epoch is that of a fresh start.
        assert!(cars(&["ctl", "init"]).status.success());
        assert!(cars(&["ctl", "start"]).status.success());
        launch.finish();
        nobody_is_left(&run);
        let digest = |run: &str| self.lab.summary(run)["digest"].clone();
        assert_eq!(
            digest(&run),
            digest(&format!("new-{language}-first")),
            "{language}"
        );
    }
}

/// The methods of a text in Python, each with what is indented below it.
fn methods(text: &str) -> Vec<String> {
    let mut methods: Vec<String> = Vec::new();
    let mut is_within = false;
    for line in text.lines() {
        let begins = line.starts_with("    def ");
        is_within = begins || is_within && line.starts_with("        ");
        if begins {
            methods.push(String::new());
        }
        if let Some(method) = methods.last_mut().filter(|_| is_within) {
            method.push_str(line);
            method.push('\n');
        }
    }
    methods
}

/// Where Python finds the SDK: that of the project first.
fn python_path() -> OsString {
    let others = std::env::var_os("PYTHONPATH").unwrap_or_default();
    let own = package().to_owned();
    std::env::join_paths([own].into_iter().chain(std::env::split_paths(&others))).unwrap()
}

/// Whether a tool is there; where it is not, that is said aloud, and in CI it is a failure.
fn has(tool: &str, test: &mut Command, help: &str) -> bool {
    let found = test
        .stdin(Stdio::null())
        .output()
        .is_ok_and(|output| output.status.success());
    if !found {
        lacks_tool(&format!("the test of a new robot in {tool}"), help);
    }

    found
}

fn build(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(
        output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// The robot in Rust. What it depends on is what the project depends on, and compiling that takes minutes; so it is built
/// in the project's target folder, as a member of a twin of the project's workspace.
fn rust() -> Robot {
    // The same folder every time: cargo keeps what it builds by place, and a program is large.
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-rust");
    if out.exists() {
        std::fs::remove_dir_all(&out).unwrap();
    }
    let robot = Robot::new_in(&out, Lab::new(), "rust");
    has_the_packages_of_the_project(&robot.folder);
    join_a_twin_of_the_workspace(&out);

    let target = programs().parent().unwrap();
    let output = cargo()
        .current_dir(&out)
        .env("CARGO_TARGET_DIR", target)
        .args(["build", "--offline", "--release"])
        .args(["-p", "cars-rosie", "-p", "features"])
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}");
    for line in printed.lines() {
        let mut words = line.split_whitespace();
        match (words.next(), words.next()) {
            (Some("Compiling"), Some(name)) => assert!(
                ["features", "cars-rosie"].contains(&name),
                "compiled a second time, with other features:\n{printed}"
            ),
            (word, _) => assert!(
                matches!(word, Some("Finished" | "Locking" | "Adding" | "Blocking")),
                "a warning:\n{printed}"
            ),
        }
    }

    // Where its files name the program.
    std::os::unix::fs::symlink(target, robot.folder.join("target")).unwrap();
    robot
}

/// The platform of this machine, as the compiler names it.
fn platform() -> String {
    let output = Command::new("rustc").arg("-vV").output().unwrap();
    let version = String::from_utf8(output.stdout).unwrap();
    let mut lines = version.lines();
    let host = lines.find_map(|line| line.strip_prefix("host: "));
    host.expect("a platform").to_owned()
}

/// By itself, as it was made, a robot is built with the packages that the project has changed, and not with the published ones.
fn has_the_packages_of_the_project(robot: &Path) {
    // Packages of other platforms need not be there.
    let output = cargo()
        .current_dir(robot)
        .args(["metadata", "--offline", "--format-version", "1"])
        .args(["--filter-platform", &platform()])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );

    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for name in ["zenoh-link-tcp", "zenoh-link-tls"] {
        let found: Vec<&str> = metadata["packages"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|package| package["name"] == name)
            .map(|package| package["manifest_path"].as_str().unwrap())
            .collect();
        let own = root().join("vendor").join(name).join("Cargo.toml");
        assert_eq!(found, [own.to_str().unwrap()]);
    }
}

/// Makes a folder the twin of the project's workspace: the same crates at the same places, and the robot beside them. To
/// cargo they are the crates that are built already. A package that depends on all that the project depends on gives them
/// the features that they have there; the robot itself sees the dependencies that it names and no others.
fn join_a_twin_of_the_workspace(twin: &Path) {
    let project = root();
    for shared in ["crates", "sdk", "tests", "vendor"] {
        std::os::unix::fs::symlink(project.join(shared), twin.join(shared)).unwrap();
    }
    std::fs::copy(project.join("Cargo.lock"), twin.join("Cargo.lock")).unwrap();

    let mut workspace = read_table(&project.join("Cargo.toml"));
    let members = workspace["workspace"]["members"].as_array_mut().unwrap();
    members.extend(["Rosie".into(), "features".into()]);
    write_table(&twin.join("Cargo.toml"), &workspace);

    // What a member of a workspace leaves to the workspace.
    let mut robot = read_table(&twin.join("Rosie/Cargo.toml"));
    for key in ["workspace", "patch", "profile"] {
        assert!(robot.remove(key).is_some(), "{key}");
    }
    robot["dependencies"]["robot"]["path"] = "../crates/robot".into();
    write_table(&twin.join("Rosie/Cargo.toml"), &robot);

    let mut features: toml::Table = "package = { name = \"features\", edition = \"2024\" }"
        .parse()
        .unwrap();
    let mut dependencies = workspace["workspace"]["dependencies"]
        .as_table()
        .unwrap()
        .clone();
    dependencies.retain(|_, dependency| dependency.get("path").is_none());
    features.insert("dependencies".to_owned(), dependencies.into());
    std::fs::create_dir_all(twin.join("features/src")).unwrap();
    std::fs::write(twin.join("features/src/lib.rs"), "").unwrap();
    write_table(&twin.join("features/Cargo.toml"), &features);
}

fn read_table(path: &Path) -> toml::Table {
    let text = std::fs::read_to_string(path).unwrap();
    text.parse().unwrap()
}

fn write_table(path: &Path, table: &toml::Table) {
    std::fs::write(path, toml::to_string(table).unwrap()).unwrap();
}

/// As the README of the robot says.
fn c() -> Robot {
    let robot = Robot::new("c");
    let text = std::fs::read_to_string(robot.folder.join("README.md")).unwrap();
    let line = text.lines().find(|line| line.starts_with("cc ")).unwrap();
    build(Command::new("sh").args(["-c", &line.replace("cc ", "cc -Werror ")]));
    robot
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_new_robot_is_the_same_in_every_language_that_counts_alike() {
    let rust = rust().plays("rust");
    let version = |program: &str| {
        let mut command = Command::new(program);
        command.arg("--version");
        command
    };

    if has(
        "C",
        &mut version("cc"),
        "install a C compiler that is called `cc`",
    ) {
        assert_same(("Rust", &rust), ("C", &c().plays("c")));
    }

    if has(
        "Node.js",
        &mut version("node"),
        "install Node.js 18 or newer",
    ) {
        assert_same(
            ("Rust", &rust),
            ("Node.js", &Robot::new("node").plays("node")),
        );
    }

    let mut python = Command::new("python3");
    python
        .args(["-c", "import cars"])
        .env("PYTHONPATH", python_path());

    if has("Python", &mut python, "install Python 3.9 or later") {
        assert_same(
            ("Rust", &rust),
            ("Python", &Robot::new("python").plays("python")),
        );
    }
}

/// As the page has it made and changed.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_robot_of_the_page_of_python_conforms() {
    let mut python = Command::new("python3");
    python
        .args(["-c", "import cars"])
        .env("PYTHONPATH", python_path());
    if !has("Python", &mut python, "install Python 3.9 or later") {
        return;
    }

    let page = std::fs::read_to_string(root().join("docs/python-robot.md")).unwrap();
    let (_, rest) = page.split_once("```python\n").unwrap();
    let (change, _) = rest.split_once("```").unwrap();
    let robot = Robot::new("python");
    robot.replace_methods(change);

    let run = "new-python-of-the-page";
    robot.start(run, &[]).finish();
    nobody_is_left(run);
    let log = robot.cars_log(run);
    assert!(log.contains("-> RESIGNED"), "{log}");
    robot.conforms_as(&page, robot.lab.out());
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_new_robot_in_bash_plays() {
    let mut bash = Command::new("bash");
    if has("Bash", bash.arg("--version"), "install Bash 4 or newer") {
        Robot::new("bash").plays("bash");
    }
}

/// What a program reads and writes in a tick whose command has a payload like a line `tick`, and a command in it.
#[test]
fn what_a_payload_looks_like_makes_no_difference() {
    let lines = concat!(
        r#"{"type":"init","tick":0,"name":"Rosie","location":{"x":5.0,"y":5.0},"tick_s":0.5,"parameters":{}}"#,
        "\n",
        r#"{"type":"tick","tick":1,"location":{"x":5.5,"y":5.0},"commands":[{"from":"A","performative":"achieve","command":"#,
        r#""hi","payload":{"blocked":true,"command":"rest","from":"B","performative":"achieve"}}]}"#,
        "\n",
        r#"{"type":"tick","tick":2,"location":{"x":6.0,"y":5.0},"blocked":true}"#,
        "\n",
        r#"{"type":"end","reason":"finished"}"#,
        "\n",
    );
    let mut programs = Vec::new();
    let mut version = Command::new("cc");
    if has(
        "C",
        version.arg("--version"),
        "install a C compiler that is called `cc`",
    ) {
        programs.push((c(), "robot"));
    }
    let mut version = Command::new("bash");
    if has("Bash", version.arg("--version"), "install Bash 4 or newer") {
        programs.push((Robot::new("bash"), "robot.sh"));
    }

    for (robot, program) in programs {
        std::fs::write(robot.folder.join("lines"), lines).unwrap();
        let lines = std::fs::File::open(robot.folder.join("lines")).unwrap();
        let mut command = Command::new(robot.folder.join(program));
        let output = command.stdin(lines).output().unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        let done: Vec<serde_json::Value> = printed
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .filter(|line: &serde_json::Value| line["type"] == "done")
            .collect();
        let held_up_s = |tick: usize| done[tick]["state_variables"]["held_up_s"].as_f64();
        assert_eq!(done[1]["behavior_state"], "STROLL", "{program}: {printed}");
        assert_eq!(
            [1, 2].map(held_up_s),
            [Some(0.0), Some(0.5)],
            "{program}: {printed}"
        );
    }
}

#[test]
fn nothing_is_overwritten_and_what_is_wrong_is_said() {
    let robot = Robot::new("c");
    let source = robot.folder.join("robot.c");
    std::fs::write(&source, "mine").unwrap();
    let again = |args: &[&str]| robot.lab.fails(&[&["new", "robot"], args].concat());
    let (code, text) = again(&["Rosie", "--lang", "c"]);
    assert!(
        code == 1 && text.contains("is there already") && text.contains("nothing is overwritten"),
        "{text}"
    );
    assert_eq!(std::fs::read_to_string(&source).unwrap(), "mine");

    let (_, text) = again(&["../Rosie", "--lang", "c"]);
    assert!(text.contains("is not a usable name"), "{text}");

    let (_, text) = again(&["Rita", "--lang", "cobol"]);
    assert!(text.contains("rust, python, c, bash, node"), "{text}");

    let (_, text) = again(&["Rita", "--lang", "rust", "--cars", "/"]);
    assert!(
        text.contains("whose SDK this robot uses, is not at /") && text.contains("--cars DIR"),
        "{text}"
    );
    assert!(
        !robot.lab.out().join("Rita").exists(),
        "a robot that cannot be made leaves nothing"
    );
}

#[test]
fn whatever_its_name_is_its_files_are_read() {
    let lab = Lab::new();

    for (name, language) in [
        ("a.b-C_9", "rust"),
        ("9", "bash"),
        ("_", "c"),
        ("R2-D2", "node"),
        ("x.y", "python"),
    ] {
        lab.ok(&[
            "new",
            "robot",
            name,
            "--lang",
            language,
            "--cars",
            root().to_str().unwrap(),
        ]);
        let folder = lab.out().join(name);
        for file in walk(&folder) {
            let text = std::fs::read_to_string(&file).unwrap();
            assert!(
                !text.contains("@NAME@") && !text.contains("@CARS@"),
                "{}",
                file.display()
            );
            let left = text
                .split('@')
                .skip(1)
                .step_by(2)
                .find(|word| word.chars().all(|c| c.is_ascii_uppercase()));
            assert_eq!(left, None, "{}", file.display());
        }
        let (code, text) =
            lab.cars_without_out(&["check", folder.join("scenario.toml").to_str().unwrap()]);
        assert_eq!(code, 0, "{text}");
    }

    let manifest = std::fs::read_to_string(lab.out().join("a.b-C_9/Cargo.toml")).unwrap();
    assert!(manifest.contains("name = \"cars-a-b-c_9\""), "{manifest}");
}

fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    entries
        .flat_map(|path| {
            if path.is_dir() {
                walk(&path)
            } else {
                vec![path]
            }
        })
        .collect()
}
