//! The second round of a trial: the view that a diagnosis asks for is taken, hashed and diagnosed,
//! and whatever is changed about it afterwards is found. The solver here is a script that asks.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use kinoise::prove::{CheckOptions, Proof, Trial, World, check, plan, prove};
use serde_json::{Value, json};

const SETS: usize = 5;
/// What the script asks for: farther away than any wall can lean so much.
const ADVISED: [f64; 3] = [3.3, 0.7, 0.0];

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("advice-{name}"));
    let _ = fs::remove_dir_all(&path);
    path
}

/// Of small sets by rays with something to name, and one by light.
fn seed() -> u64 {
    let fits = |seed: &u64| {
        let asked: Vec<_> = plan(SETS, *seed, false).into_iter().map(|p| p.asked).collect();
        let light = asked.iter().filter(|a| a.world == World::Light).count();
        asked.iter().all(|a| a.small) && light == 1
    };
    (1..10_000).find(fits).expect("a seed with small sets")
}

fn diagnosis(status: &str, p: f64, next_view: &Value) -> Value {
    json!({"verdict": "mismatch", "cannot_tell": [], "after": {"verdict": "match"}, "findings": [{
        "status": status, "effect": "vignetting", "statistic": "variance", "axis": "radius",
        "interval": [0, 1], "parameters": {}, "next_view": next_view,
        "alternatives": [{"effect": "vignetting", "probability": p},
                         {"effect": "range-exponent", "probability": 1.0 - p}]}]})
}

/// A solver that asks for a view, and with one view more than the set had is sure.
fn solver() -> PathBuf {
    let root = folder("solver");
    fs::create_dir_all(root.join("seen")).unwrap();
    let [z_m, theta_rad, azimuth_rad] = ADVISED;
    let view = json!({"z_m": z_m, "theta_rad": theta_rad, "azimuth_rad": azimuth_rad,
        "separation_now": 0.5, "separation_then": 6.0, "why": "they differ there"});
    let write = |name: &str, said: Value| fs::write(root.join(name), said.to_string()).unwrap();
    write("asks.json", diagnosis("one-of", 0.55, &view));
    write("sure.json", diagnosis("named", 0.97, &Value::Null));
    let root = root.display();
    // Its memory of what it saw stands for the model that a real one would keep for itself.
    let script = format!(
        "#!/bin/sh\necho 'not in force: a script'\nkey=$(cksum recording/0000/depth/0000.png | cut -d' ' -f1)\n\
         n=$(ls -d recording/0* | wc -l)\nbefore=$(cat {root}/seen/$key 2>/dev/null || echo $n)\necho $n > {root}/seen/$key\n\
         if [ $n -gt $before ]; then cp {root}/sure.json ../out/diagnosis.json; else cp {root}/asks.json ../out/diagnosis.json; fi\n"
    );
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("advice-solver/solver.sh");
    fs::write(&path, script).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// A finished trial and its solver; do not change it.
fn finished() -> &'static (PathBuf, PathBuf) {
    static DONE: OnceLock<(PathBuf, PathBuf)> = OnceLock::new();
    DONE.get_or_init(|| {
        let (output, program) = (folder("finished"), solver());
        let trial = Trial {
            output: output.clone(),
            sets: SETS,
            seed: seed(),
            data: None,
            keep: true,
            workers: 2,
            program: program.clone(),
            limit: Duration::from_secs(60),
            examine: None,
        };
        prove(&trial, &|_, _, _| ()).expect("a trial");
        (output, program)
    })
}

fn faults(folder: &Path) -> Vec<String> {
    let program = finished().1.clone();
    let options = CheckOptions { data: None, all: false, workers: 2, program };
    check(folder, &options, &|_, _, _| ()).expect("a check").faults
}

/// All files, by their place, below a folder.
fn files(root: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).unwrap().display().to_string();
                all.push((name, fs::read(path).unwrap()));
            }
        }
    }
    all.sort();
    all
}

