//! Candidates beside the chosen terms, which are fitted jointly to all views.

use nalgebra::{Cholesky, DMatrix, Dyn};

use super::evidence::Evidence;

/// The chosen terms' fit: the first columns of the views' evidence.
pub struct Beside {
    chosen: usize,
    /// `None` without chosen terms.
    fit: Option<(Cholesky<f64, Dyn>, DMatrix<f64>)>,
}

impl Beside {
    /// `prior` is the precision of a coefficient. `None` if the chosen terms are collinear.
    pub fn of(views: &[Evidence], chosen: usize, prior: f64) -> Option<Self> {
        let k = views.first()?.b.len() - chosen;
        if chosen == 0 {
            return Some(Beside { chosen, fit: None });
        }
        let all = Evidence::sum(chosen + k, prior, views).a;
        let factor = all.view((0, 0), (chosen, chosen)).into_owned().cholesky()?;
        let explained = factor.solve(&all.view((0, chosen), (chosen, k)));
        Some(Beside { chosen, fit: Some((factor, explained)) })
    }

    /// Evidence of each view on the candidate alone.
    pub fn alone(&self, views: &[Evidence]) -> Vec<Evidence> {
        let Some((_, t)) = &self.fit else { return views.to_vec() };
        let (m, k) = (self.chosen, t.ncols());
        let b: Vec<DMatrix<f64>> =
            views.iter().map(|v| DMatrix::from_column_slice(m + k, 1, v.b.as_slice())).collect();
        let alone = views.iter().zip(self.scores(views, b)).map(|(v, b)| {
            let own = v.a.view((0, 0), (m, m));
            let tm = t.tr_mul(&v.a.view((0, m), (m, k)));
            let a = v.a.view((m, m), (k, k)) - &tm - tm.transpose() + t.tr_mul(&(own * t));
            Evidence { a, b: b.column(0).into_owned() }
        });
        alone.collect()
    }

    /// Each view's scores on the candidate alone, of scores on all columns: one column a recording.
    pub fn scores(&self, views: &[Evidence], all: Vec<DMatrix<f64>>) -> Vec<DMatrix<f64>> {
        let Some((factor, t)) = &self.fit else { return all };
        let (m, k) = (self.chosen, t.ncols());
        let mut sum = DMatrix::zeros(m, all.first().map_or(0, DMatrix::ncols));
        all.iter().for_each(|b| sum += b.rows(0, m));
        let beta = factor.solve(&sum);
        let alone = views.iter().zip(&all).map(|(v, b)| {
            let left = b.rows(0, m) - v.a.view((0, 0), (m, m)) * &beta;
            b.rows(m, k) - v.a.view((0, m), (m, k)).tr_mul(&beta) - t.tr_mul(&left)
        });
        alone.collect()
    }
}
