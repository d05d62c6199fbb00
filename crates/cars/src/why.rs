//! `cars why`: what decided a recorded run.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use causes::{WhyAnswer, WhyBudget, WhyOptions, why as find_out};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use lab::LabError;
use lab::folder::{find, recorded_epoch, run_name};
use lab::run::project_robots;
use protocol::Epoch;
use protocol::time::time_s;
use record::names::LATEST;
use terminal::OutputError;

use crate::errors::{Result, refusal};

/// Most jumps and causes that are printed.
const MAX_ROWS: usize = 20;
/// The exit status after a second Ctrl-C, as shells have it.
pub(crate) const INTERRUPTED: i32 = 130;
/// Set by Ctrl-C: what was played is kept.
static STOP: AtomicBool = AtomicBool::new(false);

/// `cars why`.
#[derive(Debug, Args)]
pub(crate) struct WhyArgs {
    /// Name or folder of a run; without it the latest run.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    /// The name of an expectation or of a measure of the scenario, a condition such as '{ robot = "Butler", behavior = "INTERCEPT" }',
    /// or the path of a number of the summary, such as robots.Butler.blocked; without it the expectation that failed first, or else
    /// the last one.
    #[arg(value_name = "WHAT")]
    what: Option<String>,
    /// Most forks, such as 2000, or the time after which no fork is begun, such as "5 min"; without it as many as the answer needs. The
    /// same number of forks gives the same answer.
    #[arg(long, value_name = "FORKS|TIME")]
    budget: Option<WhyBudget>,
    /// Number of forks at the same time; without it the number of processors. The answer does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// The epoch; without it the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Print the answer as JSON, as its file has it.
    #[arg(long)]
    json: bool,
}

/// Finds out what decided a run.
pub(crate) fn why(args: &WhyArgs) -> Result<ExitCode> {
    let folder = find(&args.out, &args.run)?.resolved()?;
    let files = recorded_epoch(&folder, args.epoch)?;
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            // Whoever asks a second time does not want to wait for the forks in progress.
            std::process::exit(INTERRUPTED);
        }
    })?;

    let jobs = match args.jobs {
        Some(jobs) => jobs as usize,
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let options = WhyOptions {
        what: args.what.clone(),
        budget: args.budget,
        jobs,
        make: project_robots(),
        stop: &STOP,
    };
    let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed}")?;
    let bar = ProgressBar::new_spinner().with_style(style);
    let found = find_out(
        &folder,
        &run_name(&folder),
        &files,
        &options,
        &mut |progress| {
            bar.set_message(format!(
                "{} forks asked for, now after tick {}",
                progress.forks, progress.tick
            ));
            bar.tick();
        },
    );
    bar.finish_and_clear();
    let (answer, path) = found.map_err(|error| match error {
        LabError::Interrupted => refusal!(
            help = "the forks that were played are kept: the same command goes on",
            "interrupted"
        ),
        error => error.into(),
    })?;

    let printed = if args.json {
        let json = serde_json::to_string_pretty(&answer)?;
        terminal::data(format_args!("{json}\n"))
    } else {
        let text = in_words(&answer);
        terminal::print_line(format_args!("{text}\nanswer: {}", path.display()))
    };
    OutputError::unless_closed(printed)?;
    Ok(ExitCode::SUCCESS)
}

/// The answer for people: a sentence, and a table of what was tried.
fn in_words(answer: &WhyAnswer) -> String {
    let mut text = format!("{}\n", answer.sentence);

    let is_share = answer.is_share;
    let mut rows = Vec::new();
    for jump in &answer.jumps {
        let time_s = format!("{} s", time_s(jump.shown.tick, answer.tick_s));
        rows.push([
            time_s.clone(),
            "before".to_owned(),
            jump.shown.before.in_words_with_count(is_share),
        ]);
        rows.push([
            time_s.clone(),
            "after".to_owned(),
            jump.shown.after.in_words_with_count(is_share),
        ]);
        // What other chance could not leave out was not tried.
        for tried in jump.tried.iter().filter(|tried| tried.without.n > 0) {
            let restores = if tried.restores { " *" } else { "" };
            let what = format!("without: {}{restores}", tried.what);
            rows.push([
                time_s.clone(),
                what,
                tried.without.in_words_with_count(is_share),
            ]);
        }
    }
    for effect in &answer.planned {
        let time_s = format!("{} s", time_s(effect.tick, answer.tick_s));
        let matters = if effect.matters { " *" } else { "" };
        rows.push([
            time_s,
            format!("without {}{matters}", effect.what),
            effect.without.in_words_with_count(is_share),
        ]);
    }
    let left_out = rows.len().saturating_sub(MAX_ROWS);
    rows.truncate(MAX_ROWS);
    if !rows.is_empty() {
        let head = ["time", "forks", "outcome"];
        text += &format!("\n{}\n", terminal::table(head, rows, 2, head.len()));
    }
    if left_out > 0 {
        text += &format!("{left_out} further rows are in the file of the answer\n");
    }

    if !answer.kinds.is_empty() {
        text +=
            "\nOther chance of one kind alone, from the first tick on, gives another outcome in:\n";
        for effect in &answer.kinds {
            text += &format!(
                "  {}: {}\n",
                effect.kind,
                effect.changed.in_words_with_count(true)
            );
        }
    }
    text + &format!("\n{} forks\n", answer.forks)
}