#[test]
fn the_view_that_was_asked_for_is_taken_and_nothing_else_changes() {
    let root = &finished().0;
    let proof = Proof::read(root).unwrap();
    let second = proof.second.as_ref().expect("a second round");
    assert_eq!((second.sets.len(), second.scores.sets), (SETS, SETS), "all ask");
    for (set, again) in second.advice.sets.iter().zip(&second.sets) {
        let [z_m, theta_rad, azimuth_rad] = ADVISED;
        let asked = set.advised;
        assert_eq!([asked.z_m, asked.theta_rad, asked.azimuth_rad], [z_m, theta_rad, azimuth_rad]);
        assert!(set.taken.theta_rad > 0.1 && set.taken.theta_rad <= theta_rad);
        let data = |kept: &str| files(&root.join(kept).join(&set.name).join("set"));
        let (before, after) = (data("kept"), data("kept-advised"));
        let new: Vec<_> = after.iter().filter(|f| !before.contains(f)).collect();
        assert_eq!(after.len() - before.len(), new.len(), "what was there is as it was");
        let folders: std::collections::BTreeSet<String> =
            new.iter().map(|f| f.0.split('/').take(2).collect::<Vec<_>>().join("/")).collect();
        let light =
            proof.sets.iter().any(|s| s.name == set.name && s.truth.asked.world == World::Light);
        assert_eq!(folders.len(), if light { 2 } else { 1 }, "one view more: {folders:?}");
        assert_eq!(again.marks.after, "vignetting");
        assert_eq!(again.marks.promised, Some([0.5, 6.0]));
    }
    assert_eq!(faults(root), Vec::<String>::new());
}

/// A copy of the finished trial, changed.
fn changed(name: &str, change: impl Fn(&Path)) -> Vec<String> {
    let copy = folder(name);
    for (path, bytes) in files(&finished().0) {
        if !path.starts_with("kept") {
            let to = copy.join(path);
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::write(to, bytes).unwrap();
        }
    }
    change(&copy);
    faults(&copy)
}

fn edit(path: &Path, change: impl Fn(&mut Value)) {
    let mut json: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    change(&mut json);
    fs::write(path, serde_json::to_string_pretty(&json).unwrap() + "\n").unwrap();
}

#[test]
fn whatever_is_changed_of_the_second_round_is_found() {
    let name = Proof::read(&finished().0).unwrap().second.unwrap().sets[0].name.clone();
    type Change = Box<dyn Fn(&Path)>;
    let proof = |change: fn(&mut Value)| -> Change {
        Box::new(move |d| edit(&d.join("proof.json"), change))
    };
    let file = |file: String, change: fn(&mut Value)| -> Change {
        Box::new(move |d| edit(&d.join(&file), change))
    };
    let cases: [(&str, Change, &str); 10] = [
        (
            "hash",
            file("advice.json".into(), |a| a["sets"][0]["data_sha256"] = json!("0")),
            "advice.json is not",
        ),
        (
            "view",
            proof(|p| p["second"]["advice"]["sets"][0]["advised"]["z_m"] = json!(1.0)),
            "other views",
        ),
        (
            "left",
            proof(|p| drop(p["second"]["advice"]["sets"].as_array_mut().unwrap().pop())),
            "other views",
        ),
        (
            "said",
            file("verdicts-advised.json".into(), |v| {
                v["verdicts"][0]["verdict_sha256"] = json!("0")
            }),
            "verdicts-advised.json",
        ),
        (
            "diagnosis",
            file(format!("diagnoses-advised/{name}.json"), |d| d["verdict"] = json!("match")),
            "is not the second verdict",
        ),
        (
            "verdict",
            proof(|p| p["second"]["sets"][0]["verdict"]["verdict"] = json!("match")),
            "second verdict",
        ),
        (
            "marks",
            proof(|p| p["second"]["sets"][0]["marks"]["after"] = json!("right")),
            "other marks",
        ),
        (
            "scores",
            proof(|p| p["second"]["scores"]["sets"] = json!(9)),
            "scores of the second round",
        ),
        (
            "taken",
            proof(|p| p["second"]["advice"]["sets"][0]["taken"]["z_m"] = json!(1.0)),
            "taken again",
        ),
        (
            "hidden",
            proof(|p| drop(p.as_object_mut().unwrap().remove("second"))),
            "tells of no second round",
        ),
    ];
    for (what, change, words) in cases {
        let found = changed(what, change);
        assert!(found.iter().any(|f| f.contains(words)), "{what}: {found:?}");
    }
}
