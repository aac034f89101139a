//! One set against its answer, question by question.

use std::collections::BTreeMap;

use kinoise::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::verdict::{Finding, Verdict};
use crate::raytraced::question::{Cell, Hidden, Truth};

/// What the judge says of one set.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Marks {
    /// The first thing said: a name, "unexplained", "recalibrate", "nothing", or "failed".
    pub first: String,
    /// Every question that arose, and whether the answer is yes. Without a diagnosis everything that
    /// was asked is wrong. The questions are told on the page ([`QUESTIONS`]).
    pub answers: BTreeMap<String, bool>,
    /// What the stretch of the finding and that of the label share, over what either holds.
    pub overlap: Option<f64>,
    pub parameters: Vec<ParameterMark>,
    pub stated: Vec<Stated>,
}

/// What is asked, and of which sets.
pub const QUESTIONS: [(&str, &str); 14] = [
    ("ran", "a diagnosis came"),
    ("false_alarm", "something is found where nothing is hidden"),
    ("detected", "something is found where something is hidden that can be seen"),
    ("first_name", "the first finding's name is one of the hidden; of those detected"),
    ("in_two", "its name or its first two alternatives are; of those detected"),
    ("exact", "the names said are those hidden, no more and no fewer"),
    ("axis", "the first finding is on the right axis; of those detected"),
    (
        "abstained",
        "what the catalogue lacks is called unexplained, on the right statistic and axis",
    ),
    ("confident_wrong", "a name that is not hidden is said with 0.9 or more"),
    ("said_blind", "what planes cannot show is said to be so"),
    ("nothing_claimed", "nothing is claimed of what planes cannot show"),
    ("recalibrate", "a unit that has changed is sent back to calibration, without a name"),
    ("after_clean", "the extended model leaves nothing that the tests can see; of those named"),
    ("advice", "where the finding is one of several, a next view is proposed"),
];

/// A parameter that the truth and the finding have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterMark {
    pub effect: String,
    pub name: String,
    pub truth: f64,
    pub said: f64,
    /// |said - truth| / |truth|.
    pub relative_error: f64,
    /// The 90 % interval of the stated standard error holds the truth.
    pub covered: Option<bool>,
}

/// The probability of a finding's best name, and whether it was right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stated {
    pub effect: String,
    pub probability: f64,
    pub right: bool,
}

/// Judge one set.
///
/// # Errors
/// When the verdict is not a diagnosis.
pub fn mark(truth: &Truth, verdict: Option<&Value>) -> Result<Marks> {
    let read = |v: &Value| {
        serde_json::from_value::<Verdict>(v.clone()).map_err(|e| Error::Argument {
            what: format!("a verdict cannot be read: {e}"),
            remedy: "it must be a diagnosis.json without its curves",
        })
    };
    let verdict = verdict.map(read).transpose()?;
    Ok(Case { truth, said: verdict.as_ref() }.marks())
}

/// A truth and what was said to it; nothing where no diagnosis came.
struct Case<'a> {
    truth: &'a Truth,
    said: Option<&'a Verdict>,
}

