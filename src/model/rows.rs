//! Measured sigmas with their weights, for least squares.

use nalgebra::{DMatrix, DVector};

use crate::measure::{SigmaRow, SigmaTable};
use crate::stats::{between, paule_mandel};

/// Rows grouped by view. The relative error of a row is the sum of three independent ones: its sampling
/// error (variance 1/(2 n_effective)), an error of its own (tau_cell) and one shared by the rows of its
/// view (tau_view). Residuals are relative to the *model's* sigma, not the measured one: weights from the
/// measurement would favour values that came out too small.
#[derive(Debug, Clone)]
pub struct Rows {
    rows: Vec<SigmaRow>,
    /// Range of rows of each view.
    blocks: Vec<std::ops::Range<usize>>,
    /// Sampling variance of the relative error. When any n is unknown, it is the same for all rows: one, or next to
    /// nothing where views have several rows, whose scatter tells the rest.
    sampling: Vec<f64>,
    /// Whether every n is known, and whether the variances are known in size and not only in proportion.
    counted: bool,
    sized: bool,
    /// Sigma that residuals are relative to, m.
    reference: Vec<f64>,
    steepest: f64,
    /// Relative variance of each row's own error beyond sampling, and of the error shared by a view.
    tau_cell2: f64,
    tau_view2: f64,
    whitener: Whitener,
}

/// Precomputed factors of [`Rows::whiten`].
#[derive(Debug, Clone, Default)]
struct Whitener {
    /// One over the standard deviation of a row's own relative error.
    root: Vec<f64>,
    /// Factor of each value: `root` over the reference sigma, and for a view of a single row also the
    /// shrinkage by the view's common error.
    scale: Vec<f64>,
    /// Views of several rows, with the shrinkage of their common error.
    shared: Vec<(std::ops::Range<usize>, f64)>,
}

/// Sampling variance of a row whose n is unknown beside others of its view: a ten-thousandth of sigma.
const UNSEEN: f64 = 1e-8;

