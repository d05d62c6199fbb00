//! The log of a process: what it prints, up to a limit. Of a longer output the beginning and the end are kept.

use std::fs::{File, Permissions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Longest log of a process, bytes.
pub(super) const LIMIT_BYTES: u64 = 64 << 20;

/// The log of a process, which its pipes and its restarts share.
#[derive(Debug, Clone)]
pub(super) struct ProcessLog(Arc<Mutex<OpenLog>>);

#[derive(Debug)]
struct OpenLog {
    path: PathBuf,
    /// Whether only the owner may read it.
    is_private: bool,
    limit_bytes: u64,
    /// `None` until the process is started.
    file: Option<File>,
    size_bytes: u64,
    /// The end of the beginning that is kept, once the log has been shortened.
    head_bytes: Option<u64>,
    /// Length of the line in the place of what was left out.
    gap_line_bytes: u64,
    left_out_bytes: u64,
}

impl ProcessLog {
    /// The log at `path`. The file is not touched before [`Self::open`].
    pub(super) fn new(path: PathBuf, is_private: bool, limit_bytes: u64) -> Self {
        Self(Arc::new(Mutex::new(OpenLog {
            path,
            is_private,
            limit_bytes,
            file: None,
            size_bytes: 0,
            head_bytes: None,
            gap_line_bytes: 0,
            left_out_bytes: 0,
        })))
    }

    /// Opens the file to append, unless it is open.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub(super) fn open(&self) -> std::io::Result<()> {
        self.locked(OpenLog::open)
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// If the disk is full, for example.
    pub(super) fn append(&self, bytes: &[u8]) -> std::io::Result<()> {
        self.locked(|log| log.append(bytes))
    }

    fn locked<T>(&self, work: impl FnOnce(&mut OpenLog) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl OpenLog {
    fn open(&mut self) -> std::io::Result<()> {
        if self.file.is_some() {
            return Ok(());
        }

        let mode = if self.is_private { 0o600 } else { 0o666 };
        let file = File::options()
            .create(true)
            .read(true)
            .append(true)
            .mode(mode)
            .open(&self.path)?;
        if self.is_private {
            // An earlier log that could not be removed has the permissions of then.
            file.set_permissions(Permissions::from_mode(mode))?;
        }

        self.size_bytes = file.metadata()?.len();
        self.file = Some(file);
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        file.write_all(bytes)?;
        self.size_bytes += bytes.len() as u64;

        if self.size_bytes > self.limit_bytes {
            self.shorten()?;
        }
        Ok(())
    }

    /// Leaves out the middle: half of the limit is kept of the beginning and a quarter of the end, so that each byte is
    /// copied about once more, however long the output is.
    fn shorten(&mut self) -> std::io::Result<()> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };

        let head_bytes = match self.head_bytes {
            Some(head_bytes) => head_bytes,
            None => end_of_line_before(file, self.limit_bytes / 2)?,
        };
        let gap_end = head_bytes + self.gap_line_bytes;
        // What was left out before is not read again: the gap only grows.
        let tail_start = gap_end.max(self.size_bytes.saturating_sub(self.limit_bytes / 4));
        let mut tail = Vec::new();
        file.seek(SeekFrom::Start(tail_start))?;
        file.read_to_end(&mut tail)?;
        let line_start = tail.iter().position(|byte| *byte == b'\n');
        // Whole lines only, unless one is longer than what is kept.
        let tail = &tail[line_start.map_or(0, |end| end + 1)..];

        let kept_bytes = tail.len() as u64;
        self.left_out_bytes += (self.size_bytes - gap_end).saturating_sub(kept_bytes);
        let gap_line = format!(
            "[{} bytes are left out here: the log is limited to {} bytes]\n",
            self.left_out_bytes, self.limit_bytes
        );
        file.set_len(head_bytes)?;
        file.write_all(gap_line.as_bytes())?;
        file.write_all(tail)?;

        self.head_bytes = Some(head_bytes);
        self.gap_line_bytes = gap_line.len() as u64;
        self.size_bytes = head_bytes + self.gap_line_bytes + kept_bytes;
        Ok(())
    }
}

/// Longest search for the end of a line, bytes.
const LINE_BYTES: u64 = 64 << 10;

/// The end of the last line that ends before `at`; `at` itself if the line is very long.
fn end_of_line_before(file: &mut File, at: u64) -> std::io::Result<u64> {
    let start = at.saturating_sub(LINE_BYTES);
    let mut before = Vec::new();
    file.seek(SeekFrom::Start(start))?;
    file.take(at - start).read_to_end(&mut before)?;

    let end = before.iter().rposition(|byte| *byte == b'\n');
    Ok(end.map_or(at, |end| start + end as u64 + 1))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn log(folder: &Path, limit_bytes: u64) -> ProcessLog {
        let log = ProcessLog::new(folder.join("Butler.log"), false, limit_bytes);
        log.open().unwrap();
        log
    }

    fn read(folder: &Path) -> String {
        std::fs::read_to_string(folder.join("Butler.log")).unwrap()
    }

    /// The number in the line about what is left out, and the numbered lines around it.
    fn parts(text: &str) -> (u64, Vec<u64>) {
        let mut left_out = 0;
        let mut numbers = Vec::new();
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix('[') {
                assert_eq!(left_out, 0, "one gap: {text}");
                left_out = rest.split(' ').next().unwrap().parse().unwrap();
            } else {
                numbers.push(line.parse().unwrap());
            }
        }
        (left_out, numbers)
    }

    #[test]
    fn a_log_at_its_limit_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let log = log(folder.path(), 400);
        for number in 0..100 {
            log.append(format!("{number:03}\n").as_bytes()).unwrap();
        }
        let (left_out, numbers) = parts(&read(folder.path()));
        assert_eq!((left_out, numbers.len()), (0, 100));

        log.append(b"100\n").unwrap();
        let (left_out, numbers) = parts(&read(folder.path()));
        assert_eq!(left_out + 4 * numbers.len() as u64, 404);
        assert!(left_out > 0);
    }

    #[test]
    fn the_beginning_and_the_end_are_kept_and_every_byte_is_accounted_for() {
        for limit in [1000, 1001, 1003] {
            let folder = tempfile::tempdir().unwrap();
            let log = log(folder.path(), limit);
            for number in 0..10_000_u64 {
                log.append(format!("{number:06}\n").as_bytes()).unwrap();
                let (left_out, numbers) = parts(&read(folder.path()));
                assert_eq!(left_out + 7 * numbers.len() as u64, 7 * (number + 1));
                assert_eq!(numbers.first(), Some(&0));
                assert_eq!(numbers.last(), Some(&number));
                assert!(read(folder.path()).len() as u64 <= limit);
                if number > 400 {
                    assert!(numbers.iter().filter(|kept| **kept < 70).count() >= 70);
                }
            }
        }
    }

    #[test]
    fn output_without_lines_is_bounded_too() {
        let folder = tempfile::tempdir().unwrap();
        let log = log(folder.path(), 10_000);
        for _ in 0..100 {
            log.append(&[b'x'; 7000]).unwrap();
        }
        let text = read(folder.path());
        assert!(text.len() <= 10_000, "{}", text.len());
        let kept = text.bytes().filter(|byte| *byte == b'x').count();
        assert!(
            text.contains(&format!("[{} bytes", 700_000 - kept)),
            "{text}"
        );
    }

    #[test]
    fn a_log_that_is_opened_again_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        log(folder.path(), 1000).append(b"1\n").unwrap();
        log(folder.path(), 1000).append(b"2\n").unwrap();
        assert_eq!(read(folder.path()), "1\n2\n");
    }
}
