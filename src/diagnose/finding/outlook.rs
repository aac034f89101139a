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
use crate::stats::median_in_place;
use crate::terms::{Extent, PixelContext, Pixels, Statistic};

/// Where a board is held: distances, m, and tilts, degrees.
const Z_M: [f64; 12] = [0.6, 0.8, 1.0, 1.2, 1.5, 1.8, 2.1, 2.5, 2.9, 3.3, 3.7, 4.0];
const TILTS_DEG: [f64; 7] = [0.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0];
/// Directions, 45 degrees apart.
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
    /// Places of the views are so far from the target's edge at least, px.
    pub rim_px: f64,
    /// The room and the sensor as they were last: time, temperature and ambient light.
    pub last: PixelContext,
    /// Where no depth comes back.
    pub lost: &'a [Step],
    /// Weight of a pixel: over its variance for the mean, as it is for the variance.
    pub worth: f64,
    /// Of a view's own level or plane, as the recording's views have it.
    pub precision: Vec<f64>,
}

/// Distance, m, tilt and azimuth, rad.
pub fn poses() -> Vec<(f64, f64, f64)> {
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
    pub fn view(&self, plane: &Plane) -> Option<ViewData> {
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
        let enough = data.places.len() > FEWEST_PATCHES && measured > MIN_PIXELS as f64;
        enough.then_some(data)
    }

    /// Where a pixel lies on the target, if it does.
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
        // What a metre along the target is in the picture, px.
        let px_per_m = |along: &Vector3<f64>| {
            let du = self.camera.fx * (along.x - place.x * along.z) / z;
            du.hypot(self.camera.fy * (along.y - place.y * along.z) / z)
        };
        let inside = |x: f64, [low, high]: [f64; 2], along: &Vector3<f64>| {
            (x - low).min(high - x) * px_per_m(along)
        };
        let right = inside(place.right, self.reach.right, &board.right);
        let edge = right.min(inside(place.down, self.reach.down, &board.down));
        if edge < 0.0 {
            return None;
        }
        place.edge = (self.rim_px + edge).min(self.reach.edge);
        let sigma_px = self.sigma.axial_sigma(z, place.theta) * self.scale_px_m / (z * z);
        place.variance = sigma_px * sigma_px;
        let PixelContext { session_s, temperature_c, ambient, .. } = self.last;
        Some(PixelContext { session_s, temperature_c, ambient, ..place })
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
    lost: &'a [Step],
) -> Option<Outlook<'a>> {
    let views = &scene.survey.views;
    let first = |v: &'a SurveyedView| v.places.first();
    let later = |a: &&PixelContext, b: &&PixelContext| a.session_s.total_cmp(&b.session_s);
    let places = views.iter().flat_map(|v| v.places.iter());
    // Of the view's own nuisances; how known terms scatter is nothing to plan by.
    let own = if scene.statistic == Statistic::Bias { MEAN_PRECISION.len() } else { 1 };
    let mut outlook = Outlook {
        statistic: scene.statistic,
        camera,
        rays,
        scale_px_m: scene.scale_px_m,
        sigma,
        reach: &scene.survey.reach,
        rim_px: places.map(|p| p.edge).fold(f64::INFINITY, f64::min),
        last: *views.iter().filter_map(first).max_by(later)?,
        lost,
        worth: 1.0,
        precision: scene.data.first()?.precision[..own].to_vec(),
    };
    // A pixel's weight in the views there are: theirs over what they would weigh by their poses. The
    // target is not always in the middle, and not all of it is used.
    let worth = |view: &ViewData| {
        let at = view.places.first()?;
        let pose = Plane::tilted(at.rho / at.theta.cos(), at.theta, at.azimuth);
        let expected: f64 = outlook.view(&pose)?.weight.iter().sum();
        let worth = (view.weight.iter().sum::<f64>() / expected) as f32;
        (worth > 0.0).then_some(worth)
    };
    let mut worths: Vec<f32> = scene.data.iter().filter_map(worth).collect();
    if worths.is_empty() {
        return None;
    }
    outlook.worth = f64::from(median_in_place(&mut worths));
    Some(outlook)
}
