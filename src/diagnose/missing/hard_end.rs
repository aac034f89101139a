//! A hard end of the range: beyond it all is missing, by the sensor's driver or format.

use super::cells::Cell;
use super::shapes::Step;
use crate::diagnose::diagnosis::Finding;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::surveyed_view::SurveyedView;
use crate::terms::Axis;

/// An edge narrower than this share of its distance, or than the noise there, is a limit that a driver
/// or a format has set (the noise blurs it so); a pattern that grows faint goes gradually.
const HARD_END_SHARE: f64 = 0.01;
/// Widths by which the views reach beyond an edge that is known as a whole.
const PASSED: f64 = 5.0;
/// One that is hardly reached must be narrower by so many standard errors, which hold the doubt about
/// the form of its rise as well.
const SURE_WIDTH_ERRORS: f64 = 1.0;
/// Widths of an edge within which patches feel it: 2 % are lost there.
const FELT: f64 = 4.0;

/// Beyond it (or before it) all is missing.
pub struct HardEnd {
    z_m: f64,
    /// Negative where what is nearer is lost.
    width_m: f64,
}

impl HardEnd {
    pub fn of(finding: &Finding, blur: &dyn Fn(f64) -> f64) -> Option<Self> {
        if finding.effect != Some("range-dropout") || finding.parameters.contains_key("share") {
            return None;
        }
        let (z_m, width_m) = (finding.value("z50_m")?, finding.value("width_m")?);
        let error = finding.parameters.get("width_m")?.get("std_error")?.as_f64()?;
        let limit = f64::max(HARD_END_SHARE * z_m, blur(z_m));
        let end = finding.interval[usize::from(width_m > 0.0)];
        let doubt = if (end - z_m) / width_m > PASSED { 0.0 } else { SURE_WIDTH_ERRORS * error };
        (width_m.abs() + doubt < limit).then_some(HardEnd { z_m, width_m })
    }

    pub fn touches(&self, cell: &Cell<'_>) -> bool {
        let far = cell.place.slope[0].abs() + cell.place.slope[1].abs();
        let half = 0.5 * cell.place.side * far / cell.place.disparity * cell.place.z;
        let past = (cell.place.z - self.z_m) * self.width_m.signum();
        past + half > -FELT * self.width_m.abs()
    }

    /// What it loses.
    pub fn step(&self) -> Step {
        Step::whole(Axis::Z, self.z_m, self.width_m)
    }

    pub fn note(&self) -> String {
        let side = if self.width_m > 0.0 { "beyond" } else { "nearer than" };
        format!(
            "readings {side} {:.2} m are missing: the range has a hard end there, set by the sensor's driver or format",
            self.z_m
        )
    }
}

/// Standard deviation of the depth, by the model, where the views come nearest to `z`, m.
pub fn blur(survey: &Survey, z: f64) -> f64 {
    let patches = survey.views.iter().flat_map(SurveyedView::patches);
    let nearest = patches.min_by(|(a, _), (b, _)| (a.z - z).abs().total_cmp(&(b.z - z).abs()));
    nearest.map_or(0.0, |(place, t)| t.variance.sqrt() / place.disparity * z)
}
