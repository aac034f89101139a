use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open, write_atomic};
use kinoise::model::{Direction, Domain, PAPER_EQ1};
use kinoise::scene::{Board, PATCH_SIDE_M, Print, Target, WHITE};
use kinoise::simulate::room::Film;
use kinoise::simulate::speckle::Causes;
use kinoise::simulate::{
    Grid, GridView, Physics, Scenery, Shoot, ViewPlan, kinect_v1, plan_grid, plan_like,
};
use kinoise::units::shortest;
use kinoise::{Form, NoiseModel, Sensor, SigmaModel};

use super::common::{Bar, Global, numbers, say};
use super::simulate_room::{self, FilmArguments, RoomArguments};

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
    poses: Poses,
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

#[derive(Debug, Args)]
struct Poses {
    /// The poses
    #[arg(long, value_enum, default_value_t = GridArgument::Paper)]
    grid: GridArgument,
    /// Own distances in m, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "M,M,..", allow_hyphen_values = true)]
    distances: Vec<f64>,
    /// Own tilts in degrees, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "DEG,..", allow_hyphen_values = true)]
    tilts: Vec<f64>,
    /// Own directions of tilt in degrees, 0 along the columns; every pose in each of them
    #[arg(long, value_delimiter = ',', value_name = "DEG,..", allow_hyphen_values = true)]
    azimuths: Vec<f64>,
    /// Take the views in the grid's order, not in random order
    #[arg(long)]
    ordered: bool,
}

