//! Leguin, the refiller.

fn main() -> std::process::ExitCode {
    robot::main("Leguin", |_| robots::make_leguin())
}
