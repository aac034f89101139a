//! Shared helpers of the `kinoise capture` tests.

use assert_cmd::assert::Assert;
use kinoise::io::FrameSource;
use kinoise::{Frame, Recording};
use serde_json::Value;

/// Frames of a view, and still frames before it.
pub const FRAMES: usize = 4;
pub const HOLD: usize = 2;
/// Frames of each pose in a dump: the first still frame, the view, one to spare.
pub const HELD_STILL: usize = FRAMES + HOLD;

pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder")
}

pub fn frames_of(recording: &Recording) -> Vec<Frame> {
    let camera = &recording.sensor.camera;
    let mut source = FrameSource::new(camera.width, camera.height);
    let frames = recording.views.iter().flat_map(|v| &v.depth);
    frames.map(|f| source.read(&f.path).expect("a frame")).collect()
}

pub fn json(assert: &Assert) -> Value {
    serde_json::from_slice(&assert.get_output().stdout).expect("nothing but JSON on stdout")
}

pub fn told(assert: &Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}
