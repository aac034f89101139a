//! One set's answer compared with its truth, question by question.

use std::collections::BTreeMap;

use kinoise::error::Result;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::verdict::{Finding, Verdict};
use crate::raytraced::question::{Cell, Hidden, Truth};

/// Marks of one set.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Marks {
    /// What the first finding says: a name, "unexplained", "recalibrate", "nothing", or "failed".
    pub first: String,
    /// Answers to those of [`QUESTIONS`] that apply. Without a diagnosis every answer counts as wrong.
    pub answers: BTreeMap<String, bool>,
    /// Intersection over union of the finding's interval and the label's.
    pub overlap: Option<f64>,
    pub parameters: Vec<ParameterMark>,
    pub stated: Vec<Stated>,
}

/// A parameter that the truth and the finding have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterMark {
    pub effect: String,
    pub name: String,
    pub truth: f64,
    pub said: f64,
    /// |said - truth| / |truth|.
    pub relative_error: f64,
    /// Whether the 90 % interval of the stated standard error holds the truth.
    pub covered: Option<bool>,
}

/// The probability of a finding's best name, and whether it was right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stated {
    pub effect: String,
    pub probability: f64,
    pub right: bool,
}

/// Name, what is asked of which sets, and the answer; `None` where it is not asked.
type Question = (&'static str, &'static str, fn(&Case<'_>) -> Option<bool>);

pub const QUESTIONS: [Question; 14] = [
    ("ran", "a diagnosis came", |c| Some(c.said.is_some())),
    ("false_alarm", "something is found where nothing is hidden", |c| {
        let alarms = |v: &Verdict| v.verdict == "mismatch" || v.claims().next().is_some();
        c.is(Kind::Empty).then(|| c.said.is_none_or(alarms))
    }),
    ("detected", "something is found where something is hidden that can be seen", |c| {
        (c.is(Kind::Concealed) || c.is(Kind::Drift)).then(|| c.found())
    }),
    ("first_name", "the first finding's name is one of the hidden; of those detected", |c| {
        c.of_first(|f| f.name().is_some_and(|id| c.is_hidden(id)))
    }),
    ("in_two", "its name or its first two alternatives are; of those detected", |c| {
        let two = |f: &Finding| f.alternatives.iter().take(2).any(|a| c.is_hidden(&a.effect));
        c.of_first(|f| two(f) || f.name().is_some_and(|id| c.is_hidden(id)))
    }),
    ("exact", "the names said are those hidden, no more and no fewer", |c| {
        let asked = c.is(Kind::Concealed) && c.nameless().next().is_none();
        asked.then(|| {
            let said: Vec<&str> = c.claims().filter_map(Finding::name).collect();
            let found = |h: &Hidden| h.names.iter().any(|n| said.contains(&n.as_str()));
            c.hidden.iter().all(found) && said.iter().all(|id| c.is_hidden(id))
        })
    }),
    ("axis", "the first finding is on the right axis; of those detected", |c| {
        c.of_first(|f| c.meant(f).any(|h| f.right_axis(h)))
    }),
    (
        "abstained",
        "what the catalogue lacks is called unexplained, on the right statistic and axis",
        |c| {
            let open = |f: &Finding, h| f.status == "unexplained" && f.right_place(h);
            let asked = c.is(Kind::Concealed) && c.nameless().next().is_some();
            asked.then(|| c.nameless().all(|h| c.claims().any(|f| open(f, h))))
        },
    ),
    ("confident_wrong", "a name that is not hidden is said with 0.9 or more", |c| {
        Some(c.claims().filter_map(Finding::certain_name).any(|id| !c.is_hidden(id)))
    }),
    ("said_blind", "what planes cannot show is said to be so", |c| {
        let blind = |v: &Verdict| {
            let unseen = v.cannot_tell.iter().map(|c| c.effect.as_str());
            let found = v.findings.iter().filter(|f| !f.claims());
            unseen.chain(found.filter_map(|f| f.effect.as_deref())).any(|id| c.is_hidden(id))
        };
        c.is(Kind::Blind).then(|| c.said.is_some_and(blind))
    }),
    ("nothing_claimed", "nothing is claimed of what planes cannot show", |c| {
        c.is(Kind::Blind).then(|| c.said.is_some() && c.claims().next().is_none())
    }),
    ("recalibrate", "a unit that has changed is sent back to calibration, without a name", |c| {
        let sent_back = || c.claims().any(|f| f.status == "recalibrate");
        c.is(Kind::Drift).then(|| sent_back() && c.claims().all(|f| f.name().is_none()))
    }),
    (
        "after_clean",
        "the extended model leaves nothing that the tests can see; of those named",
        |c| {
            let asked = c.is(Kind::Concealed) && c.claims().any(|f| f.name().is_some());
            let after = c.said.and_then(|v| v.after.as_ref());
            asked.then(|| after.is_some_and(|a| a.verdict == "match"))
        },
    ),
    ("advice", "where the finding is one of several, a next view is proposed", |c| {
        let doubtful = c.claims().find(|f| f.status == "one-of");
        doubtful.filter(|_| c.is(Kind::Concealed)).map(|f| f.next_view.is_some())
    }),
];

/// Judges one set.
///
/// # Errors
/// When the verdict is not a diagnosis.
pub fn mark(truth: &Truth, verdict: Option<&Value>) -> Result<Marks> {
    let said = verdict.map(Verdict::read).transpose()?;
    let kind = match truth.asked.cell {
        Cell::Drift => Kind::Drift,
        Cell::Blind => Kind::Blind,
        _ if truth.hidden.is_empty() => Kind::Empty,
        _ => Kind::Concealed,
    };
    Ok(Case { kind, hidden: &truth.hidden, said: said.as_ref() }.marks())
}

/// What kind of thing is hidden.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Empty,
    /// Sigma itself has changed.
    Drift,
    /// What planes cannot show.
    Blind,
    Concealed,
}

/// What is hidden and what was said; `said` is `None` where no diagnosis came.
pub struct Case<'a> {
    kind: Kind,
    hidden: &'a [Hidden],
    said: Option<&'a Verdict>,
}

