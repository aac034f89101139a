//! Quantisation steps of the raw words, and variance with other causes than sigma.

mod coarse;
pub mod comb;
pub mod lattice;
pub mod rounding;

use crate::camera::Rays;
use crate::diagnose::diagnosis::{Finding, Size};
use crate::diagnose::finding::other_findings::named;
use crate::diagnose::finding::parameters::one;
use crate::diagnose::finding::pixels::{fixed_px2, mean_of, typical_sigma_mm, typical_sigma_px};
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::frame::DepthCode;
use crate::terms::{Axis, PixelContext, Statistic};
use crate::view::Recording;
use lattice::{RawHistogram, Step};

/// Variance with other causes than sigma: quantisation steps, rows, and pixels.
#[derive(Debug, Clone, Copy)]
pub struct Steps {
    depth_px_m2: f64,
    disparity_px: f64,
    noise_px2: f64,
}

impl Steps {
    pub fn of(
        step: Option<Step>,
        structure: &[Structure],
        fields: &[Field],
        recording: &Recording,
    ) -> Self {
        let size = |of_depth| step.filter(|s| s.is_of_depth == of_depth).map_or(0.0, |s| s.size);
        let step_px = size(false);
        let own_px = word_px(recording, fields[0].scale_px_m).unwrap_or(0.0);
        let words = step_px / own_px;
        let whole = own_px > 0.0 && (words.round() / words - 1.0).abs() < SAME_STEP;
        // With frames to compare, fixed-pattern noise is not in the variance.
        let single = fields.iter().all(|f| f.frames.len() < 2);
        let still = if single { fixed_px2(structure) } else { 0.0 };
        Steps {
            depth_px_m2: size(true) * fields[0].scale_px_m,
            // The model's variance already includes the words of a raw sensor. A step that is no whole number
            // of words is rounded twice.
            disparity_px: if whole {
                (step_px.powi(2) - own_px.powi(2)).max(0.0).sqrt()
            } else {
                step_px
            },
            noise_px2: mean_of(structure.iter().filter_map(|s| s.row_px2)) + still,
        }
    }

    /// Variance at a place, px^2.
    pub fn at(&self, p: &PixelContext) -> f64 {
        let depth_px = self.depth_px_m2 / (p.z * p.z);
        (depth_px * depth_px + self.disparity_px.powi(2)) / 12.0 + self.noise_px2
    }
}

/// Finds the step of the stored words, and what it is at each target.
pub(in crate::diagnose) fn measure_steps(
    fields: &mut [Field],
    recording: &Recording,
    rays: &Rays,
) -> Option<Step> {
    let found = lattice(&*fields, recording);
    for f in fields.iter_mut().filter(|f| !f.pixels.is_empty()) {
        let z = f.scale_px_m / f.disparity(f.pixels.len() / 2, rays);
        let word_px = f.scale_px_m * recording.sensor.code.step_inverse(z);
        f.step_px = found.map_or(0.0, |step| step.px(f.scale_px_m, z)).max(word_px);
    }
    found
}

fn lattice<'a>(fields: impl IntoIterator<Item = &'a Field>, recording: &Recording) -> Option<Step> {
    let (mut words, mut pictures) = (RawHistogram::default(), RawHistogram::default());
    let mut scale_px_m = 0.0;
    for f in fields {
        words.merge(&f.words);
        pictures.merge(&f.pictures);
        scale_px_m = f.scale_px_m;
    }
    // Where steps are coarser than a target is deep, it has a single word.
    let words = if words.is_few() { pictures } else { words };
    words.lattice(&recording.sensor, scale_px_m)
}

/// Size of a raw word of the disparity, px.
fn word_px(recording: &Recording, px_m: f64) -> Option<f64> {
    let DepthCode::Disparity { slope, .. } = recording.sensor.code else { return None };
    Some((slope * px_m).abs())
}

/// Relative difference below which the steps of two halves are equal: twice the scan's own error.
const SAME_STEP: f64 = 0.005;
/// Relative standard error of a step that was scanned for.
const SCANNED: f64 = 0.002;

/// Standard error of a step. A whole number of units or words has none: it is the greatest that divides all.
fn error(step: Step, recording: &Recording, px_m: f64) -> f64 {
    let units = match recording.sensor.code {
        DepthCode::Metric { units_per_metre, .. } if step.is_of_depth => {
            step.size * units_per_metre
        }
        _ if step.is_of_depth => f64::NAN,
        _ => word_px(recording, px_m).map_or(f64::NAN, |word| step.size / word),
    };
    if (units - units.round()).abs() < 1e-9 * units { 0.0 } else { SCANNED * step.size }
}

/// Step of a raw recording's own words, px, if that is the step found. A simulation in the same words has it
/// too, and sigma includes its error.
pub(in crate::diagnose) fn own_step(
    step: Option<Step>,
    recording: &Recording,
    px_m: f64,
) -> Option<f64> {
    let word = word_px(recording, px_m)?;
    let size = step.filter(|s| !s.is_of_depth)?.size;
    ((size / word - 1.0).abs() < SAME_STEP).then_some(size)
}

pub(in crate::diagnose) fn own_step_note(step: f64) -> String {
    format!(
        "depths come in the steps of the recording's own raw words, {step:.3} px of disparity; sigma holds the error that they make"
    )
}

/// Sigmas up to which a step acts as noise of a twelfth of its square (Widrow and Kollar, Quantization Noise,
/// 2008). The error of coarser steps follows the surface.
pub(in crate::diagnose) const COARSE_SIGMAS: f64 = 2.0;

