//! The fitted shapes of a model, applied in place of the catalogue's formulas.

use rayon::prelude::*;

use super::{Card, Carded, Draw, Effect, Exposure, Settings, Stage};
use crate::plane::Plane;
use crate::scene::Seen;
use crate::stats::median_in_place;
use crate::terms::{LearntTerm, Needs, PixelContext, Pixels, Statistic, Term, edge_distances};

/// All terms of one statistic: a bias shifts the disparity, a variance term scales the variance, evaluated
/// at what each pixel sees undisturbed.
pub struct Shape {
    card: &'static Card,
    pub(super) terms: Vec<LearntTerm>,
}

static BIAS: Card = Card {
    id: "shape-of-bias",
    title: "a measured bias without a formula",
    stage: Stage::Disparity,
    summary: "errors of the disparity as a fit found them, without a formula",
    statistic: "bias",
    axis: "pixel",
    reference: "the model",
    ..Card::BASE
};

static VARIANCE: Card = Card {
    id: "shape-of-variance",
    title: "a measured variance without a formula",
    stage: Stage::Variance,
    summary: "changes of the noise as a fit found them, without a formula",
    statistic: "variance",
    ..BIAS
};

impl Shape {
    /// Groups terms into a shape of the bias and one of the variance.
    pub(super) fn of(terms: impl Iterator<Item = LearntTerm>) -> impl Iterator<Item = Shape> {
        let (bias, variance): (Vec<LearntTerm>, Vec<LearntTerm>) =
            terms.partition(|(t, _)| t.statistic == Statistic::Bias);
        let shapes = [(&BIAS, bias), (&VARIANCE, variance)];
        let shapes = shapes.map(|(card, terms)| Shape { card, terms });
        shapes.into_iter().filter(|s| !s.terms.is_empty())
    }

    fn change(&self, exposure: &mut Exposure, values: &[f32]) {
        if self.card.stage == Stage::Variance {
            scale_variance(exposure, values);
        } else {
            exposure.shift_disparity(|i| f64::from(values[i]));
        }
    }
}

impl Carded for Shape {
    fn card(&self) -> &'static Card {
        self.card
    }
}

impl Effect for Shape {
    fn forward(&self, _: &Settings, exposure: &mut Exposure, _: &Draw) {
        let (moving, still): (Vec<&LearntTerm>, Vec<&LearntTerm>) =
            self.terms.iter().partition(|(t, _)| t.needs().session);
        let at_rest = |e: &Exposure| values(&still, e);
        exposure.with_kept(self.card.id, at_rest, |exposure, at_rest| {
            if moving.is_empty() {
                self.change(exposure, at_rest);
            } else {
                let mut now = values(&moving, exposure);
                now.iter_mut().zip(at_rest).for_each(|(n, r)| *n += r);
                self.change(exposure, &now);
            }
        });
    }
}

/// Scales the variance. The terms were fitted to raw values, whose rounding is part of the variance but not
/// of `sigma`: it is added before and subtracted after.
fn scale_variance(exposure: &mut Exposure, log_ratio: &[f32]) {
    let rounding = rounding_variance(exposure);
    for (i, sigma) in exposure.sigma.iter_mut().enumerate() {
        let stored = sigma.powi(2) + rounding(exposure.seen.depth[i]);
        let scaled = stored * log_ratio[i].exp() - rounding(exposure.seen.depth[i]);
        *sigma = scaled.max(0.0).sqrt();
    }
}

/// Rounding variance of a raw value at a depth, m^2: uniform over a step.
fn rounding_variance(exposure: &Exposure) -> impl Fn(f32) -> f32 + use<> {
    let code = exposure.sensor.code;
    move |z| {
        let z = f64::from(z);
        ((code.step_inverse(z) * z * z).powi(2) / 12.0) as f32
    }
}

