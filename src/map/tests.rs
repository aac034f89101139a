//! Tests against ground truth: corners with a known motion, and noise of a known size.

use nalgebra::{Isometry3, Vector3};
use rand_distr::{Distribution, Normal};

use super::blocks::Blocks;
use super::icp::{Alignment, Target, Termination, align};
use super::index_map::Projective;
use super::nearest::Nearest;
use super::point::{Noise, Point};
use super::voxel::{Voxels, points_of};
use super::{Init, Kernel, Options, Weights};
use crate::camera::Camera;
use crate::model::NoiseModel;
use crate::rng::{Seed, Stream};

fn camera() -> Camera {
    Camera::centred(320, 240, 262.5)
}

/// Planes n . p = d of the corner of a room: every motion is determined.
const CORNER: [([f64; 3], f64); 3] =
    [([0.6, 0.0, 0.8], 2.4), ([-0.8, 0.0, 0.6], 1.6), ([0.0, 0.8, 0.6], 1.5)];

/// Depth image of planes from a camera at `pose`: the nearest in front of it.
fn picture(planes: &[([f64; 3], f64)], pose: &Isometry3<f64>) -> Vec<f32> {
    let rays = camera().rays();
    let depth = |i: usize| {
        let (x, y) = rays.at(i);
        let ray = Vector3::new(x, y, 1.0);
        let z = planes
            .iter()
            .map(|(n, d)| {
                let n = Vector3::from(*n);
                (d - n.dot(&pose.translation.vector)) / n.dot(&(pose.rotation * ray))
            })
            .filter(|z| *z > 0.0)
            .fold(f64::INFINITY, f64::min);
        if z.is_finite() { z as f32 } else { f32::NAN }
    };
    (0..camera().pixels()).map(depth).collect()
}

fn noise() -> Noise {
    Noise::of(&NoiseModel::paper())
}

fn cloud(depth: &[f32]) -> Nearest {
    let voxels = Voxels::of(depth, &camera().rays(), 0.03);
    Nearest::new(points_of(&voxels, &noise()), 0.03, 0.1)
}

fn blocks(depth: &[f32]) -> Blocks {
    Blocks::of(depth, &camera(), &camera().rays(), 4, &noise())
}

fn projected(source: &[f32], target: &[f32], options: &Options) -> Alignment {
    let (camera, source, target) = (camera(), blocks(source), blocks(target));
    let points: Vec<_> = source.points.iter().flatten().copied().collect();
    let target = Projective::new(&camera, &target, 0.1);
    align(&points, &target, Isometry3::identity(), options)
}

fn error(found: &Alignment, truth: &Isometry3<f64>) -> (f64, f64) {
    let error = found.target_from_source.inverse() * truth;
    (error.translation.vector.norm(), error.rotation.angle())
}

fn motion() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.012, -0.008, 0.015), Vector3::new(0.008, -0.012, 0.01))
}

#[test]
fn a_known_motion_before_a_corner_is_found() {
    let still = picture(&CORNER, &Isometry3::identity());
    let moved = picture(&CORNER, &motion());
    let (source, target) = (cloud(&moved), cloud(&still));
    let paper = Options::paper(Weights::None, Init::None);
    for weights in [Weights::None, Weights::Model, Weights::Both] {
        let options = Options { weights, ..paper };
        let found = align(source.points(), &target, Isometry3::identity(), &options);
        let (shift, turn) = error(&found, &motion());
        assert!(shift < 1e-3 && turn < 1e-3, "voxels {weights:?}: {shift} m, {turn} rad");
        let determined = found.degenerate_directions.is_empty() && found.min_information > 0.02;
        assert!(determined, "{found:?}");
        let robust = Options { kernel: Kernel::Tukey, min_cosine: 0.7, ..options };
        let found = projected(&moved, &still, &robust);
        let (shift, turn) = error(&found, &motion());
        assert!(shift < 1e-4 && turn < 1e-4, "blocks {weights:?}: {shift} m, {turn} rad");
    }
}

