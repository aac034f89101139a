//! Damaged input, refusals, and the library call.

use super::*;

#[test]
fn a_damaged_image_is_copied_and_told() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    files.model(&small(vec![bowl(0.5)]));
    fs::write(recording.join("0001/depth/0000.png"), b"no picture").expect("written");
    let (json, said) = files.correct(&recording, &[]);
    assert_eq!(json["frames"], json!(7));
    assert!(said.contains("copied as it is") && said.contains("0000.png"), "{said}");
}

#[test]
fn bad_input_is_refused_with_one_message() {
    let files = Files::new();
    let recording = files.at("rec");
    copy_tree(good(), &recording);
    let out = files.at("out");
    files.refused(&recording, &out, &["model.json"]);
    files.model(&model(&kinect_v1(2), vec![bowl(0.5)]));
    files.refused(&recording, &out, &["320 x 240", "160 x 120"]);
    fs::write(files.at("model.json"), "{\"format\": \"kinoise-model/9\"}").expect("written");
    files.refused(&recording, &out, &["newer"]);
    files.model(&small(vec![named("no-such-thing", json!({}))]));
    files.refused(&recording, &out, &["model.json", "no-such-thing"]);
    let path = files.model(&small(vec![bowl(0.5)]));
    files.refused(&files.at("nowhere"), &out, &["no such folder"]);
    files.refused(&recording, &recording.join("new/folder"), &["inside"]);
    files.refused(&recording, &recording, &["inside"]);
    files.refused(&recording, files.folder.path(), &["not empty"]);
    let text = fs::read_to_string(&path).expect("read");
    for (from, to, says) in [
        ("\"orders\": 1", "\"orders\": 2", "1 coefficients where its basis has 2"),
        ("\"orders\": 1", "\"orders\": 0", "orders"),
        ("\"kind\": \"bowl\"", "\"kind\": \"cup\"", "cup"),
        ("\"statistic\": \"bias\"", "\"statistic\": \"missing\"", "a bias or a variance"),
    ] {
        let lie = text.replacen(from, to, 1);
        assert_ne!(lie, text, "{from}");
        fs::write(&path, lie).expect("written");
        files.refused(&recording, &out, &["model.json", says]);
    }
    assert!(!out.exists(), "nothing was begun");
}

#[test]
fn an_effect_on_top_of_its_shape_is_refused() {
    let files = Files::new();
    let path = files.model(&small(vec![bowl(0.5)]));
    let output = kinoise()
        .args(["simulate", "--effect", "radial-disparity-bias:k_px=1", "--model"])
        .arg(path)
        .arg(files.at("out"))
        .output()
        .expect("runs");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.code() == Some(2) && said.contains("brings its shape"), "{said}");
}

#[test]
fn the_library_does_what_the_program_does() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let model = small(vec![bowl(0.5)]);
    files.model(&model);
    let (json, _) = files.correct(&recording, &[]);
    let out = files.at("library");
    let done = correct_recording(
        &recording,
        &Assumed::default(),
        &model,
        &out,
        &CorrectOptions::default(),
        &|_, _| (),
    )
    .expect("done");
    assert_eq!(json["pixels_changed"], json!(done.changed));
    assert!(tree(&out) == tree(&files.at("out")));
}

/// Two shapes of one fit have correlated errors, a third is independent: compared with the formula at every
/// pixel, and in the written images.
#[test]
fn the_uncertainty_of_a_correction_is_its_covariance() {
    let grows =
        |k: f64| bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(2.0)), &[k]);
    let still =
        |k: f64| bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), &[k]);
    let of = |shape, fit, factors, variances| Effect {
        covariance: Some(Covariance { fit, factors, variances }),
        ..shaped(UNEXPLAINED, vec![shape])
    };
    let over_temperature = Basis::Curve {
        over: Coordinate::Temperature,
        low: 20.0,
        high: 40.0,
        nodes: 2,
        times: Modulation::One,
    };
    let effects = vec![
        of(still(0.01), 1, vec![vec![0.2], vec![0.0]], vec![]),
        of(grows(0.01), 1, vec![vec![-0.1], vec![0.3]], vec![]),
        of(still(0.01), 2, vec![], vec![0.04]),
        // Not subtracted where the temperature is unknown, as here.
        of(bias(over_temperature, &[0.5, 1.0]), 3, vec![], vec![0.5, 0.5]),
    ];
    let sensor = sensor();
    let correction =
        Correction::of(&model(&sensor, effects.clone()), &sensor).expect("a correction");
    let camera = &sensor.camera;
    let depth: Vec<f32> = (0..camera.pixels()).map(|i| 0.7 + 1e-5 * i as f32).collect();
    let told = correction.uncertainty_m(&depth, &Conditions::default()).expect("its size");
    let corner = kinoise::terms::corner_radius(camera);
    for i in (0..camera.pixels()).step_by(97) {
        let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
        let square = (u - camera.cx).powi(2) + (v - camera.cy).powi(2);
        let (r2, z) = (square / corner.powi(2), f64::from(depth[i]));
        let far = (FB / z / 40.0).powi(2);
        let px2 = (0.2 - 0.1 * far).powi(2) + (0.3 * far).powi(2) + 0.04;
        let expected = r2 * px2.sqrt() * z * z / FB;
        assert!((f64::from(told[i]) - expected).abs() < 1e-4 * expected + 1e-9, "{i}");
    }
    let nothing = vec![f32::NAN; camera.pixels()];
    let told = correction.uncertainty_m(&nothing, &Conditions::default()).expect("its size");
    assert!(told.iter().all(|u| u.is_nan()));
    let endless = vec![f32::INFINITY; camera.pixels()];
    let told = correction.uncertainty_m(&endless, &Conditions::default()).expect("its size");
    assert!(told.iter().all(|u| *u == f32::INFINITY));
    assert!(correction.uncertainty_m(&depth[1..], &Conditions::default()).is_err());

    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    files.model(&small(effects));
    let sigma = files.at("sigma");
    files.correct(&recording, &["--sigma", sigma.to_str().expect("a path")]);
    let about: Value =
        serde_json::from_slice(&fs::read(sigma.join("sigma.json")).expect("read")).expect("json");
    assert_eq!(about["units_per_metre"], json!(SIGMA_UNITS_PER_METRE));
    let forced = ["--sigma", sigma.to_str().expect("a path"), "--force"];
    files.correct(&recording, &forced);
    let words =
        FrameSource::new(160, 120).read(&sigma.join("0001/depth/0000.png")).expect("read").raw;
    assert!(words[0] > 20 && words[60 * 160 + 80] < 5, "{} {}", words[0], words[60 * 160 + 80]);
    fs::remove_dir_all(files.at("out")).expect("removed");
    files.model(&small(vec![bowl(0.5)]));
    let again = files.at("sigma2");
    let output = kinoise()
        .arg("correct")
        .arg(&recording)
        .args(["--model", files.at("model.json").to_str().expect("a path")])
        .args(["-o", files.at("out").to_str().expect("a path")])
        .args(["--sigma", again.to_str().expect("a path")])
        .output()
        .expect("runs");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.code() == Some(2) && said.contains("how sure"), "{said}");
    assert!(!again.exists() && !files.at("out").exists(), "nothing was begun");
}
