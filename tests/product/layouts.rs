//! One scene in five layouts: every reader must give the same views, and they must agree with the truth.
//! Then real recordings, where available.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use kinoise::frame::KINECT_NO_MEASUREMENT;
use kinoise::io::{Assumed, open, write_recording_file};
use kinoise::measure::MeasureOptions;
use kinoise::plane::Plane;
use kinoise::scene::Bench;
use kinoise::simulate::{GridView, kinect_v1, shoot};
use kinoise::view::Region;
use kinoise::{DepthCode, Frame, Measurements, Recording, Seed, Sensor, ViewMeasurement};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rand_distr::{Distribution, StandardNormal};

use crate::common;
use crate::common::{BOARD, BOARD_HEIGHT_M, data, truth, write_depth};

// ---- the scene --------------------------------------------------------------------------------

/// 320 x 240 px.
const SHRINK: usize = 2;
/// Frames of a still stretch; a film needs at least ten.
const STILL: usize = 12;
const TUM: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
/// OpenKinect's formula, which the reader of fakenect dumps assumes.
const DISPARITY: DepthCode = DepthCode::Disparity {
    offset: 3.330_949_516_1,
    slope: -0.003_071_101_6,
    invalid: KINECT_NO_MEASUREMENT,
};

fn poses() -> Vec<GridView> {
    [(1.0, 0.0f64, 0.0), (1.4, 30.0, 1.0), (2.0, 50.0, 2.5), (1.7, 20.0, -1.5)]
        .map(|(z_m, tilt, azimuth_rad)| GridView { z_m, theta_rad: tilt.to_radians(), azimuth_rad })
        .to_vec()
}

fn sensor(code: DepthCode) -> Sensor {
    Sensor { code, ..kinect_v1(SHRINK) }
}

fn assumed(code: Option<DepthCode>) -> Assumed {
    let c = sensor(TUM).camera;
    Assumed { intrinsics: Some([c.fx, c.fy, c.cx, c.cy]), code, ..Assumed::default() }
}

/// Frame `frame` of the board at `plane`; the noise does not depend on the code.
fn frame(code: DepthCode, plane: &Plane, pose: usize, frame: usize) -> Frame {
    let sensor = sensor(code);
    let seed = Seed(1000 * pose as u64 + frame as u64);
    shoot(&sensor, &sensor.camera.rays(), &Bench::bare(*plane, BOARD), &truth(), seed)
}

fn stills(code: DepthCode) -> Vec<Vec<Frame>> {
    poses()
        .iter()
        .enumerate()
        .map(|(i, p)| (0..STILL).map(|k| frame(code, &p.plane(), i, k)).collect())
        .collect()
}

/// Frames between two still stretches of a film, in which the board moves.
const MOVING: usize = 5;

fn film(code: DepthCode) -> Vec<Frame> {
    let mut frames = Vec::new();
    let poses = poses();
    for (i, still) in stills(code).into_iter().enumerate() {
        frames.extend(still);
        let Some(next) = poses.get(i + 1) else { break };
        for k in 1..=MOVING {
            let t = k as f64 / (MOVING + 1) as f64;
            let z = poses[i].z_m + t * (next.z_m - poses[i].z_m);
            let theta = poses[i].theta_rad + t * (next.theta_rad - poses[i].theta_rad);
            frames.push(frame(code, &Plane::tilted(z, theta, next.azimuth_rad), 100 + i, k));
        }
    }
    frames
}

fn write_recording(root: &Path, code: DepthCode) {
    write_recording_file(root, &sensor(code)).expect("written");
    for (i, frames) in stills(code).iter().enumerate() {
        let view = root.join(format!("{i:04}"));
        let mut list = String::new();
        for (k, frame) in frames.iter().enumerate() {
            write_depth(&view.join(format!("depth/{k:04}.png")), frame);
            let _ = writeln!(list, "{:.6} depth/{k:04}.png", i as f64 * 30.0 + k as f64 / 30.0);
        }
        fs::write(view.join("depth.txt"), list).expect("written");
    }
}

fn write_tum(root: &Path, frames: &[Frame]) {
    let mut list = String::from("# depth maps\n# timestamp filename\n");
    for (k, frame) in frames.iter().enumerate() {
        let name = format!("depth/{:.6}.png", 1305.0 + k as f64 / 30.0);
        write_depth(&root.join(&name), frame);
        let _ = writeln!(list, "{:.6} {name}", 1305.0 + k as f64 / 30.0);
    }
    fs::write(root.join("depth.txt"), list).expect("written");
}

