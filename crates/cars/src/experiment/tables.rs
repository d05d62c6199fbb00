//! Results as tables and as JSON.

use experiments::{
    ArmDifference, ArmMeasure, Contrast, Estimated, Experiment, Measure, Results, SHOWN_P,
    least_p_holm,
};

use crate::errors::Result;

/// Prints every run, every estimate and every difference as JSON.
///
/// # Errors
/// If the standard output cannot be written.
pub(super) fn print_json(results: &Results) -> Result<()> {
    let all = serde_json::json!({
        "compared": results.plan.compared(),
        "runs": results.outcomes,
        "failures": results.failures,
        "estimates": results.estimates(),
        "contrasts": results.contrasts(),
    });
    let all = serde_json::to_string_pretty(&all)?;
    terminal::data(format_args!("{all}\n"))?;
    Ok(())
}

/// Prints the estimates and the differences as tables.
///
/// # Errors
/// If the standard output cannot be written.
pub(super) fn print(results: &Results) -> Result<()> {
    let experiment = &results.plan.experiment;
    let compared = terminal::wrapped(&results.plan.compared());
    let table = render(experiment, &results.estimates());
    terminal::print(format_args!("{compared}\n\n{table}\n"))?;

    let contrasts = results.contrasts();
    if let Some(contrast) = contrasts.first() {
        let baseline = &contrast.baseline;
        terminal::print(format_args!(
            "\nDifference to \"{baseline}\", paired by seed, with 95 % confidence intervals (means:\n\
             Student's t; shares of runs: Tango's score interval). p is that of the sign-flip\n\
             test of the pairs, after Holm's correction over all comparisons of a measure.\n"
        ))?;
    }
    for measure in &experiment.measures {
        let contrasts = contrasts.iter().filter(|one| one.measure == measure.name);
        let contrasts: Vec<&Contrast> = contrasts.collect();
        if !contrasts.is_empty() {
            let text = render_contrasts(experiment, measure, &contrasts);
            terminal::print(format_args!("\n{text}\n"))?;
        }
    }
    Ok(())
}

/// The estimates as a table with one line for each arm under each condition.
fn render(experiment: &Experiment, cells: &[ArmMeasure]) -> String {
    let mut head = vec![experiment.conditions.head(), "arm".to_owned()];
    for measure in &experiment.measures {
        if measure.column.is_some() {
            head.push(measure.title());
            if measure.is_time() {
                head.push("median time\nto it, s".to_owned());
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
        let mut lines = Vec::new();
        let mut median = None;
        match &cell.estimate {
            Estimated::Number { mean, .. } => lines.push(mean.to_string()),
            Estimated::Time { survival, .. } if survival.n == 0 => {
                lines.push("no run".to_owned());
                median = Some(String::new());
            }
            Estimated::Time { share, survival } => {
                let share = share.scaled(100.0);
                lines.push(format!("{} of {}", survival.events, survival.n));
                lines.push(format!("{share} %"));
                median = Some(survival.to_string());
            }
        }

        if !cell.excluded.is_none() {
            lines.push(cell.excluded.to_string());
        }
        row.push(lines.join("\n"));
        row.extend(median);
    }
    table(head, rows.0)
}

/// The differences to the baseline in a measure as a table, under a line about it.
fn render_contrasts(experiment: &Experiment, measure: &Measure, contrasts: &[&Contrast]) -> String {
    let mut head = vec![
        experiment.conditions.head(),
        "arm".to_owned(),
        "pairs".to_owned(),
    ];
    if measure.is_time() {
        head.push("runs with it,\npoints".to_owned());
        head.push("mean time\nto it, s".to_owned());
    } else {
        head.push("difference".to_owned());
    }
    head.push("p".to_owned());

    let mut rows = Vec::new();
    for contrast in contrasts {
        let mut row = vec![
            contrast.condition.clone(),
            contrast.arm.clone(),
            pairs(contrast),
        ];
        match &contrast.difference {
            ArmDifference::Number { mean, .. } => row.push(mean.signed()),
            ArmDifference::Time {
                share,
                restricted_mean_s,
                until_s,
                ..
            } => {
                row.push(share.scaled(100.0).signed());
                row.push(format!("{}\nup to {until_s} s", restricted_mean_s.signed()));
            }
            ArmDifference::NoPair | ArmDifference::NotFinite => {
                row.push(contrast.no_difference().unwrap_or_default());
                row.resize(head.len() - 1, String::new());
            }
        }
        row.push(match contrast.p_holm {
            Some(p) if p < 0.001 => "< 0.001".to_owned(),
            Some(p) => format!("{p:.3}"),
            None => String::new(),
        });
        rows.push(row);
    }

    let comparisons = contrasts.first().map_or(0, |one| one.comparisons);
    let mut text = match comparisons {
        0 => format!("{}: no comparison can be made", measure.title()),
        1 => format!("{}: one comparison, so p is not corrected", measure.title()),
        _ => format!(
            "{}: p after Holm over the {comparisons} comparisons of this measure",
            measure.title()
        ),
    };
    let least_p = least_p_holm(contrasts);
    if comparisons > 0 && least_p >= SHOWN_P {
        text += &format!(
            "\nso few pairs cannot show a difference: p is {least_p:.3} at least; play more seeds"
        );
    }
    format!("{text}\n{}", table(head, rows))
}

/// Number of pairs, and the runs of both arms that have no number.
fn pairs(contrast: &Contrast) -> String {
    let mut lines = vec![contrast.n.to_string()];
    for (arm, excluded) in [
        (&contrast.arm, contrast.excluded),
        (&contrast.baseline, contrast.excluded_baseline),
    ] {
        if !excluded.is_none() {
            lines.push(format!("{arm}:"));
            lines.push(excluded.to_string().replace(", ", "\n"));
        }
    }
    lines.join("\n")
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
fn table(head: Vec<String>, mut rows: Vec<Vec<String>>) -> String {
    let mut above = String::new();
    for row in &mut rows {
        if row[0] == above {
            row[0].clear();
        } else {
            above.clone_from(&row[0]);
        }
    }

    terminal::table(head, rows, 2, 2)
}
