//! The folder of an experiment: whatever interrupts it, whoever plays its units and in whatever order, its results are the same
//! bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use protocol::random;
use system_tests::{Lab, PATIENCE, eventually, is_within, programs, root};

use super::{HALL, assert_same_results, cars, command, files_of_units, ok, rows};

/// An experiment of very short runs: two factors, two arms, one of which is yoked.
struct Short {
    lab: Lab,
    file: PathBuf,
}

impl Short {
    fn new() -> Self {
        let lab = Lab::new();
        let file = lab.write("short.toml", &Self::text());
        Self { lab, file }
    }

    fn text() -> String {
        let scenario = root().join(HALL);
        format!(
            r#"
question = "Are results independent of how they are made?"
procedure = "Short runs."
scenario = {scenario:?}
seeds = 4
duration = "3 s"
baseline = "plain"

[[factor]]
name = "guests"
path = "guests.count"
values = [0, 3]

[[factor]]
name = "loss"
values = [0.0, 0.25, 0.5, 0.75, 1.0]
set = ["network.commands={{ loss = {{value}} }}"]

[[arm]]
name = "plain"
what = "as it is"
set = []

[[arm]]
name = "yoked"
what = "emotions of the next seed"
yoked_to = "plain"
set = []

[[measure]]
name = "blocked"
contrast = true
summary = "robots.*.blocked"

[[measure]]
name = "served"
column = "served"
summary = "robots.Butler.state_variables.served"

[[measure]]
name = "concerned"
time = {{ to = {{ event = "emotion", to = "CONCERNED" }} }}
"#
        )
    }

    fn out(&self, name: &str) -> PathBuf {
        self.lab.out().join(name)
    }

    /// Plays the experiment into a folder; returns what is printed for people.
    fn run(&self, folder: &Path, args: &[&str]) -> String {
        let file = self.file.to_str().unwrap();
        let fixed = ["run", file, "-o", folder.to_str().unwrap()];
        ok(&[&fixed, args].concat())
    }

    fn start(&self, folder: &Path, args: &[&str]) -> Playing {
        let file = self.file.to_str().unwrap();
        let mut command = command(&["run", file, "-o", folder.to_str().unwrap()]);
        command.args(args);
        Playing::start(command)
    }
}

/// An experiment in progress.
struct Playing(Child);

impl Playing {
    fn start(mut command: Command) -> Self {
        let command = command.stdout(Stdio::null()).stderr(Stdio::null());
        Self(command.spawn().unwrap())
    }
}

impl Drop for Playing {
    fn drop(&mut self) {
        let _has_ended = self.0.kill();
        let _status = self.0.wait();
    }
}

