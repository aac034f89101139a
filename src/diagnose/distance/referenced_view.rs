//! Views whose distance was measured by other means.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::diagnose::checks::rms;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::surveyed_view::SurveyedView;
use crate::solve::{fit_by_svd, plane_equations};
use crate::stats::paule_mandel;
use crate::terms::Term;

/// A view with a reference distance.
#[derive(Debug, Clone, Copy)]
pub struct ReferencedView {
    /// Measured distance with the known laws subtracted, m.
    pub z: f64,
    /// Slope of the target, along the columns and rows.
    pub slope: [f64; 2],
    /// `z` minus the reference, m.
    pub off: f64,
    /// Standard error of `z` due to the view's own noise, m; grows with z^2.
    pub own_m: f64,
    pub session_s: f64,
    /// Disparity in px times depth.
    pub px_m: f64,
    pub sigma_m: f64,
    pub in_second_half: bool,
}

impl ReferencedView {
    /// Distance that would be measured without any law, m.
    pub fn without_law(&self) -> f64 {
        self.z - self.off
    }

    /// Change in the distance by a disparity that is too large by one px, m: negative.
    pub fn moved_by_a_px(&self) -> f64 {
        -self.z * self.without_law() / self.px_m
    }
}

/// Views with a reference, with the model's known laws and the terms of the found `bias` subtracted.
pub fn referenced_views(
    fields: &[Field],
    survey: &Survey,
    bias: &[Term],
    known: &KnownTerms,
) -> Vec<ReferencedView> {
    let levels = rms::levels(survey, bias);
    let views = fields.par_iter().zip(&survey.views).zip(levels);
    views
        .filter_map(|((f, view), level)| {
            let reference_m = f.reference_distance_m?;
            // The plane was bent towards what is now known to be a bias.
            let measured = f.scale_px_m / (f.scale_px_m * f.plane.q.z + level);
            let session_s = f.session_s;
            let z = measured - known.law_m(measured, session_s, f.scale_px_m);
            let m_a_px = z * z / f.scale_px_m;
            let steep = f.plane.theta().tan();
            let (sin, cos) = f.plane.azimuth().sin_cos();
            let sigma_px = f64::from(f.middle_sigma_px()?);
            let white_px = sigma_px / (f.pixels.len().max(1) as f64).sqrt();
            Some(ReferencedView {
                z,
                slope: [steep * cos, steep * sin],
                off: z - reference_m,
                own_m: level_error_px(view).unwrap_or(white_px) * m_a_px,
                session_s,
                px_m: f.scale_px_m,
                sigma_m: sigma_px * m_a_px,
                in_second_half: view.in_second_half,
            })
        })
        .collect()
}

/// Standard error of the disparity of a view's plane on the optical axis; `None` where the target is too
/// small to measure its noise on.
fn level_error_px(view: &SurveyedView) -> Option<f64> {
    let points = view.patches().map(|(p, t)| ([p.x, p.y], t.mean, view.weight(t)));
    let (information, _) = plane_equations(points);
    Some(information.try_inverse()?[(0, 0)].sqrt()).filter(|error| error.is_finite())
}

/// Least slope of a target that shows where it was measured; `MIN_TILTED` such targets are needed.
const TILTED: f64 = 0.2;
const MIN_TILTED: usize = 5;

/// Whether to fit two angles beside every law: on a tilted target the distance depends on where the optical
/// axis is taken to meet it. Takes enough views.
pub fn is_tilted(checked: &[ReferencedView]) -> bool {
    let steep = |c: &&ReferencedView| c.slope[0].hypot(c.slope[1]) > TILTED;
    checked.iter().filter(steep).count() >= MIN_TILTED && checked.len() >= 2 * MIN_TILTED
}

/// A tape is read to half a millimetre at best.
const TAPE_M: f64 = 0.0005;

/// Errors of the references.
pub struct Scatter {
    /// Variance of each reference, m^2.
    pub variances: Vec<f64>,
    /// Degrees of freedom of the estimate.
    pub freedom: f64,
}

impl Scatter {
    /// Variance of one reference, m^2, beside the views' own errors: as large as it takes to explain the
    /// residuals of all laws together (Paule and Mandel 1982).
    pub fn of(checked: &[ReferencedView]) -> Self {
        let n = checked.len();
        let span = checked.iter().map(|c| c.session_s).fold(0.0, f64::max).max(1.0);
        let columns = if is_tilted(checked) { 6 } else { 4 };
        let columns = DMatrix::from_fn(n, columns, |i, j| {
            let c = &checked[i];
            let [right, down] = c.slope;
            [1.0, c.z, c.z * c.z, c.z * c.session_s / span, c.z * right, c.z * down][j]
        });
        let off = DVector::from_iterator(n, checked.iter().map(|c| c.off));
        let with = |more: f64| {
            let own = checked.iter().map(|c| TAPE_M * TAPE_M + c.own_m * c.own_m);
            own.map(|own| own + more).collect::<Vec<f64>>()
        };
        // Weighted sum of squared residuals, its derivative, and the degrees of freedom.
        let left = |more: f64| {
            let weights = DVector::from_iterator(n, with(more).iter().map(|v| v.recip()));
            let roots = weights.map(f64::sqrt);
            let (mut columns, off) = (columns.clone(), off.component_mul(&roots));
            columns.column_iter_mut().for_each(|mut c| c.component_mul_assign(&roots));
            let (left, rank) = match fit_by_svd(&columns, &off) {
                Some((fit, rank)) => (off - columns * fit, rank),
                None => (off, 0),
            };
            (left.norm_squared(), -weights.dot(&left.component_mul(&left)), (n - rank) as f64)
        };
        let freedom = left(0.0).2;
        let more = paule_mandel(freedom.max(1.0), |more| {
            let (squares, slope, _) = left(more);
            (squares, slope)
        });
        Scatter { variances: with(more), freedom }
    }
}

#[cfg(test)]
impl ReferencedView {
    /// A frontal view that measured `z`, too far by `off`.
    pub fn ahead(z: f64, off: f64, px_m: f64) -> Self {
        ReferencedView {
            z,
            slope: [0.0; 2],
            off,
            own_m: 0.0,
            session_s: 0.0,
            px_m,
            sigma_m: 0.002,
            in_second_half: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::views::tiles::Tile;
    use crate::terms::PixelContext;

    /// White noise of 0.1 px on tiles even about the axis: the error is that of the mean of all readings.
    #[test]
    fn the_level_of_a_view_is_as_sure_as_the_mean_of_its_readings() {
        const ACROSS: i32 = 20;
        let at = |k: i32| f64::from(2 * (k % ACROSS) + 1 - ACROSS);
        let tile = Tile::of_noise(0.01, 16.0);
        let patches = (0..ACROSS * ACROSS).map(|k| {
            let (x, y) = (0.01 * at(k), 0.01 * at(k / ACROSS));
            (PixelContext { x, y, disparity: 20.0, variance: 0.01, ..Default::default() }, tile)
        });
        let view = SurveyedView::white(patches, 1.0);
        let error = level_error_px(&view).expect("readings");
        approx::assert_relative_eq!(error, 0.1 / f64::sqrt(400.0 * 16.0), max_relative = 1e-9);
        let unmeasured = SurveyedView { inflation: f64::INFINITY, ..view };
        assert_eq!(level_error_px(&unmeasured), None);
    }
}
