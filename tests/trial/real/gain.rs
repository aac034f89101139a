//! What who knows a cause gains by it on a real recording, nats, and the strength for a gain.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::change::Graft;
use super::full::{Full, area};
use super::scene::{Camera, Scene};
use kinoise::plane::NormalEquations;

/// Pixels are looked at so far apart, px: every cause is wider.
const APART: usize = 5;

/// What one cause does to the chosen views.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gain {
    /// From errors of the mean, after a plane is fitted to each view, and from more noise: as if the
    /// error were the same over the area in which the sensor's noise hangs together.
    pub nats: f64,
    /// Share of the target's pixels that get no answer.
    pub lost: f64,
}

pub(super) fn gain(graft: &Graft, full: &Full, camera: &Camera<'_>, views: &[usize]) -> Gain {
    let areas = ["bias", "variance"].map(|statistic| area(&full.model, statistic));
    let each: Vec<(Gain, f64)> =
        views.par_iter().map(|&k| of_view(graft, full, camera, k, areas)).collect();
    let looked: f64 = each.iter().map(|e| e.1).sum();
    Gain {
        nats: each.iter().map(|e| e.0.nats).sum(),
        lost: each.iter().map(|e| e.0.lost).sum::<f64>() / looked.max(1.0),
    }
}

fn of_view(
    graft: &Graft,
    full: &Full,
    camera: &Camera<'_>,
    k: usize,
    [mean_area, variance_area]: [f64; 2],
) -> (Gain, f64) {
    let seen = &full.seen[k];
    let scene = Scene::new(camera, seen.plane, session_s(full, k));
    let width = camera.sensor.camera.width;
    let mut off = NormalEquations::default();
    let mut looked = 0.0;
    let (mut noisier, mut lost, mut row) = (0.0, 0.0, Vec::new());
    for &i in &seen.pixels {
        let i = i as usize;
        if !(i % width).is_multiple_of(APART) || !(i / width).is_multiple_of(APART) {
            continue;
        }
        let site = scene.site(i, None);
        let there = graft.there(&scene, &site);
        let [_, sigma] = scene.expected(i, &site, &mut row);
        let r2 = there.spread.max(1.0).powi(2) + (there.tremble / sigma).powi(2);
        noisier += 0.5 * (r2 - 1.0 - r2.ln());
        lost += there.loss;
        off.add(&(Vector3::new(site.x, site.y, 1.0) / sigma), there.shift / sigma, 1.0);
        looked += 1.0;
    }
    let each = (APART * APART * full.recording.views[k].depth.len()) as f64;
    let nats = each * (0.5 * off.left() / mean_area + noisier / variance_area);
    (Gain { nats, lost }, looked)
}

/// Since the recording began, s.
pub(super) fn session_s(full: &Full, k: usize) -> f64 {
    let stamps = |k: usize| full.recording.views[k].depth.iter().map(|f| f.timestamp);
    let begin = (0..full.recording.views.len()).flat_map(stamps).fold(f64::INFINITY, f64::min);
    stamps(k).next().map_or(0.0, |t| t - begin)
}

const WEAKEST: f64 = 0.01;
const STRONGEST: f64 = 8.0;

/// The strength at which a cause that grows with it gains `nats`, or the nearest there is.
pub(super) fn strength_for(nats: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (WEAKEST.ln(), STRONGEST.ln());
    for _ in 0..14 {
        let middle = 0.5 * (low + high);
        if of(middle.exp()) < nats {
            low = middle;
        } else {
            high = middle;
        }
    }
    (0.5 * (low + high)).exp()
}