impl Rows {
    pub fn new(table: &SigmaTable) -> Self {
        let mut rows = table.rows.clone();
        rows.sort_by_key(|r| r.view);
        let mut blocks: Vec<std::ops::Range<usize>> = Vec::new();
        for (i, row) in rows.iter().enumerate() {
            match blocks.last_mut() {
                Some(block) if rows[block.start].view == row.view => block.end = i + 1,
                _ => blocks.push(i..i + 1),
            }
        }
        let counted = rows.iter().all(|r| r.n_effective.is_some());
        let sized = counted || blocks.len() < rows.len();
        let unknown = if sized { UNSEEN } else { 1.0 };
        let sampling = rows
            .iter()
            .map(|r| r.n_effective.filter(|_| counted).map_or(unknown, |n| 0.5 / n))
            .collect();
        let reference = rows.iter().map(|r| r.sigma_m).collect();
        let steepest = rows.iter().map(|r| r.theta_rad).fold(f64::NEG_INFINITY, f64::max);
        let mut rows = Rows {
            rows,
            blocks,
            sampling,
            counted,
            sized,
            reference,
            steepest,
            tau_cell2: 0.0,
            tau_view2: 0.0,
            whitener: Whitener::default(),
        };
        rows.weigh();
        rows
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn views(&self) -> usize {
        self.blocks.len()
    }

    pub fn iter(&self) -> impl Iterator<Item = &SigmaRow> {
        self.rows.iter()
    }

    pub fn steepest(&self) -> f64 {
        self.steepest
    }

    pub fn range(&self, column: impl Fn(&SigmaRow) -> f64) -> [f64; 2] {
        crate::stats::range(self.rows.iter().map(column))
    }

    /// Whether the sampling error is known (a table with n).
    pub fn counted(&self) -> bool {
        self.counted
    }

    /// Whether the rows' variances are known in size.
    pub fn sized(&self) -> bool {
        self.sized
    }

    /// Number of distances that differ by more than `ratio`.
    pub fn distances(&self, ratio: f64) -> usize {
        let mut z: Vec<f64> = self.rows.iter().map(|r| r.z_m).collect();
        z.sort_by(f64::total_cmp);
        z.dedup_by(|next, last| *next <= *last * ratio);
        z.len()
    }

    /// Makes residuals relative to these sigmas, m.
    pub fn refer_to(&mut self, sigma: impl Fn(&SigmaRow) -> f64) {
        self.reference = self.rows.iter().map(sigma).collect();
        self.weigh();
    }

    pub fn reference(&self) -> &[f64] {
        &self.reference
    }

    /// Weighted chi-square per degree of freedom, for six parameters; at least 1 where the variances are known
    /// in size.
    pub fn noise_scale(&self, chi2: f64) -> f64 {
        let found = chi2 / (self.len() as f64 - 6.0).max(1.0);
        found.max(if self.sized { 1.0 } else { f64::MIN_POSITIVE })
    }

    /// Divides by the reference sigma and transforms so that errors are independent and of unit variance: for
    /// a view with variances D and shared tau^2, by a root of (D + tau^2 11')^-1 in closed form.
    pub fn whiten(&self, column: &mut [f64]) {
        for (value, scale) in column.iter_mut().zip(&self.whitener.scale) {
            *value *= scale;
        }
        for (block, shrink) in &self.whitener.shared {
            let root = &self.whitener.root[block.clone()];
            let column = &mut column[block.clone()];
            let dot: f64 = column.iter().zip(root).map(|(v, r)| v * r).sum();
            for (v, r) in column.iter_mut().zip(root) {
                *v -= shrink * dot * r;
            }
        }
    }

    /// Prepares the whitening; called whenever weights or reference change.
    fn weigh(&mut self) {
        let w = &mut self.whitener;
        w.root = self.sampling.iter().map(|s| 1.0 / (s + self.tau_cell2).sqrt()).collect();
        w.scale = w.root.iter().zip(&self.reference).map(|(r, s)| r / s).collect();
        w.shared.clear();
        if self.tau_view2 == 0.0 {
            return;
        }
        for block in &self.blocks {
            let s: f64 = w.root[block.clone()].iter().map(|r| r * r).sum();
            let kept = 1.0 / (1.0 + self.tau_view2 * s).sqrt();
            if block.len() == 1 {
                w.scale[block.start] *= kept;
            } else {
                w.shared.push((block.clone(), (1.0 - kept) / s));
            }
        }
    }

    pub fn whitened_sigmas(&self) -> DVector<f64> {
        let mut y: Vec<f64> = self.rows.iter().map(|r| r.sigma_m).collect();
        self.whiten(&mut y);
        DVector::from_vec(y)
    }

    /// Weighted least squares of sigma on `k` columns; `None` when they are linearly dependent.
    pub fn solve_linear(&self, k: usize, fill: impl Fn(&SigmaRow, &mut [f64])) -> Option<Vec<f64>> {
        let n = self.len();
        if n < k {
            return None;
        }
        let mut a = DMatrix::zeros(n, k);
        let mut values = vec![0.0; k];
        for (i, row) in self.rows.iter().enumerate() {
            fill(row, &mut values);
            for (j, &v) in values.iter().enumerate() {
                a[(i, j)] = v;
            }
        }
        let mut scales = Vec::with_capacity(k);
        for j in 0..k {
            let column = &mut a.as_mut_slice()[j * n..(j + 1) * n];
            self.whiten(column);
            let norm = column.iter().map(|v| v * v).sum::<f64>().sqrt();
            if !(norm > 0.0 && norm.is_finite()) {
                return None;
            }
            column.iter_mut().for_each(|v| *v /= norm);
            scales.push(norm);
        }
        let qr = a.qr();
        let r = qr.r();
        if (0..k).any(|j| r[(j, j)].abs() < DEPENDENT) {
            return None;
        }
        let right = qr.q().tr_mul(&self.whitened_sigmas());
        let x = r.solve_upper_triangular(&right)?;
        Some(x.iter().zip(&scales).map(|(x, s)| x / s).collect())
    }

    /// Estimates the two extra variances from the relative residuals (Paule and Mandel 1982, within views
    /// and between them); zero where sampling explains all.
    pub fn estimate_extra(&mut self, parameters: usize) {
        if !self.sized {
            return;
        }
        let residual: Vec<f64> =
            self.rows.iter().zip(&self.reference).map(|(r, s)| r.sigma_m / s - 1.0).collect();
        let within_dof = self.len() as f64 - self.views() as f64;
        // With one row per view there is nothing but rounding within views.
        self.tau_cell2 = if within_dof < 1.0 {
            0.0
        } else {
            paule_mandel(within_dof, |tau| self.within(&residual, tau))
        };
        let between_dof = (self.views() as f64 - parameters as f64).max(1.0);
        let means: Vec<(f64, f64)> = self
            .blocks
            .iter()
            .map(|b| {
                let (mean, variance, ..) = self.block(b, &residual, self.tau_cell2);
                (mean * mean, variance)
            })
            .collect();
        self.tau_view2 = paule_mandel(between_dof, |tau| between(&means, tau));
        self.weigh();
    }

    /// Chi-square of the rows about their view's mean, and its derivative by tau_cell^2.
    fn within(&self, residual: &[f64], tau_cell2: f64) -> (f64, f64) {
        self.blocks.iter().fold((0.0, 0.0), |(chi2, slope), b| {
            let (_, _, c, s) = self.block(b, residual, tau_cell2);
            (chi2 + c, slope + s)
        })
    }

    /// Weighted mean of a view's residuals, its variance, the chi-square about it, and the derivative of the
    /// latter by tau_cell^2 (chi-square is least at the mean, so the mean's own change adds nothing).
    fn block(
        &self,
        block: &std::ops::Range<usize>,
        residual: &[f64],
        tau_cell2: f64,
    ) -> (f64, f64, f64, f64) {
        let weight = |i: usize| 1.0 / (self.sampling[i] + tau_cell2);
        let total: f64 = block.clone().map(weight).sum();
        let mean = block.clone().map(|i| weight(i) * residual[i]).sum::<f64>() / total;
        let (chi2, slope) = block.clone().fold((0.0, 0.0), |(chi2, slope), i| {
            let part = weight(i) * (residual[i] - mean).powi(2);
            (chi2 + part, slope - part * weight(i))
        });
        (mean, 1.0 / total, chi2, slope)
    }

    /// Relative scatter beyond sampling, as standard deviations: within views and between them.
    pub fn extra(&self) -> [f64; 2] {
        [self.tau_cell2.sqrt(), self.tau_view2.sqrt()]
    }

    /// Total relative variance of row `i`.
    pub fn relative_variance(&self, i: usize) -> f64 {
        self.sampling[i] + self.tau_cell2 + self.tau_view2
    }
}

/// Diagonal of R, for columns of unit length, below which a column is linearly dependent.
const DEPENDENT: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Rows {
        let table = SigmaTable {
            rows: (0..12)
                .map(|i| SigmaRow {
                    z_m: 1.0 + 0.2 * f64::from(i),
                    theta_rad: 0.1,
                    sigma_m: 0.002 + 0.001 * f64::from(i),
                    n_effective: Some(50.0 + 10.0 * f64::from(i)),
                    // Three views of three rows, and three of one.
                    view: (i / 3).max(i - 6) as usize,
                })
                .collect(),
        };
        let mut rows = Rows::new(&table);
        rows.tau_cell2 = 0.003;
        rows.tau_view2 = 0.02;
        rows.weigh();
        rows
    }

    /// Compares whitened products with the explicit inverse of the covariance.
    #[test]
    fn whitening_is_the_inverse_covariance() {
        let rows = rows();
        let n = rows.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let same_view = rows.rows[i].view == rows.rows[j].view;
            let mut c = if same_view { rows.tau_view2 } else { 0.0 };
            if i == j {
                c += rows.sampling[i] + rows.tau_cell2;
            }
            c * rows.reference[i] * rows.reference[j]
        });
        let x = DVector::from_fn(n, |i, _| (i as f64).sin());
        let y = DVector::from_fn(n, |i, _| (i as f64 * 0.7).cos());
        let explicit = x.dot(&(covariance.try_inverse().unwrap() * &y));
        let (mut xw, mut yw) = (x.as_slice().to_vec(), y.as_slice().to_vec());
        rows.whiten(&mut xw);
        rows.whiten(&mut yw);
        let whitened: f64 = xw.iter().zip(&yw).map(|(a, b)| a * b).sum();
        assert!((whitened / explicit - 1.0).abs() < 1e-9, "{whitened} {explicit}");
    }
}