/// Bytes of the units that have been played.
fn played_bytes(folder: &Path) -> u64 {
    let files = files_of_units(folder).into_iter();
    files
        .map(|file| fs::metadata(file).map_or(0, |metadata| metadata.len()))
        .sum()
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn an_experiment_that_is_killed_again_and_again_has_the_results_of_an_undisturbed_one() {
    const KILLS: u64 = 10;
    let short = Short::new();
    let undisturbed = short.out("undisturbed");
    let disturbed = short.out("disturbed");
    let seeds = ["--seeds", "100", "--duration", "10 s"];
    short.run(&undisturbed, &seeds);
    assert_eq!(rows(&undisturbed).len(), 2000);

    let mut chance = random::stream(14, "kills");
    // Half of the units are left after the last one, so that each of them interrupts it.
    let part = played_bytes(&undisturbed) / (2 * KILLS);
    for kill in 0..KILLS {
        let until = kill * part + (random::unit(&mut chance) * part as f64) as u64;
        let mut playing = short.start(&disturbed, &[seeds.as_slice(), &["--jobs", "1"]].concat());
        let is_reached = is_within(PATIENCE, || played_bytes(&disturbed) > until);
        assert!(
            is_reached,
            "{kill}: {} of {until} bytes",
            played_bytes(&disturbed)
        );
        assert_eq!(
            playing.0.try_wait().unwrap(),
            None,
            "{kill}: it was not interrupted"
        );
        playing.0.kill().unwrap();
        playing.0.wait().unwrap();
    }
    assert!(!disturbed.join("runs.csv").exists());

    let printed = short.run(&disturbed, &seeds);
    assert!(!printed.contains("2000 to play"), "{printed}");
    assert_same_results(&undisturbed, &disturbed);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn results_do_not_depend_on_the_number_of_jobs_or_of_processes_at_work() {
    let short = Short::new();
    let one = short.out("one");
    short.run(&one, &["--jobs", "1", "--seeds", "12"]);
    let four = short.out("four");
    short.run(&four, &["--jobs", "4", "--seeds", "12"]);
    assert_same_results(&one, &four);

    let both = short.out("both");
    let mut playing = Vec::new();
    for _ in 0..2 {
        playing.push(short.start(&both, &["--jobs", "1", "--seeds", "12"]));
    }
    for process in &mut playing {
        assert!(process.0.wait().unwrap().success());
    }
    assert_same_results(&one, &both);
}

#[test]
fn units_that_are_played_one_by_one_merge_to_the_same() {
    let short = Short::new();
    let whole = short.out("whole");
    short.run(&whole, &[]);

    let parts = short.out("parts");
    let folder = parts.to_str().unwrap();
    let printed = short.run(&parts, &["--plan-only"]);
    assert!(printed.contains("80 units in"), "{printed}");
    // The last part is played first, and ends after the last unit.
    for (units, played) in [("50..=99", 30), ("7", 1), ("0..=9", 9), ("0..=9", 0)] {
        let printed = ok(&["unit", folder, units]);
        assert!(
            printed.contains(&format!("{played} to play")),
            "{units}: {printed}"
        );
    }
    let (code, printed) = cars(&["unit", folder, "80"]);
    assert_eq!(code, 1);
    assert!(printed.contains("has the units 0 to 79"), "{printed}");

    let (code, printed) = cars(&["merge", folder]);
    assert_eq!(code, 1);
    assert!(
        printed.contains("40 of 80 units are missing, the first is 10"),
        "{printed}"
    );
    assert_eq!(rows(&parts).len(), 40);
    ok(&["unit", folder, "10..=49"]);
    ok(&["merge", folder]);
    assert_same_results(&whole, &parts);

    let status = command(&["status", folder]).output().unwrap();
    let status = String::from_utf8(status.stdout).unwrap();
    assert_eq!(status, "80 units: 80 played, 0 failed, 0 missing\n");
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn only_what_is_new_or_has_changed_is_played() {
    let short = Short::new();
    let folder = short.out("grown");
    let play = |text: &str, args: &[&str], expected: &str| {
        fs::write(&short.file, text).unwrap();
        let printed = short.run(&folder, args);
        assert!(printed.contains(expected), "{expected}: {printed}");
        printed
    };
    let text = Short::text();
    let arm = "[[arm]]\nname = \"few\"\nwhat = \"fewer treats\"\n\
               set = [\"robot.Butler.params.treat_capacity=5\"]\n\n[[measure]]\nname = \"blocked\"";
    let with_arm = text.replacen("[[measure]]\nname = \"blocked\"", arm, 1);

    play(&text, &[], "80 units: 0 are there, 80 to play");
    play(&text, &[], "80 units: 80 are there, 0 to play");
    // Two more seeds of each of 20 cells; in the ten yoked ones the last seed was yoked to the first, and no longer is.
    play(
        &text,
        &["--seeds", "6"],
        "120 units: 70 are there, 50 to play",
    );
    play(
        &with_arm,
        &["--seeds", "6"],
        "180 units: 120 are there, 60 to play",
    );
    play(
        &text,
        &["--seeds", "2..=5"],
        "80 units: 70 are there, 10 to play",
    );

    let changed = text.replace("robots.*.blocked", "robots.Butler.blocked");
    let printed = play(&changed, &[], "80 units: 0 are there, 80 to play");
    assert!(printed.contains("the measures have changed"), "{printed}");
    play(&text, &[], "80 units: 80 are there, 0 to play");
    // What is only shown is no other measure.
    let column = text.replace("column = \"served\"", "column = \"guests served\"");
    play(&column, &[], "80 units: 80 are there, 0 to play");

    let longer = play(
        &text,
        &["--duration", "4 s"],
        "80 units: 0 are there, 80 to play",
    );
    assert!(
        longer.contains("the scenario of the arm \"plain\""),
        "{longer}"
    );

    let fresh = short.out("fresh");
    fs::write(&short.file, &with_arm).unwrap();
    short.run(&fresh, &["--seeds", "6"]);
    play(
        &with_arm,
        &["--seeds", "6"],
        "180 units: 180 are there, 0 to play",
    );
    assert_same_results(&fresh, &folder);
}

#[test]
fn a_damaged_unit_is_named_and_played_again() {
    let short = Short::new();
    let whole = short.out("whole");
    short.run(&whole, &[]);
    let folder = short.out("damaged");
    short.run(&folder, &["--jobs", "1"]);

    let files = files_of_units(&folder);
    let [file] = files.as_slice() else {
        panic!("one process writes one file: {files:?}");
    };
    let mut bytes = fs::read(file).unwrap();
    let lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
    let damaged = lines[..17].concat().len() + 60;
    let cut = bytes.len() - 10;
    bytes[damaged] ^= 1;
    bytes.truncate(cut);
    fs::write(file, bytes).unwrap();

    let status = cars(&["status", folder.to_str().unwrap()]).1;
    assert!(
        status.contains("line 18 is damaged: unit 17 (condition"),
        "{status}"
    );
    let printed = short.run(&folder, &[]);
    assert!(
        printed.contains("line 18 is damaged: unit 17 (condition"),
        "{printed}"
    );
    assert!(
        printed.contains("80 units: 78 are there, 2 to play"),
        "{printed}"
    );
    assert_same_results(&whole, &folder);

    let printed = short.run(&folder, &[]);
    assert!(!printed.contains("is damaged"), "{printed}");
}

/// Nothing is played under a wrong name, and what has been played is not lost.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_plan_that_is_damaged_or_lost_is_made_again_and_its_units_are_used() {
    let short = Short::new();
    let whole = short.out("whole");
    short.run(&whole, &[]);
    let folder = short.out("damaged");
    short.run(&folder, &[]);
    let plan = folder.join("plan.json");
    let good = fs::read_to_string(&plan).unwrap();
    let flipped = good.replacen("loss = 0.25", "loss = 0.75", 1);
    let flipped = if flipped == good {
        good.replacen("0.25", "0.35", 1)
    } else {
        flipped
    };
    assert_ne!(flipped, good);

    let unsealed = good.replace("\"seal\"", "\"soul\"");
    for (text, reason) in [
        (Some(flipped.as_str()), "is not as it was written"),
        (Some(&good[..good.len() / 2]), "is damaged"),
        (Some(&unsealed), "has no seal"),
        (Some(""), "is empty"),
        (None, "it has no plan.json"),
    ] {
        match text {
            Some(text) => fs::write(&plan, text).unwrap(),
            None => fs::remove_file(&plan).unwrap(),
        }
        for command in ["status", "merge", "unit", "replay"] {
            let mut args = vec![command, folder.to_str().unwrap()];
            if matches!(command, "unit" | "replay") {
                args.push("0");
            }
            let (code, printed) = cars(&args);
            assert_eq!(code, 1, "{command}: {printed}");
            assert!(printed.contains(reason), "{command}: {printed}");
            assert!(
                printed.contains("cars experiment run FILE --out"),
                "{printed}"
            );
        }

        let printed = short.run(&folder, &[]);
        assert!(printed.contains("it is made again"), "{printed}");
        assert!(printed.contains("80 are there, 0 to play"), "{printed}");
        assert_same_results(&whole, &folder);
    }
}

/// Every bit of a plan counts, or changes nothing.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn no_flipped_bit_of_a_plan_plays_anything_else() {
    let short = Short::new();
    let folder = short.out("bits");
    short.run(&folder, &["--plan-only", "--seeds", "2"]);
    let plan = folder.join("plan.json");
    let good = fs::read(&plan).unwrap();
    let before = experiments::Plan::load(&folder).unwrap();
    let mut chance = random::stream(14, "bits");
    for _ in 0..300 {
        let place = (random::unit(&mut chance) * good.len() as f64) as usize;
        let bit = (random::unit(&mut chance) * 8.0) as u32;
        let mut damaged = good.clone();
        damaged[place] ^= 1 << bit;
        fs::write(&plan, &damaged).unwrap();
        if let Ok(plan) = experiments::Plan::load(&folder) {
            for number in 0..before.units() {
                assert_eq!(plan.unit(number).key, before.unit(number).key, "{place}");
            }
        }
    }
}

#[test]
fn two_experiment_files_of_one_name_do_not_share_a_folder_by_chance() {
    let lab = Lab::new();
    let play = |folder: &str, question: &str, more: &[&str]| {
        let at = lab.out().join(folder);
        fs::create_dir_all(&at).unwrap();
        let file = at.join("twice.toml");
        let text = Short::text().replace("Are results independent", question);
        fs::write(&file, text).unwrap();
        let args = ["run", file.to_str().unwrap(), "--plan-only"];
        let mut command = command(&[&args[..], more].concat());
        let output = command.current_dir(lab.out()).output().unwrap();
        (output.status.code(), super::notes(&output))
    };

    assert_eq!(play("one", "Is it one", &[]).0, Some(0));
    assert_eq!(play("one", "Is it still one", &[]).0, Some(0));
    let (code, printed) = play("other", "Is it another", &[]);
    assert_eq!(code, Some(1), "{printed}");
    assert!(
        printed.contains("choose another folder with -o"),
        "{printed}"
    );
    // Naming the folder does not give it to another experiment.
    let out = ["--out", "runs/experiments/twice"];
    assert_eq!(play("other", "Is it another", &out).0, Some(1));
    let out = ["--out", "runs/experiments/another"];
    assert_eq!(play("other", "Is it another", &out).0, Some(0));
}

/// A robot that exits in the middle of a run where its parameter `wings` is 2, and in tick 0 where it is 3.
const WINGS: &str = r#"
while read -r line; do
    case $line in
        *'"type":"end"'*) exit 0 ;;
        *'"wings":2'*) fails=yes ;;
        *'"wings":3'*) echo 'it fell' >&2; exit 4 ;;
    esac
    case $line in *'"tick":2'*) test -z "$fails" || { echo 'no wings' >&2; exit 3; } ;; esac
    echo '{"type":"done"}'
