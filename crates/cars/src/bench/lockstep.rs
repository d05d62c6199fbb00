//! The lock-step of this project, measured with the programs of a build. Scenarios are written here, so that another build
//! runs the same ones.

use std::path::{Path, PathBuf};
use std::process::Command;

use miette::{IntoDiagnostic, WrapErr};
use serde::Deserialize;
use simulator::recorder::SUMMARY;

use super::Bench;
use super::programs::{Processes, Programs, free_endpoint};

/// Name of each run.
const RUN: &str = "bench";
/// Length of a tick in the scenarios below, s.
const TICK_S: f64 = 0.5;
/// Distance between robots that only answer, m: farther than they sense each other (6 ft).
const APART_M: usize = 3;
/// Side of the square in which a Butler and his Leguin work, m.
const ROOM_M: usize = 8;

/// The lock-step with robots that only answer.
pub(super) fn bare(bench: &Bench<'_>, programs: &Programs, robots: usize) -> miette::Result<f64> {
    let ticks = bench.ticks_with(robots);
    let scenario = write(bench, &bare_scenario(robots))?;
    let mut commands = Vec::new();
    for number in 0..robots {
        let mut command = programs.command("cars");
        command.args(["bench-robot", "--name", &format!("r{number}")]);
        commands.push(command);
    }

    let duration_s = ticks as f64 * TICK_S;

    as_processes(bench, programs, &scenario, duration_s, commands)
}

fn bare_scenario(robots: usize) -> String {
    let columns = side_of_square(robots);
    let field_m = APART_M * (columns + 1);
    let mut text = format!(
        "tick = \"{TICK_S} s\"\n\
         [field]\n\
         size = [\"{field_m} m\", \"{field_m} m\"]\n"
    );

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

/// Pairs of a Butler and his Leguin. Nothing is set but who belongs to whom.
pub(super) fn crowd(bench: &Bench<'_>, programs: &Programs, robots: usize) -> miette::Result<f64> {
    let ticks = bench.ticks_with(robots);
    let scenario = write(bench, &crowd_scenario(robots / 2))?;
    let mut commands = Vec::new();
    for number in 0..robots / 2 {
        for class in ["Butler", "Leguin"] {
            commands.push(robot(programs, class, &format!("{class}{number}")));
        }
    }

    let duration_s = ticks as f64 * TICK_S;

    as_processes(bench, programs, &scenario, duration_s, commands)
}

fn crowd_scenario(pairs: usize) -> String {
    let columns = side_of_square(pairs);
    let field_m = ROOM_M * columns;
    let mut text = format!(
        "tick = \"{TICK_S} s\"\n\
         [field]\n\
         size = [\"{field_m} m\", \"{field_m} m\"]\n"
    );

    for number in 0..pairs {
        let left_m = ROOM_M * (number % columns);
        let bottom_m = ROOM_M * (number / columns);
        text += &format!(
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
        );
    }

    text
}

/// Columns of a square with room for so many.
fn side_of_square(count: usize) -> usize {
    (1..).find(|side| side * side >= count).unwrap_or(count)
}

/// The hall, a process for each robot.
pub(super) fn hall(bench: &Bench<'_>, programs: &Programs) -> miette::Result<f64> {
    let mut commands = Vec::new();
    for (name, spec) in &bench.hall.robots {
        commands.push(robot(programs, &spec.class, name.as_str()));
    }
    let duration_s = hall_duration_s(bench);
    as_processes(bench, programs, bench.hall_file, duration_s, commands)
}

/// The hall in one process.
pub(super) fn hall_in_one_process(bench: &Bench<'_>, programs: &Programs) -> miette::Result<f64> {
    let duration_s = hall_duration_s(bench);
    let mut command = programs.command("cars");
    command.arg("run").arg(bench.hall_file).arg("--quiet");
    execute(bench, &mut command, duration_s, Vec::new())
}

fn hall_duration_s(bench: &Bench<'_>) -> f64 {
    let ticks = bench.ticks / 2;
    ticks as f64 * bench.hall.tick_s
}

/// The program of a shipped class.
fn robot(programs: &Programs, class: &str, name: &str) -> Command {
    let mut command = programs.command(&format!("cars-{}", class.to_lowercase()));
    command.args(["--name", name]);
    command
}

/// Ticks per second of a simulator and robots as processes.
fn as_processes(
    bench: &Bench<'_>,
    programs: &Programs,
    scenario: &Path,
    duration_s: f64,
    robots: Vec<Command>,
) -> miette::Result<f64> {
    let endpoint = free_endpoint()?;
    let mut simulator = programs.command("cars-sim");
    simulator.arg(scenario).args(["--listen", &endpoint]);
    let mut commands = Vec::new();
    for mut robot in robots {
        robot.env("CARS_RUN", RUN).env("CARS_CONNECT", &endpoint);
        commands.push(robot);
    }

    execute(bench, &mut simulator, duration_s, commands)
}

/// Runs a simulation and its robots to the end, and returns ticks per second as the simulation measured them.
fn execute(
    bench: &Bench<'_>,
    simulation: &mut Command,
    duration_s: f64,
    robots: Vec<Command>,
) -> miette::Result<f64> {
    simulation
        .args(["--run", RUN, "--duration", &format!("{duration_s} s")])
        .arg("--out")
        .arg(bench.scratch);
    let mut processes = Processes::default();
    processes.start(simulation)?;
    for mut robot in robots {
        processes.start(&mut robot)?;
    }
    processes.wait()?;

    let folder = bench.scratch.join(RUN);
    let summary = read_summary(&folder.join(SUMMARY))?;
    std::fs::remove_dir_all(&folder).into_diagnostic()?;
    Ok(summary.ticks as f64 / summary.wall.elapsed_s)
}

/// What is read of a summary: no more than any build writes.
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
    let text = std::fs::read_to_string(file)
        .into_diagnostic()
        .wrap_err_with(|| format!("reading {}", file.display()))?;
    serde_json::from_str(&text)
        .into_diagnostic()
        .wrap_err_with(|| format!("reading {}", file.display()))
}

fn write(bench: &Bench<'_>, scenario: &str) -> miette::Result<PathBuf> {
    let file = bench.scratch.join("scenario.toml");
    std::fs::write(&file, scenario)
        .into_diagnostic()
        .wrap_err_with(|| format!("writing {}", file.display()))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use simulator::Scenario;
    use simulator::diagnostic::Source;

    use super::*;

    fn parsed(text: String) -> Scenario {
        let source = Source {
            name: "scenario.toml".to_owned(),
            text,
        };
        Scenario::parse(&source, Path::new(".")).unwrap()
    }

    #[test]
    fn robots_that_only_answer_do_not_sense_each_other() {
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
        let of_class = |class: &str| {
            let robots = scenario.robots.values();
            robots.filter(|robot| robot.class == class).count()
        };
        assert_eq!((of_class("Butler"), of_class("Leguin")), (32, 32));
    }
}
