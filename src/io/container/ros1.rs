//! The bag format 2.0 of ROS 1 (wiki.ros.org/Bags/Format/2.0), read through its index.
//!
//! The crate `rosbag` maps the file and slices it at the offsets given in the file: it panics on a bag that
//! is truncated or has no index, which are the damages that occur in practice.

use std::collections::HashMap;
use std::path::Path;

use super::bag::{Bag, Message, Topic, kind_of};
use super::blocks::{Chunk, Chunks, Compression, Source, word32};
use super::wire::Dialect;
use crate::error::Result;

const VERSION: &[u8] = b"#ROSBAG V2.0\n";
const MESSAGE: u8 = 2;
const BAG: u8 = 3;
const INDEX: u8 = 4;
const CHUNK: u8 = 5;
const CHUNK_INFO: u8 = 6;
const CONNECTION: u8 = 7;
/// Largest header: names and numbers take less.
const MAX_HEADER: u64 = 1 << 20;
const REMEDY_INDEX: &str = "the recording was interrupted or the file is cut: copy it again, or mend it with rosbag reindex";
const REMEDY: &str = "the file is damaged; copy or record it again";

#[derive(Debug)]
pub struct Ros1Bag {
    chunks: Chunks,
    topics: Vec<Topic>,
    /// Positions of each topic's messages.
    places: Vec<Vec<Place>>,
}

#[derive(Debug, Clone, Copy)]
struct Place {
    chunk: u32,
    offset: u32,
    connection: u32,
}

impl Ros1Bag {
    /// Fails if the bag has no index or the index contradicts the file.
    pub fn open(path: &Path) -> Result<Self> {
        let source = Source::open(path)?;
        let version =
            source.bytes(0, (VERSION.len() as u64).min(source.length), "the first line")?;
        if version != VERSION {
            let what = "this is no ROS bag of version 2.0";
            return Err(source.damaged(what, "give a .bag file; older ones: rosbag migrate"));
        }
        let mut bag =
            Ros1Bag { chunks: Chunks::new(source), topics: Vec::new(), places: Vec::new() };
        let (begins, topic_of) = bag.index()?;
        for at in begins {
            bag.add_chunk(at, &topic_of)?;
        }
        Ok(bag)
    }

    /// Reads the topics from the end of the file. Returns where each chunk begins, in file order, and the
    /// topic of each connection; several may write to one topic.
    fn index(&mut self) -> Result<(Vec<u64>, HashMap<u32, usize>)> {
        let source = &self.chunks.source;
        let head = Record::at(source, VERSION.len() as u64)?;
        if head.fields.op()? != BAG {
            return Err(source.damaged("the bag's own header is missing", REMEDY));
        }
        let index = head.fields.u64("index_pos")?;
        if index == 0 {
            return Err(source.damaged("the bag has no index", REMEDY_INDEX));
        }
        if index > source.length {
            let what = format!(
                "the index should stand at byte {index}, but the file ends at {}",
                source.length
            );
            return Err(source.damaged(what, REMEDY_INDEX));
        }
        let (connections, chunks) =
            (head.fields.u32("conn_count")?, head.fields.u32("chunk_count")?);
        let (mut begins, mut topic_of) = (Vec::new(), HashMap::new());
        let (mut listed, mut next) = (0, index);
        while next < source.length {
            let record = Record::at(source, next)?;
            match record.fields.op()? {
                CONNECTION => {
                    listed += 1;
                    let inner = source.bytes(record.data_at, record.data, "a connection")?;
                    let inner = Fields { source, at: record.data_at, bytes: inner };
                    let name = record.fields.text("topic")?;
                    let kind = kind_of(&inner.text("type")?);
                    let same = |t: &Topic| t.name == name && t.kind == kind;
                    let topic = self.topics.iter().position(same).unwrap_or(self.topics.len());
                    if topic == self.topics.len() {
                        let logged_ns = Vec::new();
                        self.topics.push(Topic { name, kind, dialect: Dialect::Ros1, logged_ns });
                        self.places.push(Vec::new());
                    }
                    topic_of.insert(record.fields.u32("conn")?, topic);
                }
                CHUNK_INFO => begins.push(record.fields.u64("chunk_pos")?),
                op => {
                    let what = format!("at byte {next}: a record of kind {op} in the index");
                    return Err(source.damaged(what, REMEDY_INDEX));
                }
            }
            next = record.end();
        }
        if (listed, begins.len()) != (connections, chunks as usize) {
            let what = format!(
                "the index lists {listed} of {connections} connections and {} of {chunks} chunks",
                begins.len()
            );
            return Err(source.damaged(what, REMEDY_INDEX));
        }
        begins.sort_unstable();
        // A chunk listed twice would be read twice, with all its messages.
        if begins.windows(2).any(|w| w[0] == w[1]) {
            return Err(source.damaged("the index lists a chunk twice", REMEDY_INDEX));
        }
        Ok((begins, topic_of))
    }

