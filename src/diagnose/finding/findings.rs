//! Turns the terms that the searches chose into findings.

use rayon::prelude::*;
use serde_json::Map;

use super::along::Along;
use super::naming::{naming, physics};
use super::other_findings::named;
use super::parameters::parameters;
use super::pixels::terms_of;
use super::scene::{Scene, size};
use super::shape;
use crate::diagnose::diagnosis::{Finding, MapRow};
use crate::diagnose::joint::terms::is_smooth_and_nameless;
use crate::diagnose::search::outcome::{Chosen, Look, Outcome};
use crate::effects::Fitted;
use crate::model::Covariance;
use crate::terms::{Axis, Basis, Modulation, Term};

/// Returns all terms of a layer as findings. Terms of one family form one finding; a nameless curve on the
/// axis of a name refines that name's shape.
pub fn findings(scene: &Scene<'_>, outcome: &Outcome) -> Vec<Finding> {
    let terms = terms_of(outcome, scene.statistic);
    // Terms that form one finding.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (k, c) in outcome.chosen.iter().enumerate() {
        let axis = c.candidate.basis.axis();
        // The part of a term that planes absorb goes with it.
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
                // The smooth remainder of a radial cause.
                None if is_map && first.candidate.family.is_some() => {
                    first.candidate.basis.axis() == Axis::Radius
                }
                Some(family) => {
                    // A curve came first, but this name had explained enough of it.
                    let nearly = first.candidate.family.is_none()
                        && first.candidate.basis.axis() == axis
                        && first
                            .rivals
                            .iter()
                            .any(|r| r.family == family && r.gain > NEARLY * first.gain);
                    first.candidate.family == c.candidate.family || nearly
                }
                // Smooth curves over the picture overlap.
                None => {
                    let smooth = |c: &Chosen| is_smooth_and_nameless(&c.candidate);
                    first.candidate.basis.axis() == axis || smooth(c) && smooth(first)
                }
            }
        });
        match home {
            Some(g) if c.candidate.family.is_some() => groups[g].insert(0, k),
            Some(g) => groups[g].push(k),
            None => groups.push(vec![k]),
        }
    }
    // A nameless shape that differs between the halves of the views is scatter.
    let scattered = |group: &Vec<usize>| {
        let nameless = group.iter().all(|&k| outcome.chosen[k].candidate.family.is_none());
        nameless && outcome.halves.as_ref().is_some_and(|h| h.contradict(group))
    };
    let told = groups.iter().filter(|group| !scattered(group));
    told.map(|group| finding(scene, outcome, group, &terms)).collect()
}

/// A name found after a curve on its axis stands for both if it had explained this share of the curve.
const NEARLY: f64 = 0.4;

fn finding(scene: &Scene<'_>, outcome: &Outcome, group: &[usize], terms: &[Term]) -> Finding {
    let main = group[0];
    let chosen = &outcome.chosen[main];
    let axis = chosen.candidate.basis.axis();
    let own: Vec<Term> = group.iter().map(|&k| terms[k].clone()).collect();
    let others = (0..terms.len()).filter(|k| !group.contains(k));
    let others: Vec<Term> = others.map(|k| terms[k].clone()).collect();
    let (mine, left) = (scene.values(&own), scene.without(&others));
    let along = Along::of(scene, &chosen.candidate.basis);
    let (status, effect, alternatives) = naming(chosen);
    let covariance = outcome.fit.as_ref().map(|f| {
        let span = outcome.span(main);
        f.covariance.view((span.start, span.start), (span.len(), span.len())).into_owned()
    });
    let formula_error = chosen.candidate.formula_error();
    let parameters = covariance.map_or_else(Map::new, |c| {
        let Term { basis, coefficients, .. } = &terms[main];
        let (covariance, reach) = (&c, &scene.survey.reach);
        let fit = Fitted { shape: basis, coefficients, covariance, reach };
        parameters(chosen.candidate.family, formula_error, &fit)
    });
    let shape =
        effect.is_none().then(|| shape::words(&terms[main].basis, &terms[main].coefficients));
    let physics = physics(status, effect, scene.statistic, axis, shape.as_deref());
    Finding {
        status,
        effect,
        alternatives,
        interval: along.interval(scene, &mine),
        unit: along.unit,
        // Nats for now; `verdict::shares` turns them into shares.
        share: group.iter().map(|&k| outcome.chosen[k].gain).sum(),
        parameters,
        size: size(scene, &mine),
        p_adjusted: Some(chosen.p),
        replicated: outcome.halves.as_ref().and_then(|h| match chosen.candidate.family {
            Some(_) => h.replicate(group, formula_error),
            None => h.replicate_beside(group),
        }),
        physics,
        shape,
        curve: Some(along.curve(scene, &left, &mine)),
        terms: own,
        covariance: covariance_of(outcome, group),
        ..named(effect.unwrap_or_default(), scene.statistic, axis)
    }
}

/// Covariance of the terms of a group.
fn covariance_of(outcome: &Outcome, group: &[usize]) -> Covariance {
    let Covariance { fit, factors, variances } = &outcome.covariance;
    let of = |f: &Vec<f64>| -> Vec<f64> {
        group.iter().filter_map(|&k| f.get(outcome.span(k))).flatten().copied().collect()
    };
    Covariance { fit: *fit, factors: factors.iter().map(of).collect(), variances: of(variances) }
}

/// Fills in the size and the interval, in these views, of a finding with one term.
pub fn placed(finding: Finding, scene: &Scene<'_>) -> Finding {
    let Some(term) = finding.terms.first() else { return finding };
    let values = scene.values(std::slice::from_ref(term));
    let interval = Along::of(scene, &term.basis).interval(scene, &values);
    Finding { interval, size: size(scene, &values), ..finding }
}

/// Nameless curves significant at `level` before anything is explained: the largest of each axis.
pub fn map(scene: &Scene<'_>, outcome: &Outcome, level: f64) -> Vec<MapRow> {
    let of_axis = |basis: &Basis| match basis {
        // A ripple's period is not the axis's own curve.
        Basis::Ring { .. } => basis.axis() != Axis::Z,
        Basis::Curve { times, .. } => *times != Modulation::DisparitySquared,
        _ => true,
    };
    let of_look = |look: &Look| {
        let axis = look.basis.axis();
        let term = Term {
            statistic: scene.statistic,
            basis: look.basis.clone(),
            coefficients: look.coefficients.clone(),
        };
        let values = scene.values(std::slice::from_ref(&term));
        let along = Along::of(scene, &look.basis);
        MapRow {
            statistic: scene.statistic,
            axis,
            interval: along.interval(scene, &values),
            unit: along.unit,
            effect_size: size(scene, &values).sigma,
            p_adjusted: look.p,
        }
    };
    let looks = outcome.looks.par_iter().filter(|l| l.p < level && of_axis(&l.basis));
    let mut rows: Vec<MapRow> = Vec::new();
    for row in looks.map(of_look).collect::<Vec<_>>() {
        match rows.iter_mut().find(|r| r.axis == row.axis) {
            Some(old) if old.effect_size >= row.effect_size => {}
            Some(old) => *old = row,
            None => rows.push(row),
        }
    }
    rows.sort_by(|a, b| b.effect_size.total_cmp(&a.effect_size));
    rows
}
