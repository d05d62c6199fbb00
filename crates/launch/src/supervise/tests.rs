//! Supervision of real little processes: shells that play simulator and robots.

use std::collections::BTreeMap;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};

use nix::sys::signal::kill;
use nix::unistd::Pid;

use super::super::plan::CommandLine;
use super::super::restart::Restart;
use super::super::screen::{Screen, ScreenOptions};
use super::*;

/// Longer than any test may take.
const FOREVER: &str = "sleep 600";

/// What a test sees of a launch: its folder, and the launch itself once it is over.
struct TestLaunch {
    folder: tempfile::TempDir,
    planned: Vec<Planned>,
    grace: Duration,
    /// Whether the supervisor is told that the run is observed.
    is_observed: bool,
}

impl TestLaunch {
    /// `$DIR` is the test's folder for the shells.
    fn new(simulator: &str) -> Self {
        let hall = Self {
            folder: tempfile::tempdir().unwrap(),
            planned: Vec::new(),
            grace: Duration::from_secs(20),
            is_observed: true,
        };
        hall.with(Planned {
            part: Part::Simulator,
            ..shell("simulator", simulator)
        })
    }

    fn with(mut self, mut planned: Planned) -> Self {
        let folder = self.folder.path().display().to_string();
        planned.command.env.insert("DIR".to_owned(), folder);
        self.planned.push(planned);
        self
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_default()
    }

