//! The streaming pass: sums the residuals of the target's pixels, frame by frame.

use super::Workbench;
use super::follow::{Follow, MAJORITY, NO_SHIFT, centre};
use super::grouping::{CUT_SIGMAS, by_cell, settled_scale, words_a_step};
use crate::frame::Frame;
use crate::plane::{Plane, Target};
use crate::residual::perpendicular_per_axial;

/// Frames used to find the target and the scale; more would not improve them.
pub(super) const HELD_FRAMES: usize = 8;

/// A frame that measures a smaller share of the target has lost it, and does not show it elsewhere.
const MIN_MEASURED: f64 = 0.1;

pub(super) struct Scan<'a> {
    pub(super) bench: &'a Workbench<'a>,
    /// Pixels grouped by cell, in image order inside a cell.
    pub(super) pixels: Vec<u32>,
    /// First index of each cell in `pixels`, and the end.
    pub(super) starts: Vec<usize>,
    pub(super) plane: Plane,
    /// See [`words_a_step`].
    pub(super) words_a_step: f64,
    /// Expected depth of each of `pixels`, m.
    pub(super) expected: Vec<f32>,
    /// Largest residual kept in each cell, m, relative to the cell's offset in the frame.
    pub(super) cut: Vec<f32>,
    pub(super) follow: Follow,
    pub(super) count: Vec<u32>,
    pub(super) sum: Vec<f64>,
    pub(super) square: Vec<f64>,
    pub(super) frames: Vec<FrameSums>,
    pub(super) dropouts: Vec<usize>,
    pub(super) beyond: Vec<usize>,
    pub(super) lagged: Lagged,
}

/// Sums of a cell's residuals over the frames, for the variance between frames.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrameSums {
    pub n: f64,
    pub sum: f64,
    pub mean_square: f64,
}

impl<'a> Scan<'a> {
    /// Groups the target's pixels into cells and finds each cell's cut from the frames held.
    pub fn begin(bench: &'a Workbench<'a>, target: &Target, held: &[Frame]) -> Self {
        let plane = target.plane;
        let (pixels, starts) = by_cell(&target.pixels, &plane, bench);
        let cells = starts.len() - 1;
        let n = pixels.len();
        let words = held.iter().flat_map(|frame| pixels.iter().map(|&i| frame.raw[i as usize]));
        let words_a_step = words_a_step(words, &bench.table);
        let expected = |&i: &u32| plane.depth_at(&bench.rays, i as usize) as f32;
        let mut scan = Scan {
            bench,
            expected: pixels.iter().map(expected).collect(),
            pixels,
            starts,
            plane,
            words_a_step,
            cut: vec![0.0; cells],
            follow: Follow::over(cells, held.len()),
            count: vec![0; n],
            sum: vec![0.0; n],
            square: vec![0.0; n],
            frames: vec![FrameSums::default(); cells],
            dropouts: vec![0; cells],
            beyond: vec![0; cells],
            lagged: Lagged::default(),
        };
        scan.find_cuts(held);
        scan
    }

    pub(super) fn cell_range(&self, cell: usize) -> std::ops::Range<usize> {
        self.starts[cell]..self.starts[cell + 1]
    }

    /// Finds each cell's cut and mean from its robust scale: the median absolute deviation, refined by
    /// [`settled_scale`].
    fn find_cuts(&mut self, held: &[Frame]) {
        for cell in 0..self.cut.len() {
            let (range, stride) = (self.cell_range(cell), self.stride(cell));
            let mut residuals: Vec<f32> = held
                .iter()
                .flat_map(|frame| range.clone().map(move |k| (frame, k)))
                .step_by(stride)
                .map(|(frame, k)| self.residual(frame, k))
                .filter(|e| e.is_finite())
                .collect();
            let scale = settled_scale(residuals.clone(), self.min_scale(cell));
            self.cut[cell] = (CUT_SIGMAS * scale) as f32;
            self.follow.usual[cell] = centre(&mut residuals, self.cut[cell]);
        }
    }

    /// Stride through a cell's pixels that leaves enough for its cut.
    fn stride(&self, cell: usize) -> usize {
        const ENOUGH: usize = 20_000;
        (self.cell_range(cell).len() * self.follow.held / ENOUGH).max(1)
    }

