//! The names a chosen term may have, and the text on the physics behind a name.

use crate::diagnose::diagnosis::{Alternative, Finding, Status};
use crate::diagnose::search::candidate::RECALIBRATE;
use crate::diagnose::search::outcome::Chosen;
use crate::effects;
use crate::terms::{Axis, Statistic};

/// Log odds (Occam factor) of a family that needs so many more columns for the same fit, under a
/// unit-information prior (Kass and Wasserman 1995) and after a gain of `gain` nats.
pub fn ln_occam(more_columns: f64, gain: f64) -> f64 {
    -0.5 * more_columns * (1.0 + 2.0 * gain.max(0.0)).ln()
}

/// Log odds for a lead of so many nats. The lead in single views counts separately.
pub fn ln_odds(nats: f64) -> f64 {
    0.25 * nats
}

/// Names less probable than this are not reported.
pub const MIN_PROBABILITY: f64 = 0.005;

/// Temperature of the stated odds: the layers' own odds to the power 1 / `TEMPERATURE`, because the layers
/// take a name's formula as exact and the views as alike. By maximum likelihood, with [`by_chance`], on 2,199
/// best names of seven earlier trials: 1.73, from 1.60 to 1.87 (95 %).
const TEMPERATURE: f64 = 1.7;

/// Layers that a cause may show in: mean, size of the noise, its structure, losses.
const LAYERS: f64 = 4.0;

/// Least probability that a finding with this p-value is chance, where something is missing in one of the
/// layers, as often as not in this one of all (Sellke, Bayarri and Berger 2001).
fn by_chance(p: f64) -> f64 {
    let p = p.clamp(f64::MIN_POSITIVE, (-1f64).exp());
    let odds = -LAYERS * std::f64::consts::E * p * p.ln();
    odds / (1.0 + odds)
}

/// Tempers the odds of a finding's names and of none of them.
pub fn temper(alternatives: &mut [Alternative]) {
    let cool = |p: f64| p.max(0.0).powf(1.0 / TEMPERATURE);
    let stated = || alternatives.iter().filter_map(|a| a.probability);
    let none = (1.0 - stated().sum::<f64>()).max(0.0);
    let total = cool(none) + stated().map(cool).sum::<f64>();
    for a in alternatives.iter_mut().filter(|_| total > 0.0) {
        a.probability = a.probability.map(|p| cool(p) / total);
    }
}

/// Lowers the probability of names of errors over the picture by the share of the nameless remainder. That
/// remainder may belong to the shape of the named part, which is then not what its name says.
pub fn doubt_beside_the_unexplained(found: &mut [Finding]) {
    let of_picture = |f: &Finding| {
        let places = [Axis::Column, Axis::Row, Axis::Radius, Axis::Pixel];
        f.statistic == Statistic::Bias && places.contains(&f.axis)
    };
    // A fine pattern is not the remainder of a smooth shape.
    let smooth = |f: &&Finding| f.axis != Axis::Pixel || !f.terms.is_empty();
    let nameless = |f: &&Finding| of_picture(f) && f.status == Status::Unexplained && smooth(f);
    let left: f64 = found.iter().filter(nameless).map(|f| f.share).sum();
    for f in found.iter_mut().filter(|f| of_picture(f) && f.share > 0.0) {
        less_sure(f, f.share / (f.share + left));
    }
}

/// Probability that a name of the mean error is right where the two halves of the views do not agree on its size:
/// a cause has one size. Of five such names with a probability in a trial (400 sets, seed 20261213) and 24 halves of
/// a real Kinect's views, three were right; by Jeffreys's prior.
const SURE_OF_DISAGREEING_HALVES: f64 = (3.0 + 0.5) / (5.0 + 1.0);

/// Lowers the probability of names of the mean error that the two halves of the views do not bear out.
pub fn doubt_where_halves_disagree(found: &mut [Finding]) {
    let disagree = |f: &&mut Finding| f.statistic == Statistic::Bias && f.replicated == Some(false);
    found.iter_mut().filter(disagree).for_each(|f| less_sure(f, SURE_OF_DISAGREEING_HALVES));
}

