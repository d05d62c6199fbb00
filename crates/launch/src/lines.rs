//! Splits the bytes of a pipe into lines for a terminal.

use protocol::plain::escape_line;

/// Longest line, bytes; a longer one is split.
const MAX_LINE: usize = 4096;

/// Splits pieces of a stream into lines, which are escaped: another program wrote them.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    rest: Vec<u8>,
}

impl Lines {
    /// Adds bytes and calls `each` for every complete line.
    pub(crate) fn push(&mut self, bytes: &[u8], mut each: impl FnMut(String)) {
        for piece in bytes.split_inclusive(|byte| *byte == b'\n') {
            self.rest.extend_from_slice(piece);
            if piece.ends_with(b"\n") || self.rest.len() >= MAX_LINE {
                each(self.take());
            }
        }
    }

    /// Calls `each` for the last line if it has no end.
    pub(crate) fn finish(&mut self, mut each: impl FnMut(String)) {
        if !self.rest.is_empty() {
            each(self.take());
        }
    }

    fn take(&mut self) -> String {
        let line = std::mem::take(&mut self.rest);
        let line = String::from_utf8_lossy(&line);
        escape_line(line.trim_end_matches(['\n', '\r']))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(pieces: &[&[u8]]) -> Vec<String> {
        let mut lines = Lines::default();
        let mut found = Vec::new();
        for piece in pieces {
            lines.push(piece, |line| found.push(line));
        }
        lines.finish(|line| found.push(line));
        found
    }

    #[test]
    fn lines_do_not_depend_on_the_pieces() {
        assert_eq!(
            lines(&[b"on", b"e\ntwo\r\n\nth", b"ree"]),
            ["one", "two", "", "three"]
        );
        assert_eq!(lines(&[b"\xff\n"]), ["\u{fffd}"]);
        assert_eq!(lines(&[]), [""; 0]);
        assert_eq!(
            lines(&[b"\x1b[2Jgone\rforged\n"]),
            [r"\u{1b}[2Jgone\rforged"]
        );
    }

    #[test]
    fn an_endless_line_is_split() {
        let piece = [b'x'; MAX_LINE];
        assert_eq!(lines(&[&piece, &piece, b"y\n"]).len(), 3);
    }
}
