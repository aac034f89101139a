//! In every format, what is written reads back unchanged, whatever the numbers.

use std::path::Path;

use kinoise::io::{
    Assumed, FrameSource, encode_pgm16, encode_png16, encode_png16_quickly, open, open_uncut,
    read_list, write_recording_file, write_view_notes,
};
use kinoise::measure::read_table;
use kinoise::sensors::SensorKind;
use kinoise::trajectory::{Pose, read_benchmark, read_trajectory, tum_text};
use kinoise::view::{IntrinsicsUncertainty, Region, TargetSize, ViewNotes};
use kinoise::{Camera, DepthCode, Frame, Sensor};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::option::of;
use proptest::prelude::*;

use crate::common::write_dump;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder")
}

prop_compose! {
    fn frame()(width in 1usize..40, height in 1usize..30)(
        raw in prop::collection::vec(any::<u16>(), width * height), width in Just(width), height in Just(height)
    ) -> Frame {
        Frame { width, height, raw }
    }
}

fn code() -> impl Strategy<Value = DepthCode> {
    let metric = (10.0f64..1e6, any::<u16>())
        .prop_map(|(units_per_metre, invalid)| DepthCode::Metric { units_per_metre, invalid });
    let raw = (-100.0f64..100.0, 1e-7f64..1.0, any::<bool>(), any::<u16>()).prop_map(
        |(offset, slope, falls, invalid)| {
            let slope = if falls { -slope } else { slope };
            DepthCode::Disparity { offset, slope, invalid }
        },
    );
    prop_oneof![metric, raw]
}

prop_compose! {
    fn sensor()(
        name in any::<String>(), serial in of(any::<String>()), mode in of("near|normal"),
        width in 8usize..64, height in 8usize..48, view in 0.5f64..3.0, aspect in 0.85f64..1.2,
        centre in (0.1f64..0.9, 0.1f64..0.9), lens in of(prop::array::uniform5(-1e-3f64..1e-3)),
        baseline_m in of(0.005f64..3.0), code in code(), uncertain in of(0.01f64..0.9),
        kind in of(prop::sample::select(SensorKind::ALL)),
    ) -> Sensor {
        let fx = view * width as f64;
        let camera = Camera {
            width, height, fx, fy: fx * aspect,
            cx: centre.0 * (width as f64 - 1.0), cy: centre.1 * (height as f64 - 1.0),
            distortion: lens,
        };
        let uncertain = uncertain
            .map(|u| IntrinsicsUncertainty { fx: Some(u), cy: Some(u), ..Default::default() });
        Sensor { name, serial, mode, camera, baseline_m, code, intrinsics_uncertainty: uncertain, kind }
    }
}

fn region() -> impl Strategy<Value = Option<Region>> {
    let at = || -1e4f64..1e4;
    let rectangle = (at(), at(), 1e-3f64..1e4, 1e-3f64..1e4)
        .prop_map(|(u, v, w, h)| Region::Rectangle([u, v, u + w, v + h]));
    let corners = prop::collection::vec([at(), at()], 3..9);
    of(prop_oneof![rectangle, corners.prop_map(Region::Polygon)])
}

prop_compose! {
    fn notes()(
        size in of((0.001f64..100.0, 0.001f64..100.0, of(1e-6f64..1.0))), distance in of(0.001f64..100.0),
        uncertain in of(1e-6f64..1.0), region in region(), temperature_c in of(-100.0f64..200.0),
        ambient_lux in of(0.0f64..1e6), notes in of(any::<String>()),
    ) -> ViewNotes {
        ViewNotes {
            target: size.map(|(width_m, height_m, flat)| TargetSize {
                width_m, height_m, flatness_m: flat.map(|f| 0.1 * f * width_m.min(height_m)),
            }),
            reference_distance_m: distance,
            reference_uncertainty_m: distance.and_then(|d| uncertain.map(|u| 0.9 * u * d)),
            region, temperature_c, ambient_lux, notes,
        }
    }
}

prop_compose! {
    fn pose()(at in prop::array::uniform3(-1e4f64..1e4), turn in prop::array::uniform3(-3.0f64..3.0)) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        Isometry3::from_parts(Translation3::from(Vector3::from(at)), rotation)
    }
}

