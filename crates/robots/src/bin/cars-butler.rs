//! Butler, the waiter.

fn main() -> std::process::ExitCode {
    robot::main("Butler", |_| Box::new(robots::Butler::default()))
}