/// A bare wall: two shifts along it and the turn about its normal keep their start values.
#[test]
fn what_a_wall_does_not_determine_is_named_and_kept() {
    let wall = [([0.0, 0.0, 1.0], 2.0)];
    let away = Isometry3::translation(0.0, 0.0, -0.02);
    let still = noisy(&picture(&wall, &Isometry3::identity()), &mut Seed(1).stream("a"));
    let moved = noisy(&picture(&wall, &away), &mut Seed(1).stream("b"));
    let paper = Options::paper(Weights::Model, Init::None);
    let found = projected(&moved, &still, &paper);
    let mut names: Vec<String> =
        found.degenerate_directions.iter().map(ToString::to_string).collect();
    names.sort();
    assert_eq!(names.len(), 3, "{names:?}");
    assert!(names.contains(&"turn about z".to_string()), "{names:?}");
    assert!(names.iter().filter(|n| n.starts_with("shift along")).count() == 2, "{names:?}");
    let t = found.target_from_source.translation.vector;
    assert!((t.z + 0.02).abs() < 5e-4 && t.xy().norm() < 1e-3, "{t}");
}

fn noisy(depth: &[f32], rng: &mut Stream) -> Vec<f32> {
    let model = NoiseModel::paper();
    let unit = Normal::new(0.0, 1.0).unwrap();
    let draw = |&z: &f32| {
        let sigma = model.sigma.sigma(f64::from(z), 0.0) * f64::from(z / 4.0).max(1.0).powi(2);
        z + (sigma * unit.sample(rng)) as f32
    };
    depth.iter().map(draw).collect()
}

/// A near corner on the left, a far one on the right, and noise that grows as z^2. If the weights had no
/// effect, they would win 17 or more of 20 draws with a probability of 0.0013.
#[test]
fn weights_beat_none_where_noise_differs() {
    let two_corners = |pose: &Isometry3<f64>| -> Vec<f32> {
        let [near, far] = [0.55, 2.0].map(|scale| {
            picture(&CORNER.map(|(normal, distance)| (normal, scale * distance)), pose)
        });
        let width = camera().width;
        let left = |i: usize| i % width < width / 2;
        (0..near.len()).map(|i| if left(i) { near[i] } else { far[i] }).collect()
    };
    let (still, moved) = (two_corners(&Isometry3::identity()), two_corners(&motion()));
    let paper = Options::paper(Weights::None, Init::None);
    let (mut won, mut squares) = (0, [0.0; 2]);
    for seed in 0..20 {
        let a = noisy(&still, &mut Seed(seed).stream("still"));
        let b = noisy(&moved, &mut Seed(seed).stream("moved"));
        let errors = [Weights::None, Weights::Model]
            .map(|weights| error(&projected(&b, &a, &Options { weights, ..paper }), &motion()).0);
        won += usize::from(errors[1] < errors[0]);
        squares = [squares[0] + errors[0].powi(2), squares[1] + errors[1].powi(2)];
    }
    assert!(won >= 17 && squares[1] < 0.5 * squares[0], "{won} of 20; {squares:?}");
}

/// A target with the `Gate` switched on.
struct Gated<'a>(Projective<'a>);

impl Target for Gated<'_> {
    type Cache = ();
    fn find(&self, p: &Vector3<f32>, cache: &mut ()) -> Option<&Point> {
        self.0.find(p, cache)
    }
    fn block_width(&self) -> Option<f32> {
        Some((4.0 / camera().fx) as f32)
    }
}

