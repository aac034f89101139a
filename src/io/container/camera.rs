//! The camera of a depth topic: its sensor_msgs/CameraInfo.

use super::bag::{Bag, Topic};
use super::messages::CameraInfo;
use super::topics::damaged;
use crate::camera::Camera;
use crate::error::{Error, Result};

const REMEDY: &str =
    "give --intrinsics fx,fy,cx,cy in pixels, or record the camera_info that belongs to the topic";

/// The camera that took images of `size` px on `depth`, and the topic that says so; nothing where no
/// topic does. An error when what is said does not belong to the images or is no camera.
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
    // Rectified images lie in P, and D is what was taken out of them.
    let rectified = bent && name.contains("_rect") && info.rectified[0] > 0.0;
    let [fx, fy, cx, cy] = if rectified { info.rectified } else { info.intrinsics };
    let distortion = if rectified { None } else { distortion(&info).map_err(wrong)? };
    let (width, height) = size;
    let camera = Camera { width, height, fx, fy, cx, cy, distortion };
    match camera.fault() {
        Some(fault) => Err(wrong(fault.to_string())),
        None => Ok(Some((camera, from.name.clone()))),
    }
}

/// The camera_info in the same namespace, or nearest to it; nothing when two are as near.
fn beside(topics: &[Topic], depth: &str) -> Option<usize> {
    let parts = |name: &str| name.split('/').map(String::from).collect::<Vec<_>>();
    let depth = parts(depth);
    let shared = |t: &Topic| parts(&t.name).iter().zip(&depth).take_while(|(a, b)| a == b).count();
    let infos = topics
        .iter()
        .enumerate()
        .filter(|(_, t)| t.kind == "sensor_msgs/CameraInfo" && !t.logged_ns.is_empty());
    let near: Vec<(usize, usize)> = infos.map(|(i, t)| (shared(t), i)).collect();
    let nearest = near.iter().map(|(n, _)| *n).max()?;
    let mut best = near.iter().filter(|(n, _)| *n == nearest);
    let (_, topic) = best.next()?;
    best.next().is_none().then_some(*topic)
}

/// k1, k2, p1, p2, k3, where that is all there is.
fn distortion(info: &CameraInfo) -> Result<Option<[f64; 5]>, String> {
    if info.distortion.iter().all(|&k| k == 0.0) {
        return Ok(None);
    }
    let brown = ["plumb_bob", "rational_polynomial", "Brown Conrady"];
    let (first, rest) = info.distortion.split_at(info.distortion.len().min(5));
    if !brown.contains(&&*info.model) || rest.iter().any(|&k| k != 0.0) {
        return Err(format!(
            "its lens is \"{}\" with coefficients {:?}, not one of k1, k2, p1, p2, k3 (plumb_bob)",
            info.model, info.distortion
        ));
    }
    let mut k = [0.0; 5];
    k[..first.len()].copy_from_slice(first);
    Ok(Some(k))
}
