//! Scores the found terms on held-out views, which had no part in any choice.

use rand::seq::SliceRandom;

use super::rms::rms;
use super::textures;
use crate::diagnose::case::Case;
use crate::diagnose::diagnosis::HeldOut;
use crate::diagnose::finding::pixels::{pixel_terms, terms_of};
use crate::diagnose::noise::lines::LearntLines;
use crate::diagnose::noise::scatter::ScatterResult;
use crate::diagnose::noise::still::beside_bias;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::samples::ViewData;
use crate::stats::{mean, student_quantile};
use crate::terms::{Statistic, Term};

/// One view in this many is held out; of small recordings one in three, up to three: fewer have no scatter of
/// their own.
const KEPT_ASIDE: usize = 4;
const OF_FEW_ASIDE: usize = 3;
const FEW_ASIDE: usize = 3;
/// Fewest views from which any can be spared.
const MIN_VIEWS: usize = 6;

impl Case<'_> {
    /// Repeats the search without some views, and scores those. The errors of single `lines` and textures are
    /// learnt again without them, where all views together show such.
    pub(in crate::diagnose) fn heldout(
        &self,
        lines: &[LearntLines],
        scatter: &ScatterResult,
    ) -> Option<HeldOut> {
        let (survey, seed) = (&self.survey, self.options.seed);
        let (camera, scale_px_m) = (&self.sensor().camera, self.fields[0].scale_px_m);
        let n = survey.views.len();
        if n < MIN_VIEWS {
            return None;
        }
        let mut rng = seed.stream("diagnose/heldout");
        let mut order: Vec<usize> = (0..n).collect();
        order.shuffle(&mut rng);
        let mut aside = order[..(n / KEPT_ASIDE).max(FEW_ASIDE.min(n / OF_FEW_ASIDE))].to_vec();
        aside.sort_unstable();
        let rest: Vec<usize> = (0..n).filter(|v| !aside.contains(v)).collect();
        let (chosen_on, judged_on) = (survey.subset(&rest), survey.subset(&aside));
        let fine = chosen_on.mean_data();
        let found = chosen_on.search_bias(&fine, camera, self.level(Case::MEAN_LEVEL), seed);
        let bias = chosen_on.refit_bias(&fine, camera, found);
        drop(fine);
        let bias_terms = terms_of(&bias, Statistic::Bias);
        let (sigma, level) = (&self.model.sigma, self.level(Case::VARIANCE_LEVEL));
        let variance = chosen_on.search_variance(sigma, camera, level, seed);
        let variance_terms = terms_of(&variance, Statistic::Variance);
        let stored = self.as_stored();
        let means: Vec<ViewData> = judged_on.coarse_mean_data();
        let blocks = judged_on.variance_data();
        let mut views = Vec::new();
        let mut before = Vec::new();
        let (mut of_bias, mut gains) = (Vec::new(), Vec::new());
        let of_lines = self.gained_by_lines(lines, &bias_terms, &rest, &aside);
        let of_textures = textures::gained(scatter, &self.known, [&rest, &aside]);
        let others = of_lines.iter().zip(of_textures).zip(&judged_on.views);
        for ((mean, block), ((lines, of_textures), view)) in means.iter().zip(&blocks).zip(others) {
            let score = |terms: &[Term]| log_score(mean, terms);
            // A view that says nothing of its mean has no score.
            let Some((b0, b1)) = score(&stored).zip(score(&bias_terms)) else { continue };
            let (v0, v1) = (noise_score(block, &[]), noise_score(block, &variance_terms));
            views.push(view.name.clone());
            before.push(b0 + v0);
            of_bias.push(b1 - b0 + lines.nats);
            gains.push(b1 - b0 + v1 - v0 + lines.nats + of_textures);
        }
        let mean_before = mean(before.into_iter())?;
        let gain = mean(gains.iter().copied())?;
        let by_lines: f64 = of_lines.iter().map(|l| l.px2).sum();
        let rms = |terms: &[Term], less_px2| rms(&judged_on.views, terms, scale_px_m, less_px2);
        let [px_before, mm_before] = rms(&stored, 0.0);
        let [px_after, mm_after] = rms(&bias_terms, by_lines);
        let of_sensor: Vec<Term> =
            bias_terms.iter().filter(|t| t.is_sensor_bias()).cloned().collect();
        let [px_corrected, _] = rms(&of_sensor, by_lines);
        Some(HeldOut {
            views,
            log_score_before: mean_before,
            log_score_after: mean_before + gain,
            gain,
            gain_interval: interval_of_mean(&gains)?,
            bias_gain_interval: interval_of_mean(&of_bias)?,
            is_clear: is_clear(&gains),
            bias_is_clear: is_clear(&of_bias),
            rms_mm_before: mm_before,
            rms_mm_after: mm_after,
            rms_px_before: px_before,
            rms_px_after: px_after,
            correction_rms_before_px: px_before,
            correction_rms_after_px: px_corrected,
        })
    }

    /// Gain of lines along these axes, learnt on the `rest` beside its `bias`, on each of the views held out
    /// (`aside`).
    fn gained_by_lines(
        &self,
        lines: &[LearntLines],
        bias: &[Term],
        rest: &[usize],
        aside: &[usize],
    ) -> Vec<LinesGain> {
        if lines.is_empty() {
            return vec![LinesGain::default(); aside.len()];
        }
        let at_pixels = |terms| pixel_terms(&self.fields, terms, self.survey.light, &self.bench);
        let bias = at_pixels(bias);
        let all = beside_bias(&self.fields, &bias);
        let learnt_on: Vec<(&Field, &[f32])> = rest.iter().map(|&v| all[v]).collect();
        let learnt = |l: &LearntLines| Some(LearntLines::of(&learnt_on, l.axis)?.profile);
        let px = at_pixels(&lines.iter().filter_map(learnt).collect::<Vec<Term>>());
        let of_view = |&v: &usize| {
            let ((field, bias), lines) = (all[v], &px[v]);
            let of_bias = |k: usize| bias.get(k).copied().unwrap_or(0.0);
            let view = &self.survey.views[v];
            let inflation = view.inflation * view.row_inflation;
            let mut gain = LinesGain::default();
            for k in (0..lines.len()).filter(|&k| field.mean[k].is_finite()) {
                let less = f64::from(lines[k] * (2.0 * (field.mean[k] - of_bias(k)) - lines[k]));
                gain.px2 += less;
                gain.nats += 0.5 * less / (f64::from(field.sigma[k]).powi(2) * inflation);
            }
            gain
        };
        aside.iter().map(of_view).collect()
    }
}

