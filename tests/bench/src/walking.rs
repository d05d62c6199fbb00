//! `cars-bench crowd`: agent-steps per second of crowds of the same density.

use std::process::ExitCode;
use std::thread::available_parallelism;
use std::time::Instant;

use clap::Args;
use crowd::{
    CollisionFree, Itinerary, Pedestrian, Pedestrians, Premises, SocialForce, Vector, WalkingModel,
};
use miette::IntoDiagnostic;

/// Agent-steps of one measurement: a second or so.
const AGENT_STEPS: u64 = 4_000_000;
/// Distance between people at first, m: 1 person per m².
const SPACING_M: f64 = 1.0;

/// `cars-bench crowd`.
#[derive(Debug, Args)]
pub(crate) struct WalkingArgs {
    /// Numbers of people.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "1000,10000,100000,1000000",
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    people: Vec<u64>,
    /// Number of threads; without it the number of processors.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    threads: Option<u64>,
    /// Number of rounds; the best one counts, because the machine may be busy.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    rounds: u64,
}

/// Measures all models and prints a table.
pub(crate) fn measure(args: &WalkingArgs) -> miette::Result<ExitCode> {
    let threads = match args.threads {
        Some(threads) => threads as usize,
        None => available_parallelism().map_or(1, usize::from),
    };
    let mut rows = Vec::new();
    for people in &args.people {
        let mut best = [0.0_f64; 3];
        for _ in 0..args.rounds {
            let rates = [
                rate(CollisionFree::published(), *people, threads)?,
                rate(CollisionFree::default(), *people, threads)?,
                rate(SocialForce::default(), *people, threads)?,
            ];
            for (best, rate) in best.iter_mut().zip(rates) {
                *best = best.max(rate);
            }
        }
        let mut row = vec![people.to_string()];
        row.extend(best.map(|rate| format!("{:.2}", rate / 1e6)));
        rows.push(row);
    }

    let head = [
        "people",
        "collision-free, published",
        "calibrated",
        "social force",
    ];
    let table = terminal::table(head, rows, 1, 0);
    terminal::print_line(format_args!(
        "{table}\nMillions of agent-steps per second, {threads} threads, the best of {} rounds.",
        args.rounds
    ))
    .into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}

/// Agent-steps per second of people on a square, 1 person per m², half of whom walk to the right and half up.
fn rate<M: WalkingModel>(model: M, people: u64, threads: usize) -> miette::Result<f64> {
    let step_s = model.longest_step_s();
    let radius_m = model.body_radius_m();
    let mut crowd = Pedestrians::new(model, &Premises::default()).into_diagnostic()?;
    for direction in [Vector::new(1.0, 0.0), Vector::new(0.0, 1.0)] {
        crowd
            .add_itinerary(Itinerary::along(direction))
            .into_diagnostic()?;
    }
    let columns = (people as f64).sqrt().ceil() as u64;
    for index in 0..people {
        let place = Vector::new((index % columns) as f64, (index / columns) as f64) * SPACING_M;
        let person = Pedestrian {
            radius_m,
            itinerary: (index / columns / 10 % 2) as u16,
            desired_mps: 1.0 + 0.1 * (index % 7) as f64,
            ..Pedestrian::at(place)
        };
        crowd.add(person).into_diagnostic()?;
    }

    // Buffers are made in the first step.
    crowd.step(step_s, threads);
    let steps = (AGENT_STEPS / people).max(2);
    let begin = Instant::now();
    for _ in 0..steps {
        crowd.step(step_s, threads);
    }
    Ok((steps * people) as f64 / begin.elapsed().as_secs_f64())
}