done
"#;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_unit_that_fails_ends_nothing_and_is_played_again_on_request() {
    let lab = Lab::new();
    let robot = lab.write("robot.sh", WINGS);
    let program = programs().join("cars");
    lab.write(
        "walk.toml",
        "[[robot]]\nname = 'Walker'\nat = ['25 ft', '25 ft']\nparams = { wings = 1 }\n\
         [[expect]]\nname = 'it flies'\neventually = { event = 'emotion', robot = 'Walker', to = 'HAPPY' }\n\
         within = '100 s'\n",
    );
    lab.write(
        "launch.toml",
        &format!(
            "scenario = 'walk.toml'\n[console]\nenabled = false\n[[process]]\nname = 'Walker'\n\
             command = [{program:?}, 'exec', '--', 'sh', {robot:?}]\n"
        ),
    );
    let file = lab.write(
        "wings.toml",
        "question = '?'\nscenario = 'launch.toml'\nduration = '2 s'\nseeds = 2\n[[arm]]\nname = 'good'\n\
         [[arm]]\nname = 'bad'\nset = ['robot.Walker.params.wings=2']\n\
         [[arm]]\nname = 'falls'\nset = ['robot.Walker.params.wings=3']\n\
         [[measure]]\nname = 'ticks'\nsummary = 'ticks'\n",
    );
    let folder = lab.out().join("failing");
    let args = ["run", file.to_str().unwrap(), "--processes", "-o"];
    let args = [&args[..], &[folder.to_str().unwrap()]].concat();

    for (more, expected) in [
        (&[] as &[&str], "6 units: 0 are there, 6 to play"),
        (&[], "6 units: 6 are there, 0 to play"),
        (&["--retry-failed"], "6 units: 2 are there, 4 to play"),
    ] {
        let (code, printed) = cars(&[&args, more].concat());
        assert_eq!(code, 1, "{printed}");
        assert!(printed.contains(expected), "{printed}");
        assert!(printed.contains("4 of 6 units failed"), "{printed}");
        assert!(printed.contains("no wings"), "{printed}");
        assert!(printed.contains("it fell"), "{printed}");
    }

    let results = fs::read_to_string(folder.join("results.json")).unwrap();
    let results: serde_json::Value = serde_json::from_str(&results).unwrap();
    let failures = results["failures"].as_array().unwrap();
    assert_eq!(failures.len(), 4, "{results}");
    for failure in failures {
        let reason = failure["reason"].as_str().unwrap();
        let expected = match failure["arm"].as_str() {
            Some("bad") => "no wings",
            _ => "it fell",
        };
        assert!(reason.contains(expected), "{failure}");
        assert!(!reason.contains("damaged"), "{failure}");
    }
    for (index, failed) in [(0, 0), (1, 2), (2, 2)] {
        let excluded = &results["estimates"][index]["excluded"];
        assert_eq!(excluded["failed"], failed, "{results}");
    }
    let good = &results["estimates"][0];
    assert_eq!(
        (&good["arm"], &good["mean"]["n"]),
        (&"good".into(), &2.into()),
        "{results}"
    );
}

