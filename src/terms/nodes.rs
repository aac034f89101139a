//! Values between nodes: straight, bilinear and cubic.

/// Number of the node below a value, and the way to the next.
pub(super) fn node(value: f64, low: f64, high: f64, nodes: usize) -> (usize, f64) {
    let last = (nodes - 1) as f64;
    let place = ((value - low) / (high - low).max(1e-12) * last).clamp(0.0, last);
    let k = (place as usize).min(nodes - 2);
    (k, place - k as f64)
}

pub(super) fn bilinear(
    (i, s): (usize, f64),
    (j, t): (usize, f64),
    across: usize,
    scale: f64,
    out: &mut [f64],
) {
    out.fill(0.0);
    for (dj, wv) in [(0, 1.0 - t), (1, t)] {
        for (di, wu) in [(0, 1.0 - s), (1, s)] {
            out[(j + dj) * across + i + di] = scale * wu * wv;
        }
    }
}

/// The value there of a bilinear map with these values at its nodes.
pub(super) fn interpolated(
    nodes: &[f64],
    across: usize,
    (i, s): (usize, f64),
    (j, t): (usize, f64),
) -> f64 {
    let along = |j: usize| nodes[j * across + i] * (1.0 - s) + nodes[j * across + i + 1] * s;
    along(j) * (1.0 - t) + along(j + 1) * t
}

/// Numbers of the nodes before and after a value on a circle of this period, and the way from one to
/// the other.
pub(super) fn on_ring(value: f64, period: f64, nodes: usize) -> ([usize; 2], f64) {
    let place = (value / period).rem_euclid(1.0) * nodes as f64;
    let k = place as usize % nodes;
    ([k, (k + 1) % nodes], place.fract())
}

/// Cubic B-splines on `nodes` even places from 0 to `last`: the number of the first of the four that
/// are not zero at `at`, and their values, which sum to one (de Boor 1978).
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
