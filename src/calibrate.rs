//! Calibrates the noise model of a recording (Yamaguchi et al. 2016, section II).

mod uncertainty;

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use crate::Progress;
use crate::error::{Error, Result};
use crate::io::{hex, sha256_hex};
use crate::measure::{
    MeasureOptions, ReferenceDistance, SigmaKind, SigmaTable, ViewMeasurement, Workbench,
    measure_view, ranges_remark, without_copies,
};
use crate::model::{
    Direction, FitSummary, Form, HeldOut, NoiseModel, Provenance, SigmaFit, SigmaModel,
    compare_forms, sort_out,
};
use crate::read::read_bytes;
use crate::rng::Seed;
use crate::units::verb;
use crate::view::{Excluded, Recording, RecordingFile};
use uncertainty::uncertainty_of;

#[derive(Debug, Clone, Copy, Default)]
pub struct CalibrateOptions {
    pub measure: MeasureOptions,
    /// The standard deviation that the model describes.
    pub kind: SigmaKind,
    /// The form to fit; `None` takes the one that predicts left-out distances best.
    pub form: Option<Form>,
    /// Creation time to write into the model; the current time if `None`.
    pub created: Option<SystemTime>,
}

impl CalibrateOptions {
    fn provenance(&self, seed: Option<u64>) -> Provenance {
        Provenance::at(seed, self.created.unwrap_or_else(SystemTime::now))
    }
}

/// All views of a recording, measured.
#[derive(Debug, Clone)]
pub struct Measurements {
    /// In the recording's order.
    pub views: Vec<ViewMeasurement>,
    /// Views that could not be opened or measured, and why.
    pub excluded: Vec<Excluded>,
    /// A remark where many excluded views are flat as ranges.
    pub ranges: Option<String>,
}

#[derive(Debug, Clone)]
pub struct Calibration {
    /// The fitted data.
    pub table: SigmaTable,
    pub fit: SigmaFit,
    /// How well each form predicts distances left out, best first; empty with too few distances.
    pub comparison: Vec<HeldOut>,
    pub model: NoiseModel,
    /// What to know before trusting the model, the most important first.
    pub warnings: Vec<String>,
}

/// Measures every view. A view without a plane is excluded, with the reason, and so is a copy of another,
/// which would count twice. `progress` counts views.
/// Fails when no view can be measured; the message gives the first reason.
pub fn measure(
    recording: &Recording,
    options: &MeasureOptions,
    progress: Progress<'_>,
) -> Result<Measurements> {
    let bench = Workbench::new(&recording.sensor, *options);
    let (mut views, mut excluded) =
        recording.each_view(progress, |view| measure_view(view, &bench));
    excluded.extend(without_copies(recording, &mut views));
    let ranges = ranges_remark(recording, &excluded, &bench);
    let (measurements, total) = (Measurements { views, excluded, ranges }, recording.views.len());
    if measurements.views.is_empty() {
        let first = measurements.excluded.first();
        let first = first.map(|e| format!("view {}: {}", e.view, e.reason));
        let first = first.unwrap_or_else(|| "there is no view".to_string());
        let ranges = measurements.ranges.map_or_else(String::new, |remark| format!("; {remark}"));
        return Err(Error::recording(
            &recording.root,
            format!("no view of {total} can be used; the first: {first}{ranges}"),
            "put this right, then run again",
        ));
    }
    Ok(measurements)
}

/// Fits the noise model to the measured views.
/// Fails when the views are too few or too alike for the form, or a description file cannot be read.
pub fn model_of(
    recording: &Recording,
    measurements: &Measurements,
    options: &CalibrateOptions,
) -> Result<Calibration> {
    let table = SigmaTable::of(&measurements.views, options.kind);
    if table.rows.is_empty() {
        return Err(Error::NotEnough {
            what: format!("no view gives a {}", options.kind.description()),
            remedy: "a temporal sigma needs views of at least two frames".into(),
        });
    }
    let (fit, comparison) = fit_chosen(&table, options.form)?;
    let warnings = warnings_of(recording, measurements, &fit);
    let mut provenance = options.provenance(Some(options.measure.seed.0));
    provenance.options = describe(options, fit.form, !comparison.is_empty());
    provenance.sha256 = hashes(recording, measurements)?;
    let mut model = noise_model(
        Some(RecordingFile::of(&recording.sensor)),
        &fit,
        &comparison,
        options.kind,
        provenance,
    );
    model.uncertainty = uncertainty_of(recording, &measurements.views, &model.sigma);
    Ok(Calibration { table, fit, comparison, model, warnings })
}

/// Calibrates the paper's form of sigma, for a recording without a model. Where that has no positive fit,
/// takes another form and says so in the model's first remark. The last of them, k z^2, fits any sigmas.
///
/// # Errors
/// As [`measure`] and [`model_of`].
pub fn paper_model(
    recording: &Recording,
    seed: Seed,
    created: Option<SystemTime>,
    progress: Progress<'_>,
) -> Result<NoiseModel> {
    let mut options = CalibrateOptions { form: Some(Form::Paper), created, ..Default::default() };
    options.measure.seed = seed;
    let views = measure(recording, &options.measure, progress)?;
    let first = match model_of(recording, &views, &options) {
        Err(why) => why,
        Ok(calibration) => return Ok(calibration.model),
    };
    for form in [Form::Nguyen, Form::Disparity, Form::Khoshelham] {
        options.form = Some(form);
        if let Ok(Calibration { mut model, .. }) = model_of(recording, &views, &options) {
            let note = format!("sigma was fitted with the form \"{form}\": {first}");
            model.fit.remarks.insert(0, note);
            return Ok(model);
        }
    }
    Err(first)
}

