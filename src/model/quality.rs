//! How well a surface fits, and warnings about a fit that should not be trusted as it stands.

use super::rows::Rows;

/// How a surface fits its rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quality {
    /// Root mean square of s - sigma, m, and as a share of sigma.
    pub rmse_m: f64,
    pub rmse_relative: f64,
    pub r2: f64,
    /// What rmse_relative would be from sampling alone; `None` when no n is known.
    pub sampling_relative: Option<f64>,
    /// Share of sigma's variance over the rows that neither the surface nor sampling explains.
    pub unexplained: f64,
}

/// Above this share the surface misses more of what differs between the views than a coefficient
/// rounded to one digit would.
const MAX_UNEXPLAINED: f64 = 0.2;
/// Scatter this many times that of sampling is no accident, whatever the number of rows: chi^2
/// per degree of freedom is its square.
const FAR_ABOVE_SAMPLING: f64 = 3.0;
/// Fewer views cannot disagree with a surface.
const MIN_VIEWS: usize = 3;

impl Quality {
    /// `sigma` is the surface at every row, m.
    pub fn of(rows: &Rows, sigma: &[f64]) -> Self {
        let n = rows.len() as f64;
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / n;
        let measured = || rows.iter().map(|r| r.sigma_m);
        let middle = mean(&mut measured());
        let scatter = mean(&mut measured().map(|s| (s - middle).powi(2)));
        let left = mean(&mut measured().zip(sigma).map(|(s, m)| (s - m).powi(2)));
        let relative = mean(&mut measured().zip(sigma).map(|(s, m)| (s / m - 1.0).powi(2)));
        let sampled = || rows.iter().zip(sigma).map(|(r, m)| (m, r.n_effective.map(|n| 0.5 / n)));
        let by_sampling = mean(&mut sampled().map(|(m, v)| m * m * v.unwrap_or(0.0)));
        let sampling = mean(&mut sampled().map(|(_, v)| v.unwrap_or(0.0))).sqrt();
        let share = |left: f64| if scatter > 0.0 { left / scatter } else { 0.0 };
        Quality {
            rmse_m: left.sqrt(),
            rmse_relative: relative.sqrt(),
            r2: if scatter > 0.0 { 1.0 - left / scatter } else { 0.0 },
            sampling_relative: rows.counted().then_some(sampling),
            unexplained: share((left - by_sampling).max(0.0)),
        }
    }

    pub fn is_poor(&self) -> bool {
        self.r2 < 0.0 || self.unexplained > MAX_UNEXPLAINED
    }

    /// What to know before the coefficients, if anything.
    pub fn warning(&self) -> Option<String> {
        const REMEDY: &str = "look in measurements.csv for views that measured something else than one flat target, or try --form auto";
        let sampling = self.sampling_relative.map_or(String::new(), |s| {
            format!(", where the number of samples explains {:.1} %", 1e2 * s)
        });
        let scatter =
            format!("sigmas lie {:.0} % off it (rms){sampling}", 1e2 * self.rmse_relative);
        if self.r2 < 0.0 {
            return Some(format!(
                "the fit is useless: one constant sigma would fit better than this surface (r2 {:.2}), {scatter}; {REMEDY}",
                self.r2
            ));
        }
        if self.is_poor() {
            return Some(format!(
                "the fit is poor: the surface and sampling leave {:.0} % of the variance of sigma unexplained (r2 {:.2}), {scatter}; {REMEDY}",
                1e2 * self.unexplained,
                self.r2
            ));
        }
        let far =
            self.sampling_relative.is_some_and(|s| self.rmse_relative > FAR_ABOVE_SAMPLING * s);
        far.then(|| {
            format!(
                "the views differ by more than noise: {scatter}; the intervals allow for it, more frames will not help, other views will"
            )
        })
    }
}

/// Said where the views are too few for the intervals to mean much.
pub(super) fn few_views(views: usize, free: usize) -> Option<String> {
    let seen = if views == 1 { "one view".into() } else { format!("{views} views") };
    if views < MIN_VIEWS {
        return Some(format!(
            "this is no calibration: a surface through {seen} has nothing to check it by; record views at three distances at least, better at five and at several tilts"
        ));
    }
    (views <= free).then(|| {
        format!(
            "{seen} for {free} coefficients: the views cannot contradict the surface, and its intervals are guesses; record more views"
        )
    })
}
