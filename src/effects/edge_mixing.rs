//! Depth mixes with the background at edges.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Stage};
use crate::terms::{Basis, Coordinate};

pub struct EdgeMixing;

pub(super) static CARD: Card = Card {
    id: "edge-mixing",
    title: "mixed depth at edges",
    stage: Stage::Optics,
    summary: "at the edge of the target a pixel sees both the target and what is behind, and answers between the two; there must be something behind the target",
    parameters: &[Parameter {
        name: "width_px",
        range: [0.0, 32.0],
        typical: 2.0,
        summary: "distance from the edge at which a pixel sees one surface only",
    }],
    statistic: "bias",
    axis: "edge-distance",
    confused_with: "target-bow, which has no edge; occlusion-shadow, which loses pixels on one side",
    reference: "Gschwandtner et al. 2011 (BlenSor): mixed pixels; half a matching window",
    // A blur of the picture spreads an edge as well.
    is_symptom: true,
    ..Card::BASE
};

impl Effect for EdgeMixing {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let width = settings.at(0);
        let mixing = |e: &Exposure| offsets(e, width);
        exposure.with_kept(CARD.id, mixing, |e, offsets| {
            e.depth.iter_mut().zip(offsets).for_each(|(z, offset)| *z += offset);
        });
    }

    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        let widths = [0.5, 1.0, 2.0, 4.0, 8.0].into_iter();
        let seen = widths.filter(|width_px| bounds.reach.edge >= 4.0 * width_px);
        seen.map(|width| Basis::Decay { over: Coordinate::Edge, width }).collect()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Decay { width, .. } = *fit.shape else { return Vec::new() };
        vec![
            fit.estimate("amplitude_px", &|b| b[0]),
            Estimate::given("width_px", width, 0.4 * width),
        ]
    }
}

/// Error of each pixel's depth, m: at the edge half the step to the nearest other surface, falling linearly
/// to zero at `width` px, as the share of a square footprint.
fn offsets(exposure: &Exposure, width: f64) -> Vec<f32> {
    let mut nearest = vec![width; exposure.pixels()];
    let mut offsets = vec![0f32; exposure.pixels()];
    for border in (0..exposure.pixels()).filter(|&i| at_border(exposure, i)) {
        for i in around(exposure, border, width.ceil() as usize) {
            let distance = from_edge(exposure, border, i);
            if other(exposure, border, i) && distance < nearest[i] {
                nearest[i] = distance;
                let share = 0.5 * (1.0 - distance / width);
                let step = exposure.depth[border] - exposure.depth[i];
                offsets[i] = share as f32 * step;
            }
        }
    }
    offsets
}

/// Whether two pixels have depth from different surfaces.
fn other(exposure: &Exposure, a: usize, b: usize) -> bool {
    let there = |i: usize| exposure.depth[i].is_finite();
    exposure.seen.surface[a] != exposure.seen.surface[b] && there(a) && there(b)
}

fn at_border(exposure: &Exposure, i: usize) -> bool {
    around(exposure, i, 1).any(|j| other(exposure, i, j))
}

/// Pixels at most `reach` columns and rows away, including `i` itself.
fn around(exposure: &Exposure, i: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
    let (width, height) = (exposure.seen.width, exposure.seen.height);
    let (u, v) = (i % width, i / width);
    let span = move |at: usize, size: usize| at.saturating_sub(reach)..=(at + reach).min(size - 1);
    span(v, height).flat_map(move |v| span(u, width).map(move |u| v * width + u))
}

/// Distance of pixel `i` from the edge next to pixel `border`, px: the edge runs half-way between the two
/// surfaces' pixels.
fn from_edge(exposure: &Exposure, border: usize, i: usize) -> f64 {
    let ((ub, vb), (u, v)) = (exposure.at(border), exposure.at(i));
    f64::hypot(u.abs_diff(ub) as f64, v.abs_diff(vb) as f64) - 0.5
}