/// Fits a bare table that was read from `source`; of the options only `form` and `created` are used.
pub fn model_of_table(
    table: &SigmaTable,
    source: &Path,
    options: &CalibrateOptions,
) -> Result<Calibration> {
    let (table, pooled) = table.binned();
    let (fit, comparison) = fit_chosen(&table, options.form)?;
    let mut provenance = options.provenance(None);
    provenance.options.insert("form".into(), json!(fit.form.id()));
    let bytes = read_bytes(source)?;
    let name = source.file_name().unwrap_or_default().to_string_lossy().into_owned();
    provenance.sha256.insert(name, json!(sha256_hex(&bytes)));
    let warnings = pooled.into_iter().chain(fit.remarks.iter().cloned()).collect();
    let model = noise_model(None, &fit, &comparison, SigmaKind::Spatial, provenance);
    Ok(Calibration { table, fit, comparison, model, warnings })
}

fn fit_chosen(table: &SigmaTable, form: Option<Form>) -> Result<(SigmaFit, Vec<HeldOut>)> {
    let sorted = sort_out(table);
    let comparison = compare_forms(&sorted.kept);
    let form = form.or(comparison.first().map(|h| h.form)).unwrap_or(Form::Paper);
    Ok((sorted.fit(form)?, comparison))
}

fn noise_model(
    sensor: Option<RecordingFile>,
    fit: &SigmaFit,
    comparison: &[HeldOut],
    kind: SigmaKind,
    provenance: Provenance,
) -> NoiseModel {
    let across = kind == SigmaKind::Paper;
    let direction = if across { Direction::Perpendicular } else { Direction::Axial };
    NoiseModel {
        sensor,
        sigma: SigmaModel { direction, ..fit.model() },
        effects: Vec::new(),
        uncertainty: None,
        fit: FitSummary {
            views: fit.views,
            samples: fit.rows,
            rmse_m: fit.quality.rmse_m,
            r2: fit.quality.r2,
            heldout: comparison.iter().find(|h| h.form == fit.form).map(|h| h.rmse_relative),
            remarks: fit.remarks.clone(),
            searched: None,
        },
        provenance,
    }
}

fn describe(options: &CalibrateOptions, form: Form, compared: bool) -> Map<String, Value> {
    let chosen_by = match options.form {
        Some(_) => "user",
        None if compared => "held-out distances",
        None => "default: no form can be judged at distances left out",
    };
    let value = json!({
        "form": form.id(),
        "form_chosen_by": chosen_by,
        "sigma": options.kind.description(),
        "ransac_threshold_m": options.measure.ransac_threshold_m,
        "ransac_iterations": options.measure.ransac_iterations,
    });
    value.as_object().cloned().unwrap_or_default()
}

/// Hashes of the description files and of all views' frames. Fails when a file can no longer be read: a
/// hash without it would vouch for the wrong input.
fn hashes(recording: &Recording, measurements: &Measurements) -> Result<Map<String, Value>> {
    let mut map = Map::new();
    let mut described = Sha256::new();
    let mut files: Vec<&PathBuf> = recording.described_by.iter().collect();
    files.sort();
    for path in files {
        described.update(read_bytes(path)?);
    }
    map.insert("description".into(), json!(hex(&described.finalize())));
    let mut frames = Sha256::new();
    for view in &measurements.views {
        frames.update(view.name.as_bytes());
        frames.update(view.digest);
    }
    map.insert("frames".into(), json!(hex(&frames.finalize())));
    Ok(map)
}

/// What a user should know before trusting the model, the most important first.
fn warnings_of(recording: &Recording, measurements: &Measurements, fit: &SigmaFit) -> Vec<String> {
    let mut warnings: Vec<String> = measurements.ranges.iter().cloned().collect();
    warnings.extend(measurements.excluded.iter().map(ToString::to_string));
    // These include views left out while opening.
    warnings.extend(recording.remarks.iter().cloned());
    let total = measurements.views.len();
    let smooth = measurements.views.iter().filter(|v| v.correlation.persists).count();
    if smooth > 0 {
        warnings.push(format!(
            "in {smooth} of {total} views the residual hangs together over more than 40 px: sigma there holds a \
             systematic error (lens, bands; see the pictures), and frames do not average it out"
        ));
    }
    warnings.extend(off_reference(&measurements.views));
    let single = measurements.views.iter().filter(|v| v.frames < 2).count();
    if single > 0 {
        warnings.push(format!(
            "{single} of {total} views {} a single frame: no temporal sigma from them",
            verb(single, "has", "have")
        ));
    }
    warnings.extend(fit.remarks.iter().cloned());
    for view in &measurements.views {
        warnings.extend(view.notes.iter().map(|note| format!("view {}: {note}", view.name)));
    }
    warnings
}

/// One remark for all views whose distance contradicts their reference.
fn off_reference(views: &[ViewMeasurement]) -> Option<String> {
    let known: Vec<_> = views.iter().filter_map(|v| Some((v, v.reference()?))).collect();
    let off = known.iter().filter(|(_, r)| r.contradicts());
    let (view, worst) =
        off.clone().max_by(|(_, a), (_, b)| a.off_m().abs().total_cmp(&b.off_m().abs()))?;
    Some(format!(
        "in {} of {} views with a reference distance the target is not where it says, by more than {}; most in \
         view {}: {:.3} m on the optical axis for {:.3} m ({:+.1} mm). Check reference_distance_m, the region, and \
         how words become metres",
        off.count(),
        known.len(),
        ReferenceDistance::describe_tolerance(),
        view.name,
        worst.measured_m,
        worst.reference_m,
        1e3 * worst.off_m(),
    ))
}
