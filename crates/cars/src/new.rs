//! `cars new`: makes the skeleton of a robot, which can be launched without changes.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand, ValueEnum};
use config::{FileError, Source};
use launch::LaunchFile;
use protocol::{RobotName, RunName};
use scenario::Scenario;

use crate::errors::{Context, Result, refusal};

/// `cars new`.
#[derive(Debug, Args)]
pub(crate) struct NewArgs {
    #[command(subcommand)]
    what: NewCommand,
}

#[derive(Debug, Subcommand)]
enum NewCommand {
    /// A folder with a robot program, a scenario and a launch file.
    Robot(NewRobotArgs),
}

#[derive(Debug, Args)]
struct NewRobotArgs {
    /// Name of the robot and of its folder.
    name: RobotName,
    /// Programming language.
    #[arg(long, value_name = "LANGUAGE")]
    lang: Language,
    /// Where the folder is made.
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// The folder of the CARS project, for a robot in Rust, which uses its SDK; without it the one around this program or
    /// around the current folder.
    #[arg(long, value_name = "DIR")]
    cars: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    /// With the Rust SDK.
    Rust,
    /// With the module `cars`, which the wheel of CARS brings.
    Python,
    /// Over standard input and output (`cars exec`).
    C,
    /// Over standard input and output (`cars exec`).
    Bash,
    /// JavaScript for Node.js, over standard input and output (`cars exec`).
    Node,
}

/// What differs between languages. The texts contain placeholders, see [`Template`].
struct Skeleton {
    /// Name of the language.
    language: &'static str,
    /// Name and text of the robot's source file.
    program: (&'static str, &'static str),
    /// Names and texts of further files.
    more: &'static [(&'static str, &'static str)],
    /// `command` of the launch file.
    command: &'static str,
    /// The robot's own command, as typed where `cars new` was.
    typed: &'static str,
    /// Command that builds the robot; empty if there is nothing to build.
    build: &'static str,
    /// Where to go on.
    hint: &'static str,
}

/// The launch file of every skeleton.
const LAUNCH: (&str, &str) = ("launch.toml", include_str!("new/launch.toml"));
/// The scenario of every skeleton.
const SCENARIO: (&str, &str) = ("scenario.toml", include_str!("new/scenario.toml"));
/// Files of every skeleton: name and text.
const COMMON: [(&str, &str); 3] = [
    LAUNCH,
    SCENARIO,
    ("README.md", include_str!("new/README.md")),
];
/// Where to go on with a robot over standard input and output.
const OVER_PIPES: &str = "\
`docs/protocol.md` of the CARS project, \"Robots over stdin and stdout\", lists what a robot can send in a tick besides the
line `done`: queries and commands to other robots, requests for the bodies near it, and random numbers.";

impl Skeleton {
    /// A robot over standard input and output that needs no build.
    fn over_pipes(language: &'static str, file: &'static str, text: &'static str) -> Self {
        Self {
            language,
            program: (file, text),
            more: &[],
            command: "",
            typed: "",
            build: "",
            hint: OVER_PIPES,
        }
    }
}

