//! Blind trial of `kinoise diagnose`, as an example that uses only the public library:
//! `./run prove -o DIR [--sets N] [--seed S] [--data RECORDINGS]`, `--check DIR`, `--page DIR`; in parts
//! by `--shard I/N -o DIR` on each machine, then `--merge DIR1 DIR2 ... -o DIR`.
//!
//! The makers of simulated sets ([`raytraced`] and the speckle simulator) share no formula with the
//! catalogue and no code with the diagnosis; other sets are made of real recordings. Data and answers
//! are hashed before the first diagnosis, the verdicts before the first answer is opened. A process
//! that can reach one set and nothing else diagnoses it. Endpoints are chosen in advance; every failure
//! is on the page.

#![forbid(unsafe_code)]

#[path = "../common/raytraced/mod.rs"]
mod raytraced;

mod baselines;
mod check;
mod commitment;
mod gain;
mod judge;
mod make;
mod page;
mod plan;
mod predictor;
mod proof;
mod real;
mod reliance;
mod rounds;
mod shard;
mod solver;
mod speckle;
#[cfg(all(test, unix))]
mod tests;
mod trial;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use kinoise::io::write_atomic;

use check::{CheckOptions, check};
use proof::{Order, Proof};
use shard::{Shard, gather, hold_shard};
use trial::{Trial, hold};

/// A blind trial of the diagnosis on concealed sets that anyone can check.
#[derive(Debug, Parser)]
#[command(name = "prove", args_conflicts_with_subcommands = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    trial: Arguments,
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
struct Arguments {
    /// Folder for what is published and for the report; a trial that was interrupted goes on there
    #[arg(short, long, value_name = "DIR", conflicts_with_all = ["check", "page"])]
    output: Option<PathBuf>,
    /// How many sets; their kinds keep their shares
    #[arg(long, value_name = "N", default_value_t = 60)]
    sets: usize,
    /// Seed of all random choices: the same seed gives the same sets
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Real recordings, a folder each: a part of the sets is made of them
    #[arg(long, value_name = "PATH")]
    data: Option<PathBuf>,
    /// Keep every set and all that was written about it, in kept/
    #[arg(long)]
    keep: bool,
    /// Longest time for one diagnosis
    #[arg(long, value_name = "SECONDS", default_value_t = 900)]
    limit: u64,
    /// Hold part I of N only: the same plan, every N-th set; merge all parts with --merge
    #[arg(long, value_name = "I/N", conflicts_with_all = ["check", "page", "merge"])]
    shard: Option<Shard>,
    /// Finish the trial whose shards are in these folders, as one trial in -o DIR
    #[arg(
        long,
        value_name = "DIR",
        num_args = 1..,
        requires = "output",
        conflicts_with_all = ["sets", "seed", "limit"]
    )]
    merge: Vec<PathBuf>,
    /// Check the trial in DIR: hashes, marks, scores, and a sample of sets made again
    #[arg(long, value_name = "DIR", conflicts_with = "page")]
    check: Option<PathBuf>,
    /// With --check: make every set again
    #[arg(long, requires = "check")]
    all: bool,
    /// Draw report.html of the finished trial in DIR again
    #[arg(long, value_name = "DIR")]
    page: Option<PathBuf>,
    /// Print the scores, or what was checked, as JSON on stdout
    #[arg(long)]
    json: bool,
    /// Sets at a time; results do not depend on it [default: all cores]
    #[arg(long)]
    threads: Option<usize>,
}

/// Exit codes: a trial that does not hold; bad input or failure.
const DOES_NOT_HOLD: u8 = 1;
const FAILURE: u8 = 2;

/// Upper limit of `--threads`: more than any machine has.
const MAX_THREADS: usize = 1024;

fn main() -> ExitCode {
    let line = CommandLine::parse();
    let done = match &line.command {
        Some(Command::Make(a)) => make::run(a).map(|()| 0),
        Some(Command::Solve) => solver::diagnose_shut_in(),
        None => run(&line.trial),
    };
    ExitCode::from(done.unwrap_or_else(|e| {
        eprintln!("prove: {e:#}");
        FAILURE
    }))
}

fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    if let Some(data) = arguments.data.as_ref().filter(|d| !d.is_dir()) {
        bail!("{}: no folder is here; give --data the folder of the recordings", data.display());
    }
    if let Some(n) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(n.clamp(1, MAX_THREADS)).build_global()?;
    }
    let program = std::env::current_exe().context("where this program lies")?;
    match (&arguments.check, &arguments.page, &arguments.output) {
        (Some(folder), _, _) => check_again(folder, program, arguments),
        (None, Some(folder), _) => page_of(folder, &Proof::read(folder)?).map(|()| 0),
        (None, None, Some(output)) => hold_trial(output, program, arguments).map(|()| 0),
        (None, None, None) => bail!("no folder was given; say -o DIR, --check DIR or --page DIR"),
    }
}

fn page_of(folder: &Path, proof: &Proof) -> anyhow::Result<()> {
    let path = folder.join("report.html");
    write_atomic(&path, page::page(proof).as_bytes())?;
    eprintln!("wrote {}", path.display());
    Ok(())
}

fn hold_trial(output: &Path, program: PathBuf, arguments: &Arguments) -> anyhow::Result<()> {
    let order =
        Order { sets: arguments.sets, seed: arguments.seed, real: arguments.data.is_some() };
    order.check()?;
    let output = std::path::absolute(output).with_context(|| output.display().to_string())?;
    let mut trial = Trial {
        order,
        data: arguments.data.clone(),
        keep: arguments.keep,
        limit: Duration::from_secs(arguments.limit),
        program,
        output,
    };
    if let Some(shard) = arguments.shard {
        hold_shard(&trial, shard, &bar()?)?;
        let Shard { index, of } = shard;
        let folder = trial.output.display();
        eprintln!(
            "shard {index} of {of} is in {folder}; when all are there: --merge DIR1 DIR2 ... -o DIR"
        );
        return Ok(());
    }
    if !arguments.merge.is_empty() {
        let (order, limit_s) = gather(&arguments.merge, &trial.program, &trial.output)?;
        if order.real && trial.data.is_none() {
            bail!("the shards hold sets of real recordings; give the same --data again");
        }
        (trial.order, trial.limit) = (order, Duration::from_secs(limit_s));
    }
    let proof = hold(&trial, &bar()?)?;
    print_json(arguments, &proof.scores)?;
    eprintln!("{}", page::summary(&proof));
    page_of(&trial.output, &proof)
}

fn check_again(folder: &Path, program: PathBuf, arguments: &Arguments) -> anyhow::Result<u8> {
    let options = CheckOptions { data: arguments.data.clone(), all: arguments.all, program };
    let checked = check(folder, &options, &bar()?)?;
    print_json(arguments, &checked)?;
    for (what, lines) in [
        ("checked", &checked.checked),
        ("note", &checked.remarks),
        ("DOES NOT HOLD", &checked.faults),
    ] {
        lines.iter().for_each(|line| eprintln!("{what}: {line}"));
    }
    if checked.faults.is_empty() {
        eprintln!("the trial holds");
        return Ok(0);
    }
    Ok(DOES_NOT_HOLD)
}

fn print_json(arguments: &Arguments, value: &impl serde::Serialize) -> anyhow::Result<()> {
    if arguments.json {
        let mut out = std::io::stdout().lock();
        serde_json::to_writer_pretty(&mut out, value)?;
        writeln!(out)?;
    }
    Ok(())
}

/// Progress bars one after another on a terminal; prints nothing elsewhere.
fn bar() -> anyhow::Result<impl Fn(&'static str, usize, usize) + Sync> {
    let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {eta}")?;
    let bar = ProgressBar::new(0).with_style(style);
    Ok(move |what, done: usize, all: usize| {
        if done == 0 {
            bar.reset();
            bar.set_message(what);
        }
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })
}
