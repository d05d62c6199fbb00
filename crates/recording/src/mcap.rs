//! A file of MCAP (<https://mcap.dev/spec>), as it is written: a recording, or an export for other readers of the format.
//!
//! The package `mcap` puts every field of a message through its compressor, on the thread that adds it. Here messages are encoded
//! into the content of a chunk, which another thread compresses as a whole.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};

use crate::format::{MAGIC, RecordBytes, op};

/// Level of compression. From level 3 on `.cargo/config.toml` leaves out what zstd would use, to compile less C code. Level -1 saves
/// an eighth of the bytes, for a tenth more of the time that recording takes.
const COMPRESSION_LEVEL: i32 = -4;
const COMPRESSION: &str = "zstd";

/// The content of a chunk: records one after the other, not compressed.
#[derive(Debug, Default)]
pub struct Chunk {
    content: Vec<u8>,
    messages: Vec<MessagePlace>,
}

/// Where a message is in the content of a chunk.
#[derive(Debug)]
struct MessagePlace {
    channel: u16,
    time_ns: u64,
    offset: u64,
}

/// What a message has beside its data.
#[derive(Debug, Clone, Copy)]
pub struct MessageHead {
    /// Number of its channel.
    pub channel: u16,
    /// Its number on the channel; 0 where nothing counts them.
    pub sequence: u32,
    /// When it was logged and published, nanoseconds.
    pub time_ns: u64,
}

impl Chunk {
    /// Bytes before compression.
    #[must_use]
    pub fn len(&self) -> usize {
        self.content.len()
    }

    /// Whether nothing was added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.content.is_empty()
    }

    /// Empties the chunk and keeps its memory.
    pub fn clear(&mut self) {
        self.content.clear();
        self.messages.clear();
    }

    /// Adds records that are not messages.
    pub fn add_records(&mut self, records: &[u8]) {
        self.content.extend_from_slice(records);
    }

    /// Adds a message, which `encode` appends to the bytes that it is given.
    pub fn add_message(&mut self, head: MessageHead, encode: impl FnOnce(&mut Vec<u8>)) {
        self.messages.push(MessagePlace {
            channel: head.channel,
            time_ns: head.time_ns,
            offset: self.content.len() as u64,
        });

        let mut record = RecordBytes::begin(&mut self.content, op::MESSAGE);
        record.u16(head.channel);
        record.u32(head.sequence);
        record.u64(head.time_ns);
        record.u64(head.time_ns);
        encode(record.bytes);
        record.end();
    }

    /// The first and the last time of its messages, nanoseconds.
    fn times_ns(&self) -> (u64, u64) {
        let times = self.messages.iter().map(|message| message.time_ns);
        let first = times.clone().min();
        (first.unwrap_or(0), times.max().unwrap_or(0))
    }
}

/// Schemas and channels, which a file has in its first chunk and once more in its index.
#[derive(Debug, Clone, Default)]
pub struct Channels {
    /// Schemas, by their names. The first one has number 1.
    schema_ids: BTreeMap<&'static str, u16>,
    schemas: Vec<u8>,
    channel_count: u16,
    channels: Vec<u8>,
}

impl Channels {
    /// Adds a schema, or finds it by its name. Returns its number.
    pub fn add_schema(&mut self, name: &'static str, encoding: &str, data: &[u8]) -> u16 {
        if let Some(id) = self.schema_ids.get(name) {
            return *id;
        }

        let id = self.schema_ids.len() as u16 + 1;
        self.schema_ids.insert(name, id);
        let mut record = RecordBytes::begin(&mut self.schemas, op::SCHEMA);
        record.u16(id);
        record.text(name);
        record.text(encoding);
        record.u32(data.len() as u32);
        record.bytes.extend_from_slice(data);
        record.end();
        id
    }

    /// Adds a channel. Returns its number.
    pub fn add_channel(&mut self, topic: &str, schema: u16, encoding: &str) -> u16 {
        let id = self.channel_count;
        self.channel_count += 1;
        let mut record = RecordBytes::begin(&mut self.channels, op::CHANNEL);
        record.u16(id);
        record.u16(schema);
        record.text(topic);
        record.text(encoding);
        record.map(&BTreeMap::new());
        record.end();
        id
    }

    /// A chunk with all schemas and channels, which is the first one of a file.
    #[must_use]
    pub fn chunk(&self) -> Chunk {
        let mut chunk = Chunk::default();
        chunk.add_records(&self.schemas);
        chunk.add_records(&self.channels);
        chunk
    }
}

