//! `kinoise capture` from a played recording and a growing folder, its screen, and failures.

use std::fs;
use std::path::Path;
use std::process::{Child, Command as Process, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use kinoise::Seed;
use kinoise::io::{Assumed, open};
use kinoise::simulate::{Scenery, Shoot, plan_grid};

use crate::common;
use crate::common::capture::{FRAMES, HELD_STILL, folder, frames_of, json, told};
use crate::common::{BOARD, grid, kinoise, shots, write_depth};

/// A recording of three poses in order, with small images.
fn small() -> &'static Path {
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = folder();
        let poses = grid(&[1.0, 1.5, 2.0], &[0.0]);
        let views = plan_grid(&poses.views(), &Scenery::bare(BOARD), HELD_STILL, false, Seed(5));
        let shoot = Shoot { views, ..shots(poses, HELD_STILL, 5) };
        shoot.write(folder.path(), &|_, _| ()).expect("written");
        folder
    })
    .path()
}

fn play(output: &Path) -> assert_cmd::Command {
    let mut command = kinoise();
    command.args(["capture", "--plain", "--json", "--frames", "4", "--hold", "2", "--source"]);
    command.arg(format!("play:{}", small().display())).arg(output);
    command
}

#[test]
fn a_recording_played_as_if_live_becomes_a_recording() {
    let folder = folder();
    let any = play(&folder.path().join("any")).args(["--views", "any"]).assert().success();
    assert_eq!(json(&any)["views"].as_array().map(Vec::len), Some(3));
    let output = folder.path().join("paper");
    let paper = play(&output).assert().code(2);
    assert_eq!(json(&paper)["views"], serde_json::json!(["z100-t00", "z150-t00", "z200-t00"]));
    assert!(told(&paper).contains("60 still wanted"), "{}", told(&paper));
}