    /// Waits until the shells have said that they are ready: each file of `names` is there.
    async fn ready(folder: &Path, names: &[&str]) {
        let deadline = Instant::now() + Duration::from_secs(20);
        while names.iter().any(|name| !folder.join(name).exists()) {
            assert!(Instant::now() < deadline, "the shells did not come up");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// Runs to the end; the signals are sent once the files `ready` are there.
    fn run(&self, ready: &[&str], signals: &[Signal]) -> LaunchOutcome {
        self.run_and_report(ready, signals).0
    }

    /// The same, with the robots for which the simulator was told that no process follows.
    fn run_and_report(&self, ready: &[&str], signals: &[Signal]) -> (LaunchOutcome, Vec<String>) {
        let screen = Screen::open(quiet()).unwrap();
        let (sender, gone) = std::sync::mpsc::channel();
        let leftovers = Leftovers::unguarded();
        let mut planned = self.planned.clone();
        for process in planned.iter_mut().filter(|one| one.part == Part::Robots) {
            process.command.env.extend([leftovers.mark(&process.name)]);
        }
        let outcome = runtime().block_on(async {
            let supervisor = Supervisor::new(
                planned,
                self.folder.path(),
                self.grace,
                screen.handle(),
                leftovers,
                sender,
            );
            let queue = supervisor.queue();
            if self.is_observed {
                queue.send(SupervisorEvent::Observed).unwrap();
            }
            let running = tokio::spawn(supervisor.run());
            Self::ready(self.folder.path(), ready).await;
            for signal in signals {
                queue.send(SupervisorEvent::Asked(*signal)).unwrap();
            }
            running.await.unwrap()
        });

        screen.finish();
        let gone = gone.iter().map(|gone| {
            let robots: Vec<&str> = gone.robots.iter().map(RobotName::as_str).collect();
            format!("{} {}", robots.join(" and "), gone.because)
        });
        (outcome, gone.collect())
    }
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap()
}

fn quiet() -> ScreenOptions {
    ScreenOptions {
        names: Vec::new(),
        is_quiet: true,
        has_colors_out: false,
        has_colors_err: false,
        has_bar: false,
    }
}

fn shell(name: &str, script: &str) -> Planned {
    Planned {
        name: name.to_owned(),
        command: CommandLine {
            program: "/bin/sh".into(),
            args: vec!["-c".to_owned(), script.to_owned()],
            env: BTreeMap::new(),
        },
        restart: Restart::Never,
        backoff: Duration::from_millis(1),
        is_required: true,
        is_extern: false,
        part: Part::Robots,
        robots: RobotName::new(name).into_iter().collect(),
    }
}

/// Whether the process with this id is running. A zombie is not.
fn is_alive(pid: &str) -> bool {
    let pid: i32 = pid.trim().parse().expect("a process wrote its number");
    let state = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    kill(Pid::from_raw(pid), None).is_ok() && !state.contains(") Z ")
}

#[track_caller]
fn assert_gone(pid: &str) {
    let deadline = Instant::now() + Duration::from_secs(10);
    while is_alive(pid) {
        assert!(Instant::now() < deadline, "process {pid} was left behind");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_run_that_ends_well_is_no_failure() {
    let hall = TestLaunch::new("sleep 0.2")
        .with(shell("Butler", "sleep 0.1"))
        .with(shell("Leguin", "sleep 0.3"));
    let outcome = hall.run(&[], &[]);
    assert_eq!((outcome.failure, outcome.asked), (None, None));
}

#[test]
fn no_robot_starts_before_the_run_is_observed() {
    let up = "trap 'exit 0' TERM; touch $DIR/up; sleep 600 & wait";
    for is_observed in [false, true] {
        let hall = TestLaunch {
            is_observed,
            ..TestLaunch::new(up).with(shell("Butler", "touch $DIR/Butler"))
        };
        let ready: &[&str] = if is_observed {
            &["up", "Butler"]
        } else {
            &["up"]
        };
        let outcome = hall.run(ready, &[Signal::SIGINT]);
        assert_eq!(
            (outcome.failure, outcome.asked),
            (None, Some(Signal::SIGINT))
        );
        assert_eq!(hall.path("Butler").exists(), is_observed);
    }
}

#[test]
fn who_watches_is_told_when_the_run_is_over_and_does_not_end_it() {
    let watching = "trap 'touch $DIR/told; exit 0' TERM; touch $DIR/watching; sleep 600 & wait";
    let observer = Planned {
        part: Part::Observer,
        is_required: false,
        ..shell("console", watching)
    };
    let broken = Planned {
        part: Part::Observer,
        is_required: false,
        ..shell("broken", "exit 1")
    };
    let hall = TestLaunch::new("until [ -e $DIR/watching ]; do sleep 0.01; done")
        .with(observer)
        .with(broken);
    let told = hall.path("told");
    let outcome = hall.run(&[], &[]);

    assert_eq!((outcome.failure, outcome.asked), (None, None));
    assert!(told.exists());
}

/// Whether users other than the owner may read a file.
fn is_public(file: &Path) -> bool {
    let permissions = std::fs::metadata(file).unwrap().permissions();
    permissions.mode() & 0o077 != 0
}

#[test]
fn only_the_owner_can_read_the_log_of_an_observer() {
    let observer = Planned {
        part: Part::Observer,
        ..shell("console", "echo secret; touch $DIR/shown; sleep 600")
    };
    let hall =
        TestLaunch::new("until [ -e $DIR/shown ]; do sleep 0.01; done; echo plain").with(observer);
    let log = hall.path("console.log");
    std::fs::write(&log, "earlier\n").unwrap();
    std::fs::set_permissions(&log, Permissions::from_mode(0o644)).unwrap();

    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_eq!(hall.read("console.log"), "earlier\nsecret\n");
    assert!(!is_public(&log));

    std::fs::remove_file(&log).unwrap();
    std::fs::remove_file(hall.path("shown")).unwrap();
    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_eq!(hall.read("console.log"), "secret\n");
    assert!(!is_public(&log));
}

#[test]
fn the_first_required_failure_ends_the_run_in_good_order() {
    let simulator =
        "trap 'echo stopped > $DIR/record; exit 0' TERM; touch $DIR/up; sleep 600 & wait";
    let robot =
        "until [ -e $DIR/up ]; do sleep 0.01; done; echo one >&2; echo two >&2; echo plain; exit 3";
    let other_robot = "until [ -e $DIR/record ]; do sleep 0.01; done";
    let hall = TestLaunch::new(simulator)
        .with(shell("Butler", robot))
        .with(shell("Leguin", other_robot));
    let failure = hall.run(&[], &[]).failure.unwrap();
    assert_eq!(failure.code, 3);
    assert_eq!(failure.text, "Butler ended with exit status 3");
    assert_eq!(failure.tail, ["one", "two"]);
    assert_eq!(failure.log, Some(hall.path("Butler.log")));
    assert_eq!(
        hall.read("record"),
        "stopped\n",
        "the simulator was to write its record"
    );

    let mut log: Vec<String> = hall.read("Butler.log").lines().map(str::to_owned).collect();
    log.sort();
    assert_eq!(log, ["one", "plain", "two"]);
}

#[test]
fn a_signal_is_a_failure_with_its_number() {
    let hall = TestLaunch::new(FOREVER).with(shell("Butler", "kill -KILL $$"));
    let failure = hall.run(&[], &[]).failure.unwrap();
    assert_eq!(
        (failure.code, failure.text.as_str()),
        (137, "Butler was ended by SIGKILL")
    );
}

#[test]
fn a_simulator_that_fails_takes_the_robots_with_it_at_once() {
    let begun = Instant::now();
    let failure = TestLaunch::new("exit 4")
        .with(shell("Butler", FOREVER))
        .run(&[], &[])
        .failure
        .unwrap();
    assert_eq!(failure.text, "simulator ended with exit status 4");
    assert!(begun.elapsed() < Duration::from_secs(10));
}

#[test]
fn a_program_that_cannot_be_started_is_a_failure() {
    let mut missing = shell("Butler", "");
    missing.command.program = "/nowhere/cars-butler".into();
    let failure = TestLaunch::new(FOREVER)
        .with(missing)
        .run(&[], &[])
        .failure
        .unwrap();

    assert_eq!(failure.code, 126);
    assert!(
        failure
            .text
            .contains("/nowhere/cars-butler cannot be started"),
        "{}",
        failure.text
    );
}

/// A console that stays when the run has failed, until the file `seen` is there; it exits with this status.
fn staying(status: u8) -> Planned {
    let script = format!(
        "trap 'touch $DIR/told; exit 0' TERM; touch $DIR/up
         until [ -e $DIR/failed.json ]; do sleep 0.01; done; cp $DIR/failed.json $DIR/read
         until [ -e $DIR/seen ]; do sleep 0.01; done; exit {status}"
    );
    Planned {
        part: Part::Observer,
        is_required: false,
        ..shell("console", &script)
    }
}

/// The simulator leaves its record, and with it the console may end.
const RECORDING: &str = "trap 'touch $DIR/seen; exit 0' TERM; touch $DIR/sim; sleep 600 & wait";
const FAILING: &str =
    "until [ -e $DIR/up -a -e $DIR/sim ]; do sleep 0.01; done; echo 'error: no way' >&2; exit 3";

#[test]
fn the_console_outlives_a_failure_and_is_told_why() {
    for (status, is_to_resume) in [(0, false), (RESUME, true), (1, false)] {
        let hall = TestLaunch::new(RECORDING)
            .with(shell("Butler", FAILING))
            .with(staying(status));
        let outcome = hall.run(&[], &[]);
        assert_eq!(outcome.failure.unwrap().code, 3);
        assert_eq!(outcome.is_to_resume, is_to_resume);
        assert!(!hall.path("told").exists(), "the console was ended");

        let told: serde_json::Value = serde_json::from_str(&hall.read("read")).unwrap();
        assert_eq!(told["text"], "Butler ended with exit status 3");
        assert_eq!(told["lines"], serde_json::json!(["error: no way"]));
        let command = told["command"].as_str().unwrap();
        assert!(command.starts_with("cars launch --resume "), "{command}");
    }
}

#[test]
fn ctrl_c_ends_a_console_that_shows_a_failure() {
    let hall = TestLaunch::new("trap 'exit 0' TERM; touch $DIR/sim; sleep 600 & wait")
        .with(shell("Butler", FAILING))
        .with(staying(RESUME));
    let outcome = hall.run(&["read"], &[Signal::SIGINT]);
    assert!(outcome.failure.is_some());
    assert!(!outcome.is_to_resume);
    assert!(hall.path("told").exists());
}

#[test]
fn a_robot_that_is_not_required_may_fail() {
    let robot = Planned {
        is_required: false,
        ..shell("Butler", "exit 1")
    };
    let outcome = TestLaunch::new("sleep 0.3").with(robot).run(&[], &[]);
    assert_eq!(outcome.failure, None);
}

#[test]
fn a_failed_robot_is_restarted_and_the_run_goes_on() {
    let script = "echo up >> $DIR/starts; [ $(wc -l < $DIR/starts) -lt 3 ] && exit 1; touch $DIR/well; sleep 600";
    let robot = Planned {
        restart: Restart::OnFailure,
        ..shell("Butler", script)
    };
    let hall = TestLaunch::new("until [ -e $DIR/well ]; do sleep 0.01; done").with(robot);
    let hall = TestLaunch {
        grace: Duration::from_millis(100),
        ..hall
    };

    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_eq!(hall.read("starts"), "up\nup\nup\n");
}

#[test]
fn a_robot_that_always_fails_is_given_up() {
    let robot = Planned {
        restart: Restart::Always,
        ..shell("Butler", "echo up >> $DIR/starts; exit 7")
    };
    let hall = TestLaunch::new(FOREVER).with(robot);
    assert_eq!(hall.run(&[], &[]).failure.unwrap().code, 7);
    assert_eq!(hall.read("starts").lines().count(), 1 + BUDGET);
}

#[test]
fn what_a_process_started_ends_with_it() {
    let robot = "sleep 600 & echo $! > $DIR/grandchild; exit 0";
    let hall = TestLaunch::new("until [ -s $DIR/grandchild ]; do sleep 0.01; done; sleep 0.1")
        .with(shell("Butler", robot));
    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_gone(&hall.read("grandchild"));
}

#[test]
fn a_child_in_a_session_of_its_own_ends_with_the_run() {
    let robot = "setsid sleep 600 & setsid sh -c 'echo $$ > $DIR/daemon; sleep 600' & \
                 until [ -s $DIR/daemon ]; do sleep 0.01; done; touch $DIR/up; sleep 600";
    let hall =
        TestLaunch::new("until [ -e $DIR/up ]; do sleep 0.01; done").with(shell("Butler", robot));
    let hall = TestLaunch {
        grace: Duration::from_millis(100),
        ..hall
    };
    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_gone(&hall.read("daemon"));
}

#[test]
fn a_child_in_a_session_of_its_own_ends_with_its_robot() {
    let robot = "setsid sh -c 'echo $$ > $DIR/daemon; sleep 600' & \
                 until [ -s $DIR/daemon ]; do sleep 0.01; done; touch $DIR/left";
    // The simulator ends when the daemon has.
    let simulator = "until [ -e $DIR/left ]; do sleep 0.01; done; \
                     while kill -0 $(cat $DIR/daemon) 2> /dev/null; do sleep 0.01; done";
    let hall = TestLaunch::new(simulator).with(shell("Butler", robot));
    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_gone(&hall.read("daemon"));
}

/// Ends when the robot has.
const WHILE_BUTLER: &str = "until [ -e $DIR/left ]; do sleep 0.01; done; sleep 0.3";

#[test]
fn the_simulator_is_told_of_robots_that_no_process_follows() {
    let over = "touch $DIR/left; exit 0";
    let broken = "touch $DIR/left; exit 3";
    let told = |butler: Planned| {
        let hall = TestLaunch::new(WHILE_BUTLER).with(butler);
        let (outcome, gone) = hall.run_and_report(&[], &[]);
        assert_eq!(outcome.failure, None);
        gone
    };

    assert_eq!(
        told(shell("Butler", over)),
        ["Butler ended with exit status 0"]
    );
    assert_eq!(
        told(Planned {
            restart: Restart::OnFailure,
            ..shell("Butler", over)
        }),
        ["Butler ended with exit status 0"]
    );
    assert_eq!(
        told(Planned {
            is_required: false,
            ..shell("Butler", broken)
        }),
        ["Butler ended with exit status 3"]
    );
    assert_eq!(
        told(Planned {
            is_required: false,
            restart: Restart::Always,
            ..shell("Butler", broken)
        }),
        ["Butler ended with exit status 3, and has been restarted 5 times already"]
    );
    let missing = Planned {
        is_required: false,
        ..shell("Butler", "")
    };
    let missing = Planned {
        command: CommandLine {
            program: "/nowhere/robot".into(),
            ..missing.command
        },
        ..missing
    };
    let hall = TestLaunch::new("sleep 0.5").with(missing);
    let (_, gone) = hall.run_and_report(&[], &[]);
    assert!(
        gone[0].starts_with("Butler did not start (/nowhere/robot cannot be started"),
        "{gone:?}"
    );
}

#[test]
fn the_simulator_is_not_told_of_robots_that_a_process_follows() {
    let restarted = Planned {
        restart: Restart::Always,
        backoff: Duration::from_secs(600),
        ..shell("Butler", "touch $DIR/left; exit 0")
    };
    let observer = Planned {
        part: Part::Observer,
        robots: Vec::new(),
        ..shell("console", "touch $DIR/closed; exit 0")
    };
    // It ends when the simulator has ended.
    let at_the_end = shell(
        "Leguin",
        "until [ -s $DIR/simulator ] && ! kill -0 $(cat $DIR/simulator) 2> /dev/null; do sleep 0.01; done",
    );
    let simulator = "until [ -e $DIR/left ] && [ -e $DIR/closed ]; do sleep 0.01; done; \
                     sleep 0.3; echo $$ > $DIR/simulator";
    let hall = TestLaunch::new(simulator)
        .with(restarted)
        .with(observer)
        .with(at_the_end);
    let (outcome, gone) = hall.run_and_report(&[], &[]);
    assert_eq!(outcome.failure, None);
    assert_eq!(gone, [""; 0]);
}

#[test]
fn the_log_of_a_process_is_bounded() {
    let robot = "echo first; yes 'a line of a robot that prints without an end' | head -n 4000000; echo last";
    let hall = TestLaunch::new("until [ -e $DIR/left ]; do sleep 0.05; done")
        .with(shell("Butler", &format!("{robot}; touch $DIR/left")));
    assert_eq!(hall.run(&[], &[]).failure, None);

    let log = hall.read("Butler.log");
    assert!(log.len() as u64 <= LIMIT_BYTES, "{} bytes", log.len());
    assert!(log.len() as u64 > LIMIT_BYTES / 2, "{} bytes", log.len());
    assert!(log.starts_with("first\na line"));
    assert!(log.ends_with("\nlast\n"), "{:?}", &log[log.len() - 60..]);
    assert!(log.contains(" bytes are left out here"));
}

/// Hears SIGTERM and does not care; so does what it started.
const DEAF: &str = "trap '' TERM; (sleep 600; true) & echo $! > $DIR/grandchild; echo $$ > $DIR/own; touch $DIR/deaf; wait";

#[test]
fn who_does_not_leave_in_time_is_killed_with_all_it_started() {
    let hall =
        TestLaunch::new("until [ -e $DIR/deaf ]; do sleep 0.01; done").with(shell("Butler", DEAF));
    let hall = TestLaunch {
        grace: Duration::from_millis(100),
        ..hall
    };
    assert_eq!(hall.run(&[], &[]).failure, None);
    assert_gone(&hall.read("own"));
    assert_gone(&hall.read("grandchild"));
}

#[test]
fn asked_once_all_are_ended_also_one_that_is_stopped() {
    let simulator =
        "trap 'echo stopped > $DIR/record; exit 0' TERM; touch $DIR/up; sleep 600 & wait";
    let hall = TestLaunch::new(simulator).with(shell(
        "Butler",
        "touch $DIR/stopped; kill -STOP $$; sleep 600",
    ));
    let begun = Instant::now();
    let outcome = hall.run(&["up", "stopped"], &[Signal::SIGINT]);

    assert!(
        begun.elapsed() < Duration::from_secs(10),
        "a process had to be killed"
    );
    assert_eq!(
        (outcome.failure, outcome.asked),
        (None, Some(Signal::SIGINT))
    );
    assert_eq!(hall.read("record"), "stopped\n");
}

#[test]
fn the_death_of_a_parent_is_one_request_however_many_signals_it_sends() {
    let simulator = "trap 'sleep 0.3; echo whole > $DIR/record; exit 0' TERM; touch $DIR/up; \
                     while :; do sleep 0.01; done";
    let hall = TestLaunch::new(simulator);
    let outcome = hall.run(&["up"], &[Signal::SIGTERM, Signal::SIGTERM, Signal::SIGHUP]);
    assert_eq!(
        (outcome.failure, outcome.asked),
        (None, Some(Signal::SIGTERM))
    );
    assert_eq!(hall.read("record"), "whole\n");
}

#[test]
fn asked_twice_all_are_killed_at_once() {
    let hall = TestLaunch::new(FOREVER).with(shell("Butler", DEAF));
    let hall = TestLaunch {
        grace: Duration::from_secs(600),
        ..hall
    };
    let outcome = hall.run(&["deaf"], &[Signal::SIGINT, Signal::SIGINT]);
    assert_eq!(outcome.asked, Some(Signal::SIGINT));
    assert_gone(&hall.read("own"));
    assert_gone(&hall.read("grandchild"));
}

#[test]
fn no_process_is_left_behind_when_the_launcher_panics() {
    let hall = TestLaunch::new(FOREVER).with(shell("Butler", DEAF));
    let screen = Screen::open(quiet()).unwrap();
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        runtime().block_on(async {
            let grace = Duration::from_secs(600);
            let supervisor = Supervisor::new(
                hall.planned.clone(),
                hall.folder.path(),
                grace,
                screen.handle(),
                Leftovers::unguarded(),
                std::sync::mpsc::channel().0,
            );
            supervisor.queue().send(SupervisorEvent::Observed).unwrap();
            tokio::spawn(supervisor.run());
            TestLaunch::ready(hall.folder.path(), &["deaf"]).await;
            panic!("as a defect of the launcher would");
        });
    }));

    assert!(result.is_err());
    assert_gone(&hall.read("own"));
    assert_gone(&hall.read("grandchild"));

    screen.finish();
}
