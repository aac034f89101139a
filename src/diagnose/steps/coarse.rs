//! Coarse steps: lattices that pass every occurring raw word within its width, which tells a step from its
//! fractions.

use super::comb::{CHANCE, COARSE, GATHERED, Gathered, PHASE_STEP, STRAY};

/// A raw word: where its readings lie, its width, and the root of their count.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub at: f64,
    pub width: f64,
    pub weight: f64,
}

/// A lattice of steps: place number `k` lies at `from + k size`.
struct Lattice {
    size: f64,
    from: f64,
}

/// Tolerance of a fit beyond a word's own width, in steps, round by round. The scan is off by half of
/// [`PHASE_STEP`] at the ends.
const LEFT_OUT: [f64; 4] = [0.15, 0.05, 0.015, 0.0];
/// A word reaches half of its width to each side, and a lattice fitted to five words, rounded by 0.29 of a
/// width, is off by up to a quarter.
const REACH: f64 = 0.75;

impl Lattice {
    fn number(&self, at: f64) -> f64 {
        ((at - self.from) / self.size).round()
    }

    fn off(&self, at: f64) -> f64 {
        (at - self.from - self.number(at) * self.size).abs()
    }

    fn is_near(&self, place: &Place, more: f64) -> bool {
        self.off(place.at) <= REACH * place.width + more * self.size
    }

    /// Least-squares fit of about this step to the near places, with a tolerance that narrows in rounds.
    fn fit(places: &[Place], size: f64) -> Option<Self> {
        let on: Vec<(f64, f64)> = places.iter().map(|p| (p.at, p.weight)).collect();
        let from = size * Gathered::of(&on, 1.0 / size).phase;
        let refine = |lattice: Option<Lattice>, more: &f64| {
            let lattice = lattice?;
            let near = places.iter().filter(|p| lattice.is_near(p, *more));
            let rows = near.map(|p| (lattice.number(p.at), p.at, p.width.powi(-2)));
            let [mut n, mut k, mut kk, mut x, mut kx] = [0.0; 5];
            for (number, at, weight) in rows {
                n += weight;
                k += weight * number;
                kk += weight * number * number;
                x += weight * at;
                kx += weight * number * at;
            }
            let size = (n * kx - k * x) / (n * kk - k * k);
            size.is_finite().then(|| Lattice { size, from: (x - size * k) / n })
        };
        LEFT_OUT.iter().fold(Some(Lattice { size, from }), refine)
    }

    /// Words on the lattice, in order; `None` where too many readings lie in others. All readings of a step
    /// are in one word, so a word's neighbour should be empty.
    fn explains(&self, places: &[Place]) -> Option<Vec<Place>> {
        let mut on: Vec<Place> = Vec::new();
        for place in places.iter().filter(|p| self.is_near(p, 0.0)) {
            match on.last_mut().filter(|last| self.number(last.at) == self.number(place.at)) {
                Some(last) if last.weight < place.weight => *last = *place,
                Some(_) => {}
                None => on.push(*place),
            }
        }
        let weight = |of: &[Place]| of.iter().map(|p| p.weight).sum::<f64>();
        (weight(&on) >= (1.0 - STRAY) * weight(places)).then_some(on)
    }

    /// Probability that words placed anywhere would fit as well; the two finest determine the lattice.
    fn chance(&self, on: &[Place]) -> f64 {
        let mut widths: Vec<f64> = on.iter().map(|p| p.width).collect();
        widths.sort_by(f64::total_cmp);
        let of = |width: &f64| (2.0 * REACH * width / self.size).min(1.0);
        widths.iter().skip(2).map(of).product()
    }
}

/// Coarsest step between `coarsest` and `finest` that fits the places, which are in order, and its p-value.
pub fn coarsest_step(places: &[Place], [coarsest, finest]: [f64; 2]) -> Option<(f64, f64)> {
    let range = places.last()?.at - places.first()?.at;
    let by = PHASE_STEP / range.abs().max(finest);
    let frequency = |scanned: usize| 1.0 / coarsest + scanned as f64 * by;
    let mut scan = (0..).map(|n| (n, 1.0 / frequency(n))).take_while(|(_, size)| *size > finest);
    let told = |(scanned, size): (usize, f64)| {
        // Wider words cannot show this step.
        let fine: Vec<Place> = places.iter().filter(|p| p.width < COARSE * size).copied().collect();
        let at: Vec<(f64, f64)> = fine.iter().map(|p| (p.at, p.weight)).collect();
        if Gathered::of(&at, 1.0 / size).resultant < GATHERED {
            return None;
        }
        let lattice = Lattice::fit(&fine, size)?;
        let p = (scanned + 1) as f64 * lattice.chance(&lattice.explains(&fine)?);
        let near = (lattice.size / size - 1.0).abs() < 0.5;
        (near && p < CHANCE).then(|| (lattice.size, p.max(f64::MIN_POSITIVE)))
    };
    scan.find_map(told)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words of 0.2 mm at these disparities, for a camera with 43.5 px m.
    fn places(disparities: impl Iterator<Item = f64>) -> Vec<Place> {
        let px_words = 43.5 * 5000.0;
        let place = |d: f64| {
            let word = (px_words / d).round();
            Place { at: px_words / word, width: px_words / word.powi(2), weight: 1.0 }
        };
        disparities.map(place).collect()
    }

    #[test]
    fn a_step_is_told_from_its_own_fractions() {
        for step in [0.3, 0.5, 1.0, 1.7, 4.0] {
            let all = (0..60).map(|k| 14.0 + step * f64::from(k)).filter(|d| *d < 44.0);
            let (told, p) = coarsest_step(&places(all), [8.0, 0.25]).expect("a step");
            assert!((told / step - 1.0).abs() < 1e-3 && p < 1e-6, "{step}: {told} {p}");
        }
    }

    /// Each reading in one of two or three words around a few distances.
    #[test]
    fn few_words_anywhere_and_clusters_of_words_are_no_steps() {
        let anywhere = [14.21, 19.04, 23.77, 29.3, 36.92, 41.15];
        assert!(coarsest_step(&places(anywhere.into_iter()), [8.0, 0.25]).is_none());
        let of_even = |d: f64| [d - 0.01, d, d + 0.01];
        let clusters = [18.0, 24.0, 36.0, 42.0].into_iter().flat_map(of_even);
        assert!(coarsest_step(&places(clusters), [8.0, 0.25]).is_none());
    }
}
