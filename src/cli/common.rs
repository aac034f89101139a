//! The options that commands share.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use kinoise::frame::{KINECT_NO_MEASUREMENT, UNITS_PER_METRE};
use kinoise::io::Assumed;
use kinoise::map::outside;
use kinoise::sensors::{PRESETS, Preset};
use kinoise::sequence::Sequence;
use kinoise::units::shortest;
use kinoise::view::BASELINE_M;
use kinoise::{DepthCode, NoiseModel, Seed, Sensor};

use super::console::{Verbosity, answer, detail, detail_model, say};

#[derive(Debug, Args)]
pub struct Global {
    /// Print the result as JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
    #[command(flatten)]
    verbosity: Verbosity,
    /// Seed of all random choices: the same seed gives the same bytes [default: 1; demo: the clock]
    #[arg(long, global = true, value_name = "N", allow_hyphen_values = true, value_parser = seed)]
    pub seed: Option<u64>,
    /// Threads to use; the results do not depend on it [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = count(1, MAX_THREADS))]
    threads: Option<usize>,
    /// Write into a folder that holds other files; calibrate: also a model that explains nothing
    #[arg(long, global = true)]
    pub force: bool,
}

/// More than any machine this runs on has; each thread costs memory.
const MAX_THREADS: usize = 1024;

impl Global {
    pub fn seed(&self) -> Seed {
        Seed(self.seed.unwrap_or(1))
    }

    /// Sets the number of threads and the verbosity of the whole process.
    pub fn set_up(&self) -> anyhow::Result<()> {
        self.verbosity.set();
        if let Some(n) = self.threads {
            rayon::ThreadPoolBuilder::new().num_threads(n).build_global().context("--threads")?;
        }
        let (version, threads) = (env!("CARGO_PKG_VERSION"), rayon::current_num_threads());
        detail(format!("kinoise {version}, seed {}, {threads} threads", self.seed().0));
        Ok(())
    }

    /// Prints the result on stdout with --json; text for people goes to stderr.
    pub fn print_json(&self, value: &serde_json::Value) -> anyhow::Result<()> {
        if self.json {
            answer(kinoise::io::pretty_json(value)?.as_bytes()).context("stdout")?;
        }
        Ok(())
    }
}

/// For folders that do not describe themselves.
#[derive(Debug, Default, PartialEq, Args)]
pub struct Input {
    /// fx,fy,cx,cy in px, for folders without recording.json
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = numbers::<4>(-MAX_PX, MAX_PX, "px"), allow_hyphen_values = true)]
    intrinsics: Option<[f64; 4]>,
    /// Raw depth values per metre (1000 = mm, 5000 = TUM), for folders without recording.json
    #[arg(long, value_name = "N", conflicts_with = "raw_disparity", allow_hyphen_values = true, value_parser = between(UNITS_PER_METRE[0], UNITS_PER_METRE[1], "1/m"))]
    units_per_metre: Option<f64>,
    /// Raw Kinect disparities: z = 1/(C0 + C1 raw), for folders without recording.json
    #[arg(long, value_name = "C0,C1", value_parser = numbers::<2>(-MAX_INVERSE_M, MAX_INVERSE_M, "1/m"), allow_hyphen_values = true)]
    raw_disparity: Option<[f64; 2]>,
    /// Projector-camera distance in m, for folders without recording.json
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = between(BASELINE_M[0], BASELINE_M[1], "m"))]
    baseline: Option<f64>,
    /// A usual camera, for what the folder or bag does not say of its own
    #[arg(long, value_name = "ID", value_parser = PossibleValuesParser::new(PRESETS.iter().map(|p| {
        PossibleValue::new(p.id).help(p.describe())
    })))]
    sensor: Option<String>,
    /// Depth topic of a bag, or array of a .npz, where there are several
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
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
        Ok(Assumed {
            intrinsics: self.intrinsics,
            code,
            baseline_m: self.baseline,
            preset: self.sensor.as_deref().and_then(Preset::find),
            topic: self.topic.clone(),
        })
    }

    /// Fails if an option is given that has no meaning for a live Kinect, which sends its own raw disparities.
    pub fn refuse_for_kinect(&self) -> anyhow::Result<()> {
        let given = self.again();
        let is_given = |name: &&&str| given.iter().any(|word| word == **name);
        if let Some(name) = ["--units-per-metre", "--sensor", "--topic"].iter().find(is_given) {
            bail!(
                "{name} does not belong to --source freenect: a Kinect sends raw disparities; --raw-disparity says what they mean"
            );
        }
        Ok(())
    }

    /// The same options as arguments, for another command on the same folder.
    pub fn again(&self) -> Vec<OsString> {
        let joined = |all: &[f64]| all.iter().map(|v| shortest(*v)).collect::<Vec<_>>().join(",");
        let given = [
            ("--intrinsics", self.intrinsics.map(|v| joined(&v))),
            ("--units-per-metre", self.units_per_metre.map(shortest)),
            ("--raw-disparity", self.raw_disparity.map(|v| joined(&v))),
            ("--baseline", self.baseline.map(shortest)),
            ("--sensor", self.sensor.clone()),
            ("--topic", self.topic.clone()),
        ];
        let given =
            given.into_iter().filter_map(|(name, value)| Some([name.into(), value?.into()]));
        given.flatten().collect()
    }
}

/// For commands that need a model and can do with the paper's.
#[derive(Debug, Args)]
pub struct Model {
    /// model.json of this sensor [default: the paper's Eq. 1]
    #[arg(short = 'm', long = "model", value_name = "FILE")]
    file: Option<PathBuf>,
}

