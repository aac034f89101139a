//! `model.json` (`crate::docs::layouts`): written and read back bit for bit; foreign files are refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::effect::Effect;
use super::forms::Form;
use super::provenance::{FitSummary, Provenance};
use super::uncertainty::Uncertainty;
use super::{Direction, Domain, SigmaModel};
use crate::error::{Error, Result};
use crate::io::{pretty_json, write_atomic};
use crate::read::{absurd, plainly, read_json};
use crate::view::{RecordingFile, Sensor};

/// The format this version writes and reads.
pub const MODEL_FORMAT: &str = "kinoise-model/1";
/// The file name that every command uses.
const MODEL: &str = "model.json";
const FORMAT_FAMILY: &str = "kinoise-model/";

/// A sensor's noise, as exchanged between `calibrate`, `simulate`, `diagnose` and `map`.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    /// `None` when the model came from a bare table.
    pub sensor: Option<RecordingFile>,
    pub sigma: SigmaModel,
    pub effects: Vec<Effect>,
    /// Budgets of the measured values, where the recording states uncertainties.
    pub uncertainty: Option<Uncertainty>,
    pub fit: FitSummary,
    pub provenance: Provenance,
}

#[derive(Serialize, Deserialize, JsonSchema)]
struct ModelFile {
    format: String,
    sensor: Option<RecordingFile>,
    sigma: SigmaFile,
    effects: Vec<Effect>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    uncertainty: Option<Uncertainty>,
    fit: FitFile,
    provenance: Provenance,
}

#[derive(Serialize, Deserialize, JsonSchema)]
struct FitFile {
    /// What sigma is: along the optical axis ("axial") or across the plane ("perpendicular").
    residual: Direction,
    /// Student's degrees of freedom of the intervals.
    degrees_of_freedom: f64,
    #[serde(flatten)]
    summary: FitSummary,
}

#[derive(Serialize, Deserialize, JsonSchema)]
struct SigmaFile {
    form: String,
    formula: String,
    #[schemars(with = "BTreeMap<String, ParameterFile>")]
    parameters: Map<String, Value>,
    covariance: Vec<Vec<f64>>,
    valid: Domain,
}

#[derive(Serialize, Deserialize, JsonSchema)]
struct ParameterFile {
    value: f64,
    std_error: Option<f64>,
}

const REMEDY: &str = "make the model again with `kinoise calibrate` or `kinoise fit`";

const REMEDY_EFFECT: &str = "make the model again with `kinoise diagnose`, or take the effect out";

impl NoiseModel {
    /// The paper's Eq. 1 without effects.
    pub fn paper() -> Self {
        NoiseModel {
            sensor: None,
            sigma: SigmaModel::paper(),
            effects: Vec::new(),
            uncertainty: None,
            fit: FitSummary::default(),
            provenance: Provenance::default(),
        }
    }

    /// The sensor that the model was made of; `None` for a model of a bare table.
    /// Fails when its description contradicts itself.
    pub fn described_sensor(&self) -> Result<Option<Sensor>> {
        self.sensor.clone().map(RecordingFile::sensor).transpose().map_err(|what| Error::Argument {
            what: format!("the model's sensor: {what}"),
            remedy: "give the model that was made of this very sensor",
        })
    }

    /// The text of `model.json`. Fails when a number of the model is not finite.
    pub fn to_json(&self) -> Result<String> {
        let of_effects = || self.effects.iter().find_map(Effect::fault);
        if let Some(what) = self.sigma.fault().or_else(of_effects) {
            return Err(Error::Solver {
                what,
                remedy: "the model cannot be written; look at the views' warnings",
            });
        }
        let SigmaModel { form, parameters, std_errors, covariance, domain, .. } = &self.sigma;
        let parameter = |((name, _), (&value, &std_error)): (&(&str, _), (&f64, &Option<f64>))| {
            (name.to_string(), serde_json::json!(ParameterFile { value, std_error }))
        };
        let names = form.card().parameters.iter();
        let file = ModelFile {
            format: MODEL_FORMAT.into(),
            sensor: self.sensor.clone(),
            sigma: SigmaFile {
                form: form.id().into(),
                formula: form.card().formula.into(),
                parameters: names.zip(parameters.iter().zip(std_errors)).map(parameter).collect(),
                covariance: covariance.row_iter().map(|r| r.iter().copied().collect()).collect(),
                valid: *domain,
            },
            effects: self.effects.clone(),
            uncertainty: self.uncertainty.clone(),
            fit: FitFile {
                residual: self.sigma.direction,
                degrees_of_freedom: self.sigma.degrees_of_freedom,
                summary: self.fit.clone(),
            },
            provenance: self.provenance.clone(),
        };
        pretty_json(&file).map_err(|e| Error::Solver {
            what: format!("the model cannot be written as JSON: {e}"),
            remedy: "report this as a bug",
        })
    }

    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomic(path, self.to_json()?.as_bytes())
    }

    /// Path of the `model.json`: for a folder, the one in it.
    pub fn file(path: &Path) -> PathBuf {
        if path.is_dir() { path.join(MODEL) } else { path.to_path_buf() }
    }

    /// Reads a `model.json`, without checking its effects against the catalogue.
    pub(crate) fn read_unchecked(file: &Path) -> Result<Self> {
        let text = read_json(file)?;
        let path = file.to_path_buf();
        Self::from_json(&text).map_err(|(what, remedy)| Error::Recording { path, what, remedy })
    }

    fn from_json(text: &str) -> Result<Self, (String, &'static str)> {
        let value: Value = serde_json::from_str(text).map_err(|e| {
            (format!("not whole JSON ({e})"), "the file is damaged; restore it or make it again")
        })?;
        check_format(&value)?;
        if let Some(what) = absurd(&value) {
            return Err((what, REMEDY));
        }
        // From the text, so that errors have line numbers.
        let file: ModelFile = serde_json::from_str(text).map_err(|e| {
            let (line, why) = (e.line(), plainly(&e));
            (format!("line {line}: a part of the model is missing or wrong ({why})"), REMEDY)
        })?;
        let sensor = file.sensor.clone().map(RecordingFile::sensor).transpose();
        sensor.map_err(|what| (format!("sensor: {what}"), REMEDY))?;
        let sigma = read_sigma(file.sigma, &file.fit)?;
        if let Some(fault) = sigma.fault() {
            return Err((fault, REMEDY));
        }
        if let Some(fault) = file.effects.iter().find_map(Effect::fault) {
            return Err((fault, REMEDY_EFFECT));
        }
        Ok(NoiseModel {
            sensor: file.sensor,
            sigma,
            effects: file.effects,
            uncertainty: file.uncertainty,
            fit: file.fit.summary,
            provenance: file.provenance,
        })
    }
}

