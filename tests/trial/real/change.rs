//! A cause of the first world acts on the words of a real view.

use rand::Rng;

use super::dither::{Words, places};
use super::scene::Scene;
use crate::raytraced::borrow::{Window, fresh, white};
use crate::raytraced::{Act, Cause, Clock, Phase, Shake, Site};
use kinoise::error::{Error, Result};
use kinoise::frame::{DepthCode, Frame};
use kinoise::rng::Seed;

/// What is done to a recording.
pub(super) struct Graft {
    pub causes: Vec<Cause>,
    pub seed: Seed,
    /// Side of the window that the sensor's own noise is seen through, px.
    pub window_px: f64,
}

/// What the causes together do at a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct There {
    /// Added to the disparity, px.
    pub shift: f64,
    /// Factor on the standard deviation of the noise.
    pub spread: f64,
    /// Further noise, from pixel to pixel, px.
    pub tremble: f64,
    /// Probability of no answer.
    pub loss: f64,
}

/// Can a finished recording be given it?
///
/// # Errors
/// When the cause acts where no recording can be reached any more.
pub(super) fn check(cause: &Cause, code: DepthCode) -> Result<()> {
    let fits = match cause.act {
        Act::Ray(_) | Act::Mismatch(_) | Act::Spread(_) | Act::Loss(_) | Act::Gain(_) => true,
        Act::Wander(_) | Act::Shake(_) | Act::Grain(Phase::Tails, _) => true,
        // Words of disparity have their own steps, and know none of depth.
        Act::Lattice { .. } | Act::Floor(_) => matches!(code, DepthCode::Metric { .. }),
        Act::Lift(_) | Act::Move(_) | Act::Grain(..) => false,
    };
    if fits {
        return Ok(());
    }
    Err(Error::Argument {
        what: format!("{} cannot be added to a recording that was taken", cause.label.form),
        remedy: "name another effect, or none",
    })
}

impl Graft {
    pub fn there(&self, scene: &Scene<'_>, site: &Site) -> There {
        let facts = scene.facts();
        let fb = scene.camera.disparity_px_m();
        let mut there = There { shift: 0.0, spread: 1.0, tremble: 0.0, loss: 0.0 };
        for cause in &self.causes {
            match &cause.act {
                Act::Mismatch(f) => there.shift += f(site, &facts),
                Act::Spread(f) => there.spread *= f(site, &facts),
                Act::Gain(f) => there.shift += site.disparity * (1.0 / f(site, &facts) - 1.0),
                Act::Loss(f) => there.loss = 1.0 - (1.0 - there.loss) * (1.0 - f(site, &facts)),
                Act::Ray(bend) if site.on_board => {
                    let (x, y) = bend(site.x, site.y);
                    there.shift += fb * scene.plane.inverse_depth(x, y) - site.disparity;
                }
                Act::Wander(px) if site.on_board => {
                    there.tremble = there.tremble.hypot(px * scene.slope());
                }
                _ => {}
            }
        }
        there
    }

    /// The frame as the sensor would have stored it with the causes at work. `target` holds the
    /// plane's pixels; what lies beside it is met at its own depth.
    pub fn apply(&self, scene: &Scene<'_>, target: &[bool], frame: &Frame, clock: &Clock) -> Frame {
        let code = scene.camera.sensor.code;
        let fb = scene.camera.disparity_px_m();
        let valid: Vec<bool> = frame.raw.iter().map(|&w| code.metres(w).is_some()).collect();
        let off = off(scene, target, frame, &valid);
        let words = Words { frame, valid: &valid, off: &off };
        let places = places(&words, &mut self.stream("step", clock));
        let noise = self.noise(clock, frame.raw.len());
        let trembling = white(frame.raw.len(), self.stream("tremble", clock));
        let tails = self.tails(scene, target, frame, &places, clock);
        let shake = self.shake(frame, clock);
        let mut lost = self.stream("lost", clock);
        let mut words = frame.raw.clone();
        for i in 0..words.len() {
            let chance: f64 = lost.random();
            if !valid[i] {
                continue;
            }
            let d = disparity(&code, frame.raw[i], places[i], fb);
            let site = scene.site(i, (!target[i]).then(|| fb / d));
            let there = self.there(scene, &site);
            let [_, sigma] = scene.expected(i, &site, &mut Vec::new());
            let rows = shake.rows[i / frame.width] + shake.columns[i % frame.width];
            let further = sigma * (there.spread.powi(2) - 1.0).max(0.0).sqrt();
            let more = further * f64::from(noise[i]) + there.tremble * f64::from(trembling[i]);
            let d = d + there.shift + f64::from(rows) + more + sigma * f64::from(tails[i]);
            words[i] = if chance < there.loss { no_word(&code) } else { self.word(&code, d, fb) };
        }
        Frame { width: frame.width, height: frame.height, raw: words }
    }