/// Writes a dump as fakenect-record does: raw memory, low byte first.
fn write_fakenect(root: &Path, frames: &[Frame]) {
    let mut index = String::new();
    for (k, frame) in frames.iter().enumerate() {
        let stamp = 1_316_653_530.0 + k as f64 / 30.0;
        let name = format!("d-{stamp:.6}-{}.pgm", 4_127_230_476u64 + k as u64);
        let mut bytes = format!("P5 {} {} 65535\n", frame.width, frame.height).into_bytes();
        bytes.extend(frame.raw.iter().flat_map(|w| w.to_le_bytes()));
        fs::write(root.join(&name), bytes).expect("written");
        let _ = write!(index, "{name}\nr-{stamp:.6}-{k}.ppm\na-{stamp:.6}-{k}.dump\n");
    }
    fs::write(root.join("INDEX.txt"), index).expect("written");
}

// ---- against the truth ----------------------------------------------------------------------

fn measured(recording: &Recording) -> Measurements {
    kinoise::measure_recording(recording, &MeasureOptions::default(), &|_, _| ()).expect("measured")
}

/// Opens and measures what `write` puts into a folder.
fn read_back(write: impl Fn(&Path), assumed: &Assumed) -> (Recording, Measurements) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path());
    let recording = open(folder.path(), assumed).expect("opens");
    let measurements = measured(&recording);
    (recording, measurements)
}

/// Asserts views in order of the poses, nothing excluded, every number within its own error.
#[track_caller]
fn agrees_with_the_truth(m: &Measurements, code: DepthCode) {
    assert!(m.excluded.is_empty(), "{:?}", m.excluded);
    assert_eq!(m.views.len(), poses().len());
    for (view, pose) in m.views.iter().zip(poses()) {
        assert_eq!(view.frames, STILL, "{}", view.name);
        one_agrees(view, &pose, code);
    }
}

/// Five standard errors: with 4 layouts x 4 views x 4 numbers a false alarm in 30,000 runs.
const ERRORS: f64 = 5.0;

#[track_caller]
fn one_agrees(view: &ViewMeasurement, pose: &GridView, code: DepthCode) {
    let z = view.z_m;
    // Sigma is that of stored words: the simulator allows for the rounding to the code.
    let expected = |z: f64| truth().sigma(z, pose.theta_rad);
    let sigma = expected(z);
    let n = view.whole.n as f64;
    // The plane's depth on the axis is a mean over n residuals; half a word for the rounding of frontal
    // planes.
    let axis = (view.axis_distance_m - pose.z_m).abs();
    let step = code.step_inverse(z) * z * z;
    assert!(axis < ERRORS * sigma / n.sqrt() + 0.02 * step, "{}: axis {axis}", view.name);
    // The mean over the target: the excluded rim is not quite symmetrical in depth.
    let mean = (z - mean_depth(pose)).abs();
    assert!(mean < 0.004 * z, "{}: z {z}, {}", view.name, mean_depth(pose));
    // The tilt's standard error: the error of the mean divided by the spread of the points.
    let spread = BOARD_HEIGHT_M / 12f64.sqrt() * pose.theta_rad.cos();
    let theta = (view.theta_rad - pose.theta_rad).abs();
    let slope = sigma / n.sqrt() / spread;
    assert!(
        theta < ERRORS * slope + 0.001 * step / spread + 1e-5,
        "{}: {theta} {slope}",
        view.name
    );
    for cell in &view.cells {
        let ratio = cell.spread.spatial_m / expected(cell.z_m) - 1.0;
        let error = (0.5 / cell.n_effective).sqrt();
        // One percent: sigma grows within a cell, and the cut at 3.5 sigmas is constant.
        assert!(
            ratio.abs() < ERRORS * error + 0.01,
            "{}: sigma off by {ratio} ({error})",
            view.name
        );
    }
}

/// Mean depth of the board's pixels without noise, m.
fn mean_depth(pose: &GridView) -> f64 {
    let sensor = sensor(TUM);
    let rays = sensor.camera.rays();
    let plane = pose.plane();
    let seen = frame(TUM, &plane, 0, 0);
    let depths: Vec<f64> = (0..seen.raw.len())
        .filter(|&i| seen.raw[i] > 0)
        .map(|i| {
            let (x, y) = rays.at(i);
            plane.depth(x, y)
        })
        .collect();
    depths.iter().sum::<f64>() / depths.len() as f64
}

