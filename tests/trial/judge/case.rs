//! One set against its answer, question by question.

use serde_json::Value;

use super::marks::{Marks, Names, ParameterMark, Stated};
use super::places::{overlap, right_axis, right_place};
use crate::raytraced::question::{Hidden, Truth};
use crate::verdict::{Said, Verdict};

/// A truth and what was said to it.
pub struct Case<'a> {
    pub truth: &'a Truth,
    /// None where no diagnosis came.
    pub said: Option<&'a Verdict>,
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

    pub fn empty(&self) -> Marks {
        let alarm = |v: &Verdict| v.verdict == "mismatch" || v.claims().next().is_some();
        Marks { false_alarm: Some(self.said.is_none_or(alarm)), ..self.common() }
    }

    pub fn drift(&self) -> Marks {
        let right = |v: &Verdict| {
            v.claims().any(|f| f.status == "recalibrate") && v.claims().all(|f| f.name().is_none())
        };
        Marks {
            detected: Some(self.found()),
            recalibrate: Some(self.said.is_some_and(right)),
            ..self.common()
        }
    }

    pub fn blind(&self) -> Marks {
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

    pub fn concealed(&self) -> Marks {
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
