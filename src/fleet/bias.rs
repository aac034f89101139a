//! The bias of depth over the picture as the sum of a model's fitted shapes.
//!
//! Diagnoses differ in how they split a bias among causes; only the sum in metres was measured.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::curve::Curve;
use super::own::{Standing, sort_out};
use super::unit::UnitModel;
use crate::camera::Camera;
use crate::model::{Effect, NoiseModel};
use crate::plane::Plane;
use crate::terms::{PixelContext, Pixels, Term};

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SharedBias {
    pub standings: Vec<Standing>,
    pub distances: Vec<SharedDistance>,
}

/// Bias of depth over the picture, as RMS.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SharedDistance {
    pub z_m: f64,
    /// RMS of the units' mean and of their scatter about it, both minus the contribution of the errors.
    pub common_rms_m: f64,
    pub scatter_rms_m: f64,
    pub units: Vec<BiasOfUnit>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BiasOfUnit {
    pub unit: String,
    pub rms_m: f64,
    pub error_rms_m: f64,
    /// RMS of the difference from the mean of the other units that share a bias, minus the contribution of
    /// the errors.
    pub departure_rms_m: f64,
}

/// Columns and rows of the pixels at which the bias is compared.
const GRID: [usize; 2] = [9, 7];
const PIXELS: usize = GRID[0] * GRID[1];
/// Number of distances. A bias depends on the disparity by at most two parts, a constant and a square.
const DISTANCES: usize = 3;

/// Degrees of freedom: practically infinite, because the fit uses all pixels of all views.
const EXACT: f64 = 1e9;
/// Share of a bias below which what is left beside the planes is rounding.
const ROUNDING: f64 = 1e-9;

/// Effects whose bias can be compared, or the reason why there are none.
pub(super) fn shapes(model: &NoiseModel) -> Result<Vec<&Effect>, String> {
    let is_bias = |e: &&Effect| e.shape.iter().any(usable);
    let found: Vec<&Effect> = model.effects.iter().filter(is_bias).collect();
    if found.is_empty() {
        return Err("holds no measured bias: it was not diagnosed, or none was found".into());
    }
    let lacks = |e: &&&Effect| e.covariance.as_ref().is_none_or(|c| c.is_empty());
    match found.iter().find(lacks) {
        Some(effect) => Err(format!(
            "does not say how sure its {} is (an older file?): diagnose it again to compare its bias",
            effect.id
        )),
        None => Ok(found),
    }
}

/// Whether the term is a bias of the sensor that is the same in every session and on any surface.
fn usable(term: &Term) -> bool {
    let needs = term.needs();
    term.is_sensor_bias() && !needs.light && !needs.temperature && !needs.session
}

/// The camera, and depth times disparity, px m.
fn scale(model: &NoiseModel) -> Option<(Camera, f64)> {
    let sensor = model.described_sensor().ok()??;
    let scale = sensor.scale_px_m();
    Some((sensor.camera, scale))
}

/// Distances at which all models have learnt their biases, near to far; empty if they have none in common.
pub(super) fn distances(models: &[&NoiseModel]) -> Vec<f64> {
    let [mut near, mut far] = [0.0, f64::INFINITY];
    for model in models {
        let Some((_, scale)) = scale(model) else { return Vec::new() };
        let learnt = model
            .effects
            .iter()
            .filter_map(|e| e.learnt_px)
            .map(|[low, high]| [scale / high, scale / low]);
        for [a, b] in learnt.chain([model.sigma.domain.z_m]) {
            (near, far) = (f64::max(near, a), f64::min(far, b));
        }
    }
    if !(near > 0.0 && near <= far && far.is_finite()) {
        return Vec::new();
    }
    let last = DISTANCES as f64 - 1.0;
    let mut all: Vec<f64> =
        (0..DISTANCES).map(|i| near * (far / near).powf(i as f64 / last)).collect();
    all.dedup();
    all
}

