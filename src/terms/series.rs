//! Evaluates powers, waves, piecewise-linear curves without their straight part, and linear, bilinear and
//! cubic interpolation.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;

use super::coordinate::Coordinate;
use super::modulation::Modulation;
use super::place::PixelContext;

/// `scale` times `base`, its square, and so on, `orders` of them; with `level`, `scale` itself comes second.
pub(super) fn powers(
    [scale, base]: [f64; 2],
    orders: usize,
    level: bool,
    mut see: impl FnMut(usize, f64),
) {
    let mut term = scale;
    for k in 0..orders {
        term *= base;
        see(k + usize::from(level && k > 0), term);
    }
    if level {
        see(1, scale);
    }
}

/// Columns of a lens. A spot at (x, y) is seen at (x, y) (1 + k r^2n). Its pixel then shows the disparity of
/// another ray, and its shift against the reference is scaled by the derivative of x (1 + k r^2n) by x.
pub(super) fn lens(
    [fx, fy]: [f64; 2],
    reference_px: f64,
    orders: usize,
    p: &PixelContext,
    mut see: impl FnMut(usize, f64),
) {
    let square = p.x * p.x + p.y * p.y;
    let elsewhere = Modulation::RadialSlope { fx, fy }.value(p);
    let shift = p.disparity - reference_px;
    let mut power = 1.0;
    for n in 0..orders {
        let stretch = square + 2.0 * (n + 1) as f64 * p.x * p.x;
        see(n, power * (square * elsewhere + stretch * shift));
        power *= square;
    }
}

/// Sine and cosine of a coordinate's phase and of its multiples, averaged over the patch's span of the
/// coordinate.
pub(super) fn waves(
    (over, period, harmonics): (Coordinate, f64, usize),
    scale: f64,
    p: &PixelContext,
    mut see: impl FnMut(usize, f64),
) {
    let first = turned(over.value(p) / period);
    let mut turn = first;
    let mut seen = seen(over, period, p);
    for k in 0..harmonics {
        let size = scale * seen();
        see(2 * k, size * turn.im);
        see(2 * k + 1, size * turn.re);
        turn *= first;
    }
}

/// Cosine and sine of an angle; its powers are those of the angle's multiples.
fn turned(cycles: f64) -> Complex<f64> {
    Complex::cis(TAU * cycles)
}

/// Unit of the columns of stripes, px, to be divided by their order: bands are this large, and the waves of a
/// saw-tooth fall off so. A coefficient that few columns of the picture determine is then held to it.
const STRIPE_PX: f64 = 0.2;

/// Size of a wave over the patch and, call by call, of its harmonics.
fn seen(over: Coordinate, period: f64, p: &PixelContext) -> impl FnMut() -> f64 {
    let spans = match over {
        Coordinate::Column | Coordinate::Row => [p.side, 0.0],
        Coordinate::Disparity => p.slope.map(|slope| slope * p.side),
        _ => [0.0; 2],
    };
    let stripes = matches!(over, Coordinate::Column | Coordinate::Row);
    let mut means = spans.map(|span| sincs(span / period));
    let mut order = 0.0;
    move || {
        order += 1.0;
        let unit = if stripes { STRIPE_PX / order } else { 1.0 };
        means.iter_mut().fold(unit, |size, mean| size * mean())
    }
}

/// Yields sin(k x) / (k x) for x = pi `cycles` and k = 1, 2, ...
fn sincs(cycles: f64) -> impl FnMut() -> f64 {
    const NOTHING: f64 = 1e-6;
    let x = PI * cycles;
    let first = if x.abs() < NOTHING { turned(0.0) } else { turned(0.5 * cycles) };
    let (mut turn, mut order) = (first, 0.0);
    move || {
        order += 1.0;
        let mean = if x.abs() < NOTHING { 1.0 } else { turn.im / (order * x) };
        turn *= first;
        mean
    }
}

