//! Where the parts of a file are: read from the index at its end, or found record by record in a file that has none.

use std::fmt::Display;
use std::fs::{File, Metadata};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::Path;

use mcap::MAGIC;
use mcap::records::{ChunkHeader, Record, op};

use crate::damage::{Name, RecordingError};

/// Bytes of a record before its body: operation code and length.
const RECORD_HEAD: u64 = 9;
/// Bytes of the record at the end of a finished file.
const FOOTER: u64 = RECORD_HEAD + 20;
/// Longest record and largest chunk, bytes. A chunk ends after 256 KiB; one tick of thousands of robots can be longer.
const MAX_BYTES: u64 = 1 << 30;

/// A file with its name and length.
#[derive(Debug)]
pub(crate) struct Bytes {
    pub(crate) name: Name,
    file: File,
    len: u64,
}

/// A chunk of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Chunk {
    pub(crate) offset: u64,
    /// Simulated time of its first message, nanoseconds.
    pub(crate) start_ns: u64,
    /// Simulated time of its last message, nanoseconds.
    pub(crate) end_ns: u64,
    /// Its size before compression, bytes.
    pub(crate) size: u64,
}

/// The parts of a file.
#[derive(Debug, Default)]
pub(crate) struct Index {
    pub(crate) chunks: Vec<Chunk>,
    /// Offset of the attached scenario.
    pub(crate) scenario: Option<u64>,
    /// Whether the file was finished.
    pub(crate) is_finished: bool,
    /// Where a file without an index goes on.
    pub(crate) end: u64,
}

/// A record, not decoded.
struct RecordHead {
    op: u8,
    /// Where its body begins.
    body: u64,
    len: u64,
}

impl Bytes {
    pub(crate) fn new(name: Name, file: File) -> Result<Self, RecordingError> {
        let metadata = file.metadata().map_err(|error| name.unreadable(error))?;
        Ok(Self {
            len: metadata.len(),
            name,
            file,
        })
    }

    /// Whether the file is at this path: another one may have taken its name.
    pub(crate) fn is_at(&self, path: &Path) -> bool {
        let identity = |metadata: Metadata| (metadata.dev(), metadata.ino());
        let own = self.file.metadata().map(identity);
        let there = path.metadata().map(identity);
        matches!((own, there), (Ok(own), Ok(there)) if own == there)
    }

    /// Finds the parts that have been written from `end` on, which another call has returned.
    pub(crate) fn grown(&mut self, end: u64) -> Result<Index, RecordingError> {
        let metadata = self.file.metadata();
        let metadata = metadata.map_err(|error| self.name.unreadable(error))?;
        self.len = metadata.len();

        let mut index = self.scan(end)?;
        index.is_finished = self.summary()?.is_some();
        Ok(index)
    }

    /// Reads bytes that are within the file.
    fn read(&self, offset: u64, len: u64) -> Result<Vec<u8>, RecordingError> {
        let is_within = offset.checked_add(len).is_some_and(|end| end <= self.len);
        if !is_within || len > MAX_BYTES {
            return Err(self.name.damaged(offset, &"a length is wrong"));
        }

        let mut bytes = vec![0; len as usize];
        self.file
            .read_exact_at(&mut bytes, offset)
            .map_err(|error| self.name.unreadable(error))?;
        Ok(bytes)
    }

    /// The head of the record at an offset; `None` if the file ends within it.
    fn record_at(&self, offset: u64) -> Result<Option<RecordHead>, RecordingError> {
        let head_end = offset.checked_add(RECORD_HEAD);
        if head_end.is_none_or(|end| end > self.len) {
            return Ok(None);
        }

        let head = self.read(offset, RECORD_HEAD)?;
        let record = RecordHead {
            op: head[0],
            body: offset + RECORD_HEAD,
            len: little_endian(&head[1..]),
        };
        let end = record.body.checked_add(record.len);
        Ok(end.is_some_and(|end| end <= self.len).then_some(record))
    }

    fn body(&self, record: &RecordHead) -> Result<Vec<u8>, RecordingError> {
        self.read(record.body, record.len)
    }

