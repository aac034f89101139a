//! Occlusion shadow: losses beside the target, in all views on one side, and as wide as predicted.
//!
//! The band that the projector cannot light is as many pixels wide as the disparity drops from the target's
//! edge to the background: fx b (1/z - 1/z_behind), on the side away from the projector.

use super::{EdgeLoss, Edges};
use crate::diagnose::checks::replication::agree;
use crate::diagnose::diagnosis::Curve;
use crate::diagnose::noise::some_views::{SomeViews, min_views};
use crate::diagnose::noise::view_mean::ViewMean;
use crate::diagnose::search::null::student;
use crate::stats::student_upper;

/// Losses beside the target.
#[derive(Debug, Clone)]
pub struct Band {
    /// 0 left of the target, 1 right of it.
    pub side: usize,
    /// Whether it is as wide as the geometry predicts, and on one side.
    pub lawful: bool,
    /// Share of the predicted width that is lost, and its standard error.
    pub share: [f64; 2],
    /// Nats of a share of the predicted width, and of one width everywhere.
    pub gain: [f64; 2],
    pub p: f64,
    pub curve: Curve,
    /// Views that have it, of how many, where not all do.
    pub of_some: Option<[usize; 2]>,
}

const MIN_VIEWS: usize = 3;
/// The other side must have less than this share of it.
const OTHER_SIDE: f64 = 0.4;
/// Widest shadow, as a share of the predicted width: pixels that see both surfaces are lost beside it.
const WIDEST: f64 = 1.4;
/// Standard error of one view's border, px; its rows err together.
const BORDER_PX: f64 = 0.7;
/// Shares of the level on each of the two sides: for the views' agreement on a share of the width; for what
/// exceeds the border error, in all views or in some; for the counts.
const SHARES: [f64; 3] = [1.0 / 12.0, 1.0 / 24.0, 0.25];
/// Share of the best curve's gain that a name must reach.
const SHADOW_ADEQUATE: f64 = 0.6;

/// Losses of a view left and right of the target; `None` where too little is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sides(pub [Option<EdgeLoss>; 2]);

impl Sides {
    /// Losses beyond those of a twin, where there is one.
    pub fn of(edges: &Edges, twin: Option<&Edges>) -> Self {
        let side = |side: usize| {
            let own = edges.beside(side)?;
            let Some(twin) = twin else { return Some(own) };
            let expected = twin.beside(side)?;
            let lost = own.lost - expected.lost * own.rows / expected.rows;
            Some(EdgeLoss { lost, counts: Default::default(), ..own })
        };
        Sides([side(0), side(1)])
    }
}

/// Mean over the views of the losses as a share of `of`.
fn law(views: &[EdgeLoss], of: impl Fn(&EdgeLoss) -> f64) -> Option<ViewMean> {
    ViewMean::weighed(&views.iter().map(|v| (v.lost / of(v), of(v))).collect::<Vec<_>>())
}

/// Per side, the views that see it, and the share of the predicted width that is lost.
fn by_side(views: &[Sides]) -> [(Vec<EdgeLoss>, Option<ViewMean>); 2] {
    [0, 1].map(|side: usize| {
        let seen: Vec<EdgeLoss> = views.iter().filter_map(|s| s.0[side]).collect();
        let enough = seen.len() >= MIN_VIEWS;
        let share = enough.then(|| law(&seen, |v| v.shaded)).flatten();
        (seen, share)
    })
}

/// Share on the side that loses more.
pub fn largest_share(views: &[Sides]) -> Option<ViewMean> {
    let [(_, left), (_, right)] = by_side(views);
    [left?, right?].into_iter().max_by(|a, b| a.value.total_cmp(&b.value))
}

fn t(share: &ViewMean) -> f64 {
    // Without any loss there is neither a share nor an error.
    if share.value > 0.0 { share.value / share.std_error.max(1e-9 * share.value) } else { 0.0 }
}

/// Nats of a share of `of`: for the agreement of the views on it, and for the whole pixels it explains.
fn nats(share: &ViewMean, views: &[EdgeLoss], of: impl Fn(&EdgeLoss) -> f64) -> f64 {
    let square = |px: f64, v: &EdgeLoss| (px / v.rows / BORDER_PX).powi(2);
    let explained = |v: &EdgeLoss| square(v.lost, v) - square(v.lost - share.value * of(v), v);
    student(0.5 * t(share).powi(2), share.views - 1.0)
        + 0.5 * views.iter().map(explained).sum::<f64>()
}

/// Band of losses that all of the views, or some of them, show at this level.
pub fn band(views: &[Sides], level: f64) -> Option<Band> {
    let all = band_of(views)?;
    if all.p <= level {
        return Some(all);
    }
    let sides = [0, 1].iter().filter_map(|side| shaded_views(views, *side));
    sides.min_by(|a, b| a.p.total_cmp(&b.p)).filter(|b| b.p <= level)
}

/// Band of those views that lose more on this side than the border error.
fn shaded_views(views: &[Sides], side: usize) -> Option<Band> {
    let seen: Vec<(Sides, EdgeLoss)> =
        views.iter().filter_map(|s| Some((*s, s.0[side]?))).collect();
    let widths: Vec<f64> = seen.iter().map(|(_, v)| v.lost / v.rows).collect();
    // Two views are too few for a share.
    let counts = [min_views(widths.len())];
    let some = SomeViews::beyond(&widths, BORDER_PX, OF_A_CONSTANT, &counts)?;
    let shaded: Vec<Sides> = some.which.iter().map(|&v| seen[v].0).collect();
    let p = (some.p / SHARES[1]).min(1.0);
    let of_some = Some([shaded.len(), seen.len()]);
    Some(Band { p, of_some, ..band_on(&shaded, side)? })
}

