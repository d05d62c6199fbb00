//! Programs that were built on one machine and run on another one do not show folders of the first.

use std::net::TcpListener;
use std::path::Path;
use std::process::Command;

use system_tests::{Lab, eventually, programs, root};

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
fn the_programs_beside_cars_are_that_program_under_their_names() {
    let lab = Lab::new();
    let run = "doors";
    let args = ["launch", "launch/hors_doeuvres.toml", "--paused"];
    let launch = lab.start(run, &args);
    for program in ["cars-sim", "cars-console", "cars-butler", "cars-leguin"] {
        let comm = format!("/proc/{}/comm", launch.process(program));
        // As killall and pgrep find it, from the moment when it has gone on as `cars`.
        eventually(program, || {
            let name = std::fs::read_to_string(&comm).unwrap();
            (name.trim_end() == program).then_some(())
        });
    }

    let size = |program: &str| std::fs::metadata(programs().join(program)).unwrap().len();
    for program in [
        "cars-sim",
        "cars-console",
        "cars-butler",
        "cars-leguin",
        "cars-vonda",
    ] {
        assert!(size(program) * 10 < size("cars"), "{program}");
    }
}

#[test]
fn a_program_that_has_no_cars_beside_it_says_so() {
    let lab = Lab::new();
    let alone = lab.out().join("cars-sim");
    copy("cars-sim", &alone);

    let output = Command::new(&alone).arg("--version").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    let missing = lab.out().join("cars");
    assert!(
        said.contains(&format!("cars-sim needs the program {}", missing.display())),
        "{said}"
    );
    assert!(
        said.contains("install all programs of CARS in one folder"),
        "{said}"
    );
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
