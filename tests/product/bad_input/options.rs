//! Options and output folders.

use super::*;

/// The good recording's images without the description.
fn plain_folder() -> Bench {
    let bench = Bench::empty();
    for view in 0..common::GOOD_VIEWS {
        let from = good().join(format!("{view:04}/depth/0000.png"));
        bench.put(&format!("{view:04}.png"), fs::read(from).expect("read"));
    }
    bench
}

#[test]
fn a_plain_folder_needs_its_intrinsics() {
    plain_folder().calibrate().fails(&["recording", "--intrinsics fx,fy,cx,cy"]);
    plain_folder()
        .calibrate_with(&["--intrinsics", "145,145,79.5,59.5", "--units-per-metre", "5000"])
        .tells(&["12 of 12 views", "single frame"]);
}

#[test]
fn options_that_mean_nothing() {
    for (options, says) in [
        (["--intrinsics", "0,0,0,0"], "--intrinsics"),
        (["--intrinsics", "NaN,145,79.5,59.5"], "--intrinsics"),
        (["--intrinsics", "145,145,inf,59.5"], "--intrinsics"),
        (["--intrinsics", "-145,145,79.5,59.5"], "--intrinsics"),
        (["--intrinsics", "a,b,c,d"], "--intrinsics"),
        (["--intrinsics", "145,145"], "--intrinsics"),
        (["--raw-disparity", "0,0"], "raw_disparity"),
        (["--raw-disparity", "x,y"], "--raw-disparity"),
        (["--units-per-metre", "0"], "--units-per-metre"),
        (["--units-per-metre", "NaN"], "--units-per-metre"),
        (["--baseline", "0"], "baseline"),
        (["--form", "cubic"], "cubic"),
        (["--sigma", "loud"], "--sigma"),
        (["--ransac-threshold", "0"], "--ransac-threshold"),
        (["--ransac-threshold", "NaN"], "--ransac-threshold"),
        (["--threads", "0"], "--threads"),
        (["--threads", "many"], "--threads"),
        (["--seed", "x"], "--seed"),
        (["--colour", "red"], "--colour"),
    ] {
        let mut all = options.to_vec();
        if options[0] != "--intrinsics" {
            all.extend(["--intrinsics", "145,145,79.5,59.5"]);
        }
        plain_folder().calibrate_with(&all).fails(&[says]);
    }
}

#[test]
fn options_that_would_have_no_effect() {
    for (option, value) in [
        ("--intrinsics", "145,145,79.5,59.5"),
        ("--units-per-metre", "1000"),
        ("--raw-disparity", "3.33,-0.003"),
        ("--baseline", "0.08"),
    ] {
        Bench::good().calibrate_with(&[option, value]).fails(&[
            option,
            "recording.json",
            "leave the option out",
        ]);
    }
}

#[test]
fn an_image_size_for_a_model_that_has_its_own() {
    let bench = Bench::good();
    bench.calibrate().tells(&[]);
    let model = bench.out().join("model.json");
    let simulate = |options: &[&str]| {
        let out = bench.folder.path().join("simulated");
        kinoise().arg("simulate").arg(out).args(options).output().expect("the program runs")
    };
    let path = model.to_str().expect("a plain path");
    for (options, says) in [
        (&["--model", path, "--shrink", "2"][..], "--shrink: "),
        (&["--shrink", "9"], "1 to 8"),
        (&["--shrink", "0"], "1 to 8"),
    ] {
        let output = simulate(options);
        let stderr = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(says) && stderr.lines().count() == 1, "{stderr}");
    }
    let help = String::from_utf8(simulate(&["-h"]).stdout).expect("text");
    assert!(help.contains("--shrink") && help.contains("to 8"), "{help}");
}

#[test]
fn no_command_and_a_wrong_one() {
    for arguments in [&[][..], &["calibrat"], &["calibrate"], &["fit", "x.csv"]] {
        let output = kinoise().args(arguments).output().expect("the program runs");
        let stderr = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(output.stdout.is_empty());
        if !arguments.is_empty() {
            assert_eq!(stderr.matches("kinoise: ").count(), 1, "{stderr}");
            assert_eq!(stderr.lines().count(), 1, "{stderr}");
        }
    }
}

/// Permission bits do not stop root; a path below a regular file fails for every user.
#[test]
fn a_folder_that_cannot_be_written() {
    let bench = Bench::good();
    let file = bench.folder.path().join("file");
    fs::write(&file, b"in the way").expect("written");
    for out in [file.join("below"), file.clone()] {
        bench.run_to("calibrate", &bench.recording(), &out, &[]).fails(&["file", "-o"]);
        let table = bench.folder.path().join("table.csv");
        fs::write(&table, GOOD_TABLE).expect("written");
        bench.run_to("fit", &table, &out, &[]).fails(&["file", "-o"]);
    }
    assert_eq!(fs::read(&file).expect("read"), b"in the way");
}

#[test]
fn a_model_to_simulate_with_that_is_none() {
    let bench = Bench::empty();
    let model = bench.folder.path().join("model.json");
    for text in ["", "{}", "{\"format\": \"kinoise-model/9\"}", "{\"format\": \"kinoise-model/1\"}"]
    {
        fs::write(&model, text).expect("written");
        let output = kinoise()
            .arg("simulate")
            .arg(bench.recording())
            .arg("--model")
            .arg(&model)
            .output()
            .expect("the program runs");
        let stderr = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.starts_with("kinoise: ") && stderr.contains("model.json"), "{stderr}");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        assert!(!bench.recording().exists(), "nothing is written before the model is read");
    }
}
