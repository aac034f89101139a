//! One set before and after the view that its diagnosis asked for.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::verdict::{CERTAIN, Finding, Verdict};
use crate::raytraced::question::Truth;

/// Whether the view that was advised did what it was advised for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AdviceMarks {
    /// The two names in doubt, the better first.
    pub doubt: Vec<String>,
    /// Leading name of the finding of the same statistic after the view, or "nothing".
    pub after: String,
    /// Probability of the hidden name among the two, before and after; `None` where neither is hidden.
    pub right: Option<[f64; 2]>,
    /// Whether the hidden name leads afterwards with 0.9 or more.
    pub settled: Option<bool>,
}

/// Judges one set's second verdict against its first.
pub fn mark_advice(truth: &Truth, first: Option<&Value>, second: Option<&Value>) -> AdviceMarks {
    let read = |v: Option<&Value>| v.and_then(|v| Verdict::read(v).ok());
    let (before, after) = (read(first), read(second).unwrap_or_default());
    let Some(asked) = before.as_ref().and_then(Verdict::in_doubt) else {
        return AdviceMarks::default();
    };
    let doubt: Vec<String> = asked.alternatives.iter().take(2).map(|a| a.effect.clone()).collect();
    let answer = after.claims().find(|f| f.statistic == asked.statistic && f.name().is_some());
    let leads = answer.and_then(Finding::name).unwrap_or("nothing").to_string();
    let right_name = doubt.iter().find(|id| truth.hidden.iter().any(|h| h.names.contains(id)));
    let right = right_name.map(|id| {
        let then = after.claims().map(|f| f.probability(id));
        [asked.probability(id), then.fold(0.0, f64::max)]
    });
    let settled = right_name.zip(right).map(|(id, [_, p])| *id == leads && p >= CERTAIN);
    AdviceMarks { doubt, after: leads, right, settled }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::marks::tests::{hidden, truth};
    use serde_json::json;

    fn finding(names: &[(&str, f64)], next_view: &Value) -> Value {
        let all: Vec<Value> =
            names.iter().map(|(id, p)| json!({"effect": id, "probability": p})).collect();
        let status = if next_view.is_null() { "named" } else { "one-of" };
        json!({"verdict": "mismatch", "findings": [{"status": status, "effect": null,
            "alternatives": all, "statistic": "variance", "axis": "radius", "interval": [0.0, 1.0],
            "next_view": next_view}]})
    }

    #[test]
    fn an_advised_view_settles_when_the_hidden_name_leads_with_certainty() {
        let truth = truth("single", json!([hidden(&["vignetting"], "radius")]));
        let pose = json!({"z_m": 1.0, "theta_rad": 0.5, "azimuth_rad": 0.0});
        let first = finding(&[("slope-noise", 0.6), ("vignetting", 0.4)], &pose);
        let settled = finding(&[("vignetting", 0.97)], &Value::Null);
        let marks = mark_advice(&truth, Some(&first), Some(&settled));
        assert_eq!((marks.right, marks.settled), (Some([0.4, 0.97]), Some(true)));
        let misled = finding(&[("slope-noise", 0.97)], &Value::Null);
        assert_eq!(mark_advice(&truth, Some(&first), Some(&misled)).settled, Some(false));
        assert_eq!(mark_advice(&truth, Some(&first), None).settled, Some(false));
        assert_eq!(mark_advice(&truth, Some(&settled), Some(&settled)), AdviceMarks::default());
    }
}
