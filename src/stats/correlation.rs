//! Effective number of independent samples in a patch of correlated pixels.

use super::{MAD_TO_SIGMA, coprime, median_in_place};

/// Spatial correlation of a residual image, summed along columns and rows.
///
/// The sums treat the correlation as separable in u and v, which is exact for a rectangular matching
/// window.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// rho(lag, 0), lag = 0, 1, 2 ... px along the columns.
    pub along_u: Vec<f64>,
    /// The same along the rows: rho(0, lag).
    pub along_v: Vec<f64>,
    /// Sum of rho over all lags: pixels per independent sample of a *mean*.
    pub sum: f64,
    /// Sum over all lags of the correlation of squares: pixels per independent sample of a *variance*. That
    /// correlation is rho^2 for Gaussian noise and more for pixels that are copies of their neighbours.
    pub sum_of_squares: f64,
    /// Whether the correlation has not died out at the longest lag: the residual then holds a smooth
    /// error (a bowl, bands), and the sums are lower bounds.
    pub persists: bool,
}

/// Longest lag evaluated, px: four times a Kinect's matching window.
pub const LONGEST_LAG: usize = 40;
/// Correlations below this count as died out.
const DEAD: f64 = 0.05;
/// The measured correlation of squares replaces rho^2 only where it is larger by this many times two
/// standard errors, 0.1 at [`PAIRS`]. Copied pixels differ by 0.25; Gaussian noise keeps the exact relation,
/// which has the smaller error.
const CLEARLY: f64 = 5.0;
/// Values beyond this many standard deviations are left out of the correlation of squares: a few hundred
/// pixels of a static error would outweigh all noise.
const CUT: f64 = 3.5;
/// Pairs evaluated per lag; the standard error of a correlation is then 0.01.
const PAIRS: usize = 10_000;

impl Correlation {
    /// [`Correlation::sum_of_squares`] over the pairs within a square of this side, px.
    pub fn sum_of_squares_within(&self, side: f64) -> f64 {
        let part = |rho: &[f64]| {
            let sum = |of: &dyn Fn(f64) -> f64| {
                let lags = rho.iter().enumerate().skip(1);
                1.0 + 2.0 * lags.map(|(lag, rho)| rho * rho * of(lag as f64)).sum::<f64>()
            };
            sum(&|lag| (1.0 - lag / side).max(0.0)) / sum(&|_| 1.0)
        };
        self.sum_of_squares * part(&self.along_u) * part(&self.along_v)
    }

    /// Correlation of white noise.
    pub fn white() -> Self {
        let alone = || vec![1.0];
        Correlation {
            along_u: alone(),
            along_v: alone(),
            sum: 1.0,
            sum_of_squares: 1.0,
            persists: false,
        }
    }
}

/// Measures the correlation of the residual `field` (row-major, `width` wide, NaN where there is none).
pub fn measure_correlation(field: &[f32], width: usize) -> Correlation {
    let valid = field.iter().filter(|e| e.is_finite()).count();
    let stride = (valid / PAIRS).max(1);
    let (along_u, squares_u) =
        course(field, width, valid, stride, |i, u, lag| (u + lag < width).then(|| field[i + lag]));
    let (along_v, squares_v) =
        course(field, width, valid, stride, |i, _, lag| field.get(i + lag * width).copied());
    let two_sided = |c: &[f64]| 1.0 + 2.0 * c[1..].iter().sum::<f64>();
    let persists = |c: &[f64]| c.len() > LONGEST_LAG;
    Correlation {
        sum: (two_sided(&along_u) * two_sided(&along_v)).max(1.0),
        sum_of_squares: two_sided(&squares_u) * two_sided(&squares_v),
        persists: persists(&along_u) || persists(&along_v),
        along_u,
        along_v,
    }
}

/// Correlation at lags 0, 1, 2 ... until it dies out, and that of the squares; `partner(i, u, lag)` is the
/// value `lag` px from sample `i` of column `u`.
fn course(
    field: &[f32],
    width: usize,
    valid: usize,
    stride: usize,
    partner: impl Fn(usize, usize, usize) -> Option<f32>,
) -> (Vec<f64>, Vec<f64>) {
    let (mut course, mut squares, mut apart) = (vec![1.0], vec![1.0], None);
    if valid < 100 || width == 0 {
        return (course, squares);
    }
    let stride = coprime(stride, width);
    let there = |i: usize| field[i].is_finite().then(|| (i, i % width));
    let samples: Vec<(usize, usize)> = (0..field.len()).step_by(stride).filter_map(there).collect();
    let mut sizes: Vec<f32> = samples.iter().map(|&(i, _)| field[i].abs()).collect();
    let cut = CUT * MAD_TO_SIGMA * f64::from(median_in_place(&mut sizes));
    let mut products = Vec::new();
    for lag in 1..=LONGEST_LAG {
        let (mut ab, mut aa, mut bb, mut n) = (0.0f64, 0.0f64, 0.0f64, 0usize);
        let mut near = Products::default();
        for &(i, u) in &samples {
            if let Some(b) = partner(i, u, lag).filter(|b| b.is_finite()) {
                let (a, b) = (f64::from(field[i]), f64::from(b));
                ab += a * b;
                aa += a * a;
                bb += b * b;
                n += 1;
                if a.abs().max(b.abs()) < cut {
                    near.add(a * a, b * b);
                }
            }
        }
        let rho = if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 };
        let noise = 2.0 / (n.max(1) as f64).sqrt();
        if n < 50 || rho < DEAD.max(noise) {
            // At this lag pixels share only the noise level, which may vary over the picture.
            apart = (n >= 50).then(|| near.product());
            break;
        }
        course.push(rho);
        products.push((rho, near, CLEARLY * noise));
    }
    // Where the correlation never dies out, the effect of the level is unknown: rho^2 is kept.
    squares.extend(products.into_iter().map(|(rho, near, clearly)| {
        let of_gaussian = rho * rho;
        let own = apart.and_then(|apart| near.correlation(apart)).unwrap_or(0.0);
        if own > of_gaussian + clearly { own } else { of_gaussian }
    }));
    (course, squares)
}

