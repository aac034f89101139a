//! The evidence against dense least squares on all samples at once, and against simulated noise.

use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::search::rows::Rows;
use crate::rng::{Seed, Stream};

pub fn normal(rng: &mut Stream) -> f64 {
    StandardNormal.sample(rng)
}

fn matrix(rows: usize, columns: usize, rng: &mut Stream) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| normal(rng))
}

/// One view's samples as plain matrices.
#[derive(Clone)]
pub struct View {
    pub y: DVector<f64>,
    pub w: DVector<f64>,
    /// Nuisances, and the prior precision of each.
    pub x: DMatrix<f64>,
    pub precision: Vec<f64>,
    /// Terms already chosen, and the candidate.
    pub chosen: DMatrix<f64>,
    pub candidate: DMatrix<f64>,
}

const NUISANCES: usize = 3;

impl View {
    pub fn draw(n: usize, chosen: usize, candidate: usize, rng: &mut Stream) -> Self {
        View {
            y: DVector::from_fn(n, |_, _| normal(rng)),
            // One in ten has no weight.
            w: DVector::from_fn(n, |_, _| {
                if rng.random::<f64>() < 0.1 { 0.0 } else { rng.random_range(0.1..5.0) }
            }),
            x: matrix(n, NUISANCES, rng),
            precision: vec![0.0, 0.7, 30.0],
            chosen: matrix(n, chosen, rng),
            candidate: matrix(n, candidate, rng),
        }
    }

    pub fn rows(&self) -> Rows<'_> {
        let beside = join(&self.x, &self.chosen);
        let width = beside.ncols();
        let row_major: Vec<f64> = beside.transpose().as_slice().to_vec();
        Rows::new(self.y.as_slice(), self.w.as_slice(), &row_major, width, &self.precision)
            .expect("nuisances that can be told apart")
    }

    pub fn evidence(&self) -> Evidence {
        let g = &self.candidate;
        self.rows().reduce(g.ncols(), |i, row| {
            row.iter_mut().enumerate().for_each(|(j, x)| *x = g[(i, j)]);
        })
    }

    /// All terms, the chosen ones first.
    fn terms(&self) -> DMatrix<f64> {
        join(&self.chosen, &self.candidate)
    }

    /// Profile log-likelihood of the view for given coefficients, nats.
    fn log_likelihood(&self, terms: &DMatrix<f64>, beta: &DVector<f64>) -> f64 {
        let left = &self.y - terms * beta;
        let w = DMatrix::from_diagonal(&self.w);
        let mut normal = self.x.transpose() * &w * &self.x;
        for (q, p) in self.precision.iter().enumerate() {
            normal[(q, q)] += p;
        }
        let c = normal.lu().solve(&(self.x.transpose() * &w * &left)).expect("regular");
        let rest = left - &self.x * &c;
        let held: f64 = self.precision.iter().zip(c.iter()).map(|(p, c)| p * c * c).sum();
        -0.5 * (rest.dot(&(&w * &rest)) + held)
    }
}

fn join(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(a.nrows(), a.ncols() + b.ncols());
    all.columns_mut(0, a.ncols()).copy_from(a);
    all.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    all
}

/// Common coefficients of the terms from one dense system over all views, each with its own nuisances.
fn dense_fit(views: &[&View], terms: &dyn Fn(&View) -> DMatrix<f64>, prior: f64) -> DVector<f64> {
    let k = terms(views[0]).ncols();
    let width = k + NUISANCES * views.len();
    let mut a = DMatrix::zeros(width, width);
    let mut b = DVector::zeros(width);
    for (v, view) in views.iter().enumerate() {
        let mut all = DMatrix::zeros(view.y.len(), width);
        all.columns_mut(0, k).copy_from(&terms(view));
        all.columns_mut(k + NUISANCES * v, NUISANCES).copy_from(&view.x);
        let w = DMatrix::from_diagonal(&view.w);
        a += all.transpose() * &w * &all;
        b += all.transpose() * &w * &view.y;
        for (q, p) in view.precision.iter().enumerate() {
            let at = k + NUISANCES * v + q;
            a[(at, at)] += p;
        }
    }
    (0..k).for_each(|j| a[(j, j)] += prior);
    a.lu().solve(&b).expect("regular").rows(0, k).into_owned()
}

