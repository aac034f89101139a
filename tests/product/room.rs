//! The filmed office: geometry against independent oracles, ground truth against the images, paths against
//! the furniture, and the written folder.

use std::collections::BTreeMap;
use std::path::Path;

use kinoise::io::{Assumed, FrameSource, open};
use kinoise::scene::{Hit, World};
use kinoise::simulate::Physics;
use kinoise::simulate::room::{
    Body, CEILING_M, CLEARANCE_M, FLOOR_M, Film, Mapping, Material, Picture, Pose, PosedRoom, Room,
    RoomCamera, Shape, Shutter, Texture, around_the_desks, looking, place, read_trajectory,
    resample,
};
use kinoise::simulate::speckle::Causes;
use kinoise::{Camera, Frame, Seed, Sensor, SigmaModel};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::Rng;

use crate::common;

/// A room with a single white body.
fn alone(shape: Shape, room_from_body: Isometry3<f64>) -> Room {
    let materials = [Material::new(0, Mapping::Fit); Shape::FACES];
    let textures = vec![Texture::new(1, vec![[255; 3]])];
    Room { bodies: vec![Body { shape, room_from_body, materials }], textures }
}

/// Casts a ray given in the room's frame.
fn cast(room: &Room, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
    PosedRoom { room, room_from_camera: Isometry3::identity() }.cast(origin, direction)
}

/// Whether a point is inside the body, by the definition of its shape.
fn inside(shape: &Shape, room_from_body: &Isometry3<f64>, point: &Vector3<f64>) -> bool {
    let p = room_from_body.inverse_transform_point(&Point3::from(*point));
    match *shape {
        Shape::Cuboid(h) => p.x.abs() < h.x && p.y.abs() < h.y && p.z.abs() < h.z,
        Shape::Ball(r) => p.coords.norm() < r,
        Shape::Drum { radius, half_height } => p.x.hypot(p.y) < radius && p.z.abs() < half_height,
        Shape::Shell(h) => p.x.abs() > h.x || p.y.abs() > h.y || p.z.abs() > h.z,
    }
}

