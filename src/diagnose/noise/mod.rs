//! Findings from the structure of the noise; each view is one sample of every statistic.

pub mod frame_means;
pub mod frame_series;
pub mod frame_tilts;
pub mod frames;
pub mod in_time;
pub mod lagged;
pub mod lines;
pub mod mixture;
pub mod moderated;
pub mod moments;
pub mod outliers;
pub mod pairs;
pub mod scatter;
pub mod skewness;
pub mod some_views;
pub mod still;
pub mod structure;
pub mod structures;
pub mod tail_counts;
pub mod tails;
mod tails_of_some;
pub mod texture;
pub mod texture_finding;
pub mod view_mean;
pub mod window;

use crate::diagnose::finding::parameters::{estimate, one};
use crate::diagnose::views::known::KnownTerms;
use crate::terms::{Axis, Statistic};
use frame_means::{frame_means, jitter_px2};
use frame_tilts::frame_tilts;
use frames::{flicker, unequal};
use in_time::{FIXED_PATTERN, in_time, pattern_px2};
use moderated::{Moderated, near};
use pairs::REACH_PX;
use some_views::some_views;
use still::Still;
use structure::Structure;
use texture_finding::TextureFinding;
use view_mean::{ViewMean, nats, variance_px2};
use window::{Window, part};

/// All mismatches of structure, each tested at this level.
pub fn texture_findings(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
) -> Vec<TextureFinding> {
    let mut found = Vec::new();
    found.extend(window(views, known, level));
    found.extend(in_time(views, known, level));
    found.extend(lines(views, known, level));
    let rho = found
        .iter()
        .find(|h| h.families.first() == Some(&"temporal-correlation"))
        .and_then(|h| h.parameters["rho"]["value"].as_f64())
        .or_else(|| known.parameter("temporal-correlation", "rho"))
        .unwrap_or(0.0);
    found.extend(frame_means(views, known, level, rho));
    found.extend(unequal(views, level));
    tell_pattern_once(&mut found);
    found
}

/// Reports a pattern only once: with a grain of a few pixels it shows in pixels and in their means.
fn tell_pattern_once(found: &mut Vec<TextureFinding>) {
    let of_pixels = found.iter().any(|f| f.families == [FIXED_PATTERN]);
    let of_means = |f: &TextureFinding| f.families.is_empty() && f.axis == Axis::Pixel;
    let coarse = found.iter().any(of_means);
    if of_pixels && coarse {
        found.retain(|f| !of_means(f));
        let named = found.iter_mut().find(|f| f.families == [FIXED_PATTERN]);
        named.into_iter().for_each(|f| f.words = Some("its grain is wider than a pixel".into()));
    }
}

/// Further mismatches of a recording by itself, besides those in `found`. Not for a comparison with a
/// simulation: there, views and frames differ for no reason that could be stated.
pub fn further_textures(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
    found: &[TextureFinding],
) -> Vec<TextureFinding> {
    let mut all = textures_of_some(views, known, level, found);
    all.extend(frame_tilts(views, jitter_px2(found, known), level));
    let of_frames =
        |f: &TextureFinding| f.statistic == Statistic::Variance && f.axis == Axis::Frame;
    all.extend((!found.iter().any(of_frames)).then(|| flicker(views, level)).flatten());
    all
}

/// Textures that only some of the views have, besides those `found` in all.
fn textures_of_some(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
    found: &[TextureFinding],
) -> Vec<TextureFinding> {
    type OfView<'a> = &'a dyn Fn(&Structure) -> Option<f64>;
    type Error<'a> = &'a dyn Fn(&Structure) -> f64;
    type OfAll = fn(&[Structure], &KnownTerms, f64) -> Vec<TextureFinding>;
    // Skips what was found or is in the model: about a model's value the views need
    // not scatter symmetrically.
    let told = |ids: &[&str]| {
        let found = found.iter().flat_map(|f| &f.families).any(|f| ids.contains(f));
        found || ids.iter().any(|id| known.has(id))
    };
    let beside = pattern_px2(views, found, known);
    // Relative to the view's own variance, so that near and far views scatter alike.
    let all: [(&[&str], OfView, Error, OfAll); 3] = [
        (&[ROW_NOISE], &|s| Some(s.row_px2? / s.variance_px2), &|s| s.line_error(0), lines),
        // Quantisation errors are constant: where the steps are too coarse for a neighbour
        // correlation, frames are alike too.
        (
            &["frozen-noise", "temporal-correlation"],
            &|s| s.neighbour_correlation.and(s.beside_pattern(beside)[0]),
            &|s| s.lagged_error_beside(beside),
            in_time,
        ),
        (
            &["spatial-correlation"],
            &|s| s.neighbour_correlation,
            &|s| s.near_error,
            |views, known, level| window(views, known, level).into_iter().collect(),
        ),
    ];
    let of = |(ids, of_view, error, of_all): (&[&str], OfView, Error, OfAll)| {
        // Second test of each texture at this level.
        let some = some_views(views, of_view, Some(error)).filter(|some| 2.0 * some.p < level)?;
        let shown = of_all(&some.views, known, AMONG_SOME).into_iter();
        let mut named = shown.filter(|f| f.families.iter().any(|id| ids.contains(id)));
        Some(named.next()?.of_some([some.views.len(), some.of], 2.0 * some.p))
    };
    all.into_iter().filter(|test| !told(test.0)).filter_map(of).collect()
}

