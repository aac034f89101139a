//! Accumulates a view's frames: the residual of every pixel from its expected disparity.

use super::field::{CLIP_SIGMAS, Field};
use super::known::KnownTerms;
use super::tiles::Places;
use crate::camera::Rays;
use crate::diagnose::edges::Edges;
use crate::diagnose::options::FRAMES_KEPT;
use crate::frame::{DepthTable, Frame};
use crate::measure::{ColumnSteps, Workbench};
use crate::model::SigmaModel;
use crate::stats::{MAD_TO_SIGMA, median_in_place};
use crate::terms::{LearntTerm, ROOM_LUX, Term};

/// Least standard deviation of the disparity over a view for fitting a slope, px.
const MIN_SPREAD_PX: f64 = 0.5;
/// Factor by which the spread about the model must exceed the view's own for the model to be wrong. With a
/// correct model the two agree to a few per cent.
const FAR_OFF: f32 = 2.0;
/// Least share of the mean number of pixels for a frame's mean and line to count.
const MIN_SHARE: f64 = 0.8;

impl Field {
    /// Collects the residuals of all frames, each given with its time since the first, s.
    pub fn accumulate(
        &mut self,
        frames: impl Iterator<Item = (f64, Frame)>,
        bench: &Workbench<'_>,
        sigma: &SigmaModel,
        known: &KnownTerms,
    ) {
        self.sigma = self.expected_sigma(&bench.rays, sigma);
        let mut expected = self.known_bias(known, bench);
        let mut clip_px = self.spread_px;
        let mut edges = Edges::default();
        let mut seen = Vec::new();
        for (time, image) in frames {
            if self.frames.is_empty() {
                if !known.bias.is_empty() {
                    clip_px = self.spread_beside(&image, &expected, &bench.table);
                }
                self.pictured = readings_of_lines(&image, &bench.table);
                edges = Edges::find(self, &image, &bench.rays, &bench.table);
                self.subsample_blocks(&mut expected);
                if bench.sensor.may_have_disparity() {
                    self.find_column_steps(&image, &bench.table);
                }
                let of_pixels = self.pixels.iter().zip(&mut expected);
                of_pixels.for_each(|(&i, d)| *d += self.column_error(i));
            }
            edges.add(self, &image, &bench.rays, &bench.table);
            seen.push(self.add(&image, time, &expected, &bench.table, clip_px));
        }
        self.forget_partial(&seen);
        self.edges = edges;
        for ((mean, square), n) in self.mean.iter_mut().zip(&mut self.square).zip(&self.count) {
            *mean /= f32::from(*n);
            *square /= f32::from(*n);
        }
    }

    /// Drops the means and lines of frames that lost much: they are of another part of the target, which need not
    /// have the same mean. `seen` is the number of pixels of each frame.
    fn forget_partial(&mut self, seen: &[f64]) {
        let whole = MIN_SHARE * seen.iter().sum::<f64>() / seen.len().max(1) as f64;
        let frames = self.frames.iter_mut().zip(&mut self.lines).zip(seen);
        for ((frame, line), _) in frames.filter(|(_, n)| **n < whole || **n == 0.0) {
            frame.1 = f64::NAN;
            *line = [f64::NAN; 2];
        }
    }

    /// Finds the steps between a matcher's columns from the image alone, without a plane.
    fn find_column_steps(&mut self, image: &Frame, table: &DepthTable) {
        let disparity = |&word: &u16| (self.scale_px_m / f64::from(table.metres(word))) as f32;
        let disparities: Vec<f32> = image.raw.iter().map(disparity).collect();
        self.column_steps = ColumnSteps::find(&disparities, self.width);
    }

    /// Sigma of the disparity at each pixel, px.
    fn expected_sigma(&self, rays: &Rays, sigma: &SigmaModel) -> Vec<f32> {
        let theta = self.plane.theta();
        let of = |&i: &u32| {
            let (x, y) = rays.at(i as usize);
            let z = self.plane.depth(x, y);
            (sigma.axial_sigma(z, theta) * self.scale_px_m / (z * z)) as f32
        };
        self.pixels.iter().map(of).collect()
    }

