//! Region growing over the image: finds the connected pixels on one plane.
//!
//! A single pixel scatters by sigma, and a wall that a tilted board nearly touches is within a few sigma of
//! the board's plane over a long distance. So neighbourhoods are judged instead of pixels, by their mean and
//! their spread about the plane. A plane known from a small patch is uncertain far from it, so a round grows
//! only as far as the plane's own standard error is below sigma.

use nalgebra::{Matrix3, Vector3};

use super::affine::AffineFit;
use crate::camera::Rays;

/// A coarse lattice over the image: one node for every `pitch` x `pitch` pixels.
///
/// Growing on it costs a tenth of growing on pixels, and bridges single dead pixels.
pub(super) struct Lattice {
    pub pitch: usize,
    pub columns: usize,
    pub rows: usize,
    /// Pixel index of each node's sample; `None` where the node has no measured pixel.
    sample: Vec<Option<u32>>,
    /// Means over each node's measured pixels: ray (x, y, 1) and inverse depth, 1/m.
    mean: Vec<Option<(Vector3<f64>, f64)>>,
}

/// Nodes in a row of the image: a pitch of 3 px on a 640 px image.
const NODES_A_ROW: f64 = 213.0;
/// Radius of a node's neighbourhood in nodes: 15 px across on a 640 px image, wider than the matching window
/// of a Kinect v1, 9 px (Konolige and Mihelich 2011), which correlates its noise.
const AROUND: usize = 2;
/// Limit of a neighbourhood's mean in sigma: smooth errors of lens and board pass (at 2.5 the rims of real
/// boards were lost), and noise alone moves the mean by 0.6 where 9 px are correlated.
const MEAN_SIGMAS: f64 = 5.0;
/// ... and of its spread about its own mean. Noise correlated over 9 px gives below 1 with a scatter of 0.4;
/// a wall that crosses the plane at an angle grows without bound.
const SPREAD_SIGMAS: f64 = 1.5;
/// ... or of the ratio of its spread to the roughness between adjacent nodes. White noise has a ratio of 1,
/// and of 1.5 where 9 px are correlated; a wall over a fifth of the neighbourhood gives 2.6.
const SPREAD_PER_ROUGHNESS: f64 = 2.0;
/// Limit of the residual of single nodes at the edge, which have no neighbourhood, in sigma.
const EDGE_SIGMAS: f64 = 2.5;
/// Residuals in sums are clipped to this many sigma, so that no single gross error decides.
const CLIP_SIGMAS: f32 = 6.0;
/// Nodes off by less than this many sigma just miss the plane: a surface that curves away passes here.
const MISS_SIGMAS: f64 = 8.0;
/// Nodes per independent sample: the matching window, 9 x 9 px, at 3 px per node.
const CORRELATED_NODES: f64 = 9.0;
/// Floor of sigma, m: lens errors of a Kinect bend a near wall (0.56 m) by 8 mm where its noise is a
/// millimetre, and this must be within 5 sigma.
pub(super) const BEND_M: f64 = 0.002;

/// A plane with the scale of its residuals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gauge<'f> {
    pub fit: &'f AffineFit,
    /// Floor of sigma, m.
    pub bend_m: f64,
}

impl Gauge<'_> {
    /// Sigma where the plane has inverse depth `w`, 1/m.
    fn sigma(&self, w: f64) -> f64 {
        self.fit.scale.max(self.bend_m * w * w)
    }
}

#[cfg(test)]
impl Lattice {
    /// A lattice of nodes without pixels.
    pub fn bare(columns: usize, rows: usize) -> Self {
        let n = columns * rows;
        Lattice { pitch: 1, columns, rows, sample: vec![None; n], mean: vec![None; n] }
    }
}