impl Case<'_> {
    fn marks(&self) -> Marks {
        let first = match (self.said, self.first()) {
            (None, _) => "failed",
            (_, None) => "nothing",
            (_, Some(said)) => said.name().unwrap_or(&said.status),
        };
        let answers = [
            ("ran", Some(self.said.is_some())),
            ("confident_wrong", Some(self.certain_but_wrong())),
        ];
        let more = match self.truth.asked.cell {
            Cell::Drift => self.drift(),
            Cell::Blind => self.blind(),
            _ if self.truth.hidden.is_empty() => vec![("false_alarm", Some(self.alarms()))],
            _ => self.concealed(),
        };
        let all = answers.into_iter().chain(more);
        Marks {
            first: first.into(),
            answers: all.filter_map(|(name, yes)| Some((name.to_string(), yes?))).collect(),
            overlap: self.best_overlap(),
            parameters: self.parameters(),
            stated: self.stated(),
        }
    }

    fn alarms(&self) -> bool {
        self.said.is_none_or(|v| v.verdict == "mismatch" || v.claims().next().is_some())
    }

    fn drift(&self) -> Vec<(&'static str, Option<bool>)> {
        let sent_back = self.claims().any(|f| f.status == "recalibrate");
        let right = sent_back && self.claims().all(|f| f.name().is_none());
        vec![("detected", Some(self.found())), ("recalibrate", Some(right))]
    }

    fn blind(&self) -> Vec<(&'static str, Option<bool>)> {
        let blind = |v: &Verdict| {
            let unseen = v.cannot_tell.iter().map(|c| c.effect.as_str());
            let found = v.findings.iter().filter(|f| !f.claims());
            unseen.chain(found.filter_map(|f| f.effect.as_deref())).any(|id| self.is_hidden(id))
        };
        let silent = self.said.is_some_and(|v| v.claims().next().is_none());
        vec![("said_blind", Some(self.said.is_some_and(blind))), ("nothing_claimed", Some(silent))]
    }

    fn concealed(&self) -> Vec<(&'static str, Option<bool>)> {
        let nameless: Vec<&Hidden> = self.hidden().filter(|h| h.names.is_empty()).collect();
        let has_names = self.hidden().count() > nameless.len();
        let of_first = |ask: &dyn Fn(&Finding) -> bool| self.first().filter(|_| has_names).map(ask);
        let unexplained = || self.claims().filter(|f| f.status == "unexplained");
        let abstained = nameless.iter().all(|h| unexplained().any(|f| f.right_place(h)));
        let clean = |v: &Verdict| v.after.as_ref().is_some_and(|a| a.verdict == "match");
        let named = self.claims().any(|f| f.name().is_some());
        let doubtful = self.claims().find(|f| f.status == "one-of");
        vec![
            ("detected", Some(self.found())),
            ("first_name", of_first(&|f| f.name().is_some_and(|id| self.is_hidden(id)))),
            ("in_two", of_first(&|f| self.is_among_two(f))),
            ("exact", nameless.is_empty().then(|| self.exact())),
            ("axis", of_first(&|f| self.meant(f).any(|h| f.right_axis(h)))),
            ("abstained", (!nameless.is_empty()).then_some(abstained)),
            ("after_clean", named.then(|| self.said.is_some_and(clean))),
            ("advice", doubtful.map(Finding::advises)),
        ]
    }

    fn hidden(&self) -> impl Iterator<Item = &Hidden> {
        self.truth.hidden.iter()
    }

    fn claims(&self) -> impl Iterator<Item = &Finding> {
        self.said.into_iter().flat_map(Verdict::claims)
    }

    fn found(&self) -> bool {
        self.said.is_some_and(Verdict::finds_something)
    }

    /// The most important finding, where there is a mismatch at all.
    fn first(&self) -> Option<&Finding> {
        self.said.filter(|v| v.finds_something()).and_then(|v| v.claims().next())
    }

    fn is_hidden(&self, id: &str) -> bool {
        self.hidden().any(|h| h.names.iter().any(|n| n == id))
    }

    fn is_among_two(&self, said: &Finding) -> bool {
        let two = said.alternatives.iter().take(2).map(|a| a.effect.as_str());
        two.chain(said.name()).any(|id| self.is_hidden(id))
    }

    /// The hidden causes that a finding can stand for: those of its name, else all.
    fn meant(&self, said: &Finding) -> impl Iterator<Item = &Hidden> {
        let id = said.name().filter(|id| self.is_hidden(id)).map(String::from);
        self.hidden().filter(move |h| id.as_ref().is_none_or(|id| h.names.contains(id)))
    }

    fn exact(&self) -> bool {
        let said: Vec<&str> = self.claims().filter_map(Finding::name).collect();
        let every = self.hidden().all(|h| h.names.iter().any(|n| said.contains(&n.as_str())));
        every && said.iter().all(|id| self.is_hidden(id))
    }

    fn certain_but_wrong(&self) -> bool {
        self.claims().filter_map(Finding::certain_name).any(|id| !self.is_hidden(id))
    }

    /// Of the finding that meets a label with a stretch best.
    fn best_overlap(&self) -> Option<f64> {
        let fits = |f: &Finding, h: &Hidden| match f.name() {
            Some(id) => h.names.iter().any(|n| n == id),
            None => h.names.is_empty() && f.right_place(h),
        };
        let all = self.claims().flat_map(|f| self.hidden().map(move |h| (f, h)));
        all.filter(|(f, h)| fits(f, h)).filter_map(|(f, h)| f.overlap(h)).reduce(f64::max)
    }

    fn parameters(&self) -> Vec<ParameterMark> {
        let mut marks = Vec::new();
        for said in self.claims() {
            let Some(id) = said.name().filter(|id| self.is_hidden(id)) else { continue };
            for hidden in self.meant(said) {
                marks.extend(hidden.parameters.iter().filter_map(|(name, truth)| {
                    parameter(id, name, truth.as_f64()?, said.parameters.get(name)?)
                }));
            }
        }
        marks
    }

    fn stated(&self) -> Vec<Stated> {
        let best = |f: &Finding| {
            let best = f.alternatives.first().filter(|_| f.name().is_some())?;
            let right = self.is_hidden(&best.effect);
            Some(Stated { effect: best.effect.clone(), probability: best.probability?, right })
        };
        self.claims().filter_map(best).collect()
    }
}

