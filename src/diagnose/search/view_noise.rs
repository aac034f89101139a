//! Simulated noise of a view, and the candidates' scores on it.
//!
//! Candidates share samples, so noise that looks like one of them also looks like others: the largest of
//! their gains is smaller than that of as many independent ones. Where tiles are gathered into coarser
//! patches, these and each grouping of the tiles have noise of their own, and the threshold is a little high.

use nalgebra::{DMatrix, DMatrixView, DVector};
use rand_distr::{Distribution, StandardNormal};

use super::evidence::root;
use super::prepared::{Grouping, Prepared, fill_all};
use super::rows::Rows;
use crate::rng::Stream;
use crate::terms::{Basis, PixelContext};

/// Noise of one view; one column per draw.
pub struct ViewNoise {
    /// At each coarse sample; see [`Rows::noise`].
    samples: DMatrix<f64>,
    /// Summed over each grouping.
    groups: Vec<DMatrix<f64>>,
    /// Scores of the terms fitted alongside every candidate.
    beside: DMatrix<f64>,
}

/// Scores by column and draw; there are many, of which three digits matter.
pub type Scores = DMatrix<f32>;

impl ViewNoise {
    /// Puts the scores of the terms alongside before a candidate's.
    fn with_beside(&self, own: &DMatrixView<'_, f64>) -> Scores {
        let m = self.beside.nrows();
        DMatrix::from_fn(m + own.nrows(), own.ncols(), |j, draw| {
            (if j < m { self.beside[(j, draw)] } else { own[(j - m, draw)] }) as f32
        })
    }
}

impl Rows<'_> {
    /// Draws the noise so many times, weighted and with the nuisances profiled out: one row per sample. Its
    /// products with columns are scores of their information's covariance.
    pub fn noise(&self, draws: usize, rng: &mut Stream) -> DMatrix<f64> {
        let (n, p) = (self.weight.len(), self.nuisances());
        let nuisances = DMatrix::from_fn(n, p, |i, q| self.sample(i)[q]);
        let weighted = DMatrix::from_fn(n, p, |i, q| self.weight[i] * nuisances[(i, q)]);
        let precision = DVector::from_column_slice(&self.precision);
        let information = self.own.view((0, 0), (p, p)) - DMatrix::from_diagonal(&precision);
        // The part of the nuisances' information that lies within the merged groups.
        let within = information - weighted.tr_mul(&nuisances);
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let roots: Vec<f64> = self.weight.iter().map(|w| w.max(0.0).sqrt()).collect();
        let mut noise = DMatrix::from_fn(n, draws, |i, _| roots[i] * normal());
        // A nuisance with a prior scatters by it; a free one is profiled out, whatever it is.
        let own = DMatrix::from_fn(p, draws, |q, _| match self.precision[q] {
            precision if precision > 0.0 => normal() / precision.sqrt(),
            _ => 0.0,
        });
        noise.gemm(1.0, &weighted, &own, 1.0);
        let within = root(&within) * DMatrix::from_fn(p, draws, |_, _| normal()) + within * own;
        let explained = &self.inverse * (nuisances.tr_mul(&noise) + within);
        noise.gemm(-1.0, &weighted, &explained, 1.0);
        noise
    }

    /// Scores of such noise on the chosen terms.
    fn chosen_scores(&self, noise: &DMatrix<f64>) -> DMatrix<f64> {
        let (p, m) = (self.nuisances(), self.width - self.nuisances());
        DMatrix::from_fn(m, self.weight.len(), |j, i| self.sample(i)[p + j]) * noise
    }

    /// Scores of such noise on a candidate, one column per draw; `columns` fills one row of its columns.
    pub fn scores(
        &self,
        count: usize,
        mut columns: impl FnMut(usize, &mut [f64]),
        noise: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(count, self.weight.len());
        for i in self.used() {
            columns(i, all.column_mut(i).as_mut_slice());
        }
        all * noise
    }
}

impl Grouping {
    /// Sums the samples' rows over each group.
    fn summed(&self, samples: &DMatrix<f64>) -> DMatrix<f64> {
        let mut sums = DMatrix::zeros(self.places.len(), samples.ncols());
        for (mut sum, column) in sums.column_iter_mut().zip(samples.column_iter()) {
            column.iter().zip(&self.of).for_each(|(x, &k)| sum[k as usize] += x);
        }
        sums
    }
}

