//! Normal equations of terms and smooth maps together, by folds of the views, and their penalised
//! solution.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::columns::Columns;
use crate::diagnose::search::evidence::{Evidence, score};
use crate::diagnose::views::samples::ViewData;
use crate::solve::Cholesky;

/// Number of cross-validation folds of the views.
const FOLDS: usize = 6;
/// Precision of second differences of a map's nodes, over the mean information on a node.
pub const SMOOTHNESS: [f64; 5] = [1.0, 0.2, 0.04, 0.008, 0.0016];

/// Some views' equations of a subset of the terms, with the maps' nodes (if any) eliminated.
pub struct Reduced {
    pub a: DMatrix<f64>,
    b: DVector<f64>,
    /// Nodes where all terms are zero, and what each unit of a term's coefficient subtracts from them.
    alone: DVector<f64>,
    pub with: DMatrix<f64>,
}

impl Reduced {
    /// Reduces to the terms' columns in `kept`, out of `terms` in all.
    pub fn of(
        all: &Evidence,
        terms: usize,
        kept: &[usize],
        penalty: Option<&DMatrix<f64>>,
    ) -> Option<Self> {
        let mut a = all.a.view((0, 0), (terms, terms)).into_owned();
        let mut b = all.b.rows(0, terms).into_owned();
        let nodes = all.b.len() - terms;
        let (mut alone, mut with) = (DVector::zeros(nodes), DMatrix::zeros(nodes, terms));
        if let Some(penalty) = penalty {
            let factor = Cholesky::of(all.a.view((terms, terms), (nodes, nodes)) + penalty)?;
            let cross = all.a.view((terms, 0), (nodes, terms)).select_columns(kept);
            alone = factor.solve(&all.b.rows(terms, nodes).into_owned());
            let solved = factor.solve_all(cross.clone());
            let (less, less_seen) = (cross.tr_mul(&solved), cross.tr_mul(&alone));
            for (j, &column) in kept.iter().enumerate() {
                with.set_column(column, &solved.column(j));
                b[column] -= less_seen[j];
                kept.iter().enumerate().for_each(|(i, &row)| a[(row, column)] -= less[(i, j)]);
            }
        }
        Some(Reduced { a, b, alone, with })
    }

    /// Coefficients of the terms' columns in `kept`, and of the nodes.
    pub fn fit(&self, kept: &[usize], precision: &DVector<f64>) -> Option<DVector<f64>> {
        let n = kept.len();
        let a = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { precision[kept[i]] } else { 0.0 };
            self.a[(kept[i], kept[j])] + own
        });
        let mine = a.cholesky()?.solve(&DVector::from_fn(n, |i, _| self.b[kept[i]]));
        let terms = self.b.len();
        let mut all = DVector::zeros(terms + self.alone.len());
        kept.iter().zip(mine.iter()).for_each(|(&k, m)| all[k] = *m);
        let nodes = &self.alone - &self.with * all.rows(0, terms);
        all.rows_mut(terms, self.alone.len()).copy_from(&nodes);
        Some(all)
    }
}

/// The equations by folds of the views.
pub struct Joint<'a> {
    pub columns: &'a Columns,
    pub data: &'a [ViewData],
    parts: Vec<Evidence>,
    pub all: Evidence,
    /// Equations of each half of the views.
    pub halves: [Evidence; 2],
}

impl<'a> Joint<'a> {
    pub fn of(columns: &'a Columns, data: &'a [ViewData], second: &[bool]) -> Self {
        // Near and far views in every fold.
        let z = |v: &usize| data[*v].places.first().map_or(0.0, |p| p.rho);
        let mut order: Vec<usize> = (0..data.len()).collect();
        order.sort_by(|a, b| z(a).total_cmp(&z(b)));
        let folds = FOLDS.min(data.len());
        let views: Vec<Vec<usize>> =
            (0..folds).map(|f| order.iter().skip(f).step_by(folds).copied().collect()).collect();
        // Equations of each fold and half. A view's are a matrix of megabytes: they are summed as they
        // come, the nearest first.
        let of_half = |(part, half): (usize, bool)| {
            let mine = views[part].iter().filter(|v| second[**v] == half);
            columns.evidence(mine.map(|&v| &data[v]))
        };
        let each: Vec<(usize, bool)> =
            (0..folds).flat_map(|part| [(part, false), (part, true)]).collect();
        let each: Vec<Evidence> = each.into_par_iter().map(of_half).collect();
        let n = columns.terms + columns.nodes;
        let halves = [0, 1].map(|half| Evidence::sum(n, 0.0, each.iter().skip(half).step_by(2)));
        let parts: Vec<Evidence> = each.chunks(2).map(|both| Evidence::sum(n, 0.0, both)).collect();
        let all = Evidence::sum(n, 0.0, &halves);
        Joint { columns, data, parts, all, halves }
    }

