//! Taking the views of a plan and writing them as a recording.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::GridView;
use super::formula::{FormulaSensor, Shot};
use super::plan::{Scenery, ViewPlan, plan_grid};
use super::speckle::{Causes, SpeckleSensor};
use crate::Progress;
use crate::camera::Rays;
use crate::effects::{Active, Instant};
use crate::error::{Error, Result};
use crate::frame::{DepthCode, Frame};
use crate::io::{
    encode_png16, encode_png16_quickly, refuse_full, write_atomic, write_recording_file,
    write_view_notes,
};
use crate::model::SigmaModel;
use crate::rng::Seed;
use crate::scene::Target;
use crate::view::Sensor;

/// How the frames are made.
#[derive(Debug, Clone)]
pub enum Physics {
    /// sigma(z, theta) and the effects, in light-path order.
    Formula { sigma: SigmaModel, effects: Vec<Active> },
    /// Dots, a lens, a chip and a matcher: errors arise by themselves.
    Speckle { causes: Causes },
}

impl Physics {
    /// The physics as JSON, for a recipe.
    pub(super) fn described(&self) -> serde_json::Value {
        match self {
            Physics::Formula { sigma, effects } => serde_json::json!({
                "world": "formula",
                "sigma": {"form": sigma.form.id(), "parameters": sigma.parameters},
                "effects": effects.iter().map(Active::described).collect::<Vec<_>>(),
            }),
            Physics::Speckle { causes } => {
                serde_json::json!({"world": "speckle", "causes": causes.values()})
            }
        }
    }
}

#[derive(Debug, Clone)]
pub struct Shoot {
    pub sensor: Sensor,
    pub views: Vec<ViewPlan>,
    pub physics: Physics,
    pub infrared: bool,
    pub seed: Seed,
}

impl Shoot {
    /// A bare target at these poses in random order, with Gaussian noise of sigma(z, theta).
    pub fn plain(
        sensor: Sensor,
        target: Target,
        poses: &[GridView],
        frames: usize,
        sigma: SigmaModel,
        seed: Seed,
    ) -> Self {
        Shoot {
            sensor,
            views: plan_grid(poses, &Scenery::bare(target), frames, true, seed),
            physics: Physics::Formula { sigma, effects: Vec::new() },
            infrared: false,
            seed,
        }
    }

    /// Writes the whole recording into `root`, which must be new or empty, one folder per view. Returns the
    /// names of the views that show no depth at all: the target is out of the picture, or beyond the depth
    /// code.
    pub fn write(&self, root: &Path, progress: Progress<'_>) -> Result<Vec<String>> {
        self.write_as(encode_png16, root, progress)
    }

    /// Like [`Shoot::write`], at the fastest compression: half the time for a speckle recording.
    pub fn write_quickly(&self, root: &Path, progress: Progress<'_>) -> Result<Vec<String>> {
        self.write_as(encode_png16_quickly, root, progress)
    }

    fn write_as(&self, encode: Encode, root: &Path, progress: Progress<'_>) -> Result<Vec<String>> {
        refuse_full(root)?;
        std::fs::create_dir_all(root).map_err(|e| Error::write(root, e))?;
        let speckle = match &self.physics {
            Physics::Speckle { causes } => Some(SpeckleSensor::new(&self.sensor, causes.clone())?),
            Physics::Formula { .. } => None,
        };
        let described = speckle.as_ref().map_or(&self.sensor, SpeckleSensor::described);
        write_recording_file(root, described)?;
        let rays = self.sensor.camera.rays();
        let first = self.views.iter().filter_map(|v| v.stamps.first()).copied();
        let session = first.fold(f64::INFINITY, f64::min);
        let done = AtomicUsize::new(0);
        let empty = |(index, view): (usize, &ViewPlan)| {
            let mut folder =
                ViewFolder::new(&root.join(&view.name), self.infrared, &described.code, encode)?;
            let instants = view.instants(index, session);
            match &speckle {
                Some(sensor) => self.by_speckle(sensor, view, instants, &mut folder)?,
                None => self.by_formula(view, instants, &rays, &mut folder)?,
            }
            let blind = !folder.sees;
            folder.finish(view)?;
            progress.step(done.fetch_add(1, Ordering::Relaxed) + 1, self.views.len());
            Ok(blind.then(|| view.name.clone()))
        };
        let views: Result<Vec<Option<String>>> =
            self.views.par_iter().enumerate().map(empty).collect();
        Ok(views?.into_iter().flatten().collect())
    }

    /// The seed, physics and planes as JSON, for a separate file.
    pub fn recipe(&self) -> serde_json::Value {
        let view = |v: &ViewPlan| {
            let q = v.bench.plane.q;
            serde_json::json!({"name": v.name, "plane": [q.x, q.y, q.z]})
        };
        serde_json::json!({
            "format": "kinoise-recipe/1",
            "seed": self.seed.0,
            "physics": self.physics.described(),
            "views": self.views.iter().map(view).collect::<Vec<_>>(),
        })
    }

