//! One set: what was right and what was wrong.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::places::{overlap, right_axis, right_place};
use crate::error::{Error, Result};
use crate::prove::question::{Cell, Hidden, Truth};
use crate::prove::verdict::{Said, Verdict};

/// What the judge says of one set. `None`: the question does not arise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Marks {
    /// A diagnosis came. One that did not counts as wrong in every respect.
    pub ran: bool,
    /// The first thing said: a name, "unexplained", "recalibrate", "nothing", or "failed".
    pub first: String,
    /// Something was found where nothing is hidden.
    pub false_alarm: Option<bool>,
    /// Something was found where something is hidden that can be seen.
    pub detected: Option<bool>,
    /// The first finding's name is one of the hidden; of those detected.
    pub first_name: Option<bool>,
    /// Its name or its first two alternatives; of those detected.
    pub in_two: Option<bool>,
    /// The names said are those hidden, no more and no fewer.
    pub exact: Option<bool>,
    /// The first finding is on the right axis; of those detected.
    pub axis: Option<bool>,
    /// Share of the stretch of that axis, see [`overlap`].
    pub overlap: Option<f64>,
    /// What the catalogue lacks is called unexplained, with the right statistic and axis.
    pub abstained: Option<bool>,
    /// What the catalogue lacks is given a name of its own with 0.9 or more.
    pub masquerade: Option<bool>,
    /// A name that is not hidden is said with 0.9 or more.
    pub confident_wrong: Option<bool>,
    /// What planes cannot show is said to be so.
    pub said_blind: Option<bool>,
    /// Nothing is claimed of what planes cannot show.
    pub nothing_claimed: Option<bool>,
    /// A unit that has changed is sent back to calibration.
    pub recalibrate: Option<bool>,
    /// The extended model leaves nothing that the tests can see; of those with a name.
    pub after_clean: Option<bool>,
    /// Where the finding is one of several, a next view is proposed.
    pub advice: Option<bool>,
    pub names: Names,
    pub parameters: Vec<ParameterMark>,
    pub stated: Vec<Stated>,
}

/// How many names.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Names {
    pub hidden: usize,
    pub said: usize,
    pub right: usize,
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
    /// The 90 % interval of the stated standard error holds the truth.
    pub covered: Option<bool>,
}

/// A probability that was stated, and whether the name was right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stated {
    pub effect: String,
    pub probability: f64,
    /// The finding's best name, not one of its alternatives.
    pub best: bool,
    pub right: bool,
}

impl Marks {
    /// All that is yes or no, with the names of the scores.
    pub fn yes_no(&self) -> [(&'static str, Option<bool>); 15] {
        [
            ("ran", Some(self.ran)),
            ("false_alarm", self.false_alarm),
            ("detected", self.detected),
            ("first_name", self.first_name),
            ("in_two", self.in_two),
            ("exact", self.exact),
            ("axis", self.axis),
            ("abstained", self.abstained),
            ("masquerade", self.masquerade),
            ("confident_wrong", self.confident_wrong),
            ("said_blind", self.said_blind),
            ("nothing_claimed", self.nothing_claimed),
            ("recalibrate", self.recalibrate),
            ("after_clean", self.after_clean),
            ("advice", self.advice),
        ]
    }
}

/// Judge one set. Without a verdict everything that was asked is wrong.
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
    let case = Case { truth, said: verdict.as_ref() };
    Ok(match truth.asked.cell {
        Cell::Drift => case.drift(),
        Cell::Blind => case.blind(),
        _ if truth.hidden.is_empty() => case.empty(),
        _ => case.concealed(),
    })
}

