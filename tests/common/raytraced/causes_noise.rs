//! Causes in how the noise hangs together, and in how far it strays.

use std::f64::consts::TAU;

use rand::Rng;
use rand_distr::{ChiSquared, Distribution, Exp1};

use super::causes_bias::lot;
use super::kernels::{Window, fresh, roundish, white};
use super::{Act, Cause, Clock, Label, Phase, Trace, Unit};
use kinoise::rng::{Seed, Stream};

fn stream(clock: &Clock, what: &str) -> Stream {
    clock.seed.stream(&format!("rays/{what}/{}/{}", clock.view, clock.frame))
}

/// Student's t of unit variance, or a few Laplace errors among Gaussian ones.
pub fn heavy_tails(strength: f64, rng: &mut Stream) -> Cause {
    let tails = ["distribution", "residual"];
    let id = Some("heavy-tails");
    if lot(&[true, false], rng) {
        let nu = 3.0 + 2.0 / strength;
        let chi = ChiSquared::new(nu).expect("more than three degrees of freedom");
        let widen = move |field: &mut [f32], clock: &Clock| {
            let mut rng = stream(clock, "student");
            let scale = (nu - 2.0).sqrt();
            field.iter_mut().for_each(|x| *x *= (scale / chi.sample(&mut rng).sqrt()) as f32);
        };
        let label = Label::new(id, "student", tails, &[("nu", nu)]);
        return Cause::new(label, Act::grain(Phase::Tails, widen)).tracing(Trace::Student(nu));
    }
    let (fraction, scale) = (0.015 * strength, rng.random_range(3.0..5.0));
    let stray = move |field: &mut [f32], clock: &Clock| {
        let mut rng = stream(clock, "laplace");
        for x in field {
            if rng.random::<f32>() < fraction as f32 {
                let away: f32 = Exp1.sample(&mut rng);
                *x = scale * away * x.signum();
            }
        }
    };
    let parameters = [("fraction", fraction), ("scale", f64::from(scale) * 2f64.sqrt())];
    let label = Label::new(id, "laplace mixture", tails, &parameters);
    let trace = Trace::Stray { fraction, scale: f64::from(scale) };
    Cause::new(label, Act::grain(Phase::Tails, stray)).tracing(trace)
}

/// Neighbours share a window that is not a flat one; below strength 1 they share it for a part of
/// the noise only, and the read-out adds the rest.
pub fn spatial_correlation(strength: f64, rng: &mut Stream) -> Cause {
    let side = 7.0 * strength.max(1.0);
    let bell = lot(&[true, false], rng);
    let window = if bell { Window::bell(side) } else { Window::tent(side) };
    let form = if bell { "gaussian window" } else { "triangular window" };
    if strength < 1.0 { shared(form, window, strength) } else { windowed(form, window) }
}

/// The noise seen through `window`.
pub fn windowed(form: &'static str, window: Window) -> Cause {
    let label = Label::new(
        Some("spatial-correlation"),
        form,
        ["correlation", "pixel-lag"],
        &[("length_px", window.side())],
    );
    let trace = Trace::Window { window: window.clone(), share: 1.0 };
    let blur = move |field: &mut [f32], clock: &Clock| window.blur(field, clock.width);
    Cause::new(label, Act::grain(Phase::InSpace, blur)).tracing(trace)
}

/// `share` of the variance comes through `window`, the rest is each pixel's own.
fn shared(form: &'static str, window: Window, share: f64) -> Cause {
    let Cause { mut label, .. } = windowed(form, window.clone());
    label.parameters.insert("share".into(), share.into());
    let trace = Trace::Window { window: window.clone(), share };
    let (through, own) = (share.sqrt() as f32, (1.0 - share).sqrt() as f32);
    let mix = move |field: &mut [f32], clock: &Clock| {
        let mut seen = white(field.len(), stream(clock, "matched"));
        window.blur(&mut seen, clock.width);
        field.iter_mut().zip(seen).for_each(|(x, s)| *x = own * *x + through * s);
    };
    Cause::new(label, Act::grain(Phase::InSpace, mix)).tracing(trace)
}

