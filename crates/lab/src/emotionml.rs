//! Exports the emotions of a run's robots as EmotionML 1.0 (W3C Recommendation, 22 May 2014).
//!
//! One `<emotion>` is one episode: the longest span of ticks in which a robot is in one emotion state. An `<emotion>` has
//! one vocabulary for each kind of descriptor, so it cannot hold a category of this project beside one of W3C's, and a
//! second `<emotion>` with the same times would count every episode twice. There are therefore two views of a run, with
//! the same episodes under the same ids. [`View::Own`] uses the robots' own names, which the document declares together
//! with the nearest terms of W3C; [`View::Standard`] uses W3C's vocabularies only.
//!
//! The run is read tick by tick and written episode by episode. Only the episodes in progress are in memory, seven numbers a
//! tick of each.

mod document;
mod episode;
mod reader;
mod terms;

use std::io::Write;
use std::path::Path;

use miette::miette;
use protocol::RobotName;
use record::RunFolder;

use document::Document;
use episode::Episodes;
use reader::{Reader, Snapshot};

/// The vocabularies of a document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// The robots' own names of emotions and action tendencies, declared by the document.
    Own,
    /// The nearest terms of W3C's vocabularies.
    Standard,
}

/// A run that is being exported.
pub struct Export {
    reader: Reader,
    first: Snapshot,
    only: Option<RobotName>,
}

/// Why a document is incomplete. It then has no end tag, so no program takes it for a complete one.
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
        let mut reader = Reader::open(folder)?;
        let first = reader
            .next()?
            .ok_or_else(|| miette!("{} holds no tick yet", reader.path().display()))?;
        check_robot(only.as_ref(), &first)?;

        Ok(Self {
            reader,
            first,
            only,
        })
    }

    /// The file that is exported.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.reader.path()
    }

    /// Writes the document. Returns notes for people about what it leaves out, a sentence each.
    ///
    /// # Errors
    /// [`ExportError`] if the record cannot be read to its end, or the document cannot be written.
    pub fn write(mut self, out: &mut impl Write, view: View) -> Result<Vec<String>, ExportError> {
        let names = self.first.robots.iter().map(|robot| robot.name.clone());
        let roster = names.collect();
        let facts = self.reader.facts().clone();
        let mut document = Document::begin(&mut *out, facts, roster, view == View::Standard)?;

        let mut episodes = Episodes::default();
        let mut snapshot = Some(self.first);
        while let Some(Snapshot { tick, robots }) = snapshot {
            for robot in robots {
                if self.only.as_ref().is_some_and(|only| *only != robot.name) {
                    continue;
                }
                if let Some(ended) = episodes.add(tick, robot) {
                    document.emotion(&ended)?;
                }
            }
            snapshot = self.reader.next()?;
        }

        let mut notes = self.reader.into_notes();
        notes.append(&mut episodes.notes);
        for ended in episodes.end() {
            document.emotion(&ended)?;
        }
        notes.extend(document.end()?);
        out.flush()?;
        Ok(notes)
    }
}

fn check_robot(only: Option<&RobotName>, first: &Snapshot) -> miette::Result<()> {
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
