//! Files that commands write: they get their names when they are complete.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Stdout, Write};
use std::path::Path;

use experiments::is_of_experiment;
use export::draft::{Draft, unwritable};
use record::RunFolder;

use crate::errors::{Result, refusal};

/// Paths of the standard output.
const STANDARD: [&str; 3] = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
/// What paths of files begin with that this process has open.
const OPEN: [&str; 3] = ["/dev/stderr", "/dev/fd/", "/proc/"];

/// Where a command writes. [`Destination::finish`] completes it; a file that is not completed is as it was before, or not there.
#[derive(Debug)]
pub(crate) enum Destination {
    /// A file, which is replaced as a whole.
    File(Draft),
    /// A pipe or a device.
    Stream(BufWriter<File>),
    /// The standard output.
    Standard(BufWriter<Stdout>),
}

impl Destination {
    /// Begins to write to a path; without one to the standard output.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn create(path: Option<&Path>) -> Result<Self> {
        let Some(path) = path.filter(|path| !STANDARD.iter().any(|name| *path == Path::new(name)))
        else {
            return Ok(Self::Standard(BufWriter::new(std::io::stdout())));
        };

        check_no_record(path)?;
        let is_special = path
            .metadata()
            .is_ok_and(|found| !found.is_file() && !found.is_dir());
        let is_open = OPEN.iter().any(|open| path.starts_with(open));
        if is_special || is_open {
            // What others have written before stays.
            let file = File::options().append(true).open(path);
            let file = file.map_err(|error| unwritable(path, &error))?;
            return Ok(Self::Stream(BufWriter::new(file)));
        }
        Ok(Self::File(Draft::follow(path)?))
    }

    /// Completes it. Returns whether everything was written: a reader may have seen enough.
    ///
    /// # Errors
    /// The reason why it cannot be written.
    pub(crate) fn finish(mut self) -> Result<()> {
        match self.flush() {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(()),
            flushed => flushed.map_err(|error| refusal!("cannot write: {error}"))?,
        }
        if let Self::File(draft) = self {
            draft.publish()?;
        }
        Ok(())
    }
}

impl Write for Destination {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::File(draft) => draft.write(bytes),
            Self::Stream(stream) => stream.write(bytes),
            Self::Standard(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::File(draft) => draft.flush(),
            Self::Stream(stream) => stream.flush(),
            Self::Standard(out) => out.flush(),
        }
    }
}

/// Writes a text to a path; without one to the standard output.
///
/// # Errors
/// If it cannot be written. A file is then as it was before, or not there.
pub(crate) fn write(path: Option<&Path>, text: &str) -> Result<()> {
    let mut output = Destination::create(path)?;
    match output.write_all(text.as_bytes()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(cannot_write(path, &error)),
        Ok(()) => output.finish(),
    }
}

/// Checks that a path is not that of a part of a record.
///
/// # Errors
/// If it is.
pub(crate) fn check_no_record(path: &Path) -> Result<()> {
    if is_part_of_record(path) {
        return Err(refusal!(
            help = "choose another --output",
            "{} is part of the record of a run or an experiment",
            path.display()
        ));
    }
    Ok(())
}

/// Whether a path is that of a part of the record of a run or an experiment: as it is given, with its folder's links resolved, or with
/// all links resolved.
fn is_part_of_record(path: &Path) -> bool {
    let absolute = std::path::absolute(path).ok();
    // The folder of the absolute path is never the empty path.
    let folder = absolute.as_deref().and_then(Path::parent);
    let in_folder = folder
        .and_then(|folder| folder.canonicalize().ok())
        .zip(path.file_name())
        .map(|(folder, name)| folder.join(name));
    let resolved = path.canonicalize().ok();

    let mut places = [absolute, in_folder, resolved].into_iter().flatten();
    places.any(|place| RunFolder::is_of_run(&place) || is_of_experiment(&place))
}

/// The error of an output that cannot be written.
pub(crate) fn cannot_write(
    path: Option<&Path>,
    error: &std::io::Error,
) -> Box<dyn Error + Send + Sync> {
    match path {
        Some(path) => unwritable(path, error).into(),
        None => refusal!("cannot write to the standard output: {error}"),
    }
}