#[derive(Debug, Args)]
struct SceneryArguments {
    /// Board width and height in m
    #[arg(long, value_parser = numbers::<2>, default_value = "1,0.8", value_name = "W,H", allow_hyphen_values = true)]
    board: [f64; 2],
    /// The target is a wall that fills the picture
    #[arg(long, conflicts_with = "board")]
    wall_target: bool,
    /// Print grey squares on the target
    #[arg(long)]
    patches: bool,
    /// A wall this far behind the target, m
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    wall: Option<f64>,
    /// Boxes in the way, beside the target's middle
    #[arg(long, default_value_t = 0, value_name = "N")]
    clutter: usize,
    /// Write reference distances with this standard deviation, m
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    reference_error: Option<f64>,
    /// Write the temperature of the room into every view
    #[arg(long)]
    conditions: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum PhysicsArgument {
    /// sigma(z, theta) of the model, and effects
    Formula,
    /// A Kinect v1 by light: pattern, lens, chip, block matching
    Speckle,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum GridArgument {
    /// 1 to 4 m by 0.5 m, 0 to 70 degrees by 10, and 76 for 80: Eq. 1 has its pole at 79.6
    Paper,
}

fn effect(text: &str) -> Result<Active, String> {
    Active::parse(text).map_err(|e| e.to_string())
}

/// Eq. 1 everywhere a board of this size reaches, short of its pole.
fn eq1_at_its_word() -> SigmaModel {
    let domain = Domain { z_m: [0.2, 10.0], theta_rad: [0.0, PAPER_EQ1[5] - 0.02] };
    SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
}

impl Poses {
    fn views(&self) -> anyhow::Result<Vec<GridView>> {
        let GridArgument::Paper = self.grid;
        let mut grid = Grid::paper();
        if !self.distances.is_empty() {
            grid.distances_m = self.distances.clone();
        }
        if !self.tilts.is_empty() {
            grid.tilts_rad = self.tilts.iter().map(|t| t.to_radians()).collect();
        }
        if grid.distances_m.iter().any(|z| !(0.1..=20.0).contains(z)) {
            bail!("--distances: a distance lies between 0.1 and 20 m");
        }
        if grid.tilts_rad.iter().any(|t| !(0.0..1.55).contains(t)) {
            bail!("--tilts: a tilt lies between 0 and 88 degrees");
        }
        if self.azimuths.iter().any(|a| !a.is_finite()) {
            bail!("--azimuths: a direction is a number of degrees");
        }
        let azimuths: Vec<f64> = self.azimuths.iter().map(|a| a.to_radians()).collect();
        Ok(if azimuths.is_empty() { grid.views() } else { grid.views_towards(&azimuths) })
    }
}

impl SceneryArguments {
    fn scenery(&self) -> anyhow::Result<Scenery> {
        let [width_m, height_m] = self.board;
        if !(width_m > 0.0 && height_m > 0.0) {
            bail!(
                "--board {},{}: give a width and a height in m",
                shortest(width_m),
                shortest(height_m)
            );
        }
        let positive = |name: &str, value: Option<f64>| match value {
            Some(v) if !(v.is_finite() && v >= 0.0) => bail!("{name} {v}: give a length in m"),
            _ => Ok(()),
        };
        positive("--wall", self.wall)?;
        positive("--reference-error", self.reference_error)?;
        if self.reference_error.is_some_and(|e| e > LARGEST_REFERENCE_ERROR_M) {
            bail!("--reference-error: more than {LARGEST_REFERENCE_ERROR_M} m is no measurement");
        }
        if self.clutter > MOST_CLUTTER {
            bail!("--clutter {}: give at most {MOST_CLUTTER}", self.clutter);
        }
        Ok(Scenery {
            target: if self.wall_target {
                Target::Wall
            } else {
                Target::Board(Board { width_m, height_m })
            },
            print: if self.patches { Print::Patches(PATCH_SIDE_M) } else { Print::Plain(WHITE) },
            wall_gap_m: self.wall,
            clutter: self.clutter,
            reference_error_m: self.reference_error,
            conditions: self.conditions,
        })
    }
}

/// What shoots: the model's own sensor and effects, or a Kinect and Eq. 1.
fn camera(arguments: &Arguments) -> anyhow::Result<(Sensor, SigmaModel, Vec<Active>)> {
    let shrink = arguments.shrink.unwrap_or(1);
    if !(1..=8).contains(&shrink) {
        bail!("--shrink {shrink}: give a whole number from 1 to 8");
    }
    let Some(path) = &arguments.model else {
        return Ok((kinect_v1(shrink), eq1_at_its_word(), Vec::new()));
    };
    let model = NoiseModel::read(path)?;
    let sensor = match model.sensor {
        Some(_) if arguments.shrink.is_some() => {
            bail!("--shrink: {} brings its own sensor; leave --shrink out", path.display())
        }
        Some(file) => {
            file.sensor().map_err(|e| anyhow::anyhow!("{}: sensor: {e}", path.display()))?
        }
        None => kinect_v1(shrink),
    };
    if model.sigma.direction == Direction::Perpendicular {
        say(format!(
            "note: {} describes distances across the plane; depth noise is 1/cos(tilt) times them",
            path.display()
        ));
    }
    let effects =
        Active::all_of_model(&model.effects).with_context(|| path.display().to_string())?;
    let shaped = model.effects.iter().filter(|e| !e.shape.is_empty());
    refuse_over_shape(shaped.map(|e| e.id.as_str()), &arguments.effects)?;
    Ok((sensor, model.sigma, effects))
}

/// An effect on top of the shape that was fitted for it would count twice.
fn refuse_over_shape<'a>(
    shaped: impl Iterator<Item = &'a str>,
    given: &[Active],
) -> anyhow::Result<()> {
    let ids: Vec<&str> = shaped.collect();
    match given.iter().map(|a| a.effect.card().id).find(|id| ids.contains(id)) {
        None => Ok(()),
        Some(id) => {
            bail!(
                "--effect {id}: the model brings its shape; take it out of the model, or leave --effect out"
            )
        }
    }
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
const MOST_FRAMES: usize = 108_000;
/// More boxes than this leave no target to see.
const MOST_CLUTTER: usize = 100;
/// A reference off by more than this is none, m.
const LARGEST_REFERENCE_ERROR_M: f64 = 1.0;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    if let Some(n) = arguments.frames.filter(|n| !(1..=MOST_FRAMES).contains(n)) {
        bail!("--frames {n}: give a number from 1 to {MOST_FRAMES}");
    }
    if let Some(path) = &arguments.recipe {
        check_recipe(path, &arguments.output)?;
    }
    let (sensor, sigma, mut effects) = camera(arguments)?;
    effects.extend(arguments.effects.iter().cloned());
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
        tell_of_idle(effects, arguments);
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
    for name in &blind {
        say(format!(
            "note: view {name} shows no depth: the target is out of the picture or beyond the depth code"
        ));
    }
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

/// Effects that have nothing to act on in this scene.
fn tell_of_idle(effects: &[Active], arguments: &Arguments) {
    for active in effects {
        let missing = match active.effect.card().id {
            "occlusion-shadow" | "edge-mixing" if arguments.scenery.wall.is_none() => {
                "something behind the target (--wall)"
            }
            "intensity-dependent-noise" if !arguments.scenery.patches => {
                "a target of several greys (--patches)"
            }
            _ => continue,
        };
        say(format!("note: {} needs {missing} to show much", active.effect.card().id));
    }
}

/// A recipe is a file of its own: before hours of shooting, not after.
fn check_recipe(path: &Path, output: &Path) -> anyhow::Result<()> {
    if path.exists() {
        bail!("--recipe {}: the file exists; name a new one", path.display());
    }
    if path.starts_with(output) {
        bail!("--recipe {}: inside the recording it would tell; put it elsewhere", path.display());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if folder.is_some_and(|f| !f.is_dir()) {
        bail!("--recipe {}: its folder does not exist; make it first", path.display());
    }
    Ok(())
}

fn tell_of_clamped(views: &[ViewPlan], sigma: &SigmaModel) {
    let outside = |v: &&ViewPlan| {
        let plane = &v.bench.plane;
        // No recording has a tilt of exactly zero; facing the target is inside all the same.
        let theta = plane.theta().max(sigma.domain.theta_rad[0]);
        !sigma.domain.contains(plane.depth(0.0, 0.0), theta)
    };
    let count = views.iter().filter(outside).count();
    if count > 0 {
        let d = sigma.domain;
        say(format!(
            "note: {count} of {} views lie outside the model's range (z {:.2} to {:.2} m, tilt up to {:.1} degrees); sigma is clamped to its edge there",
            views.len(),
            d.z_m[0],
            d.z_m[1],
            d.theta_rad[1].to_degrees()
        ));
    }
}

pub(super) fn write_recipe(path: &Path, recipe: &serde_json::Value) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(recipe)?;
    text.push('\n');
    Ok(write_atomic(path, text.as_bytes())?)
}
