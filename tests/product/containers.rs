//! One film in every container, written by third-party libraries (tests/tools/make_containers.py): each
//! reader gives the same frames and the same model as the film in a folder of PNGs.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use kinoise::correct::{Conditions, CorrectOptions, correct_recording};
use kinoise::io::{Assumed, FrameSource, open, open_uncut, write_recording_file};
use kinoise::model::Effect;
use kinoise::view::{FrameRef, RecordingFile};
use kinoise::{
    CalibrateOptions, Camera, DepthCode, Frame, NoiseModel, Recording, Sensor, measure_recording,
    model_of, sequence,
};
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;

use crate::common::{kinoise, write_depth};

const SIZE: (usize, usize) = (32, 24);
/// Frames per view.
const STILL: usize = 10;
const MILLIMETRES: DepthCode = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };

/// Path of a file in tests/data/containers.
fn container(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/containers").join(name)
}

/// The film as made by make_containers.py, mm.
fn film() -> Vec<Frame> {
    let views = [(800, 0, 0), (1200, 6000, -2000), (1700, -5000, 3000), (2300, 3000, 0)];
    let mut state = 12_345i64;
    let mut pixel = |(mm, du, dv): (i64, i64, i64), u: i64, v: i64| {
        let mut total = 0;
        for _ in 0..4 {
            state = (state * 1_103_515_245 + 12_345) % (1 << 31);
            total += (state >> 16) & 0xff;
        }
        let z = 1_000_000_000 / (1_000_000_000 / mm + du * (u - 16) + dv * (v - 12));
        let noise = ((total - 510) * z * z).div_euclid(98_500_000);
        if (state >> 8) % 97 == 0 { 0 } else { (z + noise) as u16 }
    };
    let (width, height) = SIZE;
    let places = || (0..height as i64).flat_map(|v| (0..width as i64).map(move |u| (u, v)));
    let frames = views.into_iter().flat_map(|view| [view; STILL]);
    frames
        .map(|view| Frame {
            width,
            height,
            raw: places().map(|(u, v)| pixel(view, u, v)).collect(),
        })
        .collect()
}

fn sensor() -> Sensor {
    let distortion = Some([0.02, -0.03, 0.001, -0.002, 0.004]);
    let (width, height) = SIZE;
    let camera = Camera { width, height, fx: 29.0, fy: 29.25, cx: 15.5, cy: 11.75, distortion };
    let name = "a depth camera".into();
    Sensor {
        name,
        serial: None,
        mode: None,
        camera,
        baseline_m: None,
        code: MILLIMETRES,
        intrinsics_uncertainty: None,
        kind: None,
    }
}

/// The film in the TUM layout, with a description.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut list = String::new();
    for (k, frame) in film().iter().enumerate() {
        let ns = 1_305_031_102_175_304_000u64 + 33_333_000 * k as u64;
        let name = format!("depth/{k:04}.png");
        write_depth(&folder.path().join(&name), frame);
        let _ = writeln!(list, "{}.{:09} {name}", ns / 1_000_000_000, ns % 1_000_000_000);
    }
    fs::write(folder.path().join("depth.txt"), list).expect("written");
    write_recording_file(folder.path(), &sensor()).expect("written");
    folder
}

fn frames(recording: &Recording) -> Vec<(f64, Frame)> {
    let camera = &recording.sensor.camera;
    let read = |f: &FrameRef| {
        let mut source = FrameSource::new(camera.width, camera.height);
        (f.timestamp, source.frame(f).expect("a frame"))
    };
    recording.views.iter().flat_map(|v| &v.depth).map(read).collect()
}

/// The whole film of a topic, not cut into views.
fn uncut(name: &str, topic: &str) -> Recording {
    let assumed = Assumed { topic: Some(topic.into()), ..Assumed::default() };
    open_uncut(&container(name), &assumed).unwrap_or_else(|e| panic!("{name}, {topic}: {e}"))
}

/// The content of model.json without its provenance.
fn model(mut recording: Recording) -> Value {
    recording.sensor.name = sensor().name;
    let options = CalibrateOptions::default();
    let measured = measure_recording(&recording, &options.measure, &|_, _| ()).expect("measured");
    let model = model_of(&recording, &measured, &options).expect("a model").model;
    let mut value: Value = serde_json::from_str(&model.to_json().expect("JSON")).expect("JSON");
    value.as_object_mut().expect("an object").remove("provenance");
    value
}