#[test]
fn results_name_the_commit_that_the_program_was_built_from() {
    let short = Short::new();
    let folder = short.out("results");
    short.run(&folder, &["--duration", "10 s", "--seeds", "2"]);
    let read = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap()
    };

    let commit = read("provenance.json")["commit"].clone();
    assert_eq!(read("plan.json")["program"]["commit"], commit);
    let mut git = Command::new("git");
    let asked = git.args(["rev-parse", "HEAD"]).current_dir(root()).output();
    let is_checkout = asked.is_ok_and(|output| output.status.success());
    let digits = commit.as_str().unwrap_or_default();
    assert_eq!(digits.len(), if is_checkout { 40 } else { 0 }, "{commit}");
}

/// The digest of a run in the folder of a lab.
fn digest(lab: &Lab, run: &str) -> String {
    lab.summary(run)["digest"].as_str().unwrap().to_owned()
}

#[test]
fn a_unit_is_recorded_as_a_run_by_one_command() {
    let short = Short::new();
    let folder = short.out("results");
    short.run(&folder, &["--duration", "60 s", "--seeds", "2"]);
    let rows = rows(&folder);
    for (unit, arm) in [("1", "plain"), ("39", "yoked")] {
        let row = &rows[unit.parse::<usize>().unwrap()];
        assert_eq!(row["arm"], arm);
        let out = short.lab.out().to_str().unwrap();
        let printed = ok(&["replay", folder.to_str().unwrap(), unit, "--out", out]);
        assert!(printed.contains("is the same run"), "{printed}");

        let run = format!("short-{unit}");
        assert_eq!(digest(&short.lab, &run), row["digest"]);
        assert_eq!(short.lab.recorded(&run).len(), 121);
        short.lab.ok(&["verify", &run]);
    }

    // A plan that is not as it was written is refused.
    let plan = folder.join("plan.json");
    let text = fs::read_to_string(&plan).unwrap();
    let changed = text.replace("\"version\": \"", "\"version\": \"0.");
    fs::write(&plan, changed).unwrap();
    let (code, printed) = cars(&["unit", folder.to_str().unwrap(), "0"]);
    assert_eq!(code, 1);
    assert!(printed.contains("is not as it was written"), "{printed}");
}