/// Sum of the terms at each pixel; zero where nothing is seen.
fn values(terms: &[&LearntTerm], exposure: &Exposure) -> Vec<f32> {
    let seen = exposure.seen;
    let mut sums = vec![0f32; seen.depth.len()];
    if terms.is_empty() {
        return sums;
    }
    let scene =
        Scene::of(exposure, terms.iter().fold(Needs::default(), |n, (t, _)| n.and(t.needs())));
    sums.par_chunks_mut(seen.width).enumerate().for_each(|(row, line)| {
        for (u, sum) in line.iter_mut().enumerate() {
            let i = row * seen.width + u;
            if seen.depth[i].is_nan() {
                continue;
            }
            let place = scene.place(i);
            let applies = terms.iter().filter(|(t, _)| scene.knows(t, i));
            *sum = applies.map(|(t, learnt)| t.held_value(*learnt, &place)).sum::<f64>() as f32;
        }
    });
    sums
}

/// Context of what a view's pixels see.
struct Scene<'a> {
    exposure: &'a Exposure<'a>,
    pixels: Pixels<'a>,
    needs: Needs,
    /// Distance to the target's edge, px; empty where no term needs it.
    edge: Vec<f32>,
    /// Median reflectance.
    grey: f64,
}

impl<'a> Scene<'a> {
    fn of(exposure: &'a Exposure<'a>, needs: Needs) -> Self {
        let seen = exposure.seen;
        let pixels =
            Pixels::new(&exposure.sensor.camera, exposure.rays, exposure.sensor.scale_px_m());
        let on_target = |i: usize| seen.is_target(i) && !seen.depth[i].is_nan();
        let edge = if needs.board && seen.target.is_some() {
            let on: Vec<bool> = (0..seen.depth.len()).map(on_target).collect();
            edge_distances(&on, seen.width)
        } else {
            Vec::new()
        };
        let grey = if needs.light { median_grey(seen) } else { 1.0 };
        Scene { exposure, pixels, needs, edge, grey }
    }

    /// Whether a term can be evaluated at pixel `i`: a board's shape needs the board, a curve over the
    /// temperature needs a measured temperature.
    fn knows(&self, term: &Term, i: usize) -> bool {
        let seen = self.exposure.seen;
        let needs = term.needs();
        let of_board = needs.board || !term.belongs_to_sensor();
        (!of_board || (seen.target.is_some() && seen.is_target(i)))
            && (!needs.temperature || self.exposure.temperature_c.is_some())
    }

    fn place(&self, i: usize) -> PixelContext {
        let Exposure { seen, instant, sigma, .. } = self.exposure;
        let mut place = self.pixels.place(i);
        let z = f64::from(seen.depth[i]);
        let scale = self.pixels.scale_px_m;
        place.at_disparity(scale / z, scale);
        place.session_s = instant.session_s;
        place.temperature_c = self.exposure.temperature_c.unwrap_or(0.0);
        place.ambient = self.exposure.ambient_lux;
        if self.needs.light {
            place.light = f64::from(seen.albedo[i]) / self.grey;
        }
        if self.needs.slope {
            // n . X is constant on the surface: the plane is q = n / (n . X).
            let normal = nalgebra::Vector3::from(seen.normal[i].map(f64::from));
            let point = nalgebra::Vector3::new(place.x, place.y, 1.0) * z;
            place.lean_on(&Plane::new(normal / normal.dot(&point)), &self.pixels);
            let rounding = rounding_variance(self.exposure)(seen.depth[i]);
            place.variance = f64::from(sigma[i].powi(2) + rounding) * (scale / (z * z)).powi(2);
            if let Some(target) = seen.target.filter(|_| self.needs.board) {
                (place.right, place.down) = target.place(&point);
                place.edge = self.edge.get(i).copied().map_or(0.0, f64::from);
            }
        }
        place
    }
}

fn median_grey(seen: &Seen) -> f64 {
    let pixels = 0..seen.depth.len();
    let mut greys: Vec<f32> = pixels
        .filter(|&i| !seen.depth[i].is_nan() && (seen.target.is_none() || seen.is_target(i)))
        .map(|i| seen.albedo[i])
        .collect();
    f64::from(median_in_place(&mut greys)).max(f64::MIN_POSITIVE)
}
