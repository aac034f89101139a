//! Uncertainty budgets after the GUM (JCGM 100:2008): components, their combination by the law of
//! propagation (5.1.2), degrees of freedom by Welch and Satterthwaite (G.4.1), and expansion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::student_coverage;

/// Coverage factor of all expanded uncertainties.
pub const COVERAGE_FACTOR: f64 = 2.0;

/// How a standard uncertainty was evaluated (GUM 4.2 and 4.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Evaluation {
    /// By statistics of repeated observations.
    A,
    /// By other means.
    B,
}

/// What an input is taken to be drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Distribution {
    Normal,
    Rectangular,
    /// A rounding that the noise of the readings spreads: see [`rounding_uncertainty`].
    DitheredRectangular,
}

impl Distribution {
    /// Human-readable name.
    pub fn description(self) -> &'static str {
        match self {
            Distribution::Normal => "normal",
            Distribution::Rectangular => "rectangular",
            Distribution::DitheredRectangular => "rectangular, dithered",
        }
    }
}

/// A row of a budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Component {
    /// The source of the uncertainty.
    pub quantity: String,
    #[serde(rename = "type")]
    pub evaluation: Evaluation,
    pub distribution: Distribution,
    /// u(x), in `unit`.
    pub standard_uncertainty: f64,
    pub unit: String,
    /// What the measurand changes by with the input, m per `unit`.
    pub sensitivity: f64,
    /// |sensitivity| u(x), m.
    pub contribution_m: f64,
    /// Null where it is infinite: the uncertainty is taken as stated (GUM G.4.3).
    pub degrees_of_freedom: Option<f64>,
}

impl Component {
    /// Type A component in m, from statistics of the readings.
    pub fn type_a(quantity: &str, standard_uncertainty_m: f64, degrees_of_freedom: f64) -> Self {
        let degrees_of_freedom = Some(degrees_of_freedom);
        let normal = Self::type_b(quantity, Distribution::Normal, standard_uncertainty_m);
        Component { evaluation: Evaluation::A, degrees_of_freedom, ..normal }
    }

    /// Type B component in m, stated or known from construction.
    pub fn type_b(quantity: &str, distribution: Distribution, standard_uncertainty_m: f64) -> Self {
        Component {
            quantity: quantity.into(),
            evaluation: Evaluation::B,
            distribution,
            standard_uncertainty: standard_uncertainty_m,
            unit: "m".into(),
            sensitivity: 1.0,
            contribution_m: standard_uncertainty_m,
            degrees_of_freedom: None,
        }
    }

    /// Converts to an input in another unit, with its sensitivity in m per unit.
    pub fn times(self, unit: &str, sensitivity: f64) -> Self {
        let contribution_m = (sensitivity * self.standard_uncertainty).abs();
        Component { unit: unit.into(), sensitivity, contribution_m, ..self }
    }
}

/// The uncertainty of one result, with all that it is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Budget {
    /// The result, m.
    pub value_m: f64,
    pub components: Vec<Component>,
    /// Combined standard uncertainty, m.
    pub combined_m: f64,
    /// Effective degrees of freedom; null where they are infinite.
    pub degrees_of_freedom: Option<f64>,
    /// U = k u with k = 2, m.
    pub expanded_m: f64,
    /// Probability of the interval +-U, by Student's t.
    pub coverage: f64,
}

impl Budget {
    /// Combines independent inputs.
    pub fn of(value_m: f64, components: Vec<Component>) -> Self {
        let combined_m = components.iter().map(|c| c.contribution_m).fold(0.0, f64::hypot);
        let degrees_of_freedom = welch_satterthwaite(combined_m, &components);
        let coverage = student_coverage(COVERAGE_FACTOR, degrees_of_freedom);
        let expanded_m = COVERAGE_FACTOR * combined_m;
        Budget { value_m, components, combined_m, degrees_of_freedom, expanded_m, coverage }
    }
}

/// u^4 over the sum of u_i^4/nu_i (GUM G.2b); `None` where no component has finite degrees of freedom.
/// Computed from shares of u, so that no power underflows.
fn welch_satterthwaite(combined_m: f64, components: &[Component]) -> Option<f64> {
    let share =
        |c: &Component| Some((c.contribution_m / combined_m).powi(4) / c.degrees_of_freedom?);
    let sum: f64 = components.iter().filter_map(share).sum();
    let freedom = sum.recip();
    freedom.is_finite().then_some(freedom)
}

