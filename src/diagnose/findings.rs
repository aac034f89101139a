//! From what the searches chose to what is told.

use serde_json::Map;

use super::candidate::RECALIBRATE;
use super::diagnosis::{Alternative, Curve, Finding, MapRow, Size, Status};
use super::layers::Survey;
use super::missing::DropoutFinding;
use super::noise::Hanging;
use super::parameters::{of_any_formula, parameters};
use super::search::{Chosen, Outcome, ViewData, coarser};
use super::shape;
use crate::effects;
use crate::model::Covariance;
use crate::stats::range;
use crate::terms::{Axis, Basis, Modulation, PixelContext, Statistic, Term};

/// The data a layer's findings are measured on.
pub struct Scene<'a> {
    pub statistic: Statistic,
    pub survey: &'a Survey,
    pub data: Vec<ViewData>,
    /// Depth error in mm of one px of disparity, at a place.
    pub scale_px_m: f64,
    pub corner_px: f64,
}

impl<'a> Scene<'a> {
    pub fn bias(survey: &'a Survey, scale_px_m: f64, corner_px: f64) -> Self {
        let data = survey.mean_data().iter().map(coarser).collect();
        Scene { statistic: Statistic::Bias, survey, data, scale_px_m, corner_px }
    }

    pub fn variance(survey: &'a Survey, scale_px_m: f64, corner_px: f64) -> Self {
        let data = survey.variance_data();
        Scene { statistic: Statistic::Variance, survey, data, scale_px_m, corner_px }
    }

    /// A term's values, what the views' own nuisances take taken out.
    fn values(&self, term: &Term) -> Vec<Vec<f64>> {
        let mut row = Vec::new();
        self.data
            .iter()
            .map(|view| {
                let mut values: Vec<f64> =
                    view.places.iter().map(|p| term.value(p, &mut row)).collect();
                if self.statistic == Statistic::Bias {
                    level(view, &mut values);
                }
                values
            })
            .collect()
    }

    fn responses(&self) -> Vec<Vec<f64>> {
        let of = |view: &ViewData| {
            let mut values = view.response.clone();
            if self.statistic == Statistic::Bias {
                level(view, &mut values);
            }
            values
        };
        self.data.iter().map(of).collect()
    }
}

/// Take the weighted fit of the view's nuisances out of `values`.
fn level(view: &ViewData, values: &mut [f64]) {
    let p = view.precision.len();
    let mut a = nalgebra::DMatrix::<f64>::zeros(p, p);
    let mut b = nalgebra::DVector::<f64>::zeros(p);
    for ((row, w), y) in view.nuisance.chunks_exact(p).zip(&view.weight).zip(values.iter()) {
        for q in 0..p {
            b[q] += w * row[q] * y;
            for r in 0..p {
                a[(q, r)] += w * row[q] * row[r];
            }
        }
    }
    let Some(fit) = a.lu().solve(&b) else { return };
    for (row, y) in view.nuisance.chunks_exact(p).zip(values) {
        *y -= row.iter().zip(fit.iter()).map(|(x, c)| x * c).sum::<f64>();
    }
}

