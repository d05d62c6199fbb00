//! The console.

fn main() -> std::process::ExitCode {
    console::main()
}