/// Finds the entry point by stepping and bisection, without a formula for the ray.
fn walk(enters: impl Fn(f64) -> bool) -> Option<f64> {
    const STEP: f64 = 0.002;
    let mut high = (1..4000).map(|k| f64::from(k) * STEP).find(|t| enters(*t))?;
    let mut low = high - STEP;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if enters(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

#[test]
fn rays_end_where_a_walk_along_them_first_comes_inside() {
    let mut rng = Seed(5).stream("bodies");
    let shapes = [
        Shape::Cuboid(Vector3::new(0.4, 0.2, 0.3)),
        Shape::Ball(0.35),
        Shape::Drum { radius: 0.25, half_height: 0.3 },
        Shape::Shell(Vector3::new(2.0, 1.5, 3.0)),
    ];
    for shape in shapes {
        let mut met = 0;
        for _ in 0..60 {
            let mut any = || rng.random_range(-1.0..1.0);
            let away = if matches!(shape, Shape::Shell(_)) { 0.0 } else { 2.0 };
            let pose = Isometry3::new(
                Vector3::new(0.2 * any(), 0.2 * any(), away + 0.3 * any()),
                3.0 * Vector3::new(any(), any(), any()),
            );
            let room = alone(shape, pose);
            for _ in 0..8 {
                let direction = Vector3::new(0.2 * any(), 0.2 * any(), 1.0);
                let origin = 0.05 * Vector3::new(any(), any(), any());
                let truth = walk(|t| inside(&shape, &pose, &(origin + t * direction)));
                let hit = cast(&room, &origin, &direction);
                let Some(truth) = truth else {
                    // The walk may step over a corner, but over nothing larger.
                    assert!(hit.is_none_or(|h| {
                        let deeper = origin + (h.t + 0.004) * direction;
                        !inside(&shape, &pose, &deeper)
                    }));
                    continue;
                };
                let hit = hit.expect("the walk came inside");
                assert!((hit.t - truth).abs() < 2e-3, "{shape:?}: {} {truth}", hit.t);
                // Unless the walk stepped over a corner, the two agree to the precision of the bisection.
                met += usize::from((hit.t - truth).abs() < 1e-9);
                assert!((hit.normal.norm() - 1.0).abs() < 1e-12);
                assert!(hit.normal.dot(&direction) < 0.0, "towards where the ray came from");
                let outside = origin + hit.t * direction + 1e-6 * hit.normal;
                assert!(!inside(&shape, &pose, &outside), "the normal points out of the body");
            }
        }
        assert!(met > 100, "{shape:?}: only {met} exact meetings");
    }
}

/// Depths that can be checked by hand.
#[test]
fn known_bodies_have_known_depths() {
    let depth = |shape, at: Vector3<f64>, direction: Vector3<f64>| {
        cast(&alone(shape, Isometry3::from(at)), &Vector3::zeros(), &direction).map(|h| h.t)
    };
    let ahead = Vector3::z();
    let at = Vector3::new(0.0, 0.0, 3.0);
    let close = |a: Option<f64>, b: f64| assert!((a.unwrap() - b).abs() < 1e-12, "{a:?} {b}");
    close(depth(Shape::Ball(0.5), at, ahead), 2.5);
    // Seen at 0.1 to the side: z^2 (1 + 0.01) - 6 z + 9 - 0.25 = 0.
    let expected = (6.0 - f64::sqrt(36.0 - 4.0 * 1.01 * 8.75)) / 2.02;
    close(depth(Shape::Ball(0.5), at, Vector3::new(0.1, 0.0, 1.0)), expected);
    close(depth(Shape::Cuboid(Vector3::new(0.5, 0.5, 0.2)), at, Vector3::new(0.1, -0.1, 1.0)), 2.8);
    assert_eq!(
        depth(Shape::Cuboid(Vector3::new(0.2, 0.5, 0.2)), at, Vector3::new(0.1, 0.0, 1.0)),
        None
    );
    close(depth(Shape::Drum { radius: 0.4, half_height: 0.25 }, at, ahead), 2.75);
    close(
        depth(Shape::Drum { radius: 0.4, half_height: 0.25 }, at, Vector3::new(0.12, 0.0, 1.0)),
        2.75,
    );
    // From the side: its axis is the ray's y axis.
    let lying = Isometry3::new(at, Vector3::x() * std::f64::consts::FRAC_PI_2);
    let drum = alone(Shape::Drum { radius: 0.4, half_height: 0.25 }, lying);
    let hit = cast(&drum, &Vector3::zeros(), &ahead).unwrap();
    assert!((hit.t - 2.6).abs() < 1e-9);
    close(depth(Shape::Shell(Vector3::new(2.0, 1.0, 4.0)), Vector3::zeros(), ahead), 4.0);
    close(
        depth(
            Shape::Shell(Vector3::new(2.0, 1.0, 4.0)),
            Vector3::zeros(),
            Vector3::new(0.0, 0.5, 1.0),
        ),
        2.0,
    );
}

fn small() -> Camera {
    Film::kinect(4).camera
}

fn pictures(room: &Room, camera: &Camera, poses: &[Pose]) -> Vec<Picture> {
    let rays = camera.rays();
    let taker = RoomCamera::new(room, camera, &rays);
    poses.iter().map(|p| taker.take(&p.world_from_camera)).collect()
}

/// The tiles miss nothing: every pixel is what a single ray through the whole room meets.
#[test]
fn pictures_are_what_single_rays_meet() {
    let (room, camera) = (Room::office(Seed(2)), small());
    let rays = camera.rays();
    for pose in around_the_desks().iter().step_by(210) {
        let picture = &pictures(&room, &camera, &[*pose])[0];
        let eye = pose.world_from_camera;
        for i in (0..camera.pixels()).step_by(7) {
            let (x, y) = rays.at(i);
            let direction = eye.rotation * Vector3::new(x, y, 1.0);
            let hit = cast(&room, &eye.translation.vector, &direction).expect("walls all round");
            assert!((f64::from(picture.seen.depth[i]) - hit.t).abs() < 1e-5 * hit.t);
            let normal = eye.rotation.inverse() * hit.normal;
            let seen = Vector3::from(picture.seen.normal[i]).cast::<f64>();
            if picture.seen.surface[i] == hit.surface {
                assert!((normal - seen).norm() < 1e-5);
            }
        }
    }
}

#[test]
fn normals_are_of_unit_length_and_face_the_camera() {
    let (room, camera) = (Room::office(Seed(2)), small());
    let rays = camera.rays();
    for pose in around_the_desks().iter().step_by(170) {
        let seen = &pictures(&room, &camera, &[*pose])[0].seen;
        let mut flat = Vec::new();
        for i in 0..camera.pixels() - camera.width - 1 {
            let normal = Vector3::from(seen.normal[i]).cast::<f64>();
            let point = |j: usize| {
                let (x, y) = rays.at(j);
                Vector3::new(x, y, 1.0) * f64::from(seen.depth[j])
            };
            assert!((normal.norm() - 1.0).abs() < 1e-5);
            assert!(normal.dot(&point(i)) < 1e-6, "pixel {i} sees a back");
            let (right, below) = (i + 1, i + camera.width);
            if seen.surface[right] == seen.surface[i] && seen.surface[below] == seen.surface[i] {
                // The normal spanned by three neighbouring points, whatever the shape.
                let spanned = (point(below) - point(i)).cross(&(point(right) - point(i)));
                flat.push(spanned.normalize().dot(&normal).clamp(-1.0, 1.0).acos());
            }
        }
        flat.sort_by(f64::total_cmp);
        assert!(flat[flat.len() / 2] < 1e-2, "median {} rad", flat[flat.len() / 2]);
        assert!(flat[flat.len() * 9 / 10] < 0.1);
    }
}

/// Points seen in frame A lie, by the two poses, on a surface seen from B or behind one.
#[test]
fn points_of_one_frame_lie_on_the_surfaces_of_another() {
    let (room, camera) = (Room::office(Seed(2)), small());
    let rays = camera.rays();
    let path = around_the_desks();
    for (a, b) in [(0, 15), (300, 330), (700, 640), (1100, 1145)] {
        let seen = &pictures(&room, &camera, &[path[a]])[0].seen;
        let from_b = path[b].world_from_camera;
        let (mut visible, mut all) = (0, 0);
        for i in (0..camera.pixels()).step_by(11) {
            let (x, y) = rays.at(i);
            let in_a = Point3::from(Vector3::new(x, y, 1.0) * f64::from(seen.depth[i]));
            let in_world = path[a].world_from_camera * in_a;
            let way = in_world.coords - from_b.translation.vector;
            let hit = cast(&room, &from_b.translation.vector, &way).expect("a wall at least");
            // `way` ends at the point, so the point is at t = 1.
            assert!(hit.t < 1.0 + 1e-5, "pixel {i} of frame {a} hangs in the air: {}", hit.t);
            visible += usize::from(hit.t > 1.0 - 1e-5);
            all += 1;
        }
        assert!(visible * 10 > all * 6, "{visible} of {all} visible from frame {b}");
    }
}

fn assert_clear(room: &Room, poses: &[Pose], least: f64) {
    for pose in poses {
        let at = pose.world_from_camera.translation.vector;
        let (clearance, body) = room.clearance(&at);
        assert!(clearance >= least, "{at:?}: {clearance} m from body {body}");
        assert!(at.x.abs() < 0.5 * FLOOR_M && at.y.abs() < 0.5 * FLOOR_M);
        assert!(at.z > 0.0 && at.z < CEILING_M);
    }
}

#[test]
fn the_default_path_touches_nothing() {
    assert_clear(&Room::office(Seed(1)), &around_the_desks(), CLEARANCE_M);
}

/// Three motion-capture paths: around desks, along desks, and almost still.
#[test]
fn real_paths_fit_and_touch_nothing() {
    let room = Room::office(Seed(1));
    for name in ["fr2_desk", "fr1_desk", "fr1_xyz"] {
        let file = format!("tum_trajectories/{name}_groundtruth.txt");
        let Some(file) = common::data(&file) else { return };
        let read = read_trajectory(&file).unwrap();
        let poses = resample(&read.poses, None).unwrap().poses;
        let (room_from_world, _) = place(&room, &poses).unwrap();
        let mut moved = poses.clone();
        moved.iter_mut().for_each(|p| p.world_from_camera = room_from_world * p.world_from_camera);
        assert_clear(&room, &moved, CLEARANCE_M);
        // Rigid: distances between poses are preserved.
        let gap = |p: &[Pose]| {
            let [a, b] = [0, p.len() / 3].map(|k| p[k].world_from_camera.translation.vector);
            (a - b).norm()
        };
        assert!((gap(&poses) - gap(&moved)).abs() < 1e-9);
        if name == "fr2_desk" {
            let full = |p: &Pose| p.world_from_camera.translation.vector.xy();
            let quadrants = moved.iter().map(|p| (full(p).x > 0.0, full(p).y > 0.0));
            let seen: std::collections::BTreeSet<_> = quadrants.collect();
            assert_eq!(seen.len(), 4, "it circles the desks");
        }
    }
}

fn pose(stamp: f64, at: Vector3<f64>, turn: Vector3<f64>) -> Pose {
    Pose { stamp, world_from_camera: Isometry3::new(at, turn) }
}

#[test]
fn resampling_keeps_straight_motion_and_follows_a_curve() {
    let straight = |t: f64| pose(t, Vector3::new(t, 2.0 * t, 1.0), Vector3::z() * 0.3 * t);
    let samples: Vec<Pose> = [0.0, 0.1, 0.15, 0.3, 0.5].map(straight).to_vec();
    let found = resample(&samples, None).unwrap();
    assert!(found.gaps_s.is_empty());
    assert_eq!(found.poses.len(), 16);
    for p in &found.poses {
        let off = p.world_from_camera.inverse() * straight(p.stamp).world_from_camera;
        assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-9);
    }
    let curve = |t: f64| pose(t, Vector3::new(t.sin(), t.cos(), 1.0), Vector3::z() * t);
    let samples: Vec<Pose> = (0..=40).map(|k| curve(0.1 * f64::from(k))).collect();
    for p in resample(&samples, None).unwrap().poses {
        let off = p.world_from_camera.inverse() * curve(p.stamp).world_from_camera;
        // Inside the path the cubic is accurate to (0.1 s)^4; at its ends velocities are one-sided.
        let limit = if (0.2..3.8).contains(&p.stamp) { 3e-5 } else { 2e-3 };
        assert!(off.translation.vector.norm() < limit, "{}: {}", p.stamp, off.translation);
    }
}

#[test]
fn a_gap_is_told_and_glided_through_without_overshoot() {
    let before = (0..30)
        .map(|k| pose(k as f64 * 0.01, Vector3::new(k as f64 * 0.01, 0.0, 1.0), Vector3::zeros()));
    let after = (0..30).map(|k| {
        pose(5.0 + k as f64 * 0.01, Vector3::new(1.0, k as f64 * 0.01, 1.0), Vector3::zeros())
    });
    let samples: Vec<Pose> = before.chain(after).collect();
    let found = resample(&samples, None).unwrap();
    assert_eq!(found.gaps_s.len(), 1);
    assert!((found.gaps_s[0] - 4.71).abs() < 1e-9);
    for w in found.poses.windows(2) {
        let [a, b] = [0, 1].map(|k: usize| w[k].world_from_camera.translation.vector);
        assert!((b - a).norm() < 0.04, "a jump at {}", w[0].stamp);
        assert!(b.x > -0.2 && b.x < 1.2 && b.y > -0.3 && b.y < 0.6, "{b:?}");
    }
    assert_eq!(resample(&samples, Some(7)).unwrap().poses.len(), 7);
    let nanoseconds: Vec<Pose> =
        samples.iter().map(|p| Pose { stamp: p.stamp * 1e9, ..*p }).collect();
    assert!(resample(&nanoseconds, None).unwrap_err().to_string().contains("seconds"));
}

#[test]
fn a_path_larger_than_the_room_is_refused_with_its_size() {
    let eye = |k: i32| Vector3::new(f64::from(k), 0.0, 1.5);
    let poses: Vec<Pose> = (0..12)
        .map(|k| Pose {
            stamp: f64::from(k),
            world_from_camera: looking(eye(k), eye(k) + Vector3::new(1.0, 0.2, -0.3)),
        })
        .collect();
    let message = place(&Room::office(Seed(1)), &poses).unwrap_err().to_string();
    assert!(message.contains("11.0 x 0.0 m") && message.contains("--frames"), "{message}");
}

/// The words scatter about the true depth as the model says, over all tilts in a room.
#[test]
fn depth_scatters_by_the_models_sigma() {
    let film = Film {
        sensor: Film::kinect(2),
        room: Room::office(Seed(3)),
        poses: around_the_desks(),
        physics: Physics::Formula { sigma: common::truth(), effects: Vec::new() },
        seed: Seed(3),
    };
    let rays = film.sensor.camera.rays();
    let mut shutter = Shutter::new(&film, &film.sensor, &rays).unwrap();
    let (picture, depth) = shutter.shoot(100..101).remove(0);
    let mut scores: Vec<f64> = Vec::new();
    for (i, &word) in depth.raw.iter().enumerate() {
        let z = f64::from(picture.seen.depth[i]);
        let sigma = common::truth().sigma(z, picture.seen.theta(i));
        // Sigma below a fiftieth of the depth: the conversion through disparity is nearly linear.
        if sigma < 0.02 * z {
            scores.push((Film::CODE.metres(word).unwrap() - z) / sigma);
        }
    }
    let n = scores.len() as f64;
    assert!(n > 60_000.0, "{n}");
    let mean = scores.iter().sum::<f64>() / n;
    let sd = (scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n).sqrt();
    assert!(mean.abs() < 4.0 / n.sqrt() && (sd - 1.0).abs() < 0.02, "{mean} {sd}");
}

fn films(output: &Path, extra: &[&str]) {
    let mut command = common::kinoise();
    command.args(["simulate", "--room", "--shrink", "4"]).arg(output).args(extra);
    command.assert().success();
}

fn tree(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            files.extend(tree(&path).into_iter().map(|(k, v)| (format!("{name}/{k}"), v)));
        } else {
            files.insert(name, std::fs::read(path).unwrap());
        }
    }
    files
}

