//! Depth mixing at the target's edge: one share per view, with the views as the sample.

use nalgebra::{Matrix3, Vector3};

use super::{Edges, INSIDE_PX};
use crate::diagnose::finding::parameters::one;
use crate::diagnose::noise::some_views::SomeViews;
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::diagnose::noise::view_mean::{ViewMean, nats};
use crate::diagnose::views::field::Field;
use crate::stats::{bisect, common_value, mean};
use crate::terms::{Axis, Statistic};

/// Footprint widths tried to decide whether depth mixes, px.
const TRIED_PX: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Widths tried to estimate how far, px.
const WIDTHS_PX: [f64; 7] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];
/// Too few views to show a rule, and to show it once they are known to differ from the others.
const TOO_FEW_VIEWS: f64 = 2.0;
const TOO_FEW_OF_SOME: f64 = 1.0;
/// Widest footprint that is reported, px: the catalogue's limit.
const WIDEST_PX: f64 = 32.0;

/// Share of a full footprint's mixing in one view, and the information on it.
fn share(edges: &Edges, width: f64) -> Option<(f64, f64)> {
    let (mut normal, mut cross, mut score) = (Matrix3::zeros(), Vector3::zeros(), Vector3::zeros());
    let (mut own, mut own_score) = (0.0, 0.0);
    for (n, s) in edges.inside.iter().enumerate() {
        // A bias that is smooth over these pixels is not due to the edge.
        let x = n as f64 / INSIDE_PX as f64 - 0.5;
        let smooth = Vector3::new(1.0, x, x * x);
        let seen = footprint(n, width);
        normal += s.n * smooth * smooth.transpose();
        cross += seen * s.step * smooth;
        score += s.residual * smooth;
        own += seen * seen * s.square;
        own_score += seen * s.product;
    }
    let solved = normal.cholesky()?.solve(&cross);
    let information = own - cross.dot(&solved);
    let value = (own_score - solved.dot(&score)) / information;
    let sure = information / edges.sigma_px.powi(2);
    (value.is_finite() && sure > 0.0).then_some((value, sure))
}

/// Share of the other surface in pixel `n` of the target from the edge, for a square footprint that reaches
/// `width` px to either side.
fn footprint(n: usize, width: f64) -> f64 {
    0.5 * (1.0 - (n as f64 + 0.5) / width).max(0.0)
}

/// Total mixed in by a full footprint of this width, in px of the step.
fn mixed_px(width: f64) -> f64 {
    (0..WIDEST_PX as usize).map(|n| footprint(n, width)).sum()
}

/// Width of the full footprint that mixes in this much.
fn width_px(mixed: f64) -> f64 {
    let [low, high] = bisect([0.5, WIDEST_PX], |width| mixed_px(width) < mixed);
    0.5 * (low + high)
}

/// Mean over the views of a footprint's share, for any width, and its size at the edge in sigmas. No bias is
/// fitted beside it, since none is a quarter of the step.
pub fn whole_share(views: &[&Edges], width: f64) -> Option<(ViewMean, f64)> {
    let of = |edges: &&Edges| {
        let sums = || edges.inside.iter().enumerate().map(|(n, s)| (footprint(n, width), s));
        let own: f64 = sums().map(|(seen, s)| seen * seen * s.square).sum();
        let score: f64 = sums().map(|(seen, s)| seen * s.product).sum();
        (own > 0.0).then_some((score / own, own))
    };
    let seen: Vec<(f64, f64)> = views.iter().filter_map(of).collect();
    (seen.len() as f64 > TOO_FEW_VIEWS).then_some(())?;
    Some((ViewMean::weighed(&seen)?, footprint(0, width) * step_sigmas(views)))
}

/// Mean over the views of the step to what is behind, in sigmas of the noise.
fn step_sigmas(views: &[&Edges]) -> f64 {
    let seen = views.iter().filter(|e| e.sigma_px > 0.0);
    mean(seen.map(|e| e.step_px / e.sigma_px)).unwrap_or(0.0)
}

/// Mean share over the views at a width, beyond the twins' where there are any. Also how well it explains the
/// views by the noise alone: the signed root of twice the gain in nats.
pub fn mean_share(
    views: &[&Edges],
    twins: Option<&[&Edges]>,
    width: f64,
) -> Option<(ViewMean, f64)> {
    let of = |v: usize| {
        let (value, sure) = share(views[v], width)?;
        let Some(twins) = twins else { return Some((value, sure)) };
        let (expected, as_sure) = share(twins[v], width)?;
        Some((value - expected, 1.0 / (1.0 / sure + 1.0 / as_sure)))
    };
    let seen: Vec<(f64, f64)> = (0..views.len()).filter_map(of).collect();
    let (sum, sure) = seen.iter().fold((0.0, 0.0), |(s, w), v| (s + v.0 * v.1, w + v.1));
    Some((between_views(&seen)?, sum / sure.sqrt()))
}

