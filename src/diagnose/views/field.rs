//! Residuals of a view: every pixel of the target, all frames, about one plane.
//!
//! A plane is exactly affine in the image in disparity, so residuals are taken there, in px of
//! fx * baseline / z. No RANSAC threshold removes pixels: outliers are clipped and counted.

use super::box_sums::{SMOOTH_PX, high_pass};
use super::infrared::amplitudes;
use super::known::KnownTerms;
use crate::camera::Rays;
use crate::diagnose::edges::Edges;
use crate::diagnose::steps::lattice::RawHistogram;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::measure::{ColumnSteps, LeftOut, TargetFrames, Workbench};
use crate::model::SigmaModel;
use crate::plane::Plane;
use crate::stats::median_in_place;
use crate::terms::edge_distances;
use crate::view::View;

/// One view's residuals.
#[derive(Debug, Clone, Default)]
pub struct Field {
    pub name: String,
    /// Time on the recording's clock, s.
    pub time_s: f64,
    /// The same since the recording's first frame, of whatever view, s.
    pub session_s: f64,
    pub plane: Plane,
    /// fx * baseline, px m.
    pub scale_px_m: f64,
    pub width: usize,
    pub height: usize,
    /// Pixels of the target, ascending.
    pub pixels: Vec<u32>,
    /// Distance of each pixel from the target's edge, px.
    pub edge: Vec<f32>,
    /// Model's standard deviation of the disparity of each pixel, px.
    pub sigma: Vec<f32>,
    /// Robust standard deviation of the view's residuals, px.
    pub spread_px: f32,
    /// Mean over the frames, px; NaN where never measured.
    pub mean: Vec<f32>,
    /// Mean square over the frames, px^2.
    pub square: Vec<f32>,
    /// Frames with a measurement inside the clip.
    pub count: Vec<u16>,
    /// Frames with a measurement.
    pub measured: Vec<u16>,
    /// Error of whole columns, where the first frame shows it; the residuals are without it.
    pub column_steps: Option<ColumnSteps>,
    /// Residuals of the first frames, px, in order.
    pub first: Vec<Vec<f32>>,
    /// Time and mean residual of each frame, s since the first and px; NaN where it lost many pixels.
    pub frames: Vec<(f64, f64)>,
    pub left_out: LeftOut,
    /// Line through each frame's residuals over the disparity: value at the view's middle, px, and slope; NaN
    /// where it lost many pixels.
    pub lines: Vec<[f64; 2]>,
    pub reference_distance_m: Option<f64>,
    /// Flatness of the target as the view states it, m.
    pub flatness_m: Option<f64>,
    pub temperature_c: Option<f64>,
    pub ambient_lux: Option<f64>,
    /// Light of the surface: infrared amplitude times the squared distance over the cosine of the incidence
    /// angle, in the image's own units. Empty without an infrared image.
    pub light: Vec<f32>,
    /// Median infrared amplitude over the target, in the image's own units.
    pub infrared: Option<f64>,
    /// Step between the stored words at the target's middle, px.
    pub step_px: f64,
    /// How often each stored word occurs on the target.
    pub words: RawHistogram,
    /// Same over the whole images, counted where the target has few distinct words.
    pub pictures: RawHistogram,
    /// Readings of the whole first picture, by column and by row.
    pub pictured: [Vec<u32>; 2],
    /// Whether the target's region was given; otherwise it ends where too little is measured.
    pub region_given: bool,
    /// Edges where the target ends in front of something else.
    pub edges: Edges,
}

/// Clipping limit, in standard deviations of the model or, where larger, of the view's own residuals.
/// Residuals beyond it are excluded from the means and left to the tests of the tails.
pub const CLIP_SIGMAS: f32 = 6.0;

/// Most frames of a view: the counts of each pixel hold no more.
const MAX_FRAMES: usize = u16::MAX as usize;

