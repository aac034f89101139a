//! What a person should know before trusting a model.

use super::Measurements;
use crate::measure::{ReferenceDistance, ViewMeasurement};
use crate::model::SigmaFit;
use crate::view::Recording;

/// The most important first.
pub(super) fn of(
    recording: &Recording,
    measurements: &Measurements,
    fit: &SigmaFit,
) -> Vec<String> {
    let mut warnings = Vec::new();
    for e in &measurements.excluded {
        warnings.push(e.to_string());
    }
    // Views left out while opening stand here too.
    warnings.extend(recording.remarks.iter().cloned());
    let total = measurements.views.len();
    let smooth = measurements.views.iter().filter(|v| v.correlation.persists).count();
    if smooth > 0 {
        warnings.push(format!(
            "in {smooth} of {total} views the residual is smooth over more than 40 px: sigma there holds a \
             systematic error (lens, bands; see the pictures), and frames do not average it out"
        ));
    }
    warnings.extend(off_reference(&measurements.views));
    let single = measurements.views.iter().filter(|v| v.frames < 2).count();
    if single > 0 {
        warnings.push(format!(
            "{single} of {total} views have a single frame: no temporal sigma from them"
        ));
    }
    warnings.extend(fit.remarks.iter().cloned());
    for view in &measurements.views {
        warnings.extend(view.notes.iter().map(|note| format!("view {}: {note}", view.name)));
    }
    warnings
}

/// One remark for all views whose distance is not what was measured by other means.
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
        ReferenceDistance::tolerance_words(),
        view.name,
        worst.measured_m,
        worst.reference_m,
        1e3 * worst.off_m(),
    ))
}
