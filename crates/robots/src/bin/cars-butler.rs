//! Butler, the waiter.

fn main() -> std::process::ExitCode {
    robot::main("Butler", |_| robots::make_butler())
}
