//! The noise's fourth moment beyond a Gaussian's, with what an uneven size of the noise adds taken off.
//!
//! Noise of a size s(u, v) that differs from place to place has a fourth moment of 3 (1 + c), where c is
//! the variance of s^2 over its mean's square: as though its tails were heavy. The same c is the
//! covariance of the squares of two pixels so near that they share s. Two Gaussian pixels that are
//! correlated by rho add 2 rho^2 to it. So
//!
//! ```text
//! excess = E x^4 - 3 (1 + cov(x^2, y^2) - 2 rho^2)        x, y of unit variance
//! ```
//!
//! is none for Gaussian noise of any smooth size.

use super::patches::patches;
use super::tails::FEWEST_READINGS;

/// Residuals farther out, in standard deviations, are [`super::tails`]' to count: one gross error of 30
/// would outweigh a million others here.
const CUT: f32 = 4.5;
/// E x^4 of a Gaussian that is cut there, its variance being 1 afterwards.
const GAUSSIAN_FOURTH: f64 = 2.997_52;
/// Pixels so far apart share the size of the noise, and hardly its errors: most matchers' windows are no
/// wider.
const APART_PX: usize = 8;

/// Sums over residuals of unit variance, and over pairs of them [`APART_PX`] apart.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FourthMoment {
    n: f64,
    fourth: f64,
    pairs: f64,
    products: f64,
    products_of_squares: f64,
}

impl FourthMoment {
    /// Of an image's residuals.
    pub fn of(image: &[f32], width: usize) -> Self {
        let mut unit = vec![f32::NAN; image.len()];
        let mut sums = FourthMoment::default();
        for patch in patches(image, width) {
            let near = || patch.pixels.iter().filter(|i| image[**i].abs() < CUT * patch.sigma);
            let (n, square) = near()
                .fold((0.0, 0.0), |(n, sum), i| (n + 1.0, sum + f64::from(image[*i]).powi(2)));
            let scale = (n / f64::max(square, f64::MIN_POSITIVE)).sqrt();
            near().for_each(|i| {
                let x = scale * f64::from(image[*i]);
                unit[*i] = x as f32;
                sums.fourth += x.powi(4);
            });
            sums.n += n;
        }
        let height = image.len() / width.max(1);
        for (i, x) in unit.iter().enumerate().filter(|(_, x)| x.is_finite()) {
            let (u, v) = (i % width, i / width);
            for (du, dv) in [(APART_PX, 0), (0, APART_PX), (APART_PX, APART_PX)] {
                if u + du >= width || v + dv >= height {
                    continue;
                }
                let y = unit[i + dv * width + du];
                if y.is_finite() {
                    let (x, y) = (f64::from(*x), f64::from(y));
                    sums.pairs += 1.0;
                    sums.products += x * y;
                    sums.products_of_squares += (x * x - 1.0) * (y * y - 1.0);
                }
            }
        }
        sums
    }

    pub fn add(&mut self, other: &FourthMoment) {
        self.n += other.n;
        self.fourth += other.fourth;
        self.pairs += other.pairs;
        self.products += other.products;
        self.products_of_squares += other.products_of_squares;
    }

    /// Excess kurtosis, where enough was looked at.
    pub fn excess(&self) -> Option<f64> {
        if self.n.min(self.pairs) < FEWEST_READINGS {
            return None;
        }
        let rho = self.products / self.pairs;
        let uneven = self.products_of_squares / self.pairs - 2.0 * rho * rho;
        Some(self.fourth / self.n - GAUSSIAN_FOURTH - 3.0 * uneven)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand_distr::{Distribution, StandardNormal, StudentT};

    const SIZE: [usize; 2] = [320, 240];

    fn image(mut draw: impl FnMut(f64, f64) -> f64) -> Vec<f32> {
        (0..SIZE[0] * SIZE[1])
            .map(|i| draw((i % SIZE[0]) as f64, (i / SIZE[0]) as f64) as f32)
            .collect()
    }

    /// Each within five standard errors, (24 / n)^(1/2) and what the pairs add.
    #[test]
    fn only_what_is_no_gaussian_has_an_excess() {
        let mut rng = Seed(3).stream("kurtosis");
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let error = 5.0 * 1.3 * (24.0 / (SIZE[0] * SIZE[1]) as f64).sqrt();
        let excess = |image: &[f32]| FourthMoment::of(image, SIZE[0]).excess().expect("an excess");
        let even = excess(&image(|_, _| normal()));
        assert!(even.abs() < error, "{even}");
        let uneven =
            excess(&image(|u, v| normal() * (1.0 + 0.4 * (u / 25.0).sin() * (v / 30.0).cos())));
        assert!(uneven.abs() < error, "uneven: {uneven}");
        // Means of 3 x 3 pixels: correlated, and Gaussian still.
        let white = image(|_, _| normal());
        let mean = |i: usize| {
            let around = [0, 1, 2].into_iter().flat_map(|r| (0..3).map(move |c| r * SIZE[0] + c));
            around.map(|k| white.get(i + k).copied().unwrap_or(0.0)).sum::<f32>()
        };
        let blurred = excess(&(0..white.len()).map(mean).collect::<Vec<f32>>());
        assert!(blurred.abs() < 3.0 * error, "blurred: {blurred}");
    }

    /// Student's t of 24 degrees of freedom has 6 / 20 more, less what the cut takes.
    #[test]
    fn weak_tails_have_one() {
        let mut rng = Seed(4).stream("kurtosis");
        let student = StudentT::new(24.0).expect("a distribution");
        let found = FourthMoment::of(&image(|_, _| student.sample(&mut rng)), SIZE[0]).excess();
        let found = found.expect("an excess");
        assert!((0.12..0.3).contains(&found), "{found}");
    }

    #[test]
    fn a_small_picture_tells_nothing() {
        assert_eq!(FourthMoment::of(&vec![1.0; 2000], 50).excess(), None);
        assert_eq!(FourthMoment::default().excess(), None);
    }
}
