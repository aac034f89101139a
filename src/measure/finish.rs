//! Turns the sums over a view's frames into its result.

use nalgebra::{Matrix3, Vector3};

use super::cells::{Cell, Context, Sums};
use super::doubtful::{Bin, doubts};
use super::grouping::CUT_SIGMAS;
use super::scan::Scan;
use super::{ResidualPicture, ViewMeasurement};
use crate::frame::Frame;
use crate::plane::{Effort, Plane, Target, fit_affine_robust};
use crate::residual::perpendicular_per_axial;
use crate::stats::{Correlation, mean, measure_correlation, normal_cut_factor};

impl Scan<'_> {
    /// Refits the plane to all frames, and turns the sums into the view's result (the caller adds names and
    /// notes). `None` when nothing was measured.
    pub fn finish(self, target: &Target, first: &Frame) -> Option<ViewMeasurement> {
        let frames = self.lagged.frames;
        let plane = self.refit(target);
        let shift = self.shift_to(&plane);
        let cells = 0..self.cut.len();
        let mut sums: Vec<Sums> = cells.map(|cell| self.sums_of(cell, &plane, &shift)).collect();
        let correlation = self.correlation(first, &plane, &sums);
        let temporal_correlation = self.lagged.correlation();
        let context = self.context(&correlation, temporal_correlation);
        sums.iter_mut().for_each(|s| s.shared = context.shared_by_a_frame(s));
        let (cells, trusted, mut notes) = trusted_cells(&sums, &context);
        notes.extend(self.follow.drift_sigmas().map(|sigmas| {
            let way = if sigmas > 0.0 { "farther away" } else { "nearer" };
            format!(
                "the target is {:.1} of its sigmas {way} in its last frames than in its first: it, the sensor or its \
                 temperature drifts, which temporal sigma holds and spatial sigma does not",
                sigmas.abs()
            )
        }));
        let whole = context.cell(&trusted)?;
        let axis_distance_m = plane.depth(0.0, 0.0);
        // The same error in inverse depth, converted to another depth.
        let to_axis = (axis_distance_m / whole.z_m).powi(2);
        Some(ViewMeasurement {
            name: String::new(),
            time_s: 0.0,
            plane,
            z_m: whole.z_m,
            theta_rad: plane.theta(),
            azimuth_rad: plane.azimuth(),
            whole,
            cells,
            paper: None,
            correlation,
            temporal_correlation,
            frames,
            exclusions: target.exclusions,
            reference_distance_m: None,
            axis_distance_m,
            axis_std_error_m: self.axis_lever() * to_axis * whole.mean_std_error_m,
            disparity_px_m: self.bench.sensor.disparity_px_m(),
            reference_uncertainty_m: None,
            distance_budget: None,
            infrared: None,
            picture: self.picture(&shift),
            notes,
            digest: [0; 32],
        })
    }

    /// Standard error of the plane on the optical axis over that at the centroid of the pixels: a plane is
    /// affine in the ray, and less certain away from the pixels it was fitted to.
    fn axis_lever(&self) -> f64 {
        let mut normal = Matrix3::zeros();
        let seen = self.pixels.iter().zip(&self.count).filter(|(_, n)| **n > 0);
        for (&i, _) in seen {
            let (x, y) = self.bench.rays.at(i as usize);
            let row = Vector3::new(x, y, 1.0);
            normal += row * row.transpose();
        }
        let pixels = normal[(2, 2)];
        normal.try_inverse().map_or(1.0, |inverse| (pixels * inverse[(2, 2)]).max(1.0).sqrt())
    }

    /// Fits a robust plane to the mean of all frames.
    fn refit(&self, target: &Target) -> Plane {
        let mut w = vec![f32::NAN; self.bench.sensor.camera.pixels()];
        let min_readings = (self.lagged.frames as u32 / 4).max(1);
        for (k, &i) in self.pixels.iter().enumerate() {
            if self.count[k] >= min_readings {
                let mean = self.sum[k] / f64::from(self.count[k]);
                w[i as usize] = (1.0 / (f64::from(self.expected[k]) + mean)) as f32;
            }
        }
        let floor = 0.1 * self.step(self.plane.q.z.abs());
        fit_affine_robust(
            &w,
            &self.bench.rays,
            &target.pixels,
            &self.plane,
            floor,
            Effort::AllPixels,
        )
        .map_or(self.plane, |fit| fit.plane)
    }

    /// Change of each pixel's expected depth by the refit, m.
    fn shift_to(&self, plane: &Plane) -> Vec<f64> {
        let rays = &self.bench.rays;
        let rise = |(&i, &old): (&u32, &f32)| plane.depth_at(rays, i as usize) - f64::from(old);
        self.pixels.iter().zip(&self.expected).map(rise).collect()
    }

    fn sums_of(&self, cell: usize, plane: &Plane, shift: &[f64]) -> Sums {
        let mut s = Sums {
            dropouts: self.dropouts[cell],
            cut: self.beyond[cell],
            bins: 1.0,
            ..Sums::default()
        };
        for k in self.cell_range(cell) {
            let n = f64::from(self.count[k]);
            if n == 0.0 {
                continue;
            }
            let c = shift[k];
            let e = self.sum[k] - n * c;
            let e2 = self.square[k] - 2.0 * c * self.sum[k] + n * c * c;
            let (x, y) = self.bench.rays.at(self.pixels[k] as usize);
            let per_axial = perpendicular_per_axial(plane, x, y);
            s.n += n;
            s.z += n * (f64::from(self.expected[k]) + c) + e;
            s.e += e;
            s.e2 += e2;
            s.p2 += e2 * per_axial * per_axial;
            s.pixels += 1.0;
            if n >= 2.0 {
                s.within += (self.square[k] - self.sum[k] * self.sum[k] / n).max(0.0);
                s.within_dof += n - 1.0;
            }
        }
        let f = &self.frames[cell];
        if f.n > 0.0 && self.lagged.frames > 1 {
            s.between = (f.mean_square - f.sum * f.sum / f.n).max(0.0);
        }
        s
    }

    fn context(&self, correlation: &Correlation, temporal: Option<f64>) -> Context {
        let rho = temporal.unwrap_or(0.0).clamp(0.0, 0.95);
        Context {
            frames: self.lagged.frames as f64,
            cut_factor: normal_cut_factor(CUT_SIGMAS),
            correlation_sum: correlation.sum,
            correlation_squares: correlation.sum_of_squares,
            temporal_rho: rho,
            view_pixels: self.pixels.len() as f64,
        }
    }

    /// Correlation of the first frame's residuals, each in units of its cell's standard deviation.
    fn correlation(&self, first: &Frame, plane: &Plane, sums: &[Sums]) -> Correlation {
        let camera = &self.bench.sensor.camera;
        let mut field = vec![f32::NAN; camera.pixels()];
        for (cell, s) in sums.iter().enumerate() {
            let per_sigma = 1.0 / (s.e2 / s.n.max(1.0)).sqrt().max(f64::MIN_POSITIVE) as f32;
            for k in self.cell_range(cell) {
                let i = self.pixels[k] as usize;
                let z = self.bench.table.metres(first.raw[i]);
                let e = z - plane.depth_at(&self.bench.rays, i) as f32;
                if e.abs() < self.cut[cell] {
                    field[i] = e * per_sigma;
                }
            }
        }
        centre(&mut field);
        measure_correlation(&field, camera.width)
    }

    fn picture(&self, shift: &[f64]) -> ResidualPicture {
        let camera = &self.bench.sensor.camera;
        let shrink = camera.width.div_ceil(PICTURE_WIDTH).max(1);
        let (width, height) = (camera.width.div_ceil(shrink), camera.height.div_ceil(shrink));
        let mut sum = vec![0f64; width * height];
        let mut n = vec![0f64; width * height];
        for (k, &i) in self.pixels.iter().enumerate() {
            let i = i as usize;
            let at = (i / camera.width / shrink) * width + (i % camera.width) / shrink;
            let count = f64::from(self.count[k]);
            sum[at] += self.sum[k] - count * shift[k];
            n[at] += count;
        }
        let millimetres = sum
            .iter()
            .zip(&n)
            .map(|(s, &n)| if n > 0.0 { (1000.0 * s / n) as f32 } else { f32::NAN })
            .collect();
        ResidualPicture { width, height, millimetres }
    }
}

/// The cells that show the target's noise, their merged sums, and why the others do not.
fn trusted_cells(sums: &[Sums], context: &Context) -> (Vec<Cell>, Sums, Vec<String>) {
    let (bins, sums): (Vec<Bin>, Vec<&Sums>) = sums
        .iter()
        .filter_map(|s| Some((Bin { cell: context.cell(s)?, mean_m: s.e / s.n }, s)))
        .unzip();
    let (mut cells, mut whole, mut notes) = (Vec::new(), Sums::default(), Vec::new());
    for ((bin, sums), doubt) in bins.iter().zip(sums).zip(doubts(&bins)) {
        match doubt {
            Some(why) => notes.push(why),
            None => {
                cells.push(bin.cell);
                whole.merge(sums);
            }
        }
    }
    (cells, whole, notes)
}

/// Largest width, px: enough to show a lens's bowl and a firmware's bands, in 77 kB per view.
const PICTURE_WIDTH: usize = 160;

/// Subtracts the mean: an offset of the whole frame is not correlation between pixels.
fn centre(field: &mut [f32]) {
    let mean = mean(field.iter().map(|e| f64::from(*e))).unwrap_or(0.0) as f32;
    field.iter_mut().for_each(|e| *e -= mean);
}