/// The bias of depth over the picture at each distance, m, for a frontal wall. The part that is affine in the
/// ray is removed, because planes cannot show it.
pub(super) fn curve(model: &NoiseModel, effects: &[&Effect], distances: &[f64]) -> Option<Curve> {
    let (camera, scale) = scale(model)?;
    let rays = camera.rays();
    let pixels = Pixels::new(&camera, &rays, scale);
    let grid = grid(&camera);
    let without_plane = without_plane(&grid.iter().map(|&i| rays.at(i)).collect::<Vec<_>>())?;
    let n = PIXELS * distances.len();
    let mut sum =
        Sum { values: DVector::zeros(n), own: DMatrix::zeros(n, n), parts: BTreeMap::new() };
    for effect in effects {
        let mut first = 0;
        for term in &effect.shape {
            let span = first..first + term.coefficients.len();
            first = span.end;
            if !usable(term) {
                continue;
            }
            let (mut rows, mut whole) = (DMatrix::zeros(n, span.len()), 0.0);
            for (d, &z) in distances.iter().enumerate() {
                let mut block = DMatrix::zeros(PIXELS, span.len());
                let mut row = vec![0.0; span.len()];
                for (k, &i) in grid.iter().enumerate() {
                    let place = wall(&pixels, i, z);
                    row.fill(0.0);
                    term.basis.fill(&place, &mut row);
                    // A larger disparity is a smaller depth.
                    let depth = -z * z / scale;
                    row.iter().enumerate().for_each(|(j, v)| block[(k, j)] = depth * v);
                }
                let left = &without_plane * &block;
                whole = f64::max(whole, block.amax());
                rows.rows_mut(d * PIXELS, PIXELS).copy_from(&left);
            }
            // A bias that is the same all over a frontal wall leaves rounding errors only.
            if rows.amax() > ROUNDING * whole {
                sum.add(effect, span, term, &rows);
            }
        }
    }
    let mut covariance = sum.own;
    for part in sum.parts.values() {
        covariance += part * part.transpose();
    }
    Some(Curve { values: sum.values, covariance, degrees_of_freedom: EXACT })
}

/// Sum of the terms so far.
struct Sum {
    values: DVector<f64>,
    own: DMatrix<f64>,
    /// Correlated factors, by fit and number within the fit.
    parts: BTreeMap<(u32, usize), DVector<f64>>,
}

impl Sum {
    fn add(
        &mut self,
        effect: &Effect,
        span: std::ops::Range<usize>,
        term: &Term,
        rows: &DMatrix<f64>,
    ) {
        self.values += rows * DVector::from_column_slice(&term.coefficients);
        let Some(covariance) = &effect.covariance else { return };
        for (k, factor) in covariance.factors.iter().enumerate() {
            let Some(factor) = factor.get(span.clone()) else { continue };
            let of_part = rows * DVector::from_column_slice(factor);
            self.parts
                .entry((covariance.fit, k))
                .and_modify(|sum| *sum += &of_part)
                .or_insert(of_part);
        }
        if let Some(variances) = covariance.variances.get(span) {
            let mut weighted = rows.clone();
            for (mut column, v) in weighted.column_iter_mut().zip(variances) {
                column *= *v;
            }
            self.own += weighted * rows.transpose();
        }
    }
}

/// Pixels at the centres of equal fields of the picture.
fn grid(camera: &Camera) -> Vec<usize> {
    let middle = |k: usize, fields: usize, size: usize| (2 * k + 1) * size / (2 * fields);
    let [across, down] = GRID;
    (0..PIXELS)
        .map(|k| {
            let (u, v) =
                (middle(k % across, across, camera.width), middle(k / across, down, camera.height));
            v * camera.width + u
        })
        .collect()
}

/// A pixel that sees a frontal wall at distance `z`, m.
fn wall(pixels: &Pixels<'_>, i: usize, z: f64) -> PixelContext {
    let mut place = pixels.place(i);
    place.at_disparity(pixels.scale_px_m / z, pixels.scale_px_m);
    place.lean_on(&Plane::tilted(z, 0.0, 0.0), pixels);
    place
}

