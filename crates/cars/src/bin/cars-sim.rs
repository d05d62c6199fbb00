//! The simulator.

#[path = "../door.rs"]
mod door;

fn main() -> std::process::ExitCode {
    door::open("cars-sim")
}
