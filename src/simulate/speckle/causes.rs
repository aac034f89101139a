//! Settings of the simulated Kinect (causes, never errors), and the state of sensor and target at one
//! instant: temperature and motion.

use nalgebra::Vector3;

use crate::effects::Instant;
use crate::error::{Error, Result};
use crate::plane::Plane;
use crate::scene::Bench;

/// Settings of the sensor, the light, the room and the bench.
#[derive(Debug, Clone, PartialEq)]
pub struct Causes {
    pub window_px: f64,
    pub step_px: f64,
    pub confidence: f64,
    pub light: f64,
    pub ambient_dn: f64,
    pub speckle: f64,
    pub lens_k1: f64,
    pub lens_k2: f64,
    pub blur_px: f64,
    pub read_noise_dn: f64,
    pub warm_up_k: f64,
    pub warm_up_s: f64,
    pub wavelength_nm_per_k: f64,
    pub expansion_per_k: f64,
    pub bow_m: f64,
    pub motion_mps: f64,
}

/// Description of a cause, for people and the command line.
#[derive(Debug, Clone, Copy)]
pub struct Cause {
    pub name: &'static str,
    pub unit: &'static str,
    /// Accepted values.
    pub range: [f64; 2],
    /// Default value.
    pub usual: f64,
    /// Meaning, and source of the default.
    pub description: &'static str,
    value: fn(&mut Causes) -> &mut f64,
}

/// One line per cause: field, unit, range, default, description.
macro_rules! causes {
    ($($name:ident [$unit:literal] $low:literal ..= $high:literal, $usual:literal: $description:literal;)*) => {
        /// All causes.
        pub static KNOWN_CAUSES: &[Cause] = &[$(Cause {
            name: stringify!($name),
            unit: $unit,
            range: [$low, $high],
            usual: $usual,
            description: $description,
            value: |causes| &mut causes.$name,
        }),*];

        impl Default for Causes {
            fn default() -> Self {
                Causes { $($name: $usual),* }
            }
        }
    };
}

causes! {
    window_px ["px"] 3.0..=31.0, 9.0:
        "side of the matching window, odd (Konolige and Mihelich: 9x9 or 9x7)";
    step_px ["px"] 0.0625..=1.0, 0.125:
        "read-out step of the disparity (Konolige and Mihelich: 1/8 px)";
    confidence ["1"] 0.0..=1.0, 0.4:
        "least correlation that counts as an answer (in the dark 81 pixels correlate by chance \
         with sd 1/9; the best of 100 candidates exceeds 0.4 once in a hundred)";
    light ["1"] 0.0..=100.0, 2.0:
        "projector power over that of Landau's law of dot peaks; chosen, not derived: with 2 the \
         disparity sd at 4 m is 0.10 px, with 1 it is 0.13 px, published is 0.08 px";
    ambient_dn ["DN"] 0.0..=1000.0, 0.0:
        "sunlight or lamps on a white surface, in numbers of the 10-bit camera";
    speckle ["1"] 0.0..=2.0, 0.324:
        "laser speckle: sd over mean of a dot's light, and its shift over its radius (half of \
         Landau's Gamma of shape 4.54, the other half is the projector's: an assumed split)";
    lens_k1 ["1"] -0.3..=0.3, 0.0:
        "radial distortion r^2 of the infrared lens that recording.json does not know";
    lens_k2 ["1"] -0.3..=0.3, 0.0:
        "radial distortion r^4 of the same";
    blur_px ["px"] 0.0..=3.0, 0.4:
        "sd of the lens's point spread";
    read_noise_dn ["DN"] 0.0..=200.0, 10.4:
        "sd of the camera's read noise (Landau)";
    warm_up_k ["K"] -50.0..=50.0, 0.0:
        "rise of temperature over the session, approached as 1 - exp(-t / warm_up_s)";
    warm_up_s ["s"] 1.0..=36000.0, 900.0:
        "time constant of the warm-up (10 to 20 min)";
    wavelength_nm_per_k ["nm/K"] 0.0..=1.0, 0.06:
        "drift of the laser: the pattern grows about the projector's axis (stabilised diode)";
    expansion_per_k ["1/K"] 0.0..=0.001, 2.3e-5:
        "thermal expansion of the baseline (aluminium)";
    bow_m ["m"] -0.1..=0.1, 0.0:
        "rise of the board's middle over its edges";
    motion_mps ["m/s"] -1.0..=1.0, 0.0:
        "speed of the target away from the sensor during a view";
}

fn fault(what: String) -> Error {
    Error::Argument { what, remedy: "give --cause NAME=VALUE with one of these" }
}