    fn add_chunk(&mut self, at: u64, topic_of: &HashMap<u32, usize>) -> Result<()> {
        let source = &self.chunks.source;
        let record = Record::at(source, at)?;
        let wrong = |what: &str| source.damaged(format!("at byte {at}: {what}"), REMEDY);
        if record.fields.op()? != CHUNK {
            return Err(wrong("the index says that a chunk begins here"));
        }
        let compression = match record.fields.get("compression")? {
            b"none" => Compression::None,
            b"bz2" => Compression::Bz2,
            b"lz4" => Compression::Lz4,
            _ => return Err(wrong("a compression that is not known")),
        };
        let size = u64::from(record.fields.u32("size")?);
        if compression == Compression::None && size != record.data {
            return Err(wrong("the chunk's two lengths differ"));
        }
        let chunk = Chunk { at: record.data_at, stored: record.data, size, compression, crc: None };
        let mut next = record.end();
        let number = self.chunks.push(chunk)? as u32;
        // Index records follow their chunk, one per connection.
        let source = &self.chunks.source;
        while next < source.length {
            let record = Record::at(source, next)?;
            if record.fields.op()? != INDEX {
                break;
            }
            next = record.end();
            let (connection, count) = (record.fields.u32("conn")?, record.fields.u32("count")?);
            let wrong = |what: &str| {
                source.damaged(format!("the index at byte {}: {what}", record.data_at), REMEDY)
            };
            if u64::from(count) * 12 != record.data {
                return Err(wrong("its length is not that of its entries"));
            }
            let Some(&topic) = topic_of.get(&connection) else {
                return Err(wrong("it is of a connection that the bag does not list"));
            };
            if !self.topics[topic].is_read() {
                continue;
            }
            let entries = source.bytes(record.data_at, record.data, "an index")?;
            for entry in entries.as_chunks::<12>().0 {
                let word = |k: usize| word32(&entry[k..]);
                let logged = i64::from(word(0)) * 1_000_000_000 + i64::from(word(4));
                self.topics[topic].logged_ns.push(logged);
                self.places[topic].push(Place { chunk: number, offset: word(8), connection });
            }
        }
        Ok(())
    }
}

impl Bag for Ros1Bag {
    fn path(&self) -> &Path {
        &self.chunks.source.path
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn message(&self, topic: usize, number: usize, limit: u64) -> Result<Message> {
        let Place { chunk, offset, connection } = self.places[topic][number];
        let (chunk, at) = (chunk as usize, u64::from(offset));
        let bytes = |at: u64, n: u64| self.chunks.bytes(chunk, at, n, "a message");
        let length = |at: u64| bytes(at, 4).map(|word| u64::from(word32(&word)));
        let source = &self.chunks.source;
        let header = length(at)?;
        if header > MAX_HEADER {
            return Err(source.damaged(format!("a message's header claims {header} bytes"), REMEDY));
        }
        let fields = Fields { source, at, bytes: bytes(at + 4, header)? };
        if fields.op()? != MESSAGE || fields.u32("conn")? != connection {
            let what = format!("{at} bytes into a chunk is not the message that the index lists");
            return Err(source.damaged(what, REMEDY));
        }
        let length = length(at + 4 + header)?;
        let begin = at + 8 + header;
        // The whole message must be there, however much is requested.
        self.chunks.bytes(chunk, begin + length, 0, "the end of a message")?;
        Ok(Message { bytes: bytes(begin, length.min(limit))?, length })
    }
}

/// A header of named fields, followed by data.
struct Record<'s> {
    fields: Fields<'s>,
    data_at: u64,
    data: u64,
}

impl<'s> Record<'s> {
    fn at(source: &'s Source, at: u64) -> Result<Self> {
        let word = |at: u64| source.bytes(at, 4, "a record");
        let length = |at: u64| word(at).map(|word| u64::from(word32(&word)));
        let header = length(at)?;
        if header > MAX_HEADER {
            let what = format!("at byte {at}: a record's header claims {header} bytes");
            return Err(source.damaged(what, REMEDY));
        }
        let bytes = source.bytes(at + 4, header, "a record's header")?;
        let data = length(at + 4 + header)?;
        if at + 8 + header + data > source.length {
            let what = format!(
                "the record at byte {at} should have {data} bytes, but the file ends at {}",
                source.length
            );
            return Err(source.damaged(what, REMEDY_INDEX));
        }
        Ok(Record { fields: Fields { source, at, bytes }, data_at: at + 8 + header, data })
    }

    fn end(&self) -> u64 {
        self.data_at + self.data
    }
}

/// "name=value" fields, each after its length.
struct Fields<'s> {
    source: &'s Source,
    /// Position of the record in the file, for errors.
    at: u64,
    bytes: Vec<u8>,
}

impl Fields<'_> {
    fn get(&self, name: &str) -> Result<&[u8]> {
        let mut rest = &self.bytes[..];
        while let Some((length, after)) = rest.split_first_chunk::<4>() {
            let Some((field, after)) = after.split_at_checked(u32::from_le_bytes(*length) as usize)
            else {
                break;
            };
            let value = field.strip_prefix(name.as_bytes()).and_then(|f| f.strip_prefix(b"="));
            if let Some(value) = value {
                return Ok(value);
            }
            rest = after;
        }
        let what = format!("at byte {}: the record has no field \"{name}\"", self.at);
        Err(self.source.damaged(what, REMEDY))
    }

    fn number<const N: usize>(&self, name: &str) -> Result<[u8; N]> {
        let value = self.get(name)?;
        value.try_into().map_err(|_| {
            let what = format!("at byte {}: \"{name}\" has {} bytes", self.at, value.len());
            self.source.damaged(what, REMEDY)
        })
    }

    fn op(&self) -> Result<u8> {
        self.number::<1>("op").map(|[op]| op)
    }

    fn u32(&self, name: &str) -> Result<u32> {
        self.number(name).map(u32::from_le_bytes)
    }

    fn u64(&self, name: &str) -> Result<u64> {
        self.number(name).map(u64::from_le_bytes)
    }

    fn text(&self, name: &str) -> Result<String> {
        self.get(name).map(|value| String::from_utf8_lossy(value).into_owned())
    }
}
