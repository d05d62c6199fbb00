//! `cars-bench`, for developers: ticks per second of the lock-step, and of two floors on the same machine in the same sitting: a
//! bare zenoh star, with and without the messages of the protocol, and a raw TCP barrier.

mod lockstep;
mod programs;
mod results;
mod robot;
mod star;
mod subject;
mod table;
mod tcp;
mod walking;
mod workload;

use std::ffi::OsString;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use ::robot::RobotArgs;
use clap::{Args, Parser, Subcommand};
use config::shipped::{self, SCENARIOS};
use launch::child::{AtExit, become_program};
use miette::{IntoDiagnostic, WrapErr, miette};
use scenario::{Changes, Scenario};

use programs::Programs;
use results::Results;
use subject::{CROWD, HallPlace, Subject};
use workload::Workload;

/// Ticks per second of the lock-step and of the hall, beside a bare zenoh star and a raw TCP barrier.
#[derive(Debug, Parser)]
#[command(name = "cars-bench", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(flatten)]
    bench: BenchArgs,
    #[command(subcommand)]
    process: Option<Process>,
}

/// A process of a measurement, or a measurement of its own.
#[derive(Debug, Subcommand)]
enum Process {
    /// An idle robot of the bare lock-step.
    #[command(hide = true)]
    Robot(RobotArgs),
    /// Becomes a program that is killed when the process `parent` exits: see `launch::child`.
    #[command(hide = true)]
    Child {
        parent: i32,
        #[arg(last = true, required = true)]
        command: Vec<OsString>,
    },
    #[command(hide = true)]
    Echo(tcp::EchoArgs),
    #[command(hide = true)]
    Star(star::StarArgs),
    #[command(hide = true)]
    StarClient(star::ClientArgs),
    /// Measures crowds: agent-steps per second by number of people.
    Crowd(walking::WalkingArgs),
}

#[derive(Debug, Args)]
struct BenchArgs {
    /// Number of rounds; each round measures every subject once.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    rounds: u64,
    /// Numbers of robot processes for the bare lock-step and its floor.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "2,4,16,64",
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
    robots: Vec<u64>,
    /// Scenario of the hall.
    #[arg(long, default_value = "hors_doeuvres", value_name = "FILE")]
    scenario: PathBuf,
    /// Ticks of a measurement with two processes; more processes do fewer.
    #[arg(long, default_value_t = 20_000, value_name = "N")]
    ticks: u64,
    /// A folder with another build of all programs, to compare this build with.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// Secure every run with certificates. The floors stay plain.
    #[arg(long)]
    secured: bool,
    /// Measure only the subjects with this text in their names, and their floors.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
}

fn main() -> ExitCode {
    let cli: Cli = match terminal::arguments() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    terminal::print_diagnostics("warn,zenoh=error");

    let result = match cli.process {
        None => bench(&cli.bench),
        Some(Process::Robot(args)) => robot::take_part(&args),
        Some(Process::Child { parent, command }) => {
            let Err(error) = become_program(parent, AtExit::Kill, &command);
            Err(error).into_diagnostic()
        }
        Some(Process::Echo(args)) => tcp::echo(&args),
        Some(Process::Star(args)) => star::router(&args),
        Some(Process::StarClient(args)) => star::client(&args),
        Some(Process::Crowd(args)) => walking::measure(&args),
    };
    result.unwrap_or_else(|error| {
        terminal::note(format_args!("Error: {error:?}"));
        ExitCode::FAILURE
    })
}

/// Measures every subject in each round and prints a table.
fn bench(args: &BenchArgs) -> miette::Result<ExitCode> {
    // A new folder with a random name, for this user alone: nothing that is there already is followed.
    let scratch = tempfile::Builder::new()
        .permissions(Permissions::from_mode(0o700))
        .tempdir()
        .into_diagnostic()
        .wrap_err("making a temporary folder")?;
    let outcome = measure_all(args, scratch.path());
    scratch.close().into_diagnostic()?;

    table::print(&outcome?).into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}

fn measure_all(args: &BenchArgs, scratch: &Path) -> miette::Result<Vec<Results>> {
    let here = Programs::of_this_build()?;
    let there = args.against.as_deref().map(Programs::of).transpose()?;
    let hall_file = shipped::find(&args.scenario, &[SCENARIOS]);
    let workload = Workload {
        hall: Scenario::load(&hall_file, &Changes::default())?,
        hall_file: &hall_file,
        ticks: args.ticks,
        is_secured: args.secured,
        scratch,
    };

    let mut all = Vec::new();
    for subject in plan(args, workload.hall.robots.len())? {
        all.push(Results::of(subject));
    }

    for round in 0..args.rounds {
        for results in &mut all {
            let number = round + 1;
            terminal::note(format_args!(
                "round {number} of {}: {}",
                args.rounds, results.subject
            ));
            let is_other_first = round % 2 == 1;
            measure_once(&workload, results, &here, there.as_ref(), is_other_first)?;
        }
    }
    Ok(all)
}

