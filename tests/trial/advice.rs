//! The second round: the view that a diagnosis advised is taken, and all is diagnosed again.
//!
//! Which sets come into it follows from the verdicts alone, by a rule that anybody can apply to them
//! again; their hashes are published before the view is taken. What is taken is hashed before the
//! second diagnosis, whose verdicts are hashed before the answers are opened.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::judge::{AdviceMarks, AdviceScores};
use super::verdict::Verdict;
use crate::raytraced::question::{Pose, World};

pub const ADVICE_FORMAT: &str = "kinoise-advice/1";
/// Hashes of what is taken in the second round.
pub const ADVICE_FILE: &str = "advice.json";
/// Of what is said of it; answers `advice.json` as `verdicts.json` does `seal.json`.
pub const ADVISED_VERDICTS_FILE: &str = "verdicts-advised.json";
/// Complete diagnoses of the second round, by the name of the set.
pub const ADVISED_DIAGNOSES: &str = "diagnoses-advised";

/// Sets of a second round at most.
const MOST: usize = 40;

/// `advice.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    pub format: String,
    /// Of `verdicts.json`, which holds the advice.
    pub verdicts_sha256: String,
    pub sets: Vec<AdvisedSet>,
}

/// A set with the view that was advised.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AdvisedSet {
    pub name: String,
    pub advised: Pose,
    /// As near to it as the stage permits.
    pub taken: Pose,
    /// Of what the solver gets.
    pub data_sha256: String,
}

/// The second round in `proof.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SecondRound {
    /// Of `advice.json` and `verdicts-advised.json` as they were written.
    pub advice_sha256: String,
    pub verdicts_sha256: String,
    pub advice: Advice,
    /// One for each set of the advice.
    pub sets: Vec<Rediagnosed>,
    pub scores: AdviceScores,
}

/// What is said of a set with the advised view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rediagnosed {
    pub name: String,
    pub verdict: Option<Value>,
    pub failure: Option<String>,
    pub diagnosis_sha256: Option<String>,
    pub verdict_sha256: Option<String>,
    pub marks: AdviceMarks,
    /// Depends on the machine.
    pub seconds: f64,
}

/// Which sets, by their number, are shot again, and from where: the first forty, in the order of the
/// trial, whose diagnosis advises a view; but of a session that a real sensor has long ended.
pub fn asked_for<'a>(sets: impl Iterator<Item = (World, Option<&'a Value>)>) -> Vec<(usize, Pose)> {
    let all = sets.enumerate().filter(|(_, (world, _))| *world != World::Real);
    all.filter_map(|(i, (_, verdict))| Some((i, advised(verdict?)?))).take(MOST).collect()
}

/// By the first finding that is not sure of its name.
fn advised(verdict: &Value) -> Option<Pose> {
    let verdict: Verdict = serde_json::from_value(verdict.clone()).ok()?;
    let next = verdict.in_doubt()?.next_view.clone()?;
    let pose: Pose = serde_json::from_value(next).ok()?;
    [pose.z_m, pose.theta_rad, pose.azimuth_rad].iter().all(|x| x.is_finite()).then_some(pose)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn verdict(view: &Value) -> Value {
        let one = |status: &str, view: &Value| {
            json!({"status": status, "effect": "vignetting", "statistic": "variance",
                "axis": "radius", "interval": [0, 1], "next_view": view})
        };
        json!({"verdict": "mismatch",
            "findings": [one("named", &Value::Null), one("one-of", view)]})
    }

    #[test]
    fn the_first_forty_in_the_order_of_the_trial_that_ask_for_a_view() {
        let view = json!({"z_m": 1.5, "theta_rad": 0.5, "azimuth_rad": 0.0, "why": "so"});
        let (asks, silent) = (verdict(&view), verdict(&Value::Null));
        let sets: Vec<(World, Option<&Value>)> = (0..100)
            .map(|i| match i % 5 {
                0 => (World::Real, Some(&asks)),
                1 => (World::Rays, Some(&silent)),
                2 => (World::Light, None),
                _ => (World::Rays, Some(&asks)),
            })
            .collect();
        let found = asked_for(sets.iter().copied());
        let all: Vec<usize> = (0..100).filter(|i| i % 5 > 2).collect();
        assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), all[..40].to_vec());
        assert!(found.iter().all(|f| f.1.z_m == 1.5));
        let broken = verdict(&json!({"z_m": 1.5}));
        assert!(asked_for([(World::Rays, Some(&broken))].into_iter()).is_empty());
    }
}