/// All containers of the film; .db3 needs the feature.
fn films() -> Vec<&'static str> {
    let mut films = vec!["film.bag", "film.mcap", "film.npz"];
    if cfg!(feature = "db3") {
        // The folder made by rosbag2, and the file in it.
        films.extend(["film", "film/film.db3"]);
    }
    films
}

#[test]
fn every_container_gives_the_frames_and_the_model_of_the_folder() {
    let folder = folder();
    let plain = open(folder.path(), &Assumed::default()).expect("the folder");
    assert_eq!(plain.views.len(), 4);
    let expected = (frames(&plain), model(plain.clone()));
    for name in films() {
        let recording = open(&container(name), &Assumed::default()).expect(name);
        assert_eq!(recording.sensor.camera, sensor().camera, "{name}");
        assert_eq!(recording.sensor.code, MILLIMETRES, "{name}");
        let names = |r: &Recording| r.views.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&recording), names(&plain), "{name}");
        assert!(frames(&recording) == expected.0, "{name}: other frames or stamps");
        assert_eq!(model(recording), expected.1, "{name}");
    }
}

#[test]
fn bags_tell_the_temperature_of_a_view() {
    let recording = open(&container("film.bag"), &Assumed::default()).expect("a bag");
    let celsius: Vec<f64> = recording.views.iter().filter_map(|v| v.notes.temperature_c).collect();
    // One reading per view, at its fifth frame.
    assert_eq!(celsius, [30.4, 31.4, 32.4, 33.4]);
    let film = sequence::open(&container("film.bag"), &Assumed::default()).expect("a bag");
    let mean = film.temperature_c.expect("a temperature");
    assert!((mean - 31.9).abs() < 1e-9, "{mean}");
    let conditions = Conditions::of(&film.moments[3], &film);
    assert_eq!(conditions.temperature_c, film.temperature_c);
    assert_eq!(conditions.session_s, film.moments[3].stamp - film.moments[0].stamp);
}

#[test]
fn a_bag_is_mapped_and_corrected_as_the_folder_is() {
    let folder = folder();
    let bag = container("film.bag");
    let open = |path: &Path| sequence::open(path, &Assumed::default()).expect("a sequence");
    let (plain, from_bag) = (open(folder.path()), open(&bag));
    assert_eq!(plain.moments.len(), from_bag.moments.len());
    for (a, b) in plain.moments.iter().zip(&from_bag.moments) {
        assert_eq!(a.stamp, b.stamp);
        assert_eq!(plain.depth(a).expect("a frame"), from_bag.depth(b).expect("a frame"));
    }

    let sensor = Sensor { baseline_m: Some(0.075), ..sensor() };
    let parameters = json!({"k_px": 0.5}).as_object().cloned().expect("an object");
    let bowl = Effect { id: "radial-disparity-bias".into(), parameters, ..Effect::default() };
    let mut model = NoiseModel::paper();
    model.sensor = Some(RecordingFile::of(&sensor));
    model.effects = vec![bowl];
    let out = tempfile::tempdir().expect("a temporary folder");
    let assumed = Assumed { baseline_m: Some(0.075), ..Assumed::default() };
    // The folder has no baseline, and an option that adds to a description is refused.
    write_recording_file(folder.path(), &sensor).expect("written");
    let corrected = |path: &Path, name: &str, assumed: &Assumed| {
        let output = out.path().join(name);
        let options = CorrectOptions::default();
        let done = correct_recording(path, assumed, &model, &output, &options, &|_, _| ());
        let done = done.expect("corrected");
        assert!(done.changed > done.measured / 10, "{} of {}", done.changed, done.measured);
        open_uncut(&output, &Assumed::default()).expect("a folder that describes itself")
    };
    let [a, b] =
        [corrected(folder.path(), "folder", &Assumed::default()), corrected(&bag, "bag", &assumed)];
    assert_eq!(a.sensor.camera, b.sensor.camera);
    assert!(frames(&a) == frames(&b), "other frames or stamps");
}

