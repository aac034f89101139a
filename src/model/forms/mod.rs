//! Forms of sigma(z, theta), one per file. To add one, add its file and a variant of [`Form`].

mod disparity;
mod khoshelham;
mod nguyen;
mod paper;
mod tilt;

use std::fmt;
use std::str::FromStr;

use nalgebra::DMatrix;

use super::rows::Rows;

pub use paper::PAPER_EQ1;

/// The largest number of parameters of a form.
pub const MAX_PARAMETERS: usize = 6;

/// Working coordinate of a parameter in the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Walk {
    Linear,
    /// The logarithm, for a positive parameter.
    Log,
    /// The logarithm of its excess over the steepest theta of the data, for the pole of a form.
    LogAboveTheta,
}

/// Start of a fit, near enough for a local solver and found without a user's guess.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    pub parameters: Vec<f64>,
    /// Whether each parameter is held at its value, because the data do not determine it.
    pub held: Vec<bool>,
    pub remarks: Vec<String>,
}

/// Description of a form.
pub struct Card {
    pub id: &'static str,
    /// As text, with units.
    pub formula: &'static str,
    /// Where it comes from.
    pub reference: &'static str,
    pub parameters: &'static [(&'static str, Walk)],
    /// Fewest different distances that the form needs.
    pub distances_needed: usize,
}

/// A formula for sigma.
pub trait SigmaForm: Sync {
    fn card(&self) -> &'static Card;
    /// sigma in m at depth z (m) and tilt theta (rad).
    fn sigma(&self, p: &[f64], z: f64, theta: f64) -> f64;
    /// Writes the derivatives of sigma by the parameters to the first elements of `out`.
    fn gradient(&self, p: &[f64], z: f64, theta: f64, out: &mut [f64; MAX_PARAMETERS]);
    /// Tilt at which sigma diverges, rad.
    fn pole(&self, _p: &[f64]) -> Option<f64> {
        None
    }
    /// Depth at which sigma is least, m, for a form whose first parameter is a constant offset.
    fn vertex(&self, _p: &[f64]) -> Option<f64> {
        None
    }
    /// Finds a start from the data alone. `None` when the data do not support the form.
    fn start(&self, rows: &Rows) -> Option<Start>;
    /// Plausible range of parameter `i`; beyond, it is held at the edge.
    fn limits(&self, _i: usize, _rows: &Rows) -> Option<[f64; 2]> {
        None
    }
    /// Remark on parameter `i` when its standard error is comparable to its value.
    fn why_weak(&self, _i: usize, _rows: &Rows) -> Option<String> {
        None
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Form {
    Paper,
    Nguyen,
    Khoshelham,
    Disparity,
}

impl Form {
    pub const ALL: [Form; 4] = [Form::Paper, Form::Nguyen, Form::Khoshelham, Form::Disparity];

    pub fn spec(self) -> &'static dyn SigmaForm {
        match self {
            Form::Paper => &paper::Paper,
            Form::Nguyen => &nguyen::Nguyen,
            Form::Khoshelham => &khoshelham::Khoshelham,
            Form::Disparity => &disparity::Disparity,
        }
    }

    pub fn card(self) -> &'static Card {
        self.spec().card()
    }

    pub fn id(self) -> &'static str {
        self.card().id
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id())
    }
}

impl FromStr for Form {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Form::ALL.into_iter().find(|f| f.id() == text).ok_or_else(|| {
            let known: Vec<&str> = Form::ALL.iter().map(|f| f.id()).collect();
            format!("there is no form \"{text}\"; the forms are {}", known.join(", "))
        })
    }
}

/// Whitened derivatives of sigma by the free parameters, one row per measurement.
pub fn natural_jacobian(
    rows: &Rows,
    spec: &dyn SigmaForm,
    p: &[f64],
    free: &[usize],
) -> DMatrix<f64> {
    let n = rows.len();
    let mut j = DMatrix::zeros(n, free.len());
    let mut gradient = [0.0; MAX_PARAMETERS];
    for (i, r) in rows.iter().enumerate() {
        spec.gradient(p, r.z_m, r.theta_rad, &mut gradient);
        for (column, &k) in free.iter().enumerate() {
            j[(i, column)] = gradient[k];
        }
    }
    for column in 0..free.len() {
        rows.whiten(&mut j.as_mut_slice()[column * n..(column + 1) * n]);
    }
    j
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares every form's gradient with central differences.
    #[test]
    fn gradients_match_differences() {
        for form in Form::ALL {
            let spec = form.spec();
            let p: Vec<f64> = match form {
                Form::Paper => PAPER_EQ1.to_vec(),
                Form::Nguyen => vec![0.0012, 0.0019, 0.4, 0.0001],
                Form::Khoshelham => vec![1.425e-3],
                Form::Disparity => vec![1.4e-3, 0.8e-3],
            };
            assert_eq!(p.len(), form.card().parameters.len());
            for (z, theta) in [(0.8, 0.0), (1.0, 0.6), (3.7, 1.25)] {
                let mut gradient = [0.0; MAX_PARAMETERS];
                spec.gradient(&p, z, theta, &mut gradient);
                for i in 0..p.len() {
                    let h = 1e-6 * p[i].abs().max(1e-6);
                    let (mut low, mut high) = (p.clone(), p.clone());
                    low[i] -= h;
                    high[i] += h;
                    let numeric =
                        (spec.sigma(&high, z, theta) - spec.sigma(&low, z, theta)) / (2.0 * h);
                    let scale = gradient[i].abs().max(1e-9);
                    assert!(
                        (gradient[i] - numeric).abs() < 1e-5 * scale,
                        "{form} {i}: {} {numeric}",
                        gradient[i]
                    );
                }
            }
        }
    }

    #[test]
    fn names_read_back() {
        for form in Form::ALL {
            assert_eq!(form.id().parse::<Form>().unwrap(), form);
        }
        assert!("best".parse::<Form>().unwrap_err().contains("paper"));
    }
}