    /// Finds the parts of the file.
    pub(crate) fn index(&self) -> Result<Index, RecordingError> {
        let begins = self.len >= MAGIC.len() as u64 && self.read(0, MAGIC.len() as u64)? == MAGIC;
        if !begins {
            return Err(self.name.headless());
        }

        // An index that is damaged is not needed.
        match self.summary()?.and_then(|summary| self.indexed(&summary)) {
            Some(index) => Ok(index),
            None => self.scan(MAGIC.len() as u64),
        }
    }

    fn has_end(&self) -> Result<bool, RecordingError> {
        let magic = MAGIC.len() as u64;
        Ok(self.len >= 2 * magic + FOOTER && self.read(self.len - magic, magic)? == MAGIC)
    }

    /// The index at the end of a finished file, undamaged.
    fn summary(&self) -> Result<Option<Vec<u8>>, RecordingError> {
        if !self.has_end()? {
            return Ok(None);
        }

        let footer = self.len - MAGIC.len() as u64 - FOOTER;
        let start = little_endian(&self.read(footer + RECORD_HEAD, 8)?);
        if start < MAGIC.len() as u64 || start > footer || footer - start > MAX_BYTES {
            return Ok(None);
        }

        // The checksum covers everything up to itself.
        let bytes = self.read(start, footer + FOOTER - start)?;
        let (covered, stated) = bytes.split_at(bytes.len() - 4);
        if u64::from(crc32fast::hash(covered)) != little_endian(stated) {
            return Ok(None);
        }
        Ok(Some(bytes[..(footer - start) as usize].to_vec()))
    }

    /// The parts that an index names; `None` if it is not one that [`crate::Writer`] has written.
    fn indexed(&self, summary: &[u8]) -> Option<Index> {
        let mut index = Index {
            is_finished: true,
            ..Index::default()
        };
        let mut rest = summary;
        while !rest.is_empty() {
            let (head, after) = rest.split_at_checked(RECORD_HEAD as usize)?;
            let len = usize::try_from(little_endian(&head[1..])).ok()?;
            let (body, after) = after.split_at_checked(len)?;
            rest = after;

            if head[0] == op::CHUNK_INDEX
                && let Record::ChunkIndex(chunk) = mcap::parse_record(head[0], body).ok()?
            {
                index.chunks.push(Chunk {
                    offset: chunk.chunk_start_offset,
                    start_ns: chunk.message_start_time,
                    end_ns: chunk.message_end_time,
                    size: chunk.uncompressed_size,
                });
            }
            if head[0] == op::ATTACHMENT_INDEX {
                index.scenario = Some(little_endian(body.get(..8)?));
            }
        }

        Some(index)
    }

    /// Finds the parts of a file that was not finished, from an offset up to where it is cut off.
    fn scan(&self, from: u64) -> Result<Index, RecordingError> {
        let mut index = Index::default();
        let mut offset = from;
        while let Some(record) = self.record_at(offset)? {
            index.end = offset;
            match record.op {
                op::CHUNK => {
                    let header = self.chunk_header(&record)?;
                    index.chunks.push(Chunk {
                        offset,
                        start_ns: header.message_start_time,
                        end_ns: header.message_end_time,
                        size: header.uncompressed_size,
                    });
                }
                op::ATTACHMENT => index.scenario = Some(offset),
                op::HEADER | op::METADATA | op::MESSAGE_INDEX => {}
                op::DATA_END => return Ok(index),
                other => {
                    let reason = format!("an unknown record of type {other}");
                    return Err(self.name.damaged(offset, &reason));
                }
            }
            offset = record.body + record.len;
        }
        index.end = offset;

        if self.has_end()? {
            return Err(self.name.damaged(offset, &"a length is wrong"));
        }
        Ok(index)
    }

