//! Finds the view most likely to settle a name that these views leave in doubt, among the poses at which
//! the causes are farthest apart.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::contest::{Contest, SURE};
use super::outlook::{Outlook, poses};
use super::scene::Scene;
use crate::diagnose::diagnosis::{Finding, NextView, Status};
use crate::diagnose::search::outcome::{Chosen, Outcome};
use crate::diagnose::search::prepared::evidence_of_bases;
use crate::plane::Plane;
use crate::rng::Seed;

/// Number of poses that are simulated.
const CLOSELY: usize = 12;

/// Prospects of a view at the poses where the causes are farthest apart, best first.
fn prospects(contest: &Contest<'_>, outlook: &Outlook<'_>, seed: Seed) -> Vec<NextView> {
    let separation_now = contest.separation(&contest.information);
    let pose = |(z_m, theta_rad, azimuth_rad)| {
        let view = outlook.view(&Plane::tilted(z_m, theta_rad, azimuth_rad))?;
        let a = evidence_of_bases(&[view], &contest.bases).pop()?.a;
        let with = &contest.information + &a;
        let separation_then = contest.separation(&with);
        let (chance, why) = (0.0, String::new());
        let view =
            NextView { z_m, theta_rad, azimuth_rad, separation_now, separation_then, chance, why };
        // Squared standard errors between two causes, over all pairs.
        Some((contest.all_apart(&with), view, a))
    };
    let mut all: Vec<_> = poses().into_par_iter().filter_map(pose).collect();
    all.sort_by(|x, y| y.0.total_cmp(&x.0));
    all.truncate(CLOSELY);
    let closely = |(_, mut view, a): (f64, NextView, DMatrix<f64>)| {
        view.chance = contest.chance(&a, seed.stream("diagnose/next-view"));
        (view, a)
    };
    let mut all: Vec<_> = all.into_par_iter().map(closely).collect();
    all.sort_by(|x, y| y.0.chance.total_cmp(&x.0.chance));
    // The best of many estimates is biased upwards: its chance is estimated again from other draws.
    if let Some((best, a)) = all.first_mut() {
        best.chance = contest.chance(a, seed.stream("diagnose/next-view/chosen"));
    }
    all.into_iter().map(|(view, _)| view).collect()
}

/// Suggests a view for every finding of the layer whose name is in doubt, where the view is likely to settle
/// it or the finding has several names.
pub fn advise(
    found: &mut [Finding],
    scene: &Scene<'_>,
    outcome: &Outcome,
    outlook: &Outlook<'_>,
    seed: Seed,
) {
    for finding in found.iter_mut().filter(|f| f.statistic == scene.statistic) {
        let sure = finding.alternatives.first().and_then(|a| a.probability).unwrap_or(0.0);
        let Some(name) = finding.effect.filter(|_| sure < SURE) else { continue };
        let of_name = |c: &&Chosen| c.candidate.family == Some(name);
        let Some(chosen) = outcome.chosen.iter().find(of_name) else { continue };
        let views = (scene.statistic, &scene.data[..]);
        let contest = Contest::of(views, outcome, chosen, &finding.alternatives);
        let Some(contest) = contest else { continue };
        let best = prospects(&contest, outlook, seed).into_iter().next();
        let told = |v: &NextView| v.is_likely_to_settle() || finding.status == Status::OneOf;
        finding.next_view = best.map(|view| report(view, &contest)).filter(told);
    }
}

fn report(mut view: NextView, contest: &Contest<'_>) -> NextView {
    let [best, rival] = [contest.names[0].family, contest.names[1].family];
    let percent = 100.0 * view.chance;
    let settles = if view.is_likely_to_settle() {
        format!("it settles the name with a chance of {percent:.0} %")
    } else {
        format!("no single view is likely to settle the name (chance {percent:.0} %)")
    };
    view.why = format!(
        "{best} and {rival} are {:.1} standard errors apart as it is, {:.1} expected with this view; {settles}",
        view.separation_now, view.separation_then
    );
    view
}

#[cfg(test)]
#[path = "next_view_tests.rs"]
mod tests;
