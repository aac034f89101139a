//! The marks beside the five endpoints: what was hoped for, what came.

use maud::{Markup, html};

use super::words::{of, percent, percents, ratio, worth};
use crate::prove::{
    Cell, Judged, Learnt, Level, OUR_METHOD, Proof, ProvenSet, Rate, World, scores,
};
use crate::report::numbers::ABSENT;

/// What a mark asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Within([f64; 2]),
}

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            Bound::AtMost(most) => value <= most,
            Bound::AtLeast(least) => value >= least,
            Bound::Within([low, high]) => (low..=high).contains(&value),
        }
    }

    fn words(self, share: bool) -> String {
        let number = |v| if share { percent(v) } else { ratio(v) };
        match self {
            Bound::AtMost(most) => format!("≤ {}", number(most)),
            Bound::AtLeast(least) => format!("≥ {}", number(least)),
            Bound::Within([low, high]) => format!("{} to {}", number(low), number(high)),
        }
    }
}

/// One figure and its marks.
pub(super) struct Goal {
    pub what: &'static str,
    pub value: Option<f64>,
    /// Told in percent.
    share: bool,
    /// Counts and interval of a share.
    rate: Option<Rate>,
    good: Option<Bound>,
    extraordinary: Bound,
}

impl Goal {
    /// `None` where nothing was measured.
    pub fn reached(&self) -> Option<Level> {
        let value = self.value.filter(|v| v.is_finite())?;
        let good = self.good.is_some_and(|b| b.holds(value));
        Some(match (self.extraordinary.holds(value), good) {
            (true, _) => Level::Extraordinary,
            (_, true) => Level::Good,
            _ => Level::Neither,
        })
    }

    /// `1 of 9, which is 11 % (95 % interval 0.3 to 48 %); asked for: ≤ 5 %`.
    pub fn in_words(&self) -> String {
        let asked = self.good.unwrap_or(self.extraordinary).words(self.share);
        match (&self.rate, self.value) {
            (Some(r), _) => {
                let interval = percents(r.interval);
                let share = percent(r.rate);
                format!(
                    "{}, which is {share} (95 % interval {interval}); asked for: {asked}",
                    of(r)
                )
            }
            (None, Some(value)) => format!("{}; asked for: {asked}", ratio(value)),
            (None, None) => "not measured".into(),
        }
    }
}

fn share(what: &'static str, rate: Option<Rate>, good: Option<Bound>, best: Bound) -> Goal {
    Goal { what, value: rate.map(|r| r.rate), share: true, rate, good, extraordinary: best }
}

fn figure(what: &'static str, value: Option<f64>, good: Option<Bound>, best: Bound) -> Goal {
    Goal { what, value, share: false, rate: None, good, extraordinary: best }
}

fn least(good: f64) -> Option<Bound> {
    Some(Bound::AtLeast(good))
}

fn most(good: f64) -> Option<Bound> {
    Some(Bound::AtMost(good))
}

/// A yes or no of the judge over some of the sets.
fn among(
    sets: &[ProvenSet],
    which: impl Fn(&ProvenSet) -> bool,
    answer: impl Fn(&ProvenSet) -> Option<bool>,
) -> Option<Rate> {
    Rate::of(sets.iter().filter(|s| which(s)).filter_map(answer))
}

/// All but the five endpoints, in the order of the plan.
pub(super) fn goals(proof: &Proof) -> Vec<Goal> {
    let mut all = seen(proof);
    all.extend(named(proof));
    all.extend(measured(proof));
    all.extend(gained(proof));
    all
}

