//! Absurd numbers, files and names: one message and exit code 2, quickly and with little memory. Never
//! "match", never a hang, never a foreign file in the result.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::time::Duration;

use kinoise::{NoiseModel, SigmaModel};
use serde_json::{Value, json};

use crate::common::{good, kinoise, write_png};
use crate::desk::{Desk, fifo};

/// A sparse file of a terabyte.
fn sparse(path: &Path) {
    let file = fs::File::create(path).expect("made");
    file.set_len(1 << 40).expect("a disk with sparse files");
}

/// Regression test: a surface seen edge on had no sigma, and so no position.
#[test]
fn every_point_of_a_map_is_a_number_and_none_is_certain() {
    let desk = Desk::new();
    desk.done("simulate film --room --shrink 4 --frames 10");
    desk.done("map film --method paper --iterations 3 -o out");
    let ply = fs::read(desk.at("out/map.ply")).expect("read");
    let end = b"end_header\n";
    let begin = ply.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let points = ply[begin..].chunks_exact(31);
    assert!(points.len() > 5000, "{}", points.len());
    for point in points {
        let float = |at: usize| f32::from_le_bytes(point[at..at + 4].try_into().expect("four"));
        let sigma = float(27);
        let all = [0, 4, 8, 12, 16, 20].map(float);
        assert!(all.iter().all(|v| v.is_finite()) && sigma > 0.0 && sigma < 1.0, "{all:?} {sigma}");
    }
}

/// Refuses days of work and counts that overflow.
#[test]
fn options_of_a_map_have_their_ranges() {
    let desk = Desk::new();
    desk.film("film", 2);
    for (option, says) in [
        ("--iterations 0", "1 to 1000"),
        ("--iterations 1000000000000", "1 to 1000"),
        ("--iterations 99999999999999999999999", "--iterations"),
        ("--memory 0.5", "1 to 108000"),
        ("--memory inf", "1 to 108000"),
        ("--memory 1e30", "1 to 108000"),
        ("--memory NaN", "1 to 108000"),
        ("--voxel 1e-30", "0.002 to 1 m"),
        ("--block 100000", "1 to 32"),
        ("--gate inf", "0.001 to 2 m"),
        ("--stride 1000000000000", "--stride"),
    ] {
        desk.refused(&format!("map film -o out {option}"), &[says]);
    }
    desk.done("map film -o out --iterations 1000 --memory 108000");
}

/// An alignment without any pair of points has no distance between them.
#[test]
fn a_lost_frame_has_no_number_that_is_none() {
    let desk = Desk::new();
    desk.film("film", 3);
    let images = desk.images("film");
    let flat = kinoise::Frame { width: 160, height: 120, raw: vec![60_000; 160 * 120] };
    crate::common::write_depth(&images[2], &flat);
    desk.done("map film -o out");
    let table = fs::read_to_string(desk.at("out/frames.csv")).expect("text");
    assert!(
        table.contains(",lost,") && !table.contains("inf") && !table.contains("NaN"),
        "{table}"
    );
}

/// The square of a coordinate must be finite.
#[test]
fn poses_that_are_nowhere_are_refused_with_their_line() {
    let desk = Desk::new();
    let good = "0 0 0 0 0 0 0 1\n0.5 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n";
    desk.put("good.txt", good);
    for (pose, says) in [
        ("2 1e155 0 0 0 0 0 1", "1e155"),
        ("2 0 0 -1e200 0 0 0 1", "metres"),
        ("2 0 0 0 0 0 0 1e200", "length 1"),
        ("2 0 0 0 1e155 0 0 1e155", "no rotation"),
        ("1305031098665900000 0 0 0 0 0 0 1", "seconds"),
    ] {
        desk.put("bad.txt", format!("{good}{pose}\n"));
        let says = ["bad.txt, line 4", says];
        desk.refused("evaluate --truth bad.txt --estimate good.txt", &says);
        desk.refused("evaluate --truth good.txt --estimate bad.txt", &says);
        desk.refused("simulate film --room --trajectory bad.txt --shrink 8", &says);
    }
}

