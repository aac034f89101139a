//! `depth.txt`, `view.json`, and too few or too uniform views.

use super::*;

#[test]
fn a_list_that_names_a_missing_file() {
    let bench = Bench::good();
    fs::remove_file(bench.file("0006/depth/0000.png")).expect("removed");
    let result = bench.calibrate().tells(&["view 0006", "depth.txt line 2", "0000.png", "missing"]);
    assert_eq!(used(&result), common::GOOD_VIEWS);
    fs::remove_file(bench.file("0006/depth/0001.png")).expect("removed");
    bench.calibrate().tells(&["view 0006 was left out", "0006/depth.txt"]);
}

#[test]
fn lines_that_are_no_frames() {
    let bench = Bench::good();
    let mut spoilt: Vec<String> = Vec::new();
    for line in ["no-time depth/0001.png", "NAN depth/0001.png", "INF depth/0001.png", "3.5"] {
        let view = spoilt.len();
        bench.edit(&format!("{view:04}/depth.txt"), |t| format!("{t}{line}\n"));
        spoilt.push(format!("{view:04}/depth.txt, line 4: \"{line}\""));
    }
    let needles: Vec<&str> = spoilt.iter().map(String::as_str).collect();
    let result = bench.calibrate().tells(&needles);
    assert_eq!(used(&result), common::GOOD_VIEWS - needles.len());
}

#[test]
fn a_list_that_is_empty_or_binary() {
    let bench = Bench::good();
    bench.put("0001/depth.txt", "# nothing\n").put("0002/depth.txt", [0xff, 0x00, 0xfe]);
    let result = bench.calibrate().tells(&["view 0001 was left out", "view 0002 was left out"]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 2);
}

#[test]
fn a_folder_with_a_view_file_and_no_list() {
    let bench = Bench::good();
    bench.put("notes/view.json", "{}");
    bench.calibrate().tells(&["view notes was left out", "depth.txt"]);
}

#[test]
fn frames_out_of_order_are_sorted() {
    let bench = Bench::good();
    let told = |run: Run, says: &str| assert_eq!(used(&run.tells(&["view 0006", says])), 12);
    bench.edit("0006/depth.txt", |t| {
        let mut lines: Vec<&str> = t.lines().collect();
        lines.reverse();
        lines.join("\n\n").replace(' ', "\t") + "\n"
    });
    told(bench.calibrate(), "out of order");
    let files = |bench: &Bench| {
        ["model.json", "measurements.csv"].map(|n| fs::read(bench.out().join(n)).expect("read"))
    };
    let sorted = Bench::good();
    sorted.calibrate().tells(&[]);
    assert_eq!(files(&bench)[1], files(&sorted)[1], "order in the list changes no number");
}

#[test]
fn a_timestamp_given_twice() {
    let bench = Bench::good();
    bench.edit("0006/depth.txt", |t| format!("{t}{}\n", t.lines().last().expect("a line")));
    bench.calibrate().tells(&["view 0006", "twice"]);
    let bench = Bench::good();
    bench.put("0006/depth.txt", "1.0 depth/0000.png\n1.0 depth/0001.png\n");
    bench.calibrate().tells(&["view 0006", "depth.txt", "same timestamp"]);
}

