//! Trials from the commitments to the check, with a solver that always says "match": tampering with any file
//! is noticed; and the same in shards.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use crate::check::{CheckOptions, check};
use crate::judge::scores;
use crate::plan::plan;
use crate::proof::{Order, Proof};
use crate::raytraced::question::World;
use crate::shard::{Shard, gather, hold_shard};
use crate::trial::{Trial, hold};

const SETS: usize = 3;

/// Order of a quick trial: small ray-traced images.
fn order() -> Order {
    let quick =
        |order: &Order| plan(order).iter().all(|p| p.asked.small && p.asked.world == World::Rays);
    let mut orders = (1..10_000).map(|seed| Order { sets: SETS, seed, real: false });
    orders.find(quick).expect("a seed with small sets")
}

/// A program that gives every set the same answer.
fn solver(folder: &Path, verdict: &str) -> PathBuf {
    let path = folder.join("solver.sh");
    let answer = json!({"verdict": verdict, "findings": []});
    let model = kinoise::NoiseModel::paper().to_json().expect("a model");
    let text = format!(
        "#!/bin/sh\necho nothing\nprintf '%s' '{answer}' > ../out/diagnosis.json\n\
         printf '%s' '{model}' > ../out/model.json\n"
    );
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
    let changes: [(String, fn(&mut Value)); 7] = [
        ("proof.json".into(), |p| p["confinement"] = json!({"landlock ABI 5": 3})),
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
    // The scores follow from the gains: a forger changes both.
    let forge = |p: &mut Value| {
        let mut forged: Proof = serde_json::from_value(p.clone()).expect("a proof");
        for gains in forged.sets.iter_mut().filter_map(|s| s.gains.as_mut()) {
            let own = gains.methods.get_mut("kinoise").expect("its own");
            own.within = 0.99 * gains.oracle.within;
        }
        assert!(forged.sets.iter().any(|s| s.gains.is_some()));
        forged.scores = scores(&forged.sets);
        *p = json!(forged);
    };
    let before = edit(&out.join("proof.json"), forge);
    let told = faults(folder.path(), &program);
    assert!(told.iter().any(|f| f.contains("gains something else")), "{told:?}");
    fs::write(out.join("proof.json"), before).expect("put back");
    assert_eq!(faults(folder.path(), &program), Vec::<String>::new());
    assert_eq!(Proof::read(&out).expect("a proof"), proof);
}

#[test]
fn an_interrupted_trial_goes_on_and_another_program_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = solver(folder.path(), "match");
    let whole = hold(&trial(folder.path(), program.clone()), &|_, _, _| ()).expect("a trial");
    // State after an interruption before the verdicts were published.
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

/// A solver that asks for another view of every set, so that there is a second round.
fn doubting(folder: &Path) -> PathBuf {
    let path = folder.join("doubting.sh");
    let view = json!({"z_m": 1.2, "theta_rad": 0.4, "azimuth_rad": 0.0});
    let names = [("vignetting", 0.5), ("slope-noise", 0.4)]
        .map(|(effect, probability)| json!({"effect": effect, "probability": probability}));
    let finding = json!({"status": "one-of", "effect": null, "alternatives": names,
        "statistic": "variance", "axis": "radius", "interval": [0.0, 1.0], "next_view": view});
    let answer = json!({"verdict": "mismatch", "findings": [finding]});
    let text = format!("#!/bin/sh\necho nothing\nprintf '%s' '{answer}' > ../out/diagnosis.json\n");
    fs::write(&path, text).expect("written");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("executable");
    path
}

/// All files of a finished trial, without the seconds, which depend on the machine.
fn published(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(&inner).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let text = fs::read_to_string(&path).expect("text");
            let is_seconds = |line: &&str| line.trim_start().starts_with("\"seconds\":");
            let lines: Vec<&str> = text.lines().filter(|l| !is_seconds(l)).collect();
            files.push((path.strip_prefix(folder).expect("below").into(), lines.join("\n")));
        }
    }
    files.sort();
    files
}

