//! Leguin, the refiller.

fn main() -> std::process::ExitCode {
    robot::main("Leguin", |_| Box::new(robots::Leguin::default()))
}
