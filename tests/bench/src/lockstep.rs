//! Measures the lock-step with the programs of a build. The scenarios are generated here, so two builds run the same ones.

use std::path::{Path, PathBuf};
use std::process::Command;

use launch::Certificates;
use miette::{IntoDiagnostic, WrapErr};
use protocol::RobotName;
use record::names::SUMMARY;
use serde::Deserialize;

use crate::programs::{Processes, Programs, free_endpoint};
use crate::workload::Workload;

/// Name of each run.
const RUN: &str = "bench";
/// Length of a tick in the scenarios below, s.
const TICK_S: f64 = 0.5;
/// Distance between idle robots, m; greater than the sensing range (6 ft).
const APART_M: usize = 3;
/// Side of the square room of a Butler and his Leguin, m.
const ROOM_M: usize = 8;

/// Ticks per second of the lock-step with idle robots.
pub(crate) fn bare(
    workload: &Workload<'_>,
    programs: &Programs,
    robots: usize,
) -> miette::Result<f64> {
    let scenario = write(workload, &bare_scenario(robots))?;
    let mut commands = Vec::new();
    for number in 0..robots {
        let name = format!("r{number}");
        let mut command = programs.command("cars-bench");
        command.args(["robot", "--name", &name]);
        commands.push((name, command));
    }

    let duration_s = duration_s(workload, robots);
    as_processes(workload, programs, &scenario, duration_s, commands)
}

fn bare_scenario(robots: usize) -> String {
    let columns = side_of_square(robots);
    let field_m = APART_M * (columns + 1);
    let mut text = scenario_head(field_m);

    for number in 0..robots {
        let x = APART_M * (1 + number % columns);
        let y = APART_M * (1 + number / columns);
        text += &format!(
            "[[robot]]\n\
             name = \"r{number}\"\n\
             at = [\"{x} m\", \"{y} m\"]\n"
        );
    }

    text
}

/// Ticks per second of pairs of a Butler and his Leguin.
pub(crate) fn crowd(
    workload: &Workload<'_>,
    programs: &Programs,
    robots: usize,
) -> miette::Result<f64> {
    let scenario = write(workload, &crowd_scenario(robots / 2))?;
    let mut commands = Vec::new();
    for number in 0..robots / 2 {
        for class in ["Butler", "Leguin"] {
            let name = format!("{class}{number}");
            let command = robot(programs, class, &name);
            commands.push((name, command));
        }
    }

    let duration_s = duration_s(workload, robots);

    as_processes(workload, programs, &scenario, duration_s, commands)
}

fn crowd_scenario(pairs: usize) -> String {
    let columns = side_of_square(pairs);
    let field_m = ROOM_M * columns;
    let mut text = scenario_head(field_m);

    for number in 0..pairs {
        let left_m = ROOM_M * (number % columns);
        let bottom_m = ROOM_M * (number / columns);
        text += &pair(number, left_m, bottom_m);
    }

    text
}

/// A Butler and his Leguin in the room whose lower left corner is given.
fn pair(number: usize, left_m: usize, bottom_m: usize) -> String {
    format!(
        "[[robot]]\n\
         name = \"Butler{number}\"\n\
         class = \"Butler\"\n\
         at = [\"{} m\", \"{} m\"]\n\
         params = {{ refiller = \"Leguin{number}\" }}\n\
         [[robot]]\n\
         name = \"Leguin{number}\"\n\
         class = \"Leguin\"\n\
         at = [\"{} m\", \"{} m\"]\n\
         params = {{ waiter = \"Butler{number}\" }}\n",
        left_m + 5,
        bottom_m + 5,
        left_m + 2,
        bottom_m + 2,
    )
}

/// Length of a measurement with this number of processes, simulated seconds.
fn duration_s(workload: &Workload<'_>, processes: usize) -> f64 {
    workload.ticks_with(processes) as f64 * TICK_S
}

/// Tick and field, the side of which is given in m.
fn scenario_head(field_m: usize) -> String {
    format!(
        "tick = \"{TICK_S} s\"\n\
         [field]\n\
         size = [\"{field_m} m\", \"{field_m} m\"]\n"
    )
}

/// Columns of the smallest square with room for this many.
fn side_of_square(count: usize) -> usize {
    (1..).find(|side| side * side >= count).unwrap_or(count)
}

/// Ticks per second of the hall with a process for each robot.
pub(crate) fn hall(workload: &Workload<'_>, programs: &Programs) -> miette::Result<f64> {
    let mut commands = Vec::new();
    for (name, spec) in &workload.hall.robots {
        let command = robot(programs, &spec.class, name.as_str());
        commands.push((name.to_string(), command));
    }
    let duration_s = hall_duration_s(workload);
    as_processes(workload, programs, workload.hall_file, duration_s, commands)
}

/// Ticks per second of the hall in one process.
pub(crate) fn hall_in_one_process(
    workload: &Workload<'_>,
    programs: &Programs,
) -> miette::Result<f64> {
    let duration_s = hall_duration_s(workload);
    let mut command = programs.command("cars");
    command.arg("run").arg(workload.hall_file).arg("--quiet");
    execute(workload, &mut command, duration_s, Vec::new())
}

