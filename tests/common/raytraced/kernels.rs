//! Random numbers, and windows that correlate the noise of neighbours.

use rand::Rng;
use rand::seq::SliceRandom;
use rand_distr::{Distribution, StandardNormal};

use super::Clock;
use kinoise::rng::{Seed, Stream};

/// One of `forms` at random.
pub fn lot<T: Copy>(forms: &[T], rng: &mut Stream) -> T {
    forms[rng.random_range(0..forms.len())]
}

pub fn sign(rng: &mut Stream) -> f64 {
    lot(&[-1.0, 1.0], rng)
}

/// Seed from the first 64 bits of a hash.
pub fn seed_of(sha256: &str) -> Seed {
    Seed(sha256.get(..16).and_then(|bits| u64::from_str_radix(bits, 16).ok()).unwrap_or_default())
}

/// Stratified random numbers: one from each of `n` equal parts of 0 to 1, shuffled.
pub fn scattered(n: usize, rng: &mut Stream) -> Vec<f64> {
    let mut places: Vec<f64> =
        (0..n).map(|i| (i as f64 + rng.random::<f64>()) / n as f64).collect();
    places.shuffle(rng);
    places
}

/// Independent standard normal numbers.
pub fn white(count: usize, mut rng: Stream) -> Vec<f32> {
    (0..count).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// The base noise of a frame before it is shaped.
pub fn fresh(clock: &Clock, count: usize) -> Vec<f32> {
    white(count, clock.stream("white"))
}

/// Sum of four uniform numbers, mean 0, variance 1.
pub fn roundish(rng: &mut Stream) -> f32 {
    let sum: f32 = (0..4).map(|_| rng.random::<f32>()).sum();
    (sum - 2.0) * 3f32.sqrt()
}

/// A separable window with weights of unit square sum.
#[derive(Debug, Clone)]
pub struct Window {
    /// Odd in number.
    taps: Vec<f32>,
}

impl Window {
    fn of(weights: impl Iterator<Item = f64>) -> Self {
        let weights: Vec<f64> = weights.collect();
        let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        Window { taps: weights.iter().map(|w| (w / norm) as f32).collect() }
    }

    /// Equal weights over `side` px; a fraction goes to the two outermost.
    pub fn flat(side: f64) -> Self {
        let reach = ((side - 1.0) / 2.0).ceil() as i32;
        let rim = (side - f64::from(2 * reach - 1)) / 2.0;
        Window::of((-reach..=reach).map(|k| if k.abs() == reach { rim } else { 1.0 }))
    }

    /// Gaussian window with the [`Window::side`] of a flat one of `side` px: 2 sqrt(pi) standard deviations.
    pub fn bell(side: f64) -> Self {
        let sd = side / (2.0 * std::f64::consts::PI.sqrt());
        let reach = (4.0 * sd).ceil() as i32;
        Window::of((-reach..=reach).map(|k| (-0.5 * (f64::from(k) / sd).powi(2)).exp()))
    }

    /// Triangular window with the [`Window::side`] of a flat one of `side` px: 3/4 of its base.
    pub fn tent(side: f64) -> Self {
        let half = side * 2.0 / 3.0;
        let reach = half.ceil() as i32;
        Window::of((-reach..=reach).map(|k| (1.0 - f64::from(k.abs()) / half).max(0.0)))
    }

    /// Sum of the correlation over all lags along one axis: for a flat window, its side.
    pub fn side(&self) -> f64 {
        f64::from(self.taps.iter().sum::<f32>()).powi(2)
    }

    /// Sum of the squared correlation over all lags along one axis.
    pub fn squares(&self) -> f64 {
        let n = self.taps.len();
        let lag = |k: usize| (k..n).map(|i| self.taps[i] * self.taps[i - k]).sum::<f32>();
        1.0 + 2.0 * (1..n).map(|k| f64::from(lag(k)).powi(2)).sum::<f64>()
    }

    /// Power at an angular frequency, 1/px; 1 on average.
    pub fn power(&self, frequency: f64) -> f64 {
        let reach = (self.taps.len() / 2) as f64;
        let wave =
            |(k, tap): (usize, &f32)| f64::from(*tap) * (frequency * (k as f64 - reach)).cos();
        self.taps.iter().enumerate().map(wave).sum::<f64>().powi(2)
    }

    /// Blurs with the variance kept and periodic boundaries.
    pub fn blur(&self, field: &mut [f32], width: usize) {
        let height = field.len() / width;
        let reach = self.taps.len() / 2;
        let mut line = Vec::with_capacity(width + 2 * reach);
        for row in field.chunks_exact_mut(width) {
            line.clear();
            line.extend((0..width + 2 * reach).map(|i| row[(i + width - reach) % width]));
            row.fill(0.0);
            for (k, tap) in self.taps.iter().enumerate() {
                row.iter_mut().zip(&line[k..]).for_each(|(out, x)| *out += tap * x);
            }
        }
        let source = field.to_vec();
        for (v, row) in field.chunks_exact_mut(width).enumerate() {
            row.fill(0.0);
            for (k, tap) in self.taps.iter().enumerate() {
                let from = (v + k + height - reach) % height * width;
                row.iter_mut().zip(&source[from..from + width]).for_each(|(o, x)| *o += tap * x);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_a_side_reach_equally_far_and_keep_the_variance() {
        let windows = [Window::flat(9.0), Window::flat(5.0), Window::bell(8.0), Window::tent(8.0)];
        for (window, side) in windows.iter().zip([9.0, 5.0, 8.0, 8.0]) {
            assert!((window.side() / side - 1.0).abs() < 0.02, "{} {side}", window.side());
            let mut field = white(640 * 480, Seed(1).stream("white"));
            window.blur(&mut field, 640);
            let variance = field.iter().map(|x| x * x).sum::<f32>() / field.len() as f32;
            assert!((variance - 1.0).abs() < 0.08, "{variance}");
        }
    }
}