    /// Scores that a fit leaves in these views, their planes profiled out.
    pub fn left(&self, views: &[usize], beta: &DVector<f64>) -> Vec<DVector<f64>> {
        views.par_iter().filter_map(|&v| self.columns.left(&self.data[v], beta)).collect()
    }

    /// Reduced equations of these terms without each fold in turn.
    pub fn without(&self, terms: &[usize], penalty: Option<&DMatrix<f64>>) -> Option<Vec<Reduced>> {
        let kept = self.kept(terms);
        let of = |part: &Evidence| {
            let others = Evidence { a: &self.all.a - &part.a, b: &self.all.b - &part.b };
            Reduced::of(&others, self.columns.terms, &kept, penalty)
        };
        self.parts.par_iter().map(of).collect()
    }

    pub fn kept(&self, terms: &[usize]) -> Vec<usize> {
        terms.iter().flat_map(|&t| self.columns.span(t)).collect()
    }

    /// Gain over no term at all on each left-out fold, nats, counting only the terms that `applied`
    /// selects.
    pub fn scores(
        &self,
        without: &[Reduced],
        terms: &[usize],
        applied: impl Fn(usize) -> bool + Sync,
    ) -> Vec<f64> {
        let kept = self.kept(terms);
        let of = |(reduced, part): (&Reduced, &Evidence)| {
            let mut beta = reduced.fit(&kept, &self.columns.precision)?;
            for &t in terms.iter().filter(|t| !applied(**t)) {
                self.columns.span(t).for_each(|k| beta[k] = 0.0);
            }
            Some(score(part, &beta))
        };
        let pairs: Vec<_> = without.iter().zip(&self.parts).collect();
        pairs.into_par_iter().map(|pair| of(pair).unwrap_or(f64::NEG_INFINITY)).collect()
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;

    /// Two of four terms beside five nodes, against all seven solved at once.
    #[test]
    fn terms_beside_the_maps_are_those_of_the_whole_system() {
        let (terms, nodes, kept) = (4, 5, [0, 2]);
        let n = terms + nodes;
        let mut rng = Seed(8).stream("joint/reduced");
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let x = DMatrix::from_fn(3 * n, n, |_, _| draw());
        let all = Evidence { a: x.transpose() * &x, b: DVector::from_fn(n, |_, _| draw()) };
        let penalty = DMatrix::identity(nodes, nodes) * 0.7;
        let precision = DVector::from_vec(vec![0.3, 0.5, 0.2, 0.9]);
        let reduced = Reduced::of(&all, terms, &kept, Some(&penalty)).expect("positive definite");
        let beta = reduced.fit(&kept, &precision).expect("positive definite");
        let columns: Vec<usize> = kept.into_iter().chain(terms..n).collect();
        let held = |k: usize| if k < terms { precision[k] } else { 0.7 };
        let a = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            all.a[(columns[i], columns[j])] + if i == j { held(columns[i]) } else { 0.0 }
        });
        let b = DVector::from_fn(columns.len(), |i, _| all.b[columns[i]]);
        let truth = a.lu().solve(&b).expect("a regular matrix");
        for (t, &k) in truth.iter().zip(&columns) {
            approx::assert_relative_eq!(beta[k], *t, epsilon = 1e-10);
        }
        assert_eq!([beta[1], beta[3]], [0.0, 0.0]);
    }
}
