//! A set on disk: the recording, the model file, the sealed truth.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use png::{BitDepth, ColorType, Compression};
use rayon::prelude::*;

use super::sets::Set;
use super::shoot::Still;
use kinoise::error::{Error, Result};
use kinoise::frame::Frame;
use kinoise::io::{encode_png16_quickly, write_recording_file, write_view_notes};

/// Write `set` into `root`: `<name>/`, `model/<name>.json`, `truth/<name>.json`.
///
/// # Errors
/// When the disk refuses.
pub fn write(set: &Set, root: &Path) -> Result<()> {
    for sub in [&root.join("model"), &root.join("truth")] {
        fs::create_dir_all(sub).map_err(|e| Error::write(sub, e))?;
    }
    recording(set, &root.join(&set.name))?;
    let json = format!("{}.json", set.name);
    set.described.model(set.known.clone())?.write(&root.join("model").join(&json))?;
    save(&root.join("truth").join(&json), format!("{:#}\n", set.truth()).as_bytes())
}

/// The recording alone.
pub(super) fn recording(set: &Set, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
    write_recording_file(folder, &set.described.sensor)?;
    (0..set.plans.len()).into_par_iter().try_for_each(|view| write_view(set, view, folder))
}

fn write_view(set: &Set, view: usize, folder: &Path) -> Result<()> {
    let folder = folder.join(format!("{view:04}"));
    for kind in ["depth", "ir"].into_iter().take(1 + usize::from(set.infrared_bits.is_some())) {
        let images = folder.join(kind);
        fs::create_dir_all(&images).map_err(|e| Error::write(&images, e))?;
    }
    let still = Still::new(set, view);
    let (mut depth_list, mut infrared_list) = (String::new(), String::new());
    for (frame, stamp) in set.plans[view].stamps.iter().enumerate() {
        let name = format!("{frame:04}.png");
        save(&folder.join("depth").join(&name), &encode_png16_quickly(&still.words(frame))?)?;
        let _ = writeln!(depth_list, "{stamp:.6} depth/{name}");
        if let Some(bits) = set.infrared_bits {
            let camera = &set.unit.sensor.camera;
            let image =
                Frame { width: camera.width, height: camera.height, raw: still.infrared(frame) };
            save(&folder.join("ir").join(&name), &infrared(&image, bits)?)?;
            let _ = writeln!(infrared_list, "{stamp:.6} ir/{name}");
        }
    }
    write_view_notes(&folder, &set.plans[view].notes)?;
    if set.infrared_bits.is_some() {
        save(&folder.join("ir.txt"), infrared_list.as_bytes())?;
    }
    save(&folder.join("depth.txt"), depth_list.as_bytes())
}

/// Ten bits as they are, or the upper eight of them.
fn infrared(image: &Frame, bits: u8) -> Result<Vec<u8>> {
    if bits == 16 {
        return encode_png16_quickly(image);
    }
    let failed = |e: png::EncodingError| Error::Drawing { what: "PNG", why: e.to_string() };
    let data: Vec<u8> = image.raw.iter().map(|w| (w >> 2) as u8).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width as u32, image.height as u32);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

fn save(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).map_err(|e| Error::write(path, e))
}
