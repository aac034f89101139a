//! Errors that pixels repeat: in every view, in every frame of a view, and from frame to frame.

use super::moderated::{Moderated, any_two, falling, last, next};
use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::{ViewMean, nats, variance_px2};
use crate::diagnose::finding::parameters::one;
use crate::diagnose::views::known::KnownTerms;
use crate::stats::mean;
use crate::terms::{Axis, Statistic};

/// Effect id: a constant error of each pixel.
pub const FIXED_PATTERN: &str = "fixed-pattern-noise";
/// Least share of the variance repeated in every view that is worth reporting.
const MIN_FIXED: f64 = 0.0003;
/// P-value below which a fall of the correlation is not attributed to noise alone.
const DOUBTFUL: f64 = 0.05;
/// Error of a constant share beside one that changes slowly.
const BESIDE_ANOTHER: f64 = 0.05;

/// Finding of a correlation of these views' frames: a share of the noise before rounding.
fn of_frames(
    views: &[Structure],
    families: Vec<&'static str>,
    interval: [f64; 2],
    (name, share, std_error): (&str, f64, f64),
    size: f64,
    (p, nats): (f64, f64),
) -> TextureFinding {
    // Sizes are those of the stored words, rounding included.
    let size = size * mean(views.iter().map(|s| 1.0 - s.rounding)).unwrap_or(1.0);
    TextureFinding {
        interval,
        parameters: one(name, share, std_error),
        size_sigma: size.max(0.0).sqrt(),
        p,
        nats,
        ..TextureFinding::named(families, Statistic::Correlation, Axis::Frame)
    }
}