#[test]
fn the_folder_is_a_tum_sequence_that_the_reader_opens() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("film");
    films(&root, &["--frames", "3", "--stride", "20"]);
    let rows = |name: &str| -> Vec<Vec<String>> {
        let text = std::fs::read_to_string(root.join(name)).unwrap();
        let lines = text.lines().filter(|l| !l.starts_with('#'));
        lines.map(|l| l.split(' ').map(str::to_owned).collect()).collect()
    };
    let (rgb, depth, truth) = (rows("rgb.txt"), rows("depth.txt"), rows("groundtruth.txt"));
    assert_eq!((rgb.len(), depth.len(), truth.len()), (3, 3, 3));
    let path = around_the_desks();
    for k in 0..3 {
        assert!(rgb[k][0] == depth[k][0] && depth[k][0] == truth[k][0], "one clock");
        let numbers: Vec<f64> = truth[k].iter().map(|w| w.parse().unwrap()).collect();
        let expected = &path[20 * k];
        assert!((numbers[0] - expected.stamp).abs() < 1e-6);
        let q = nalgebra::Quaternion::new(numbers[7], numbers[4], numbers[5], numbers[6]);
        let turn = UnitQuaternion::from_quaternion(q);
        assert!(turn.angle_to(&expected.world_from_camera.rotation) < 1e-6);
        let at = Vector3::new(numbers[1], numbers[2], numbers[3]);
        assert!((at - expected.world_from_camera.translation.vector).norm() < 1e-6);
        let colour = image::open(root.join(&rgb[k][1])).unwrap();
        assert_eq!((colour.width(), colour.height()), (160, 120));
        assert_eq!(colour.color(), image::ColorType::Rgb8);
        let frame = FrameSource::new(160, 120).read(&root.join(&depth[k][1])).unwrap();
        assert!(frame.raw.iter().all(|&w| w < 60_000), "5000 units a metre: below 12 m");
    }
    let recording = open(&root, &Assumed::default()).unwrap();
    assert_eq!(recording.sensor.camera, Film::kinect(4).camera);
    assert_eq!(recording.sensor.code, Film::CODE);
    let told = std::fs::read_to_string(root.join("recording.json")).unwrap();
    assert!(!told.contains("effect") && !told.contains("sigma"));
    // A second film into the same folder is refused.
    let mut again = common::kinoise();
    again.args(["simulate", "--room", "--frames", "1"]).arg(&root).assert().code(2);
}