#[test]
fn merged_shards_are_the_single_trial() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = doubting(folder.path());
    let single = trial(folder.path(), program.clone());
    let proof = hold(&single, &|_, _, _| ()).expect("a trial");
    assert!(proof.sets.iter().all(|s| s.advised.is_some()), "a second round");

    let shards: Vec<PathBuf> = (1..=SETS)
        .map(|index| {
            let output = folder.path().join(format!("shard-{index}"));
            let part = Trial { output, ..trial(folder.path(), program.clone()) };
            hold_shard(&part, Shard { index, of: SETS }, &|_, _, _| ()).expect("a shard");
            part.output
        })
        .collect();
    let output = folder.path().join("merged");
    // In any order.
    let given: Vec<PathBuf> = shards.iter().rev().cloned().collect();
    let (order, limit_s) = gather(&given, &program, &output).expect("all shards");
    let limit = Duration::from_secs(limit_s);
    let merged = Trial { output, order, limit, ..trial(folder.path(), program.clone()) };
    hold(&merged, &|_, _, _| ()).expect("the merged trial");
    assert_eq!(published(&merged.output), published(&single.output));

    let refused = |shards: &[PathBuf], program: &Path| {
        let output = folder.path().join("refused");
        gather(shards, program, &output).expect_err("refused").to_string()
    };
    let [a, b, c] = &shards[..] else { panic!("three shards") };
    let missing = refused(&[a.clone(), c.clone()], &program);
    assert!(missing.contains("missing: 2/3"), "{missing}");
    let double = refused(&[a.clone(), b.clone(), a.clone(), c.clone()], &program);
    assert!(double.contains("shard 1") && double.contains("shard-1"), "{double}");
    let other = refused(&shards, &solver(folder.path(), "match"));
    assert!(other.contains("another build"), "{other}");
    edit(&b.join("shard.json"), |s| s["order"]["seed"] = 77.into());
    let other = refused(&shards, &program);
    assert!(other.contains("another trial") && other.contains("shard-2"), "{other}");
    fs::remove_file(b.join("shard.json")).expect("removed");
    let unfinished = refused(&shards, &program);
    assert!(unfinished.contains("no finished shard") && unfinished.contains("shard-2"));
}

#[test]
fn a_shard_that_was_changed_is_not_merged() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = solver(folder.path(), "match");
    let part = trial(folder.path(), program.clone());
    hold_shard(&part, Shard { index: 1, of: 1 }, &|_, _, _| ()).expect("a shard");
    let name = plan(&part.order)[0].name.clone();
    let changes: [(String, fn(&mut Value)); 4] = [
        ("verdicts.json".into(), |v| v["verdicts"][0]["diagnosis_sha256"] = "0".into()),
        ("commitments.json".into(), |c| c["sets"][0]["data_sha256"] = "0".into()),
        (format!("diagnoses/{name}.json"), |d| d["verdict"] = "mismatch".into()),
        (format!("work/verdicts/{name}.json"), |d| d["diagnosis_sha256"] = "0".into()),
    ];
    let output = folder.path().join("merged");
    for (file, change) in changes {
        let path = part.output.join(&file);
        let before = edit(&path, change);
        let told = gather(std::slice::from_ref(&part.output), &program, &output);
        assert!(told.is_err(), "{file} was changed unnoticed");
        fs::write(&path, before).expect("put back");
    }
    gather(std::slice::from_ref(&part.output), &program, &output).expect("as it was");
}

#[test]
fn shards_are_disjoint_and_together_the_plan() {
    for text in ["1/1", "3/8", "8/8"] {
        assert!(text.parse::<Shard>().is_ok(), "{text}");
    }
    for text in ["0/3", "4/3", "1", "a/b", "/", "-1/3", "1/0"] {
        assert!(text.parse::<Shard>().is_err(), "{text}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let part = trial(folder.path(), solver(folder.path(), "match"));
    let shard = Shard { index: SETS + 1, of: SETS + 1 };
    let told = hold_shard(&part, shard, &|_, _, _| ()).expect_err("nothing to do");
    assert!(told.to_string().contains("sets only"), "{told}");
}