pub fn in_time(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<TextureFinding> {
    let fixed = fixed(views);
    let variance = variance_px2(views);
    let known_px = known.parameter(FIXED_PATTERN, "sigma_px").unwrap_or(0.0);
    let known_px2 = known_px * known_px;
    let worth = |m: &ViewMean| (m.value - known_px2) / variance.max(1e-12) > MIN_FIXED;
    let pattern = TextureFinding::named(vec![FIXED_PATTERN], Statistic::Bias, Axis::Pixel);
    let found = fixed.filter(worth).and_then(|m| pattern.shared(&m, known_px2, variance, level));
    let mut found: Vec<TextureFinding> = found.map(|f| of_pixels(f, views)).into_iter().collect();
    // The pattern's error is common to the correlations of all views.
    let of_pattern = fixed.map_or(0.0, |m| m.std_error * mean_precision(views));
    let beside_it = beside_pattern(views, fixed);
    // Beside a pattern or known correlations, these err by more than the noise implies.
    let correlated = ["frozen-noise", "temporal-correlation"].iter().any(|id| known.has(id));
    let alone = found.is_empty() && known_px == 0.0 && !correlated;
    let of =
        if alone { Moderated::of(&beside_it, known) } else { Moderated::by_scatter(&beside_it) };
    found.extend(beside(&of, of_pattern, known, level));
    found
}

/// Adds the sampling error of a pattern's standard deviation over its pixels; small
/// views lie within large ones.
fn of_pixels(mut found: TextureFinding, views: &[Structure]) -> TextureFinding {
    let pixels = ViewMean::common_size(views, |s| s.still.fixed_pixels);
    let told = |key: &str| found.parameters["sigma_px"][key].as_f64().unwrap_or(0.0);
    let (sigma, std_error) = (told("value"), told("std_error"));
    found.parameters = one("sigma_px", sigma, std_error.hypot(sigma / (2.0 * pixels).sqrt()));
    found
}

/// Tests what frames of a view share beside the pattern; `of_pattern` is the standard error that it adds.
fn beside(
    views: &Moderated<'_>,
    of_pattern: f64,
    known: &KnownTerms,
    level: f64,
) -> Vec<TextureFinding> {
    let mut found = Vec::new();
    let Some(first) = views.mean(next) else { return found };
    let first = first.and_error(of_pattern);
    let first_error = first.std_error.max(by_chance(views.views));
    let frozen_known = known.parameter("frozen-noise", "fraction").unwrap_or(0.0);
    let rho_known = known.parameter("temporal-correlation", "rho").unwrap_or(0.0);
    let falling = views.mean(falling);
    let Some((falling, still)) = falling.zip(still_beside(views.views)) else {
        // With two frames per view, constant and slowly changing noise cannot be told apart.
        let p = first.p_above(frozen_known + rho_known);
        let more = first.value - frozen_known - rho_known;
        if p < level {
            let names = vec!["frozen-noise", "temporal-correlation"];
            let fraction = ("fraction", first.value, first_error);
            let evidence = (p, nats(&first, frozen_known + rho_known));
            found.push(of_frames(views.views, names, [0.0, 1.0], fraction, more, evidence));
        }
        return found;
    };
    let p_falling = falling.p_above(0.0);
    // Slowly changing noise makes successive frames alike; a fall from no correlation is chance.
    let alike = first.p_above(frozen_known) < level;
    let slowly = alike && p_falling < level;
    // Constant noise is whole at the longest lag, and at all lags where nothing fades.
    let standing = views.mean(if slowly { last } else { any_two });
    let Some(standing) = standing.map(|m| m.and_error(of_pattern)) else { return found };
    let p_still = standing.p_above(frozen_known);
    let floor = if slowly { BESIDE_ANOTHER } else { 0.0 };
    let stands = p_still < level && still - frozen_known > floor;
    if slowly && rho_known == 0.0 {
        // A share too small to report is mostly chance, and its estimate contains this very correlation.
        let s = if stands { still } else { frozen_known };
        let rho = ((first.value - s) / (1.0 - s).max(1e-6)).clamp(0.0, 1.0);
        let name = vec!["temporal-correlation"];
        let evidence = (p_falling, nats(&falling, 0.0));
        found.push(of_frames(
            views.views,
            name,
            [1.0, 3.0],
            ("rho", rho, first_error),
            rho,
            evidence,
        ));
    }
    if stands {
        // An uncertain fall may as well be slow change.
        let doubtful = !slowly && p_falling < DOUBTFUL && rho_known == 0.0;
        let names = match doubtful {
            false => vec!["frozen-noise"],
            true if 2.0 * falling.value < first.value => {
                vec!["frozen-noise", "temporal-correlation"]
            }
            true => vec!["temporal-correlation", "frozen-noise"],
        };
        let evidence = (p_still, nats(&standing, frozen_known));
        let parameter = match names[0] {
            "frozen-noise" => ("fraction", still, standing.std_error),
            _ => ("rho", (first.value - frozen_known).max(0.0), first_error),
        };
        found.push(of_frames(views.views, names, [1.0, 3.0], parameter, still, evidence));
    }
    found
}

/// Standard error of the correlation of white noise: one over the root of the number of pixels. A few views
/// may happen to agree better.
fn by_chance(views: &[Structure]) -> f64 {
    let pairs = |s: &Structure| {
        let lags = s.lagged.iter().flatten().count() as f64;
        s.pixels * lags * (1.0 - s.rounding).powi(2)
    };
    let pairs: f64 = views.iter().map(pairs).sum();
    if pairs > 0.0 { pairs.sqrt().recip() } else { 0.0 }
}

/// Views with their frames' correlations less those of a pattern common to all views, of which each view's
/// variance has its own share.
fn beside_pattern(views: &[Structure], fixed: Option<ViewMean>) -> Vec<Structure> {
    let fixed_px2 = fixed.map_or(0.0, |m| m.value);
    let beside = |s: &Structure| Structure { lagged: s.beside_pattern(fixed_px2), ..s.clone() };
    views.iter().map(beside).collect()
}

/// Mean inverse variance, px^-2.
fn mean_precision(views: &[Structure]) -> f64 {
    let precision = |s: &Structure| (s.noise_px2() > 0.0).then(|| 1.0 / s.noise_px2());
    ViewMean::of(views, precision).map_or(0.0, |m| m.value)
}

/// Variance of what pixels err by in every view alike, px^2.
fn fixed(views: &[Structure]) -> Option<ViewMean> {
    ViewMean::of_pairs(views, |s| s.still.fixed_px2)
}

/// Variance of a pattern that was `found` or is known, px^2; else 0.
pub fn pattern_px2(views: &[Structure], found: &[TextureFinding], known: &KnownTerms) -> f64 {
    let found = found.iter().any(|f| f.families.contains(&FIXED_PATTERN));
    if !found && !known.has(FIXED_PATTERN) {
        return 0.0;
    }
    fixed(views).map_or(0.0, |m| m.value)
}

/// Share of the noise that is constant within a view but not common to all, by the views' mean correlations;
/// `None` with too few frames.
pub fn still_level(views: &[Structure]) -> Option<f64> {
    still_beside(&beside_pattern(views, fixed(views)))
}

fn still_beside(views: &[Structure]) -> Option<f64> {
    let mean = |lag: usize| ViewMean::of(views, |s| s.lagged[lag]).map(|m| m.value);
    Some(still_share(mean(0)?, mean(1)?, mean(2)))
}

/// Solves c_k = s + (1 - s) rho^k for s, from the correlations at lags one, two and,
/// with enough frames, three.
pub(in crate::diagnose) fn still_share(c1: f64, c2: f64, c3: Option<f64>) -> f64 {
    let near = c1 - c2;
    let Some(c3) = c3 else {
        // Two lags alone cannot separate rho from a share: a fall is attributed to a filter.
        return if near > 0.05 * c1 { 0.0 } else { c2 };
    };
    if near <= 0.01 {
        return (c1 + c2 + c3) / 3.0;
    }
    let rho = ((c2 - c3) / near).clamp(0.0, 0.95);
    // c1 - c2 = (1 - s) rho (1 - rho); a moving average dies out at once and leaves the last.
    let s = if rho < 0.05 { c3 } else { 1.0 - near / (rho * (1.0 - rho)) };
    s.clamp(0.0, c3.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{parameter, with};
    use super::*;
    use crate::rng::Seed;

    /// What chance leaves of the later frames is no constant share: it would make rho smaller, never larger.
    #[test]
    fn a_share_that_is_not_told_has_no_part_in_the_correlation_of_frames() {
        const RHO: f64 = 0.08;
        let mut rng = Seed(8).stream("noise/in-time");
        let mut off: Vec<f64> = Vec::new();
        for _ in 0..400 {
            let views = with(&mut rng, |s| {
                for (k, lag) in (1..).zip(&mut s.lagged) {
                    *lag = lag.map(|c| c + RHO.powi(k));
                }
            });
            let found = in_time(&views, &KnownTerms::default(), 1e-3);
            let slow = found.iter().find(|f| f.families == ["temporal-correlation"]);
            off.extend(slow.map(|f| parameter(f, "rho")[0] - RHO));
        }
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        assert!(off.len() > 390 && mean.abs() < 1e-3, "{mean} of {}", off.len());
    }

    /// Far views have more noise of their own beside the same pattern: the constant share within each is 0.1
    /// of that noise in all of them.
    #[test]
    fn what_stands_still_in_all_views_is_none_of_what_stands_still_in_each() {
        const FRACTION: f64 = 0.1;
        const PATTERN_PX2: f64 = 0.01;
        let mut rng = Seed(9).stream("noise/pattern");
        let mut off: Vec<f64> = Vec::new();
        for _ in 0..40 {
            let mut noise_px2 = 0.01;
            let views = with(&mut rng, |s| {
                noise_px2 *= 1.3;
                s.variance_px2 = noise_px2 + PATTERN_PX2;
                s.still.fixed_px2 = s.still.fixed_px2.map(|f| f + PATTERN_PX2);
                let still = (FRACTION * noise_px2 + PATTERN_PX2) / s.variance_px2;
                s.lagged = s.lagged.map(|c| c.map(|c| c + still));
            });
            let found = in_time(&views, &KnownTerms::default(), 1e-3);
            let frozen = found.iter().find(|f| f.families == ["frozen-noise"]);
            off.extend(frozen.map(|f| parameter(f, "fraction")[0] - FRACTION));
        }
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        assert!(off.len() > 30 && mean.abs() < 0.005, "{mean} of {}", off.len());
    }
}
