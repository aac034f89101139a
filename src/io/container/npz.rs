//! The members of a .npz archive: where each begins, and access to its bytes at any offset.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use flate2::read::DeflateDecoder;
use zip::{CompressionMethod, ZipArchive};

use super::blocks::{MAX_PIECE, Source};
use crate::error::{Error, Result};

/// One array of the archive, including its header.
#[derive(Debug, Clone)]
pub struct Member {
    pub name: String,
    at: u64,
    stored: u64,
    pub size: u64,
    deflated: bool,
}

const REMEDY: &str = "the archive is damaged; write it again with np.savez";
/// Deflate expands by at most a factor of 1032.
const MAX_RATIO: u64 = 1032;

/// Lists the arrays of an archive. Fails if it is truncated or its members are
/// not stored as NumPy stores them.
pub fn members(path: &Path) -> Result<Vec<Member>> {
    let damaged = |why: zip::result::ZipError| Error::recording(path, why.to_string(), REMEDY);
    let file = File::open(path).map_err(|e| Error::read(path, e))?;
    let length = file.metadata().map_err(|e| Error::read(path, e))?.len();
    let mut archive = ZipArchive::new(io::BufReader::new(file)).map_err(damaged)?;
    let mut members = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.into_owned();
        let Some(name) = name.strip_suffix(".npy").map(String::from) else { continue };
        let wrong = |what: &str| Error::recording(path, format!("array {name}: {what}"), REMEDY);
        let deflated = match entry.compression() {
            CompressionMethod::Stored => false,
            CompressionMethod::Deflated => true,
            _ => return Err(wrong("it is compressed in a way that NumPy does not use")),
        };
        let at = entry.data_start().ok_or_else(|| wrong("its place is not known"))?;
        let (stored, size) = (entry.compressed_size(), entry.size());
        if at.checked_add(stored).is_none_or(|end| end > length) {
            return Err(wrong("it reaches beyond the end of the file"));
        }
        if size > stored.saturating_mul(if deflated { MAX_RATIO } else { 1 }) {
            return Err(wrong(&format!("{stored} bytes cannot hold the {size} that it claims")));
        }
        members.push(Member { name, at, stored, size, deflated });
    }
    Ok(members)
}

/// The bytes of one member.
#[derive(Debug)]
pub enum Body {
    /// Stored as is, from offset `at`.
    Plain {
        source: Source,
        at: u64,
    },
    Deflated(Inflater),
}

impl Body {
    pub fn of(source: Source, member: &Member) -> Self {
        match member.deflated {
            false => Body::Plain { source, at: member.at },
            true => Body::Deflated(Inflater {
                source: Arc::new(source),
                at: member.at,
                end: member.at + member.stored,
                open: Mutex::default(),
            }),
        }
    }

    pub fn bytes(&self, at: u64, n: u64, what: &str) -> Result<Vec<u8>> {
        match self {
            Body::Plain { source, at: begin } => source.bytes(begin + at, n, what),
            Body::Deflated(Inflater { source, .. }) if n > MAX_PIECE => {
                Err(source.damaged(format!("{what} claims {n} bytes"), REMEDY))
            }
            Body::Deflated(inflater) => inflater.bytes(at, n, what),
        }
    }
}

/// Reads a compressed stream, which only goes forwards, at any offset: several readers stay open.
#[derive(Debug)]
pub struct Inflater {
    source: Arc<Source>,
    at: u64,
    end: u64,
    open: Mutex<Vec<Onwards>>,
}

/// Readers kept open, on a machine of few threads.
const MIN_OPEN: usize = 8;

#[derive(Debug)]
struct Onwards {
    at: u64,
    bytes: DeflateDecoder<Section>,
}

impl Inflater {
    fn bytes(&self, at: u64, n: u64, what: &str) -> Result<Vec<u8>> {
        let open = || self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let before = {
            let mut open = open();
            let nearest = (0..open.len()).filter(|&i| open[i].at <= at).max_by_key(|&i| open[i].at);
            nearest.map(|i| open.swap_remove(i))
        };
        let section = || Section { source: self.source.clone(), at: self.at, end: self.end };
        let mut reader =
            before.unwrap_or_else(|| Onwards { at: 0, bytes: DeflateDecoder::new(section()) });
        let mut bytes = Vec::new();
        let skipped = io::copy(&mut (&mut reader.bytes).take(at - reader.at), &mut io::sink());
        let read = skipped.and_then(|_| (&mut reader.bytes).take(n).read_to_end(&mut bytes));
        let damaged = |why: String| self.source.damaged(format!("{what}: {why}"), REMEDY);
        read.map_err(|e| damaged(e.to_string()))?;
        if bytes.len() as u64 != n {
            return Err(damaged(format!("the array ends {} bytes early", n - bytes.len() as u64)));
        }
        reader.at = at + n;
        let mut open = open();
        // One more than the threads that walk through views.
        if open.len() > MIN_OPEN.max(rayon::current_num_threads()) {
            open.remove(0);
        }
        open.push(reader);
        Ok(bytes)
    }
}

/// A range of a file as a stream.
#[derive(Debug)]
struct Section {
    source: Arc<Source>,
    at: u64,
    end: u64,
}

impl Read for Section {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = (self.end - self.at).min(buffer.len() as u64);
        let bytes = self.source.bytes(self.at, n, "an array").map_err(io::Error::other)?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        self.at += n;
        Ok(bytes.len())
    }
}
