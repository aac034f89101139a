//! Frames whose means move or jitter by more than the pixels' noise explains.

use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use super::frame_series::{Excess, Jitter, MUCH, Squares, of_excess};
use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::variance_px2;
use crate::diagnose::finding::parameters::one;
use crate::diagnose::views::known::KnownTerms;
use crate::terms::{Axis, Statistic};

/// Relative error due to motion that is not uniform and jitter that is not white.
const UNEVEN: f64 = 0.2;

/// Same as [`MUCH`] for means of frames. Of 140 simulated recordings without jitter, with all kinds of other
/// effects, they scatter by 0.95 of their noise and none by more than chance makes of 1.25. Not beside noise
/// that is correlated in time: about a line through a hundred frames, a correlation of 0.5 scatters by 1.92
/// times what is expected.
const MUCH_OF_MEANS: f64 = 1.25;

/// Effect id: frames that shift as a whole.
const JITTERS: &str = "frame-jitter";

/// A target with the same velocity in all views.
struct Motion {
    /// Along the optical axis, m/s.
    velocity_mps: f64,
    std_error: f64,
    p: f64,
}

impl Motion {
    /// Mean of the views' velocities weighted by their errors; disagreement enlarges its error.
    fn of(all: &[Jitter], noise: &FrameNoise) -> Option<Self> {
        let known: Vec<(f64, f64)> = all
            .iter()
            .filter(|j| j.trend_px2 > 0.0 && j.about.freedom > 0.0)
            .map(|j| (j.velocity_mps, j.velocity_mps.powi(2) / j.trend_px2 * noise.own_px2(j)))
            .filter(|(_, variance)| *variance > 0.0)
            .collect();
        let n = known.len() as f64;
        let precision: f64 = known.iter().map(|v| 1.0 / v.1).sum();
        if known.len() < 3 || !precision.is_finite() {
            return None;
        }
        let velocity_mps = known.iter().map(|v| v.0 / v.1).sum::<f64>() / precision;
        let left: f64 = known.iter().map(|v| (v.0 - velocity_mps).powi(2) / v.1).sum();
        let std_error = ((left / (n - 1.0)).max(1.0) / precision).sqrt();
        let t = velocity_mps / std_error;
        let p = StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |d| 2.0 * d.sf(t.abs()));
        Some(Motion { velocity_mps, std_error, p })
    }
}

/// Apparent velocity of the target and its standard error, m/s, and the p-value for a target at rest.
pub(in crate::diagnose) fn velocity(views: &[Structure]) -> Option<(f64, f64, f64)> {
    let all: Vec<Jitter> = views.iter().filter_map(|s| s.jitter).collect();
    let Motion { velocity_mps, std_error, p } = Motion::of(&all, &FrameNoise::of(&all))?;
    Some((velocity_mps, std_error.hypot(UNEVEN * velocity_mps), p))
}

/// Noise of a frame's mean about the line of its view.
struct FrameNoise {
    /// Degrees of freedom of all frames together.
    freedom: f64,
    /// Variance of all frames beyond what their pixels explain, px^2; negative where they scatter less.
    extra_px2: f64,
    /// Squared coefficient of variation of the views' variances about that, beyond chance.
    cv2: f64,
}

impl FrameNoise {
    fn of(all: &[Jitter]) -> Self {
        let freedom: f64 = all.iter().map(|j| j.about.freedom).sum();
        let beside: f64 =
            all.iter().map(|j| j.about.sum - j.about.freedom * j.about.expected).sum();
        let mut noise = FrameNoise { freedom, extra_px2: beside / freedom, cv2: 0.0 };
        // For a ratio r with f degrees of freedom, (r - 1)^2 averages cv2 (1 + 2 / f) + 2 / f.
        let off = |j: &Jitter| {
            let by_chance = 2.0 / j.about.freedom;
            ((noise.ratio(j) - 1.0).powi(2) - by_chance) / (1.0 + by_chance)
        };
        let measured =
            all.iter().filter(|j| j.about.freedom > 0.0 && noise.px2(j) > f64::MIN_POSITIVE);
        let (sum, n) = measured.fold((0.0, 0.0), |(sum, n), j| (sum + off(j), n + 1.0));
        noise.cv2 = (sum / f64::max(n, 1.0)).max(0.0);
        noise
    }

    /// Scatter of all frames over what their pixels explain.
    fn larger(&self, all: &[Jitter]) -> f64 {
        let of_pixels = all.iter().map(|j| j.about.freedom * j.about.expected).sum::<f64>();
        1.0 + self.extra_px2 * self.freedom / of_pixels
    }

    /// Scatter of a view's own frames over the expected.
    fn ratio(&self, view: &Jitter) -> f64 {
        view.about.sum / (view.about.freedom * self.px2(view))
    }

