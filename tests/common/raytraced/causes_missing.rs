//! Causes of pixels without an answer.

use std::f64::consts::{LN_2, SQRT_2};

use rand::Rng;
use statrs::function::erf::erfc;

use super::causes_bias::lot;
use super::geometry::shaded;
use super::{Act, Cause, Label, Unit};
use kinoise::rng::Stream;

/// Rises from 0 to 1, one half at 0.
fn rise(form: &str, t: f64) -> f64 {
    match form {
        "normal cdf" => 0.5 * erfc(-t / SQRT_2),
        _ => (-LN_2 * (-t).exp()).exp(),
    }
}

/// Beyond an angle.
pub fn grazing_dropout(strength: f64, rng: &mut Stream) -> Cause {
    let (middle, width) = (66.0 - 6.0 * strength.log2(), rng.random_range(2.0..4.0));
    let form = lot(&["normal cdf", "gompertz"], rng);
    let label = Label::new(
        Some("grazing-dropout"),
        form,
        ["missing", "theta"],
        &[("theta50_deg", middle), ("width_deg", width)],
    )
    .within((middle - width).min(89.0).to_radians(), std::f64::consts::FRAC_PI_2);
    Cause::new(label, Act::loss(move |s, _| rise(form, (s.theta.to_degrees() - middle) / width)))
}

/// Beyond a distance, or short of one.
pub fn range_dropout(strength: f64, rng: &mut Stream) -> Cause {
    let near = rng.random_range(0..4) == 0;
    let middle = if near { 0.95 + 0.1 * strength.log2() } else { 3.0 - 0.4 * strength.log2() };
    let width = rng.random_range(0.08..0.2) * if near { -0.5 } else { 1.0 };
    let form = lot(&["normal cdf", "gompertz"], rng);
    let interval = if near { [0.0, middle - width] } else { [middle - width, 10.0] };
    let label = Label::new(
        Some("range-dropout"),
        form,
        ["missing", "z"],
        &[("z50_m", middle), ("width_m", width)],
    )
    .within(interval[0], interval[1]);
    Cause::new(label, Act::loss(move |s, _| rise(form, (s.z - middle) / width)))
}

/// The board stands in the projector's light; `share` of the pixels there go without an answer.
pub fn occlusion_shadow(share: f64, unit: &Unit) -> Cause {
    let baseline_m = unit.baseline_m;
    let label = Label::new(
        Some("occlusion-shadow"),
        "shadow rays",
        ["missing", "edge-distance"],
        &[("share", share)],
    );
    Cause::new(
        label,
        Act::loss(
            move |s, f| {
                if !s.on_board && shaded(f.stage, baseline_m, &s.point) { share } else { 0.0 }
            },
        ),
    )
}
