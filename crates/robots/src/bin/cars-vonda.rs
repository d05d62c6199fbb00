//! Vonda, a clone of Leguin under another name.

fn main() -> std::process::ExitCode {
    robot::main("Vonda", |_| robots::make_leguin())
}