/// With noise of four times the model's and a fifth of the target moved by 7 cm, within the widest gate
/// of 10 cm, the narrower gate keeps those pairs out. Where the noise is as modelled, nothing changes.
#[test]
fn pairs_are_held_together_where_the_noise_model_falls_short() {
    let (still, moved) = (picture(&CORNER, &Isometry3::identity()), picture(&CORNER, &motion()));
    let (camera, options) = (camera(), Options::best());
    let errors = |seed: u64, factor: f32, apart_m: f32| {
        let drawn = |depth: &[f32], stream: &str| -> Vec<f32> {
            let noisy = noisy(depth, &mut Seed(seed).stream(stream));
            depth.iter().zip(noisy).map(|(z, noisy)| z + factor * (noisy - z)).collect()
        };
        let mut target = drawn(&still, "still");
        for (i, z) in target.iter_mut().enumerate() {
            *z -= if i % camera.width % 80 < 16 { apart_m } else { 0.0 };
        }
        let (source, target) = (blocks(&drawn(&moved, "moved")), blocks(&target));
        let points: Vec<_> = source.points.iter().flatten().copied().collect();
        let wide = || Projective::new(&camera, &target, 0.1);
        let start = Isometry3::identity();
        let found = [
            align(&points, &wide(), start, &options),
            align(&points, &Gated(wide()), start, &options),
        ];
        assert!(found[1].inlier_ratio > 0.8, "{}", found[1].inlier_ratio);
        let square = Options { kernel: Kernel::Square, ..options };
        let square = align(&points, &Gated(wide()), start, &square);
        assert!(square.misfit.is_finite(), "a square kernel has a misfit, too");
        found.map(|found| error(&found, &motion()).0)
    };
    let mut sums = [0.0; 2];
    for seed in 0..6 {
        let [wide, gated] = errors(seed, 1.0, 0.0);
        assert_eq!(wide, gated, "seed {seed}, the model's own noise");
        let [wide, gated] = errors(seed, 4.0, 0.07);
        sums = [sums[0] + wide, sums[1] + gated];
    }
    assert!(sums[1] < 0.5 * sums[0], "{sums:?}");
}

/// The reported covariance matches the scatter of the estimates, to a factor: 40 draws give a standard
/// deviation to 11 %, and errors of the normals add some.
#[test]
fn the_covariance_is_the_scatter() {
    let (still, moved) = (picture(&CORNER, &Isometry3::identity()), picture(&CORNER, &motion()));
    let options = Options::best();
    let (mut squares, mut reported) = (Vector3::zeros(), Vector3::zeros());
    for seed in 0..40 {
        let a = noisy(&still, &mut Seed(seed).stream("still"));
        let b = noisy(&moved, &mut Seed(seed).stream("moved"));
        let found = projected(&b, &a, &options);
        // The covariance is in the target frame, so the error is taken there.
        let off = found.target_from_source * motion().inverse();
        squares += off.translation.vector.map(|v| v * v);
        reported += found.covariance.diagonal().fixed_rows::<3>(0).into_owned();
    }
    for k in 0..3 {
        let ratio = (squares[k] / reported[k]).sqrt();
        assert!((0.5..2.5).contains(&ratio), "axis {k}: {ratio}");
    }
}

/// Images without any valid depth give neither a panic nor a pose.
#[test]
fn nothing_in_nothing_out() {
    let nan = vec![f32::NAN; camera().pixels()];
    let odd: Vec<f32> =
        nan.iter().enumerate().map(|(i, v)| [0.0, -1.0, f32::INFINITY, *v][i % 4]).collect();
    let corner = picture(&CORNER, &Isometry3::identity());
    let options = Options::best();
    for empty in [&nan, &odd] {
        assert!(cloud(empty).points().is_empty());
        assert!(blocks(empty).points.iter().all(Option::is_none));
        for (a, b) in [(empty, &corner), (&corner, empty)] {
            let found = projected(a, b, &options);
            assert_eq!(found.termination, Termination::TooFewCorrespondences);
            let t = found.target_from_source.translation.vector;
            assert!(t.iter().all(|v| v.is_finite()));
        }
    }
}
