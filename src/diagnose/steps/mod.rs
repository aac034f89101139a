//! Steps of the words, and the variance that comes by other names than sigma.

pub mod comb;
pub mod lattice;

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
use lattice::{Quantisation, RawHistogram};

/// Variance that comes by other names than sigma: of steps, rows, and pixels.
#[derive(Debug, Clone, Copy)]
pub struct Steps {
    depth_px_m2: f64,
    disparity_px: f64,
    noise_px2: f64,
}

impl Steps {
    pub fn of(
        lattice: &Quantisation,
        structure: &[Structure],
        fields: &[Field],
        recording: &Recording,
    ) -> Self {
        let step_px = lattice.disparity_step_px.unwrap_or(0.0);
        let own_px = word_px(recording, fields[0].scale_px_m).unwrap_or(0.0);
        let words = step_px / own_px;
        let whole = own_px > 0.0 && (words.round() / words - 1.0).abs() < SAME_STEP;
        // With frames to compare, what stands still is not in the variance.
        let single = fields.iter().all(|f| f.frames.len() < 2);
        let still = if single { fixed_px2(structure) } else { 0.0 };
        Steps {
            depth_px_m2: lattice.depth_step_m.unwrap_or(0.0) * fields[0].scale_px_m,
            // Words of a raw sensor are in the model's variance already. A step that is no whole number
            // of them is rounded twice.
            disparity_px: if whole {
                (step_px.powi(2) - own_px.powi(2)).max(0.0).sqrt()
            } else {
                step_px
            },
            noise_px2: mean_of(structure.iter().filter_map(|s| s.row_px2)) + still,
        }
    }

    /// At a place, px^2.
    pub fn at(&self, p: &PixelContext) -> f64 {
        let depth_px = self.depth_px_m2 / (p.z * p.z);
        (depth_px * depth_px + self.disparity_px.powi(2)) / 12.0 + self.noise_px2
    }
}

pub(in crate::diagnose) fn lattice<'a>(
    fields: impl IntoIterator<Item = &'a Field>,
    recording: &Recording,
) -> Quantisation {
    let mut words = RawHistogram::none();
    let mut scale_px_m = 0.0;
    for f in fields {
        words.merge(&f.words);
        scale_px_m = f.scale_px_m;
    }
    words.lattice(&recording.sensor, scale_px_m)
}

/// A raw word of the disparity, px.
fn word_px(recording: &Recording, px_m: f64) -> Option<f64> {
    let DepthCode::Disparity { slope, .. } = recording.sensor.code else { return None };
    Some((slope * px_m).abs())
}

/// Steps of two halves that differ by less, as a share, are one: the scan's own error twice.
const SAME_STEP: f64 = 0.005;

/// The step of a raw recording's own words, px, where that is what is seen: a simulation in the same
/// words has it too, and sigma holds the error that it makes.
pub(in crate::diagnose) fn own_step(
    lattice: &Quantisation,
    recording: &Recording,
    px_m: f64,
) -> Option<f64> {
    let word = word_px(recording, px_m)?;
    lattice.disparity_step_px.filter(|step| (step / word - 1.0).abs() < SAME_STEP)
}

pub(in crate::diagnose) fn own_step_note(step: f64) -> String {
    format!(
        "depths come in the steps of the recording's own raw words, {step:.3} px of disparity; sigma holds the error that they make"
    )
}

/// A step of fewer sigmas errs as if by noise, of a twelfth of its square: Widrow and Kollar,
/// Quantization Noise, 2008. What coarser ones leave follows the surface.
pub(in crate::diagnose) const COARSE_SIGMAS: f64 = 2.0;

/// Neighbours in one coarse step err alike: such views show no window. Nor do they show what lines share,
/// for whether a pixel jumps from frame to frame depends on where in a step its line lies.
pub(in crate::diagnose) fn forget_windows(
    structure: &mut [Structure],
    fields: &[Field],
    lattice: &Quantisation,
) {
    for (s, f) in structure.iter_mut().zip(fields) {
        let sigma = f.middle_sigma_px().map_or(0.0, f64::from);
        let step = lattice.step_px(f.scale_px_m, f.plane.depth(0.0, 0.0));
        if step > COARSE_SIGMAS * sigma {
            (s.window_px, s.neighbour_correlation, s.correlation_profile) = (None, None, None);
            (s.row_px2, s.column_px2) = (None, None);
        }
    }
}

/// A step of the model that the words do not lie on.
pub(in crate::diagnose) struct Contradicted {
    pub id: &'static str,
    pub axis: Axis,
    /// Of the error that it would make, and what that is worth.
    pub size: Size,
    pub nats: f64,
}

