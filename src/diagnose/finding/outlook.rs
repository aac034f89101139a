//! The views that a sensor could take, as the search would see them.

use std::sync::Arc;

use nalgebra::Vector3;

use super::scene::Scene;
use crate::camera::{Camera, Rays};
use crate::diagnose::missing::shapes::Step;
use crate::diagnose::views::samples::ViewData;
use crate::diagnose::views::surveyed_view::{MEAN_PRECISION, SurveyedView, mean_nuisance};
use crate::model::SigmaModel;
use crate::plane::{MIN_PIXELS, Plane};
use crate::scene::TargetFrame;
use crate::stats::median;
use crate::terms::{Extent, PixelContext, Pixels, Statistic};

/// Poses of a board: distances, m, and tilts, degrees.
const Z_M: [f64; 12] = [0.6, 0.8, 1.0, 1.2, 1.5, 1.8, 2.1, 2.5, 2.9, 3.3, 3.7, 4.0];
const TILTS_DEG: [f64; 7] = [0.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0];
/// Directions, 45 degrees apart.
const AZIMUTHS: u32 = 8;
/// Number of patches across the picture.
const ACROSS: usize = 32;
/// Farthest depth that is measured, m.
const FARTHEST_M: f64 = 8.0;

/// Time, temperature and ambient light of the last of these views. Where the last does not state one, the
/// latest known value is taken.
fn last_conditions(views: &[SurveyedView]) -> PixelContext {
    let mut all: Vec<&PixelContext> = views.iter().filter_map(|v| v.places.first()).collect();
    all.sort_by(|a, b| a.session_s.total_cmp(&b.session_s));
    let last = |of: fn(&PixelContext) -> f64| {
        all.iter().rev().map(|p| of(p)).find(|x| *x != 0.0).unwrap_or(0.0)
    };
    PixelContext {
        session_s: last(|p| p.session_s),
        temperature_c: last(|p| p.temperature_c),
        ambient: last(|p| p.ambient),
        ..PixelContext::default()
    }
}

/// A sensor that could take a view, and the weight of such a view.
pub struct Outlook<'a> {
    pub statistic: Statistic,
    pub camera: &'a Camera,
    pub rays: &'a Rays,
    pub scale_px_m: f64,
    pub sigma: &'a SigmaModel,
    /// Extent of the target in use: the next view has no larger one.
    pub reach: &'a Extent,
    /// Least distance of the views' places from the target's edge, px.
    pub rim_px: f64,
    /// Latest conditions of the room and the sensor.
    pub last: PixelContext,
    /// Losses of depth: which share, and where.
    pub lost: &'a [Step],
    /// Weight of a pixel of a centred target. For the mean it is divided by the pixel's variance.
    pub worth: f64,
    /// Prior precision of a view's own level or plane, as in the recording's views.
    pub precision: Vec<f64>,
}

