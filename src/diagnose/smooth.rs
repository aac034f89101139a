//! Taking out what is smooth.

/// Side of the box whose mean is taken out, px: several windows, and less than a lens's bowl.
pub const SMOOTH_PX: usize = 49;

/// Minus its mean over a box of `side` px, where at least a quarter of the box is there; NaN elsewhere.
pub fn high_pass(image: &[f32], width: usize, height: usize, side: usize) -> Vec<f32> {
    // Summed-area tables of value and presence.
    let mut sums = vec![(0f64, 0f64); (width + 1) * (height + 1)];
    for v in 0..height {
        let mut row = (0.0, 0.0);
        for u in 0..width {
            let e = image[v * width + u];
            if e.is_finite() {
                row.0 += f64::from(e);
                row.1 += 1.0;
            }
            let above = sums[v * (width + 1) + u + 1];
            sums[(v + 1) * (width + 1) + u + 1] = (above.0 + row.0, above.1 + row.1);
        }
    }
    let half = side / 2;
    (0..width * height)
        .map(|i| {
            let (u, v) = (i % width, i / width);
            let (u0, u1) = (u.saturating_sub(half), (u + half + 1).min(width));
            let (v0, v1) = (v.saturating_sub(half), (v + half + 1).min(height));
            let at = |u: usize, v: usize| sums[v * (width + 1) + u];
            let box_of = |f: fn((f64, f64)) -> f64| {
                f(at(u1, v1)) - f(at(u0, v1)) - f(at(u1, v0)) + f(at(u0, v0))
            };
            let n = box_of(|s| s.1);
            if 4.0 * n < (side * side) as f64 {
                return f32::NAN;
            }
            image[i] - (box_of(|s| s.0) / n) as f32
        })
        .collect()
}
