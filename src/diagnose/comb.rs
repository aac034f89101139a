//! Combs: whether the words that occur lie at even distances, by how far their phases gather.

use std::f64::consts::TAU;

/// Phases gathered more than this belong to a lattice: chance over the scanned frequencies and a
/// hundred words reaches 0.4.
const GATHERED: f64 = 0.6;
/// Words wider than this share of a step cannot show it.
pub const COARSE: f64 = 0.35;
/// Finest and coarsest steps of the depth looked for, in units of the words: two are gathered by
/// sin(pi / 2) / (pi / 2), just above [`GATHERED`].
const STEPS_UNITS: [f64; 2] = [2.0, 500.0];
/// The range of words in which they are looked for first.
const DENSE_UNITS: f64 = 1024.0;
/// Coarsest and finest steps looked for, px.
const STEPS_PX: [f64; 2] = [1.0 / 3.0, 1.0 / 64.0];

/// How much the phases of places gather, 0 to 1, and how many equal places their weights are worth.
pub struct Gathered {
    pub resultant: f64,
    places: f64,
}

impl Gathered {
    /// Of places with their weights; nothing of none.
    pub fn of(places: &[(f64, f64)], frequency: f64) -> Self {
        let (mut c, mut s, mut n, mut squares) = (0.0, 0.0, 0.0, 0.0);
        for &(x, weight) in places {
            let (sin, cos) = (TAU * frequency * x).sin_cos();
            c += weight * cos;
            s += weight * sin;
            n += weight;
            squares += weight * weight;
        }
        let resultant = f64::hypot(c, s) / f64::max(n, 1e-9);
        Gathered { resultant, places: n * n / squares }
    }
}

/// The frequency at which phases gather most, how much they do (0 to 1), and the chance of it.
#[derive(Default)]
pub struct Comb {
    frequency: f64,
    pub resultant: f64,
    pub p: f64,
}

impl Comb {
    /// Of a lattice, if it is one.
    pub fn step(&self) -> Option<f64> {
        (self.resultant > GATHERED).then(|| 1.0 / self.frequency)
    }

    /// Of the places, with their weights, that `at` gives for each frequency of an even scan.
    fn scan<'a>(from: f64, to: f64, by: f64, at: &dyn Fn(f64) -> &'a [(f64, f64)]) -> Self {
        let mut best = Comb::default();
        let (mut worth, mut scanned) = (0.0, 0.0);
        let mut frequency = from;
        while frequency < to {
            let Gathered { resultant, places } = Gathered::of(at(frequency), frequency);
            if resultant > best.resultant {
                (best.frequency, best.resultant) = (frequency, resultant);
                worth = places;
            }
            scanned += 1.0;
            frequency += by;
        }
        // Rayleigh's test, at each of the scanned frequencies.
        let chance: f64 = scanned * (-worth * best.resultant * best.resultant).exp();
        Comb { p: chance.clamp(f64::MIN_POSITIVE, 1.0), ..best }
    }
}

/// A scan goes on by this share of a cycle over the range of what it looks at.
pub const PHASE_STEP: f64 = 0.15;

/// Steps of the disparity, px: words are `px_words` over their disparity.
pub fn steps_of_disparities(words: &[(usize, f64)], px_words: f64) -> Comb {
    let disparities: Vec<(f64, f64)> = words
        .iter()
        // A count counts less and less: a lattice shows in which words occur.
        .map(|&(w, n)| (px_words / w as f64, n.sqrt()))
        .collect();
    let range = disparities[0].0 - disparities[disparities.len() - 1].0;
    // Words coarser than the lattice, the nearest ones, cannot show it.
    let fine = |frequency: f64| {
        let coarse = |&(w, _): &(usize, f64)| px_words / (w * w) as f64 * frequency >= COARSE;
        &disparities[words.partition_point(coarse)..]
    };
    Comb::scan(1.0 / STEPS_PX[0], 1.0 / STEPS_PX[1], PHASE_STEP / range.max(1.0), &fine)
}

/// Steps of the depth that are no whole number of units: where words lie densest first, then finer and
/// finer over more of them.
pub fn steps_of_depths(words: &[(usize, f64)]) -> Comb {
    let places: Vec<(f64, f64)> = words.iter().map(|&(w, n)| (w as f64, n.sqrt())).collect();
    let within = |middle: f64, range: f64| {
        let from = places.partition_point(|p| p.0 < middle - 0.5 * range);
        &places[from..places.partition_point(|p| p.0 < middle + 0.5 * range)]
    };
    let all = places[places.len() - 1].0 - places[0].0;
    let mut range = DENSE_UNITS.min(all);
    let crowded = |w: &(f64, f64)| within(w.0, range).iter().map(|p| p.1).sum::<f64>();
    let every = (places.len() / 64).max(1);
    let densest = places.iter().step_by(every).max_by(|a, b| crowded(a).total_cmp(&crowded(b)));
    let middle = densest.map_or(0.0, |p| p.0);
    let near = within(middle, range);
    let mut comb =
        Comb::scan(1.0 / STEPS_UNITS[1], 1.0 / STEPS_UNITS[0], PHASE_STEP / range, &|_| near);
    let mut p = comb.p;
    while range < 2.0 * all {
        let off = 2.0 * PHASE_STEP / range;
        range *= 2.0;
        let more = within(middle, range);
        let (from, to) = (comb.frequency - off, comb.frequency + off);
        comb = Comb::scan(from, to, PHASE_STEP / range, &|_| more);
        p = p.min(comb.p * STEPS_UNITS[1] * range / PHASE_STEP);
    }
    Comb { p: p.clamp(f64::MIN_POSITIVE, 1.0), ..comb }
}
