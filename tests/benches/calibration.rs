//! Speed of the calibrator's parts. Run beside `../shared/peers/calib.py`, whose scene the plane
//! benches repeat; compare as ratios in one run (see README, "Speed").

use std::hint::black_box;
use std::path::PathBuf;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use kinoise::io::{Assumed, FrameSource, open};
use kinoise::measure::{MeasureOptions, SigmaRow, SigmaTable, Workbench, measure_view};
use kinoise::model::sort_out;
use kinoise::plane::{
    Effort, InverseDepthImage, Points, RansacOptions, find_target, fit_affine_robust, ransac_plane,
};
use kinoise::scene::{Board, Target};
use kinoise::simulate::{Grid, Shoot, kinect_v1};
use kinoise::view::Region;
use kinoise::{Form, Plane, Seed, SigmaModel};
use rand_distr::{Distribution, StandardNormal};

/// 8 f b of a Kinect v1, px m: raw disparity steps are 1/8 px.
const STEPS: f64 = 8.0 * 580.0 * 0.075;

/// The scene of calib.py: a wall at 1.5 m turned by 30 degrees, with a tenth of the pixels clutter at 0.9 m.
fn wall() -> (Points, Plane) {
    let sensor = kinect_v1(1);
    let rays = sensor.camera.rays();
    let plane = Plane::tilted(1.5, 0.52, 0.0);
    let sigma = SigmaModel::paper();
    let mut rng = Seed(3).stream("wall");
    let mut points = Points::default();
    for i in 0..sensor.camera.pixels() {
        let (u, v) = ((i % 640) as f64, (i / 640) as f64);
        let (x, y) = rays.at(i);
        let clutter = (u - 320.0).abs() < 100.0 && (v - 240.0).abs() < 77.0;
        let z = if clutter { 0.9 } else { plane.depth(x, y) };
        let noise: f64 = StandardNormal.sample(&mut rng);
        let z = z + sigma.sigma(z, 0.52) * noise;
        let z = STEPS / (STEPS / z).round();
        points.push((x * z) as f32, (y * z) as f32, z as f32);
    }
    (points, plane)
}

/// The points that calib.py left in its work folder (float32 x, y, z), given by KINOISE_PLANE_XYZ; its wall
/// has the normal (sin .52, 0, cos .52) through (0, 0, 1.5).
fn peers_wall() -> Option<(Points, Plane)> {
    let bytes = std::fs::read(std::env::var_os("KINOISE_PLANE_XYZ")?).ok()?;
    let mut points = Points::default();
    for point in bytes.chunks_exact(12) {
        let [x, y, z] = [0, 4, 8]
            .map(|i| f32::from_le_bytes([point[i], point[i + 1], point[i + 2], point[i + 3]]));
        points.push(x, y, z);
    }
    let normal = nalgebra::Vector3::new(0.52f64.sin(), 0.0, 0.52f64.cos());
    Some((points, Plane::from_normal(normal, 1.5 * normal.z)))
}

fn planes(c: &mut Criterion) {
    let (points, truth) = peers_wall().unwrap_or_else(wall);
    let options = RansacOptions { threshold_m: 0.02, iterations: 500, confidence: 0.999 };
    let found = ransac_plane(&points, &options, &mut Seed(1).stream("r")).expect("a plane");
    println!(
        "plane of 307,200 points: angle error {:.4} deg, distance error {:.3} mm, {} inliers",
        found.plane.normal().angle(&truth.normal()).to_degrees(),
        1e3 * (found.plane.distance() - truth.distance()),
        found.inliers
    );
    c.bench_function("plane: RANSAC + refit, 307,200 points", |b| {
        b.iter(|| ransac_plane(black_box(&points), &options, &mut Seed(1).stream("r")));
    });
    default_plane(&points, &truth, c);
}

