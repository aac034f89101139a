//! Causes of error in the mean, of the match and of what is looked at.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};

use rand::Rng;
use statrs::function::erf::erfc;

use super::kernels::roundish;
use super::{Act, Cause, Label, Trace, Unit};
use kinoise::rng::{Seed, Stream};

/// One of `forms`, by lot.
pub(super) fn lot<T: Copy>(forms: &[T], rng: &mut Stream) -> T {
    forms[rng.random_range(0..forms.len())]
}

pub(super) fn sign(rng: &mut Stream) -> f64 {
    lot(&[-1.0, 1.0], rng)
}

/// Leans toward whole pixels: half-way between them the error is greatest, or jumps.
pub fn pixel_locking(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let amplitude = 0.05 * strength * unit.scale();
    let form = lot(&["sawtooth", "triangle", "cubic"], rng);
    let label = Label::new(
        Some("pixel-locking"),
        form,
        ["bias", "disparity-phase"],
        &[("amplitude_px", amplitude)],
    );
    // From -1/2 to 1/2, 0 at a whole pixel.
    let off = |d: f64| d - d.round();
    Cause::new(
        label,
        Act::mismatch(move |s, _| {
            let t = off(s.disparity);
            let wave = match form {
                "sawtooth" => 2.0 * t,
                "triangle" => 1.0 - (4.0 * t.abs() - 1.0).abs(),
                // t (1/4 - t^2) is greatest, 1/(12 sqrt 3), at 1/sqrt 12.
                _ => 12.0 * 3f64.sqrt() * t * (0.25 - t * t),
            };
            let wave = if form == "triangle" { wave * t.signum() } else { wave };
            -amplitude * wave
        }),
    )
}

/// The firmware takes a ramp over the columns away in whole steps of the read-out.
pub fn column_banding(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let scale = unit.scale();
    let step = 0.125 * strength * scale;
    let period = scale * rng.random_range(40.0..200.0);
    let kappa = step / period;
    let start = rng.random_range(0.0..unit.sensor.camera.width as f64);
    let label = Label::new(
        Some("column-banding"),
        "steps of a rounded ramp",
        ["bias", "column"],
        &[("amplitude_px", step / 2.0), ("period_px", period)],
    );
    Cause::new(
        label,
        Act::mismatch(move |s, _| {
            let ramp = kappa * (s.u - start);
            (ramp / step).round() * step - ramp
        }),
    )
}

/// A bowl of disparity about the principal point, 0 in the middle, `k` at the corner.
pub fn radial_disparity_bias(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let k = sign(rng) * 0.25 * strength * unit.scale();
    let form = lot(&["1 - cos", "r^2 and r^4", "gaussian well"], rng);
    let label = Label::new(Some("radial-disparity-bias"), form, ["bias", "radius"], &[("k_px", k)]);
    Cause::new(
        label,
        Act::mismatch(move |s, _| {
            let r = s.radius;
            k * match form {
                "1 - cos" => 1.0 - (FRAC_PI_2 * r).cos(),
                "r^2 and r^4" => 0.4 * r.powi(2) + 0.6 * r.powi(4),
                _ => (1.0 - (-r * r).exp()) / (1.0 - (-1f64).exp()),
            }
        }),
    )
}

/// The division model: ray = bent / (1 + lambda r^2).
pub fn lens_distortion(strength: f64, rng: &mut Stream) -> Cause {
    let lambda = sign(rng) * 0.03 * strength;
    let label = Label::new(
        Some("lens-distortion"),
        "division model",
        ["bias", "radius"],
        &[("k1", lambda)],
    );
    let bend = move |x: f64, y: f64| {
        let by = 1.0 + lambda * (x * x + y * y);
        (x / by, y / by)
    };
    Cause::new(label, Act::Ray(Box::new(bend)))
}

