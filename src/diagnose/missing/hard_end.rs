//! Hard end of the range: everything beyond it is missing because of the sensor's driver or format.

use super::cells::Cell;
use super::points::Point;
use super::shapes::Step;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::surveyed_view::SurveyedView;
use crate::terms::Axis;

/// An edge narrower than this share of its distance, or than the noise that blurs it there, is a limit set by
/// a driver or format. A fading pattern loses readings gradually.
const HARD_END_SHARE: f64 = 0.01;
/// Limits on either side of the middle that are examined pixel by pixel; an edge as wide as the limit has
/// lost 2 % there.
const CLOSE: f64 = 4.0;
/// Largest share that a driver's limit lets pass farther beyond it than that: strays only.
const STRAYS: f64 = 0.1;

/// Losses about a depth, pixel by pixel.
pub struct CloseLook<'a> {
    /// Standard deviation of the depth at a depth, m.
    pub blur: &'a dyn Fn(f64) -> f64,
    /// Shares lost per view within a span of depths, m.
    pub points: &'a dyn Fn([f64; 2]) -> Vec<Point>,
    /// Depths that the views reach, m.
    pub reach: [f64; 2],
}

/// Depth beyond (or before) which everything is missing.
pub struct HardEnd {
    z_m: f64,
    /// Negative where nearer readings are lost.
    width_m: f64,
    /// Distance before the end from which it loses nothing any more, m.
    felt_m: f64,
}

impl HardEnd {
    /// Returns the hard end, if a step in depth is one: either it was fitted as that narrow, or the pixels
    /// show a cut, with losses beyond and measurements before it, but for fewer than an edge as wide as the
    /// limit would mix. `base` is lost anyway.
    pub fn of(step: &Step, width_error: f64, base: f64, look: &CloseLook<'_>) -> Option<Self> {
        if step.axis != Axis::Z || step.share < 1.0 - STRAYS {
            return None;
        }
        // A rise of which only the foot is seen has its middle beyond the reach; a hard end does not.
        let [near, far] = look.reach;
        let (middle, toward) = (step.middle.max(near).min(far), step.width.signum());
        let limit = f64::max(HARD_END_SHARE * middle, (look.blur)(middle));
        let fitted = HardEnd { z_m: step.middle, width_m: step.width, felt_m: CLOSE * limit };
        let narrow = step.width.abs() + width_error < limit;
        let end = if narrow { fitted } else { HardEnd::cut(middle, toward * limit, base, look)? };
        // Losses that begin mid-session are no hard end either: other views measure beyond it.
        let past = end.z_m + toward * CLOSE * limit;
        let beyond = if toward > 0.0 { [past, far] } else { [near, past] };
        let all = if beyond[0] < beyond[1] { (look.points)(beyond) } else { Vec::new() };
        let sum = |of: fn(&Point) -> f64| all.iter().map(of).sum::<f64>();
        (sum(|p| p.asked * (1.0 - p.share)) <= STRAYS * sum(|p| p.asked)).then_some(end)
    }

    /// Finds the cut about `middle`, narrower than `limit`, which is negative where nearer readings are lost.
    fn cut(middle: f64, limit: f64, base: f64, look: &CloseLook<'_>) -> Option<Self> {
        let close = CLOSE * limit.abs();
        let mut points = (look.points)([middle - close, middle + close]);
        points.sort_by(|a, b| (a.x * limit).total_cmp(&(b.x * limit)));
        let lost = |p: &Point| ((p.share - base) / (1.0 - base)).max(0.0) * p.asked;
        let (z_m, before, measured) = best_cut(&points, lost)?;
        let edge = Step::whole(Axis::Z, z_m, limit);
        let of_edge =
            |p: &Point| p.asked * edge.loss(z_m - limit.signum() * (p.x - z_m).abs(), 0.0);
        let (mixed, widest) = (before + measured, points.iter().map(of_edge).sum::<f64>());
        // The foot of a rise has most of its losses before any cut, and a single distance shows no cut.
        let all_lost: f64 = points.iter().map(lost).sum();
        let all_measured: f64 = points.iter().map(|p| p.asked - lost(p)).sum();
        let is_cut =
            before < all_lost - before && mixed < all_measured - measured && mixed < widest;
        let width_m = limit * mixed.max(1.0) / widest;
        is_cut.then_some(HardEnd { z_m, width_m, felt_m: close })
    }

    pub fn touches(&self, cell: &Cell<'_>) -> bool {
        let far = cell.place.slope[0].abs() + cell.place.slope[1].abs();
        let half = 0.5 * cell.place.side * far / cell.place.disparity * cell.place.z;
        !self.spares(cell.place.z + half * self.width_m.signum())
    }

    /// Whether it loses nothing at this depth.
    pub fn spares(&self, z: f64) -> bool {
        (z - self.z_m) * self.width_m.signum() <= -self.felt_m
    }

    /// Part of a range of depths that it spares.
    pub fn spared(&self, [near, far]: [f64; 2]) -> [f64; 2] {
        let last = self.z_m - self.felt_m * self.width_m.signum();
        if self.width_m > 0.0 { [near, far.min(last)] } else { [near.max(last), far] }
    }

