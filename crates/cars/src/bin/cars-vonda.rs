//! Vonda, a clone of Leguin under another name.

#[path = "../door.rs"]
mod door;

fn main() -> std::process::ExitCode {
    door::open("cars-vonda")
}
