//! Uncertainty of a correction, pixel by pixel.

use std::collections::BTreeMap;

use crate::model;
use crate::terms::{ANYWHERE, Basis, Modulation, Needs, PixelContext, Term};

/// The covariance of the removed bias.
#[derive(Debug, Clone, Default)]
pub(super) struct Uncertainty {
    shapes: Vec<Spread>,
    /// Indices of the correlated factors, by fit and number within the fit.
    parts: BTreeMap<(u32, usize), usize>,
    pub needs: Needs,
}

/// The share of one term in the covariance.
#[derive(Debug, Clone)]
struct Spread {
    term: (Term, [f64; 2]),
    /// Index of a factor and the change of each coefficient per standard deviation of it.
    parts: Vec<(usize, Vec<f64>)>,
    /// Independent variance of each coefficient; empty for none.
    own: Vec<f64>,
}

impl Uncertainty {
    /// Adds the `usable` terms of `entry`, learnt at these disparities.
    pub fn add(
        &mut self,
        entry: &model::Effect,
        learnt: [f64; 2],
        usable: impl Fn(&&Term) -> bool,
    ) {
        let Some(covariance) = &entry.covariance else { return };
        let mut first = 0;
        for term in &entry.shape {
            let span = first..first + term.coefficients.len();
            first = span.end;
            if !usable(&term) {
                continue;
            }
            let mut parts = Vec::new();
            for (k, factor) in covariance.factors.iter().enumerate() {
                let next = self.parts.len();
                let part = *self.parts.entry((covariance.fit, k)).or_insert(next);
                parts.extend(factor.get(span.clone()).map(|f| (part, f.to_vec())));
            }
            let own = covariance.variances.get(span).unwrap_or_default().to_vec();
            self.needs = self.needs.and(term.needs());
            self.shapes.push(Spread { term: (term.clone(), learnt), parts, own });
        }
    }

    /// Adds a distance law that was determined from references, with its standard error.
    pub fn add_law(&mut self, entry: &model::Effect) {
        // A drift has the error of its final value.
        let (name, times) = match entry.id.as_str() {
            "depth-scale" => ("scale", Modulation::Disparity),
            "disparity-offset" => ("offset_px", Modulation::One),
            "thermal-drift" => ("relative", Modulation::Disparity),
            _ => return,
        };
        let parameter = entry.parameters.get(name);
        let error = parameter.and_then(|p| p.get("std_error")).and_then(serde_json::Value::as_f64);
        if let Some(error) = error.filter(|e| e.is_finite()) {
            let coefficients = vec![0.0; 3];
            let term = Term::bias(Basis::Affine { times }, coefficients);
            let own = vec![error * error, 0.0, 0.0];
            self.shapes.push(Spread { term: (term, ANYWHERE), parts: Vec::new(), own });
        }
    }

    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Variance at a place, px^2, of the terms that are `subtracted` there. `parts` is scratch space.
    pub fn variance(
        &self,
        place: &PixelContext,
        subtracted: impl Fn(&Term) -> bool,
        parts: &mut Vec<f64>,
    ) -> f64 {
        parts.clear();
        parts.resize(self.parts.len(), 0.0);
        let mut own = 0.0;
        let shapes = self.shapes.iter().filter(|shape| subtracted(&shape.term.0));
        for Spread { term: (term, learnt), parts: mine, own: variances } in shapes {
            term.basis.visit(&term.basis.held(*learnt, place), |j, g| {
                mine.iter().for_each(|(part, coefficients)| parts[*part] += g * coefficients[j]);
                own += variances.get(j).map_or(0.0, |variance| g * g * variance);
            });
        }
        own + parts.iter().map(|p| p * p).sum::<f64>()
    }
}