/// Hat function of node `k` at a `place` between the nodes, without its straight line over the nodes: a
/// surface that is moved or tilted as a whole is a plane again, and no fit to planes can tell how far.
pub(super) fn hat_without_line(k: usize, place: f64, nodes: usize) -> f64 {
    let (k, n) = (k as f64, nodes as f64);
    let middle = 0.5 * (n - 1.0);
    let squares = n * (n * n - 1.0) / 12.0;
    let hat = (1.0 - (place - k).abs()).max(0.0);
    hat - 1.0 / n - (place - middle) / squares * (k - middle)
}

/// Index of the node below a value, and the fraction of the way to the next.
pub(super) fn node(value: f64, low: f64, high: f64, nodes: usize) -> (usize, f64) {
    let last = (nodes - 1) as f64;
    let place = ((value - low) / (high - low).max(1e-12) * last).clamp(0.0, last);
    let k = (place as usize).min(nodes - 2);
    (k, place - k as f64)
}

/// Weights of the four nodes of a map about a place.
pub(super) fn bilinear(
    [(i, s), (j, t)]: [(usize, f64); 2],
    across: usize,
    scale: f64,
    mut see: impl FnMut(usize, f64),
) {
    for (j, y) in [(j, 1.0 - t), (j + 1, t)] {
        see(j * across + i, scale * (1.0 - s) * y);
        see(j * across + i + 1, scale * s * y);
    }
}

/// Bilinear interpolation of a map with these values at its nodes.
pub(super) fn interpolated(
    nodes: &[f64],
    across: usize,
    (i, s): (usize, f64),
    (j, t): (usize, f64),
) -> f64 {
    let along = |j: usize| nodes[j * across + i] * (1.0 - s) + nodes[j * across + i + 1] * s;
    along(j) * (1.0 - t) + along(j + 1) * t
}

/// Indices of the nodes before and after a value on a circle of this period, and the fraction of the way
/// between them.
pub(super) fn on_ring(value: f64, period: f64, nodes: usize) -> ([usize; 2], f64) {
    let place = (value / period).rem_euclid(1.0) * nodes as f64;
    let k = place as usize % nodes;
    ([k, (k + 1) % nodes], place.fract())
}

