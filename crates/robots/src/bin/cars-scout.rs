//! A robot that covers a field with others.

fn main() -> std::process::ExitCode {
    robots::main("Scout")
}
