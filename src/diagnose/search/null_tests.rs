//! The null distribution against noise simulated sample by sample.

use super::*;
use crate::diagnose::search::evidence::gain;
use crate::diagnose::search::evidence::tests::{View, normal};
use crate::diagnose::search::tests::RULES;
use crate::diagnose::views::learnt::Learnt;
use crate::rng::{Seed, Stream};

/// The gain that `detectable` asks for is the one the search accepts, with and without a model of other
/// views.
#[test]
fn the_gain_for_so_many_nats_counts_for_as_many() {
    let null = Null {
        axes: DMatrix::zeros(0, 0),
        vectors: Vec::new(),
        prior: 1.0,
        dispersion: 1.5,
        about_fit: 3.0,
    };
    let rules = |learnt_from| Rules { learnt_from, ..RULES };
    let other = |searched| Some(Learnt { views: 20.0, searched });
    for (learnt_from, factor) in [(None, 0.99), (other(false), 2.0), (other(true), 4.0)] {
        let rules = rules(learnt_from);
        let gain = null.gain_for(7.0, 12, &rules);
        approx::assert_relative_eq!(
            null.calibrated_gain(gain, 12, &rules),
            7.0,
            max_relative = 1e-12
        );
        assert!(gain > factor * null.dispersion * 7.0, "{gain}");
    }
}

const DRAWS: usize = 4000;

/// Gains of the candidate over the chosen terms in recordings of pure noise, simulated sample by
/// sample; the chosen terms have nonzero true coefficients.
fn simulated(views: &[View], prior: f64, rng: &mut Stream) -> Vec<f64> {
    let chosen = views[0].chosen.ncols();
    let mut noisy: Vec<View> = views.to_vec();
    let truth = DVector::from_element(chosen, 0.8);
    let mut gains: Vec<f64> = (0..DRAWS)
        .map(|_| {
            for (view, n) in views.iter().zip(&mut noisy) {
                let noise = view.w.map(|w| if w > 0.0 { normal(rng) / w.sqrt() } else { 0.0 });
                n.y = &view.chosen * &truth + noise;
            }
            let with: Vec<Evidence> = noisy.iter().map(View::evidence).collect();
            let before: Vec<Evidence> =
                noisy.iter().map(|v| v.rows().reduce(0, |_, _| ())).collect();
            let base = if chosen > 0 { gain(&before, prior).unwrap().total } else { 0.0 };
            gain(&with, prior).unwrap().total - base
        })
        .collect();
    gains.sort_by(f64::total_cmp);
    gains
}

fn drawn(views: &[View], prior: f64, rng: &mut Stream) -> Vec<f64> {
    let evidence: Vec<Evidence> = views.iter().map(View::evidence).collect();
    let null = Null::of(&evidence, views[0].chosen.ncols(), prior).unwrap();
    let mut gains: Vec<f64> = (0..DRAWS).map(|_| null.draw(rng)).collect();
    gains.sort_by(f64::total_cmp);
    gains
}

/// Greatest distance between two samples' distribution functions.
fn kolmogorov_smirnov(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .map(|x| {
            let share = |s: &[f64]| s.partition_point(|y| y < x) as f64 / s.len() as f64;
            (share(a) - share(b)).abs()
        })
        .fold(0.0, f64::max)
}

/// Views with the same columns and different weights.
fn multiples(chosen: usize, candidate: usize, rng: &mut Stream) -> Vec<View> {
    let one = View { precision: vec![0.0; 3], ..View::draw(25, chosen, candidate, rng) };
    (0..7).map(|v| View { w: &one.w * (0.5 + f64::from(v)), ..one.clone() }).collect()
}

