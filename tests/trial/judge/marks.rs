//! One set: what was right and what was wrong.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::case::Case;
use crate::raytraced::question::{Cell, Truth};
use crate::verdict::Verdict;
use kinoise::error::{Error, Result};

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
    /// Share of the stretch of that axis, what both hold over what either holds.
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
