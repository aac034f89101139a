//! The streaming pass: residuals of the target's pixels, frame by frame, into sums.

use nalgebra::{Matrix3, Vector3};

use super::cells::{Cell, Context, Sums};
use super::doubtful::{Bin, doubts};
use super::grouping::{CUT_SIGMAS, by_cell, expected, settled_scale};
use super::lagged::Lagged;
use super::{Planes, ResidualPicture, ViewMeasurement, Workbench};
use crate::frame::Frame;
use crate::plane::{Effort, Plane, Target, fit_affine_robust};
use crate::residual::perpendicular_per_axial;
use crate::stats::{Correlation, measure_correlation, normal_cut_factor};

pub(super) struct Scan<'a> {
    bench: &'a Workbench<'a>,
    /// Pixels grouped by cell, in image order inside a cell.
    pixels: Vec<u32>,
    /// First index into `pixels` of each cell, and the end.
    starts: Vec<usize>,
    plane: Plane,
    /// Expected depth, m, pixel by pixel of `pixels`.
    expected: Vec<f32>,
    /// Greatest residual kept in each cell, m.
    cut: Vec<f32>,
    count: Vec<u32>,
    sum: Vec<f64>,
    square: Vec<f64>,
    frames: Vec<FrameSums>,
    missing: Vec<usize>,
    beyond: Vec<usize>,
    lagged: Lagged,
    /// Sum of the frames' own planes when they are fitted one by one.
    own_planes: Vector3<f64>,
}

/// Per cell: number and sum of residuals, frame by frame reduced to what the variance between
/// frames needs.
#[derive(Debug, Clone, Copy, Default)]
struct FrameSums {
    n: f64,
    sum: f64,
    mean_square: f64,
}

impl<'a> Scan<'a> {
    /// Group the target's pixels into cells and find each cell's cut from the frames held.
    pub fn begin(bench: &'a Workbench<'a>, target: &Target, held: &[Frame]) -> Self {
        let plane = target.plane;
        let (pixels, starts) = by_cell(&target.pixels, &plane, bench);
        let cells = starts.len() - 1;
        let n = pixels.len();
        let mut scan = Scan {
            bench,
            expected: expected(&pixels, &plane, bench),
            pixels,
            starts,
            plane,
            cut: vec![0.0; cells],
            count: vec![0; n],
            sum: vec![0.0; n],
            square: vec![0.0; n],
            frames: vec![FrameSums::default(); cells],
            missing: vec![0; cells],
            beyond: vec![0; cells],
            lagged: Lagged::default(),
            own_planes: Vector3::zeros(),
        };
        scan.find_cuts(held);
        scan
    }

    fn cell_range(&self, cell: usize) -> std::ops::Range<usize> {
        self.starts[cell]..self.starts[cell + 1]
    }

    /// Robust scale of each cell: median absolute deviation, then cut and corrected until it
    /// settles.
    fn find_cuts(&mut self, held: &[Frame]) {
        const ENOUGH: usize = 20_000;
        for cell in 0..self.cut.len() {
            let range = self.cell_range(cell);
            let stride = (range.len() * held.len() / ENOUGH).max(1);
            let residuals: Vec<f32> = held
                .iter()
                .flat_map(|frame| range.clone().map(move |k| (frame, k)))
                .step_by(stride)
                .map(|(frame, k)| self.residual(frame, k))
                .filter(|e| e.is_finite())
                .collect();
            self.cut[cell] = (CUT_SIGMAS * settled_scale(residuals, self.min_scale(cell))) as f32;
        }
    }

    /// A fronto-parallel plane in a coarse code may show no spread at all.
    fn min_scale(&self, cell: usize) -> f64 {
        let z = f64::from(self.expected[self.starts[cell]]);
        0.3 * self.bench.step(1.0 / z) * z * z
    }

    #[inline]
    fn residual(&self, frame: &Frame, k: usize) -> f32 {
        self.bench.table.metres(frame.raw[self.pixels[k] as usize]) - self.expected[k]
    }

