//! The projector does not reach all that the camera sees.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};
use crate::sensors::SensorKind;

pub struct OcclusionShadow;

pub(super) static CARD: Card = Card {
    id: "occlusion-shadow",
    title: "an occlusion shadow",
    stage: Stage::Dropout,
    summary: "what the target hides from the projector has no pattern and no depth: a band on the background beside the target, fx b (1/z - 1/z_behind) px wide, on one side; there must be something behind the target",
    parameters: &[Parameter {
        name: "share",
        range: [0.0, 1.0],
        typical: 1.0,
        summary: "of the baseline between camera and projector",
    }],
    kinds: SensorKind::MATCHING,
    statistic: "missing",
    axis: "edge-distance",
    confused_with: "grazing-dropout and range-dropout, which are not beside an edge; edge-mixing, which is on all sides",
    reference: "geometry; render_kinect (Bohg et al. 2014) tests the same ray",
    ..Card::BASE
};

impl Effect for OcclusionShadow {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let share = settings.at(0) as f32;
        exposure.with_kept(CARD.id, |e| shadow(e, share), |e, shadow| {
            for (d, dark) in e.disparity.iter_mut().zip(shadow) {
                if *dark > 0.0 {
                    *d = f32::NAN;
                }
            }
        });
    }
}

/// One where the projector's light does not reach.
///
/// The projector is on the side of increasing columns (a Kinect v1 seen from behind): its column for a
/// point is u - d with the disparity d = fx b / z, so the shadow falls on the other side.
fn shadow(exposure: &Exposure, share: f32) -> Vec<f32> {
    let seen = exposure.seen;
    let scale = share * exposure.sensor.scale_px_m() as f32;
    let rows = seen.depth.chunks_exact(seen.width).zip(seen.surface.chunks_exact(seen.width));
    let mut dark = Vec::with_capacity(seen.depth.len());
    for (depth, surface) in rows {
        let disparity: Vec<f32> = depth.iter().map(|z| scale / z).collect();
        let lit = Lit::by(&disparity, surface);
        dark.extend(disparity.iter().enumerate().map(|(u, &d)| {
            let nearer = lit.at(u as f32 - d) - d;
            f32::from(u8::from(nearer > HARDLY_NEARER_PX))
        }));
    }
    dark
}

/// Disparity of the nearest surface by projector column, px.
struct Lit {
    first: f32,
    bins: Vec<f32>,
}

/// Resolution of a shadow's edge, px.
const BIN_PX: f32 = 0.25;
/// Tolerance, px: a surface does not shadow itself, as its disparity differs by less than this within a
/// bin.
const HARDLY_NEARER_PX: f32 = 0.5;

impl Lit {
    fn by(disparity: &[f32], surface: &[u16]) -> Self {
        let width = disparity.len();
        let first = -disparity.iter().copied().fold(0.0, f32::max) - 1.0;
        let count = ((width as f32 + 1.0 - first) / BIN_PX) as usize;
        let mut lit = Lit { first, bins: vec![f32::NEG_INFINITY; count] };
        for (u, &d) in disparity.iter().enumerate() {
            // A pixel extends half-way to its neighbours on the same surface.
            let half = |other: Option<usize>| match other {
                Some(v) if v < width && surface[v] == surface[u] && disparity[v].is_finite() => {
                    let gap = (v as f32 - disparity[v]) - (u as f32 - d);
                    0.5 * gap.abs()
                }
                _ => 0.5,
            };
            if d.is_finite() {
                lit.cover(u as f32 - d, half(u.checked_sub(1)), half(Some(u + 1)), d);
            }
        }
        lit
    }

    fn cover(&mut self, middle: f32, left: f32, right: f32, disparity: f32) {
        for k in self.bin(middle - left)..=self.bin(middle + right) {
            self.bins[k] = self.bins[k].max(disparity);
        }
    }

    fn bin(&self, column: f32) -> usize {
        (((column - self.first) / BIN_PX).max(0.0) as usize).min(self.bins.len() - 1)
    }

    fn at(&self, column: f32) -> f32 {
        self.bins[self.bin(column)]
    }
}