fn told(recording: &Recording, words: &str) -> bool {
    recording.remarks.iter().any(|r| r.contains(words))
}

#[test]
fn a_recording_in_units() {
    let (recording, m) = read_back(|root| write_recording(root, TUM), &Assumed::default());
    assert!(recording.remarks.is_empty(), "{:?}", recording.remarks);
    agrees_with_the_truth(&m, TUM);
}

#[test]
fn a_recording_in_raw_disparity() {
    let (recording, m) = read_back(|root| write_recording(root, DISPARITY), &Assumed::default());
    assert!(recording.remarks.is_empty(), "{:?}", recording.remarks);
    agrees_with_the_truth(&m, DISPARITY);
}

#[test]
fn a_tum_folder_is_cut_into_its_still_stretches() {
    let frames = film(TUM);
    let moving = MOVING * (poses().len() - 1);
    let (recording, m) = read_back(|root| write_tum(root, &frames), &assumed(None));
    assert!(
        told(&recording, &format!("{moving} of {} frames lie between", frames.len())),
        "{:?}",
        recording.remarks
    );
    agrees_with_the_truth(&m, TUM);
}

#[test]
fn a_tum_folder_of_small_images_needs_its_intrinsics() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_tum(folder.path(), &film(TUM)[..STILL]);
    let error = open(folder.path(), &Assumed::default()).expect_err("525 px belong to 640 x 480");
    let error = error.to_string();
    assert!(error.contains("320 x 240") && error.contains("--intrinsics"), "{error}");
}

/// A sensor writes empty frames while starting up; they must not count as still together with all others.
#[test]
fn empty_frames_neither_join_nor_part_a_still_stretch() {
    let empty = Frame { width: 320, height: 240, raw: vec![0; 320 * 240] };
    let mut frames = film(TUM);
    frames.insert(STILL / 2, empty.clone());
    frames.insert(0, empty);
    let (recording, m) = read_back(|root| write_tum(root, &frames), &assumed(None));
    assert!(told(&recording, "no pixel carries a depth"), "{:?}", recording.remarks);
    agrees_with_the_truth(&m, TUM);
}

/// Damaged frames are counted among all frames, and reported.
#[test]
fn damaged_frames_of_a_film_are_counted() {
    let frames = film(TUM);
    let moving = MOVING * (poses().len() - 1);
    let write = |root: &Path| {
        write_tum(root, &frames);
        for (k, name) in ["damaged.png", "cut.png"].iter().enumerate() {
            fs::write(root.join("depth").join(name), b"no picture").expect("written");
            let path = root.join("depth.txt");
            let list = fs::read_to_string(&path).expect("text");
            let line = format!("{}.01 depth/{name}\n", 1305 + k);
            fs::write(path, list + &line).expect("written");
        }
    };
    let (recording, m) = read_back(write, &assumed(None));
    let all = frames.len() + 2;
    for words in [
        format!("2 of {all} frames cannot be read or carry no depth; the first: "),
        format!("{moving} of {all} frames lie between"),
        "damaged.png".into(),
        "cut.png".into(),
    ] {
        assert!(told(&recording, &words), "{words}: {:?}", recording.remarks);
    }
    agrees_with_the_truth(&m, TUM);
}

/// Two positions of a small target without a common pixel are two views.
#[test]
fn a_target_that_jumps_aside_has_moved() {
    let half = |right: bool| {
        let mut frame = frame(TUM, &Plane::tilted(1.0, 0.0, 0.0), 0, usize::from(right));
        for (i, word) in frame.raw.iter_mut().enumerate() {
            if (i % 320 >= 160) != right {
                *word = 0;
            }
        }
        frame
    };
    let frames: Vec<Frame> = (0..2 * STILL).map(|k| half(k >= STILL)).collect();
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_tum(folder.path(), &frames);
    let recording = open(folder.path(), &assumed(None)).expect("opens");
    let lengths: Vec<usize> = recording.views.iter().map(|v| v.depth.len()).collect();
    assert_eq!(lengths, [STILL, STILL]);
}

#[test]
fn a_plain_folder_of_images() {
    let write = |root: &Path| {
        for (k, frame) in stills(TUM).into_iter().flatten().enumerate() {
            write_depth(&root.join(format!("frame-{k:06}.png")), &frame);
        }
    };
    let (recording, m) = read_back(write, &assumed(Some(TUM)));
    assert!(recording.remarks.is_empty(), "{:?}", recording.remarks);
    agrees_with_the_truth(&m, TUM);
}

