//! The table at the end of a run.

use std::collections::BTreeMap;
use std::path::Path;

use protocol::messages::End;
use simulator::Summary;
use simulator::summary::RobotSummary;
use tabled::builder::Builder;
use tabled::settings::Style;

/// Cells of a full bar.
const BAR: usize = 10;

/// Prints what came of a run.
pub(crate) fn print(summary: &Summary, folder: &Path) {
    print!("{}", render(summary, folder));
}

fn render(summary: &Summary, folder: &Path) -> String {
    let end = match summary.end {
        Some(End::Finished) => "finished",
        Some(End::Stopped) => "stopped",
        Some(End::Aborted) => "aborted",
        None => "unfinished",
    };
    let (elapsed_s, time_s) = (summary.wall.elapsed_s, summary.time_s);
    let mut text = format!(
        "\n{} {end} after {time_s:.1} s ({} ticks)",
        summary.run, summary.ticks
    );
    if elapsed_s > 0.0 {
        text += &format!(
            " in {elapsed_s:.1} s, {:.0} times real time",
            time_s / elapsed_s
        );
    }
    text += &format!(
        "\nseed {}  guests {}  digest {}\n\n",
        summary.seed, summary.guests, summary.digest
    );
    let mut table = Builder::default();
    table.push_record(["robot", "emotion", "behavior", "commands", "moves"]);
    for (name, robot) in &summary.robots {
        table.push_record([
            name.to_string(),
            shares(&robot.emotions_s, None),
            shares(&robot.behaviors_s, Some(&robot.entered)),
            commands(robot),
            moves(robot),
        ]);
    }
    text += &table.build().with(Style::rounded()).to_string();
    text += &held_up(summary);
    text + &format!("\n\nrecord: {}\n", folder.display())
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
    for (count, what) in [
        (robot.dropped, "lost on the way"),
    ] {
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

/// Who held up the run, if somebody did so long enough for a person to notice.
fn held_up(summary: &Summary) -> String {
    let noticed = summary
        .wall
        .held_up_by
        .iter()
        .filter(|(_, held)| held.longest_s >= 0.5);
    let line = |(name, held): (&protocol::RobotName, &simulator::summary::HeldUp)| {
        format!(
            "\nthe clock waited {:.1} s for {name}, at most {:.1} s at a time",
            held.waited_s, held.longest_s
        )
    };
    noticed.map(line).collect()
}
