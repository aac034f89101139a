//! Causes that can be switched on, how far, and what a solver could rightly call them.

use rand::Rng;
use rand::seq::IndexedRandom;
use serde_json::{Map, Value};

use crate::raytraced::question::Hidden;
use kinoise::error::{Error, Result};
use kinoise::rng::Stream;
use kinoise::scene::Target;
use kinoise::simulate::Scenery;
use kinoise::simulate::speckle::Causes;

use Reach::{Among, Either, Times, Up};

/// A cause that can be concealed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Switch {
    /// Name in the speckle simulator.
    pub cause: &'static str,
    /// Effects that are right names for it; empty where "unexplained" or "recalibrate" is right.
    names: &'static str,
    /// The statistic, the axis, and further axes on which it shows.
    place: &'static str,
    reach: Reach,
}

/// Value of a cause at size 1; sizes are about 1/3, 1/2, 1 and 1.7.
#[derive(Debug, Clone, Copy)]
enum Reach {
    /// This times the size, with either sign.
    Either(f64),
    /// This times the size.
    Up(f64),
    /// The usual value times this to the power of the size.
    Times(f64),
    /// One value for each of the four sizes, for causes that do not vary by degrees.
    Among([f64; 4]),
}

const fn switch(
    cause: &'static str,
    names: &'static str,
    place: &'static str,
    reach: Reach,
) -> Switch {
    Switch { cause, names, place, reach }
}

/// Right names of an unknown lens distortion: it bends the rays and, at the reference's distance, enters the
/// disparity again.
const LENS: &str = "lens-distortion radial-disparity-bias";
/// Sunlight adds noise where the pattern is faint: far, and at the corners.
const SUN: &str = "ambient-light vignetting range-exponent";

/// Causes that can be switched on. A larger window averages more, so the noise shrinks as well. Laser
/// speckle is fixed to the scene.
pub(super) static SWITCHES: [Switch; 12] = [
    switch("lens_k1", LENS, "bias radius pixel", Either(0.012)),
    switch("lens_k2", LENS, "bias radius pixel", Either(0.03)),
    switch("step_px", "disparity-quantisation", "distribution disparity-phase z", Among(STEPS)),
    switch("window_px", "spatial-correlation", "correlation pixel-lag z", Among(WINDOWS)),
    switch("ambient_dn", SUN, "variance intensity radius z", Up(120.0)),
    switch("warm_up_k", "thermal-drift", "bias session-time", Either(15.0)),
    switch("bow_m", "target-bow", "bias target-position", Either(0.003)),
    switch("motion_mps", "target-motion", "bias frame", Either(0.03)),
    switch("blur_px", "", "variance z radius theta", Times(1.6)),
    switch("read_noise_dn", "", "variance z radius intensity", Times(4.0)),
    switch("light", "", "variance z radius intensity", Times(0.5)),
    switch("speckle", "frozen-noise", "correlation frame z", Times(1.6)),
];
const STEPS: [f64; 4] = [0.16, 0.2, 0.25, 0.5];
/// Added to the usual window.
const WINDOWS: [f64; 4] = [2.0, 4.0, 6.0, 10.0];

/// The unit without a cause, drawn at random: no two are alike.
pub(super) fn base(rng: &mut Stream) -> Result<Causes> {
    let window: f64 = *[7.0, 9.0, 9.0, 11.0].choose(rng).unwrap_or(&9.0);
    let usual = Causes::default();
    let light = usual.light * rng.random_range(0.8..1.5);
    let blur = usual.blur_px * rng.random_range(0.8..1.4);
    usual.with("window_px", window)?.with("light", light)?.with("blur_px", blur)
}

impl Switch {
    pub fn named(name: &str) -> Result<&'static Switch> {
        SWITCHES.iter().find(|s| s.cause == name).ok_or_else(|| Error::Argument {
            what: format!("no cause is called \"{name}\""),
            remedy: "take one of the causes of the speckle simulator",
        })
    }

    pub fn by_lot(rng: &mut Stream) -> &'static Switch {
        &SWITCHES[rng.random_range(0..SWITCHES.len())]
    }

    /// `base` with the cause switched on, and its label.
    pub fn turn(
        &self,
        base: Causes,
        size: f64,
        scenery: &Scenery,
        rng: &mut Stream,
    ) -> Result<(Causes, Hidden)> {
        let usual = base.values().get(self.cause).and_then(Value::as_f64).unwrap_or(0.0);
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        let rank = [0.43, 0.74, 1.3].iter().filter(|limit| size > **limit).count();
        let value = match self.reach {
            Either(far) => sign * far * size,
            Up(far) => far * size,
            Times(factor) => usual * f64::powf(factor, size),
            Among(values) if self.cause == "window_px" => usual + values[rank],
            Among(values) => values[rank],
        };
        let mut causes = base.with(self.cause, value)?;
        if self.cause == "warm_up_k" {
            // Most of the warm-up falls within the session.
            causes = causes.with("warm_up_s", rng.random_range(100.0..200.0))?;
        }
        let names: Vec<&str> = self.names.split_whitespace().collect();
        let mut place = self.place.split_whitespace();
        let at = [place.next(), place.next()].map(Option::unwrap_or_default);
        let mut hidden = Hidden::new(&names, self.cause, at);
        hidden.also = place.map(String::from).collect();
        hidden.parameters = parameters(self.cause, value, &causes, scenery);
        Ok((causes, hidden))
    }
}

/// The switched value, and the catalogue's parameters that follow from it by geometry alone.
fn parameters(cause: &str, value: f64, causes: &Causes, scenery: &Scenery) -> Map<String, Value> {
    let mut all = Map::from_iter([(cause.to_string(), Value::from(value))]);
    let mut say = |name: &str, value: f64| all.insert(name.into(), value.into());
    match cause {
        "lens_k1" => drop(say("k1", value)),
        "window_px" => drop(say("length_px", value)),
        "warm_up_k" => drop(say("time_constant_s", causes.warm_up_s)),
        "motion_mps" => drop(say("velocity_mps", value)),
        "bow_m" => {
            say("sagitta_m", value);
            if let Target::Board(board) = scenery.target {
                say("span_m", board.width_m);
            }
        }
        _ => {}
    }
    all
}
