//! Causes in what the driver makes of the match.

use rand::Rng;

use super::causes_bias::{lot, sign};
use super::{Act, Cause, Label, Trace, Unit};
use kinoise::rng::Stream;

/// Matches come in steps, counted from a reference that is no whole number of them.
pub fn disparity_quantisation(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let step = 0.125 * strength * unit.scale();
    let phase = rng.random_range(0.0..1.0);
    let label = Label::new(
        Some("disparity-quantisation"),
        "steps from a reference disparity",
        ["distribution", "disparity-phase"],
        &[("step_px", step)],
    );
    Cause::new(label, Act::Lattice { step, phase }).tracing(Trace::Comb)
}

/// Cut off, not rounded.
pub fn depth_rounding(strength: f64) -> Cause {
    let step = 0.002 * strength;
    let label =
        Label::new(Some("depth-rounding"), "floor", ["distribution", "z"], &[("step_m", step)]);
    Cause::new(label, Act::Floor(step)).tracing(Trace::Comb)
}

/// The ray's length, or what a driver with a wrong focal length makes of it.
pub fn range_not_depth(strength: f64) -> Cause {
    let share = strength.powf(1.5).min(1.0);
    let label = Label::new(
        Some("range-not-depth"),
        if share < 1.0 { "half undone" } else { "ray length" },
        ["bias", "radius"],
        &[("share", share)],
    );
    Cause::new(
        label,
        Act::gain(move |s, _| {
            let r2 = s.x * s.x + s.y * s.y;
            ((1.0 + r2) / (1.0 + (1.0 - share) * r2)).sqrt()
        }),
    )
}

/// Triangulated with a baseline that is not the unit's.
pub fn depth_scale(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let believed_m = unit.baseline_m * (1.0 + sign(rng) * 0.02 * strength);
    let scale = believed_m / unit.baseline_m;
    let label =
        Label::new(Some("depth-scale"), "wrong baseline", ["bias", "z"], &[("scale", scale)]);
    Cause::new(label, Act::gain(move |_, _| scale))
}

/// The reference plane stands elsewhere than the driver believes.
pub fn disparity_offset(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let reference_m = rng.random_range(1.2..2.5);
    let offset = sign(rng) * 0.1 * strength * unit.scale();
    // By how much the reference plane is off to shift the pattern that far.
    let off_m = offset * reference_m * reference_m / unit.disparity_px_m();
    let wrong = unit.disparity_px_m() * (1.0 / reference_m - 1.0 / (reference_m + off_m));
    let label = Label::new(
        Some("disparity-offset"),
        "reference plane misplaced",
        ["bias", "z"],
        &[("offset_px", wrong)],
    );
    Cause::new(label, Act::mismatch(move |_, _| wrong))
}

/// Warm-up, its approach not exponential.
pub fn thermal_drift(strength: f64, rng: &mut Stream) -> Cause {
    let relative = sign(rng) * 0.004 * strength;
    let tau_s = rng.random_range(500.0..1200.0);
    let form = lot(&["tanh", "t / (t + tau)"], rng);
    let label = Label::new(
        Some("thermal-drift"),
        form,
        ["bias", "session-time"],
        &[("relative", relative), ("time_constant_s", tau_s)],
    );
    Cause::new(
        label,
        Act::gain(move |_, f| {
            let t = f.session_s / tau_s;
            let warmth = if form == "tanh" { t.tanh() } else { t / (0.6 + t) };
            1.0 + relative * warmth
        }),
    )
}