#[test]
fn a_fakenect_dump() {
    let frames = film(DISPARITY);
    let (recording, m) = read_back(|root| write_fakenect(root, &frames), &assumed(None));
    assert!(told(&recording, "OpenKinect's depth formula"), "{:?}", recording.remarks);
    assert!(told(&recording, "lie between still stretches"), "{:?}", recording.remarks);
    agrees_with_the_truth(&m, DISPARITY);
}

/// The layouts carry the same frames: the measurements agree.
#[test]
fn layouts_agree_to_the_last_bit() {
    let numbers = |m: &Measurements| -> Vec<[f64; 4]> {
        m.views
            .iter()
            .map(|v| [v.z_m, v.theta_rad, v.whole.spread.spatial_m, v.axis_distance_m])
            .collect()
    };
    // The intrinsics of one went through a file, those of the other did not.
    let (_, a) = read_back(|root| write_recording(root, TUM), &Assumed::default());
    let (_, b) = read_back(|root| write_tum(root, &film(TUM)), &assumed(None));
    // The target's search is seeded by the view's name, and names differ between layouts.
    for (a, b) in numbers(&a).into_iter().flatten().zip(numbers(&b).into_iter().flatten()) {
        assert!((a - b).abs() < 1e-9 + 1e-4 * a.abs(), "{a} {b}");
    }
}

// ---- real data --------------------------------------------------------------------------------

