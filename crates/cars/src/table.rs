//! The table at the end of a run: a row for each robot.

use std::collections::BTreeMap;
use std::path::Path;

use protocol::messages::{End, Verdict};
use protocol::time::seconds;
use record::Summary;
use record::summary::{ExpectationVerdict, RobotSummary};
use terminal::OutputError;

/// Width of a full bar, characters.
const BAR: usize = 10;
/// Most texts of commands that are shown of a robot.
const MAX_TEXTS: usize = 5;
/// The time in which a robot takes no part.
const ABSENT: &str = "(takes no part)";
/// Times that differ by less are equal, seconds.
const ROUNDING_S: f64 = 1e-6;
/// A robot is named if the clock waited this long for it at a time, seconds of wall clock.
const NOTICED_S: f64 = 0.5;
/// Heads of the columns.
const HEAD: [&str; 5] = ["robot", EMOTION, "behavior", "commands", "moves"];
const EMOTION: &str = "emotion";

/// Prints the summary of a run.
///
/// # Errors
/// [`OutputError`] if the standard output cannot be written.
pub(crate) fn print(summary: &Summary, folder: &Path) -> Result<(), OutputError> {
    let heading = heading(summary);
    let (head, rows) = columns(summary);
    let width = head.len();
    let table = terminal::table(head, rows, 1, width);
    let mut text = format!("\n{heading}\n{table}");
    for line in verdicts(&summary.expectations) {
        text += &format!("\n{line}");
    }
    for (name, measured) in &summary.measures {
        text += &format!("\n{name}: {measured}");
    }
    for line in held_up(summary) {
        text += &format!("\n{line}");
    }

    let folder = folder.display();
    terminal::print_line(format_args!("{text}\n\nrecord: {folder}"))
}

/// End, duration, seed and digest of the run in two lines.
fn heading(summary: &Summary) -> String {
    let end = match summary.end {
        Some(End::Finished) => "finished",
        Some(End::Stopped) => "stopped",
        Some(End::Aborted) => "aborted",
        None => "unfinished",
    };

    let run = &summary.run;
    let ticks = summary.ticks;
    let time_s = summary.time_s;
    let tick_s = time_s / ticks.max(1) as f64;
    let time = seconds(time_s, tick_s);
    let mut text = format!("{run} {end} after {time} s ({ticks} ticks)");

    let elapsed_s = summary.wall.elapsed_s;
    if elapsed_s > 0.0 {
        let ratio = time_s / elapsed_s;
        text += &format!(" in {elapsed_s:.1} s, {ratio:.0} times real time");
    }

    if let Some(because) = &summary.end_because {
        text += &format!("\nended because {}", protocol::plain::escape_line(because));
    }
    text += &format!(
        "\nseed {}  guests {}  digest {}\n",
        summary.seed, summary.guests, summary.digest
    );
    text
}

/// The heads of the columns, and one row for each robot; a cell may have several lines. Where no robot has emotions there is no column
/// of them.
fn columns(summary: &Summary) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let mut robots = summary.robots.values();
    let have_emotions = robots.any(|robot| !robot.emotions_s.is_empty());
    let mut head = HEAD.to_vec();
    head.retain(|column| have_emotions || *column != EMOTION);

    let total_s = summary.time_s;
    let mut rows = Vec::new();
    for (name, robot) in &summary.robots {
        let absent_s = absent_s(robot, total_s);
        let mut row = vec![name.to_string()];
        if have_emotions {
            row.push(shares(&robot.emotions_s, absent_s, total_s, None));
        }
        let entered = Some(&robot.entered);
        row.push(shares(&robot.behaviors_s, absent_s, total_s, entered));
        row.push(commands(robot));
        row.push(moves(robot));
        rows.push(row);
    }
    (head, rows)
}

/// The time in which a robot takes no part: it is in an emotion, or in a behavior, while it does, unless it reports neither.
fn absent_s(robot: &RobotSummary, total_s: f64) -> f64 {
    let times_s = [&robot.emotions_s, &robot.behaviors_s];
    let [emotions_s, behaviors_s] = times_s.map(|times_s| times_s.values().sum::<f64>());
    let present_s = emotions_s.max(behaviors_s);
    if present_s > 0.0 {
        total_s - present_s
    } else {
        0.0
    }
}

/// A line for each expectation: its verdict, its name, and the reason unless it is met.
pub(crate) fn verdicts(expectations: &BTreeMap<String, ExpectationVerdict>) -> Vec<String> {
    let mut lines = Vec::new();
    for (name, judged) in expectations {
        let verdict = judged.verdict;
        let mut line = format!("{verdict:<9}  {name}");
        if judged.verdict != Verdict::Pass {
            line += &format!(": {}", judged.because);
        }
        lines.push(line);
    }
    lines
}

