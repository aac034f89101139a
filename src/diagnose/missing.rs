//! The layer of what is not there: which pixels give no answer, and what it follows.
//!
//! Losses are judged in log odds, view by view, against views that differ for no reason by a
//! factor of e and more: a finding must hold over the views. Steps on lawful axes have a name
//! unless a nameless curve does clearly better.

use serde_json::{Map, Value, json};

use super::diagnosis::Curve;
use super::field::Field;
use super::layers::Survey;
use super::missing_cells::{Cell, cells};
use super::missing_fit::{Fitted, Point, fit, points};
use super::missing_search::{Judged, Losses, Shape, Step, curves, steps};
use super::reach::Reach;
use super::shadow_test::{Band, band};
use crate::camera::{Camera, Rays};
use crate::rng::Seed;
use crate::terms::{Axis, Basis};

/// Losses that follow an axis.
#[derive(Debug, Clone)]
pub struct MissingFinding {
    /// Id of effects.md; `None` where no family explains it.
    pub family: Option<&'static str>,
    pub axis: Axis,
    /// Where it matters, in the axis's unit.
    pub interval: [f64; 2],
    /// As effects.md names them, each with value and standard error.
    pub parameters: Map<String, Value>,
    /// Chance that losses without a cause look as much like it anywhere in this layer.
    pub p: f64,
    /// Families and nameless axes beside it, nats, best first.
    pub rivals: Vec<(&'static str, f64)>,
    /// Nats on held-out views.
    pub gain: f64,
    /// Share of all pixel-frames that it took.
    pub size: f64,
    /// Lost share over the axis.
    pub curve: Curve,
}

/// All that was found missing.
#[derive(Debug, Clone, Default)]
pub struct MissingOutcome {
    /// Largest gain first.
    pub findings: Vec<MissingFinding>,
    /// Families with the middle of the faintest whole step that 80 % of such recordings would
    /// show, in degrees or m: what begins farther out is not seen.
    pub detectable: Vec<(&'static str, &'static str, f64)>,
}

/// Fewer views show no rule.
const FEWEST_VIEWS: usize = 4;
/// Chance of a finding on a clean recording: the steps and curves, and the shadow.
const LEVEL: f64 = 0.001;
const SHADOW_LEVEL: f64 = 0.0005;
/// A name must explain this share of what the best nameless curve does.
const ADEQUATE: f64 = 0.6;
const MOST_FINDINGS: usize = 3;
/// A later finding must bring this share of what the first brought.
const LEAST_SHARE: f64 = 0.1;
/// An effect matters from this lost share on.
const MATTERS: f64 = 0.05;

/// What the losses of a recording follow.
pub fn missing(
    fields: &[Field],
    survey: &Survey,
    camera: &Camera,
    _rays: &Rays,
    seed: Seed,
) -> MissingOutcome {
    let mut outcome = of_cells(&cells(survey, camera), &survey.reach, camera, seed);
    let shadows: Vec<_> = fields.iter().map(|f| f.shadow).collect();
    if let Some(band) = band(&shadows, SHADOW_LEVEL) {
        outcome.findings.push(shadow_finding(band, fields));
    }
    outcome
}

/// Losses on the target.
fn of_cells(views: &[Vec<Cell>], reach: &Reach, camera: &Camera, seed: Seed) -> MissingOutcome {
    let mut outcome = MissingOutcome::default();
    if views.iter().filter(|v| !v.is_empty()).count() < FEWEST_VIEWS {
        return outcome;
    }
    let (steps, curves) = (steps(reach), curves(camera, reach));
    let mut explained: Vec<Vec<f64>> = views.iter().map(|v| vec![0.0; v.len()]).collect();
    let mut taken: Vec<Axis> = Vec::new();
    while outcome.findings.len() < MOST_FINDINGS {
        let mut losses = Losses::new(views, &explained);
        let open_steps: Vec<Step> =
            steps.iter().filter(|s| !taken.contains(&s.axis)).copied().collect();
        let open_curves: Vec<Shape> =
            curves.iter().filter(|c| !taken.contains(&c.axis())).cloned().collect();
        let (first, _) = losses.judge(&open_steps, &open_curves, None);
        let Some(best) = choose(&first) else { break };
        losses.scattered_as_left_by(best);
        let (judged, chance) = losses.judge(&open_steps, &open_curves, Some(seed));
        let threshold = chance.threshold(LEVEL);
        if outcome.findings.is_empty() {
            outcome.detectable = detectable(&losses, &steps, threshold);
        }
        let Some(won) = choose(&judged).filter(|j| j.gain > threshold) else { break };
        if outcome.findings.first().is_some_and(|f| won.gain < LEAST_SHARE * f.gain) {
            break;
        }
        let more = losses.explained(won);
        explained.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(e, m)| *e += m);
        taken.push(won.shape.axis());
        let rivals = rivals(&judged);
        let p = chance.of_gain(won.gain);
        outcome.findings.push(finding(won, rivals, p, &losses, reach, camera));
    }
    outcome
}

