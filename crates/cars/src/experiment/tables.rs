//! Results as tables and as JSON.

use lab::experiment::{Cell, Contrast, Difference, Estimated, Experiment, Results};
use miette::IntoDiagnostic;
use tabled::builder::Builder;
use tabled::settings::object::Columns;
use tabled::settings::{Alignment, Style};

/// Prints every run, every estimate and every difference as JSON.
///
/// # Errors
/// If the standard output cannot be written.
pub(super) fn print_json(results: &Results) -> miette::Result<()> {
    let experiment = &results.plan.experiment;
    let all = serde_json::json!({
        "compared": results.plan.compared(),
        "runs": results.outcomes,
        "failures": results.failures,
        "estimates": experiment.estimate(&results.outcomes),
        "contrasts": experiment.contrast(&results.outcomes),
    });
    let all = serde_json::to_string_pretty(&all).into_diagnostic()?;
    terminal::data(format_args!("{all}\n"))?;
    Ok(())
}

/// Prints the estimates and the differences as tables.
///
/// # Errors
/// If the standard output cannot be written.
pub(super) fn print(results: &Results) -> miette::Result<()> {
    let experiment = &results.plan.experiment;
    let compared = results.plan.compared();
    let table = render(experiment, &experiment.estimate(&results.outcomes));
    terminal::print(format_args!("{compared}\n{table}\n"))?;

    let contrasts = experiment.contrast(&results.outcomes);
    if let Some(contrast) = contrasts.first() {
        let baseline = &contrast.baseline;
        let table = render_contrasts(experiment, &contrasts);
        terminal::print(format_args!(
            "\nDifference to \"{baseline}\", paired by seed: mean, 95 % confidence interval (bootstrap, BCa), and p value by\n\
             Holm's procedure over all arms and conditions (sign flips; times: log-rank).\n\n{table}\n"
        ))?;
    }
    Ok(())
}

/// The estimates as a table with one line for each arm under each condition.
fn render(experiment: &Experiment, cells: &[Cell]) -> tabled::Table {
    let mut head = vec![experiment.conditions.head(), "arm".to_owned()];
    for measure in &experiment.measures {
        if measure.column.is_some() {
            head.push(measure.title());
            if measure.is_time() {
                head.push("median time to it, s".to_owned());
            }
        }
    }

    let mut rows = Rows::default();
    for cell in cells {
        let measures = &experiment.measures;
        let measure = measures.iter().find(|measure| measure.name == cell.measure);
        if measure.is_none_or(|measure| measure.column.is_none()) {
            continue;
        }
        let row = rows.of(&cell.condition, &cell.arm);
        match &cell.estimate {
            Estimated::Number { mean, .. } => row.push(mean.to_string()),
            Estimated::Time(times) => {
                row.push(format!("{} of {}", times.events, times.n));
                row.push(times.to_string());
            }
        }
    }
    table(head, rows.0)
}

/// The differences to the baseline as a table; shares are in percentage points.
fn render_contrasts(experiment: &Experiment, contrasts: &[Contrast]) -> tabled::Table {
    let mut head = vec![experiment.conditions.head(), "arm".to_owned()];
    for measure in &experiment.measures {
        if measure.contrast {
            let title = measure.title();
            let unit = if measure.is_time() {
                ", % of the runs"
            } else {
                ""
            };
            head.push(format!("{title}{unit}"));
        }
    }

    let mut rows = Rows::default();
    for contrast in contrasts {
        let (difference, scale) = match &contrast.difference {
            Difference::Number { mean, .. } => (mean, 1.0),
            Difference::Time { share, .. } => (share, 100.0),
        };
        let interval = match difference.interval.bounds() {
            Some((low, high)) => format!("[{:+.1}, {:+.1}]", low * scale, high * scale),
            None => format!("({})", difference.interval),
        };

        let value = difference.value * scale;
        let p = match contrast.p_holm {
            p if p < 0.001 => "< 0.001".to_owned(),
            p => format!("{p:.3}"),
        };
        let n = contrast.n;
        let row = rows.of(&contrast.condition, &contrast.arm);
        row.push(format!("{value:+.1} {interval}\np {p}, n {n}"));
    }
    table(head, rows.0)
}

/// The rows of a table, which begin with the names of their condition and their arm.
#[derive(Default)]
struct Rows(Vec<Vec<String>>);

impl Rows {
    /// The row of an arm under a condition, which is added if there is none.
    fn of(&mut self, condition: &str, arm: &str) -> &mut Vec<String> {
        let found = self
            .0
            .iter()
            .position(|row| row[0] == condition && row[1] == arm);
        let place = found.unwrap_or(self.0.len());
        if place == self.0.len() {
            self.0.push(vec![condition.to_owned(), arm.to_owned()]);
        }
        &mut self.0[place]
    }
}

/// A table whose first column names a condition in its first line only.
fn table(head: Vec<String>, rows: Vec<Vec<String>>) -> tabled::Table {
    let mut table = Builder::default();
    table.push_record(head);
    let mut above = String::new();
    for mut row in rows {
        if row[0] == above {
            row[0].clear();
        } else {
            above.clone_from(&row[0]);
        }
        table.push_record(row);
    }

    let mut table = table.build();
    table
        .with(Style::rounded())
        .modify(Columns::new(2..), Alignment::right());
    table
}