/// Measures a subject once with each build. Which build is first alternates between rounds, because the second one runs
/// on a machine that the first one has warmed up.
fn measure_once(
    workload: &Workload<'_>,
    results: &mut Results,
    here: &Programs,
    there: Option<&Programs>,
    is_other_first: bool,
) -> miette::Result<()> {
    let subject = results.subject;
    let there = there.filter(|_| subject.runs_the_project());

    if let Some(there) = there.filter(|_| is_other_first) {
        results.there.push(measure(subject, workload, there)?);
    }
    results.here.push(measure(subject, workload, here)?);
    if let Some(there) = there.filter(|_| !is_other_first) {
        results.there.push(measure(subject, workload, there)?);
    }

    Ok(())
}

/// Ticks per second of a subject with the programs of one build.
fn measure(subject: Subject, workload: &Workload<'_>, programs: &Programs) -> miette::Result<f64> {
    match subject {
        Subject::Tcp { processes } => tcp::measure(processes, workload.ticks_with(processes)),
        Subject::Star { clients, content } => {
            star::measure(clients, content, workload.ticks_with(clients))
        }
        Subject::Lockstep { robots } => lockstep::bare(workload, programs, robots),
        Subject::Crowd { robots } => lockstep::crowd(workload, programs, robots),
        Subject::Hall { place, .. } => match place {
            HallPlace::Processes => lockstep::hall(workload, programs),
            HallPlace::OneProcess => lockstep::hall_in_one_process(workload, programs),
        },
    }
}

/// The subjects to measure, each after its floors and once.
fn plan(args: &BenchArgs, robots_of_hall: usize) -> miette::Result<Vec<Subject>> {
    let mut wanted = all_subjects(args, robots_of_hall)?;
    if let Some(text) = &args.only {
        wanted.retain(|subject| subject.to_string().contains(text));
    }
    if wanted.is_empty() {
        return Err(miette!(
            help = "leave --only out to see the names of all subjects",
            "no subject has this text in its name"
        ));
    }

    let mut plan = Vec::new();
    for subject in wanted {
        let floors = [
            subject.second_floor(),
            subject.floor(),
            subject.message_floor(),
        ];
        for step in floors.into_iter().chain([Some(subject)]) {
            plan.extend(step.filter(|step| !plan.contains(step)));
        }
    }
    Ok(plan)
}

fn all_subjects(args: &BenchArgs, robots_of_hall: usize) -> miette::Result<Vec<Subject>> {
    let mut subjects = Vec::new();
    for robots in &args.robots {
        let robots = usize::try_from(*robots).into_diagnostic()?;
        subjects.push(Subject::Lockstep { robots });
    }

    subjects.push(Subject::Crowd { robots: CROWD });
    for place in [HallPlace::Processes, HallPlace::OneProcess] {
        subjects.push(Subject::Hall {
            robots: robots_of_hall,
            place,
        });
    }
    Ok(subjects)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(line: &[&str]) -> Vec<String> {
        let words = ["bench"].iter().chain(line);
        let args = Cli::try_parse_from(words).unwrap().bench;
        let subjects = plan(&args, 2).unwrap();
        subjects.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn every_subject_comes_once_and_after_its_floors() {
        let names = names(&[]);
        assert_eq!(names.len(), 1 + 4 + 4 + 4 + 1 + 2, "{names:?}");

        let place = |name: &str| names.iter().position(|other| other == name).unwrap();

        for (floor, subject) in [
            ("raw TCP barrier, 2 processes", "zenoh star, 2 clients"),
            (
                "zenoh star, 2 clients",
                "zenoh star with messages, 2 clients",
            ),
            (
                "zenoh star with messages, 2 clients",
                "bare lock-step, 2 robots",
            ),
            ("zenoh star, 64 clients", "bare lock-step, 64 robots"),
            ("zenoh star, 64 clients", "Butlers and Leguins, 64 robots"),
            ("zenoh star, 2 clients", "the hall, as processes"),
        ] {
            assert!(
                place(floor) < place(subject),
                "{floor}, {subject}: {names:?}"
            );
        }
    }

    #[test]
    fn only_the_subjects_asked_for_and_their_floors_are_measured() {
        assert_eq!(
            names(&["--only", "16 robots"]),
            [
                "zenoh star, 16 clients",
                "zenoh star with messages, 16 clients",
                "bare lock-step, 16 robots"
            ]
        );
    }
}