/// The JSON Schema of `model.json`.
pub(crate) fn model_schema() -> schemars::Schema {
    schemars::schema_for!(ModelFile)
}

fn check_format(value: &Value) -> Result<(), (String, &'static str)> {
    let Some(format) = value.get("format").and_then(Value::as_str) else {
        return Err(("it has no \"format\": not a kinoise model".into(), REMEDY));
    };
    if format == MODEL_FORMAT {
        return Ok(());
    }
    match format.strip_prefix(FORMAT_FAMILY).and_then(|v| v.parse::<u32>().ok()) {
        Some(version) if version > 1 => Err((
            format!("its format is \"{format}\", newer than this program's \"{MODEL_FORMAT}\""),
            "update kinoise",
        )),
        _ => Err((format!("its format is \"{format}\", not \"{MODEL_FORMAT}\""), REMEDY)),
    }
}

fn read_sigma(file: SigmaFile, fit: &FitFile) -> Result<SigmaModel, (String, &'static str)> {
    let form: Form =
        file.form.parse().map_err(|what| (what, "update kinoise, or make the model again"))?;
    let mut parameters = Vec::new();
    let mut std_errors = Vec::new();
    for (name, _) in form.card().parameters {
        let value = file
            .parameters
            .get(*name)
            .ok_or_else(|| (format!("the parameter {name} is missing"), REMEDY))?;
        let parameter: ParameterFile = serde_json::from_value(value.clone())
            .map_err(|e| (format!("the parameter {name}: {}", plainly(&e)), REMEDY))?;
        parameters.push(parameter.value);
        std_errors.push(parameter.std_error);
    }
    let p = parameters.len();
    if file.covariance.len() != p || file.covariance.iter().any(|row| row.len() != p) {
        return Err((format!("the covariance is not {p} x {p}"), REMEDY));
    }
    Ok(SigmaModel {
        form,
        parameters,
        std_errors,
        covariance: DMatrix::from_fn(p, p, |i, j| file.covariance[i][j]),
        domain: file.valid,
        degrees_of_freedom: fit.degrees_of_freedom,
        direction: fit.residual,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Finite `f64`s survive the file exactly.
        #[test]
        fn numbers_read_back_bit_for_bit(a in 1e-12f64..1.0, b in 1e-300f64..1.0, c in -1.0f64..1.0, s in 1e-300f64..1e30) {
            let mut model = NoiseModel::paper();
            model.sigma.parameters[0] = a;
            model.sigma.parameters[1] = b;
            model.sigma.parameters[2] = c;
            model.sigma.covariance[(1, 1)] = s;
            model.sigma.std_errors[1] = Some(a);
            let back = NoiseModel::from_json(&model.to_json().unwrap()).unwrap();
            prop_assert_eq!(back, model);
        }
    }

    #[test]
    fn foreign_newer_and_damaged_files_are_told_apart() {
        let good = NoiseModel::paper().to_json().unwrap();
        let says = |text: &str| NoiseModel::from_json(text).unwrap_err().0;
        assert!(says(&good.replace("kinoise-model/1", "kinoise-model/2")).contains("newer"));
        assert!(
            says(&good.replace("kinoise-model/1", "other/1")).contains("not \"kinoise-model/1\"")
        );
        assert!(says("{}").contains("no \"format\""));
        assert!(says(&good[..good.len() / 2]).contains("not whole JSON"));
        assert!(says(&good.replace("\"b\"", "\"bb\"")).contains("parameter b"));
        assert!(
            says(&good.replace("\"form\": \"paper\"", "\"form\": \"cubic\"")).contains("cubic")
        );
        assert!(
            says(&good.replace("1.39,", "1.0,").replace("\"value\": 1.39", "\"value\": 1.0"))
                .contains("pole")
        );
    }

    /// Every truncation is an error, none a panic.
    #[test]
    fn every_truncation_is_refused() {
        let good = NoiseModel::paper().to_json().unwrap();
        for cut in (0..good.len() - 2).step_by(7) {
            assert!(NoiseModel::from_json(&good[..cut]).is_err(), "cut at {cut}");
        }
    }
}
