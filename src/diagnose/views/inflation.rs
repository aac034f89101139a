//! How much more the mean of a view errs than its model's noise says: the size of the noise, and its correlation
//! between pixels and between frames.

use rayon::prelude::*;

use super::box_sums::{SMOOTH_PX, take_out_cubic};
use super::field::Field;
use crate::diagnose::noise::texture::{same_pixel, without_bias};
use crate::stats::{Correlation, measure_correlation, median};

/// Fewest independent samples for a view's own correlation estimate. The standard error is then a tenth, and
/// subtracting the view's mean makes the correlation look shorter.
const FEW_SAMPLES: f64 = 100.0;

/// Inflation of the views' means and correlation of their pixels, with this bias subtracted. All views of a
/// sensor share one matching window, so a view too small to show it gets at least the median of the larger
/// half of the views.
pub fn inflations(fields: &[Field], bias: &[Vec<f32>]) -> Vec<(f64, Correlation)> {
    let of = |(n, f): (usize, &Field)| inflation(f, bias.get(n).map_or(&[], |b| &b[..]));
    let mut all: Vec<(f64, Correlation)> = fields.par_iter().enumerate().map(of).collect();
    let pixels = |f: &Field| f.pixels.len() as f64;
    let middle_px = median(&mut fields.iter().map(pixels).collect::<Vec<f64>>());
    let middle = |of: &dyn Fn(&Correlation) -> f64| {
        let large = all.iter().zip(fields).filter(|(_, f)| pixels(f) >= middle_px);
        median(&mut large.map(|((_, c), _)| of(c)).collect::<Vec<f64>>())
    };
    let (sum, squares) = (middle(&|c| c.sum), middle(&|c| c.sum_of_squares));
    for ((inflation, correlation), field) in all.iter_mut().zip(fields) {
        if pixels(field) < FEW_SAMPLES * squares {
            *inflation *= (sum / correlation.sum).max(1.0);
            correlation.sum = correlation.sum.max(sum);
            correlation.sum_of_squares = correlation.sum_of_squares.max(squares);
        }
    }
    all
}

/// Inflation of the variance of a pixel's mean: its ratio to the model's, times the pixels per independent
/// sample; and the pixels' correlation. Measured after subtracting smooth errors and the known bias (px, by
/// pixel, or empty).
fn inflation(field: &Field, bias: &[f32]) -> (f64, Correlation) {
    let cut = field.cut_to_target();
    let rough = whitened_high_passed(&without_bias(&field.mean, bias), field, &cut);
    let (mut sum, mut n) = (0.0, 0.0);
    for r in rough.iter().filter(|r| r.is_finite()) {
        sum += f64::from(*r).powi(2);
        n += 1.0;
    }
    let mut correlation = measure_correlation(&rough, cut.width);
    let taken = restore_sum(&mut correlation);
    let ratio = sum / n / (1.0 - taken);
    let inflation = if n > 0.0 { (ratio * correlation.sum).max(1e-6) } else { f64::INFINITY };
    (inflation, correlation)
}

/// Restores the sum of the correlation from before the high-pass; returns the share of the variance that the
/// high-pass took. A box mean of B pixels, subtracted, lowers the covariance at all lags within the box by the
/// share t = C / B of the variance, where C is the sum of the correlation there: rho' = (rho - t) / (1 - t). A
/// correlation that does not die out is a smooth error rather than noise, and stays as measured.
fn restore_sum(correlation: &mut Correlation) -> f64 {
    /// Each shrinks the error by t: from a fifth to less than a hundredth.
    const ROUNDS: usize = 3;
    const REACH: usize = SMOOTH_PX / 2;
    /// Largest share, that of a window of 35 px.
    const MAX_TAKEN: f64 = 0.5;
    if correlation.persists {
        return 0.0;
    }
    let two_sided = |rho: &[f64]| 2.0 * rho.iter().sum::<f64>();
    let mut taken = 0.0;
    for _ in 0..ROUNDS {
        let [across, down] = [&correlation.along_u, &correlation.along_v].map(|rho| {
            let (near, far) = rho[1..].split_at(REACH.min(rho.len() - 1));
            let lags = 1.0 + 2.0 * near.len() as f64;
            let near = (1.0 - taken) * (1.0 + two_sided(near)) + taken * lags;
            [near, near + two_sided(far)]
        });
        correlation.sum = (across[1] * down[1]).max(1.0);
        taken = (across[0] * down[0] / (SMOOTH_PX * SMOOTH_PX) as f64).clamp(0.0, MAX_TAKEN);
    }
    taken
}