impl Prepared<'_> {
    /// Draws the noise of the coarse samples, and of each grouping: that of the same samples where these are
    /// the fine ones, and of its own otherwise.
    pub fn noise(&self, draws: usize, rng: &mut Stream) -> ViewNoise {
        let samples = self.coarse.1.noise(draws, rng);
        let mut of_group = |(group, rows): &(&Grouping, Rows<'_>)| {
            if self.is_one_size { group.summed(&samples) } else { rows.noise(draws, rng) }
        };
        ViewNoise {
            groups: self.groups.iter().map(&mut of_group).collect(),
            beside: self.coarse.1.chosen_scores(&samples),
            samples,
        }
    }

    /// Scores of the noise on the terms fitted alongside and each basis: one row per column of these, one
    /// column per draw. `None` for a basis that is tried on finer samples than the noise was drawn for.
    pub fn noise_scores(&self, bases: &[&Basis], noise: &ViewNoise) -> Vec<Option<Scores>> {
        let mut scores = vec![None; bases.len()];
        let samples = |basis: &Basis| self.drawn(basis, noise);
        let mut left: Vec<usize> =
            (0..bases.len()).filter(|&k| samples(bases[k]).is_some()).collect();
        // Those that are tried on the same samples are multiplied at once.
        while let Some((places, rows, drawn)) = left.first().and_then(|&k| samples(bases[k])) {
            let same = |k: &usize| samples(bases[*k]).is_some_and(|(.., d)| std::ptr::eq(d, drawn));
            let (mine, others): (Vec<usize>, Vec<usize>) = left.into_iter().partition(same);
            left = others;
            let of: Vec<&Basis> = mine.iter().map(|&k| bases[k]).collect();
            let count = of.iter().map(|b| b.count()).sum();
            let all = rows.scores(count, |i, g| fill_all(&of, &places[i], g), drawn);
            let mut first = 0;
            for k in mine {
                let own = all.rows(first, bases[k].count());
                first += own.nrows();
                scores[k] = Some(noise.with_beside(&own));
            }
        }
        scores
    }

    /// Samples that a basis is tried on, with their noise.
    fn drawn<'n>(
        &self,
        basis: &Basis,
        noise: &'n ViewNoise,
    ) -> Option<(&[PixelContext], &Rows<'_>, &'n DMatrix<f64>)> {
        let (places, rows) = self.samples(basis);
        let group = self.groups.iter().position(|(_, of)| std::ptr::eq(of, rows));
        // The scores of the terms alongside are those of the coarse samples' noise.
        let is_joint = self.is_one_size || noise.beside.is_empty();
        let is_drawn = self.is_one_size || std::ptr::eq(rows, &self.coarse.1);
        let drawn = match group {
            Some(g) => Some(&noise.groups[g]).filter(|_| is_joint),
            None => Some(&noise.samples).filter(|_| is_drawn),
        };
        Some((places, rows, drawn?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::search::evidence::tests::{View, normal};
    use crate::rng::Seed;

    /// Drawn scores have the evidence's information as covariance: with free nuisances and nuisances with a
    /// prior, beside chosen terms, and where samples that a candidate cannot tell apart are merged though
    /// their nuisances differ. Six standard errors of a variance from so many draws.
    #[test]
    fn scores_of_noise_scatter_by_their_information() {
        const DRAWS: usize = 20_000;
        const KEYS: usize = 12;
        let mut rng = Seed(3).stream("view-noise");
        for chosen in [0, 2] {
            let mut view = View::draw(120, chosen, 3, &mut rng);
            let by_key = DMatrix::from_fn(KEYS, 3, |_, _| normal(&mut rng));
            let shared = DMatrix::from_fn(KEYS, view.x.ncols(), |_, _| normal(&mut rng));
            for i in 0..120 {
                view.candidate.set_row(i, &by_key.row(i % KEYS));
                let own = view.x.row(i) + shared.row(i % KEYS);
                view.x.set_row(i, &own);
            }
            let rows = view.rows();
            let merged = rows.grouped(KEYS, |i| i % KEYS);
            let information = view.evidence().a;
            let fill = |columns: &DMatrix<f64>, i: usize, g: &mut [f64]| {
                g.iter_mut().zip(columns.row(i).iter()).for_each(|(g, x)| *g = *x);
            };
            let noise = rows.noise(DRAWS, &mut rng);
            let own = rows.scores(3, |i, g| fill(&view.candidate, i, g), &noise);
            let mut scores = rows.chosen_scores(&noise).insert_rows(chosen, 3, 0.0);
            scores.rows_mut(chosen, 3).copy_from(&own);
            assert_covariance(&scores, &information);
            let noise = merged.noise(DRAWS, &mut rng);
            let scores = merged.scores(3, |k, g| fill(&by_key, k, g), &noise);
            let alone = information.view((chosen, chosen), (3, 3)).into_owned();
            assert_covariance(&scores, &alone);
        }
    }

    fn assert_covariance(scores: &DMatrix<f64>, information: &DMatrix<f64>) {
        let root = information.clone().cholesky().expect("columns that differ").l();
        let white = root.solve_lower_triangular(scores).expect("information");
        let covariance = &white * white.transpose() / scores.ncols() as f64;
        let off = (covariance - DMatrix::identity(root.nrows(), root.nrows())).amax();
        assert!(off < 0.06, "{off}");
    }
}
