//! A launch of Butler and of Leguin, whom a shell script plays over its standard input and output.

use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};

use system_tests::processes::Running;
use system_tests::{Lab, PATIENCE, eventually, root};

/// What a script can use: `json` is the line that it was told, `is TYPE` asks for its type, `say` says a line and `ask`
/// says one and puts the answer into `json`.
const WORDS: &str = r#"#!/bin/sh
is() { case $json in *'"type":"'"$1"'"'*) return 0 ;; *) return 1 ;; esac; }
hear() { read -r json; }
say() { printf '%s\n' "$1"; }
ask() { say "$1"; hear; }
"#;

/// A lab whose `launch.toml` runs a script as Leguin.
pub(crate) struct Stage {
    pub(crate) lab: Lab,
    file: String,
}

impl Stage {
    /// Leguin is this script; `more` is added to her process in the launch file.
    pub(crate) fn new(script: &str, more: &str) -> Self {
        let lab = Lab::new();
        let program = lab.write(
            "leguin.sh",
            &format!("{WORDS}cd {}\n{script}\n", lab.out().display()),
        );
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let scenario = root().join("configs/hors_doeuvres.toml");
        let text = format!(
            "scenario = {:?}\n[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n[[process]]\n\
             name = \"Leguin\"\ncommand = [\"cars\", \"exec\", \"--\", \"./leguin.sh\", \"an argument\"]\n{more}\n",
            scenario.display().to_string()
        );
        let file = lab.write("launch.toml", &text).to_str().unwrap().to_owned();

        Self { lab, file }
    }

    /// A script that has these lines in every tick, and init, before its `done`.
    pub(crate) fn each_tick(lines: &str, more: &str) -> Self {
        let script = format!(
            "while hear; do\nif is end; then echo \"end $json\" >&2; exit 0; fi\n{lines}\nsay '{{\"type\":\"done\"}}'\ndone"
        );
        Self::new(&script, more)
    }

    /// Launches it and leaves it running, for 30 s of simulated time and as fast as it goes unless `more` has other values.
    pub(crate) fn start(&self, run: &str, more: &[&str]) -> Running {
        let mut args = vec!["launch", &self.file, "--no-console"];
        args.extend(more);
        if !more.contains(&"--duration") {
            args.extend(["--duration", "30 s"]);
        }
        if !more.contains(&"--speed") {
            args.extend(["--speed", "max"]);
        }
        self.lab.start(run, &args)
    }

    /// What Leguin's process printed in a run.
    pub(crate) fn log(&self, run: &str) -> String {
        std::fs::read_to_string(self.lab.file(run, "logs/Leguin.log")).unwrap_or_default()
    }

    /// A file that the script writes, once it has a whole line.
    pub(crate) fn written(&self, name: &str) -> String {
        eventually(name, || {
            let text = std::fs::read_to_string(self.lab.out().join(name)).ok()?;
            text.ends_with('\n').then(|| text.trim_end().to_owned())
        })
    }
}

/// Waits until a program has printed all of this; it may be over, and its last lines still on their way.
#[track_caller]
pub(crate) fn says(launch: &Running, parts: &[&str]) {
    let begun = Instant::now();
    while let Some(missing) = parts.iter().find(|part| !launch.printed().contains(**part)) {
        assert!(
            begun.elapsed() < PATIENCE,
            "no {missing:?} in\n{}",
            launch.printed()
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Waits until there is no process of this number any more.
pub(crate) fn is_gone(pid: &str) {
    let stat = format!("/proc/{}/stat", pid.trim());
    eventually("the program to be gone", || {
        std::fs::read_to_string(&stat)
            .map_or(true, |stat| stat.contains(") Z "))
            .then_some(())
    });
}