/// All terms of a layer as findings. Terms of one family are one finding, and a nameless curve on
/// the axis of a name is that name's shape, met better.
pub fn findings(scene: &Scene<'_>, outcome: &Outcome) -> Vec<Finding> {
    let terms: Vec<Term> = (0..outcome.chosen.len())
        .map(|k| Term {
            statistic: scene.statistic,
            basis: outcome.chosen[k].candidate.basis.clone(),
            coefficients: outcome.coefficients(k),
        })
        .collect();
    let values: Vec<Vec<Vec<f64>>> = terms.iter().map(|t| scene.values(t)).collect();
    let responses = scene.responses();
    // Groups: who goes with whom.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (k, c) in outcome.chosen.iter().enumerate() {
        let axis = c.candidate.basis.axis();
        // What planes absorb of a term goes with it.
        if let (Basis::Affine { .. }, Some(home)) =
            (&c.candidate.basis, groups.iter_mut().find(|g| g.contains(&k.wrapping_sub(1))))
        {
            home.push(k);
            continue;
        }
        let is_map = matches!(c.candidate.basis, Basis::Spline { .. });
        let home = groups.iter().position(|g| {
            let first = &outcome.chosen[g[0]];
            match c.candidate.family {
                // The smooth rest of a radial cause.
                None if is_map && first.candidate.family.is_some() => {
                    first.candidate.basis.axis() == Axis::Radius
                }
                Some(family) => {
                    // A curve came first, but this name had explained half of it.
                    let nearly = first.candidate.family.is_none()
                        && first.candidate.basis.axis() == axis
                        && first
                            .rivals
                            .iter()
                            .any(|r| r.family == family && r.gain > NEARLY * first.gain);
                    first.candidate.family == c.candidate.family || nearly
                }
                None => first.candidate.basis.axis() == axis,
            }
        });
        match home {
            Some(g) if c.candidate.family.is_some() => groups[g].insert(0, k),
            Some(g) => groups[g].push(k),
            None => groups.push(vec![k]),
        }
    }
    groups.iter().map(|group| finding(scene, outcome, group, &terms, &values, &responses)).collect()
}

/// A name found after a curve on its axis stands for both if it had explained this share of it.
const NEARLY: f64 = 0.4;

fn finding(
    scene: &Scene<'_>,
    outcome: &Outcome,
    group: &[usize],
    terms: &[Term],
    values: &[Vec<Vec<f64>>],
    responses: &[Vec<f64>],
) -> Finding {
    let main = group[0];
    let chosen = &outcome.chosen[main];
    let axis = chosen.candidate.basis.axis();
    let mine: Vec<Vec<f64>> = sum(group.iter().map(|&k| &values[k]));
    let others: Vec<usize> = (0..terms.len()).filter(|k| !group.contains(k)).collect();
    let rest: Vec<Vec<f64>> = sum(others.iter().map(|&k| &values[k]));
    let left: Vec<Vec<f64>> = responses
        .iter()
        .enumerate()
        .map(|(v, y)| {
            y.iter().enumerate().map(|(i, y)| y - rest.get(v).map_or(0.0, |r| r[i])).collect()
        })
        .collect();
    let along = Along::of(scene, &chosen.candidate.basis);
    let (status, effect, alternatives) = naming(chosen);
    let covariance = outcome.fit.as_ref().map(|f| {
        let span = outcome.span(main);
        f.covariance.view((span.start, span.start), (span.len(), span.len())).into_owned()
    });
    let parameters = covariance.map_or_else(Map::new, |c| {
        let Term { basis, coefficients, .. } = &terms[main];
        of_any_formula(basis, parameters(basis, coefficients, &c, &scene.survey.reach))
    });
    let shape =
        effect.is_none().then(|| shape::words(&terms[main].basis, &terms[main].coefficients));
    let physics = physics(status, effect, scene.statistic, axis, shape.as_deref());
    let mut finding = Finding {
        status,
        effect,
        alternatives,
        statistic: scene.statistic,
        axis,
        interval: along.interval(scene, &mine),
        unit: axis.unit(),
        share: 0.0,
        parameters,
        size: size(scene, &mine),
        p_adjusted: chosen.p,
        physics,
        next_view: None,
        shape,
        curve: Some(along.curve(scene, &left, &mine)),
        terms: group.iter().map(|&k| terms[k].clone()).collect(),
        covariance: covariance_of(outcome, group),
    };
    // Nats for now; the engine turns them into shares.
    finding.share = group.iter().map(|&k| outcome.chosen[k].gain).sum();
    finding
}