    fn by_formula(
        &self,
        view: &ViewPlan,
        instants: impl Iterator<Item = (f64, Instant)>,
        rays: &Rays,
        folder: &mut ViewFolder,
    ) -> Result<()> {
        let Physics::Formula { sigma, effects } = &self.physics else { return Ok(()) };
        let seen = view.seen(&self.sensor.camera, rays);
        let camera = FormulaSensor { sensor: &self.sensor, rays, sigma, effects, seed: self.seed };
        let mut shooting = camera.begin(&seen);
        (shooting.ambient_lux, shooting.temperature_c) =
            (view.ambient_lux, view.notes.temperature_c);
        for (stamp, instant) in instants {
            let shot = shooting.shoot(instant);
            let infrared = self.infrared.then(|| self.amplitude(&shot, instant));
            folder.add(stamp, &shot.depth, infrared.as_ref())?;
        }
        Ok(())
    }

    fn by_speckle(
        &self,
        sensor: &SpeckleSensor,
        view: &ViewPlan,
        instants: impl Iterator<Item = (f64, Instant)>,
        folder: &mut ViewFolder,
    ) -> Result<()> {
        let mut filming = sensor.begin(&view.bench, self.seed);
        for (stamp, instant) in instants {
            let mut shot = filming.shoot(instant);
            if let Some(mask) = &view.mask {
                let hidden = shot.depth.raw.iter_mut().zip(mask).filter(|(_, shown)| !**shown);
                hidden.for_each(|(word, _)| *word = sensor.described().code.invalid());
            }
            folder.add(stamp, &shot.depth, self.infrared.then_some(&shot.infrared))?;
        }
        Ok(())
    }

    /// Infrared picture of the simulated light: 10 bits, with shot and read noise.
    fn amplitude(&self, shot: &Shot, instant: Instant) -> Frame {
        let name = format!("simulate/infrared/{}/{}", instant.view, instant.frame);
        let mut noise = vec![0f32; shot.light.len()];
        crate::effects::fill_normal(&mut noise, &mut self.seed.stream(&name));
        let words = shot.light.iter().zip(&noise).map(|(light, n)| {
            let mean = DN_AT_1_M * light;
            let sd = (mean / ELECTRONS_PER_DN + READ_NOISE_DN * READ_NOISE_DN).sqrt();
            (mean + sd * n).round().clamp(0.0, 1023.0) as u16
        });
        Frame { width: shot.depth.width, height: shot.depth.height, raw: words.collect() }
    }
}

/// Landau, Choo and Beling 2015: 5.90e8 cos / r^2 (r in mm), 10-bit numbers.
const DN_AT_1_M: f32 = 590.0;
/// Same source.
const READ_NOISE_DN: f32 = 10.4;
/// A 10-bit sensor of this class has a full well of some 10,000 electrons.
const ELECTRONS_PER_DN: f32 = 10.0;

type Encode = fn(&Frame) -> Result<Vec<u8>>;

/// A view's folder while it is written.
struct ViewFolder {
    encode: Encode,
    root: PathBuf,
    depth_list: String,
    infrared_list: String,
    frames: usize,
    /// Whether any pixel of any frame has a depth.
    sees: bool,
    code: DepthCode,
}

impl ViewFolder {
    fn new(root: &Path, infrared: bool, code: &DepthCode, encode: Encode) -> Result<Self> {
        for kind in ["depth", "ir"].into_iter().take(1 + usize::from(infrared)) {
            let images = root.join(kind);
            std::fs::create_dir_all(&images).map_err(|e| Error::write(&images, e))?;
        }
        let header = String::from("# timestamp path\n");
        Ok(ViewFolder {
            encode,
            root: root.into(),
            depth_list: header.clone(),
            infrared_list: header,
            frames: 0,
            sees: false,
            code: *code,
        })
    }

    fn add(&mut self, stamp: f64, depth: &Frame, infrared: Option<&Frame>) -> Result<()> {
        let name = format!("{:04}.png", self.frames);
        write_atomic(&self.root.join("depth").join(&name), &(self.encode)(depth)?)?;
        let _ = writeln!(self.depth_list, "{stamp:.6} depth/{name}");
        if let Some(image) = infrared {
            write_atomic(&self.root.join("ir").join(&name), &(self.encode)(image)?)?;
            let _ = writeln!(self.infrared_list, "{stamp:.6} ir/{name}");
        }
        self.frames += 1;
        self.sees |= depth.raw.iter().any(|&word| self.code.metres(word).is_some());
        Ok(())
    }

    fn finish(self, view: &ViewPlan) -> Result<()> {
        write_view_notes(&self.root, &view.notes)?;
        if self.root.join("ir").is_dir() {
            write_atomic(&self.root.join("ir.txt"), self.infrared_list.as_bytes())?;
        }
        // Last: a view without its list is ignored, so an interrupted run leaves no incomplete view.
        write_atomic(&self.root.join("depth.txt"), self.depth_list.as_bytes())
    }
}
