//! `kinoise simulate OUT --room`: an office filmed along a path.

use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::effects::Active;
use kinoise::simulate::room::{
    CLEARANCE_M, Film, Pose, Resampled, Room, around_the_desks, place, read_trajectory, resample,
};
use kinoise::{Sensor, SigmaModel};
use serde_json::{Value, json};

use super::common::{Bar, Global, MAX_FRAMES, count, say};

#[derive(Debug, Args)]
pub struct RoomArguments {
    /// Film an office with two desks: a TUM-layout sequence with colour, depth and ground truth
    #[arg(long, conflicts_with_all = ["like", "grid", "distances", "tilts", "azimuths", "ordered", "board", "wall_target", "patches", "wall", "clutter", "reference_error", "conditions", "infrared", "physics", "causes"])]
    pub room: bool,
    /// Poses to film along: timestamp tx ty tz qx qy qz qw, z up [default: once around the desks]
    #[arg(long, value_name = "POSES", requires = "room")]
    trajectory: Option<PathBuf>,
    /// Take every Nth frame of the path
    #[arg(long, value_name = "N", default_value_t = 1, requires = "room", value_parser = count(1, MAX_FRAMES))]
    stride: usize,
}

/// What the film shares with the other recordings.
pub struct FilmArguments<'a> {
    pub output: &'a Path,
    pub frames: Option<usize>,
    pub sensor: Sensor,
    pub sigma: SigmaModel,
    pub effects: Vec<Active>,
}

/// Film the office: what programs are told of it, and the recipe.
pub fn film(
    arguments: &RoomArguments,
    film: FilmArguments<'_>,
    global: &Global,
) -> anyhow::Result<(Value, Value)> {
    let room = Room::office(global.seed());
    let all = match &arguments.trajectory {
        Some(file) => fitted(file, &room, film.frames, arguments.stride)?,
        None => around_the_desks(),
    };
    let poses: Vec<Pose> =
        all.into_iter().step_by(arguments.stride).take(film.frames.unwrap_or(usize::MAX)).collect();
    let FilmArguments { output, sensor, sigma, effects, .. } = film;
    let film = Film { sensor, room, poses, sigma, effects, seed: global.seed() };
    let bar = Bar::new("frames");
    film.write(output, &|done, all| bar.step(done, all))?;
    drop(bar);
    let frames = film.poses.len();
    say(format!("wrote {frames} frames of a room to {}", output.display()));
    Ok((json!({"frames": frames, "output": output}), film.recipe()))
}

/// The path of a file, at 30 Hz and in the room.
fn fitted(
    file: &Path,
    room: &Room,
    frames: Option<usize>,
    stride: usize,
) -> anyhow::Result<Vec<Pose>> {
    let read = read_trajectory(file)?;
    if read.repeated > 0 {
        say(format!(
            "note: {}: {} lines repeat the time of the line before; they are left out",
            file.display(),
            read.repeated
        ));
    }
    let Resampled { poses, gaps } =
        resample(&read.poses, frames.map(|n| n.saturating_mul(stride)))?;
    let placed = place(room, &poses)?;
    if !gaps.is_empty() {
        let seconds: f64 = gaps.iter().map(|g| g.seconds()).sum();
        say(format!(
            "note: {}: {} gaps without poses, {seconds:.1} s in all; the path is interpolated there",
            file.display(),
            gaps.len()
        ));
    }
    let motion = placed.room_from_world;
    let (shift, turn) = (motion.translation, motion.rotation.euler_angles().2);
    say(format!(
        "note: path placed by a turn of {:.0} degrees and a shift of ({:.2}, {:.2}, {:.2}) m; never nearer than {:.2} m to anything ({CLEARANCE_M} m are needed)",
        turn.to_degrees(),
        shift.x,
        shift.y,
        shift.z,
        placed.clearance_m
    ));
    Ok(placed.apply(&poses))
}
