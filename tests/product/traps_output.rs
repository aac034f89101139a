//! No data loss: existing files stay, nothing is written into the input, and an interrupted command leaves
//! nothing that looks complete.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::common::{copy_tree, good, kinoise, tree};

/// A working folder with the good recording.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
        copy_tree(good(), &folder.path().join("rec"));
        Desk { folder }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a command in this folder; relative names are paths in it.
    fn run(&self, line: &str) -> Output {
        kinoise().current_dir(self.folder.path()).args(line.split(' ')).output().expect("it runs")
    }

    #[track_caller]
    fn done(&self, line: &str) -> String {
        let output = self.run(line);
        let said = String::from_utf8(output.stderr).expect("text");
        assert!(matches!(output.status.code(), Some(0 | 1)), "{line}: {said}");
        said
    }

    /// Asserts a refusal with all of `needles`, and that not a byte changed anywhere.
    #[track_caller]
    fn refused(&self, line: &str, needles: &[&str]) {
        let before = tree(self.folder.path());
        let output = self.run(line);
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{line}: {said}");
        for needle in needles {
            assert!(said.contains(needle), "{line}: \"{needle}\" is not in: {said}");
        }
        assert!(tree(self.folder.path()) == before, "{line}: something was written");
        assert_eq!(unfinished(self.folder.path()), [""; 0], "{line}");
    }
}

/// Hidden files and folders, which only unfinished output has.
fn unfinished(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') {
            found.push(name);
        } else if entry.path().is_dir() {
            found.extend(unfinished(&entry.path()));
        }
    }
    found
}

const FILM: &str = "simulate film --room --frames 8 --shrink 4";

#[test]
fn a_command_writes_again_over_its_own_results() {
    let desk = Desk::new();
    // RPE over 1 s needs more than 30 frames.
    desk.done("simulate film --room --frames 40 --shrink 4");
    desk.done("calibrate rec -o cal");
    let table = "z_m,theta_rad,sigma_m\n1,0,0.0019\n1.5,0,0.0035\n2,0,0.006\n3,0,0.014\n";
    fs::write(desk.at("table.csv"), table).expect("written");
    for line in [
        "calibrate rec -o cal",
        "fit table.csv -o fit",
        "diagnose rec --model cal/model.json -o dia",
        "map film --frames 8 --block 2 -o map",
        "compare film -o com",
    ] {
        desk.done(line);
        let out = desk.at(line.rsplit(' ').next().expect("a folder"));
        let first = tree(&out);
        desk.done(line);
        let second = tree(&out);
        let names = |tree: &[(PathBuf, Vec<u8>)]| -> Vec<PathBuf> {
            tree.iter().map(|f| f.0.clone()).collect()
        };
        assert!(!first.is_empty() && names(&first) == names(&second), "{line}");
        assert_eq!(unfinished(&out), [""; 0], "{line}");
    }
    // Files of another run that this one does not write are removed.
    fs::remove_file(desk.at("fit/model.json")).expect("removed");
    fs::write(desk.at("fit/measurements.csv"), "of another run").expect("written");
    desk.done("fit table.csv -o fit");
    assert!(desk.at("fit/model.json").is_file() && !desk.at("fit/measurements.csv").exists());
}

#[test]
fn what_others_wrote_is_not_overwritten() {
    let desk = Desk::new();
    desk.done(FILM);
    desk.done("calibrate rec -o cal");
    desk.done("diagnose rec --model cal/model.json -o dia");
    fs::create_dir(desk.at("thesis")).expect("made");
    fs::write(desk.at("thesis/chapter.tex"), "ten years").expect("written");
    fs::create_dir(desk.at("kept")).expect("made");
    fs::copy(desk.at("cal/model.json"), desk.at("kept/model.json")).expect("copied");
    copy_tree(&desk.at("cal"), &desk.at("mixed"));
    fs::write(desk.at("mixed/notes.txt"), "of mine").expect("written");
    for (line, holds) in [
        ("calibrate rec -o mixed", "holds notes.txt"),
        ("calibrate rec -o dia", "diagnosis.json"),
        ("calibrate rec -o thesis", "chapter.tex"),
        ("calibrate rec -o kept", "model.json"),
        ("diagnose rec -o cal", "measurements.csv"),
        ("diagnose rec -o kept", "model.json"),
        ("map film --block 2 -o cal", "measurements.csv"),
        ("compare film --frames 6 -o dia", "diagnosis.json"),
        ("demo -o dia", "diagnosis.json"),
        ("demo -o cal", "measurements.csv"),
        ("simulate film --shrink 8 --frames 1", "not empty"),
        ("simulate thesis --shrink 8 --frames 1", "chapter.tex"),
        ("simulate thesis --shrink 8 --frames 1 --force", "chapter.tex"),
        ("correct rec --model cal/model.json -o thesis", "chapter.tex"),
        ("correct rec --model cal/model.json -o film", "not empty"),
        ("capture thesis --source play:rec --views any", "not empty"),
    ] {
        desk.refused(line, &[holds]);
    }
    // With --force, results are written beside what was there.
    let before = fs::read(desk.at("dia/diagnosis.json")).expect("read");
    desk.done("calibrate rec -o dia --force");
    desk.done("calibrate rec -o thesis --force");
    assert_eq!(fs::read(desk.at("dia/diagnosis.json")).expect("read"), before);
    assert!(desk.at("thesis/chapter.tex").is_file() && desk.at("thesis/model.json").is_file());
    desk.done("simulate film --shrink 8 --frames 1 --distances 1,2 --tilts 0 --force");
    assert!(desk.at("film/0001").is_dir() && !desk.at("film/groundtruth.txt").exists());
    assert_eq!(unfinished(desk.folder.path()), [""; 0]);
}

