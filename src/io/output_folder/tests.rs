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
