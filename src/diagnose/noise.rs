//! What the structure of the noise amounts to: each view is one sample of every statistic.

use serde_json::{Map, json};
use statrs::distribution::{Continuous, ContinuousCDF, StudentsT};

use super::frames::frames;
use super::known::KnownTerms;
use super::parameters::estimate;
use super::structure::{GAUSSIAN_TAIL, Structure};
use crate::terms::{Axis, Statistic};

/// A mismatch of the noise's structure.
#[derive(Debug, Clone)]
pub struct Hanging {
    /// Best first; more than one when they cannot be told apart. Empty: no name.
    pub families: Vec<&'static str>,
    pub statistic: Statistic,
    pub axis: Axis,
    pub interval: [f64; 2],
    pub parameters: Map<String, serde_json::Value>,
    /// In units of the noise's standard deviation.
    pub size_sigma: f64,
    pub p: f64,
    /// Roughly, nats a recording.
    pub nats: f64,
    pub words: Option<String>,
}

/// Mean of a statistic over the views, and its standard error.
#[derive(Debug, Clone, Copy)]
struct Mean {
    value: f64,
    std_error: f64,
    views: f64,
}

impl Mean {
    fn of(views: &[Structure], value: impl Fn(&Structure) -> Option<f64>) -> Option<Self> {
        let values: Vec<(f64, f64)> = views
            .iter()
            .filter_map(|s| Some((value(s).filter(|v| v.is_finite())?, s.pixels)))
            .collect();
        let middle = values.iter().map(|v| v.1).sum::<f64>() / values.len().max(1) as f64;
        // A small target says little; views differ for reasons of their own, so that a large one
        // does not say all.
        let weight = |pixels: f64| if middle > 0.0 { pixels / (pixels + middle) } else { 1.0 };
        let total: f64 = values.iter().map(|v| weight(v.1)).sum();
        let squares: f64 = values.iter().map(|v| weight(v.1).powi(2)).sum();
        let n = total * total / squares.max(f64::MIN_POSITIVE);
        if values.len() < 2 || n <= 1.0 {
            return None;
        }
        let value = values.iter().map(|v| weight(v.1) * v.0).sum::<f64>() / total;
        let scatter: f64 = values.iter().map(|v| (weight(v.1) * (v.0 - value)).powi(2)).sum();
        Some(Mean { value, std_error: (scatter * n / (n - 1.0)).sqrt() / total, views: n })
    }

    /// Of what each view shares with all the others: a pair of views counts in two of the values, so
    /// that these scatter less than their mean errs.
    fn of_pairs(views: &[Structure], value: impl Fn(&Structure) -> Option<f64>) -> Option<Self> {
        let m = Mean::of(views, value)?;
        let std_error = m.std_error * (2.0 * (m.views - 1.0) / (m.views - 2.0)).sqrt();
        (m.views > 2.0).then_some(Mean { std_error, ..m })
    }

    /// Chance of a mean this far above `expected`, one-sided, by Student's t.
    fn p_above(&self, expected: f64) -> f64 {
        let t = (self.value - expected) / self.std_error.max(1e-12 * self.value.abs()).max(1e-300);
        StudentsT::new(0.0, 1.0, self.views - 1.0).map_or(1.0, |d| 1.0 - d.cdf(t)).max(1e-300)
    }
}

