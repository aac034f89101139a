//! The five figures that were chosen beforehand, and whether they reach their marks.

use rand::Rng;
use serde::{Deserialize, Serialize};

use super::learnt::{BEYOND, Side, WITHIN, ratio};
use super::scores::{Judged, worth};
use crate::examine::OUR_METHOD;
use crate::gains::Gains;
use crate::raytraced::question::{Cell, World};
use kinoise::rng::Seed;
use kinoise::stats::{at_least, at_most, clopper_pearson, quantile};

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
    /// The best mark of which that is below 5 %: chance alone does not bring it there.
    pub shown: Level,
}

struct Question {
    id: &'static str,
    words: &'static str,
    marks: [f64; 2],
}

const QUESTIONS: [Question; 5] = [
    Question {
        id: "false-alarms",
        words: "Of the sets in which nothing is hidden, the share with a mismatch or any finding. \
                A diagnosis that fails counts as an alarm. Good: 5 % or less; extraordinary: 2 % or less.",
        marks: [0.05, 0.02],
    },
    Question {
        id: "first-name",
        words: "Of the single hidden causes of the catalogue made by rays or by light, worth 50 nats \
                or more and detected, the share whose first finding has the right name. Good: 80 % or \
                more; extraordinary: 90 % or more.",
        marks: [0.8, 0.9],
    },
    Question {
        id: "gain",
        words: "The median, over the sets whose hidden causes are worth 50 nats or more each, of the \
                gain on fresh views inside the recording's distances and tilts, over the gain of the \
                oracle; nothing found gains nothing. Good: 0.80 or more; extraordinary: 0.93 or more.",
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
                and tilts, over the gain of the oracle; and the mean lead over the best other method \
                is above zero, by resampling sets. Good: 0.60 or more; extraordinary: \
                0.85 or more.",
        marks: [0.6, 0.85],
    },
];

/// As they are sealed.
pub fn endpoints_in_words() -> Vec<String> {
    QUESTIONS.iter().map(|q| words(q.words)).collect()
}

fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A figure, its interval, whether it reaches a mark, and how probable that is by chance.
struct Figure {
    n: usize,
    value: Option<f64>,
    interval: Option<[f64; 2]>,
    reached: [bool; 2],
    p: [f64; 2],
}

