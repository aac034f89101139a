//! The paper's experiment: four variants of one mapper on one sequence, and further variants that go beyond
//! the paper.

pub mod tables;

use nalgebra::Isometry3;

use crate::error::{Error, Result};
use crate::evaluate::{Delta, Evaluation, evaluate};
use crate::map::{Init, Kernel, Method, Options, Stages, Weights, map};
use crate::model::NoiseModel;
use crate::rng::Seed;
use crate::sequence::{Moment, Sequence};
use crate::trajectory::Pose;

/// A named configuration of the mapper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variant {
    pub name: &'static str,
    /// Whether it is one of the paper's four.
    pub of_the_paper: bool,
    pub options: Options,
}

/// The paper's four variants: plain, weighted, and both with the ORB start.
pub fn of_the_paper() -> Vec<Variant> {
    let variant = |name, weights, init| Variant {
        name,
        of_the_paper: true,
        options: Options { colour: false, ..Options::paper(weights, init) },
    };
    vec![
        variant("ICP", Weights::None, Init::None),
        variant("weighted ICP", Weights::Model, Init::None),
        variant("ORB + ICP", Weights::None, Init::Orb),
        variant("ORB + weighted ICP", Weights::Model, Init::Orb),
    ]
}

/// Step-by-step variants from the paper's mapper to the default.
pub fn past_the_paper() -> Vec<Variant> {
    let paper = Options { colour: false, ..Options::paper(Weights::Both, Init::None) };
    let best = Options { colour: false, ..Options::best() };
    let frames = Options { method: Method::Projective, ..best };
    let variant = |(name, options)| Variant { name, of_the_paper: false, options };
    [
        ("paper + both noises", paper),
        ("paper + both noises + Tukey", Options { kernel: Kernel::Tukey, ..paper }),
        ("projective, plain", Options { weights: Weights::None, ..frames }),
        ("projective", frames),
        ("frame to map, plain", Options { weights: Weights::None, ..best }),
        ("frame to map, square", Options { kernel: Kernel::Square, ..best }),
        ("frame to map, Tukey", Options { kernel: Kernel::Tukey, ..best }),
        ("frame to map (default)", best),
        ("frame to map, ORB start", Options { init: Init::Orb, ..best }),
    ]
    .map(variant)
    .into()
}

#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    pub seed: u64,
    pub evaluation: Evaluation,
    pub iterations: f64,
    pub lost: usize,
    pub frames: usize,
    /// Medians over frames, ms.
    pub stages: Stages,
    pub trajectory: Vec<Pose>,
}

/// All runs of a variant; the first is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub variant: Variant,
    pub runs: Vec<Run>,
    /// Why runs failed, in order.
    pub failed: Vec<String>,
}

/// All data shown by the tables and figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    pub sequence: String,
    pub rows: Vec<Row>,
    /// A camera that never moves, as the baseline.
    pub still: Evaluation,
    pub truth: Vec<Pose>,
    pub remarks: Vec<String>,
}

/// Called before each run: the variant's name, runs done, runs in all.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Runs all variants, each `repeats` times with different seeds.
/// Fails if the sequence has no ground truth for its time, or the model is of another sensor.
pub fn compare(
    sequence: &Sequence,
    model: &NoiseModel,
    variants: &[Variant],
    repeats: usize,
    seed: Seed,
    progress: Progress<'_>,
) -> Result<Comparison> {
    let delta = Delta::Seconds(1.0);
    if sequence.truth.is_empty() {
        let unused = sequence.unused_truth.as_ref();
        return Err(Error::recording(
            &sequence.root,
            unused.map_or("no ground truth in it".into(), |why| {
                format!("its ground truth cannot be used: {why}")
            }),
            "a comparison needs groundtruth.txt, or frame-XXXXXX.pose.txt beside each frame",
        ));
    }
    let unmoved = |m: &Moment| Pose { stamp: m.stamp, world_from_camera: Isometry3::identity() };
    let unmoved: Vec<Pose> = sequence.moments.iter().map(unmoved).collect();
    let still = evaluate(&sequence.truth, &unmoved, delta)?;
    let mut rows = Vec::new();
    // Without randomness every repeat is the same.
    let runs = |v: &Variant| if v.options.init == Init::Orb { repeats } else { 1 };
    let (mut done, total) = (0, variants.iter().map(runs).sum());
    for variant in variants {
        let mut row = Row { variant: *variant, runs: Vec::new(), failed: Vec::new() };
        for repeat in 0..runs(variant) {
            progress(variant.name, done, total);
            done += 1;
            let seed = Seed(seed.0.wrapping_add(repeat as u64));
            match run(sequence, model, &Options { seed, ..variant.options }, delta) {
                Ok(run) => row.runs.push(run),
                Err(e) => row.failed.push(e.to_string()),
            }
        }
        rows.push(row);
    }
    if let (true, Some(why)) =
        (rows.iter().all(|r: &Row| r.runs.is_empty()), rows.iter().find_map(|r| r.failed.first()))
    {
        let what = format!("no variant makes a map; the first: {why}");
        return Err(Error::recording(&sequence.root, what, "put this right, then run again"));
    }
    Ok(Comparison {
        sequence: sequence.name(),
        rows,
        still,
        truth: sequence.truth.clone(),
        remarks: sequence.remarks.clone(),
    })
}

fn run(sequence: &Sequence, model: &NoiseModel, options: &Options, delta: Delta) -> Result<Run> {
    let mapped = map(sequence, model, options, &|_, _| ())?;
    let trajectory = mapped.trajectory();
    let evaluation = evaluate(&sequence.truth, &trajectory, delta)?;
    let aligned = mapped.frames.iter().filter_map(|f| f.alignment.as_ref());
    let iterations: Vec<f64> = aligned.map(|a| a.iterations as f64).collect();
    let stages: Vec<Stages> = mapped.frames.iter().map(|f| f.stages.clone()).collect();
    Ok(Run {
        seed: options.seed.0,
        evaluation,
        iterations: iterations.iter().sum::<f64>() / iterations.len().max(1) as f64,
        lost: mapped.lost(),
        frames: mapped.frames.len(),
        stages: Stages::medians(&stages),
        trajectory,
    })
}