/// All mismatches of structure at this error rate each.
pub fn hanging(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<Hanging> {
    let mut found = Vec::new();
    found.extend(window(views, known, level));
    found.extend(in_time(views, known, level));
    found.extend(lines(views, known, level));
    let rho = found
        .iter()
        .find(|h| h.families.first() == Some(&"temporal-correlation"))
        .and_then(|h| h.parameters["rho"]["value"].as_f64())
        .unwrap_or(0.0);
    found.extend(frames(views, known, level, rho));
    found
}

pub(super) fn one(name: &str, value: f64, std_error: f64) -> Map<String, serde_json::Value> {
    let mut map = Map::new();
    map.insert(name.into(), estimate(value, std_error));
    map
}

fn nats(m: &Mean, expected: f64) -> f64 {
    let t = (m.value - expected) / m.std_error.max(1e-9);
    0.5 * m.views * (t * t / m.views).ln_1p()
}

/// Windows that differ by less than this factor are the same.
const SAME_WINDOW: f64 = 1.12;

fn window(views: &[Structure], known: &KnownTerms, level: f64) -> Option<Hanging> {
    let m = Mean::of(views, |s| s.window_px.map(f64::ln))?;
    let expected = known.parameter("spatial-correlation", "length_px").unwrap_or(1.0).max(1.0);
    let length = m.value.exp();
    let p = m.p_above(expected.ln());
    let found = |interval, length, std_error, size_sigma, p, nats| Hanging {
        families: vec!["spatial-correlation"],
        statistic: Statistic::Correlation,
        axis: Axis::PixelLag,
        interval,
        parameters: one("length_px", length, std_error),
        size_sigma,
        p,
        nats,
        words: None,
    };
    if p < level && length > SAME_WINDOW * expected {
        let nats = nats(&m, expected.ln());
        return Some(found([0.0, length], length, length * m.std_error, 1.0, p, nats));
    }
    // A part of the noise alone: seen where neighbours are taken for independent.
    let near = Mean::of(views, |s| s.near)?;
    let p = near.p_above(0.0);
    (expected == 1.0 && p < level && near.value > LEAST_NEAR).then(|| {
        // As many pixels make one as a window of this side would have it.
        let length = (1.0 + 2.0 * REACH_PX * near.value).max(length);
        let std_error = 2.0 * REACH_PX * near.std_error + 0.2 * (length - 1.0);
        let size = near.value.sqrt();
        found([0.0, REACH_PX], length, std_error, size, p, nats(&near, 0.0))
    })
}

/// Mean correlation of near pixels that is worth a word.
const LEAST_NEAR: f64 = 0.0005;
/// As far as neighbours are looked at, px.
const REACH_PX: f64 = 4.0;

/// Correlations smaller than this are not worth a word.
const LEAST_CORRELATION: f64 = 0.004;
/// Share of the variance that pixels repeat in every view, worth a word.
const LEAST_FIXED: f64 = 0.0003;
/// A share that stands still beside one that changes slowly is known to this.
const BESIDE_ANOTHER: f64 = 0.05;

/// Variance that pixels or lines share, as it is looked for.
struct Shared {
    families: Vec<&'static str>,
    statistic: Statistic,
    axis: Axis,
    /// What the model has of it, px^2.
    expected_px2: f64,
    /// Of all variance: a smaller share is not worth a word.
    least: f64,
    words: Option<&'static str>,
}

impl Shared {
    /// `m` of the noise's `variance_px2`, both px^2.
    fn found(self, m: &Mean, variance_px2: f64, level: f64) -> Option<Hanging> {
        let p = m.p_above(self.expected_px2);
        let share = (m.value - self.expected_px2) / variance_px2.max(1e-12);
        let sigma = m.value.max(0.0).sqrt();
        (p < level && share > self.least).then(|| Hanging {
            families: self.families,
            statistic: self.statistic,
            axis: self.axis,
            interval: [0.0, 0.0],
            parameters: one("sigma_px", sigma, 0.5 * m.std_error / sigma.max(1e-9)),
            size_sigma: share.sqrt(),
            p,
            nats: nats(m, self.expected_px2),
            words: self.words.map(String::from),
        })
    }
}

/// Of the first frame's rough residual, px^2.
pub(super) fn variance_px2(views: &[Structure]) -> f64 {
    Mean::of(views, |s| Some(s.variance_px2)).map_or(0.0, |m| m.value)
}

/// A correlation of frames: a share of the variance.
fn of_frames(
    families: Vec<&'static str>,
    interval: [f64; 2],
    (name, share, std_error): (&str, f64, f64),
    size: f64,
    (p, nats): (f64, f64),
) -> Hanging {
    Hanging {
        families,
        statistic: Statistic::Correlation,
        axis: Axis::Frame,
        interval,
        parameters: one(name, share, std_error),
        size_sigma: size.max(0.0).sqrt(),
        p,
        nats,
        words: None,
    }
}

fn in_time(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<Hanging> {
    let fixed = Mean::of_pairs(views, |s| s.fixed_px2);
    let variance = variance_px2(views);
    let known_px = known.parameter("fixed-pattern-noise", "sigma_px").unwrap_or(0.0);
    let pattern = Shared {
        families: vec!["fixed-pattern-noise"],
        statistic: Statistic::Bias,
        axis: Axis::Pixel,
        expected_px2: known_px * known_px,
        least: LEAST_FIXED,
        words: None,
    };
    let mut found: Vec<Hanging> =
        fixed.and_then(|m| pattern.found(&m, variance, level)).into_iter().collect();
    let fixed_px2 = fixed.map_or(0.0, |m| m.value.max(0.0));
    let Some(first) = Mean::of(views, |s| s.lagged[0]) else { return found };
    let fixed_share = fixed_px2 / variance.max(1e-12);
    let frozen_known = known.parameter("frozen-noise", "fraction").unwrap_or(0.0);
    let rho_known = known.parameter("temporal-correlation", "rho").unwrap_or(0.0);
    let last = if views.iter().any(|s| s.lagged[2].is_some()) { 2 } else { 1 };
    let falling = Mean::of(views, |s| Some(s.lagged[0]? - s.lagged[last]?));
    let Some((falling, (still, least))) =
        falling.zip(still_level(views).zip(Mean::of(views, |s| s.lagged[last])))
    else {
        // Two frames a view: still or slowly changing, nobody can say.
        let p = first.p_above(fixed_share + frozen_known + rho_known);
        let more = first.value - fixed_share - frozen_known - rho_known;
        if p < level && more > LEAST_CORRELATION {
            let names = vec!["frozen-noise", "temporal-correlation"];
            let fraction = ("fraction", first.value, first.std_error);
            found.push(of_frames(names, [0.0, 1.0], fraction, more, (p, nats(&first, 0.0))));
        }
        return found;
    };
    let p_falling = falling.p_above(0.0);
    // What stands still is in the last of them whole.
    let p_still = least.p_above(fixed_share + frozen_known);
    let slowly = p_falling < level && falling.value > LEAST_CORRELATION;
    if slowly && rho_known == 0.0 {
        let s = still.max(0.0) + fixed_share;
        let rho = ((first.value - s) / (1.0 - s).max(1e-6)).clamp(0.0, 1.0);
        let name = vec!["temporal-correlation"];
        let evidence = (p_falling, nats(&falling, 0.0));
        found.push(of_frames(name, [1.0, 3.0], ("rho", rho, first.std_error), rho, evidence));
    }
    let floor = if slowly { BESIDE_ANOTHER } else { LEAST_CORRELATION };
    if p_still < level && still - frozen_known > floor {
        let name = vec!["frozen-noise"];
        let evidence = (p_still, nats(&least, fixed_share + frozen_known));
        let fraction = ("fraction", still, least.std_error);
        found.push(of_frames(name, [1.0, 3.0], fraction, still, evidence));
    }
    found
}

/// Share of the noise that stands still within a view, by the views' mean correlations; `None` with
/// too few frames.
pub fn still_level(views: &[Structure]) -> Option<f64> {
    let mean = |of: &dyn Fn(&Structure) -> Option<f64>| Mean::of(views, of).map(|m| m.value);
    let (c1, c2, c3) = (mean(&|s| s.lagged[0])?, mean(&|s| s.lagged[1])?, mean(&|s| s.lagged[2]));
    let share = still_share([c1, c2, c3.unwrap_or(c2 * c2 / c1.max(1e-6))], c3.is_some());
    let fixed = mean(&|s| s.fixed_px2).unwrap_or(0.0).max(0.0);
    let variance = mean(&|s| Some(s.variance_px2)).unwrap_or(0.0);
    Some(share - fixed / variance.max(1e-12))
}

/// The s of c_k = s + (1 - s) rho^k, from the correlations at lags one to three.
fn still_share([c1, c2, c3]: [f64; 3], three: bool) -> f64 {
    let (near, far) = (c1 - c2, c2 - c3);
    if !three {
        // rho^2 = rho * rho alone cannot be told from a share: what falls is taken as a filter's.
        return if near > 0.05 * c1 { 0.0 } else { c2 };
    }
    if near <= 0.01 {
        return (c1 + c2 + c3) / 3.0;
    }
    let rho = (far / near).clamp(0.0, 0.95);
    // c1 - c2 = (1 - s) rho (1 - rho); a moving average dies at once and leaves the last.
    let s = if rho < 0.05 { c3 } else { 1.0 - near / (rho * (1.0 - rho)) };
    s.clamp(0.0, c3.max(0.0))
}

fn lines(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<Hanging> {
    let variance = variance_px2(views);
    let known_px = known.parameter("row-noise", "sigma_px").unwrap_or(0.0);
    let line = |families, statistic, axis, expected_px2, words| Shared {
        families,
        statistic,
        axis,
        expected_px2,
        least: LEAST_LINES,
        words,
    };
    let still = "whole columns or rows err by a constant each, from one to the next";
    let afresh = "each column is shifted as one, afresh in every frame";
    let row = known_px * known_px;
    let all = [
        (
            Mean::of_pairs(views, |s| s.lines_px2),
            line(vec![], Statistic::Bias, Axis::Column, known.error_of_lines_px2(), Some(still)),
        ),
        (
            Mean::of(views, |s| s.row_px2),
            line(vec!["row-noise"], Statistic::Correlation, Axis::Row, row, None),
        ),
        (
            Mean::of(views, |s| s.column_px2),
            line(vec![], Statistic::Correlation, Axis::Column, 0.0, Some(afresh)),
        ),
    ];
    all.into_iter().filter_map(|(m, line)| line.found(&m?, variance, level)).collect()
}

/// Share of the variance that lines have in common, worth a word.
const LEAST_LINES: f64 = 0.0004;

/// A tail is heavy from this many times a Gaussian's share on.
const HEAVY: f64 = 2.5;
/// So much more where the size of the noise is uneven.
const MUCH_HEAVIER: f64 = 6.0;
/// So heavy it may look without a cause.
const UNEQUAL: f64 = 1.5;
/// A tail of another form than two Gaussians moves its parameters by this share.
const TAIL_FORM: f64 = 0.2;
/// Views too small to show a tail, in readings.
const FEWEST_READINGS: f64 = 5000.0;

/// Are the residuals' tails heavier than a Gaussian's? `uneven` says that the noise is of unequal
/// size where no law was found for it, which makes a tail too.
pub fn tails(views: &[Structure], known: &KnownTerms, level: f64, uneven: bool) -> Option<Hanging> {
    if known.has("heavy-tails") {
        return None;
    }
    let looked = |s: &Structure| s.tail_pixels > FEWEST_READINGS;
    let m = Mean::of(views, |s| looked(s).then_some(s.tail))?;
    // Patches of unequal noise, and steps of the words, make a tail of a Gaussian too.
    let much = if uneven { MUCH_HEAVIER } else { 1.0 };
    let expected = much * UNEQUAL * GAUSSIAN_TAIL;
    if m.value < much * HEAVY * GAUSSIAN_TAIL || m.p_above(expected) > level {
        return None;
    }
    let size = Mean::of(views, |s| (looked(s) && s.tail > 0.0).then_some(s.tail_size))?;
    let more = m.value - GAUSSIAN_TAIL;
    // How far out they lie that are no Gaussian's.
    let mean = (m.value * size.value - GAUSSIAN_TAIL * beyond_four(1.0).1) / more;
    let scale = wider(mean);
    let fraction = (more / beyond_four(scale).0).clamp(0.0, 1.0);
    let scatter = m.std_error / m.value.max(1e-12);
    let mut parameters = one("fraction", fraction, fraction * scatter.hypot(TAIL_FORM));
    let scatter = size.std_error / (size.value - 4.0).max(1e-6);
    parameters.insert("scale".into(), estimate(scale, scale * scatter.hypot(TAIL_FORM)));
    parameters.insert("share_beyond_4_sigma".into(), json!(m.value));
    Some(Hanging {
        families: vec!["heavy-tails"],
        statistic: Statistic::Distribution,
        axis: Axis::Residual,
        interval: [4.0, 4.0 + 2.0 * (size.value - 4.0).max(0.5)],
        parameters,
        size_sigma: fraction.sqrt() * scale,
        p: m.p_above(GAUSSIAN_TAIL),
        nats: m.value
            * views.iter().map(|s| s.tail_pixels).sum::<f64>()
            * (m.value / GAUSSIAN_TAIL).ln(),
        words: None,
    })
}

/// Share of a Gaussian of this standard deviation beyond four, and its mean distance there.
fn beyond_four(scale: f64) -> (f64, f64) {
    let normal = statrs::distribution::Normal::standard();
    let t = 4.0 / scale;
    let share = 2.0 * normal.sf(t);
    (share, 2.0 * scale * Continuous::pdf(&normal, t) / share)
}

/// Standard deviation of a Gaussian whose mean distance beyond four is `mean`, by bisection.
fn wider(mean: f64) -> f64 {
    let (mut low, mut high) = (1.1, 20.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if beyond_four(middle).1 < mean { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
