//! Depth image -> voxel grid -> points with normals: the paper's front end. A voxel keeps the moments
//! of its points; its normal is the direction of least variance in its neighbourhood.

use nalgebra::Vector3;

use super::point::{Noise, Point};
use super::sparse_grid::{Cell, SparseGrid, cell_along};
use crate::camera::Rays;

/// The pixels whose points fall in one cell; moments about the cell's corner.
#[derive(Debug, Clone, Copy, Default)]
pub struct Voxel {
    pub n: f32,
    pub sum: Vector3<f32>,
    /// xx, xy, xz, yy, yz, zz.
    pub squares: [f32; 6],
    /// The first of these pixels.
    pub pixel: u32,
}

/// A depth image as occupied cells.
pub struct Voxels {
    pub side_m: f32,
    pub grid: SparseGrid,
    /// Indexed by the index of their cells.
    pub voxels: Vec<Voxel>,
}

/// Capacity: a Kinect's image of a room fills about this many cells of 3 cm.
const USUAL_CELLS: usize = 20_000;

impl Voxels {
    /// Bins a depth image, m, NaN where nothing was measured.
    pub fn of(depth: &[f32], rays: &Rays, side_m: f32) -> Self {
        let mut grid = SparseGrid::with_room(USUAL_CELLS);
        let mut voxels: Vec<Voxel> = Vec::with_capacity(USUAL_CELLS);
        // Neighbouring pixels mostly fall in one cell, which is looked up only when a run leaves it.
        let (mut here, mut run) = ([i32::MAX; 3], Run::default());
        let mut leave = |cell: Cell, run: &Run| {
            if run.voxel.n > 0.0 {
                let index = grid.insert(cell);
                if index == voxels.len() {
                    voxels.push(Voxel { pixel: run.voxel.pixel, ..Voxel::default() });
                }
                voxels[index].plus(&run.voxel);
            }
        };
        let mut at = [[0.0; STRIP]; 3];
        let mut cells = [[0; STRIP]; 3];
        for begin in (0..depth.len()).step_by(STRIP) {
            let strip = begin..(begin + STRIP).min(depth.len());
            let n = strip.len();
            let depth = &depth[strip.clone()];
            let ([xs, ys, zs], rays) = (&mut at, [&rays.x[strip.clone()], &rays.y[strip]]);
            zs[..n].copy_from_slice(depth);
            for (place, ray) in [xs, ys].into_iter().zip(rays) {
                for ((place, &ray), &z) in place.iter_mut().zip(ray).zip(depth) {
                    *place = ray * z;
                }
            }
            for (cells, places) in cells.iter_mut().zip(&at) {
                for (cell, &place) in cells.iter_mut().zip(places) {
                    *cell = cell_along(place, 1.0 / side_m);
                }
            }
            for i in 0..n {
                let at = Vector3::new(at[0][i], at[1][i], at[2][i]);
                if !(at.z > 0.0 && at.z.is_finite()) {
                    continue;
                }
                let cell = [cells[0][i], cells[1][i], cells[2][i]];
                if cell != here {
                    leave(here, &run);
                    here = cell;
                    run = Run::begin(cell, side_m, begin + i);
                }
                run.voxel.add(at - run.corner);
            }
        }
        leave(here, &run);
        Voxels { side_m, grid, voxels }
    }

    pub fn mean(&self, index: usize) -> Vector3<f32> {
        let voxel = &self.voxels[index];
        corner(self.grid.cell(index), self.side_m) + voxel.sum / voxel.n
    }
}

/// Pixels processed at once, few enough for a core's fast cache.
const STRIP: usize = 128;

/// Consecutive pixels that fall in one cell.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    voxel: Voxel,
    corner: Vector3<f32>,
}

impl Run {
    fn begin(cell: Cell, side_m: f32, pixel: usize) -> Self {
        Run {
            voxel: Voxel { pixel: pixel as u32, ..Voxel::default() },
            corner: corner(cell, side_m),
        }
    }
}

#[inline]
fn corner(cell: Cell, side_m: f32) -> Vector3<f32> {
    Vector3::from(cell.map(|v| v as f32)) * side_m
}

impl Voxel {
    #[inline]
    fn add(&mut self, p: Vector3<f32>) {
        self.n += 1.0;
        self.sum += p;
        let products = [p.x * p.x, p.x * p.y, p.x * p.z, p.y * p.y, p.y * p.z, p.z * p.z];
        for (sum, product) in self.squares.iter_mut().zip(products) {
            *sum += product;
        }
    }

    /// Adds another voxel's moments about the same corner.
    #[inline]
    fn plus(&mut self, other: &Voxel) {
        self.n += other.n;
        self.sum += other.sum;
        for (sum, more) in self.squares.iter_mut().zip(other.squares) {
            *sum += more;
        }
    }

    /// Adds another voxel's moments, whose corner is at the offset `o` from this one's, m.
    #[inline]
    fn merge(&mut self, other: &Voxel, o: Vector3<f32>) {
        let (s, n) = (other.sum, other.n);
        self.n += n;
        self.sum += s + o * n;
        let q = &other.squares;
        self.squares[0] += q[0] + o.x * (2.0 * s.x + n * o.x);
        self.squares[1] += q[1] + o.x * s.y + o.y * (s.x + n * o.x);
        self.squares[2] += q[2] + o.x * s.z + o.z * (s.x + n * o.x);
        self.squares[3] += q[3] + o.y * (2.0 * s.y + n * o.y);
        self.squares[4] += q[4] + o.y * s.z + o.z * (s.y + n * o.y);
        self.squares[5] += q[5] + o.z * (2.0 * s.z + n * o.z);
    }
}

