//! A blind trial from the seals to the proof, its interruption, and proofs that were tampered with.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use common::kinoise;
use kinoise::prove::{Proof, World, plan};
use serde_json::{Value, json};

const SETS: usize = 4;

/// Of a trial that is quick: small pictures, by rays.
fn seed() -> u64 {
    let quick = |seed: &u64| {
        plan(SETS, *seed, false).iter().all(|p| p.asked.small && p.asked.world == World::Rays)
    };
    (1..10_000).find(quick).expect("a seed with small sets")
}

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("prove-{name}"));
    let _ = fs::remove_dir_all(&path);
    path
}

fn arguments(out: &Path, threads: &str) -> Vec<String> {
    let (out, seed) = (out.display().to_string(), seed().to_string());
    let sets = SETS.to_string();
    ["prove", "-o", &out, "--sets", &sets, "--seed", &seed, "--threads", threads]
        .map(String::from)
        .to_vec()
}

/// A finished trial; do not change it.
fn finished() -> &'static Path {
    static DONE: OnceLock<PathBuf> = OnceLock::new();
    DONE.get_or_init(|| {
        let out = folder("whole");
        kinoise().args(arguments(&out, "2")).assert().success();
        out
    })
}

/// A copy of the finished trial with `change` made to its proof.
fn tampered(name: &str, change: impl Fn(&mut Value)) -> PathBuf {
    let copy = folder(name);
    fs::create_dir_all(copy.join("diagnoses")).unwrap();
    for file in ["seal.json", "verdicts.json"] {
        fs::copy(finished().join(file), copy.join(file)).unwrap();
    }
    let text = fs::read_to_string(finished().join("proof.json")).unwrap();
    let mut proof: Value = serde_json::from_str(&text).unwrap();
    change(&mut proof);
    fs::write(copy.join("proof.json"), proof.to_string()).unwrap();
    copy
}

/// What does not hold.
fn faults(folder: &Path) -> Vec<String> {
    let output = kinoise().args(["prove", "--json", "--check"]).arg(folder).output().unwrap();
    let said: Value = serde_json::from_slice(&output.stdout).unwrap();
    let faults: Vec<String> = serde_json::from_value(said["faults"].clone()).unwrap();
    assert_eq!(output.status.code(), Some(i32::from(!faults.is_empty())));
    faults
}

#[test]
fn a_trial_leaves_a_proof_that_holds() {
    let proof = Proof::read(finished()).unwrap();
    assert_eq!((proof.sets.len(), proof.scores.sets), (SETS, SETS));
    assert!(proof.sets.iter().all(|s| s.failure.is_none()), "{:?}", proof.sets[0].failure);
    let seal = fs::read_to_string(finished().join("seal.json")).unwrap();
    assert!(!seal.contains(&format!("\"seed\": {}", seed())) && seal.contains("seed_sha256"));
    for word in ["cell", "names", "nats", "salt"] {
        assert!(!seal.contains(&format!("\"{word}\"")), "{word} is told before the opening");
    }
    assert!(!finished().join("work").exists());
    assert_eq!(faults(finished()), Vec::<String>::new());
}

#[test]
fn a_trial_that_was_killed_goes_on_and_ends_the_same() {
    let out = folder("killed");
    let mut child = Command::new(env!("CARGO_BIN_EXE_kinoise"))
        .args(arguments(&out, "1"))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let verdicts = out.join("work/verdicts");
    let begin = Instant::now();
    let count = || fs::read_dir(&verdicts).map_or(0, |d| d.count());
    while count() == 0 && begin.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(out.join("seal.json").exists(), "sealed before the first verdict");
    assert!(!out.join("proof.json").exists() && !out.join("verdicts.json").exists());
    let others = [arguments(&out, "2"), vec!["--limit".into(), "7".into()]].concat();
    kinoise().args(others).assert().code(2);
    kinoise().args(arguments(&out, "2")).assert().success();
    let timeless = |folder: &Path| {
        let mut proof = serde_json::to_value(Proof::read(folder).unwrap()).unwrap();
        proof["provenance"]["created"] = Value::Null;
        proof["sets"].as_array_mut().unwrap().iter_mut().for_each(|s| s["seconds"] = Value::Null);
        proof
    };
    assert!(timeless(&out) == timeless(finished()), "the interrupted trial ended otherwise");
    kinoise().args(arguments(&out, "2")).assert().code(2);
}

#[test]
fn whatever_is_changed_afterwards_is_found_and_named() {
    let sets = Proof::read(finished()).unwrap().sets;
    let found = faults(&tampered("sets", |p| {
        p["sets"][0]["truth"]["base"] = json!("another");
        p["sets"][1]["salt"] = json!("00");
        p["sets"][2]["verdict"]["verdict"] = json!("inconclusive");
        p["sets"][3]["marks"]["first"] = json!("right");
        p["scores"]["sets"] = json!(5);
    }));
    let words = ["salt and truth", "salt and truth", "the verdict is not", "other marks"];
    for (set, words) in sets.iter().zip(words) {
        let named = |f: &&String| f.contains(&set.name) && f.contains(words);
        assert!(found.iter().any(|f| named(&f)), "{words}: {found:?}");
    }
    assert!(found.contains(&"the scores are not those of the marks".to_string()), "{found:?}");
}

#[test]
fn hashes_that_were_changed_along_are_found_in_what_was_published() {
    let name = Proof::read(finished()).unwrap().sets[1].name.clone();
    let found = faults(&tampered("hashes", |p| {
        p["seal"]["sets"][1]["commitment"] = json!("0");
        p["sets"][1]["verdict_sha256"] = json!("0");
    }));
    assert!(found.contains(&"seal.json is not what proof.json holds".to_string()), "{found:?}");
    let other = format!("set {name}: verdicts.json has another verdict");
    assert!(found.contains(&other), "{found:?}");
}

#[test]
fn a_diagnosis_that_was_changed_is_found() {
    let copy = tampered("diagnosis", |_| ());
    let name = format!("{}.json", Proof::read(&copy).unwrap().sets[0].name);
    let text = fs::read_to_string(finished().join("diagnoses").join(&name)).unwrap();
    fs::write(copy.join("diagnoses").join(&name), text + " ").unwrap();
    assert!(faults(&copy)[0].contains(&name));
}

#[test]
fn what_is_no_proof_is_bad_input() {
    let empty = folder("empty");
    fs::create_dir_all(&empty).unwrap();
    kinoise().args(["prove", "--check"]).arg(&empty).assert().code(2);
    fs::write(empty.join("proof.json"), "{}").unwrap();
    kinoise().args(["prove", "--check"]).arg(&empty).assert().code(2);
}

/// A set that points elsewhere shows whether the solver can look there.
#[cfg(unix)]
#[test]
fn a_solver_that_is_shut_in_reaches_its_set_alone() {
    let root = folder("shut");
    let real = common::good();
    fs::create_dir_all(root.join("set")).unwrap();
    fs::create_dir_all(root.join("out")).unwrap();
    std::os::unix::fs::symlink(real, root.join("set/recording")).unwrap();
    let mut solver = Command::new(env!("CARGO_BIN_EXE_kinoise"));
    let output = solver.arg("prove-solver").current_dir(root.join("set")).output().unwrap();
    let how = String::from_utf8_lossy(&output.stdout).lines().next().unwrap().to_string();
    if how.starts_with("landlock") {
        let said = String::from_utf8_lossy(&output.stderr).to_string();
        assert!(output.status.code() == Some(2) && said.contains("denied"), "{said}");
    } else {
        assert!(how.starts_with("not "), "{how}");
    }
}