/// The best step, unless the best curve leaves it behind.
fn choose(judged: &[Judged]) -> Option<&Judged> {
    let best = |named: bool| judged.iter().find(|j| j.shape.family().is_some() == named);
    let (step, curve) = (best(true), best(false));
    let enough = curve.map_or(0.0, |c| ADEQUATE * c.gain);
    step.filter(|s| s.gain > enough).or(curve)
}

fn rivals(judged: &[Judged]) -> Vec<(&'static str, f64)> {
    let mut all: Vec<(&'static str, f64)> = Vec::new();
    for j in judged {
        let name = j.shape.family().unwrap_or(j.shape.axis().id());
        if all.iter().all(|r| r.0 != name) {
            all.push((name, j.gain));
        }
    }
    all
}

fn detectable(
    losses: &Losses<'_>,
    steps: &[Step],
    threshold: f64,
) -> Vec<(&'static str, &'static str, f64)> {
    let name = |s: Step| match (s.axis, s.width > 0.0) {
        (Axis::Theta, _) => (s.family(), "theta50_deg", s.middle.to_degrees()),
        (_, true) => (s.family(), "z50_m", s.middle),
        (_, false) => (s.family(), "z50_m, near side", s.middle),
    };
    losses.detectable(steps, threshold).into_iter().map(name).collect()
}

fn finding(
    won: &Judged,
    rivals: Vec<(&'static str, f64)>,
    p: f64,
    losses: &Losses<'_>,
    reach: &Reach,
    camera: &Camera,
) -> MissingFinding {
    let asked: f64 = losses.views.iter().flatten().map(|c| c.asked).sum();
    let mut finding = MissingFinding {
        family: won.shape.family(),
        axis: won.shape.axis(),
        interval: [0.0; 2],
        parameters: Map::new(),
        p,
        rivals,
        gain: won.gain,
        size: 0.0,
        curve: Curve::default(),
    };
    match &won.shape {
        Shape::Step(step) => {
            let span = if step.axis == Axis::Theta { reach.theta } else { reach.z };
            let all = points(losses.views, &|c| step.at(&c.place), span);
            let own = Fitted { step: *step, base: losses.base, std_error: [None; 3] };
            let fitted = fit(*step, losses.base, &all).unwrap_or(own);
            finding.parameters = parameters(&fitted);
            finding.interval = interval(&fitted, span);
            let extra = |x: f64| fitted.step.loss(x, losses.base) - losses.base;
            finding.size = all.iter().map(|p| p.asked * extra(p.x)).sum::<f64>() / asked;
            finding.curve =
                binned(&all, won.shape.axis(), span, |x| fitted.step.loss(x, losses.base));
        }
        Shape::Curve(axis, basis) => {
            let (span, at) = along(*axis, basis, reach, camera);
            let all = points(losses.views, &at, span);
            let rise = |p: &Point| (p.share - losses.base).max(0.0) * p.asked;
            finding.size = all.iter().map(rise).sum::<f64>() / asked;
            finding.curve = binned(&all, *axis, span, |_| f64::NAN);
            let lost = &finding.curve.y;
            let most = lost.iter().copied().fold(0.0, f64::max);
            finding.curve.model = lost.clone();
            let high = (0..lost.len()).filter(|&k| lost[k] - losses.base > 0.5 * (most - losses.base));
            finding.interval = crate::stats::range(high.map(|k| finding.curve.x[k]));
        }
    }
    finding
}

fn along(
    axis: Axis,
    basis: &Basis,
    reach: &Reach,
    camera: &Camera,
) -> ([f64; 2], Box<dyn Fn(&Cell) -> f64>) {
    if let Basis::Curve { over, low, high, .. } = basis {
        let over = *over;
        return ([*low, *high], Box::new(move |c| over.value(&c.place)));
    }
    let _ = (axis, reach);
    ([0.0, camera.width as f64], Box::new(|c| c.place.u))
}

fn estimate(value: f64, std_error: Option<f64>) -> Value {
    json!({"value": value, "std_error": std_error})
}

fn parameters(fitted: &Fitted) -> Map<String, Value> {
    let Fitted { step, std_error: [middle, width, share], .. } = fitted;
    let (unit, names) = match step.axis {
        Axis::Theta => (1f64.to_degrees(), ["theta50_deg", "width_deg"]),
        _ => (1.0, ["z50_m", "width_m"]),
    };
    let mut all = Map::new();
    all.insert(names[0].into(), estimate(unit * step.middle, middle.map(|e| unit * e)));
    all.insert(names[1].into(), estimate(unit * step.width, width.map(|e| unit * e)));
    if share.is_some() {
        all.insert("share".into(), estimate(step.share, *share));
    }
    all
}

/// From where the loss matters to the end of the axis.
fn interval(fitted: &Fitted, [low, high]: [f64; 2]) -> [f64; 2] {
    let Step { middle, width, share, axis } = fitted.step;
    let from = middle + width * (MATTERS / (share - MATTERS).max(MATTERS)).ln();
    match (width > 0.0, axis) {
        (true, Axis::Theta) => [from, std::f64::consts::FRAC_PI_2],
        (true, _) => [from.min(high), high.max(from)],
        (false, _) => [0.0, from.max(low)],
    }
}

/// Lost shares bin by bin; the views are the sample.
fn binned(points: &[Point], axis: Axis, [low, high]: [f64; 2], model: impl Fn(f64) -> f64) -> Curve {
    const BINS: usize = 20;
    let width = ((high - low) / BINS as f64).max(f64::MIN_POSITIVE);
    let mut curve = Curve {
        x_label: format!("{axis}, {}", axis.unit()),
        y_label: "share of the pixel-frames without a measurement".into(),
        ..Curve::default()
    };
    for bin in 0..BINS {
        let inside = |p: &&Point| (((p.x - low) / width).max(0.0) as usize).min(BINS - 1) == bin;
        let members: Vec<&Point> = points.iter().filter(inside).collect();
        let asked: f64 = members.iter().map(|p| p.asked).sum();
        if asked <= 0.0 {
            continue;
        }
        let mean = |of: &dyn Fn(&Point) -> f64| {
            members.iter().map(|p| p.asked * of(p)).sum::<f64>() / asked
        };
        let (x, y) = (mean(&|p| p.x), mean(&|p| p.share));
        let scatter: f64 = members.iter().map(|p| (p.asked * (p.share - y)).powi(2)).sum();
        curve.x.push(x);
        curve.y.push(y);
        curve.y_std_error.push((scatter / asked.powi(2)).max(y * (1.0 - y) / asked).sqrt());
        curve.model.push(model(x));
    }
    curve
}

fn shadow_finding(band: Band, fields: &[Field]) -> MissingFinding {
    let name = if band.lawful { "occlusion-shadow" } else { Axis::EdgeDistance.id() };
    let mut parameters = Map::new();
    if band.lawful {
        parameters.insert("share".into(), estimate(band.share[0], Some(band.share[1])));
    }
    parameters.insert("side".into(), json!(if band.left { "left" } else { "right" }));
    let (mut lost, mut asked) = (0.0, 0.0);
    for f in fields {
        let side = if band.left { f.shadow.left } else { f.shadow.right };
        lost += side.map_or(0.0, |s| s.width_px * s.rows as f64);
        asked += f.pixels.len() as f64;
    }
    MissingFinding {
        family: band.lawful.then_some(name),
        axis: Axis::EdgeDistance,
        interval: [0.0, band.curve.y.iter().copied().fold(0.0, f64::max)],
        parameters,
        p: band.p,
        rivals: vec![("occlusion-shadow", band.gain[0]), ("edge-distance", band.gain[1])],
        gain: band.gain[usize::from(!band.lawful)],
        size: lost / (asked + lost).max(1.0),
        curve: band.curve,
    }
}

#[cfg(test)]
#[path = "missing_tests.rs"]
mod tests;
