//! How small an effect this recording could have shown.

use serde_json::{Map, Value, json};

use super::case::Case;
use super::diagnosis::Detectable;
use super::outcome::Outcome;
use super::power::Gates;
use super::scene::Scene;
use crate::effects::{self, Smallest};
use crate::terms::{Statistic, Term};

impl Case<'_> {
    /// The least parameter of each family that would be found with 80 % power.
    pub(super) fn detectable(&self, [bias, variance]: [&Outcome; 2]) -> Vec<Detectable> {
        let (survey, camera) = (&self.survey, &self.sensor().camera);
        let seed = self.options.seed;
        let scenes = [Scene::bias(survey, 1.0, 1.0), Scene::variance(survey, 1.0, 1.0)];
        let mean = Gates {
            scene: &scenes[0],
            outcome: bias,
            rules: survey.bias_rules(camera, self.level(Case::MEAN_LEVEL)),
            beside: None,
            seed,
        };
        let blocks = Gates {
            scene: &scenes[1],
            outcome: variance,
            rules: survey.variance_rules(self.level(Case::VARIANCE_LEVEL)),
            beside: survey.refitted().map(|c| c.basis),
            seed,
        };
        let bounds = survey.bounds(camera);
        let mut all = Vec::new();
        for (statistic, gates) in [(Statistic::Bias, &mean), (Statistic::Variance, &blocks)] {
            let can = effects::that_change(statistic).into_iter();
            for effect in can.filter(|e| e.card().applies_to(bounds.kind)) {
                let smallest = effect.smallest(&bounds).and_then(|s| least(s, statistic, gates));
                all.extend(
                    smallest.map(|minimum| Detectable { effect: effect.card().id, minimum }),
                );
            }
        }
        all
    }
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
