use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::evaluate::{Delta, Evaluation, evaluate};
use kinoise::io::{OutputFolder, pretty_json};
use kinoise::map::{
    self, Alignment, GATE_M, Init, Kernel, MAX_BLOCK_PX, MAX_ITERATIONS, MAX_OBSERVATIONS,
    MAX_READOUT_S, Mapped, Options, Stages, VOXEL_M, Weights, frames_csv, ply,
};
use kinoise::report::{Against, MapPage, map_page};
use kinoise::sequence::{Sequence, open};
use kinoise::trajectory::tum_text;
use kinoise::units::counted;
use kinoise::{NoiseModel, Seed};
use serde_json::{Value, json};

use super::common::{Global, Input, Model, Thinning, between, count, one_of};
use super::console::{beside, detail, next_step, notes, result, say, working};
use super::origin::origin;
use super::output::{MAP, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise map rgbd_dataset_freiburg1_desk -m out/kinect/model.json -o out/desk
  kinoise map rgbd_dataset_freiburg1_desk -o out/quick --stride 2 --frames 200")]
pub struct Arguments {
    /// A sequence in the layout of the TUM RGB-D benchmark or of 7-Scenes, a ROS bag (.bag, .mcap, .db3), or
    /// a NumPy stack (.npy, .npz)
    sequence: PathBuf,
    /// Folder for trajectory.txt, map.ply, stats.json and map.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    model: Model,
    #[command(flatten, next_help_heading = "Frames")]
    thinning: Thinning,
    #[command(flatten, next_help_heading = "Alignment and map")]
    tuning: Tuning,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

#[derive(Debug, Args)]
struct Tuning {
    /// What frames are aligned to, and how
    #[arg(long, default_value = "best", value_parser = one_of::<Method, 4>([
        ("best", "The best measured so far: at present, model", Options::best),
        ("paper", "The paper's: 3 cm voxels, exact nearest neighbours, frame to frame",
            || Options::paper(Weights::Model, Init::None)),
        ("projective", "Image blocks, neighbours by projection, frame to frame: the fastest",
            || Options { method: map::Method::Projective, ..Options::best() }),
        ("model", "Image blocks, neighbours by projection, frame to map", Options::best),
    ]))]
    method: Method,
    /// How much a pair of points counts [default: both; with --method paper: model]
    #[arg(long, value_parser = one_of([
        ("none", "All count the same", Weights::None),
        ("model", "The paper's: 1/sigma(d_z, theta) of the point in the earlier frame or in the map", Weights::Model),
        ("both", "By the errors of both points, across their surface", Weights::Both),
    ]))]
    weights: Option<Weights>,
    /// Where an alignment starts [default: motion; with --method paper: none]
    #[arg(long, value_parser = one_of([
        ("none", "Where the last frame was", Init::None),
        ("motion", "As the last two frames moved", Init::Motion),
        ("orb", "Where ORB features say", Init::Orb),
    ]))]
    init: Option<Init>,
    /// How outliers count [default: huber; with --method paper: square]
    #[arg(long, value_parser = one_of([
        ("square", "By their square: not less than others", Kernel::Square),
        ("huber", "By their distance", Kernel::Huber),
        ("tukey", "Not at all, when far out", Kernel::Tukey),
    ]))]
    kernel: Option<Kernel>,
    /// Side of a voxel in m, with --method paper
    #[arg(long, value_name = "M", value_parser = between(VOXEL_M[0], VOXEL_M[1], "m"))]
    voxel: Option<f64>,
    /// Side of an image block in px, not with --method paper
    #[arg(long, value_name = "PX", value_parser = count(1, MAX_BLOCK_PX))]
    block: Option<usize>,
    /// Greatest distance between the points of a pair, m. With the default method, once the motion is
    /// nearly found, a smaller one where frames fit the map worse than the noise model expects
    #[arg(long, value_name = "M", value_parser = between(GATE_M[0], GATE_M[1], "m"))]
    gate: Option<f64>,
    /// Maximum number of iterations of an alignment
    #[arg(long, value_name = "N", value_parser = count(1, MAX_ITERATIONS))]
    iterations: Option<usize>,
    /// Maximum number of observations that count for a piece of the map, with --method model; fewer do where frames fit it
    /// worse than the noise model expects
    #[arg(long, value_name = "N", value_parser = between(1.0, MAX_OBSERVATIONS.into(), "observations"))]
    memory: Option<f64>,
    /// Time from the first row of a depth image to the last, for a rolling shutter, s (a Kinect v1 takes
    /// about 0.03), not with --method paper [default: 0, all rows at once]
    #[arg(long, value_name = "S", value_parser = between(0.0, MAX_READOUT_S, "s"))]
    readout: Option<f64>,
    /// Do not read colour for the map
    #[arg(long)]
    no_colour: bool,
}

