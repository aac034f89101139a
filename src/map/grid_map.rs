//! A map without a model behind it: the points of all frames, averaged in cubes.

use nalgebra::{Isometry3, Vector3};

use super::cells::{Cells, place_of};
use super::motion::Motion;
use super::point::Point;
use super::surfels::colour_of;

/// A point of a finished map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPoint {
    /// m, in the frame of the first camera.
    pub at: Vector3<f32>,
    pub normal: Vector3<f32>,
    /// Of its place across its surface, m.
    pub sigma: f32,
    /// Red, green, blue; grey where no colour was seen.
    pub colour: [u8; 3],
}

/// Side of a cube, m.
const SIDE_M: f32 = 0.03;
/// For what was never seen in colour.
const GREY: [u8; 3] = [160; 3];

/// Means weighted by information, 1 / sigma^2.
#[derive(Debug, Clone, Default)]
pub struct GridMap {
    cells: Cells,
    sums: Vec<Sum>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    information: f32,
    /// Relative to the first point that fell in, weighted.
    off: Vector3<f32>,
    first: Vector3<f32>,
    normal: Vector3<f32>,
    colour: Vector3<f32>,
    coloured: f32,
}

impl GridMap {
    pub fn add(&mut self, points: &[Point], pose: &Isometry3<f64>, rgb: Option<&[u8]>) {
        let motion = Motion::of(pose);
        for point in points {
            let at = motion.moved(&point.at);
            let index = self.cells.add(place_of(&at, 1.0 / SIDE_M));
            if index == self.sums.len() {
                self.sums.push(Sum { first: at, ..Sum::default() });
            }
            let sum = &mut self.sums[index];
            let information = point.across.powi(-2);
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
            colour: colour_or_grey(sum.colour, sum.coloured),
        };
        self.sums.iter().map(point).collect()
    }
}

/// The mean colour of `n` sums, or grey.
pub fn colour_or_grey(sum: Vector3<f32>, n: f32) -> [u8; 3] {
    if n > 0.0 { [0, 1, 2].map(|k| (sum[k] / n).round().clamp(0.0, 255.0) as u8) } else { GREY }
}
