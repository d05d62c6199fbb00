//! Leguin, the refiller.

fn main() -> std::process::ExitCode {
    robots::main("Leguin")
}
