//! Which view would tell two causes apart that these views confuse.
//!
//! With the best cause's coefficients beta and its columns G, the rival's columns R fitted freely
//! (one set for all views) and every view's own plane or level projected out, the two causes are
//! sqrt(beta' (A_gg - A_gr A_rr^-1 A_rg) beta) standard errors apart, A the views' summed normal
//! equations. A view more adds its own normal equations; the best one makes the most of that.

use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use super::scene::Scene;
use crate::camera::{Camera, Rays};
use crate::diagnose::diagnosis::{Finding, NextView};
use crate::diagnose::search::evidence::Evidence;
use crate::diagnose::search::outcome::{Chosen, Outcome};
use crate::diagnose::search::prepared::evidence_of;
use crate::diagnose::views::samples::ViewData;
use crate::model::SigmaModel;
use crate::plane::Plane;
use crate::scene::TargetFrame;
use crate::terms::{Extent, Pixels, Statistic, Term};

/// A name this probable needs no further view.
const SURE: f64 = 0.9;
/// Where a board is held: distances, m, and tilts, degrees.
const Z_M: [f64; 12] = [0.6, 0.8, 1.0, 1.2, 1.5, 1.8, 2.1, 2.5, 2.9, 3.3, 3.7, 4.0];
const TILTS_DEG: [f64; 7] = [0.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0];
/// Directions, quarters of a right angle times two: along, across and oblique.
const AZIMUTHS: u32 = 8;
/// The picture is looked at in so many patches across.
const ACROSS: usize = 32;
/// Beyond this no depth comes back, m.
const FARTHEST_M: f64 = 8.0;

/// A sensor that could take a view, and what a view of its is worth.
pub struct Outlook<'a> {
    pub statistic: Statistic,
    pub camera: &'a Camera,
    pub rays: &'a Rays,
    pub scale_px_m: f64,
    pub sigma: &'a SigmaModel,
    /// Extent of the target in use: the next view has no larger one.
    pub reach: &'a Extent,
    /// Weight of a pixel: over its variance for the mean, as it is for the variance.
    pub worth: f64,
    /// Of a view's own level or plane, as the recording's views have it.
    pub precision: Vec<f64>,
}

/// A pose and how far apart, in standard errors, the causes would be with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prospect {
    pub z_m: f64,
    pub theta_rad: f64,
    pub azimuth_rad: f64,
    pub separation: f64,
}

/// How far apart two causes are on the views taken, and on these and one of the candidates.
pub struct Prospects {
    pub now: f64,
    pub views: Vec<Prospect>,
}

impl Prospects {
    pub fn best(&self) -> Option<&Prospect> {
        self.views.iter().max_by(|a, b| a.separation.total_cmp(&b.separation))
    }
}

/// `best` with its coefficients against `rival`, whose coefficients are free.
pub fn prospects(
    taken: &[ViewData],
    best: &Term,
    rival: &Term,
    outlook: &Outlook<'_>,
) -> Prospects {
    let pair = [best.clone(), rival.clone()];
    let k = best.basis.count();
    let beta = DVector::from_column_slice(&best.coefficients);
    let n = k + rival.basis.count();
    let sum =
        evidence_of(taken, &pair).iter().fold(DMatrix::zeros(n, n), |sum, e: &Evidence| sum + &e.a);
    let views = poses()
        .into_par_iter()
        .filter_map(|(z_m, theta_rad, azimuth_rad)| {
            let view = outlook.view(&Plane::tilted(z_m, theta_rad, azimuth_rad))?;
            let more = evidence_of(std::slice::from_ref(&view), &pair);
            let separation = apart(&(&sum + &more.first()?.a), &beta);
            Some(Prospect { z_m, theta_rad, azimuth_rad, separation })
        })
        .collect();
    Prospects { now: apart(&sum, &beta), views }
}

/// Standard errors between the first columns with `beta` and the best that the rest can do.
fn apart(a: &DMatrix<f64>, beta: &DVector<f64>) -> f64 {
    let k = beta.len();
    let r = a.nrows() - k;
    let own = a.view((0, 0), (k, k));
    let cross = a.view((k, 0), (r, k)) * beta;
    let mut rival = a.view((k, k), (r, r)).into_owned();
    // Columns that say nothing must not divide by nothing.
    let floor = 1e-9 * rival.diagonal().max().max(f64::MIN_POSITIVE);
    for j in 0..r {
        rival[(j, j)] += floor;
    }
    let absorbed = rival.cholesky().map_or(0.0, |c| cross.dot(&c.solve(&cross)));
    (beta.dot(&(own * beta)) - absorbed).max(0.0).sqrt()
}

fn poses() -> Vec<(f64, f64, f64)> {
    let mut all = Vec::new();
    for z in Z_M {
        for tilt in TILTS_DEG {
            // Facing the target there is no direction.
            let directions = if tilt == 0.0 { 1 } else { AZIMUTHS };
            for k in 0..directions {
                all.push((z, tilt.to_radians(), f64::from(k) * std::f64::consts::FRAC_PI_4));
            }
        }
    }
    all
}

