//! Lists and trajectories of the TUM layout, and poses of 7-Scenes.

use std::fmt::Write;

use kinoise::evaluate::{Delta, evaluate};
use kinoise::io::{Assumed, read_list, write_recording_file};
use kinoise::sequence::{self, Sequence};
use std::path::Path;

use kinoise::trajectory::{Pose, read_benchmark, read_trajectory, tum_text};

use super::desk::{Desk, assumed, check_sensor, frame_png, read, sensor};

/// The lists of a TUM folder, with their content while another one is under test.
const LISTS: [(&str, &str); 4] = [
    ("depth.txt", "0.0 0.png\n0.1 1.png\n0.2 2.png\n"),
    ("rgb.txt", "0.01 0.png\n0.11 1.png\n"),
    ("associations.txt", "0.0 0.png 0.0 0.png\n0.1 1.png 0.1 1.png\n"),
    ("groundtruth.txt", "0 0 0 0 0 0 0 1\n0.1 0 0 0.1 0 0 0 1\n"),
];

/// The first byte selects the list that the other bytes are; associations replace rgb.txt.
pub fn list(data: &[u8]) -> bool {
    thread_local! {
        static DESK: Desk = {
            let image = frame_png();
            let desk = Desk::new(&[("0.png", &image), ("1.png", &image), ("2.png", &image)]);
            write_recording_file(desk.root(), &sensor()).expect("written");
            desk
        };
    }
    let Some((&which, text)) = data.split_first() else { return false };
    let tested = usize::from(which) % LISTS.len();
    DESK.with(|desk| {
        let path = |k: usize| desk.root().join(LISTS[k].0);
        for (k, (name, usual)) in LISTS.iter().enumerate() {
            let _ = std::fs::remove_file(path(k));
            // With either of rgb.txt and associations.txt, the other is not read.
            let is_there = !matches!((tested, k), (1, 2) | (2, 1));
            if k == tested {
                desk.put(name, text);
            } else if is_there && k != 2 {
                desk.put(name, usual.as_bytes());
            }
        }
        if let Ok(list) = read_list(&path(tested)) {
            let mut written = String::new();
            for frame in &list.frames {
                let _ = writeln!(written, "{} {}", frame.timestamp, frame.path.display());
            }
            let again = desk.put("written.txt", written.as_bytes());
            assert_eq!(read_list(&again).expect("what was written is read").frames, list.frames);
        }
        let Ok(sequence) = sequence::open(desk.root(), &Assumed::default()) else { return false };
        check(&sequence);
        true
    })
}

fn check(sequence: &Sequence) {
    check_sensor(&sequence.sensor);
    let table = sequence.sensor.code.table();
    assert!(sequence.moments.is_sorted_by(|a, b| a.stamp < b.stamp), "stamps");
    for moment in sequence.moments.iter().take(16) {
        assert!(moment.stamp.is_finite());
        read(&sequence.sensor, &moment.depth, &table);
        let _ = sequence.colour(moment);
    }
    check_poses(&sequence.truth);
}

fn check_poses(poses: &[Pose]) {
    assert!(poses.is_sorted_by(|a, b| a.stamp <= b.stamp), "times");
    for Pose { stamp, world_from_camera } in poses {
        let (place, turn) = (world_from_camera.translation, world_from_camera.rotation);
        assert!(stamp.is_finite() && place.vector.iter().all(|v| v.is_finite()));
        assert!((turn.coords.norm() - 1.0).abs() < 1e-9, "{turn:?}");
    }
}

/// A trajectory, read both ways, written, and evaluated against itself.
pub fn trajectory(data: &[u8]) -> bool {
    thread_local! {
        static DESK: Desk = Desk::new(&[]);
    }
    DESK.with(|desk| {
        let path = desk.put("poses.txt", data);
        let mut is_one = false;
        let in_order = |path: &Path| read_trajectory(path).map(|t| t.poses);
        for read in [in_order, read_benchmark] {
            let Ok(poses) = read(&path) else { continue };
            is_one = true;
            check_poses(&poses);
            let again = desk.put("again.txt", tum_text(&poses).as_bytes());
            let again = read_benchmark(&again).expect("what was written is read");
            // Stamps are written to the microsecond: closer ones become equal.
            if again.len() == poses.len() {
                for (a, b) in poses.iter().zip(&again) {
                    let off = a.world_from_camera.inv_mul(&b.world_from_camera);
                    let far = a.world_from_camera.translation.vector.norm();
                    assert!((a.stamp - b.stamp).abs() <= 1e-6 + 1e-15 * a.stamp.abs());
                    let metres = off.translation.vector.norm();
                    assert!(metres < 1e-8 * (1.0 + far) && off.rotation.angle() < 1e-7);
                }
            }
            if let Ok(errors) = evaluate(&poses, &poses, Delta::Frames(1)) {
                let (ate, far) = (errors.ate.error.rmse, farthest(&poses));
                assert!(ate >= 0.0 && ate <= 1e-6 * (1.0 + far), "{ate} m of {far} m");
            }
        }
        is_one
    })
}

fn farthest(poses: &[Pose]) -> f64 {
    let places = poses.iter().map(|p| p.world_from_camera.translation.vector.norm());
    places.fold(0.0, f64::max)
}

/// A pose of 7-Scenes beside its image.
pub fn scenes(data: &[u8]) -> bool {
    thread_local! {
        static DESK: Desk = Desk::new(&[("frame-000003.depth.png", &frame_png())]);
    }
    DESK.with(|desk| {
        let opened = |text: &[u8]| {
            desk.put("frame-000003.pose.txt", text);
            sequence::open(desk.root(), &assumed())
        };
        let Ok(first) = opened(data) else { return false };
        check(&first);
        let Some(pose) = first.truth.first() else { return true };
        let mut text = String::new();
        for row in pose.world_from_camera.to_homogeneous().row_iter() {
            let _ = writeln!(text, "{:e} {:e} {:e} {:e}", row[0], row[1], row[2], row[3]);
        }
        let again = opened(text.as_bytes()).expect("what was written is read");
        let again = again.truth.first().expect("a pose").world_from_camera;
        let far = pose.world_from_camera.translation.vector.norm();
        let off = pose.world_from_camera.inv_mul(&again);
        assert!(off.translation.vector.norm() < 1e-9 * (1.0 + far) && off.rotation.angle() < 1e-6);
        true
    })
}