/// Mean of (value, information). Views differ without a cause, so it includes the scatter between them: no
/// view with little noise decides alone.
fn between_views(views: &[(f64, f64)]) -> Option<ViewMean> {
    let units: Vec<(f64, f64)> = views.iter().map(|(v, sure)| (*v, 1.0 / sure)).collect();
    let [value, std_error] = common_value(&units)?;
    Some(ViewMean::new(value, std_error, views.len() as f64))
}

/// Width of a footprint, mean share of it, and how well it explains the views.
type Footprint = (f64, (ViewMean, f64));

/// Width that explains the views best. Of equally good ones, such as 1 and 1.5 px, which both reach one
/// pixel, the narrowest.
fn best(
    edges: &[&Edges],
    twins: Option<&[&Edges]>,
    widths: &[f64],
    too_few: f64,
) -> Option<Footprint> {
    let at = |w: &f64| Some((*w, mean_share(edges, twins, *w)?));
    let seen = widths.iter().filter_map(at).filter(|(_, (m, _))| m.views > too_few);
    const ROUNDING: f64 = 1e-9;
    seen.reduce(|a, b| if b.1.1 - a.1.1 > ROUNDING * a.1.1.abs() { b } else { a })
}

/// Views whose edges mix while the others' do not, the number of views measured, and the p-value.
fn mixing_views<'a>(edges: &[&'a Edges]) -> Option<(Vec<&'a Edges>, usize, f64)> {
    let at = |width: &f64| {
        let sure = |e: &&'a Edges| share(e, *width).map(|(value, sure)| (*e, value * sure.sqrt()));
        let (seen, off): (Vec<&Edges>, Vec<f64>) = edges.iter().filter_map(sure).unzip();
        let some = SomeViews::above(&off)?;
        Some((some.which.iter().map(|&v| seen[v]).collect::<Vec<_>>(), seen.len(), some.p))
    };
    TRIED_PX.iter().filter_map(at).min_by(|a, b| a.2.total_cmp(&b.2))
}

/// Finding of depth mixing at the edge, if all or some of the views show it at this level.
pub fn mixing(fields: &[Field], twins: Option<&[Field]>, level: f64) -> Option<TextureFinding> {
    let edges: Vec<&Edges> = fields.iter().map(|f| &f.edges).collect();
    let twins: Option<Vec<&Edges>> = twins.map(|t| t.iter().map(|f| &f.edges).collect());
    let twins = twins.as_deref();
    let tried = TRIED_PX.len() as f64;
    let best_of_all = |widths: &[f64]| best(&edges, twins, widths, TOO_FEW_VIEWS);
    let p = (tried * best_of_all(&TRIED_PX)?.1.0.p_above(0.0)).min(1.0);
    if p <= level {
        return found(&edges, best_of_all(&WIDTHS_PX)?, p);
    }
    // This is the second test at the level.
    let (some, of, p) = twins.is_none().then(|| mixing_views(&edges)).flatten()?;
    let p = 2.0 * tried * p;
    let best_of_some = || best(&some, None, &WIDTHS_PX, TOO_FEW_OF_SOME);
    let footprint = (p <= level).then(best_of_some).flatten()?;
    Some(found(&some, footprint, p)?.of_some([some.len(), of], p))
}

fn found(edges: &[&Edges], (width, (share, _)): Footprint, p: f64) -> Option<TextureFinding> {
    let full = mixed_px(width);
    let [mixed, error] = [full * share.value, full * share.std_error];
    let slope = (width_px(mixed + error) - width_px((mixed - error).max(0.0))) / 2.0;
    // Part of a wider footprint mixes in as much as the whole of a narrower one.
    let whole = width_px(mixed);
    let std_error = slope.hypot(width - whole);
    let edge = share.value * footprint(0, width);
    (share.value > 0.0).then(|| TextureFinding {
        interval: [0.0, width],
        parameters: one("width_px", whole, std_error),
        size_sigma: edge * step_sigmas(edges),
        p,
        nats: nats(&share, 0.0),
        words: Some(format!(
            "the target's last pixel is off by {:.2} % of the step to what is behind",
            100.0 * edge
        )),
        ..TextureFinding::named(vec!["edge-mixing"], Statistic::Bias, Axis::EdgeDistance)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two runs differ view by view: one view with little noise is off by nine times its own error, the
    /// others by as much to either side.
    #[test]
    fn one_view_of_little_noise_does_not_decide_alone() {
        let others = (0..9).map(|k| (0.03 * f64::from(k - 4) / 4.0, 1e4));
        let views: Vec<(f64, f64)> = others.chain([(0.03, 9e4)]).collect();
        let share = between_views(&views).unwrap();
        assert!(share.p_above(0.0) > 0.05, "{share:?}");
        let agreed: Vec<(f64, f64)> = views.iter().map(|(_, sure)| (0.03, *sure)).collect();
        let share = between_views(&agreed).unwrap();
        assert!(share.p_above(0.0) < 1e-4 && (share.value - 0.03).abs() < 1e-9, "{share:?}");
    }
}
