//! Concealed recordings by the speckle simulator: dots imaged and matched twice at the same poses, once with
//! a cause switched on and once without. No error formula exists anywhere; the truth is the switch.

mod causes;

use std::f64::consts::TAU;
use std::path::Path;

use rand::Rng;
use serde_json::{Value, json};

use crate::raytraced::kernels::{scattered, seed_of};
use crate::raytraced::poses::wall_tilt;
use crate::raytraced::question::{Asked, Cell, ConcealedSet, Pose, Truth};
use causes::{SWITCHES, Switch};
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;
use kinoise::rng::Stream;
use kinoise::scene::{Board, Print, Target, WHITE};
use kinoise::simulate::{GridView, Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::view::Sensor;

/// Factor by which a Kinect's image is reduced. The matcher's window is not: at a quarter it covers too much
/// of a distant board.
const SHRINK: usize = 2;
const SHRINK_SMALL: usize = 4;
/// Frames per view: few, since every frame is matched.
const FRAMES: usize = 3;
const NEAREST_M: f64 = 0.9;
const FARTHEST_M: f64 = 2.8;
/// Maximum depth of a wall within the image.
const WALL_ENDS_M: f64 = 3.8;
/// Maximum tilt: the matcher gives up on steeper boards nearby.
const STEEPEST_RAD: f64 = 0.9;

/// Names of the causes that can be concealed.
pub fn known() -> impl Iterator<Item = &'static str> {
    SWITCHES.iter().map(|s| s.cause)
}

/// The set that is `asked`: `recording/` and, taken with nothing switched on, `simulated/`. The nats asked
/// for choose a size of the cause; its worth in nats is unknown.
pub fn conceal(asked: &Asked) -> Result<Box<dyn ConcealedSet>> {
    Ok(Box::new(taken(asked, None)?.1))
}

/// The set, with one more view if wanted, and that view's pose.
fn taken(asked: &Asked, more: Option<&Pose>) -> Result<(Option<Pose>, Speckle)> {
    let Asked { cell, seed, small, .. } = *asked;
    if ![Cell::Null, Cell::Single].contains(&cell) || asked.names.len() > 1 {
        let causes = asked.names.len();
        return Err(Error::Argument {
            what: format!("the speckle world has no cell {cell:?} of {causes} causes"),
            remedy: "ask for null or single, of one cause",
        });
    }
    let digest = sha256_hex(format!("light/{cell:?}/{:?}/{seed}/{small}", asked.names).as_bytes());
    let seed = seed_of(&digest);
    let mut rng = seed.stream("light/set");
    let base = causes::base(&mut rng)?;
    let switch = match (cell, asked.names.first()) {
        (Cell::Null, _) => None,
        (_, Some(name)) => Some(Switch::named(name)?),
        _ => Some(Switch::by_lot(&mut rng)),
    };
    let sensor = kinect_v1(if small { SHRINK_SMALL } else { SHRINK });
    let session = Session::draw(switch.map_or("", |s| s.cause), &sensor, &mut rng);
    let mut views = plan_grid(&session.poses, &session.scenery, FRAMES, true, seed);
    let extra = more.map(|pose| session.nearest(pose, &sensor));
    if let Some(extra) = extra {
        let all = [&session.poses[..], &[extra]].concat();
        views.extend(plan_grid(&all, &session.scenery, FRAMES, false, seed).pop());
    }
    let (mut on, mut hidden) = (base.clone(), Vec::new());
    if let Some(switch) = switch {
        let size = asked.nats.map_or(1.0, |nats| (nats / 50.0).sqrt());
        let (causes, label) = switch.turn(base.clone(), size, &session.scenery, &mut rng)?;
        on = causes;
        hidden.push(label);
    }
    let pose =
        |p: &GridView| Pose { z_m: p.z_m, theta_rad: p.theta_rad, azimuth_rad: p.azimuth_rad };
    let made = json!({
        "usual": base.values(), "switched": on.values(), "size": asked.nats,
        "board": format!("{:?}", session.scenery.target),
        "reference": session.scenery.reference_error_m,
        "views": session.poses.iter().map(|p| json!(pose(p))).collect::<Vec<Value>>(),
        "frames": FRAMES,
    });
    let shoot = |causes, which: &str| Shoot {
        sensor: sensor.clone(),
        views: views.clone(),
        physics: Physics::Speckle { causes },
        infrared: session.infrared,
        // The two recordings draw their noise from different seeds.
        seed: seed_of(&sha256_hex(format!("{digest}/{which}").as_bytes())),
    };
    let set = Speckle {
        recording: shoot(on, "recording"),
        simulated: shoot(base, "simulated"),
        truth: Truth { asked: asked.clone(), hidden, base: made },
    };
    Ok((extra.as_ref().map(pose), set))
}

struct Speckle {
    recording: Shoot,
    simulated: Shoot,
    truth: Truth,
}

impl ConcealedSet for Speckle {
    fn truth(&self) -> Truth {
        self.truth.clone()
    }

    fn write(&self, folder: &Path) -> Result<()> {
        self.recording.write_quickly(&folder.join("recording"), &|_, _| ())?;
        self.simulated.write_quickly(&folder.join("simulated"), &|_, _| ()).map(drop)
    }

    fn with_view(&self, pose: &Pose) -> Result<Option<(Pose, Box<dyn ConcealedSet>)>> {
        let (pose, set) = taken(&self.truth.asked, Some(pose))?;
        Ok(pose.map(|pose| (pose, Box::new(set) as Box<dyn ConcealedSet>)))
    }
}

