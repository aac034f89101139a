//! Laws that distances may be off by, fitted to views whose distance was measured by other means.

use nalgebra::{DMatrix, DVector};

use super::anchor::Family;
use super::evidence::{Evidence, gain};
use super::field::Field;
use super::known::KnownTerms;
use super::null::Null;
use super::replication::agree;
use super::texture_finding::ViewMean;
use super::warm_up::warm_up;
use crate::solve::{Left, left_by_fit};
use crate::terms::Axis;

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

/// A law that the distances may be off by.
pub struct Law {
    pub family: &'static str,
    pub axis: Axis,
    /// Of the axis.
    pub reach: [f64; 2],
    /// What it makes of the depth, m and in sigmas.
    pub rms_m: f64,
    pub rms_sigma: f64,
    /// Of one reference, m.
    pub error_m: f64,
    /// What settles its shape, each with its standard error.
    pub settled: Vec<(&'static str, [f64; 2])>,
    /// Nats.
    pub gain: f64,
    /// Its coefficient, and the standard error.
    pub estimate: [f64; 2],
    pub null: Null,
    /// Degrees of freedom that the references' own error was measured with.
    pub freedom: f64,
    /// Both halves of the references say the same.
    pub replicated: Option<bool>,
}

/// Fewer references than this can be fitted by anything.
pub const FEWEST: usize = 5;
/// Time constants of a warm-up, s.
const WARM_UPS: [f64; 6] = [60.0, 180.0, 480.0, 1200.0, 2400.0, 7200.0];

/// What else distances may be off by.
#[derive(Default)]
pub struct Nuisances {
    /// How far a bent target may lie from the place on it that was measured, at any distance, m.
    pub bent_m: f64,
    /// Biases whose constants are open: an offset of the disparity cannot be told from them.
    pub open: Vec<Family>,
}

/// All laws, with what each gains on references left out; none where there are too few.
pub fn laws(checked: &[ReferencedView], Nuisances { bent_m, open }: &Nuisances) -> Vec<Law> {
    if checked.len() < FEWEST {
        return Vec::new();
    }
    let angles = if is_tilted(checked) { 2 } else { 0 };
    let bent = (*bent_m > 0.0).then_some(*bent_m);
    let others = |c: &ReferencedView| -> Vec<f64> {
        let angles = c.slope[..angles].iter().map(|s| c.z * s);
        angles.chain(bent).chain(open.iter().map(|f| f.moves_m(c))).collect()
    };
    let beside = angles + usize::from(bent.is_some()) + open.len();
    let (variance, free) = scatter(checked);
    let mut laws = Vec::new();
    let mut add = |family, axis, column: &dyn Fn(&ReferencedView) -> f64| {
        let evidence = |with: bool| -> Vec<Evidence> {
            let of = |c: &ReferencedView| {
                let mut g = others(c);
                g.extend(with.then(|| column(c)));
                let g = DVector::from_vec(g);
                Evidence { a: &g * g.transpose() / variance, b: g * (c.off / variance) }
            };
            checked.iter().map(of).collect()
        };
        let views = evidence(true);
        let alone = if beside > 0 { gain(&evidence(false), PRIOR) } else { None };
        if let (Some(mut gain), Some(null)) = (gain(&views, PRIOR), Null::of(&views, beside, PRIOR))
        {
            if let Some(alone) = alone {
                gain.total -= alone.total;
            }
            let beta = gain.beta[beside];
            let beta_error = gain.covariance[(beside, beside)].sqrt();
            let n = checked.len() as f64;
            let square = |of: &dyn Fn(&ReferencedView) -> f64| {
                (checked.iter().map(|c| of(c).powi(2)).sum::<f64>() / n).sqrt()
            };
            let shift = |c: &ReferencedView| beta * column(c);
            let reach = crate::stats::range(checked.iter().map(|c| match axis {
                Axis::SessionTime => c.session_s,
                _ => c.z,
            }));
            let (rms_m, rms_sigma) = (square(&shift), square(&|c| shift(c) / c.sigma_m));
            // The others as all references have them.
            let sizes = &gain.beta.as_slice()[..beside];
            let moved = |c: &ReferencedView| -> f64 {
                sizes.iter().zip(others(c)).map(|(size, column)| size * column).sum()
            };
            let half = |second: bool| {
                let mine = checked.iter().filter(|c| c.in_second_half == second);
                ViewMean::of_scores(mine.map(|c| {
                    let g = column(c);
                    (g * g / variance, g * (c.off - moved(c)) / variance)
                }))
            };
            let replicated = agree([half(false), half(true)]);
            let error_m = variance.sqrt();
            let freedom = free.max(1.0);
            laws.push(Law {
                family,
                axis,
                reach,
                rms_m,
                rms_sigma,
                error_m,
                settled: Vec::new(),
                gain: gain.total,
                estimate: [beta, beta_error],
                null,
                freedom,
                replicated,
            });
        }
    };
    add("depth-scale", Axis::Z, &|c| c.z);
    // An offset of the disparity by delta px moves the depth by -z^2 delta / (f b).
    if open.is_empty() {
        add("disparity-offset", Axis::Z, &|c| -c.z * c.z / c.px_m);
    }
    for tau in WARM_UPS {
        add("thermal-drift", Axis::SessionTime, &|c| c.z * (1.0 - (-c.session_s / tau).exp()));
    }
    // The variance was measured with few degrees of freedom: a Student's t in place of a Gaussian.
    let widened = variance * free / (free - 2.0).max(1.0);
    if let Some(warm_up) = warm_up(checked, &others, widened) {
        for law in laws.iter_mut().filter(|l| l.family == "thermal-drift") {
            law.estimate = warm_up.relative;
            law.settled = vec![("time_constant_s", warm_up.time_constant_s)];
        }
    }
    laws
}

/// A relative error of a few percent, an offset of a few px.
const PRIOR: f64 = 1.0;

#[cfg(test)]
#[path = "laws_tests.rs"]
mod tests;
