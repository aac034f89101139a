//! Output on stderr: verbosity, the progress bar, and the next step.

use std::collections::HashSet;
use std::ffi::OsString;
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use kinoise::units::counted;
use kinoise::{Camera, NoiseModel, Progress, Recording, Sensor, Watch};

#[derive(Debug, Args)]
pub struct Verbosity {
    /// Print errors and the result only
    #[arg(short, long, global = true, overrides_with = "verbose")]
    quiet: bool,
    /// Print also the settings that were read, the stages of the work and their times
    #[arg(short, long, global = true, overrides_with = "quiet")]
    verbose: bool,
}

const QUIET: u8 = 0;
const USUAL: u8 = 1;
const VERBOSE: u8 = 2;
static LEVEL: AtomicU8 = AtomicU8::new(USUAL);

impl Verbosity {
    /// Sets the level for the whole process.
    pub fn set(&self) {
        let level = USUAL + u8::from(self.verbose) - u8::from(self.quiet);
        LEVEL.store(level, Ordering::Relaxed);
    }
}

fn print(min_level: u8, text: &str) {
    if LEVEL.load(Ordering::Relaxed) >= min_level {
        let mut err = std::io::stderr().lock();
        let _ = writeln!(err, "{}", escaped(text, |c| c == '\n'));
    }
}

/// Escapes characters that would control a terminal or begin a new line: file names and strings in files
/// are untrusted.
fn escaped(text: &str, kept: impl Fn(char) -> bool) -> String {
    let steers = |c: char| {
        // Besides control characters: bidirectional formatting and other line ends.
        c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let shown = |c: char| match steers(c) && !kept(c) {
        true => c.escape_default().to_string(),
        false => c.into(),
    };
    text.chars().map(shown).collect()
}

/// Longer messages lose their middle: the beginning and the remedy at the end stay.
const MAX_MESSAGE: usize = 1200;

/// Maximum number of digits shown in a row: an f64 has 17, a longer number is a typing error.
const MAX_DIGITS: usize = 40;
/// Digits shown of a longer number.
const SHOWN_DIGITS: usize = 17;

/// Shortens numbers of hundreds of digits.
fn short_numbers(text: &str) -> String {
    let mut short = String::new();
    let mut rest = text;
    while let Some(begin) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(begin);
        let count = number.find(|c: char| !c.is_ascii_digit()).unwrap_or(number.len());
        short += before;
        match count > MAX_DIGITS {
            true => short += &format!("{}... ({count} digits)", &number[..SHOWN_DIGITS]),
            false => short += &number[..count],
        }
        rest = &number[count..];
    }
    short + rest
}

/// Returns the message on one line.
pub fn one_line(text: &str) -> String {
    let text = &short_numbers(text);
    let count = text.chars().count();
    if count <= MAX_MESSAGE {
        return escaped(text, |_| false);
    }
    let half = MAX_MESSAGE / 2;
    let head: String = text.chars().take(half).collect();
    let tail: String = text.chars().skip(count - half).collect();
    let cut = count - 2 * half;
    escaped(&format!("{head} ... ({cut} characters) ... {tail}"), |_| false)
}

/// Prints one line. Line breaks within it, as in a file name, are escaped; empty lines before and after it
/// are kept.
fn print_line(min_level: u8, text: &str) {
    let line = text.trim_matches('\n');
    let begin = text.len() - text.trim_start_matches('\n').len();
    let (before, after) = (&text[..begin], &text[(begin + line.len()).min(text.len())..]);
    print(min_level, &format!("{before}{}{after}", escaped(line, |_| false)));
}

/// Prints a line of the result, also with --quiet.
pub fn result(line: impl AsRef<str>) {
    print_line(QUIET, line.as_ref());
}

/// Prints several lines of the result; they must not contain untrusted names.
pub fn result_lines(text: impl AsRef<str>) {
    print(QUIET, text.as_ref());
}

/// Prints why the command failed.
pub fn failure(text: &str) {
    result(format!("kinoise: {}", one_line(text)));
}

/// Writes the answer to stdout. A reader that closes early is no failure; a full disk is.
pub fn answer(text: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e),
        _ => Ok(()),
    }
}

/// Prints a line, unless --quiet.
pub fn say(line: impl AsRef<str>) {
    print_line(USUAL, line.as_ref());
}

/// Prints several lines, unless --quiet; they must not contain untrusted names.
pub fn say_lines(text: impl AsRef<str>) {
    print(USUAL, text.as_ref());
}

/// Prints a line with --verbose only.
pub fn detail(line: impl AsRef<str>) {
    print_line(VERBOSE, line.as_ref());
}

pub fn detail_recording(recording: &Recording) {
    let (root, views) = (recording.root.display(), counted(recording.views.len(), "view"));
    let Sensor { name, camera, code, .. } = &recording.sensor;
    let Camera { width, height, fx, fy, cx, cy, .. } = camera;
    let lens = format!("{width} x {height} px, fx {fx} fy {fy} cx {cx} cy {cy}");
    detail(format!("read {root}: {name}, {views}, {lens}, {code:?}"));
}

