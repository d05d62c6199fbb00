//! `cars new`: a skeleton of a robot that can be launched at once, and changed from there.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand, ValueEnum};
use miette::{IntoDiagnostic, WrapErr, miette};
use protocol::RobotName;

/// `cars new`.
#[derive(Debug, Args)]
pub(crate) struct NewArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// A robot of your own, with a scenario and a launch file: a folder of its name.
    Robot(RobotArgs),
}

#[derive(Debug, Args)]
struct RobotArgs {
    /// Its name, as in the roster of the scenario.
    name: RobotName,
    /// The language that it is written in.
    #[arg(long, value_name = "LANGUAGE")]
    lang: Language,
    /// Where its folder is made.
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// The folder of the CARS project, whose SDK a robot in Rust or Python uses; without it the one that this program was
    /// built from.
    #[arg(long, value_name = "DIR")]
    cars: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    /// With the Rust SDK.
    Rust,
    /// With the Python SDK.
    Python,
    /// Over standard input and output (`cars exec`).
    C,
    /// Over standard input and output (`cars exec`).
    Bash,
    /// JavaScript for Node.js, over standard input and output (`cars exec`).
    Node,
}

/// What differs between languages.
struct Skeleton {
    /// As people call the language.
    language: &'static str,
    /// The file that is the robot, and its text.
    program: (&'static str, &'static str),
    /// Further files.
    more: &'static [(&'static str, &'static str)],
    /// `command` of the launch file.
    command: &'static str,
    /// The same, to be typed where `cars new` was.
    typed: &'static str,
    /// What comes before the launch.
    build: &'static str,
    /// Where to go on.
    hint: &'static str,
}

const LAUNCH: &str = include_str!("new/launch.toml");
const SCENARIO: &str = include_str!("new/scenario.toml");
const README: &str = include_str!("new/README.md");
const OVER_PIPES: &str = "\
What can be said in a tick besides the line `done` (queries to other robots, commands to them, what is near, chance) is in
`docs/protocol.md` of the CARS project, \"Robots over stdin and stdout\".";

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
                       `cargo doc --open -p robot` says what a robot can do in a tick.",
            },
            Self::Python => Skeleton {
                language: "Python",
                program: ("robot.py", include_str!("new/python/robot.py")),
                more: &[],
                command: r#"["./robot.py"]"#,
                typed: "@FOLDER@/robot.py",
                build: "pip install @CARS@/sdk/python",
                hint: "`sdk/python/README.md` of the CARS project says what a robot can do in a tick.",
            },
            Self::C => Skeleton {
                language: "C",
                program: ("robot.c", include_str!("new/c/robot.c")),
                more: &[],
                command: r#"["cars", "exec", "--", "./robot"]"#,
                typed: "cars exec --name @NAME@ -- @FOLDER@/robot",
                // A product and a sum that are rounded once would be another number on some machines.
                build: "cc -std=c11 -O2 -ffp-contract=off -Wall -Wextra -o @FOLDER@/robot @FOLDER@/robot.c -lm",
                hint: OVER_PIPES,
            },
            Self::Bash => Skeleton {
                language: "Bash",
                program: ("robot.sh", include_str!("new/bash/robot.sh")),
                more: &[],
                command: r#"["cars", "exec", "--", "./robot.sh"]"#,
                typed: "cars exec --name @NAME@ -- @FOLDER@/robot.sh",
                build: "",
                hint: OVER_PIPES,
            },
            Self::Node => Skeleton {
                language: "JavaScript (Node.js)",
                program: ("robot.mjs", include_str!("new/node/robot.mjs")),
                more: &[],
                command: r#"["cars", "exec", "--", "./robot.mjs"]"#,
                typed: "cars exec --name @NAME@ -- @FOLDER@/robot.mjs",
                build: "",
                hint: OVER_PIPES,
            },
        }
    }

    fn needs_sdk(self) -> bool {
        matches!(self, Self::Rust | Self::Python)
    }
}

