//! Weights and nuisances of a view without noise.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::views::blocks::{BLOCK_TILES, blocks};
use crate::diagnose::views::tiles::SIDE;
use crate::plane::Plane;
use crate::rng::Seed;
use crate::simulate::kinect_v1;
use crate::terms::{Basis, Coordinate, Modulation};

/// A tilted wall seen by a sensor of Eq. 1 whose noise is Gaussian in depth; the means are noise-free.
fn view() -> SurveyedView {
    let sensor = kinect_v1(1);
    let (camera, scale) = (&sensor.camera, 43.5);
    let plane = Plane::tilted(3.5, 1.0, 0.7);
    let mut patches = Vec::new();
    for v in (SIDE / 2..camera.height).step_by(SIDE) {
        for u in (SIDE / 2..camera.width).step_by(SIDE) {
            let (u, v) = (u as f64, v as f64);
            let (x, y) = camera.ray(u, v);
            let z = plane.depth(x, y);
            if !(0.5..8.0).contains(&z) {
                continue;
            }
            let (disparity, sigma_m) = (scale / z, 0.0015 + 0.00215 * (z - 0.483).powi(2));
            let variance = (sigma_m * disparity / z).powi(2);
            let (side, radius) = (SIDE as f64, x.hypot(y));
            let own = PixelContext {
                u,
                v,
                x,
                y,
                z,
                disparity,
                variance,
                side,
                radius,
                ..Default::default()
            };
            let mean = disparity * (sigma_m / z).powi(2);
            // Thirty frames.
            let noise = Tile::of_noise(variance, 30.0 * side * side);
            patches.push((own, Tile { mean, ..noise }));
        }
    }
    SurveyedView::white(patches, 30.0)
}

/// Halving sigma in a refit leaves a view's weight unchanged. An inflation raised threefold by an effect
/// missing from the model does not lower it.
#[test]
fn a_view_keeps_its_weight_whatever_sigma_is() {
    let first = view();
    let near = Correlation { sum: 3.0, ..Correlation::white() };
    let weights = (first.whole_weight(), near.clone());
    let mut refitted = view();
    refitted.tiles_mut().for_each(|(_, tile)| tile.variance /= 4.0);
    refitted.inflation *= 4.0;
    refitted.weigh_more(weights.clone());
    assert_eq!(refitted.inflation, 4.0 * first.inflation);
    assert_eq!(refitted.correlation, Correlation::white());
    refitted.inflation *= 3.0;
    refitted.weigh_more(weights);
    assert_eq!(refitted.correlation, near);
    approx::assert_relative_eq!(
        refitted.whole_weight(),
        first.whole_weight(),
        max_relative = 1e-12
    );
}

/// Noise with another named cause changes the log variance that is left, not the weights of the means.
#[test]
fn what_the_noise_is_held_against_does_not_weigh_the_means() {
    let first = view();
    let mut held = view();
    held.tiles_mut().for_each(|(_, tile)| tile.noise_variance *= 2.0);
    assert_eq!(mean_data(&held).weight, mean_data(&first).weight);
    let [before, after] = [&first, &held].map(|v| blocks(v, BLOCK_TILES, false, None).response);
    assert!(!before.is_empty());
    for (before, after) in before.iter().zip(&after) {
        approx::assert_relative_eq!(before - after, 2f64.ln(), epsilon = 1e-12);
    }
}

/// Twice the model's variance in four frames, and a tile outside the model's domain.
#[test]
fn frames_tell_the_noise_where_the_model_says_something() {
    let mut view = SurveyedView { between_frame_factor: Some(4.0 / 3.0), ..view() };
    view.tiles_mut().for_each(|(_, t)| t.temporal = 0.75 * 2.0 * t.variance);
    view.tiles_mut().take(1).for_each(|(_, t)| t.temporal = f64::NAN);
    approx::assert_relative_eq!(view.noise_by_frames().expect("noise"), 2.0, epsilon = 1e-9);
    view.between_frame_factor = None;
    assert_eq!(view.noise_by_frames(), None);
}

/// With planes alone it looks like a bowl: a nat in each view, and views add up.
#[test]
fn noise_that_is_gaussian_in_the_depth_is_no_bowl() {
    let data = mean_data(&view());
    let bowl = Basis::powers(Coordinate::RadiusSquared, 2, Modulation::One);
    let nats = |data: &ViewData| {
        let rows = data.rows(&data.response).expect("nuisances that can be told apart");
        let seen = rows.evidence(&bowl, &data.places);
        0.5 * seen.b.dot(&(seen.a.try_inverse().expect("two columns") * &seen.b))
    };
    let planes = ViewData {
        nuisance: data.nuisance.chunks_exact(4).flat_map(|n| n[..3].to_vec()).collect(),
        precision: vec![0.0; 3],
        ..data.clone()
    };
    // The mean disparity of simulated Gaussian depths is too large by the same amount.
    let mut rng = Seed(1).stream("mean-off");
    let (z, sigma_m, mut sum) = (4.0, 0.2, 0.0);
    for _ in 0..200_000 {
        let normal: f64 = StandardNormal.sample(&mut rng);
        let both = [normal, -normal].map(|n| 43.5 / (z + sigma_m * n));
        sum += (both[0] + both[1]) / 400_000.0;
    }
    let (disparity, variance) = (43.5 / z, (43.5 * sigma_m / (z * z)).powi(2));
    let own = PixelContext { z, disparity, variance, ..Default::default() };
    approx::assert_relative_eq!(sum - disparity, mean_off(&own), max_relative = 0.03);
    let (with, without) = (nats(&data), nats(&planes));
    println!("{with:.3} nats, by planes alone {without:.1}");
    assert!(without > 1.0 && with < 0.01, "{with} {without}");
}
