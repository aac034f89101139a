//! What planes alone cannot tell: offset, scale and drift, where distances were measured by other
//! means.

use nalgebra::{DMatrix, DVector};

use super::evidence::{Evidence, Gain, Null, gain};
use super::field::Field;

/// A law that the distances may be off by.
pub struct Law {
    pub family: &'static str,
    pub axis: &'static str,
    pub settled: Vec<(&'static str, f64)>,
    pub gain: Gain,
    pub null: Null,
}

/// One view with a reference.
#[derive(Debug, Clone, Copy)]
struct Checked {
    z: f64,
    /// Measured minus reference, m.
    off: f64,
    session_s: f64,
    px_m: f64,
}

/// Fewer references than this can be fitted by anything.
const FEWEST: usize = 5;
/// Time constants of a warm-up, s.
const WARM_UPS: [f64; 6] = [60.0, 180.0, 480.0, 1200.0, 2400.0, 7200.0];

/// All laws, with what each gains on references left out; empty where there are too few.
pub fn laws(fields: &[Field]) -> Vec<Law> {
    let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
    let checked: Vec<Checked> = fields
        .iter()
        .filter_map(|f| {
            let z = f.plane.depth(0.0, 0.0);
            let off = z - f.reference_distance_m?;
            Some(Checked { z, off, session_s: f.time_s - start, px_m: f.scale_px_m })
        })
        .collect();
    if checked.len() < FEWEST {
        return Vec::new();
    }
    let variance = scatter(&checked);
    let mut laws = Vec::new();
    let mut add = |family, axis, settled, column: &dyn Fn(&Checked) -> f64| {
        let views: Vec<Evidence> = checked
            .iter()
            .map(|c| {
                let g = column(c);
                Evidence {
                    a: DMatrix::from_element(1, 1, g * g / variance),
                    b: DVector::from_element(1, g * c.off / variance),
                }
            })
            .collect();
        if let (Some(gain), Some(null)) = (gain(&views, PRIOR), Null::of(&views, 0, PRIOR)) {
            laws.push(Law { family, axis, settled, gain, null });
        }
    };
    add("depth-scale", "z", Vec::new(), &|c| c.z);
    // An offset of the disparity by delta px moves the depth by -z^2 delta / (f b).
    add("disparity-offset", "z", Vec::new(), &|c| -c.z * c.z / c.px_m);
    for tau in WARM_UPS {
        let settled = vec![("time_constant_s", tau)];
        add("thermal-drift", "session-time", settled, &|c| {
            c.z * (1.0 - (-c.session_s / tau).exp())
        });
    }
    laws
}

/// A relative error of a few percent, an offset of a few px.
const PRIOR: f64 = 1.0;

/// Variance of the references' own errors, m^2: what the three laws together leave.
fn scatter(checked: &[Checked]) -> f64 {
    let n = checked.len();
    let span = checked.iter().map(|c| c.session_s).fold(0.0, f64::max).max(1.0);
    let columns = DMatrix::from_fn(n, 4, |i, j| {
        let c = &checked[i];
        [1.0, c.z, c.z * c.z, c.z * c.session_s / span][j]
    });
    let off = DVector::from_iterator(n, checked.iter().map(|c| c.off));
    let fitted = columns.clone().svd(true, true).solve(&off, 1e-9).map(|beta| &columns * beta);
    let left = fitted.map_or_else(|_| off.norm_squared(), |f| (&off - f).norm_squared());
    // A tape is read to half a millimetre at best.
    (left / (n as f64 - 4.0).max(1.0)).max(0.0005 * 0.0005)
}