#[test]
fn runs_of_processes_give_the_results_of_one_process() {
    let lab = Lab::new();
    let launch = root().join("launch/hors_doeuvres.toml");
    let text = Short::text();
    let text = text.replace(
        &format!("scenario = {:?}", root().join(HALL)),
        &format!("scenario = {launch:?}"),
    );
    let text = text.replace("values = [0, 3]", "values = [50]");
    let text = text.replace("[0.0, 0.25, 0.5, 0.75, 1.0]", "[0.5]");
    let file = lab.write("launched.toml", &text);
    let play = |name: &str, more: &[&str]| {
        let folder = lab.out().join(name);
        let out = folder.to_str().unwrap();
        let fixed = [
            "run",
            file.to_str().unwrap(),
            "-o",
            out,
            "--seeds",
            "2",
            "--duration",
            "60 s",
        ];
        ok(&[&fixed, more].concat());
        folder
    };
    let one = play("one", &[]);
    let processes = play("processes", &["--processes"]);
    let fresh = play("fresh", &["--processes", "--fresh-processes"]);
    for name in ["runs.csv", "results.json"] {
        let bytes = |folder: &Path| fs::read(folder.join(name)).unwrap();
        assert!(bytes(&one) == bytes(&processes), "{name}");
        assert!(bytes(&one) == bytes(&fresh), "{name}");
    }
    // The yoke acts: what is compared is not the same run four times.
    let rows = rows(&one);
    assert_ne!(rows[0]["digest"], rows[2]["digest"]);

    let out = lab.out().to_str().unwrap();
    let folder = processes.to_str().unwrap();
    let printed = ok(&["replay", folder, "2", "--out", out, "--run", "again"]);
    assert!(printed.contains("is the same run"), "{printed}");
    assert_eq!(digest(&lab, "again"), rows[2]["digest"]);
}

