//! The console.

#[path = "../door.rs"]
mod door;

fn main() -> std::process::ExitCode {
    door::open("cars-console")
}
