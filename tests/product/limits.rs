//! Limits of every input: names, texts, numbers and files beyond them are refused where they are read, and
//! named.

use std::fs;

use kinoise::Frame;
use kinoise::io::FrameSource;
use serde_json::{Value, json};

use crate::common::write_depth;
use crate::desk::{Desk, fifo};

/// Regression test: a newline in the sensor's name wrote a line that looked like the program's own.
#[test]
fn a_sensors_name_stands_on_one_line() {
    for (key, name) in [
        ("sensor", "Kinect\nkinoise: all is well"),
        ("serial", "A\u{1b}[31m"),
        ("mode", "normal\r"),
    ] {
        let desk = Desk::new();
        desk.describe(|sensor| sensor[key] = json!(name));
        for command in ["calibrate rec -o out", "metrics rec", "diagnose rec -o out"] {
            let says = ["recording.json, line ", key, "control character"];
            desk.refused(command, &says);
        }
        desk.model("model.json", |model| {
            model["sensor"] = json!({"format": "recording/1", "sensor": "Kinect", "width": 160,
                "height": 120, "fx": 145, "fy": 145, "cx": 79.5, "cy": 59.5, "units_per_metre": 5000});
            model["sensor"][key] = json!(name);
        });
        desk.refused("export model.json --format c -o noise.h", &["sensor: ", "control character"]);
    }
}

/// The same for names that stand in no file: folders.
#[test]
fn names_of_folders_make_no_lines_of_their_own() {
    let desk = Desk::new();
    fs::rename(desk.at("rec/0000"), desk.at("rec/0000\nkinoise: all is well")).expect("renamed");
    for line in ["calibrate rec -o out", "metrics rec -o out2", "calibrate rec -v -o out3"] {
        let told = desk.done(line);
        assert!(!told.contains("\nkinoise: all"), "{line}: {told}");
    }
    let odd = desk.path().join("out\nkinoise: all is well");
    let output = crate::common::kinoise()
        .current_dir(desk.path())
        .args(["calibrate", "rec", "-o"])
        .arg(&odd)
        .output()
        .expect("run");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !told.contains("\nkinoise: all"), "{told}");
}

/// Regression test: 20 MB of "mode" were kept in every result.
#[test]
fn texts_have_their_length() {
    let long = "x".repeat(1 << 20);
    for (key, says) in [("sensor", "1048576"), ("mode", "1048576"), ("anything", "anything")] {
        let desk = Desk::new();
        desk.describe(|sensor| sensor[key] = json!(long));
        desk.refused("calibrate rec -o out", &["recording.json, line ", key, says]);
    }
    let desk = Desk::new();
    desk.put("rec/0000/view.json", format!("{{\n\"notes\": \"{long}\"}}"));
    let told = desk.done("calibrate rec -o out");
    assert!(told.contains("view.json, line 2: notes = a text of 1048576 bytes"), "{told}");
    for pointer in ["/provenance/tool", "/sigma/formula", "/fit/remarks"] {
        desk.model("model.json", |model| match model.pointer_mut(pointer) {
            Some(Value::String(text)) => *text = long.clone(),
            _ => model["fit"]["remarks"] = json!([long]),
        });
        desk.refused("export model.json --format c -o noise.h", &["a text of 1048576 bytes"]);
    }
    let short = format!("{} notes", "x".repeat(1000));
    desk.put("rec/0000/view.json", json!({"notes": short}).to_string());
    assert!(!desk.done("calibrate rec -o out2").contains("0000 was left out"));
}

/// Regression test: a bowl with a name that is not in the catalogue had no effect, and gave "match".
#[test]
fn what_an_effect_has_not_is_refused_wherever_a_model_is_read() {
    let desk = Desk::furnished();
    let bowl = |parameters| json!([{"id": "radial-disparity-bias", "parameters": parameters}]);
    let shape = json!([{"id": "bananas", "shape": [
        {"statistic": "variance", "basis": {"kind": "level"}, "coefficients": [0.1]}]}]);
    for (effects, says) in [
        (bowl(json!({"bowl_px": {"value": 3, "std_error": 0.1}})), "bowl_px"),
        (bowl(json!({"k_px": 1, "foo": 1})), "foo"),
        (bowl(json!({"k_px": 1e300})), "k_px"),
        (bowl(json!({"k_px": "1"})), "k_px"),
        (json!([{"id": "radial-bias"}]), "radial-bias"),
        (shape, "bananas"),
    ] {
        desk.model("odd.json", |model| model["effects"] = effects);
        for line in [
            "diagnose rec -m odd.json -o out",
            "correct rec -m odd.json -o out",
            "simulate out --shrink 8 --frames 1 -m odd.json",
            "map film -m odd.json -o out",
            "compare film -m odd.json -o out",
            "sigma film -m odd.json -o out",
            "export odd.json --format python -o out.py",
            "units odd.json model.json",
        ] {
            desk.refused(line, &["odd.json: ", says]);
        }
    }
}