/// Degrees of freedom of a constant, which these views do not estimate: Student's t is then normal.
const OF_A_CONSTANT: usize = 1000;

/// Band on the side that loses more, whatever its significance.
fn band_of(views: &[Sides]) -> Option<Band> {
    let [left, right] = by_side(views).map(|(_, share)| share.map_or(0.0, |share| share.value));
    band_on(views, usize::from(right > left))
}

fn band_on(views: &[Sides], side: usize) -> Option<Band> {
    let sides = by_side(views);
    let share = |side: usize| sides[side].1.map_or(0.0, |share| share.value);
    let (views, lawful) = (&sides[side].0, sides[side].1?);
    let even = law(views, |v| v.rows)?;
    let p = [lawful.p_above(0.0), beyond_borders(views), by_counts(views)];
    let p = p.iter().zip(SHARES).map(|(p, share)| p / share).fold(1.0, f64::min);
    let one_sided = share(1 - side) < OTHER_SIDE * lawful.value;
    let gain = [nats(&lawful, views, |v| v.shaded), nats(&even, views, |v| v.rows)];
    Some(Band {
        side,
        lawful: one_sided && lawful.value < WIDEST && gain[0] > SHADOW_ADEQUATE * gain[1],
        share: [lawful.value, lawful.std_error],
        gain,
        p,
        curve: curve(views, lawful.value),
        of_some: None,
    })
}

/// P-value of the widths' dependence on the predicted ones. Few views say little about their scatter, so the
/// border error is pooled with it, with the weight of the fewest views.
fn beyond_borders(views: &[EdgeLoss]) -> f64 {
    let products = views.iter().map(|v| [v.lost, v.shaded].map(|px| px / v.rows));
    let (own, cross, square) =
        products.fold((0.0, 0.0, 0.0), |(own, cross, square), [lost, wide]| {
            (own + lost * lost, cross + lost * wide, square + wide * wide)
        });
    if square <= 0.0 {
        return 1.0;
    }
    let borders = MIN_VIEWS as f64;
    let freedom = views.len() as f64 - 1.0 + borders;
    let scatter = (own - cross * cross / square + borders * BORDER_PX.powi(2)) / freedom;
    student_upper(cross / (square * scatter).sqrt(), freedom)
}

/// P-value of where the lost readings lie, in the shadow or beyond it, given their number. The dispersion is
/// that of the views' losses in the shadow about their mean share, as losses come in clumps (McCullagh and
/// Nelder 1989). For shadows too thin to be an error of a border, which is whole pixels.
fn by_counts(views: &[EdgeLoss]) -> f64 {
    if views.iter().any(|v| v.lost > 0.5 * BORDER_PX * v.rows) {
        return 1.0;
    }
    let sum = |of: usize, k: usize| views.iter().map(|v| v.counts[of][k]).sum::<f64>();
    let [[within, seen], [beyond, others]] = [0, 1].map(|of| [sum(of, 0), sum(of, 1)]);
    let (lost, all) = (within + beyond, seen + others);
    if within * others <= beyond * seen {
        return 1.0;
    }
    let term = |k: f64, expected: f64| if k > 0.0 { k * (k / expected).ln() } else { 0.0 };
    let deviance = 2.0 * (term(within, lost * seen / all) + term(beyond, lost * others / all));
    let freedom = views.len() as f64 - 1.0;
    let off = |v: &EdgeLoss| {
        let expected = within * v.counts[0][1] / seen;
        (v.counts[0][0] - expected).powi(2) / expected
    };
    let dispersion = views.iter().map(off).sum::<f64>() / freedom;
    // The deviance of equal shares is zero but for rounding.
    student_upper((deviance.max(0.0) / dispersion.max(1.0)).sqrt(), freedom)
}

fn curve(views: &[EdgeLoss], share: f64) -> Curve {
    let mut widths: Vec<[f64; 2]> =
        views.iter().map(|v| [v.shaded, v.lost].map(|px| px / v.rows)).collect();
    widths.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let model: Vec<f64> = widths.iter().map(|w| share * w[0]).collect();
    let off: f64 = widths.iter().zip(&model).map(|(w, m)| (w[1] - m).powi(2)).sum();
    let scatter = (off / (widths.len() as f64 - 1.0)).sqrt();
    Curve {
        x_label: "disparity from the target's border to what is behind, px".into(),
        y_label: "width without a measurement beside the border, px".into(),
        x: widths.iter().map(|w| w[0]).collect(),
        y: widths.iter().map(|w| w[1]).collect(),
        y_std_error: vec![scatter; widths.len()],
        model,
    }
}

/// Whether the shadows of both halves have the same share of the predicted width.
pub fn bands_agree(sides: &[Sides], second: &[bool]) -> Option<bool> {
    let half = |which: bool| {
        let mine = sides.iter().zip(second).filter(|(_, s)| **s == which);
        let mine: Vec<Sides> = mine.map(|(sides, _)| *sides).collect();
        let Band { side, share: [value, std_error], .. } = band_of(&mine)?;
        Some((side, ViewMean::new(value, std_error, mine.len() as f64)))
    };
    let (first, second) = (half(false)?, half(true)?);
    Some(first.0 == second.0 && agree([Some(first.1), Some(second.1)])?)
}
