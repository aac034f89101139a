//! Causes that make some pixels noisier than sigma(z, theta) says.

use rand::Rng;

use super::causes_bias::lot;
use super::{Act, Cause, Label, Unit};
use kinoise::rng::Stream;

/// Light of an office, lx.
const OFFICE_LUX: f64 = 500.0;
/// Share of light that white paper gives back.
pub(super) const WHITE: f64 = 0.8;

/// Far away it grows faster.
pub fn range_exponent(strength: f64, rng: &mut Stream) -> Cause {
    let form = lot(&["softplus", "z^4 in quadrature"], rng);
    let label =
        Label::new(Some("range-exponent"), form, ["variance", "z"], &[("growth", 0.5 * strength)]);
    Cause::new(
        label,
        Act::spread(move |s, _| match form {
            "softplus" => 1.0 + 0.2 * strength * ((s.z - 1.8) / 0.5).exp().ln_1p(),
            _ => (1.0 + 0.5 * strength * (s.z / 2.5).powi(4)).sqrt(),
        }),
    )
}

/// The pixel trembles over the slope, ray by ray.
pub fn slope_noise(strength: f64, unit: &Unit) -> Cause {
    let lateral = 0.8 * strength * unit.scale();
    let label = Label::new(
        Some("slope-noise"),
        "trembling rays",
        ["variance", "theta"],
        &[("sigma_lateral_px", lateral)],
    );
    Cause::new(label, Act::Wander(lateral))
}

/// The gradient of disparity stretches the window along the baseline and calms it across.
pub fn tilt_axis_anisotropy(strength: f64) -> Cause {
    let at_60 = 0.5 * strength;
    let label = Label::new(
        Some("tilt-axis-anisotropy"),
        "stretched window, tan^2",
        ["variance", "azimuth"],
        &[("ratio", 1.0 + at_60)],
    );
    let steep2 = 3.0; // tan^2 of 60 degrees
    Cause::new(
        label,
        Act::spread(move |s, f| {
            if !s.on_board {
                return 1.0;
            }
            let (sin, cos) = f.stage.azimuth.sin_cos();
            let stretch = at_60 / steep2 * s.theta.tan().powi(2);
            ((1.0 + stretch * cos * cos) / (1.0 + stretch * sin * sin)).sqrt()
        }),
    )
}

/// The cos^4 law, or a lens that shades only its rim.
pub fn vignetting(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let growth = 0.5 * strength;
    let form = lot(&["cos^-4", "r^4 rim"], rng);
    let label = Label::new(Some("vignetting"), form, ["variance", "radius"], &[("growth", growth)]);
    let fx = unit.sensor.camera.fx;
    let half = 400.0 * unit.scale() / fx;
    let law = |tan2: f64| (1.0 + tan2).powi(2) - 1.0;
    Cause::new(
        label,
        Act::spread(move |s, _| match form {
            "cos^-4" => 1.0 + growth * law(s.x * s.x + s.y * s.y) / law(half * half),
            _ => 1.0 + growth * (0.3 * s.radius.powi(2) + 0.7 * s.radius.powi(4)),
        }),
    )
}

/// Shot noise and a floor: only a part of the variance goes with one over the print's grey.
pub fn intensity_dependent_noise(strength: f64) -> Cause {
    let share = 0.5 * strength;
    let label = Label::new(
        Some("intensity-dependent-noise"),
        "shot noise over a floor",
        ["variance", "intensity"],
        &[("share", share)],
    );
    Cause::new(label, Act::spread(move |s, _| (1.0 + share * (WHITE / s.albedo - 1.0)).sqrt()))
}

/// Background light against the pattern's, which falls with distance and slant.
pub fn ambient_light(strength: f64, rng: &mut Stream) -> Cause {
    let ratio = 0.05 * strength;
    let power = rng.random_range(0.4..0.6);
    let label = Label::new(
        Some("ambient-light"),
        "power law of background over signal",
        ["variance", "intensity"],
        &[("ratio", ratio), ("power", power)],
    );
    Cause::new(
        label,
        Act::spread(move |s, f| {
            let signal = s.facing / s.point.norm_squared();
            (1.0 + ratio * f.lux / OFFICE_LUX / signal).powf(power)
        }),
    )
}