#[test]
fn a_diagnosis_says_which_views_are_wanted() {
    let folder = folder();
    let diagnosis = folder.path().join("diagnosis.json");
    let write = |next: &str| {
        let text = format!(r#"{{"findings": [{{"effect": null, "next_view": {next}}}]}}"#);
        fs::write(&diagnosis, text).expect("written");
    };
    let advised = |output: &str| {
        let mut command = play(&folder.path().join(output));
        command.arg("--advise").arg(&diagnosis);
        command
    };
    write(r#"{"z_m": 1.5, "theta_rad": 0.0, "azimuth_rad": 0.0, "why": "to tell a from b"}"#);
    let done = advised("rec").assert().success();
    assert_eq!(json(&done)["finished"], serde_json::json!(["z150-t00"]));
    write("null");
    assert!(told(&advised("other").assert().code(2)).contains("advises no further view"));
}

/// A child that is killed when the test ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn watch_folder(from: &Path, output: &Path, patience: &str) -> Process {
    let mut command = Process::new(env!("CARGO_BIN_EXE_kinoise"));
    command
        .args(["capture", "--plain", "--views", "any", "--frames", "4", "--hold", "2"])
        .args(["--intrinsics", "145,145,79.5,59.5", "--units-per-metre", "5000"])
        .args(["--patience", patience, "--source", &format!("folder:{}", from.display())])
        .arg(output)
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !there() {
        assert!(begun.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Puts frames of the small recording into a folder, as another program would.
fn fill(to: &Path, frames: std::ops::Range<usize>) {
    let recording = open(small(), &Assumed::default()).expect("a recording");
    for (k, frame) in frames_of(&recording).iter().enumerate() {
        if frames.contains(&k) {
            write_depth(&to.join(format!("{k:04}.png")), frame);
        }
    }
}

/// kill -9 in the middle of the second view, then the same command again.
#[test]
fn killed_in_the_middle_of_a_view_it_goes_on() {
    let folder = folder();
    let (from, output) = (folder.path().join("filled"), folder.path().join("rec"));
    fill(&from, 0..HELD_STILL + 3);
    let half = output.join(".partial/z150-t00/depth/0001.png");
    {
        let mut child = Running(watch_folder(&from, &output, "30").spawn().expect("started"));
        wait_for("half of the second view", || half.is_file());
        child.0.kill().expect("killed");
        child.0.wait().expect("ended");
    }
    let left = open(&output, &Assumed::default()).expect("a recording");
    assert_eq!(left.views.len(), 1, "the second is not there at all");
    fill(&from, 0..2 * HELD_STILL);
    let done = watch_folder(&from, &output, "1").output().expect("run");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(said.contains("half of view z150-t00 from an interrupted run was removed"), "{said}");
    let whole = open(&output, &Assumed::default()).expect("a recording");
    assert_eq!(whole.views.len(), 2);
    assert!(whole.views.iter().all(|v| v.depth.len() == FRAMES));
    assert!(!output.join(".partial").exists());
}

/// Ctrl-C in the middle of the second view.
#[cfg(unix)]
#[test]
fn interrupted_it_ends_in_order() {
    let folder = folder();
    let (from, output) = (folder.path().join("filled"), folder.path().join("rec"));
    fill(&from, 0..HELD_STILL + 3);
    let child = watch_folder(&from, &output, "30").spawn().expect("started");
    let mut child = Running(child);
    let half = output.join(".partial/z150-t00/depth/0001.png");
    wait_for("half of the second view", || half.is_file());
    let pid = child.0.id().to_string();
    assert!(Process::new("kill").args(["-INT", &pid]).status().expect("kill").success());
    let ended = child.0.wait().expect("ended");
    assert_eq!(ended.code(), Some(2));
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.0.stderr.take().expect("piped"), &mut said)
        .expect("text");
    assert!(said.contains("interrupted: 1 view is kept"), "{said}");
    assert!(!output.join(".partial").exists());
}

/// Capture gives up when the folder stops growing.
#[test]
fn a_stream_that_stands_still_is_told() {
    let folder = folder();
    let (from, output) = (folder.path().join("filled"), folder.path().join("rec"));
    fill(&from, 0..3);
    let ended = watch_folder(&from, &output, "1").output().expect("run");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(2), "{said}");
    assert!(said.contains("no frame for 1 s"), "{said}");
}

/// A file size limit acts like a full disk: the write fails.
#[cfg(unix)]
#[test]
fn a_full_disk_ends_it_and_what_was_finished_stays() {
    let folder = folder();
    let output = folder.path().join("rec");
    play(&output).args(["--distances", "1", "--tilts", "0"]).assert().success();
    let line = format!(
        "ulimit -f 4; exec '{}' capture --plain --frames 4 --hold 2 --source 'play:{}' '{}'",
        env!("CARGO_BIN_EXE_kinoise"),
        small().display(),
        output.display()
    );
    let ended = Process::new("sh").args(["-c", &line]).output().expect("a shell");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(2), "{said}");
    assert!(said.contains("make room") && said.contains("1 view is kept"), "{said}");
    assert!(!output.join(".partial").exists());
    let kept = open(&output, &Assumed::default()).expect("a recording");
    assert_eq!(kept.views.len(), 1);
}

/// After the folder's last frame the first capture waits, with one view finished and the second begun.
#[test]
fn a_second_capture_into_the_same_recording_is_refused() {
    let folder = folder();
    let (from, output) = (folder.path().join("filled"), folder.path().join("rec"));
    fill(&from, 0..HELD_STILL + 3);
    let _first = Running(watch_folder(&from, &output, "30").spawn().expect("started"));
    let half = output.join(".partial/z150-t00/depth/0001.png");
    wait_for("half of the second view", || half.is_file());
    if cfg!(unix) {
        let second = play(&output).assert().code(2);
        assert!(told(&second).contains("another capture is writing"), "{}", told(&second));
    }
    assert!(half.is_file());
}

#[test]
fn what_is_played_does_not_grow_and_what_is_left_out_is_told() {
    let folder = folder();
    let from = folder.path().join("from");
    common::copy_tree(small(), &from);
    let capture = |output: &Path| {
        let mut command = kinoise();
        command.args(["capture", "--plain", "--views", "any", "--frames", "4", "--hold", "2"]);
        command.arg("--source").arg(format!("play:{}", from.display())).arg(output);
        command
    };
    let itself = capture(&from.join(".")).assert().code(2);
    assert!(told(&itself).contains("this is the source"), "{}", told(&itself));
    let views = open(&from, &Assumed::default()).expect("a recording").views;
    let image = &views[1].depth[0].path;
    let bytes = fs::read(image).expect("read");
    fs::write(image, &bytes[..bytes.len() / 2]).expect("written");
    fs::write(from.join(&views[2].name).join("depth.txt"), "no list").expect("written");
    let done = capture(&folder.path().join("rec")).assert().success();
    assert!(told(&done).contains("frame left out: "), "{}", told(&done));
    assert!(told(&done).contains(&format!("view {} was left out", views[2].name)));
    assert!(told(&done).contains("2 views are kept"), "{}", told(&done));
}

/// Runs it in a terminal made by `script` (util-linux): the keys work and the terminal is restored.
#[cfg(target_os = "linux")]
#[test]
fn on_a_terminal_keys_are_heeded_and_the_terminal_is_left_as_it_was() {
    use std::io::Write;

    if !Path::new("/usr/bin/script").exists() {
        println!("skipped: no /usr/bin/script (package bsdutils) to make a terminal with");
        return;
    }
    let folder = folder();
    let (from, output) = (folder.path().join("filled"), folder.path().join("rec"));
    fill(&from, 0..HELD_STILL);
    let at = |name: &str| folder.path().join(name);
    let line = format!(
        "stty -a > '{}'; '{}' capture --views any --frames 4 --hold 2 --patience 60 \
         --intrinsics 145,145,79.5,59.5 --units-per-metre 5000 --source 'folder:{}' '{}'; \
         echo $? > '{}'; stty -a > '{}'",
        at("before").display(),
        env!("CARGO_BIN_EXE_kinoise"),
        from.display(),
        output.display(),
        at("code").display(),
        at("after").display(),
    );
    let mut child = Running(
        Process::new("script")
            .args(["-q", "-c", &line, "/dev/null"])
            .env("SHELL", "/bin/sh")
            .stdin(Stdio::piped())
            .stdout(fs::File::create(at("shown")).expect("made"))
            .stderr(Stdio::null())
            .spawn()
            .expect("started"),
    );
    let mut keys = child.0.stdin.take().expect("piped");
    let mut press = |bytes: &[u8]| keys.write_all(bytes).expect("pressed");
    let (view, code) = (output.join("z100-t00/depth.txt"), at("code"));
    wait_for("a view", || view.is_file());
    // F2 to F4: escape sequences that end in Q, R and S.
    press(b"\x1bOQ\x1bOR\x1bOS");
    std::thread::sleep(Duration::from_millis(300));
    assert!(view.is_file() && !code.exists(), "function keys are no letters");
    press(b"r");
    wait_for("the view is thrown away", || !view.exists());
    press(b"q");
    wait_for("the end", || at("after").metadata().is_ok_and(|m| m.len() > 0));
    assert_eq!(fs::read_to_string(&code).expect("a code").trim(), "0");
    let read = |name: &str| fs::read_to_string(at(name)).expect("text");
    assert_eq!(read("before"), read("after"));
    child.0.wait().expect("ended");
    let shown = read("shown");
    let position = |what: &str| shown.find(what).unwrap_or_else(|| panic!("{what:?} in {shown}"));
    assert!(position("\x1b[?1049h") < position("z100-t00 is on the disk"));
    assert!(position("\x07") < position("\x1b[?1049l"), "it rings");
    assert!(position("\x1b[?1049l") < position("0 views are kept"));
}
