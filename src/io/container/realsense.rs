//! Device information in librealsense's own recordings, stored beside the images
//! (src/media/ros/ros_file_format.h and ros_writer.cpp of librealsense).

use super::bag::{Bag, Topic};
use super::messages::{ImageHead, Wire, float32, key_value};

/// The sensor that took the images of a topic.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Device {
    pub name: Option<String>,
    pub serial: Option<String>,
    /// Depth unit of a word, m.
    pub depth_unit_m: Option<f64>,
    pub baseline_m: Option<f64>,
}

impl Device {
    /// `None` if another program recorded the topic; librealsense's are
    /// "/device_0/sensor_0/Depth_0/image/data".
    /// Unreadable messages are ignored: they are not the measured data.
    pub fn of(bag: &dyn Bag, depth: usize) -> Option<Self> {
        let name = &bag.topics()[depth].name;
        let parts: Vec<&str> = name.split('/').collect();
        let ["", device, sensor, _, "image", "data"] = parts[..] else { return None };
        if !(device.starts_with("device_") && sensor.starts_with("sensor_")) {
            return None;
        }
        let value =
            |option: &str| option_value(bag, &format!("/{device}/{sensor}/option/"), option);
        let info = |key: &str| device_info(bag, &format!("/{device}/info"), key);
        Some(Device {
            name: info("Name"),
            serial: info("Serial Number"),
            depth_unit_m: unit_of_message(bag, depth).or_else(|| value("depth units")),
            // Given in millimetres, whatever the depth's unit.
            baseline_m: value("stereo baseline").map(|mm| decimal(mm * 1e-3)),
        })
    }
}

/// Converts a 32-bit float to the decimal that was meant: 0.001, not 0.0010000000474974513.
fn meant(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

fn decimal(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

fn positive(value: f64) -> Option<f64> {
    (value.is_finite() && value > 0.0).then_some(value)
}

/// Since version 2.49 the recorder appends the unit to an image and writes "1" as the frame's name.
fn unit_of_message(bag: &dyn Bag, depth: usize) -> Option<f64> {
    let dialect = bag.topics()[depth].dialect;
    let message = bag.message(depth, 0, u64::MAX).ok()?;
    let head = ImageHead::read(&message.bytes, dialect, true).ok().filter(|h| h.frame_id == "1")?;
    let behind = message.bytes.get(head.data_at + head.data..)?;
    positive(meant(Wire::new(behind, dialect).ok()?.f32().ok()?))
}

/// Older option names have spaces, newer ones underscores.
fn option_value(bag: &dyn Bag, prefix: &str, option: &str) -> Option<f64> {
    let is_it = |t: &Topic| {
        let name = t.name.strip_prefix(prefix).and_then(|n| n.strip_suffix("/value"));
        name.is_some_and(|n| n.replace('_', " ").eq_ignore_ascii_case(option))
    };
    let topic = bag.topics().iter().position(|t| is_it(t) && !t.logged_ns.is_empty())?;
    let message = bag.message(topic, 0, u64::MAX).ok()?;
    positive(meant(float32(&message.bytes, bag.topics()[topic].dialect).ok()?))
}

fn device_info(bag: &dyn Bag, name: &str, key: &str) -> Option<String> {
    let topic = bag.topics().iter().position(|t| t.name == name)?;
    let Topic { dialect, logged_ns, .. } = &bag.topics()[topic];
    let pairs = (0..logged_ns.len()).filter_map(|number| {
        let message = bag.message(topic, number, u64::MAX).ok()?;
        key_value(&message.bytes, *dialect).ok()
    });
    pairs.into_iter().find(|(k, _)| k == key).map(|(_, value)| value)
}
