//! Deterministic simulation of the lock-step: the real [`lockstep::Barrier`] with the real [`environment::Simulation`], and real
//! [`lockstep::Participant`]s with real robots, over a simulated star with simulated time. What happens to links, processes
//! and the operator is drawn from a seed, in one thread, so that a seed that fails fails every time.
//!
//! `CARS_SCHEDULES=5000` executes more of them, `CARS_SCHEDULE_SEED=17` one alone.

#![expect(clippy::print_stdout, reason = "a test prints what it measures")]
#![expect(
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

mod again;
mod chance;
mod hall;
mod plan;
mod planned;
mod process;
mod reference;
mod simulator;
mod star;
mod world;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use hall::{Halls, halls};
use plan::{Family, Flaw, Plan};
use world::{Came, Counts, Failure, World};

/// How many schedules, or the only one that is wanted.
fn seeds(default: u64) -> std::ops::Range<u64> {
    if let Some(seed) = number("CARS_SCHEDULE_SEED") {
        return seed..seed + 1;
    }

    0..number("CARS_SCHEDULES").unwrap_or(default)
}

pub(crate) fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;

    Some(text.parse().expect("a number"))
}

/// Executes a schedule for each seed, until one of them is what is looked for; each is single-threaded, and several run at the
/// same time.
fn explore(
    seeds: std::ops::Range<u64>,
    halls: &Arc<Halls>,
    flaw: Flaw,
    is_wanted: fn(&Came) -> bool,
) -> BTreeMap<u64, Came> {
    let next = AtomicU64::new(seeds.start);
    let found = Mutex::new(BTreeMap::new());
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if !seeds.contains(&seed) {
                        return;
                    }
                    let mut plan = Plan::draw(seed, halls);
                    plan.flaw = flaw;
                    let came = World::execute(plan, halls);
                    if is_wanted(&came) {
                        next.store(seeds.end, Ordering::Relaxed);
                    }
                    let mut found = found.lock().expect("no schedule panics");
                    found.insert(seed, came);
                }
            });
        }
    });

    found.into_inner().expect("no schedule panics")
}

/// The command that executes one schedule again.
fn again(seed: u64) -> String {
    format!(
        "CARS_SCHEDULE_SEED={seed} cargo test --release -p system-tests --test schedules every_schedule -- --nocapture"
    )
}

fn sum(found: &BTreeMap<u64, Came>) -> Counts {
    let mut counts = Counts::default();
    for came in found.values() {
        counts.add(&came.counts);
    }

    counts
}

#[test]
fn every_schedule_is_a_run_that_the_rules_allow() {
    let halls = halls();
    let wanted = seeds(400);
    let count = wanted.end - wanted.start;
    let begun = Instant::now();
    let found = explore(wanted, &halls, Flaw::None, |_| false);

    let counts = sum(&found);
    println!(
        "{count} schedules in {:.1} s: {counts:?}",
        begun.elapsed().as_secs_f64()
    );
    let mut failed = 0;
    for (seed, came) in &found {
        if let Some(failure) = &came.failure {
            failed += 1;
            if failed <= 5 {
                println!("seed {seed}: {failure:?}");
                println!("  {:?}", Plan::draw(*seed, &halls));
                println!("  again: {}", again(*seed));
            }
        }
    }
    assert_eq!(failed, 0, "{failed} of {count} schedules failed");
    assert_same_causes_are_same_runs(&found, &halls);

    let happened = [
        counts.cuts,
        counts.losses,
        counts.duplicates,
        counts.naps,
        counts.held_back,
        counts.crashes,
        counts.hangs,
        counts.stopped,
        counts.inits,
        counts.operator,
        counts.commands,
        counts.joined,
        counts.lost,
        counts.missed,
        counts.aborted,
        counts.first_ticks,
        counts.joined_and_missed,
        counts.forks,
    ];
    assert!(
        count < 400 || !happened.contains(&0),
        "not covered: {counts:?}"
    );
}

/// Where and when a process dies, or the scenario stops it, decides what the run becomes, and nothing else of the schedule
/// does.
fn assert_same_causes_are_same_runs(found: &BTreeMap<u64, Came>, halls: &Halls) {
    let mut runs: BTreeMap<_, BTreeMap<&str, Vec<u64>>> = BTreeMap::new();
    for (seed, came) in found {
        let plan = Plan::draw(*seed, halls);
        if matches!(plan.family, Family::Death | Family::Stopped) {
            let cause = (plan.hall, plan.death, plan.stop);
            let digests = runs.entry(cause).or_default();
            digests.entry(&came.digest).or_default().push(*seed);
        }
    }

    runs.retain(|_, digests| digests.len() > 1);
    assert!(
        runs.is_empty(),
        "the same cause gave different runs (digest, then seeds): {runs:#?}"
    );
}

#[test]
fn a_seed_replays_exactly() {
    let halls = halls();
    for seed in 0..20 {
        let once = World::execute(Plan::draw(seed, &halls), &halls);
        let again = World::execute(Plan::draw(seed, &halls), &halls);

        assert_eq!(once, again, "seed {seed}");
    }
}

/// The search finds a defect of the star or of the hosts' loop within so many seeds, as a run that does not go on.
fn assert_found(flaw: Flaw, most: u64) {
    let halls = halls();
    let is_stuck = |came: &Came| matches!(came.failure, Some(Failure::Stuck(_)));
    let found = explore(0..most, &halls, flaw, is_stuck);
    let stuck = found.iter().find(|(_, came)| is_stuck(came));
    let (seed, came) = stuck.unwrap_or_else(|| panic!("{flaw:?} is not found"));
    println!("{flaw:?}: seed {seed}: {:?}", came.failure);

    let without = World::execute(Plan::draw(*seed, &halls), &halls);
    assert_eq!(without.failure, None, "seed {seed} without the defect");
}

#[test]
fn a_robot_that_is_cut_off_at_init_and_never_returns_is_found() {
    assert_found(Flaw::InitAtTickZeroOnly, 600);
}

#[test]
fn a_robot_that_waits_for_one_that_is_stopped_is_found() {
    assert_found(Flaw::NobodyStandsIn, 1_000);
}

#[test]
fn a_queue_without_room_for_a_large_state_is_found() {
    assert_found(Flaw::QueueWithoutRoom, 200);
}
