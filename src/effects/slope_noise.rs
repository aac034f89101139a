//! Lateral noise becomes depth noise on a slope.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage};
use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, Term};

pub struct SlopeNoise;

pub(super) static CARD: Card = Card {
    id: "slope-noise",
    title: "extra noise on slopes",
    stage: Stage::Variance,
    summary: "a pixel does not know to a fraction where it looks: on a slope that is an error of depth, growing with z tan(theta)",
    parameters: &[Parameter {
        name: "sigma_lateral_px",
        range: [0.0, 10.0],
        typical: 0.8,
        summary: "standard deviation of the place a pixel looks at",
    }],
    kinds: SensorKind::MATCHING,
    statistic: "variance",
    axis: "theta",
    confused_with: "the tilt term of the form, which is near nothing below 70 degrees and grows with z^2; tilt-axis-anisotropy, which prefers a direction",
    reference: "Nguyen, Izadi and Lovell 2012: 0.8 px and more",
    is_symptom: true,
    formula_error: 0.07,
    ..Card::BASE
};

impl Effect for SlopeNoise {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let lateral = settings.at(0) / exposure.sensor.camera.fx;
        let seen = exposure.seen;
        for i in 0..exposure.pixels() {
            // Depth gradient on the ray (x, y, 1) of a plane with this normal: z tan(theta) on the axis,
            // more where the plane recedes.
            let [a, b, c] = seen.normal[i].map(f64::from);
            let (x, y) = exposure.rays.at(i);
            let facing = (a * x + b * y + c).abs().max(f64::from(f32::EPSILON));
            let slope = f64::from(seen.depth[i]) * a.hypot(b) / facing;
            exposure.sigma[i] = f64::from(exposure.sigma[i]).hypot(lateral * slope) as f32;
        }
    }

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        let tilted = WIDTHS_PX.map(|px| Basis::Log1p { over: Coordinate::TiltBlur(px) });
        WIDTHS_PX.map(blur).into_iter().chain(tilted).collect()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Log1p {
            over: Coordinate::Blur(lateral_px) | Coordinate::TiltBlur(lateral_px),
        } = *fit.shape
        else {
            return Vec::new();
        };
        // Match the law with coefficient one where this shape's width doubles the variance.
        let doubled = |b: &[f64]| (2f64.powf(b[0]) - 1.0).max(0.0);
        vec![fit.estimate("sigma_lateral_px", &|b| lateral_px * doubled(b).sqrt())]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::variance(blur(settings.at(0)), vec![1.0]))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("sigma_lateral_px", blur(0.2));
        Some(Smallest { parameter, shape, unit: vec![1.0], of: |a| 0.2 * a.sqrt() })
    }
}

/// Steps of the square root of two: a width between two of them is off by a fifth, and its curve by little.
const WIDTHS_PX: [f64; 9] = [0.1, 0.14, 0.2, 0.28, 0.4, 0.57, 0.8, 1.13, 1.6];

/// Lateral noise in the picture, seen through the slope of the target.
fn blur(lateral_px: f64) -> Basis {
    Basis::Log1p { over: Coordinate::Blur(lateral_px) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Plane;
    use crate::simulate::kinect_v1;
    use crate::terms::Pixels;

    /// In depth (times z^2 / (fx b)) the noise is the width times the plane's depth change per pixel, or
    /// times z tan(theta) / fx, which agrees with it on the optical axis alone.
    #[test]
    fn a_width_is_noise_of_the_depth_by_the_slope() {
        const WIDTH_PX: f64 = 0.7;
        let camera = kinect_v1(1).camera;
        let rays = camera.rays();
        let px_m = 0.075 * camera.fx;
        let plane = Plane::tilted(1.5, 0.8, 0.0);
        let pixels = Pixels::new(&camera, &rays, px_m);
        for u in [40.0, camera.cx, 560.0] {
            let (x, _) = camera.ray(u, camera.cy);
            let depth = |x: f64| plane.depth(x, 0.0);
            let z = depth(x);
            let mut place = pixels.place(camera.cy.round() as usize * camera.width);
            (place.x, place.y, place.variance) = (x, 0.0, 1.0);
            place.at_disparity(px_m / z, px_m);
            place.lean_on(&plane, &pixels);
            let in_depth = |over: Coordinate| over.value(&place).sqrt() * z * z / px_m;
            let change = (depth(x + 0.5 / camera.fx) - depth(x - 0.5 / camera.fx)).abs();
            let by_plane = in_depth(Coordinate::Blur(WIDTH_PX));
            assert!((by_plane / (WIDTH_PX * change) - 1.0).abs() < 1e-3, "{u}: {by_plane}");
            let by_tilt = in_depth(Coordinate::TiltBlur(WIDTH_PX));
            let law = WIDTH_PX * z * plane.theta().tan() / camera.fx;
            assert!((by_tilt / law - 1.0).abs() < 1e-9, "{u}: {by_tilt} {law}");
        }
    }
}