/// Of the terms of a group.
fn covariance_of(outcome: &Outcome, group: &[usize]) -> Covariance {
    let Covariance { fit, factors, variances } = &outcome.covariance;
    let of = |f: &Vec<f64>| -> Vec<f64> {
        group.iter().filter_map(|&k| f.get(outcome.span(k))).flatten().copied().collect()
    };
    Covariance { fit: *fit, factors: factors.iter().map(of).collect(), variances: of(variances) }
}

fn sum<'a>(layers: impl Iterator<Item = &'a Vec<Vec<f64>>>) -> Vec<Vec<f64>> {
    let mut total: Vec<Vec<f64>> = Vec::new();
    for layer in layers {
        if total.is_empty() {
            total = layer.clone();
        } else {
            for (t, l) in total.iter_mut().zip(layer) {
                t.iter_mut().zip(l).for_each(|(t, l)| *t += l);
            }
        }
    }
    total
}

/// Odds of a family that needs more columns to say the same: it can bend to what it is not.
const RICHER: f64 = 0.35;

/// Which names, and how sure.
pub fn naming(chosen: &Chosen) -> (Status, Option<&'static str>, Vec<Alternative>) {
    let Some(family) = chosen.candidate.family else {
        return (Status::Unexplained, None, Vec::new());
    };
    let adequacy = chosen.gain / chosen.best_curve.max(1e-9);
    let none = if chosen.best_curve > 0.0 {
        1.0 / (1.0 + ((adequacy - chosen.adequacy - 0.06) / 0.05).exp())
    } else {
        0.0
    };
    let best = chosen.rivals.iter().find(|r| r.family == family).map_or(chosen.gain, |r| r.gain);
    let mut odds: Vec<(&'static str, f64)> = vec![(family, 1.0)];
    for rival in chosen.rivals.iter().filter(|r| r.family != family) {
        let nats = (best - rival.gain).clamp(0.0, 40.0);
        let behind = rival.behind.clamp(-1.0, 6.0);
        let richer = rival.basis.count() > chosen.candidate.basis.count();
        let bent = if richer { RICHER } else { 1.0 };
        odds.push((rival.family, bent * (-(1.2 * behind + 0.25 * nats)).exp().min(1.0)));
    }
    let total: f64 = odds.iter().map(|o| o.1).sum();
    odds.sort_by(|a, b| b.1.total_cmp(&a.1));
    let alternatives: Vec<Alternative> = odds
        .iter()
        .filter(|o| o.0 != RECALIBRATE)
        .map(|&(effect, o)| Alternative { effect, probability: (1.0 - none) * o / total })
        .filter(|a| a.probability > 0.005)
        .take(5)
        .collect();
    if family == RECALIBRATE {
        return (Status::Recalibrate, None, alternatives);
    }
    let sure = alternatives.first().map_or(0.0, |a| a.probability);
    let status = if sure < 0.6 && alternatives.len() > 1 { Status::OneOf } else { Status::Named };
    (status, Some(family), alternatives)
}

fn size(scene: &Scene<'_>, values: &[Vec<f64>]) -> Size {
    let (mut mm, mut sigma, mut n) = (0.0, 0.0, 0.0);
    for (view, values) in scene.data.iter().zip(values) {
        for ((p, &f), &w) in view.places.iter().zip(values).zip(&view.weight) {
            if w <= 0.0 || !f.is_finite() {
                continue;
            }
            let px_mm = 1e3 * p.z * p.z / scene.scale_px_m;
            let (in_mm, in_sigma) = if scene.statistic == Statistic::Bias {
                (f * px_mm, f / p.variance.sqrt())
            } else {
                let factor = (0.5 * f).exp() - 1.0;
                (factor * p.variance.sqrt() * px_mm, factor)
            };
            mm += in_mm * in_mm;
            sigma += in_sigma * in_sigma;
            n += 1.0;
        }
    }
    let n = f64::max(n, 1.0);
    Size { mm: (mm / n).sqrt(), sigma: (sigma / n).sqrt() }
}

type OfPlace = Box<dyn Fn(&PixelContext) -> f64>;

/// The axis along which a term is shown.
struct Along {
    label: String,
    value: OfPlace,
}

impl Along {
    fn of(scene: &Scene<'_>, basis: &Basis) -> Self {
        let axis = basis.axis();
        let corner = scene.corner_px;
        let (label, value): (&str, OfPlace) = match axis {
            Axis::Z => ("depth, m", Box::new(|p| p.z)),
            Axis::DisparityPhase => {
                let period = match basis {
                    Basis::Locking { period_px, .. } => *period_px,
                    Basis::Ring { period, .. } => *period,
                    _ => 1.0,
                };
                (
                    "fraction of a pixel of disparity",
                    Box::new(move |p| (p.disparity / period).rem_euclid(1.0)),
                )
            }
            Axis::Column => ("column, px", Box::new(|p| p.u)),
            Axis::Row => ("row, px", Box::new(|p| p.v)),
            Axis::Radius | Axis::Pixel => {
                ("distance from the image centre, px", Box::new(move |p| p.radius * corner))
            }
            Axis::Theta => ("tilt, rad", Box::new(|p| p.theta)),
            Axis::Azimuth
                if matches!(basis, Basis::Curve { over: crate::terms::Coordinate::Along, .. }) =>
            {
                (
                    "from the optical axis along the tilt, ray",
                    Box::new(|p| crate::terms::Coordinate::Along.value(p)),
                )
            }
            Axis::Azimuth => ("direction of the tilt, rad", Box::new(|p| p.azimuth)),
            Axis::TargetPosition => match basis {
                Basis::Curve { over: crate::terms::Coordinate::Down, .. } => {
                    ("down on the board, m", Box::new(|p| p.down))
                }
                _ => ("right on the board, m", Box::new(|p| p.right)),
            },
            Axis::EdgeDistance => ("distance from the target's edge, px", Box::new(|p| p.edge)),
            Axis::Intensity => {
                ("infrared light of the surface, of the median", Box::new(|p| p.light))
            }
            Axis::SessionTime => ("time since the first view, s", Box::new(|p| p.session_s)),
            Axis::Temperature => ("temperature, degrees Celsius", Box::new(|p| p.temperature_c)),
            _ => ("", Box::new(|p| p.z)),
        };
        Along { label: label.into(), value }
    }

    /// Where nine tenths of the term's energy lie.
    fn interval(&self, scene: &Scene<'_>, values: &[Vec<f64>]) -> [f64; 2] {
        let mut energy: Vec<(f64, f64)> = Vec::new();
        for (view, values) in scene.data.iter().zip(values) {
            for ((p, f), w) in view.places.iter().zip(values).zip(&view.weight) {
                let e = w * f * f;
                if e.is_finite() && e > 0.0 {
                    energy.push(((self.value)(p), e));
                }
            }
        }
        energy.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = energy.iter().map(|e| e.1).sum();
        let at = |share: f64| {
            let mut sum = 0.0;
            let found = energy.iter().find(|e| {
                sum += e.1;
                sum >= share * total
            });
            found.or(energy.last()).map_or(0.0, |e| e.0)
        };
        [at(0.05), at(0.95)]
    }

    /// Binned: as measured without the other terms, and as fitted.
    fn curve(&self, scene: &Scene<'_>, left: &[Vec<f64>], mine: &[Vec<f64>]) -> Curve {
        const BINS: usize = 32;
        let [low, high] =
            range(scene.data.iter().flat_map(|v| v.places.iter().map(|p| (self.value)(p))));
        let bin = |p: &PixelContext| {
            let place = ((self.value)(p) - low) / (high - low).max(1e-12) * BINS as f64;
            (place as usize).min(BINS - 1)
        };
        let mut by_view = vec![[[0.0f64; 4]; BINS]; scene.data.len()];
        for (v, view) in scene.data.iter().enumerate() {
            for (i, p) in view.places.iter().enumerate() {
                let w = view.weight[i];
                if w > 0.0 {
                    let s = &mut by_view[v][bin(p)];
                    s[0] += w;
                    s[1] += w * left[v][i];
                    s[2] += w * mine[v][i];
                    s[3] += w * (self.value)(p);
                }
            }
        }
        let mut curve = Curve {
            x_label: self.label.clone(),
            y_label: if scene.statistic == Statistic::Bias {
                "disparity error, px".into()
            } else {
                "noise over the model's".into()
            },
            ..Curve::default()
        };
        let show = |y: f64| {
            if scene.statistic == Statistic::Bias { y } else { (0.5 * y).exp() }
        };
        for b in 0..BINS {
            let total: f64 = by_view.iter().map(|s| s[b][0]).sum();
            if total <= 0.0 {
                continue;
            }
            let mean = by_view.iter().map(|s| s[b][1]).sum::<f64>() / total;
            let model = by_view.iter().map(|s| s[b][2]).sum::<f64>() / total;
            let scatter: f64 = by_view.iter().map(|s| (s[b][1] - s[b][0] * mean).powi(2)).sum();
            let error = scatter.sqrt() / total;
            curve.x.push(by_view.iter().map(|s| s[b][3]).sum::<f64>() / total);
            curve.y.push(show(mean));
            curve.y_std_error.push(if scene.statistic == Statistic::Bias {
                error
            } else {
                0.5 * error * show(mean)
            });
            curve.model.push(show(model));
        }
        curve
    }
}

/// What was left out, why it looks so, what else it could be.
pub fn physics(
    status: Status,
    effect: Option<&'static str>,
    statistic: Statistic,
    axis: Axis,
    shape: Option<&str>,
) -> String {
    if status == Status::Recalibrate {
        return "Nothing of the physics is missing: the numbers of sigma(z, theta) themselves are off. Calibrate again, or take the factor given here.".into();
    }
    let Some(card) = effect.and_then(effects::find).map(|e| e.card()) else {
        let what = match statistic {
            Statistic::Bias => "the mean error",
            Statistic::Variance => "the size of the noise",
            Statistic::Distribution => "the distribution of the errors",
            Statistic::Correlation => "how errors hang together",
            Statistic::Dropout => "where measurements are missing",
        };
        let shape = shape.map_or(String::new(), |s| format!(": {s}"));
        return format!(
            "Unexplained: {what} depends on {axis}{shape}. No effect of the catalogue explains it; the extended model holds it as the curve that was measured."
        );
    };
    format!(
        "Left out: {}. It is told by {} along {}. It could be taken for {}.",
        card.summary, card.statistic, card.axis, card.confused_with
    )
}

/// A finding with this name and nothing else said yet.
pub fn named(effect: &'static str, probability: f64, statistic: Statistic, axis: Axis) -> Finding {
    Finding {
        status: Status::Named,
        effect: Some(effect),
        alternatives: vec![Alternative { effect, probability }],
        statistic,
        axis,
        interval: [0.0, 0.0],
        unit: axis.unit(),
        share: 0.0,
        parameters: Map::new(),
        size: Size::default(),
        p_adjusted: 1.0,
        physics: physics(Status::Named, Some(effect), statistic, axis, None),
        next_view: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
        covariance: Covariance::default(),
    }
}

/// A mismatch of structure as a finding; `sigma_mm` is the recording's typical sigma.
pub fn hanging(found: Hanging, sigma_mm: f64) -> Finding {
    let effect = found.families.first().copied();
    let status = match found.families.len() {
        0 => Status::Unexplained,
        1 => Status::Named,
        _ => Status::OneOf,
    };
    let n = found.families.len() as f64;
    let each = if n > 1.0 { 0.96 / n } else { 0.97 };
    Finding {
        status,
        effect,
        alternatives: found
            .families
            .iter()
            .map(|&effect| Alternative { effect, probability: each })
            .collect(),
        statistic: found.statistic,
        axis: found.axis,
        interval: found.interval,
        unit: found.axis.unit(),
        share: found.nats,
        parameters: found.parameters,
        size: Size { mm: found.size_sigma * sigma_mm, sigma: found.size_sigma },
        p_adjusted: found.p,
        physics: physics(status, effect, found.statistic, found.axis, found.words.as_deref()),
        next_view: None,
        shape: found.words,
        curve: None,
        terms: Vec::new(),
        covariance: Covariance::default(),
    }
}

/// Something lost as a finding.
pub fn missing(found: DropoutFinding) -> Finding {
    let status = if found.family.is_some() { Status::Named } else { Status::Unexplained };
    let best = found.rivals.first().map_or(found.gain, |r| r.1);
    let mut alternatives: Vec<Alternative> = Vec::new();
    if let Some(effect) = found.family {
        let known: Vec<(&'static str, f64)> = found
            .rivals
            .iter()
            .filter_map(|&(id, gain)| Some((effects::find(id)?.card().id, gain)))
            .filter(|r| r.0 != effect)
            .map(|(id, gain)| (id, (0.25 * (gain - best).clamp(-60.0, 0.0)).exp()))
            .collect();
        let total = 1.0 + known.iter().map(|k| k.1).sum::<f64>();
        alternatives.push(Alternative { effect, probability: 0.97 / total });
        alternatives.extend(
            known
                .iter()
                .map(|&(effect, odds)| Alternative { effect, probability: 0.97 * odds / total })
                .filter(|a| a.probability > 0.005),
        );
    }
    let shape = found
        .family
        .is_none()
        .then(|| format!("more is lost from {:.4} to {:.4}", found.interval[0], found.interval[1]));
    let words = physics(status, found.family, Statistic::Dropout, found.axis, shape.as_deref());
    Finding {
        status,
        effect: found.family,
        alternatives,
        statistic: Statistic::Dropout,
        axis: found.axis,
        interval: found.interval,
        unit: found.axis.unit(),
        share: found.gain,
        parameters: found.parameters,
        size: Size { mm: 0.0, sigma: found.size },
        p_adjusted: found.p,
        physics: words,
        next_view: None,
        shape,
        curve: Some(found.curve),
        terms: Vec::new(),
        covariance: Covariance::default(),
    }
}

/// Every nameless curve that saw something, on the data as they came.
pub fn map(scene: &Scene<'_>, outcome: &Outcome, level: f64) -> Vec<MapRow> {
    let mut rows: Vec<MapRow> = Vec::new();
    for look in outcome.looks.iter().filter(|l| l.p < level) {
        let axis = look.basis.axis();
        if matches!(look.basis, Basis::Ring { .. }) && axis == Axis::Z {
            // A ripple's period is not the axis's own curve.
            continue;
        }
        if matches!(look.basis, Basis::Curve { times: Modulation::DisparitySquared, .. }) {
            continue;
        }
        let term = Term {
            statistic: scene.statistic,
            basis: look.basis.clone(),
            coefficients: look.coefficients.clone(),
        };
        let values = scene.values(&term);
        let along = Along::of(scene, &look.basis);
        let row = MapRow {
            statistic: scene.statistic,
            axis,
            interval: along.interval(scene, &values),
            unit: axis.unit(),
            effect_size: size(scene, &values).sigma,
            p_adjusted: look.p,
        };
        match rows.iter_mut().find(|r| r.axis == axis) {
            Some(old) if old.effect_size >= row.effect_size => {}
            Some(old) => *old = row,
            None => rows.push(row),
        }
    }
    rows.sort_by(|a, b| b.effect_size.total_cmp(&a.effect_size));
    rows
}
