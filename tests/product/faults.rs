//! Machine faults: a full disk, an unwritable stdout, files that vanish while they are read. The result is
//! one message and exit code 2, or a result that names what it lacks; nothing is left behind.
//! reports/reliability covers the same at length.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use kinoise::io::{Assumed, open};
use kinoise::{CalibrateOptions, measure_recording, model_of};

use crate::common::{GOOD_VIEWS, copy_tree, good, tree, write_depth};
use crate::desk::Desk;

/// The program with the words of `line`, after the shell command `before`.
fn shell(desk: &Desk, before: &str, line: &str) -> Command {
    let mut command = Command::new("bash");
    command.current_dir(desk.path());
    command.args(["-c", &format!("{before} exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_kinoise")]);
    command.args(line.split(' ')).env("SOURCE_DATE_EPOCH", "1700000000");
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[track_caller]
fn failed(output: &Output, line: &str, needle: &str) {
    let said = said(output);
    assert_eq!(output.status.code(), Some(2), "{line}: {said}");
    let message = said.lines().last().unwrap_or_default();
    assert!(message.starts_with("kinoise: ") && message.contains(needle), "{line}: {said}");
}

/// A file size limit aborts a write like a full disk.
#[test]
fn a_full_disk_costs_the_run_and_nothing_that_was_there() {
    let desk = Desk::furnished();
    for line in [
        "calibrate rec -o out",
        "diagnose rec -m model.json -o out",
        "correct rec -m model.json -o out",
        "map film -o out",
        "sigma film -m model.json -o out",
        "metrics rec -o out",
        "man out",
        "simulate out --shrink 4 --frames 1 --distances 1,2 --tilts 0",
        "simulate out --room --shrink 4 --frames 2",
        "export model.json --format npz -o out",
    ] {
        let before = tree(desk.path());
        let limited = |line: &str| shell(&desk, "ulimit -f 1;", line).output().expect("bash");
        failed(&limited(line), line, "ulimit -f");
        assert!(tree(desk.path()) == before, "{line}: something was written");
        assert!(!desk.at("out").exists(), "{line}");

        // Over results of an earlier run, which must stay unchanged.
        let done = shell(&desk, "", line).output().expect("bash");
        assert!(matches!(done.status.code(), Some(0 | 1)), "{line}: {}", said(&done));
        let before = tree(desk.path());
        failed(&limited(&format!("{line} --force")), line, "ulimit -f");
        assert!(tree(desk.path()) == before, "{line}: the earlier results changed");
        if desk.at("out").is_dir() {
            fs::remove_dir_all(desk.at("out")).expect("removed");
        } else {
            fs::remove_file(desk.at("out")).expect("removed");
        }
    }
}

#[cfg(target_os = "linux")] // /dev/full
#[test]
fn an_answer_that_nobody_gets_is_a_failure_and_a_lost_message_is_none() {
    let desk = Desk::furnished();
    for line in [
        "effects --list",
        "effects --json",
        "schema model",
        "completions bash",
        "metrics rec --json",
        "calibrate rec -o out --json",
    ] {
        let full = fs::File::options().write(true).open("/dev/full").expect("a device");
        let output = shell(&desk, "", line).stdout(full).output().expect("bash");
        failed(&output, line, "stdout");
        // A reader that closes early is no failure.
        let closed = shell(&desk, "exec 1> >(:); sleep 0.1;", line).stderr(Stdio::null()).status();
        assert_eq!(closed.expect("bash").code(), Some(0), "{line}");
        let _ = fs::remove_dir_all(desk.at("out"));
    }
    for (line, code) in [("calibrate rec -o out", 0), ("calibrate none -o none", 2), ("no", 2)] {
        for stderr in ["2>/dev/full", "2>&-", "2> >(:); sleep 0.1"] {
            let _ = fs::remove_dir_all(desk.at("out"));
            let status = shell(&desk, &format!("exec {stderr};"), line).status().expect("bash");
            assert_eq!(status.code(), Some(code), "{line} {stderr}");
        }
    }
}

/// A change to a view while it is being read.
type Change = fn(&Path);

/// Changes files after the lists were read and before the images are.
#[test]
fn a_recording_that_changes_while_it_is_read_costs_what_has_changed() {
    let changes: [(&str, Change); 6] = [
        ("a frame is gone", |view| fs::remove_file(view.join("depth/0000.png")).expect("gone")),
        ("a frame is cut", |view| {
            let file = fs::File::options().write(true).open(view.join("depth/0000.png"));
            file.expect("there").set_len(100).expect("cut");
        }),
        ("a frame has another size", |view| {
            let flat = kinoise::Frame { width: 32, height: 24, raw: vec![5000; 32 * 24] };
            write_depth(&view.join("depth/0000.png"), &flat);
        }),
        ("a folder in place of a frame", |view| {
            fs::remove_file(view.join("depth/0000.png")).expect("gone");
            fs::create_dir(view.join("depth/0000.png")).expect("made");
        }),
        ("the view is gone", |view| fs::remove_dir_all(view).expect("gone")),
        ("the list is gone", |view| fs::remove_file(view.join("depth.txt")).expect("gone")),
    ];
    for (what, change) in changes {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
        let root = folder.path().join("rec");
        copy_tree(good(), &root);
        let recording = open(&root, &Assumed::default()).expect("a recording");
        change(&root.join("0005"));
        let options = CalibrateOptions::default();
        let measured = measure_recording(&recording, &options.measure, &|_, _| ()).expect(what);
        let untouched = measured.views.iter().filter(|v| v.name != "0005").count();
        assert_eq!(untouched, GOOD_VIEWS - 1, "{what}");
        let lost = measured.excluded.iter().any(|e| e.to_string().contains("0005"));
        assert_eq!(lost, what == "the view is gone", "{what}: {:?}", measured.excluded);
        assert_eq!(lost, measured.views.len() < GOOD_VIEWS, "{what}");
        match model_of(&recording, &measured, &options) {
            Ok(found) => assert!(found.model.sigma.sigma(2.0, 0.0) > 0.0, "{what}"),
            // A model records hashes of its input, including the lists.
            Err(e) => {
                assert!(what.contains("gone") && e.to_string().contains("0005/depth.txt"), "{e}")
            }
        }
    }
}
