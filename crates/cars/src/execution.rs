//! Options shared by `launch`, `run` and `net play`.

use std::path::PathBuf;

use clap::Args;
use config::units::Time;
use config::{Override, Speed, seed};
use launch::RunOptions;
use protocol::RunName;
use protocol::random::MAX_SEED;
use record::IfTaken;

/// Options of one execution.
#[derive(Debug, Clone, Args)]
pub(crate) struct ExecutionArgs {
    /// Name of the run, and of its folder; without it that in the launch file, or the file's name.
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<RunName>,
    /// Replace the run with this name, if it is over. Without it, a new run takes the next free name, as in `hall-2`.
    #[arg(long)]
    pub(crate) replace: bool,
    /// The folder of the run was made for it, by another process.
    #[arg(long, hide = true, conflicts_with = "replace")]
    pub(crate) reserved: bool,
    /// Seed, or `random` to draw one; the record contains it either way.
    #[arg(long, value_name = "N|random", value_parser = parse_seed)]
    pub(crate) seed: Option<u64>,
    /// Simulated time, for example "600 s".
    #[arg(long, value_name = "TIME")]
    pub(crate) duration: Option<Time>,
    /// Simulated seconds per second, or `max` for as fast as possible.
    #[arg(long, value_name = "FACTOR|max")]
    pub(crate) speed: Option<Speed>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// A change of the scenario, for example `guests.count=50` or `robot.Butler.params.refiller=Vonda`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub(crate) set: Vec<Override>,
}

/// Reads a seed, or draws one.
pub(crate) fn parse_seed(text: &str) -> Result<u64, String> {
    if text == "random" {
        return draw_seed();
    }
    let number = text
        .parse()
        .map_err(|_| format!("a seed is a whole number from 0 to {MAX_SEED}, or `random`"))?;
    seed::check(number).map_err(|error| error.to_string())
}

/// Draws a seed from the operating system. The run records it, so the run can be repeated.
fn draw_seed() -> Result<u64, String> {
    let mut bytes = [0; 8];
    let read = std::fs::File::open("/dev/urandom")
        .and_then(|mut source| std::io::Read::read_exact(&mut source, &mut bytes));
    read.map_err(|error| format!("no seed can be drawn: {error}"))?;
    Ok(u64::from_le_bytes(bytes) & MAX_SEED)
}

/// What is done where the name of a new run is taken.
pub(crate) fn if_taken(replaces: bool) -> IfTaken {
    if replaces {
        IfTaken::Replace
    } else {
        IfTaken::Number
    }
}

impl ExecutionArgs {
    /// The options as the `launch` crate takes them.
    pub(crate) fn options(self) -> RunOptions {
        RunOptions {
            if_taken: if self.reserved {
                IfTaken::Reserved
            } else {
                if_taken(self.replace)
            },
            run: self.run,
            seed: self.seed,
            duration: self.duration,
            speed: self.speed,
            out: self.out,
            set: self.set,
        }
    }
}