impl Field {
    /// Reads the view and collects its residuals.
    ///
    /// # Errors
    /// When no frame can be read, none shows a plane, or there are more than [`MAX_FRAMES`].
    pub fn read(
        view: &View,
        bench: &Workbench<'_>,
        sigma: &SigmaModel,
        known: &KnownTerms,
        session_start: f64,
    ) -> Result<Self> {
        if view.depth.len() > MAX_FRAMES {
            return Err(Error::View {
                view: view.name.clone(),
                what: format!("{} frames, of which {MAX_FRAMES} can be counted", view.depth.len()),
                remedy: "split it into several views",
            });
        }
        let (target, mut frames) = TargetFrames::of(view, bench)?;
        let (sensor, notes) = (bench.sensor, &view.notes);
        let (scale_px_m, size) = (sensor.scale_px_m(), [sensor.camera.width, sensor.camera.height]);
        let start = view.depth.first().map_or(0.0, |f| f.timestamp);
        let mut field = Field {
            name: view.name.clone(),
            time_s: start,
            session_s: start - session_start,
            spread_px: (target.scale * scale_px_m) as f32,
            reference_distance_m: notes.reference_distance_m,
            flatness_m: notes.target.and_then(|t| t.flatness_m),
            temperature_c: notes.temperature_c,
            ambient_lux: notes.ambient_lux,
            region_given: notes.region.is_some(),
            ..Field::unseen(target.plane, scale_px_m, size, target.pixels)
        };
        let timed = frames.by_ref().map(|(k, frame)| (view.depth[k].timestamp - start, frame));
        field.accumulate(timed, bench, sigma, known);
        field.left_out = frames.left_out();
        field.read_infrared(view, &bench.rays);
        Ok(field)
    }

    /// Same pixels about the same plane, with other frames (each with its time since the first, s).
    pub fn with_frames(
        &self,
        frames: impl Iterator<Item = (f64, Frame)>,
        bench: &Workbench<'_>,
        sigma: &SigmaModel,
        known: &KnownTerms,
    ) -> Self {
        let mut field = self.clone();
        field.forget();
        field.accumulate(frames, bench, sigma, known);
        field
    }

    /// Reads the light of the surface, if there is a readable infrared image.
    fn read_infrared(&mut self, view: &View, rays: &Rays) {
        let Some(amplitudes) = amplitudes(view, &self.on_target(), self.width) else { return };
        self.infrared = Some(f64::from(median_in_place(&mut amplitudes.clone())));
        let n = self.plane.q.normalize();
        let light = self.pixels.iter().zip(amplitudes).map(|(&i, amplitude)| {
            let (x, y) = rays.at(i as usize);
            let ray = nalgebra::Vector3::new(x, y, 1.0);
            let facing = (n.dot(&ray) / ray.norm()).abs().max(0.02);
            let far = self.plane.depth(x, y).powi(2) * ray.norm_squared();
            (f64::from(amplitude) * far / facing) as f32
        });
        self.light = light.collect();
    }

    /// Infrared amplitude of a target that faces the sensor at 1 m, in the image's own units.
    pub fn pattern_at_1m(&self) -> Option<f64> {
        let light = median_in_place(&mut self.light.clone());
        (light > 0.0).then_some(f64::from(light))
    }

    /// Variance over the frames of their lines at this disparity, px^2. Motion of the whole frame is not
    /// pixel noise.
    pub fn moved_px2(&self, disparity: f64) -> f64 {
        let x = disparity - self.scale_px_m * self.plane.q.z;
        let at = self.lines.iter().map(|line| line[0] + line[1] * x).filter(|e| e.is_finite());
        let n = at.clone().count() as f64;
        if n < 2.0 {
            return 0.0;
        }
        let mean = at.clone().sum::<f64>() / n;
        at.map(|e| (e - mean).powi(2)).sum::<f64>() / n
    }

    /// Mean number of pixels measured in a frame.
    pub fn measured_pixels(&self) -> f64 {
        let measured: f64 = self.measured.iter().map(|&n| f64::from(n)).sum();
        measured / self.frames.len().max(1) as f64
    }

    /// Values of the target's pixels as an image, NaN elsewhere.
    pub fn image(&self, values: &[f32]) -> Vec<f32> {
        let last = self.pixels.last().map_or(0, |&i| i as usize);
        let rows = self.height.max(last / self.width + 1);
        let mut image = vec![f32::NAN; self.width * rows];
        for (&i, &value) in self.pixels.iter().zip(values) {
            image[i as usize] = value;
        }
        image
    }