/// A moving average over two frames, the earlier the weaker; beyond strength 1 over three.
pub fn temporal_correlation(strength: f64) -> Cause {
    let weights = if strength <= 1.0 {
        vec![1.0, strength]
    } else {
        vec![1.0, 1.0, (strength - 1.0).min(1.0)]
    };
    let norm = weights.iter().map(|w| w * w).sum::<f64>();
    let rho = weights.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / norm;
    let label = Label::new(
        Some("temporal-correlation"),
        "moving average",
        ["correlation", "frame"],
        &[("rho", rho), ("frames", weights.len() as f64)],
    );
    let trace = Trace::Average(weights.iter().map(|w| w / norm.sqrt()).collect());
    let weights: Vec<f32> = weights.iter().map(|w| (w / norm.sqrt()) as f32).collect();
    let average = move |field: &mut [f32], clock: &Clock| {
        field.iter_mut().for_each(|x| *x *= weights[0]);
        for (ago, weight) in weights.iter().enumerate().skip(1) {
            let earlier = fresh(clock.seed, clock.view, clock.frame - ago as i64, field.len());
            field.iter_mut().zip(earlier).for_each(|(x, e)| *x += weight * e);
        }
    };
    Cause::new(label, Act::grain(Phase::InTime, average)).tracing(trace)
}

/// Grain that stands still within a view: a sum of uniforms.
pub fn frozen_noise(strength: f64) -> Cause {
    let fraction = strength / (strength + 0.5);
    let label = Label::new(
        Some("frozen-noise"),
        "sum of four uniforms",
        ["correlation", "frame"],
        &[("fraction", fraction)],
    );
    let (still, alive) = (fraction.sqrt() as f32, (1.0 - fraction).sqrt() as f32);
    let mix = move |field: &mut [f32], clock: &Clock| {
        let mut rng = stream(&Clock { frame: 0, ..*clock }, "grain");
        field.iter_mut().for_each(|x| *x = alive * *x + still * roundish(&mut rng));
    };
    Cause::new(label, Act::grain(Phase::AtRest, mix)).tracing(Trace::Frozen(fraction))
}

/// Each row's own shift: uniform.
pub fn row_noise(strength: f64, unit: &Unit) -> Cause {
    let sigma = 0.03 * strength * unit.scale();
    let label =
        Label::new(Some("row-noise"), "uniform", ["correlation", "row"], &[("sigma_px", sigma)]);
    let half = (sigma * 3f64.sqrt()) as f32;
    let shift = move |clock: &Clock, shake: &mut super::Shake| {
        let mut rng = stream(clock, "rows");
        shake.rows.iter_mut().for_each(|row| *row += rng.random_range(-half..half));
    };
    Cause::new(label, Act::shake(shift)).tracing(Trace::Rows(sigma))
}

/// The mount swings: a sine met at a random phase in every view.
pub fn frame_jitter(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let sigma = 0.03 * strength * unit.scale();
    let hertz = rng.random_range(7.0..13.0);
    let label = Label::new(
        Some("frame-jitter"),
        "vibration",
        ["correlation", "frame"],
        &[("sigma_px", sigma), ("hertz", hertz)],
    );
    let swing = move |clock: &Clock, shake: &mut super::Shake| {
        let phase: f64 = view_phase(clock.seed, clock.view);
        let shift = sigma * 2f64.sqrt() * (TAU * (hertz * clock.view_s + phase)).sin();
        shake.rows.iter_mut().for_each(|row| *row += shift as f32);
    };
    Cause::new(label, Act::shake(swing)).tracing(Trace::Frames(sigma))
}

fn view_phase(seed: Seed, view: usize) -> f64 {
    seed.stream(&format!("rays/phase/{view}")).random()
}