#[test]
fn a_broken_view_file_costs_its_view_alone() {
    let broken = [
        ("{\n\"roi\": [1, 2\n", "line"),
        ("{\"roi\": [1, 2, 3]}", "line 1"),
        ("{\"polygon\": [[10, 10], [20, 20]]}", "three corners"),
        ("{\"polygon\": []}", "three corners"),
        ("{\"roi\": [50, 50, 50, 60]}", "empty"),
        ("{\"roi\": [60, 50, 40, 60]}", "empty"),
        ("{\"roi\": [60, 50, 80, 70], \"polygon\": [[1, 1], [9, 1], [9, 9]]}", "both"),
        ("{\"reference_distance_m\": -1}", "reference_distance_m"),
        ("{\"reference_distance_m\": 1e999}", "line 1"),
        ("{\"reference_uncertainty_m\": 0.001}", "without reference_distance_m"),
        (
            "{\"reference_distance_m\": 2, \"reference_uncertainty_m\": 0}",
            "reference_uncertainty_m = 0 must",
        ),
        (
            "{\"reference_distance_m\": 2, \"reference_uncertainty_m\": 3}",
            "reference_uncertainty_m = 3 must be above 0 and below reference_distance_m = 2; is it in millimetres?",
        ),
        ("{\"reference_distance_m\": 2, \"reference_uncertainty_m\": \"1\"}", "line 1"),
        (
            "{\"target\": {\"width_m\": 1, \"height_m\": 0.5, \"flatness_m\": 0.2}}",
            "target.flatness_m = 0.2 must be above 0 and at most a tenth",
        ),
        ("{\"target\": {\"width_m\": 1, \"height_m\": -0.5}}", "height_m = -0.5"),
    ];
    for few in broken.chunks(3) {
        let bench = Bench::good();
        for (view, (text, _)) in few.iter().enumerate() {
            bench.put(&format!("{view:04}/view.json"), text);
        }
        let run = bench.calibrate();
        for (view, (_, says)) in few.iter().enumerate() {
            let told = format!("view {view:04} was left out");
            let line = run.stderr.lines().find(|l| l.contains(&told)).expect(&run.stderr);
            assert!(line.contains("view.json") && line.contains(says), "{says}: {line}");
        }
        assert_eq!(used(&run.tells(&[])), common::GOOD_VIEWS - few.len());
    }
}

#[test]
fn a_region_that_holds_nothing() {
    let bench = Bench::good();
    let empty = [
        ("{\"polygon\": [[900, 900], [990, 900], [990, 990]]}", "outside the image"),
        ("{\"polygon\": [[50, 50], [50, 50], [50, 50]]}", "region"),
        ("{\"roi\": [0, 0, 3, 3]}", "region"),
        ("{\"roi\": [-1e9, -1e9, -1e8, -1e8]}", "outside the image"),
    ];
    for (view, (text, _)) in empty.iter().enumerate() {
        bench.put(&format!("{view:04}/view.json"), text);
    }
    let result = bench.calibrate().tells(&[]);
    assert_eq!(used(&result), common::GOOD_VIEWS - empty.len());
    for (excluded, (_, says)) in result["excluded"].as_array().expect("a list").iter().zip(empty) {
        assert!(excluded["reason"].as_str().expect("words").contains(says), "{excluded}");
    }
    let bench = Bench::good();
    bench
        .put("0008/view.json", "{\"polygon\": [[1e308, -1e308], [-1e308, 1e308], [1e308, 1e308]]}");
    bench.calibrate().tells(&[]);
}

/// A broken view among many smaller notes must not be cut off the list.
#[test]
fn a_view_left_out_is_told_before_smaller_oddities() {
    let bench = Bench::good();
    for view in 0..11 {
        bench.put(&format!("{view:04}/depth/0001.png"), b"spoiled");
    }
    bench.put("0011/view.json", "{");
    bench.calibrate().tells(&["view 0011 was left out"]);
}

#[test]
fn too_few_or_too_uniform_views() {
    Bench::of(&[1.5], &[0.0]).calibrate().fails(&["measurements.csv", "too few"]);
    Bench::of(&[1.0, 2.0], &[0.0]).calibrate().fails(&["measurements.csv"]);
    Bench::of(&[2.0], &[0.0, 20.0, 40.0, 50.0, 60.0]).calibrate().fails_or_tells(&["note: "]);
    Bench::of(&[1.0, 1.5, 2.0, 3.0], &[0.0]).calibrate().tells(&["tilt"]);
    Bench::of(&[2.0], &[0.0, 0.5, 1.0, 1.5, 2.0])
        .calibrate()
        .fails(&["1 different distance", "other distances"]);
}

/// When no model can be fitted, the user needs the reasons for the excluded views.
#[test]
fn exclusions_are_told_when_the_fit_fails_too() {
    let bench = Bench::of(&[1.0, 1.5, 2.0, 2.5], &[0.0]);
    let nothing = Frame { width: 160, height: 120, raw: vec![0; 160 * 120] };
    for view in 0..3 {
        for frame in 0..2 {
            write_depth(&bench.file(&format!("{view:04}/depth/{frame:04}.png")), &nothing);
        }
    }
    let run = bench.calibrate();
    run.fails(&["too few"]);
    assert!(run.stderr.contains("view 0001 was left out"), "{}", run.stderr);
}
