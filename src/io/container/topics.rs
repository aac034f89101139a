//! Finds the topic of a bag that holds the depth.

use super::bag::{Bag, Topic};
use super::messages::{HEAD_BYTES, ImageHead};
use super::pixels::Encoding;
use crate::error::{Error, Result};

/// A topic of depth images.
#[derive(Debug, Clone, Copy)]
pub struct DepthTopic {
    pub topic: usize,
    pub encoding: Encoding,
}

/// The named topic, or the only one. Fails with a list if there are several.
pub fn depth_topic(bag: &dyn Bag, named: Option<&str>) -> Result<DepthTopic> {
    let topics = bag.topics();
    let error = |what: String, remedy| Err(Error::recording(bag.path(), what, remedy));
    if let Some(name) = named {
        let Some(topic) = topics.iter().position(|t| t.name == name) else {
            let what = format!("there is no topic {name}; these are: {}", listed(topics));
            return error(what, "give one of them to --topic");
        };
        return match encoding(bag, topic)? {
            Ok(encoding) => Ok(DepthTopic { topic, encoding }),
            Err(why) => error(format!("{name} {why}"), REMEDY_KIND),
        };
    }
    let mut found = Vec::new();
    for (topic, Topic { name, .. }) in topics.iter().enumerate() {
        if let Ok(encoding) = encoding(bag, topic)?
            && !is_infrared(name)
        {
            found.push(DepthTopic { topic, encoding });
        }
    }
    match found[..] {
        [only] => Ok(only),
        [] => {
            let what = format!("no topic holds depth images; these are: {}", listed(topics));
            error(what, REMEDY_KIND)
        }
        _ => {
            let names: Vec<&str> = found.iter().map(|d| &*topics[d.topic].name).collect();
            let what = format!("several topics hold depth images: {}", names.join(", "));
            error(what, "choose one with --topic")
        }
    }
}

const REMEDY_KIND: &str = "record sensor_msgs/Image as 16UC1 or 32FC1, or compressedDepth as PNG";

/// Infrared images of 16 bits use the same encodings as depth.
fn is_infrared(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    !name.contains("depth") && (name.contains("infra") || name.split('/').any(|p| p == "ir"))
}

/// Depth encoding of a topic, or why it holds no depth.
fn encoding(bag: &dyn Bag, topic: usize) -> Result<Result<Encoding, String>> {
    let Topic { dialect, logged_ns, kind, .. } = &bag.topics()[topic];
    let is_raw = match &**kind {
        "sensor_msgs/Image" => true,
        "sensor_msgs/CompressedImage" => false,
        other => return Ok(Err(format!("holds {other}, no images"))),
    };
    if logged_ns.is_empty() {
        return Ok(Err("holds no message".into()));
    }
    let first = bag.message(topic, 0, HEAD_BYTES)?;
    let head = ImageHead::read(&first.bytes, *dialect, is_raw)
        .map_err(|damage| damaged(bag, topic, 0, &damage))?;
    Ok(Encoding::of(&head.encoding, is_raw)
        .ok_or_else(|| format!("holds images as \"{}\", which is no depth", head.encoding)))
}

/// Error for one message.
pub fn damaged(bag: &dyn Bag, topic: usize, number: usize, damage: &str) -> Error {
    let what = format!("{}: {damage}", place(bag, topic, number));
    Error::recording(
        bag.path(),
        what,
        "the message is damaged; copy the file again or record it again",
    )
}

pub fn place(bag: &dyn Bag, topic: usize, number: usize) -> String {
    format!("message {} of {}", number + 1, bag.topics()[topic].name)
}

fn listed(topics: &[Topic]) -> String {
    let each: Vec<String> = topics.iter().map(|t| format!("{} ({})", t.name, t.kind)).collect();
    if each.is_empty() { "none".into() } else { each.join(", ") }
}
