//! Views whose distance was measured by other means.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::solve::{Left, left_by_fit};

/// One view with a reference.
#[derive(Debug, Clone, Copy)]
pub struct ReferencedView {
    pub z: f64,
    /// Slope of the target, along the columns and rows.
    pub slope: [f64; 2],
    /// Measured minus reference, m.
    pub off: f64,
    pub session_s: f64,
    /// Disparity in px times depth.
    pub px_m: f64,
    pub sigma_m: f64,
    pub in_second_half: bool,
}

/// What the model knows of the laws is taken out. `levels` is what each view's disparity on the
/// optical axis changes by once the found bias is taken out, px.
pub fn referenced_views(
    fields: &[Field],
    levels: &[f64],
    known: &KnownTerms,
    second: &[bool],
) -> Vec<ReferencedView> {
    let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
    fields
        .iter()
        .zip(levels)
        .zip(second)
        .filter_map(|((f, level), &in_second_half)| {
            // The plane had bent towards what is now known to be a bias.
            let z = f.scale_px_m / (f.scale_px_m * f.plane.q.z + level);
            let session_s = f.time_s - start;
            let off = z - f.reference_distance_m? - known.law_m(z, session_s, f.scale_px_m);
            let sigma_px = f64::from(f.middle_sigma_px()?);
            let sigma_m = sigma_px * z * z / f.scale_px_m;
            let steep = f.plane.theta().tan();
            let (sin, cos) = f.plane.azimuth().sin_cos();
            let slope = [steep * cos, steep * sin];
            Some(ReferencedView {
                z,
                slope,
                off,
                session_s,
                px_m: f.scale_px_m,
                sigma_m,
                in_second_half,
            })
        })
        .collect()
}

/// Targets tilted by less, as a slope, and fewer of them than this, do not tell where they were
/// measured.
const TILTED: f64 = 0.2;
const FEWEST_TILTED: usize = 5;

/// On a tilted target the distance depends on where the optical axis is taken to meet it: by two
/// angles, which are fitted beside every law where there are views enough.
pub fn is_tilted(checked: &[ReferencedView]) -> bool {
    let steep = |c: &&ReferencedView| c.slope[0].hypot(c.slope[1]) > TILTED;
    checked.iter().filter(steep).count() >= FEWEST_TILTED && checked.len() >= 2 * FEWEST_TILTED
}

/// Variance of the references' own errors, m^2, and its degrees of freedom: what the laws together
/// leave.
pub fn scatter(checked: &[ReferencedView]) -> (f64, f64) {
    let n = checked.len();
    let span = checked.iter().map(|c| c.session_s).fold(0.0, f64::max).max(1.0);
    let columns = if is_tilted(checked) { 6 } else { 4 };
    let columns = DMatrix::from_fn(n, columns, |i, j| {
        let c = &checked[i];
        let [right, down] = c.slope;
        [1.0, c.z, c.z * c.z, c.z * c.session_s / span, c.z * right, c.z * down][j]
    });
    let off = DVector::from_iterator(n, checked.iter().map(|c| c.off));
    let all = Left { squares: off.norm_squared(), free: n as f64 };
    let left = left_by_fit(&columns, &off).unwrap_or(all);
    // A tape is read to half a millimetre at best.
    ((left.squares / left.free.max(1.0)).max(0.0005 * 0.0005), left.free)
}

#[cfg(test)]
impl ReferencedView {
    /// A frontal view.
    pub fn ahead(z: f64, off: f64, px_m: f64) -> Self {
        ReferencedView {
            z,
            slope: [0.0; 2],
            off,
            session_s: 0.0,
            px_m,
            sigma_m: 0.002,
            in_second_half: false,
        }
    }
}
