//! Pictures: as `cars report` and `cars diagram` draw them, and the answers of `cars why` that are in them.

use std::path::PathBuf;

use experiments::PLAN;
use lab::LabError;
use lab::folder::{recorded_epoch, recorded_epochs};
use lab::moment::Moment;
use pictures::Page;
use pyo3::prelude::*;
use record::RunFolder;
use reports::diagram::{DiagramOptions, Window, draw};
use reports::{decisions, of_experiment, of_runs};

use crate::error::{plain, reported};

/// The report about runs, or about one experiment, by their folders: HTML.
#[pyfunction]
pub(crate) fn report(py: Python<'_>, folders: Vec<PathBuf>) -> PyResult<String> {
    py.detach(|| page(folders).map(Page::finish))
        .map_err(reported)
}

/// The figures of that report, each as a page of its own.
#[pyfunction]
pub(crate) fn figures(py: Python<'_>, folders: Vec<PathBuf>) -> PyResult<Vec<String>> {
    py.detach(|| page(folders).map(Page::into_figures))
        .map_err(reported)
}

fn page(folders: Vec<PathBuf>) -> Result<Page, LabError> {
    if let [folder] = &folders[..]
        && folder.join(PLAN).exists()
    {
        return of_experiment(folder);
    }
    let runs: Vec<RunFolder> = folders.into_iter().map(RunFolder::at).collect();
    of_runs(&runs)
}

/// The space-time diagram of the last epoch of a run: SVG, and what it lacks, a sentence each.
#[pyfunction]
pub(crate) fn diagram(
    py: Python<'_>,
    run: PathBuf,
    from: Option<&str>,
    to: Option<&str>,
    queries: bool,
    whole: bool,
) -> PyResult<(String, Vec<String>)> {
    let window = Window {
        from: from.map(str::parse::<Moment>).transpose().map_err(plain)?,
        to: to.map(str::parse::<Moment>).transpose().map_err(plain)?,
    };

    let drawn = py.detach(|| -> Result<_, LabError> {
        let folder = RunFolder::at(run);
        let files = recorded_epoch(&folder, None)?;
        let mut title = folder.title();
        if recorded_epochs(&folder)?.len() > 1 {
            title += &format!(", epoch {}", files.epoch);
        }

        let decided = decisions(&folder, &files)?;
        let options = DiagramOptions {
            title,
            decisions: decided.all,
            queries,
            is_whole: whole,
            ..DiagramOptions::default()
        };
        let mut drawn = draw(&files, window, options)?;
        drawn.notes.extend(decided.notes);
        Ok(drawn)
    });

    let drawn = drawn.map_err(reported)?;
    Ok((drawn.svg, drawn.notes))
}

/// The answers of `cars why` about the last epoch of a run, each as JSON, and what cannot be read of them, a sentence each.
#[pyfunction]
pub(crate) fn answers(py: Python<'_>, run: PathBuf) -> PyResult<(Vec<String>, Vec<String>)> {
    let found = py.detach(|| {
        let folder = RunFolder::at(run);
        let files = recorded_epoch(&folder, None)?;
        decisions(&folder, &files)
    });
    let found = found.map_err(reported)?;
    let answers = found.all.iter().map(serde_json::to_string);
    let answers = answers.collect::<Result<_, _>>().map_err(plain)?;
    Ok((answers, found.notes))
}
