//! The finished map: its points, the PLY file, and a grid that averages the points of all frames, for the
//! methods without surfels.

use nalgebra::{Isometry3, Vector3};

use super::point::{Motion, Point};
use super::sparse_grid::{SparseGrid, cell_of};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPoint {
    /// m, in the frame of the first camera.
    pub at: Vector3<f32>,
    pub normal: Vector3<f32>,
    /// Standard deviation along the normal, m.
    pub sigma: f32,
    /// Red, green, blue; grey without colour.
    pub colour: [u8; 3],
}

/// The map as a binary little-endian PLY file, as MeshLab and CloudCompare read it: positions, normals,
/// colours and `sigma`, m.
pub fn ply(points: &[MapPoint]) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment kinoise map; metres; frame of the first camera\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float sigma\nend_header\n",
        points.len()
    );
    let mut bytes = Vec::with_capacity(header.len() + points.len() * 31);
    bytes.extend_from_slice(header.as_bytes());
    for point in points {
        for v in point.at.iter().chain(point.normal.iter()) {
            bytes.extend_from_slice(&v.to_le_bytes());
        }
        bytes.extend_from_slice(&point.colour);
        bytes.extend_from_slice(&point.sigma.to_le_bytes());
    }
    bytes
}

/// Side of a cell, m.
const SIDE_M: f32 = 0.03;
/// Colour of points never seen in colour.
const GREY: [u8; 3] = [160; 3];

/// Means of points in cells, weighted by information, 1 / sigma^2.
#[derive(Debug, Clone, Default)]
pub struct PointGrid {
    cells: SparseGrid,
    sums: Vec<Sum>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    information: f32,
    /// Weighted sum relative to the first point in the cell.
    off: Vector3<f32>,
    first: Vector3<f32>,
    normal: Vector3<f32>,
    colour: Vector3<f32>,
    coloured: f32,
}

impl PointGrid {
    pub fn add(&mut self, points: &[Point], pose: &Isometry3<f64>, rgb: Option<&[u8]>) {
        let motion = Motion::of(pose);
        for point in points {
            let at = motion.moved(&point.at);
            let index = self.cells.insert(cell_of(&at, 1.0 / SIDE_M));
            if index == self.sums.len() {
                self.sums.push(Sum { first: at, ..Sum::default() });
            }
            let sum = &mut self.sums[index];
            let information = point.sigma_normal.powi(-2);
            sum.information += information;
            sum.off += (at - sum.first) * information;
            sum.normal += motion.turned(&point.normal) * information;
            if let Some(rgb) = rgb {
                sum.colour += colour_of(rgb, point.pixel);
                sum.coloured += 1.0;
            }
        }
    }

    pub fn points(&self) -> Vec<MapPoint> {
        let point = |sum: &Sum| MapPoint {
            at: sum.first + sum.off / sum.information,
            normal: sum.normal.try_normalize(f32::MIN_POSITIVE).unwrap_or_else(Vector3::z),
            sigma: sum.information.powf(-0.5),
            colour: mean_colour(sum.colour, sum.coloured),
        };
        self.sums.iter().map(point).collect()
    }
}

/// Red, green and blue of a pixel, 0 to 255.
pub fn colour_of(rgb: &[u8], pixel: u32) -> Vector3<f32> {
    let i = 3 * pixel as usize;
    Vector3::new(rgb[i], rgb[i + 1], rgb[i + 2]).map(f32::from)
}

/// Mean of `n` colours from their sum; grey for none.
pub fn mean_colour(sum: Vector3<f32>, n: f32) -> [u8; 3] {
    if n > 0.0 { [0, 1, 2].map(|k| (sum[k] / n).round().clamp(0.0, 255.0) as u8) } else { GREY }
}
