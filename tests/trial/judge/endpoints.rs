//! The five figures that were chosen beforehand, and whether they reach their marks.

use kinoise::Seed;
use kinoise::stats::{at_least, at_most, clopper_pearson, quantile};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::scores::{SIDES, level, ratio};
use crate::gain::OUR_METHOD;
use crate::proof::ProvenSet;
use crate::raytraced::question::{Cell, World};

/// How far a figure got.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    Neither,
    Good,
    Extraordinary,
}

/// One of the five.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Endpoint {
    pub id: String,
    pub words: String,
    pub n: usize,
    /// The figure itself; `None` where nothing was measured.
    pub value: Option<f64>,
    /// 95 %.
    pub interval: Option<[f64; 2]>,
    /// What "good" and "extraordinary" ask for.
    pub marks: [f64; 2],
    /// The best mark that the figure reaches as it stands.
    pub reached: Level,
    /// Probability of such a figure or a better one if the truth only just missed the mark; after
    /// Holm over the five. For "good" and for "extraordinary".
    pub p_adjusted: [f64; 2],
}

struct Question {
    id: &'static str,
    words: &'static str,
    marks: [f64; 2],
}

/// The least strength at which a cause is worth knowing, nats.
const WORTH_NATS: f64 = 50.0;

const QUESTIONS: [Question; 5] = [
    Question {
        id: "false-alarms",
        words: "Of the sets in which nothing is hidden, the share with a mismatch or any finding; a \
                diagnosis that fails counts as an alarm. Good: 5 % or less; extraordinary: 2 % or less.",
        marks: [0.05, 0.02],
    },
    Question {
        id: "first-name",
        words: "Of the single hidden causes of the catalogue, simulated, worth 50 nats or more and \
                detected, the share whose first finding has the right name. Good: 80 % or more; \
                extraordinary: 90 % or more.",
        marks: [0.8, 0.9],
    },
    Question {
        id: "gain",
        words: "The median, over the sets whose hidden causes are worth 50 nats or more each, of the \
                gain on fresh views inside the recording's distances and tilts over the oracle's; \
                nothing found gains nothing. Good: 0.80 or more; extraordinary: 0.93 or more.",
        marks: [0.8, 0.93],
    },
    Question {
        id: "abstention",
        words: "Of the hidden causes that the catalogue lacks, worth 50 nats or more, the share that \
                is called unexplained with the right statistic and axis; what is not detected counts \
                as missed. Good: 75 % or more; extraordinary: 90 % or more.",
        marks: [0.75, 0.9],
    },
    Question {
        id: "extrapolation",
        words: "The median over the same sets of the gain on views outside the recording's distances \
                and tilts over the oracle's. Good: 0.60 or more; extraordinary: 0.85 or more.",
        marks: [0.6, 0.85],
    },
];

/// As they are committed to.
pub fn endpoints_in_words() -> Vec<String> {
    QUESTIONS.iter().map(|q| words(q.words)).collect()
}

fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A figure, its interval, whether it reaches its marks, and how probable that is by chance.
struct Figure {
    n: usize,
    value: Option<f64>,
    interval: Option<[f64; 2]>,
    reached: [bool; 2],
    p: [f64; 2],
}

pub fn endpoints(sets: &[ProvenSet]) -> Vec<Endpoint> {
    let worth = |s: &&ProvenSet| level(&s.truth).is_some_and(|nats| nats >= WORTH_NATS);
    let answers = |question: &str, of: &dyn Fn(&&ProvenSet) -> bool| -> Vec<bool> {
        let asked = sets.iter().filter(of);
        asked.filter_map(|s| s.marks.answers.get(question).copied()).collect()
    };
    let single = |s: &&ProvenSet| {
        let asked = &s.truth.asked;
        worth(s) && asked.cell == Cell::Single && asked.world != World::Real
    };
    let ratios = |side: usize| -> Vec<f64> {
        let gains = sets.iter().filter(worth).filter_map(|s| s.gains.as_ref());
        gains.filter_map(|g| ratio(g, OUR_METHOD, SIDES[side])).collect()
    };
    let marks = |i: usize| QUESTIONS[i].marks;
    let figures = [
        share(&answers("false_alarm", &|_| true), marks(0), true),
        share(&answers("first_name", &single), marks(1), false),
        median(&ratios(0), marks(2)),
        share(&answers("abstained", &worth), marks(3), false),
        median(&ratios(1), marks(4)),
    ];
    let adjusted = [0, 1].map(|m| holm(&figures.each_ref().map(|f| f.p[m])));
    let endpoint = |i: usize| Endpoint {
        id: QUESTIONS[i].id.into(),
        words: words(QUESTIONS[i].words),
        n: figures[i].n,
        value: figures[i].value,
        interval: figures[i].interval,
        marks: QUESTIONS[i].marks,
        reached: match figures[i].reached {
            [_, true] => Level::Extraordinary,
            [true, _] => Level::Good,
            _ => Level::Neither,
        },
        p_adjusted: [adjusted[0][i], adjusted[1][i]],
    };
    (0..QUESTIONS.len()).map(endpoint).collect()
}