/// The search for the nearest rotation would not end where there is none.
#[test]
fn poses_of_7_scenes_that_are_no_rotations_name_their_file() {
    let desk = Desk::new();
    desk.film("film", 3);
    let images = desk.images("film");
    fs::create_dir(desk.at("scenes")).expect("made");
    for (k, image) in images.iter().enumerate() {
        fs::copy(image, desk.at(&format!("scenes/frame-{k:06}.depth.png"))).expect("copied");
    }
    let map = "map scenes -o out --force --intrinsics 131.25,131.25,79.5,59.5";
    for (pose, says) in [
        ("-1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1", "mirrors"),
        ("0 0 0 0  0 0 0 0  0 0 0 0  0 0 0 0", "no rotation"),
        ("2 0 0 0  0 2 0 0  0 0 2 0  0 0 0 1", "no rotation"),
        ("1e160 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1", "no rotation"),
        ("1 0 0 1e155  0 1 0 0  0 0 1 0  0 0 0 1", "on earth"),
        ("1 0 0 0  0 1 0 0  0 0 1 0  5 0 0 1", "0 0 0 1"),
    ] {
        desk.put("scenes/frame-000001.pose.txt", pose);
        desk.refused(map, &["frame-000001.pose.txt", says]);
    }
    desk.put(
        "scenes/frame-000001.pose.txt",
        "1 0 0 0  0 0.999 0.0447 0  0 -0.0447 0.999 0  0 0 0 1",
    );
    desk.done(map);
}