/// What can be said of names without anything else: whether they are a false alarm, or whether
/// something was seen, the first name is right, and the set of names is.
pub fn names_alone(truth: &Truth, names: &[String]) -> Vec<(&'static str, bool)> {
    let hidden = |id: &String| truth.hidden.iter().any(|h| h.names.contains(id));
    let catalogued = truth.hidden.iter().all(|h| !h.names.is_empty());
    match truth.asked.cell {
        Cell::Drift | Cell::Blind => Vec::new(),
        _ if truth.hidden.is_empty() => vec![("false_alarm", !names.is_empty())],
        _ if catalogued => {
            let all = truth.hidden.iter().all(|h| h.names.iter().any(|n| names.contains(n)));
            let mut marks = vec![("detected", !names.is_empty())];
            marks.extend(names.first().map(|id| ("first_name", hidden(id))));
            marks.push(("exact", all && names.iter().all(hidden)));
            marks
        }
        _ => vec![("detected", !names.is_empty())],
    }
}

struct Case<'a> {
    truth: &'a Truth,
    said: Option<&'a Verdict>,
}

impl Case<'_> {
    fn common(&self) -> Marks {
        let first = match (self.said, self.first()) {
            (None, _) => "failed",
            (_, None) => "nothing",
            (_, Some(said)) => said.name().unwrap_or(&said.status),
        };
        Marks {
            ran: self.said.is_some(),
            first: first.into(),
            confident_wrong: Some(self.certain_but_wrong()),
            stated: self.stated(),
            ..Marks::default()
        }
    }

    fn empty(&self) -> Marks {
        let alarm = |v: &Verdict| v.verdict == "mismatch" || v.claims().next().is_some();
        Marks { false_alarm: Some(self.said.is_none_or(alarm)), ..self.common() }
    }

    fn drift(&self) -> Marks {
        let right = |v: &Verdict| {
            v.claims().any(|f| f.status == "recalibrate") && v.claims().all(|f| f.name().is_none())
        };
        Marks {
            detected: Some(self.found()),
            recalibrate: Some(self.said.is_some_and(right)),
            ..self.common()
        }
    }

    fn blind(&self) -> Marks {
        let blind = |v: &Verdict| {
            let told = v.cannot_tell.iter().map(|c| c.effect.as_str());
            let found = v.findings.iter().filter(|f| !f.claims());
            let mut all = told.chain(found.filter_map(|f| f.effect.as_deref()));
            all.any(|id| self.is_hidden(id))
        };
        Marks {
            said_blind: Some(self.said.is_some_and(blind)),
            nothing_claimed: Some(self.said.is_some_and(|v| v.claims().next().is_none())),
            ..self.common()
        }
    }

    fn concealed(&self) -> Marks {
        let nameless: Vec<&Hidden> = self.hidden().filter(|h| h.names.is_empty()).collect();
        let named = self.hidden().count() - nameless.len();
        let first = self.first();
        let of_first = |ask: &dyn Fn(&Said) -> bool| first.filter(|_| named > 0).map(ask);
        let open = |h: &&Hidden| self.unexplained().any(|f| right_place(f, h));
        let lacking = !nameless.is_empty();
        let doubtful = || self.claims().find(|f| f.status == "one-of");
        let names_said = self.claims().any(|f| f.name().is_some());
        let clean = |v: &Verdict| v.after.as_ref().is_some_and(|a| a.verdict == "match");
        Marks {
            detected: Some(self.found()),
            first_name: of_first(&|f| f.name().is_some_and(|id| self.is_hidden(id))),
            in_two: of_first(&|f| self.is_among_two(f)),
            exact: (!lacking).then(|| self.exact()),
            axis: of_first(&|f| self.meant(f).any(|h| right_axis(f, h))),
            overlap: self.best_overlap(),
            abstained: lacking.then(|| nameless.iter().all(open)),
            masquerade: lacking.then(|| self.certain_but_wrong()),
            after_clean: names_said.then(|| self.said.is_some_and(clean)),
            advice: doubtful().map(|f| f.next_view.as_ref().is_some_and(|v| !v.is_null())),
            names: self.names(),
            parameters: self.parameters(),
            ..self.common()
        }
    }

    fn hidden(&self) -> impl Iterator<Item = &Hidden> {
        self.truth.hidden.iter()
    }

    fn claims(&self) -> impl Iterator<Item = &Said> {
        self.said.into_iter().flat_map(Verdict::claims)
    }

    fn unexplained(&self) -> impl Iterator<Item = &Said> {
        self.claims().filter(|f| f.status == "unexplained")
    }

    fn found(&self) -> bool {
        self.said.is_some_and(Verdict::finds_something)
    }

    /// The most important finding, where there is a mismatch at all.
    fn first(&self) -> Option<&Said> {
        self.said.filter(|v| v.finds_something()).and_then(|v| v.claims().next())
    }

    fn is_hidden(&self, id: &str) -> bool {
        self.hidden().any(|h| h.names.iter().any(|n| n == id))
    }

    fn is_among_two(&self, said: &Said) -> bool {
        let two = said.alternatives.iter().take(2).map(|a| a.effect.as_str());
        two.chain(said.name()).any(|id| self.is_hidden(id))
    }

    /// The hidden causes that a finding can stand for: those of its name, else all.
    fn meant(&self, said: &Said) -> impl Iterator<Item = &Hidden> {
        let id = said.name().filter(|id| self.is_hidden(id)).map(String::from);
        self.hidden().filter(move |h| id.as_ref().is_none_or(|id| h.names.contains(id)))
    }

    fn names_said(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.claims().filter_map(Said::name).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    fn names(&self) -> Names {
        let said = self.names_said();
        let named = || self.hidden().filter(|h| !h.names.is_empty());
        let right = |h: &&Hidden| h.names.iter().any(|n| said.contains(&n.as_str()));
        Names { hidden: named().count(), said: said.len(), right: named().filter(right).count() }
    }

    fn exact(&self) -> bool {
        let names = self.names();
        names.right == names.hidden && self.names_said().iter().all(|id| self.is_hidden(id))
    }

    fn certain_but_wrong(&self) -> bool {
        self.claims().filter_map(Said::certain_name).any(|id| !self.is_hidden(id))
    }

    /// Of the finding that meets a label with a stretch best.
    fn best_overlap(&self) -> Option<f64> {
        let fits = |f: &Said, h: &Hidden| {
            f.name().map_or(h.names.is_empty() && right_place(f, h), |id| {
                h.names.iter().any(|n| n == id)
            })
        };
        let all = self.claims().flat_map(|f| self.hidden().map(move |h| (f, h)));
        all.filter(|(f, h)| fits(f, h)).filter_map(|(f, h)| overlap(f, h)).reduce(f64::max)
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

    /// Of every name that is offered; one that another finding gives as its own is not this one's.
    fn stated(&self) -> Vec<Stated> {
        let mut all = Vec::new();
        let findings: Vec<&Said> = self.claims().filter(|f| f.name().is_some()).collect();
        for (i, said) in findings.iter().enumerate() {
            let elsewhere =
                |id: &str| findings.iter().enumerate().any(|(j, f)| i != j && f.name() == Some(id));
            for (rank, a) in said.alternatives.iter().enumerate() {
                let Some(probability) = a.probability else { continue };
                let right = self.is_hidden(&a.effect) && (rank == 0 || !elsewhere(&a.effect));
                all.push(Stated { effect: a.effect.clone(), probability, best: rank == 0, right });
            }
        }
        all
    }
}

/// Standard deviations of a Gaussian that hold 90 %.
const NINETY_PERCENT: f64 = 1.644_853_626_951_472_2;

fn parameter(effect: &str, name: &str, truth: f64, estimate: &Value) -> Option<ParameterMark> {
    let said = estimate.get("value")?.as_f64()?;
    let off = (said - truth).abs();
    let relative_error = off / truth.abs();
    let covered = estimate
        .get("std_error")
        .and_then(Value::as_f64)
        .map(|error| off <= NINETY_PERCENT * error);
    relative_error.is_finite().then(|| ParameterMark {
        effect: effect.into(),
        name: name.into(),
        truth,
        said,
        relative_error,
        covered,
    })
}
