//! What an experiment costs beside its simulation: runs of the hall with all that an experiment does for each of them, and the
//! same runs in a bare loop, in turn. Processor time is compared, so that other programs at work matter little.
//!
//!     cargo run --release -p experiments --example harness -- [ROUNDS]

#![expect(clippy::print_stdout, reason = "a measurement prints its figures")]

use std::error::Error;
use std::path::Path;

use config::Changes;
use experiments::engine::{self, EngineOptions, Queue};
use experiments::{Experiment, Launches, Plan, Request, Robots, Store};
use lab::run::Local;
use protocol::RunName;
use scenario::Scenario;
use statistics::Estimate;

/// Runs of each round.
const RUNS: u64 = 24;
/// Rounds, unless the command line names another number.
const ROUNDS: usize = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let rounds = std::env::args()
        .nth(1)
        .map_or(Ok(ROUNDS), |text| text.parse());
    let rounds: usize = rounds?;
    let mut experiment = Experiment::find(Path::new("deadlock"))?;
    experiment.seeds = (1..=RUNS).collect();
    let scenario = experiment.scenario.clone();
    let plan = Plan::new(&Request {
        name: "harness".to_owned(),
        experiment,
        set: Vec::new(),
        robots: Robots::InProcess,
        own: None,
    })?;

    let mut bare = Vec::new();
    let mut measured = Vec::new();
    let mut costs = Vec::new();
    for round in 0..=rounds {
        let bare_s = play_bare(&scenario)?;
        let measured_s = play(&plan)?;
        // The first round warms the machine up.
        if round > 0 {
            bare.push(RUNS as f64 / bare_s);
            measured.push(RUNS as f64 / measured_s);
            costs.push((measured_s / bare_s - 1.0) * 100.0);
        }
    }

    let runs = |rates: &[f64]| {
        format!(
            "{} runs of 600 s per second and core",
            Estimate::mean(rates)
        )
    };
    println!("bare loop:  {}", runs(&bare));
    println!("experiment: {}", runs(&measured));
    println!(
        "cost: {} %, {rounds} rounds of {RUNS} runs",
        Estimate::mean(&costs)
    );
    Ok(())
}

/// Processor time of this process so far, also of threads that have ended, seconds.
fn processor_s() -> Result<f64, Box<dyn Error>> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields);
    // proc(5): utime and stime are fields 14 and 15, in clock ticks of 10 ms; the first one here is the third.
    let mut ticks = 0.0;
    for field in fields.split_whitespace().skip(11).take(2) {
        ticks += field.parse::<f64>()?;
    }
    Ok(ticks / 100.0)
}

/// Seconds for the runs in a loop without anything else: the arm "emotions" without loss.
fn play_bare(scenario: &std::path::Path) -> Result<f64, Box<dyn Error>> {
    let run = RunName::new("bare")?;
    let begun_s = processor_s()?;
    for seed in 1..=RUNS {
        let mut set = Vec::new();
        for change in [
            "robot.Butler.params.policy=emotion",
            "robot.Leguin.params.policy=emotion",
            "robot.Butler.params.resend=on",
            "network.commands={ loss = 0.0 }",
        ] {
            set.push(change.parse()?);
        }
        let changes = Changes {
            seed: Some(seed),
            duration_s: Some(600.0),
            set,
            ..Changes::default()
        };
        let mut local = Local::new(Scenario::load(scenario, &changes)?, &run)?;
        local.simulation.init(&mut local.robots)?;
        while !local.simulation.is_over() {
            local.simulation.step(&mut local.robots)?;
        }
    }
    Ok(processor_s()? - begun_s)
}

/// Seconds for the same runs as the first units of an experiment, from an empty folder to the last line.
fn play(plan: &Plan) -> Result<f64, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let options = EngineOptions {
        units: 0..RUNS as usize,
        jobs: 1,
        retries_failed: false,
    };
    let begun_s = processor_s()?;
    plan.save(folder.path())?;
    let mut store = Store::open(folder.path())?;
    let mut queue = Queue::of(plan, &store, &options);
    engine::play(
        plan,
        folder.path(),
        &mut store,
        &mut queue,
        &options,
        &Launches::none(),
        &|| {},
    )?;
    Ok(processor_s()? - begun_s)
}
