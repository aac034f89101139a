//! Concealed recordings by light: dots seen and matched twice at the same poses, once with a cause
//! switched on and once without. No formula of an error exists anywhere; the truth is the switch.

mod causes;
mod poses;
#[cfg(test)]
mod tests;

use std::path::Path;

use serde_json::{Value, json};

use super::{Asked, Cell, Hidden, Pose, Sealed, Truth};
use causes::{SWITCHES, Switch};
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;
use kinoise::rng::Seed;
use kinoise::simulate::{GridView, Physics, Shoot, kinect_v1, plan_grid};

/// What the picture of a Kinect is shrunk by. The matcher's window does not shrink: at a quarter it
/// covers too much of a board far away.
const SHRINK: usize = 2;
const SHRINK_SMALL: usize = 4;

/// Names of the causes that can be concealed.
pub fn known() -> impl Iterator<Item = &'static str> {
    SWITCHES.iter().map(|s| s.cause)
}

/// The set that is `asked`: `recording/` and, taken with nothing switched on, `simulated/`. What is
/// asked in nats chooses a size of the cause; what it is worth nobody can tell.
///
/// # Errors
/// When this world has no such cell or cause.
pub fn seal(asked: &Asked) -> Result<Box<dyn Sealed>> {
    Ok(Box::new(taken(asked, None)?.1))
}

/// The set, with one view more where one is wanted, and that view's pose.
fn taken(asked: &Asked, more: Option<&Pose>) -> Result<(Option<Pose>, Light)> {
    let Asked { cell, seed, small, .. } = *asked;
    if ![Cell::Null, Cell::Single].contains(&cell) || asked.names.len() > 1 {
        return Err(Error::Argument {
            what: format!(
                "the world of light has no cell {cell:?} of {} causes",
                asked.names.len()
            ),
            remedy: "ask for null or single, of one cause",
        });
    }
    let digest = sha256_hex(format!("light/{cell:?}/{:?}/{seed}/{small}", asked.names).as_bytes());
    let seed = Seed(u64::from_str_radix(&digest[..16], 16).unwrap_or(seed));
    let mut rng = seed.stream("light/set");
    let base = causes::base(&mut rng)?;
    let switch = match (cell, asked.names.first()) {
        (Cell::Null, _) => None,
        (_, Some(name)) => Some(Switch::named(name)?),
        _ => Some(Switch::by_lot(&mut rng)),
    };
    let sensor = kinect_v1(if small { SHRINK_SMALL } else { SHRINK });
    let cause = switch.map_or("", |s| s.cause);
    let session = poses::draw(cause, &sensor, &mut rng);
    let mut views = plan_grid(&session.poses, &session.scenery, poses::FRAMES, true, seed);
    let extra = more.map(|pose| session.nearest(pose, &sensor));
    if let Some(extra) = extra {
        let all = [&session.poses[..], &[extra]].concat();
        views.extend(plan_grid(&all, &session.scenery, poses::FRAMES, false, seed).pop());
    }
    let mut hidden = Vec::new();
    let mut on = base.clone();
    if let Some(switch) = switch {
        let size = asked.nats.map_or(1.0, |nats| (nats / 50.0).sqrt());
        let (causes, told) = switch.turn(base.clone(), size, &session, &mut rng)?;
        on = causes;
        hidden.push(told);
    }
    let told = json!({
        "usual": base.values(), "switched": on.values(), "size": asked.nats,
        "board": format!("{:?}", session.scenery.target),
        "reference": session.scenery.reference_error_m,
        "views": session.poses.iter().map(|p| json!({
            "z_m": p.z_m, "theta_rad": p.theta_rad, "azimuth_rad": p.azimuth_rad,
        })).collect::<Vec<Value>>(),
        "frames": poses::FRAMES,
    });
    let shoot = |causes, seed: &str| Shoot {
        sensor: sensor.clone(),
        views: views.clone(),
        physics: Physics::Speckle { causes },
        infrared: session.infrared,
        seed: Seed(seed_of(&digest, seed)),
    };
    let light = Light {
        recording: shoot(on, "recording"),
        simulated: shoot(base, "simulated"),
        truth: Truth { asked: asked.clone(), hidden, base: told },
    };
    let pose =
        extra.map(|GridView { z_m, theta_rad, azimuth_rad }| Pose { z_m, theta_rad, azimuth_rad });
    Ok((pose, light))
}

/// Neither recording has its noise from the other's seed.
fn seed_of(digest: &str, which: &str) -> u64 {
    let own = sha256_hex(format!("{digest}/{which}").as_bytes());
    u64::from_str_radix(&own[..16], 16).unwrap_or_default()
}

struct Light {
    recording: Shoot,
    simulated: Shoot,
    truth: Truth,
}

impl Sealed for Light {
    fn truth(&self) -> Truth {
        self.truth.clone()
    }

    fn write(&self, folder: &Path) -> Result<()> {
        self.recording.write_quickly(&folder.join("recording"), &|_, _| ())?;
        self.simulated.write_quickly(&folder.join("simulated"), &|_, _| ()).map(drop)
    }

    fn with_view(&self, pose: &Pose) -> Result<Option<(Pose, Box<dyn Sealed>)>> {
        let (pose, light) = taken(&self.truth.asked, Some(pose))?;
        Ok(pose.map(|pose| (pose, Box::new(light) as Box<dyn Sealed>)))
    }
}

/// What a cause shows itself as.
fn hidden(switch: &Switch, parameters: serde_json::Map<String, Value>) -> Hidden {
    Hidden {
        names: switch.names.iter().map(ToString::to_string).collect(),
        form: switch.cause.into(),
        statistic: switch.statistic.into(),
        axis: switch.axis.into(),
        also: switch.also.iter().map(ToString::to_string).collect(),
        interval: None,
        parameters,
        nats: None,
    }
}
