//! `kinoise simulate OUT --room`: an office filmed along a path.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use kinoise::effects::{Active, Stage};
use kinoise::simulate::Physics;
use kinoise::simulate::room::{
    CLEARANCE_M, Pose, Resampled, Room, around_the_desks, place, read_trajectory, resample,
};
use kinoise::units::counted;

use super::common::{MAX_FRAMES, count};
use super::console::say;

#[derive(Debug, Args)]
pub struct RoomArguments {
    /// Film an office with two desks: a TUM-layout sequence with colour, depth and ground truth
    #[arg(long, conflicts_with_all = ["like", "grid", "distances", "tilts", "azimuths", "ordered", "board", "wall_target", "patches", "wall", "clutter", "reference_error", "conditions", "infrared"])]
    pub room: bool,
    /// Poses to film along: timestamp tx ty tz qx qy qz qw, z up [default: once around the desks]
    #[arg(long, value_name = "POSES", requires = "room")]
    pub trajectory: Option<PathBuf>,
    /// Take every Nth pose of the path
    #[arg(long, value_name = "N", default_value_t = 1, requires = "room", value_parser = count(1, MAX_FRAMES))]
    stride: usize,
}

impl RoomArguments {
    /// Refuses the room's options without --room: clap drops `requires` where the required option conflicts
    /// with another.
    pub fn refuse_without_room(&self) -> anyhow::Result<()> {
        let given = [("--trajectory", self.trajectory.is_some()), ("--stride", self.stride != 1)];
        match given.into_iter().find(|(_, given)| !self.room && *given) {
            Some((option, _)) => bail!("{option} is of a film: give --room too, or leave it out"),
            None => Ok(()),
        }
    }

    /// The poses to film from, at most `frames`.
    pub fn path(&self, room: &Room, frames: Option<usize>) -> anyhow::Result<Vec<Pose>> {
        let all = match &self.trajectory {
            Some(file) => fitted(file, room, frames, self.stride)?,
            None => around_the_desks(),
        };
        Ok(all.into_iter().step_by(self.stride).take(frames.unwrap_or(usize::MAX)).collect())
    }
}

/// The path of a file, resampled at 30 Hz and placed in the room.
fn fitted(
    file: &Path,
    room: &Room,
    frames: Option<usize>,
    stride: usize,
) -> anyhow::Result<Vec<Pose>> {
    let read = read_trajectory(file)?;
    let (path, repeated) = (file.display(), read.repeated);
    if repeated > 0 {
        let what = "lines repeat the time of the line before; they are left out";
        say(format!("note: {path}: {repeated} {what}"));
    }
    let Resampled { mut poses, gaps_s } =
        resample(&read.poses, frames.map(|n| n.saturating_mul(stride)))?;
    let (room_from_world, clearance) = place(room, &poses)?;
    if !gaps_s.is_empty() {
        let (count, seconds) = (counted(gaps_s.len(), "gap"), gaps_s.iter().sum::<f64>());
        say(format!(
            "note: {path}: {count} without poses, {seconds:.1} s in all; the path is interpolated there"
        ));
    }
    let turn = room_from_world.rotation.euler_angles().2.to_degrees();
    let [x, y, z]: [f64; 3] = room_from_world.translation.vector.into();
    say(format!(
        "note: the path was placed by a turn of {turn:.0} degrees and a shift of ({x:.2}, {y:.2}, {z:.2}) m; it keeps {clearance:.2} m away from everything ({CLEARANCE_M} m are needed)"
    ));
    poses.iter_mut().for_each(|p| p.world_from_camera = room_from_world * p.world_from_camera);
    Ok(poses)
}

/// Refuses causes and `given` effects of the target: a room has none that could be bent or move. Those that
/// the model brings are noted.
pub fn refuse_of_target(physics: &Physics, given: &[Active]) -> anyhow::Result<()> {
    let option = match physics {
        Physics::Speckle { causes } => {
            let of_target = [("bow_m", causes.bow_m), ("motion_mps", causes.motion_mps)];
            of_target.iter().find(|(_, v)| *v != 0.0).map(|(name, _)| format!("--cause {name}"))
        }
        Physics::Formula { effects, .. } => {
            let given = of_target(given).next().map(|id| format!("--effect {id}"));
            if given.is_none() {
                of_target(effects).for_each(|id| {
                    say(format!("note: the model's {id} is left out: a room has no target"));
                });
            }
            given
        }
    };
    match option {
        Some(option) => bail!("{option}: a room has no target; leave it out, or leave --room out"),
        None => Ok(()),
    }
}

/// Ids of the effects that act on a target alone.
fn of_target(effects: &[Active]) -> impl Iterator<Item = &'static str> {
    let act = effects.iter().filter(|a| !a.is_identity()).map(|a| a.effect.card());
    act.filter(|card| card.stage == Stage::Surface).map(|card| card.id)
}
