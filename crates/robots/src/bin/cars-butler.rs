//! Butler, the waiter.

fn main() -> std::process::ExitCode {
    robots::main("Butler")
}
