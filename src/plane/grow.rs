//! Region growing over the image: which pixels hang together on one plane.
//!
//! A single pixel scatters by sigma, and a wall that a tilted board nearly touches is within a
//! few sigma of the board's plane over a long way. So not pixels are judged but neighbourhoods:
//! their mean and their spread about the plane. And a plane known from a small patch says little
//! far from it, so a round grows only as far as the plane's own standard error stays below sigma.

use nalgebra::{Matrix3, Vector3};

use super::affine::AffineFit;
use crate::camera::Rays;

/// A coarse lattice over the image: one node for every `pitch` x `pitch` pixels.
///
/// Growing on the lattice costs a tenth of growing on pixels, and bridges single dead pixels.
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    pub pitch: usize,
    pub columns: usize,
    pub rows: usize,
    /// Pixel index of each node's sample; `None` where the cell holds no measurement.
    sample: Vec<Option<u32>>,
    /// Means over each node's measured pixels: ray (x, y, 1) and inverse depth, 1/m.
    mean: Vec<Option<(Vector3<f64>, f64)>>,
}

/// Nodes across the image; 3 px pitch on a 640 px image.
const NODES_ACROSS: f64 = 213.0;
/// A node is judged by the nodes this far around it: 15 px on a 640 px image, wider than the 9 px
/// over which a Kinect's matching window correlates the noise (Konolige and Mihelich 2011).

/// The mean of a neighbourhood is off by less than this many sigma: noise alone moves it by
/// 0.6 sigma where it is correlated over 9 px; the rest is for smooth errors of lens and board,
/// which on real Kinects reach about twice the noise.
const MEAN_SIGMAS: f64 = 2.5;
/// ... and its root mean square is below this many: 3 independent samples exceed it once in 140,
/// a surface that crosses the plane at an angle exceeds it beyond the crossing.
const SPREAD_SIGMAS: f64 = 2.0;
/// Residuals count at most this many sigma, so that one gross error decides nothing.
const CLIP_SIGMAS: f64 = 6.0;
/// Side of the matching window of a Kinect v1, px at 640 px across: one independent sample each.
const CORRELATED_NODES: f64 = 9.0;

/// What a plane lets through.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gauge<'f> {
    pub fit: &'f AffineFit,
    /// Distance from the plane that is never too far, m.
    pub slack_m: f64,
}

impl Gauge<'_> {
    /// Sigma in inverse depth that the slack is worth where the plane has inverse depth `w`.
    fn sigma(&self, w: f64) -> f64 {
        self.fit.scale.max(self.slack_m * w * w / ev("SLACK"))
    }
}

impl Lattice {
    pub fn over(w: &[f32], rays: &Rays, width: usize, height: usize) -> Self {
        let pitch = ((width as f64 / NODES_ACROSS).round() as usize).max(1);
        let (columns, rows) = (width.div_ceil(pitch), height.div_ceil(pitch));
        let mut sample = vec![None; columns * rows];
        let mut mean = vec![None; columns * rows];
        for node in 0..columns * rows {
            let (u0, v0) = ((node % columns) * pitch, (node / columns) * pitch);
            let (mut sum, mut n) = (Vector3::zeros(), 0.0);
            let mut sum_w = 0.0;
            for v in v0..(v0 + pitch).min(height) {
                for i in v * width + u0..v * width + (u0 + pitch).min(width) {
                    if w[i].is_finite() {
                        let (x, y) = rays.at(i);
                        sum += Vector3::new(x, y, 1.0);
                        sum_w += f64::from(w[i]);
                        n += 1.0;
                        sample[node].get_or_insert(i as u32);
                    }
                }
            }
            mean[node] = (n > 0.0).then(|| (sum / n, sum_w / n));
        }
        Lattice { pitch, columns, rows, sample, mean }
    }

    pub fn node_of(&self, pixel: usize, width: usize) -> usize {
        (pixel / width / self.pitch) * self.columns + (pixel % width) / self.pitch
    }

    /// Sample pixels of the nodes that are set.
    pub fn samples(&self, mask: &[bool]) -> Vec<u32> {
        self.sample.iter().zip(mask).filter(|(_, m)| **m).filter_map(|(s, _)| *s).collect()
    }

    /// Residual of each node's mean in sigma of the gauge; NaN without a measurement.
    pub fn residuals(&self, gauge: &Gauge<'_>) -> Vec<f32> {
        let q = gauge.fit.plane.q;
        self.mean
            .iter()
            .map(|mean| match mean {
                Some((ray, w)) if q.dot(ray) > 0.0 => {
                    let expected = q.dot(ray);
                    let t = (w - expected) / gauge.sigma(expected);
                    t.clamp(-CLIP_SIGMAS, CLIP_SIGMAS) as f32
                }
                Some(_) => CLIP_SIGMAS as f32,
                None => f32::NAN,
            })
            .collect()
    }

    /// Nodes whose neighbourhood, by mean and by spread, is noise about the plane.
    pub fn quiet(&self, residuals: &[f32]) -> Vec<bool> {
        let sums = self.boxed(residuals);
        sums.iter()
            .zip(residuals)
            .map(|(&[n, sum, squares], r)| {
                r.is_finite()
                    && f64::from(sum.abs()) < ev("MEAN") * f64::from(n)
                    && f64::from(squares - sum * sum / n) < ev("SPREAD").powi(2) * f64::from(n)
            })
            .collect()
    }