#[test]
fn every_encoding_of_depth_is_understood() {
    let film = film();
    for (bag, count) in [("kinds.bag", 2), ("kinds.mcap", 1)] {
        for topic in ["/big/image", "/metres/image", "/metres_big/image", "/padded/image"]
            .into_iter()
            .chain(["/png/image/compressedDepth"])
        {
            let recording = uncut(bag, topic);
            assert_eq!(recording.sensor.code, MILLIMETRES, "{bag}, {topic}");
            let frames: Vec<Frame> = frames(&recording).into_iter().map(|(_, f)| f).collect();
            assert!(frames[..] == film[..count], "{bag}, {topic}");
        }
        // Inverse depths are truncated to steps of 1/10100 per metre; rounding to words of 0.1 mm adds to it.
        let recording = uncut(bag, "/inverse/image/compressedDepth");
        let table = recording.sensor.code.table();
        let read = frames(&recording);
        assert_eq!(read.len(), count);
        for ((_, frame), truth) in read.iter().zip(&film) {
            for (&raw, &mm) in frame.raw.iter().zip(&truth.raw) {
                let (z, expected) = (table.metres(raw), f32::from(mm) * 1e-3);
                assert_eq!(z.is_nan(), mm == 0);
                let step = expected * expected / 10_100.0 + 0.5e-4;
                assert!(mm == 0 || (z - expected).abs() < 1.01 * step, "{z} m, not {expected} m");
            }
        }
    }
}

#[test]
fn an_mcap_without_chunks_or_without_an_index_is_read() {
    for name in ["unchunked.mcap", "unindexed.mcap"] {
        let recording = open_uncut(&container(name), &Assumed::default()).expect(name);
        assert!(frames(&recording)[0].1 == film()[0], "{name}");
    }
}

#[test]
fn a_realsense_bag_says_its_device_and_its_unit() {
    for (name, units) in [("realsense.bag", 1000.0), ("realsense-older.bag", 10_000.0)] {
        let recording = open_uncut(&container(name), &Assumed::default()).expect(name);
        let sensor = &recording.sensor;
        assert_eq!(sensor.name, "Intel RealSense D435");
        assert_eq!(sensor.serial.as_deref(), Some("0123456789"));
        assert_eq!(sensor.baseline_m, Some(0.04994));
        assert_eq!(sensor.code, DepthCode::Metric { units_per_metre: units, invalid: 0 }, "{name}");
        let frames: Vec<Frame> = frames(&recording).into_iter().map(|(_, f)| f).collect();
        assert!(frames[..] == film()[..2], "{name}");
    }
}

#[test]
fn stacks_are_read_as_folders_of_images_are() {
    let camera = Assumed { intrinsics: Some([29.0, 29.25, 15.5, 11.75]), ..Assumed::default() };
    let given = Assumed { code: Some(MILLIMETRES), ..camera.clone() };
    let film = film();
    for (name, assumed) in [("words.npy", &given), ("metres.npy", &camera)] {
        let recording = open_uncut(&container(name), assumed).expect(name);
        assert_eq!(recording.sensor.code, MILLIMETRES);
        let frames: Vec<Frame> = frames(&recording).into_iter().map(|(_, f)| f).collect();
        assert!(frames[..] == film[..2], "{name}");
    }
    let far = Assumed { topic: Some("far".into()), ..given.clone() };
    let recording = open_uncut(&container("two.npz"), &far).expect("far");
    assert!(frames(&recording)[0].1 == film[film.len() - 1]);
    let refused = |name: &str, assumed: &Assumed| {
        open(&container(name), assumed).expect_err(name).to_string()
    };
    let two = refused("two.npz", &given);
    assert!(two.contains("far") && two.contains("near") && two.contains("--topic"), "{two}");
    let camera = refused("words.npy", &Assumed::default());
    assert!(camera.contains("--intrinsics"), "{camera}");
}

/// An array that cannot be read may be the depth, unless another is named.
#[test]
fn a_named_array_is_read_whatever_stands_beside_it() {
    let folder = folder();
    let path = folder.path().join("three.npz");
    std::fs::copy(container("two.npz"), &path).expect("copied");
    let file = std::fs::File::options().read(true).write(true).open(&path).expect("opened");
    let mut archive = zip::ZipWriter::new_append(file).expect("an archive");
    archive.start_file("colour.npy", SimpleFileOptions::default()).expect("begun");
    let header = "{'descr': '<u2', 'fortran_order': True, 'shape': (2, 3, 4), }";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend([0; 48]);
    archive.write_all(&bytes).expect("written");
    archive.finish().expect("closed");
    let of = |topic: Option<&str>| Assumed {
        intrinsics: Some([29.0, 29.25, 15.5, 11.75]),
        code: Some(MILLIMETRES),
        topic: topic.map(String::from),
        ..Assumed::default()
    };
    let far = open_uncut(&path, &of(Some("far"))).expect("far");
    assert!(frames(&far)[0].1 == film()[film().len() - 1]);
    let refused = open_uncut(&path, &of(None)).expect_err("colour").to_string();
    assert!(refused.contains("colour") && refused.contains("ascontiguousarray"), "{refused}");
}