/// Differences of limits of +-1e308 overflow.
#[test]
fn every_number_of_a_model_has_a_range() {
    let desk = Desk::new();
    let curve = |low: f64, high: f64, c: f64| {
        json!([{"id": "unexplained", "shape": [{"statistic": "bias", "basis": {"kind": "curve",
            "over": "log-z", "low": low, "high": high, "nodes": 3, "times": "one"},
            "coefficients": [c, 0, 0]}]}])
    };
    let cases: [(&str, Value, &str); 6] = [
        ("/effects", curve(-1e308, 1e308, 0.1), "1e308"),
        ("/effects", curve(-1e12, 1.0, 0.1), "low"),
        ("/effects", curve(0.0, 1.0, 1e20), "coefficient"),
        ("/fit/rmse_m", json!(1e300), "fit.rmse_m = 1e300"),
        ("/fit/degrees_of_freedom", json!(-1), "degrees_of_freedom"),
        ("/sigma/covariance/0/0", json!(1e308), "sigma.covariance[0][0] = 1e308"),
    ];
    for (pointer, value, says) in cases {
        desk.model("model.json", |model| *model.pointer_mut(pointer).expect(pointer) = value);
        desk.refused("diagnose rec -m model.json -o out", &["model.json: ", says]);
    }
    desk.model("model.json", |model| model["effects"] = curve(0.0, 1.0, 0.1));
    desk.done("correct rec -m model.json -o out");
}

/// Regression test: clipping about a bowl that is not there left no pixel to detect it by.
#[test]
fn a_model_that_is_far_off_is_no_inconclusive_answer() {
    let desk = Desk::new();
    desk.done("simulate three --shrink 8 --frames 4 --distances 1,2,3 --tilts 0");
    desk.done("simulate six --shrink 8 --frames 4 --distances 1,1.5,2 --tilts 0,30");
    for (views, k_px) in [("three", 2.0), ("three", 4.0), ("six", 2.0), ("six", 4.0)] {
        desk.model("model.json", |model| {
            let bowl = json!({"id": "radial-disparity-bias", "parameters": {"k_px": k_px}});
            model["effects"] = json!([bowl]);
        });
        let output = desk.run(&format!("diagnose {views} -m model.json -o out --force"));
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{views} {k_px}: {told}");
        let file = fs::read_to_string(desk.at("out/diagnosis.json")).expect("text");
        let diagnosis: Value = serde_json::from_str(&file).expect("JSON");
        let findings = diagnosis["findings"].as_array().expect("findings");
        let told_bias = |f: &Value| f["statistic"] == "bias" && f["status"] != "not-identifiable";
        assert!(findings.iter().any(told_bias), "{views} {k_px}: {told}");
    }
}

/// Regression test: twelve views of which nine were left out gave "match".
#[test]
fn of_a_recording_that_is_mostly_left_out_nothing_is_said() {
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    let nothing = Frame { width: 160, height: 120, raw: vec![0; 160 * 120] };
    for (left_out, verdict) in [(6, "match"), (7, "inconclusive")] {
        for (view, frame) in (0..left_out).flat_map(|view| [(view, 0), (view, 1)]) {
            write_depth(&desk.at(&format!("rec/{view:04}/depth/{frame:04}.png")), &nothing);
        }
        let told = desk.done("diagnose rec -m model.json -o out --force");
        assert!(told.contains(&format!("{verdict}: nothing was found")), "{left_out}: {told}");
        let file = fs::read_to_string(desk.at("out/diagnosis.json")).expect("text");
        let diagnosis: Value = serde_json::from_str(&file).expect("JSON");
        assert_eq!(diagnosis["verdict"], verdict, "{left_out}: {told}");
        let says = format!("{left_out} of 12 views were left out");
        assert_eq!(told.contains(&says), verdict == "inconclusive", "{told}");
    }
}