/// Projection that removes the part affine in the ray from values on these rays.
fn without_plane(rays: &[(f64, f64)]) -> Option<DMatrix<f64>> {
    let x = DMatrix::from_fn(rays.len(), 3, |i, j| [1.0, rays[i].0, rays[i].1][j]);
    let inverse = (x.transpose() * &x).try_inverse()?;
    Some(DMatrix::identity(rays.len(), rays.len()) - &x * inverse * x.transpose())
}

/// Units whose biases can be compared.
pub(super) struct Comparable {
    units: Vec<String>,
    curves: Vec<Curve>,
    distances: Vec<f64>,
}

/// The comparable units, at least two; the others get remarks.
pub(super) fn comparable(
    newest: &[(String, &UnitModel)],
    remarks: &mut Vec<String>,
) -> Option<Comparable> {
    let mut usable = Vec::new();
    for (name, unit) in newest {
        match shapes(&unit.model) {
            Ok(found) => usable.push((name, &unit.model, found)),
            Err(why) => remarks.push(format!("{name}: its model {why}")),
        }
    }
    if usable.len() < 2 {
        return None;
    }
    let models: Vec<_> = usable.iter().map(|(_, model, _)| *model).collect();
    let distances = distances(&models);
    if distances.is_empty() {
        remarks.push("the units learnt their biases at distances that have nothing in common: biases are not compared".into());
        return None;
    }
    let of =
        |(_, model, found): &(&String, &NoiseModel, Vec<&Effect>)| curve(model, found, &distances);
    let curves = usable.iter().map(of).collect::<Option<Vec<_>>>()?;
    Some(Comparable {
        units: usable.iter().map(|(name, ..)| (*name).clone()).collect(),
        curves,
        distances,
    })
}

pub(super) fn shared(
    Comparable { units, curves: all, distances }: &Comparable,
    statistics: usize,
) -> Option<SharedBias> {
    let (standings, departures) = sort_out(units.iter(), all, statistics)?;
    let mean = Curve::mean(&all.iter().collect::<Vec<_>>())?;
    let count = all.len() as f64;
    let plain_mean = all.iter().map(|c| &c.values).sum::<DVector<f64>>() / count;
    let root = |square: f64| square.max(0.0).sqrt();
    let at = |(d, &z_m): (usize, &f64)| {
        let [square, error] = mean_squares(&mean, d);
        let about = |c: &Curve| {
            let off = &c.values - &plain_mean;
            off.rows(d * PIXELS, PIXELS).norm_squared() / PIXELS as f64
        };
        let about: f64 = all.iter().map(about).sum();
        let errors: f64 = all.iter().map(|c| mean_squares(c, d)[1]).sum();
        let of_unit = |(unit, (curve, departure)): (&String, (&Curve, &Curve))| {
            let [own, own_error] = mean_squares(curve, d);
            let [off, off_error] = mean_squares(departure, d);
            BiasOfUnit {
                unit: unit.clone(),
                rms_m: own.sqrt(),
                error_rms_m: own_error.sqrt(),
                departure_rms_m: root(off - off_error),
            }
        };
        SharedDistance {
            z_m,
            common_rms_m: root(square - error),
            scatter_rms_m: root(about / (count - 1.0) - errors / count),
            units: units.iter().zip(all.iter().zip(&departures)).map(of_unit).collect(),
        }
    };
    let distances = distances.iter().enumerate().map(at).collect();
    Some(SharedBias { standings, distances })
}

/// Mean squares over the picture at the `d`-th distance: of the values and of their errors.
pub(super) fn mean_squares(curve: &Curve, d: usize) -> [f64; 2] {
    let span = d * PIXELS..(d + 1) * PIXELS;
    let mean = |of: &dyn Fn(usize) -> f64| span.clone().map(of).sum::<f64>() / PIXELS as f64;
    [mean(&|i| curve.values[i].powi(2)), mean(&|i| curve.covariance[(i, i)])]
}
