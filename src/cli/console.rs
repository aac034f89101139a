//! What people read on stderr: how much of it, the bar, and the next step.

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
    /// From here on, for the whole process.
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

/// Text with what would steer a terminal, or write a line of its own, made visible: names of files and
/// words in them are anybody's.
fn escaped(text: &str, kept: impl Fn(char) -> bool) -> String {
    let steers = |c: char| {
        // Beside the control characters those that turn the direction of writing, and other line ends.
        c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let shown = |c: char| match steers(c) && !kept(c) {
        true => c.escape_default().to_string(),
        false => c.into(),
    };
    text.chars().map(shown).collect()
}

/// Longer messages lose their middle: what is said first and what is to be done last stay.
const MAX_MESSAGE: usize = 1200;

/// Digits in a row that are shown: a double has 17, and what is longer is a slip.
const MAX_DIGITS: usize = 40;
/// Of a longer number.
const SHOWN_DIGITS: usize = 17;

/// Numbers of hundreds of digits cut.
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

/// A message on one line.
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

/// One line. What would end it within, in somebody's name, is made visible; an empty line before or
/// after it may be asked for.
fn print_line(min_level: u8, text: &str) {
    let line = text.trim_matches('\n');
    let begin = text.len() - text.trim_start_matches('\n').len();
    let (before, after) = (&text[..begin], &text[(begin + line.len()).min(text.len())..]);
    print(min_level, &format!("{before}{}{after}", escaped(line, |_| false)));
}

/// What the command was run for, a line; also with --quiet.
pub fn result(line: impl AsRef<str>) {
    print_line(QUIET, line.as_ref());
}

/// The same in several lines, none of which holds a name of somebody's.
pub fn result_lines(text: impl AsRef<str>) {
    print(QUIET, text.as_ref());
}

/// Why the command gave up.
pub fn failure(text: &str) {
    result(format!("kinoise: {}", one_line(text)));
}

/// What was asked for, on stdout. A reader that closes early is no failure; a full disk is.
pub fn answer(text: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e),
        _ => Ok(()),
    }
}

/// A line for people.
pub fn say(line: impl AsRef<str>) {
    print_line(USUAL, line.as_ref());
}

/// Lines for people, none of which holds a name of somebody's.
pub fn say_lines(text: impl AsRef<str>) {
    print(USUAL, text.as_ref());
}

/// With --verbose alone.
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

/// Notes of one kind that are shown; a recording of an hour may have thousands.
const MAX_NOTES: usize = 12;

pub fn notes(remarks: impl IntoIterator<Item = impl Display>) {
    // Several readers may come upon the same.
    let mut known = HashSet::new();
    let mut remarks =
        remarks.into_iter().map(|r| r.to_string()).filter(|r| known.insert(r.clone()));
    remarks.by_ref().take(MAX_NOTES).for_each(|remark| say(format!("note: {}", one_line(&remark))));
    match remarks.count() {
        0 => {}
        more => say(format!("note: and {more} more like these")),
    }
}

/// Work that says what it is at: on a terminal in a bar that goes away, with --verbose in a line a
/// stage with its time.
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
        // What the first stage is called is said twice: by who starts the work, and by the work.
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
        // Threads report out of order; a bar never goes back.
        if done as u64 > self.bar.position() {
            self.bar.set_position(done as u64);
        }
    }
}

/// The last line of a command: what to run next, to copy.
pub fn next_step(words: &[OsString]) {
    say(format!("next: kinoise {}", shell(words)));
}

/// Words as a shell reads them back.
pub fn shell(words: &[OsString]) -> String {
    words.iter().map(|w| quoted(&w.to_string_lossy())).collect::<Vec<_>>().join(" ")
}

/// As a shell reads it back.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "@%+=:,./_-".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A folder for what comes of `path`: its name with what it is, beside it.
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
