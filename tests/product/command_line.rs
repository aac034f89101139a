//! Messages of the command line: help, typos, the next step, findings as commands.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Output;

use kinoise::effects::{Active, CATALOGUE};
use kinoise::io::{Assumed, open};
use serde_json::Value;

use crate::common::{good, kinoise};

fn run(words: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Output {
    kinoise().args(words).output().expect("it runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder")
}

/// Runs a printed command in a shell.
fn run_line(line: &str) -> Output {
    let rest = line.trim().strip_prefix("kinoise ").expect("a command of kinoise");
    let line = format!("\"$KINOISE\" {rest}");
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", &line]).env("KINOISE", env!("CARGO_BIN_EXE_kinoise"));
    shell.output().expect("sh")
}

fn next_of(output: &Output) -> String {
    let text = stderr(output);
    let last = text.lines().last().unwrap_or_default();
    last.strip_prefix("next: ").unwrap_or_else(|| panic!("no next step: {text}")).to_string()
}

#[test]
fn the_catalogue_is_listed_an_id_a_line() {
    let output = run(["effects", "--list"]);
    let text = String::from_utf8(output.stdout).expect("text");
    let ids: Vec<&str> = CATALOGUE.iter().map(|e| e.card().id).collect();
    assert_eq!(text.lines().collect::<Vec<_>>(), ids);
}

#[test]
fn a_typo_is_answered_from_the_command_it_belongs_to() {
    let says = [
        (&["diagnos", "x"][..], "similar subcommand exists: 'diagnose'; see kinoise --help"),
        (&["diagnose", "x", "--outptu", "y"], "'--output'; see kinoise diagnose --help"),
        (&["map", "x", "-o", "y", "--strid", "2"], "'--stride'; see kinoise map --help"),
        (&["simulate", "x", "--effect", "vigneting"], "did you mean vignetting?"),
    ];
    for (words, says) in says {
        let output = run(words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        let text = stderr(&output);
        assert!(text.contains(says) && text.lines().count() == 1, "{words:?}: {text}");
    }
}

/// Runs the next step that each command prints, starting with a simulation. The board is bent: the span in
/// the printed effect is a parameter that the diagnosis measures elsewhere.
#[test]
fn each_command_names_the_next_and_each_finding_its_simulation() {
    let folder = folder();
    // A space and a quote, which must be quoted for the shell.
    let root = folder.path().join("it's here");
    let at = |name: &str| root.join(name);
    let shot = run([
        "simulate".as_ref(),
        at("bent").as_os_str(),
        "--effect".as_ref(),
        "target-bow:sagitta_m=0.02,span_m=1".as_ref(),
        "--shrink".as_ref(),
        "4".as_ref(),
        "--frames".as_ref(),
        "2".as_ref(),
    ]);
    assert!(shot.status.success(), "{}", stderr(&shot));
    let calibrated = run_line(&next_of(&shot));
    assert!(at("bent-noise/model.json").is_file(), "{}", stderr(&calibrated));
    let diagnosed = run_line(&next_of(&calibrated));
    assert_eq!(diagnosed.status.code(), Some(1), "{}", stderr(&diagnosed));

    let text = stderr(&diagnosed);
    let bow = text.lines().find(|l| l.contains("--effect target-bow:")).expect(&text);
    let effect = bow.split("--effect ").nth(1).expect("an effect").trim();
    let active = Active::parse(effect).expect("it parses");
    let parameter = |name: &str| active.parameters()[name].as_f64().expect("a number");
    assert!((parameter("span_m") - 1.0).abs() < 0.1, "{effect}");
    assert!((parameter("sagitta_m") - 0.02).abs() < 0.004, "{effect}");
    let again = run_line(bow);
    assert!(again.status.success(), "{}", stderr(&again));
    assert!(at("bent-noise-diagnosis-target-bow/recording.json").is_file(), "{bow}");
    // A bent board is no bias of the sensor: the next step is a simulated twin, not a correction.
    let next = next_of(&diagnosed);
    assert!(next.contains("simulate") && run_line(&next).status.success(), "{next}");
}

/// Every command that reads a plain folder repeats its options, on the terminal and on the page; the
/// corrected recording needs none.
#[test]
fn a_plain_folder_is_read_alike_by_every_next_command() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let bowl = at("bowl");
    let effect = "--effect=radial-disparity-bias:k_px=1";
    assert!(run(["simulate", &bowl, effect, "--shrink", "4"]).status.success());
    let recording = open(Path::new(&bowl), &Assumed::default()).expect("opens");
    std::fs::create_dir(at("plain")).expect("made");
    for view in &recording.views {
        let image = Path::new(&at("plain")).join(format!("{}.png", view.name));
        std::fs::copy(&view.depth[0].path, image).expect("copied");
    }
    let kinoise::DepthCode::Metric { units_per_metre, .. } = recording.sensor.code else {
        panic!("{:?}", recording.sensor.code)
    };
    let camera = &recording.sensor.camera;
    let options = format!(
        "--intrinsics {},{},{},{} --units-per-metre {units_per_metre} --baseline 0.075",
        camera.fx, camera.fy, camera.cx, camera.cy
    );
    let plain = run_line(&format!("kinoise calibrate {} -o {} {options}", at("plain"), at("out")));
    let diagnosed = run_line(&next_of(&plain));
    let text = stderr(&diagnosed);
    assert_eq!(diagnosed.status.code(), Some(1), "{text}");
    let bias = text.lines().find(|l| l.contains("--effect radial-disparity-bias:")).expect(&text);
    let again = run_line(bias);
    assert!(again.status.success(), "{bias}: {}", stderr(&again));
    // Compared with its twin, which describes itself.
    let against = run_line(&next_of(&again));
    assert!(matches!(against.status.code(), Some(0 | 1)), "{}", stderr(&against));

    let correct = next_of(&diagnosed);
    assert!(correct.starts_with("kinoise correct ") && correct.ends_with(&options), "{correct}");
    let page = at("out-diagnosis/report.html");
    let page = std::fs::read_to_string(&page).expect(&page);
    let out = at("out-diagnosis");
    let shown = format!("kinoise correct {} -o {out}-corrected", at("plain"));
    let shown = format!("{shown} -m {out}/model.json {options}");
    assert!(page.contains(&shown), "the page and the terminal say the same: {shown}");
    let corrected = run_line(&correct);
    assert!(corrected.status.success(), "{}", stderr(&corrected));
    let last = run_line(&next_of(&corrected));
    assert!(matches!(last.status.code(), Some(0 | 1)), "{}", stderr(&last));
}

fn diagnosed(words: &[&str], to: &Path) -> Output {
    let [recording, to] = [good(), to].map(Path::as_os_str);
    let fixed = ["diagnose".as_ref(), recording, "-o".as_ref(), to];
    run(fixed.into_iter().chain(words.iter().map(OsStr::new)))
}

#[test]
fn quiet_says_the_result_alone_and_verbose_the_stages() {
    let folder = folder();
    let quiet = diagnosed(&["-q"], &folder.path().join("quiet"));
    assert_eq!(stderr(&quiet).lines().count(), 1, "{}", stderr(&quiet));
    let verbose = stderr(&diagnosed(&["-v"], &folder.path().join("verbose")));
    for stage in ["calibrating", "measuring the views", "searching the noise", "kept aside"] {
        let line = |l: &str| l.contains(stage) && l.ends_with(" s");
        assert!(verbose.lines().any(line), "{stage}: {verbose}");
    }
    assert!(verbose.contains("seed 1") && verbose.contains("160 x 120 px"), "{verbose}");
    let error = run(["calibrate", "-q", "no-such-folder", "-o", "nowhere"]);
    assert!(stderr(&error).starts_with("kinoise: "), "{}", stderr(&error));
}

#[test]
fn a_script_may_ask_for_no_exit_code_of_a_finding() {
    let folder = folder();
    let eq1 = folder.path().join("eq1.json");
    kinoise::NoiseModel::paper().write(&eq1).expect("written");
    let bowl = folder.path().join("bowl");
    let words = ["--effect", "radial-disparity-bias:k_px=1", "--shrink", "4", "-q"];
    let shot =
        run([OsStr::new("simulate"), bowl.as_os_str()].into_iter().chain(words.map(OsStr::new)));
    assert!(shot.status.success(), "{}", stderr(&shot));
    let code = |words: &[&str], to: &str| {
        let to = folder.path().join(to);
        let fixed = [OsStr::new("diagnose"), bowl.as_os_str(), OsStr::new("-o"), to.as_os_str()];
        let model = [OsStr::new("-m"), eq1.as_os_str()];
        let all = fixed.into_iter().chain(model).chain(words.iter().map(OsStr::new));
        run(all).status.code()
    };
    assert_eq!((code(&[], "a"), code(&["--exit-zero"], "b")), (Some(1), Some(0)));
}

/// The hash comes before the diagnosis and matches the text opened after it.
#[test]
fn the_demo_keeps_its_promise() {
    let folder = folder();
    let to = folder.path().join("demo");
    let words = ["demo", "--json", "--seed", "5", "-o"].map(OsStr::new);
    let output = run(words.into_iter().chain([to.as_os_str()]));
    let text = stderr(&output);
    assert!(output.status.success(), "{text}");
    let value: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let sealed = std::fs::read_to_string(to.join("sealed.txt")).expect("the seal");
    let hash = kinoise::io::sha256_hex(sealed.as_bytes());
    assert_eq!(value["sealed"]["text"], sealed.as_str());
    assert_eq!(value["sealed"]["sha256"], hash.as_str());
    let promise = std::fs::read_to_string(to.join("sealed.sha256")).expect("the promise");
    assert_eq!(promise, format!("{hash}  sealed.txt\n"));
    let place = |needle: &str| text.find(needle).unwrap_or_else(|| panic!("{needle}: {text}"));
    let effect = sealed.lines().nth(1).expect("the effect");
    assert!(place(&hash) < place("filmed") && place("filmed") < place(effect), "{text}");
    for file in ["report.html", "diagnosis/report.html", "map/map.html", "sealed/recording.json"] {
        assert!(to.join(file).is_file(), "{file}");
    }
    // The last line is the next step.
    assert!(text.ends_with("--views quick\n"), "{text}");
}