impl Case<'_> {
    fn marks(&self) -> Marks {
        let first = match (self.said, self.first()) {
            (None, _) => "failed",
            (_, None) => "nothing",
            (_, Some(said)) => said.name().unwrap_or(&said.status),
        };
        let answers = QUESTIONS.iter().filter_map(|(id, _, ask)| Some(((*id).into(), ask(self)?)));
        Marks {
            first: first.into(),
            answers: answers.collect(),
            overlap: self.best_overlap(),
            parameters: self.parameters(),
            stated: self.stated(),
        }
    }

    fn is(&self, kind: Kind) -> bool {
        self.kind == kind
    }

    fn claims(&self) -> impl Iterator<Item = &Finding> {
        self.said.into_iter().flat_map(Verdict::claims)
    }

    fn found(&self) -> bool {
        self.said.is_some_and(Verdict::finds_something)
    }

    /// The most important finding, if the verdict is a mismatch.
    fn first(&self) -> Option<&Finding> {
        self.claims().next().filter(|_| self.found())
    }

    /// Answer about the first finding; asked only where something with a name is hidden.
    fn of_first(&self, ask: impl Fn(&Finding) -> bool) -> Option<bool> {
        let asked = self.is(Kind::Concealed) && self.hidden.iter().any(|h| !h.names.is_empty());
        self.first().filter(|_| asked).map(ask)
    }

    /// Hidden causes that the catalogue lacks.
    fn nameless(&self) -> impl Iterator<Item = &Hidden> {
        self.hidden.iter().filter(|h| h.names.is_empty())
    }

    fn is_hidden(&self, id: &str) -> bool {
        self.hidden.iter().any(|h| h.names.iter().any(|n| n == id))
    }

    /// The hidden causes that a finding can stand for: those of its name, else all.
    fn meant(&self, said: &Finding) -> impl Iterator<Item = &Hidden> {
        let id = said.name().filter(|id| self.is_hidden(id)).map(String::from);
        self.hidden.iter().filter(move |h| id.as_ref().is_none_or(|id| h.names.contains(id)))
    }

    /// Best overlap of a finding with a label that it fits.
    fn best_overlap(&self) -> Option<f64> {
        let fits = |f: &Finding, h: &Hidden| match f.name() {
            Some(id) => h.names.iter().any(|n| n == id),
            None => h.names.is_empty() && f.right_place(h),
        };
        let all = self.claims().flat_map(|f| self.hidden.iter().map(move |h| (f, h)));
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

/// Half-width of the central 90 % of a Gaussian, in standard deviations.
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
pub mod tests {
    use super::*;
    use serde_json::json;

    pub fn truth(cell: &str, hidden: Value) -> Truth {
        let asked = json!({"world": "rays", "cell": cell, "nats": 50.0, "seed": 1, "small": true});
        serde_json::from_value(json!({"asked": asked, "hidden": hidden, "base": null})).unwrap()
    }

    pub fn hidden(names: &[&str], axis: &str) -> Value {
        json!({"names": names, "form": "f", "statistic": "variance", "axis": axis,
            "interval": [0.0, 1.0], "parameters": {"growth": 0.5}, "nats": 60.0})
    }

    fn verdict(found: &[(&str, &str, f64)]) -> Value {
        let finding = |(status, effect, probability): &(&str, &str, f64)| {
            json!({"status": status, "effect": effect, "statistic": "variance", "axis": "radius",
                "interval": [0.5, 1.0],
                "alternatives": [{"effect": effect, "probability": probability}],
                "parameters": {"growth": {"value": 0.6, "std_error": 0.1}}})
        };
        let verdict = if found.is_empty() { "match" } else { "mismatch" };
        let findings: Vec<Value> = found.iter().map(finding).collect();
        json!({"verdict": verdict, "findings": findings, "after": {"verdict": "match"}})
    }

    /// What is hidden, what is said, and the questions answered with yes.
    #[test]
    fn right_and_wrong_names_and_silence_count_as_what_they_are() {
        let vignetting = || truth("single", json!([hidden(&["vignetting"], "radius")]));
        let seam = || truth("outside", json!([hidden(&[], "radius")]));
        let (named, wrong) = (("named", "vignetting", 0.95), ("named", "slope-noise", 0.95));
        let cases = [
            (vignetting(), vec![named], "after_clean axis detected exact first_name in_two ran"),
            (vignetting(), vec![wrong], "after_clean axis confident_wrong detected ran"),
            (vignetting(), vec![], "ran"),
            (seam(), vec![("unexplained", "", 0.0)], "abstained detected ran"),
            (seam(), vec![named], "after_clean confident_wrong detected ran"),
            (truth("null", json!([])), vec![], "ran"),
            (truth("null", json!([])), vec![("recalibrate", "", 0.0)], "false_alarm ran"),
        ];
        for (truth, said, expected) in cases {
            let answers = mark(&truth, Some(&verdict(&said))).unwrap().answers;
            let yes: Vec<String> = answers.into_iter().filter(|a| a.1).map(|a| a.0).collect();
            assert_eq!(yes.join(" "), expected, "{said:?}");
        }
        let none = mark(&vignetting(), None).unwrap();
        assert!(none.answers.values().all(|yes| !yes) && none.first == "failed");
        assert!(mark(&truth("null", json!([])), None).unwrap().answers["false_alarm"]);
    }

    #[test]
    fn stretches_parameters_and_probabilities_are_compared_with_the_truth() {
        let truth = truth("single", json!([hidden(&["vignetting"], "radius")]));
        let marks = mark(&truth, Some(&verdict(&[("named", "vignetting", 0.95)]))).unwrap();
        assert_eq!(marks.answers.get("confident_wrong"), Some(&false));
        assert_eq!(marks.overlap, Some(0.5));
        assert!((marks.parameters[0].relative_error - 0.2).abs() < 1e-12);
        assert_eq!(marks.parameters[0].covered, Some(true));
        let stated = Stated { effect: "vignetting".into(), probability: 0.95, right: true };
        assert_eq!(marks.stated, [stated]);
    }
}
