//! Recordings of views.

use super::*;

#[test]
fn a_corrected_recording_is_back_at_noise_level() {
    let files = Files::new();
    let effect = Active::parse("radial-disparity-bias:k_px=0.1").expect("an effect");
    let recording = files.recording(METRIC, vec![effect]);
    files.model(&small(vec![bowl(0.1)]));
    let (json, _) = files.correct(&recording, &[]);
    assert_eq!((&json["frames"], &json["clamped"]), (&json!(8), &json!(0)));
    assert!(json["pixels_changed"].as_u64() > Some(100_000), "{json}");
    assert!((1.0..20.0).contains(&json["rms_shift_mm"].as_f64().expect("a number")), "{json}");
    let (before, after) = (sigma_ratio(&recording), sigma_ratio(&files.at("out")));
    assert!(before > 1.5 && (after - 1.0).abs() < 0.1, "{before} -> {after}");
    // All other files are copied byte for byte.
    let (old, new) = (tree(&recording), tree(&files.at("out")));
    assert_eq!(old.len(), new.len());
    for ((name, a), (other, b)) in old.iter().zip(&new) {
        assert_eq!(name, other);
        assert!(a == b || name.to_string_lossy().contains("depth/"), "{}", name.display());
    }
}

#[test]
fn a_second_correction_is_told() {
    let files = Files::new();
    let recording =
        files.recording(METRIC, vec![Active::parse("radial-disparity-bias").expect("an effect")]);
    files.model(&small(vec![bowl(0.1)]));
    files.correct(&recording, &[]);
    let arguments = ["correct", "out", "-m", "model.json", "-o", "again"];
    let output = kinoise().current_dir(files.at("")).args(arguments).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("is corrected already"), "{said}");
}

/// References give the scale a standard error of 1 %, and so the depth.
#[test]
fn a_law_has_its_own_uncertainty() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let error = |error: Value| {
        let scale = json!({"value": 1.02, "std_error": error});
        files.model(&small(vec![named("depth-scale", json!({"scale": scale}))]));
        let arguments = ["correct", "rec", "-m", "model.json", "-o", "out", "--sigma", "sigma"];
        kinoise().current_dir(files.at("")).args(arguments).output().expect("it runs")
    };
    let refused = error(Value::Null);
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(said.contains("none has a covariance"), "{said}");
    let output = error(json!(0.01));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let corrected = open_uncut(&files.at("out"), &Assumed::default()).expect("opened");
    let table = corrected.sensor.code.table();
    let mut source = FrameSource::new(160, 120);
    let image = &corrected.views[0].depth[0].path;
    let depth = source.read(image).expect("read");
    let relative = image.strip_prefix(files.at("out")).expect("inside");
    let sigma = source.read(&files.at("sigma").join(relative)).expect("read");
    assert!(recording.is_dir());
    for (&raw, &word) in depth.raw.iter().zip(&sigma.raw) {
        let z = f64::from(table.metres(raw));
        let expected = 0.01 * z * SIGMA_UNITS_PER_METRE;
        assert!(z.is_nan() || (f64::from(word) - expected).abs() < 2.0, "{z}: {word}");
    }
}

#[test]
fn a_model_without_bias_changes_no_byte() {
    let files = Files::new();
    files.model(&small(vec![named("vignetting", json!({"growth": 0.4}))]));
    for code in [METRIC, RAW] {
        let recording = files.recording(code, Vec::new());
        let (json, said) = files.correct(&recording, &[]);
        assert_eq!((&json["pixels_changed"], &json["rms_shift_mm"]), (&json!(0), &json!(0.0)));
        assert!(
            said.contains("left in, because they are noise or belong to the scene: vignetting"),
            "{said}"
        );
        assert!(tree(&recording) == tree(&files.at("out")));
        fs::remove_dir_all(&recording).expect("removed");
        fs::remove_dir_all(files.at("out")).expect("removed");
    }
}

