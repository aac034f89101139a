//! Uncertainty budgets of a calibration (GUM), from what the recording states and the views show.

use crate::measure::{ViewMeasurement, flatness_uncertainty_m};
use crate::model::{Conditions, NO_ACCEPTANCE_TEST, SigmaModel, Uncertainty, ViewUncertainty};
use crate::stats::{Budget, COVERAGE_FACTOR, Component, Distribution, range};
use crate::view::{Recording, Sensor, View, ViewNotes};

/// Budgets of all views; `None` where the recording states no uncertainty at all, since statistics of the
/// readings alone are no budget.
pub fn uncertainty_of(
    recording: &Recording,
    measured: &[ViewMeasurement],
    sigma: &SigmaModel,
) -> Option<Uncertainty> {
    let find = |m: &ViewMeasurement| recording.views.iter().find(|v| v.name == m.name);
    let views: Vec<(&ViewMeasurement, &View)> =
        measured.iter().filter_map(|m| Some((m, find(m)?))).collect();
    let sensor = &recording.sensor;
    let not_stated = not_stated(sensor, &views);
    if views.is_empty() || not_stated.iter().filter(|(_, in_any)| !in_any).count() == KEYS {
        return None;
    }
    let of = |(m, view): &(&ViewMeasurement, &View)| ViewUncertainty {
        view: m.name.clone(),
        distance_error: m.distance_budget.clone(),
        sigma: sigma_budget(m, &view.notes, sensor, sigma),
    };
    Some(Uncertainty {
        statement: NO_ACCEPTANCE_TEST.into(),
        coverage_factor: COVERAGE_FACTOR,
        conditions: conditions(&views),
        not_stated: not_stated.into_iter().map(|(key, _)| key.into()).collect(),
        views: views.iter().map(of).collect(),
    })
}

const KEYS: usize = 3;

/// The keys missing in at least one view, and whether any view has them.
fn not_stated(sensor: &Sensor, views: &[(&ViewMeasurement, &View)]) -> Vec<(&'static str, bool)> {
    let stated = |of: &dyn Fn(&ViewNotes) -> bool| {
        let count = views.iter().filter(|(_, v)| of(&v.notes)).count();
        [count > 0, count == views.len()]
    };
    let flatness = stated(&|n| n.target.is_some_and(|t| t.flatness_m.is_some()));
    let keys: [(&str, [bool; 2]); KEYS] = [
        ("reference_uncertainty_m", stated(&|n| n.reference_uncertainty_m.is_some())),
        ("target.flatness_m", flatness),
        ("intrinsics_uncertainty", [sensor.intrinsics_uncertainty.is_some(); 2]),
    ];
    keys.into_iter().filter(|(_, [_, all])| !all).map(|(key, [any, _])| (key, any)).collect()
}

/// Budget of a view's spatial sigma, taken as the noise at its distance and tilt.
fn sigma_budget(
    m: &ViewMeasurement,
    notes: &ViewNotes,
    sensor: &Sensor,
    model: &SigmaModel,
) -> Budget {
    let (sigma, whole) = (m.whole.spread.spatial_m, &m.whole);
    // u(s) = s/sqrt(2 nu), with nu independent readings (GUM E.4.3).
    let mut components =
        vec![Component::type_a("scatter of the readings", whole.std_error_m, whole.n_effective)];
    if let Some(flatness) = notes.target.and_then(|t| t.flatness_m) {
        // The board's own shape can only have made sigma larger. It is not subtracted; the whole of it
        // counts as half the width of the interval (GUM F.2.4.5).
        let without = (sigma * sigma - flatness_uncertainty_m(flatness).powi(2)).max(0.0).sqrt();
        let u = (sigma - without) / 3f64.sqrt();
        components.push(Component::type_b("flatness of the target", Distribution::Rectangular, u));
    }
    let stated = sensor.intrinsics_uncertainty.as_ref();
    if let Some([across, down]) = stated.and_then(|i| i.focal_relative(&sensor.camera)) {
        // The slope of the plane scales with the focal length: d theta = sin theta cos theta d f/f.
        let (sin, cos) = m.azimuth_rad.sin_cos();
        let (theta, z) = (m.theta_rad, m.z_m);
        let u = theta.sin() * theta.cos() * (cos * cos * across).hypot(sin * sin * down);
        let component = Component::type_b("tilt, by the focal length", Distribution::Normal, u);
        components.push(component.times("rad", slope_in_tilt(model, z, theta)));
    }
    Budget::of(sigma, components)
}

/// Derivative of the model's axial sigma by theta, m/rad; at an end of its domain from within, as sigma is constant
/// beyond.
fn slope_in_tilt(model: &SigmaModel, z: f64, theta: f64) -> f64 {
    const STEP_RAD: f64 = 1e-3;
    let [low, high] = model.domain.theta_rad;
    let theta = theta.max(low).min(high);
    let [a, b] = [(theta - STEP_RAD).max(low), (theta + STEP_RAD).min(high)];
    if b > a { (model.axial_sigma(z, b) - model.axial_sigma(z, a)) / (b - a) } else { 0.0 }
}

fn conditions(views: &[(&ViewMeasurement, &View)]) -> Conditions {
    let over = |of: &dyn Fn(&ViewMeasurement) -> f64| range(views.iter().map(|(m, _)| of(m)));
    let stated = |of: &dyn Fn(&ViewNotes) -> Option<f64>| {
        let values: Vec<f64> = views.iter().filter_map(|(_, v)| of(&v.notes)).collect();
        (!values.is_empty()).then(|| range(values))
    };
    let frames = views.iter().map(|(m, _)| m.frames);
    let [first, last] = over(&|m| m.time_s);
    Conditions {
        views: views.len(),
        frames: [frames.clone().min().unwrap_or(0), frames.max().unwrap_or(0)],
        distance_m: over(&|m| m.axis_distance_m),
        tilt_rad: over(&|m| m.theta_rad),
        duration_s: last - first,
        temperature_c: stated(&|n| n.temperature_c),
        ambient_lux: stated(&|n| n.ambient_lux),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Direction, PAPER_EQ1};

    /// Eq. 1's sigma across the plane, divided by cos(theta), differentiated by hand.
    #[test]
    fn the_slope_at_an_end_of_the_domain_is_the_formulas() {
        let [a, b, c, d, e, f] = PAPER_EQ1;
        let mut model = SigmaModel::paper();
        model.domain.theta_rad = [0.2, 1.1];
        for (theta, at) in [(0.7, 0.7), (1.1, 1.1), (1.3, 1.1), (0.2, 0.2), (0.0, 0.2)] {
            let z: f64 = 2.0;
            let (far, left) = (d * z.powf(e), f - at);
            let across = a + b * (z - c).powi(2) + far * (at / left).powi(2);
            let slope = far * 2.0 * at * f / left.powi(3);
            let axial = match model.direction {
                Direction::Axial => slope,
                Direction::Perpendicular => (slope + across * at.tan()) / at.cos(),
            };
            let told = slope_in_tilt(&model, z, theta);
            assert!((told / axial - 1.0).abs() < 0.01, "{told} at {theta}, by hand {axial}");
        }
    }
}
