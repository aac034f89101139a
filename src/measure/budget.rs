//! Uncertainty budget of a view's distance error against its reference.

use super::ViewMeasurement;
use crate::stats::{Budget, Component, Distribution, rounding_uncertainty};
use crate::view::{Sensor, ViewNotes};

const PLANE_PARAMETERS: f64 = 3.0;

/// Standard uncertainty by flatness, the distance of the two planes that enclose the surface (ISO 1101): a
/// point lies anywhere within half of it from their middle (GUM F.2.3.3).
pub fn flatness_uncertainty_m(flatness_m: f64) -> f64 {
    flatness_m / 12f64.sqrt()
}

/// Effective degrees of freedom of the plane's distance (Welch and Satterthwaite, GUM G.4.1): its pixels are many,
/// but whole frames that shift are a sample of a few.
fn degrees_of_freedom(m: &ViewMeasurement) -> f64 {
    let [all, shifts] = [m.whole.mean_std_error_m, m.whole.shift_std_error_m].map(|u| u * u);
    let of_shifts = if all > 0.0 { shifts / all } else { 0.0 };
    let pixels = (m.whole.n_effective - PLANE_PARAMETERS).max(1.0);
    let frames = (m.frames as f64 - 1.0).max(1.0);
    1.0 / ((1.0 - of_shifts).powi(2) / pixels + of_shifts.powi(2) / frames)
}

/// Budget of the error of indication: depth of the fitted plane on the optical axis minus the reference.
/// `None` where the recording does not state the uncertainty of the reference, which is mostly the largest
/// component: a budget without it would promise too much.
pub fn distance_budget(m: &ViewMeasurement, notes: &ViewNotes, sensor: &Sensor) -> Option<Budget> {
    let reference_u_m = notes.reference_uncertainty_m?;
    let error_m = m.reference()?.off_m();
    let z = m.axis_distance_m;
    let noise = "noise of the plane on the optical axis";
    let mut components = vec![
        Component::type_a(noise, m.axis_std_error_m, degrees_of_freedom(m)),
        Component::type_b("reference distance", Distribution::Normal, reference_u_m),
    ];
    if let Some(flatness) = notes.target.and_then(|t| t.flatness_m) {
        let u = flatness_uncertainty_m(flatness);
        components.push(Component::type_b("flatness of the target", Distribution::Rectangular, u));
    }
    let step_m = sensor.code.step_inverse(z) * z * z;
    // The measured variance includes that of the rounding.
    let noise = (m.whole.spread.spatial_m.powi(2) - step_m * step_m / 12.0).max(0.0).sqrt();
    let rounding = rounding_uncertainty(step_m, noise);
    let dithered = Distribution::DitheredRectangular;
    components.push(Component::type_b("resolution of the stored depth", dithered, rounding));
    let stated = sensor.intrinsics_uncertainty.as_ref();
    if let Some([across, down]) = stated.and_then(|i| i.axis_rad(&sensor.camera)) {
        // The axis meets a tilted plane at another depth: dz = z tan(theta) along the slope. The focal
        // length does not affect where the depth is read.
        let (sin, cos) = m.azimuth_rad.sin_cos();
        let u = (cos * across).hypot(sin * down);
        let sensitivity = z * m.theta_rad.tan();
        let axis = Component::type_b("principal point", Distribution::Normal, u);
        components.push(axis.times("rad", sensitivity));
    }
    Some(Budget::of(error_m, components))
}
