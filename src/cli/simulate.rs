use std::path::PathBuf;

use anyhow::bail;
use clap::{Args, ValueEnum};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open};
use kinoise::simulate::room::Film;
use kinoise::simulate::speckle::Causes;
use kinoise::simulate::{Physics, Shoot, ViewPlan, plan_grid, plan_like};
use kinoise::{Sensor, SigmaModel};

use super::common::{Bar, Global, say};
use super::simulate_poses::PosesArguments;
use super::simulate_recipe::{check_recipe, write_recipe};
use super::simulate_room::{self, FilmArguments, RoomArguments};
use super::simulate_scenery::SceneryArguments;
use super::simulate_sensor::sensor_and_noise;
use super::simulate_words::{tell_of_blind, tell_of_clamped, tell_of_idle};

#[derive(Debug, Args)]
pub struct Arguments {
    /// New folder for the recording
    output: PathBuf,
    /// model.json to shoot with [default: the paper's Eq. 1, taken at its word outside 1 to 4 m too]
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The world: errors by formula, or dots seen and matched in which errors arise by themselves
    #[arg(long, value_enum, default_value_t = PhysicsArgument::Formula)]
    physics: PhysicsArgument,
    /// With --physics speckle: set a cause, such as ambient_dn=200; repeatable. An unknown name is answered with the list
    #[arg(long = "cause", value_name = "NAME=VALUE", allow_hyphen_values = true)]
    causes: Vec<String>,
    /// Add a physical effect (see kinoise effects); repeatable
    #[arg(long = "effect", value_name = "ID:KEY=VALUE", value_parser = effect)]
    effects: Vec<Active>,
    /// Shoot the very views of this recording: planes, regions, pixels, frames, timestamps
    #[arg(long, value_name = "REC", conflicts_with_all = ["grid", "distances", "tilts", "azimuths", "frames", "shrink", "board", "wall_target", "patches", "wall", "clutter", "ordered", "conditions"])]
    like: Option<PathBuf>,
    #[command(flatten)]
    poses: PosesArguments,
    /// Frames a view [default: 1]; with --room, of the film [default: the whole path]
    #[arg(long)]
    frames: Option<usize>,
    #[command(flatten)]
    room: RoomArguments,
    /// Make the image 1 to 8 times smaller each way [default: 1, which is 640 x 480]; not with a
    /// model that carries its own sensor
    #[arg(long, value_name = "N")]
    shrink: Option<usize>,
    #[command(flatten)]
    scenery: SceneryArguments,
    /// Write infrared amplitude images too
    #[arg(long)]
    infrared: bool,
    /// Write what was switched on to this file; the recording itself never tells
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum PhysicsArgument {
    /// sigma(z, theta) of the model, and effects
    Formula,
    /// A Kinect v1 by light: pattern, lens, chip, block matching
    Speckle,
}

fn effect(text: &str) -> Result<Active, String> {
    Active::parse(text).map_err(|e| e.to_string())
}

/// The views, and the sensor of the recording that is shot again.
fn plans(
    arguments: &Arguments,
    global: &Global,
) -> anyhow::Result<(Vec<ViewPlan>, Option<Sensor>)> {
    let seed = global.seed();
    let scenery = arguments.scenery.scenery()?;
    let Some(like) = &arguments.like else {
        let poses = arguments.poses.views()?;
        let shuffled = !arguments.poses.ordered;
        return Ok((
            plan_grid(&poses, &scenery, arguments.frames.unwrap_or(1), shuffled, seed),
            None,
        ));
    };
    let recording = open(like, &Assumed::default())?;
    let (plans, excluded) = plan_like(&recording, scenery.reference_error_m.unwrap_or(0.0), seed);
    for view in &excluded {
        say(format!("note: {view}"));
    }
    if plans.is_empty() {
        bail!("{}: no view shows a plane; see the notes", like.display());
    }
    Ok((plans, Some(recording.sensor)))
}

/// An hour at 30 Hz.
const MAX_FRAMES: usize = 108_000;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    if let Some(n) = arguments.frames.filter(|n| !(1..=MAX_FRAMES).contains(n)) {
        bail!("--frames {n}: give a number from 1 to {MAX_FRAMES}");
    }
    if let Some(path) = &arguments.recipe {
        check_recipe(path, &arguments.output)?;
    }
    let (model, given) = (arguments.model.as_deref(), &arguments.effects);
    let (sensor, sigma, mut effects) = sensor_and_noise(model, arguments.shrink, given)?;
    effects.extend(given.iter().cloned());
    Active::refuse_twice(&effects)?;
    if arguments.room.room {
        let shot = FilmArguments {
            output: &arguments.output,
            frames: arguments.frames,
            recipe: arguments.recipe.as_deref(),
            // A model brings its own sensor; without one it is what TUM readers assume.
            sensor: if arguments.model.is_some() {
                sensor
            } else {
                Film::kinect(arguments.shrink.unwrap_or(1))
            },
            sigma,
            effects,
        };
        return simulate_room::run(&arguments.room, shot, global);
    }
    let (views, recorded_by) = plans(arguments, global)?;
    let sensor = recorded_by.unwrap_or(sensor);
    let physics = physics(arguments, sigma, effects)?;
    if let Physics::Formula { sigma, effects } = &physics {
        tell_of_clamped(&views, sigma);
        tell_of_idle(effects, &arguments.scenery);
    }
    let shoot = Shoot { sensor, views, physics, infrared: arguments.infrared, seed: global.seed() };
    let bar = Bar::new("views");
    let blind = shoot.write(&arguments.output, &|done, all| bar.step(done, all))?;
    drop(bar);
    if blind.len() == shoot.views.len() {
        bail!(
            "{}: no view shows any depth: the target is out of the picture or beyond the depth code; change --distances, --azimuths or --board",
            arguments.output.display()
        );
    }
    tell_of_blind(&blind);
    if let Some(path) = &arguments.recipe {
        write_recipe(path, &shoot.recipe())?;
    }
    let frames: usize = shoot.views.iter().map(|v| v.stamps.len()).sum();
    say(format!(
        "wrote {} views, {frames} frames, to {}",
        shoot.views.len(),
        arguments.output.display()
    ));
    global.print_json(&serde_json::json!({"views": shoot.views.len(), "frames": frames, "output": arguments.output}))
}

/// Which world; each refuses what only the other knows.
fn physics(
    arguments: &Arguments,
    sigma: SigmaModel,
    effects: Vec<Active>,
) -> anyhow::Result<Physics> {
    if arguments.physics == PhysicsArgument::Formula {
        if !arguments.causes.is_empty() {
            bail!("--cause belongs to --physics speckle; by formula there is --effect");
        }
        return Ok(Physics::Formula { sigma, effects });
    }
    if !arguments.effects.is_empty() {
        bail!("--effect belongs to --physics formula; by light there is --cause");
    }
    if !effects.is_empty() {
        bail!("--model: it brings effects, which are formulas; by light there is --cause");
    }
    if arguments.model.is_some() {
        say("note: of the model only the sensor is used: by light sigma comes by itself");
    }
    let causes = arguments.causes.iter().try_fold(Causes::default(), |c, text| c.parse(text))?;
    Ok(Physics::Speckle { causes })
}