/// A robot that no process of the project can run takes part in an experiment.
#[test]
fn a_robot_in_another_language_takes_part() {
    let lab = Lab::new();
    let stroller = root().join("sdk/stdio/bash");
    let scenario = "tick = \"0.5 s\"\nduration = \"10 s\"\n[field]\nsize = [\"30 ft\", \"30 ft\"]\n\
                    [[robot]]\nname = \"Bruno\"\nclass = \"Bash\"\nat = [\"15 ft\", \"22 ft\"]\n";
    lab.write("hall.toml", scenario);
    std::os::unix::fs::symlink(stroller, lab.out().join("programs")).unwrap();
    let launch = "scenario = \"hall.toml\"\n[[process]]\nname = \"Bruno\"\n\
                  command = [\"cars\", \"exec\", \"--\", \"programs/stroller.sh\"]\n";
    lab.write("launch.toml", launch);
    let experiment = "question = \"Does he walk?\"\nprocedure = \"Guests.\"\nscenario = \"launch.toml\"\n\
                      seeds = 2\nduration = \"10 s\"\n\
                      [[factor]]\nname = \"guests\"\npath = \"guests.count\"\nvalues = [0, 40]\n\
                      [[arm]]\nname = \"Bruno\"\nwhat = \"in Bash\"\nset = []\n\
                      [[measure]]\nname = \"blocked\"\nsummary = \"robots.Bruno.blocked\"\n";
    let file = lab.write("strolling.toml", experiment);
    let folder = lab.out().join("results");
    let args = [
        "run",
        file.to_str().unwrap(),
        "-o",
        folder.to_str().unwrap(),
    ];

    let (code, printed) = cars(&args);
    assert_eq!(code, 1, "{printed}");
    assert!(printed.contains("can run in this process"), "{printed}");
    ok(&[&args, ["--processes"].as_slice()].concat());
    let rows = rows(&folder);
    assert_eq!(rows.len(), 4);
    for row in rows {
        assert!(
            !row["digest"].is_empty() && !row["blocked"].is_empty(),
            "{row:?}"
        );
    }
}

