//! The options that commands share, and the ways they report.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use indicatif::{ProgressBar, ProgressStyle};
use kinoise::frame::KINECT_NO_MEASUREMENT;
use kinoise::io::Assumed;
use kinoise::{DepthCode, NoiseModel, Progress, Seed};

#[derive(Debug, Args)]
pub struct Global {
    /// Print the result as JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
    /// Seed of all random choices: the same seed gives the same bytes
    #[arg(long, global = true, default_value_t = 1, allow_hyphen_values = true)]
    pub seed: u64,
    /// Threads; results do not depend on it [default: all cores]
    #[arg(long, global = true, value_parser = count(1, MAX_THREADS))]
    pub threads: Option<usize>,
}

/// More than any machine this runs on has; each costs memory before it helps.
const MAX_THREADS: usize = 1024;

impl Global {
    pub fn seed(&self) -> Seed {
        Seed(self.seed)
    }

    pub fn set_threads(&self) -> anyhow::Result<()> {
        let Some(n) = self.threads else { return Ok(()) };
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

/// For folders that do not describe themselves.
#[derive(Debug, Default, PartialEq, Args)]
pub struct Input {
    /// fx,fy,cx,cy in px, for folders without recording.json
    #[arg(
        long,
        value_name = "FX,FY,CX,CY",
        value_parser = numbers::<4>,
        allow_hyphen_values = true
    )]
    intrinsics: Option<[f64; 4]>,
    /// Raw depth values per metre (1000 = mm, 5000 = TUM), for folders without recording.json
    #[arg(long, value_name = "N", conflicts_with = "raw_disparity")]
    units_per_metre: Option<f64>,
    /// Raw Kinect disparities: z = 1/(C0 + C1 raw), for folders without recording.json
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
            let numbers = "numbers that turn raw values into metres";
            bail!("{fault}; give --units-per-metre or --raw-disparity {numbers}");
        }
        Ok(Assumed { intrinsics: self.intrinsics, code, baseline_m: self.baseline })
    }
}

/// For commands that need a model and can do with the paper's.
#[derive(Debug, Args)]
pub struct Model {
    /// model.json of this sensor [default: the paper's Eq. 1]
    #[arg(long = "model", value_name = "FILE")]
    file: Option<PathBuf>,
}

impl Model {
    pub fn read(&self) -> kinoise::Result<NoiseModel> {
        self.file.as_deref().map_or_else(|| Ok(NoiseModel::paper()), NoiseModel::read)
    }
}

/// For commands that read a sequence.
#[derive(Debug, Args)]
pub struct Thinning {
    /// Take every Nth depth image
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub stride: usize,
    /// Take the first N of those
    #[arg(long, value_name = "N")]
    pub frames: Option<usize>,
}

/// An hour at 30 Hz.
pub const MAX_FRAMES: usize = 108_000;

/// For clap: one of several names, each with its help and what it stands for.
pub fn one_of<T: Clone + Send + Sync + 'static, const N: usize>(
    choices: [(&'static str, &'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    let names = choices.each_ref().map(|(name, help, _)| match *help {
        "" => PossibleValue::new(*name),
        help => PossibleValue::new(*name).help(help),
    });
    PossibleValuesParser::new(names).try_map(move |given| {
        let choice = choices.iter().find(|(name, ..)| *name == given);
        choice.map(|(.., meaning)| meaning.clone()).ok_or("no such choice")
    })
}

/// For clap: a whole number from `low` to `high`.
pub fn count(low: usize, high: usize) -> impl Fn(&str) -> Result<usize, String> + Clone {
    move |text| match text.parse() {
        Ok(n) if (low..=high).contains(&n) => Ok(n),
        _ => Err(format!("give a whole number from {low} to {high}")),
    }
}

/// For clap: a number from `low` to `high`.
pub fn between(
    low: f64,
    high: f64,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.trim().parse() {
        Ok(v) if (low..=high).contains(&v) => Ok(v),
        _ => Err(format!("give a number from {low} to {high} {unit}")),
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

/// Work with a bar on a terminal, and with nothing elsewhere.
pub fn with_bar<T>(what: &'static str, work: impl FnOnce(Progress<'_>) -> T) -> T {
    if !std::io::stderr().is_terminal() {
        return work(&|_, _| ());
    }
    let bar = ProgressBar::new(0).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    let done = work(&|done, total| {
        bar.set_length(total as u64);
        // Threads report out of order; a bar never goes back.
        if done as u64 > bar.position() {
            bar.set_position(done as u64);
        }
    });
    bar.finish_and_clear();
    done
}

/// A line for people.
pub fn say(text: impl AsRef<str>) {
    let mut err = std::io::stderr().lock();
    let _ = writeln!(err, "{}", text.as_ref());
}

/// Notes of one kind that are shown; a recording of an hour may have thousands.
const MAX_NOTES: usize = 12;

pub fn notes(remarks: impl IntoIterator<Item = impl Display>) {
    let mut remarks = remarks.into_iter();
    remarks.by_ref().take(MAX_NOTES).for_each(|remark| say(format!("note: {remark}")));
    match remarks.count() {
        0 => {}
        more => say(format!("note: and {more} more like these")),
    }
}