impl Model {
    pub fn path(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    pub fn read(&self) -> kinoise::Result<NoiseModel> {
        let file = self.file.as_deref();
        let model = file.map_or_else(|| Ok(NoiseModel::paper()), NoiseModel::read)?;
        detail_model(&model, file);
        Ok(model)
    }

    /// Description of the model for a page.
    pub fn described(&self, model: &NoiseModel) -> String {
        let Some(file) = &self.file else { return "the paper's Eq. 1, for a Kinect v1".into() };
        let sensor = model.sensor.as_ref().map_or(String::new(), |s| format!(" ({})", s.sensor));
        let made = &model.provenance.created;
        format!("{}{sensor}, made on {made}", file.display())
    }

    /// Reads the model for a sequence. Reports where it does not match the sequence's camera and range.
    pub fn read_for(&self, sequence: &Sequence) -> kinoise::Result<NoiseModel> {
        let model = self.read()?;
        if let Some(file) = &self.file {
            model.refuse_other_size(&sequence.sensor).map_err(|e| e.of(file))?;
        }
        let beyond = outside(sequence, &model).filter(|share| *share > MAX_OUTSIDE);
        let percent = |share: f64| format!("{:.0} % of the depths here lie outside", 1e2 * share);
        let ([near, far], beyond) = (model.sigma.domain.z_m, beyond.map(percent));
        match &self.file {
            Some(file) => {
                say_differences(file, &model, &sequence.sensor);
                if let Some(outside) = beyond {
                    say(format!(
                        "note: {outside} {near:.2} to {far:.2} m, where the model was measured; sigma is held at its edge"
                    ));
                }
            }
            None => {
                let held = |outside| format!("; {outside}, where it is held at its edge");
                let held = beyond.map_or_else(String::new, held);
                say(format!(
                    "no --model was given: points are weighed by the paper's Eq. 1, for a Kinect v1 at {near} to {far} m{held}"
                ));
            }
        }
        Ok(model)
    }

    /// The same option as arguments, for another command.
    pub fn again(&self) -> Vec<OsString> {
        model_again(self.file.as_deref())
    }
}

/// A smaller share of depths outside the model's range changes no weight that matters.
const MAX_OUTSIDE: f64 = 0.1;

/// Reports how the model in `file` differs from this sensor.
pub fn say_differences(file: &Path, model: &NoiseModel, sensor: &Sensor) {
    let differences = model.differences(sensor);
    if !differences.is_empty() {
        let (file, differences) = (file.display(), differences.join("; "));
        say(format!(
            "note: {file} seems to be of another sensor: {differences}; its weights and corrections may do harm here: give this sensor's own model"
        ));
    }
}

pub fn model_again(file: Option<&Path>) -> Vec<OsString> {
    file.map_or_else(Vec::new, |f| vec!["-m".into(), f.into()])
}

/// For commands that read a sequence.
#[derive(Debug, Args)]
pub struct Thinning {
    /// Take every Nth depth image: N times as fast, and N times the motion between two frames
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(1, MAX_FRAMES))]
    pub stride: usize,
    /// Stop after N of those
    #[arg(long, value_name = "N", value_parser = count(1, MAX_FRAMES))]
    pub frames: Option<usize>,
}

impl Thinning {
    /// The same options as arguments, for another command.
    pub fn again(&self) -> Vec<OsString> {
        let stride = (self.stride > 1).then(|| ["--stride".into(), self.stride.to_string().into()]);
        let frames = self.frames.map(|n| ["--frames".into(), n.to_string().into()]);
        stride.into_iter().chain(frames).flatten().collect()
    }
}

/// Longer than any focal length of a camera of up to 16 megapixels.
const MAX_PX: f64 = 1e6;
/// Largest inverse depth, that of 1 cm.
const MAX_INVERSE_M: f64 = 100.0;

/// An hour at 30 Hz.
pub const MAX_FRAMES: usize = 108_000;

/// Clap parser: one of several names, each with its help and value.
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

/// Clap parser: a whole number from `low` to `high`.
pub fn count(low: usize, high: usize) -> impl Fn(&str) -> Result<usize, String> + Clone {
    move |text| match text.parse() {
        Ok(n) if (low..=high).contains(&n) => Ok(n),
        _ => Err(format!("give a whole number from {low} to {high}")),
    }
}

fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("give a whole number from 0 to {}", u64::MAX))
}

/// Clap parser: a number from `low` to `high`.
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

/// Clap parser: "a,b,..." as exactly `N` numbers from `low` to `high`.
///
/// (clap's `num_args` counts arguments before it splits them at commas, so it cannot express this.)
pub fn numbers<const N: usize>(
    low: f64,
    high: f64,
    unit: &'static str,
) -> impl Fn(&str) -> Result<[f64; N], String> + Clone {
    move |text| {
        let one = |part: &str| -> Result<f64, String> {
            let number = part.trim().parse().map_err(|_| format!("\"{part}\" is not a number"))?;
            match (low..=high).contains(&number) {
                true => Ok(number),
                false => Err(format!("give numbers from {low} to {high} {unit}")),
            }
        };
        let parsed: Vec<f64> = text.split(',').map(one).collect::<Result<_, String>>()?;
        let given = parsed.len();
        parsed.try_into().map_err(|_| format!("{given} numbers where {N} are needed, with commas"))
    }
}

/// Creation time to write into results: SOURCE_DATE_EPOCH, the convention of reproducible builds, in s
/// since 1970; `None` (the current time) where it is no such number or not set.
pub fn source_date() -> Option<SystemTime> {
    let seconds = std::env::var("SOURCE_DATE_EPOCH").ok()?.parse().ok()?;
    SystemTime::UNIX_EPOCH.checked_add(Duration::from_secs(seconds))
}
