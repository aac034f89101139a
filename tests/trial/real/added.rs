//! A raytraced cause is added to what a real sensor recorded: one that acts pixel by pixel, on the
//! mean, the spread or the answer.

use rand::Rng;
use rand::seq::SliceRandom;

use super::dither::places;
use super::full::{Full, area};
use crate::raytraced::choices::cause;
use crate::raytraced::eye::{Eye, Site};
use crate::raytraced::kernels::{Window, fresh};
use crate::raytraced::nats::{Ground, Looked, Repeats, Sample};
use crate::raytraced::poses::Plan;
use crate::raytraced::question::Asked;
use crate::raytraced::shoot::Sum;
use crate::raytraced::weigh::strength_for;
use crate::raytraced::{Act, Cause, Clock, Draw, Unit};
use kinoise::error::{Error, Result};
use kinoise::frame::{DepthCode, Frame};
use kinoise::rng::{Seed, Stream};

/// What a finished recording of a plane can be given and can show.
const KNOWN: [&str; 10] = [
    "pixel-locking",
    "column-banding",
    "radial-disparity-bias",
    "lens-distortion",
    "range-not-depth",
    "fixed-pattern-noise",
    "range-exponent",
    "vignetting",
    "range-dropout",
    "grazing-dropout",
];
const OUTSIDE: [&str; 9] = [
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
const OUTSIDE_EVERY: u32 = 4;
/// What is worth less is no question, nats.
const MIN_NATS: f64 = 5.0;
/// Pixels are looked at so far apart, px: every cause is wider.
const APART: usize = 5;

/// The causes to add to `views` of the recording: those that are asked for, or one by lot that the
/// full model does not hold already and that these views can show.
pub fn causes(full: &Full, asked: &Asked, views: &[usize], rng: &mut Stream) -> Result<Vec<Cause>> {
    let plans: Vec<Plan> = views.iter().map(|&k| full.plan(k)).collect();
    let ground = ground(full, &plans);
    let weighed = |name: &str| weighed(name, asked, &ground);
    if !asked.names.is_empty() {
        return asked.names.iter().map(|name| weighed(name)).collect();
    }
    let held = |name: &&str| full.model.effects.iter().any(|e| e.id == *name);
    let outside = rng.random_range(0..OUTSIDE_EVERY) == 0;
    let mut names = if outside { OUTSIDE.to_vec() } else { KNOWN.to_vec() };
    names.retain(|name| !held(name));
    names.shuffle(rng);
    for name in names {
        let cause = weighed(name)?;
        if cause.label.nats.is_some_and(|nats| nats >= MIN_NATS) {
            return Ok(vec![cause]);
        }
    }
    let what = "nothing can be added to it";
    Err(Error::recording(&full.recording.root, what, "give a recording with more views"))
}

/// The cause of this name, as strong as asked for.
fn weighed(name: &str, asked: &Asked, ground: &Ground<'_>) -> Result<Cause> {
    let seed = Seed(asked.seed);
    let at = |strength: f64| {
        let draw = Draw { strength, shadow: 1.0, unit: ground.unit, half_m: 0.6, seed };
        cause(name, &draw, &mut seed.stream(&format!("rays/alone/{name}")))
    };
    let by_pixel = matches!(
        at(1.0)?.act,
        Act::Ray(_) | Act::Mismatch(_) | Act::Spread(_) | Act::Loss(_) | Act::Gain(_)
    );
    if !by_pixel {
        return Err(Error::Argument {
            what: format!("{name} cannot be added to a recording that was taken"),
            remedy: "name another effect, or none",
        });
    }
    let nats = |strength: f64| Ok(ground.nats(&at(strength)?).unwrap_or(0.0));
    let strength = match asked.nats {
        Some(wanted) => strength_for(wanted, nats)?.0,
        None => 1.0,
    };
    let mut cause = at(strength)?;
    cause.label.nats = Some(nats(strength)?);
    Ok(cause)
}

/// What the full model expects of these views.
fn ground<'a>(full: &'a Full, plans: &'a [Plan]) -> Ground<'a> {
    let world = full.world();
    let width = world.unit.sensor.camera.width;
    let looked = |plan: &'a Plan| {
        let (eye, seen) = (Eye::new(world, plan), &full.seen[plan.view]);
        let sample = |(&i, &sigma): (&u32, &f32)| {
            let (u, v) = (i as usize % width, i as usize / width);
            let site = eye.look(u as f64, v as f64)?;
            let sample = Sample { site, sigma_px: f64::from(sigma), on_target: true };
            (u.is_multiple_of(APART) && v.is_multiple_of(APART)).then_some(sample)
        };
        let samples = seen.pixels.iter().zip(&seen.sigma_px).filter_map(sample).collect();
        Looked { eye, samples }
    };
    let [mean, variance] = ["bias", "variance"].map(|statistic| area(&full.model, statistic));
    Ground {
        unit: world.unit,
        views: plans.iter().map(looked).collect(),
        weight: (APART * APART) as f64,
        repeats: Repeats { area: mean, row: mean.sqrt(), squares: variance },
        reference_m: None,
    }
}

