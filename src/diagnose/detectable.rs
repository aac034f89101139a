//! How small an effect this recording could have shown.

use serde_json::{Map, Value, json};

use super::diagnosis::Detectable;
use super::layers::Survey;
use super::search::{Outcome, ViewData, coarser, evidence_of};
use crate::camera::Camera;
use crate::effects::{self, Smallest};
use crate::terms::{Statistic, Term};

/// Nats beyond the threshold that eight recordings in ten would bring.
const MARGIN: f64 = 4.0;

/// The least parameter of each family that would be found with 80 % power.
pub fn detectable(
    survey: &Survey,
    bias: &Outcome,
    variance: &Outcome,
    camera: &Camera,
) -> Vec<Detectable> {
    let bounds = survey.bounds(camera);
    let mean: Vec<ViewData> = survey.mean_data().iter().map(coarser).collect();
    let blocks = survey.variance_data();
    let layers = [(Statistic::Bias, &mean, bias), (Statistic::Variance, &blocks, variance)];
    let mut all = Vec::new();
    for (statistic, data, outcome) in layers {
        for effect in effects::that_change(statistic) {
            let smallest =
                effect.smallest(&bounds).and_then(|s| least(s, statistic, data, outcome));
            all.extend(smallest.map(|minimum| Detectable { effect: effect.card().id, minimum }));
        }
    }
    all
}

fn least(
    smallest: Smallest,
    statistic: Statistic,
    data: &[ViewData],
    outcome: &Outcome,
) -> Option<Map<String, Value>> {
    let Smallest { parameter, shape, unit, of } = smallest;
    let term = Term { statistic, basis: shape, coefficients: unit.clone() };
    let unit = nalgebra::DVector::from_vec(unit);
    let information: f64 =
        evidence_of(data, &[term]).iter().map(|e| unit.dot(&(&e.a * &unit))).sum();
    let need = outcome.noise.threshold(0.01) + MARGIN;
    let least = of((2.0 * need / information).sqrt());
    let found = least.is_finite() && information > 0.0;
    found.then(|| Map::from_iter([(parameter.to_string(), json!(least))]))
}