/// The target and its poses.
struct Session {
    poses: Vec<GridView>,
    scenery: Scenery,
    infrared: bool,
}

impl Session {
    /// Draws a session that has whatever the cause needs to show at all.
    fn draw(cause: &str, sensor: &Sensor, rng: &mut Stream) -> Self {
        let boarded = rng.random::<bool>() || cause == "bow_m";
        let (width_m, height_m) = (rng.random_range(1.0..1.3), rng.random_range(0.8..1.0));
        let referenced = rng.random::<f64>() < 0.25 || cause == "warm_up_k";
        let board = Target::Board(Board { width_m, height_m });
        let scenery = Scenery {
            target: if boarded { board } else { Target::Wall },
            print: Print::Plain(WHITE),
            wall_gap_m: None,
            clutter: 0,
            reference_error_m: referenced.then_some(0.001),
            conditions: rng.random::<f64>() < 0.3,
        };
        let infrared = rng.random::<f64>() < 0.2 || cause == "ambient_dn";
        let n = rng.random_range(10..=14);
        let (near, tilt, turn) = (scattered(n, rng), scattered(n, rng), scattered(n, rng));
        let pose = |k: usize| {
            let z_m = NEAREST_M * (FARTHEST_M / NEAREST_M).powf(near[k]);
            let azimuth_rad = TAU * turn[k];
            let most = steepest(boarded, z_m, azimuth_rad, sensor);
            GridView { z_m, theta_rad: (STEEPEST_RAD * tilt[k]).min(most), azimuth_rad }
        };
        Session { poses: (0..n).map(pose).collect(), scenery, infrared }
    }

    /// Pose nearest to `pose` that the target can take; beyond the matcher's reach nothing is learnt.
    fn nearest(&self, pose: &Pose, sensor: &Sensor) -> GridView {
        let boarded = matches!(self.scenery.target, Target::Board(_));
        let z_m = pose.z_m.clamp(NEAREST_M, FARTHEST_M);
        let most = steepest(boarded, z_m, pose.azimuth_rad, sensor);
        GridView { z_m, theta_rad: pose.theta_rad.min(most), azimuth_rad: pose.azimuth_rad }
    }
}

/// Maximum tilt that the matcher, and for a wall its extent within the image, allow, rad.
fn steepest(boarded: bool, z_m: f64, azimuth_rad: f64, sensor: &Sensor) -> f64 {
    let wall = wall_tilt(&sensor.camera, z_m, azimuth_rad, WALL_ENDS_M);
    if boarded { STEEPEST_RAD } else { STEEPEST_RAD.min(wall) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::raytraced::question::World;
    use crate::raytraced::tests::files;

    fn asked(cell: Cell, names: &[&str], nats: f64, seed: u64) -> Asked {
        let names = names.iter().map(ToString::to_string).collect();
        Asked { world: World::Light, cell, names, nats: Some(nats), seed, small: true }
    }

    #[test]
    fn every_switch_goes_as_far_as_it_must() {
        for switch in &SWITCHES {
            for nats in [5.0, 15.0, 50.0, 150.0] {
                let set = conceal(&asked(Cell::Single, &[switch.cause], nats, 3));
                let Truth { hidden, base, .. } = set.unwrap().truth();
                assert_eq!(hidden[0].form, switch.cause);
                assert_ne!(base["usual"][switch.cause], base["switched"][switch.cause]);
                assert!(hidden[0].parameters.contains_key(switch.cause));
            }
        }
        assert!(conceal(&asked(Cell::Single, &["no such cause"], 5.0, 1)).is_err());
        assert!(conceal(&asked(Cell::Pair, &[], 5.0, 1)).is_err());
        assert!(conceal(&asked(Cell::Null, &[], 5.0, 1)).unwrap().truth().hidden.is_empty());
    }

    /// Two recordings of the same views with different noise; nothing in their text reveals the cause. One
    /// more view changes no byte of the others and stands within the matcher's reach.
    #[test]
    fn a_set_is_two_recordings_of_the_same_poses_and_a_view_more_is_all_that_changes() {
        let set = conceal(&asked(Cell::Single, &["lens_k1"], 50.0, 2)).unwrap();
        let wanted = Pose { z_m: 4.0, theta_rad: 1.2, azimuth_rad: 0.5 };
        let (taken, more) = set.with_view(&wanted).unwrap().unwrap();
        assert!(taken.z_m < 3.0 && taken.theta_rad < 1.0 && taken.azimuth_rad == 0.5);
        let (before, after) = (files(&*set), files(&*more));
        for (name, bytes) in before.iter().filter(|(name, _)| name.starts_with("recording/")) {
            let image = name.ends_with("png");
            let other = &before[&name.replacen("recording", "simulated", 1)];
            assert_eq!(bytes == other, !image, "{name}");
            let text = String::from_utf8_lossy(bytes).to_lowercase();
            assert!(image || !["lens", "k1", "cause"].iter().any(|w| text.contains(w)), "{name}");
        }
        assert!(before.iter().all(|(name, bytes)| after.get(name) == Some(bytes)));
        let new: BTreeMap<&str, usize> = after
            .keys()
            .filter(|name| !before.contains_key(*name))
            .filter_map(|name| Some((name.split('/').nth(1)?, 1)))
            .collect();
        assert_eq!(new.len(), 1, "{new:?}");
    }
}