/// A line for each robot for which the clock waited long enough for a person to notice.
fn held_up(summary: &Summary) -> Vec<String> {
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

/// Shares of the time of the run, the largest first: a bar, the percentage, and the number of times that the state was entered; then
/// that in which the robot took no part.
fn shares(
    times_s: &BTreeMap<String, f64>,
    absent_s: f64,
    total_s: f64,
    entered: Option<&BTreeMap<String, u64>>,
) -> String {
    let mut sorted: Vec<(&str, f64)> = Vec::new();
    for (state, time_s) in times_s {
        sorted.push((state, *time_s));
    }
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    if absent_s > ROUNDING_S {
        sorted.push((ABSENT, absent_s));
    }
    let width = sorted.iter().map(|(state, _)| state.len()).max();
    let width = width.unwrap_or(0);

    let mut lines = Vec::new();
    for (state, time_s) in sorted {
        let share = if total_s > 0.0 { time_s / total_s } else { 0.0 };
        let percent = share * 100.0;
        let mut line = format!("{state:<width$} {} {percent:>3.0} %", bar(share));
        if let Some(count) = entered.and_then(|entered| entered.get(state)) {
            line += &format!(" {count:>4}x");
        }
        lines.push(line);
    }
    lines.join("\n")
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
    let mut sent: Vec<(&String, &u64)> = robot.sent.iter().collect();
    sent.sort_by(|one, other| other.1.cmp(one.1));
    let (shown, others) = sent.split_at(sent.len().min(MAX_TEXTS));

    let mut lines = Vec::new();
    for (command, count) in shown {
        lines.push(format!("{count} {command}"));
    }
    if !others.is_empty() {
        let count: u64 = others.iter().map(|(_, count)| **count).sum();
        lines.push(format!("{count} with {} further texts", others.len()));
    }
    lines.push(format!("{} received", robot.received));
    if robot.dropped > 0 {
        lines.push(format!("{} lost on the way", robot.dropped));
    }
    lines.join("\n")
}

fn moves(robot: &RobotSummary) -> String {
    let mut lines = vec![format!("{} blocked", robot.blocked)];
    for (count, one, many) in [
        (robot.missed, "tick missed", "ticks missed"),
        (robot.returns, "return", "returns"),
    ] {
        match count {
            0 => {}
            1 => lines.push(format!("1 {one}")),
            _ => lines.push(format!("{count} {many}")),
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(sent: &[(&str, u64)]) -> RobotSummary {
        let sent = sent
            .iter()
            .map(|(text, count)| ((*text).to_owned(), *count));
        RobotSummary {
            sent: sent.collect(),
            received: 3,
            ..RobotSummary::default()
        }
    }

    #[test]
    fn the_most_frequent_five_texts_of_commands_have_a_line_each() {
        let five = [("a", 1), ("b", 5), ("c", 2), ("d", 9), ("e", 4)];
        let lines = "9 d\n5 b\n4 e\n2 c\n1 a";
        assert_eq!(commands(&robot(&five)), format!("{lines}\n3 received"));

        // Of those that are as frequent the first by name is shown.
        let more = [&five[..], &[("f", 1), ("g", 1)]].concat();
        assert_eq!(
            commands(&robot(&more)),
            format!("{lines}\n2 with 2 further texts\n3 received")
        );
    }

    #[test]
    fn one_tick_and_one_return_are_in_the_singular() {
        let counted = |missed, returns| {
            let mut robot = robot(&[]);
            robot.missed = missed;
            robot.returns = returns;
            moves(&robot)
        };
        assert_eq!(counted(1, 2), "0 blocked\n1 tick missed\n2 returns");
        assert_eq!(counted(2, 1), "0 blocked\n2 ticks missed\n1 return");
    }

    #[test]
    fn the_time_in_which_a_robot_takes_no_part_has_a_line_of_its_own() {
        let times_s = |times_s: &[(&str, f64)]| {
            let times_s = times_s
                .iter()
                .map(|(state, time_s)| ((*state).to_owned(), *time_s));
            times_s.collect::<BTreeMap<_, _>>()
        };
        let states = |text: &str| {
            let lines = text.lines().map(|line| line.split("  ").next().unwrap());
            lines.map(str::to_owned).collect::<Vec<_>>()
        };

        let lost = shares(&times_s(&[("SERVE", 3.0), ("WAIT", 1.0)]), 6.0, 10.0, None);
        assert_eq!(states(&lost), ["SERVE", "WAIT", "(takes no part) ██████"]);
        assert!(lost.ends_with(" 60 %"), "{lost}");

        // Sums of decimals are not exact.
        let mut whole = robot(&[]);
        whole.behaviors_s = times_s(&[("X", 0.1), ("Y", 0.2)]);
        assert!(absent_s(&whole, 0.3).abs() < ROUNDING_S);
        whole.emotions_s = times_s(&[("HAPPY", 0.1)]);
        assert!(
            absent_s(&whole, 0.3).abs() < ROUNDING_S,
            "an emotion may come late"
        );
        whole.behaviors_s.clear();
        whole.emotions_s.clear();
        assert_eq!(absent_s(&whole, 0.3), 0.0, "it reports neither");
    }
}