/// The number of robots of a team is a factor, also where processes share the team out.
#[test]
fn the_number_of_robots_is_a_factor() {
    let lab = Lab::new();
    lab.write(
        "team.toml",
        "[field]\nsize = ['60 ft', '60 ft']\n[[robot]]\nname = 'S{1..2}'\nclass = 'Leguin'\nat = 'random'\n\
         [[robot]]\nname = 'Butler'\nat = 'random'\nparams = { refiller = 'S1' }\n",
    );
    lab.write(
        "launch.toml",
        "scenario = 'team.toml'\n[[process]]\nname = 'team'\ncommand = ['cars-leguin']\nrobots = 'S*'\nper_process = 2\n\
         [[process]]\nname = 'Butler'\ncommand = ['cars-butler']\n",
    );
    let file = lab.write(
        "size.toml",
        "question = '?'\nscenario = 'launch.toml'\nduration = '20 s'\nseeds = 2\n\
         [[factor]]\nname = 'robots'\nvalues = [1, 5]\nset = ['robot.S.count={value}', 'robot.S*.params.waiter=Butler']\n\
         [[arm]]\nname = 'a'\n\
         [[measure]]\nname = 'states'\ncount = { event = 'behavior', robot = '*' }\n\
         [[measure]]\nname = 'balance'\njain = { robot = 'S*', name = 'trips' }\n",
    );
    let play = |name: &str, more: &[&str]| {
        let folder = lab.out().join(name);
        let args = [
            "run",
            file.to_str().unwrap(),
            "-o",
            folder.to_str().unwrap(),
        ];
        ok(&[&args, more].concat());
        fs::read(folder.join("runs.csv")).unwrap()
    };
    let here = play("here", &[]);
    assert!(here == play("there", &["--processes"]));
    assert_eq!(String::from_utf8(here).unwrap().lines().count(), 1 + 4);
}

/// Whatever ends an experiment, its processes end, too.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_killed_experiment_leaves_no_process() {
    let lab = Lab::new();
    let short = Short::text();
    let launch = root().join("launch/hors_doeuvres.toml");
    let text = short.replace(
        &format!("scenario = {:?}", root().join(HALL)),
        &format!("scenario = {launch:?}"),
    );
    let file = lab.write("killed.toml", &text);
    let folder = lab.out().join("killed");
    let temporary = lab.out().join("temporary");
    fs::create_dir(&temporary).unwrap();
    let mut command = command(&[
        "run",
        file.to_str().unwrap(),
        "-o",
        folder.to_str().unwrap(),
    ]);
    command
        .args(["--processes", "--jobs", "2"])
        .env("TMPDIR", &temporary)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut experiment = command.spawn().unwrap();
    eventually("a unit that has been played again", || {
        let files = files_of_units(&folder);
        let lines = files.iter().map(|file| {
            let text = fs::read_to_string(file).unwrap_or_default();
            text.lines().count()
        });
        (lines.sum::<usize>() > 6).then_some(())
    });

    experiment.kill().unwrap();
    experiment.wait().unwrap();
    let place = temporary.display().to_string();
    eventually("the last process to be gone", || {
        let entries = fs::read_dir("/proc").unwrap().flatten();
        let mut lines =
            entries.map(|entry| fs::read(entry.path().join("cmdline")).unwrap_or_default());
        let is_any = lines.any(|line| String::from_utf8_lossy(&line).contains(&place));
        (!is_any).then_some(())
    });
}
