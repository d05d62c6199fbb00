//! The floor over TCP: a barrier of one write and one read for each process and tick.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;
use miette::IntoDiagnostic;

use crate::programs::{Processes, own_command};
use crate::workload::{CLOCK_BYTES, REPORT_BYTES};

/// `cars-bench echo`.
#[derive(Debug, Args)]
pub(crate) struct EchoArgs {
    /// Address of the barrier.
    address: String,
}

/// Ticks per second of a barrier with this number of processes.
pub(crate) fn measure(processes: usize, ticks: u64) -> miette::Result<f64> {
    let listener = TcpListener::bind("127.0.0.1:0").into_diagnostic()?;
    let address = listener.local_addr().into_diagnostic()?.to_string();
    let mut children = Processes::default();
    let mut streams = Vec::new();
    for _ in 0..processes {
        children.start(own_command()?.args(["echo", &address]))?;
        let (stream, _) = listener.accept().into_diagnostic()?;
        stream.set_nodelay(true).into_diagnostic()?;
        streams.push(stream);
    }

    let begun = Instant::now();
    for _ in 0..ticks {
        tick(&mut streams).into_diagnostic()?;
    }
    let rate = ticks as f64 / begun.elapsed().as_secs_f64();

    // The processes end when their connections are closed.
    drop(streams);
    children.wait()?;
    Ok(rate)
}

fn tick(streams: &mut [TcpStream]) -> std::io::Result<()> {
    for stream in &mut *streams {
        stream.write_all(&[1; CLOCK_BYTES])?;
    }

    let mut report = [0; REPORT_BYTES];
    for stream in streams {
        stream.read_exact(&mut report)?;
    }
    Ok(())
}

/// A process of the barrier: answers each clock with a report.
pub(crate) fn echo(args: &EchoArgs) -> miette::Result<ExitCode> {
    let mut stream = TcpStream::connect(&args.address).into_diagnostic()?;
    stream.set_nodelay(true).into_diagnostic()?;
    let mut clock = [0; CLOCK_BYTES];
    while stream.read_exact(&mut clock).is_ok() {
        stream.write_all(&[2; REPORT_BYTES]).into_diagnostic()?;
    }
    Ok(ExitCode::SUCCESS)
}