#[test]
fn raw_disparities_become_fine_metric_words_unless_kept() {
    let files = Files::new();
    let offset = Active::parse("disparity-offset:offset_px=0.2").expect("an effect");
    let recording = files.recording(RAW, vec![offset]);
    let described = recording.join("recording.json");
    let text = fs::read_to_string(&described).expect("read");
    fs::write(&described, text.replacen('{', "{ \"owner\": \"lab 3\",", 1)).expect("written");
    files.model(&small(vec![named("disparity-offset", json!({"offset_px": 0.2}))]));
    let (json, _) = files.correct(&recording, &[]);
    assert_eq!(json["units_per_metre"], json!(10_000.0));
    let text = fs::read_to_string(files.at("out/recording.json")).expect("read");
    let value: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&value["owner"], &value["raw_disparity"]), (&json!("lab 3"), &Value::Null));
    // d = fb / z, less 0.2 px.
    let fb = 145.0 * 0.075;
    let views = |path: &Path| open_uncut(path, &Assumed::default()).expect("opened");
    let (old, new) = (views(&recording), views(&files.at("out")));
    let (old_table, new_table) = (old.sensor.code.table(), new.sensor.code.table());
    let mut source = FrameSource::new(160, 120);
    for (a, b) in old.views.iter().zip(&new.views) {
        let a = source.read(&a.depth[0].path).expect("read");
        let b = source.read(&b.depth[0].path).expect("read");
        for (&raw, &word) in a.raw.iter().zip(&b.raw) {
            let (z, better) = (old_table.metres(raw), new_table.metres(word));
            assert_eq!(z.is_nan(), better.is_nan(), "valid stays valid, and invalid invalid");
            let expected = fb / (fb / f64::from(z) - 0.2);
            assert!(z.is_nan() || (f64::from(better) - expected).abs() < 5.1e-5, "{z} {better}");
        }
    }
    fs::remove_dir_all(files.at("out")).expect("removed");
    let (json, _) = files.correct(&recording, &["--keep-code"]);
    assert_eq!(json["units_per_metre"], Value::Null);
    assert!(fs::read_to_string(files.at("out/recording.json")).expect("read").contains("raw_disp"));
}

/// Lists may name a dump's PGMs. A view that cannot be read would pass for one in the new code.
#[test]
fn a_recoded_recording_can_be_read_whatever_its_images() {
    let files = Files::new();
    let recording = files.recording(RAW, Vec::new());
    files.model(&small(vec![bowl(0.5)]));
    let mut source = FrameSource::new(160, 120);
    for view in open_uncut(&recording, &Assumed::default()).expect("opened").views {
        for frame in &view.depth {
            let words = source.read(&frame.path).expect("read");
            let name = frame.path.file_stem().expect("a name").to_string_lossy();
            let pgm = frame.path.with_file_name(format!("d-{name}.pgm"));
            fs::write(pgm, encode_pgm16(&words)).expect("written");
            fs::remove_file(&frame.path).expect("removed");
        }
        let list = recording.join(&view.name).join("depth.txt");
        let named = fs::read_to_string(&list).expect("a list");
        let named = named.replace(".png", ".pgm").replace("depth/", "depth/d-");
        fs::write(list, named).expect("written");
    }
    let both = r#"{"roi": [1, 1, 9, 9], "polygon": [[1, 1], [9, 1], [9, 9]]}"#;
    fs::write(recording.join("0001/view.json"), both).expect("written");
    let (json, said) = files.correct(&recording, &[]);
    assert_eq!(json["frames"], json!(6));
    assert!(said.contains("view 0001 is left out"), "{said}");
    let again = kinoise::io::open(&files.at("out"), &Assumed::default()).expect("described");
    assert_eq!((again.views.len(), &again.excluded), (3, &Vec::new()));
    let frames = again.views.iter().flat_map(|v| &v.depth);
    frames.for_each(|f| assert!(source.read(&f.path).is_ok(), "{}", f.path.display()));
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let camera = kinect_v1(4).camera;
    let lens = bias(
        Basis::powers(
            Coordinate::RaySquared,
            1,
            Modulation::RadialSlope { fx: camera.fx, fy: camera.fy },
        ),
        &[-0.1],
    );
    files.model(&small(vec![bowl(0.5), shaped("lens-distortion", vec![lens])]));
    let (one, _) = files.correct(&recording, &["--threads", "1"]);
    fs::rename(files.at("out"), files.at("one")).expect("moved");
    let (two, _) = files.correct(&recording, &["--threads", "2"]);
    assert_eq!(one, two);
    assert!(tree(&files.at("one")) == tree(&files.at("out")));
}
