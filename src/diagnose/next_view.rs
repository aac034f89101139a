//! Which view would tell two causes apart that these views confuse.
//!
//! With the best cause's coefficients beta and its columns G, the rival's columns R fitted freely
//! (one set for all views) and every view's own plane or level projected out, the two causes are
//! sqrt(beta' (A_gg - A_gr A_rr^-1 A_rg) beta) standard errors apart, A the views' summed normal
//! equations. A view more adds its own normal equations; the best one makes the most of that.

use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use super::diagnosis::{Finding, NextView};
use super::evidence::Evidence;
use super::findings::Scene;
use super::search::{Chosen, Outcome, ViewData, evidence_of};
use crate::camera::{Camera, Rays};
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
        let mut data = ViewData {
            gathered: Vec::new(),
            places: Vec::new(),
            response: Vec::new(),
            weight: Vec::new(),
            nuisance: Vec::new(),
            precision: self.precision.clone(),
        };
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
    Some(Outlook {
        statistic: scene.statistic,
        camera,
        rays,
        scale_px_m: scene.scale_px_m,
        sigma,
        reach: &scene.survey.reach,
        worth: f64::from(crate::stats::median_in_place(&mut worths)),
        precision: scene.data.first()?.precision.clone(),
    })
}

/// Give advice to every finding of the layer that is not sure of its name.
pub fn advise(found: &mut [Finding], scene: &Scene<'_>, outcome: &Outcome, outlook: &Outlook<'_>) {
    for finding in found.iter_mut().filter(|f| f.statistic == scene.statistic) {
        let sure = finding.alternatives.first().map_or(0.0, |a| a.probability);
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
        finding.next_view = all.best().map(|p| told(p, all.now, name, runner_up));
    }
}

/// Apart by less than this two causes are not.
const APART: f64 = 2.0;

fn told(view: &Prospect, now: f64, best: &str, rival: &str) -> NextView {
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
mod tests {
    use super::*;
    use crate::model::{Domain, Form, PAPER_EQ1};
    use crate::simulate::kinect_v1;
    use crate::terms::{Basis, Coordinate, Modulation, PixelContext};

    fn sigma() -> SigmaModel {
        let domain = Domain { z_m: [0.3, 9.0], theta_rad: [0.0, 1.3] };
        SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
    }

    /// Of a target of this size, m.
    fn reach([width, height]: [f64; 2]) -> Extent {
        let none = [0.0, 0.0];
        Extent {
            disparity: none,
            z: none,
            theta: none,
            right: [-0.5 * width, 0.5 * width],
            down: [-0.5 * height, 0.5 * height],
            session: none,
            temperature: none,
            light: none,
            ambient: none,
            edge: 100.0,
        }
    }

    fn term(basis: Basis, coefficients: Vec<f64>) -> Term {
        Term { statistic: Statistic::Bias, basis, coefficients }
    }

    const WALL_M: [f64; 2] = [20.0, 20.0];
    const BOARD_M: [f64; 2] = [1.0, 0.8];

    /// Frontal views, and what is asked of another.
    fn confused(best: &Term, rival: &Term, size: [f64; 2]) -> (Prospects, Prospects) {
        let sensor = kinect_v1(4);
        let (camera, rays, sigma, reach) =
            (&sensor.camera, sensor.camera.rays(), sigma(), reach(size));
        let outlook = Outlook {
            statistic: Statistic::Bias,
            camera,
            rays: &rays,
            scale_px_m: sensor.disparity_px_m().unwrap(),
            sigma: &sigma,
            reach: &reach,
            worth: 0.02,
            precision: vec![0.0; 3],
        };
        let frontal: Vec<ViewData> =
            [0.9, 1.3].iter().filter_map(|&z| outlook.view(&Plane::tilted(z, 0.0, 0.0))).collect();
        assert!(frontal[0].places.iter().all(|p: &PixelContext| p.z > 0.0));
        let there = prospects(&frontal, best, rival, &outlook);
        let alone = prospects(&[], best, rival, &outlook);
        (there, alone)
    }

    /// What frontal views cannot tell: a bowl that stands still in the picture, and one that goes
    /// with the ray's angle to the surface, which is the same bowl while the target is faced.
    #[test]
    fn a_bowl_and_the_angle_of_incidence_ask_for_a_tilted_view() {
        let bowl =
            term(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), vec![0.2]);
        let incidence =
            term(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(1.0)), vec![0.0; 2]);
        let lens = term(
            Basis::powers(
                Coordinate::RaySquared,
                1,
                Modulation::RadialSlope { fx: 145.0, fy: 145.0 },
            ),
            vec![0.05],
        );
        let (there, _) = confused(&bowl, &incidence, WALL_M);
        let best = there.best().unwrap();
        assert!(best.separation > 2.0 * there.now, "{} {best:?}", there.now);
        // A lens shows on tilted planes alone.
        let (there, _) = confused(&lens, &bowl, WALL_M);
        let best = there.best().unwrap();
        assert!(there.now < 1e-6 && best.separation > 2.0, "{} {best:?}", there.now);
        assert!(best.theta_rad > 0.4, "{best:?}");
    }

    #[test]
    fn the_advised_view_separates_more_than_most() {
        let bow = term(Basis::relief(2), vec![0.02, 0.02, 0.0]);
        let bowl =
            term(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(0.0)), vec![0.0; 2]);
        for (best, rival) in [(&bow, &bowl), (&bowl_of(0.2), &bow)] {
            let (there, alone) = confused(best, rival, BOARD_M);
            let mut all: Vec<f32> = there.views.iter().map(|p| p.separation as f32).collect();
            let median = f64::from(crate::stats::median_in_place(&mut all));
            let most = there.best().unwrap();
            assert!(most.separation > 1.2 * median, "{} {median} {most:?}", there.now);
            assert!(there.views.iter().all(|p| p.separation >= there.now - 1e-6));
            // Views taken hold the rival down: the same view alone tells less.
            assert!(alone.best().unwrap().separation <= most.separation + 1e-6);
        }
    }

    /// Of a small board far away little is left in the picture: what a wall would tell there, it
    /// cannot.
    #[test]
    fn a_small_board_is_asked_for_near_by() {
        let bowl = bowl_of(0.2);
        let incidence =
            term(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(1.0)), vec![0.0; 2]);
        let [wall, board] =
            [WALL_M, [0.6, 0.5]].map(|size| confused(&bowl, &incidence, size).0.best().copied());
        let (wall, board) = (wall.unwrap(), board.unwrap());
        assert!(board.separation < wall.separation && board.z_m <= wall.z_m, "{wall:?} {board:?}");
    }

    fn bowl_of(k: f64) -> Term {
        term(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), vec![k])
    }
}