#[test]
fn an_error_of_the_principal_point_has_its_line() {
    for (key, value) in [("cx", 5000.0), ("cy", -20.0), ("fy", -1.0), ("fx", 0.0)] {
        let desk = Desk::new();
        desk.describe(|sensor| sensor[key] = json!(value));
        let text = fs::read_to_string(desk.at("rec/recording.json")).expect("text");
        let line = 1 + text.lines().position(|l| l.contains(&format!("\"{key}\""))).expect("there");
        desk.refused("calibrate rec -o out", &[&format!("recording.json, line {line}: {key}")]);
    }
}

/// Regression test: these were ignored, or reported as missing.
#[test]
fn what_is_no_regular_file_is_told() {
    for (name, line) in [
        ("rec/recording.json", "calibrate rec -o out"),
        ("film/depth.txt", "map film -o out"),
        ("film/recording.json", "map film -o out"),
        ("film/groundtruth.txt", "compare film -o out"),
        ("film/rgb.txt", "map film -o out"),
        ("film/associations.txt", "map film -o out"),
    ] {
        let desk = Desk::furnished();
        for make in [fifo, |path: &std::path::Path| fs::create_dir(path).expect("made")] {
            let _ = fs::remove_file(desk.at(name));
            make(&desk.at(name));
            desk.refused(line, &[name, "not a regular file"]);
            let _ = fs::remove_dir(desk.at(name));
        }
    }
    let desk = Desk::furnished();
    let images = desk.images("film");
    fs::remove_file(&images[1]).expect("removed");
    fifo(&images[1]);
    let told = desk.done("map film -o out");
    assert!(told.contains("depth.txt line") && told.contains("not a regular file"), "{told}");
    fs::create_dir(desk.at("plain")).expect("made");
    for (k, image) in desk.images("rec/0000").iter().enumerate() {
        fs::copy(image, desk.at(&format!("plain/{k}.png"))).expect("copied");
    }
    fifo(&desk.at("plain/9.png"));
    let told = desk.run("metrics plain --intrinsics 145,145,79.5,59.5 --units-per-metre 5000");
    let told = String::from_utf8_lossy(&told.stderr);
    assert!(told.contains("9.png") && told.contains("not a regular file"), "{told}");
}

/// Regression test: it reported that there is no ground truth.
#[test]
fn a_comparison_names_the_line_of_its_ground_truth() {
    let desk = Desk::furnished();
    let good = fs::read_to_string(desk.at("film/groundtruth.txt")).expect("text");
    let lines = good.lines().count();
    desk.put("film/groundtruth.txt", format!("{good}9 1e155 0 0 0 0 0 1\n"));
    let says = [&*format!("groundtruth.txt, line {}: ", lines + 1), "1e155"];
    desk.refused("compare film -o out", &says);
}

/// An image file far larger than its pixels is no image; lists or videos of gigabytes belong to no recording.
#[test]
fn files_of_a_recording_have_the_size_of_their_kind() {
    let sparse = |desk: &Desk, name: &str, megabytes: u64| {
        let file = fs::File::create(desk.at(name)).expect("made");
        file.set_len(megabytes << 20).expect("a disk with sparse files");
    };
    for (name, megabytes, says) in [
        ("rec/extra.png", 65, "(64 MB)"),
        ("rec/extra.txt", 257, "(256 MB)"),
        ("rec/extra.mp4", 3000, "(1024 MB)"),
    ] {
        let desk = Desk::furnished();
        sparse(&desk, name, megabytes);
        desk.refused("correct rec -m model.json -o out", &[name, says]);
        assert!(!desk.at("out").exists());
    }
    let desk = Desk::new();
    let folder = fs::read_dir(desk.at("rec/0000/depth")).expect("images");
    for image in folder {
        let file = fs::File::options().write(true).open(image.expect("one").path()).expect("open");
        file.set_len(3 << 20).expect("longer");
    }
    let told = desk.done("calibrate rec -o out");
    assert!(told.contains("0000 was left out") && told.contains("MB"), "{told}");
}

