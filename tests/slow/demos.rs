//! The demo as a trial: a random cause of about its typical strength must be named first and alone.

use std::process::Command;

use serde_json::Value;

/// Twenty seeds. Of fifty others 48 were named first and alone: at that rate fewer than 17 of twenty have a
/// probability of 0.7 %.
#[test]
fn causes_of_typical_strength_are_named_first_and_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let wrong: Vec<String> = (91_001..91_021)
        .filter_map(|seed: u64| {
            let out = folder.path().join(seed.to_string());
            let run = Command::new(env!("CARGO_BIN_EXE_kinoise"))
                .args(["demo", "--json", "--quiet", "--seed", &seed.to_string(), "-o"])
                .arg(&out)
                .output()
                .expect("the demo runs");
            let said: Value = serde_json::from_slice(&run.stdout).expect("JSON");
            let sealed = &said["sealed"];
            let alone = sealed["also_named"].as_array().is_some_and(Vec::is_empty);
            let right = sealed["answer"] == "first" && alone;
            std::fs::remove_dir_all(&out).expect("removed");
            (!right).then(|| format!("{seed}: {} {}", sealed["answer"], sealed["text"]))
        })
        .collect();
    println!("not named first and alone: {wrong:#?}");
    assert!(wrong.len() <= 3, "{wrong:#?}");
}