/// Regression test: a baseline in mm allocated gigabytes.
#[test]
fn numbers_of_another_unit_are_named_by_key_and_line() {
    let text = fs::read_to_string(good().join("recording.json")).expect("text");
    for (from, to, key) in [
        ("\"baseline_m\": 0.075", "\"baseline_m\": 75", "baseline_m"),
        ("\"baseline_m\": 0.075", "\"baseline_m\": 7.5", "baseline_m"),
        ("\"baseline_m\": 0.075", "\"baseline_m\": 1e20", "baseline_m"),
        ("\"baseline_m\": 0.075", "\"baseline_m\": 1e-5", "baseline_m"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 1e-300", "units_per_metre"),
        ("\"units_per_metre\": 5000.0", "\"units_per_metre\": 1e9", "units_per_metre"),
        ("\"fx\": 145.0", "\"fx\": \"145\"", "fx"),
        ("\"cy\": 59.5", "\"cy\": [59.5]", "cy"),
        ("\"fx\": 145.0", "\"fx\": 1e9", "fx"),
    ] {
        let desk = Desk::new();
        let changed = text.replace(from, to);
        let line = 1 + changed.lines().position(|l| l.contains(key)).expect("the key");
        desk.put("rec/recording.json", changed);
        let says = [&*format!("recording.json, line {line}: "), key];
        desk.refused("diagnose rec -o out", &says);
    }
    // Wrong only together: 2.5 m is an allowed baseline, but not with such a narrow lens.
    let desk = Desk::new();
    let tele = text.replace("0.075", "2.5").replace("145.0", "1450.0");
    desk.put("rec/recording.json", tele);
    desk.refused("calibrate rec -o out", &["baseline_m", "fx"]);
    for (notes, key) in [
        ("{\n\"reference_distance_m\": 1500}", "reference_distance_m"),
        ("{\n\"temperature_c\": -300}", "temperature_c"),
        ("{\n\"ambient_lux\": 1e300}", "ambient_lux"),
        ("{\n\"target\": {\"width_m\": 1e6, \"height_m\": 1}}", "width_m"),
    ] {
        let desk = Desk::new();
        desk.put("rec/0000/view.json", notes);
        let told = desk.done("calibrate rec -o out");
        assert!(told.contains("view.json, line 2: ") && told.contains(key), "{key}: {told}");
    }
}

/// Regression test: some of these gave "match".
#[test]
fn an_absurd_model_is_an_error_for_every_command() {
    let effect = |id: &str, parameters: Value| json!([{"id": id, "parameters": parameters}]);
    let level = json!([{"id": "unexplained", "parameters": {}, "shape": [
        {"statistic": "variance", "basis": {"kind": "level"}, "coefficients": [200]}]}]);
    let desk = Desk::new();
    let models: [(&str, Value, &str); 6] = [
        ("bowl", effect("radial-disparity-bias", json!({"k_px": 100, "power": 0})), "k_px"),
        ("level", level, "200"),
        (
            "stripes",
            effect("column-banding", json!({"amplitude_px": 1e308, "period_px": -1e308})),
            "amplitude_px",
        ),
        ("period", effect("column-banding", json!({"period_px": 0})), "period_px"),
        ("dark", effect("vignetting", json!({"growth": {"value": 300}})), "growth"),
        ("far", Value::Null, "more than any depth"),
    ];
    for (name, effects, says) in models {
        desk.model(&format!("{name}.json"), |model| match effects {
            Value::Null => model["sigma"]["parameters"]["a"]["value"] = json!(1e10),
            effects => model["effects"] = effects,
        });
        for line in ["diagnose rec", "correct rec"] {
            desk.refused(&format!("{line} -m {name}.json -o out"), &[says]);
        }
    }
}

/// Regression test: a private file was copied into a corrected recording.
#[test]
fn nothing_outside_a_recording_is_copied() {
    let outside = tempfile::tempdir().expect("a folder");
    fs::write(outside.path().join("private.txt"), "secret").expect("written");
    let correct = "correct rec -m model.json -o out";
    for (name, target) in [
        ("rec/notes.txt", outside.path().join("private.txt")),
        ("rec/more", outside.path().to_path_buf()),
        ("rec/0000/depth/extra.png", "../../../model.json".into()),
    ] {
        let desk = Desk::new();
        desk.model("model.json", |_| ());
        symlink(target, desk.at(name)).expect("a link");
        desk.refused(correct, &[name, "leads out of the recording"]);
        assert!(!desk.at("out").exists());
    }
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    desk.put("elsewhere.png", "secret");
    desk.put("rec/rgb.txt", "0.0 ../elsewhere.png\n");
    desk.refused(correct, &["elsewhere.png", "stands outside"]);
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    symlink("recording.json", desk.at("rec/again.json")).expect("a link");
    desk.done(correct);
    let [one, two] =
        ["out/again.json", "rec/recording.json"].map(|f| fs::read(desk.at(f)).expect("there"));
    assert_eq!(one, two, "a link within stays what it says");
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    sparse(&desk.at("rec/film.raw"));
    desk.refused(correct, &["rec/film.raw", "(1024 MB)"]);
    fs::remove_file(desk.at("rec/film.raw")).expect("removed");
    fifo(&desk.at("rec/pipe"));
    desk.refused(correct, &["rec/pipe"]);
}

/// Recordings are often split by links to their views.
#[test]
fn views_may_be_links() {
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    desk.done("correct rec -m model.json -o all");
    fs::create_dir(desk.at("some")).expect("made");
    for name in ["recording.json", "0000"] {
        symlink(desk.at("rec").join(name), desk.at("some").join(name)).expect("a link");
    }
    desk.done("correct some -m model.json -o out");
    let image = fs::read_dir(desk.at("rec/0000/depth")).expect("listed").next();
    let image = image.expect("an image").expect("an entry").file_name();
    let [one, two] = ["all", "out"]
        .map(|f| fs::read(desk.at(f).join("0000/depth").join(&image)).expect("there"));
    assert_eq!(one, two);
    fs::write(desk.at("rec/0000/notes.txt"), "secret").expect("written");
    desk.refused("correct some -m model.json -o again", &["some/0000/notes.txt", "leads out"]);
}

#[test]
fn pipes_devices_and_sparse_files_are_no_input() {
    let desk = Desk::new();
    desk.put("poses.txt", "0 0 0 0 0 0 0 1\n");
    fifo(&desk.at("pipe"));
    sparse(&desk.at("sparse"));
    symlink("/dev/zero", desk.at("zero")).expect("a link");
    for (odd, says) in [("pipe", "a pipe"), ("zero", "a pipe or a device"), ("sparse", "MB")] {
        for line in [
            format!("fit {odd} -o out"),
            format!("evaluate --truth {odd} --estimate poses.txt"),
            format!("evaluate --truth poses.txt --estimate {odd}"),
            format!("diagnose rec -m {odd} -o out"),
            format!("capture new --source play:rec --advise {odd}"),
            format!("simulate film --room --trajectory {odd}"),
            format!("export --format python {odd} -o out.py"),
        ] {
            desk.refused(&line, &[odd, says]);
        }
        desk.refused(&format!("calibrate {odd} -o out"), &[odd]);
        desk.refused(&format!("map {odd} -o out"), &[odd]);
        // As a list and as an image of a recording.
        let bad = Desk::new();
        for name in ["rec/0000/depth.txt", "rec/0001/view.json"] {
            let _ = fs::remove_file(bad.at(name));
            symlink(desk.at(odd), bad.at(name)).expect("a link");
        }
        let image = fs::read_dir(bad.at("rec/0002/depth")).expect("images").next();
        let image = image.expect("one").expect("read").path();
        fs::remove_file(&image).expect("removed");
        symlink(desk.at(odd), &image).expect("a link");
        let told = bad.done("calibrate rec -o out");
        assert!(told.contains("view 0000 was left out"), "{odd}: {told}");
    }
}

/// Half a megabyte of PNG may decompress to gigabytes of pixels.
#[test]
fn images_of_another_size_are_not_unpacked() {
    let desk = Desk::new();
    let size = 4000;
    let pixels = vec![0; (size * size) as usize];
    let bomb = desk.at("bomb.png");
    write_png(&bomb, (size, size), png::ColorType::Grayscale, png::BitDepth::Eight, &pixels);
    let read = kinoise::io::read_infrared(&bomb, [160, 120]).expect_err("another size");
    assert!(read.to_string().contains("4000 x 4000 px, the depth 160 x 120"), "{read}");
    let read = kinoise::io::ColourImage::read(&bomb, [160, 120]).expect_err("another size");
    assert!(read.to_string().contains("4000 x 4000 px, the depth 160 x 120"), "{read}");
    // The header suffices: almost all pixels are cut off.
    let bytes = fs::read(&bomb).expect("read");
    fs::write(&bomb, &bytes[..60]).expect("written");
    let read = kinoise::io::read_infrared(&bomb, [160, 120]).expect_err("another size");
    assert!(read.to_string().contains("4000 x 4000 px"), "{read}");
}

/// A view's name with an escape sequence and a line that looks like the program's own.
#[test]
fn names_do_not_steer_the_terminal() {
    let desk = Desk::new();
    let name = "0000\u{1b}[2J\nkinoise: all is well\u{202e}";
    fs::rename(desk.at("rec/0000"), desk.at("rec").join(name)).expect("renamed");
    desk.put(&format!("rec/{name}/view.json"), "{");
    let told = desk.done("calibrate rec -o out");
    assert!(!told.contains(['\u{1b}', '\u{202e}']) && !told.contains("\nkinoise: all"), "{told}");
    assert!(told.contains(r"0000\u{1b}[2J\nkinoise: all is well"), "{told}");
    let output = kinoise().args(["calibrate", "a\u{1b}[2J\nb", "-o", "out"]).output().expect("run");
    let stderr = String::from_utf8(output.stderr).expect("text");
    assert!(stderr.lines().count() == 1 && !stderr.contains('\u{1b}'), "{stderr}");
}

#[test]
fn long_values_are_not_echoed_whole() {
    let desk = Desk::new();
    let long = "x".repeat(1 << 20);
    desk.put("model.json", format!("{{\"format\": \"{long}\"}}"));
    desk.refused("diagnose rec -m model.json -o out", &["make the model again"]);
    desk.put("rec/recording.json", format!("{{\"format\": \"{long}\"}}"));
    desk.refused("calibrate rec -o out", &["recording layout"]);
    let desk = Desk::new();
    desk.put("rec/0000/depth.txt", format!("0.0 {long}\n"));
    assert!(desk.done("calibrate rec -o out").len() < 10_000);
}

#[test]
fn words_that_are_no_text_are_refused() {
    use std::os::unix::ffi::OsStrExt;
    let odd = std::ffi::OsStr::from_bytes(b"\xff");
    for words in
        [vec![odd], vec!["film".as_ref(), odd], vec!["map".as_ref(), "--odd".as_ref(), odd]]
    {
        let out = crate::common::kinoise().args(&words).output().expect("run");
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains("--help"), "{said}");
    }
}

