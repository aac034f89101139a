//! A real set on disk, in the layout of every recording.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use rayon::prelude::*;

use super::Real;
use super::gain::session_s;
use super::scene::{Camera, Scene};
use crate::raytraced::Clock;
use kinoise::error::{Error, Result};
use kinoise::io::{
    FrameSource, encode_png16_quickly, write_atomic, write_recording_file, write_view_notes,
};
use kinoise::view::FrameRef;

pub(super) fn write(set: &Real, folder: &Path) -> Result<()> {
    let root = folder.join("recording");
    fs::create_dir_all(&root).map_err(|e| Error::write(&root, e))?;
    write_recording_file(&root, &set.full.recording.sensor)?;
    let camera = Camera::new(&set.full.recording.sensor, &set.full.model);
    (0..set.views.len())
        .into_par_iter()
        .try_for_each(|n| write_view(set, n, &camera, &root.join(format!("{n:04}"))))?;
    set.model.write(&folder.join("model.json"))
}

fn write_view(set: &Real, n: usize, camera: &Camera<'_>, folder: &Path) -> Result<()> {
    let k = set.views[n];
    let view = &set.full.recording.views[k];
    let images = folder.join("depth");
    fs::create_dir_all(&images).map_err(|e| Error::write(&images, e))?;
    let size = &camera.sensor.camera;
    let mut source = FrameSource::new(size.width, size.height);
    let seen = &set.full.seen[k];
    let scene = Scene::new(camera, seen.plane, session_s(&set.full, k));
    let mut target = vec![false; size.pixels()];
    seen.pixels.iter().for_each(|&i| target[i as usize] = true);
    let start = view.depth.first().map_or(0.0, |f| f.timestamp);
    let mut list = String::new();
    for (frame, file) in view.depth.iter().enumerate() {
        // What cannot be read, the full model was not learnt from either.
        let Ok(mut image) = source.read(&file.path) else { continue };
        if let Some(graft) = &set.graft {
            let view_s = file.timestamp - start;
            let width = size.width;
            let clock = Clock { seed: graft.seed, view: k, frame: frame as i64, view_s, width };
            image = graft.apply(&scene, &target, &image, &clock);
        }
        let name = format!("depth/{frame:04}.png");
        write_atomic(&folder.join(&name), &encode_png16_quickly(&image)?)?;
        let _ = writeln!(list, "{:.6} {name}", file.timestamp);
    }
    write_infrared(&view.infrared, folder)?;
    // A person's words on the view are nobody's business here.
    write_view_notes(folder, &kinoise::view::ViewNotes { notes: None, ..view.notes.clone() })?;
    write_atomic(&folder.join("depth.txt"), list.as_bytes())
}

/// As they are.
fn write_infrared(files: &[FrameRef], folder: &Path) -> Result<()> {
    if files.is_empty() {
        return Ok(());
    }
    let images = folder.join("ir");
    fs::create_dir_all(&images).map_err(|e| Error::write(&images, e))?;
    let mut list = String::new();
    for (k, file) in files.iter().enumerate() {
        let ending = file.path.extension().and_then(|e| e.to_str()).unwrap_or("png");
        let name = format!("ir/{k:04}.{ending}");
        let bytes = fs::read(&file.path).map_err(|e| Error::read(&file.path, e))?;
        write_atomic(&folder.join(&name), &bytes)?;
        let _ = writeln!(list, "{:.6} {name}", file.timestamp);
    }
    write_atomic(&folder.join("ir.txt"), list.as_bytes())
}
