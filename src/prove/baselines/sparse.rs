//! Sparse regression on the diagnosis's own columns: stepwise by BIC, every pixel of every frame
//! taken for independent.
//!
//! That is how it is done where nobody asks about correlation; what it says is missing is the name
//! of the columns it takes.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};

use super::learnt::{AtPlaces, Learnt, each};
use super::linear::{Design, fit_log, ratios, solve, working};
use super::tiles::{Tile, Tiles};
use super::{Baseline, Fitted};
use crate::error::Result;
use crate::terms::{Basis, PixelContext, Statistic, Term};

#[derive(Debug, Clone, Copy)]
pub struct Sparse;

/// Columns that come together, and the effect they stand for.
struct Family {
    id: &'static str,
    basis: Basis,
}

fn family(id: &'static str, basis: Basis) -> Family {
    Family { id, basis }
}

/// Of stripes, px of a picture 640 px wide.
const STRIPES_PX: [f64; 9] = [16.0, 24.0, 32.0, 48.0, 64.0, 80.0, 96.0, 128.0, 192.0];

fn of_bias(tiles: &Tiles) -> Vec<Family> {
    let camera = &tiles.sensor.camera;
    let (fx, fy) = (camera.fx, camera.fy);
    let shrink = camera.width as f64 / 640.0;
    let mut all = vec![
        family("radial-disparity-bias", Basis::Bowl { disparity_power: 0.0, orders: 1 }),
        family("radial-disparity-bias", Basis::Bowl { disparity_power: 0.0, orders: 2 }),
        family("lens-distortion", Basis::Lens { fx, fy, orders: 1 }),
        family("range-not-depth", Basis::RangeNotDepth),
        family("target-bow", Basis::Bow { degree: 2 }),
        family("pixel-locking", Basis::Locking { period_px: 1.0, harmonics: 2 }),
        family("edge-mixing", Basis::EdgeMixing { width_px: 2.0 }),
        family("edge-mixing", Basis::EdgeMixing { width_px: 5.0 }),
    ];
    all.extend(STRIPES_PX.map(|period| {
        let period_px = shrink * period;
        family("column-banding", Basis::Banding { period_px, harmonics: 1 })
    }));
    all
}

/// What it calls a sigma that is wrong as a whole.
const RECALIBRATE: &str = "recalibrate";

fn of_variance() -> Vec<Family> {
    vec![
        family(RECALIBRATE, Basis::Level),
        family("range-exponent", Basis::RangeExponent { pivot_m: 2.0, orders: 1 }),
        family("vignetting", Basis::Vignetting { orders: 1 }),
        family("slope-noise", Basis::SlopeNoise { lateral_px: 0.5 }),
        family("tilt-axis-anisotropy", Basis::TiltAxis { tilt_power: 2 }),
        family("intensity-dependent-noise", Basis::Intensity { orders: 1 }),
        family("ambient-light", Basis::Ambient { ratio: 1.0 }),
    ]
}

fn columns(families: &[Family]) -> (usize, impl Fn(&Tile, &mut [f64]) + '_) {
    let count = families.iter().map(|f| f.basis.count()).sum();
    let fill = move |t: &Tile, mut row: &mut [f64]| {
        for f in families {
            let (mine, rest) = row.split_at_mut(f.basis.count());
            f.basis.fill(&t.place, mine);
            row = rest;
        }
    };
    (count, fill)
}

/// First column of a family and how many it has.
fn ranges(families: &[Family]) -> Vec<std::ops::Range<usize>> {
    let mut start = 0;
    let next = |f: &Family| {
        let range = start..start + f.basis.count();
        start = range.end;
        range
    };
    families.iter().map(next).collect()
}

fn indices(chosen: &[usize], ranges: &[std::ops::Range<usize>]) -> Vec<usize> {
    chosen.iter().flat_map(|&f| ranges[f].clone()).collect()
}

/// What the chosen columns take off the sum of squares, less ln N for each direction.
fn worth(gram: &DMatrix<f64>, right: &DVector<f64>, columns: &[usize], log_n: f64) -> f64 {
    if columns.is_empty() {
        return 0.0;
    }
    let gram =
        DMatrix::from_fn(columns.len(), columns.len(), |i, j| gram[(columns[i], columns[j])]);
    let right = DVector::from_fn(columns.len(), |i, _| right[columns[i]]);
    let solved = solve(&gram, &right);
    solved.drop - log_n * solved.rank as f64
}

/// The family that adds most beyond those chosen, when it adds anything.
fn best(
    chosen: &[usize],
    ranges: &[std::ops::Range<usize>],
    worth: &dyn Fn(&[usize]) -> f64,
) -> Option<usize> {
    let now = worth(&indices(chosen, ranges));
    let with = |f: usize| {
        let more: Vec<usize> = chosen.iter().copied().chain([f]).collect();
        worth(&indices(&more, ranges)) - now
    };
    (0..ranges.len())
        .filter(|f| !chosen.contains(f))
        .map(|f| (f, with(f)))
        .filter(|(_, gain)| *gain > 0.0)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(f, _)| f)
}

