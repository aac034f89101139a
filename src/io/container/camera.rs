//! The camera of a depth topic: its sensor_msgs/CameraInfo.

use super::bag::{Bag, Topic};
use super::lens::lens;
use super::messages::CameraInfo;
use super::topics::damaged;
use crate::camera::Camera;
use crate::error::{Error, Result};

const REMEDY: &str =
    "give --intrinsics fx,fy,cx,cy in pixels, or record the camera_info that belongs to the topic";

/// The camera of the images of `size` px on `depth`, and where it is described; `None` without a camera_info.
/// Fails if the description does not fit the images or is not a valid camera.
pub fn camera(
    bag: &dyn Bag,
    depth: usize,
    size: (usize, usize),
) -> Result<Option<(Camera, String)>> {
    let name = &bag.topics()[depth].name;
    let Some(topic) = beside(bag.topics(), name) else { return Ok(None) };
    let from = &bag.topics()[topic];
    let message = bag.message(topic, 0, u64::MAX)?;
    let info = CameraInfo::read(&message.bytes, from.dialect)
        .map_err(|damage| damaged(bag, topic, 0, &damage))?;
    let wrong =
        |what: String| Error::recording(bag.path(), format!("{}: {what}", from.name), REMEDY);
    if info.size != size {
        let ((w, h), (width, height)) = (info.size, size);
        return Err(wrong(format!(
            "it is of images of {w} x {h} px, {name} has {width} x {height}"
        )));
    }
    let bent = info.distortion.iter().any(|&k| k != 0.0);
    // Rectified images follow P; D has been removed from them.
    let rectified = bent && name.contains("_rect") && info.rectified[0] > 0.0;
    let [fx, fy, cx, cy] = if rectified { info.rectified } else { info.intrinsics };
    let (distortion, said) = if rectified { (None, None) } else { lens(&info).map_err(wrong)? };
    let (width, height) = size;
    let camera = Camera { width, height, fx, fy, cx, cy, distortion };
    match camera.fault() {
        Some(fault) => Err(wrong(fault)),
        None => {
            let said = said.map_or_else(String::new, |said| format!("; {said}"));
            Ok(Some((camera, format!("the camera is what {} says{said}", from.name))))
        }
    }
}

/// The camera_info topic in the namespace of the images, if there is exactly one. That of another camera,
/// such as a colour camera, would look just as plausible.
fn beside(topics: &[Topic], depth: &str) -> Option<usize> {
    let (namespace, last) = depth.rsplit_once('/')?;
    // Suffixes that a transport or librealsense's recorder adds to the topic's name.
    let namespace = match last {
        "compressedDepth" | "data" => namespace.rsplit_once('/')?.0,
        _ => namespace,
    };
    let is_there = |t: &Topic| {
        let below = |parent: &str| t.name.strip_prefix(parent).and_then(|r| r.strip_prefix('/'));
        // Further down may be other cameras. librealsense's recorder has a level of its own.
        let beside = |rest: &str| !rest.contains('/') || rest == "info/camera_info";
        let inside = below(namespace).is_some_and(beside) || below(depth).is_some();
        inside && t.kind == "sensor_msgs/CameraInfo" && !t.logged_ns.is_empty()
    };
    let mut found = topics.iter().enumerate().filter(|(_, t)| is_there(t));
    let (topic, _) = found.next()?;
    found.next().is_none().then_some(topic)
}
