//! Tests textures in halves of the views and on held-out views. Each view is one sample of the statistic that
//! a finding rests on.

use super::replication::agree;
use crate::diagnose::edges::Edges;
use crate::diagnose::edges::mixing::mean_share;
use crate::diagnose::noise::expected_window;
use crate::diagnose::noise::lagged::{later, of_any_two};
use crate::diagnose::noise::mixture::Mixture;
use crate::diagnose::noise::scatter::ScatterResult;
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::tail_counts::GAUSSIAN_TAIL;
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::diagnose::noise::view_mean::{ViewMean, variance_px2};
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::terms::{Axis, Statistic};

/// A view's value beyond what the model has, in the statistic's own unit.
type OfView<'a> = Box<dyn Fn(&Structure) -> Option<f64> + 'a>;

/// Whether both halves show it. `None` where the finding is no mean of all views, or a half has too few of
/// them.
pub fn replicated(
    found: &TextureFinding,
    structure: &[Structure],
    fields: &[Field],
    second: &[bool],
    known: &KnownTerms,
) -> Option<bool> {
    if found.of_some.is_some() {
        return None;
    }
    let (beyond, variance_px2) = (beyond_known(found, known), variance_px2(structure));
    let half = |which: bool| {
        let mine = second.iter().enumerate().filter(|(_, s)| **s == which).map(|(v, _)| v);
        match &beyond {
            Some(of) => {
                let values = mine.filter_map(|v| sized(found, of, &structure[v], variance_px2));
                ViewMean::weighed(&values.collect::<Vec<_>>())
            }
            None if found.axis == Axis::EdgeDistance => {
                let edges: Vec<&Edges> = mine.map(|v| &fields[v].edges).collect();
                mean_share(&edges, None, found.interval[1]).map(|(m, _)| m)
            }
            None => None,
        }
    };
    agree([half(false), half(true)])
}

/// Gain of named textures and tails, learnt on the `rest` of the views, on each of those held out (`aside`),
/// nats.
pub fn gained(
    ScatterResult { structure, textures, tails, .. }: &ScatterResult,
    known: &KnownTerms,
    [rest, aside]: [&[usize]; 2],
) -> Vec<f64> {
    let mut gains = vec![0.0; aside.len()];
    let variance_px2 = variance_px2(structure);
    // A nameless texture is in no model, and one of some views is no mean of all.
    let named = textures.iter().filter(|t| !t.families.is_empty());
    for texture in named.chain(tails).filter(|t| t.of_some.is_none()) {
        let Some(beyond) = beyond_known(texture, known) else { continue };
        let of = |&v: &usize| sized(texture, &beyond, &structure[v], variance_px2);
        let learnt_on: Vec<(f64, f64)> = rest.iter().filter_map(of).collect();
        for (gain, view) in gains.iter_mut().zip(aside) {
            let nats = of(view).and_then(|own| ViewMean::predicts(&learnt_on, own));
            *gain += nats.unwrap_or(0.0);
        }
    }
    gains
}

/// A view's value, and the size that gives its weight.
fn sized(
    found: &TextureFinding,
    beyond: &OfView,
    s: &Structure,
    variance_px2: f64,
) -> Option<(f64, f64)> {
    let size = match (found.axis, found.statistic) {
        (Axis::Row, Statistic::Correlation) => s.line_size(0, variance_px2),
        (Axis::Column, Statistic::Correlation) => s.line_size(1, variance_px2),
        _ => s.pixels,
    };
    Some((beyond(s).filter(|x| x.is_finite())?, size))
}

/// Statistic of a view that a finding rests on.
fn beyond_known<'a>(found: &TextureFinding, known: &'a KnownTerms) -> Option<OfView<'a>> {
    Some(match (found.families.first().copied(), found.axis, found.statistic) {
        // If only part of the noise is correlated it shows in neighbouring pixels, if all of it in the
        // window.
        (Some("spatial-correlation"), ..) if found.size_sigma < 1.0 => {
            Box::new(|s| s.neighbour_correlation)
        }
        // Less what stands still, which the finding leaves out too.
        (Some("temporal-correlation"), ..) => Box::new(|s| Some(s.lagged[0]? - later(s)?)),
        (Some("heavy-tails"), ..) if found.are_weak_tails() => {
            Box::new(|s| s.excess()?.into_iter().min_by(f64::total_cmp))
        }
        (Some("target-motion"), ..) => Box::new(|s| Some(s.jitter?.velocity_mps)),
        (Some(id), ..) => return beyond(id, known),
        (None, Axis::Column, Statistic::Bias) => Box::new(|s| s.still.lines_px2[0]),
        (None, Axis::Row, Statistic::Bias) => Box::new(|s| s.still.lines_px2[1]),
        (None, Axis::Residual, _) => Box::new(|s| Some(s.skewness()?[0])),
        (None, Axis::Pixel, _) => Box::new(|s| s.still.blotches_px2),
        (None, Axis::Column, _) => Box::new(|s| s.column_px2),
        (None, Axis::Frame, Statistic::Correlation) => Box::new(|s| Some(s.tilts?.beyond())),
        (None, Axis::Frame, _) => {
            let frame = found.parameters.get("frame")?.as_u64()? as usize;
            Box::new(move |s| *s.frame_log_variance.get(frame)?)
        }
        _ => return None,
    })
}

/// A view's texture of this name, beyond what the model has of it.
pub fn beyond<'a>(id: &str, known: &'a KnownTerms) -> Option<OfView<'a>> {
    let parameter = |name: &str| known.parameter(id, name).unwrap_or(0.0);
    let (px2, fraction, rho) =
        (parameter("sigma_px").powi(2), parameter("fraction"), parameter("rho"));
    let still =
        |s: &Structure| s.still.fixed_px2.unwrap_or(0.0).max(0.0) / s.noise_px2().max(1e-12);
    Some(match id {
        "spatial-correlation" => {
            let side = expected_window(known);
            Box::new(move |s| Some(s.window_px?.ln() - side.ln()))
        }
        "fixed-pattern-noise" => Box::new(move |s| Some(s.still.fixed_px2? - px2)),
        "temporal-correlation" => Box::new(move |s| Some(s.lagged[0]? - rho)),
        "frozen-noise" => Box::new(move |s| Some(of_any_two(s)? - still(s) - fraction)),
        "row-noise" => Box::new(move |s| Some(s.row_px2? - px2)),
        "heavy-tails" => {
            let own = Mixture::of(known).map_or(GAUSSIAN_TAIL, |m| m.tail(1.0, 0.0));
            Box::new(move |s| Some(s.tail_share()? - own))
        }
        "frame-jitter" => Box::new(move |s| Some(s.jitter?.about.beyond() - px2)),
        _ => return None,
    })
}
