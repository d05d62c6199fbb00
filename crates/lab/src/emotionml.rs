//! What the robots of a run felt, as EmotionML 1.0 (W3C Recommendation, 22 May 2014), for the tools of
//! people who study emotions.
//!
//! One `<emotion>` is one episode: the longest span of ticks in which a robot is in one emotion state. An `<emotion>` has
//! one set for each kind of descriptor, so that a name of this project and a name of W3C's vocabularies cannot both be
//! categories of it, and a second `<emotion>` with the same times would count every episode twice. So there are two views
//! of a run, with the same episodes under the same ids: the default speaks in the robots' own words, which the document
//! declares, each with what is nearest to it; [`View::Standard`] speaks in W3C's vocabularies alone.
//!
//! The run is read tick by tick and written episode by episode. What stays in memory is the episodes in progress: two
//! numbers a tick of each.

mod document;
mod episode;
mod notes;
mod source;
mod terms;

use std::io::Write;
use std::path::Path;

use miette::miette;
use protocol::RobotName;
use simulator::RunFolder;

use document::Document;
use episode::Episodes;
use source::{Moment, Source};

/// Whose words a document is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// The robots' own names of emotions and action tendencies, declared by the document.
    Own,
    /// What is nearest to them in W3C's vocabularies.
    Standard,
}

/// A run that is being exported.
pub struct Export {
    source: Source,
    first: Moment,
    only: Option<RobotName>,
}

/// Why a document stays incomplete; it then lacks its end, so that it cannot be taken for the whole.
#[derive(Debug)]
pub enum ExportError {
    /// The record of the run cannot be used.
    Read(miette::Report),
    /// The document cannot be written.
    Write(std::io::Error),
}

impl From<miette::Report> for ExportError {
    fn from(report: miette::Report) -> Self {
        Self::Read(report)
    }
}

impl From<std::io::Error> for ExportError {
    fn from(error: std::io::Error) -> Self {
        Self::Write(error)
    }
}

impl Export {
    /// Opens the record of a run; `only` limits the export to one robot.
    ///
    /// # Errors
    /// If there is no record, or it holds no such robot.
    pub fn open(folder: &RunFolder, only: Option<RobotName>) -> miette::Result<Self> {
        let mut source = Source::open(folder)?;
        let first = source
            .next()?
            .ok_or_else(|| miette!("{} holds no tick yet", source.path().display()))?;
        check_robot(only.as_ref(), &first)?;

        Ok(Self {
            source,
            first,
            only,
        })
    }

    /// The file that is exported.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.source.path()
    }

    /// Writes the document.
    ///
    /// # Errors
    /// [`ExportError`] if the record cannot be read to its end, or the document cannot be written.
    pub fn write(self, out: &mut impl Write, view: View) -> Result<(), ExportError> {
        let Self {
            mut source,
            first,
            only,
        } = self;
        let roster = first
            .robots
            .iter()
            .map(|robot| robot.name.clone())
            .collect();
        let facts = source.facts().clone();
        let mut document = Document::begin(&mut *out, facts, roster, view == View::Standard)?;

        let mut episodes = Episodes::default();
        let mut moment = Some(first);
        while let Some(Moment { tick, robots }) = moment {
            for seen in robots {
                if only.as_ref().is_some_and(|only| *only != seen.name) {
                    continue;
                }
                if let Some(ended) = episodes.see(tick, seen) {
                    document.emotion(&ended)?;
                }
            }
            moment = source.next()?;
        }

        for ended in episodes.end() {
            document.emotion(&ended)?;
        }
        document.end()?;
        Ok(out.flush()?)
    }
}

fn check_robot(only: Option<&RobotName>, first: &Moment) -> miette::Result<()> {
    let Some(only) = only else {
        return Ok(());
    };

    let mut names = Vec::new();
    for robot in &first.robots {
        names.push(robot.name.as_str());
    }

    if names.contains(&only.as_str()) {
        return Ok(());
    }

    Err(miette!(
        "no robot of this run is called {only}; there are {}",
        names.join(", ")
    ))
}
