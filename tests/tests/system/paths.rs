//! Where the programs are, and where they find one another; what was built on one machine and runs on another one does not show
//! folders of the first.

use std::fs::Permissions;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use system_tests::{Lab, PROGRAMS, cargo, eventually, profile_of, programs, root};

/// Copies a program, in a process of its own: while another test starts a process, that one would still have the file open to
/// write, and what is open to write cannot be run.
fn copy(program: &str, to: &Path) {
    let copied = Command::new("cp")
        .arg(programs().join(program))
        .arg(to)
        .status();
    assert!(copied.unwrap().success());
}

#[test]
fn a_skeleton_needs_the_folder_of_the_project_where_it_is_not_around() {
    let elsewhere = tempfile::tempdir().unwrap();
    let cars = elsewhere.path().join("cars");
    copy("cars", &cars);
    let output = Command::new(cars)
        .current_dir(elsewhere.path())
        .args(["new", "robot", "Rosie", "--lang", "rust"])
        .output()
        .unwrap();

    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("--cars DIR"), "{text}");
    assert!(!text.contains(root().to_str().unwrap()), "{text}");
}

#[test]
fn errors_of_the_middleware_name_no_sources() {
    let lab = Lab::new();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let output = Command::new(programs().join("cars-sim"))
        .current_dir(root())
        .args(["configs/three_robots.toml", "--listen", &endpoint, "--out"])
        .arg(lab.out())
        .output()
        .unwrap();

    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("cannot listen at"), "{text}");
    assert!(!text.contains(".rs:"), "{text}");
}

#[test]
fn a_process_has_the_name_of_its_program() {
    let lab = Lab::new();
    let args = ["launch", "launch/hors_doeuvres.toml", "--paused"];
    let launch = lab.start("named", &args);
    for program in ["cars-sim", "cars-console", "cars-butler", "cars-leguin"] {
        // As killall and pgrep find it.
        let comm = format!("/proc/{}/comm", launch.process(program));
        eventually(program, || {
            let name = std::fs::read_to_string(&comm).unwrap();
            (name.trim_end() == program).then_some(())
        });
    }
}

