//! The ceremony from the commitments to the check, with a solver that always says "match": what is
//! tampered with is noticed, whichever file it is in.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use crate::check::{CheckOptions, check};
use crate::plan::plan;
use crate::proof::{Order, Proof};
use crate::raytraced::question::World;
use crate::trial::{Trial, hold};

const SETS: usize = 3;

/// Of a trial that is quick: small ray-traced pictures.
fn order() -> Order {
    let quick =
        |order: &Order| plan(order).iter().all(|p| p.asked.small && p.asked.world == World::Rays);
    let mut orders = (1..10_000).map(|seed| Order { sets: SETS, seed, real: false });
    orders.find(quick).expect("a seed with small sets")
}

/// A program that answers every set alike.
fn solver(folder: &Path, verdict: &str) -> PathBuf {
    let path = folder.join("solver.sh");
    let answer = json!({"verdict": verdict, "findings": []});
    let text = format!("#!/bin/sh\necho nothing\nprintf '%s' '{answer}' > ../out/diagnosis.json\n");
    fs::write(&path, text).expect("written");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("executable");
    path
}

fn trial(folder: &Path, program: PathBuf) -> Trial {
    let limit = Duration::from_secs(60);
    Trial { output: folder.join("out"), order: order(), data: None, keep: false, program, limit }
}

fn faults(folder: &Path, program: &Path) -> Vec<String> {
    let options = CheckOptions { data: None, all: true, program: program.into() };
    check(&folder.join("out"), &options, &|_, _, _| ()).expect("a check").faults
}

fn edit(path: &Path, change: impl Fn(&mut Value)) -> Vec<u8> {
    let before = fs::read(path).expect("read");
    let mut value = serde_json::from_slice(&before).expect("JSON");
    change(&mut value);
    fs::write(path, value.to_string()).expect("written");
    before
}

#[test]
fn a_trial_holds_until_something_in_it_is_changed() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = solver(folder.path(), "match");
    let proof = hold(&trial(folder.path(), program.clone()), &|_, _, _| ()).expect("a trial");
    assert_eq!(proof.sets.len(), SETS);
    assert!(proof.sets.iter().all(|s| s.answer.failure.is_none() && s.marks.first == "nothing"));
    assert_eq!(faults(folder.path(), &program), Vec::<String>::new());

    let out = folder.path().join("out");
    let name = &proof.sets[0].name;
    let changes: [(String, fn(&mut Value)); 6] = [
        ("proof.json".into(), |p| p["sets"][0]["verdict"]["verdict"] = "mismatch".into()),
        ("proof.json".into(), |p| p["sets"][1]["truth"]["asked"]["seed"] = 1.into()),
        ("proof.json".into(), |p| p["sets"][2]["marks"]["first"] = "vignetting".into()),
        ("commitments.json".into(), |c| c["sets"][0]["data_sha256"] = "0".into()),
        ("verdicts.json".into(), |v| v["verdicts"][0]["diagnosis_sha256"] = "0".into()),
        (format!("diagnoses/{name}.json"), |d| d["verdict"] = "mismatch".into()),
    ];
    for (file, change) in changes {
        let path = out.join(&file);
        let before = edit(&path, change);
        assert!(!faults(folder.path(), &program).is_empty(), "{file} was changed unnoticed");
        fs::write(&path, before).expect("put back");
    }
    assert_eq!(faults(folder.path(), &program), Vec::<String>::new());
    assert_eq!(Proof::read(&out).expect("a proof"), proof);
}

#[test]
fn an_interrupted_trial_goes_on_and_another_program_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = solver(folder.path(), "match");
    let whole = hold(&trial(folder.path(), program.clone()), &|_, _, _| ()).expect("a trial");
    // As after an interruption before the verdicts were closed.
    let out = folder.path().join("out");
    for file in ["proof.json", "summary.json", "verdicts.json", "verdicts-advised.json"] {
        fs::remove_file(out.join(file)).expect("removed");
    }
    let again = hold(&trial(folder.path(), program.clone()), &|_, _, _| ()).expect("it goes on");
    assert_eq!(again.published, whole.published);
    let told = hold(&trial(folder.path(), program), &|_, _, _| ()).expect_err("it is finished");
    assert!(told.to_string().contains("a finished trial is here"), "{told}");
    fs::remove_file(out.join("proof.json")).expect("removed");
    let other = solver(folder.path(), "mismatch");
    let told = hold(&trial(folder.path(), other), &|_, _, _| ()).expect_err("another build");
    assert!(told.to_string().contains("another build"), "{told}");
}
