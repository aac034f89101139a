//! The views that a sensor could take, as the search would see them.

use std::sync::Arc;

use nalgebra::Vector3;

use super::scene::Scene;
use crate::camera::{Camera, Rays};
use crate::diagnose::views::samples::ViewData;
use crate::diagnose::views::surveyed_view::{MEAN_PRECISION, mean_nuisance};
use crate::model::SigmaModel;
use crate::plane::Plane;
use crate::scene::TargetFrame;
use crate::terms::{Extent, Pixels, Statistic};

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
                    data.nuisance.extend(mean_nuisance(&place));
                } else {
                    data.weight.push(weight);
                    data.nuisance.push(1.0);
                }
                data.response.push(0.0);
                Arc::make_mut(&mut data.places).push(place);
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
            .zip(view.places.iter())
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
    let own = if bias { MEAN_PRECISION.len() } else { 1 };
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
