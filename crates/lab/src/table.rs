//! The summary of a run as the cells of a table.

use std::collections::BTreeMap;

use protocol::messages::End;
use simulator::Summary;
use simulator::summary::RobotSummary;

/// Cells of a full bar.
const BAR: usize = 10;
/// A robot that held the clock this long at a time, seconds of wall clock, is named.
const NOTICED_S: f64 = 0.5;
/// Heads of the columns of [`rows`].
pub const HEAD: [&str; 5] = ["robot", "emotion", "behavior", "commands", "moves"];

/// How the run ended, how long it took, and what it was, in two lines.
#[must_use]
pub fn heading(summary: &Summary) -> String {
    let end = match summary.end {
        Some(End::Finished) => "finished",
        Some(End::Stopped) => "stopped",
        Some(End::Aborted) => "aborted",
        None => "unfinished",
    };
    let elapsed_s = summary.wall.elapsed_s;
    let time_s = summary.time_s;

    let mut text = format!(
        "{} {end} after {time_s:.1} s ({} ticks)",
        summary.run, summary.ticks
    );
    if elapsed_s > 0.0 {
        text += &format!(
            " in {elapsed_s:.1} s, {:.0} times real time",
            time_s / elapsed_s
        );
    }
    text += &format!(
        "\nseed {}  guests {}  digest {}\n",
        summary.seed, summary.guests, summary.digest
    );
    text
}

/// One row for each robot; a cell may have several lines.
#[must_use]
pub fn rows(summary: &Summary) -> Vec<[String; 5]> {
    let mut rows = Vec::new();
    for (name, robot) in &summary.robots {
        rows.push([
            name.to_string(),
            shares(&robot.emotions_s, None),
            shares(&robot.behaviors_s, Some(&robot.entered)),
            commands(robot),
            moves(robot),
        ]);
    }

    rows
}

/// The robots for which the clock was held long enough for a person to notice, a line each.
#[must_use]
pub fn held_up(summary: &Summary) -> Vec<String> {
    let mut lines = Vec::new();
    for (name, held) in &summary.wall.held_up_by {
        if held.longest_s >= NOTICED_S {
            lines.push(format!(
                "the clock waited {:.1} s for {name}, at most {:.1} s at a time",
                held.waited_s, held.longest_s
            ));
        }
    }

    lines
}

/// Shares of the time, the largest first: a bar, per cent, and how often it was entered.
fn shares(times_s: &BTreeMap<String, f64>, entered: Option<&BTreeMap<String, u64>>) -> String {
    let total_s: f64 = times_s.values().sum();
    let mut sorted: Vec<(&String, f64)> = times_s
        .iter()
        .map(|(state, time_s)| (state, *time_s))
        .collect();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let width = sorted
        .iter()
        .map(|(state, _)| state.len())
        .max()
        .unwrap_or(0);
    let line = |(state, time_s): &(&String, f64)| {
        let share = if total_s > 0.0 { time_s / total_s } else { 0.0 };
        let count = entered
            .and_then(|entered| entered.get(*state))
            .map(|count| format!(" {count:>4}x"));
        format!(
            "{state:<width$} {} {:>3.0} %{}",
            bar(share),
            share * 100.0,
            count.unwrap_or_default()
        )
    };

    sorted.iter().map(line).collect::<Vec<_>>().join("\n")
}

fn bar(share: f64) -> String {
    let eighths = (share.clamp(0.0, 1.0) * (BAR * 8) as f64).round() as usize;
    let partial = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉'];
    let full = eighths / 8;
    let mut text = "█".repeat(full);
    if full < BAR {
        text.push(partial[eighths % 8]);
        text += &" ".repeat(BAR - full - 1);
    }
    text
}

fn commands(robot: &RobotSummary) -> String {
    let mut lines: Vec<String> = robot
        .sent
        .iter()
        .map(|(command, count)| format!("{count} {command}"))
        .collect();

    lines.push(format!("{} received", robot.received));

    for (count, what) in [(robot.dropped, "lost on the way")] {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    }

    lines.join("\n")
}

fn moves(robot: &RobotSummary) -> String {
    let mut lines = vec![format!("{} blocked", robot.blocked)];
    for (count, what) in [(robot.missed, "ticks missed"), (robot.returns, "returns")] {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    }
    lines.join("\n")
}