#[test]
fn topics_are_listed_where_there_is_a_choice() {
    let refused = |name: &str, topic: Option<&str>| {
        let assumed = Assumed { topic: topic.map(String::from), ..Assumed::default() };
        open(&container(name), &assumed).expect_err(name).to_string()
    };
    let several = refused("kinds.bag", None);
    for said in ["kinds.bag", "/big/image", "/png/image/compressedDepth", "--topic"] {
        assert!(several.contains(said), "{several}");
    }
    let unknown = refused("film.bag", Some("/depth"));
    assert!(unknown.contains("/camera/depth/image_raw (sensor_msgs/Image)"), "{unknown}");
    let colour = refused("film.bag", Some("/camera/rgb/image_color"));
    assert!(colour.contains("rgb8"), "{colour}");
    let none = refused("no-depth.bag", None);
    assert!(none.contains("/imu/temperature"), "{none}");
    let folder = folder();
    let topic = Assumed { topic: Some("/depth".into()), ..Assumed::default() };
    let needless = open(folder.path(), &topic).expect_err("a folder").to_string();
    assert!(needless.contains("--topic"), "{needless}");
}

#[test]
fn the_command_line_reads_a_bag() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let into = out.path().join("out");
    kinoise().arg("calibrate").arg(container("film.mcap")).arg("-o").arg(&into).assert().success();
    assert!(into.join("model.json").is_file());
    let told = kinoise().arg("calibrate").arg(container("kinds.bag")).arg("-o").arg(&into).assert();
    let told = told.code(2).get_output().stderr.clone();
    assert!(String::from_utf8_lossy(&told).contains("choose one with --topic"));
}

// ---- damage -----------------------------------------------------------------------------------

/// Files of every kind, with the options that their topic needs.
fn victims() -> Vec<(&'static str, Assumed)> {
    let topic = |name: &str| Assumed { topic: Some(name.into()), ..Assumed::default() };
    let camera = Assumed { intrinsics: Some([29.0, 29.25, 15.5, 11.75]), ..Assumed::default() };
    let stack = Assumed { code: Some(MILLIMETRES), ..camera };
    let mut victims = vec![
        ("film.bag", Assumed::default()),
        ("film.mcap", Assumed::default()),
        ("film.npz", Assumed::default()),
        ("kinds.bag", topic("/metres/image")),
        ("kinds.mcap", topic("/png/image/compressedDepth")),
        ("realsense.bag", Assumed::default()),
        ("unchunked.mcap", Assumed::default()),
        ("unindexed.mcap", Assumed::default()),
        ("words.npy", stack),
    ];
    if cfg!(feature = "db3") {
        victims.push(("film/film.db3", Assumed::default()));
    }
    victims
}

/// A damaged copy under its own name.
fn spoilt(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(Path::new(name).file_name().expect("a name"));
    fs::write(&path, bytes).expect("written");
    (folder, path)
}

#[test]
fn a_file_that_is_cut_is_refused_by_name_and_with_what_to_do() {
    const CUTS: usize = 40;
    for (name, assumed) in victims() {
        let whole = fs::read(container(name)).expect(name);
        let mut cuts: Vec<usize> = (0..CUTS).map(|k| k * whole.len() / CUTS).collect();
        cuts.extend([whole.len() - 1, whole.len() - 8]);
        for cut in cuts {
            let (_folder, path) = spoilt(name, &whole[..cut]);
            let Err(error) = open_uncut(&path, &assumed) else {
                panic!("{name}: cut at {cut} of {}", whole.len());
            };
            let said = error.to_string();
            let remedy = ["again", "give", "save"].iter().any(|word| said.contains(word));
            let file = path.file_name().expect("a name").to_string_lossy();
            assert!(said.contains(&*file) && remedy, "{name} cut at {cut}: {said}");
        }
    }
}