/// Root may read any folder: then the test shows nothing.
#[test]
fn a_folder_that_may_not_be_read_is_told() {
    let desk = Desk::new();
    fs::set_permissions(desk.at("rec/0000"), fs::Permissions::from_mode(0o000)).expect("set");
    let readable = fs::read_dir(desk.at("rec/0000")).is_ok();
    let told = desk.done("calibrate rec -o out");
    fs::set_permissions(desk.at("rec/0000"), fs::Permissions::from_mode(0o755)).expect("set");
    assert!(readable || told.contains("view 0000 was left out"), "{told}");
}

/// A run refuses a folder that another run is writing.
#[test]
fn two_runs_do_not_share_a_folder() {
    use kinoise::io::{Leaves, OutputFolder};
    let desk = Desk::new();
    desk.done("calibrate rec -o out");
    let leaves = Leaves::Results { names: &[&["x"]], marks: &["x"] };
    let other = OutputFolder::begin(&desk.at("out"), leaves, &[], true).expect("begun");
    desk.refused("calibrate rec -o out", &["another run", "out"]);
    drop(other);
    desk.done("calibrate rec -o out");
}

/// Regression test: 40,000 rows took two minutes.
#[test]
fn a_table_of_many_rows_is_pooled_and_says_so() {
    let sigma = SigmaModel::paper();
    let mut text = String::from("z_m,theta_rad,sigma_m,n\n");
    for k in 0..40_000 {
        // Every distance and tilt once, with an error of 5 % that follows no pattern.
        let (a, b) = (f64::from(k % 200) / 200.0, f64::from(k / 200) / 200.0);
        let (z, theta) = (1.0 + 3.0 * a, 1.2 * b);
        let off = 1.0 + 0.05 * (f64::from(k) * 12.9898).sin();
        text += &format!("{z},{theta},{},200\n", off * sigma.sigma(z, theta));
    }
    let desk = Desk::new();
    desk.put("table.csv", text);
    let told = desk.done("fit table.csv --form paper -o out");
    assert!(told.contains("40000 rows were pooled by distance and tilt into 10000"), "{told}");
    let model = NoiseModel::read(&desk.at("out")).expect("a model").sigma;
    for (z, theta) in [(1.0, 0.0), (2.0, 0.5), (3.9, 1.0)] {
        let ratio = model.sigma(z, theta) / sigma.sigma(z, theta);
        assert!((ratio - 1.0).abs() < 0.01, "{z} {theta}: {ratio}");
    }
}