#[test]
fn each_program_runs_alone_in_any_folder() {
    let lab = Lab::new();
    let alone = |program: &str| lab.out().join(format!("of-{program}")).join(program);
    let elsewhere = |program: &str| {
        let mut command = Command::new(alone(program));
        command.current_dir(lab.out()).env("PATH", "/usr/bin:/bin");
        command
    };
    for program in PROGRAMS {
        std::fs::create_dir(lab.out().join(format!("of-{program}"))).unwrap();
        copy(program, &alone(program));
        for argument in ["--version", "--help"] {
            let output = elsewhere(program).arg(argument).output().unwrap();
            assert!(output.status.success(), "{program} {argument}: {output:?}");
        }
    }

    let mut launch = format!(
        "scenario = {:?}\n[simulator]\ncommand = [{:?}]\n[console]\nbind = \"127.0.0.1:0\"\n",
        root().join("configs/three_robots.toml"),
        alone("cars-sim"),
    );
    for robot in ["Butler", "Leguin", "Vonda"] {
        let program = alone(&format!("cars-{}", robot.to_lowercase()));
        launch += &format!("[[process]]\nname = {robot:?}\ncommand = [{program:?}]\n");
    }
    lab.write("alone.toml", &launch);
    let args = ["alone.toml", "--duration", "5 s", "--speed", "max"];
    // No launch file can name a console.
    let path = format!("{}:/usr/bin", lab.out().join("of-cars-console").display());
    let output = elsewhere("cars")
        .env("PATH", path)
        .arg("launch")
        .args(args)
        .args(["--out", ".", "--run", "alone"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert_eq!(lab.summary("alone")["ticks"], 10);
}

#[test]
fn programs_are_found_beside_cars_or_on_path_and_else_it_says_how_to_install_them() {
    let lab = Lab::new();
    let cars = lab.out().join("cars");
    copy("cars", &cars);
    let launch = |path: &Path| {
        let mut command = Command::new(&cars);
        command.current_dir(lab.out()).env("PATH", path).args([
            "launch",
            "hors_doeuvres",
            "--dry-run",
            "--no-console",
        ]);
        command.output().unwrap()
    };
    let planned = |path: &Path| String::from_utf8(launch(path).stdout).unwrap();

    let on_path = planned(programs());
    let simulator = programs().join("cars-sim");
    assert!(on_path.contains(simulator.to_str().unwrap()), "{on_path}");

    let missing = launch(Path::new("/nowhere"));
    let said = String::from_utf8(missing.stderr).unwrap();
    assert_eq!(missing.status.code(), Some(1), "{said}");
    for part in [
        "there is no program cars-sim",
        "(beside this program)",
        "cargo build --release",
        "cargo install --locked --path crates/simulator",
    ] {
        assert!(said.contains(part), "no {part:?} in\n{said}");
    }

    let beside = lab.out().join("cars-sim");
    copy("cars-sim", &beside);
    let beside_cars = planned(programs());
    assert!(
        beside_cars.contains(beside.to_str().unwrap()),
        "{beside_cars}"
    );
}

/// A cargo that writes its arguments and how many variables of a package it got, takes some time, and fails.
const FAILING_CARGO: &str = r#"#!/bin/sh
echo "$@" > "$SAID"
env | grep -cE '^CARGO_(PKG|MANIFEST)_' >> "$SAID"
sleep 1.5
exit 101
"#;

#[test]
fn cargo_run_builds_the_other_programs_first() {
    let lab = Lab::new();
    let cargo = lab.write("cargo", FAILING_CARGO);
    std::fs::set_permissions(&cargo, Permissions::from_mode(0o755)).unwrap();
    let package = root().join("crates/cars");
    let said = lab.out().join("said");
    let output = lab
        .cars(&["launch", "launch/hors_doeuvres.toml"])
        .env("CARGO", &cargo)
        .env("CARGO_MANIFEST_DIR", &package)
        .env("CARGO_PKG_NAME", "cars")
        .env("SAID", &said)
        .output()
        .unwrap();

    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    for part in ["building the programs beside", "do not build"] {
        assert!(stderr.contains(part), "no {part:?} in\n{stderr}");
    }
    assert_eq!(
        std::fs::read_to_string(said).unwrap(),
        format!(
            "build --quiet --profile {} --target-dir {} --manifest-path {}/../../Cargo.toml\n0\n",
            profile_of(programs()),
            programs().parent().unwrap().display(),
            package.display(),
        )
    );
    assert!(!lab.file("hors_doeuvres", "events.jsonl").exists());
}

#[test]
fn cargo_run_compiles_nothing_that_the_tests_have_compiled() {
    let built = cargo()
        .current_dir(root())
        .args(["build", "--profile", profile_of(programs())])
        .args(["--message-format", "json", "--quiet"])
        .output()
        .unwrap();
    assert!(built.status.success());

    let mut stale = Vec::new();
    for line in String::from_utf8(built.stdout).unwrap().lines() {
        let message: Value = serde_json::from_str(line).unwrap();
        if message["fresh"] == false {
            stale.push(message["package_id"].clone());
        }
    }
    assert!(stale.is_empty(), "{stale:?}");

    let played = cargo()
        .current_dir(root())
        .args(["run", "--quiet", "--profile", profile_of(programs())])
        .args(["--", "launch", "hors_doeuvres", "--dry-run"])
        .output()
        .unwrap();
    let simulator = programs().join("cars-sim");
    let planned = String::from_utf8(played.stdout).unwrap();
    assert!(planned.contains(simulator.to_str().unwrap()), "{planned}");
}

/// A simulator that finds the port of its launch taken, the first time it is started, and is the real one otherwise.
const TAKEN_ONCE: &str = r#"
if mkdir "$ONCE"; then
    for argument in "$@"; do
        case $argument in --listen=*) argument=--listen=$TAKEN;; esac
        shift
        set -- "$@" "$argument"
    done
fi
exec "$SIMULATOR" "$@"
"#;

#[test]
fn a_launch_whose_port_was_taken_tries_another() {
    let lab = Lab::new();
    let mut launch = format!(
        "scenario = {:?}\n[console]\nenabled = false\n\
         [simulator]\ncommand = [\"sh\", \"-c\", '''{TAKEN_ONCE}''', \"cars-sim\"]\n",
        root().join("configs/three_robots.toml")
    );
    for (name, program) in [
        ("Butler", "cars-butler"),
        ("Leguin", "cars-leguin"),
        ("Vonda", "cars-vonda"),
    ] {
        launch += &format!("[[process]]\nname = {name:?}\ncommand = [{program:?}]\n");
    }
    let file = lab.write("taken.toml", &launch);

    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let args = ["--run", "taken", "--duration", "5 s"];
    let output = lab
        .cars(&[&["launch", file.to_str().unwrap()], &args[..]].concat())
        .env("ONCE", lab.out().join("once"))
        .env("TAKEN", format!("tcp/{}", taken.local_addr().unwrap()))
        .env("SIMULATOR", programs().join("cars-sim"))
        .output()
        .unwrap();

    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert_eq!(
        said.matches("is taken: trying another port").count(),
        1,
        "{said}"
    );
    assert!(!lab.recorded("taken").is_empty());
}
