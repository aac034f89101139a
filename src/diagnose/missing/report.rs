//! Findings of the layer of losses, put in numbers: parameters, interval, size, curve.

use serde_json::{Map, Value, json};

use super::cells::Cell;
use super::finding::DropoutFinding;
use super::fit::{Fitted, fit};
use super::points::{Point, bounded, part, points};
use super::search::Judged;
use super::shapes::{Shape, Step};
use crate::camera::Camera;
use crate::diagnose::diagnosis::Curve;
use crate::diagnose::edges::shadow::Band;
use crate::diagnose::finding::parameters::estimate;
use crate::diagnose::views::field::Field;
use crate::terms::{Axis, Basis, Extent};

/// An effect matters from this lost share on.
const MATTERS: f64 = 0.05;

/// Writes findings, from what the views lost.
pub struct DropoutReporter<'a> {
    /// The views' losses in the smallest patches.
    pub fine: &'a [Vec<Cell<'a>>],
    /// Whether each view's region was given.
    pub region_given: &'a [bool],
    /// Share lost everywhere.
    pub base: f64,
    pub reach: &'a Extent,
    pub camera: &'a Camera,
}

/// Where a cell lies on an axis.
type At = Box<dyn Fn(&Cell<'_>) -> Option<f64>>;

impl DropoutReporter<'_> {
    pub fn finding(
        &self,
        won: &Judged,
        rivals: Vec<(&'static str, f64)>,
        p: f64,
    ) -> DropoutFinding {
        let mut finding = DropoutFinding {
            family: won.shape.family(),
            axis: won.shape.axis(),
            interval: [0.0; 2],
            parameters: Map::new(),
            p,
            rivals,
            gain: won.gain,
            size: 0.0,
            replicated: None,
            since_s: None,
            curve: Curve::default(),
        };
        match &won.shape {
            Shape::Step(step) => self.step(*step, &mut finding),
            Shape::Curve(basis) => self.curve(basis, &mut finding),
        }
        finding
    }

    fn step(&self, step: Step, finding: &mut DropoutFinding) {
        let span = if step.axis == Axis::Theta { self.reach.theta } else { self.reach.z };
        let at = |c: &Cell<'_>| (!step.before(c.place.session_s)).then(|| step.at(c.place));
        let all = bounded(points(self.fine, &at, span), &step, self.region_given);
        let own = Fitted { step, std_error: [None; 3] };
        let fitted = fit(step, self.base, &all).unwrap_or(own);
        let loss = |x: f64| fitted.step.loss(x, self.base);
        finding.parameters = parameters(&fitted);
        finding.since_s = step.since_s;
        finding.interval = interval(&fitted, span);
        // Of all pixel-frames, those before it began among them.
        let there: f64 = all.iter().map(|p| p.asked).sum();
        let asked: f64 = self.fine.iter().flatten().map(|c| c.asked).sum();
        finding.size = there / asked.max(1.0) * mean(&all, |p| loss(p.x) - self.base);
        finding.curve = binned(&all, step.axis, span, loss);
    }

    fn curve(&self, basis: &Basis, finding: &mut DropoutFinding) {
        let (span, at): ([f64; 2], At) = match basis {
            Basis::Curve { over, low, high, .. } => {
                let over = *over;
                ([*low, *high], Box::new(move |c| Some(over.value(&c.place))))
            }
            _ => ([0.0, self.camera.width as f64], Box::new(|c| Some(c.place.u))),
        };
        let all = points(self.fine, &at, span);
        finding.size = mean(&all, |p| (p.share - self.base).max(0.0));
        finding.curve = binned(&all, basis.axis(), span, |_| self.base);
        finding.curve.model = finding.curve.y.clone();
        finding.interval = crowded(&finding.curve, self.base, (span[1] - span[0]) / BINS as f64);
    }
}

fn mean(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    let asked: f64 = points.iter().map(|p| p.asked).sum();
    points.iter().map(|p| p.asked * of(p)).sum::<f64>() / asked.max(1.0)
}

/// Where more than half of the greatest excess is lost.
fn crowded(curve: &Curve, base: f64, bin: f64) -> [f64; 2] {
    let most = curve.y.iter().copied().fold(base, f64::max) - base;
    let high = curve.x.iter().zip(&curve.y).filter(|(_, y)| **y - base > 0.5 * most);
    let [low, high] = crate::stats::range(high.map(|(x, _)| *x));
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

/// From where the loss matters to the end of the axis.
fn interval(fitted: &Fitted, [low, high]: [f64; 2]) -> [f64; 2] {
    let Step { middle, width, share, axis, .. } = fitted.step;
    let from = middle + width * (MATTERS / (share - MATTERS).max(MATTERS)).ln();
    match (width > 0.0, axis) {
        (true, Axis::Theta) => [from, std::f64::consts::FRAC_PI_2],
        (true, _) => [from.min(high), high.max(from)],
        (false, _) => [0.0, from.max(low)],
    }
}

/// Bins of a curve: a band of a few per cent of the axis is still seen.
const BINS: usize = 40;

/// Lost shares bin by bin; the views are the sample.
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
        let scatter: f64 = members.iter().map(|p| (p.asked * (p.share - y)).powi(2)).sum();
        curve.x.push(x);
        curve.y.push(y);
        curve.y_std_error.push((scatter / asked.powi(2)).max(y * (1.0 - y) / asked).sqrt());
        curve.model.push(model(x));
    }
    curve
}

/// A band beside the target.
pub fn shadow_finding(band: Band, fields: &[Field]) -> DropoutFinding {
    let mut parameters = Map::new();
    if band.lawful {
        parameters.insert("share".into(), estimate(band.share[0].min(1.0), band.share[1]));
    }
    parameters.insert("side".into(), json!(["left", "right"][band.side]));
    let (mut lost, mut asked) = (0.0, 0.0);
    for f in fields {
        lost += f.edges.lost_px(band.side);
        asked += f.pixels.len() as f64;
    }
    DropoutFinding {
        family: band.lawful.then_some("occlusion-shadow"),
        axis: Axis::EdgeDistance,
        interval: [0.0, band.curve.y.iter().copied().fold(0.0, f64::max)],
        parameters,
        p: band.p,
        rivals: vec![("occlusion-shadow", band.gain[0]), ("edge-distance", band.gain[1])],
        gain: band.gain[usize::from(!band.lawful)],
        size: lost / (asked + lost).max(1.0),
        replicated: None,
        since_s: None,
        curve: band.curve,
    }
}