impl Language {
    fn skeleton(self) -> Skeleton {
        match self {
            Self::Rust => Skeleton {
                language: "Rust",
                program: ("src/main.rs", include_str!("new/rust/src/main.rs")),
                more: &[
                    ("Cargo.toml", include_str!("new/rust/Cargo.toml")),
                    (".gitignore", "/target\n/runs\n"),
                ],
                command: r#"["./target/release/@PACKAGE@"]"#,
                typed: "@FOLDER@/target/release/@PACKAGE@",
                build: "cargo build --release --manifest-path @FOLDER@/Cargo.toml",
                hint: "`docs/new-robot.md` of the CARS project makes a robot with an emotion of its own;\n\
                       `cargo doc --open -p robot` documents what a robot can do in a tick.",
            },
            Self::Python => Skeleton {
                language: "Python",
                program: ("robot.py", include_str!("new/python/robot.py")),
                more: &[],
                command: r#"["./robot.py"]"#,
                typed: "@FOLDER@/robot.py",
                build: "",
                hint: "The robot imports the module `cars`. The wheel of CARS brings it, together with the command `cars`; `docs/notebooks.md`\n\
                       of the project says how to make one. `sdk/python/README.md` of the project documents what a robot can do in a tick, and so does `help(cars.Robot)` in Python.",
            },
            Self::C => Skeleton {
                // A fused multiply-add rounds once instead of twice, so results would differ between machines.
                typed: "cars exec --name @NAME@ -- @FOLDER@/robot",
                build: "cc -std=c11 -O2 -ffp-contract=off -Wall -Wextra -o @FOLDER@/robot @FOLDER@/robot.c -lm",
                command: r#"["cars", "exec", "--", "./robot"]"#,
                ..Skeleton::over_pipes("C", "robot.c", include_str!("new/c/robot.c"))
            },
            Self::Bash => Skeleton {
                command: r#"["cars", "exec", "--", "./robot.sh"]"#,
                typed: "cars exec --name @NAME@ -- @FOLDER@/robot.sh",
                ..Skeleton::over_pipes("Bash", "robot.sh", include_str!("new/bash/robot.sh"))
            },
            Self::Node => Skeleton {
                command: r#"["cars", "exec", "--", "./robot.mjs"]"#,
                typed: "cars exec --name @NAME@ -- @FOLDER@/robot.mjs",
                ..Skeleton::over_pipes(
                    "JavaScript (Node.js)",
                    "robot.mjs",
                    include_str!("new/node/robot.mjs"),
                )
            },
        }
    }

    fn needs_sdk(self) -> bool {
        matches!(self, Self::Rust)
    }
}

/// Makes a skeleton and prints the next steps.
pub(crate) fn new(args: &NewArgs) -> Result<ExitCode> {
    let NewCommand::Robot(args) = &args.what;
    let folder = args.out.join(args.name.as_str());
    let skeleton = args.lang.skeleton();
    check_launch(&skeleton, &args.name)?;
    let cars = if args.lang.needs_sdk() {
        project(args.cars.as_deref())?
    } else {
        PathBuf::new()
    };
    make_folder(&args.out, &folder)?;

    let template = Template {
        skeleton: &skeleton,
        name: args.name.as_str(),
        folder: shown(&folder),
        cars: &cars,
    };
    let place = folder.canonicalize()?;
    for (name, text) in [skeleton.program]
        .iter()
        .chain(skeleton.more)
        .chain(&COMMON)
    {
        write(&place.join(name), &template.fill(text))?;
    }
    if args.lang == Language::Rust {
        copy_lock(&cars, &place)?;
    }

    let language = skeleton.language;
    let readme = folder.join("README.md");
    terminal::print_line(format_args!(
        "{} is a robot in {language}. Next:\n\n{}\n\nand read {}",
        folder.display(),
        template.steps(),
        readme.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Checks that the robot can be launched: some names are reserved.
fn check_launch(skeleton: &Skeleton, name: &RobotName) -> Result<()> {
    RunName::new(name.as_str())?;

    let template = Template {
        skeleton,
        name: name.as_str(),
        folder: String::new(),
        cars: Path::new(""),
    };
    let [launch, scenario] = [LAUNCH, SCENARIO].map(|(file, text)| Source {
        name: file.to_owned(),
        text: template.fill(text),
    });
    let wrong = |error: FileError| {
        refusal!(
            help = "choose another name",
            "no robot can be called {name}: {}",
            error.in_words()
        )
    };
    let scenario = Scenario::parse(&scenario, Path::new("")).map_err(wrong)?;
    let mut launch = LaunchFile::parse(launch, Path::new("")).map_err(wrong)?;
    launch.assign_robots(&scenario).map_err(wrong)?;
    Ok(())
}

/// Makes the folder of the robot, which must not exist.
fn make_folder(out: &Path, folder: &Path) -> Result<()> {
    std::fs::create_dir_all(out).context(format!("making {}", out.display()))?;

    std::fs::create_dir(folder).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => {
            let help = "nothing is overwritten: choose another name or another --out, or remove it";
            refusal!(help = help, "{} is there already", folder.display())
        }
        _ => refusal!("{} cannot be made: {error}", folder.display()),
    })
}

/// Copies the lock file of the project: the robot is built with the same versions as the simulator.
fn copy_lock(cars: &Path, place: &Path) -> Result<()> {
    let lock =
        std::fs::read_to_string(cars.join("Cargo.lock")).context("the project's Cargo.lock")?;
    write(&place.join("Cargo.lock"), &lock)
}

/// The values of the placeholders in the files of a skeleton.
struct Template<'a> {
    skeleton: &'a Skeleton,
    /// Name of the robot.
    name: &'a str,
    /// Its folder, quoted for a shell.
    folder: String,
    /// The folder of the CARS project; empty for languages without an SDK.
    cars: &'a Path,
}

