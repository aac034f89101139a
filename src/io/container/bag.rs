//! Common interface of the three ROS formats: topics, and messages fetched by number.

use std::path::Path;

use super::messages::Dialect;
use crate::error::Result;

/// Message types that are read; of others only the topic is known.
pub const KINDS: [&str; 6] =
    ["Image", "CompressedImage", "CameraInfo", "Temperature", "Float32", "KeyValue"];

/// An open bag whose messages can be fetched.
pub trait Bag: std::fmt::Debug + Send + Sync {
    fn path(&self) -> &Path;
    fn topics(&self) -> &[Topic];
    /// The first `limit` bytes of a message, and its length.
    /// Fails if the file contradicts its index.
    fn message(&self, topic: usize, number: usize, limit: u64) -> Result<Message>;
}

#[derive(Debug, Clone)]
pub struct Topic {
    pub name: String,
    /// As in "sensor_msgs/Image", for both generations of ROS.
    pub kind: String,
    pub dialect: Dialect,
    /// Time at which each message was written, ns; empty for types that are not read.
    pub logged_ns: Vec<i64>,
}

pub struct Message {
    pub bytes: Vec<u8>,
    pub length: u64,
}

impl Topic {
    /// Type without its package: "Image".
    pub fn short_kind(&self) -> &str {
        self.kind.rsplit('/').next().unwrap_or_default()
    }

    pub fn is_read(&self) -> bool {
        KINDS.contains(&self.short_kind())
    }
}

/// Converts "sensor_msgs/msg/Image" to "sensor_msgs/Image".
pub fn kind_of(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}