    fn px2(&self, view: &Jitter) -> f64 {
        (view.about.expected + self.extra_px2.max(0.0)).max(f64::MIN_POSITIVE)
    }

    /// Variance of a view, moderated (Smyth 2004, the prior by its moments): its own frames count as far as
    /// views differ. At least that of all, as few frames may lie on a line by chance.
    fn own_px2(&self, view: &Jitter) -> f64 {
        // Inverse gamma variances of d degrees of freedom have cv2 = 2 / (d - 4), and
        // their mean has weight d - 2.
        let others = 2.0 * (1.0 + self.cv2);
        let own = self.cv2 * view.about.freedom;
        self.px2(view) * ((others + own * self.ratio(view)) / (others + own)).max(1.0)
    }
}

/// Tests the frames' means; `rho` is the correlation between successive frames, found or known.
pub(in crate::diagnose) fn frame_means(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
    rho: f64,
) -> Vec<TextureFinding> {
    let all: Vec<Jitter> = views.iter().filter_map(|s| s.jitter).collect();
    let noise = FrameNoise::of(&all);
    if all.len() < 2 || noise.freedom < 2.0 {
        return Vec::new();
    }
    let mut found = Vec::new();
    found.extend((!known.has("target-motion")).then(|| motion(&all, &noise, level, rho)).flatten());
    // A motion that is not uniform scatters about its line.
    let trend_px2 = all.iter().map(|j| j.trend_px2).sum::<f64>() / all.len() as f64;
    if found.is_empty() || noise.extra_px2 >= 0.15 * trend_px2 {
        let known_px2 = jitter_px2(&[], known);
        let slow = rho > 0.0 || known.has("temporal-correlation");
        let much = if slow { MUCH } else { MUCH_OF_MEANS };
        found.extend(jitter(&all, &noise, known_px2, variance_px2(views), [much, level]));
    }
    found
}

/// Variance of the frame jitter, px^2: as found, or else as known.
pub fn jitter_px2(found: &[TextureFinding], known: &KnownTerms) -> f64 {
    let jitter = found.iter().find(|f| f.families.contains(&JITTERS));
    let found = jitter.and_then(|f| f.parameters["sigma_px"]["value"].as_f64());
    found.or_else(|| known.parameter(JITTERS, "sigma_px")).unwrap_or(0.0).powi(2)
}

/// Tests for motion: the line explains more than the scatter about it, or all views move alike.
fn motion(all: &[Jitter], noise: &FrameNoise, level: f64, rho: f64) -> Option<TextureFinding> {
    let n = all.len() as f64;
    let by_noise =
        |of: &dyn Fn(&Jitter) -> f64| all.iter().map(|j| of(j) / noise.px2(j)).sum::<f64>();
    let line = by_noise(&|j| j.trend_px2) / n;
    let about_it = (by_noise(&|j| j.about.sum) / noise.freedom).max(1.0);
    // Frames correlated with their neighbours drift.
    let wander = (1.0 + rho) / (1.0 - rho).max(0.05);
    let f = line / (about_it * wander * wander);
    let p_line = FisherSnedecor::new(n, noise.freedom).map_or(1.0, |d| d.sf(f));
    let steady = Motion::of(all, noise).filter(|m| m.p < 0.5 * level);
    if steady.is_none() && !(p_line < 0.5 * level && f > 3.0) {
        return None;
    }
    let speed = (all.iter().map(|j| j.velocity_mps.powi(2)).sum::<f64>() / n).sqrt();
    let signed = all.iter().map(|j| j.velocity_mps).sum::<f64>() / n;
    let Motion { velocity_mps, std_error, p } = steady.unwrap_or(Motion {
        velocity_mps: speed.copysign(signed),
        std_error: speed / (2.0 * n).sqrt(),
        p: p_line,
    });
    let std_error = std_error.hypot(UNEVEN * velocity_mps);
    Some(TextureFinding {
        parameters: one("velocity_mps", velocity_mps, std_error),
        // The better of two tests.
        p: (2.0 * p).clamp(1e-300, 1.0),
        // As for a term: the squares that the lines explain.
        nats: 0.5 * n * line,
        ..TextureFinding::named(vec!["target-motion"], Statistic::Bias, Axis::Frame)
    })
}

