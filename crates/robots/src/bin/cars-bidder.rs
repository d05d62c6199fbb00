//! A robot that shares tasks with others by auction.

fn main() -> std::process::ExitCode {
    robots::main("Bidder")
}
