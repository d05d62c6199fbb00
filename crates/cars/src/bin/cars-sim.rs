//! The simulator.

fn main() -> std::process::ExitCode {
    simulator::program::main()
}
