//! The SQLite storage of ROS 2's rosbag2 (.db3), including messages that are compressed one by one.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags, params};

use super::bag::{Bag, Message, Topic, kind_of};
use super::blocks::{MAX_PIECE, unzstd};
use super::wire::Dialect;
use crate::error::{Error, Result};

const REMEDY: &str =
    "the file is cut or damaged; copy or record it again, or mend it with sqlite3 FILE .recover";
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

#[derive(Debug)]
pub struct Db3 {
    path: PathBuf,
    database: Mutex<Connection>,
    topics: Vec<Topic>,
    /// Row ids of each topic's messages.
    rows: Vec<Vec<i64>>,
}

impl Db3 {
    /// Fails if this is not a rosbag2 file.
    pub fn open(path: &Path) -> Result<Self> {
        let failed = |e| damaged(path, &e);
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let database = Connection::open_with_flags(path, flags).map_err(failed)?;
        database.set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_PIECE as i32).map_err(failed)?;
        if !are_tables(&database).map_err(failed)? {
            let what = "no bag of ROS 2: it has no tables of topics and messages";
            return Err(Error::recording(path, what, REMEDY));
        }
        let (topics, rows) = index(&database).map_err(failed)?;
        Ok(Db3 { path: path.into(), database: Mutex::new(database), topics, rows })
    }
}

/// Whether topics and messages are real tables: a view of that name may be an endless query.
fn are_tables(database: &Connection) -> rusqlite::Result<bool> {
    let of =
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')
              AND sql NOT LIKE 'CREATE VIRTUAL%'";
    database.query_row(of, [], |row| row.get::<_, i64>(0)).map(|n| n == 2)
}

fn index(database: &Connection) -> rusqlite::Result<(Vec<Topic>, Vec<Vec<i64>>)> {
    let mut listed =
        database.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
    let each = listed.query_map([], |row| {
        let (kind, format): (String, String) = (row.get(2)?, row.get(3)?);
        let kind = if format == "cdr" { kind_of(&kind) } else { format!("{kind} in {format}") };
        let topic = Topic { name: row.get(1)?, kind, dialect: Dialect::Cdr, logged_ns: Vec::new() };
        Ok((row.get::<_, i64>(0)?, topic))
    })?;
    let (mut topics, mut rows) = (Vec::new(), Vec::new());
    for topic in each {
        let (id, mut topic) = topic?;
        let mut own = Vec::new();
        if topic.is_read() {
            let of = "SELECT id, timestamp FROM messages WHERE topic_id = ? ORDER BY timestamp, id";
            let mut messages = database.prepare(of)?;
            let mut found = messages.query([id])?;
            while let Some(row) = found.next()? {
                own.push(row.get(0)?);
                topic.logged_ns.push(row.get(1)?);
            }
        }
        topics.push(topic);
        rows.push(own);
    }
    Ok((topics, rows))
}

fn damaged(path: &Path, why: &rusqlite::Error) -> Error {
    Error::recording(path, format!("no bag of ROS 2 can be read from it: {why}"), REMEDY)
}

impl Bag for Db3 {
    fn path(&self) -> &Path {
        &self.path
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn message(&self, topic: usize, number: usize, limit: u64) -> Result<Message> {
        let row = self.rows[topic][number];
        let fetch = |limit: u64| {
            let database = self.database.lock().unwrap_or_else(PoisonError::into_inner);
            let of = "SELECT length(data), substr(data, 1, ?) FROM messages WHERE id = ?";
            let mut query = database.prepare(of)?;
            let limit = limit.min(MAX_PIECE) as i64;
            query.query_row(params![limit, row], |found| {
                Ok((found.get::<_, i64>(0)? as u64, found.get::<_, Vec<u8>>(1)?))
            })
        };
        let fetched = |limit: u64| fetch(limit).map_err(|e| damaged(&self.path, &e));
        let (length, bytes) = fetched(limit)?;
        if !bytes.starts_with(ZSTD) {
            return Ok(Message { bytes, length });
        }
        let (_, stored) = fetched(u64::MAX)?;
        let mut bytes = unzstd(&stored, MAX_PIECE).map_err(|why| {
            let what = format!("message {} of {}: {why}", number + 1, self.topics[topic].name);
            Error::recording(&self.path, what, REMEDY)
        })?;
        let length = bytes.len() as u64;
        bytes.truncate(length.min(limit) as usize);
        Ok(Message { bytes, length })
    }
}
