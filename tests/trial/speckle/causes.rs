//! What can be switched on, how far, and what a solver could rightly call it.

use rand::Rng;
use rand::seq::IndexedRandom;
use serde_json::{Map, Value};

use crate::raytraced::question::Hidden;
use kinoise::error::{Error, Result};
use kinoise::rng::Stream;
use kinoise::scene::Target;
use kinoise::simulate::Scenery;
use kinoise::simulate::speckle::Causes;

/// A cause that can be concealed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Switch {
    /// Of the speckle world.
    pub cause: &'static str,
    /// Effects that it rightly is called; none where "unexplained" or "recalibrate" is right.
    pub names: &'static [&'static str],
    pub statistic: &'static str,
    pub axis: &'static str,
    pub also: &'static [&'static str],
    reach: Reach,
}

/// Where a cause goes at size 1; sizes are about 1/3, 1/2, 1 and 1.7.
#[derive(Debug, Clone, Copy)]
enum Reach {
    /// To either side of nothing, as far as this.
    Either(f64),
    /// Up from nothing.
    Up(f64),
    /// Times this to the size.
    Times(f64),
    /// The four sizes in order: what a cause can be does not go by degrees.
    Among([f64; 4]),
}

const fn switch(
    cause: &'static str,
    names: &'static [&'static str],
    [statistic, axis]: [&'static str; 2],
    also: &'static [&'static str],
    reach: Reach,
) -> Switch {
    Switch { cause, names, statistic, axis, also, reach }
}

/// An unknown lens both bends the rays and is met again, at the reference's distance, in the disparity:
/// either name is right. Sunlight adds noise where the pattern is faint: far, and at the corners. A
/// larger window averages more, so that the noise shrinks as well.
pub(super) static SWITCHES: [Switch; 12] = [
    switch(
        "lens_k1",
        &["lens-distortion", "radial-disparity-bias"],
        ["bias", "radius"],
        &["pixel"],
        Reach::Either(0.012),
    ),
    switch(
        "lens_k2",
        &["lens-distortion", "radial-disparity-bias"],
        ["bias", "radius"],
        &["pixel"],
        Reach::Either(0.03),
    ),
    switch(
        "step_px",
        &["disparity-quantisation"],
        ["distribution", "disparity-phase"],
        &["z"],
        Reach::Among([0.16, 0.2, 0.25, 0.5]),
    ),
    switch(
        "window_px",
        &["spatial-correlation"],
        ["correlation", "pixel-lag"],
        &["z"],
        Reach::Among([2.0, 4.0, 6.0, 10.0]),
    ),
    switch(
        "ambient_dn",
        &["ambient-light", "vignetting", "range-exponent"],
        ["variance", "intensity"],
        &["radius", "z"],
        Reach::Up(120.0),
    ),
    switch("warm_up_k", &["thermal-drift"], ["bias", "session-time"], &[], Reach::Either(15.0)),
    switch("bow_m", &["target-bow"], ["bias", "target-position"], &[], Reach::Either(0.003)),
    switch("motion_mps", &["target-motion"], ["bias", "frame"], &[], Reach::Either(0.03)),
    switch("blur_px", &[], ["variance", "z"], &["radius", "theta"], Reach::Times(1.6)),
    switch("read_noise_dn", &[], ["variance", "z"], &["radius", "intensity"], Reach::Times(4.0)),
    switch("light", &[], ["variance", "z"], &["radius", "intensity"], Reach::Times(0.5)),
    // Laser speckle stands still with the scene.
    switch("speckle", &["frozen-noise"], ["correlation", "frame"], &["z"], Reach::Times(1.6)),
];

/// The unit as it is without a cause: no two are alike.
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

    /// `base` with the cause switched on, and what that is called.
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
            Reach::Either(far) => sign * far * size,
            Reach::Up(far) => far * size,
            Reach::Times(factor) => usual * f64::powf(factor, size),
            Reach::Among(values) if self.cause == "window_px" => usual + values[rank],
            Reach::Among(values) => values[rank],
        };
        let mut causes = base.with(self.cause, value)?;
        if self.cause == "warm_up_k" {
            // Most of it within the session.
            causes = causes.with("warm_up_s", rng.random_range(100.0..200.0))?;
        }
        let mut hidden = Hidden::new(self.names, self.cause, [self.statistic, self.axis]);
        hidden.also = self.also.iter().map(ToString::to_string).collect();
        hidden.parameters = parameters(self.cause, value, &causes, scenery);
        Ok((causes, hidden))
    }
}

/// The switch, and in the catalogue's words what follows from it by geometry alone.
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
