//! Quantifies dropout findings: parameters, interval, size and curve.

use serde_json::{Map, Value, json};

use super::cells::Cell;
use super::fit::{Fitted, fit};
use super::points::{BINS, Point, bounded, misfit, part, points};
use super::search::{Judged, Losses};
use super::shapes::{Shape, Step};
use super::{DropoutCells, DropoutSearch};
use crate::diagnose::diagnosis::{Alternative, Curve, Detectable, Finding, Size, Status};
use crate::diagnose::edges::shadow::Band;
use crate::diagnose::finding::naming::{MIN_PROBABILITY, ln_odds, none_of_these, physics};
use crate::diagnose::finding::other_findings::named;
use crate::diagnose::finding::parameters::estimate;
use crate::diagnose::finding::shape::digits;
use crate::diagnose::views::field::Field;
use crate::effects;
use crate::stats::range;
use crate::terms::{Axis, Basis, Coordinate, Statistic, corner_radius};

/// Lost share from which an effect matters.
const MATTERS: f64 = 0.05;
/// Share of the best nameless curve's gain that a name must reach.
pub const NAME_ADEQUATE: f64 = 0.6;

/// Families and nameless axes that were tried, nats, best first.
pub type Rivals = [(&'static str, f64)];

/// Families and nameless axes, each with the gain of its best shape.
pub fn rivals<'a>(judged: impl IntoIterator<Item = &'a Judged>) -> Vec<(&'static str, f64)> {
    let mut all: Vec<(&'static str, f64)> = Vec::new();
    for j in judged {
        let name = j.shape.family().unwrap_or(j.shape.axis().id());
        if all.iter().all(|r| r.0 != name) {
            all.push((name, j.gain));
        }
    }
    all
}

/// Writes findings from the losses of the views.
pub(super) struct DropoutReporter<'a> {
    pub search: &'a DropoutSearch<'a>,
    pub seen: &'a DropoutCells<'a>,
    /// Share lost everywhere.
    pub base: f64,
}

/// Place of a cell on an axis, if it counts.
type At = Box<dyn Fn(&Cell<'_>) -> Option<f64>>;

impl DropoutReporter<'_> {
    /// Finding for losses of this shape; `p` is its p-value.
    pub fn finding(&self, won: &Judged, rivals: &Rivals, p: f64) -> Finding {
        let (mut family, axis) = (won.shape.family(), won.shape.axis());
        let mut finding = Finding {
            share: won.gain,
            p_adjusted: Some(p),
            ..named(family.unwrap_or_default(), Statistic::Dropout, axis)
        };
        match &won.shape {
            Shape::Step(step) => {
                let follows = self.step(*step, &mut finding);
                family = family.filter(|_| follows);
            }
            Shape::Curve(basis) => self.curve(basis, &mut finding),
        }
        described(finding, family, rivals, Some(&won.shape))
    }

    /// Fits the step and fills in the finding. Returns whether the losses are nearer to the step than to
    /// none. A step in the angle of incidence gets the parameters of the nearest step in the plane's tilt,
    /// which is what a model has.
    fn step(&self, step: Step, finding: &mut Finding) -> bool {
        let nearest = |step: Step| {
            let all = self.points(step);
            (self.nearest(step, &all), all)
        };
        let by_incidence = step.incidence.then(|| nearest(step).0.is_some());
        let step = Step { incidence: false, ..step };
        let (span, (fitted, all)) = (self.span(step), nearest(step));
        let Some(fitted) = fitted.filter(|_| by_incidence != Some(false)) else {
            self.shapeless(&all, step.axis, span, finding);
            return false;
        };
        let loss = |x: f64| fitted.step.loss(x, self.base);
        finding.parameters = parameters(&fitted);
        finding.interval = interval(&fitted, span);
        // Relative to all pixel-frames, including those before it began.
        let there: f64 = all.iter().map(|p| p.asked).sum();
        let asked: f64 = self.seen.fine.iter().flatten().map(|c| c.asked).sum();
        finding.size.sigma = there / asked.max(1.0) * mean(&all, |p| loss(p.x) - self.base);
        finding.curve = Some(binned(&all, step.axis, span, loss));
        true
    }

    fn span(&self, step: Step) -> [f64; 2] {
        match step.axis {
            Axis::Theta if step.incidence => {
                range(self.seen.fine.iter().flatten().map(|c| step.at(c.place)))
            }
            Axis::Theta => self.search.reach.theta,
            _ => self.search.reach.z,
        }
    }

    fn points(&self, step: Step) -> Vec<Point> {
        let at = |c: &Cell<'_>| (!step.before(c.place.session_s)).then(|| step.at(c.place));
        bounded(points(&self.seen.fine, &at, self.span(step)), &step, &self.seen.region_given)
    }

    /// Fits the step to these losses; `None` where it is no nearer to them than no step, or where its
    /// middle may as well be at the sensor.
    fn nearest(&self, step: Step, all: &[Point]) -> Option<Fitted> {
        let own = Fitted { step, std_error: [None; 3] };
        let fitted = fit(step, self.base, all).unwrap_or(own);
        let off = |loss: &dyn Fn(f64) -> f64| -> f64 {
            all.iter().map(|p| misfit(p, loss(p.x)).powi(2)).sum()
        };
        let follows = off(&|x| fitted.step.loss(x, self.base)) < off(&|_| self.base);
        // The fit of a near foot to other losses runs on to a middle at the sensor.
        let at_the_sensor = step.axis == Axis::Z
            && step.width < 0.0
            && fitted.step.middle < fitted.std_error[0].unwrap_or(0.0);
        (follows && !at_the_sensor).then_some(fitted)
    }

    fn curve(&self, basis: &Basis, finding: &mut Finding) {
        let (span, at): ([f64; 2], At) = match basis {
            Basis::Curve { over, low, high, .. } => {
                let (over, corner) = (*over, corner_radius(self.search.camera));
                let unit = if over == Coordinate::Radius { corner } else { 1.0 };
                let value = move |c: &Cell<'_>| Some(unit * over.value(c.place));
                ([unit * low, unit * high], Box::new(value))
            }
            _ => ([0.0, self.search.camera.width as f64], Box::new(|c| Some(c.place.u))),
        };
        self.shapeless(&points(&self.seen.fine, &at, span), basis.axis(), span, finding);
    }

    /// Fills in what was measured, without a law.
    fn shapeless(&self, all: &[Point], axis: Axis, span: [f64; 2], finding: &mut Finding) {
        finding.size.sigma = mean(all, |p| (p.share - self.base).max(0.0));
        let mut curve = binned(all, axis, span, |_| self.base);
        curve.model = curve.y.clone();
        finding.interval = crowded(&curve, self.base, (span[1] - span[0]) / BINS as f64);
        finding.curve = Some(curve);
    }
}

fn mean(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    let asked: f64 = points.iter().map(|p| p.asked).sum();
    points.iter().map(|p| p.asked * of(p)).sum::<f64>() / asked.max(1.0)
}

/// Interval in which more than half of the largest excess is lost.
fn crowded(curve: &Curve, base: f64, bin: f64) -> [f64; 2] {
    let most = curve.y.iter().copied().fold(base, f64::max) - base;
    let high = curve.x.iter().zip(&curve.y).filter(|(_, y)| **y - base > 0.5 * most);
    let [low, high] = range(high.map(|(x, _)| *x));
    [low - 0.5 * bin, high + 0.5 * bin]
}

fn parameters(fitted: &Fitted) -> Map<String, Value> {
    let Fitted { step, std_error: [middle, width, share], .. } = fitted;
    let (unit, names) = match step.axis {
        Axis::Theta => (1f64.to_degrees(), ["theta50_deg", "width_deg"]),
        _ => (1.0, ["z50_m", "width_m"]),
    };
    let error = |of: &Option<f64>| of.map_or(f64::NAN, |e| unit * e);
    let mut all = Map::new();
    all.insert(names[0].into(), estimate(unit * step.middle, error(middle)));
    all.insert(names[1].into(), estimate(unit * step.width, error(width)));
    if let Some(error) = *share {
        all.insert("share".into(), estimate(step.share, error));
    }
    all
}

/// Interval from where the loss matters to the end of the axis.
fn interval(fitted: &Fitted, [low, high]: [f64; 2]) -> [f64; 2] {
    let Step { middle, width, share, axis, .. } = fitted.step;
    let from = middle + width * (MATTERS / (share - MATTERS).max(MATTERS)).ln();
    match (width > 0.0, axis) {
        (true, Axis::Theta) => [from, std::f64::consts::FRAC_PI_2],
        (true, _) => [from.min(high), high.max(from)],
        (false, _) => [0.0, from.max(low)],
    }
}

/// Lost shares per bin; the views are the sample.
fn binned(points: &[Point], axis: Axis, span: [f64; 2], model: impl Fn(f64) -> f64) -> Curve {
    let mut curve = Curve {
        x_label: format!("{axis}, {}", axis.unit()),
        y_label: "share of the pixel-frames without a measurement".into(),
        ..Curve::default()
    };
    for bin in 0..BINS {
        let inside = |p: &&Point| part(p.x, span, BINS) == bin;
        let members: Vec<Point> = points.iter().filter(inside).copied().collect();
        let asked: f64 = members.iter().map(|p| p.asked).sum();
        if asked <= 0.0 {
            continue;
        }
        let (x, y) = (mean(&members, |p| p.x), mean(&members, |p| p.share));
        let n = members.len() as f64;
        let squares: f64 = members.iter().map(|p| (p.asked * (p.share - y)).powi(2)).sum();
        let scatter = squares * n / (n - 1.0).max(1.0);
        curve.x.push(x);
        curve.y.push(y);
        curve.y_std_error.push((scatter / asked.powi(2)).max(y * (1.0 - y) / asked).sqrt());
        curve.model.push(model(x));
    }
    curve
}

/// Smallest detectable effects: the middle of the faintest step that would be seen.
pub fn detectable(losses: &Losses<'_>, steps: &[Step], threshold: f64) -> Vec<Detectable> {
    let minimum = |s: Step| {
        let (name, value) = match (s.axis, s.width > 0.0) {
            (Axis::Theta, _) => ("theta50_deg", s.middle.to_degrees()),
            (_, true) => ("z50_m", s.middle),
            (_, false) => ("z50_m, near side", s.middle),
        };
        let minimum = Map::from_iter([(name.to_string(), json!(value))]);
        Detectable { effect: s.family(), minimum }
    };
    losses.detectable(steps, threshold).into_iter().map(minimum).collect()
}

/// Finding of a band beside the target.
pub fn shadow_finding(band: Band, fields: &[Field]) -> Finding {
    let mut parameters = Map::new();
    if band.lawful {
        parameters.insert("share".into(), estimate(band.share[0].min(1.0), band.share[1]));
    }
    parameters.insert("side".into(), json!(["left", "right"][band.side]));
    let lost: f64 = fields.iter().map(|f| f.edges.lost_px(band.side)).sum();
    let asked: f64 = fields.iter().map(|f| f.pixels.len() as f64).sum();
    let family = band.lawful.then_some("occlusion-shadow");
    let finding = Finding {
        interval: [0.0, band.curve.y.iter().copied().fold(0.0, f64::max)],
        share: band.gain[usize::from(!band.lawful)],
        parameters,
        size: Size { mm: 0.0, sigma: lost / (asked + lost).max(1.0) },
        p_adjusted: Some(band.p),
        curve: Some(band.curve),
        of_some: band.of_some,
        ..named(family.unwrap_or_default(), Statistic::Dropout, Axis::EdgeDistance)
    };
    let rivals = [("occlusion-shadow", band.gain[0]), ("edge-distance", band.gain[1])];
    let mut finding = described(finding, family, &rivals, None);
    let which = finding.which_views();
    finding.physics.extend(which.iter().map(|which| format!(" Measured here: {which}.")));
    finding.shape.iter_mut().for_each(|s| s.extend(which.iter().map(|which| format!(", {which}"))));
    finding
}

/// Adds the name, if there is one, the rivals, and the description of both.
fn described(
    found: Finding,
    family: Option<&'static str>,
    rivals: &Rivals,
    shape: Option<&Shape>,
) -> Finding {
    let status = if family.is_some() { Status::Named } else { Status::Unexplained };
    let ([from, to], unit) = (found.interval.map(digits), found.unit);
    let step = shape.and_then(|s| if let Shape::Step(step) = s { Some(step) } else { None });
    let shape = family.is_none().then(|| format!("more is lost from {from} to {to} {unit}"));
    let mut words = physics(status, family, Statistic::Dropout, found.axis, shape.as_deref());
    if step.is_some_and(|s| s.incidence) && family.is_some() {
        words += " It goes with the angle at which each pixel sees the target; the numbers are those of the plane's tilt that come nearest.";
    }
    if let Some(since) = step.and_then(|s| s.since_s) {
        words += &format!(" It began about {since:.1} s after the first view.");
    }
    let alternatives = family.map_or_else(Vec::new, |name| weighed(name, found.share, rivals));
    Finding { status, effect: family, alternatives, physics: words, shape, ..found }
}

/// Probabilities of the names, by how well each predicts views left out. What a nameless curve gains beyond
/// them gives the probability of none.
fn weighed(name: &'static str, gain: f64, rivals: &Rivals) -> Vec<Alternative> {
    let best = rivals.first().map_or(gain, |r| r.1);
    let card = |id: &'static str| effects::find(id).map(|e| e.card().id);
    let curves = rivals.iter().filter(|r| card(r.0).is_none());
    let curve = curves.map(|r| r.1).fold(0.0, f64::max);
    let mut odds = vec![(name, 1.0)];
    let rivals = rivals.iter().filter_map(|&(id, gain)| Some((card(id)?, gain)));
    let behind = |gain: f64| ln_odds((gain - best).clamp(-60.0, 0.0)).exp();
    odds.extend(rivals.filter(|r| r.0 != name).map(|(id, gain)| (id, behind(gain))));
    let total: f64 = odds.iter().map(|o| o.1).sum();
    let some = 1.0 - none_of_these(gain, curve, NAME_ADEQUATE);
    odds.into_iter()
        .map(|(effect, o)| (effect, some * o / total))
        .filter(|a| a.0 == name || a.1 > MIN_PROBABILITY)
        .map(|(effect, p)| Alternative { effect, probability: Some(p) })
        .collect()
}
