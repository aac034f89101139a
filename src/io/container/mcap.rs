//! MCAP (mcap.dev/spec), with messages of either generation of ROS.
//!
//! One pass over the top-level records finds everything, with or without a summary: chunks are skipped if a
//! message index follows them, and searched otherwise. The crate `mcap` is not used: its readers only return
//! messages in order, and allocate as much as a record claims.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::bag::{Bag, Message, Topic, kind_of};
use super::blocks::{Chunk, Chunks, Compression, Source, word32};
use super::wire::{Damage, Dialect, Wire};
use crate::error::{Error, Result};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Opcodes of the records that are read.
mod op {
    pub const FOOTER: u8 = 2;
    pub const SCHEMA: u8 = 3;
    pub const CHANNEL: u8 = 4;
    pub const MESSAGE: u8 = 5;
    pub const CHUNK: u8 = 6;
    pub const MESSAGE_INDEX: u8 = 7;
}
/// Length of a record's header: opcode and length.
const HEAD: u64 = 9;
/// Length of a message record before its data: channel, number, two times.
const MESSAGE_HEAD: u64 = 22;
/// Upper limit for a chunk's header, with the longest compression name.
const CHUNK_HEAD: u64 = 64;
const REMEDY_CUT: &str =
    "the recording was interrupted or the file is cut: copy it again, or mend it with mcap recover";
const REMEDY: &str = "the file is damaged; copy or record it again, or mend it with mcap recover";

#[derive(Debug)]
pub struct Mcap {
    chunks: Chunks,
    topics: Vec<Topic>,
    /// Positions of each topic's messages.
    places: Vec<Vec<Place>>,
}

#[derive(Debug, Clone, Copy)]
struct Place {
    /// `None` for a message outside all chunks.
    chunk: Option<u32>,
    at: u64,
    channel: u16,
}

impl Mcap {
    /// Fails if the file is truncated.
    pub fn open(path: &Path) -> Result<Self> {
        let source = Source::open(path)?;
        let magic = MAGIC.len() as u64;
        if source.bytes(0, magic.min(source.length), "the first bytes")? != MAGIC {
            return Err(source.damaged("this is no MCAP file", "give a .mcap file"));
        }
        let mut walk = Walk {
            chunks: Chunks::new(source),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            messages: Vec::new(),
            bare: Vec::new(),
            all: 0,
        };
        walk.file(magic)?;
        walk.unindexed()?;
        walk.sorted()
    }

    fn bytes(&self, place: Place, at: u64, n: u64) -> Result<Vec<u8>> {
        self.chunks.bytes_at(place.chunk, at, n, "a message")
    }
}