/// A run right after a kill removes what the killed run left.
#[test]
fn what_the_dead_left_goes_whatever_its_age() {
    let desk = Desk::new();
    let mut child = std::process::Command::new("true").spawn().expect("true");
    let dead = child.id();
    child.wait().expect("it ends");
    let alive = std::process::id();
    for name in [format!(".kinoise-{dead}-0"), format!(".kinoise-{alive}-0")] {
        fs::create_dir(desk.at(&name)).expect("made");
    }
    desk.put(&format!(".kinoise-{dead}-aBcDeF"), "half");
    desk.put(&format!(".kinoise-{dead}-1.kept/whole"), "");
    desk.done("calibrate rec -o out");
    assert!(!desk.at(&format!(".kinoise-{dead}-0")).exists());
    assert!(!desk.at(&format!(".kinoise-{dead}-aBcDeF")).exists());
    assert!(desk.at(&format!(".kinoise-{alive}-0")).exists());
    assert!(desk.at(&format!(".kinoise-{dead}-1.kept")).exists());
}

/// Regression test: messages such as "1 measured sigmas" did not name the recording; the same for models of
/// another size.
#[test]
fn what_does_not_fit_together_is_named() {
    let desk = Desk::furnished();
    desk.done("simulate one --shrink 4 --frames 4 --distances 1 --tilts 0");
    desk.refused("calibrate one -o out", &["one: 1 measured sigma is too few"]);
    let small = json!({"format": "recording/1", "sensor": "Kinect", "width": 64, "height": 48,
        "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "units_per_metre": 5000});
    desk.model("small.json", |model| model["sensor"] = small);
    for (line, name) in [
        ("diagnose rec -m small.json -o out2", "small.json: "),
        ("simulate out2 --like rec -m small.json", "small.json: "),
        ("map film -m small.json -o out2", "small.json: "),
        ("sigma film -m small.json -o out2", "small.json: "),
        ("correct rec -m small.json -o out2", "rec: "),
    ] {
        desk.refused(line, &[name, "64 x 48 px"]);
    }
    let text = std::fs::read_to_string(desk.at("one/recording.json")).expect("a recording");
    let mut described: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let described = described.as_object_mut().expect("an object");
    described.remove("units_per_metre");
    described.insert("raw_disparity".into(), json!({"offset": 3.33, "slope": -0.00307}));
    described.insert("invalid".into(), json!(0));
    std::fs::write(desk.at("one/recording.json"), json!(described).to_string()).expect("written");
    desk.refused("calibrate one -o out", &["within raw_disparity"]);
}

/// Regression test: messages named this program's types, and numbers with rounding errors of sums.
#[test]
fn messages_are_in_plain_words() {
    let board = |flatness: f64| json!({"width_m": 1, "height_m": 0.8, "flatness_m": flatness});
    for (view, says) in [
        (
            json!({"target": 5}),
            "line 2: target: invalid type: integer `5`, expected an object with width_m and height_m",
        ),
        (
            json!({"target": {"width_m": "a"}}),
            "line 2: target: invalid type: string \"a\", expected a number",
        ),
        (json!({"roi": 5}), "line 2: roi: "),
        (json!({"target": board(0.5)}), "shorter side, 0.08; is it"),
    ] {
        let desk = Desk::new();
        desk.put("rec/0000/view.json", format!("{view:#}"));
        let told = desk.done("calibrate rec -o out");
        assert!(told.contains(says), "{says}: {told}");
    }
    let desk = Desk::new();
    for (key, value, says) in [
        ("raw_disparity", json!(5), "expected an object with offset and slope"),
        ("intrinsics_uncertainty", json!("x"), "expected an object with any of fx, fy, cx and cy"),
        ("width", json!(1.5), "expected a whole number"),
    ] {
        desk.describe(|sensor| sensor[key] = value);
        desk.refused("calibrate rec -o out", &[key, says]);
    }
    for key in ["sigma", "fit", "provenance", "effects"] {
        desk.model("model.json", |model| model[key] = json!(5));
        let says = ["model.json: line ", "integer `5`, expected a"];
        desk.refused("export model.json --format c -o noise.h", &says);
        let told = desk.run("export model.json --format c -o noise.h").stderr;
        assert!(!String::from_utf8_lossy(&told).contains("struct "));
    }
    desk.refused("simulate out --seed=inf", &["from 0 to 18446744073709551615"]);
    desk.refused("simulate out --effect x:y=1", &["radial-disparity-bias, ", "which has "]);
    desk.refused("simulate out --effect radial:y=1", &["did you mean radial-disparity-bias?"]);
}

/// Regression test: a shift of 600 m was reported for depths that end with the code, at 13 m.
#[test]
fn a_correction_tells_what_it_stored() {
    let desk = Desk::new();
    desk.done("simulate far --shrink 8 --frames 2 --distances 8 --tilts 0 --wall-target");
    desk.model("model.json", |model| {
        let bowl = json!({"id": "radial-disparity-bias", "parameters": {"k_px": 4}});
        model["effects"] = json!([bowl]);
    });
    let output = desk.run("correct far -m model.json -o out --json");
    let told: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let [clamped, rms_mm] = ["clamped", "rms_shift_mm"].map(|key| told[key].as_f64().expect(key));
    // From 8 m to the end of the code, where most of them are clamped.
    let end_mm = 1e3 * (f64::from(u16::MAX) / 5000.0 - 8.0);
    assert!(clamped > 0.5 * told["pixels"].as_f64().expect("pixels"), "{told}");
    assert!((0.7 * end_mm..1.1 * end_mm).contains(&rms_mm), "{told}");
}

/// Regression test: both were written, and one then got in the way of the other.
#[test]
fn a_correction_and_its_uncertainty_lie_apart() {
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    for (output, sigma) in
        [("out", "out"), ("out", "./x/../out"), ("out", "out/sigma"), ("s/out", "s")]
    {
        let line = format!("correct rec -m model.json -o {output} --sigma {sigma}");
        desk.refused(&line, &["would lie one in the other"]);
        assert!(!desk.at("out").exists() && !desk.at("s").exists());
    }
    // A path through a missing folder leads where it appears to lead.
    desk.refused("calibrate rec -o x/../rec/out", &["inside the recording"]);
    assert!(!desk.at("x").exists() && !desk.at("rec/out").exists());
}

/// Found by fuzzing: the number of bytes of 4 thousand million columns by as many rows overflows.
#[test]
fn no_size_of_an_image_is_too_large_to_be_refused() {
    let desk = Desk::new();
    let folder = fs::read_dir(desk.at("rec/0000/depth")).expect("images");
    for image in folder {
        let image = image.expect("one").path();
        for size in [usize::MAX, u32::MAX as usize, 0, 1] {
            assert!(FrameSource::new(size, size).read(&image).is_err(), "{size}");
        }
    }
}

/// Regression test: a finished recording could not be moved to its place, because the name was too long for
/// the disk.
#[test]
fn what_cannot_be_written_is_told_before_the_work() {
    let desk = Desk::new();
    let name = "x".repeat(256);
    desk.refused(&format!("calibrate rec -o {name}"), &["too long"]);
    desk.refused(&format!("simulate {name} --distances 1 --tilts 0"), &["too long"]);
    let left = fs::read_dir(desk.at(".")).expect("the desk").flatten();
    let left: Vec<_> = left.map(|entry| entry.file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().contains("kinoise")), "{left:?}");
}

/// Options of a film given without --room, options that a film does not take, and causes that leave nothing
/// visible.
#[test]
fn options_of_a_film_are_told_without_one() {
    let desk = Desk::new();
    for option in ["--stride 3", "--trajectory poses.txt"] {
        let line = format!("simulate out --shrink 8 --distances 1 --tilts 0 {option}");
        desk.refused(&line, &[&option[..8], "give --room too"]);
    }
    desk.film("film", 2);
    for option in ["--intrinsics 145,145,79.5,59.5", "--units-per-metre 1000", "--baseline 0.08"] {
        let name = option.split(' ').next().expect("a name");
        let says = [name, "recording.json", "leave the option out"];
        desk.refused(&format!("map film -o out {option}"), &says);
    }
    let dark = "--room --shrink 8 --frames 2 --physics speckle --cause light=0";
    desk.refused(&format!("simulate out {dark}"), &["no frame shows any depth"]);
    let light = "--shrink 8 --distances 1 --tilts 0 --physics speckle --cause light=1e9";
    desk.refused(&format!("simulate out {light}"), &["is outside 0 to 100; give a value within"]);
    assert!(!desk.at("out").exists());
}
