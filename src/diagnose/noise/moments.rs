//! Third moment of the noise, and its excess kurtosis corrected for a noise level that
//! varies over the picture.
//!
//! Noise of a standard deviation s(u, v) that varies over the picture has a fourth moment of 3 (1 + c), as if
//! it had heavy tails; c is the variance of s^2 over its squared mean. Two Gaussian pixels close enough to
//! share s, with correlation rho, have E x^2 y^2 = (1 + c) (1 + 2 rho^2). So
//!
//! ```text
//! excess = E x^4 - 3 E x^2 y^2 / (1 + 2 rho^2)        x, y of unit variance
//! ```
//!
//! is zero for Gaussian noise whose s changes little from x to y. An uneven noise level adds no third moment.

use super::tail_counts::{MIN_READINGS, patches};

/// Residuals beyond this many standard deviations are left to [`super::tails`]: one gross error of 30 would
/// outweigh a million others here.
const CUT: f32 = 4.5;
/// E x^4 of a Gaussian truncated at [`CUT`] and rescaled to unit variance.
const GAUSSIAN_FOURTH: f64 = 2.997_52;
/// Distance between the pixels of a pair, px: they share the noise level but little of the noise. Their
/// correlation is corrected for.
const APART_PX: usize = 8;
/// Largest correlation of the pairs, averaged over all directions. Of 7 clean recordings with windows of
/// 14 px (.29) three had an excess of .04, of 23 with narrower ones (12 px: .20) none. Wide windows alone are
/// not the cause: simulated noise of even level has at most .01 with them.
const MAX_SHARED: f64 = 0.25;
/// Along rows, along columns and along the diagonal, each with its own rho.
const DIRECTIONS: [[usize; 2]; 3] = [[APART_PX, 0], [0, APART_PX], [APART_PX, APART_PX]];

/// Sums over pairs of residuals of unit variance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct PairSums {
    pairs: f64,
    fourth: f64,
    products: f64,
    products_of_squares: f64,
}

/// Sums over the residuals of some images, by direction.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    pairs: [PairSums; DIRECTIONS.len()],
    readings: f64,
    /// Sum of the cubed residuals, each about the mean and over the standard deviation of its patch.
    thirds: f64,
}

impl Moments {
    /// Adds the residuals of an image: row-major, `width` px wide, in any unit, NaN where there is none.
    pub fn add(&mut self, image: &[f32], width: usize) {
        let mut unit = vec![f64::NAN; image.len()];
        for patch in patches(image, width).filter(|p| !p.coarse) {
            let near = || patch.pixels.iter().filter(|i| image[**i].abs() < CUT * patch.sigma);
            let (n, square) = near()
                .fold((0.0, 0.0), |(n, sum), i| (n + 1.0, sum + f64::from(image[*i]).powi(2)));
            if square > 0.0 {
                let scale = f64::sqrt(n / square);
                near().for_each(|i| unit[*i] = scale * f64::from(image[*i]));
                let mean = near().map(|i| unit[*i]).sum::<f64>() / n;
                let spread = (1.0 - mean * mean).sqrt();
                // A single value has no skewness.
                if spread > 0.0 {
                    let third = |i: &usize| ((unit[*i] - mean) / spread).powi(3);
                    self.readings += n;
                    self.thirds += near().map(third).sum::<f64>();
                }
                // Both residuals of a pair are in units of this patch's standard deviation.
                self.add_pairs(&unit, width, &patch.pixels);
                near().for_each(|i| unit[*i] = f64::NAN);
            }
        }
    }

    fn add_pairs(&mut self, unit: &[f64], width: usize, pixels: &[usize]) {
        for &i in pixels.iter().filter(|i| unit[**i].is_finite()) {
            for (sums, [du, dv]) in self.pairs.iter_mut().zip(DIRECTIONS) {
                let inside = i % width + du < width;
                let y = unit.get(i + dv * width + du).filter(|y| inside && y.is_finite());
                if let Some(y) = y {
                    let (xx, yy) = (unit[i] * unit[i], y * y);
                    sums.pairs += 1.0;
                    sums.fourth += 0.5 * (xx * xx + yy * yy);
                    sums.products += unit[i] * y;
                    sums.products_of_squares += xx * yy;
                }
            }
        }
    }

    /// Skewness; `None` with too few readings.
    pub fn skewness(&self) -> Option<f64> {
        (self.readings >= MIN_READINGS).then(|| self.thirds / self.readings)
    }

