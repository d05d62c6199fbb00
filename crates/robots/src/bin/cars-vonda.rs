//! Vonda, a clone of Leguin under another name.

fn main() -> std::process::ExitCode {
    robots::main("Vonda")
}
