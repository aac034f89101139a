//! The folder and `recording.json`.

use super::*;

#[test]
fn the_good_recording_is_good() {
    let result = Bench::good().calibrate().tells(&["12 of 12 views"]);
    assert_eq!(used(&result), common::GOOD_VIEWS);
}

#[test]
fn an_empty_folder() {
    let bench = Bench::empty();
    fs::create_dir(bench.recording()).expect("made");
    bench.calibrate().fails(&["recording", "recording.json", "give the folder"]);
}

#[test]
fn no_such_folder() {
    Bench::empty().calibrate().fails(&["recording", "no such folder"]);
}

#[test]
fn a_recording_without_views() {
    let bench = Bench::empty();
    bench.put("recording.json", fs::read(good().join("recording.json")).expect("read"));
    bench.calibrate().fails(&["recording", "no view", "depth.txt"]);
}

#[test]
fn every_key_of_the_description_is_needed() {
    for key in ["format", "sensor", "width", "height", "fx", "fy", "cx", "cy", "units_per_metre"] {
        let bench = Bench::good();
        bench.edit("recording.json", |text| text.replace(&format!("\"{key}\""), "\"other\""));
        bench.calibrate().fails(&["recording.json", key]);
    }
}

#[test]
fn malformed_json_names_its_line() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("\"width\":", "\"width\""));
    let line = fs::read_to_string(bench.file("recording.json"))
        .expect("text")
        .lines()
        .position(|l| l.contains("width"))
        .expect("there")
        + 1;
    bench.calibrate().fails(&["recording.json", &format!("line {line}")]);
    bench.put("recording.json", "").calibrate().fails(&["recording.json"]);
    bench.put("recording.json", [0xff, 0xfe, 0x00]).calibrate().fails(&["recording.json"]);
}

#[test]
fn another_format_is_refused_before_its_keys() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("recording/1", "recording/7"));
    bench.calibrate().fails(&["recording.json", "recording/7", "recording/1"]);
    bench.put("recording.json", "{\"format\": \"film/3\"}");
    bench.calibrate().fails(&["recording.json", "film/3", "recording/1"]);
}

#[test]
fn numbers_that_describe_no_camera() {
    for (from, to, says) in [
        ("\"fx\": 145.0", "\"fx\": 0.0", "fx = 0"),
        ("\"fx\": 145.0", "\"fx\": -145.0", "fx = -145"),
        ("\"fx\": 145.0", "\"fx\": 1e999", "line"),
        ("\"fx\": 145.0", "\"fx\": \"145\"", "line"),
        ("\"width\": 160", "\"width\": 0", "0 x 120"),
        ("\"width\": 160", "\"width\": 99999999", "99999999"),
        (
            "\"width\": 160,\n  \"height\": 120",
            "\"width\": 16384, \"height\": 16384",
            "16384 x 16384",
        ),
        ("\"width\": 160", "\"width\": -160", "line"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 0.0", "units_per_metre"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": -5.0", "units_per_metre"),
        ("\"baseline_m\": 0.075", "\"baseline_m\": -1.0", "baseline_m"),
        (
            "\"baseline_m\": 0.075",
            "\"baseline_m\": 0.075, \"intrinsics_uncertainty\": {\"fx\": 0}",
            "intrinsics_uncertainty.fx = 0 must",
        ),
        (
            "\"baseline_m\": 0.075",
            "\"baseline_m\": 0.075, \"intrinsics_uncertainty\": {\"cy\": 400}",
            "intrinsics_uncertainty.cy = 400 must",
        ),
        (
            "\"units_per_metre\": 5000.0",
            "\"units_per_metre\": 5000.0, \"raw_disparity\": {\"offset\": 3.0, \"slope\": -0.003}",
            "contradict",
        ),
    ] {
        let bench = Bench::good();
        bench.edit("recording.json", |t| t.replace(from, to));
        bench.calibrate().fails(&["recording.json", says]);
    }
}

#[test]
fn a_camera_that_cannot_be_meant() {
    for (from, to) in [
        ("\"fx\": 145.0", "\"fx\": 1e-300"),
        ("\"fx\": 145.0", "\"fx\": 1e300"),
        ("\"cx\": 79.5", "\"cx\": 1e300"),
        ("\"cx\": 79.5", "\"cx\": -5000.0"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 1e-300"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 1e300"),
    ] {
        let bench = Bench::good();
        bench.edit("recording.json", |t| t.replace(from, to));
        bench.calibrate().fails_or_tells(&[]);
    }
}

#[test]
fn a_lens_that_not_every_pixel_has_a_ray_through() {
    for (lens, shown) in [
        ("[-0.8, 0, 0, 0, 0]", "[-0.8, 0, 0, 0, 0]"),
        ("[0, 0, 0, 0, -9]", "[0, 0, 0, 0, -9]"),
        ("[1e30, -1e30, 1e30, 1e30, 1e30]", "1e30"),
        ("[-1e3, 1e5, 1e2, 1e2, 1e5]", "[-1000, 100000, 100, 100, 100000]"),
    ] {
        let bench = Bench::good();
        bench.edit("recording.json", |t| {
            t.replace("\"cy\": 59.5", &format!("\"cy\": 59.5, \"distortion\": {lens}"))
        });
        bench.calibrate().fails(&["recording.json", "k1, k2, p1, p2, k3", shown]);
    }
    let bench = Bench::good();
    bench.edit("recording.json", |t| {
        t.replace("\"cy\": 59.5", "\"cy\": 59.5, \"distortion\": [-0.05, 0.02, 0, 0, 0]")
    });
    bench.calibrate().tells(&["12 of 12 views"]);
}

/// An unknown key may be a typing error; files of a later layout must still open.
#[test]
fn keys_that_nobody_knows_are_told_once_each() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("\"cy\": 59.5", "\"cy\": 59.5, \"baseline\": 0.08"));
    for view in 0..3 {
        bench.put(&format!("{view:04}/view.json"), "{\"reference_distance\": 1.0, \"roi\": null}");
    }
    bench
        .put("0003/view.json", "{\"target\": {\"width_m\": 1, \"height_m\": 0.8, \"depth_m\": 0}}");
    let result = bench.calibrate().tells(&[
        "recording.json: unknown key \"baseline\"",
        "view.json and 2 more: unknown key \"reference_distance\"",
        "view.json: unknown key \"target.depth_m\"",
    ]);
    let warnings = result["warnings"].as_array().expect("a list");
    assert_eq!(warnings.iter().filter(|w| w.to_string().contains("unknown key")).count(), 3);
    assert_eq!(used(&result), common::GOOD_VIEWS);
}

