//! A folder for a reader's files, and checks that hold for every recording that opens.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::frame::DepthTable;
use kinoise::io::{Assumed, FrameSource, encode_png16};
use kinoise::view::FrameRef;
use kinoise::{Camera, DepthCode, Frame, Recording, Sensor};

pub struct Desk(tempfile::TempDir);

impl Desk {
    pub fn new(files: &[(&str, &[u8])]) -> Self {
        let desk = Desk(tempfile::tempdir().expect("a folder"));
        for (name, bytes) in files {
            desk.put(name, bytes);
        }
        desk
    }

    pub fn root(&self) -> &Path {
        self.0.path()
    }

    pub fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.root().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("made");
        fs::write(&path, bytes).expect("written");
        path
    }
}

/// A small sensor, fx = fy = 8 px.
pub fn sensor() -> Sensor {
    Sensor {
        name: "small".into(),
        serial: None,
        mode: None,
        camera: Camera::centred(8, 6, 8.0),
        baseline_m: Some(0.075),
        code: DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 },
        intrinsics_uncertainty: None,
        kind: None,
    }
}

/// Assumptions that fit its images.
pub fn assumed() -> Assumed {
    let Sensor { camera, code, .. } = sensor();
    let intrinsics = Some([camera.fx, camera.fy, camera.cx, camera.cy]);
    Assumed { intrinsics, code: Some(code), ..Assumed::default() }
}

pub fn frame() -> Frame {
    Frame { width: 8, height: 6, raw: (0..48).map(|i| 1500 + 7 * (i % 11)).collect() }
}

pub fn frame_png() -> Vec<u8> {
    encode_png16(&frame()).expect("encoded")
}

/// Maximum number of frames to check: more show nothing new.
const MAX_FRAMES: usize = 64;

/// Checks that the recording's numbers are valid, and that every frame is one or an error, whatever the
/// order of reading.
pub fn check(recording: &Recording) {
    check_sensor(&recording.sensor);
    let frames: Vec<&FrameRef> =
        recording.views.iter().flat_map(|v| v.depth.iter().chain(&v.infrared)).collect();
    assert!(frames.iter().all(|f| f.timestamp.is_finite()), "a stamp");
    let depth: Vec<&FrameRef> =
        recording.views.iter().flat_map(|v| &v.depth).take(MAX_FRAMES).collect();
    let table = recording.sensor.code.table();
    let forwards: Vec<Option<Frame>> =
        depth.iter().map(|f| read(&recording.sensor, f, &table)).collect();
    let backwards = depth.iter().rev().map(|f| read(&recording.sensor, f, &table));
    assert!(forwards.into_iter().rev().eq(backwards), "frames depend on the order of reading");
    for view in &recording.views {
        assert!(view.depth.is_sorted_by(|a, b| a.timestamp <= b.timestamp), "{}", view.name);
        assert!(
            view.notes.fault().is_none() && view.notes.temperature_c.is_none_or(f64::is_finite)
        );
    }
}

pub fn read(sensor: &Sensor, frame: &FrameRef, table: &DepthTable) -> Option<Frame> {
    let Camera { width, height, .. } = sensor.camera;
    let image = FrameSource::new(width, height).frame(frame).ok()?;
    assert_eq!((image.width, image.height, image.raw.len()), (width, height, width * height));
    assert!(table.depths(&image).iter().all(|z| z.is_nan() || (*z > 0.0 && z.is_finite())));
    Some(image)
}

pub fn check_sensor(sensor: &Sensor) {
    assert!(sensor.fault().is_none(), "{:?}", sensor.fault());
    let Camera { width, height, .. } = sensor.camera;
    for (u, v) in [(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)] {
        let (x, y) = sensor.camera.ray(u as f64, v as f64);
        assert!(x.is_finite() && y.is_finite(), "the ray of {u}, {v}");
    }
}
