//! How small an effect this recording could have shown.

use serde_json::{Map, Value, json};

use super::case::Case;
use super::diagnosis::Detectable;
use super::engine::DiagnoseOptions;
use super::layers::Survey;
use super::outcome::Outcome;
use super::power::Gates;
use super::scene::Scene;
use crate::camera::Camera;
use crate::effects::{self, Smallest};
use crate::terms::{Statistic, Term};

/// The least parameter of each family that would be found with 80 % power.
pub fn detectable(
    survey: &Survey,
    bias: &Outcome,
    variance: &Outcome,
    camera: &Camera,
    options: &DiagnoseOptions,
) -> Vec<Detectable> {
    let (level, seed) = (options.level, options.seed);
    let scenes = [Scene::bias(survey, 1.0, 1.0), Scene::variance(survey, 1.0, 1.0)];
    let mean = Gates {
        scene: &scenes[0],
        outcome: bias,
        rules: survey.bias_rules(camera, Case::MEAN_LEVEL * level),
        beside: None,
        seed,
    };
    let blocks = Gates {
        scene: &scenes[1],
        outcome: variance,
        rules: survey.variance_rules(Case::VARIANCE_LEVEL * level),
        beside: survey.refitted().map(|c| c.basis),
        seed,
    };
    let bounds = survey.bounds(camera);
    let mut all = Vec::new();
    for (statistic, gates) in [(Statistic::Bias, &mean), (Statistic::Variance, &blocks)] {
        let can = effects::that_change(statistic).into_iter();
        for effect in can.filter(|e| e.card().applies_to(bounds.kind)) {
            let smallest = effect.smallest(&bounds).and_then(|s| least(s, statistic, gates));
            all.extend(smallest.map(|minimum| Detectable { effect: effect.card().id, minimum }));
        }
    }
    all
}

fn least(
    smallest: Smallest,
    statistic: Statistic,
    gates: &Gates<'_>,
) -> Option<Map<String, Value>> {
    let Smallest { parameter, shape, unit, of } = smallest;
    let term = Term { statistic, basis: shape, coefficients: unit };
    let least = gates.least(&term).map(of).filter(|least| least.is_finite())?;
    Some(Map::from_iter([(parameter.to_string(), json!(least))]))
}
