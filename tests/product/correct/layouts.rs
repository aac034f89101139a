//! Films, dumps and plain folders.

use super::*;

#[test]
fn a_film_keeps_its_colour_and_every_frame() {
    let files = Files::new();
    let model_path = files.model(&small(vec![bowl(0.5)]));
    let film = files.at("film");
    let shot = kinoise()
        .args(["simulate", "--room", "--frames", "4", "--model"])
        .arg(&model_path)
        .arg(&film)
        .output()
        .expect("runs");
    assert!(shot.status.success(), "{}", String::from_utf8_lossy(&shot.stderr));
    let (json, said) = files.correct(&film, &[]);
    assert_eq!(json["frames"], json!(4), "{said}");
    let (old, new) = (tree(&film), tree(&files.at("out")));
    let changed: Vec<_> = old.iter().zip(&new).filter(|(a, b)| a != b).map(|(a, _)| &a.0).collect();
    assert_eq!(old.len(), new.len());
    assert_eq!(changed.len(), 4, "the depth images and nothing else: {changed:?}");
    // The film's effect is removed: a film without it differs only by rounding.
    files.model(&small(Vec::new()));
    let plain = files.at("plain");
    let shot = kinoise()
        .args(["simulate", "--room", "--frames", "4", "--model"])
        .arg(&model_path)
        .arg(&plain)
        .output()
        .expect("runs");
    assert!(shot.status.success());
    let mut source = FrameSource::new(160, 120);
    let mut off = 0;
    for name in &changed {
        let a = source.read(&plain.join(name)).expect("read");
        let b = source.read(&files.at("out").join(name)).expect("read");
        // A word of 0.2 mm either way, and as much again from rounding the shifted depth.
        off += a.raw.iter().zip(&b.raw).filter(|(a, b)| a.abs_diff(**b) > 3).count();
    }
    assert!(off < 200, "{off} pixels are elsewhere");
}

#[test]
fn a_dump_of_raw_words_goes_on_as_a_described_sequence() {
    let files = Files::new();
    let raw = files.recording(RAW, Vec::new());
    let dump = files.at("dump");
    fs::create_dir(&dump).expect("made");
    let recording = open_uncut(&raw, &Assumed::default()).expect("opened");
    let mut source = FrameSource::new(160, 120);
    let mut index = String::new();
    for (k, frame) in recording.views.iter().flat_map(|v| &v.depth).enumerate() {
        let name = format!("d-{}.{k}-{k}.pgm", 1000 + k);
        let image = source.read(&frame.path).expect("read");
        fs::write(dump.join(&name), kinoise::io::encode_pgm16(&image)).expect("written");
        index += &format!("{name}\nr-{}.{k}-{k}.ppm\n", 1000 + k);
        fs::write(dump.join(format!("r-{}.{k}-{k}.ppm", 1000 + k)), b"P6").expect("written");
    }
    fs::write(dump.join("INDEX.txt"), index).expect("written");
    files.model(&small(vec![bowl(0.5)]));
    let options = ["--intrinsics", "145,145,79.5,59.5"];
    let (json, _) = files.correct(&dump, &options);
    assert_eq!(json["frames"], json!(8));
    let again = open_uncut(&files.at("out"), &Assumed::default()).expect("described");
    assert_eq!((again.views[0].depth.len(), again.sensor.camera.fx), (8, 145.0));
    assert!(files.at("out/r-1000.0-0.ppm").is_file(), "colour goes along");
    fs::remove_dir_all(files.at("out")).expect("removed");
    files.correct(&dump, &[&options[..], &["--keep-code"]].concat());
    assert!(files.at("out/INDEX.txt").is_file());
}

