//! A robot that shares tasks with others by auction.

fn main() -> std::process::ExitCode {
    robot::main("Bidder", |_| robots::make_bidder())
}
