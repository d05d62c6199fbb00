//! `cars-console`: will be the web console. Until then it says so.

fn main() -> std::process::ExitCode {
    eprintln!("cars-console is not built yet; `cars log -f` and `cars ctl` watch and control a run.");
    std::process::ExitCode::FAILURE
}