/// Standard uncertainty that rounding to `step` leaves in the mean of many readings whose noise before
/// rounding has standard deviation `sigma`; in the unit of both.
///
/// The error of the mean of rounded Gaussians is the sum over m of
/// step/(pi m) exp(-2 (pi m sigma/step)^2) sin(2 pi m x/step), up to signs (Widrow and Kollar 2008,
/// section 4). With x uniform in the step, the variance is half the sum of the squared amplitudes:
/// step^2/12 without noise (GUM F.2.2.1).
pub fn rounding_uncertainty(step: f64, sigma: f64) -> f64 {
    const NEGLIGIBLE: f64 = 40.0;
    const MANY: usize = 2000;
    let spread = 2.0 * std::f64::consts::PI * sigma / step;
    if step.is_nan() || step <= 0.0 {
        return 0.0;
    }
    if spread * spread * (MANY * MANY) as f64 <= NEGLIGIBLE {
        return step / 12f64.sqrt();
    }
    let harmonics = (1..=MANY).map(|m| m as f64);
    let squares = harmonics.map_while(|m| {
        let exponent = (spread * m).powi(2);
        let height = (m * std::f64::consts::PI).recip();
        (exponent < NEGLIGIBLE).then(|| 0.5 * height * height * (-exponent).exp())
    });
    // An empty `sum()` is minus zero.
    let square = squares.fold(0.0, |sum, s| sum + s);
    step * square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand_distr::{Distribution as _, StandardNormal};

    fn of(parts: &[(f64, Option<f64>)]) -> Budget {
        let component = |&(u, freedom): &(f64, Option<f64>)| match freedom {
            Some(freedom) => Component::type_a("", u, freedom),
            None => Component::type_b("", Distribution::Normal, u),
        };
        Budget::of(0.0, parts.iter().map(component).collect())
    }

    /// GUM H.1, the end gauge, Table H.1 and H.1.6: 25, 9.7, 2.9 and 16.6 nm with 18, 25.6, 50 and 2
    /// degrees of freedom give u^2 = 1002 nm^2 (31.7 nm) with 16.7 degrees of freedom.
    #[test]
    fn the_end_gauge_of_the_gum() {
        const NM: f64 = 1e-9;
        let gauge = of(&[
            (25.0 * NM, Some(18.0)),
            (9.7 * NM, Some(25.6)),
            (2.9 * NM, Some(50.0)),
            (16.6 * NM, Some(2.0)),
        ]);
        assert!((gauge.combined_m / NM - 31.7).abs() < 0.05, "{gauge:?}");
        let freedom = gauge.degrees_of_freedom.unwrap();
        assert!((freedom - 16.7).abs() < 0.1, "{freedom}");
        assert!((gauge.expanded_m / NM - 63.4).abs() < 0.1);
    }

    /// GUM G.4.2: 0.25 %, 0.57 % and 0.82 % with 9, 4 and 14 give 1.03 % with 19.0.
    #[test]
    fn the_product_of_three_of_the_gum() {
        let product = of(&[(0.25, Some(9.0)), (0.57, Some(4.0)), (0.82, Some(14.0))]);
        assert!((product.combined_m - 1.03).abs() < 0.005, "{product:?}");
        assert!((product.degrees_of_freedom.unwrap() - 19.0).abs() < 0.1, "{product:?}");
    }

    /// GUM Table G.2: 95.45 % are covered by k = 2 with infinite degrees of freedom, 2.28 with ten, and
    /// 13.97 with one.
    #[test]
    fn coverage_is_students() {
        for (k, freedom) in [(2.0, None), (2.28, Some(10.0)), (13.97, Some(1.0)), (2.87, Some(4.0))]
        {
            let p = student_coverage(k, freedom);
            assert!((p - 0.9545).abs() < 4e-4, "{k} {freedom:?}: {p}");
        }
    }

    #[test]
    fn stated_components_alone_have_infinite_degrees_of_freedom() {
        let stated = of(&[(3.0, None), (4.0, None)]);
        assert_eq!((stated.combined_m, stated.degrees_of_freedom), (5.0, None));
        let nothing = of(&[]);
        assert_eq!((nothing.combined_m, nothing.degrees_of_freedom), (0.0, None));
        let tilt = Component::type_b("", Distribution::Normal, 0.5).times("px", -2e-3);
        assert_eq!(tilt.contribution_m, 1e-3);
    }

    #[test]
    fn rounding_without_noise_is_rectangular_and_noise_takes_it_away() {
        assert!((rounding_uncertainty(0.012, 0.0) - 0.012 / 12f64.sqrt()).abs() < 1e-12);
        // Noise of a hundredth of a step damps only the highest harmonics.
        assert!((rounding_uncertainty(1.0, 0.01) - 1.0 / 12f64.sqrt()).abs() < 0.02);
        assert!(rounding_uncertainty(1.0, 1.0) < 1e-8);
        assert!(rounding_uncertainty(1.0, 3.0).is_sign_positive(), "no minus zero on a page");
        assert_eq!(rounding_uncertainty(0.0, 0.001), 0.0);
    }

    /// Compares with the mean error of rounded draws at positions spread over the step.
    #[test]
    fn rounding_is_what_rounded_draws_show() {
        let mut rng = Seed(5).stream("rounding");
        let normal: Vec<f64> = (0..40_000).map(|_| StandardNormal.sample(&mut rng)).collect();
        for sigma in [0.1, 0.2, 0.3] {
            let error = |place: f64| {
                let mean = |f: &dyn Fn(f64) -> f64| {
                    normal.iter().map(|g| f(place + sigma * g)).sum::<f64>() / normal.len() as f64
                };
                mean(&|x| x.round()) - mean(&|x| x)
            };
            let square: f64 =
                (0..50).map(|k| error(f64::from(k) / 50.0).powi(2)).sum::<f64>() / 50.0;
            let expected = rounding_uncertainty(1.0, sigma);
            assert!(
                (square.sqrt() / expected - 1.0).abs() < 0.03,
                "{sigma}: {} {expected}",
                square.sqrt()
            );
        }
    }
}