impl Causes {
    /// `self` with one cause set. Returns an error for an unknown name or a value outside its range.
    pub fn with(mut self, name: &str, value: f64) -> Result<Self> {
        let cause = KNOWN_CAUSES.iter().find(|c| c.name == name).ok_or_else(|| {
            let names: Vec<&str> = KNOWN_CAUSES.iter().map(|c| c.name).collect();
            fault(format!("cause \"{name}\" is not known; known are {}", names.join(", ")))
        })?;
        let [low, high] = cause.range;
        if !(low..=high).contains(&value) {
            // A share or a factor has the unit one.
            let unit = if cause.unit == "1" { String::new() } else { format!(" {}", cause.unit) };
            let what = format!("{name} = {value} is outside {low} to {high}{unit}");
            return Err(Error::Argument { what, remedy: "give a value within" });
        }
        if name == "window_px" && value % 2.0 != 1.0 {
            return Err(fault(format!("window_px = {value} has no middle pixel; it is odd")));
        }
        *(cause.value)(&mut self) = value;
        Ok(self)
    }

    /// `self` with `key=value` applied.
    pub fn parse(self, text: &str) -> Result<Self> {
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| fault(format!("cause \"{text}\" is not key=value")))?;
        let number = value
            .trim()
            .parse()
            .map_err(|_| fault(format!("cause {name}: \"{value}\" is not a number")))?;
        self.with(name.trim(), number)
    }

    /// All values by name, for the recipe.
    pub fn values(&self) -> serde_json::Map<String, serde_json::Value> {
        let mut causes = self.clone();
        KNOWN_CAUSES
            .iter()
            .map(|c| (c.name.to_string(), serde_json::Value::from(*(c.value)(&mut causes))))
            .collect()
    }

    /// Half the matching window, without its middle pixel, px.
    pub(super) fn half_window(&self) -> usize {
        (self.window_px as usize) / 2
    }
}

/// State that changes from frame to frame, besides the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Temperature above that of the reference recording, K.
    pub warmth_k: f64,
    /// Distance by which the target has moved away since the view began, m.
    pub moved_m: f64,
}

/// Wavelength of a Kinect v1's laser, nm.
pub const WAVELENGTH_NM: f64 = 830.0;
/// A surface that has moved by about a millimetre shows new speckle.
const SPECKLE_LENGTH_M: f64 = 1e-3;

impl Moment {
    /// At the factory, when the reference was recorded.
    pub const FACTORY: Moment = Moment { warmth_k: 0.0, moved_m: 0.0 };

    pub fn of(causes: &Causes, instant: &Instant) -> Self {
        let share = -(-instant.session_s / causes.warm_up_s).exp_m1();
        Moment { warmth_k: causes.warm_up_k * share, moved_m: causes.motion_mps * instant.view_s }
    }

    /// Number of the speckle pattern within a view: constant while the target stands still.
    pub fn speckle_epoch(&self) -> i64 {
        (self.moved_m / SPECKLE_LENGTH_M).floor() as i64
    }

    /// The bench at this moment: the target bowed, and moved along the optical axis.
    pub fn bench(&self, causes: &Causes, at_rest: &Bench) -> Bench {
        let by = Vector3::z() * self.moved_m;
        let normal = at_rest.plane.normal();
        let mut bench = at_rest.clone();
        bench.sagitta_m += causes.bow_m;
        bench.plane =
            Plane::from_normal(normal.into_inner(), at_rest.plane.distance() + normal.dot(&by));
        bench.frame.centre += by;
        bench
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Target;

    #[test]
    fn an_unknown_cause_is_refused_with_the_list_of_the_known() {
        let said = Causes::default().parse("disparity_sd=0.1").unwrap_err().to_string();
        for cause in KNOWN_CAUSES {
            assert!(said.contains(cause.name), "{said}");
        }
    }

    #[test]
    fn every_usual_value_is_inside_its_own_range() {
        for cause in KNOWN_CAUSES {
            let causes = Causes::default().with(cause.name, cause.usual).unwrap();
            assert_eq!(causes, Causes::default(), "{}", cause.name);
        }
        assert!(Causes::default().parse("window_px=8").is_err());
        assert!(Causes::default().parse("light=-1").is_err());
    }

    #[test]
    fn a_moving_target_is_where_its_speed_takes_it() {
        let bench = Bench::bare(Plane::tilted(2.0, 0.7, 0.3), Target::Wall);
        let causes = Causes::default().with("motion_mps", -0.5).unwrap();
        let instant = Instant { view: 0, frame: 3, session_s: 0.1, view_s: 0.1 };
        let moment = Moment::of(&causes, &instant);
        let moved = moment.bench(&causes, &bench);
        assert!((moved.plane.depth(0.0, 0.0) - 1.95).abs() < 1e-12);
        assert!((moved.plane.theta() - 0.7).abs() < 1e-12);
        assert_ne!(moment.speckle_epoch(), Moment::FACTORY.speckle_epoch());
    }
}