/// Take out what is not needed beside the others.
fn prune(
    chosen: &mut Vec<usize>,
    ranges: &[std::ops::Range<usize>],
    worth: &dyn Fn(&[usize]) -> f64,
) {
    let mut k = 0;
    while k < chosen.len() {
        let without: Vec<usize> =
            chosen.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, f)| *f).collect();
        if worth(&indices(&without, ranges)) >= worth(&indices(chosen, ranges)) {
            *chosen = without;
        } else {
            k += 1;
        }
    }
}

/// What was chosen, as terms; and the fitted bias over standard errors.
struct Found {
    names: Vec<&'static str>,
    terms: Vec<Term>,
    fitted: Vec<f64>,
}

fn terms(
    families: &[Family],
    chosen: &[usize],
    statistic: Statistic,
    beta: &DVector<f64>,
) -> Vec<Term> {
    let mut rest = beta.as_slice();
    let one = |&f: &usize| {
        let basis = families[f].basis.clone();
        let (mine, others) = rest.split_at(basis.count());
        rest = others;
        Term { statistic, basis, coefficients: mine.to_vec() }
    };
    chosen.iter().map(one).collect()
}

fn bias(tiles: &Tiles, log_n: f64) -> Found {
    let families = of_bias(tiles);
    let (count, fill) = columns(&families);
    let design = Design::of_bias(tiles, count, &fill).columns;
    let residual = Design::residual(tiles);
    let (gram, right) = (design.tr_mul(&design), design.tr_mul(&residual));
    let ranges = ranges(&families);
    let worth = |columns: &[usize]| worth(&gram, &right, columns, log_n);
    let mut chosen = Vec::new();
    while let Some(f) = best(&chosen, &ranges, &worth) {
        chosen.push(f);
    }
    prune(&mut chosen, &ranges, &worth);
    let taken = design.select_columns(&indices(&chosen, &ranges));
    let beta = if chosen.is_empty() {
        DVector::zeros(0)
    } else {
        solve(&taken.tr_mul(&taken), &taken.tr_mul(&residual)).beta
    };
    Found {
        names: chosen.iter().map(|&f| families[f].id).collect(),
        terms: terms(&families, &chosen, Statistic::Bias, &beta),
        fitted: if chosen.is_empty() { Vec::new() } else { (taken * beta).as_slice().to_vec() },
    }
}

fn variance(tiles: &Tiles, fitted: &[f64], log_n: f64) -> Found {
    let families = of_variance();
    let (count, fill) = columns(&families);
    let design = Design::of_variance(tiles, count, &fill).columns;
    let (gram, ranges, ratios) = (design.tr_mul(&design), ranges(&families), ratios(tiles, fitted));
    let mut chosen: Vec<usize> = Vec::new();
    let mut beta = DVector::zeros(0);
    loop {
        let taken = design.select_columns(&indices(&chosen, &ranges));
        let right = if chosen.is_empty() {
            design.tr_mul(&weighed(tiles, &ratios))
        } else {
            beta = fit_log(tiles, &ratios, &taken).beta;
            design.tr_mul(&working(tiles, &ratios, &taken, &beta))
        };
        // At the fit the chosen columns have nothing left to take: this is the score test.
        let worth = |columns: &[usize]| worth(&gram, &right, columns, log_n);
        match best(&chosen, &ranges, &worth) {
            Some(f) => chosen.push(f),
            None => break,
        }
    }
    Found {
        names: chosen.iter().map(|&f| families[f].id).collect(),
        terms: terms(&families, &chosen, Statistic::Variance, &beta),
        fitted: Vec::new(),
    }
}

/// Ratios beyond one, weighed.
fn weighed(tiles: &Tiles, ratios: &[f64]) -> DVector<f64> {
    DVector::from_fn(ratios.len(), |i, _| (0.5 * tiles.tiles[i].count).sqrt() * (ratios[i] - 1.0))
}

impl Baseline for Sparse {
    fn name(&self) -> &'static str {
        "sparse-regression"
    }

    fn fit(&self, tiles: &Tiles) -> Result<Fitted> {
        let log_n = tiles.tiles.iter().map(|t| t.count).sum::<f64>().ln();
        let bias = bias(tiles, log_n);
        let variance = variance(tiles, &bias.fitted, log_n);
        let names: BTreeSet<&str> = bias.names.iter().chain(&variance.names).copied().collect();
        let numbers = |terms: &[Term]| terms.iter().map(|t| t.coefficients.len()).sum::<usize>();
        let parameters = numbers(&bias.terms) + numbers(&variance.terms);
        let predictor = Learnt {
            scale_px_m: tiles.scale_px_m,
            bias: at_place(bias.terms),
            log_variance: at_place(variance.terms),
            stride: 1,
        };
        Ok(Fitted {
            predictor: Box::new(predictor),
            parameters,
            names: Some(names.into_iter().map(Into::into).collect()),
        })
    }
}

/// A board's shape stays with the board.
fn at_place(mut terms: Vec<Term>) -> Option<AtPlaces> {
    terms.retain(Term::belongs_to_sensor);
    if terms.is_empty() {
        return None;
    }
    Some(each(move |p: &PixelContext| terms.iter().map(|t| t.value(p, &mut Vec::new())).sum()))
}