/// Multiplies the probabilities of a finding's names by `share`.
fn less_sure(f: &mut Finding, share: f64) {
    f.alternatives.iter_mut().for_each(|a| a.probability = a.probability.map(|p| share * p));
}

/// Removes the name of a finding.
pub fn unname(f: &mut Finding) {
    (f.status, f.effect) = (Status::Unexplained, None);
    f.parameters.clear();
    f.physics = physics(f.status, None, f.statistic, f.axis, None);
}

/// Last step: tempers the probabilities, leaves room for chance, drops an improbable name, and tells whether
/// the extended model has the finding.
pub fn finish(f: &mut Finding) {
    temper(&mut f.alternatives);
    let real = 1.0 - f.p_adjusted.map_or(0.0, by_chance);
    less_sure(f, real);
    resembles_only(f);
    tell_if_held(f);
}

/// Tells whether the extended model has a finding that has no name or that only some views have.
fn tell_if_held(f: &mut Finding) {
    let nameless = f.status == Status::Unexplained && f.contradicted.is_none();
    if nameless && !f.terms.is_empty() {
        f.physics += " The extended model holds it as the curve that was measured.";
    } else if nameless || f.of_some.is_some() {
        f.physics += " The extended model has no term for it.";
    }
}

/// Removes a name that is less probable than none of the names; the finding then only resembles it.
fn resembles_only(f: &mut Finding) {
    let stated: Option<Vec<f64>> = f.alternatives.iter().map(|a| a.probability).collect();
    let own =
        f.alternatives.iter().find(|a| Some(a.effect) == f.effect).and_then(|a| a.probability);
    let Some((own, all)) = own.zip(stated.map(|p| p.iter().sum::<f64>())) else { return };
    let named = matches!(f.status, Status::Named | Status::OneOf);
    if let Some(id) = f.effect.filter(|_| named && own < 1.0 - all) {
        unname(f);
        let title = effects::find(id).map_or(id, |e| e.card().title);
        f.physics.push_str(&format!(" It resembles {title}, which is less probable than not."));
    }
}

/// Probability that the cause has none of the names, where a name gains `named` nats and the best nameless
/// curve `curve`, of which the share `adequate` suffices.
pub fn none_of_these(named: f64, curve: f64, adequate: f64) -> f64 {
    if curve <= 0.0 {
        return 0.0;
    }
    1.0 / (1.0 + ((named / curve.max(1e-9) - adequate - 0.06) / 0.05).exp())
}

