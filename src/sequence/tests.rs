use std::fs;
use std::path::Path;

use super::*;
use crate::frame::Frame;
use crate::io::encode_png16;

fn depth(path: &Path) {
    let frame = Frame { width: 640, height: 480, raw: vec![5000; 640 * 480] };
    fs::write(path, encode_png16(&frame).unwrap()).unwrap();
}

/// A TUM folder with depth images and colour files at these stamps.
fn tum(depths: &[f64], colours: &[f64]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let list = |kind: &str, stamps: &[f64]| {
        fs::create_dir_all(dir.path().join(kind)).unwrap();
        let mut text = String::from("# comment\n");
        for (k, stamp) in stamps.iter().enumerate() {
            depth(&dir.path().join(format!("{kind}/{k}.png")));
            text += &format!("{stamp} {kind}/{k}.png\n");
        }
        fs::write(dir.path().join(format!("{kind}.txt")), text).unwrap();
    };
    list("depth", depths);
    if !colours.is_empty() {
        list("rgb", colours);
    }
    dir
}

fn remarked(sequence: &Sequence, part: &str) -> bool {
    sequence.remarks.iter().any(|r| r.contains(part))
}

#[test]
fn colour_belongs_within_a_fiftieth_of_a_second() {
    let dir = tum(&[0.0, 0.033, 0.066], &[0.005, 0.050, 0.090]);
    let sequence = open(dir.path(), &Assumed::default()).unwrap();
    let names: Vec<Option<String>> = sequence
        .moments
        .iter()
        .map(|m| Some(m.colour.as_ref()?.path.file_name()?.to_string_lossy().into_owned()))
        .collect();
    // 0.050 is nearer to 0.066 than to 0.033, and each is used once.
    assert_eq!(names, [Some("0.png".into()), None, Some("1.png".into())]);
    assert!(
        remarked(&sequence, "1 of 3 depth images has no colour image"),
        "{:?}",
        sequence.remarks
    );
}

#[test]
fn gaps_duplicates_and_missing_files_are_remarked_on() {
    let dir = tum(&[0.0, 0.033, 0.033, 0.066, 0.1, 1.1], &[]);
    fs::remove_file(dir.path().join("depth/3.png")).unwrap();
    let sequence = open(dir.path(), &Assumed::default()).unwrap();
    assert_eq!(sequence.moments.len(), 4);
    assert!(remarked(&sequence, "1 gap"), "{:?}", sequence.remarks);
    assert!(remarked(&sequence, "the stamp of the one before"), "{:?}", sequence.remarks);
    assert!(remarked(&sequence, "missing"), "{:?}", sequence.remarks);
}

#[test]
fn associations_are_taken_at_their_word() {
    let dir = tum(&[0.0, 0.033], &[0.5, 0.6]);
    let text = "0.5 rgb/0.png 0.033 depth/1.png\n";
    fs::write(dir.path().join("associations.txt"), text).unwrap();
    let sequence = open(dir.path(), &Assumed::default()).unwrap();
    assert!(sequence.moments[0].colour.is_none());
    assert!(sequence.moments[1].colour.as_ref().unwrap().path.ends_with("rgb/0.png"));
    fs::write(dir.path().join("associations.txt"), "0.5 rgb/0.png\n").unwrap();
    let error = open(dir.path(), &Assumed::default()).unwrap_err().to_string();
    assert!(error.contains("line 1"), "{error}");
}

#[test]
fn seven_scenes_folders_are_read() {
    let dir = tempfile::tempdir().unwrap();
    for k in [0, 1, 3] {
        depth(&dir.path().join(format!("frame-{k:06}.depth.png")));
        let pose = format!("1 0 0 {k}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        fs::write(dir.path().join(format!("frame-{k:06}.pose.txt")), pose).unwrap();
    }
    // Another name of the second frame's number.
    depth(&dir.path().join("frame-1.depth.png"));
    let sequence = open(dir.path(), &Assumed::default()).unwrap();
    assert_eq!(sequence.moments.len(), 3);
    assert!(sequence.moments[1].depth.path.ends_with("frame-000001.depth.png"));
    assert_eq!(sequence.moments[2].stamp, 0.1);
    assert_eq!(sequence.truth[2].world_from_camera.translation.x, 3.0);
    assert_eq!(sequence.sensor.camera.fx, 585.0);
}

#[test]
fn neither_layout_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let error = open(dir.path(), &Assumed::default()).unwrap_err().to_string();
    assert!(error.contains("no sequence to map"), "{error}");
}
