//! Sums and means over boxes of an image.

/// Side of the box whose mean is taken out, px: several windows, and less than a lens's bowl.
pub const SMOOTH_PX: usize = 49;

/// Sums over boxes of an image, by a summed-area table (Crow 1984).
pub struct BoxSums {
    /// Sum and number of the finite pixels above and left of each corner.
    table: Vec<[f64; 2]>,
    width: usize,
    height: usize,
}

impl BoxSums {
    pub fn of(image: &[f32], width: usize, height: usize) -> Self {
        let mut table = vec![[0.0; 2]; (width + 1) * (height + 1)];
        for v in 0..height {
            let mut row = [0.0; 2];
            for u in 0..width {
                let r = image[v * width + u];
                if r.is_finite() {
                    row[0] += f64::from(r);
                    row[1] += 1.0;
                }
                let above = table[v * (width + 1) + u + 1];
                table[(v + 1) * (width + 1) + u + 1] = [above[0] + row[0], above[1] + row[1]];
            }
        }
        BoxSums { table, width, height }
    }

    /// Sum and number of the finite pixels no farther than `reach` px from (u, v) along either axis.
    pub fn around(&self, u: usize, v: usize, reach: usize) -> [f64; 2] {
        let (u0, u1) = (u.saturating_sub(reach), (u + reach + 1).min(self.width));
        let (v0, v1) = (v.saturating_sub(reach), (v + reach + 1).min(self.height));
        let at = |u: usize, v: usize| self.table[v * (self.width + 1) + u];
        let [a, b, c, d] = [at(u1, v1), at(u0, v1), at(u1, v0), at(u0, v0)];
        [a[0] - b[0] - c[0] + d[0], a[1] - b[1] - c[1] + d[1]]
    }
}

/// Minus its mean over a box of `side` px, where at least a quarter of the box is there; NaN elsewhere.
pub fn high_pass(image: &[f32], width: usize, height: usize, side: usize) -> Vec<f32> {
    let sums = BoxSums::of(image, width, height);
    let minus_mean = |i: usize| {
        let [sum, n] = sums.around(i % width, i / width, side / 2);
        if 4.0 * n < (side * side) as f64 { f32::NAN } else { image[i] - (sum / n) as f32 }
    };
    (0..width * height).map(minus_mean).collect()
}
