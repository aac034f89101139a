//! Covariance of a fitted shape, also with the other shapes of the same fit.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Covariance of the coefficients of an effect's shape, all its terms' one after the other: the sum
/// of the factors' outer products, and of variances of each coefficient's own.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Covariance {
    /// Shapes of the same fit err together: a factor of one goes with the factor of the same place
    /// of the others.
    #[serde(default)]
    pub fit: u32,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub factors: Vec<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variances: Vec<f64>,
}

impl Covariance {
    pub fn is_empty(&self) -> bool {
        self.factors.is_empty() && self.variances.is_empty()
    }

    /// Rounds to four digits, more than are significant.
    pub fn rounded(mut self) -> Self {
        let all = self.factors.iter_mut().flatten().chain(&mut self.variances);
        all.for_each(|x| *x = four_digits(*x));
        self
    }

    /// Appends the covariance of another shape of the same fit.
    pub fn extend(&mut self, other: Covariance) {
        for (mine, theirs) in self.factors.iter_mut().zip(other.factors) {
            mine.extend(theirs);
        }
        self.variances.extend(other.variances);
    }

    /// What is wrong with it, if anything, for a shape of this many coefficients.
    pub fn fault(&self, coefficients: usize) -> Option<&'static str> {
        let whole = |v: &Vec<f64>| v.len() == coefficients && v.iter().all(|x| x.is_finite());
        if !self.factors.iter().all(whole) {
            return Some("a factor of its covariance has not a number for every coefficient");
        }
        let own = &self.variances;
        let fits = own.is_empty() || whole(own) && own.iter().all(|v| *v >= 0.0);
        if !fits {
            return Some("its variances are not one for every coefficient");
        }
        None
    }
}

fn four_digits(x: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    let unit = 10f64.powi(3 - x.abs().log10().floor() as i32);
    let rounded = (x * unit).round() / unit;
    if rounded.is_finite() { rounded } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_digits_are_kept() {
        for (x, told) in [(1234.56, 1235.0), (-0.000_123_456, -0.000_123_5), (0.0, 0.0)] {
            assert!((four_digits(x) - told).abs() <= 1e-12 * told.abs(), "{x} {}", four_digits(x));
        }
        assert_eq!(four_digits(5e-324), 5e-324);
    }

    #[test]
    fn a_covariance_of_another_shape_is_refused() {
        let of = |factors, variances| Covariance { fit: 1, factors, variances };
        let good = of(vec![vec![1.0, 2.0], vec![0.0, 1.0]], vec![0.1, 0.2]);
        assert_eq!(good.fault(2), None);
        assert!(good.fault(3).is_some());
        assert!(of(vec![vec![f64::NAN]], vec![]).fault(1).is_some());
        assert!(of(vec![], vec![-1.0]).fault(1).is_some());
    }
}
