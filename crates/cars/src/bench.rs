//! `cars bench`: ticks per second of the project's barriers, interleaved in one sitting with what the same machine does
//! without the project: a bare zenoh star, and a raw TCP barrier.

mod floors;
mod lockstep;
mod programs;
pub(crate) mod robot;
pub(crate) mod star;
mod table;
pub(crate) mod tcp;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use simulator::scenario::{Changes, Scenario};

use floors::{CROWD, HallPlace, Subject};
use programs::Programs;

/// Size of the clock that the floors send out, bytes; about as long as a real one.
const CLOCK_BYTES: usize = 64;
/// Size of the report that comes back, bytes; about as long as a real one.
const REPORT_BYTES: usize = 300;
/// Fewest ticks of one measurement: with less, starting and ending would be measured as well.
const MIN_TICKS: u64 = 300;

/// `cars bench`.
#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// How often everything is measured, in turn.
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
    /// The hall that is measured.
    #[arg(
        long,
        default_value = "configs/hors_doeuvres.toml",
        value_name = "FILE"
    )]
    scenario: PathBuf,
    /// Ticks of a measurement with two processes; more processes do fewer.
    #[arg(long, default_value_t = 20_000, value_name = "N")]
    ticks: u64,
    /// A folder with another build of cars, cars-sim, cars-butler and cars-leguin, to compare this build with.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// Measure only what has this text in its name, and its floors.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
}

/// Everything that measurements share.
struct Bench<'a> {
    /// Scenario of the hall.
    hall_file: &'a Path,
    /// The same, as this build reads it.
    hall: Scenario,
    /// Ticks of a measurement with two processes.
    ticks: u64,
    /// Where scenarios and runs are kept until the end.
    scratch: &'a Path,
}

impl Bench<'_> {
    /// Ticks of a measurement with so many processes: all measurements take about as long.
    fn ticks_with(&self, processes: usize) -> u64 {
        (2 * self.ticks / processes as u64).max(MIN_TICKS)
    }
}

/// Results of one subject, ticks per second, by round.
struct Results {
    subject: Subject,
    /// With this build.
    here: Vec<f64>,
    /// With the build that it is compared with.
    there: Vec<f64>,
}

/// Measures everything in turn, as often as asked for, and prints a table.
pub(crate) fn bench(args: &BenchArgs) -> miette::Result<ExitCode> {
    let scratch = std::env::temp_dir().join(format!("cars-bench-{}", std::process::id()));
    std::fs::create_dir_all(&scratch)
        .into_diagnostic()
        .wrap_err_with(|| format!("making {}", scratch.display()))?;
    let outcome = measure(args, &scratch);
    std::fs::remove_dir_all(&scratch).into_diagnostic()?;

    table::print(&outcome?);
    Ok(ExitCode::SUCCESS)
}

fn measure(args: &BenchArgs, scratch: &Path) -> miette::Result<Vec<Results>> {
    let here = Programs::of_this_build()?;
    let there = args.against.as_deref().map(Programs::of).transpose()?;
    let bench = Bench {
        hall_file: &args.scenario,
        hall: Scenario::load(&args.scenario, &Changes::default())?,
        ticks: args.ticks,
        scratch,
    };

    let mut all = Vec::new();
    for subject in plan(args, bench.hall.robots.len())? {
        all.push(Results {
            subject,
            here: Vec::new(),
            there: Vec::new(),
        });
    }

    for round in 0..args.rounds {
        for results in &mut all {
            eprintln!(
                "round {} of {}: {}",
                round + 1,
                args.rounds,
                results.subject
            );
            measure_once(&bench, results, &here, there.as_ref(), round % 2 == 1)?;
        }
    }
    Ok(all)
}

/// Measures a subject once with each build. Which build is first changes from round to round: the second one finds
/// a machine that the first one has warmed.
fn measure_once(
    bench: &Bench<'_>,
    results: &mut Results,
    here: &Programs,
    there: Option<&Programs>,
    is_other_first: bool,
) -> miette::Result<()> {
    let there = there.filter(|_| results.subject.is_of_the_project());
    if let Some(there) = there.filter(|_| is_other_first) {
        results.there.push(results.subject.measure(bench, there)?);
    }

    results.here.push(results.subject.measure(bench, here)?);

    if let Some(there) = there.filter(|_| !is_other_first) {
        results.there.push(results.subject.measure(bench, there)?);
    }

    Ok(())
}

/// What is measured, each subject after its floors.
fn plan(args: &BenchArgs, robots_of_hall: usize) -> miette::Result<Vec<Subject>> {
    let mut wanted = Vec::new();
    for robots in &args.robots {
        let robots = usize::try_from(*robots).into_diagnostic()?;
        wanted.push(Subject::Lockstep { robots });
    }
    wanted.push(Subject::Crowd { robots: CROWD });
    for place in [HallPlace::Processes, HallPlace::OneProcess] {
        wanted.push(Subject::Hall {
            robots: robots_of_hall,
            place,
        });
    }

    if let Some(text) = &args.only {
        wanted.retain(|subject| subject.to_string().contains(text));
    }
    if wanted.is_empty() {
        return Err(miette!(
            help = "leave --only out to see the names of all subjects",
            "nothing has this text in its name"
        ));
    }

    let mut plan = Vec::new();
    for subject in wanted {
        for step in [subject.second_floor(), subject.floor(), Some(subject)] {
            plan.extend(step.filter(|step| !plan.contains(step)));
        }
    }
    Ok(plan)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        bench: BenchArgs,
    }

    fn names(line: &[&str]) -> Vec<String> {
        let words = ["bench"].iter().chain(line);
        let args = Line::try_parse_from(words).unwrap().bench;
        let subjects = plan(&args, 2).unwrap();
        subjects.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn every_subject_comes_once_and_after_its_floors() {
        let names = names(&[]);
        assert_eq!(names.len(), 1 + 4 + 4 + 1 + 2, "{names:?}");

        let place = |name: &str| names.iter().position(|other| other == name).unwrap();

        for (floor, subject) in [
            ("raw TCP barrier, 2 processes", "zenoh star, 2 clients"),
            ("zenoh star, 2 clients", "bare lock-step, 2 robots"),
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
    fn what_is_left_out_takes_its_floor_along() {
        assert_eq!(
            names(&["--only", "16 robots"]),
            ["zenoh star, 16 clients", "bare lock-step, 16 robots"]
        );
    }
}