/// The frame as the sensor would have stored it with the causes at work. What lies beside the target
/// is met at its own depth.
pub fn add(causes: &[Cause], full: &Full, eye: &Eye<'_>, frame: &Frame, clock: &Clock) -> Frame {
    let unit = eye.world.unit;
    let (code, fb, width) = (unit.sensor.code, unit.disparity_px_m(), frame.width);
    let sites: Vec<Option<Site>> = (0..frame.raw.len())
        .map(|i| {
            code.metres(frame.raw[i])?;
            eye.look((i % width) as f64, (i / width) as f64)
        })
        .collect();
    let seen = &full.seen[eye.plan.view];
    let mut sigma_px = vec![f64::NAN; frame.raw.len()];
    let known = seen.pixels.iter().zip(&seen.sigma_px);
    known.for_each(|(&i, &sigma)| sigma_px[i as usize] = f64::from(sigma));
    let places = before_rounding(frame, &sites, &sigma_px, unit, &mut clock.stream("step"));
    let mut noise = fresh(clock, frame.raw.len());
    let window_px = area(&full.model, "bias").sqrt();
    if window_px > 1.0 {
        Window::bell(window_px).blur(&mut noise, width);
    }
    let bent = eye.with(causes);
    let (facts, mut lost) = (eye.plan.facts(), clock.stream("lost"));
    let mut words = frame.raw.clone();
    for (i, site) in sites.into_iter().enumerate() {
        let chance: f64 = lost.random();
        let Some(mut site) = site else { continue };
        let d = disparity(&code, words[i], f64::from(places[i]), fb);
        let (mut sigma, mut error) = (sigma_px[i], 0.0);
        if sigma.is_finite() {
            error = bent.look(site.u, site.v).map_or(0.0, |there| there.disparity - site.disparity);
        } else {
            (site.z, site.disparity, site.on_board, site.theta) = (fb / d, d, false, 0.0);
            sigma = unit.sigma(site.z, 0.0) * fb / (site.z * site.z);
        }
        let sum = Sum::of(causes, &site, &facts);
        let further = sigma * (sum.spread.powi(2) - 1.0).max(0.0).sqrt();
        let d = (d + error + sum.error) / sum.gain + further * f64::from(noise[i]);
        // No depth at all is stored as none.
        words[i] = code.raw(if chance < sum.answer { fb / d } else { f64::NAN });
    }
    Frame { width, height: frame.height, raw: words }
}

/// Where in its step each word's value lay.
fn before_rounding(
    frame: &Frame,
    sites: &[Option<Site>],
    sigma_px: &[f64],
    unit: &Unit,
    rng: &mut Stream,
) -> Vec<f32> {
    let (code, fb) = (unit.sensor.code, unit.disparity_px_m());
    // By how many steps a word is above what the plane's would be; NaN beside it.
    let off = |(i, site): (usize, &Option<Site>)| match site {
        Some(site) if sigma_px[i].is_finite() => {
            let at = |place: f64| disparity(&code, frame.raw[i], place, fb);
            ((at(0.0) - site.disparity) / (at(0.5) - at(-0.5))) as f32
        }
        _ => f32::NAN,
    };
    let off: Vec<f32> = sites.iter().enumerate().map(off).collect();
    let valid: Vec<bool> = sites.iter().map(Option::is_some).collect();
    places(frame, &valid, &off, rng)
}

/// Of a word's value at this place within its step, px.
fn disparity(code: &DepthCode, word: u16, place: f64, fb: f64) -> f64 {
    let value = f64::from(word) + place;
    match code {
        DepthCode::Metric { units_per_metre, .. } => fb * units_per_metre / value,
        DepthCode::Disparity { offset, slope, .. } => fb * (offset + slope * value),
    }
}