    /// Number, sum and sum of squares of the measured residuals around each node.
    pub fn boxed(&self, residuals: &[f32]) -> Vec<[f32; 3]> {
        let add = |a: &mut [f32; 3], b: [f32; 3]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        let moments = |r: f32| if r.is_finite() { [1.0, r, r * r] } else { [0.0; 3] };
        let mut across = vec![[0f32; 3]; residuals.len()];
        let mut both = vec![[0f32; 3]; residuals.len()];
        for node in 0..residuals.len() {
            let (first, c) = (node - node % self.columns, node % self.columns);
            let (low, high) = (c.saturating_sub((ev("AROUND") as usize)), (c + (ev("AROUND") as usize)).min(self.columns - 1));
            residuals[first + low..=first + high]
                .iter()
                .for_each(|&r| add(&mut across[node], moments(r)));
        }
        for node in 0..residuals.len() {
            let (row, c) = (node / self.columns, node % self.columns);
            for r in row.saturating_sub((ev("AROUND") as usize))..=(row + (ev("AROUND") as usize)).min(self.rows - 1) {
                add(&mut both[node], across[r * self.columns + c]);
            }
        }
        both
    }

    /// Nodes at which the plane through the set nodes is known to better than one sigma;
    /// everywhere the slack is wider than the noise counts as known.
    pub fn known(&self, mask: &[bool]) -> Option<Vec<bool>> {
        let mut information = Matrix3::zeros();
        for (ray, _) in self.mean.iter().zip(mask).filter(|(_, m)| **m).filter_map(|(s, _)| *s) {
            information += ray * ray.transpose();
        }
        let covariance = (information / CORRELATED_NODES).try_inverse()?;
        let known = |ray: &Vector3<f64>| ray.dot(&(covariance * ray)) < 1.0;
        Some(self.mean.iter().map(|mean| mean.is_some_and(|(ray, _)| known(&ray))).collect())
    }

    /// Nodes reached from `seeds` over `open` nodes.
    pub fn reached(&self, open: &[bool], seeds: &[usize]) -> Vec<bool> {
        let mut mask = vec![false; open.len()];
        let mut queue: Vec<usize> = Vec::new();
        for &seed in seeds {
            if !mask[seed] && open[seed] {
                mask[seed] = true;
                queue.push(seed);
            }
        }
        while let Some(node) = queue.pop() {
            for neighbour in self.around(node, BRIDGE) {
                if !mask[neighbour] && open[neighbour] {
                    mask[neighbour] = true;
                    queue.push(neighbour);
                }
            }
        }
        mask
    }

    /// The rim that judging by neighbourhoods cost: nodes within a neighbourhood of the set ones
    /// that lie on the plane themselves.
    pub fn with_rim(&self, mask: &[bool], residuals: &[f32], barred: &[bool]) -> Vec<bool> {
        let mut wide = mask.to_vec();
        for _ in 0..(ev("AROUND") as usize) {
            let near = self.dilated(&wide);
            for node in 0..wide.len() {
                wide[node] |= near[node] && !barred[node]
 && f64::from(residuals[node].abs()) < ev("RIM");
            }
        }
        wide
    }

    fn around(&self, node: usize, radius: usize) -> impl Iterator<Item = usize> + '_ {
        let (c, r) = (node % self.columns, node / self.columns);
        let columns = c.saturating_sub(radius)..=(c + radius).min(self.columns - 1);
        let rows = r.saturating_sub(radius)..=(r + radius).min(self.rows - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| row * self.columns + column))
    }

    pub fn measured(&self) -> impl Iterator<Item = bool> + '_ {
        self.sample.iter().map(Option::is_some)
    }

    /// Nodes at most `steps` columns and `steps` rows from a set one.
    pub fn within(&self, mask: &[bool], steps: usize) -> Vec<bool> {
        let spread = |mask: &[bool], length: usize, at: &dyn Fn(usize, usize) -> usize| {
            let mut wide = vec![false; mask.len()];
            for line in 0..mask.len() / length {
                let (mut forth, mut back) = (usize::MAX, usize::MAX);
                for k in 0..length {
                    let (a, b) = (at(line, k), at(line, length - 1 - k));
                    forth = if mask[a] { 0 } else { forth.saturating_add(1) };
                    back = if mask[b] { 0 } else { back.saturating_add(1) };
                    wide[a] |= forth <= steps;
                    wide[b] |= back <= steps;
                }
            }
            wide
        };
        let columns = self.columns;
        let along_rows = spread(mask, columns, &|row, k| row * columns + k);
        spread(&along_rows, self.rows, &|column, k| k * columns + column)
    }

    /// Every node with a set node within one step.
    pub fn dilated(&self, mask: &[bool]) -> Vec<bool> {
        (0..mask.len()).map(|n| self.around(n, 1).any(|m| mask[m])).collect()
    }

    /// Every node whose neighbours inside the image are all set.
    pub fn eroded(&self, mask: &[bool]) -> Vec<bool> {
        (0..mask.len()).map(|n| self.around(n, 1).all(|m| mask[m])).collect()
    }
}

/// Gaps up to this many nodes are crossed: speckle holes, not the gap between two objects.
const BRIDGE: usize = 2;

pub(super) fn ev(name: &str) -> f64 {
    static M: std::sync::OnceLock<std::collections::HashMap<String, f64>> = std::sync::OnceLock::new();
    M.get_or_init(|| std::env::vars().filter_map(|(k, v)| Some((k, v.parse().ok()?))).collect())[name]
}
