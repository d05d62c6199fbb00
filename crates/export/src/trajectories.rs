//! Where robots and guests were, as trajectories in the text form of Forschungszentrum Jülich, `id frame x/m y/m z/m`, which
//! PedPy's `load_trajectory_from_txt`, JuPedSim's tools and scenarios read.
//!
//! A frame is a tick. Robots have the ids from 1 on, in the order of their names; guests those after, by their numbers.

use std::io::Write;

use protocol::RobotName;
use recording::{RecordedTick, Recording, Ticks};

use crate::ExportError;

/// Writes the trajectories of an epoch.
///
/// # Errors
/// [`ExportError`] if the recording cannot be read to its end, or the trajectories cannot be written.
pub fn write(recording: Recording, out: &mut impl Write) -> Result<(), ExportError> {
    let header = recording.header();
    let robots = header.robots.clone();
    let rate_hz = 1.0 / header.tick_s;

    writeln!(
        out,
        "# description: run {}, epoch {}",
        header.run, header.epoch
    )?;
    writeln!(out, "# framerate: {rate_hz} fps")?;
    for (id, robot) in (1..).zip(&robots) {
        let id: u64 = id;
        writeln!(out, "# robot {robot}: id {id}")?;
    }
    writeln!(out, "# guests: ids from {} on", robots.len() + 1)?;
    // Last, because readers take the unit from here.
    writeln!(out, "# id frame x/m y/m z/m")?;

    let mut ticks = Ticks::of(recording);
    while let Some(tick) = ticks.next_tick()? {
        write_tick(&tick, &robots, out)?;
    }
    out.flush()?;
    Ok(())
}

fn write_tick(
    tick: &RecordedTick,
    robots: &[RobotName],
    out: &mut impl Write,
) -> Result<(), ExportError> {
    let frame = &tick.frame;
    let number = frame.tick;
    for robot in &frame.robots {
        let Ok(index) = robots.binary_search(&robot.name) else {
            continue;
        };
        let at = robot.location;
        writeln!(out, "{} {number} {:.3} {:.3} 0", index + 1, at.x, at.y)?;
    }

    for (guest, [x_m, y_m]) in frame.guests() {
        let id = robots.len() + 1 + guest as usize;
        writeln!(out, "{id} {number} {x_m:.3} {y_m:.3} 0")?;
    }
    Ok(())
}