/// Whitened and high-passed residuals as an image of the target alone, `cut`.
fn whitened_high_passed(residuals: &[f32], field: &Field, cut: &Field) -> Vec<f32> {
    let mut whitened: Vec<f32> = residuals.iter().zip(&field.sigma).map(|(r, s)| r / s).collect();
    // On a target not much larger than the box, the high-pass leaves most of a bowl. It would count as
    // correlated noise: the stronger the bowl, the less of it would be detected.
    take_out_cubic(&mut whitened, &cut.pixels, cut.width);
    cut.high_passed(&whitened)
}

/// Effective number of independent frames: 1 / (rho^2 + (1 - rho^2) / F) for F frames whose noise has the
/// correlation rho.
pub fn independent_frames(field: &Field) -> f64 {
    let [first, second, ..] = field.first.as_slice() else { return 1.0 };
    let cut = field.cut_to_target();
    let [first, second] = [first, second].map(|f| whitened_high_passed(f, field, &cut));
    let rho = same_pixel(&first, &second);
    let rho = if rho.is_finite() { rho.clamp(0.0, 1.0) } else { 0.0 };
    let frames = field.frames.len() as f64;
    1.0 / (rho * rho + (1.0 - rho * rho) / frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Plane;
    use crate::rng::{Seed, Stream};
    use crate::stats::noise_through_boxes;

    /// Mean of a target of this size, white noise smoothed by boxes of `side` px.
    fn field([width, height]: [usize; 2], side: usize, rng: &mut Stream) -> Field {
        let noise = noise_through_boxes([width, height], side, rng);
        let n = width * height;
        let plane = Plane::tilted(1.0, 0.0, 0.0);
        Field {
            sigma: vec![1.0; n],
            mean: noise.into_iter().map(|r| r as f32).collect(),
            count: vec![1; n],
            ..Field::unseen(plane, 40.0, [width, height], (0..n as u32).collect())
        }
    }

    /// On 22 x 16 px alone a box of 9 px looks like one of 6 px; a view that shows its own window keeps it.
    #[test]
    fn a_view_too_small_to_show_a_window_has_that_of_the_others() {
        let mut rng = Seed(1).stream("layers/window");
        let mut fields: Vec<Field> =
            [9, 9, 9, 3].map(|side| field([160, 120], side, &mut rng)).into();
        fields.push(field([22, 16], 9, &mut rng));
        let alone: Vec<(f64, Correlation)> = fields.iter().map(|f| inflation(f, &[])).collect();
        let beside = inflations(&fields, &[]);
        assert!(alone[..4] == beside[..4]);
        let squares =
            |all: &[(f64, Correlation)]| all[4].1.sum_of_squares / all[0].1.sum_of_squares;
        assert!(
            squares(&alone) < 0.6 && squares(&beside) > 0.9,
            "{:?}",
            [&alone, &beside].map(|a| squares(a))
        );
        let more = beside[4].1.sum / alone[4].1.sum;
        approx::assert_relative_eq!(beside[4].0, more * alone[4].0, max_relative = 1e-12);
    }

    /// White noise averaged over boxes: the variance of the mean over the whole target is `side`^2 times that of
    /// independent pixels, which the high-pass must not hide. The small correlations at the longest lags are lost.
    #[test]
    fn the_high_pass_takes_nothing_from_the_inflation() {
        const SIZE: [usize; 2] = [320, 240];
        for (side, least) in [(1, 0.98), (5, 0.95), (9, 0.92)] {
            let mut rng = Seed(side as u64).stream("inflation");
            let field = field(SIZE, side, &mut rng);
            let ratio = inflation(&field, &[]).0 / (side * side) as f64;
            assert!((least..1.06).contains(&ratio), "{side}: {ratio}");
        }
    }
}