/// Tests for jitter: the means scatter by more than their pixels' noise and the known jitter explain.
/// `variance_px2` is the variance of a pixel.
fn jitter(
    all: &[Jitter],
    noise: &FrameNoise,
    known_px2: f64,
    variance_px2: f64,
    [much, level]: [f64; 2],
) -> Option<TextureFinding> {
    let beside = all.iter().map(|j| Squares { expected: j.about.expected + known_px2, ..j.about });
    let Excess { p, nats, .. } = Excess::of(beside, much, level)?;
    // The total, as in a model.
    let sigma = noise.extra_px2.sqrt();
    let error = UNEVEN.hypot(of_excess(noise.larger(all), noise.freedom));
    Some(TextureFinding {
        parameters: one("sigma_px", sigma, sigma * error),
        size_sigma: ((noise.extra_px2 - known_px2).max(0.0) / variance_px2.max(1e-12)).sqrt(),
        p,
        nats,
        ..TextureFinding::named(vec![JITTERS], Statistic::Correlation, Axis::Frame)
    })
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::{Seed, Stream};

    fn normal(rng: &mut Stream) -> f64 {
        StandardNormal.sample(rng)
    }

    /// Velocity found, m/s.
    fn velocity(views: &[Structure]) -> Option<f64> {
        let found = frame_means(views, &KnownTerms::default(), 1e-3, 0.0);
        let motion = found.iter().find(|h| h.families == ["target-motion"])?;
        motion.parameters["velocity_mps"]["value"].as_f64()
    }

    /// Frames that jitter about a line through four of them: with two degrees of freedom per view, some view
    /// lies on its line by chance and must not decide for all. A true motion is found.
    #[test]
    fn frames_that_jitter_do_not_move() {
        // At 2 m.
        const M_PER_PX: f64 = 4.0 / 43.5;
        let told = |seed: u64, velocity_mps: f64| {
            let mut rng = Seed(seed).stream("noise/jitter");
            let view = |_| {
                let t = [-0.05, -0.05 / 3.0, 0.05 / 3.0, 0.05f64];
                let m = t.map(|t| 0.015 * normal(&mut rng) - velocity_mps / M_PER_PX * t);
                let mean = m.iter().sum::<f64>() / 4.0;
                let tt: f64 = t.iter().map(|t| t * t).sum();
                let tm: f64 = t.iter().zip(m).map(|(t, m)| t * m).sum();
                let mm: f64 = m.iter().map(|m| (m - mean).powi(2)).sum();
                Structure {
                    jitter: Some(Jitter {
                        about: Squares { sum: mm - tm * tm / tt, freedom: 2.0, expected: 1e-7 },
                        trend_px2: tm * tm / tt,
                        velocity_mps: -tm / tt * M_PER_PX,
                    }),
                    ..Structure::default()
                }
            };
            velocity(&(0..40).map(view).collect::<Vec<_>>()).is_some()
        };
        // At 1e-3, 0.3 of 300 are expected: more than 3 have a chance of 3e-4.
        let moving = (0..300).filter(|seed| told(*seed, 0.0)).count();
        assert!(moving <= 3, "{moving} of 300 move");
        assert!((0..20).all(|seed| told(seed, 0.05)));
    }

    /// Views that scatter alike get the common variance: with each one's own, of two degrees of freedom,
    /// where that is larger, it would be 1 + 1/e. A view that truly scatters more gets its own.
    #[test]
    fn a_view_counts_by_its_own_frames_as_far_as_views_differ() {
        let mut rng = Seed(11).stream("frame-means/moderated");
        let mut view = |true_px2: f64, freedom: u32| {
            let sum = (0..freedom).map(|_| true_px2 * normal(&mut rng).powi(2)).sum();
            let about = Squares { sum, freedom: f64::from(freedom), expected: 1.0 };
            Jitter { about, trend_px2: 1.0, velocity_mps: 1.0 }
        };
        let mut over = 0.0;
        for _ in 0..200 {
            let all: Vec<Jitter> = (0..13).map(|_| view(1.0, 2)).collect();
            let noise = FrameNoise::of(&all);
            over += all.iter().map(|j| noise.own_px2(j) / noise.px2(j)).sum::<f64>() / 2600.0;
        }
        assert!((1.0..1.2).contains(&over), "{over}");
        let all: Vec<Jitter> = (0..40).map(|v| view(if v == 7 { 30.0 } else { 1.0 }, 10)).collect();
        let noise = FrameNoise::of(&all);
        let own = noise.own_px2(&all[7]);
        assert!((15.0..60.0).contains(&own), "{own}");
    }

    /// Far, tilted views have noisy means; they do not weaken a motion that the near ones show.
    #[test]
    fn views_count_by_their_own_noise() {
        let mut rng = Seed(9).stream("motion/uneven");
        let view = |n: u32| {
            let expected = 1e-6 * f64::from(1 << n);
            let spread = expected.sqrt();
            let trend = 0.006 + spread * normal(&mut rng);
            let sum = (spread * normal(&mut rng)).powi(2);
            let about = Squares { sum, freedom: 1.0, expected };
            let jitter = Jitter { about, trend_px2: trend * trend, velocity_mps: trend };
            Structure { jitter: Some(jitter), ..Structure::default() }
        };
        let velocity = velocity(&(0..12).map(view).collect::<Vec<_>>()).expect("a motion");
        assert!((velocity - 0.006).abs() < 0.002, "{velocity}");
    }
}
