//! The simulator.

#[path = "../exec_as.rs"]
mod exec_as;

fn main() -> std::process::ExitCode {
    exec_as::exec_cars("cars-sim")
}