/// Gain of subtracting the errors of single lines from a view.
#[derive(Clone, Copy, Default)]
struct LinesGain {
    nats: f64,
    /// Reduction of the sum of squares of its pixels.
    px2: f64,
}

/// Log score of the means about a plane of the view's own: -r'Wr / 2, nats.
fn log_score(view: &ViewData, terms: &[Term]) -> Option<f64> {
    let response = view.without(terms);
    let own: f64 = response.iter().zip(&view.weight).map(|(y, w)| w * y * y).sum();
    let rows = view.rows(&response)?;
    Some(-0.5 * (own - rows.explained()))
}

/// Log score of the noise, block by block: minus half the deviance of sums of squares (a gamma distribution),
/// nats. A view's level counts too, since a user of the model has no other sigma. Beside a simulation, whose
/// blocks err as much, the weights are those of the ratio.
fn noise_score(blocks: &ViewData, terms: &[Term]) -> f64 {
    let left = blocks.without(terms);
    -left.iter().zip(&blocks.weight).map(|(log, w)| w * (log.exp_m1() - log)).sum::<f64>()
}

/// Whether views gain beyond chance: their mean, or each of them and all together more than chance brings to one
/// in twenty (the gain is the logarithm of a likelihood ratio). Near views gain more than far ones, and no
/// interval of few such gains says as much.
fn is_clear(gains: &[f64]) -> bool {
    let each = gains.iter().all(|gain| *gain > 0.0);
    let together = gains.iter().sum::<f64>() > 20f64.ln();
    interval_of_mean(gains).is_some_and(|[low, _]| low > 0.0 || each && together)
}

/// 95 % interval of the mean by Student's t; `None` with fewer than two values.
fn interval_of_mean(values: &[f64]) -> Option<[f64; 2]> {
    let n = values.len() as f64;
    let middle = mean(values.iter().copied())?;
    let square = values.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / (n - 1.0);
    let half = student_quantile(0.95, n - 1.0) * (square / n).sqrt();
    (n >= 2.0).then_some([middle - half, middle + half])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Student's quantile of one degree of freedom is 12.706.
    #[test]
    fn few_views_have_wide_intervals() {
        assert_eq!(interval_of_mean(&[500.0]), None);
        assert_eq!(interval_of_mean(&[0.0; 4]), Some([0.0; 2]));
        let [low, high] = interval_of_mean(&[10.0, 12.0]).expect("two views");
        assert!((low - (11.0 - 12.706)).abs() < 1e-3 && (high - (11.0 + 12.706)).abs() < 1e-3);
        let cases = [
            (&[10.0, 2.0][..], true),
            (&[10.0, -1.0], false),
            (&[1.0, 1.5], false),
            (&[9.0], false),
        ];
        cases.iter().for_each(|(gains, clear)| assert_eq!(is_clear(gains), *clear, "{gains:?}"));
    }
}
