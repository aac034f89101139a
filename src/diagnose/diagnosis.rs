//! Contents of a diagnosis: `diagnosis.json` (`crate::docs::layouts`).

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::model::Covariance;
use crate::terms::{Axis, Statistic, Term};

pub const DIAGNOSIS_FORMAT: &str = "kinoise-diagnosis/1";

/// All that was found, and all that could not be.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Diagnosis {
    pub format: &'static str,
    pub recording: String,
    /// What the recording was held against.
    pub reference: Reference,
    pub verdict: Verdict,
    /// Most important first.
    pub findings: Vec<Finding>,
    pub map: Vec<MapRow>,
    pub heldout: Option<HeldOut>,
    pub after: After,
    pub detectable: Vec<Detectable>,
    /// What this recording cannot tell, and what would.
    pub cannot_tell: Vec<CannotTell>,
    pub views: Vec<ViewLine>,
    /// What was odd, in words.
    pub remarks: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub enum Reference {
    #[serde(rename = "model")]
    Model,
    #[serde(rename = "simulated recording")]
    SimulatedRecording,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    Match,
    Mismatch,
    /// Nothing was found, and the mean or the size of the noise could not be tested, or more views were
    /// left out than looked at.
    Inconclusive,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    Named,
    OneOf,
    Unexplained,
    Recalibrate,
    NotIdentifiable,
}

/// One mismatch.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Finding {
    pub status: Status,
    /// Id in the catalogue.
    pub effect: Option<&'static str>,
    /// Best first; what is left to one is the chance of none of them.
    pub alternatives: Vec<Alternative>,
    pub statistic: Statistic,
    pub axis: Axis,
    pub interval: [f64; 2],
    pub unit: &'static str,
    /// Of all that was explained, 0 to 1.
    pub share: f64,
    /// Less than a hundredth of it.
    pub minor: bool,
    pub parameters: Map<String, Value>,
    pub size: Size,
    /// `None` where no test gave one.
    pub p_adjusted: Option<f64>,
    /// Each half of the views alone supports it: sign, and size within the joint interval; `None`
    /// where that was not tested.
    pub replicated: Option<bool>,
    pub physics: String,
    pub next_view: Option<NextView>,
    /// The curve in words, where it has no name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<String>,
    /// What it looks like over its axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curve: Option<Curve>,
    /// So many of the views have it, of so many that were measured, and no model of the sensor does; `None`
    /// of what all have.
    #[serde(skip)]
    pub of_some: Option<[usize; 2]>,
    /// The effect of the model that the views contradict; such a finding has no name of its own.
    #[serde(skip)]
    pub contradicted: Option<&'static str>,
    /// What the model is given.
    #[serde(skip)]
    pub terms: Vec<Term>,
    /// Of the terms' coefficients, one term after the other.
    #[serde(skip)]
    pub covariance: Covariance,
}

/// Text for `some` of `all` measured views.
pub(super) fn in_some_views([some, all]: [usize; 2]) -> String {
    format!("in {some} of {all} views")
}

impl HeldOut {
    /// Whether the searches find nothing without the held-out views, or nothing that is scored.
    pub fn is_nothing(&self) -> bool {
        self.gain_interval == [0.0; 2]
    }
}

impl Finding {
    /// Whether it is a law of the distance. Such a law rests on one number per view, others on every pixel,
    /// so few nats do not mean that it is small.
    pub fn is_law(&self) -> bool {
        matches!(self.effect, Some("depth-scale" | "disparity-offset" | "thermal-drift"))
    }

    /// Text on how many views have it, where not all do.
    pub fn which_views(&self) -> Option<String> {
        self.of_some.map(in_some_views)
    }

    /// Measured value of a parameter, without its error.
    pub fn value(&self, parameter: &str) -> Option<f64> {
        self.parameters.get(parameter)?.get("value")?.as_f64()
    }
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Alternative {
    pub effect: &'static str,
    /// `None` where no test weighed the names against one another.
    pub probability: Option<f64>,
}

#[derive(Debug, Clone, Copy, Default, Serialize, JsonSchema)]
pub struct Size {
    /// Root mean square over the recording.
    pub mm: f64,
    /// The same over the model's sigma; for what is missing, the share of pixels lost.
    pub sigma: f64,
}

/// Points of a curve with their standard errors.
#[derive(Debug, Clone, Default, Serialize, JsonSchema)]
pub struct Curve {
    /// What x is, with its unit.
    pub x_label: String,
    pub y_label: String,
    pub x: Vec<f64>,
    /// Measured, bin by bin.
    pub y: Vec<f64>,
    pub y_std_error: Vec<f64>,
    /// As the extended model has it.
    pub model: Vec<f64>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct NextView {
    pub z_m: f64,
    pub theta_rad: f64,
    pub azimuth_rad: f64,
    /// Standard errors between the two best names, on the views there are and with this one added.
    pub separation_now: f64,
    pub separation_then: f64,
    /// Chance that with this view the right name has a probability of 0.9 or more.
    pub chance: f64,
    pub why: String,
}

impl NextView {
    /// Least chance of a view that is likely to settle the name. Of 22 views with this chance or more 16
    /// settled it, of 7 with .5 to .7 two (development seeds 4202 and 4303): the formulas used in the
    /// simulation of views are not those of the sets.
    const LIKELY: f64 = 0.7;

    /// Whether the view is worth taking for this alone.
    pub fn is_likely_to_settle(&self) -> bool {
        self.chance >= Self::LIKELY
    }
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct MapRow {
    pub statistic: Statistic,
    pub axis: Axis,
    pub interval: [f64; 2],
    pub unit: &'static str,
    /// In standard deviations of a pixel for the bias, in shares of the model's for the rest.
    pub effect_size: f64,
    pub p_adjusted: f64,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct HeldOut {
    pub views: Vec<String>,
    /// Nats a view.
    pub log_score_before: f64,
    pub log_score_after: f64,
    pub gain: f64,
    /// 95 %, by the scatter of the views.
    pub gain_interval: [f64; 2],
    /// The same of the mean error alone.
    pub bias_gain_interval: [f64; 2],
    /// Whether the gain, and that of the mean error alone, is beyond chance.
    pub is_clear: bool,
    pub bias_is_clear: bool,
    /// Root mean square of the smooth residual, mm.
    pub rms_mm_before: f64,
    pub rms_mm_after: f64,
    /// Root mean square of the residual to a plane, every pixel of every frame, px of disparity.
    pub rms_px_before: f64,
    pub rms_px_after: f64,
    /// The same with what `correct` takes out, and no more.
    pub correction_rms_before_px: f64,
    pub correction_rms_after_px: f64,
}

/// The battery once more, against the extended model.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct After {
    pub verdict: Verdict,
    pub remaining: Vec<Remaining>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Remaining {
    pub statistic: Statistic,
    pub axis: Axis,
    /// Of all that either run explains, 0 to 1.
    pub share: f64,
    pub p_adjusted: Option<f64>,
    pub words: String,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Detectable {
    pub effect: &'static str,
    /// Least parameter values seen with 80 % power.
    pub minimum: Map<String, Value>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CannotTell {
    pub effect: &'static str,
    pub why: String,
}

/// One view, for people.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ViewLine {
    pub name: String,
    pub z_m: f64,
    pub theta_rad: f64,
    pub azimuth_rad: f64,
    pub frames: usize,
    pub pixels: usize,
    /// Root mean square of the view's smooth residual before and after, px of disparity.
    pub bowl_px_before: f64,
    pub bowl_px_after: f64,
    pub held_out: bool,
}
