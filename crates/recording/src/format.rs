//! The format of the file, MCAP (<https://mcap.dev/spec>): its operation codes, and the fields of a record as they are written and
//! read. All numbers are little-endian.

use std::collections::BTreeMap;

/// The bytes at the beginning and at the end of a file.
pub(crate) const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Operation codes.
pub(crate) mod op {
    pub(crate) const HEADER: u8 = 0x01;
    pub(crate) const FOOTER: u8 = 0x02;
    pub(crate) const SCHEMA: u8 = 0x03;
    pub(crate) const CHANNEL: u8 = 0x04;
    pub(crate) const MESSAGE: u8 = 0x05;
    pub(crate) const CHUNK: u8 = 0x06;
    pub(crate) const MESSAGE_INDEX: u8 = 0x07;
    pub(crate) const CHUNK_INDEX: u8 = 0x08;
    pub(crate) const ATTACHMENT: u8 = 0x09;
    pub(crate) const ATTACHMENT_INDEX: u8 = 0x0A;
    pub(crate) const STATISTICS: u8 = 0x0B;
    pub(crate) const METADATA: u8 = 0x0C;
    pub(crate) const METADATA_INDEX: u8 = 0x0D;
    pub(crate) const SUMMARY_OFFSET: u8 = 0x0E;
    pub(crate) const DATA_END: u8 = 0x0F;
}

/// A record that is appended to bytes: an operation code, its length, and fields in little-endian.
pub(crate) struct RecordBytes<'a> {
    pub(crate) bytes: &'a mut Vec<u8>,
    /// Where its body begins.
    body: usize,
}

impl<'a> RecordBytes<'a> {
    pub(crate) fn begin(bytes: &'a mut Vec<u8>, op: u8) -> Self {
        bytes.push(op);
        bytes.extend_from_slice(&[0; 8]);
        Self {
            body: bytes.len(),
            bytes,
        }
    }

    pub(crate) fn u16(&mut self, value: u16) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn u64(&mut self, value: u64) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.u32(text.len() as u32);
        self.bytes.extend_from_slice(text.as_bytes());
    }

    /// Texts by texts, with the length of all.
    pub(crate) fn map(&mut self, map: &BTreeMap<String, String>) {
        let mut len = 0;
        for (key, value) in map {
            len += 4 + key.len() + 4 + value.len();
        }
        self.u32(len as u32);
        for (key, value) in map {
            self.text(key);
            self.text(value);
        }
    }

    pub(crate) fn body(&self) -> &[u8] {
        &self.bytes[self.body..]
    }

    /// Ends the record: its length is known.
    pub(crate) fn end(self) {
        let len = (self.bytes.len() - self.body) as u64;
        self.bytes[self.body - 8..self.body].copy_from_slice(&len.to_le_bytes());
    }
}

/// The fields of a record that have not been read yet. A method returns `None` where bytes are missing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Fields<'a> {
    pub(crate) fn bytes(&mut self, len: u64) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(usize::try_from(len).ok()?)?;
        self.0 = rest;
        Some(bytes)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// A text, which has its length before it.
    pub(crate) fn text(&mut self) -> Option<&'a str> {
        let len = self.u32()?;
        std::str::from_utf8(self.bytes(len.into())?).ok()
    }

    /// Texts by texts, which have their length before them.
    pub(crate) fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let len = self.u32()?;
        let mut entries = Fields(self.bytes(len.into())?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            let key = entries.text()?;
            let value = entries.text()?;
            map.insert(key.to_owned(), value.to_owned());
        }
        Some(map)
    }

    /// A record: its operation code and its body.
    pub(crate) fn record(&mut self) -> Option<(u8, &'a [u8])> {
        let op = self.u8()?;
        let len = self.u64()?;
        Some((op, self.bytes(len)?))
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*bytes)
    }
}