fn hall_duration_s(workload: &Workload<'_>) -> f64 {
    let ticks = workload.ticks / 2;
    ticks as f64 * workload.hall.tick_s
}

/// The program of a shipped class.
fn robot(programs: &Programs, class: &str, name: &str) -> Command {
    let mut command = programs.command(&format!("cars-{}", class.to_lowercase()));
    command.args(["--name", name]);
    command
}

/// Ticks per second of a simulator and robots as processes; the robots come with their names.
fn as_processes(
    workload: &Workload<'_>,
    programs: &Programs,
    scenario: &Path,
    duration_s: f64,
    robots: Vec<(String, Command)>,
) -> miette::Result<f64> {
    let certificates = if workload.is_secured {
        Some(make_certificates(workload, &robots)?)
    } else {
        None
    };
    let endpoint = free_endpoint(workload.is_secured)?;
    let mut simulator = programs.command("cars-sim");
    simulator.arg(scenario).args(["--listen", &endpoint]);
    secure(&mut simulator, certificates.as_ref(), "simulator");

    let mut commands = Vec::new();
    for (name, mut robot) in robots {
        robot.env("CARS_RUN", RUN).env("CARS_CONNECT", &endpoint);
        secure(&mut robot, certificates.as_ref(), &name);
        commands.push(robot);
    }

    execute(workload, &mut simulator, duration_s, commands)
}

/// Makes certificates for these robots.
fn make_certificates(
    workload: &Workload<'_>,
    robots: &[(String, Command)],
) -> miette::Result<Certificates> {
    let mut names = Vec::new();
    for (name, _) in robots {
        names.push(RobotName::new(name).into_diagnostic()?);
    }

    let certificates = Certificates {
        folder: workload.scratch.join("certificates"),
        robots: names,
        hosts: Vec::new(),
        days: 1,
        run: None,
        replaces: true,
    };
    certificates.make().into_diagnostic()?;
    Ok(certificates)
}

/// Gives a process the configuration file with its certificate.
fn secure(process: &mut Command, certificates: Option<&Certificates>, name: &str) {
    if let Some(certificates) = certificates {
        process.env("CARS_ZENOH_CONFIG", certificates.config_of(name));
    }
}

/// Runs a simulation and its robots to the end. Returns ticks per second as measured by the simulation.
fn execute(
    workload: &Workload<'_>,
    simulation: &mut Command,
    duration_s: f64,
    robots: Vec<Command>,
) -> miette::Result<f64> {
    simulation
        .args(["--run", RUN, "--duration", &format!("{duration_s} s")])
        // A run of any length is measured; what a scenario expects of a whole one is no failure of a part.
        .args(["--set", "expect=[]"])
        .arg("--out")
        .arg(workload.scratch);
    let mut processes = Processes::default();
    processes.start(simulation)?;
    for mut robot in robots {
        processes.start(&mut robot)?;
    }
    processes.wait()?;

    let folder = workload.scratch.join(RUN);
    let summary = read_summary(&folder.join(SUMMARY))?;
    std::fs::remove_dir_all(&folder).into_diagnostic()?;
    Ok(summary.ticks as f64 / summary.wall.elapsed_s)
}

/// The fields of a summary that every build writes.
#[derive(Debug, Deserialize)]
struct Measured {
    ticks: u64,
    wall: Wall,
}

#[derive(Debug, Deserialize)]
struct Wall {
    elapsed_s: f64,
}

fn read_summary(file: &Path) -> miette::Result<Measured> {
    std::fs::read_to_string(file)
        .into_diagnostic()
        .and_then(|text| serde_json::from_str(&text).into_diagnostic())
        .wrap_err_with(|| format!("reading {}", file.display()))
}

fn write(workload: &Workload<'_>, scenario: &str) -> miette::Result<PathBuf> {
    let file = workload.scratch.join("scenario.toml");
    std::fs::write(&file, scenario)
        .into_diagnostic()
        .wrap_err_with(|| format!("writing {}", file.display()))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use scenario::Scenario;
    use scenario::diagnostic::Source;

    use super::*;

    fn parsed(text: String) -> Scenario {
        let source = Source {
            name: "scenario.toml".to_owned(),
            text,
        };
        Scenario::parse(&source, Path::new(".")).unwrap()
    }

    #[test]
    fn idle_robots_do_not_sense_each_other() {
        for count in [1, 2, 4, 16, 64, 100] {
            let scenario = parsed(bare_scenario(count));
            assert_eq!(scenario.robots.len(), count);
            let places: Vec<_> = scenario.robots.values().map(|robot| robot.at).collect();
            for (i, place) in places.iter().enumerate() {
                for other in &places[..i] {
                    assert!(
                        place.distance_m(*other) >= 3.0,
                        "{count} robots: {places:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn butlers_and_leguins_belong_together() {
        let scenario = parsed(crowd_scenario(32));
        for class in ["Butler", "Leguin"] {
            let robots = scenario.robots.values();
            let count = robots.filter(|robot| robot.class == class).count();
            assert_eq!(count, 32, "{class}");
        }
    }
}