impl Bag for Mcap {
    fn path(&self) -> &Path {
        &self.chunks.source.path
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn message(&self, topic: usize, number: usize, limit: u64) -> Result<Message> {
        let place = self.places[topic][number];
        let head = self.bytes(place, place.at, HEAD + MESSAGE_HEAD)?;
        let (kind, record) = (head[0], word64(&head[1..]));
        let channel = u16::from_le_bytes([head[9], head[10]]);
        if kind != op::MESSAGE || channel != place.channel || record < MESSAGE_HEAD {
            let what = format!("at {} is not the message that the index lists", place.at);
            return Err(self.chunks.source.damaged(what, REMEDY));
        }
        let (begin, length) = (place.at + HEAD + MESSAGE_HEAD, record - MESSAGE_HEAD);
        self.bytes(place, begin.saturating_add(length), 0)?;
        Ok(Message { bytes: self.bytes(place, begin, length.min(limit))?, length })
    }
}

fn word64(bytes: &[u8]) -> u64 {
    bytes.first_chunk().map_or(0, |b| u64::from_le_bytes(*b))
}

/// Channel of a message index, and the times and offsets of its messages.
fn index(body: &[u8]) -> Result<(u16, Vec<(u64, u64)>), Damage> {
    let mut wire = Wire::new(body, Dialect::Ros1)?;
    let (channel, length) = (wire.u16()?, wire.u32()? as usize);
    let entries = wire.take(length)?.as_chunks::<16>().0;
    Ok((channel, entries.iter().map(|e| (word64(e), word64(&e[8..]))).collect()))
}

/// State of the pass over the file.
struct Walk {
    chunks: Chunks,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Topic>,
    /// Channel, time and position of each message.
    messages: Vec<(u16, u64, Place)>,
    /// Chunks without a message index.
    bare: Vec<u32>,
    all: u32,
}

impl Walk {
    /// Reads the top-level records from `at` to the footer.
    fn file(&mut self, mut at: u64) -> Result<()> {
        let mut indexed = true;
        let mut newest = None;
        loop {
            let head = self.chunks.source.bytes(at, HEAD, "a record").map_err(|_| self.cut(at))?;
            let (kind, length) = (head[0], word64(&head[1..]));
            let end = at.checked_add(HEAD).and_then(|a| a.checked_add(length));
            if end.is_none_or(|end| end > self.chunks.source.length) {
                return Err(self.cut(at));
            }
            if kind != op::MESSAGE_INDEX && !indexed {
                self.bare.extend(newest);
                indexed = true;
            }
            let body = at + HEAD;
            match kind {
                op::FOOTER => break,
                op::CHUNK => {
                    newest = Some(self.chunk(body, length)?);
                    indexed = false;
                }
                op::MESSAGE_INDEX => {
                    indexed = true;
                    self.index(body, length, newest)?;
                }
                op::MESSAGE | op::SCHEMA | op::CHANNEL => self.record(None, at)?,
                _ => {}
            }
            at = body + length;
        }
        let end = self.chunks.source.length - MAGIC.len() as u64;
        match self.chunks.source.bytes(end, MAGIC.len() as u64, "the last bytes")? == MAGIC {
            true => Ok(()),
            false => {
                let what = String::from("the file does not end with MCAP's magic bytes");
                Err(self.chunks.source.damaged(what, REMEDY_CUT))
            }
        }
    }

    fn cut(&self, at: u64) -> Error {
        let length = self.chunks.source.length;
        let what = format!("the record at byte {at} reaches beyond the end of the file, {length}");
        self.chunks.source.damaged(what, REMEDY_CUT)
    }

    fn chunk(&mut self, body: u64, length: u64) -> Result<u32> {
        let source = &self.chunks.source;
        let head = source.bytes(body, length.min(CHUNK_HEAD), "a chunk")?;
        let wrong =
            |what: &str| source.damaged(format!("the chunk at byte {body}: {what}"), REMEDY);
        let cut = || wrong("its header is cut");
        let (size, crc) = (head.get(16..24).ok_or_else(cut)?, head.get(24..28).ok_or_else(cut)?);
        let name = word32(head.get(28..32).ok_or_else(cut)?) as usize;
        let rest = head.get(32..).ok_or_else(cut)?;
        let (name, rest) = rest.split_at_checked(name).ok_or_else(cut)?;
        let compression = match name {
            b"" => Compression::None,
            b"lz4" => Compression::Lz4,
            b"zstd" => Compression::Zstd,
            _ => return Err(wrong("a compression that is not known")),
        };
        let stored = word64(rest.get(..8).ok_or_else(cut)?);
        let begin = 40 + name.len() as u64;
        if begin.checked_add(stored) != Some(length) {
            return Err(wrong("its lengths contradict each other"));
        }
        let size = word64(size);
        if compression == Compression::None && size != stored {
            return Err(wrong("its two lengths differ"));
        }
        let crc = Some(word32(crc)).filter(|crc| *crc != 0);
        self.all += 1;
        let chunk = Chunk { at: body + begin, stored, size, compression, crc };
        self.chunks.push(chunk).map(|number| number as u32)
    }

    fn index(&mut self, body: u64, length: u64, chunk: Option<u32>) -> Result<()> {
        let bytes = self.chunks.source.bytes(body, length, "a message index")?;
        let (channel, entries) = index(&bytes).map_err(|why| self.damaged(body, &why))?;
        let place = |at| Place { chunk, at, channel };
        self.messages.extend(entries.into_iter().map(|(logged, at)| (channel, logged, place(at))));
        Ok(())
    }

