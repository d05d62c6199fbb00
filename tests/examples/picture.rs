//! Finds what the README's picture shows, the hall in the state of the paper's Figure 6, by playing seeds: prints a seed and
//! a tick. `tests/console/picture.py` draws it.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints its result"
)]

use system_tests::hall::{Hall, scenario};

const FILE: &str = "configs/hors_doeuvres.toml";

fn main() {
    match (1..=200).find_map(|seed| Some((seed, figure_6(seed)?))) {
        Some((seed, tick)) => println!("{seed} {tick}"),
        None => eprintln!("no seed up to 200 reaches the state of Figure 6"),
    }
}

/// Plays a seed until Butler, concerned, has seven treats left and Leguin, concerned, is about half-way to him: the tick.
fn figure_6(seed: u64) -> Option<u64> {
    let mut hall = Hall::new(scenario(FILE, seed, &[]));
    while hall.simulation.tick() < hall.simulation.scenario().ticks {
        hall.step();
        let state = |robot: &str| (hall.emotion(robot), hall.behavior(robot));
        let is_reached = state("Butler") == ("CONCERNED".into(), "SERVE".into())
            && state("Leguin") == ("CONCERNED".into(), "REFILL".into())
            && hall.number("Butler", "treats") == 7.0;
        if is_reached {
            return Some(hall.simulation.tick());
        }
    }

    None
}