/// Gain of the terms, each view left out in turn and predicted from the others.
fn dense_gain(views: &[View], terms: &dyn Fn(&View) -> DMatrix<f64>, prior: f64) -> Vec<f64> {
    (0..views.len())
        .map(|v| {
            let others: Vec<&View> =
                views.iter().enumerate().filter(|(i, _)| *i != v).map(|(_, o)| o).collect();
            let beta = dense_fit(&others, terms, prior);
            let t = terms(&views[v]);
            let none = DVector::zeros(beta.len());
            views[v].log_likelihood(&t, &beta) - views[v].log_likelihood(&t, &none)
        })
        .collect()
}

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-9 * (1.0 + a.abs().max(b.abs())), "{a} and {b}");
}

#[test]
fn the_gain_is_the_log_likelihood_of_views_left_out_in_a_dense_fit() {
    for seed in 0..20u64 {
        let mut rng = Seed(seed).stream("evidence/gain");
        let (chosen, candidate) = (seed as usize % 3, 1 + seed as usize % 4);
        let views: Vec<View> =
            (0..5).map(|v| View::draw(30 + 7 * v, chosen, candidate, &mut rng)).collect();
        let prior = [1e-6, 0.3, 20.0][seed as usize % 3];
        let evidence: Vec<Evidence> = views.iter().map(View::evidence).collect();
        let found = gain(&evidence, prior).unwrap();
        let expected = dense_gain(&views, &View::terms, prior);
        found.by_view.iter().zip(&expected).for_each(|(a, b)| near(*a, *b));
        near(found.total, expected.iter().sum());
        let all: Vec<&View> = views.iter().collect();
        let beta = dense_fit(&all, &View::terms, prior);
        found.beta.iter().zip(beta.iter()).for_each(|(a, b)| near(*a, *b));
    }
}

#[test]
fn a_reduced_view_is_the_dense_projection() {
    for seed in 0..12u64 {
        let mut rng = Seed(seed).stream("evidence/reduce");
        let view = View::draw(50, seed as usize % 4, 1 + seed as usize % 5, &mut rng);
        let w = DMatrix::from_diagonal(&view.w);
        let held = DMatrix::from_diagonal(&DVector::from_vec(view.precision.clone()));
        let own = (view.x.transpose() * &w * &view.x + held).try_inverse().unwrap();
        let project = &w - &w * &view.x * &own * view.x.transpose() * &w;
        let z = view.terms();
        let (a, b) = (z.transpose() * &project * &z, z.transpose() * &project * &view.y);
        let found = view.evidence();
        assert_eq!(found.a.shape(), a.shape());
        found.a.iter().zip(a.iter()).for_each(|(f, e)| near(*f, *e));
        found.b.iter().zip(b.iter()).for_each(|(f, e)| near(*f, *e));
        let explained = (&w * &view.y).dot(&(&view.x * &own * view.x.transpose() * &w * &view.y));
        near(view.rows().explained(), explained);
    }
}

#[test]
fn samples_of_one_key_are_one_sample_for_columns_of_that_key() {
    const KEYS: usize = 9;
    for seed in 0..10u64 {
        let mut rng = Seed(seed).stream("evidence/grouped");
        let mut view = View::draw(80, seed as usize % 3, 3, &mut rng);
        // The last key has no sample at all.
        let keys: Vec<usize> = (0..80).map(|_| rng.random_range(0..KEYS - 1)).collect();
        let by_key = matrix(KEYS, 3, &mut rng);
        view.candidate = DMatrix::from_fn(80, 3, |i, j| by_key[(keys[i], j)]);
        let grouped = view.rows().grouped(KEYS, |i| keys[i]).reduce(3, |k, row| {
            row.iter_mut().enumerate().for_each(|(j, x)| *x = by_key[(k, j)]);
        });
        let whole = view.evidence();
        whole.a.iter().zip(grouped.a.iter()).for_each(|(a, b)| near(*a, *b));
        whole.b.iter().zip(grouped.b.iter()).for_each(|(a, b)| near(*a, *b));
    }
}

#[test]
fn nuisances_that_are_one_and_the_same_are_refused() {
    let twice = |_: usize| [1.0, 1.0];
    let beside: Vec<f64> = (0..10).flat_map(twice).collect();
    let ones = [1.0; 10];
    assert!(Rows::new(&ones, &ones, &beside, 2, &[0.0, 0.0]).is_none());
    assert!(Rows::new(&ones, &ones, &beside, 2, &[1.0, 1.0]).is_some());
}
