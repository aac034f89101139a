//! Replays the fuzzing corpora (tests/fuzz), and inputs that once made a reader fail, through the functions
//! of the fuzz targets.

use std::fs;
use std::path::{Path, PathBuf};

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

/// Runs a target on every file of its folder; returns the number of files, and of those that were read.
fn replayed(target: fuzz::Target, folder: &Path) -> [usize; 2] {
    let Ok(files) = fs::read_dir(folder) else { return [0; 2] };
    let mut paths: Vec<PathBuf> = files.map(|f| f.expect("a file").path()).collect();
    paths.sort();
    let read = |path: &&PathBuf| {
        let data = fs::read(path).expect("read");
        // The last path printed is that of a failing file.
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
        // Some files must be read and some refused, or the corpus exercises little of its reader; points of a
        // ply are never refused, and without SQLite every db3 is.
        let both = name != "ply" && (name != "db3" || cfg!(feature = "db3"));
        assert!(
            kept > 0 && (!both || (1..kept).contains(&read)),
            "{name}: {read} of {kept} are read"
        );
        replayed(target, &root.join("found").join(name));
    }
}
