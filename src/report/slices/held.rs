//! Which quantity a slice through the surface holds fixed, and the rows of each slice.

use crate::measure::SigmaRow;
use crate::model::{DISTANCE_RATIO, SigmaModel};
use crate::report::numbers::{fixed, range as numbers};

/// Which of distance and tilt a curve holds fixed; the other runs along x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Held {
    Distance,
    Tilt,
}

/// Most groups whose colours and shapes can be told apart.
pub(super) const MAX_GROUPS: usize = 7;
/// Largest ratio of distances within a group: sigma ~ z^2 then differs by a factor of at most 1.56.
const MAX_RATIO: f64 = 1.25;
/// Largest difference of tilts within a group, rad: 15 degrees, half the step of a common grid.
const MAX_TILTS_RAD: f64 = 0.262;
/// Neighbouring tilts closer than this belong to one group, rad: 3 degrees.
const ONE_TILT_RAD: f64 = 0.0524;
/// Tolerance below a surface's smallest tilt, rad: a frontal view is never exactly frontal.
const FRONTAL_RAD: f64 = 0.1;
impl Held {
    /// x and the fixed quantity at a place.
    pub(super) fn split(self, z_m: f64, theta_rad: f64) -> (f64, f64) {
        match self {
            Held::Distance => (theta_rad.to_degrees(), z_m),
            Held::Tilt => (z_m, theta_rad),
        }
    }

    /// The place as z in m and theta in rad.
    pub(super) fn place(self, x: f64, held: f64) -> (f64, f64) {
        match self {
            Held::Distance => (held, x.to_radians()),
            Held::Tilt => (x, held),
        }
    }

    /// Range of x over which a surface is valid.
    pub(super) fn along(self, model: &SigmaModel) -> [f64; 2] {
        match self {
            Held::Distance => model.domain.theta_rad.map(f64::to_degrees),
            Held::Tilt => model.domain.z_m,
        }
    }

    /// Whether the surface was measured at about this distance or tilt.
    pub(super) fn has(self, model: &SigmaModel, held: f64) -> bool {
        let ([near, far], [low, high]) = (model.domain.z_m, model.domain.theta_rad);
        match self {
            Held::Distance => held * DISTANCE_RATIO >= near && held <= far * DISTANCE_RATIO,
            Held::Tilt => held >= low - FRONTAL_RAD && held <= high,
        }
    }

    /// Groups rows by the fixed quantity, smallest first, and sorts each group. No group is empty.
    ///
    /// Groups are separated at gaps between the values. Where that gives too many or too wide groups, the
    /// range is cut into equal widths; equal counts would separate equal values.
    pub(super) fn sorted(self, rows: &[SigmaRow]) -> Vec<Vec<SigmaRow>> {
        let (key, one, width): (fn(&SigmaRow) -> f64, f64, f64) = match self {
            Held::Distance => (|r| r.z_m.ln(), DISTANCE_RATIO.ln(), MAX_RATIO.ln()),
            Held::Tilt => (|r| r.theta_rad, ONE_TILT_RAD, MAX_TILTS_RAD),
        };
        let mut sorted = rows.to_vec();
        sorted.sort_by(|a, b| key(a).total_cmp(&key(b)));
        let natural: Vec<Vec<SigmaRow>> =
            sorted.chunk_by(|a, b| key(b) <= key(a) + one).map(<[SigmaRow]>::to_vec).collect();
        let compact = |g: &Vec<SigmaRow>| key(&g[g.len() - 1]) < key(&g[0]) + width;
        if natural.len() <= MAX_GROUPS && natural.iter().all(compact) {
            return natural;
        }
        let (low, extent) = (key(&sorted[0]), key(&sorted[sorted.len() - 1]) - key(&sorted[0]));
        let count = (extent / width).ceil().clamp(1.0, MAX_GROUPS as f64);
        let bin = |r: &SigmaRow| ((key(r) - low) / extent * count).min(count - 1.0) as usize;
        sorted.chunk_by(|a, b| bin(a) == bin(b)).map(<[SigmaRow]>::to_vec).collect()
    }

    /// The median, with the ends where they print differently.
    pub(super) fn label(self, rows: &[SigmaRow]) -> String {
        let held = |r: &SigmaRow| self.split(r.z_m, r.theta_rad).1;
        let ends = [held(&rows[0]), held(&rows[rows.len() - 1])];
        let median = held(&rows[rows.len() / 2]);
        let (median, ends, decimals, unit) = match self {
            Held::Distance => (median, ends, 2, " m"),
            Held::Tilt => (median.to_degrees(), ends.map(f64::to_degrees), 0, "°"),
        };
        // Values that print alike count as one.
        let median = fixed(median, decimals);
        let others = match numbers(ends, decimals) == median {
            true => String::new(),
            false => format!(" ({})", numbers(ends, decimals.min(1))),
        };
        format!("{median}{unit}{others}")
    }
}
