use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use kinoise::io::write_atomic;

use super::make;
use super::solver_command;
use super::summary_text as prove_words;
use crate::page::{ProofPage, proof_page};
use crate::{CheckOptions, Proof, Trial, check, examine_all, kept_curve, prove};

/// A blind trial of the diagnosis on concealed sets that anyone can check.
#[derive(Debug, Parser)]
#[command(name = "trial", args_conflicts_with_subcommands = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    trial: Arguments,
    #[command(flatten)]
    global: Global,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make concealed sets by hand
    Make(make::Arguments),
    /// One set of a trial, by a process that is shut in
    #[command(hide = true)]
    Solve,
}

#[derive(Debug, Args)]
pub struct Global {
    /// Print the scores as JSON on stdout
    #[arg(long)]
    json: bool,
    /// Seed of all random choices
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Sets at a time; results do not depend on it [default: all cores]
    #[arg(long)]
    threads: Option<usize>,
}

/// Bad input or failure.
const FAILURE: u8 = 2;

pub fn main() -> ExitCode {
    let line = CommandLine::parse();
    let done = match &line.command {
        Some(Command::Make(a)) => make::run(a).map(|()| 0),
        Some(Command::Solve) => solver_command::run(),
        None => run(&line.trial, &line.global),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(e) => {
            eprintln!("trial: {e:#}");
            ExitCode::from(FAILURE)
        }
    }
}

#[derive(Debug, Args)]
pub struct Arguments {
    /// Folder for seal.json, verdicts.json, proof.json and report.html; a trial that was interrupted
    /// goes on there
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// How many sets; their kinds keep their shares
    #[arg(long, value_name = "N", default_value_t = 60)]
    sets: usize,
    /// Real recordings, a folder each: a part of the sets is made of them
    #[arg(long, value_name = "PATH")]
    data: Option<PathBuf>,
    /// Keep every set and all that was written about it, in kept/
    #[arg(long)]
    keep: bool,
    /// Longest time for one diagnosis
    #[arg(long, value_name = "SECONDS", default_value_t = 900)]
    limit: u64,
    /// Check the proof in DIR: seals, hashes, marks, scores, and a sample of sets made again
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "sets", "keep", "limit"])]
    check: Option<PathBuf>,
    /// Draw report.html of the finished trial in DIR again
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "sets", "data", "keep", "limit", "check"])]
    page: Option<PathBuf>,
    /// With --check: make every set again
    #[arg(long, requires = "check")]
    all: bool,
}

/// A proof that does not hold.
const DOES_NOT_HOLD: u8 = 1;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<u8> {
    if let Some(data) = arguments.data.as_ref().filter(|d| !d.is_dir()) {
        bail!("{}: no folder is here; give --data the folder of the recordings", data.display());
    }
    let program = std::env::current_exe().context("where this program lies")?;
    match (&arguments.check, &arguments.page, &arguments.output) {
        (Some(folder), _, _) => again(folder, program, arguments, global),
        (None, Some(folder), _) => page(folder),
        (None, None, Some(output)) => trial(output, program, arguments, global),
        (None, None, None) => bail!("no folder was given; say -o DIR, --check DIR or --page DIR"),
    }
}

/// The page of the proof as it lies in the folder, whoever wrote it.
fn page(folder: &Path) -> anyhow::Result<u8> {
    let proof = Proof::read(folder)?;
    let text = proof_page(&ProofPage {
        title: "A blind trial of kinoise diagnose",
        proof: &proof,
        curve: &|set| kept_curve(folder, set),
    })?;
    let path = folder.join("report.html");
    write_atomic(&path, text.as_bytes())?;
    say(format!("wrote {}", path.display()));
    Ok(0)
}

fn trial(
    output: &Path,
    program: PathBuf,
    arguments: &Arguments,
    global: &Global,
) -> anyhow::Result<u8> {
    if arguments.sets == 0 {
        bail!("--sets 0: give at least one set");
    }
    let trial = Trial {
        output: std::path::absolute(output).with_context(|| output.display().to_string())?,
        sets: arguments.sets,
        seed: global.seed,
        data: arguments.data.clone(),
        keep: arguments.keep,
        workers: global.workers(),
        program,
        limit: Duration::from_secs(arguments.limit),
        examine: Some(examine_all),
    };
    let bars = Bars::default();
    let proof = prove(&trial, &|what, done, all| bars.step(what, done, all))?;
    drop(bars);
    print_json(global, &serde_json::to_value(&proof.scores)?)?;
    say(prove_words::summary(&proof));
    page(&trial.output)
}

fn again(
    folder: &Path,
    program: PathBuf,
    arguments: &Arguments,
    global: &Global,
) -> anyhow::Result<u8> {
    let options = CheckOptions {
        data: arguments.data.clone(),
        all: arguments.all,
        workers: global.workers(),
        program,
    };
    let bars = Bars::default();
    let checked = check(folder, &options, &|what, done, all| bars.step(what, done, all))?;
    drop(bars);
    print_json(global, &serde_json::to_value(&checked)?)?;
    say(prove_words::checked(&checked));
    Ok(if checked.faults.is_empty() { 0 } else { DOES_NOT_HOLD })
}

/// One bar after the other.
#[derive(Default)]
struct Bars(Mutex<Option<(&'static str, Bar)>>);

impl Bars {
    fn step(&self, what: &'static str, done: usize, all: usize) {
        let Ok(mut bar) = self.0.lock() else { return };
        if bar.as_ref().is_none_or(|(now, _)| *now != what) {
            *bar = Some((what, Bar::new(what)));
        }
        if let Some((_, bar)) = bar.as_ref() {
            bar.step(done, all);
        }
    }
}

impl Global {
    fn workers(&self) -> usize {
        let all = || std::thread::available_parallelism().map_or(1, usize::from);
        self.threads.unwrap_or_else(all)
    }
}

fn print_json(global: &Global, value: &serde_json::Value) -> anyhow::Result<()> {
    if global.json {
        let mut out = std::io::stdout().lock();
        serde_json::to_writer_pretty(&mut out, value)?;
        writeln!(out)?;
    }
    Ok(())
}

/// A line for people.
fn say(text: impl AsRef<str>) {
    eprintln!("{}", text.as_ref());
}

/// A bar on a terminal, nothing elsewhere.
struct Bar(ProgressBar);

impl Bar {
    fn new(what: &'static str) -> Self {
        if !std::io::stderr().is_terminal() {
            return Bar(ProgressBar::hidden());
        }
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {eta}") {
            bar.set_style(style);
        }
        bar.set_message(what);
        Bar(bar)
    }

    fn step(&self, done: usize, total: usize) {
        self.0.set_length(total as u64);
        self.0.set_position(done as u64);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