/// Drops windows, line variances and the sizes of single frames of views with coarse steps other than those of
/// the recording's own words. Neighbours in one step err together, and whether a pixel jumps between frames
/// depends on where in a step its line lies.
pub(in crate::diagnose) fn forget_windows(
    structure: &mut [Structure],
    fields: &[Field],
    step: Option<Step>,
    recording: &Recording,
) {
    let Some(step) = step else { return };
    if own_step(Some(step), recording, fields[0].scale_px_m).is_some() {
        return;
    }
    for (s, f) in structure.iter_mut().zip(fields) {
        let sigma = f.middle_sigma_px().map_or(0.0, f64::from);
        if step.px(f.scale_px_m, f.plane.depth(0.0, 0.0)) > COARSE_SIGMAS * sigma {
            (s.window_px, s.neighbour_correlation, s.correlation_profile) = (None, None, None);
            (s.near_sum, s.row_px2, s.column_px2) = (None, None, None);
            // Without the window's size the error of a frame's size is unknown.
            s.frame_pixels = 0.0;
        }
    }
}

/// A kind of step: of the disparity or of the depth.
pub(in crate::diagnose) struct Kind {
    pub id: &'static str,
    pub parameter: &'static str,
    axis: Axis,
}

pub(in crate::diagnose) const KINDS: [Kind; 2] = [
    Kind { id: "disparity-quantisation", parameter: "step_px", axis: Axis::DisparityPhase },
    Kind { id: "depth-rounding", parameter: "step_m", axis: Axis::Z },
];

impl Kind {
    fn is_of_depth(&self) -> bool {
        self.axis == Axis::Z
    }

    /// The step, if it is of this kind.
    pub fn of(&self, step: Option<Step>) -> Option<Step> {
        step.filter(|step| step.is_of_depth == self.is_of_depth())
    }

    fn step(&self, size: f64) -> Step {
        Step { is_of_depth: self.is_of_depth(), size, p: None }
    }

    /// Variance that a step adds in each view, as a share of the noise variance.
    fn added(&self, size: f64, fields: &[Field]) -> impl Iterator<Item = f64> {
        let step = self.step(size);
        fields.iter().map(move |f| {
            let sigma = f.middle_sigma_px().map_or(f64::INFINITY, f64::from);
            (step.px(f.scale_px_m, f.plane.depth(0.0, 0.0)) / sigma).powi(2) / 12.0
        })
    }

    /// Finding that a model lacks this step, or has it in excess. Its gain is the Kullback-Leibler divergence
    /// of the Gaussians with and without its variance, over all readings, nats. Words in steps are far
    /// stronger evidence, but of the format.
    fn finding(&self, step: f64, fields: &[Field]) -> Finding {
        let of = |(f, more): (&Field, f64)| {
            let readings: f64 = f.count.iter().map(|n| f64::from(*n)).sum();
            0.5 * readings * (more - more.ln_1p())
        };
        let sigma_mm = typical_sigma_mm(fields);
        let size = if self.is_of_depth() {
            let mm = 1e3 * step / 12f64.sqrt();
            Size { mm, sigma: mm / sigma_mm }
        } else {
            let sigma = step / 12f64.sqrt() / typical_sigma_px(fields);
            Size { mm: sigma * sigma_mm, sigma }
        };
        Finding {
            share: fields.iter().zip(self.added(step, fields)).map(of).sum(),
            size,
            ..named(self.id, Statistic::Distribution, self.axis)
        }
    }
}

/// Least error of a step that is reported, as a share of the noise in some view; for a step of the model that
/// the words contradict, of the typical noise.
const STEP_SHARE: f64 = 0.1;

/// Steps of the model that the words do not lie on.
pub(in crate::diagnose) fn contradicted(
    fields: &[Field],
    known: &KnownTerms,
    recording: &Recording,
) -> Vec<Finding> {
    let mut words = RawHistogram::default();
    fields.iter().for_each(|f| words.merge(&f.words));
    let of = |kind: &Kind| {
        let size = known.parameter(kind.id, kind.parameter)?;
        let lies = words.on(kind.step(size), &recording.sensor, fields[0].scale_px_m)?;
        (!lies).then(|| kind.finding(size, fields)).filter(|f| f.size.sigma > STEP_SHARE)
    };
    KINDS.iter().filter_map(of).collect()
}

pub(in crate::diagnose) fn steps(
    step: Option<Step>,
    known: &KnownTerms,
    fields: &[Field],
    recording: &Recording,
    second: &[bool],
) -> Vec<Finding> {
    let px_m = fields[0].scale_px_m;
    let disparity_counts =
        recording.sensor.may_have_disparity() && own_step(step, recording, px_m).is_none();
    let found = |kind: &Kind| {
        let step = kind.of(step).filter(|_| disparity_counts || kind.is_of_depth())?;
        let strongest = kind.added(step.size, fields).fold(0.0, f64::max).sqrt();
        if known.has(kind.id) || strongest <= STEP_SHARE {
            return None;
        }
        let halves = [false, true].map(|half| {
            let mine = fields.iter().zip(second).filter(|(_, s)| **s == half);
            kind.of(lattice(mine.map(|(f, _)| f), recording))
        });
        let same = |a: Step, b: Step| (a.size / b.size - 1.0).abs() < SAME_STEP;
        let depths = || crate::stats::range(fields.iter().map(|f| f.plane.depth(0.0, 0.0)));
        Some(Finding {
            interval: if kind.is_of_depth() { depths() } else { [0.0, 1.0] },
            parameters: one(kind.parameter, step.size, error(step, recording, px_m)),
            p_adjusted: step.p,
            replicated: Some(halves[0].zip(halves[1]).is_some_and(|(a, b)| same(a, b))),
            ..kind.finding(step.size, fields)
        })
    };
    KINDS.iter().filter_map(found).collect()
}