/// Where the views' information differs only by a factor, the drawn gains are distributed as those of
/// noise. False-alarm rate of each Kolmogorov-Smirnov test: 1e-4.
#[test]
fn noise_is_drawn_as_noise_brings_it_where_views_are_alike() {
    let bound = (-(0.5e-4f64).ln() / 2.0).sqrt() * (2.0 / DRAWS as f64).sqrt();
    for candidate in [1, 4] {
        let mut rng = Seed(candidate as u64).stream("evidence/null");
        let views = multiples(0, candidate, &mut rng);
        let (brute, quick) = (simulated(&views, 1e-6, &mut rng), drawn(&views, 1e-6, &mut rng));
        let distance = kolmogorov_smirnov(&brute, &quick);
        assert!(distance < bound, "{candidate} columns: {distance} > {bound}");
    }
}

/// Views that differ, with chosen terms: noise exceeds the drawn 95 % and 99 % quantiles at most 4/3
/// and 5/3 times as often as it should, and no less than a third as often. Monte Carlo alone moves
/// these shares by 7 % and 16 % (one standard deviation; root two times that for 4,000 simulated
/// against 4,000 drawn gains).
#[test]
fn noise_is_drawn_nearly_so_where_views_differ() {
    for (seed, chosen, candidate) in [(1, 0, 3), (2, 2, 3), (3, 1, 8)] {
        let mut rng = Seed(seed).stream("evidence/differ");
        let views: Vec<View> = (0..9)
            .map(|v| {
                let mut view = View::draw(25, chosen, candidate, &mut rng);
                view.precision = vec![0.0; 3];
                view.w *= 0.3 + 0.2 * f64::from(v);
                view
            })
            .collect();
        let (brute, quick) = (simulated(&views, 1e-6, &mut rng), drawn(&views, 1e-6, &mut rng));
        for (share, most) in [(0.05, 0.05 * 4.0 / 3.0), (0.01, 0.01 * 5.0 / 3.0)] {
            let cut = quick[((1.0 - share) * DRAWS as f64) as usize];
            let above = DRAWS - brute.partition_point(|g| *g < cut);
            let above = above as f64 / DRAWS as f64;
            println!("{chosen} chosen, {candidate} columns: {above:.4} above the {share} quantile");
            assert!(above < most, "noise passes the {share} quantile in {above}");
            assert!(above > share / 3.0, "the {share} quantile is far too high: {above}");
        }
    }
}

/// Dispersion of twelve views whose coefficients scatter by `apart` about `common`.
fn scatter(common: f64, apart: f64, rng: &mut Stream) -> f64 {
    let evidence: Vec<Evidence> = (0..12)
        .map(|_| {
            let mut view = View::draw(60, 1, 3, rng);
            let noise = view.w.map(|w| if w > 0.0 { normal(rng) / w.sqrt() } else { 0.0 });
            let own = DVector::from_fn(3, |_, _| common + apart * normal(rng));
            view.y = &view.candidate * own + &view.chosen * DVector::from_element(1, -3.0) + noise;
            view.evidence()
        })
        .collect();
    Null::of(&evidence, 1, 1e-6).unwrap().dispersion
}

/// With 33 degrees of freedom the mean square has a standard deviation of 0.25, one of which is already
/// subtracted. 1.75 is four of them off: a chance of 2e-3 in 20 draws, for the skewed tail. The second
/// bound is from an information of about 100 units per view: 1 + 100 * 0.5^2 = 26.
#[test]
fn views_that_disagree_are_seen_to() {
    let mut rng = Seed(5).stream("evidence/dispersion");
    for _ in 0..20 {
        let calm = scatter(0.0, 0.0, &mut rng);
        assert!((1.0..1.75).contains(&calm), "{calm}");
    }
    let wild = scatter(0.0, 0.5, &mut rng);
    assert!(wild > 5.0, "{wild}");
}

/// Views that agree do not scatter, however large the common coefficient.
#[test]
fn views_that_agree_on_something_strong_do_not_scatter() {
    let mut rng = Seed(6).stream("evidence/agree");
    for common in [0.1, 0.5, 2.0] {
        let calm = scatter(common, 0.0, &mut rng);
        assert!((1.0..1.75).contains(&calm), "coefficients of {common} in all views: {calm}");
    }
}