    /// Excess kurtosis; `None` with too few pairs or where they are too correlated.
    pub fn excess(&self) -> Option<f64> {
        let rho = |s: &PairSums| s.products / s.pairs;
        let shared = self.pairs.iter().map(rho).sum::<f64>() / self.pairs.len() as f64;
        let of = |s: &PairSums| {
            let uneven = s.products_of_squares / s.pairs / (1.0 + 2.0 * rho(s).powi(2));
            (s.pairs >= MIN_READINGS && shared < MAX_SHARED)
                .then(|| s.fourth / s.pairs - GAUSSIAN_FOURTH - 3.0 * (uneven - 1.0))
        };
        let all: Option<Vec<f64>> = self.pairs.iter().map(of).collect();
        all.map(|all| all.iter().sum::<f64>() / all.len() as f64)
    }
}

#[cfg(test)]
impl Moments {
    pub fn of(image: &[f32], width: usize) -> Self {
        let mut sums = Moments::default();
        sums.add(image, width);
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};
    use crate::stats::noise_through_boxes;
    use rand_distr::{Distribution, StandardNormal};

    const SIZE: [usize; 2] = [320, 240];
    const SEEDS: u64 = 12;

    /// Mean and standard error over the seeds.
    fn excess(draw: impl Fn(&mut Stream) -> Vec<f32>) -> [f64; 2] {
        let of = |seed| {
            let image = draw(&mut Seed(seed).stream("kurtosis"));
            Moments::of(&image, SIZE[0]).excess().expect("an excess")
        };
        let all: Vec<f64> = (0..SEEDS).map(of).collect();
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let square: f64 = all.iter().map(|x| (x - mean).powi(2)).sum();
        [mean, (square / (n - 1.0) / n).sqrt()]
    }

    fn white(rng: &mut Stream) -> Vec<f32> {
        (0..SIZE[0] * SIZE[1]).map(|_| StandardNormal.sample(rng)).collect()
    }

    /// Within four standard errors, plus what a noise level that differs within a pair leaves.
    #[test]
    fn gaussian_noise_has_none_even_uneven_or_correlated() {
        let even = excess(white);
        assert!(even[0].abs() < 4.0 * even[1], "{even:?}");
        let uneven = excess(|rng| {
            let size = |i: usize| 1.0 + 0.3 * ((i % SIZE[0]) as f32 / 40.0).sin();
            white(rng).iter().enumerate().map(|(i, x)| size(i) * x).collect()
        });
        assert!(uneven[0].abs() < 4.0 * uneven[1] + 0.02, "uneven: {uneven:?}");
        // Means over 12 px of a row: rho is 1/3 along rows and zero along columns. Without 2 rho^2
        // the excess would be -.22.
        let rows = excess(|rng| {
            let white = white(rng);
            let mean = |i: usize| white[i..(i + 12).min(white.len())].iter().sum::<f32>();
            (0..white.len()).map(mean).collect()
        });
        assert!(rows[0].abs() < 4.0 * rows[1] && rows[1] < 0.04, "rows: {rows:?}");
    }

    /// Means over 16 x 16 px: pairs 8 px apart have a correlation of 1/2 along either
    /// axis and 1/4 along both.
    #[test]
    fn a_window_wider_than_the_pairs_are_apart_tells_nothing() {
        const SIDE: usize = 16;
        let mut rng = Seed(1).stream("kurtosis/window");
        let noise = noise_through_boxes(SIZE, SIDE, &mut rng);
        let image: Vec<f32> = noise.into_iter().map(|r| r as f32).collect();
        assert_eq!(Moments::of(&image, SIZE[0]).excess(), None);
        assert!(Moments::of(&white(&mut rng), SIZE[0]).excess().is_some());
    }

    /// Too small a picture, steps so coarse that most residuals are zero, no noise at all.
    #[test]
    fn what_shows_no_noise_tells_nothing() {
        assert_eq!(Moments::of(&vec![1.0; 2000], 50).excess(), None);
        assert_eq!(Moments::default().excess(), None);
        let mut rng = Seed(1).stream("kurtosis/coarse");
        let coarse: Vec<f32> = white(&mut rng).iter().map(|x| (0.4 * x).round()).collect();
        assert_eq!(Moments::of(&coarse, SIZE[0]).excess(), None);
        assert_eq!(Moments::of(&vec![0.0; 320 * 240], SIZE[0]).excess(), None);
    }
}
