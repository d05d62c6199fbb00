//! Measures guest steps per second on one thread, for crowds of equal density.
//!
//! `cargo run --release -p world --example crowd_rate`

#![expect(clippy::print_stdout, reason = "an example prints its result")]

use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::time::Instant;
use world::{Field, Guests, Hall, Shapes, Triangular, World};

const FT: f64 = 0.3048;

/// Guest steps per measurement, enough for about a second each.
const STEPS: usize = 20_000_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "{:>9} {:>9} {:>15} {:>10} {:>9}",
        "guests", "ticks", "guest-steps/s", "ns/step", "blocked"
    );

    for count in [100, 1_000, 10_000, 100_000] {
        let mut world = World::new(&hall(count)?, Xoshiro256PlusPlus::seed_from_u64(1))?;
        let ticks = STEPS / count;
        let mut blocked = 0;

        let start = Instant::now();
        for _ in 0..ticks {
            world.advance(&[]);
            blocked += world.guest_blockers().iter().flatten().count();
        }
        let elapsed_s = start.elapsed().as_secs_f64();

        let steps = (ticks * count) as f64;
        let share = blocked as f64 / steps * 100.0;

        println!(
            "{count:>9} {ticks:>9} {:>15.0} {:>10.1} {share:>8.1}%",
            steps / elapsed_s,
            elapsed_s / steps * 1e9
        );
    }

    Ok(())
}

/// The crowd of the paper, 100 guests of 2 ft on 50 ft by 50 ft, scaled to `count` guests at the same density.
fn hall(count: usize) -> Result<Hall, Box<dyn std::error::Error>> {
    let side_m = 50.0 * FT * (count as f64 / 100.0).sqrt();

    Ok(Hall {
        field: Field {
            size_m: (side_m, side_m),
            body_m: 2.0 * FT,
        },
        obstacles: Vec::new(),
        guests: Guests {
            count,
            speed_mps: Triangular::new(0.2, 0.6, 1.2)?,
            duration_s: Triangular::new(1.0, 3.0, 8.0)?,
        },
        robots: Vec::new(),
        tick_s: 0.1,
        shapes: Shapes::default(),
        max_speed_mps: 1.0,
    })
}