    fn stream(&self, what: &str, clock: &Clock) -> kinoise::rng::Stream {
        self.seed.stream(&format!("real/{what}/{}/{}", clock.view, clock.frame))
    }

    /// Of unit variance, hanging together as the sensor's own does; empty pixels too.
    fn noise(&self, clock: &Clock, count: usize) -> Vec<f32> {
        let mut field = fresh(self.seed, clock.view, clock.frame, count);
        if self.window_px > 1.0 {
            Window::bell(self.window_px).blur(&mut field, clock.width);
        }
        field
    }

    fn shake(&self, frame: &Frame, clock: &Clock) -> Shake {
        let mut shake = Shake { rows: vec![0.0; frame.height], columns: vec![0.0; frame.width] };
        for cause in &self.causes {
            if let Act::Shake(f) = &cause.act {
                f(clock, &mut shake);
            }
        }
        shake
    }

    /// What causes of gross errors add to the residuals of the plane, in standard deviations.
    fn tails(
        &self,
        scene: &Scene<'_>,
        target: &[bool],
        frame: &Frame,
        places: &[f32],
        clock: &Clock,
    ) -> Vec<f32> {
        let mut field = vec![0.0; frame.raw.len()];
        let widen = |cause: &&Cause| matches!(cause.act, Act::Grain(Phase::Tails, _));
        if !self.causes.iter().any(|c| widen(&c)) {
            return field;
        }
        let code = scene.camera.sensor.code;
        let fb = scene.camera.disparity_px_m();
        for (i, residual) in field.iter_mut().enumerate() {
            if target[i] && code.metres(frame.raw[i]).is_some() {
                let site = scene.site(i, None);
                let [bias, sigma] = scene.expected(i, &site, &mut Vec::new());
                let d = disparity(&code, frame.raw[i], places[i], fb);
                *residual = ((d - site.disparity - bias) / sigma) as f32;
            }
        }
        let plain = field.clone();
        for cause in self.causes.iter().filter(widen) {
            if let Act::Grain(_, reshape) = &cause.act {
                reshape(&mut field, clock);
            }
        }
        field.iter_mut().zip(plain).for_each(|(f, p)| *f -= p);
        field
    }

    /// As the driver makes a word of a disparity, px.
    fn word(&self, code: &DepthCode, d: f64, fb: f64) -> u16 {
        let mut z = fb / d;
        for cause in &self.causes {
            match cause.act {
                Act::Lattice { step, phase } => {
                    z = fb / (((fb / z / step - phase).round() + phase) * step);
                }
                Act::Floor(step) => z = (z / step).floor() * step,
                _ => {}
            }
        }
        code.raw(z)
    }
}

/// From what the full model expects on the plane, steps of the word; NaN beside it.
fn off(scene: &Scene<'_>, target: &[bool], frame: &Frame, valid: &[bool]) -> Vec<f32> {
    let code = scene.camera.sensor.code;
    let fb = scene.camera.disparity_px_m();
    let mut row = Vec::new();
    let mut at = |i: usize| {
        let site = scene.site(i, None);
        let d = site.disparity + scene.expected(i, &site, &mut row)[0];
        let expected = match code {
            DepthCode::Metric { units_per_metre, .. } => fb / d * units_per_metre,
            DepthCode::Disparity { offset, slope, .. } => (d / fb - offset) / slope,
        };
        (f64::from(frame.raw[i]) - expected) as f32
    };
    let fits = |i: &usize| valid[*i] && target[*i];
    let mut off = vec![f32::NAN; valid.len()];
    (0..valid.len()).filter(fits).for_each(|i| off[i] = at(i));
    // What strays far says nothing of rounding.
    off.iter_mut().for_each(|x| *x = if x.abs() < FAR { *x } else { f32::NAN });
    off
}

/// Steps.
const FAR: f32 = 50.0;

fn no_word(code: &DepthCode) -> u16 {
    match code {
        DepthCode::Metric { invalid, .. } | DepthCode::Disparity { invalid, .. } => *invalid,
    }
}

/// Of a word's value at its place within the step, px.
fn disparity(code: &DepthCode, word: u16, place: f32, fb: f64) -> f64 {
    let value = f64::from(word) + f64::from(place);
    match code {
        DepthCode::Metric { units_per_metre, .. } => fb * units_per_metre / value,
        DepthCode::Disparity { offset, slope, .. } => fb * (offset + slope * value),
    }
}
