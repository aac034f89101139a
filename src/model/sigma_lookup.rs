//! Sigma over depth and tilt, looked up: for scenes in which every pixel has its own tilt.

use super::surface::{Domain, SigmaModel};

/// Bilinear between nodes; outside the model's range its edge holds, as in the model.
#[derive(Debug, Clone)]
pub struct SigmaLookup {
    domain: Domain,
    /// Depth by depth, m.
    nodes: Vec<f32>,
}

/// Over 4 m a step of 8 mm: the curvature 2b of Eq. 1 errs by b step^2 / 4 = 40 nm.
const DEPTHS: usize = 512;
/// Eq. 1 grows with 1 / (f - theta)^2: nodes crowd quadratically towards the steepest tilt, and at
/// 0.01 rad from the pole the table errs by 0.6 %, at 0.1 rad by 0.06 %.
const TILTS: usize = 256;

impl SigmaLookup {
    pub fn of(model: &SigmaModel) -> Self {
        let domain = model.domain;
        let ([z0, z1], steepest) = (domain.z_m, domain.theta_rad[1]);
        let mut nodes = Vec::with_capacity(DEPTHS * TILTS);
        for i in 0..DEPTHS {
            let z = z0 + (z1 - z0) * i as f64 / (DEPTHS - 1) as f64;
            for j in 0..TILTS {
                let left = 1.0 - j as f64 / (TILTS - 1) as f64;
                nodes.push(model.sigma(z, steepest * (1.0 - left * left)) as f32);
            }
        }
        SigmaLookup { domain, nodes }
    }

    /// Sigma, m, at depth `z` (m) and tilt `theta` (rad).
    #[inline]
    pub fn at(&self, z: f32, theta: f32) -> f32 {
        let [z0, z1] = self.domain.z_m.map(|v| v as f32);
        let steepest = (self.domain.theta_rad[1] as f32).max(f32::MIN_POSITIVE);
        let (i, s) = cell((z - z0) / (z1 - z0).max(f32::MIN_POSITIVE), DEPTHS);
        let share = (theta / steepest).clamp(0.0, 1.0);
        let (j, t) = cell(1.0 - (1.0 - share).sqrt(), TILTS);
        let node = |i: usize, j: usize| self.nodes[i * TILTS + j];
        let near = node(i, j) + t * (node(i, j + 1) - node(i, j));
        let far = node(i + 1, j) + t * (node(i + 1, j + 1) - node(i + 1, j));
        near + s * (far - near)
    }
}

/// Node below a share (0 to 1) of the table's length, and the way on to the next.
#[inline]
fn cell(share: f32, nodes: usize) -> (usize, f32) {
    let place = share.clamp(0.0, 1.0) * (nodes - 1) as f32;
    let below = (place as usize).min(nodes - 2);
    (below, place - below as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_model_inside_its_range_and_at_its_edge() {
        for model in [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham()] {
            let table = SigmaLookup::of(&model);
            for i in 0..=60 {
                for j in 0..=157 {
                    let (z, theta) = (0.1 * f64::from(i), 0.01 * f64::from(j));
                    let (found, truth) =
                        (f64::from(table.at(z as f32, theta as f32)), model.sigma(z, theta));
                    assert!((found / truth - 1.0).abs() < 0.01, "{z} {theta}: {found} {truth}");
                }
            }
        }
    }
}
