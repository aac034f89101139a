use std::collections::BTreeSet;

use super::*;

const TABLES: Leaves =
    Leaves::Results { names: &[&["table.csv", "model.json", "part-"]], marks: &["table.csv"] };

fn begin(place: &Path) -> Result<OutputFolder> {
    OutputFolder::begin(place, TABLES, &[], false)
}

fn put(place: &Path, names: &[&str]) {
    fs::create_dir_all(place).unwrap();
    names.iter().for_each(|name| fs::write(place.join(name), name).unwrap());
}

fn held(place: &Path) -> Vec<String> {
    let paths = entries(place).unwrap();
    paths.iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect()
}

#[test]
fn it_is_there_when_it_is_whole_and_leaves_nothing_before() {
    let dir = tempfile::tempdir().unwrap();
    let place = dir.path().join("a/b/out");
    let out = begin(&place).unwrap();
    out.write("table.csv", b"1").unwrap();
    assert!(!place.exists());
    drop(out);
    assert_eq!(held(dir.path()), [""; 0], "parents that were made go too");
    let out = begin(&place).unwrap();
    out.write("table.csv", b"1").unwrap();
    out.finish().unwrap();
    assert_eq!((held(&place), held(place.parent().unwrap()).len()), (vec!["table.csv".into()], 1));
}

#[test]
fn an_earlier_run_is_replaced_whole_and_not_before_the_end() {
    let dir = tempfile::tempdir().unwrap();
    put(dir.path(), &["table.csv", "model.json"]);
    put(&dir.path().join("part-1"), &["old"]);
    let again = || {
        let out = begin(dir.path()).unwrap();
        assert!(out.replaces());
        out.write("table.csv", b"new").unwrap();
        put(&out.path().join("part-2"), &["new"]);
        out
    };
    drop(again());
    assert_eq!(held(dir.path()), ["model.json", "part-1", "table.csv"]);
    assert_eq!(fs::read(dir.path().join("table.csv")).unwrap(), b"table.csv");
    again().finish().unwrap();
    // A model of the earlier run beside the new table would be taken for the new one.
    assert_eq!(held(dir.path()), ["part-1", "part-2", "table.csv"]);
    assert_eq!(fs::read(dir.path().join("table.csv")).unwrap(), b"new");
}

#[test]
fn what_others_wrote_stays_unless_forced_and_then_but_for_the_names() {
    for foreign in [&["notes.txt"][..], &["model.json"], &["table.csv", "notes.txt"]] {
        let dir = tempfile::tempdir().unwrap();
        put(dir.path(), foreign);
        let error = begin(dir.path()).unwrap_err().to_string();
        let named = foreign.last().unwrap();
        assert!(error.contains(named) && error.contains("--force"), "{error}");
        assert_eq!(held(dir.path()).len(), foreign.len());
        let out = OutputFolder::begin(dir.path(), TABLES, &[], true).unwrap();
        out.write("table.csv", b"new").unwrap();
        out.finish().unwrap();
        let all: BTreeSet<&str> = foreign.iter().copied().chain(["table.csv"]).collect();
        assert!(held(dir.path()).iter().eq(all.iter()), "{:?}", held(dir.path()));
    }
}

#[test]
fn a_recording_is_replaced_by_force_alone_and_nothing_else_is() {
    let dir = tempfile::tempdir().unwrap();
    let begin = |force| OutputFolder::begin(dir.path(), Leaves::RECORDING, &[], force);
    put(dir.path(), &["thesis.tex"]);
    for force in [false, true] {
        assert!(begin(force).unwrap_err().to_string().contains("not empty"), "{force}");
    }
    fs::remove_file(dir.path().join("thesis.tex")).unwrap();
    put(dir.path(), &["recording.json"]);
    put(&dir.path().join("0000"), &["depth.txt"]);
    assert!(begin(false).unwrap_err().to_string().contains("--force"));
    let out = begin(true).unwrap();
    put(&out.path().join("0001"), &["depth.txt"]);
    out.write("recording.json", b"new").unwrap();
    assert_eq!(held(dir.path()).len(), 3);
    out.finish().unwrap();
    assert_eq!(held(dir.path()), ["0001", "recording.json"]);
}

#[test]
fn nothing_goes_into_an_input() {
    let dir = tempfile::tempdir().unwrap();
    let (input, model) = (dir.path().join("rec"), dir.path().join("out/model.json"));
    put(&input, &["recording.json"]);
    put(model.parent().unwrap(), &["model.json"]);
    #[cfg(unix)]
    std::os::unix::fs::symlink(&input, dir.path().join("link")).unwrap();
    let refused = |place: &str, leaves, input: &Path| {
        let place = dir.path().join(place);
        OutputFolder::begin(&place, leaves, &[input], true).err().map(|e| e.to_string())
    };
    for place in ["rec", "rec/out", "rec/a/b", "out/../rec/x", "link", "link/x"] {
        if cfg!(not(unix)) && place.starts_with("link") {
            continue;
        }
        for leaves in [TABLES, Leaves::RECORDING] {
            let error = refused(place, leaves, &input).expect(place);
            assert!(error.contains("inside the recording"), "{place}: {error}");
        }
    }
    let error = refused("out", TABLES, &model).expect("its own model");
    assert!(error.contains("would replace") && error.contains("model.json"), "{error}");
    assert_eq!(refused("beside", TABLES, &model), None);
    assert_eq!(refused("recording", TABLES, &input), None, "a name that begins alike");
    assert_eq!(held(&input), ["recording.json"]);
}

/// Hours of work must not be lost if somebody creates the folder meanwhile.
#[test]
fn results_without_a_place_are_kept_and_told() {
    let dir = tempfile::tempdir().unwrap();
    let place = dir.path().join("out");
    let out = begin(&place).unwrap();
    out.write("table.csv", b"1").unwrap();
    put(&place, &["of another"]);
    let staging = out.path().with_extension("kept");
    let error = out.finish().unwrap_err().to_string();
    assert!(error.contains(&staging.display().to_string()), "{error}");
    assert_eq!(
        (held(&staging), held(&place)),
        (vec!["table.csv".into()], vec!["of another".into()])
    );
}
