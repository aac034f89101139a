//! An effect of the first world is added to what a real sensor recorded.

use rand::Rng;
use rand::seq::SliceRandom;

use super::change::{Graft, check};
use super::full::{Full, area};
use super::gain::{Gain, gain, strength_for};
use super::scene::Camera;
use crate::raytraced::borrow::alone;
use crate::raytraced::{Cause, Unit};
use crate::{Asked, Hidden};
use kinoise::error::{Error, Result};
use kinoise::frame::DepthCode;
use kinoise::rng::{Seed, Stream};

/// What a finished recording of a plane can be given and can show.
const KNOWN: [&str; 11] = [
    "pixel-locking",
    "column-banding",
    "radial-disparity-bias",
    "lens-distortion",
    "range-not-depth",
    "fixed-pattern-noise",
    "range-exponent",
    "slope-noise",
    "vignetting",
    "heavy-tails",
    "row-noise",
];
const LOSSES: [&str; 2] = ["range-dropout", "grazing-dropout"];
/// Only where reference distances tell where the plane is.
const REFERENCED: [&str; 3] = ["depth-scale", "disparity-offset", "thermal-drift"];
const METRIC: [&str; 2] = ["disparity-quantisation", "depth-rounding"];
const FOREIGN: [&str; 9] = [
    "seam",
    "row-banding",
    "blob",
    "disparity-step",
    "interleave",
    "noisy-distance",
    "noisy-rows",
    "tiring",
    "dead-rows",
];
/// One set in so many conceals what the catalogue lacks.
const FOREIGN_EVERY: u32 = 4;
/// What shows less, nats or share of the pixels lost, is no question.
const MIN_NATS: f64 = 5.0;
const MIN_LOST: f64 = 0.002;

/// The causes to add to `views` of the recording, and what they are.
///
/// # Errors
/// When an effect is asked for that a finished recording cannot be given.
pub(super) fn graft(
    full: &Full,
    asked: &Asked,
    views: &[usize],
    seed: Seed,
    rng: &mut Stream,
) -> Result<(Graft, Vec<Hidden>)> {
    let camera = Camera::new(&full.recording.sensor, &full.model);
    let bed = Bed { full, camera: &camera, unit: camera.unit(), views, seed };
    let names = if asked.names.is_empty() { bed.by_lot(rng)? } else { asked.names.clone() };
    let (mut causes, mut hidden) = (Vec::new(), Vec::new());
    for name in &names {
        let (cause, gain) = bed.cause(name, asked.nats)?;
        hidden.push(tell(&cause, gain));
        causes.push(cause);
    }
    Ok((bed.graft(causes), hidden))
}

/// What the causes are added to.
struct Bed<'a> {
    full: &'a Full,
    camera: &'a Camera<'a>,
    unit: Unit,
    views: &'a [usize],
    seed: Seed,
}

impl Bed<'_> {
    fn graft(&self, causes: Vec<Cause>) -> Graft {
        Graft { causes, seed: self.seed, window_px: area(&self.full.model, "bias").sqrt() }
    }

    /// The cause of this name, as strong as asked for.
    fn cause(&self, name: &str, nats: Option<f64>) -> Result<(Cause, Gain)> {
        let at = |strength: f64| alone(name, strength, &self.unit, self.seed);
        let gain_of = |cause: Cause| {
            let graft = self.graft(vec![cause]);
            gain(&graft, self.full, self.camera, self.views)
        };
        check(&at(1.0)?, self.camera.sensor.code)?;
        let middle = gain_of(at(1.0)?);
        let strength = match nats {
            Some(nats) if middle.nats > 0.0 => {
                strength_for(nats, |s| at(s).map_or(0.0, |cause| gain_of(cause).nats))
            }
            _ => 1.0,
        };
        Ok((at(strength)?, gain_of(at(strength)?)))
    }

    /// One that the full model does not hold already, and that these views can show.
    fn by_lot(&self, rng: &mut Stream) -> Result<Vec<String>> {
        let foreign = rng.random_range(0..FOREIGN_EVERY) == 0;
        let mut names: Vec<&str> = if foreign { FOREIGN.to_vec() } else { self.fitting() };
        names.shuffle(rng);
        for name in names {
            let (cause, gain) = self.cause(name, None)?;
            let unseen = gain.nats == 0.0 && gain.lost == 0.0;
            let by_itself = !matches!(cause.label.statistic, "bias" | "variance" | "missing");
            if gain.nats >= MIN_NATS || gain.lost >= MIN_LOST || by_itself && unseen {
                return Ok(vec![name.into()]);
            }
        }
        Err(Error::Argument {
            what: format!("{}: nothing can be added to it", self.full.recording.root.display()),
            remedy: "give a recording with more views",
        })
    }

    fn fitting(&self) -> Vec<&'static str> {
        let metric = matches!(self.camera.sensor.code, DepthCode::Metric { .. });
        let told = |k: &&usize| self.full.recording.views[**k].notes.reference_distance_m.is_some();
        let referenced = 2 * self.views.iter().filter(told).count() > self.views.len();
        let of = |names: &'static [&'static str], fits: bool| names.iter().filter(move |_| fits);
        of(&KNOWN, true)
            .chain(of(&LOSSES, true))
            .chain(of(&REFERENCED, referenced))
            .chain(of(&METRIC, metric))
            .copied()
            .filter(|name| !self.full.model.effects.iter().any(|e| e.id == *name))
            .collect()
    }
}

fn tell(cause: &Cause, gain: Gain) -> Hidden {
    let label = &cause.label;
    Hidden {
        names: label.id.iter().map(ToString::to_string).collect(),
        form: label.form.into(),
        statistic: label.statistic.into(),
        axis: label.axis.into(),
        also: label.also.iter().map(ToString::to_string).collect(),
        interval: label.interval,
        parameters: label.parameters.clone(),
        nats: Some(gain.nats).filter(|n| *n > 0.0),
    }
}