/// Sums over pairs of squares.
#[derive(Default)]
struct Products {
    pairs: f64,
    first: f64,
    second: f64,
    products: f64,
    squares: f64,
}

impl Products {
    fn add(&mut self, first: f64, second: f64) {
        self.pairs += 1.0;
        self.first += first;
        self.second += second;
        self.products += first * second;
        self.squares += 0.5 * (first * first + second * second);
    }

    /// Mean product of the squares over the product of their means, at least 1.
    fn product(&self) -> f64 {
        (self.products * self.pairs / (self.first * self.second)).max(1.0)
    }

    /// Correlation of the squares; `apart` is [`Products::product`] of uncorrelated pixels.
    fn correlation(&self, apart: f64) -> Option<f64> {
        let by_chance = apart * self.first * self.second / self.pairs;
        let own = (self.products - by_chance) / (self.squares - by_chance);
        (self.squares > by_chance).then(|| own.min(1.0))
    }
}

/// Unit white noise filtered by square boxes of `side` px, row-major.
#[cfg(test)]
pub fn noise_through_boxes(
    [width, height]: [usize; 2],
    side: usize,
    rng: &mut crate::rng::Stream,
) -> Vec<f64> {
    use rand_distr::{Distribution, StandardNormal};
    let wide = width + side;
    let white: Vec<f64> = (0..wide * (height + side)).map(|_| StandardNormal.sample(rng)).collect();
    let of_box = |i: usize| {
        let (u, v) = (i % width, i / width);
        let rows = (v..v + side).map(|v| white[v * wide + u..][..side].iter().sum::<f64>());
        rows.sum::<f64>() / side as f64
    };
    (0..width * height).map(of_box).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand_distr::{Distribution, StandardNormal};

    fn white(width: usize, height: usize) -> Vec<f32> {
        let mut rng = Seed(4).stream("white");
        (0..width * height).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// White noise of 400 x 300 px filtered by square windows of `side` px.
    fn blurred(side: usize) -> Vec<f32> {
        let noise = noise_through_boxes([400, 300], side, &mut Seed(4).stream("blurred"));
        noise.into_iter().map(|r| r as f32).collect()
    }

    /// Sum of rho^2 over all lags.
    fn of_gaussian(c: &Correlation) -> f64 {
        let along = |c: &[f64]| 1.0 + 2.0 * c[1..].iter().map(|rho| rho * rho).sum::<f64>();
        along(&c.along_u) * along(&c.along_v)
    }

    #[test]
    fn white_noise_is_worth_its_count() {
        let c = measure_correlation(&white(300, 200), 300);
        assert!((c.sum_of_squares - 1.0).abs() < 0.02, "{c:?}");
        assert!(!c.persists);
    }

    /// For a moving average over n pixels rho(k) = 1 - k/n, so sum rho = n and
    /// sum rho^2 = n (2/3 + 1/(3 n^2)) along each axis.
    #[test]
    fn a_nine_pixel_window_is_recognised() {
        let c = measure_correlation(&blurred(9), 400);
        let squares = (9.0 * (2.0 / 3.0 + 1.0 / 243.0f64)).powi(2);
        assert!((c.sum / 81.0 - 1.0).abs() < 0.15, "sum {}", c.sum);
        assert!((c.sum_of_squares / squares - 1.0).abs() < 0.12, "squares {}", c.sum_of_squares);
        assert!(!c.persists);
    }

    /// Every pixel repeated four times: four make one sample of a mean and of a variance; rho^2 alone would
    /// say 9/4. A varying noise level makes no pixel a copy.
    #[test]
    fn copies_are_no_samples() {
        let (width, half) = (400, white(200, 150));
        let size = |i: usize| 1.0 + 0.4 * ((i % width) as f32 / 60.0).sin();
        let copy = |i: usize| half[i / width / 2 * 200 + i % width / 2];
        for copied in [&copy, &(|i: usize| size(i) * copy(i)) as &dyn Fn(usize) -> f32] {
            let c = measure_correlation(&(0..width * 300).map(copied).collect::<Vec<_>>(), width);
            assert!((c.sum / 4.0 - 1.0).abs() < 0.1, "{c:?}");
            assert!((c.sum_of_squares / 4.0 - 1.0).abs() < 0.1, "{c:?}");
        }
        let uneven: Vec<f32> =
            blurred(9).into_iter().enumerate().map(|(i, x)| size(i) * x).collect();
        let c = measure_correlation(&uneven, width);
        assert_eq!(c.sum_of_squares, of_gaussian(&c));
    }

    /// A static error of 24 x 24 px, 10 high, must not count as correlation of the noise.
    #[test]
    fn a_bump_makes_no_copies() {
        let width = 400;
        let mut field = blurred(3);
        for v in 140..164 {
            field[v * width + 200..v * width + 224].iter_mut().for_each(|x| *x += 10.0);
        }
        let c = measure_correlation(&field, width);
        assert_eq!(c.sum_of_squares, of_gaussian(&c));
    }

    #[test]
    fn a_bowl_persists() {
        let field: Vec<f32> =
            (0..300 * 200).map(|i| ((i % 300) as f32 - 150.0).powi(2) * 1e-4 - 0.75).collect();
        assert!(measure_correlation(&field, 300).persists);
    }
}
