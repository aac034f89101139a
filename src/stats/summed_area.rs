//! Sums over boxes of an image.

use rayon::prelude::*;

/// A summed-area table of `N` numbers per pixel (Crow 1984): sums over any box in four look-ups.
pub struct SummedArea<const N: usize> {
    width: usize,
    height: usize,
    /// Sums above and left of each corner, with a row and a column of zeros before the first.
    sums: Vec<[f64; N]>,
}

impl<const N: usize> SummedArea<N> {
    /// Sums what `of` returns for each pixel, row-major; `None` counts as zero.
    pub fn of(width: usize, height: usize, of: impl Fn(usize) -> Option<[f64; N]> + Sync) -> Self {
        let across = width + 1;
        let mut sums = vec![[0.0; N]; across * (height + 1)];
        // Along the rows, each on its own ...
        sums[across..].par_chunks_mut(across).enumerate().for_each(|(v, line)| {
            let mut running = [0.0; N];
            for u in 0..width {
                if let Some(new) = of(v * width + u) {
                    running.iter_mut().zip(new).for_each(|(r, n)| *r += n);
                }
                line[u + 1] = running;
            }
        });
        // ... then down the columns.
        for v in 2..=height {
            let (above, below) = sums.split_at_mut(v * across);
            for (b, a) in below[..across].iter_mut().zip(&above[(v - 1) * across..]) {
                b.iter_mut().zip(a).for_each(|(b, a)| *b += a);
            }
        }
        SummedArea { width, height, sums }
    }

    /// Sum over columns `u0..u1` and rows `v0..v1`.
    pub fn window(&self, [u0, u1]: [usize; 2], [v0, v1]: [usize; 2]) -> [f64; N] {
        let at = |u: usize, v: usize| &self.sums[v * (self.width + 1) + u];
        let [a, b, c, d] = [at(u1, v1), at(u0, v1), at(u1, v0), at(u0, v0)];
        std::array::from_fn(|k| a[k] - b[k] - c[k] + d[k])
    }

    /// Sum over the pixels within `reach` of (u, v) along either axis.
    pub fn around(&self, u: usize, v: usize, reach: usize) -> [f64; N] {
        let span = |at: usize, end: usize| [at.saturating_sub(reach), (at + reach + 1).min(end)];
        self.window(span(u, self.width), span(v, self.height))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_sum_what_lies_in_them() {
        let (width, height) = (7, 5);
        let of = |i: usize| (i % 4 != 1).then(|| [1.0, (1.7 * i as f64).sin()]);
        let sums = SummedArea::of(width, height, of);
        for (u, v, reach) in [(0, 0, 1), (3, 2, 1), (6, 4, 2), (2, 3, 9)] {
            let mut whole = [0.0; 2];
            for i in 0..width * height {
                let (du, dv) = ((i % width).abs_diff(u), (i / width).abs_diff(v));
                if let Some([n, x]) = of(i).filter(|_| du.max(dv) <= reach) {
                    whole = [whole[0] + n, whole[1] + x];
                }
            }
            let [n, x] = sums.around(u, v, reach);
            assert_eq!(n, whole[0]);
            assert!((x - whole[1]).abs() < 1e-12, "{u} {v} {reach}");
        }
    }
}