impl Outlook<'_> {
    /// A view of the target, its middle on the optical axis; `None` when too little is seen.
    fn view(&self, plane: &Plane) -> Option<ViewData> {
        let side = self.camera.width.div_ceil(ACROSS).max(1);
        let pixels = Pixels::new(self.camera, self.rays, self.scale_px_m);
        let centre = Vector3::new(0.0, 0.0, plane.depth(0.0, 0.0));
        let board = TargetFrame::on(plane, centre);
        let within = |x: f64, [low, high]: [f64; 2]| x >= low && x <= high;
        let mut data = ViewData { precision: self.precision.clone(), ..ViewData::default() };
        for v in (side / 2..self.camera.height).step_by(side) {
            for u in (side / 2..self.camera.width).step_by(side) {
                let mut place = pixels.place(v * self.camera.width + u);
                let z = plane.depth(place.x, place.y);
                if !(z > 0.0 && z < FARTHEST_M) {
                    continue;
                }
                place.at_disparity(self.scale_px_m / z, self.scale_px_m);
                place.lean_on(plane, &pixels);
                let point = Vector3::new(place.x, place.y, 1.0) * z;
                (place.right, place.down) = board.place(&point);
                let on =
                    within(place.right, self.reach.right) && within(place.down, self.reach.down);
                if !on {
                    continue;
                }
                place.edge = self.reach.edge;
                let sigma_px = self.sigma.axial_sigma(z, place.theta) * self.scale_px_m / (z * z);
                place.variance = sigma_px * sigma_px;
                let weight = self.worth * (side * side) as f64;
                if self.statistic == Statistic::Bias {
                    data.weight.push(weight / place.variance);
                    data.nuisance.extend([1.0, place.x, place.y]);
                } else {
                    data.weight.push(weight);
                    data.nuisance.push(1.0);
                }
                data.response.push(0.0);
                data.places.push(place);
            }
        }
        (data.places.len() > FEWEST_PATCHES).then_some(data)
    }
}

/// Fewer carry no plane.
const FEWEST_PATCHES: usize = 12;

/// What all views of a layer have in common when another is taken.
pub fn outlook<'a>(
    scene: &'a Scene<'_>,
    sigma: &'a SigmaModel,
    camera: &'a Camera,
    rays: &'a Rays,
) -> Option<Outlook<'a>> {
    let bias = scene.statistic == Statistic::Bias;
    // A pixel's weight in the views there are: theirs over their patches' areas.
    let worth = |(n, view): (usize, &ViewData)| {
        let surveyed = scene.survey.views.get(n)?;
        let pixels: f64 = surveyed.tiles.iter().map(|t| t.pixels).sum();
        let weight: f64 = view
            .weight
            .iter()
            .zip(&view.places)
            .map(|(w, p)| if bias { w * p.variance } else { *w })
            .sum();
        let each = (weight / pixels.max(1.0)) as f32;
        (each > 0.0).then_some(each)
    };
    let mut worths: Vec<f32> = scene.data.iter().enumerate().filter_map(worth).collect();
    if worths.is_empty() {
        return None;
    }
    // Of the view's own nuisances; how known terms scatter is nothing to plan by.
    let own = if scene.statistic == Statistic::Bias { 3 } else { 1 };
    Some(Outlook {
        statistic: scene.statistic,
        camera,
        rays,
        scale_px_m: scene.scale_px_m,
        sigma,
        reach: &scene.survey.reach,
        worth: f64::from(crate::stats::median_in_place(&mut worths)),
        precision: scene.data.first()?.precision[..own].to_vec(),
    })
}

/// Give advice to every finding of the layer that is not sure of its name.
pub fn advise(found: &mut [Finding], scene: &Scene<'_>, outcome: &Outcome, outlook: &Outlook<'_>) {
    for finding in found.iter_mut().filter(|f| f.statistic == scene.statistic) {
        let sure = finding.alternatives.first().and_then(|a| a.probability).unwrap_or(0.0);
        let runner_up =
            finding.alternatives.iter().map(|a| a.effect).find(|e| Some(*e) != finding.effect);
        let (Some(name), Some(runner_up), true) = (finding.effect, runner_up, sure < SURE) else {
            continue;
        };
        let mine = |c: &&Chosen| c.candidate.family == Some(name);
        let rival = outcome
            .chosen
            .iter()
            .find(mine)
            .and_then(|c| c.rivals.iter().find(|r| r.family == runner_up));
        let (Some(best), Some(rival)) = (finding.terms.first(), rival) else { continue };
        let rival = Term {
            statistic: scene.statistic,
            basis: rival.basis.clone(),
            coefficients: vec![0.0; rival.basis.count()],
        };
        let all = prospects(&scene.data, best, &rival, outlook);
        finding.next_view = all.best().map(|p| report(p, all.now, name, runner_up));
    }
}

/// Apart by less than this two causes are not.
const APART: f64 = 2.0;

fn report(view: &Prospect, now: f64, best: &str, rival: &str) -> NextView {
    let then = view.separation;
    let verdict = if then < APART {
        "no single view tells them apart, this one helps most"
    } else if now < APART {
        "these views hardly tell them apart"
    } else {
        "it settles between the two best names"
    };
    NextView {
        z_m: view.z_m,
        theta_rad: view.theta_rad,
        azimuth_rad: view.azimuth_rad,
        separation_now: now,
        separation_then: then,
        why: format!(
            "{best} and {rival} differ most there: {now:.1} standard errors apart as it is, {then:.1} expected with this view; {verdict}"
        ),
    }
}

#[cfg(test)]
#[path = "next_view_tests.rs"]
mod tests;