/// Whatever a byte becomes, the result is a film or an error.
#[test]
fn no_garbage_ends_in_a_panic() {
    const TRIES: u64 = 120;
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    for (name, assumed) in victims() {
        let whole = fs::read(container(name)).expect(name);
        let mut refused = 0;
        for k in 0..TRIES {
            let mut bytes = whole.clone();
            // Mostly near the ends, where the headers and indices are.
            let reach = if k % 3 == 0 { bytes.len() } else { bytes.len().min(400) };
            for _ in 0..1 + k % 4 {
                let at = random() as usize % reach;
                let at = if k % 3 == 1 { bytes.len() - 1 - at } else { at };
                bytes[at] = if k % 2 == 0 { 0xff } else { random() as u8 };
            }
            let (_folder, path) = spoilt(name, &bytes);
            match open_uncut(&path, &assumed) {
                Err(_) => refused += 1,
                Ok(recording) => {
                    let camera = &recording.sensor.camera;
                    let mut source = FrameSource::new(camera.width, camera.height);
                    let views = recording.views.iter();
                    let bad = views.flat_map(|v| &v.depth).filter(|f| source.frame(f).is_err());
                    refused += u64::from(bad.count() > 0);
                }
            }
        }
        assert!(refused > 0, "{name}: no damage was seen in {TRIES} tries");
    }
}

