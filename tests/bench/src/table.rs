//! The table of results.

use terminal::OutputError;

use crate::results::{Results, median, paired_ratio};
use crate::subject::Subject;

/// Prints median, best and worst of each subject, and medians of ratios.
pub(crate) fn print(all: &[Results]) -> Result<(), OutputError> {
    let is_compared = all.iter().any(|results| !results.there.is_empty());
    let rows = all.iter().map(|results| row(results, all, is_compared));
    let table = terminal::table(head(is_compared), rows, 1, 1);
    terminal::print_line(format_args!(
        "{table}\nRatios are medians over rounds of pairs that were measured in the same round."
    ))
}

fn head(is_compared: bool) -> Vec<&'static str> {
    let mut head = vec![
        "ticks per second",
        "median",
        "best",
        "worst",
        "of its star",
        "with messages",
        "of raw TCP",
    ];
    if is_compared {
        head.extend(["other build", "this/other"]);
    }
    head
}

fn row(results: &Results, all: &[Results], is_compared: bool) -> Vec<String> {
    let subject = results.subject;
    let mut row = vec![
        subject.to_string(),
        format!("{:.0}", median(&results.here)),
        format!("{:.0}", results.best()),
        format!("{:.0}", results.worst()),
        ratio_to(subject.floor(), results, all),
        ratio_to(subject.message_floor(), results, all),
        ratio_to(subject.second_floor(), results, all),
    ];
    if is_compared {
        row.extend(comparison(results));
    }

    row
}

/// The two columns of the other build; empty for subjects that run nothing of the project.
fn comparison(results: &Results) -> [String; 2] {
    if results.there.is_empty() {
        return [String::new(), String::new()];
    }

    let ratio = paired_ratio(&results.here, &results.there);
    [
        format!("{:.0}", median(&results.there)),
        format!("{ratio:.2}"),
    ]
}

/// Ratio to a floor; empty for a subject without one.
fn ratio_to(floor: Option<Subject>, results: &Results, all: &[Results]) -> String {
    let floor = floor.and_then(|floor| all.iter().find(|other| other.subject == floor));
    match floor {
        Some(floor) => format!("{:.2}", paired_ratio(&results.here, &floor.here)),
        None => String::new(),
    }
}
