//! A robot that covers a field with others.

fn main() -> std::process::ExitCode {
    robot::main("Scout", |_| robots::make_scout())
}
