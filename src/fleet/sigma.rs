//! Compares sigma of several models at places that all of them have measured.

use nalgebra::DVector;
use serde::Serialize;

use super::curve::Curve;
use super::own::{Standing, sort_out};
use super::unit::UnitModel;
use crate::error::{Error, Result};
use crate::model::SigmaModel;
use crate::stats::{RandomEffects, student_quantile};

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SharedSigma {
    pub standings: Vec<Standing>,
    pub places: Vec<SharedPlace>,
}

/// Sigma along the optical axis at a distance and tilt.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SharedPlace {
    pub z_m: f64,
    pub theta_rad: f64,
    pub common_m: f64,
    pub common_interval_m: [f64; 2],
    /// Standard deviation between units, relative.
    pub scatter: f64,
    pub scatter_interval: [f64; 2],
    pub units: Vec<SigmaOfUnit>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SigmaOfUnit {
    pub unit: String,
    pub sigma_m: f64,
    pub std_error_m: f64,
    /// Relative to the mean of the other units that share a curve, with its 95 % interval at this place
    /// alone.
    pub departure: f64,
    pub departure_interval: [f64; 2],
}

/// A distance, m, and a tilt, rad.
pub(super) type Place = (f64, f64);

/// Number of distances, at the smallest common tilt: a form has at most three parameters along z.
const DISTANCES: usize = 4;
/// Smallest range of tilts over which a form could show a difference, 10 degrees.
const MIN_TILT_RANGE_RAD: f64 = 0.17;

/// Distances from near to far in equal ratios, and two tilts at the middle distance.
pub(super) fn places(units: &[&UnitModel]) -> Result<Vec<Place>> {
    let [near, far] = overlap(units, "distances", "m", |s| s.domain.z_m)?;
    let [square, steep] = overlap(units, "tilts", "rad", |s| s.domain.theta_rad)?;
    let ratio = |share: f64| near * (far / near).powf(share);
    let last = DISTANCES as f64 - 1.0;
    let mut all: Vec<Place> =
        (0..DISTANCES).map(|i| (ratio(i as f64 / last).clamp(near, far), square)).collect();
    all.dedup();
    if steep - square >= MIN_TILT_RANGE_RAD {
        all.extend([0.5, 1.0].map(|share| (ratio(0.5), square + share * (steep - square))));
    }
    Ok(all)
}

/// Range that all models have measured.
fn overlap(
    units: &[&UnitModel],
    what: &str,
    unit: &str,
    range: impl Fn(&SigmaModel) -> [f64; 2],
) -> Result<[f64; 2]> {
    let of = |u: &&&UnitModel| range(&u.model.sigma);
    let highest_low = units.iter().max_by(|a, b| of(a)[0].total_cmp(&of(b)[0]));
    let lowest_high = units.iter().min_by(|a, b| of(a)[1].total_cmp(&of(b)[1]));
    let (Some(low), Some(high)) = (highest_low, lowest_high) else { return Ok([0.0, 0.0]) };
    let ([start, end], [other_start, other_end]) = (of(&low), of(&high));
    if start <= other_end {
        return Ok([start, other_end]);
    }
    Err(Error::Argument {
        what: format!(
            "{} was measured at {what} from {start:.2} to {end:.2} {unit}, {} from {other_start:.2} to {other_end:.2}: nothing in common",
            low.path.display(),
            high.path.display()
        ),
        remedy: "record the units at the same distances and tilts",
    })
}

/// ln sigma along the optical axis.
pub(super) fn curve(sigma: &SigmaModel, places: &[Place]) -> Curve {
    let logs = places.iter().map(|&(z, theta)| sigma.axial_sigma(z, theta).ln());
    Curve {
        values: DVector::from_iterator(places.len(), logs),
        covariance: sigma.log_covariance(places),
        degrees_of_freedom: sigma.degrees_of_freedom,
    }
}

/// Compares the units' newest models; `None` where an error is unknown.
pub(super) fn shared(
    newest: &[(String, &UnitModel)],
    statistics: usize,
) -> Result<Option<SharedSigma>> {
    let units: Vec<&UnitModel> = newest.iter().map(|(_, u)| *u).collect();
    let all_places = places(&units)?;
    let all: Vec<Curve> = units.iter().map(|u| curve(&u.model.sigma, &all_places)).collect();
    let names = newest.iter().map(|(name, _)| name);
    let Some((standings, departures)) = sort_out(names, &all, statistics) else { return Ok(None) };
    let at = |(i, &(z_m, theta_rad)): (usize, &Place)| {
        let values: Vec<(f64, f64)> = all.iter().map(|c| (c.values[i], c.variance(i))).collect();
        let shared = RandomEffects::of(&values)?;
        let of_unit = |((name, _), (curve, off)): (&(String, &UnitModel), (&Curve, &Curve))| {
            let reach = student_quantile(0.95, off.degrees_of_freedom) * off.std_error(i);
            let ratio = |by: f64| (off.values[i] + by).exp_m1();
            let sigma_m = curve.values[i].exp();
            SigmaOfUnit {
                unit: name.clone(),
                sigma_m,
                std_error_m: sigma_m * curve.std_error(i),
                departure: ratio(0.0),
                departure_interval: [ratio(-reach), ratio(reach)],
            }
        };
        Some(SharedPlace {
            z_m,
            theta_rad,
            common_m: shared.common.exp(),
            common_interval_m: shared.common_interval.map(f64::exp),
            scatter: shared.scatter,
            scatter_interval: shared.scatter_interval,
            units: newest.iter().zip(all.iter().zip(&departures)).map(of_unit).collect(),
        })
    };
    let places = all_places.iter().enumerate().map(at).collect::<Option<Vec<_>>>();
    Ok(places.map(|places| SharedSigma { standings, places }))
}
