//! Experiments played by clusters: their results are those of this machine, byte for byte.

mod kubernetes;
mod parallel;
mod slurm;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use system_tests::tools::lacks_tool;
use system_tests::{Lab, programs, root};

/// Longest time of an experiment, also under much other load.
const PATIENCE: Duration = Duration::from_secs(900);
/// Number of units of the experiment.
const UNITS: usize = 32;
/// Files of the results, which have to be the same.
const RESULTS: [&str; 2] = ["runs.csv", "results.json"];

/// Two arms under two conditions with eight seeds, with numbers and a time that some runs do not reach. Its folders have
/// names that a shell has to read in quotes.
struct Trial {
    lab: Lab,
    file: PathBuf,
}

impl Trial {
    fn new() -> Self {
        let lab = Lab::new();
        let scenario = root().join("configs/hors_doeuvres.toml");
        let text = format!(
            r#"question = "Do all machines play the same?"
procedure = "Commands are lost."
scenario = {scenario:?}
seeds = 8
duration = "60 s"
baseline = "emotions"

[[factor]]
name = "loss"
values = [0.0, 0.5]
set = ["network.commands={{ loss = {{value}} }}"]

[[arm]]
name = "emotions"
what = "as shipped"
set = []

[[arm]]
name = "rules"
what = "rules decide"
set = ["robot.Butler.params.policy=rules", "robot.Leguin.params.policy=rules"]

[[measure]]
name = "served"
column = "served"
contrast = true
variable = {{ robot = "Butler", name = "served", as = "end" }}

[[measure]]
name = "refill"
column = "refill"
contrast = true
[measure.time]
after = {{ event = "command_sent", from = "Butler", to = "Leguin", command = "refill" }}
to = {{ event = "behavior", robot = "Butler", to = "EXCHANGE" }}
"#
        );
        let file = lab.write("trial.toml", &text);
        Self { lab, file }
    }

    /// A folder of this trial.
    fn folder(&self, name: &str) -> PathBuf {
        self.lab.out().join(name)
    }

    /// Runs `cars experiment`, which must succeed.
    fn cars(&self, args: &[&str], path: &Path) -> String {
        let output = self.command(args, path).output().unwrap();
        checked(&output, &args.join(" "))
    }

    /// `cars experiment` with these arguments, the first of which comes before a path.
    fn command(&self, args: &[&str], path: &Path) -> Command {
        let mut cars = Command::new(programs().join("cars"));
        cars.current_dir(self.lab.out())
            .args(["experiment", args[0]])
            .arg(path)
            .args(&args[1..])
            .stdin(Stdio::null());
        cars
    }

    /// Plans the experiment in a folder and plays nothing.
    fn plan(&self, name: &str) -> PathBuf {
        let folder = self.folder(name);
        let out = folder.to_str().unwrap();
        self.cars(&["run", "--plan-only", "--out", out], &self.file);
        folder
    }

    /// Asserts that the results in a folder are those of the experiment played here.
    fn assert_results(&self, folder: &Path) {
        let here = self.folder("here");
        self.cars(&["run", "--out", here.to_str().unwrap()], &self.file);
        let rows = std::fs::read_to_string(here.join("runs.csv")).unwrap();
        assert_eq!(rows.lines().count(), UNITS + 1, "{rows}");

        for name in RESULTS {
            let expected = std::fs::read(here.join(name)).unwrap();
            let found = std::fs::read(folder.join(name)).unwrap();
            assert!(found == expected, "{name} differs");
        }
    }
}

/// The standard output of a program that must have succeeded.
fn checked(output: &Output, what: &str) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{what}: {}\n{text}\n{errors}",
        output.status
    );
    text
}

/// Whether all of these programs can be started; otherwise the test is skipped, which is a failure in CI.
fn has_programs(test: &str, names: &[&str], packages: &str) -> bool {
    for name in names {
        let found = Command::new("sh")
            .args(["-c", &format!("command -v {name}")])
            .output()
            .unwrap();
        if !found.status.success() {
            lacks_tool(
                test,
                &format!("there is no `{name}` here (Debian: apt install {packages})"),
            );
            return false;
        }
    }
    true
}
