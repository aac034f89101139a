//! The diagnosis from end to end: locate, name, model, show.

use super::case::Case;
use super::diagnosis::Diagnosis;
use super::options::DiagnoseOptions;
use super::views::field::Field;
use crate::Progress;
use crate::error::Result;
use crate::model::NoiseModel;
use crate::terms::Term;
use crate::view::{Excluded, Recording};

/// A finished diagnosis.
pub struct Diagnosed {
    pub diagnosis: Diagnosis,
    /// The model extended with the findings.
    pub model: NoiseModel,
    /// The views without their single frames.
    pub fields: Vec<Field>,
    /// The bias that was found, at every pixel of every field, px; empty where there is none.
    pub bias_px: Vec<Vec<f32>>,
    pub excluded: Vec<Excluded>,
    /// Terms subtracted while reading, where the raw values turned out to be ranges.
    pub taken_out: Vec<Term>,
    /// The simulated views, where there are any, in the same order.
    pub against: Vec<Field>,
}

impl Diagnosed {
    /// Mean residual of every pixel of a view as read, minus the simulated view's where there is one, px.
    pub fn read(&self, view: usize) -> Vec<f32> {
        let field = &self.fields[view];
        let Some(twin) = self.against.get(view) else { return field.mean.clone() };
        let stored = |(&i, m): (&u32, &f32)| m + twin.column_error(i);
        let theirs: Vec<f32> = twin.pixels.iter().zip(&twin.mean).map(stored).collect();
        let theirs = twin.image(&theirs);
        let at = |i: u32| theirs.get(i as usize).copied().unwrap_or(f32::NAN);
        field.pixels.iter().zip(&field.mean).map(|(&i, m)| m - at(i)).collect()
    }
}

/// Finds what `model` leaves out of `recording`.
///
/// # Errors
/// When fewer than three views can be used.
pub fn diagnose(
    recording: &Recording,
    model: &NoiseModel,
    options: &DiagnoseOptions,
    progress: Progress<'_>,
) -> Result<Diagnosed> {
    Ok(Case::open(recording, None, model, options, progress)?.conclude())
}

/// Finds what a simulation leaves out: `simulated` is its recording of the same views, `model` gives the
/// sigma for the weights.
///
/// # Errors
/// When another sensor was simulated, or fewer than three views have a partner.
pub fn diagnose_against(
    recording: &Recording,
    simulated: &Recording,
    model: &NoiseModel,
    options: &DiagnoseOptions,
    progress: Progress<'_>,
) -> Result<Diagnosed> {
    Ok(Case::open(recording, Some(simulated), model, options, progress)?.conclude())
}
