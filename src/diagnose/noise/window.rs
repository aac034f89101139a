//! Window that part of the noise passes through, from the decay of the correlation with distance.

use super::structure::Structure;
use super::texture::{FAR, PROFILE_LAGS};
use super::view_mean::ViewMean;
use crate::diagnose::search::posterior::Posterior;
use crate::diagnose::views::box_sums::SMOOTH_PX;
use crate::stats::even;

/// Side, px, and share of the variance that passes through it, each with its standard error.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    pub length: [f64; 2],
    pub share: [f64; 2],
}

/// Correlation at `lag` under a window of unit side: flat, tent or bell, of the same extent. Each
/// sums to one over all lags.
const FORMS: [fn(f64) -> f64; 3] =
    [|lag| (1.0 - lag).max(0.0), tent, |lag| (-std::f64::consts::PI * lag * lag).exp()];

/// Half the base of a tent is two thirds of the side.
fn tent(lag: f64) -> f64 {
    let x = 1.5 * lag;
    if x <= 1.0 { 1.0 - 1.5 * x * x + 0.75 * x.powi(3) } else { 0.25 * (2.0 - x).max(0.0).powi(3) }
}

/// Sides tried, px, evenly spaced in the logarithm.
const SIDES: usize = 400;
const REACH_PX: [f64; 2] = [1.2, 64.0];

/// Fits the views' mean profile. All lags have the same error, since they come from the same noise.
pub fn part(views: &[Structure]) -> Option<Window> {
    let lag = |k: usize| ViewMean::of(views, |s| Some(s.correlation_profile?[k]));
    let correlation_profile: Vec<ViewMean> = (0..PROFILE_LAGS).map(lag).collect::<Option<_>>()?;
    let variance =
        correlation_profile.iter().map(|m| m.std_error.powi(2)).sum::<f64>() / PROFILE_LAGS as f64;
    let values: Vec<f64> = correlation_profile.iter().map(|m| m.value).collect();
    of(&values, variance)
}

/// Measured profile of noise whose correlation along either axis is `of` the lag: after the high-pass, and
/// less the correlation of far pixels along the diagonal.
fn seen(of: &dyn Fn(f64) -> f64, lags: usize) -> Vec<f64> {
    let reach = FAR[FAR.len() - 1];
    let half = SMOOTH_PX / 2;
    let mean = |correlation_profile: &[f64], until: usize| -> Vec<f64> {
        let at = |lag: isize| correlation_profile.get(lag.unsigned_abs()).copied().unwrap_or(0.0);
        let over = |k: usize| {
            let (k, half) = (k as isize, half as isize);
            (k - half..=k + half).map(at).sum::<f64>() / SMOOTH_PX as f64
        };
        (0..=until).map(over).collect()
    };
    let plain: Vec<f64> = (0..=reach + 2 * half).map(|lag| of(lag as f64)).collect();
    let once = mean(&plain, reach + half);
    let twice = mean(&once, reach);
    let at =
        |u: usize, v: usize| plain[u] * plain[v] - 2.0 * once[u] * once[v] + twice[u] * twice[v];
    let far = FAR.iter().map(|lag| at(*lag, *lag)).sum::<f64>() / FAR.len() as f64;
    (1..=lags).map(|lag| at(lag, 0) - far).collect()
}

fn of(correlation_profile: &[f64], variance: f64) -> Option<Window> {
    let variance = variance.max(f64::MIN_POSITIVE);
    let log = REACH_PX.map(f64::ln);
    let mut nodes: Vec<[f64; 4]> = Vec::new();
    let own = seen(&|lag| f64::from(u8::from(lag == 0.0)), correlation_profile.len());
    for form in FORMS {
        for side in even(log, SIDES).map(f64::exp) {
            let through = seen(&|lag| form(lag / side), correlation_profile.len());
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let beyond = |of: &[f64]| of.iter().zip(&own).map(|(x, own)| x - own).collect();
            let (shape, left): (Vec<f64>, Vec<f64>) =
                (beyond(&through), beyond(correlation_profile));
            let information = dot(&shape, &shape) / variance;
            let share = dot(&shape, &left) / variance / information;
            // At most all of the noise passes through; a window without a lag inside shows nothing.
            if information > 0.0 && (0.0..=1.0).contains(&share) {
                let evidence = 0.5 * (share * share * information - information.ln());
                nodes.push([evidence, side, share, 1.0 / information]);
            }
        }
    }
    let posterior = Posterior::of(nodes, |n| (n[0], 1.0))?;
    let (length, share) = (posterior.mean(|n| n[1]), posterior.mean(|n| n[2]));
    let of_length = posterior.rms(|n| n[1] - length);
    let of_share = posterior.mean(|n| (n[2] - share).powi(2) + n[3]).sqrt();
    Some(Window { length: [length, of_length], share: [share, of_share] })
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;

    /// Profiles of each form with equal errors at all lags: 90 % of 60 are 54; 48 or
    /// fewer have a chance of 2 %.
    #[test]
    fn intervals_hold_the_side_and_the_share() {
        const ERROR: f64 = 4e-4;
        for (name, form) in ["flat", "tent", "bell"].iter().zip(FORMS) {
            let mut held = [0; 2];
            for seed in 0..60 {
                let mut rng = Seed(seed).stream("window");
                let truth = [rng.random_range(4.0..12.0), rng.random_range(0.005..0.1)];
                let own = seen(&|lag| f64::from(u8::from(lag == 0.0)), PROFILE_LAGS);
                let through = seen(&|lag| form(lag / truth[0]), PROFILE_LAGS);
                let correlation_profile: Vec<f64> = own
                    .iter()
                    .zip(through)
                    .map(|(own, through)| {
                        let noise: f64 = StandardNormal.sample(&mut rng);
                        truth[1] * through + (1.0 - truth[1]) * own + ERROR * noise
                    })
                    .collect();
                let Window { length, share } =
                    of(&correlation_profile, ERROR * ERROR).expect("a window");
                for (k, [said, error]) in [length, share].into_iter().enumerate() {
                    held[k] += usize::from((said - truth[k]).abs() <= 1.645 * error);
                }
            }
            println!("{name}: {held:?} of 60");
            assert!(held.iter().all(|n| *n >= 49), "{name}: {held:?}");
        }
    }
}
