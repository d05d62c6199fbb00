//! Where the parts of a file are: read from the index at its end, or found record by record in a file that has none.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::{File, Metadata};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::Path;

use crate::damage::{Name, RecordingError};
use crate::format::{Fields, MAGIC, op};
use crate::topic::Topic;

/// Bytes of a record before its body: operation code and length.
const RECORD_HEAD: u64 = 9;
/// Bytes of the record at the end of a finished file.
const FOOTER: u64 = RECORD_HEAD + 20;
/// Bytes of the record between the data and the index.
const DATA_END: u64 = RECORD_HEAD + 4;
/// In the place of a checksum: the program that wrote the file did not compute it.
const NO_CHECKSUM: u64 = 0;
/// In the place of an operation code: nothing was written here.
const UNWRITTEN: u8 = 0;
/// Bytes that are read at once where all of a file is read.
const BLOCK: u64 = 1 << 20;
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
pub(crate) struct ChunkLocation {
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
    pub(crate) chunks: Vec<ChunkLocation>,
    /// The channels that the index names, by number; `None` for one that only viewers read.
    pub(crate) topics: Vec<(u16, Option<Topic>)>,
    /// Offset of the attached scenario.
    pub(crate) scenario: Option<u64>,
    /// Offsets of the records of metadata.
    pub(crate) metadata: Vec<u64>,
    /// Whether the file was finished.
    pub(crate) is_finished: bool,
    /// Where a file without an index goes on.
    pub(crate) end: u64,
}

/// What a chunk has before its content.
struct ChunkHeader<'a> {
    start_ns: u64,
    end_ns: u64,
    /// Bytes before compression.
    size: u64,
    checksum: u32,
    compression: &'a str,
}