/// A plain folder cannot store what its raw values mean. Its corrected copy can: the next command reads it
/// without options.
#[test]
fn a_plain_folder_goes_on_as_a_described_one() {
    let files = Files::new();
    let raw = files.recording(RAW, Vec::new());
    let plain = files.at("plain");
    fs::create_dir(&plain).expect("made");
    for view in open_uncut(&raw, &Assumed::default()).expect("opened").views {
        let image = plain.join(format!("{}.png", view.name));
        fs::copy(&view.depth[0].path, image).expect("copied");
    }
    files.model(&small(vec![bowl(0.5)]));
    let camera = [145.25, 145.0, 79.5, 59.5];
    let intrinsics = camera.map(|v| v.to_string()).join(",");
    let code = "--raw-disparity=3.3309495161,-0.0030711016";
    files.correct(&plain, &["--intrinsics", &intrinsics, code]);
    let out = files.at("out");
    let again = kinoise::io::open(&out, &Assumed::default()).expect("described");
    let seen = &again.sensor.camera;
    assert_eq!([seen.fx, seen.fy, seen.cx, seen.cy], camera);
    assert!(matches!(again.sensor.code, DepthCode::Metric { .. }));
    let names: Vec<String> = again.views.iter().map(|v| v.name.clone()).collect();
    let assumed = Assumed {
        intrinsics: Some(camera),
        code: Some(RAW),
        baseline_m: None,
        ..Assumed::default()
    };
    let before = kinoise::io::open(&plain, &assumed).expect("opened");
    assert_eq!(names, before.views.iter().map(|v| v.name.clone()).collect::<Vec<_>>());
    let refused = kinoise::io::open(&out, &assumed).expect_err("it describes itself");
    assert!(refused.to_string().contains("describes its sensor itself"), "{refused}");
    // Once more, now with a code that stays the same.
    fs::rename(&out, files.at("once")).expect("moved");
    files.correct(&files.at("once"), &[]);
    assert!(kinoise::io::open(&out, &Assumed::default()).is_ok());
}

/// Five captures of a pose are a view; in a film, they would be motion.
#[test]
fn a_stack_of_captures_stays_one() {
    let files = Files::new();
    let raw = files.recording(RAW, Vec::new());
    files.model(&small(vec![bowl(0.5)]));
    let mut source = FrameSource::new(160, 120);
    let (mut words, mut frames) = (Vec::new(), 0);
    for (view, copies) in
        open_uncut(&raw, &Assumed::default()).expect("opened").views[..2].iter().zip([6, 2])
    {
        for k in (0..copies).flat_map(|_| 0..view.depth.len()) {
            let frame = source.read(&view.depth[k].path).expect("read");
            words.extend(frame.raw.iter().flat_map(|word| word.to_le_bytes()));
            frames += 1;
        }
    }
    let head =
        format!("{{'descr': '<u2', 'fortran_order': False, 'shape': ({frames}, 120, 160), }}");
    let head = format!("{head:<117}\n");
    let size = u16::try_from(head.len()).expect("short").to_le_bytes();
    let stack = [&b"\x93NUMPY\x01\0"[..], &size[..], head.as_bytes(), &words[..]].concat();
    fs::write(files.at("stack.npy"), stack).expect("written");
    let code = "--raw-disparity=3.3309495161,-0.0030711016";
    files.correct(&files.at("stack.npy"), &["--intrinsics", "145.25,145,79.5,59.5", code]);
    let again = kinoise::io::open(&files.at("out"), &Assumed::default()).expect("described");
    assert_eq!(again.views.iter().map(|v| v.depth.len()).collect::<Vec<_>>(), [12, 4]);
}

/// A shift by 6.9 px of disparity leaves no depth beyond 1.6 m: such pixels are clamped to the code's end,
/// and reported.
#[test]
fn depths_beyond_the_code_stand_at_its_end() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    files.model(&small(vec![shaped(UNEXPLAINED, vec![bias(Basis::Level, &[6.9])])]));
    let (json, said) = files.correct(&recording, &[]);
    assert!(json["clamped"].as_u64() > Some(0), "{json}");
    assert!(said.contains("beyond the range of the depth code"), "{said}");
}

/// Learnt at 3 to 4 px, 2.7 to 3.6 m, and applied to nearer views: these are corrected like the nearest
/// learnt distance, and their share is reported.
#[test]
fn a_shape_is_held_where_its_learning_ended_and_that_is_told() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let growing =
        bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(2.0)), &[30.0]);
    let learnt = Effect { learnt_px: Some([3.0, 4.0]), ..shaped(UNEXPLAINED, vec![growing]) };
    files.model(&small(vec![learnt]));
    let (_, said) = files.correct(&recording, &[]);
    assert!(said.contains("outside 2.72 to 3.62 m") && said.contains("held at the edge"), "{said}");
    let held = raw_values(&files.at("out"));
    fs::remove_dir_all(files.at("out")).expect("removed");
    files.model(&small(vec![bowl(30.0 * (4.0f64 / 40.0).powi(2))]));
    let (json, said) = files.correct(&recording, &[]);
    assert!(json["pixels_changed"].as_u64() > Some(100_000), "{json}");
    assert!(!said.contains("held at the edge"), "{said}");
    // Nearer than 2.6 m all is held; one word of tolerance, as constant terms are summed in single precision.
    let (other, near) = (raw_values(&files.at("out")), 13_000);
    let pairs = held.iter().zip(&other).filter(|(a, _)| **a < near);
    assert!(held.len() == other.len() && pairs.clone().count() > 100_000);
    assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 1));
}
