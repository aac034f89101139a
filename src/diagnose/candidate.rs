//! Terms that could be missing: named families with a free shape, and nameless curves.

use super::tiles::Place;

/// Fills one row of columns.
pub type Columns = Box<dyn Fn(&Place, &mut [f64]) + Send + Sync>;

/// One term with everything but its linear coefficients settled.
pub struct Candidate {
    /// Id of effects.md; `None` for a curve without a name.
    pub family: Option<&'static str>,
    /// As effects.md names it.
    pub axis: &'static str,
    /// What is settled, by name: a period, an exponent.
    pub settled: Vec<(&'static str, f64)>,
    pub count: usize,
    pub columns: Columns,
}

impl Candidate {
    pub fn named(
        family: &'static str,
        axis: &'static str,
        count: usize,
        columns: impl Fn(&Place, &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        let columns = Box::new(columns);
        Candidate { family: Some(family), axis, settled: Vec::new(), count, columns }
    }

    pub fn with(mut self, name: &'static str, value: f64) -> Self {
        self.settled.push((name, value));
        self
    }

    /// A broken line over `value` of a place, between `knots` evenly spaced nodes.
    pub fn curve(
        axis: &'static str,
        [low, high]: [f64; 2],
        knots: usize,
        value: impl Fn(&Place) -> f64 + Send + Sync + 'static,
        scale: impl Fn(&Place) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let columns = move |p: &Place, out: &mut [f64]| {
            out.fill(0.0);
            hats(value(p), low, high, scale(p), out);
        };
        let columns = Box::new(columns);
        Candidate { family: None, axis, settled: Vec::new(), count: knots, columns }
    }

    /// A broken line on a circle of circumference one.
    pub fn ring(
        axis: &'static str,
        knots: usize,
        value: impl Fn(&Place) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let columns = move |p: &Place, out: &mut [f64]| {
            out.fill(0.0);
            let place = value(p).rem_euclid(1.0) * knots as f64;
            let (k, t) = (place as usize % knots, place.fract());
            out[k] += 1.0 - t;
            out[(k + 1) % knots] += t;
        };
        let columns = Box::new(columns);
        Candidate { family: None, axis, settled: Vec::new(), count: knots, columns }
    }

    /// A bilinear map over the picture.
    pub fn map(width: f64, height: f64, across: usize, down: usize) -> Self {
        let columns = move |p: &Place, out: &mut [f64]| {
            out.fill(0.0);
            let (i, s) = node(p.u, 0.0, width - 1.0, across);
            let (j, t) = node(p.v, 0.0, height - 1.0, down);
            for (dj, wv) in [(0, 1.0 - t), (1, t)] {
                for (di, wu) in [(0, 1.0 - s), (1, s)] {
                    out[(j + dj) * across + i + di] += wu * wv;
                }
            }
        };
        let columns = Box::new(columns);
        Candidate {
            family: None,
            axis: "pixel",
            settled: Vec::new(),
            count: across * down,
            columns,
        }
    }

    /// Value of the term at a place.
    pub fn value(&self, beta: &[f64], p: &Place, row: &mut Vec<f64>) -> f64 {
        row.resize(self.count, 0.0);
        (self.columns)(p, row);
        row.iter().zip(beta).map(|(g, b)| g * b).sum()
    }
}

fn node(value: f64, low: f64, high: f64, knots: usize) -> (usize, f64) {
    let last = (knots - 1) as f64;
    let place = ((value - low) / (high - low).max(1e-12) * last).clamp(0.0, last);
    let k = (place as usize).min(knots - 2);
    (k, place - k as f64)
}

fn hats(value: f64, low: f64, high: f64, scale: f64, out: &mut [f64]) {
    let (k, t) = node(value, low, high, out.len());
    out[k] += scale * (1.0 - t);
    out[k + 1] += scale * t;
}
