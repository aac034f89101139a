//! The schemas against files that the tool writes, checked by Python's validator.

use std::process::Command;

use serde_json::{Value, json};

use super::export_programs::{models, python_with, run};
use crate::common::{good, kinoise};

const VALIDATE: &str = "
import csv, json, sys
import jsonschema
schema, path = json.load(open(sys.argv[1])), sys.argv[2]
jsonschema.Draft202012Validator.check_schema(schema)
if path.endswith('.csv'):
    kind = {'view': str, 'n': int, 'missing': int, 'cut': int}
    cell = lambda name, text: kind.get(name, float)(text) if text else None
    value = [{k: cell(k, v) for k, v in row.items()} for row in csv.DictReader(open(path))]
    assert value
else:
    value = json.load(open(path))
errors = [f'{list(e.path)}: {e.message[:200]}' for e in jsonschema.Draft202012Validator(schema).iter_errors(value)]
print(json.dumps(errors[:5]))
";

#[test]
fn the_files_are_as_their_schemas_say() {
    let Some(python) = python_with("jsonschema") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    for of in ["model", "diagnosis", "measurements"] {
        let printed = kinoise().args(["schema", of]).output().expect("started");
        assert!(printed.status.success());
        std::fs::write(at(&format!("{of}.schema")), printed.stdout).expect("written");
    }
    let errors = |schema: &str, file: &std::path::Path| -> Vec<String> {
        let mut validate = Command::new(&python);
        validate.args(["-c", VALIDATE]).arg(at(&format!("{schema}.schema"))).arg(file);
        serde_json::from_str(&run(&mut validate)).expect("JSON")
    };

    kinoise().arg("calibrate").arg(good()).arg("-o").arg(at("fit")).assert().success();
    kinoise()
        .arg("diagnose")
        .arg(good())
        .args(["-m", &at("fit").to_string_lossy()])
        .arg("-o")
        .arg(at("found"))
        .arg("--exit-zero")
        .assert()
        .success();
    let none = Vec::<String>::new();
    assert_eq!(errors("model", &at("fit/model.json")), none);
    assert_eq!(errors("model", &at("found/model.json")), none);
    assert_eq!(errors("diagnosis", &at("found/diagnosis.json")), none);
    assert_eq!(errors("measurements", &at("fit/measurements.csv")), none);
    for (name, model) in models().iter().take(5) {
        model.write(&at("every.json")).expect("written");
        assert_eq!(errors("model", &at("every.json")), none, "{name}");
    }

    // Files that do not match their schema are refused.
    let text = std::fs::read_to_string(at("fit/model.json")).expect("read");
    let mut broken: Value = serde_json::from_str(&text).expect("JSON");
    broken["sigma"]["parameters"]["a"] = json!("much");
    std::fs::write(at("broken.json"), broken.to_string()).expect("written");
    assert_eq!(errors("model", &at("broken.json")).len(), 1);
    assert_ne!(errors("diagnosis", &at("fit/model.json")), none);
}

#[test]
fn completions_and_the_manual_know_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let printed = kinoise().args(["completions", shell]).output().expect("started");
        let text = String::from_utf8(printed.stdout).expect("text");
        assert!(printed.status.success() && text.contains("calibrate") && text.contains("metrics"));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let pages = folder.path().join("man");
    kinoise().arg("man").arg(&pages).assert().success();
    let page = |name: &str| std::fs::read_to_string(pages.join(name)).expect("a page");
    let whole = page("kinoise.1");
    let calibrate = page("kinoise-calibrate.1");
    assert!(whole.contains(".TH kinoise") && whole.contains("kinoise\\-calibrate"), "{whole}");
    assert!(
        calibrate.contains("kinoise\\-calibrate")
            && calibrate.contains("kinoise calibrate recording")
    );
    // The pages may be rewritten, but not with a foreign file among them.
    kinoise().arg("man").arg(&pages).assert().success();
    std::fs::write(pages.join("mine.1"), "x").expect("written");
    kinoise().arg("man").arg(&pages).assert().code(2);
}