impl Template<'_> {
    /// The commands that build and launch the robot, a line each.
    fn steps(&self) -> String {
        let launch = format!("cars launch {}/launch.toml", self.folder);
        if self.skeleton.build.is_empty() {
            return launch;
        }

        self.fill(&format!("{}\n{launch}", self.skeleton.build))
    }

    fn fill(&self, text: &str) -> String {
        let package = self.name.to_lowercase().replace('.', "-");
        let quoted = |place: &str| format!("{:?}", self.cars.join(place).display().to_string());
        let mut text = text
            .replace("@COMMAND@", self.skeleton.command)
            .replace("@PROGRAM@", self.skeleton.typed);
        if text.contains("@STEPS@") {
            text = text.replace("@STEPS@", &format!("```sh\n{}\n```", self.steps()));
        }

        text.replace("@LANGUAGE@", self.skeleton.language)
            .replace("@FILE@", self.skeleton.program.0)
            .replace("@HINT@", self.skeleton.hint)
            .replace("@FOLDER@", &self.folder)
            .replace("@PACKAGE@", &format!("cars-{package}"))
            .replace("@ROBOT_CRATE@", &quoted("crates/robot"))
            .replace("@TCP_CRATE@", &quoted("vendor/zenoh-link-tcp"))
            .replace("@TLS_CRATE@", &quoted("vendor/zenoh-link-tls"))
            .replace("@CARS@", &self.cars.display().to_string())
            .replace("@NAME@", self.name)
    }
}

/// A path quoted for a shell.
fn shown(folder: &Path) -> String {
    let path = folder.strip_prefix(".").unwrap_or(folder);
    let text = path.display().to_string();

    let is_plain = text
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || "-_./".contains(c));
    if is_plain {
        text
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// The folder of the CARS project.
fn project(given: Option<&Path>) -> Result<PathBuf> {
    let help = "give the folder that you have cloned: --cars DIR";
    let Some(given) = given else {
        return find_project().ok_or_else(|| {
            refusal!(
                help = help,
                "the CARS project, whose SDK this robot uses, is neither around this program nor \
                 around the current folder"
            )
        });
    };

    let found = given.canonicalize().ok().filter(|path| is_project(path));
    found.ok_or_else(|| {
        refusal!(
            help = help,
            "the CARS project, whose SDK this robot uses, is not at {}",
            given.display()
        )
    })
}

/// The first folder around this program (`target/release` is in the project), then around the current one, that is the
/// project.
fn find_project() -> Option<PathBuf> {
    let places = [std::env::current_exe(), std::env::current_dir()];
    for place in places.into_iter().flatten() {
        let place = place.canonicalize().unwrap_or(place);
        if let Some(project) = place.ancestors().find(|folder| is_project(folder)) {
            return Some(project.to_owned());
        }
    }
    None
}

fn is_project(folder: &Path) -> bool {
    folder.join("crates/robot/Cargo.toml").is_file()
}

/// Writes a file; a script is made executable.
fn write(file: &Path, text: &str) -> Result<()> {
    try_write(file, text).context(format!("writing {}", file.display()))
}

fn try_write(file: &Path, text: &str) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(file, text)?;
    if text.starts_with("#!") {
        std::fs::set_permissions(file, Permissions::from_mode(0o755))?;
    }
    Ok(())
}
