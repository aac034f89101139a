//! A Kinect simulated by its dots and matcher, without any error formula.
//!
//! ```text
//! pattern -> optics -> image -> matcher -> read-out -> 11-bit raw values
//!            (world)            (reference)
//! ```
//! Frames: the camera's optical frame (x right, y down, z forward, m). The projector stands at (+baseline,
//! 0, 0) with the camera's orientation: as on a Kinect v1, to the camera's right when looking out, so that
//! an object's shadow falls on its left. A point at depth z is seen d = fx * baseline / z px to the right
//! of where the projector sends its dot.
//!
//! Only [`Causes`] can be set; noise, steps, bias, holes and shadows follow.

mod causes;
mod matcher;
mod optics;
mod pattern;
mod reference;

pub use causes::{Cause, Causes, KNOWN_CAUSES};

use causes::Moment;
use optics::{Optics, Picture, expose};
use pattern::{Field, Grain, Pattern};
use reference::{Candidates, REFERENCE_M, ReadOut, Reference};

use crate::camera::Camera;
use crate::effects::Instant;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plane::Plane;
use crate::rng::{Seed, Stream};
use crate::scene::{Bench, Seen, Target, WHITE, World};
use crate::sensors::KINECT_BASELINE_M;
use crate::stats::range;
use crate::view::Sensor;

/// A structured-light sensor without any error formula.
pub struct SpeckleSensor {
    /// The sensor as its recordings describe it: without the unknown lens distortion.
    described: Sensor,
    /// The true camera.
    camera: Camera,
    baseline_m: f64,
    causes: Causes,
    pattern: Pattern,
    reference: Reference,
    read_out: ReadOut,
}

/// A frame and the infrared picture it was matched in.
pub struct SpeckleShot {
    pub depth: Frame,
    pub infrared: Frame,
}

impl SpeckleSensor {
    /// A sensor with the camera and baseline of `sensor` (0.075 m where it has none).
    /// Fails if the unknown lens folds the image within its corners.
    pub fn new(sensor: &Sensor, causes: Causes) -> Result<Self> {
        let baseline_m = sensor.baseline_m.unwrap_or(KINECT_BASELINE_M);
        let camera = with_unknown_lens(&sensor.camera, &causes);
        if let Some(fault) = camera.fault() {
            let what =
                format!("lens_k1 = {}, lens_k2 = {}: {fault}", causes.lens_k1, causes.lens_k2);
            return Err(Error::Argument { what, remedy: "give smaller ones" });
        }
        let disparity_px_m = camera.fx * baseline_m;
        let candidates = Candidates::of(disparity_px_m);
        let nearest_px = candidates.last() as f64;
        let read_out = ReadOut::new(causes.step_px, disparity_px_m, nearest_px, &sensor.code);
        let pattern = pattern_for(&camera, baseline_m, candidates);
        let picture = record_reference(&camera, baseline_m, &causes, &pattern, candidates);
        let reference = Reference::store(&picture, candidates, causes.half_window());
        let described =
            Sensor { baseline_m: Some(baseline_m), code: read_out.code, ..sensor.clone() };
        Ok(SpeckleSensor { described, camera, baseline_m, causes, pattern, reference, read_out })
    }

    pub fn described(&self) -> &Sensor {
        &self.described
    }

    /// Points it at `bench` for one view.
    pub fn begin<'a>(&'a self, bench: &'a Bench, seed: Seed) -> Filming<'a> {
        Filming { sensor: self, bench, seed, lit: None }
    }

    /// Takes one frame of a world that differs from frame to frame. `instant` determines the sensor's
    /// temperature, and the frame's own noise and speckle.
    pub fn shoot(&self, world: &dyn World, instant: &Instant, seed: Seed) -> SpeckleShot {
        let moment = Moment { moved_m: 0.0, ..Moment::of(&self.causes, instant) };
        let frame = instant.frame;
        let mut speckle = seed.stream(&format!("simulate/speckle/film/{frame}"));
        let lit = self.light_up(world, moment, &mut speckle);
        self.expose(&lit, &mut seed.stream(&format!("simulate/chip/film/{frame}")))
    }

    fn light_up(&self, world: &dyn World, moment: Moment, speckle: &mut Stream) -> Lit {
        let SpeckleSensor { camera, causes, pattern, baseline_m, .. } = self;
        let grains = Grain::draw(pattern.dots.len(), causes.speckle, speckle);
        let spots = Optics::at(&moment, causes, camera, *baseline_m).spots(world, pattern, &grains);
        let dots = Picture::dark(camera.width, camera.height, 0).with(&spots);
        Lit { moment, dots, ambient: self.ambient(world) }
    }

    fn expose(&self, lit: &Lit, chip: &mut Stream) -> SpeckleShot {
        let infrared = expose(&lit.dots, lit.ambient.as_deref(), &self.causes, chip);
        SpeckleShot { depth: self.read_out(&infrared), infrared }
    }