/// The default plane on the same points: RANSAC seed, then the robust fit of 1/z on all pixels.
fn default_plane(points: &Points, truth: &Plane, c: &mut Criterion) {
    let camera = kinect_v1(1).camera;
    let mut rays = camera.rays();
    let w: Vec<f32> = points.z.iter().map(|z| 1.0 / z).collect();
    rays.x = points.x.iter().zip(&w).map(|(x, w)| x * w).collect();
    rays.y = points.y.iter().zip(&w).map(|(y, w)| y * w).collect();
    let pixels: Vec<u32> = (0..w.len() as u32).collect();
    let region = Region::Rectangle([0.0, 0.0, 640.0, 480.0]);
    let run = || {
        let image = InverseDepthImage { w: &w, rays: &rays, camera: &camera, step: &|_| 2.9e-3 };
        let target = find_target(&image, Some(&region), &mut Seed(1).stream("r")).expect("a plane");
        fit_affine_robust(&w, &rays, &pixels, &target.plane, 3e-4, Effort::AllPixels)
            .expect("a fit")
    };
    let found = run().plane;
    println!(
        "the same by the default fit: angle error {:.4} deg, distance error {:.3} mm",
        found.normal().angle(&truth.normal()).to_degrees(),
        1e3 * (found.distance() - truth.distance())
    );
    c.bench_function("plane: seed + robust fit in 1/z, 307,200 points", |b| b.iter(run));
}

/// 100 cells of Eq. 1, each from `samples` samples.
fn cells(samples: f64) -> SigmaTable {
    let truth = SigmaModel::paper();
    let mut rng = Seed(5).stream("cells");
    let mut rows = Vec::new();
    for i in 0..10 {
        for j in 0..10 {
            let (z_m, theta_rad) =
                (1.0 + f64::from(i) / 3.0, (75.0 * f64::from(j) / 9.0).to_radians());
            let noise: f64 = StandardNormal.sample(&mut rng);
            let sigma_m = truth.sigma(z_m, theta_rad) * (1.0 + noise / (2.0 * samples).sqrt());
            rows.push(SigmaRow {
                z_m,
                theta_rad,
                sigma_m,
                n_effective: Some(samples),
                view: rows.len(),
            });
        }
    }
    SigmaTable { rows }
}

fn fits(c: &mut Criterion) {
    for samples in [100.0, 100_000.0] {
        let table = cells(samples);
        c.bench_function(&format!("fit: six parameters, 100 cells of {samples} samples"), |b| {
            b.iter(|| sort_out(black_box(&table)).fit(Form::Paper).expect("fitted"));
        });
    }
}

/// A view of many frames, against decoding its frames alone.
fn frames(c: &mut Criterion) {
    const FRAMES: usize = 120;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let board = Target::Board(Board { width_m: 3.0, height_m: 2.0 });
    let poses = Grid { distances_m: vec![1.5], tilts_rad: vec![0.1] }.views();
    let shoot = Shoot::plain(kinect_v1(1), board, &poses, FRAMES, SigmaModel::paper(), Seed(1));
    let root = folder.path().join("recording");
    shoot.write(&root, &|_, _| ()).expect("written");
    frames_of(c, "simulated wall, 120 frames", &root);
    let real = std::env::var_os("KINOISE_DATA")
        .map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from)
        .join("herrera-kinect-v1/recording");
    if real.is_dir() {
        frames_of(c, "Herrera wall, 1 frame", &real);
    } else {
        println!("{} is not here: the real frames are not measured", real.display());
    }
}

fn frames_of(c: &mut Criterion, name: &str, root: &std::path::Path) {
    let recording = open(root, &Assumed::default()).expect("opens");
    let view = recording.views.last().expect("a view").clone();
    let camera = &recording.sensor.camera;
    let bench = Workbench::new(&recording.sensor, MeasureOptions::default());
    let mut group = c.benchmark_group(name);
    group.sample_size(20);
    group.bench_function("decode alone", |b| {
        b.iter_batched(
            || FrameSource::new(camera.width, camera.height),
            |mut source| {
                for frame in &view.depth {
                    black_box(source.read(&frame.path).expect("decodes"));
                }
            },
            BatchSize::SmallInput,
        );
    });
    group.bench_function("measure the view", |b| {
        b.iter(|| measure_view(black_box(&view), &bench).expect("measured"));
    });
    group.finish();
}

criterion_group!(benches, planes, fits, frames);
criterion_main!(benches);