#[test]
fn nothing_is_written_into_an_input() {
    let desk = Desk::new();
    desk.done(FILM);
    desk.done("calibrate rec -o cal");
    #[cfg(unix)]
    std::os::unix::fs::symlink(desk.at("rec"), desk.at("link")).expect("linked");
    let mut places = vec!["rec", "rec/out", "rec/0000", "cal/../rec/a/b"];
    if cfg!(unix) {
        places.extend(["link", "link/out"]);
    }
    for place in places {
        for line in [
            "calibrate rec -o",
            "diagnose rec -o",
            "correct rec --model cal/model.json -o",
            "correct rec --model cal/model.json -o new --sigma",
            "diagnose film --against rec -o",
            "calibrate rec --force -o",
        ] {
            desk.refused(&format!("{line} {place}"), &["inside the recording that is read"]);
        }
        for line in ["simulate PLACE --like rec", "simulate PLACE --like rec --force"] {
            desk.refused(&line.replace("PLACE", place), &["inside the recording that is read"]);
        }
    }
    desk.refused("capture rec/new --source play:rec --views any", &["inside the recording"]);
    for line in ["map film -o film/map", "compare film -o film", "map film --force -o film"] {
        desk.refused(line, &["inside the recording that is read"]);
    }
    // A name that only begins like the input's.
    desk.done("calibrate rec -o recent");
    for line in [
        "diagnose rec --model cal/model.json -o cal --force",
        "calibrate cal/measurements.csv -o cal",
    ] {
        desk.refused(line, &["would replace", "which is read"]);
    }
    desk.refused(
        "calibrate cal/sigma.svg -o new",
        &["neither a folder nor a file that holds a film"],
    );
}

#[cfg(unix)]
mod interrupted {
    use std::io::Read;
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Child, Command, Stdio};
    use std::time::{Duration, Instant};

    use super::*;

    /// Runs a program until `ready`, then sends a signal; returns the signal that ended it, and its stderr.
    fn stop(desk: &Desk, line: &str, signal: &str, ready: impl Fn() -> bool) -> (i32, String) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_kinoise"))
            .current_dir(desk.folder.path())
            .args(line.split(' '))
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs");
        wait(&mut child, line, ready);
        let pid = child.id().to_string();
        Command::new("kill").args([signal, &pid]).status().expect("kill");
        let mut said = String::new();
        child.stderr.take().expect("piped").read_to_string(&mut said).expect("text");
        let status = child.wait().expect("it ends");
        (status.signal().unwrap_or_else(|| panic!("{line}: {status}: {said}")), said)
    }

    fn wait(child: &mut Child, line: &str, ready: impl Fn() -> bool) {
        let begun = Instant::now();
        while !ready() {
            assert!(begun.elapsed() < Duration::from_secs(120), "{line}: it never began to write");
            assert_eq!(child.try_wait().expect("a child"), None, "{line}: it ended before");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Hours of work, so that the signal arrives during it on any machine.
    const LONG: &str = "--frames 20000 --ordered";

    #[test]
    fn leaves_nothing_that_reads_as_whole() {
        let desk = Desk::new();
        fs::create_dir(desk.at("empty")).expect("made");
        let rest = tree(desk.folder.path());
        for (place, signal, number) in [("new/sim", "-INT", 2), ("empty", "-TERM", 15)] {
            let began = || !unfinished(desk.folder.path()).is_empty();
            let (ended, said) = stop(&desk, &format!("simulate {place} {LONG}"), signal, began);
            assert_eq!(ended, number, "{said}");
            assert!(said.contains("interrupted") && said.contains(place), "{said}");
            assert!(tree(desk.folder.path()) == rest, "{place}: something was left");
            assert_eq!(unfinished(desk.folder.path()), [""; 0], "{place}");
            assert!(!desk.at("new").exists(), "{place}");
            assert_eq!(said.lines().count(), 1, "{said}");
        }
    }

    #[test]
    fn leaves_what_was_there_and_says_what_it_kept() {
        let desk = Desk::new();
        desk.done("simulate out --shrink 8 --frames 1 --distances 1,2 --tilts 0");
        let before = tree(desk.folder.path());
        let began = || !unfinished(desk.folder.path()).is_empty();
        let (_, said) = stop(&desk, &format!("simulate out {LONG} --force"), "-INT", began);
        assert!(said.contains("out is as it was"), "{said}");
        assert!(tree(desk.folder.path()) == before);

        let calibrated = || desk.at("demo/model.json").is_file();
        let (_, said) = stop(&desk, "demo -o demo", "-INT", calibrated);
        assert!(said.contains("demo is whole and kept"), "{said}");
        assert!(desk.at("demo/report.html").is_file());
        assert_eq!(unfinished(&desk.at("demo")), [""; 0]);
    }
}
