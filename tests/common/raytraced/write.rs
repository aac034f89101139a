//! A set on disk: the recording, the model file, the truth; and the set as the trial asks for it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use png::{BitDepth, ColorType, Compression};
use rand::Rng;
use rayon::prelude::*;

use super::poses::Plan;
use super::question::{Asked, ConcealedSet, ExamView, Pose, Truth};
use super::shoot::Still;
use super::{Set, exam};
use kinoise::error::{Error, Result};
use kinoise::frame::Frame;
use kinoise::io::{encode_png16_quickly, write_recording_file, write_view_notes};

/// Writes `set` into `root`: `<name>/`, `model/<name>.json`, `truth/<name>.json`.
pub fn write(set: &Set, root: &Path) -> Result<()> {
    for sub in [&root.join("model"), &root.join("truth")] {
        fs::create_dir_all(sub).map_err(|e| Error::write(sub, e))?;
    }
    recording(set, &root.join(&set.name))?;
    let json = format!("{}.json", set.name);
    set.model()?.write(&root.join("model").join(&json))?;
    save(&root.join("truth").join(&json), format!("{:#}\n", set.truth()).as_bytes())
}

fn recording(set: &Set, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
    write_recording_file(folder, &set.described.sensor)?;
    set.plans.par_iter().try_for_each(|plan| {
        let folder = folder.join(format!("{:04}", plan.view));
        let still = Still::new(set, plan.view);
        let stamps = || plan.stamps.iter().copied().enumerate();
        let depth = stamps().map(|(k, at)| (at, encode_png16_quickly(&still.words(k))));
        images(&folder, "depth", "png", depth)?;
        if let Some(bits) = set.infrared_bits {
            let light = stamps().map(|(k, at)| (at, infrared(&still.infrared(k), bits)));
            images(&folder, "ir", "png", light)?;
        }
        write_view_notes(&folder, &plan.notes)
    })
}

/// Writes the images of a view, each with its time stamp, s, and their list; `kind` is depth or ir.
pub fn images(
    view: &Path,
    kind: &str,
    ending: &str,
    images: impl Iterator<Item = (f64, Result<Vec<u8>>)>,
) -> Result<()> {
    let folder = view.join(kind);
    fs::create_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
    let mut list = String::new();
    for (k, (stamp, bytes)) in images.enumerate() {
        let name = format!("{k:04}.{ending}");
        save(&folder.join(&name), &bytes?)?;
        let _ = writeln!(list, "{stamp:.6} {kind}/{name}");
    }
    save(&view.join(format!("{kind}.txt")), list.as_bytes())
}

/// Encodes the ten bits as they are, or their upper eight.
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

/// A set as the trial asks for it.
struct Raytraced {
    set: Set,
    asked: Asked,
}

/// The set that is `asked`.
pub fn conceal(asked: &Asked) -> Result<Box<dyn ConcealedSet>> {
    Ok(Box::new(Raytraced { set: Set::asked(asked, None, None)?, asked: asked.clone() }))
}

impl ConcealedSet for Raytraced {
    fn truth(&self) -> Truth {
        Truth { asked: self.asked.clone(), hidden: self.set.hidden(), base: self.set.base() }
    }

    fn write(&self, folder: &Path) -> Result<()> {
        recording(&self.set, &folder.join("recording"))?;
        self.set.model()?.write(&folder.join("model.json"))
    }

    fn exam(&self) -> Vec<ExamView> {
        exam::views(&self.set)
    }

    fn with_view(&self, pose: &Pose) -> Result<Option<(Pose, Box<dyn ConcealedSet>)>> {
        let mut set = Set::asked(&self.asked, None, None)?;
        let taken = set.add_view(pose);
        Ok(Some((taken, Box::new(Raytraced { set, asked: self.asked.clone() }))))
    }
}

impl Set {
    /// Adds a view after all others, by the same unit of the same target with the same causes. A wall's tilt
    /// is limited to what fits in the image. Returns the pose that was taken.
    pub fn add_view(&mut self, pose: &Pose) -> Pose {
        let mut rng = self.seed.stream("rays/advised");
        let (stamp, session_s) =
            self.plans.last().map_or((0.0, 0.0), |p| (p.stamps[0], p.session_s));
        let pause = rng.random_range(60.0..240.0);
        let Pose { z_m, theta_rad, azimuth_rad } = *pose;
        let theta_rad = self.session.within(z_m, theta_rad, azimuth_rad, &self.unit);
        let clocks = [stamp + pause, session_s + pause];
        let tilt = [theta_rad, azimuth_rad];
        let plan = self.session.view(&self.unit, z_m, tilt, clocks, &mut rng);
        self.plans.push(Plan { view: self.plans.len(), ..plan });
        Pose { theta_rad, ..*pose }
    }
}
