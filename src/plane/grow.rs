//! Region growing over the image: which pixels hang together on one plane.

use super::Plane;
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
}

/// Nodes across the image; 3 px pitch on a 640 px image.
const NODES_ACROSS: f64 = 213.0;

impl Lattice {
    pub fn over(w: &[f32], width: usize, height: usize) -> Self {
        let pitch = ((width as f64 / NODES_ACROSS).round() as usize).max(1);
        let (columns, rows) = (width.div_ceil(pitch), height.div_ceil(pitch));
        let mut sample = vec![None; columns * rows];
        for (node, slot) in sample.iter_mut().enumerate() {
            let (u0, v0) = ((node % columns) * pitch, (node / columns) * pitch);
            let cell = (v0..(v0 + pitch).min(height))
                .flat_map(|v| (u0..(u0 + pitch).min(width)).map(move |u| v * width + u));
            // The middle pixel first would be nicer; the first valid one is within the pitch.
            *slot = cell.filter(|&i| w[i].is_finite()).map(|i| i as u32).next();
        }
        Lattice { pitch, columns, rows, sample }
    }

    pub fn node_of(&self, pixel: usize, width: usize) -> usize {
        (pixel / width / self.pitch) * self.columns + (pixel % width) / self.pitch
    }

    /// Sample pixels of the nodes that are set.
    pub fn samples(&self, mask: &[bool]) -> Vec<u32> {
        self.sample.iter().zip(mask).filter(|(_, m)| **m).filter_map(|(s, _)| *s).collect()
    }

    /// Nodes reached from `seeds` over nodes whose sample lies within `reach` of the plane.
    pub fn grow(
        &self,
        w: &[f32],
        rays: &Rays,
        plane: &Plane,
        reach: impl Fn(f64) -> f64,
        seeds: &[usize],
    ) -> Vec<bool> {
        let on_plane: Vec<bool> = self
            .sample
            .iter()
            .map(|sample| {
                sample.is_some_and(|i| {
                    let i = i as usize;
                    let (x, y) = rays.at(i);
                    let expected = plane.inverse_depth(x, y);
                    expected > 0.0 && (f64::from(w[i]) - expected).abs() < reach(expected)
                })
            })
            .collect();
        let mut mask = vec![false; self.sample.len()];
        let mut queue: Vec<usize> = Vec::new();
        for &seed in seeds {
            if !mask[seed] && on_plane[seed] {
                mask[seed] = true;
                queue.push(seed);
            }
        }
        while let Some(node) = queue.pop() {
            for neighbour in self.around(node, BRIDGE) {
                if !mask[neighbour] && on_plane[neighbour] {
                    mask[neighbour] = true;
                    queue.push(neighbour);
                }
            }
        }
        mask
    }

    fn around(&self, node: usize, radius: usize) -> impl Iterator<Item = usize> + '_ {
        let (c, r) = (node % self.columns, node / self.columns);
        let columns = c.saturating_sub(radius)..=(c + radius).min(self.columns - 1);
        let rows = r.saturating_sub(radius)..=(r + radius).min(self.rows - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| row * self.columns + column))
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