pub fn detail_model(model: &NoiseModel, file: Option<&Path>) {
    let file = file.map_or("built in".into(), |f| f.display().to_string());
    let ([z0, z1], [t0, t1]) = (model.sigma.domain.z_m, model.sigma.domain.theta_rad);
    let effects: Vec<&str> = model.effects.iter().map(|e| e.id.as_str()).collect();
    detail(format!(
        "model {file}: form {}, z {z0:.2} to {z1:.2} m, tilt {:.1} to {:.1} degrees, effects [{}]",
        model.sigma.form,
        t0.to_degrees(),
        t1.to_degrees(),
        effects.join(", ")
    ));
}

/// Maximum number of notes shown of one kind; a recording of an hour may have thousands.
const MAX_NOTES: usize = 12;

pub fn notes(remarks: impl IntoIterator<Item = impl Display>) {
    // Several readers may report the same.
    let mut known = HashSet::new();
    let mut remarks =
        remarks.into_iter().map(|r| r.to_string()).filter(|r| known.insert(r.clone()));
    remarks.by_ref().take(MAX_NOTES).for_each(|remark| say(format!("note: {}", one_line(&remark))));
    match remarks.count() {
        0 => {}
        more => say(format!("note: and {more} more like these")),
    }
}

/// Runs the work and shows its stages: on a terminal in a bar that disappears, with --verbose also one line
/// per stage with its duration.
pub fn working<T>(stage: &'static str, work: impl FnOnce(Progress<'_>) -> T) -> T {
    let shows_bar = std::io::stderr().is_terminal() && LEVEL.load(Ordering::Relaxed) > QUIET;
    let bar = if shows_bar { ProgressBar::no_length() } else { ProgressBar::hidden() };
    bar.enable_steady_tick(TICK);
    let stages = Stages { bar, now: Mutex::new((stage, Instant::now())) };
    stages.show(stage);
    let done = work(&stages);
    stages.end();
    stages.bar.finish_and_clear();
    done
}

const TICK: Duration = Duration::from_millis(120);
const COUNTED: &str = "{msg} {bar:40} {pos}/{len} {eta}";
const UNCOUNTED: &str = "{msg} {spinner} {elapsed}";

struct Stages {
    bar: ProgressBar,
    now: Mutex<(&'static str, Instant)>,
}

impl Stages {
    fn now(&self) -> MutexGuard<'_, (&'static str, Instant)> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn show(&self, stage: &'static str) {
        self.bar.reset();
        self.bar.unset_length();
        self.style(UNCOUNTED);
        self.bar.set_message(stage);
    }

    fn style(&self, template: &str) {
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
    }

    fn end(&self) {
        let (stage, begun) = *self.now();
        let seconds = begun.elapsed().as_secs_f64();
        self.bar.suspend(|| detail(format!("{stage}: {seconds:.1} s")));
    }
}

impl Watch for Stages {
    fn stage(&self, name: &'static str) {
        // The first stage is named twice: by the caller and by the work itself.
        if self.now().0 != name {
            self.end();
            *self.now() = (name, Instant::now());
            self.show(name);
        }
    }

    fn step(&self, done: usize, all: usize) {
        if self.bar.length().is_none() {
            self.style(COUNTED);
            self.bar.set_length(all as u64);
        }
        // Threads report out of order; the bar must not go back.
        if done as u64 > self.bar.position() {
            self.bar.set_position(done as u64);
        }
    }
}

/// Prints the last line of a command: the next command, to copy.
pub fn next_step(words: &[OsString]) {
    next_command(&format!("kinoise {}", shell(words)));
}

/// Same of a command as it is typed.
pub fn next_command(command: &str) {
    say(format!("next: {command}"));
}

/// The words quoted for a shell, in one line.
pub fn shell(words: &[OsString]) -> String {
    words.iter().map(|w| quoted(&w.to_string_lossy())).collect::<Vec<_>>().join(" ")
}

/// The word quoted for a shell.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "@%+=:,./_-".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// Folder beside `path`, named after it with the suffix `-what`.
pub fn beside(path: &Path, what: &str) -> PathBuf {
    let Some(name) = path.file_name() else { return PathBuf::from(what) };
    let mut name = name.to_os_string();
    name.push(format!("-{what}"));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_the_words_back() {
        let words = ["calibrate", "a b/it's", "-o", "", "$HOME", "out/x-1", "é"];
        let line = shell(&words.map(OsString::from));
        let echo = format!("printf '%s\\n' {line}");
        let run = std::process::Command::new("sh").args(["-c", &echo]).output().expect("sh");
        let read = String::from_utf8(run.stdout).expect("text");
        assert_eq!(read.lines().collect::<Vec<_>>(), words);
    }

    #[test]
    fn numbers_of_hundreds_of_digits_are_cut() {
        let long = "9".repeat(150);
        let said = one_line(&format!("--delta {long}.5: 12 to 1e300"));
        assert_eq!(said, format!("--delta {}... (150 digits).5: 12 to 1e300", &long[..17]));
        assert_eq!(one_line("of 1234567890123456789 s"), "of 1234567890123456789 s");
    }

    #[test]
    fn what_comes_of_a_folder_lies_beside_it() {
        assert_eq!(beside(Path::new("data/kinect/"), "noise"), Path::new("data/kinect-noise"));
        assert_eq!(beside(Path::new(".."), "noise"), Path::new("noise"));
    }
}