    fn damaged(&self, body: u64, why: &str) -> Error {
        self.chunks.source.damaged(format!("the record at byte {body}: {why}"), REMEDY)
    }

    /// Records a message's position, a schema or a channel, inside a chunk or outside.
    fn record(&mut self, chunk: Option<u32>, at: u64) -> Result<()> {
        let bytes = |at, n| self.chunks.bytes_at(chunk, at, n, "a record");
        let head = bytes(at, HEAD)?;
        let (kind, length) = (head[0], word64(&head[1..]));
        let body = at + HEAD;
        if kind == op::MESSAGE {
            let head = bytes(body, MESSAGE_HEAD)?;
            let channel = u16::from_le_bytes([head[0], head[1]]);
            self.messages.push((channel, word64(&head[6..]), Place { chunk, at, channel }));
            return Ok(());
        }
        let bytes = bytes(body, length)?;
        let added = match kind {
            op::SCHEMA => self.schema(&bytes),
            op::CHANNEL => self.channel(&bytes),
            _ => Ok(()),
        };
        added.map_err(|why| self.damaged(body, &why))
    }

    fn schema(&mut self, body: &[u8]) -> Result<(), Damage> {
        let mut wire = Wire::new(body, Dialect::Ros1)?;
        let (id, name) = (wire.u16()?, wire.text()?);
        self.schemas.insert(id, name);
        Ok(())
    }

    fn channel(&mut self, body: &[u8]) -> Result<(), Damage> {
        let mut wire = Wire::new(body, Dialect::Ros1)?;
        let (id, schema) = (wire.u16()?, wire.u16()?);
        let (name, encoding) = (wire.text()?, wire.text()?);
        let schema = self.schemas.get(&schema).map_or("", String::as_str);
        let (dialect, kind) = match &*encoding {
            "cdr" => (Dialect::Cdr, kind_of(schema)),
            "ros1" => (Dialect::Ros1, kind_of(schema)),
            other => (Dialect::Cdr, format!("{schema} in {other}")),
        };
        self.channels.insert(id, Topic { name, kind, dialect, logged_ns: Vec::new() });
        Ok(())
    }

    /// Searches the chunks without a message index, or all of them if a channel is unknown.
    fn unindexed(&mut self) -> Result<()> {
        let bare: HashSet<u32> = self.bare.iter().copied().collect();
        let known = self.messages.iter().all(|(channel, ..)| self.channels.contains_key(channel));
        for chunk in (0..self.all).filter(|chunk| !known || bare.contains(chunk)) {
            let size = self.chunks.size(chunk as usize);
            let mut at = 0;
            while at < size {
                let head = self.chunks.bytes_at(Some(chunk), at, HEAD, "a record")?;
                if head[0] != op::MESSAGE || bare.contains(&chunk) {
                    self.record(Some(chunk), at)?;
                }
                at = at.saturating_add(HEAD).saturating_add(word64(&head[1..]));
            }
        }
        Ok(())
    }

    /// Sorts messages by topic; several channels may share one.
    fn sorted(mut self) -> Result<Mcap> {
        let mut ids: Vec<u16> = self.channels.keys().copied().collect();
        ids.sort_unstable();
        let (mut topics, mut of) = (Vec::<Topic>::new(), HashMap::new());
        for id in ids {
            let topic = &self.channels[&id];
            let same = |t: &Topic| {
                (&t.name, &t.kind, t.dialect) == (&topic.name, &topic.kind, topic.dialect)
            };
            let index = topics.iter().position(same).unwrap_or(topics.len());
            if index == topics.len() {
                topics.push(topic.clone());
            }
            of.insert(id, index);
        }
        let mut places = vec![Vec::new(); topics.len()];
        self.messages.sort_by_key(|(_, logged, _)| *logged);
        for (channel, logged, place) in self.messages {
            let Some(&topic) = of.get(&channel) else {
                let what = format!("messages of channel {channel}, which is nowhere described");
                return Err(self.chunks.source.damaged(what, REMEDY));
            };
            if topics[topic].is_read() {
                topics[topic].logged_ns.push(logged as i64);
                places[topic].push(place);
            }
        }
        Ok(Mcap { chunks: self.chunks, topics, places })
    }
}
