//! What the person with the board should do next: one big word, one small sentence.

use super::guide::Guide;
use super::wanted::{Pose, WantedView};

/// Something to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Nothing flat is in the middle of the picture.
    Aim { why: String },
    /// Carry the board away from the sensor, or towards it when negative, m.
    Carry { m: f64 },
    /// Tilt it more, or less when negative, rad.
    Tilt { rad: f64 },
    /// Let its far side point elsewhere in the picture.
    Turn { far_side: &'static str },
    /// It is where it should be.
    Hold,
    /// It is being taken.
    Stay { kept: usize, of: usize },
    /// A new view is taken wherever it holds still.
    Anywhere,
    /// All is taken.
    Done,
}

impl Step {
    /// For the guide's present state.
    pub fn of(guide: &Guide) -> Self {
        if let Some((_, kept)) = guide.taking() {
            return Step::Stay { kept, of: guide.shutter().frames };
        }
        let pose = match guide.sight() {
            Ok(seen) => seen.pose(),
            Err(why) => return Step::Aim { why: why.clone() },
        };
        match guide.suggestion().and_then(|i| guide.wanted().views.get(i)) {
            Some(view) => towards(view, &pose),
            None if guide.wanted().any => Step::Anywhere,
            None => Step::Done,
        }
    }

    /// In big letters.
    pub fn word(&self) -> String {
        match self {
            Step::Aim { .. } => "AIM".into(),
            Step::Carry { m } if *m > 0.0 => format!("BACK {:.0}", 100.0 * m),
            Step::Carry { m } => format!("NEAR {:.0}", -100.0 * m),
            Step::Tilt { rad } => format!("TILT {:+.0}°", rad.to_degrees()),
            Step::Turn { .. } => "TURN".into(),
            Step::Hold | Step::Anywhere => "HOLD".into(),
            Step::Stay { kept, of } => format!("STAY {}", of - kept),
            Step::Done => "DONE".into(),
        }
    }

    /// In small ones.
    pub fn sentence(&self) -> String {
        match self {
            Step::Aim { why } => format!("aim the sensor at the middle of the board: {why}"),
            Step::Carry { m } if *m > 0.0 => {
                format!("carry the board {:.0} cm away from the sensor", 100.0 * m)
            }
            Step::Carry { m } => {
                format!("carry the board {:.0} cm towards the sensor", -100.0 * m)
            }
            Step::Tilt { rad } => {
                let how = if *rad > 0.0 { "more" } else { "less" };
                format!("tilt the board {:.0} degrees {how}", rad.abs().to_degrees())
            }
            Step::Turn { far_side } => {
                format!(
                    "tilt it another way: its {far_side} side, as the sensor sees it, farther away"
                )
            }
            Step::Hold => "hold it still".into(),
            Step::Anywhere => "hold it still anywhere it has not been".into(),
            Step::Stay { kept, of } => format!("taking it: {kept} of {of} frames"),
            Step::Done => "all views are taken".into(),
        }
    }
}

/// The first thing that is not yet right: distance, tilt, direction.
fn towards(view: &WantedView, pose: &Pose) -> Step {
    if view.fits(pose) {
        return Step::Hold;
    }
    let m = view.pose.z_m - pose.z_m;
    if m.abs() > view.tolerance.z_m {
        return Step::Carry { m };
    }
    let rad = view.pose.theta_rad - pose.theta_rad;
    if rad.abs() > view.tolerance.theta_rad {
        return Step::Tilt { rad };
    }
    Step::Turn { far_side: side(view.pose.azimuth_rad) }
}

/// Where its far side is, as the picture shows it, by eighths of a turn.
pub fn side(azimuth_rad: f64) -> &'static str {
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