fn seen(proof: &Proof) -> Vec<Goal> {
    use Bound::{AtLeast, AtMost};
    let scores = &proof.scores;
    let alarms = |kind: &str| scores.by_world_and_cell.get(kind)?.get("false_alarm").copied();
    let detected = |key: &str| {
        let of = scores.by_nats.iter().find(|(k, _)| k.trim_start_matches('0') == key)?.1;
        of.get("detected").copied()
    };
    let (five, two) = (most(0.05), AtMost(0.02));
    vec![
        share("False alarms, world of light (S2)", alarms("light/null"), five, two),
        share("False alarms, halves of real recordings (S3)", alarms("real/halves"), five, two),
        share("Single causes worth 15 nats detected", detected("15"), least(0.5), AtLeast(0.8)),
        share("Single causes worth 50 nats detected", detected("50"), least(0.95), AtLeast(0.99)),
    ]
}

fn named(proof: &Proof) -> Vec<Goal> {
    use Bound::{AtLeast, AtMost};
    let (sets, scores) = (&proof.sets[..], &proof.scores);
    let single = |s: &ProvenSet, w: World| {
        let asked = &s.truth.asked;
        asked.cell == Cell::Single && asked.world == w && s.marks.detected == Some(true)
    };
    let rays = |s: &ProvenSet| single(s, World::Rays) && worth(&s.truth);
    let light = |s: &ProvenSet| single(s, World::Light);
    let several = |s: &ProvenSet| matches!(s.truth.asked.cell, Cell::Pair | Cell::Triple);
    let first = |s: &ProvenSet| s.marks.first_name;
    let in_two = |s: &ProvenSet| s.marks.in_two;
    let exact = among(sets, several, |s| s.marks.exact);
    let all = |mark: &str| scores.all.get(mark).copied();
    vec![
        share(
            "Right first name, rays (S1), 50 nats or more, once detected",
            among(sets, rays, first),
            least(0.8),
            AtLeast(0.9),
        ),
        share(
            "Right among the first two names, the same sets",
            among(sets, rays, in_two),
            None,
            AtLeast(0.97),
        ),
        share(
            "Right first name, light (S2), any size, once detected",
            among(sets, light, first),
            least(0.65),
            AtLeast(0.8),
        ),
        share(
            "Right among the first two names, the same sets",
            among(sets, light, in_two),
            None,
            AtLeast(0.92),
        ),
        share("Exact set of names, two or three causes", exact, least(0.6), AtLeast(0.8)),
        figure("F1 of the names, two or three causes", scores.names_f1, None, AtLeast(0.9)),
        share(
            "Confident (0.9 or more) and wrong",
            all("confident_wrong"),
            most(0.05),
            AtMost(0.02),
        ),
        share(
            "Outside the catalogue, given a confident name (masquerade)",
            all("masquerade"),
            None,
            AtMost(0.05),
        ),
        share(
            "What planes cannot show is said to be so",
            all("said_blind"),
            least(0.9),
            AtLeast(0.98),
        ),
    ]
}

fn measured(proof: &Proof) -> Vec<Goal> {
    use Bound::{AtLeast, AtMost, Within};
    let scores = &proof.scores;
    let all = |mark: &str| scores.all.get(mark).copied();
    let amnesia = |s: &ProvenSet| s.truth.asked.cell == Cell::Amnesia;
    // What is not detected is not named.
    let again = |s: &ProvenSet| Some(s.marks.first_name == Some(true));
    let certainty = &scores.certainty;
    vec![
        share("Right axis, once detected", all("axis"), least(0.85), AtLeast(0.95)),
        figure("Overlap of the interval, median", scores.overlap, least(0.5), AtLeast(0.7)),
        figure(
            "Relative error of parameters, median",
            scores.parameter_error,
            most(0.15),
            AtMost(0.07),
        ),
        share(
            "90 % intervals that hold the true parameter",
            scores.coverage,
            None,
            Within([0.86, 0.94]),
        ),
        figure(
            "Stated probabilities: calibration error (ECE)",
            certainty.ece,
            most(0.08),
            AtMost(0.04),
        ),
        figure("Stated probabilities: Brier score", certainty.brier, most(0.15), AtMost(0.08)),
        share("Nothing left after the fix", all("after_clean"), least(0.85), AtLeast(0.95)),
        share(
            "Amnesia: the struck term found and named first (S3)",
            among(&proof.sets, amnesia, again),
            least(0.7),
            AtLeast(0.9),
        ),
    ]
}

