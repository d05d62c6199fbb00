//! What decided a run: the answers of `cars why` in its folder.

use std::collections::BTreeMap;

use lab::LabError;
use pictures::{Cell, Chart, ChartPanel, Figure, OutcomeCurve, Page, Table};
use protocol::Event;
use protocol::time::{decimals, time_s};
use record::{EpochFiles, Record, RunFolder};
use recording::RunDecisions;
use timeline::{DecisionJump, ForkOutcomes, RunDecision};

/// The answers of `cars why` about an epoch: those that have the digest of the epoch at their last tick.
///
/// # Errors
/// If there are answers, and the events of the epoch cannot be read.
pub fn decisions(folder: &RunFolder, files: &EpochFiles) -> Result<RunDecisions, LabError> {
    let mut found = RunDecisions::read(folder.path());
    if found.all.is_empty() {
        return Ok(found);
    }

    let lasts = found.all.iter().map(|decision| (decision.last, None));
    let mut digests: BTreeMap<_, Option<String>> = lasts.collect();
    let mut record = Record::of_events(&files.events)?;
    while let Some(entry) = record.next_entry()? {
        let Some(digest) = digests.get_mut(&entry.tick) else {
            continue;
        };
        for event in entry.events {
            if let Event::Tick { digest: found, .. } = event {
                *digest = Some(found);
            }
        }
    }
    found
        .all
        .retain(|decision| digests.get(&decision.last) == Some(&Some(decision.digest.clone())));
    Ok(found)
}

/// What decided the run. Nothing is written if `cars why` was not asked.
pub(super) fn write_decisions(page: &mut Page, decisions: &RunDecisions) {
    if decisions.all.is_empty() && decisions.notes.is_empty() {
        return;
    }
    page.section("What decided it");
    for decision in &decisions.all {
        page.paragraph(decision.sentence.clone());
        page.figure(figure(decision));
        if !decision.jumps.is_empty() {
            let caption =
                "The ticks in which the expected outcome jumps, and what it is without the cause.";
            page.table(caption, &jumps_table(decision));
        }
    }
    for note in &decisions.notes {
        page.remark(note.clone());
    }
}

fn figure(decision: &RunDecision) -> Figure {
    let chart = OutcomeCurve(decision.clone());
    let begin = decision.curve.first().map(|point| {
        let amount = point.outcome.in_words_with_count(decision.is_share);
        format!(" At the beginning it is {amount} forks.")
    });
    let caption = format!(
        "What was asked: {}. The line is the mean of forks that share the run up to a time and have other chance from there on, the \
         area its interval of 95 %. A dashed line is a tick in which it jumps.{}",
        decision.question.name,
        begin.unwrap_or_default()
    );
    Figure::new(
        vec![ChartPanel::new("", Chart::Outcome(chart))],
        caption,
        None,
    )
}

fn jumps_table(decision: &RunDecision) -> Table {
    let mut table = Table::new("Tick | time, s | before | after | forks | cause | without it");
    for jump in &decision.jumps {
        let (cause, without) = cause(decision, jump);
        table.row([
            Cell::Count(jump.tick),
            Cell::Number(
                time_s(jump.tick, decision.tick_s),
                decimals(decision.tick_s),
            ),
            amount(decision, &jump.before).into(),
            amount(decision, &jump.after).into(),
            jump.after.n.into(),
            cause.into(),
            without.into(),
        ]);
    }
    table
}

/// The cause of a jump, and the outcome without it.
fn cause(decision: &RunDecision, jump: &DecisionJump) -> (String, String) {
    match &jump.cause {
        Some(cause) => (cause.what.clone(), amount(decision, &cause.without)),
        None => ("none found".to_owned(), "–".to_owned()),
    }
}

/// Outcomes with their interval.
fn amount(decision: &RunDecision, outcomes: &ForkOutcomes) -> String {
    let value = decision.amount(outcomes);
    match outcomes.low.zip(outcomes.high) {
        Some((low, high)) => format!(
            "{value} ({} to {})",
            decision.number(low),
            decision.number(high)
        ),
        None => value,
    }
}