/// A file that is written.
pub struct McapFile<W> {
    out: W,
    compressor: zstd::bulk::Compressor<'static>,
    /// Bytes written so far, and their checksum.
    len: u64,
    crc: crc32fast::Hasher,
    /// Records that are written next; kept for their memory.
    records: Vec<u8>,
    /// The content of a chunk, compressed; kept for its memory.
    compressed: Vec<u8>,
    index: WrittenIndex,
}

/// What the index at the end of a file is made of.
#[derive(Default)]
struct WrittenIndex {
    channels: Channels,
    chunks: Vec<u8>,
    chunk_count: u32,
    attachments: Vec<u8>,
    attachment_count: u32,
    metadata: Vec<u8>,
    metadata_count: u32,
    /// Messages, by channel.
    messages: BTreeMap<u16, u64>,
    /// The first and the last time of messages, nanoseconds.
    times_ns: Option<(u64, u64)>,
}

impl<W: Write> McapFile<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn begin(out: W, profile: &str, channels: Channels) -> io::Result<Self> {
        let mut begun = Self {
            out,
            compressor: zstd::bulk::Compressor::new(COMPRESSION_LEVEL)?,
            len: 0,
            crc: crc32fast::Hasher::new(),
            records: MAGIC.to_vec(),
            compressed: Vec::new(),
            index: WrittenIndex {
                channels,
                ..WrittenIndex::default()
            },
        };

