//! A small robot to check the conformance kit: [`lockstep::Participant`] in a host of its own. Without arguments it is
//! correct; with `--wrong RULE` or `--wrong RULE:HOW` it alters one input or output and so breaks that rule of
//! `docs/protocol.md`.

#![expect(clippy::print_stderr, reason = "a test reads what this robot prints")]

mod answering;
mod arriving;
mod host;
mod putting;
mod ticking;
mod walker;
mod wrong;

use std::process::ExitCode;

use host::Host;
use wrong::Wrong;

fn main() -> ExitCode {
    // As robots in Rust do: half the processor time.
    bus::runtime::use_one_thread();

    let wrong = Wrong(argument("--wrong").unwrap_or_default());
    let name = argument("--name").unwrap_or_else(|| "Walker".to_owned());

    match Host::connect(&name, wrong).and_then(Host::run) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The argument after a flag.
fn argument(flag: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|argument| argument != flag);
    arguments.next();
    arguments.next()
}
