//! Converts the coefficients of a fitted shape to the usual parameters of an effect.

use nalgebra::{DMatrix, DVector};

use crate::terms::{Basis, Extent, PixelContext};

/// A parameter with its standard error; NaN where that is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    pub parameter: &'static str,
    pub value: f64,
    pub std_error: f64,
    /// Whether the parameter selects the shape; it is then no coefficient of a formula that may be off.
    pub settles: bool,
}

impl Estimate {
    /// A parameter that selects the shape and was tried in steps.
    pub fn given(parameter: &'static str, value: f64, std_error: f64) -> Self {
        Estimate { parameter, value, std_error, settles: true }
    }

    /// The estimate with its standard error enlarged by the relative error of the formula: no sensor
    /// follows that very one.
    pub fn of_any_formula(self, share: f64) -> Self {
        let off = if self.settles { 0.0 } else { share * self.value };
        Estimate { std_error: self.std_error.hypot(off), ..self }
    }
}

/// A fitted shape with its coefficients.
#[derive(Debug, Clone, Copy)]
pub struct Fitted<'a> {
    pub shape: &'a Basis,
    pub coefficients: &'a [f64],
    pub covariance: &'a DMatrix<f64>,
    /// Extent of the recording.
    pub reach: &'a Extent,
}

impl Fitted<'_> {
    /// A parameter as a function of the coefficients; its error by the delta method.
    pub fn estimate(&self, parameter: &'static str, of: &dyn Fn(&[f64]) -> f64) -> Estimate {
        Estimate {
            parameter,
            value: of(self.coefficients),
            std_error: self.delta(of),
            settles: false,
        }
    }

    /// Coefficients and covariance of the same fit with coefficient `k` held at zero, which is what a shape
    /// without its column would have given: the Gaussian posterior, conditioned. `None` where its variance
    /// is not known.
    pub fn without(&self, k: usize) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let variance = self.covariance.get((k, k)).copied().filter(|v| *v > 0.0)?;
        let column = self.covariance.column(k);
        let moved = column * (self.coefficients[k] / variance);
        let coefficients = self.coefficients.iter().zip(&moved).map(|(b, m)| b - m).collect();
        Some((coefficients, self.covariance - column * column.transpose() / variance))
    }

    /// Value of the shape at a place, with these coefficients.
    pub fn value(&self, coefficients: &[f64], place: PixelContext) -> f64 {
        self.shape.value(coefficients, &place)
    }

    fn delta(&self, of: &dyn Fn(&[f64]) -> f64) -> f64 {
        let (beta, covariance) = (self.coefficients, self.covariance);
        if covariance.nrows() != beta.len() {
            return f64::NAN;
        }
        let gradient: Vec<f64> = (0..beta.len())
            .map(|j| {
                let step = (1e-3 * covariance[(j, j)].max(0.0).sqrt()).max(1e-12);
                let mut moved = beta.to_vec();
                moved[j] += step;
                let up = of(&moved);
                moved[j] -= 2.0 * step;
                (up - of(&moved)) / (2.0 * step)
            })
            .collect();
        let g = DVector::from_vec(gradient);
        g.dot(&(covariance * &g)).max(0.0).sqrt()
    }
}

/// Slope k of the least-squares fit of k r^2 + constant to a curve over 0 to `far`, weighted by area.
pub fn slope_in_square(curve: impl Fn(f64) -> f64, far: f64) -> f64 {
    const NODES: usize = 41;
    let nodes = || (0..NODES).map(|n| far * n as f64 / (NODES - 1) as f64);
    // The area of a ring grows with its radius.
    let weight: f64 = nodes().sum();
    let mean = |of: &dyn Fn(f64) -> f64| nodes().map(|r| r * of(r)).sum::<f64>() / weight;
    let (square, level) = (mean(&|r| r * r), mean(&curve));
    let cross = mean(&|r| (r * r - square) * (curve(r) - level));
    cross / mean(&|r| (r * r - square).powi(2))
}

/// Half the peak-to-peak range of a curve over a period.
pub fn greatest(curve: impl Fn(f64) -> f64) -> f64 {
    let [low, high] = crate::stats::range((0..64).map(|k| curve(f64::from(k) / 64.0)));
    0.5 * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Least squares on three columns, one of them held at zero, is least squares on the other two.
    #[test]
    fn a_fit_without_a_column_is_that_of_the_others() {
        let columns = DMatrix::from_fn(40, 3, |i, j| (0.1 * i as f64 - 1.0).powi(j as i32));
        let y = DVector::from_fn(40, |i, _| (0.7 * i as f64).sin() + 0.02 * i as f64);
        let solved = |of: &DMatrix<f64>| {
            let covariance = (of.transpose() * of).try_inverse().unwrap();
            (&covariance * of.transpose() * &y, covariance)
        };
        let (coefficients, covariance) = solved(&columns);
        let shape = &Basis::Level;
        let reach = &Extent::default();
        let fit =
            Fitted { shape, coefficients: coefficients.as_slice(), covariance: &covariance, reach };
        for gone in 0..3 {
            let others = solved(&columns.clone().remove_column(gone));
            let (held, of_held) = fit.without(gone).unwrap();
            let held = DVector::from_vec(held).remove_row(gone);
            let of_held = of_held.remove_row(gone).remove_column(gone);
            assert!((held - others.0).norm() < 1e-10);
            assert!((of_held - others.1).norm() < 1e-10);
        }
        let unknown = DMatrix::zeros(0, 0);
        assert!(Fitted { covariance: &unknown, ..fit }.without(0).is_none());
    }
}
