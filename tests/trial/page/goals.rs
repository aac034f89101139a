//! The marks beside the five endpoints: what was hoped for, what came.

use super::goal::{Bound, Goal, figure, least, most, share};
use crate::{
    Cell, Judged, Learnt, OUR_METHOD, Proof, ProvenSet, Rate, World, level, scores, worth,
};

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
    let detected = |nats: f64| {
        let rays = |s: &ProvenSet| {
            let asked = &s.truth.asked;
            let single = matches!(asked.cell, Cell::Single | Cell::Outside);
            single && asked.world == World::Rays && level(&s.truth) == Some(nats)
        };
        among(&proof.sets, rays, |s| s.marks.detected)
    };
    let (five, two) = (most(0.05), AtMost(0.02));
    vec![
        share("False alarms, world of light (S2)", alarms("light/null"), five, two),
        share("False alarms, halves of real recordings (S3)", alarms("real/halves"), five, two),
        share(
            "Single causes by rays worth 15 nats detected",
            detected(15.0),
            least(0.5),
            AtLeast(0.8),
        ),
        share(
            "Single causes by rays worth 50 nats detected",
            detected(50.0),
            least(0.95),
            AtLeast(0.99),
        ),
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
            "Right among the first two names, rays (S1), 50 nats or more, once detected",
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
            "Right among the first two names, light (S2), any size, once detected",
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
            "The advised view, once taken, settles for the right one of the two names in doubt",
            proof.second.as_ref().and_then(|s| s.scores.all.get("settled").copied()),
            least(0.7),
            AtLeast(0.9),
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
        figure("Gain over the oracle’s, 10th percentile of sets", low, None, AtLeast(0.75)),
        figure("Median gain over a Gaussian process’s", over(&median), None, AtLeast(0.95)),
        figure("Parameters over a Gaussian process’s", over(&|l| l.parameters), None, AtMost(0.2)),
    ]
}

/// Gains by method over the sets of the endpoints, whose causes are worth 50 nats or more each.
pub(super) fn learnt_where_it_matters(proof: &Proof) -> Vec<(String, Learnt)> {
    let sets: Vec<Judged<'_>> =
        proof.sets.iter().filter(|s| worth(&s.truth)).map(ProvenSet::judged).collect();
    scores(&sets).learnt.into_iter().collect()
}