/// Standard deviations of a Gaussian that hold 90 %.
const NINETY_PERCENT: f64 = 1.644_853_626_951_472_2;

fn parameter(effect: &str, name: &str, truth: f64, estimate: &Value) -> Option<ParameterMark> {
    let said = estimate.get("value")?.as_f64()?;
    let off = (said - truth).abs();
    let relative_error = off / truth.abs();
    let error = estimate.get("std_error").and_then(Value::as_f64);
    relative_error.is_finite().then(|| ParameterMark {
        effect: effect.into(),
        name: name.into(),
        truth,
        said,
        relative_error,
        covered: error.map(|e| off <= NINETY_PERCENT * e),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn truth(cell: &str, hidden: Value) -> Truth {
        let asked = json!({"world": "rays", "cell": cell, "nats": 50.0, "seed": 1, "small": true});
        serde_json::from_value(json!({"asked": asked, "hidden": hidden, "base": null})).unwrap()
    }

    fn hidden(names: &[&str], axis: &str) -> Value {
        json!({"names": names, "form": "f", "statistic": "variance", "axis": axis,
            "interval": [0.0, 1.0], "parameters": {"growth": 0.5}, "nats": 60.0})
    }

    fn finding(status: &str, effect: &str, probability: f64) -> Value {
        json!({"status": status, "effect": effect, "statistic": "variance", "axis": "radius",
            "interval": [0.5, 1.0],
            "alternatives": [{"effect": effect, "probability": probability}],
            "parameters": {"growth": {"value": 0.6, "std_error": 0.1}}})
    }

    fn verdict(findings: &[Value]) -> Value {
        let verdict = if findings.is_empty() { "match" } else { "mismatch" };
        json!({"verdict": verdict, "findings": findings, "after": {"verdict": "match"}})
    }

    fn yes(truth: &Truth, verdict: &Value) -> Vec<String> {
        let answers = mark(truth, Some(verdict)).unwrap().answers;
        answers.into_iter().filter(|a| a.1).map(|a| a.0).collect()
    }

    #[test]
    fn a_right_name_is_right_in_every_respect() {
        let truth = truth("single", json!([hidden(&["vignetting"], "radius")]));
        let marks = mark(&truth, Some(&verdict(&[finding("named", "vignetting", 0.95)]))).unwrap();
        for question in ["detected", "first_name", "in_two", "exact", "axis", "after_clean"] {
            assert_eq!(marks.answers.get(question), Some(&true), "{question}");
        }
        assert_eq!(marks.answers.get("confident_wrong"), Some(&false));
        assert_eq!(marks.overlap, Some(0.5));
        assert!((marks.parameters[0].relative_error - 0.2).abs() < 1e-12);
        assert_eq!(marks.parameters[0].covered, Some(true));
        assert_eq!(
            marks.stated,
            [Stated { effect: "vignetting".into(), probability: 0.95, right: true }]
        );
    }

    #[test]
    fn wrong_names_and_silence_count_as_what_they_are() {
        let truth = truth("single", json!([hidden(&["vignetting"], "radius")]));
        let wrong = verdict(&[finding("named", "slope-noise", 0.95)]);
        assert_eq!(
            yes(&truth, &wrong),
            ["after_clean", "axis", "confident_wrong", "detected", "ran"]
        );
        assert_eq!(yes(&truth, &verdict(&[])), ["ran"]);
        let none = mark(&truth, None).unwrap();
        assert!(none.answers.values().all(|yes| !yes) && none.first == "failed");
    }

    #[test]
    fn what_the_catalogue_lacks_wants_no_name_and_the_right_place() {
        let truth = truth("outside", json!([hidden(&[], "radius")]));
        let open = verdict(&[finding("unexplained", "", 0.0)]);
        assert!(yes(&truth, &open).contains(&"abstained".into()));
        let dressed = verdict(&[finding("named", "vignetting", 0.95)]);
        assert_eq!(yes(&truth, &dressed), ["after_clean", "confident_wrong", "detected", "ran"]);
    }

    #[test]
    fn anything_said_of_nothing_is_a_false_alarm() {
        let truth = truth("null", json!([]));
        assert_eq!(yes(&truth, &verdict(&[])), ["ran"]);
        assert!(
            yes(&truth, &verdict(&[finding("recalibrate", "", 0.0)]))
                .contains(&"false_alarm".into())
        );
        assert_eq!(mark(&truth, None).unwrap().answers["false_alarm"], true);
    }
}