/// Status, name, and the possible names with their probabilities.
pub fn naming(chosen: &Chosen) -> (Status, Option<&'static str>, Vec<Alternative>) {
    let Some(family) = chosen.candidate.family else {
        return (Status::Unexplained, None, Vec::new());
    };
    let none = none_of_these(chosen.gain, chosen.best_curve, chosen.adequacy);
    let best = chosen.rivals.iter().find(|r| r.family == family).map_or(chosen.gain, |r| r.gain);
    let mut odds: Vec<(&'static str, f64)> = vec![(family, 1.0)];
    for rival in chosen.rivals.iter().filter(|r| r.family != family) {
        let nats = (best - rival.gain).clamp(0.0, 40.0);
        let behind = rival.behind.clamp(-1.0, 6.0);
        let more = rival.basis.count().saturating_sub(chosen.candidate.basis.count());
        let bent = ln_occam(more as f64, chosen.gain).exp();
        odds.push((rival.family, bent * (ln_odds(-nats) - 1.2 * behind).exp().min(1.0)));
    }
    let total: f64 = odds.iter().map(|o| o.1).sum();
    odds.sort_by(|a, b| b.1.total_cmp(&a.1));
    let alternatives: Vec<Alternative> = odds
        .iter()
        .filter(|o| o.0 != RECALIBRATE)
        .map(|&(effect, o)| (effect, (1.0 - none) * o / total))
        .filter(|a| a.1 > MIN_PROBABILITY)
        .map(|(effect, p)| Alternative { effect, probability: Some(p) })
        .take(5)
        .collect();
    if family == RECALIBRATE {
        return (Status::Recalibrate, None, alternatives);
    }
    let sure = alternatives.first().and_then(|a| a.probability).unwrap_or(0.0);
    let status = if sure < 0.6 && alternatives.len() > 1 { Status::OneOf } else { Status::Named };
    (status, Some(family), alternatives)
}

/// Text on what was left out, how it shows, and what it could be taken for.
pub fn physics(
    status: Status,
    effect: Option<&'static str>,
    statistic: Statistic,
    axis: Axis,
    shape: Option<&str>,
) -> String {
    if status == Status::Recalibrate {
        return "Nothing of the physics is missing: the numbers of sigma(z, theta) themselves are off. Calibrate again, or take the factor given here.".into();
    }
    let Some(card) = effect.and_then(effects::find).map(|e| e.card()) else {
        let what = match statistic {
            Statistic::Bias => "the mean error",
            Statistic::Variance => "the size of the noise",
            Statistic::Distribution => "the distribution of the errors",
            Statistic::Correlation => "how errors hang together",
            Statistic::Dropout => "where measurements are missing",
        };
        let shape = shape.map_or(String::new(), |s| format!(": {s}"));
        let over = axis.in_words();
        return format!(
            "Unexplained: {what} depends on the {over}{shape}. No effect of the catalogue explains it."
        );
    };
    format!(
        "Left out: {}. It is told by {} along {}. It could be taken for {}.",
        card.summary, card.statistic, card.axis, card.confused_with
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::finding::other_findings::{named, nameless};
    use crate::terms::{Basis, Term};

    /// With half of the error nameless, the name is half as probable. A remainder on another axis, or of
    /// another statistic, has no effect.
    #[test]
    fn a_name_is_doubted_by_what_is_left_over_the_picture_beside_it() {
        let with = |share: f64, statistic: Statistic, axis: Axis| Finding {
            share,
            ..nameless(statistic, axis)
        };
        let bowl = || Finding {
            share: 30.0,
            alternatives: vec![Alternative {
                effect: "radial-disparity-bias",
                probability: Some(0.96),
            }],
            ..named("radial-disparity-bias", Statistic::Bias, Axis::Radius)
        };
        let sure = |rest: Finding| {
            let mut found = [bowl(), rest];
            doubt_beside_the_unexplained(&mut found);
            found[0].alternatives[0].probability.unwrap()
        };
        assert!((sure(with(30.0, Statistic::Bias, Axis::Column)) - 0.48).abs() < 1e-12);
        assert_eq!(sure(with(30.0, Statistic::Variance, Axis::Column)), 0.96);
        assert_eq!(sure(with(30.0, Statistic::Bias, Axis::Z)), 0.96);
    }

    /// Losses and noise differ between views for other reasons, and were named rightly all the same.
    #[test]
    fn halves_that_disagree_leave_a_name_of_the_mean_as_probable_as_they_were_right() {
        let sure = |statistic, replicated| {
            let alternatives = vec![Alternative { effect: "target-bow", probability: Some(1.0) }];
            let bow = named("target-bow", statistic, Axis::TargetPosition);
            let mut found = [Finding { replicated, alternatives, ..bow }];
            doubt_where_halves_disagree(&mut found);
            found[0].alternatives[0].probability.unwrap()
        };
        assert!((sure(Statistic::Bias, Some(false)) - 0.5833).abs() < 1e-4);
        assert_eq!([Some(true), None].map(|r| sure(Statistic::Bias, r)), [1.0; 2]);
        assert_eq!(sure(Statistic::Variance, Some(false)), 1.0);
    }

    #[test]
    fn a_name_that_is_less_probable_than_none_is_what_it_resembles() {
        let of = |p: &[f64]| {
            let tell = |p: &f64| Alternative { effect: "vignetting", probability: Some(*p) };
            let mut f = Finding {
                alternatives: p.iter().map(tell).collect(),
                ..named("vignetting", Statistic::Variance, Axis::Radius)
            };
            resembles_only(&mut f);
            (f.status, f.effect)
        };
        assert_eq!(of(&[0.3, 0.2]), (Status::Unexplained, None));
        assert_eq!(of(&[0.3, 0.5]), (Status::Named, Some("vignetting")), "some name it has");
        assert_eq!(of(&[0.6]), (Status::Named, Some("vignetting")));
        let mut untested = named("vignetting", Statistic::Variance, Axis::Radius);
        resembles_only(&mut untested);
        assert_eq!(untested.effect, Some("vignetting"), "no test has weighed it");
    }

    /// At 1 % the odds of chance are 4 e 0.01 ln(100) = 1/2. No evidence leaves the prior odds.
    #[test]
    fn a_p_value_near_its_level_leaves_room_for_chance() {
        assert!(by_chance(1e-6) < 2e-4 && (by_chance(1.0) - 0.8).abs() < 1e-12);
        let alternatives = vec![Alternative { effect: "vignetting", probability: Some(1.0) }];
        let vignette = named("vignetting", Statistic::Variance, Axis::Radius);
        let mut doubtful = Finding { p_adjusted: Some(0.01), alternatives, ..vignette };
        finish(&mut doubtful);
        let sure = doubtful.alternatives[0].probability.unwrap();
        assert!((sure - 0.6663).abs() < 1e-4, "{sure}");
    }

    /// Twelve nats are 25 = 5^2 times the information of the prior.
    #[test]
    fn each_column_more_costs_the_root_of_what_was_seen() {
        assert_eq!(
            [ln_occam(0.0, 12.0), ln_occam(1.0, 0.0), ln_occam(1.0, -3.0)].map(f64::abs),
            [0.0; 3]
        );
        assert!((ln_occam(1.0, 12.0).exp() - 0.2).abs() < 1e-12);
        assert!((ln_occam(2.0, 12.0).exp() - 0.04).abs() < 1e-12);
    }

    #[test]
    fn tempered_odds_keep_their_order_and_their_sum() {
        let of = |p: &[f64]| -> Vec<f64> {
            let tell = |p: &f64| Alternative { effect: "vignetting", probability: Some(*p) };
            let mut all: Vec<Alternative> = p.iter().map(tell).collect();
            temper(&mut all);
            all.iter().filter_map(|a| a.probability).collect()
        };
        assert_eq!(of(&[1.0]), [1.0]);
        assert!(
            (of(&[0.5])[0] - 0.5).abs() < 1e-12,
            "as probable as not, whatever the temperature"
        );
        let [first, second] = of(&[0.9, 0.08])[..] else { panic!("two names") };
        assert!(first < 0.9 && second > 0.08 && first + second < 0.98, "{first}, {second}");
        let mut untold = [Alternative { effect: "vignetting", probability: None }];
        temper(&mut untold);
        assert_eq!(untold[0].probability, None);
    }

    /// The extended model holds a measured curve, nothing of what only some views have, and still has an
    /// effect that the views contradict.
    #[test]
    fn whether_the_extended_model_has_it_is_told() {
        let told = |change: &dyn Fn(&mut Finding)| {
            let mut f = nameless(Statistic::Bias, Axis::Pixel);
            change(&mut f);
            finish(&mut f);
            f.physics
        };
        let level = || Term::bias(Basis::Level, vec![1.0]);
        assert!(
            told(&|f| f.terms = vec![level()])
                .ends_with("holds it as the curve that was measured.")
        );
        assert!(told(&|_| ()).ends_with("has no term for it."));
        assert!(!told(&|f| f.contradicted = Some("row-noise")).contains("extended model"));
        let mut some = Finding {
            of_some: Some([3, 12]),
            ..named("row-noise", Statistic::Correlation, Axis::Row)
        };
        finish(&mut some);
        assert!(some.physics.ends_with("has no term for it."));
    }
}
