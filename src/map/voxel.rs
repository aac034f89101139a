//! Depth image -> voxel grid: one point a cube of space, with the moments that its normal needs.

use nalgebra::Vector3;

use super::cells::{Cells, Place, place_of};
use crate::camera::Rays;

/// The pixels whose points fall in one cube; moments about the cube's corner.
#[derive(Debug, Clone, Copy, Default)]
pub struct Voxel {
    pub n: f32,
    pub sum: Vector3<f32>,
    /// xx, xy, xz, yy, yz, zz.
    pub squares: [f32; 6],
    /// The first pixel that fell in.
    pub pixel: u32,
}

/// A depth image as occupied cubes.
#[derive(Debug, Clone)]
pub struct Voxels {
    pub side_m: f32,
    pub cells: Cells,
    /// By the index of its cube.
    pub voxels: Vec<Voxel>,
}

/// A Kinect's picture of a room fills about this many cubes of 3 cm.
const USUAL: usize = 20_000;

impl Voxels {
    /// Of a depth image, m, NaN where nothing was measured.
    pub fn of(depth: &[f32], rays: &Rays, side_m: f32) -> Self {
        let mut cells = Cells::with_room(USUAL);
        let mut voxels: Vec<Voxel> = Vec::with_capacity(USUAL);
        // Neighbouring pixels mostly fall in one cube: it is looked up when they leave it.
        let (mut here, mut run) = ([i32::MAX; 3], Run::default());
        let mut leave = |place: Place, run: &Run| {
            if run.voxel.n > 0.0 {
                let index = cells.add(place);
                if index == voxels.len() {
                    voxels.push(Voxel { pixel: run.voxel.pixel, ..Voxel::default() });
                }
                voxels[index].join(&run.voxel);
            }
        };
        let mut at = [Vector3::zeros(); STRIP];
        let mut places = [[0; 3]; STRIP];
        for begin in (0..depth.len()).step_by(STRIP) {
            let end = (begin + STRIP).min(depth.len());
            let strip = depth[begin..end].iter().zip(&rays.x[begin..end]).zip(&rays.y[begin..end]);
            for ((((&z, &x), &y), at), place) in strip.zip(&mut at).zip(&mut places) {
                *at = Vector3::new(x * z, y * z, z);
                *place = place_of(at, 1.0 / side_m);
            }
            for (i, (at, &place)) in (begin..end).zip(at.iter().zip(&places)) {
                if !(at.z > 0.0 && at.z.is_finite()) {
                    continue;
                }
                if place != here {
                    leave(here, &run);
                    here = place;
                    run = Run::begin(place, side_m, i);
                }
                run.voxel.add(at - run.corner);
            }
        }
        leave(here, &run);
        Voxels { side_m, cells, voxels }
    }

    /// The mean of a voxel's points, m.
    pub fn mean(&self, index: usize) -> Vector3<f32> {
        let voxel = &self.voxels[index];
        corner(self.cells.place(index), self.side_m) + voxel.sum / voxel.n
    }
}

/// Pixels worked on at once: what a core keeps at hand.
const STRIP: usize = 128;

/// Pixels in a row that fall in one cube.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    voxel: Voxel,
    corner: Vector3<f32>,
}

impl Run {
    fn begin(place: Place, side_m: f32, pixel: usize) -> Self {
        Run {
            voxel: Voxel { pixel: pixel as u32, ..Voxel::default() },
            corner: corner(place, side_m),
        }
    }
}

#[inline]
fn corner(place: Place, side_m: f32) -> Vector3<f32> {
    Vector3::from(place.map(|v| v as f32)) * side_m
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

    /// Add the moments of more pixels of this cube.
    #[inline]
    fn join(&mut self, other: &Voxel) {
        self.n += other.n;
        self.sum += other.sum;
        for (sum, more) in self.squares.iter_mut().zip(other.squares) {
            *sum += more;
        }
    }

    /// Add another's moments, whose corner lies at `o` from this one's, m.
    #[inline]
    pub fn merge(&mut self, other: &Voxel, o: Vector3<f32>) {
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
