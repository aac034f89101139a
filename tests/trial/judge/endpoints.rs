//! The five endpoints chosen in advance, and whether they reach their marks.

use kinoise::Seed;
use kinoise::stats::{at_least, at_most, quantile};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::scores::{Rate, SIDES, level, ratio};
use crate::gain::OUR_METHOD;
use crate::proof::ProvenSet;
use crate::raytraced::question::{Cell, World};

/// Best mark that an endpoint reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    Neither,
    Good,
    Extraordinary,
}

/// Result of one endpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Endpoint {
    pub id: String,
    pub words: String,
    pub n: usize,
    /// The figure itself; `None` where nothing was measured.
    pub value: Option<f64>,
    /// 95 % confidence interval.
    pub interval: Option<[f64; 2]>,
    /// Values required for "good" and "extraordinary".
    pub marks: [f64; 2],
    /// The best mark that the value itself reaches, whatever its interval.
    pub reached: Level,
    /// p-values for "good" and "extraordinary" against a truth that only just misses the mark, Holm-adjusted
    /// over the five endpoints.
    pub p_adjusted: [f64; 2],
}

struct Question {
    id: &'static str,
    words: &'static str,
    marks: [f64; 2],
    measure: Measure,
}

enum Measure {
    /// Share of the sets asked a question that are answered with yes.
    Share(&'static str, fn(&ProvenSet) -> bool),
    /// The same; lower is better.
    Alarms(&'static str),
    /// Median of our gain over the oracle's, on one of [`SIDES`].
    Gain(usize),
}

/// The least strength at which a cause is worth knowing, nats.
const WORTH_NATS: f64 = 50.0;

fn is_worth(set: &ProvenSet) -> bool {
    level(&set.truth).is_some_and(|nats| nats >= WORTH_NATS)
}

fn is_worth_and_single(set: &ProvenSet) -> bool {
    let asked = &set.truth.asked;
    is_worth(set) && asked.cell == Cell::Single && asked.world != World::Real
}

const QUESTIONS: [Question; 5] = [
    Question {
        id: "false-alarms",
        words: "Of the sets in which nothing is hidden, the share with a mismatch or any finding; a \
                diagnosis that fails counts as an alarm. Good: 5 % or less; extraordinary: 2 % or less.",
        marks: [0.05, 0.02],
        measure: Measure::Alarms("false_alarm"),
    },
    Question {
        id: "first-name",
        words: "Of the single hidden causes of the catalogue, simulated, worth 50 nats or more and \
                detected, the share whose first finding has the right name. Good: 80 % or more; \
                extraordinary: 90 % or more.",
        marks: [0.8, 0.9],
        measure: Measure::Share("first_name", is_worth_and_single),
    },
    Question {
        id: "gain",
        words: "The median, over the sets whose hidden causes are worth 50 nats or more each, of the \
                gain on fresh views inside the recording's distances and tilts over the oracle's; \
                nothing found gains nothing. Good: 0.80 or more; extraordinary: 0.93 or more.",
        marks: [0.8, 0.93],
        measure: Measure::Gain(0),
    },
    Question {
        id: "abstention",
        words: "Of the hidden causes that the catalogue lacks, worth 50 nats or more, the share that \
                is called unexplained with the right statistic and axis; what is not detected counts \
                as missed. Good: 75 % or more; extraordinary: 90 % or more.",
        marks: [0.75, 0.9],
        measure: Measure::Share("abstained", is_worth),
    },
    Question {
        id: "extrapolation",
        words: "The median over the same sets of the gain on views outside the recording's distances \
                and tilts over the oracle's. Good: 0.60 or more; extraordinary: 0.85 or more.",
        marks: [0.6, 0.85],
        measure: Measure::Gain(1),
    },
];

/// The endpoints in words, as they are committed to.
pub fn endpoints_in_words() -> Vec<String> {
    QUESTIONS.iter().map(|q| q.words.to_string()).collect()
}

pub fn endpoints(sets: &[ProvenSet]) -> Vec<Endpoint> {
    let mut all: Vec<Endpoint> = QUESTIONS.iter().map(|q| q.endpoint(sets)).collect();
    for mark in 0..2 {
        let p: Vec<f64> = all.iter().map(|e| e.p_adjusted[mark]).collect();
        all.iter_mut().zip(holm(&p)).for_each(|(e, p)| e.p_adjusted[mark] = p);
    }
    all
}

impl Question {
    fn endpoint(&self, sets: &[ProvenSet]) -> Endpoint {
        let answers = |question: &str, of: fn(&ProvenSet) -> bool| -> Vec<bool> {
            let asked = sets.iter().filter(|s| of(s));
            asked.filter_map(|s| s.marks.answers.get(question).copied()).collect()
        };
        match self.measure {
            Measure::Alarms(question) => self.share(&answers(question, |_| true), true),
            Measure::Share(question, of) => self.share(&answers(question, of), false),
            Measure::Gain(side) => {
                let gains = sets.iter().filter(|s| is_worth(s)).filter_map(|s| s.gains.as_ref());
                let ratios = gains.filter_map(|g| ratio(g, OUR_METHOD, SIDES[side]));
                self.median(&ratios.collect::<Vec<f64>>())
            }
        }
    }

    /// Endpoint of a share, with exact binomial p-values.
    fn share(&self, answers: &[bool], fewer: bool) -> Endpoint {
        let Some(Rate { k, n, rate, interval }) = Rate::of(answers.iter().copied()) else {
            return self.figure(0, None, |_| false, |_| 1.0);
        };
        let p = |m| if fewer { at_most(k, n, m) } else { at_least(k, n, m) };
        let reaches = |m| if fewer { rate <= m } else { rate >= m };
        self.figure(n, Some((rate, interval)), reaches, p)
    }

    /// Endpoint of a median: sign test against each mark; interval by bootstrap over sets.
    fn median(&self, ratios: &[f64]) -> Endpoint {
        let n = ratios.len();
        let value = quantile(&mut ratios.to_vec(), 0.5).zip(resampled_median(ratios));
        let p = |m| at_least(ratios.iter().filter(|r| **r >= m).count(), n, 0.5);
        self.figure(n, value, |m| value.is_some_and(|v| v.0 >= m), p)
    }

    fn figure(
        &self,
        n: usize,
        value: Option<(f64, [f64; 2])>,
        reaches: impl Fn(f64) -> bool,
        p: impl Fn(f64) -> f64,
    ) -> Endpoint {
        Endpoint {
            id: self.id.into(),
            words: self.words.into(),
            n,
            value: value.map(|v| v.0),
            interval: value.map(|v| v.1),
            marks: self.marks,
            reached: match self.marks.map(reaches) {
                [_, true] => Level::Extraordinary,
                [true, _] => Level::Good,
                _ => Level::Neither,
            },
            p_adjusted: self.marks.map(p),
        }
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
fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let (mut adjusted, mut max) = (vec![1.0; p.len()], 0.0f64);
    for (rank, i) in order.into_iter().enumerate() {
        max = max.max((p[i] * (p.len() - rank) as f64).min(1.0));
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
        for (a, e) in adjusted.iter().zip([0.04, 0.09, 0.09, 0.025, 0.5]) {
            assert!((a - e).abs() < 1e-12, "{adjusted:?}");
        }
    }

    #[test]
    fn a_share_reaches_a_mark_that_chance_may_explain() {
        let four = QUESTIONS[1].share(&[true, true, true, true, false], false);
        assert_eq!(four.reached, Level::Good);
        assert!(four.p_adjusted[0] > 0.7, "{:?}", four.p_adjusted);
        let none = QUESTIONS[1].share(&[], false);
        assert_eq!((none.value, none.p_adjusted), (None, [1.0; 2]));
    }

    #[test]
    fn the_median_lies_in_its_interval() {
        let values: Vec<f64> = (0..101).map(|i| f64::from(i) / 100.0).collect();
        let question = Question { id: "", words: "", marks: [0.4, 0.9], measure: Measure::Gain(0) };
        let figure = question.median(&values);
        let [low, high] = figure.interval.unwrap();
        assert!(low < 0.5 && 0.5 < high && low > 0.35 && high < 0.65);
        assert_eq!((figure.value, figure.reached), (Some(0.5), Level::Good));
        assert!(figure.p_adjusted[0] < 0.1 && figure.p_adjusted[1] > 0.99);
    }
}