/// Cubic B-splines on `nodes` even places from 0 to `last`: the index of the first of the four that are
/// non-zero at `at`, and their values, which sum to one (de Boor 1978).
pub(super) fn cubic(at: f64, last: f64, nodes: usize) -> (usize, [f64; 4]) {
    let spans = nodes - 3;
    let place = (at / last.max(1e-12) * spans as f64).clamp(0.0, spans as f64);
    let k = (place as usize).min(spans - 1);
    let t = place - k as f64;
    let s = 1.0 - t;
    let inner = |a: f64| (3.0 * a * a * a - 6.0 * a * a + 4.0) / 6.0;
    (k, [s * s * s / 6.0, inner(t), inner(s), t * t * t / 6.0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A patch sees the mean of a wave and its harmonics over its pixels; a coordinate that is constant in it
    /// is seen whole.
    #[test]
    fn a_patch_sees_the_mean_over_what_it_spans() {
        const STEPS: usize = 2000;
        for (over, side, slope, period) in [
            (Coordinate::Column, 4.0, [0.0; 2], 37.0),
            (Coordinate::Row, 8.0, [0.0; 2], 9.0),
            (Coordinate::Disparity, 4.0, [0.07, -0.02], 1.0),
            (Coordinate::Disparity, 4.0, [0.0; 2], 1.0),
        ] {
            let place = PixelContext {
                u: 51.0,
                v: 23.0,
                disparity: 17.3,
                slope,
                side,
                ..Default::default()
            };
            let mut seen = [0.0; 6];
            waves((over, period, 3), 1.0, &place, |k, g| seen[k] = g);
            let mut means = [0.0; 6];
            let along = |k: usize| ((k as f64 + 0.5) / STEPS as f64 - 0.5) * side;
            for (k, l) in (0..STEPS).flat_map(|k| (0..STEPS / 40).map(move |l| (k, 40 * l + 20))) {
                let (du, dv) = (along(k), along(l));
                let moved = slope[0] * du + slope[1] * dv;
                let point = PixelContext {
                    u: place.u + du,
                    v: place.v + dv,
                    disparity: place.disparity + moved,
                    side: 0.0,
                    ..place
                };
                let mut row = [0.0; 6];
                waves((over, period, 3), 1.0, &point, |k, g| row[k] = g);
                let share = 1.0 / (STEPS * (STEPS / 40)) as f64;
                means.iter_mut().zip(row).for_each(|(m, r)| *m += share * r);
            }
            for (seen, mean) in seen.iter().zip(means) {
                assert!((seen - mean).abs() < 2e-4, "{over:?}: {seen} {mean}");
            }
        }
    }

    /// Compared with the rays themselves: spots of a tilted plane and of the reference, both seen through the
    /// lens.
    #[test]
    fn a_matcher_behind_a_lens_finds_what_the_columns_say() {
        let (f, scale) = (580.0, 43.5);
        let (at_reference, normal) = (scale / 1.5, [0.3, -0.2, 0.9]);
        let disparity = |x: f64, y: f64| scale * (normal[0] * x + normal[1] * y + normal[2]) / 1.2;
        for (n, k) in [(1, 1e-4), (2, -2e-4)] {
            let mut sums = [0.0; 2];
            let seen = |x: f64, y: f64| 1.0 + k * (x * x + y * y).powi(n);
            for (x, y) in [(0.4, 0.3), (-0.5, 0.1), (0.0, -0.35), (0.2, 0.0)] {
                // The same dot falls on the reference beside it, in the projector's direction.
                let found = |x: f64, y: f64| {
                    let shift = (disparity(x, y) - at_reference) / f;
                    let reference = x - shift;
                    // The matcher searches along the row; the spot's row is displaced a little, too.
                    f * (x * seen(x, y) - reference * seen(reference, y)) + at_reference
                };
                let (u, v) = (x * seen(x, y), y * seen(x, y));
                let error = found(x, y) - disparity(u, v);
                let place = PixelContext {
                    x: u,
                    y: v,
                    disparity: disparity(u, v),
                    slope: [normal[0], normal[1]].map(|s| scale * s / 1.2 / f),
                    ..PixelContext::default()
                };
                let mut row = [0.0; 2];
                lens([f, f], at_reference, 2, &place, |k, g| row[k] = g);
                let said = k * row[n as usize - 1];
                // Taylor's remainder, of the second order in the shift and in k.
                let order = f64::from(n);
                let shift = (disparity(x, y) - at_reference).abs() / f;
                let r = x.hypot(y) + shift;
                let curved = order * (2.0 * order + 1.0) * r.powi(2 * n - 1) * shift * shift;
                let bound = f * k.abs() * (curved + 10.0 * k.abs());
                assert!((error - said).abs() < bound, "{n} {x} {y}: {error} {said} {bound}");
                sums = [sums[0] + (error - said).abs(), sums[1] + said.abs()];
            }
            assert!(sums[0] < 0.1 * sums[1], "{n}: {sums:?}");
        }
    }

    #[test]
    fn splines_sum_to_one_and_bend_smoothly() {
        for nodes in [4, 5, 20] {
            let mut before = [0.0; 32];
            for step in 0..=1000 {
                let (k, w) = cubic(f64::from(step) * 0.639, 639.0, nodes);
                assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{nodes} {step}");
                assert!(k + 4 <= nodes && w.iter().all(|w| *w >= 0.0));
                let mut now = [0.0; 32];
                now[k..k + 4].copy_from_slice(&w);
                let moved =
                    now.iter().zip(&before).map(|(a, b)| f64::abs(a - b)).fold(0.0, f64::max);
                assert!(step == 0 || moved < 0.02, "{nodes} {step}: {moved}");
                before = now;
            }
        }
    }
}
