//! Options and habits all commands share.

use std::io::{IsTerminal, Write};
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use kinoise::frame::KINECT_NO_MEASUREMENT;
use kinoise::io::Assumed;
use kinoise::{DepthCode, Seed};

#[derive(Debug, Args)]
pub struct Global {
    /// Print the result as JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
    /// Seed of all random choices: the same seed gives the same bytes
    #[arg(long, global = true, default_value_t = 1, allow_hyphen_values = true)]
    pub seed: u64,
    /// Threads; results do not depend on it [default: all cores]
    #[arg(long, global = true)]
    pub threads: Option<usize>,
}

/// More than any machine this runs on has; each costs memory before it helps.
const MAX_THREADS: usize = 1024;

impl Global {
    pub fn seed(&self) -> Seed {
        Seed(self.seed)
    }

    /// How many may work at a time.
    pub fn workers(&self) -> usize {
        let all = || std::thread::available_parallelism().map_or(1, usize::from);
        self.threads.unwrap_or_else(all)
    }

    pub fn set_threads(&self) -> anyhow::Result<()> {
        let Some(n) = self.threads else { return Ok(()) };
        if n == 0 {
            bail!("--threads 0: give at least one thread");
        }
        if n > MAX_THREADS {
            bail!("--threads {n}: give at most {MAX_THREADS}");
        }
        rayon::ThreadPoolBuilder::new().num_threads(n).build_global().context("--threads")
    }

    /// The result for programs; people read stderr.
    pub fn print_json(&self, value: &serde_json::Value) -> anyhow::Result<()> {
        if self.json {
            let mut out = std::io::stdout().lock();
            serde_json::to_writer_pretty(&mut out, value)?;
            writeln!(out)?;
        }
        Ok(())
    }
}

/// What a folder that does not describe itself needs to be told.
#[derive(Debug, Default, Args)]
pub struct Input {
    /// fx,fy,cx,cy in px, for folders without recording.json
    #[arg(
        long,
        value_name = "FX,FY,CX,CY",
        value_parser = numbers::<4>,
        allow_hyphen_values = true
    )]
    intrinsics: Option<[f64; 4]>,
    /// Depth words per metre (1000 = mm, 5000 = TUM), for folders without recording.json
    #[arg(long, value_name = "N", conflicts_with = "raw_disparity")]
    units_per_metre: Option<f64>,
    /// Raw Kinect words: z = 1/(C0 + C1 word), for folders without recording.json
    #[arg(long, value_name = "C0,C1", value_parser = numbers::<2>, allow_hyphen_values = true)]
    raw_disparity: Option<[f64; 2]>,
    /// Projector-camera distance in m, for folders without recording.json
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    baseline: Option<f64>,
}

impl Input {
    pub fn assumed(&self) -> anyhow::Result<Assumed> {
        let code = match (self.units_per_metre, self.raw_disparity) {
            (Some(units_per_metre), _) => Some(DepthCode::Metric { units_per_metre, invalid: 0 }),
            (None, Some([offset, slope])) => {
                Some(DepthCode::Disparity { offset, slope, invalid: KINECT_NO_MEASUREMENT })
            }
            (None, None) => None,
        };
        if let Some(fault) = code.as_ref().and_then(DepthCode::fault) {
            bail!(
                "{fault}; give --units-per-metre or --raw-disparity numbers that turn words into metres"
            );
        }
        Ok(Assumed { intrinsics: self.intrinsics, code, baseline_m: self.baseline })
    }
}

/// "a,b,..." as exactly `N` numbers, for clap.
///
/// (clap's `num_args` counts arguments before it splits them at commas, so it cannot say this.)
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| format!("\"{part}\" is not a number")))
        .collect::<Result<_, String>>()?;
    let given = parsed.len();
    parsed.try_into().map_err(|_| format!("{given} numbers where {N} are needed, with commas"))
}

/// When results are to say that they were made: SOURCE_DATE_EPOCH, the convention of reproducible
/// builds, in s since 1970; `None`, for now, where that is not set.
pub fn source_date() -> Option<SystemTime> {
    let seconds = std::env::var("SOURCE_DATE_EPOCH").ok()?.parse().ok()?;
    SystemTime::UNIX_EPOCH.checked_add(Duration::from_secs(seconds))
}

/// A bar on a terminal, nothing elsewhere.
pub struct Bar(ProgressBar);

impl Bar {
    pub fn new(what: &'static str) -> Self {
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

    pub fn step(&self, done: usize, total: usize) {
        self.0.set_length(total as u64);
        // Threads report out of order; a bar never goes back.
        if done as u64 > self.0.position() {
            self.0.set_position(done as u64);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// A line for people.
pub fn say(text: impl AsRef<str>) {
    let mut err = std::io::stderr().lock();
    let _ = writeln!(err, "{}", text.as_ref());
}
