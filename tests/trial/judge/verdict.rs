//! A diagnosis as the judge reads it.

use kinoise::error::{Error, Result};
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::raytraced::question::{Hidden, Pose};

#[derive(Debug, Clone, Default, Deserialize)]
pub struct Verdict {
    pub verdict: String,
    #[serde(default)]
    pub findings: Vec<Finding>,
    pub after: Option<After>,
    #[serde(default)]
    pub cannot_tell: Vec<CannotTell>,
}

#[derive(Debug, Clone, Default, Deserialize)]
pub struct Finding {
    pub status: String,
    pub effect: Option<String>,
    #[serde(default)]
    pub alternatives: Vec<Alternative>,
    pub statistic: String,
    pub axis: String,
    pub interval: [Option<f64>; 2],
    #[serde(default)]
    pub parameters: Map<String, Value>,
    pub next_view: Option<Pose>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct Alternative {
    pub effect: String,
    pub probability: Option<f64>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct After {
    pub verdict: String,
}

#[derive(Debug, Clone, Deserialize)]
pub struct CannotTell {
    pub effect: String,
}

/// A name counts as certain from this probability on.
pub const CERTAIN: f64 = 0.9;

impl Finding {
    /// Whether it says that something is there.
    pub fn claims(&self) -> bool {
        self.status != "not-identifiable"
    }

    /// The name it gives, if any.
    pub fn name(&self) -> Option<&str> {
        let names = ["named", "one-of"].contains(&self.status.as_str());
        let best = || self.alternatives.first().map(|a| a.effect.as_str());
        self.effect.as_deref().or_else(best).filter(|_| names)
    }

    /// Probability of a name, 0 where it is not offered.
    pub fn probability(&self, id: &str) -> f64 {
        let offered = self.alternatives.iter().find(|a| a.effect == id);
        offered.and_then(|a| a.probability).unwrap_or(0.0)
    }

    /// The name, where its probability is stated as 0.9 or more.
    pub fn certain_name(&self) -> Option<&str> {
        let sure = self.alternatives.first().and_then(|a| a.probability)? >= CERTAIN;
        self.name().filter(|_| sure)
    }

    /// Whether it is on the label's axis, or on one on which the cause shows as well.
    pub fn right_axis(&self, hidden: &Hidden) -> bool {
        // Words for one axis: disparity is focal length times baseline over distance.
        let depth = |axis: &str| ["z", "disparity", "range"].contains(&axis);
        let same = |axis: &String| self.axis == *axis || depth(&self.axis) && depth(axis);
        same(&hidden.axis) || hidden.also.iter().any(same)
    }

    /// Whether statistic and axis are right, whatever the name.
    pub fn right_place(&self, hidden: &Hidden) -> bool {
        self.statistic == hidden.statistic && self.right_axis(hidden)
    }

    /// Intersection over union of both intervals; `None` where there is nothing to compare.
    pub fn overlap(&self, hidden: &Hidden) -> Option<f64> {
        let truth = hidden.interval.filter(|_| self.axis == hidden.axis)?;
        let [Some(low), Some(high)] = self.interval else { return None };
        let shared = high.min(truth[1]) - low.max(truth[0]);
        let either = high.max(truth[1]) - low.min(truth[0]);
        (either > 0.0).then(|| shared.max(0.0) / either)
    }
}

impl Verdict {
    pub fn read(verdict: &Value) -> Result<Self> {
        Verdict::deserialize(verdict).map_err(|e| Error::Argument {
            what: format!("a verdict cannot be read: {e}"),
            remedy: "it must be a diagnosis.json without its curves",
        })
    }

    pub fn claims(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| f.claims())
    }

    /// Whether it is a mismatch with a finding: what a user would act upon.
    pub fn finds_something(&self) -> bool {
        self.verdict == "mismatch" && self.claims().next().is_some()
    }

    /// The first finding that asks for another view.
    pub fn in_doubt(&self) -> Option<&Finding> {
        self.claims().find(|f| f.next_view.is_some())
    }
}

/// The view asked for by the first finding in doubt.
pub fn advised_view(verdict: &Value) -> Option<Pose> {
    Verdict::read(verdict).ok()?.in_doubt()?.next_view
}