#[test]
fn one_seed_gives_the_same_bytes_with_one_and_two_threads() {
    let folder = tempfile::tempdir().unwrap();
    let shots = [
        ("one", ["--seed", "7", "--threads", "1"]),
        ("two", ["--seed", "7", "--threads", "2"]),
        ("other", ["--seed", "8", "--threads", "2"]),
    ];
    for effects in [&[][..], &["--effect", "spatial-correlation"][..]] {
        let trees: Vec<_> = shots
            .iter()
            .map(|(name, options)| {
                let root = folder.path().join(format!("{name}{}", effects.len()));
                let extra = [&["--frames", "5", "--stride", "9"], &options[..], effects].concat();
                films(&root, &extra);
                tree(&root)
            })
            .collect();
        assert!(trees[0] == trees[1], "threads change bytes");
        let differ = |kind: &str| {
            let of = |t: &BTreeMap<String, Vec<u8>>| -> Vec<Vec<u8>> {
                t.iter().filter(|(k, _)| k.starts_with(kind)).map(|(_, v)| v.clone()).collect()
            };
            of(&trees[1]).iter().zip(&of(&trees[2])).all(|(a, b)| a != b)
        };
        assert!(differ("rgb/") && differ("depth/"), "the seed is not used");
    }
}

#[test]
fn a_bad_trajectory_is_told_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let good = "# a comment\n1.0 0 0 1.4 0 0 0 1\n";
    let cases = [
        ("empty", String::new(), "no pose"),
        ("comment", "# only this\n".into(), "no pose"),
        ("nan", format!("{good}2.0 nan 0 1.4 0 0 0 1\n"), "line 3"),
        ("infinite", format!("{good}inf 0 0 1.4 0 0 0 1\n"), "line 3"),
        ("unsorted", format!("{good}\n0.5 0 0 1.4 0 0 0 1\n"), "line 4"),
        ("zero", format!("{good}2.0 0 0 1.4 0 0 0 0\n"), "line 3"),
        ("short", format!("{good}2.0 0 0 1.4 0 0 0\n"), "line 3"),
        ("word", format!("{good}2.0 0 0 up 0 0 0 1\n"), "line 3"),
    ];
    for (name, text, told) in cases {
        let file = folder.path().join(format!("{name}.txt"));
        std::fs::write(&file, text).unwrap();
        let mut command = common::kinoise();
        command.args(["simulate", "--room", "--trajectory"]).arg(&file);
        let output = command.arg(folder.path().join("out")).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(&format!("{name}.txt")) && message.contains(told), "{message}");
        assert!(!folder.path().join("out").exists(), "nothing is begun");
    }
}

