//! What is kept of a diagnosis: the answer without its curves.

use serde::Deserialize;
use serde_json::{Map, Value};

/// Of the diagnosis, these; of each finding, all but its curve.
const KEPT: [&str; 7] =
    ["reference", "verdict", "findings", "heldout", "left_out", "after", "cannot_tell"];

/// `diagnosis.json` without what is for drawing.
pub fn reduced(diagnosis: &Value) -> Value {
    let mut kept = Map::new();
    for key in KEPT {
        let mut value = diagnosis.get(key).cloned().unwrap_or(Value::Null);
        if let (true, Some(findings)) = (key == "findings", value.as_array_mut()) {
            findings.iter_mut().filter_map(Value::as_object_mut).for_each(|finding| {
                finding.shift_remove("curve");
            });
        }
        kept.insert(key.into(), value);
    }
    Value::Object(kept)
}

/// A diagnosis as the judge reads it.
#[derive(Debug, Clone, Default, Deserialize)]
pub struct Verdict {
    pub verdict: String,
    #[serde(default)]
    pub findings: Vec<Said>,
    pub after: Option<After>,
    #[serde(default)]
    pub cannot_tell: Vec<CannotTell>,
}

#[derive(Debug, Clone, Default, Deserialize)]
pub struct Said {
    pub status: String,
    pub effect: Option<String>,
    #[serde(default)]
    pub alternatives: Vec<Alternative>,
    pub statistic: String,
    pub axis: String,
    pub interval: [Option<f64>; 2],
    #[serde(default)]
    pub parameters: Map<String, Value>,
    pub next_view: Option<Value>,
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
const CERTAIN: f64 = 0.9;

impl Said {
    /// Says that something is there.
    pub fn claims(&self) -> bool {
        self.status != "not-identifiable"
    }

    /// The name it gives.
    pub fn name(&self) -> Option<&str> {
        let names = ["named", "one-of"].contains(&self.status.as_str());
        let best = || self.alternatives.first().map(|a| a.effect.as_str());
        self.effect.as_deref().or_else(best).filter(|_| names)
    }

    /// Names with their probabilities, the best first.
    pub fn offers(&self) -> impl Iterator<Item = (String, f64)> {
        self.alternatives.iter().map(|a| (a.effect.clone(), a.probability.unwrap_or(0.0)))
    }

    /// Of a name, 0 where it is not offered.
    pub fn probability(&self, id: &str) -> f64 {
        self.offers().find(|o| o.0 == id).map_or(0.0, |o| o.1)
    }

    /// Standard errors between the two best names, as the views are and with the advised one.
    pub fn separations(&self) -> Option<[f64; 2]> {
        let at = |key: &str| self.next_view.as_ref()?.get(key)?.as_f64();
        Some([at("separation_now")?, at("separation_then")?])
    }

    /// The name, where its probability is stated as 0.9 or more.
    pub fn certain_name(&self) -> Option<&str> {
        let sure = self.alternatives.first().and_then(|a| a.probability)? >= CERTAIN;
        self.name().filter(|_| sure)
    }
}

impl Verdict {
    pub fn claims(&self) -> impl Iterator<Item = &Said> {
        self.findings.iter().filter(|f| f.claims())
    }

    /// The first finding that asks for another view.
    pub fn in_doubt(&self) -> Option<&Said> {
        self.claims().find(|f| f.next_view.as_ref().is_some_and(|v| !v.is_null()))
    }

    /// A mismatch is what a user would act upon.
    pub fn finds_something(&self) -> bool {
        self.verdict == "mismatch" && self.claims().next().is_some()
    }
}