    /// The header of a chunk, without its content.
    fn chunk_header(&self, record: &RecordHead) -> Result<ChunkHeader, RecordingError> {
        // Four numbers of 8 bytes, a checksum, and the name of a compression with its length.
        let len = record.len.min(4 * 8 + 4 + 4 + 16);
        let mut body = self.read(record.body, len)?;
        let at = 8 + 8 + 8 + 4;
        let compression = body.get(at..at + 4).map_or(u64::MAX, little_endian);
        let size_at = usize::try_from(compression).unwrap_or(usize::MAX);
        let size_at = size_at.saturating_add(at + 4);

        // The size of a content that is left out.
        match body.get_mut(size_at..size_at.saturating_add(8)) {
            Some(size) => size.fill(0),
            None => return Err(self.name.damaged(record.body, &"a chunk without a header")),
        }
        match mcap::parse_record(op::CHUNK, &body) {
            Ok(Record::Chunk { header, .. }) => Ok(header),
            Ok(_) => Err(self.name.damaged(record.body, &"not a chunk")),
            Err(error) => Err(self.name.damaged(record.body, &error)),
        }
    }

    /// The content of a chunk: decompressed and compared with its checksum.
    pub(crate) fn chunk(&self, chunk: &Chunk) -> Result<Vec<u8>, RecordingError> {
        let damaged = |reason: &dyn Display| self.name.damaged(chunk.offset, reason);

        let record = self.record_at(chunk.offset)?;
        let record = record.filter(|record| record.op == op::CHUNK);
        let record = record.ok_or_else(|| damaged(&"no chunk where the index has one"))?;
        let body = self.body(&record)?;
        let parsed = mcap::parse_record(op::CHUNK, &body);
        let Ok(Record::Chunk { header, data }) = parsed else {
            return Err(damaged(&"not a chunk"));
        };
        if header.message_start_time != chunk.start_ns || header.message_end_time != chunk.end_ns {
            return Err(damaged(&"its times are not those of the index"));
        }
        if header.uncompressed_size > MAX_BYTES {
            return Err(damaged(&"a length is wrong"));
        }

        let size = header.uncompressed_size as usize;
        let content = match header.compression.as_str() {
            "zstd" => zstd::bulk::decompress(&data, size).map_err(|error| damaged(&error))?,
            other => return Err(damaged(&format!("unknown compression {other:?}"))),
        };
        if content.len() != size || crc32fast::hash(&content) != header.uncompressed_crc {
            return Err(damaged(&"the checksum is wrong"));
        }
        Ok(content)
    }

    /// The content of the attachment at an offset, compared with its checksum.
    pub(crate) fn attachment(&self, offset: u64) -> Result<Vec<u8>, RecordingError> {
        let damaged = || {
            self.name
                .damaged(offset, &"the attached scenario is damaged")
        };

        let record = self.record_at(offset)?;
        let record = record.filter(|record| record.op == op::ATTACHMENT);
        let body = self.body(&record.ok_or_else(damaged)?)?;
        let (covered, stated) = body
            .split_at_checked(body.len().saturating_sub(4))
            .ok_or_else(damaged)?;
        if covered.is_empty() || u64::from(crc32fast::hash(covered)) != little_endian(stated) {
            return Err(damaged());
        }
        let data = attached(covered).ok_or_else(damaged)?;
        Ok(data.to_vec())
    }
}

/// The data in the body of an attachment, after two times and two texts.
fn attached(body: &[u8]) -> Option<&[u8]> {
    let rest = after_text(body.get(2 * 8..)?)?;
    let (len, data) = after_text(rest)?.split_at_checked(8)?;
    data.get(..usize::try_from(little_endian(len)).ok()?)
}

/// What follows a text, which has its length before it.
fn after_text(bytes: &[u8]) -> Option<&[u8]> {
    let (len, rest) = bytes.split_at_checked(4)?;
    rest.get(usize::try_from(little_endian(len)).ok()?..)
}

/// At most eight bytes as a number.
fn little_endian(bytes: &[u8]) -> u64 {
    let mut number = [0; 8];
    let len = bytes.len().min(8);
    number[..len].copy_from_slice(&bytes[..len]);
    u64::from_le_bytes(number)
}