/// Poses: distance, m, tilt and azimuth, rad.
pub fn poses() -> Vec<(f64, f64, f64)> {
    let mut all = Vec::new();
    for z in Z_M {
        for tilt in TILTS_DEG {
            // A frontal target has no direction of tilt.
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
    pub fn view(&self, plane: &Plane) -> Option<ViewData> {
        let (data, measured) = self.look(plane);
        let enough = data.places.len() > MIN_PATCHES && measured > MIN_PIXELS as f64;
        enough.then_some(data)
    }

    /// Same however little is seen, with the number of measured pixels.
    fn look(&self, plane: &Plane) -> (ViewData, f64) {
        let side = self.camera.width.div_ceil(ACROSS).max(1);
        let pixels = Pixels::new(self.camera, self.rays, self.scale_px_m);
        let centre = Vector3::new(0.0, 0.0, plane.depth(0.0, 0.0));
        let board = TargetFrame::on(plane, centre);
        let mut data = ViewData { precision: self.precision.clone(), ..ViewData::default() };
        let mut measured = 0.0;
        for v in (side / 2..self.camera.height).step_by(side) {
            for u in (side / 2..self.camera.width).step_by(side) {
                let Some(place) = self.place(plane, &board, &pixels, [u, v]) else { continue };
                let kept: f64 = self.lost.iter().map(|s| 1.0 - s.loss(s.at(&place), 0.0)).product();
                let seen = kept * (side * side) as f64;
                measured += seen;
                let weight = self.worth * seen;
                if self.statistic == Statistic::Bias {
                    data.weight.push(weight / place.variance);
                    data.nuisance.extend(mean_nuisance(&place));
                } else {
                    data.weight.push(weight);
                    data.nuisance.push(1.0);
                }
                data.response.push(0.0);
                Arc::make_mut(&mut data.places).push(place);
            }
        }
        (data, measured)
    }

    /// Place of a pixel on the target; `None` off the target or where no depth is measured.
    fn place(
        &self,
        plane: &Plane,
        board: &TargetFrame,
        pixels: &Pixels<'_>,
        [u, v]: [usize; 2],
    ) -> Option<PixelContext> {
        let mut place = pixels.place(v * self.camera.width + u);
        let z = plane.depth(place.x, place.y);
        if !(z > 0.0 && z < FARTHEST_M) {
            return None;
        }
        place.at_disparity(self.scale_px_m / z, self.scale_px_m);
        place.lean_on(plane, pixels);
        let point = Vector3::new(place.x, place.y, 1.0) * z;
        (place.right, place.down) = board.place(&point);
        let within = |x: f64, [low, high]: [f64; 2]| x >= low && x <= high;
        if !within(place.right, self.reach.right) || !within(place.down, self.reach.down) {
            return None;
        }
        place.edge = (self.rim_px + self.edge_px(&place, &point, board)).min(self.reach.edge);
        let sigma_px = self.sigma.axial_sigma(z, place.theta) * self.scale_px_m / (z * z);
        place.variance = sigma_px * sigma_px;
        let PixelContext { session_s, temperature_c, ambient, .. } = self.last;
        Some(PixelContext { session_s, temperature_c, ambient, ..place })
    }

    /// Distance from a point of the target, along its sides, to the nearest of its edges inside the
    /// picture, px; the picture's own border does not count.
    fn edge_px(&self, place: &PixelContext, point: &Vector3<f64>, board: &TargetFrame) -> f64 {
        let (camera, [left, right]) = (self.camera, self.reach.right);
        let [top, bottom] = self.reach.down;
        let to_edge = |way: f64, along: &Vector3<f64>| {
            let p = point + along * way;
            let (u, v) = camera.project(p.x / p.z, p.y / p.z);
            let (width, height) = (camera.width as f64, camera.height as f64);
            let seen = p.z > 0.0 && (0.0..width).contains(&u) && (0.0..height).contains(&v);
            if seen { (u - place.u).hypot(v - place.v) } else { f64::INFINITY }
        };
        let sides = [left, right].map(|x| to_edge(x - place.right, &board.right));
        let ends = [top, bottom].map(|y| to_edge(y - place.down, &board.down));
        sides.into_iter().chain(ends).fold(f64::INFINITY, f64::min)
    }
}

/// More patches than this are needed for a plane.
const MIN_PATCHES: usize = 12;

/// Outlook on another view of a layer; `None` where no view gives the weight of a pixel.
pub fn outlook<'a>(
    scene: &'a Scene<'_>,
    sigma: &'a SigmaModel,
    camera: &'a Camera,
    rays: &'a Rays,
    lost: &'a [Step],
) -> Option<Outlook<'a>> {
    let views = &scene.survey.views;
    let places = views.iter().flat_map(|v| v.places.iter());
    // The view's own nuisances only: planning ignores the scatter of known terms.
    let own = if scene.statistic == Statistic::Bias { MEAN_PRECISION.len() } else { 1 };
    let mut outlook = Outlook {
        statistic: scene.statistic,
        camera,
        rays,
        scale_px_m: scene.scale_px_m,
        sigma,
        reach: &scene.survey.reach,
        rim_px: places.map(|p| p.edge).fold(f64::INFINITY, f64::min),
        last: last_conditions(views),
        lost: &[],
        worth: 1.0,
        precision: scene.data.first()?.precision[..own].to_vec(),
    };
    // A pixel's weight in the existing views: their weight over that expected from their poses. The target is
    // not always centred, and not all of it is used. The median takes care of losses in some of them.
    let worth = |view: &ViewData| {
        let at = view.places.first()?;
        let z = view.places.iter().map(|p| p.z).sum::<f64>() / view.places.len() as f64;
        let (seen, _) = outlook.look(&Plane::tilted(z, at.theta, at.azimuth));
        let [taken, expected] = [view, &seen].map(|v| v.weight.iter().sum::<f64>());
        (taken > 0.0 && expected > 0.0).then_some(taken / expected)
    };
    let mut worths: Vec<f64> = scene.data.iter().filter_map(worth).collect();
    if worths.is_empty() {
        return None;
    }
    outlook.worth = median(&mut worths);
    outlook.lost = lost;
    Some(outlook)
}