    /// Ambient light, without the projector, DN; `None` in the dark.
    fn ambient(&self, world: &dyn World) -> Option<Vec<f32>> {
        if self.causes.ambient_dn == 0.0 {
            return None;
        }
        let rays = self.camera.rays();
        let seen = Seen::of(world, &self.camera, &rays);
        let white = self.causes.ambient_dn / WHITE;
        let light = |i| {
            let (x, y) = rays.at(i);
            (white * f64::from(seen.albedo[i]) * (1.0 + x * x + y * y).powi(-2)) as f32
        };
        Some((0..self.camera.pixels()).map(light).collect())
    }

    /// Raw values that the matcher finds in an infrared picture.
    fn read_out(&self, infrared: &Frame) -> Frame {
        let found = matcher::find(infrared, &self.reference);
        let confidence = self.causes.confidence as f32;
        let value = |(&shift, &correlation): (&f32, &f32)| {
            let sure = shift.is_finite() && correlation >= confidence;
            if sure { self.read_out.raw(shift) } else { self.described.code.invalid() }
        };
        Frame {
            width: infrared.width,
            height: infrared.height,
            raw: found.shift.iter().zip(&found.correlation).map(value).collect(),
        }
    }
}

pub struct Filming<'a> {
    sensor: &'a SpeckleSensor,
    bench: &'a Bench,
    seed: Seed,
    /// Light without noise, valid as long as nothing moves or warms up.
    lit: Option<Lit>,
}

struct Lit {
    moment: Moment,
    dots: Picture,
    ambient: Option<Vec<f32>>,
}

impl Filming<'_> {
    pub fn shoot(&mut self, instant: Instant) -> SpeckleShot {
        let SpeckleSensor { causes, .. } = self.sensor;
        let moment = Moment::of(causes, &instant);
        let lit = match self.lit.take() {
            Some(lit) if lit.moment == moment => lit,
            _ => self.light_up(instant.view, moment),
        };
        let name = format!("simulate/chip/{}/{}", instant.view, instant.frame);
        let shot = self.sensor.expose(&lit, &mut self.seed.stream(&name));
        self.lit = Some(lit);
        shot
    }

    fn light_up(&self, view: usize, moment: Moment) -> Lit {
        // The grains are the same as long as the target stands still.
        let epoch = moment.speckle_epoch();
        let mut rng = self.seed.stream(&format!("simulate/speckle/{view}/{epoch}"));
        let bench = moment.bench(&self.sensor.causes, self.bench);
        self.sensor.light_up(&bench, moment, &mut rng)
    }
}

/// The sensor's own lens with the unknown distortion added.
fn with_unknown_lens(camera: &Camera, causes: &Causes) -> Camera {
    let [k1, k2, p1, p2, k3] = camera.distortion.unwrap_or_default();
    let bent = [k1 + causes.lens_k1, k2 + causes.lens_k2, p1, p2, k3];
    let unknown = causes.lens_k1 != 0.0 || causes.lens_k2 != 0.0;
    Camera { distortion: if unknown { Some(bent) } else { camera.distortion }, ..camera.clone() }
}

/// Dots wherever the picture or the reference can see one.
fn pattern_for(camera: &Camera, baseline_m: f64, candidates: Candidates) -> Pattern {
    /// Margin for blur, wavelength drift and the width of dots, px.
    const MARGIN_PX: f64 = 16.0;
    let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    let rim = (0..=8).map(|i| f64::from(i) / 8.0).flat_map(|share| {
        let (u, v) = (share * right, share * bottom);
        [(u, 0.0), (u, bottom), (0.0, v), (right, v)].map(|(u, v)| camera.ray(u, v))
    });
    let [x0, x1] = range(rim.clone().map(|(x, _)| x));
    let [y0, y1] = range(rim.map(|(_, y)| y));
    let (mx, my) = (MARGIN_PX / camera.fx, MARGIN_PX / camera.fy);
    // The projector's x is the camera's minus the disparity: smallest for the nearest surface.
    let nearest = candidates.last() as f64 / camera.fx + baseline_m / REFERENCE_M;
    let field = Field { x: [x0 - nearest - mx, x1 + mx], y: [y0 - my, y1 + my] };
    Pattern::over(&field, camera.fx)
}

/// Records the factory reference: a white plane perpendicular to the axis, cold, no speckle, no noise.
fn record_reference(
    camera: &Camera,
    baseline_m: f64,
    causes: &Causes,
    pattern: &Pattern,
    candidates: Candidates,
) -> Picture {
    let plane = Bench::bare(Plane::tilted(REFERENCE_M, 0.0, 0.0), Target::Wall);
    let optics = Optics { light: 1.0, ..Optics::at(&Moment::FACTORY, causes, camera, baseline_m) };
    let even = vec![Grain::NONE; pattern.dots.len()];
    // Wide enough for all candidates of all columns of a picture.
    let columns = camera.width + candidates.count - 1;
    let dark = Picture::dark(columns, camera.height, -candidates.last());
    dark.with(&optics.spots(&plane, pattern, &even))
}