/// A bent board, `half` m from its middle to its end.
pub fn target_bow(strength: f64, half: f64, rng: &mut Stream) -> Cause {
    let sagitta = sign(rng) * 0.004 * strength;
    let form = lot(&["circle arc", "catenary", "gaussian bump"], rng);
    let label = Label::new(
        Some("target-bow"),
        form,
        ["bias", "target-position"],
        &[("sagitta_m", sagitta), ("span_m", 2.0 * half)],
    );
    let radius = (half * half + sagitta * sagitta) / (2.0 * sagitta.abs());
    let lift = move |[p, q]: [f64; 2]| match form {
        "circle arc" => {
            let arc = (radius * radius - p * p).max(0.0).sqrt() - (radius - sagitta.abs());
            sagitta.signum() * arc
        }
        "catenary" => sagitta * (1.0 - ((p / half).cosh() - 1.0) / (1f64.cosh() - 1.0)),
        _ => sagitta * (-(p * p + q * q) / (2.0 * (0.5 * half).powi(2))).exp(),
    };
    Cause::new(label, Act::Lift(Box::new(lift)))
}

/// The board slides along its normal, and is slowed or hurried.
pub fn target_motion(strength: f64, rng: &mut Stream) -> Cause {
    let velocity = sign(rng) * 0.005 * strength;
    // Over the few tenths of a second of a view.
    let acceleration = velocity * rng.random_range(-0.5..0.5);
    let label = Label::new(
        Some("target-motion"),
        "accelerated",
        ["bias", "frame"],
        &[("velocity_mps", velocity)],
    );
    let gone = move |c: &super::Clock| c.view_s * (velocity + 0.5 * acceleration * c.view_s);
    Cause::new(label, Act::Move(Box::new(gone)))
}

/// Every pixel's own constant: uniform, not Gaussian.
pub fn fixed_pattern_noise(strength: f64, unit: &Unit, seed: Seed) -> Cause {
    let sigma = 0.05 * strength * unit.scale();
    let mut rng = seed.stream("rays/fixed pattern");
    let width = unit.sensor.camera.width;
    let own: Vec<f32> = (0..unit.sensor.camera.pixels()).map(|_| roundish(&mut rng)).collect();
    let label = Label::new(
        Some("fixed-pattern-noise"),
        "sum of four uniforms",
        ["bias", "pixel"],
        &[("sigma_px", sigma)],
    );
    let at = move |s: &super::Site, _: &super::Facts<'_>| {
        sigma * f64::from(own[s.v as usize * width + s.u as usize])
    };
    Cause::new(label, Act::Mismatch(Box::new(at))).tracing(Trace::Pixels(sigma))
}

/// A footprint with soft edges sees two surfaces: their disparities mix by the share of each. Below
/// strength 1 only a part of the light is spread so.
pub fn edge_mixing(strength: f64, unit: &Unit) -> Cause {
    let (width, part) = (2.0 * strength.max(1.0) * unit.scale().max(0.5), strength.min(1.0));
    let label = Label::new(
        Some("edge-mixing"),
        "gaussian footprint, mixed in disparity",
        ["bias", "edge-distance"],
        &[("width_px", width), ("part", part)],
    )
    .within(0.0, width);
    Cause::new(
        label,
        Act::mismatch(move |s, _| {
            let share = part * 0.5 * erfc(s.edge_px.abs() * FRAC_1_SQRT_2 / (0.5 * width));
            s.other_disparity.map_or(0.0, |other| share * (other - s.disparity))
        }),
    )
}

/// One period from 0 to 1.
pub(super) fn wave(phase: f64) -> f64 {
    (TAU * phase).sin()
}

/// 0 to 1 and smooth, over `width` about `middle`.
pub(super) fn smooth_step(x: f64, middle: f64, width: f64) -> f64 {
    let t = ((x - middle) / width + 0.5).clamp(0.0, 1.0);
    0.5 * (1.0 - (PI * t).cos())
}