/// Projected dots on the furniture, matched: on wide faces the measured disparities agree with the true
/// depths within the sensor's usual noise, and an unknown lens distortion increases their errors.
#[test]
fn a_room_is_filmed_by_light() {
    let film = |lens_k1: f64| {
        let causes = Causes::default().with("lens_k1", lens_k1).unwrap();
        let film = Film {
            sensor: Film::kinect(2),
            room: Room::office(Seed(3)),
            poses: around_the_desks()[..2].to_vec(),
            physics: Physics::Speckle { causes },
            seed: Seed(3),
        };
        let rays = film.sensor.camera.rays();
        let sensor = Sensor { code: Film::CODE, ..film.sensor.clone() };
        let shots = Shutter::new(&film, &sensor, &rays).unwrap().shoot(0..2);
        let pixels_m = sensor.camera.fx * sensor.baseline_m.unwrap();
        let errors = |(picture, depth): &(Picture, Frame)| -> Vec<f64> {
            let (width, seen) = (depth.width, &picture.seen);
            // The whole matching window is on one face.
            let is_inside = |i: &usize| {
                let (u, v) = (i % width, i / width);
                let inside = (6..width - 6).contains(&u) && (6..depth.height - 6).contains(&v);
                let same = |j: usize| seen.surface[j] == seen.surface[*i];
                inside && (0..13).all(|k| (0..13).all(|l| same(i + k * width + l - 6 * width - 6)))
            };
            let off = |i: usize| {
                let z = Film::CODE.metres(depth.raw[i])?;
                Some(pixels_m * (1.0 / z - 1.0 / f64::from(seen.depth[i])))
            };
            (0..depth.raw.len()).filter(is_inside).filter_map(off).collect()
        };
        assert_ne!(shots[0].1, shots[1].1);
        let measured = shots[0].1.raw.iter().filter(|w| **w != 0).count();
        assert!(measured as f64 > 0.6 * shots[0].1.raw.len() as f64, "{measured} measured");
        let mut all: Vec<f64> = shots.iter().flat_map(errors).collect();
        assert!(all.len() > 10_000, "{} on wide faces", all.len());
        all.iter_mut().for_each(|e| *e = e.abs());
        all.sort_by(f64::total_cmp);
        [0.5, 0.9].map(|share| all[(share * all.len() as f64) as usize])
    };
    let [median, most] = film(0.0);
    // Disparity noise is .1 px at some metres: half of a Gaussian lies within .67 of that and nine tenths
    // within 1.64; slanted faces have more.
    assert!(median < 0.1 && most < 0.3, "{median} px, {most} px");
    let bent = film(0.1);
    assert!(bent[0] > 1.3 * median && bent[1] > 1.3 * most, "{bent:?} px against {median}, {most}");
}

#[test]
fn options_of_a_bench_are_refused_in_a_room() {
    for extra in [
        &["--clutter", "2"][..],
        &["--grid", "paper"],
        &["--infrared"],
        &["--board", "1,1"],
        &["--physics", "speckle", "--cause", "bow_m=0.01"],
        &["--effect", "target-bow:sagitta_m=0.01"],
    ] {
        let mut command = common::kinoise();
        command.args(["simulate", "never-written", "--room"]).args(extra).assert().code(2);
    }
    common::kinoise().args(["simulate", "never-written", "--stride", "2"]).assert().code(2);
    assert!(!Path::new("never-written").exists());
}

/// Sigma in the whole room, not only in the range that the paper measured.
#[test]
fn the_published_models_film_too() {
    let folder = tempfile::tempdir().unwrap();
    for (k, sigma) in [SigmaModel::paper(), SigmaModel::nguyen()].into_iter().enumerate() {
        let film = Film {
            sensor: Film::kinect(8),
            room: Room::office(Seed(1)),
            poses: around_the_desks()[..2].to_vec(),
            physics: Physics::Formula { sigma, effects: Vec::new() },
            seed: Seed(1),
        };
        film.write(&folder.path().join(k.to_string()), &|_, _| ()).unwrap();
    }
}