/// The default options of a method.
type Method = fn() -> Options;

impl Tuning {
    /// Notes options that this method does not use.
    fn note_unused(&self) {
        let method = (self.method)().method;
        let (voxels, model) = (method == map::Method::Paper, method == map::Method::Model);
        let both = "projective or model";
        for (option, unused, of) in [
            ("--voxel", self.voxel.is_some() && !voxels, "paper"),
            ("--block", self.block.is_some() && voxels, both),
            ("--readout", self.readout.is_some() && voxels, both),
            ("--memory", self.memory.is_some() && !model, "model"),
        ] {
            if unused {
                say(format!("note: {option} has no effect here: it belongs to --method {of}"));
            }
        }
    }

    fn options(&self, seed: Seed) -> Options {
        let options = (self.method)();
        Options {
            weights: self.weights.unwrap_or(options.weights),
            init: self.init.unwrap_or(options.init),
            kernel: self.kernel.unwrap_or(options.kernel),
            voxel_m: self.voxel.map_or(options.voxel_m, |v| v as f32),
            block_px: self.block.unwrap_or(options.block_px),
            max_correspondence_m: self.gate.map_or(options.max_correspondence_m, |v| v as f32),
            max_iterations: self.iterations.unwrap_or(options.max_iterations),
            max_observations: self.memory.map_or(options.max_observations, |v| v as f32),
            readout_s: self.readout.unwrap_or(options.readout_s),
            colour: !self.no_colour,
            seed,
            ..options
        }
    }
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let mut sequence = open(&arguments.sequence, &arguments.input.assumed()?)?;
    let thinning = &arguments.thinning;
    sequence.thin(thinning.stride, thinning.frames);
    let options = arguments.tuning.options(global.seed());
    arguments.tuning.note_unused();
    notes(&sequence.remarks);
    let model = arguments.model.read_for(&sequence)?;
    let title = format!("Map of {}", sequence.name());
    let inputs: Vec<&Path> =
        arguments.model.path().into_iter().chain([&*arguments.sequence]).collect();
    let out = begin(&arguments.output, MAP, &inputs, global)?;
    let named = [&*title, &arguments.model.described(&model)];
    let stats = follow(&sequence, &model, &options, named, out)?;
    global.print_json(&stats)?;
    // With true poses, compare the variants; without them, map again without the model.
    let (command, suffix, plain) = match sequence.truth.is_empty() {
        false => ("compare", "comparison", &[][..]),
        true => ("map", "unweighted", &["--weights", "none"][..]),
    };
    let to = beside(&arguments.output, suffix);
    let mut next = vec![command.into(), arguments.sequence.clone().into(), "-o".into(), to.into()];
    next.extend(plain.iter().map(Into::into));
    next_step(&[next, arguments.model.again(), thinning.again(), arguments.input.again()].concat());
    Ok(())
}