    /// Its losses as a step.
    pub fn step(&self) -> Step {
        Step::whole(Axis::Z, self.z_m, self.width_m)
    }

    pub fn note(&self) -> String {
        let side = if self.width_m > 0.0 { "beyond" } else { "nearer than" };
        format!(
            "readings {side} {:.2} m are missing: the range has a hard end there, set by the sensor's driver or format",
            self.z_m
        )
    }
}

/// The depth, of the first point or between two consecutive ones, with the fewest pixel-frames on its wrong
/// side, and their numbers: lost before it, and measured beyond it.
fn best_cut(points: &[Point], lost: impl Fn(&Point) -> f64) -> Option<(f64, f64, f64)> {
    let (mut before, mut beyond): (f64, f64) =
        (0.0, points.iter().map(|p| p.asked - lost(p)).sum());
    let first = (points.first()?.x, before, beyond);
    let cuts = points.windows(2).map(|pair| {
        before += lost(&pair[0]);
        beyond -= pair[0].asked - lost(&pair[0]);
        (0.5 * (pair[0].x + pair[1].x), before, beyond)
    });
    std::iter::once(first).chain(cuts).min_by(|a, b| (a.1 + a.2).total_cmp(&(b.1 + b.2)))
}

/// Standard deviation of the depth by the model, m, where the views come nearest to `z`.
pub fn blur(survey: &Survey, z: f64) -> f64 {
    let patches = survey.views.iter().flat_map(SurveyedView::patches);
    let nearest = patches.min_by(|(a, _), (b, _)| (a.z - z).abs().total_cmp(&(b.z - z).abs()));
    nearest.map_or(0.0, |(place, t)| t.noise_variance.sqrt() / place.disparity * z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six views that run evenly through 5.5 to 6.1 m, with about a hundred pixels of eight frames in a bin,
    /// of which `loss` loses a share. Only a corner of one view reaches the end.
    fn end(loss: impl Fn(f64) -> f64) -> Option<HardEnd> {
        let view = |view: usize| {
            let far = if view == 0 { 6.1 } else { 5.9 };
            let bins = (0..24).map(|k| 5.5 + 0.025 * f64::from(k)).filter(move |x| *x < far);
            let corner = |x: f64| if x < 5.95 { 800.0 } else { 160.0 };
            bins.map(move |x| (view, x, corner(x)))
        };
        let point = |(view, x, asked)| Point { view, x, share: loss(x), asked, at_least: false };
        let all: Vec<Point> = (0..6).flat_map(view).map(point).collect();
        judged(&all, 7.0)
    }

    fn judged(all: &[Point], middle: f64) -> Option<HardEnd> {
        let inside = |[near, far]: [f64; 2]| move |p: &Point| p.x >= near && p.x <= far;
        let look = CloseLook {
            blur: &|_| 0.03,
            points: &|span| all.iter().copied().filter(inside(span)).collect(),
            reach: crate::stats::range(all.iter().map(|p| p.x)),
        };
        HardEnd::of(&Step::whole(Axis::Z, middle, 0.1), f64::INFINITY, 0.0, &look)
    }

    #[test]
    fn a_corner_that_is_cut_off_shows_a_hard_end_and_the_foot_of_a_rise_none() {
        let cut = |at: f64| move |x: f64| f64::from(u8::from(x > at));
        let rise =
            |middle: f64, width: f64| move |x: f64| 1.0 / (1.0 + ((middle - x) / width).exp());
        assert!(end(cut(6.0)).is_some_and(|e| (e.z_m - 6.0).abs() < 0.03));
        assert!(end(rise(6.0, 0.02)).is_some(), "blurred by the noise");
        assert!(end(rise(6.0, 0.2)).is_none(), "gradual");
        assert!(end(rise(6.3, 0.1)).is_none(), "a foot");
        assert!(end(|_| 0.0).is_none(), "nothing");
    }

    /// Frontal walls half a metre apart: none shows both sides of an edge.
    #[test]
    fn a_wall_that_loses_much_is_no_cut() {
        let wall = |(view, x, share)| Point { view, x, share, asked: 4e5, at_least: false };
        let walls = [(0, 5.0, 0.0), (1, 5.5, 0.08), (2, 6.0, 0.62)].map(wall);
        assert!(judged(&walls, 5.95).is_none());
    }

    /// Another view measures the same distances, so there is no driver's limit.
    #[test]
    fn an_end_that_other_views_pass_is_none() {
        let at =
            |view: usize, x: f64, share| Point { view, x, share, asked: 800.0, at_least: false };
        let early = (0..8).map(|k| at(0, 6.5 + 0.05 * f64::from(k), 0.0));
        let late = (0..20).map(|k| at(1, 5.5 + 0.05 * f64::from(k), f64::from(u8::from(k > 10))));
        let late: Vec<Point> = late.collect();
        assert!(judged(&late, 6.0).is_some());
        assert!(judged(&late.into_iter().chain(early).collect::<Vec<_>>(), 6.0).is_none());
    }
}