impl<'a> ChunkHeader<'a> {
    /// Reads the fields of a chunk up to the length of its content.
    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            start_ns: fields.u64()?,
            end_ns: fields.u64()?,
            size: fields.u64()?,
            checksum: fields.u32()?,
            compression: fields.text()?,
        })
    }
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

        // From where the last look ended. A file is only appended to, so nothing before that changes.
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
        // One that is not whole is being written, or was cut off.
        Ok(end.is_some_and(|end| end <= self.len).then_some(record))
    }

    /// The body of the record at an offset; `None` if there is no whole record with this operation code.
    fn body_at(&self, offset: u64, op: u8) -> Result<Option<Vec<u8>>, RecordingError> {
        let record = self.record_at(offset)?;
        let record = record.filter(|record| record.op == op);
        record
            .map(|record| self.read(record.body, record.len))
            .transpose()
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
        // Nothing in the file is trusted before its checksum is right: a place that is wrong must not
        // be read from.
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
        let mut summary = Fields(summary);
        while !summary.0.is_empty() {
            let (op, body) = summary.record()?;
            let mut fields = Fields(body);
            match op {
                op::CHUNK_INDEX => index.chunks.push(indexed_chunk(&mut fields)?),
                op::CHANNEL => index.topics.push(indexed_topic(&mut fields)?),
                op::ATTACHMENT_INDEX => index.scenario = Some(fields.u64()?),
                op::METADATA_INDEX => index.metadata.push(fields.u64()?),
                _ => {}
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
                    index.chunks.push(self.scanned_chunk(offset, &record)?);
                }
                op::ATTACHMENT => index.scenario = Some(offset),
                op::METADATA => index.metadata.push(offset),
                op::HEADER | op::MESSAGE_INDEX => {}
                op::DATA_END => return Ok(index),
                // After a loss of power a file may be longer than what was written of it.
                UNWRITTEN if self.is_unwritten(offset)? => break,
                other => {
                    let reason = format!("an unknown record of type {other}");
                    return Err(self.name.damaged(offset, &reason));
                }
            }
            offset = record.body + record.len;
        }
        index.end = offset;

        // A file with an end is whole, so its records lead up to that end. If they did not, a length on
        // the way is wrong.
        if self.has_end()? {
            return Err(self.name.damaged(offset, &"a length is wrong"));
        }
        Ok(index)
    }

    /// Whether all bytes from an offset on are zero.
    fn is_unwritten(&self, offset: u64) -> Result<bool, RecordingError> {
        let mut is_zero = true;
        self.for_blocks(offset, self.len, |block| {
            is_zero &= block.iter().all(|byte| *byte == 0);
        })?;
        Ok(is_zero)
    }

    /// Calls `each` with the bytes of a range, block by block.
    fn for_blocks(
        &self,
        from: u64,
        to: u64,
        mut each: impl FnMut(&[u8]),
    ) -> Result<(), RecordingError> {
        let mut offset = from;
        while offset < to {
            let len = BLOCK.min(to - offset);
            each(&self.read(offset, len)?);
            offset += len;
        }
        Ok(())
    }

    /// Checks that a file that was finished has the bytes that were written. A checksum does not tell which byte is another one.
    pub(crate) fn check(&self) -> Result<(), RecordingError> {
        if !self.has_end()? {
            return Ok(());
        }

        let footer = self.len - MAGIC.len() as u64 - FOOTER;
        let summary = self.summary()?;
        let summary = summary.ok_or_else(|| {
            let reason = "the index from here to the end, or before, does not have its checksum";
            self.name.damaged(footer, &reason)
        })?;

        let data_end = footer - summary.len() as u64 - DATA_END;
        let stated = self.body_at(data_end, op::DATA_END)?.ok_or_else(|| {
            self.name
                .damaged(data_end, &"no end of the data before the index")
        })?;
        let stated = little_endian(&stated);
        if stated == NO_CHECKSUM {
            return Ok(());
        }

        let mut covered = crc32fast::Hasher::new();
        self.for_blocks(0, data_end, |block| covered.update(block))?;
        if u64::from(covered.finalize()) != stated {
            let reason = format!("the first {data_end} bytes do not have their checksum");
            return Err(self.name.damaged(0, &reason));
        }
        Ok(())
    }

    /// The record of metadata at an offset: its name, and what it has.
    pub(crate) fn metadata(
        &self,
        offset: u64,
    ) -> Result<(String, BTreeMap<String, String>), RecordingError> {
        let damaged = || self.name.damaged(offset, &"metadata that cannot be read");

        let body = self.body_at(offset, op::METADATA)?.ok_or_else(damaged)?;
        let mut fields = Fields(&body);
        let name = fields.text().ok_or_else(damaged)?;
        let metadata = fields.map().ok_or_else(damaged)?;
        Ok((name.to_owned(), metadata))
    }

    /// The chunk at an offset, of which only the header is read.
    fn scanned_chunk(
        &self,
        offset: u64,
        record: &RecordHead,
    ) -> Result<ChunkLocation, RecordingError> {
        // Three numbers of 8 bytes, a checksum, and the name of a compression with its length.
        let len = record.len.min(3 * 8 + 4 + 4 + 16);
        let body = self.read(record.body, len)?;
        let header = ChunkHeader::read(&mut Fields(&body));
        let header =
            header.ok_or_else(|| self.name.damaged(record.body, &"a chunk without a header"))?;

        Ok(ChunkLocation {
            offset,
            start_ns: header.start_ns,
            end_ns: header.end_ns,
            size: header.size,
        })
    }

    /// The content of a chunk: decompressed and compared with its checksum.
    pub(crate) fn chunk(&self, chunk: &ChunkLocation) -> Result<Vec<u8>, RecordingError> {
        let damaged = |reason: &dyn Display| self.name.damaged(chunk.offset, reason);

        let body = self.body_at(chunk.offset, op::CHUNK)?;
        let body = body.ok_or_else(|| damaged(&"no chunk where the index has one"))?;
        let mut fields = Fields(&body);
        let header = ChunkHeader::read(&mut fields).ok_or_else(|| damaged(&"not a chunk"))?;
        let compressed = fields.u64().and_then(|len| fields.bytes(len));
        let compressed = compressed.ok_or_else(|| damaged(&"not a chunk"))?;
        if header.start_ns != chunk.start_ns || header.end_ns != chunk.end_ns {
            return Err(damaged(&"its times are not those of the index"));
        }
        if header.size > MAX_BYTES {
            return Err(damaged(&"a length is wrong"));
        }

        // The checksum of the file is not read here: each chunk has its own, so that one tick is
        // checked without reading all.
        let size = header.size as usize;
        let content = match header.compression {
            "" => compressed.to_vec(),
            "zstd" => zstd::bulk::decompress(compressed, size).map_err(|error| damaged(&error))?,
            other => return Err(damaged(&format!("unknown compression {other:?}"))),
        };
        if content.len() != size || crc32fast::hash(&content) != header.checksum {
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

        let body = self.body_at(offset, op::ATTACHMENT)?.ok_or_else(damaged)?;
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

/// The number and the topic of a channel.
pub(crate) fn indexed_topic(fields: &mut Fields<'_>) -> Option<(u16, Option<Topic>)> {
    let id = fields.u16()?;
    let _schema = fields.u16()?;
    Some((id, Topic::parse(fields.text()?)))
}

/// A chunk as the index has it.
fn indexed_chunk(fields: &mut Fields<'_>) -> Option<ChunkLocation> {
    let start_ns = fields.u64()?;
    let end_ns = fields.u64()?;
    let offset = fields.u64()?;
    let _record_len = fields.u64()?;
    // Where the messages of each channel are.
    let places_len = fields.u32()?;
    fields.bytes(places_len.into())?;
    let _places_record_len = fields.u64()?;
    fields.text()?;
    let _compressed_size = fields.u64()?;

    Some(ChunkLocation {
        offset,
        start_ns,
        end_ns,
        size: fields.u64()?,
    })
}

/// The data in the body of an attachment, after two times and two texts.
fn attached(body: &[u8]) -> Option<&[u8]> {
    let mut fields = Fields(body);
    fields.bytes(2 * 8)?;
    fields.text()?;
    fields.text()?;
    let len = fields.u64()?;
    fields.bytes(len)
}

/// At most eight bytes as a number.
fn little_endian(bytes: &[u8]) -> u64 {
    let mut number = [0; 8];
    let len = bytes.len().min(8);
    number[..len].copy_from_slice(&bytes[..len]);
    u64::from_le_bytes(number)
}
