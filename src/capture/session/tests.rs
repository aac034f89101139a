use super::*;
use crate::frame::Frame;
use crate::simulate::kinect_v1;

fn frame(stamp: f64, word: u16) -> LiveFrame {
    let picture = |word| Frame { width: 160, height: 120, raw: vec![word; 160 * 120] };
    LiveFrame { stamp, depth: picture(word), infrared: Some(picture(word / 10)) }
}

fn take(session: &mut Session, view: &str, word: u16) {
    session.begin(view).unwrap();
    for k in 0..3 {
        session.keep(&frame(f64::from(k), word)).unwrap();
    }
    session.finish(&ViewNotes::default()).unwrap();
}

fn first_word(root: &Path, view: usize) -> u16 {
    let recording = crate::io::open(root, &crate::io::Assumed::default()).unwrap();
    let path = &recording.views[view].depth[0].path;
    crate::io::read_depth(&crate::view::FrameRef::file(0.0, path.into()), 160, 120).unwrap().raw[0]
}

#[test]
fn views_are_whole_or_not_there_and_are_replaced_whole() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("rec");
    let sensor = kinect_v1(4);
    let mut session = Session::open(&root, &sensor).unwrap();
    take(&mut session, "a", 5000);
    session.begin("b").unwrap();
    session.keep(&frame(9.0, 1)).unwrap();
    assert_eq!(session.taken().unwrap(), ["a"]);
    session.abandon();
    take(&mut session, "a", 6000);
    drop(session);
    assert_eq!(first_word(&root, 0), 6000);
    let recording = crate::io::open(&root, &crate::io::Assumed::default()).unwrap();
    assert_eq!((recording.views.len(), recording.remarks.len()), (1, 0));
    assert_eq!(recording.views[0].infrared.len(), 3);
    assert!(!root.join(PARTIAL).exists());
}

/// The state that a kill between two renames leaves.
#[test]
fn an_interrupted_run_is_tidied_up() {
    let folder = tempfile::tempdir().unwrap();
    let (root, partial) = (folder.path(), folder.path().join(PARTIAL));
    let sensor = kinect_v1(4);
    take(&mut Session::open(root, &sensor).unwrap(), "a", 5000);
    fs::create_dir_all(partial.join("b")).unwrap();
    fs::write(partial.join("b").join(DEPTH_LIST), "0 x").unwrap();
    fs::rename(root.join("a"), partial.join("old-a")).unwrap();
    let mut session = Session::open(root, &sensor).unwrap();
    assert_eq!(session.taken().unwrap(), ["a"]);
    assert_eq!(session.remarks().len(), 2, "{:?}", session.remarks());
    assert!(!partial.exists());
    take(&mut session, "b", 5000);
    session.reject("a").unwrap();
    assert_eq!(session.taken().unwrap(), ["b"], "a rejected view is gone at once");
    drop(session);
    fs::create_dir_all(&partial).unwrap();
    fs::rename(root.join("b"), partial.join("bad-b")).unwrap();
    let session = Session::open(root, &sensor).unwrap();
    assert!(session.taken().unwrap().is_empty() && session.remarks().is_empty());
}

#[test]
fn another_sensor_or_somebodys_folder_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut sensor = kinect_v1(4);
    sensor.serial = Some("A1".into());
    Session::open(&folder.path().join("rec"), &sensor).unwrap();
    sensor.serial = Some("B2".into());
    let refused = Session::open(&folder.path().join("rec"), &sensor).err().unwrap();
    assert!(refused.to_string().contains("of sensor A1, and this one is B2"), "{refused}");
    sensor.serial = None;
    sensor.camera.fx += 1.0;
    assert!(Session::open(&folder.path().join("rec"), &sensor).is_err());
    fs::write(folder.path().join("thesis.tex"), "").unwrap();
    assert!(Session::open(folder.path(), &sensor).is_err());
    assert!(Session::open(Path::new("/dev/null"), &sensor).is_err());
}
