//! Reads parts of a file: lengths checked against the file, chunks decompressed and a few cached.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};

const REMEDY: &str = "the file is damaged; copy or record it again";

/// Largest piece held at once. Recorders write chunks of 1 to 4 MB, or of one image if that is larger.
pub const MAX_PIECE: u64 = 256 << 20;

/// A file with random access from any thread.
#[derive(Debug)]
pub struct Source {
    pub path: PathBuf,
    file: Mutex<File>,
    pub length: u64,
}

impl Source {
    pub fn open(path: &Path) -> Result<Self> {
        let failed = |e| Error::read(path, e);
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        Ok(Source { path: path.into(), file: Mutex::new(file), length })
    }

    /// Reads `n` bytes from `at`; `what` names them in the error for a file that ends too early.
    pub fn bytes(&self, at: u64, n: u64, what: &str) -> Result<Vec<u8>> {
        if at.checked_add(n).is_none_or(|end| end > self.length) {
            let said = format!(
                "{what} at byte {at} should have {n} bytes, but the file ends at {}",
                self.length
            );
            return Err(self.damaged(said, "the file is cut or damaged; copy or record it again"));
        }
        if n > MAX_PIECE {
            return Err(self.damaged(format!("{what} at byte {at} claims {n} bytes"), REMEDY));
        }
        let mut bytes = vec![0; n as usize];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut bytes));
        read.map_err(|e| Error::read(&self.path, e))?;
        Ok(bytes)
    }

    pub fn damaged(&self, what: impl Into<String>, remedy: &'static str) -> Error {
        Error::recording(&self.path, what, remedy)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    None,
    Bz2,
    Lz4,
    Zstd,
}

/// A range of a file that is compressed as a unit.
#[derive(Debug, Clone, Copy)]
pub struct Chunk {
    pub at: u64,
    /// Bytes in the file, and after decompression.
    pub stored: u64,
    pub size: u64,
    pub compression: Compression,
    /// CRC-32 of the decompressed bytes, if the format has one.
    pub crc: Option<u32>,
}

/// Decompressed chunks kept, on a machine of few threads: each walks through one view at a time.
const MIN_KEPT: usize = 8;

#[derive(Debug)]
pub struct Chunks {
    pub source: Source,
    chunks: Vec<Chunk>,
    kept: Mutex<VecDeque<(usize, Arc<Vec<u8>>)>>,
}

impl Chunks {
    pub fn new(source: Source) -> Self {
        Chunks { source, chunks: Vec::new(), kept: Mutex::default() }
    }

    /// Adds a chunk and returns its number. Fails if it exceeds the file or claims
    /// more than any recorder writes.
    pub fn push(&mut self, chunk: Chunk) -> Result<usize> {
        let Chunk { at, stored, size, .. } = chunk;
        let source = &self.source;
        if at.checked_add(stored).is_none_or(|end| end > source.length) {
            let what = format!(
                "the chunk at byte {at} should have {stored} bytes, but the file ends at {}",
                source.length
            );
            return Err(source.damaged(what, "the file is cut; copy it again or mend it"));
        }
        if size > MAX_PIECE && chunk.compression != Compression::None {
            let what = format!("the chunk at byte {at} claims to become {size} bytes");
            return Err(source.damaged(what, "write it again with chunks below 256 MB"));
        }
        self.chunks.push(chunk);
        Ok(self.chunks.len() - 1)
    }

    /// Bytes of a chunk, or of the file itself without one.
    pub fn bytes_at(&self, chunk: Option<u32>, at: u64, n: u64, what: &str) -> Result<Vec<u8>> {
        match chunk {
            Some(chunk) => self.bytes(chunk as usize, at, n, what),
            None => self.source.bytes(at, n, what),
        }
    }

    /// Decompressed size of a chunk.
    pub fn size(&self, number: usize) -> u64 {
        self.chunks[number].size
    }

    /// Bytes of a decompressed chunk.
    pub fn bytes(&self, number: usize, at: u64, n: u64, what: &str) -> Result<Vec<u8>> {
        let chunk = self.chunks[number];
        if at.checked_add(n).is_none_or(|end| end > chunk.size) {
            let said = format!(
                "{what} at {at} of the chunk at byte {} should have {n} bytes, but the chunk ends at {}",
                chunk.at, chunk.size
            );
            return Err(self.source.damaged(said, REMEDY));
        }
        if chunk.compression == Compression::None {
            return self.source.bytes(chunk.at + at, n, what);
        }
        let whole = self.whole(number)?;
        Ok(whole[at as usize..(at + n) as usize].to_vec())
    }

    fn whole(&self, number: usize) -> Result<Arc<Vec<u8>>> {
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, whole)) = kept().iter().find(|(k, _)| *k == number) {
            return Ok(whole.clone());
        }
        let chunk = self.chunks[number];
        let stored = self.source.bytes(chunk.at, chunk.stored, "a chunk")?;
        let whole = decompress(&stored, chunk).map_err(|why| {
            let what = format!("the chunk at byte {} cannot be decompressed: {why}", chunk.at);
            self.source.damaged(what, REMEDY)
        })?;
        let whole = Arc::new(whole);
        let mut kept = kept();
        kept.push_back((number, whole.clone()));
        if kept.len() > MIN_KEPT.max(rayon::current_num_threads()) {
            kept.pop_front();
        }
        Ok(whole)
    }
}

/// Decompresses a chunk to exactly its claimed size; memory grows with the actual data, not with the claim.
fn decompress(stored: &[u8], chunk: Chunk) -> Result<Vec<u8>, String> {
    let whole = match chunk.compression {
        Compression::None => stored.to_vec(),
        Compression::Bz2 => all_of(bzip2::read::BzDecoder::new(stored), chunk.size)?,
        Compression::Lz4 => all_of(lz4_flex::frame::FrameDecoder::new(stored), chunk.size)?,
        Compression::Zstd => unzstd(stored, chunk.size)?,
    };
    if whole.len() as u64 != chunk.size {
        return Err(format!("it becomes {} bytes, not {}", whole.len(), chunk.size));
    }
    if chunk.crc.is_some_and(|crc| crc != crc32fast::hash(&whole)) {
        return Err("its checksum is another".into());
    }
    Ok(whole)
}

/// Decompresses zstd data. Fails if they become more than `max` bytes.
pub fn unzstd(stored: &[u8], max: u64) -> Result<Vec<u8>, String> {
    let reader = ruzstd::decoding::StreamingDecoder::new(stored).map_err(|e| e.to_string())?;
    all_of(reader, max)
}

fn all_of(reader: impl Read, max: u64) -> Result<Vec<u8>, String> {
    let mut whole = Vec::new();
    reader.take(max + 1).read_to_end(&mut whole).map_err(|e| e.to_string())?;
    match whole.len() as u64 > max {
        true => Err(format!("it becomes more than {max} bytes")),
        false => Ok(whole),
    }
}

/// The first four bytes as a little-endian number; 0 if there are fewer.
pub fn word32(bytes: &[u8]) -> u32 {
    bytes.first_chunk().map_or(0, |b| u32::from_le_bytes(*b))
}