    /// Standard deviation of the perpendicular residual over the whole view, from the cuts.
    pub fn sigma_perpendicular(&self) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for (cell, &cut) in self.cut.iter().enumerate() {
            let range = self.cell_range(cell);
            let (x, y) = self.bench.rays.at(self.pixels[range.start] as usize);
            let sigma = f64::from(cut) / CUT_SIGMAS * perpendicular_per_axial(&self.plane, x, y);
            sum += sigma * sigma * range.len() as f64;
            n += range.len() as f64;
        }
        (sum / n).sqrt()
    }

    pub fn add(&mut self, frame: &Frame) {
        match self.bench.options.planes {
            Planes::PerView => {
                self.own_planes += self.plane.q;
                self.accumulate(frame, None);
            }
            Planes::PerFrame => {
                let own = self.own_plane(frame).unwrap_or(self.plane);
                self.own_planes += own.q;
                self.accumulate(frame, Some(own));
            }
        }
        self.lagged.frames += 1;
    }

    fn accumulate(&mut self, frame: &Frame, own: Option<Plane>) {
        let follow = self.lagged.frames < super::HELD_FRAMES;
        let mut residuals = if follow { vec![f32::NAN; self.pixels.len()] } else { Vec::new() };
        for cell in 0..self.cut.len() {
            let cut = self.cut[cell];
            let (mut n, mut total) = (0u32, 0f64);
            for k in self.cell_range(cell) {
                let i = self.pixels[k] as usize;
                let z = self.bench.table.metres(frame.raw[i]);
                let expected = match own {
                    None => self.expected[k],
                    Some(plane) => {
                        let (x, y) = self.bench.rays.at(i);
                        plane.depth(x, y) as f32
                    }
                };
                let e = z - expected;
                if e.abs() < cut {
                    self.count[k] += 1;
                    let e64 = f64::from(e);
                    self.sum[k] += e64;
                    self.square[k] += e64 * e64;
                    n += 1;
                    total += e64;
                    if follow {
                        residuals[k] = e;
                    }
                } else if z.is_finite() {
                    self.beyond[cell] += 1;
                } else {
                    self.missing[cell] += 1;
                }
            }
            if n > 0 {
                let f = &mut self.frames[cell];
                f.n += f64::from(n);
                f.sum += total;
                f.mean_square += total * total / f64::from(n);
            }
        }
        if follow {
            self.lagged.follow(residuals);
        }
    }

    /// Least squares of this frame alone, on the residuals inside the cut, in inverse depth.
    fn own_plane(&self, frame: &Frame) -> Option<Plane> {
        let mut normal = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for cell in 0..self.cut.len() {
            for k in self.cell_range(cell) {
                let e = self.residual(frame, k);
                if e.abs() < self.cut[cell] {
                    let (x, y) = self.bench.rays.at(self.pixels[k] as usize);
                    let ray = Vector3::new(x, y, 1.0);
                    let z = f64::from(self.expected[k]);
                    normal += ray * ray.transpose();
                    right += ray * (1.0 / (z + f64::from(e)) - 1.0 / z);
                }
            }
        }
        let shift = normal.cholesky()?.solve(&right);
        Some(Plane::new(self.plane.q + shift)).filter(Plane::is_finite)
    }

    /// Refit on all frames, and turn the sums into the view's result (names and notes are the
    /// caller's). `None` when nothing was measured.
    pub fn finish(self, target: &Target, first: &Frame) -> Option<ViewMeasurement> {
        let frames = self.lagged.frames;
        let plane = match self.bench.options.planes {
            Planes::PerView => self.refit(target),
            Planes::PerFrame => Plane::new(self.own_planes / frames as f64),
        };
        let shift = self.shift_to(&plane);
        let sums = self.sums(&plane, &shift);
        let correlation = self.correlation(first, &plane, &sums);
        let temporal_correlation = self.lagged.correlation();
        let context = self.context(&correlation, temporal_correlation);
        let (cells, trusted, notes) = trusted_cells(&sums, &context);
        let whole = context.cell(&trusted)?;
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
            axis_distance_m: plane.depth(0.0, 0.0),
            infrared: None,
            picture: self.picture(&shift),
            notes,
            digest: [0; 32],
        })
    }

    /// The robust plane through the mean of all frames.
    fn refit(&self, target: &Target) -> Plane {
        let mut w = vec![f32::NAN; self.bench.sensor.camera.pixels()];
        let fewest = (self.lagged.frames as u32 / 4).max(1);
        for (k, &i) in self.pixels.iter().enumerate() {
            if self.count[k] >= fewest {
                let mean = self.sum[k] / f64::from(self.count[k]);
                w[i as usize] = (1.0 / (f64::from(self.expected[k]) + mean)) as f32;
            }
        }
        let floor = 0.1 * self.bench.step(self.plane.q.z.abs());
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

    /// By how much the expected depth of each pixel rose with the refit, m.
    fn shift_to(&self, plane: &Plane) -> Vec<f64> {
        if self.bench.options.planes == Planes::PerFrame {
            return vec![0.0; self.pixels.len()];
        }
        self.pixels
            .iter()
            .zip(&self.expected)
            .map(|(&i, &old)| {
                let (x, y) = self.bench.rays.at(i as usize);
                plane.depth(x, y) - f64::from(old)
            })
            .collect()
    }

    fn sums(&self, plane: &Plane, shift: &[f64]) -> Vec<Sums> {
        (0..self.cut.len()).map(|cell| self.sums_of(cell, plane, shift)).collect()
    }

    fn sums_of(&self, cell: usize, plane: &Plane, shift: &[f64]) -> Sums {
        let mut s = Sums { missing: self.missing[cell], cut: self.beyond[cell], ..Sums::default() };
        for k in self.cell_range(cell) {
            let n = f64::from(self.count[k]);
            if n == 0.0 {
                continue;
            }
            let c = shift[k];
            let e = self.sum[k] - n * c;
            let e2 = self.square[k] - 2.0 * c * self.sum[k] + n * c * c;
            let (x, y) = self.bench.rays.at(self.pixels[k] as usize);
            let across = perpendicular_per_axial(plane, x, y);
            s.n += n;
            s.z += n * (f64::from(self.expected[k]) + c) + e;
            s.e += e;
            s.e2 += e2;
            s.p2 += e2 * across * across;
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
            per_frame_planes: self.bench.options.planes == Planes::PerFrame,
        }
    }

    /// Of the first frame's residual, each in units of its cell's standard deviation.
    fn correlation(&self, first: &Frame, plane: &Plane, sums: &[Sums]) -> Correlation {
        let camera = &self.bench.sensor.camera;
        let mut field = vec![f32::NAN; camera.pixels()];
        for (cell, s) in sums.iter().enumerate() {
            let per_sigma = 1.0 / (s.e2 / s.n.max(1.0)).sqrt().max(f64::MIN_POSITIVE) as f32;
            for k in self.cell_range(cell) {
                let i = self.pixels[k] as usize;
                let (x, y) = self.bench.rays.at(i);
                let z = self.bench.table.metres(first.raw[i]);
                let e = z - plane.depth(x, y) as f32;
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

/// The cells that show the target's noise, their sums as one, and why the others do not.
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

/// Enough to see a lens's bowl and a firmware's bands; 77 kB a view.
const PICTURE_WIDTH: usize = 160;

/// Take the mean out: what a frame shares as a whole is not correlation between pixels.
fn centre(field: &mut [f32]) {
    let (mut sum, mut n) = (0f64, 0f64);
    for e in field.iter().filter(|e| e.is_finite()) {
        sum += f64::from(*e);
        n += 1.0;
    }
    let mean = (sum / n.max(1.0)) as f32;
    field.iter_mut().for_each(|e| *e -= mean);
}