impl Lattice {
    pub fn over(w: &[f32], rays: &Rays, width: usize, height: usize) -> Self {
        let pitch = ((width as f64 / NODES_A_ROW).round() as usize).max(1);
        let (columns, rows) = (width.div_ceil(pitch), height.div_ceil(pitch));
        let mut sample = vec![None; columns * rows];
        let mut mean = vec![None; columns * rows];
        for (node, (sample, mean)) in sample.iter_mut().zip(&mut mean).enumerate() {
            let (u0, v0) = ((node % columns) * pitch, (node / columns) * pitch);
            let (mut sum, mut sum_w, mut n) = (Vector3::zeros(), 0.0, 0.0);
            let pixels = (v0..(v0 + pitch).min(height))
                .flat_map(|v| v * width + u0..v * width + (u0 + pitch).min(width));
            for i in pixels.filter(|&i| w[i].is_finite()) {
                let (x, y) = rays.at(i);
                sum += Vector3::new(x, y, 1.0);
                sum_w += f64::from(w[i]);
                n += 1.0;
                sample.get_or_insert(i as u32);
            }
            *mean = (n > 0.0).then(|| (sum / n, sum_w / n));
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

    pub fn is_measured(&self, node: usize) -> bool {
        self.sample[node].is_some()
    }

    pub fn measured(&self) -> impl Iterator<Item = bool> + '_ {
        self.sample.iter().map(Option::is_some)
    }

    /// Residual of each node's mean in sigma, clamped to [`MISS_SIGMAS`]; NaN without a measurement.
    pub fn residuals(&self, gauge: &Gauge<'_>) -> Vec<f32> {
        let q = gauge.fit.plane.q;
        self.mean
            .iter()
            .map(|mean| match mean {
                Some((ray, w)) if q.dot(ray) > 0.0 => {
                    let expected = q.dot(ray);
                    let t = (w - expected) / gauge.sigma(expected);
                    t.clamp(-MISS_SIGMAS, MISS_SIGMAS) as f32
                }
                Some(_) => MISS_SIGMAS as f32,
                None => f32::NAN,
            })
            .collect()
    }

    /// Nodes whose neighbourhood, by mean and spread, is noise about the plane.
    ///
    /// The noise may be larger there than at the seed (a depth error that does not grow with depth, on the
    /// near side of a tilted target), or include gross errors. Then adjacent nodes differ as much as the
    /// neighbourhood spreads; where another surface begins they do not.
    pub fn quiet(&self, residuals: &[f32]) -> Vec<bool> {
        let sums = self.boxed(residuals);
        let rough = self.roughness(residuals);
        sums.iter()
            .zip(&rough)
            .zip(residuals)
            .map(|((&[n, sum, squares], rough), r)| {
                let mean = f64::from(sum / n);
                let spread = f64::from(squares / n) - mean * mean;
                let noise = mean * mean < spread && spread < SPREAD_PER_ROUGHNESS * rough;
                r.is_finite()
                    && mean.abs() < MEAN_SIGMAS
                    && (noise || spread < SPREAD_SIGMAS.powi(2))
            })
            .collect()
    }

    /// Half the mean squared difference of adjacent nodes: the variance if the noise is white.
    fn roughness(&self, residuals: &[f32]) -> Vec<f64> {
        let pairs: Vec<[f32; 2]> = (0..residuals.len())
            .map(|node| {
                let right = (node % self.columns + 1 < self.columns).then_some(node + 1);
                let below = Some(node + self.columns).filter(|&below| below < residuals.len());
                right
                    .into_iter()
                    .chain(below)
                    .map(|other| 0.5 * (residuals[other] - residuals[node]).powi(2))
                    .filter(|half| half.is_finite())
                    .fold([0.0, 0.0], |[n, sum], half| [n + 1.0, sum + half])
            })
            .collect();
        let sums = self.summed_around(&pairs);
        sums.iter().map(|[n, sum]| f64::from(sum / n.max(1.0))).collect()
    }

    /// Nodes whose neighbourhood as a whole is off the plane.
    pub fn off(&self, residuals: &[f32]) -> Vec<bool> {
        let sums = self.boxed(residuals);
        sums.iter()
            .zip(residuals)
            .map(|(&[n, sum, _], r)| {
                r.is_finite() && f64::from(sum.abs()) > MEAN_SIGMAS * f64::from(n)
            })
            .collect()
    }

    /// Number, sum and sum of squares of the measured residuals around each node.
    pub fn boxed(&self, residuals: &[f32]) -> Vec<[f32; 3]> {
        let moments = |r: &f32| {
            let r = r.clamp(-CLIP_SIGMAS, CLIP_SIGMAS);
            if r.is_finite() { [1.0, r, r * r] } else { [0.0; 3] }
        };
        self.summed_around(&residuals.iter().map(moments).collect::<Vec<_>>())
    }

    /// Sums over the nodes around each node.
    fn summed_around<const N: usize>(&self, values: &[[f32; N]]) -> Vec<[f32; N]> {
        let add = |a: &mut [f32; N], b: &[f32; N]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        let mut along_rows = vec![[0f32; N]; values.len()];
        let mut both = vec![[0f32; N]; values.len()];
        for (node, sum) in along_rows.iter_mut().enumerate() {
            let (first, c) = (node - node % self.columns, node % self.columns);
            let (low, high) = (c.saturating_sub(AROUND), (c + AROUND).min(self.columns - 1));
            values[first + low..=first + high].iter().for_each(|v| add(sum, v));
        }
        for (node, sum) in both.iter_mut().enumerate() {
            let (row, c) = (node / self.columns, node % self.columns);
            for r in row.saturating_sub(AROUND)..=(row + AROUND).min(self.rows - 1) {
                add(sum, &along_rows[r * self.columns + c]);
            }
        }
        both
    }

    /// Nodes at which the plane through the set nodes has a standard error below one sigma: by the leverage
    /// r' (sum r r')^-1 r of their rays, with independent samples.
    pub fn known(&self, mask: &[bool]) -> Option<Vec<bool>> {
        let mut information = Matrix3::zeros();
        for (ray, _) in self.mean.iter().zip(mask).filter(|(_, m)| **m).filter_map(|(s, _)| *s) {
            information += ray * ray.transpose();
        }
        let covariance = (information / CORRELATED_NODES).try_inverse()?;
        let known = |ray: &Vector3<f64>| ray.dot(&(covariance * ray)) < 1.0;
        Some(self.mean.iter().map(|mean| mean.is_some_and(|(ray, _)| known(&ray))).collect())
    }

    /// Share of the outline that just misses the plane: depth steps where a board ends, but not where a
    /// curved surface leaves its plane. The outline is two nodes out, because those next to the rim mix
    /// both sides of a step; the image's border is outline, too.
    pub fn curving_away(&self, mask: &[bool], residuals: &[f32]) -> f64 {
        let next = self.dilated(mask);
        let (mut outline, mut near) = (0u32, 0u32);
        for (node, around) in self.dilated(&next).iter().enumerate() {
            let (c, r) = (node % self.columns, node / self.columns);
            let border = c == 0 || r == 0 || c + 1 == self.columns || r + 1 == self.rows;
            if *around && (!next[node] || border) {
                outline += 1;
                let misses = !mask[node] && f64::from(residuals[node].abs()) < MISS_SIGMAS;
                near += u32::from(misses);
            }
        }
        f64::from(near) / f64::from(outline.max(1))
    }

    /// Adds the edge that is lost when judging by neighbourhoods: nodes within a neighbourhood of the set
    /// ones that are on the plane themselves.
    pub fn with_edge(&self, mask: &[bool], residuals: &[f32], barred: &[bool]) -> Vec<bool> {
        let mut wide = mask.to_vec();
        for _ in 0..AROUND {
            let near = self.dilated(&wide);
            for node in 0..wide.len() {
                wide[node] |=
                    near[node] && !barred[node] && f64::from(residuals[node].abs()) < EDGE_SIGMAS;
            }
        }
        wide
    }
}