        let mut record = RecordBytes::begin(&mut begun.records, op::HEADER);
        record.text(profile);
        record.text("cars");
        record.end();
        begun.write()?;
        Ok(begun)
    }

    /// Writes a record of metadata.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add_metadata(
        &mut self,
        name: &str,
        metadata: &BTreeMap<String, String>,
    ) -> io::Result<()> {
        let mut record = RecordBytes::begin(&mut self.records, op::METADATA);
        record.text(name);
        record.map(metadata);
        record.end();

        self.index.metadata_count += 1;
        let mut entry = RecordBytes::begin(&mut self.index.metadata, op::METADATA_INDEX);
        entry.u64(self.len);
        entry.u64(self.records.len() as u64);
        entry.text(name);
        entry.end();
        self.write()
    }

    /// Attaches data.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> io::Result<()> {
        let mut record = RecordBytes::begin(&mut self.records, op::ATTACHMENT);
        record.u64(0);
        record.u64(0);
        record.text(name);
        record.text(media_type);
        record.u64(data.len() as u64);
        record.bytes.extend_from_slice(data);
        // An attachment has a checksum of its own, because it is no part of a chunk.
        let crc = crc32fast::hash(record.body());
        record.u32(crc);
        record.end();

        self.index.attachment_count += 1;
        let mut entry = RecordBytes::begin(&mut self.index.attachments, op::ATTACHMENT_INDEX);
        entry.u64(self.len);
        entry.u64(self.records.len() as u64);
        entry.u64(0);
        entry.u64(0);
        entry.u64(data.len() as u64);
        entry.text(name);
        entry.text(media_type);
        entry.end();
        self.write()
    }

    /// Compresses a chunk and writes it, with the index of its messages, in one go: a crash leaves no half of one in the
    /// middle of the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add_chunk(&mut self, chunk: &Chunk) -> io::Result<()> {
        let (first_ns, last_ns) = chunk.times_ns();
        self.compressed.clear();
        let most = zstd::zstd_safe::compress_bound(chunk.content.len());
        self.compressed.reserve(most);
        self.compressor
            .compress_to_buffer(&chunk.content, &mut self.compressed)?;

        let mut record = RecordBytes::begin(&mut self.records, op::CHUNK);
        record.u64(first_ns);
        record.u64(last_ns);
        record.u64(chunk.content.len() as u64);
        record.u32(crc32fast::hash(&chunk.content));
        record.text(COMPRESSION);
        record.u64(self.compressed.len() as u64);
        record.bytes.extend_from_slice(&self.compressed);
        record.end();
        // The index of a chunk's messages follows it directly, as the format wants it.
        let chunk_len = self.records.len() as u64;
        let message_indexes = self.add_message_indexes(chunk);
        let message_indexes_len = self.records.len() as u64 - chunk_len;

        let mut entry = RecordBytes::begin(&mut self.index.chunks, op::CHUNK_INDEX);
        entry.u64(first_ns);
        entry.u64(last_ns);
        entry.u64(self.len);
        entry.u64(chunk_len);
        entry.u32(message_indexes.len() as u32 * (2 + 8));
        for (channel, offset) in &message_indexes {
            entry.u16(*channel);
            entry.u64(*offset);
        }
        entry.u64(message_indexes_len);
        entry.text(COMPRESSION);
        entry.u64(self.compressed.len() as u64);
        entry.u64(chunk.content.len() as u64);
        entry.end();
        // Only noted: the index is written at the end, and a file without it is read chunk by chunk.
        self.index.chunk_count += 1;
        let (first_before, last_before) = self.index.times_ns.unwrap_or((first_ns, last_ns));
        self.index.times_ns = Some((first_before.min(first_ns), last_before.max(last_ns)));

        self.write()
    }

    /// Adds the index of each channel that has messages in the chunk. Returns where each will be in the file.
    fn add_message_indexes(&mut self, chunk: &Chunk) -> BTreeMap<u16, u64> {
        let mut places: BTreeMap<u16, Vec<&MessagePlace>> = BTreeMap::new();
        for message in &chunk.messages {
            places.entry(message.channel).or_default().push(message);
        }

        let mut offsets = BTreeMap::new();
        for (channel, messages) in places {
            offsets.insert(channel, self.len + self.records.len() as u64);
            *self.index.messages.entry(channel).or_default() += messages.len() as u64;

            let mut record = RecordBytes::begin(&mut self.records, op::MESSAGE_INDEX);
            record.u16(channel);
            record.u32(messages.len() as u32 * (8 + 8));
            for message in messages {
                record.u64(message.time_ns);
                record.u64(message.offset);
            }
            record.end();
        }
        offsets
    }

    /// Writes the index and ends the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        let mut record = RecordBytes::begin(&mut self.records, op::DATA_END);
        // Of all bytes before this record, which is written only now.
        record.u32(self.crc.clone().finalize());
        record.end();
        self.write()?;

        let summary_start = self.len;
        let statistics = self.index.statistics();
        // The index is made in memory, so that its checksum and its offsets are known when it is
        // written.
        let mut groups = Vec::new();
        for (op, group) in [
            (op::SCHEMA, &self.index.channels.schemas),
            (op::CHANNEL, &self.index.channels.channels),
            (op::STATISTICS, &statistics),
            (op::CHUNK_INDEX, &self.index.chunks),
            (op::ATTACHMENT_INDEX, &self.index.attachments),
            (op::METADATA_INDEX, &self.index.metadata),
        ] {
            let start = summary_start + self.records.len() as u64;
            self.records.extend_from_slice(group);
            groups.push((op, start, group.len() as u64));
        }

        let offsets_start = summary_start + self.records.len() as u64;
        for (op, start, len) in groups {
            let mut record = RecordBytes::begin(&mut self.records, op::SUMMARY_OFFSET);
            record.bytes.push(op);
            record.u64(start);
            record.u64(len);
            record.end();
        }

        // The checksum covers everything of the summary up to itself.
        self.records.push(op::FOOTER);
        self.records.extend_from_slice(&20_u64.to_le_bytes());
        self.records.extend_from_slice(&summary_start.to_le_bytes());
        self.records.extend_from_slice(&offsets_start.to_le_bytes());
        let crc = crc32fast::hash(&self.records);
        self.records.extend_from_slice(&crc.to_le_bytes());
        self.records.extend_from_slice(&MAGIC);
        self.write()?;
        self.out.flush()
    }

    /// Writes the records that have been made.
    fn write(&mut self) -> io::Result<()> {
        self.out.write_all(&self.records)?;
        // Counted only when it has been written.
        self.crc.update(&self.records);
        self.len += self.records.len() as u64;
        self.records.clear();
        Ok(())
    }
}

impl McapFile<File> {
    /// Waits until everything so far is on the disk.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn sync(&self) -> io::Result<()> {
        self.out.sync_data()
    }
}

impl WrittenIndex {
    fn statistics(&self) -> Vec<u8> {
        let (first_ns, last_ns) = self.times_ns.unwrap_or((0, 0));
        let mut bytes = Vec::new();
        let mut record = RecordBytes::begin(&mut bytes, op::STATISTICS);

        record.u64(self.messages.values().sum());
        record.u16(self.channels.schema_ids.len() as u16);
        record.u32(u32::from(self.channels.channel_count));
        record.u32(self.attachment_count);
        record.u32(self.metadata_count);
        record.u32(self.chunk_count);
        record.u64(first_ns);
        record.u64(last_ns);

        record.u32(self.messages.len() as u32 * (2 + 8));
        for (channel, count) in &self.messages {
            record.u16(*channel);
            record.u64(*count);
        }

        record.end();
        bytes
    }
}