pub(in crate::diagnose) fn contradicted(
    fields: &[Field],
    known: &KnownTerms,
    recording: &Recording,
) -> Vec<Contradicted> {
    let mut words = RawHistogram::none();
    fields.iter().for_each(|f| words.merge(&f.words));
    let (sigma_px, sigma_mm) = (typical_sigma_px(fields), typical_sigma_mm(fields));
    let sensor = &recording.sensor;
    let size = |sigma: f64| Size { mm: sigma * sigma_mm, sigma };
    let disparity = known.parameter("disparity-quantisation", "step_px").and_then(|step| {
        let lies = words.on_disparities(step, sensor, fields[0].scale_px_m)?;
        (!lies).then(|| Contradicted {
            id: "disparity-quantisation",
            axis: Axis::DisparityPhase,
            size: size(step / 12f64.sqrt() / sigma_px),
            nats: step_nats(fields, |_| step),
        })
    });
    let depth = known.parameter("depth-rounding", "step_m").and_then(|step| {
        let lies = words.on_depths(step, sensor)?;
        (!lies).then(|| Contradicted {
            id: "depth-rounding",
            axis: Axis::Z,
            size: size(1e3 * step / 12f64.sqrt() / sigma_mm),
            nats: step_nats(fields, in_px(step, fields)),
        })
    });
    disparity.into_iter().chain(depth).filter(|c| c.size.sigma > STEP_SHARE).collect()
}

/// A step is worth telling when the error it makes is this share of the noise in some view; that a model
/// has one which the words contradict, when it is this share of the usual noise.
const STEP_SHARE: f64 = 0.1;

/// A step of the depth, m, as one of the disparity at a depth, px.
fn in_px(step_m: f64, fields: &[Field]) -> impl Fn(f64) -> f64 + use<> {
    let scale_px_m = fields[0].scale_px_m;
    move |z| step_m * scale_px_m / (z * z)
}

/// The variance that a step adds in each view, as a share of its noise's; `px` is the step at a depth, px.
fn added(fields: &[Field], px: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
    fields.iter().map(move |f| {
        let sigma = f.middle_sigma_px().map_or(f64::INFINITY, f64::from);
        (px(f.plane.depth(0.0, 0.0)) / sigma).powi(2) / 12.0
    })
}

/// The largest error of a step among the views, in sigmas.
fn strongest(fields: &[Field], px: impl Fn(f64) -> f64) -> f64 {
    added(fields, px).fold(0.0, f64::max).sqrt()
}

/// What a step is worth that a model lacks, or has too much: the Kullback-Leibler divergence of the
/// Gaussians with and without its variance, over all readings, nats. That words come in steps tells far
/// more, but of the format.
fn step_nats(fields: &[Field], px: impl Fn(f64) -> f64) -> f64 {
    let of = |(f, more): (&Field, f64)| {
        let readings: f64 = f.count.iter().map(|n| f64::from(*n)).sum();
        0.5 * readings * (more - more.ln_1p())
    };
    fields.iter().zip(added(fields, px)).map(of).sum()
}

pub(in crate::diagnose) fn steps(
    lattice: &Quantisation,
    known: &KnownTerms,
    fields: &[Field],
    recording: &Recording,
    second: &[bool],
) -> Vec<Finding> {
    let replicated = |step: fn(&Quantisation) -> Option<f64>| {
        let [a, b] = [false, true].map(|half| {
            let mine = fields.iter().zip(second).filter(|(_, s)| **s == half);
            step(&self::lattice(mine.map(|(f, _)| f), recording))
        });
        Some(a.zip(b).is_some_and(|(a, b)| (a / b - 1.0).abs() < SAME_STEP))
    };
    let found = |effect, axis, size: Size, nats| Finding {
        share: nats,
        size,
        ..named(effect, Statistic::Distribution, axis)
    };
    let (sigma_px, sigma_mm) = (typical_sigma_px(fields), typical_sigma_mm(fields));
    let of_disparity = lattice.disparity_step_px.filter(|_| {
        recording.sensor.may_have_disparity()
            && !known.has("disparity-quantisation")
            && own_step(lattice, recording, fields[0].scale_px_m).is_none()
    });
    let of_disparity = of_disparity.and_then(|step| {
        let sigma = step / 12f64.sqrt() / sigma_px;
        let size = Size { mm: sigma * sigma_mm, sigma };
        let error = 0.002 * step;
        (strongest(fields, |_| step) > STEP_SHARE).then(|| Finding {
            interval: [0.0, 1.0],
            parameters: one("step_px", step, error),
            p_adjusted: lattice.disparity_p,
            replicated: replicated(|l| l.disparity_step_px),
            ..found(
                "disparity-quantisation",
                Axis::DisparityPhase,
                size,
                step_nats(fields, |_| step),
            )
        })
    });
    let of_depth = lattice.depth_step_m.filter(|_| !known.has("depth-rounding"));
    let of_depth = of_depth.and_then(|step| {
        let mm = 1e3 * step / 12f64.sqrt();
        let size = Size { mm, sigma: mm / sigma_mm };
        let px = in_px(step, fields);
        (strongest(fields, &px) > STEP_SHARE).then(|| Finding {
            interval: crate::stats::range(fields.iter().map(|f| f.plane.depth(0.0, 0.0))),
            parameters: one("step_m", step, 0.0),
            p_adjusted: lattice.depth_p,
            replicated: replicated(|l| l.depth_step_m),
            ..found("depth-rounding", Axis::Z, size, step_nats(fields, px))
        })
    });
    of_disparity.into_iter().chain(of_depth).collect()
}