    /// Disparity that the model expects at each pixel, px. Its variance terms scale `sigma`. Terms over the light
    /// are left to [`KnownTerms::light_terms`]. As in a correction, unknown ambient light is a room's, and without a
    /// temperature there is no term over it.
    fn known_bias(&mut self, known: &KnownTerms, bench: &Workbench<'_>) -> Vec<f32> {
        let n = self.pixels.len();
        let mut expected: Vec<f32> =
            (0..n).map(|k| self.disparity(k, &bench.rays) as f32).collect();
        let applies = |t: &Term| {
            let needs = t.needs();
            !needs.light && (self.temperature_c.is_some() || !needs.temperature)
        };
        let bias: Vec<&LearntTerm> = known.bias.iter().filter(|(t, _)| applies(t)).collect();
        let variance: Vec<&Term> = known.variance.iter().filter(|t| applies(t)).collect();
        if bias.is_empty() && variance.is_empty() {
            return expected;
        }
        let mut sigma = self.sigma.clone();
        let places = Places::of(self, &bench.sensor.camera, &bench.rays);
        for k in 0..n {
            let mut place = places.pixel(k);
            place.ambient = self.ambient_lux.unwrap_or(ROOM_LUX);
            let px: f64 = bias.iter().map(|(t, learnt)| t.held_value(*learnt, &place)).sum();
            expected[k] += px as f32;
            let log: f64 = variance.iter().map(|t| t.value(&place)).sum();
            sigma[k] *= (0.5 * log).exp() as f32;
        }
        self.sigma = sigma;
        expected
    }

    /// Bias subtracted from each pixel while reading, px: the column steps and these terms.
    pub fn taken_out(&self, terms: &[Term], bench: &Workbench<'_>) -> Vec<f32> {
        let places = Places::of(self, &bench.sensor.camera, &bench.rays);
        let of_terms = |k| Term::sum(terms, &places.pixel(k)) as f32;
        let of_pixel = |(k, &i): (usize, &u32)| self.column_error(i) + of_terms(k);
        self.pixels.iter().enumerate().map(of_pixel).collect()
    }

    /// Spread to clip by, px: the view's own, or the spread about the model where the model is wrong by far
    /// more. If the model has a bowl that is not there, clipping by the view's own would leave no pixel.
    fn spread_beside(&self, frame: &Frame, expected: &[f32], table: &DepthTable) -> f32 {
        let off = |(&i, &d): (&u32, &f32)| {
            let z = table.metres(frame.raw[i as usize]);
            z.is_finite().then(|| ((self.scale_px_m / f64::from(z)) as f32 - d).abs())
        };
        let mut all: Vec<f32> = self.pixels.iter().zip(expected).filter_map(off).collect();
        let spread = MAD_TO_SIGMA as f32 * median_in_place(&mut all);
        if spread > FAR_OFF * self.spread_px { spread } else { self.spread_px }
    }

    fn add(
        &mut self,
        frame: &Frame,
        time: f64,
        expected: &[f32],
        table: &DepthTable,
        clip_px: f32,
    ) -> f64 {
        let keep = self.first.len() < FRAMES_KEPT;
        let mut residuals = if keep { vec![f32::NAN; self.pixels.len()] } else { Vec::new() };
        let (mut sum, mut n) = (0.0f64, 0.0f64);
        let middle = self.scale_px_m * self.plane.q.z;
        let (mut sx, mut sxx, mut sxy) = (0.0f64, 0.0f64, 0.0f64);
        for k in 0..self.pixels.len() {
            let word = frame.raw[self.pixels[k] as usize];
            let z = table.metres(word);
            if !z.is_finite() {
                continue;
            }
            self.measured[k] += 1;
            let count = &mut self.words.0[usize::from(word)];
            *count = count.saturating_add(1);
            let e = (self.scale_px_m / f64::from(z)) as f32 - expected[k];
            if keep {
                residuals[k] = e;
            }
            if e.abs() <= CLIP_SIGMAS * self.sigma[k].max(clip_px) {
                self.count[k] += 1;
                self.mean[k] += e;
                self.square[k] += e * e;
                sum += f64::from(e);
                n += 1.0;
                let x = f64::from(expected[k]) - middle;
                sx += x;
                sxx += x * x;
                sxy += x * f64::from(e);
            }
        }
        if self.words.is_few() {
            let is_depth = |word: &u16| table.metres(*word).is_finite();
            self.pictures.count(frame.raw.iter().copied().filter(is_depth));
        }
        if keep {
            self.first.push(residuals);
        }
        // A frontal view has one disparity, and no slope.
        let spread = sxx - sx * sx / f64::max(n, 1.0);
        let slope = if spread > n * MIN_SPREAD_PX * MIN_SPREAD_PX {
            (sxy - sx * sum / n) / spread
        } else {
            0.0
        };
        self.lines.push([(sum - slope * sx) / f64::max(n, 1.0), slope]);
        self.frames.push((time, sum / f64::max(n, 1.0)));
        n
    }
}

