//! The queue of a sender: messages wait until those before them have been sent.

/// How fast a radio sends, and how much may wait.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmitter {
    /// Bits that it sends in a second.
    pub bit_rate_bps: f64,
    /// Most bytes that are not sent yet, those of the message that is being sent included.
    pub queue_bytes: f64,
    /// Bytes of each message beside its content: preamble, header, checksum.
    pub overhead_bytes: f64,
}

/// The messages that a sender has not sent yet, first in, first out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SendQueue {
    /// When the last of them is sent, seconds.
    free_at_s: f64,
}

impl SendQueue {
    /// Adds a message with this content. Returns when its last bit is sent, seconds; `None` if the queue has no room for it, and then
    /// nothing has changed. Times never decrease from one message to the next.
    pub fn offer(&mut self, now_s: f64, content_bytes: usize, by: &Transmitter) -> Option<f64> {
        let message_bytes = content_bytes as f64 + by.overhead_bytes;
        let waiting_bytes = self.backlog_s(now_s) * by.bit_rate_bps / 8.0;
        if waiting_bytes + message_bytes > by.queue_bytes {
            return None;
        }

        let begin_s = self.free_at_s.max(now_s);
        self.free_at_s = begin_s + message_bytes * 8.0 / by.bit_rate_bps;
        Some(self.free_at_s)
    }

    /// The time until all is sent, seconds.
    #[must_use]
    pub fn backlog_s(&self, now_s: f64) -> f64 {
        (self.free_at_s - now_s).max(0.0)
    }
}