/// Maps, writes every output and reports; returns the content of stats.json. `title` is the page's title,
/// `named` its name of the model.
pub fn follow(
    sequence: &Sequence,
    model: &NoiseModel,
    options: &Options,
    [title, named]: [&str; 2],
    output: OutputFolder,
) -> anyhow::Result<Value> {
    detail(format!("settings: {options:?}"));
    let (begin, used) = (std::time::Instant::now(), cpu_seconds());
    let mapped = working("mapping", |step| map::map(sequence, model, options, step))?;
    let seconds = begin.elapsed().as_secs_f64();
    let cpu = used.and_then(|used| Some(cpu_seconds()? - used));
    let against = truth(sequence, &mapped);
    let stats = stats(&mapped, options, &against, [Some(seconds), cpu]);
    let trajectory = mapped.trajectory();
    output.write("trajectory.txt", tum_text(&trajectory).as_bytes())?;
    output.write("map.ply", &ply(&mapped.map))?;
    let (truth, estimate, delta) = (&*sequence.truth, &*trajectory, DELTA);
    let evaluation = against.as_ref().and_then(|t| t.as_ref().ok());
    let page = MapPage {
        title,
        points: &mapped.map,
        frames: &mapped.frames,
        against: evaluation.map(|evaluation| Against { truth, estimate, evaluation, delta }),
        model: named,
        origin: &origin(&sequence.root, options.seed.0),
    };
    output.write("map.html", map_page(&page)?.as_bytes())?;
    output.write("frames.csv", frames_csv(&mapped.frames).as_bytes())?;
    output.write("stats.json", pretty_json(&stats)?.as_bytes())?;
    let folder = output.place().to_path_buf();
    output.finish()?;
    notes(&mapped.remarks);
    report(&mapped, &against, &folder);
    Ok(stats)
}

/// Interval of the relative error.
const DELTA: Delta = Delta::Seconds(1.0);

/// Evaluates the trajectory against the sequence's true poses, if it has any.
fn truth(sequence: &Sequence, mapped: &Mapped) -> Option<Result<Evaluation, String>> {
    let evaluation = || evaluate(&sequence.truth, &mapped.trajectory(), DELTA);
    (!sequence.truth.is_empty()).then(|| evaluation().map_err(|e| e.to_string()))
}

fn report(mapped: &Mapped, against: &Option<Result<Evaluation, String>>, output: &Path) {
    match against {
        Some(Ok(Evaluation { ate, rpe, .. })) => {
            let (ate, moved, turned) =
                (ate.error.rmse, rpe.translation.rmse, rpe.rotation.rmse.to_degrees());
            let rpe = format!("RPE over 1 s {moved:.4} m and {turned:.3} degrees (rmse)");
            result(format!("against the ground truth: ATE {ate:.4} m, {rpe}"));
        }
        Some(Err(why)) => say(format!("note: not compared with the ground truth: {why}")),
        None => {}
    }
    let (posed, folder) = (mapped.frames.len() - mapped.lost(), output.display());
    let [frames, points] =
        [counted(mapped.frames.len(), "frame"), counted(mapped.map.len(), "point")];
    result(format!("{posed} of {frames} with a pose; {points}; wrote {folder}"));
}

fn stats(
    mapped: &Mapped,
    options: &Options,
    against: &Option<Result<Evaluation, String>>,
    [seconds, cpu_seconds]: [Option<f64>; 2],
) -> Value {
    let aligned = || mapped.frames.iter().filter_map(|f| f.alignment.as_ref());
    let mean = |of: fn(&Alignment) -> f64| {
        aligned().map(of).sum::<f64>() / aligned().count().max(1) as f64
    };
    let min = |of: fn(&Alignment) -> f64| aligned().map(of).fold(1.0, f64::min);
    let all: Vec<Stages> = mapped.frames.iter().map(|f| f.stages.clone()).collect();
    let mut ms: serde_json::Map<String, Value> =
        Stages::medians(&all).each().map(|(name, v)| (name.to_string(), json!(v))).collect();
    let mut totals: Vec<f64> = all.iter().map(Stages::total).collect();
    ms.insert("total".into(), json!(kinoise::stats::median(&mut totals)));
    json!({
        "frames": mapped.frames.len(),
        "lost": mapped.lost(),
        "iterations": mean(|a| a.iterations as f64),
        "matched": mean(|a| a.inlier_ratio),
        "least_matched": min(|a| a.inlier_ratio),
        "weakest": min(|a| a.min_information),
        "points": mapped.map.len(),
        "ms": ms,
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
        "peak_rss_mb": peak_rss_mb(),
        "settings": format!("{options:?}"),
        "truth": against.as_ref().and_then(|t| t.as_ref().ok()).map(super::evaluate::as_json),
    })
}

/// Peak resident memory of this process, MB; known on Linux only.
fn peak_rss_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}

/// CPU time of this process's threads so far, s; known on Linux only.
fn cpu_seconds() -> Option<f64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    let nanoseconds = |thread: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let times = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        times.split_whitespace().next()?.parse().ok()
    };
    Some(threads.filter_map(nanoseconds).sum::<f64>() * 1e-9)
}
