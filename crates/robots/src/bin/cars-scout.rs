//! A robot that covers a field with others.

fn main() -> std::process::ExitCode {
    robot::main("Scout", |_| Box::new(robots::Scout::default()))
}