fn gained(proof: &Proof) -> Vec<Goal> {
    use Bound::{AtLeast, AtMost};
    let learnt = learnt_where_it_matters(proof);
    let ours = learnt.iter().find(|(name, _)| name == OUR_METHOD).map(|(_, l)| l);
    let low = ours.and_then(|l| l.within).map(|r| r.low);
    let process = learnt.iter().find(|(name, _)| name == "gaussian-process").map(|(_, l)| l);
    let median = |l: &Learnt| l.within.map(|r| r.median);
    let over = |of: &dyn Fn(&Learnt) -> Option<f64>| {
        let (ours, theirs) = (of(ours?)?, of(process?).filter(|v| *v > 0.0)?);
        Some(ours / theirs)
    };
    vec![
        figure("Gain over the oracle's, 10th percentile of sets", low, None, AtLeast(0.75)),
        figure("Median gain over a Gaussian process's", over(&median), None, AtLeast(0.95)),
        figure("Parameters over a Gaussian process's", over(&|l| l.parameters), None, AtMost(0.2)),
    ]
}

/// Gains by method over the sets of the endpoints, whose causes are worth 50 nats or more each.
pub(super) fn learnt_where_it_matters(proof: &Proof) -> Vec<(String, Learnt)> {
    let sets: Vec<Judged<'_>> =
        proof.sets.iter().filter(|s| worth(&s.truth)).map(ProvenSet::judged).collect();
    scores(&sets).learnt.into_iter().collect()
}

pub(super) fn level_badge(reached: Option<Level>) -> Markup {
    let (class, word) = match reached {
        None => ("none", "not measured"),
        Some(Level::Neither) => ("bad", "missed"),
        Some(Level::Good) => ("good", "good"),
        Some(Level::Extraordinary) => ("best", "extraordinary"),
    };
    html! { span class={ "badge " (class) } { (word) } }
}

/// Every mark with its figure.
pub(super) fn table(goals: &[Goal]) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "Figure" } th.n { "Value" } th.n { "k of n" } th.n { "95 % interval" }
                th.n { "Good" } th.n { "Extraordinary" } th { "Reached" }
            } }
            tbody { @for goal in goals { (row(goal)) } }
        } }
    }
}

fn row(goal: &Goal) -> Markup {
    let share = goal.share;
    let number = |v: f64| if share { percent(v) } else { ratio(v) };
    html! {
        tr {
            td { (goal.what) }
            td.n { (goal.value.map_or(ABSENT.into(), number)) }
            td.n { (goal.rate.map_or(ABSENT.into(), |r| of(&r))) }
            td.n { (goal.rate.map_or(ABSENT.into(), |r| percents(r.interval))) }
            td.n { (goal.good.map_or(ABSENT.into(), |b| b.words(share))) }
            td.n { (goal.extraordinary.words(share)) }
            td { (level_badge(goal.reached())) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_reached_on_its_border_and_nothing_measured_is_not_a_miss() {
        let goal = |value| figure("x", value, most(0.15), Bound::AtMost(0.07));
        assert_eq!(goal(Some(0.07)).reached(), Some(Level::Extraordinary));
        assert_eq!(goal(Some(0.15)).reached(), Some(Level::Good));
        assert_eq!(goal(Some(0.16)).reached(), Some(Level::Neither));
        assert_eq!(goal(None).reached(), None);
        let rate = Rate::of((0..9).map(|i| i == 0));
        let alarm = share("x", rate, most(0.05), Bound::AtMost(0.02));
        assert_eq!(
            alarm.in_words(),
            "1 of 9, which is 11 % (95 % interval 0.3 to 48 %); asked for: ≤ 5 %"
        );
    }
}