/// Exact binomial.
fn share(answers: &[bool], marks: [f64; 2], fewer_is_better: bool) -> Figure {
    let (k, n) = (answers.iter().filter(|a| **a).count(), answers.len());
    let value = (n > 0).then(|| k as f64 / n as f64);
    let reach = |m: f64| value.is_some_and(|v| if fewer_is_better { v <= m } else { v >= m });
    let p = |m: f64| match n {
        0 => 1.0,
        _ if fewer_is_better => at_most(k, n, m),
        _ => at_least(k, n, m),
    };
    let interval = (n > 0).then(|| clopper_pearson(k, n, 0.95));
    Figure { n, value, interval, reached: marks.map(reach), p: marks.map(p) }
}

/// Sign test against each mark; the interval by resampling sets.
fn median(ratios: &[f64], marks: [f64; 2]) -> Figure {
    let value = quantile(&mut ratios.to_vec(), 0.5);
    let p = |m: f64| match ratios.len() {
        0 => 1.0,
        n => at_least(ratios.iter().filter(|r| **r >= m).count(), n, 0.5),
    };
    Figure {
        n: ratios.len(),
        value,
        interval: resampled_median(ratios),
        reached: marks.map(|m| value.is_some_and(|v| v >= m)),
        p: marks.map(p),
    }
}

const RESAMPLES: usize = 2000;

fn resampled_median(values: &[f64]) -> Option<[f64; 2]> {
    let mut rng = Seed(1).stream("trial/judge");
    let n = values.len();
    let mut draw = |_| {
        let mut some: Vec<f64> = (0..n).map(|_| values[rng.random_range(0..n.max(1))]).collect();
        quantile(&mut some, 0.5)
    };
    let mut all: Vec<f64> = (0..RESAMPLES).filter_map(&mut draw).collect();
    Some([quantile(&mut all, 0.025)?, quantile(&mut all, 0.975)?])
}

/// Step-down adjustment of Holm (1979).
fn holm(p: &[f64; 5]) -> [f64; 5] {
    let mut order = [0, 1, 2, 3, 4];
    order.sort_by(|a: &usize, b| p[*a].total_cmp(&p[*b]));
    let (mut adjusted, mut max) = ([1.0; 5], 0.0f64);
    for (rank, i) in order.into_iter().enumerate() {
        max = max.max((p[i] * (5 - rank) as f64).min(1.0));
        adjusted[i] = max;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holm_steps_down_and_never_falls() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005, 0.5]);
        let expected = [0.04, 0.09, 0.09, 0.025, 0.5];
        for (a, e) in adjusted.iter().zip(expected) {
            assert!((a - e).abs() < 1e-12, "{adjusted:?}");
        }
    }

    #[test]
    fn a_share_reaches_a_mark_that_chance_may_explain() {
        let four = share(&[true, true, true, true, false], [0.8, 0.9], false);
        assert_eq!(four.reached, [true, false]);
        assert!(four.p[0] > 0.7, "{:?}", four.p);
        assert_eq!(share(&[], [0.8, 0.9], false).value, None);
    }

    #[test]
    fn the_median_lies_in_its_interval() {
        let values: Vec<f64> = (0..101).map(|i| f64::from(i) / 100.0).collect();
        let figure = median(&values, [0.4, 0.9]);
        let [low, high] = figure.interval.unwrap();
        assert!(low < 0.5 && 0.5 < high && low > 0.35 && high < 0.65);
        assert_eq!((figure.value, figure.reached), (Some(0.5), [true, false]));
        assert!(figure.p[0] < 0.1 && figure.p[1] > 0.99);
    }
}