/// A killed run cannot clean up; the next one does, but keeps what another run is writing.
#[test]
fn what_a_killed_run_left_goes_with_the_next() {
    use kinoise::io::{Leaves, OutputFolder};
    let desk = Desk::new();
    let leaves = Leaves::Results { names: &[&["x"]], marks: &["x"] };
    let alive = OutputFolder::begin(&desk.at("other"), leaves, &[], false).expect("begun");
    desk.put(".kinoise-1-0/half", "");
    desk.put(".kinoise-1-1.kept/whole", "");
    desk.put(".kinoise-1-2/young", "");
    let hour_ago = std::time::SystemTime::now() - Duration::from_secs(3600);
    for old in [alive.path(), &desk.at(".kinoise-1-0"), &desk.at(".kinoise-1-1.kept")] {
        fs::File::open(old).expect("a folder").set_modified(hour_ago).expect("set");
    }
    desk.done("calibrate rec -o out");
    assert!(!desk.at(".kinoise-1-0").exists());
    let stays = [alive.path(), &desk.at(".kinoise-1-1.kept"), &desk.at(".kinoise-1-2")];
    assert!(stays.iter().all(|folder| folder.exists()));

    // The same for the file that a killed export was writing.
    desk.model("model.json", |_| ());
    for (name, age) in [(".kinoise-old", 3600), (".kinoise-new", 1)] {
        desk.put(name, "half");
        let time = std::time::SystemTime::now() - Duration::from_secs(age);
        let file = fs::File::options().write(true).open(desk.at(name)).expect("there");
        file.set_modified(time).expect("set");
    }
    desk.done("export model.json --format c -o noise.h");
    assert!(!desk.at(".kinoise-old").exists() && desk.at(".kinoise-new").exists());
}

/// A result renamed over a device would replace it for good.
#[test]
fn a_result_does_not_replace_a_pipe_or_a_device() {
    let desk = Desk::new();
    desk.model("model.json", |_| ());
    fifo(&desk.at("pipe"));
    desk.refused("export model.json --format c -o pipe --force", &["pipe", "no file"]);
    desk.refused("simulate new --shrink 8 --frames 1 --recipe pipe", &["pipe"]);
    assert!(!fs::metadata(desk.at("pipe")).expect("there").is_file());
}