/// Points in the target's region of a view's first frame, and their rays.
fn points(recording: &Recording, view: usize) -> (Vec<Vector3<f64>>, Vec<(f64, f64)>) {
    let sensor = &recording.sensor;
    let camera = &sensor.camera;
    let view = &recording.views[view];
    let mut source = kinoise::io::FrameSource::new(camera.width, camera.height);
    let frame = source.read(&view.depth[0].path).expect("read");
    let region = view.notes.region.clone().unwrap_or(Region::Rectangle([0.0, 0.0, 1e9, 1e9]));
    let (mut points, mut rays) = (Vec::new(), Vec::new());
    for (i, &word) in frame.raw.iter().enumerate() {
        let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
        if let Some(z) = sensor.code.metres(word).filter(|_| region.contains(u, v)) {
            let (x, y) = ((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
            points.push(Vector3::new(x, y, 1.0) * z);
            rays.push((x, y));
        }
    }
    (points, rays)
}

/// Orthogonal least squares with three rounds of clipping at 3.5 robust standard deviations.
/// Returns mean depth, tilt, and which points were kept.
fn total_least_squares(points: &[Vector3<f64>]) -> (f64, f64, Vec<bool>) {
    let mut kept = vec![true; points.len()];
    let mut result = (f64::NAN, f64::NAN);
    for round in 0..=3 {
        let chosen = || points.iter().zip(&kept).filter(|(_, k)| **k).map(|(p, _)| p);
        let n = chosen().count() as f64;
        let mean = chosen().sum::<Vector3<f64>>() / n;
        let scatter: Matrix3<f64> = chosen().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let eigen = SymmetricEigen::new(scatter);
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        result = (mean.z, normal.z.abs().min(1.0).acos());
        if round == 3 {
            break;
        }
        let off: Vec<f64> = points.iter().map(|p| normal.dot(&(p - mean))).collect();
        let mut sizes: Vec<f64> =
            off.iter().zip(&kept).filter(|(_, k)| **k).map(|(o, _)| o.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let reach = 3.5 * kinoise::stats::MAD_TO_SIGMA * sizes[sizes.len() / 2];
        kept = off.iter().map(|o| o.abs() <= reach).collect();
    }
    (result.0, result.1, kept)
}

/// Bias of the tilt of `plane` by orthogonal least squares when the noise lies along the rays and is uniform
/// in inverse depth (with the view's sigma at its mean depth): mean over draws, rad.
fn bias_of_total_least_squares(view: &ViewMeasurement, rays: &[(f64, f64)]) -> f64 {
    const DRAWS: usize = 6;
    let sigma_w = view.whole.spread.spatial_m / (view.z_m * view.z_m);
    let mut rng = Seed(1).stream(&view.name);
    let off: f64 = (0..DRAWS)
        .map(|_| {
            let points: Vec<Vector3<f64>> = rays
                .iter()
                .map(|&(x, y)| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    Vector3::new(x, y, 1.0) / (view.plane.inverse_depth(x, y) + sigma_w * noise)
                })
                .collect();
            total_least_squares(&points).1 - view.plane.theta()
        })
        .sum();
    off / DRAWS as f64
}

#[test]
fn real_views_of_herrera_against_independent_planes() {
    let Some(root) = data("herrera-kinect-v1/recording") else { return };
    let recording = open(&root, &Assumed::default()).expect("opens");
    let m = measured(&recording);
    assert!(m.excluded.is_empty(), "{:?}", m.excluded);
    assert_eq!(m.views.len(), 39);
    let mut biased = Vec::new();
    for (i, view) in m.views.iter().enumerate() {
        let name = &view.name;
        let (points, rays) = points(&recording, i);
        let (z, theta, kept) = total_least_squares(&points);
        assert!((view.z_m - z).abs() < 0.003 + 0.005 * z, "{name}: z {} and {z}", view.z_m);
        let paper = view.paper.expect("the paper's method finds every board");
        let off = (paper.theta_rad - theta).to_degrees();
        assert!(off.abs() < 0.2, "{name}: the paper's tilt differs by {off} degrees");
        let off = (theta - view.theta_rad).to_degrees();
        if off.abs() >= 0.2 {
            let rays: Vec<_> =
                rays.iter().zip(&kept).filter(|(_, k)| **k).map(|(r, _)| *r).collect();
            let explained = bias_of_total_least_squares(view, &rays).to_degrees();
            println!("{name}: z {z:.2} off {off:.3} explained {explained:.3}");
            biased.push((name.clone(), off, explained));
        }
    }
    let names: Vec<&str> = biased.iter().map(|(n, ..)| n.as_str()).collect();
    println!("{names:?}");
    for (name, off, explained) in &biased {
        assert!((off - explained).abs() < 0.15, "{name}: {off} degrees, explained {explained}");
    }
    assert!(names.iter().all(|n| ["0024", "0035", "0036", "0037"].contains(n)), "{names:?}");
}

#[test]
fn a_second_real_unit_as_a_plain_folder() {
    let Some(root) = data("kinect-v1-second-unit") else { return };
    let assumed = Assumed {
        intrinsics: Some([585.0, 585.0, 319.5, 239.5]),
        code: Some(DepthCode::Disparity {
            offset: 3.3309,
            slope: -0.003_071_1,
            invalid: KINECT_NO_MEASUREMENT,
        }),
        ..Assumed::default()
    };
    let recording = open(&root, &assumed).expect("opens");
    let m = measured(&recording);
    println!("{} views, {} measured", recording.views.len(), m.views.len());
    m.excluded.iter().for_each(|e| println!("{e}"));
    assert_eq!(recording.views.len(), 33);
    assert!(m.views.len() >= 25, "{}", m.views.len());
    assert!(m.views.iter().all(|v| v.z_m.is_finite() && (0.7..4.1).contains(&v.z_m)));
    let out = tempfile::tempdir().expect("a temporary folder");
    let run = common::kinoise()
        .arg("calibrate")
        .arg(&root)
        .arg("-o")
        .arg(out.path())
        .args(["--intrinsics", "585,585,319.5,239.5", "--raw-disparity", "3.3309,-0.0030711"])
        .output()
        .expect("runs");
    let stderr = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{stderr}");
    let words = format!("{} of 33 views measured", m.views.len());
    assert!(stderr.contains(&words), "{stderr}");
}

#[test]
fn a_published_table_of_another_sensor() {
    let Some(path) = data("published-tables/astra_wall_noise.tsv") else { return };
    let text = fs::read_to_string(path).expect("read");
    let mut table = String::from("z_m,theta_rad,sigma_m\n");
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split('\t').collect();
        let _ = writeln!(table, "{},0,{}", cells[0], cells[1]);
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("astra.csv");
    fs::write(&file, table).expect("written");
    let out = folder.path().join("out");
    let run = common::kinoise().arg("fit").arg(&file).arg("-o").arg(&out).output().expect("runs");
    let stderr = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("tilt"), "that no tilt was seen is told: {stderr}");
    let model = kinoise::NoiseModel::read(&out.join("model.json")).expect("a model");
    // The authors' own fit: sigma = max(0.002, 0.0019 d^2.36), good to some ten percent.
    for d in [1.0f64, 2.0, 3.0] {
        let theirs = 0.0019 * d.powf(2.36);
        let ratio = model.sigma.sigma(d, 0.0) / theirs;
        assert!((0.7..1.4).contains(&ratio), "at {d} m: {ratio}");
    }
}
