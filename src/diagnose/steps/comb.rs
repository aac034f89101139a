//! Combs: whether the raw words that occur are evenly spaced, by how much their phases concentrate.

use std::f64::consts::TAU;

use rayon::prelude::*;

/// Resultant length above which phases show a lattice; chance over the scanned frequencies and a hundred
/// words reaches 0.4.
pub const GATHERED: f64 = 0.6;
/// Words wider than this share of a step cannot show it.
pub const COARSE: f64 = 0.35;
/// Finest and coarsest steps of the depth that are tried, in raw units. At two units the resultant length is
/// sin(pi / 2) / (pi / 2), just above [`GATHERED`].
pub const STEPS_UNITS: [f64; 2] = [2.0, 500.0];
/// Range of words in which they are tried first.
const DENSE_UNITS: f64 = 1024.0;
/// Coarsest and finest steps of the disparity that are tried by phases alone, px; coarser ones also fit
/// readings at only a few distances.
pub const STEPS_PX: [f64; 2] = [1.0 / 3.0, 1.0 / 64.0];

/// Resultant length of the phases of places, 0 to 1, and the effective number of places.
pub struct Gathered {
    pub resultant: f64,
    /// Mean phase, cycles.
    pub phase: f64,
    places: f64,
}

impl Gathered {
    /// Phases of weighted places at a frequency; zero without any.
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
        Gathered { resultant, phase: s.atan2(c) / TAU, places: n * n / squares }
    }
}

/// Frequency at which the phases concentrate most, their resultant length (0 to 1), and its p-value.
#[derive(Default)]
pub struct Comb {
    frequency: f64,
    pub resultant: f64,
    pub p: f64,
}

impl Comb {
    /// Step of the lattice, if it is one.
    pub fn step(&self) -> Option<f64> {
        (self.resultant > GATHERED).then(|| 1.0 / self.frequency)
    }

    /// Scans frequencies evenly; `at` gives the weighted places for each of them.
    fn scan<'a>(from: f64, to: f64, by: f64, at: &dyn Fn(f64) -> &'a [(f64, f64)]) -> Self {
        let mut best = Comb::default();
        let (mut worth, mut scanned) = (0.0, 0.0);
        let mut frequency = from;
        while frequency < to {
            let Gathered { resultant, places, .. } = Gathered::of(at(frequency), frequency);
            if resultant > best.resultant {
                (best.frequency, best.resultant) = (frequency, resultant);
                worth = places;
            }
            scanned += 1.0;
            frequency += by;
        }
        // Rayleigh test, corrected for the number of scanned frequencies.
        let chance: f64 = scanned * (-worth * best.resultant * best.resultant).exp();
        Comb { p: chance.clamp(f64::MIN_POSITIVE, 1.0), ..best }
    }
}

/// Scan increment, in cycles over the range of the places.
pub const PHASE_STEP: f64 = 0.15;

/// Finds steps of the disparity, px; a word's disparity is `px_words` over the word.
pub fn steps_of_disparities(words: &[(usize, f64)], px_words: f64) -> Comb {
    let disparities: Vec<(f64, f64)> = words
        .iter()
        // The square root damps the counts: a lattice shows in which words occur.
        .map(|&(w, n)| (px_words / w as f64, n.sqrt()))
        .collect();
    let range = disparities[0].0 - disparities[disparities.len() - 1].0;
    // The nearest words are coarser than the lattice and cannot show it.
    let fine = |frequency: f64| {
        let coarse = |&(w, _): &(usize, f64)| px_words / (w * w) as f64 * frequency >= COARSE;
        &disparities[words.partition_point(coarse)..]
    };
    Comb::scan(1.0 / STEPS_PX[0], 1.0 / STEPS_PX[1], PHASE_STEP / range.max(1.0), &fine)
}

/// Finds steps of the depth that are no whole number of units: first where words are densest, then more and
/// more finely over more of them.
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

/// Finest and coarsest steps tried in raw words, in words; a finer step leaves only every eighth word or
/// fewer empty.
const STEPS_WORDS: [f64; 2] = [1.15, 16.0];
/// Words scanned, in the middle of those that occur. The scan goes on by `WORD_PHASE_STEP` of a step over
/// their range.
const WORDS_SCANNED: usize = 256;
const WORD_PHASE_STEP: f64 = 0.04;
/// Share of the readings, by the square roots of their counts, that may lie in words that should be empty.
pub const STRAY: f64 = 0.05;
/// Largest p-value of a step that is reported.
pub const CHANCE: f64 = 1e-4;

/// Steps of a matcher whose answers are stored in the nearest words, which leaves words between them empty:
/// the coarsest that explains which, in words, and its p-value if all were equally likely.
pub fn steps_of_words(words: &[(usize, f64)]) -> Option<(f64, f64)> {
    let middle = words[words.len() / 2].0;
    let near = words.iter().filter(|w| w.0.abs_diff(middle) <= WORDS_SCANNED / 2);
    let near: Vec<(f64, f64)> = near.map(|&(w, n)| (w as f64, n.sqrt())).collect();
    let ratio = 1.0 + WORD_PHASE_STEP / (near[near.len() - 1].0 - near[0].0).max(1.0);
    let scan = |k: usize| ratio.powi(k as i32) / STEPS_WORDS[1];
    let tries = ((STEPS_WORDS[1] / STEPS_WORDS[0]).ln() / ratio.ln()) as usize;
    let holds = |k: &usize| max_within(&near, scan(*k)) >= 1.0 - STRAY;
    let first = (0..tries).into_par_iter().find_first(holds)?;
    let last = (first..tries).take_while(holds).last()?;
    let frequency = 0.5 * (scan(first) + scan(last));
    // Probability of each word to lie within the arc that begins at one of them. Rare words, which may lie
    // anywhere, are not counted: the effective number of the weights.
    let [sum, squares] = [1, 2].map(|k| near.iter().map(|p| p.1.powi(k)).sum::<f64>());
    let n = sum * sum / squares;
    let p = (n * tries as f64 * frequency.powf(n - 1.0)).max(f64::MIN_POSITIVE);
    (p < CHANCE).then_some((frequency.recip(), p))
}

/// Largest share of the weights whose phases fit in an arc slightly shorter than a word; one as long as a
/// word would hold one evenly spaced phase too many.
fn max_within(places: &[(f64, f64)], frequency: f64) -> f64 {
    let arc = frequency * (1.0 - 0.5 * WORD_PHASE_STEP);
    let mut phases: Vec<(f64, f64)> =
        places.iter().map(|&(x, weight)| ((x * frequency).fract(), weight)).collect();
    phases.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = phases.len();
    let at = |k: usize| phases[k % n].0 + (k / n) as f64;
    let (mut held, mut most, mut end) = (0.0f64, 0.0f64, 0);
    for begin in 0..n {
        while end < begin + n && at(end) <= at(begin) + arc {
            held += phases[end % n].1;
            end += 1;
        }
        most = most.max(held);
        held -= phases[begin].1;
    }
    most / phases.iter().map(|p| p.1).sum::<f64>()
}
