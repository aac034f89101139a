//! The Kinect by light as a whole: made once, then pointed at benches.

use super::causes::Causes;
use super::detector::{Ambient, expose};
use super::grain::Grain;
use super::light::Optics;
use super::matcher;
use super::moment::Moment;
use super::pattern::{Field, Pattern};
use super::picture::Picture;
use super::readout::ReadOut;
use super::reference::{Candidates, REFERENCE_M, Reference};
use crate::camera::Camera;
use crate::effects::{Instant, KINECT_BASELINE_M};
use crate::frame::{Frame, KINECT_NO_MEASUREMENT};
use crate::plane::Plane;
use crate::rng::Seed;
use crate::scene::{Bench, Seen, Target, WHITE, World};
use crate::view::Sensor;

/// A structured-light sensor without any formula of its errors.
pub struct SpeckleSensor {
    /// As its recordings describe it: without the lens it does not know of.
    described: Sensor,
    /// As it is.
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
    /// With the camera and baseline of `sensor` (0.075 m where it has none).
    pub fn new(sensor: &Sensor, causes: Causes) -> Self {
        let baseline_m = sensor.baseline_m.unwrap_or(KINECT_BASELINE_M);
        let camera = with_unknown_lens(&sensor.camera, &causes);
        let disparity_px_m = camera.fx * baseline_m;
        let candidates = Candidates::of(disparity_px_m);
        let nearest_px = candidates.last() as f64;
        let read_out = ReadOut::new(causes.step_px, disparity_px_m, nearest_px, &sensor.code);
        let pattern = pattern_for(&camera, baseline_m, candidates);
        let picture = record_reference(&camera, baseline_m, &causes, &pattern, candidates);
        let reference = Reference::store(&picture, candidates, causes.half_window());
        let described =
            Sensor { baseline_m: Some(baseline_m), code: read_out.code(), ..sensor.clone() };
        SpeckleSensor { described, camera, baseline_m, causes, pattern, reference, read_out }
    }

    /// As recording.json tells it.
    pub fn described(&self) -> &Sensor {
        &self.described
    }

    /// Point it at `bench` for one view.
    pub fn begin<'a>(&'a self, bench: &'a Bench, seed: Seed) -> Filming<'a> {
        Filming { sensor: self, bench, seed, taken: None }
    }

    /// The same as long as the target stands still.
    fn grains(&self, seed: Seed, view: usize, epoch: i64) -> Vec<Grain> {
        let mut rng = seed.stream(&format!("simulate/speckle/{view}/{epoch}"));
        Grain::draw(self.pattern.dots.len(), self.causes.speckle, &mut rng)
    }

    fn ambient(&self, bench: &Bench) -> Ambient {
        if self.causes.ambient_dn == 0.0 {
            return Ambient::None;
        }
        let rays = self.camera.rays();
        let seen = Seen::of(bench, &self.camera, &rays);
        let white = self.causes.ambient_dn / WHITE;
        let light = (0..self.camera.pixels()).map(|i| {
            let (x, y) = rays.at(i);
            (white * f64::from(seen.albedo[i]) * (1.0 + x * x + y * y).powi(-2)) as f32
        });
        Ambient::Light(light.collect())
    }

    fn picture(&self, world: &dyn World, moment: &Moment, grains: &[Grain]) -> Picture {
        let optics = Optics::at(moment, &self.causes, &self.camera, self.baseline_m);
        let spots = optics.spots(world, &self.pattern, grains);
        Picture::dark(self.camera.width, self.camera.height, 0).with(&spots)
    }
}

/// The frames of one view, to be taken in order.
pub struct Filming<'a> {
    sensor: &'a SpeckleSensor,
    bench: &'a Bench,
    seed: Seed,
    /// Light without noise, good as long as nothing moves or warms.
    taken: Option<Taken>,
}

struct Taken {
    moment: Moment,
    dots: Picture,
    ambient: Ambient,
}

impl Filming<'_> {
    pub fn shoot(&mut self, instant: Instant) -> SpeckleShot {
        let sensor = self.sensor;
        let moment = Moment::of(&sensor.causes, &instant);
        if self.taken.as_ref().is_none_or(|t| t.moment != moment) {
            self.taken = Some(self.take(instant.view, moment));
        }
        let Some(Taken { dots, ambient, .. }) = &self.taken else { unreachable!("just taken") };
        let name = format!("simulate/chip/{}/{}", instant.view, instant.frame);
        let infrared = expose(dots, ambient, &sensor.causes, &mut self.seed.stream(&name));
        SpeckleShot { depth: sensor.answer(&infrared), infrared }
    }

    fn take(&self, view: usize, moment: Moment) -> Taken {
        let bench = moment.bench(&self.sensor.causes, self.bench);
        let grains = self.sensor.grains(self.seed, view, moment.speckle_epoch());
        let dots = self.sensor.picture(&bench, &moment, &grains);
        Taken { moment, dots, ambient: self.sensor.ambient(&bench) }
    }
}

impl SpeckleSensor {
    /// What the matcher says to an infrared picture, in words.
    fn answer(&self, infrared: &Frame) -> Frame {
        let found = matcher::find(infrared, &self.reference);
        let confidence = self.causes.confidence as f32;
        let word = |(&shift, &correlation): (&f32, &f32)| {
            let sure = shift.is_finite() && correlation >= confidence;
            if sure { self.read_out.word(shift) } else { KINECT_NO_MEASUREMENT }
        };
        Frame {
            width: infrared.width,
            height: infrared.height,
            raw: found.shift.iter().zip(&found.correlation).map(word).collect(),
        }
    }
}

/// The sensor's own lens, and what is wrong with it on top.
fn with_unknown_lens(camera: &Camera, causes: &Causes) -> Camera {
    let mut true_camera = camera.clone();
    if causes.lens_k1 != 0.0 || causes.lens_k2 != 0.0 {
        let known = camera.distortion.unwrap_or_default();
        let [k1, k2, p1, p2, k3] = known;
        true_camera.distortion = Some([k1 + causes.lens_k1, k2 + causes.lens_k2, p1, p2, k3]);
    }
    true_camera
}

/// Dots wherever picture or reference can see one.
fn pattern_for(camera: &Camera, baseline_m: f64, candidates: Candidates) -> Pattern {
    /// Blur, drift of the wavelength and the width of dots stay inside, px.
    const MARGIN_PX: f64 = 16.0;
    let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    let mut field = Field { x: [f64::MAX, f64::MIN], y: [f64::MAX, f64::MIN] };
    for i in 0..=8 {
        let share = f64::from(i) / 8.0;
        let (u, v) = (share * right, share * bottom);
        for (u, v) in [(u, 0.0), (u, bottom), (0.0, v), (right, v)] {
            let (x, y) = camera.ray(u, v);
            field.x = [field.x[0].min(x), field.x[1].max(x)];
            field.y = [field.y[0].min(y), field.y[1].max(y)];
        }
    }
    let (mx, my) = (MARGIN_PX / camera.fx, MARGIN_PX / camera.fy);
    // The projector's x is the camera's less the disparity: least for the nearest surface.
    let nearest = candidates.last() as f64 / camera.fx + baseline_m / REFERENCE_M;
    field.x = [field.x[0] - nearest - mx, field.x[1] + mx];
    field.y = [field.y[0] - my, field.y[1] + my];
    Pattern::over(&field, camera.fx)
}

/// The factory: a white plane across the axis, cold, no speckle, no noise.
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
    let (first, columns) = candidates.reference_columns(camera.width);
    Picture::dark(columns, camera.height, first).with(&optics.spots(&plane, pattern, &even))
}
