//! The programs beside `cars`. Each is a small one of its own (`exec_as.rs`), which goes on as this one under its name.

use std::path::Path;
use std::process::ExitCode;

use robots::{Butler, Leguin};

/// What a program does.
type Main = fn() -> ExitCode;

/// What this process is to do if it was begun as one of the programs beside `cars`.
pub(crate) fn begun_as() -> Option<Main> {
    let given = std::env::args_os().next()?;
    let name = Path::new(&given).file_name()?.to_str()?;
    let main = main_of(name)?;
    // The name in lists of processes, which would be `cars`; nothing depends on it.
    let _unnamed = std::fs::write("/proc/self/comm", name);
    Some(main)
}

fn main_of(name: &str) -> Option<Main> {
    match name {
        "cars-sim" => Some(simulator::program::main),
        "cars-console" => Some(console::main),
        "cars-butler" => Some(|| robot::main("Butler", |_| Box::new(Butler::default()))),
        "cars-leguin" => Some(|| robot::main("Leguin", |_| Box::new(Leguin::default()))),
        // A clone of Leguin under another name.
        "cars-vonda" => Some(|| robot::main("Vonda", |_| Box::new(Leguin::default()))),
        _ => None,
    }
}