/// Makes a skeleton.
pub(crate) fn new(args: &NewArgs) -> miette::Result<ExitCode> {
    let What::Robot(args) = &args.what;
    let folder = args.out.join(args.name.as_str());
    let cars = if args.lang.needs_sdk() {
        project(args.cars.as_deref())?
    } else {
        PathBuf::new()
    };
    let skeleton = args.lang.skeleton();
    std::fs::create_dir_all(&args.out)
        .into_diagnostic()
        .wrap_err_with(|| format!("making {}", args.out.display()))?;
    std::fs::create_dir(&folder).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => {
            let help = "nothing is overwritten: choose another name or another --out, or remove it";
            miette!(help = help, "{} is there already", folder.display())
        }
        _ => miette!("{} cannot be made: {error}", folder.display()),
    })?;

    let place = args
        .out
        .canonicalize()
        .into_diagnostic()?
        .join(args.name.as_str());
    let package = format!(
        "cars-{}",
        args.name.as_str().to_lowercase().replace('.', "-")
    );
    let launch = format!("cars launch {}/launch.toml", shown(&folder));
    let steps: Vec<&str> = [skeleton.build, launch.as_str()]
        .into_iter()
        .filter(|step| !step.is_empty())
        .collect();
    let steps = steps.join("\n");
    let fill = |text: &str| {
        let command_and_steps = text.replace("@COMMAND@", skeleton.command);
        let command_and_steps = command_and_steps.replace("@PROGRAM@", skeleton.typed);
        let text = command_and_steps.replace("@STEPS@", &format!("```sh\n{steps}\n```"));
        text.replace("@LANGUAGE@", skeleton.language)
            .replace("@FILE@", skeleton.program.0)
            .replace("@HINT@", skeleton.hint)
            .replace("@FOLDER@", &shown(&folder))
            .replace("@PACKAGE@", &package)
            .replace(
                "@ROBOT_CRATE@",
                &format!("{:?}", cars.join("crates/robot").display().to_string()),
            )
            .replace("@CARS@", &cars.display().to_string())
            .replace("@NAME@", args.name.as_str())
    };
    let common = [
        ("launch.toml", LAUNCH),
        ("scenario.toml", SCENARIO),
        ("README.md", README),
    ];
    for (name, text) in [skeleton.program]
        .iter()
        .chain(skeleton.more)
        .chain(&common)
    {
        write(&place.join(name), &fill(text))?;
    }
    if args.lang == Language::Rust {
        // The versions of everything that the simulator was built with.
        let lock = std::fs::read_to_string(cars.join("Cargo.lock"))
            .into_diagnostic()
            .wrap_err("the project's Cargo.lock")?;
        write(&place.join("Cargo.lock"), &lock)?;
    }
    println!(
        "{} is a robot in {}. Next:\n",
        folder.display(),
        skeleton.language
    );
    println!(
        "{}\n\nand read {}",
        fill(&steps),
        folder.join("README.md").display()
    );
    Ok(ExitCode::SUCCESS)
}

/// A folder as a shell reads it.
fn shown(folder: &Path) -> String {
    let text = folder
        .strip_prefix(".")
        .unwrap_or(folder)
        .display()
        .to_string();
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
fn project(given: Option<&Path>) -> miette::Result<PathBuf> {
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = given.unwrap_or(&built_from);
    let found = folder
        .canonicalize()
        .ok()
        .filter(|folder| folder.join("crates/robot/Cargo.toml").is_file());
    found.ok_or_else(|| {
        let help = "give the folder that you have cloned: --cars DIR";
        miette!(
            help = help,
            "the CARS project, whose SDK this robot uses, is not at {}",
            folder.display()
        )
    })
}

/// Writes a file; what begins as a script can be run.
fn write(file: &Path, text: &str) -> miette::Result<()> {
    let writing = || -> std::io::Result<()> {
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(file, text)?;
        if text.starts_with("#!") {
            std::fs::set_permissions(file, Permissions::from_mode(0o755))?;
        }
        Ok(())
    };
    writing()
        .into_diagnostic()
        .wrap_err_with(|| format!("writing {}", file.display()))
}