/// Level for naming a texture once it is certain that some views have it.
const AMONG_SOME: f64 = 0.05;

/// Factor below which two window sides are the same.
const SAME_WINDOW: f64 = 1.12;

pub(in crate::diagnose) fn window(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
) -> Option<TextureFinding> {
    let m = ViewMean::of(views, |s| s.window_px.map(f64::ln))?;
    let expected = expected_window(known);
    let length = m.value.exp();
    let p = m.p_above(expected.ln());
    let found = |interval, parameters, size_sigma, p, nats| TextureFinding {
        interval,
        parameters,
        size_sigma,
        p,
        nats,
        ..TextureFinding::named(vec!["spatial-correlation"], Statistic::Correlation, Axis::PixelLag)
    };
    let part = part(views).filter(|w| expected == 1.0 && w.share[0] + 2.0 * w.share[1] < WHOLE);
    let of_part = |Window { length, share }: Window| {
        let mut parameters = one("length_px", length[0], length[1]);
        parameters.insert("share".into(), estimate(share[0], share[1]));
        parameters
    };
    if p < level && length > SAME_WINDOW * expected {
        let nats = nats(&m, expected.ln());
        let whole = || one("length_px", length, length * m.std_error);
        let size = part.map_or(1.0, |w| w.share[0].sqrt());
        let parameters = part.map_or_else(whole, of_part);
        return Some(found([0.0, length], parameters, size, p, nats));
    }
    // A window for only part of the noise shows in a test against independent neighbours.
    let near = Moderated::of(views, known).mean(near)?;
    let p = near.p_above(0.0);
    if expected > 1.0 || p >= level {
        return None;
    }
    let (size, nats) = (near.value.sqrt(), nats(&near, 0.0));
    // Where side and share cannot be separated: the window that all noise would pass through.
    let all = || {
        let side_of = |sum: f64| sum.max(1.0).sqrt();
        let sum = ViewMean::of(views, |s| s.near_sum);
        let [value, error] = sum.map_or([1.0, 0.0], |m| [m.value, m.std_error]);
        let side = side_of(value);
        let std_error = side_of(value + error) - side + 0.2 * (side - 1.0);
        one("length_px", side.max(length), std_error)
    };
    let reach = part.map_or(REACH_PX as f64, |w| w.length[0]);
    Some(found([0.0, reach], part.map_or_else(all, of_part), size, p, nats))
}

/// The share of the noise that passes through the window is reported where it is below this.
const WHOLE: f64 = 0.9;

/// Side of the model's window, px; reduced in proportion where only part of the noise passes through it.
pub fn expected_window(known: &KnownTerms) -> f64 {
    let of = |name| known.parameter("spatial-correlation", name);
    let side = of("length_px").unwrap_or(1.0).max(1.0);
    1.0 + of("share").unwrap_or(1.0).clamp(0.0, 1.0) * (side - 1.0)
}

/// Effect id: an error common to the pixels of each row of a frame.
pub const ROW_NOISE: &str = "row-noise";

fn lines(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<TextureFinding> {
    let variance = variance_px2(views);
    // The noise of known rows adds to the error of what they share.
    let means = if known.has(ROW_NOISE) {
        Moderated::by_scatter(views)
    } else {
        Moderated::of(views, known)
    };
    let known_px = known.parameter(ROW_NOISE, "sigma_px").unwrap_or(0.0);
    let afresh = "each column is shifted as one, afresh in every frame";
    let plain = |families, axis, words: Option<&str>| TextureFinding {
        words: words.map(String::from),
        ..TextureFinding::named(families, Statistic::Correlation, axis)
    };
    let afresh = [
        (plain(vec![ROW_NOISE], Axis::Row, None), known_px * known_px),
        (plain(vec![], Axis::Column, Some(afresh)), 0.0),
    ];
    let afresh = afresh.into_iter().enumerate().filter_map(|(axis, (plain, known_px2))| {
        plain.shared(&means.mean_of_lines(axis)?, known_px2, variance, level)
    });
    still_errors(views, known, level).into_iter().chain(afresh).collect()
}

/// Constant errors of columns, rows and blotches. Uses only what the views share, and the size of their noise.
pub fn still_errors(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<TextureFinding> {
    let variance = variance_px2(views);
    let still = [
        (Axis::Column, "each column has a constant error of its own, unlike its neighbours'"),
        (Axis::Row, "each row has a constant error of its own, unlike its neighbours'"),
        (Axis::Pixel, "a fine pattern over the picture is the same in all views"),
    ];
    let found = still.into_iter().enumerate().filter_map(|(k, (axis, words))| {
        let of = |s: &Still| [s.lines_px2[0], s.lines_px2[1], s.blotches_px2][k];
        let by_pattern = ViewMean::of(views, |s| Some(s.still.by_pattern_px2[k]));
        let m = ViewMean::of_pairs(views, |s| of(&s.still))?;
        let m = m.and_error(by_pattern.map_or(0.0, |m| m.value));
        let plain = TextureFinding {
            words: Some(words.into()),
            ..TextureFinding::named(vec![], Statistic::Bias, axis)
        };
        // Columns, rows and blotches share one level.
        let found = plain.shared(&m, known.error_of_lines_px2(axis), variance, level / 3.0)?;
        Some(TextureFinding { p: 3.0 * found.p, ..found })
    });
    found.collect()
}

#[cfg(test)]
#[path = "further_tests.rs"]
mod further_tests;
#[cfg(test)]
mod tests;