    /// Same, high-passed.
    pub fn high_passed(&self, values: &[f32]) -> Vec<f32> {
        high_pass(&self.image(values), self.width, SMOOTH_PX)
    }

    /// Only these pixels, without plane or measurements, in a picture that ends where they do: images of it are
    /// smaller.
    pub fn cut_to_target(&self) -> Field {
        let at = |i: u32| [i as usize % self.width, i as usize / self.width];
        let pixels = self.pixels.iter().map(|&i| at(i));
        let (low, high) = pixels.clone().fold(([usize::MAX; 2], [0; 2]), |(low, high), [u, v]| {
            ([low[0].min(u), low[1].min(v)], [high[0].max(u + 1), high[1].max(v + 1)])
        });
        let [width, height] = [0, 1].map(|k| high[k].saturating_sub(low[k]).max(1));
        let moved = pixels.map(|[u, v]| ((v - low[1]) * width + u - low[0]) as u32);
        let (pixels, step_px) = (moved.collect(), self.step_px);
        Field { width, height, pixels, step_px, ..Field::default() }
    }

    /// Field of these pixels about a plane, without measurements or notes of the view.
    pub(in crate::diagnose) fn unseen(
        plane: Plane,
        scale_px_m: f64,
        [width, height]: [usize; 2],
        mut pixels: Vec<u32>,
    ) -> Self {
        // All views stay in memory together.
        pixels.shrink_to_fit();
        let mut field = Field { plane, scale_px_m, width, height, pixels, ..Field::default() };
        field.forget();
        let distances = edge_distances(&field.on_target(), width);
        field.edge = field.pixels.iter().map(|&i| distances[i as usize]).collect();
        field
    }

    /// Discards all measurements.
    pub(super) fn forget(&mut self) {
        let n = self.pixels.len();
        (self.mean, self.square) = (vec![0.0; n], vec![0.0; n]);
        (self.count, self.measured) = (vec![0; n], vec![0; n]);
        (self.first, self.frames, self.lines) = (Vec::new(), Vec::new(), Vec::new());
        (self.words, self.pictures) = Default::default();
        self.column_steps = None;
    }

    /// Disparity of the plane at pixel number `k` of the target, px.
    pub fn disparity(&self, k: usize, rays: &Rays) -> f64 {
        self.plane_at(self.pixels[k] as usize, rays)
    }

    /// Disparity of the plane at pixel `i` of the picture, px.
    pub fn plane_at(&self, i: usize, rays: &Rays) -> f64 {
        let (x, y) = rays.at(i);
        self.scale_px_m * self.plane.inverse_depth(x, y)
    }

    /// Error of the whole column of pixel `i` of the picture, px.
    pub fn column_error(&self, i: u32) -> f32 {
        self.column_steps.map_or(0.0, |steps| steps.error_px(i as usize % self.width) as f32)
    }

    /// Model's sigma in the middle of the target, px.
    pub fn middle_sigma_px(&self) -> Option<f32> {
        self.sigma.get(self.sigma.len() / 2).copied()
    }

    /// Whether each pixel of the picture is one of the target's.
    pub fn on_target(&self) -> Vec<bool> {
        let mut on = vec![false; self.width * self.height];
        self.pixels.iter().for_each(|&i| on[i as usize] = true);
        on
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::MeasureOptions;
    use crate::model::NoiseModel;
    use crate::simulate::kinect_v1;
    use crate::view::{FrameRef, ViewNotes};

    /// A count that wrapped would read as 94 % of 70,000 readings lost.
    #[test]
    fn a_view_of_more_frames_than_a_pixel_counts_is_left_out() {
        let sensor = kinect_v1(4);
        let bench = Workbench::new(&sensor, MeasureOptions::default());
        let sigma = NoiseModel::paper().sigma;
        let why = |frames: usize| {
            let depth = vec![FrameRef::file(0.0, "none.png".into()); frames];
            let (infrared, notes) = (Vec::new(), ViewNotes::default());
            let view = View { name: "0000".into(), depth, infrared, notes };
            let field = Field::read(&view, &bench, &sigma, &KnownTerms::default(), 0.0);
            field.expect_err("no such file").to_string()
        };
        assert!(why(65_536).contains("65536 frames, of which 65535 can be counted"));
        assert!(!why(4).contains("counted"), "{}", why(4));
    }
}
