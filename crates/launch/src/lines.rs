//! Bytes of a pipe as lines for a terminal.

/// Longest line that is shown in one piece, bytes.
const MAX_LINE: usize = 4096;

/// Splits what comes in pieces into lines.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    rest: Vec<u8>,
}

impl Lines {
    /// Takes the next bytes; calls `each` for every line that is complete.
    pub(crate) fn push(&mut self, bytes: &[u8], mut each: impl FnMut(String)) {
        for piece in bytes.split_inclusive(|byte| *byte == b'\n') {
            self.rest.extend_from_slice(piece);
            if piece.ends_with(b"\n") || self.rest.len() >= MAX_LINE {
                each(self.take());
            }
        }
    }

    /// The pipe is at its end; so is its last line.
    pub(crate) fn finish(&mut self, mut each: impl FnMut(String)) {
        if !self.rest.is_empty() {
            each(self.take());
        }
    }

    fn take(&mut self) -> String {
        let line = std::mem::take(&mut self.rest);
        String::from_utf8_lossy(&line)
            .trim_end_matches(['\n', '\r'])
            .to_owned()
    }
}

/// A text from outside without what would steer a terminal.
pub(crate) fn harmless(text: &str) -> String {
    text.chars()
        .map(|c| {
            if c.is_control() {
                char::REPLACEMENT_CHARACTER
            } else {
                c
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(pieces: &[&[u8]]) -> Vec<String> {
        let (mut lines, mut got) = (Lines::default(), Vec::new());
        pieces
            .iter()
            .for_each(|piece| lines.push(piece, |line| got.push(line)));
        lines.finish(|line| got.push(line));
        got
    }

    #[test]
    fn lines_are_lines_however_the_pipe_cuts_them() {
        assert_eq!(
            lines(&[b"on", b"e\ntwo\r\n\nth", b"ree"]),
            ["one", "two", "", "three"]
        );
        assert_eq!(lines(&[b"\xff\n"]), ["\u{fffd}"]);
        assert_eq!(lines(&[]), [""; 0]);
    }

    #[test]
    fn an_endless_line_is_shown_in_pieces() {
        let piece = [b'x'; MAX_LINE];
        assert_eq!(lines(&[&piece, &piece, b"y\n"]).len(), 3);
    }
}