pub fn endpoints(sets: &[Judged<'_>]) -> Vec<Endpoint> {
    let alarms: Vec<bool> = sets.iter().filter_map(|s| s.marks.false_alarm).collect();
    let names: Vec<bool> = sets
        .iter()
        .filter(|s| s.truth.asked.cell == Cell::Single && s.truth.asked.world != World::Real)
        .filter(|s| worth(s.truth) && s.marks.detected == Some(true))
        .filter_map(|s| s.marks.first_name)
        .collect();
    let open: Vec<bool> =
        sets.iter().filter(|s| worth(s.truth)).filter_map(|s| s.marks.abstained).collect();
    let gains: Vec<&Gains> =
        sets.iter().filter(|s| worth(s.truth)).filter_map(|s| s.gains).collect();
    let [a, b, c, d, e] = &QUESTIONS;
    let figures = [
        share(&alarms, a.marks, true),
        share(&names, b.marks, false),
        median(&gains, WITHIN, c.marks),
        share(&open, d.marks, false),
        leading(&gains, e.marks),
    ];
    let adjusted = [0, 1].map(|m| holm(&figures.each_ref().map(|f| f.p[m])));
    let told = |i: usize| Endpoint {
        id: QUESTIONS[i].id.into(),
        words: words(QUESTIONS[i].words),
        n: figures[i].n,
        value: figures[i].value,
        interval: figures[i].interval,
        marks: QUESTIONS[i].marks,
        reached: best(figures[i].reached),
        p_adjusted: [adjusted[0][i], adjusted[1][i]],
        shown: best([0, 1].map(|m| adjusted[m][i] < 0.05)),
    };
    (0..QUESTIONS.len()).map(told).collect()
}

fn best([good, extraordinary]: [bool; 2]) -> Level {
    match (good, extraordinary) {
        (_, true) => Level::Extraordinary,
        (true, _) => Level::Good,
        _ => Level::Neither,
    }
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

/// Sign test on the median.
fn median(gains: &[&Gains], side: Side, marks: [f64; 2]) -> Figure {
    let mut ratios: Vec<f64> = gains.iter().filter_map(|g| ratio(g, OUR_METHOD, side)).collect();
    let value = quantile(&mut ratios, 0.5);
    let n = ratios.len();
    let above = |m: f64| ratios.iter().filter(|r| **r >= m).count();
    let p = |m: f64| if n == 0 { 1.0 } else { at_least(above(m), n, 0.5) };
    Figure {
        n,
        value,
        interval: resampled(&ratios, |mut sample| quantile(&mut sample, 0.5)),
        reached: marks.map(|m| value.is_some_and(|v| v >= m)),
        p: marks.map(p),
    }
}

/// The median, and the lead over whichever other method is best over all sets.
fn leading(gains: &[&Gains], marks: [f64; 2]) -> Figure {
    let figure = median(gains, BEYOND, marks);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut others: Vec<&String> = gains.iter().flat_map(|g| g.methods.keys()).collect();
    others.sort();
    others.dedup();
    for other in others.into_iter().filter(|m| *m != OUR_METHOD) {
        let pair = |g: &&Gains| Some((ratio(g, OUR_METHOD, BEYOND)?, ratio(g, other, BEYOND)?));
        let pairs: Vec<(f64, f64)> = gains.iter().filter_map(pair).collect();
        let Some(middle) = quantile(&mut pairs.iter().map(|p| p.1).collect::<Vec<_>>(), 0.5) else {
            continue;
        };
        if best.as_ref().is_none_or(|b| middle > b.0) {
            best = Some((middle, pairs.iter().map(|p| p.0 - p.1).collect()));
        }
    }
    let behind = best.map_or(1.0, |(_, lead)| share_not_above_zero(&lead));
    let leads = behind < 0.05;
    Figure {
        reached: figure.reached.map(|r| r && leads),
        p: figure.p.map(|p| p.max(behind)),
        ..figure
    }
}

const RESAMPLES: usize = 2000;

fn resamples(values: &[f64]) -> impl Iterator<Item = Vec<f64>> {
    let mut rng = Seed(1).stream("prove/judge");
    let n = values.len();
    (0..RESAMPLES).map(move |_| (0..n).map(|_| values[rng.random_range(0..n)]).collect())
}

fn share_not_above_zero(lead: &[f64]) -> f64 {
    if lead.is_empty() {
        return 1.0;
    }
    let behind = resamples(lead).filter(|s| s.iter().sum::<f64>() <= 0.0).count();
    (behind + 1) as f64 / (RESAMPLES + 1) as f64
}

fn resampled(values: &[f64], of: impl Fn(Vec<f64>) -> Option<f64>) -> Option<[f64; 2]> {
    if values.is_empty() {
        return None;
    }
    let mut all: Vec<f64> = resamples(values).filter_map(of).collect();
    Some([quantile(&mut all, 0.025)?, quantile(&mut all, 0.975)?])
}

/// Step-down adjustment of Holm (1979).
fn holm(p: &[f64; 5]) -> [f64; 5] {
    let mut order = [0, 1, 2, 3, 4];
    order.sort_by(|a: &usize, b| p[*a].total_cmp(&p[*b]));
    let (mut adjusted, mut most) = ([1.0; 5], 0.0f64);
    for (rank, i) in order.into_iter().enumerate() {
        most = most.max((p[i] * (5 - rank) as f64).min(1.0));
        adjusted[i] = most;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains::{Gain, Method};

    #[test]
    fn holm_is_as_in_the_textbook() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005, 0.5]);
        let expected = [0.04, 0.09, 0.09, 0.025, 0.5];
        for (a, e) in adjusted.iter().zip(expected) {
            assert!((a - e).abs() < 1e-12, "{adjusted:?}");
        }
    }

    #[test]
    fn a_mark_is_shown_only_when_chance_would_not_reach_it() {
        let two = |k: usize, n: usize| (0..n).map(|i| i < k).collect::<Vec<_>>();
        let four = share(&two(4, 200), [0.05, 0.02], true);
        assert_eq!(four.reached, [true, true], "4 of 200 are 2 %");
        assert!(four.p[0] < 0.03 && four.p[1] > 0.5, "{:?}", four.p);
    }

    #[test]
    fn the_lead_must_be_over_the_best_of_the_others() {
        let both = |v: f64| Gain { within: v, beyond: v };
        let of = |ours: f64, other: f64| Gains {
            methods: [(OUR_METHOD, ours), ("process", other), ("none", 0.0)]
                .into_iter()
                .map(|(k, v)| (k.into(), Method { gain: both(v), parameters: 1 }))
                .collect(),
            oracle: both(100.0),
        };
        let ahead: Vec<Gains> = (0..40).map(|i| of(90.0 + f64::from(i % 7), 30.0)).collect();
        let behind: Vec<Gains> = (0..40).map(|i| of(90.0 + f64::from(i % 7), 99.0)).collect();
        let [a, b] =
            [&ahead, &behind].map(|all| leading(&all.iter().collect::<Vec<_>>(), [0.6, 0.85]));
        assert_eq!((a.reached, b.reached), ([true; 2], [false; 2]));
        assert!(a.p[1] < 0.01 && b.p[1] > 0.9);
    }
}