/// Fewest pixels that define a surface.
const MIN_PIXELS: f32 = 6.0;
/// Least ratio of the middle principal variance to the largest: less is a line, which has no normal.
const MIN_WIDTH_RATIO: f64 = 0.01;

/// Points of a voxel grid, each with the normal of all pixels in the 3 x 3 x 3 cells around it. Voxels
/// without a surface are left out.
pub fn points_of(voxels: &Voxels, noise: &Noise) -> Vec<Point> {
    let point = |index: usize| {
        let around = neighbourhood(voxels, index);
        let normal = normal_of(&around)?;
        let at = voxels.mean(index);
        let normal = if normal.dot(&at) > 0.0 { -normal } else { normal };
        let sigma_axial = noise.sigma_axial(at.z, &normal);
        let voxel = &voxels.voxels[index];
        let sigma_normal = noise.sigma_normal(sigma_axial, &at, &normal, voxel.n);
        Some(Point { at, normal, sigma_axial, sigma_normal, pixel: voxel.pixel })
    };
    (0..voxels.voxels.len()).filter_map(point).collect()
}

fn neighbourhood(voxels: &Voxels, index: usize) -> Voxel {
    let mut around = Voxel { pixel: voxels.voxels[index].pixel, ..Voxel::default() };
    let cell = voxels.grid.cell(index);
    let (low, high) = (cell.map(|v| v - 1), cell.map(|v| v + 1));
    voxels.grid.for_each_cell_within(low, high, |other, [x, y, z]| {
        let apart = [x - cell[0], y - cell[1], z - cell[2]].map(|v| v as f32);
        around.merge(&voxels.voxels[other], Vector3::from(apart) * voxels.side_m);
    });
    around
}

/// Unit vector of least variance; `None` where the points are few, on a line or a ball.
fn normal_of(v: &Voxel) -> Option<Vector3<f32>> {
    if v.n < MIN_PIXELS {
        return None;
    }
    let n = f64::from(v.n);
    let m = v.sum.map(f64::from) / n;
    let q = v.squares.map(|s| f64::from(s) / n);
    let covariance = [
        q[0] - m.x * m.x,
        q[1] - m.x * m.y,
        q[2] - m.x * m.z,
        q[3] - m.y * m.y,
        q[4] - m.y * m.z,
        q[5] - m.z * m.z,
    ];
    let ([min, middle, max], direction) = min_variance_direction(covariance)?;
    // A ball of noise has no normal either: the least variance must be below half the middle one.
    (middle > MIN_WIDTH_RATIO * max && min < 0.5 * middle).then(|| direction.cast())
}

/// Eigenvalues, ascending, and the unit eigenvector of the smallest, of the symmetric matrix with
/// entries xx, xy, xz, yy, yz, zz: in closed form by trigonometry (Smith 1961).
fn min_variance_direction(m: [f64; 6]) -> Option<([f64; 3], Vector3<f64>)> {
    let [xx, xy, xz, yy, yz, zz] = m;
    let mean = (xx + yy + zz) / 3.0;
    let (a, b, c) = (xx - mean, yy - mean, zz - mean);
    let off = xy * xy + xz * xz + yz * yz;
    let p = ((a * a + b * b + c * c + 2.0 * off) / 6.0).sqrt();
    if p.is_nan() || p <= 0.0 {
        return None;
    }
    let det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let angle = (det / (2.0 * p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    // cos(a + 120 degrees) from cos(a); a is 60 degrees at most.
    let cos = angle.cos();
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let max = mean + 2.0 * p * cos;
    let min = mean - p * (cos + 3f64.sqrt() * sin);
    let middle = 3.0 * mean - max - min;
    // Rows of M - min I are normal to the eigenvector; the longest of their cross products is along it.
    let rows = [
        Vector3::new(xx - min, xy, xz),
        Vector3::new(xy, yy - min, yz),
        Vector3::new(xz, yz, zz - min),
    ];
    let products = [rows[0].cross(&rows[1]), rows[0].cross(&rows[2]), rows[1].cross(&rows[2])];
    let longest = products
        .into_iter()
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
        .unwrap_or_default();
    let direction = longest.try_normalize(f64::MIN_POSITIVE)?;
    Some(([min, middle, max], direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, SymmetricEigen};
    use proptest::prelude::*;

    proptest! {
        /// Against nalgebra's iteration.
        #[test]
        fn the_direction_of_least_variance_is_an_eigenvector(a in prop::array::uniform9(-1.0f64..1.0)) {
            let half = Matrix3::from_row_slice(&a);
            let m = half * half.transpose() + Matrix3::from_diagonal_element(1e-3);
            let found = min_variance_direction([
                m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)],
            ]);
            let mut values: Vec<f64> = SymmetricEigen::new(m).eigenvalues.iter().copied().collect();
            values.sort_by(f64::total_cmp);
            let (found, direction) = found.unwrap();
            prop_assert!((found[0] - values[0]).abs() < 1e-8 * values[2]);
            prop_assert!((found[1] - values[1]).abs() < 1e-8 * values[2]);
            if values[1] - values[0] > 1e-3 * values[2] {
                prop_assert!((m * direction - direction * values[0]).norm() < 1e-6 * values[2]);
            }
        }
    }
}
