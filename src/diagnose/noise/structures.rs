//! Structure of the noise of all views.

use rayon::prelude::*;

use super::pairs::Lines;
use super::still::{KeptPattern, beside_bias, still};
use super::structure::{Structure, structure};
use super::view_mean::ViewMean;
use crate::diagnose::views::field::Field;

/// Measures all views. `bias` is their known bias, px by view and pixel (or empty).
pub fn structures(fields: &[Field], bias: &[Vec<f32>], kept: &KeptPattern) -> Vec<Structure> {
    let views = beside_bias(fields, bias);
    let (mut all, short): (Vec<Structure>, Vec<Lines>) =
        views.par_iter().map(|(f, b)| structure(f, b)).unzip();
    if is_without_window(&all) {
        all.iter_mut().zip(short).for_each(|(s, lines)| s.take_lines(lines));
    }
    for (s, still) in all.iter_mut().zip(still(&views, kept)) {
        s.still = still;
    }
    all
}

/// Only the size of the noise, and what the views share.
pub fn shared(fields: &[Field], bias: &[Vec<f32>], kept: &KeptPattern) -> Vec<Structure> {
    let views = beside_bias(fields, bias);
    let sizes = views.par_iter().map(|(field, bias)| Structure::of_size(field, bias));
    let all: Vec<Structure> = sizes.collect();
    all.into_iter().zip(still(&views, kept)).map(|(s, still)| Structure { still, ..s }).collect()
}

/// One-sided p-value, on either side, from which near pixels count as independent.
const INDEPENDENT: f64 = 0.05;

fn is_without_window(views: &[Structure]) -> bool {
    // Where lines share nearly everything, the correlation of the rest is unknown, and may exceed one.
    let known = views.iter().filter_map(|s| s.neighbour_correlation).all(|rho| rho.abs() < 1.0);
    let near = ViewMean::of(views, |s| s.neighbour_correlation).filter(|_| known);
    near.is_some_and(|m| m.p_above(0.0).min(m.p_below(0.0)) > INDEPENDENT)
}