/// Writes a recording of one view with one frame.
fn write(root: &Path, sensor: &Sensor, notes: &ViewNotes) {
    let Camera { width, height, .. } = sensor.camera;
    let frame = Frame { width, height, raw: vec![700; width * height] };
    std::fs::create_dir_all(root.join("a")).expect("made");
    std::fs::write(root.join("a/0.png"), encode_png16(&frame).expect("encoded")).expect("written");
    std::fs::write(root.join("a/depth.txt"), "0 0.png\n").expect("written");
    write_recording_file(root, sensor).expect("written");
    write_view_notes(&root.join("a"), notes).expect("written");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn depth_images(frame in frame()) {
        let folder = folder();
        let (png, quick, pgm) = (encode_png16(&frame), encode_png16_quickly(&frame), encode_pgm16(&frame));
        for (name, bytes) in [("a.png", png.unwrap()), ("b.png", quick.unwrap()), ("d-1.000000-1.pgm", pgm)] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            prop_assert_eq!(&FrameSource::new(frame.width, frame.height).read(&path).unwrap(), &frame);
        }
    }

    #[test]
    fn sensors_and_views(sensor in sensor(), notes in notes()) {
        prop_assume!(sensor.fault().is_none() && notes.fault().is_none());
        let folder = folder();
        write(folder.path(), &sensor, &notes);
        match open(folder.path(), &Assumed::default()) {
            Ok(read) => {
                prop_assert_eq!(&read.sensor, &sensor);
                prop_assert_eq!(&read.views[0].notes, &notes);
            }
            // 700 everywhere may be no depth in this code; the error then names raw disparities.
            Err(e) => prop_assert!(e.to_string().contains("raw disparities"), "{}", e),
        }
    }

    #[test]
    fn lists(stamps in prop::collection::vec(-1e10f64..1e10, 1..20)) {
        let folder = folder();
        let mut sorted = stamps.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        let mut text = String::from("# a list\n");
        for (k, stamp) in sorted.iter().enumerate() {
            std::fs::write(folder.path().join(format!("{k} of all.png")), "").unwrap();
            text += &format!("{stamp}\t {k} of all.png \r\n");
        }
        let path = folder.path().join("depth.txt");
        std::fs::write(&path, text).unwrap();
        let list = read_list(&path).unwrap();
        prop_assert!(list.remarks.is_empty(), "{:?}", list.remarks);
        prop_assert_eq!(list.frames.iter().map(|f| f.timestamp).collect::<Vec<_>>(), sorted);
    }

    #[test]
    fn trajectories(poses in prop::collection::vec(pose(), 1..12), start in 0.0f64..2e9) {
        let poses: Vec<Pose> = (0..).zip(poses)
            .map(|(k, world_from_camera)| Pose { stamp: start + f64::from(k) / 30.0, world_from_camera })
            .collect();
        let folder = folder();
        let path = folder.path().join("poses.txt");
        std::fs::write(&path, tum_text(&poses)).unwrap();
        let in_order = read_trajectory(&path).unwrap();
        prop_assert_eq!(in_order.repeated, 0);
        for again in [in_order.poses, read_benchmark(&path).unwrap()] {
            prop_assert_eq!(again.len(), poses.len());
            for (a, b) in again.iter().zip(&poses) {
                let off = a.world_from_camera.inv_mul(&b.world_from_camera);
                prop_assert!((a.stamp - b.stamp).abs() < 1e-6, "{} {}", a.stamp, b.stamp);
                prop_assert!(off.translation.vector.norm() < 1e-4 && off.rotation.angle() < 1e-7);
            }
        }
    }

    #[test]
    fn tables(rows in prop::collection::vec((0.01f64..99.0, 0.0f64..1.57, 1e-6f64..10.0, 1.0f64..1e9), 1..30)) {
        let folder = folder();
        let path = folder.path().join("table.csv");
        let lines = rows.iter().map(|(z, theta, sigma, n)| format!("{n},{sigma},x,{z},{theta}\n"));
        std::fs::write(&path, format!("n,sigma_m,note,z_m,theta_rad\n{}", lines.collect::<String>())).unwrap();
        let read: Vec<_> = read_table(&path).unwrap().rows.iter()
            .map(|r| (r.z_m, r.theta_rad, r.sigma_m, r.n_effective.unwrap())).collect();
        prop_assert_eq!(read, rows);
    }

    #[test]
    fn dumps(words in prop::collection::vec(300u16..1090, 1..4)) {
        let frames: Vec<Frame> = words.iter()
            .map(|&w| {
                let raw = (0..640 * 480).map(|i| if i % 97 == 0 { 2047 } else { w + (i % 3) as u16 });
                Frame { width: 640, height: 480, raw: raw.collect() }
            })
            .collect();
        let folder = folder();
        let root = folder.path().join("dump");
        write_dump(&root, frames.iter().enumerate().map(|(k, f)| (k as f64 / 30.0, f)));
        let read = open_uncut(&root, &Assumed::default()).unwrap();
        let mut source = FrameSource::new(640, 480);
        let again: Vec<Frame> = read.views[0].depth.iter().map(|f| source.frame(f).unwrap()).collect();
        prop_assert_eq!(again, frames);
    }
}