#[test]
fn a_reference_distance_that_the_plane_contradicts() {
    let bench = Bench::good();
    let axis: Vec<f64> = bench.calibrate().tells(&[])["views"]
        .as_array()
        .expect("views")
        .iter()
        .map(|v| v["axis_distance_m"].as_f64().expect("a distance"))
        .collect();
    let say = |view: usize, metres: f64| {
        bench.put(
            &format!("{view:04}/view.json"),
            format!("{{\"reference_distance_m\": {metres}}}"),
        );
    };
    say(0, axis[0] + 0.002);
    say(1, axis[1] - 0.002);
    let close = bench.calibrate().tells(&[]);
    assert!(!close["warnings"].to_string().contains("reference"), "{}", close["warnings"]);
    say(1, axis[1] - 0.1);
    let off = bench.calibrate().tells(&[
        "in 1 of 2 views with a reference distance",
        "view 0001",
        "+100.0 mm",
        "5 mm and 1 % of the distance",
    ]);
    let told = off["views"][1]["off_reference_m"].as_f64().expect("a difference");
    assert!((told - 0.1).abs() < 1e-9, "{told}");
    assert!(off["views"][2]["off_reference_m"].is_null());
    let page = fs::read_to_string(bench.out().join("report.html")).expect("text");
    assert!(page.contains("+100.0 (!)") && page.contains("−2.0"), "in the table of views");
}

/// The file existed when the recording was opened; hashing must not skip it silently.
#[test]
fn a_description_that_is_gone_when_it_is_hashed() {
    let bench = Bench::good();
    bench.put("0003/view.json", "{}");
    let recording = kinoise::io::open(&bench.recording(), &kinoise::io::Assumed::default());
    let recording = recording.expect("opens");
    let options = kinoise::CalibrateOptions {
        form: Some(kinoise::Form::Khoshelham),
        ..kinoise::CalibrateOptions::default()
    };
    let views = kinoise::measure_recording(&recording, &options.measure, &|_, _| ());
    fs::remove_file(bench.file("0003/view.json")).expect("removed");
    let error =
        kinoise::model_of(&recording, &views.expect("measured"), &options).expect_err("gone");
    assert!(error.to_string().contains("0003/view.json"), "{error}");
}

#[test]
fn sizes_that_contradict_the_images() {
    let bench = Bench::good();
    bench.edit("recording.json", |t| t.replace("\"width\": 160", "\"width\": 640"));
    bench.calibrate().fails(&["0000.png", "160 x 120", "640 x 120", "correct width and height"]);
}

#[test]
fn a_model_is_not_a_recording() {
    let bench = Bench::good();
    bench.calibrate().tells(&[]);
    let model = bench.out().join("model.json");
    let out = bench.folder.path().join("second");
    bench.run_to("calibrate", &model, &out, &[]).fails(&["model.json", "folder"]);
    fs::copy(&model, bench.file("recording.json")).expect("copied");
    bench.run_to("calibrate", &bench.recording(), &out, &[]).fails(&[
        "recording.json",
        "kinoise-model/1",
        "recording/1",
    ]);
}
