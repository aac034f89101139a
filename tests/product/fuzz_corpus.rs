//! The corpora that fuzzing kept (tests/fuzz), and what once made a reader fail, through the functions of
//! the fuzz targets.

use std::fs;
use std::path::{Path, PathBuf};

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

/// Runs a target on every file of its folder; how many there were, and how many of them were read.
fn replayed(target: fuzz::Target, folder: &Path) -> [usize; 2] {
    let Ok(files) = fs::read_dir(folder) else { return [0; 2] };
    let mut paths: Vec<PathBuf> = files.map(|f| f.expect("a file").path()).collect();
    paths.sort();
    let read = |path: &&PathBuf| {
        let data = fs::read(path).expect("read");
        // The file that fails is named by what is printed last.
        println!("{}", path.display());
        target(&data)
    };
    [paths.len(), paths.iter().filter(read).count()]
}

#[test]
fn what_fuzzing_found_is_read_or_refused() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz");
    for (name, target) in fuzz::TARGETS {
        let [kept, read] = replayed(target, &root.join("corpus").join(name));
        // Both ways are taken, or the corpus shows little of its reader; points are never refused, and
        // without SQLite all is.
        let both = name != "ply" && (name != "db3" || cfg!(feature = "db3"));
        assert!(
            kept > 0 && (!both || (1..kept).contains(&read)),
            "{name}: {read} of {kept} are read"
        );
        replayed(target, &root.join("found").join(name));
    }
}