/// `bytes` with the `nth` occurrence of `old` replaced by `new`.
fn replaced(bytes: &[u8], old: &[u8], nth: usize, new: &[u8]) -> Vec<u8> {
    let found = bytes.windows(old.len()).enumerate().filter(|(_, w)| *w == old).nth(nth);
    let (at, _) = found.unwrap_or_else(|| panic!("{old:?} is not in the file"));
    let mut bytes = bytes.to_vec();
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

fn refused(name: &str, bytes: &[u8], assumed: &Assumed) -> String {
    let (_folder, path) = spoilt(name, bytes);
    open_uncut(&path, assumed).expect_err(name).to_string()
}

#[test]
fn a_bag_without_an_index_is_told_to_be_mended() {
    let whole = fs::read(container("film.bag")).expect("a bag");
    let mut unindexed = whole.clone();
    let at = whole.windows(10).position(|w| w == b"index_pos=").expect("the field") + 10;
    unindexed[at..at + 8].fill(0);
    let said = refused("film.bag", &unindexed, &Assumed::default());
    assert!(said.contains("no index") && said.contains("rosbag reindex"), "{said}");
}

#[test]
fn lengths_that_lie_are_not_believed() {
    let none = Assumed::default();
    let whole = fs::read(container("realsense.bag")).expect("a bag");
    // The pixels of the first image: 32 x 24 x 2 bytes; the count follows the row length of 64.
    let announced = |n: u32| [64u32.to_le_bytes(), n.to_le_bytes()].concat();
    for lie in [u32::MAX, 1537, 100] {
        let bytes = replaced(&whole, &announced(1536), 0, &announced(lie));
        let said = refused("realsense.bag", &bytes, &none);
        let place = "message 1 of /device_0/sensor_0/Depth_0/image/data";
        assert!(said.contains(place), "{lie}: {said}");
    }
    let bytes = replaced(&whole, b"size=", 0, b"size=\xff\xff\xff\xff");
    assert!(refused("realsense.bag", &bytes, &none).contains("lengths differ"));
    let bz2 = fs::read(container("film.bag")).expect("a bag");
    let bytes = replaced(&bz2, b"size=", 0, b"size=\xff\xff\xff\xff");
    assert!(refused("film.bag", &bytes, &none).contains("4294967295 bytes"));

    let hundred_gb = 100_000_000_000u64.to_le_bytes();
    let mcap = fs::read(container("unchunked.mcap")).expect("an MCAP");
    // The length of the first record after the magic.
    let mut bytes = mcap.clone();
    bytes[9..17].copy_from_slice(&hundred_gb);
    assert!(refused("unchunked.mcap", &bytes, &none).contains("mcap recover"));
    let chunked = fs::read(container("film.mcap")).expect("an MCAP");
    let chunk = 8 + 9 + u64::from_le_bytes(chunked[9..17].try_into().expect("eight")) as usize;
    assert_eq!(chunked[chunk], 6, "a chunk follows the header");
    let mut bytes = chunked.clone();
    bytes[chunk + 9 + 16..chunk + 9 + 24].copy_from_slice(&hundred_gb);
    assert!(refused("film.mcap", &bytes, &none).contains("100000000000 bytes"));

    let camera = Assumed { intrinsics: Some([29.0, 29.25, 15.5, 11.75]), ..Assumed::default() };
    let npy = fs::read(container("words.npy")).expect("a stack");
    let bytes = replaced(&npy, b"(2, 24, 32), }      ", 0, b"(65104166, 24, 32), }");
    assert!(refused("words.npy", &bytes, &camera).contains("needs more than"));
}

/// The claimed length of a text must not decide how much memory is allocated.
/// Floats would otherwise be read as words, two to a pixel.
#[test]
fn a_topic_that_changes_its_encoding_is_refused() {
    let whole = fs::read(container("realsense.bag")).expect("a bag");
    let changed = replaced(&whole, b"mono16", 1, b" 32FC1");
    let said = refused("realsense.bag", &changed, &Assumed::default());
    assert!(said.contains("message 2 of /device_0/sensor_0/Depth_0/image/data is"), "{said}");
    assert!(said.contains("32FC1") && said.contains("a bag of their own"), "{said}");
}

/// A folder that describes itself is no folder of rosbag2, whatever a bag and a metadata.yaml do in it; and
/// one of rosbag2 is read whatever its metadata.yaml says.
#[test]
fn a_foreign_metadata_file_makes_no_bag_of_a_folder() {
    let frames_in =
        |path: &Path| frames(&open_uncut(path, &Assumed::default()).expect("a recording"));
    let folder = folder();
    let plain = frames_in(folder.path());
    let beside = |folder: &Path, bag: &str| {
        fs::copy(container(bag), folder.join(bag)).expect("copied");
        fs::write(folder.join("metadata.yaml"), "of: something else\n").expect("written");
    };
    beside(folder.path(), "unchunked.mcap");
    assert!(frames_in(folder.path()) == plain);
    let of_bag = tempfile::tempdir().expect("a temporary folder");
    beside(of_bag.path(), "film.mcap");
    assert!(frames_in(of_bag.path()) == plain);
}

#[test]
fn the_text_of_an_mcap_record_is_as_long_as_the_record() {
    let whole = fs::read(container("unchunked.mcap")).expect("an MCAP");
    // After the header's record: a schema's kind and length, its number, its name's length.
    let schema = 8 + 9 + u64::from_le_bytes(whole[9..17].try_into().expect("eight")) as usize;
    assert_eq!(whole[schema], 3, "a schema follows the header");
    let mut bytes = whole.clone();
    bytes[schema + 11..schema + 15].fill(0xff);
    let said = refused("unchunked.mcap", &bytes, &Assumed::default());
    assert!(said.contains("4294967295 bytes begins where only"), "{said}");
}

/// A chunk listed a million times would be read a million times.
#[test]
fn a_bag_that_lists_a_chunk_twice_is_refused() {
    let mut bytes = fs::read(container("film.bag")).expect("a bag");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four")) as usize;
    let behind = |field: &[u8]| {
        bytes.windows(field.len()).position(|w| w == field).expect("the field") + field.len()
    };
    // A record is a header and data, each preceded by its length; the last one describes the chunk.
    let (counted, mut last, mut at) = (behind(b"chunk_count="), 0, word(behind(b"index_pos=")));
    while at < bytes.len() {
        last = at;
        at += 4 + word(at);
        at += 4 + word(at);
    }
    bytes.extend_from_within(last..);
    bytes[counted] += 1;
    let said = refused("film.bag", &bytes, &Assumed::default());
    assert!(said.contains("lists a chunk twice"), "{said}");
}

/// A database view may be a query that never ends.
#[cfg(feature = "db3")]
#[test]
fn a_db3_whose_tables_are_none_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("film.db3");
    let database = rusqlite::Connection::open(&path).expect("made");
    let endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, \
                   'depth' AS name, 'sensor_msgs/msg/Image' AS type, 'cdr' AS serialization_format FROM n";
    database
        .execute_batch(&format!(
            "CREATE TABLE messages (id, topic_id, timestamp, data); CREATE VIEW topics AS {endless}"
        ))
        .expect("filled");
    drop(database);
    let said = open(&path, &Assumed::default()).expect_err("no tables").to_string();
    assert!(said.contains("no tables of topics"), "{said}");
}
