//! Powers, waves, and broken lines without their straight part.

use std::f64::consts::{PI, TAU};

use super::coordinate::Coordinate;
use super::place::PixelContext;

/// `base` times `scale`, its square, and so on; `scale` itself after the first where there is a
/// level.
pub(super) fn powers(scale: f64, base: f64, level: bool, out: &mut [f64]) {
    let mut term = scale;
    for (k, g) in out.iter_mut().enumerate() {
        if level && k == 1 {
            *g = scale;
            continue;
        }
        term *= base;
        *g = term;
    }
}

/// Sine and cosine of a phase and of its multiples. A patch sees the mean over what it spans of the
/// coordinate.
pub(super) fn waves(over: Coordinate, period: f64, scale: f64, p: &PixelContext, out: &mut [f64]) {
    let (s, c) = (TAU * (over.value(p) / period)).sin_cos();
    let (mut sk, mut ck) = (s, c);
    for (k, pair) in out.chunks_exact_mut(2).enumerate() {
        let size = scale * seen(over, (k + 1) as f64, period, p);
        pair[0] = size * sk;
        pair[1] = size * ck;
        (sk, ck) = (sk * c + ck * s, ck * c - sk * s);
    }
}

/// Columns of stripes are in this unit, px, over their order: so large are bands, and so do the
/// waves of a saw-tooth fall. A coefficient that few columns of the picture decide is then held to
/// it.
const STRIPE_PX: f64 = 0.2;

fn seen(over: Coordinate, order: f64, period: f64, p: &PixelContext) -> f64 {
    match over {
        Coordinate::Column | Coordinate::Row => STRIPE_PX / order * sinc(order * p.side / period),
        Coordinate::Disparity => {
            let frequency = order / period;
            sinc(frequency * p.slope[0] * p.side) * sinc(frequency * p.slope[1] * p.side)
        }
        _ => 1.0,
    }
}

fn sinc(cycles: f64) -> f64 {
    let x = PI * cycles;
    if x.abs() < 1e-6 { 1.0 } else { x.sin() / x }
}

/// Take out of the nodes' weights what a straight line over the nodes is: a surface that is moved
/// or tilted as a whole is a plane again, and no fit to planes can tell how far.
pub(super) fn without_line(weights: &mut [f64]) {
    let n = weights.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let squares = n * (n * n - 1.0) / 12.0;
    let (mut sum, mut moment) = (0.0, 0.0);
    for (k, w) in weights.iter().enumerate() {
        sum += w;
        moment += w * (k as f64 - middle);
    }
    for (k, w) in weights.iter_mut().enumerate() {
        *w -= sum / n + moment / squares * (k as f64 - middle);
    }
}
