//! What the person with the board should do next: one big word, one small sentence.

use super::guide::Guide;
use super::wanted::{Pose, WantedView};

/// One instruction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Advice {
    /// To be read from afar: capitals, digits, and `+-°`.
    pub word: String,
    pub sentence: String,
}

impl Advice {
    pub fn new(word: impl Into<String>, sentence: impl Into<String>) -> Self {
        Advice { word: word.into(), sentence: sentence.into() }
    }

    /// Advice for the guide's current state.
    pub fn of(guide: &Guide) -> Self {
        if let Some((_, kept)) = guide.taking() {
            let of = guide.shutter().frames;
            let sentence = format!("taking it: {kept} of {of} frames");
            return Advice::new(format!("STAY {}", of - kept), sentence);
        }
        match (guide.sighting(), guide.suggestion()) {
            (Err(why), _) => {
                Advice::new("AIM", format!("aim the sensor at the middle of the board: {why}"))
            }
            (Ok(seen), Some(view)) => Advice::towards(view, &seen.pose()),
            _ if guide.wanted().any => {
                Advice::new("HOLD", "hold it still anywhere it has not been")
            }
            _ => Advice::new("DONE", "all views are taken"),
        }
    }

    /// The first of distance, tilt and direction that is not right yet.
    fn towards(view: &WantedView, pose: &Pose) -> Self {
        let z_m = view.pose.z_m - pose.z_m;
        let degrees = (view.pose.theta_rad - pose.theta_rad).to_degrees();
        if view.fits(pose) {
            Advice::new("HOLD", "hold it still")
        } else if z_m.abs() > view.tolerance.z_m {
            let (word, side) = if z_m > 0.0 { ("BACK", "away from") } else { ("NEAR", "towards") };
            let cm = 100.0 * z_m.abs();
            let sentence = format!("carry the board {cm:.0} cm {side} the sensor");
            Advice::new(format!("{word} {cm:.0}"), sentence)
        } else if degrees.abs() > view.tolerance.theta_rad.to_degrees() {
            let how = if degrees > 0.0 { "more" } else { "less" };
            let sentence = format!("tilt the board {:.0} degrees {how}", degrees.abs());
            Advice::new(format!("TILT {degrees:+.0}°"), sentence)
        } else {
            let side = far_side(view.pose.azimuth_rad);
            let sentence =
                format!("tilt it so that its {side} side, as the sensor sees it, is farther away");
            Advice::new("TURN", sentence)
        }
    }
}

/// Side of the target that is farther away, as seen in the image, in eighths of a turn.
pub fn far_side(azimuth_rad: f64) -> &'static str {
    const SIDES: [&str; 8] = [
        "right",
        "lower right",
        "lower",
        "lower left",
        "left",
        "upper left",
        "upper",
        "upper right",
    ];
    let eighth = (azimuth_rad / std::f64::consts::FRAC_PI_4).round().rem_euclid(8.0);
    SIDES[eighth as usize % 8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_far_side_is_named() {
        let sides = [0.0, 92.0, -90.0, 180.0, -180.0].map(|a: f64| far_side(a.to_radians()));
        assert_eq!(sides, ["right", "lower", "upper", "left", "left"]);
    }
}
