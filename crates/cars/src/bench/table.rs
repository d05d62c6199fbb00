//! The table of results.

use tabled::builder::Builder;
use tabled::settings::Alignment;
use tabled::settings::Style;
use tabled::settings::object::Columns;

use super::Results;
use super::floors::Subject;

/// Prints median, best and worst of each subject, and medians of ratios.
pub(super) fn print(all: &[Results]) {
    let is_compared = all.iter().any(|results| !results.there.is_empty());
    let mut head = vec![
        "ticks per second",
        "median",
        "best",
        "worst",
        "of its star",
        "of raw TCP",
    ];
    if is_compared {
        head.extend(["other build", "this/other"]);
    }

    let mut table = Builder::default();
    table.push_record(head);
    for results in all {
        table.push_record(row(results, all, is_compared));
    }
    let mut table = table.build();
    table
        .with(Style::rounded())
        .modify(Columns::new(1..), Alignment::right());
    println!("{table}");
    println!("Ratios are medians over rounds of pairs that were measured in the same round.");
}

fn row(results: &Results, all: &[Results], is_compared: bool) -> Vec<String> {
    let best = results.here.iter().copied().fold(f64::MIN, f64::max);
    let worst = results.here.iter().copied().fold(f64::MAX, f64::min);
    let mut row = vec![
        results.subject.to_string(),
        format!("{:.0}", median(&results.here)),
        format!("{best:.0}"),
        format!("{worst:.0}"),
        ratio_to(results.subject.floor(), results, all),
        ratio_to(results.subject.second_floor(), results, all),
    ];

    if is_compared && results.there.is_empty() {
        row.extend([String::new(), String::new()]);
    } else if is_compared {
        row.push(format!("{:.0}", median(&results.there)));
        row.push(format!(
            "{:.2}",
            paired_ratio(&results.here, &results.there)
        ));
    }

    row
}

/// Ratio to a floor, or nothing where there is none.
fn ratio_to(floor: Option<Subject>, results: &Results, all: &[Results]) -> String {
    let floor = floor.and_then(|floor| all.iter().find(|other| other.subject == floor));
    match floor {
        Some(floor) => format!("{:.2}", paired_ratio(&results.here, &floor.here)),
        None => String::new(),
    }
}

/// Median of the ratios of values of the same round: the machine's speed drifts, and both drift with it.
fn paired_ratio(values: &[f64], others: &[f64]) -> f64 {
    let mut ratios = Vec::new();
    for (value, other) in values.iter().zip(others) {
        ratios.push(value / other);
    }
    median(&ratios)
}

/// The middle value, or the mean of the two in the middle.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.as_slice() {
        [] => f64::NAN,
        sorted if sorted.len() % 2 == 1 => sorted[middle],
        sorted => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_those_of_sorted_values() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&[7.0]), 7.0);
    }

    #[test]
    fn ratios_are_paired_by_round() {
        // The machine is ten times as fast in the second round, and nothing has changed.
        assert_eq!(paired_ratio(&[1.0, 10.0, 2.0], &[2.0, 20.0, 4.0]), 0.5);
    }
}