    /// Offset of each cell's residuals in this frame; `None` where more than half of them are beyond the cut.
    pub(super) fn shifts(&mut self, frame: &Frame) -> Option<Vec<f32>> {
        let (mut kept, mut measured) = (0, 0);
        let mut offsets = Vec::with_capacity(self.cut.len());
        for (cell, &cut) in self.cut.iter().enumerate() {
            let stride = self.stride(cell);
            let pixels = self.cell_range(cell).step_by(stride);
            let mut residuals: Vec<f32> =
                pixels.map(|k| self.residual(frame, k)).filter(|e| e.is_finite()).collect();
            let offset = self.follow.offset(cell, centre(&mut residuals, cut), cut);
            kept += stride * residuals.iter().filter(|e| (*e - offset).abs() < cut).count();
            measured += stride * residuals.len();
            offsets.push(offset);
        }
        let told = measured as f64 > MIN_MEASURED * self.pixels.len() as f64;
        if self.follow.held >= MAJORITY && told && 2 * kept < measured {
            return None;
        }
        self.follow.last.clone_from(&offsets);
        let largest = (0..self.cut.len()).max_by_key(|&cell| self.cell_range(cell).len())?;
        self.follow.path.push(offsets[largest] / self.cut[largest]);
        for (offset, cut) in offsets.iter_mut().zip(&self.cut) {
            if offset.abs() < NO_SHIFT * cut {
                *offset = 0.0;
            }
        }
        Some(offsets)
    }

    /// Step of the sensor at inverse depth `w`, 1/m.
    pub(super) fn step(&self, w: f64) -> f64 {
        self.bench.step(self.words_a_step, w)
    }

    /// Floor of the scale, m: a fronto-parallel plane in a coarse code may show no spread.
    fn min_scale(&self, cell: usize) -> f64 {
        let z = f64::from(self.expected[self.starts[cell]]);
        0.3 * self.step(1.0 / z) * z * z
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

    /// Adds a frame, unless most of the target is elsewhere than in the first frames. Returns whether it did.
    pub fn add(&mut self, frame: &Frame) -> bool {
        let Some(shifts) = self.shifts(frame) else { return false };
        self.accumulate(frame, &shifts);
        self.lagged.frames += 1;
        true
    }

    fn accumulate(&mut self, frame: &Frame, shifts: &[f32]) {
        let follow = self.lagged.frames < HELD_FRAMES;
        let mut residuals = if follow { vec![f32::NAN; self.pixels.len()] } else { Vec::new() };
        for (cell, &shift) in shifts.iter().enumerate() {
            let cut = self.cut[cell];
            let (mut n, mut total) = (0u32, 0f64);
            for k in self.cell_range(cell) {
                let z = self.bench.table.metres(frame.raw[self.pixels[k] as usize]);
                let e = z - self.expected[k];
                if (e - shift).abs() < cut {
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
                    self.dropouts[cell] += 1;
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
}

/// Mean half squared differences of a pixel's residual over one and two frames, in the first frames.
///
/// They estimate the variance times 1 - rho(lag) without the pixel's own mean. For a first-order filter
/// rho(2) = rho(1)^2, so their ratio is 1 + rho(1).
#[derive(Debug, Default)]
pub(super) struct Lagged {
    pub frames: usize,
    previous: Vec<f32>,
    before: Vec<f32>,
    one: Mean,
    two: Mean,
}

#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    n: f64,
}

impl Mean {
    fn half_squared_differences(&mut self, a: &[f32], b: &[f32]) {
        for (&a, &b) in a.iter().zip(b) {
            let d = f64::from(b - a);
            if d.is_finite() {
                self.sum += 0.5 * d * d;
                self.n += 1.0;
            }
        }
    }

    fn value(&self) -> Option<f64> {
        (self.n > 0.0 && self.sum > 0.0).then(|| self.sum / self.n)
    }
}

impl Lagged {
    pub fn follow(&mut self, residuals: Vec<f32>) {
        self.one.half_squared_differences(&self.previous, &residuals);
        self.two.half_squared_differences(&self.before, &residuals);
        self.before = std::mem::replace(&mut self.previous, residuals);
    }

    /// Correlation of the moving part one frame apart; `None` with fewer than four frames.
    pub fn correlation(&self) -> Option<f64> {
        if self.frames < 4 {
            return None;
        }
        Some((self.two.value()? / self.one.value()? - 1.0).clamp(-1.0, 1.0))
    }
}