/// Number of readings on each column and on each row of a picture.
fn readings_of_lines(image: &Frame, table: &DepthTable) -> [Vec<u32>; 2] {
    let mut lines = [image.width, image.height].map(|n| vec![0; n]);
    for (i, _) in image.raw.iter().enumerate().filter(|(_, raw)| table.metres(**raw).is_finite()) {
        lines[0][i % image.width] += 1;
        lines[1][i / image.width] += 1;
    }
    lines
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::measure::MeasureOptions;
    use crate::model::{Effect, NoiseModel};
    use crate::plane::Plane;
    use crate::simulate::kinect_v1;
    use crate::terms::{Basis, Coordinate, Modulation};

    /// Known bias, px, and sigma, px, at the picture's corner: of a frontal target at this disparity, px, under so
    /// much ambient light.
    fn known_at(effect: Effect, disparity: f64, ambient_lux: Option<f64>) -> [f32; 2] {
        let sensor = kinect_v1(1);
        let bench = Workbench::new(&sensor, MeasureOptions::default());
        let model = NoiseModel { effects: vec![effect], ..NoiseModel::paper() };
        let scale_px_m = sensor.scale_px_m();
        let plane = Plane::tilted(scale_px_m / disparity, 0.0, 0.0);
        let mut field = Field::unseen(plane, scale_px_m, [640, 480], vec![0]);
        (field.sigma, field.ambient_lux) = (vec![0.1], ambient_lux);
        let expected = field.known_bias(&KnownTerms::of(&model, &sensor.camera), &bench);
        [expected[0] - disparity as f32, field.sigma[0]]
    }

    /// As in a correction and a simulation: beyond the disparities at which it was learnt a bowl is that at their
    /// edge; unknown light is a room's.
    #[test]
    fn what_is_known_is_what_a_correction_undoes() {
        let bowl = || Effect {
            id: "unexplained".into(),
            shape: vec![Term::bias(
                Basis::powers(Coordinate::RadiusSquared, 1, Modulation::DisparitySquared),
                vec![1e-3],
            )],
            learnt_px: Some([11.0, 22.0]),
            ..Effect::default()
        };
        let [inside, edge, near] = [15.0, 22.0, 40.0].map(|d| known_at(bowl(), d, None)[0]);
        assert!((near - edge).abs() < 1e-4 && edge > 2.0 * inside, "{inside} {edge} {near}");
        let lit = |lux| {
            let id = "ambient-light".into();
            let parameters = [("ratio".to_string(), json!(0.05))].into_iter().collect();
            known_at(Effect { id, parameters, ..Effect::default() }, 15.0, lux)[1]
        };
        assert_eq!(lit(None), lit(Some(ROOM_LUX)));
        assert!(lit(Some(0.0)) == 0.1 && lit(None) > 0.11);
    }

    /// A hand before the target in one frame: what is left has another mean, which is no motion.
    #[test]
    fn frames_that_lost_much_do_not_count() {
        let mut field = Field {
            frames: vec![(0.0, 0.01), (0.03, 0.5), (0.06, 0.01), (0.09, 0.0)],
            lines: vec![[0.01, 0.0], [0.5, 0.0], [0.01, 0.0], [0.0; 2]],
            ..Field::default()
        };
        field.forget_partial(&[1000.0, 400.0, 990.0, 0.0]);
        let kept: Vec<bool> = field.frames.iter().map(|f| f.1.is_finite()).collect();
        assert_eq!(kept, [true, false, true, false]);
        assert_eq!(field.moved_px2(0.0), 0.0);
        field.forget_partial(&[0.0; 4]);
        assert_eq!(field.moved_px2(0.0), 0.0);
    }
}
