use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use clap::{Args, ValueEnum};
use kinoise::effects::Active;
use kinoise::io::{Leaves, OutputFolder, open, settled, write_json};
use kinoise::model::{Direction, Domain, PAPER_EQ1};
use kinoise::simulate::room::{Film, Room};
use kinoise::simulate::speckle::Causes;
use kinoise::simulate::{Physics, Shoot, ViewPlan, kinect_v1, plan_grid, plan_like};
use kinoise::units::{counted, verb};
use kinoise::{Form, NoiseModel, Sensor, SigmaModel};
use serde_json::{Value, json};

use super::common::{Global, Input, MAX_FRAMES, count, model_again};
use super::console::{beside, detail, detail_model, next_step, notes, result, say, working};
use super::output::begin;
use super::simulate_room::{RoomArguments, refuse_of_target};
use super::simulate_scene::{PosesArguments, SceneryArguments, note_idle};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise simulate out/bowl --effect radial-disparity-bias:k_px=0.3 --frames 4 --shrink 2
  kinoise simulate out/twin -m out/kinect/model.json --like recording
  kinoise simulate out/room --room --frames 90
  kinoise simulate out/film --room --physics speckle --cause lens_k1=0.05 --frames 40 --shrink 2")]
pub struct Arguments {
    /// New folder for the recording
    output: PathBuf,
    /// model.json of the sensor [default: the paper's Eq. 1, also outside its 1 to 4 m]
    #[arg(short, long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// How errors come about
    #[arg(long, value_enum, default_value_t = PhysicsArgument::Formula)]
    physics: PhysicsArgument,
    /// With --physics speckle: set a cause, such as ambient_dn=200; repeatable. An unknown name
    /// prints the list
    #[arg(long = "cause", value_name = "NAME=VALUE", allow_hyphen_values = true)]
    causes: Vec<String>,
    /// Add a physical effect (kinoise effects lists them); repeatable
    #[arg(long = "effect", value_name = "ID:KEY=VALUE", value_parser = Active::parse)]
    effects: Vec<Active>,
    /// Simulate the very views of this recording: planes, regions, pixels, frames, timestamps
    #[arg(long, value_name = "REC", conflicts_with_all = ["grid", "distances", "tilts", "azimuths", "frames", "shrink", "board", "wall_target", "patches", "wall", "clutter", "ordered", "conditions"])]
    like: Option<PathBuf>,
    /// Frames of each view [default: 1]; with --room, of the film [default: the whole path]
    #[arg(long, value_name = "N", value_parser = count(1, MAX_FRAMES))]
    frames: Option<usize>,
    /// Make the image 1 to 8 times smaller each way [default: 1, which is 640 x 480]; a model that
    /// carries its own sensor refuses it
    #[arg(long, value_name = "N", value_parser = count(1, 8))]
    shrink: Option<usize>,
    /// Write infrared amplitude images too
    #[arg(long)]
    infrared: bool,
    /// Write what was switched on to this file; the recording itself does not say
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    #[command(flatten, next_help_heading = "Views")]
    poses: PosesArguments,
    #[command(flatten, next_help_heading = "Scene")]
    scenery: SceneryArguments,
    #[command(flatten, next_help_heading = "Room")]
    room: RoomArguments,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum PhysicsArgument {
    /// By formula: sigma(z, theta) of the model, and effects
    Formula,
    /// By light, as in a Kinect v1: pattern, lens, chip and block matching; errors arise by themselves
    Speckle,
}

impl Arguments {
    /// Begins the folder of the new recording.
    fn folder(&self, global: &Global) -> kinoise::Result<OutputFolder> {
        let read = [&self.model, &self.like, &self.room.trajectory].into_iter().flatten();
        let inputs: Vec<&Path> = read.map(PathBuf::as_path).collect();
        begin(&self.output, Leaves::RECORDING, &inputs, global)
    }
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    ensure!(
        arguments.like.is_some() || arguments.input == Input::default(),
        "--intrinsics and the like tell how to read a recording; give it with --like"
    );
    arguments.room.refuse_without_room()?;
    if let Some(path) = &arguments.recipe {
        check_recipe(path, &arguments.output)?;
    }
    let (model, given) = (arguments.model.as_deref(), &arguments.effects);
    let (sensor, sigma, mut effects) = sensor_and_noise(model, arguments.shrink, given)?;
    effects.extend(given.iter().cloned());
    Active::refuse_twice(&effects)?;
    let physics = physics(arguments, sigma, effects)?;
    let (made, recipe) = if arguments.room.room {
        // The default is the camera that TUM readers assume.
        let tum = || Film::kinect(arguments.shrink.unwrap_or(1));
        let sensor = sensor.unwrap_or_else(tum);
        let room = Room::office(global.seed());
        let poses = arguments.room.path(&room, arguments.frames)?;
        refuse_of_target(&physics, given)?;
        let film = Film { sensor, room, poses, physics, seed: global.seed() };
        write_film(&film, arguments.folder(global)?)?
    } else {
        let kinect = || kinect_v1(arguments.shrink.unwrap_or(1));
        shoot(arguments, sensor.unwrap_or_else(kinect), physics, global)?
    };
    if let Some(path) = &arguments.recipe {
        write_json(path, &recipe, "report this as a bug")?;
    }
    global.print_json(&made)?;
    next_step(&next(arguments));
    Ok(())
}

/// The command to run next on the simulated recording.
fn next(arguments: &Arguments) -> Vec<OsString> {
    let output = &arguments.output;
    let (command, suffix) = match (&arguments.like, arguments.room.room) {
        (Some(real), _) => {
            let to = beside(output, "diagnosis");
            let against = vec!["--against".into(), output.into(), "-o".into(), to.into()];
            let input = arguments.input.again();
            return [vec!["diagnose".into(), real.into()], against, input].concat();
        }
        (None, true) => ("map", "map"),
        (None, false) => ("calibrate", "noise"),
    };
    let to = beside(output, suffix);
    let model = arguments.model.as_deref().filter(|_| arguments.room.room);
    [vec![command.into(), output.into(), "-o".into(), to.into()], model_again(model)].concat()
}

/// Films the office; returns the JSON result and the recipe.
fn write_film(film: &Film, folder: OutputFolder) -> anyhow::Result<(Value, Value)> {
    let blind = working("filming", |step| film.write(folder.path(), step))?;
    let (output, frames) = (folder.place().to_path_buf(), film.poses.len());
    ensure!(
        blind < frames,
        "{}: no frame shows any depth; change what the sensor or its light is",
        output.display()
    );
    folder.finish()?;
    result(format!("wrote {} of a room to {}", counted(frames, "frame"), output.display()));
    Ok((json!({"frames": frames, "output": output}), film.recipe()))
}

/// Shoots the views of a plane; returns the JSON result and the recipe.
fn shoot(
    arguments: &Arguments,
    sensor: Sensor,
    physics: Physics,
    global: &Global,
) -> anyhow::Result<(Value, Value)> {
    let (views, recorded_by) = plans(arguments, global)?;
    if let (Some(path), Some(recorded_by)) = (&arguments.model, &recorded_by) {
        let model = NoiseModel::read(path)?;
        model.refuse_other_size(recorded_by).map_err(|e| e.of(path))?;
    }
    let sensor = recorded_by.unwrap_or(sensor);
    if let Physics::Formula { sigma, effects } = &physics {
        note_clamped(&views, sigma);
        let frames = views.iter().map(|v| v.stamps.len()).max().unwrap_or(0);
        note_idle(effects, &arguments.scenery, arguments.like.is_some(), frames);
    }
    detail(format!("effects and physics: {physics:?}"));
    let shoot = Shoot { sensor, views, physics, infrared: arguments.infrared, seed: global.seed() };
    let folder = arguments.folder(global)?;
    let blind = working("filming", |step| shoot.write(folder.path(), step))?;
    const UNSEEN: &str = "the target is out of the picture or beyond the depth code";
    let (output, views) = (arguments.output.display(), shoot.views.len());
    ensure!(
        blind.len() < views,
        "{output}: no view shows any depth: {UNSEEN}; change --distances, --azimuths or --board"
    );
    folder.finish()?;
    notes(blind.iter().map(|name| format!("view {name} shows no depth: {UNSEEN}")));
    let frames: usize = shoot.views.iter().map(|v| v.stamps.len()).sum();
    let [taken, each] = [counted(views, "view"), counted(frames, "frame")];
    result(format!("wrote {taken}, {each}, to {output}"));
    let made = json!({"views": views, "frames": frames, "output": arguments.output});
    Ok((made, shoot.recipe()))
}

/// The views, and the sensor of the recording to shoot again, if any.
fn plans(
    arguments: &Arguments,
    global: &Global,
) -> anyhow::Result<(Vec<ViewPlan>, Option<Sensor>)> {
    let seed = global.seed();
    let scenery = arguments.scenery.scenery();
    let Some(like) = &arguments.like else {
        let (frames, shuffled) = (arguments.frames.unwrap_or(1), !arguments.poses.ordered);
        let plans = plan_grid(&arguments.poses.views()?, &scenery, frames, shuffled, seed);
        return Ok((plans, None));
    };
    let recording = open(like, &arguments.input.assumed()?)?;
    let (plans, excluded) = plan_like(&recording, scenery.reference_error_m.unwrap_or(0.0), seed);
    notes(&excluded);
    let referenced = recording.views.iter().any(|v| v.notes.reference_distance_m.is_some());
    if scenery.reference_error_m.is_some() && !referenced {
        let what = "no view has a reference_distance_m to write again";
        say(format!("note: --reference-error has no effect: in {} {what}", like.display()));
    }
    ensure!(!plans.is_empty(), "{}: no view shows a plane; see the notes", like.display());
    Ok((plans, Some(recording.sensor)))
}

/// Formula or speckle; each refuses the options of the other.
fn physics(
    arguments: &Arguments,
    sigma: SigmaModel,
    effects: Vec<Active>,
) -> anyhow::Result<Physics> {
    if arguments.physics == PhysicsArgument::Formula {
        let foreign = "--cause belongs to --physics speckle; with --physics formula give --effect";
        ensure!(arguments.causes.is_empty(), foreign);
        return Ok(Physics::Formula { sigma, effects });
    }
    let foreign = "--effect belongs to --physics formula; with --physics speckle give --cause";
    ensure!(arguments.effects.is_empty(), foreign);
    let brought =
        "--model: its effects are formulas, which --physics speckle cannot use; give --cause";
    ensure!(effects.is_empty(), brought);
    if arguments.model.is_some() {
        say(
            "note: only the sensor of the model is used; with --physics speckle the noise arises by itself",
        );
    }
    let causes = arguments.causes.iter().try_fold(Causes::default(), |c, text| c.parse(text))?;
    Ok(Physics::Speckle { causes })
}

/// The model's own sensor, where it has one, its sigma, or Eq. 1, and its effects. Refuses effects `given`
/// beside a model that has a shape of them already: they would count twice.
fn sensor_and_noise(
    model: Option<&Path>,
    shrink: Option<usize>,
    given: &[Active],
) -> anyhow::Result<(Option<Sensor>, SigmaModel, Vec<Active>)> {
    let Some(path) = model else {
        return Ok((None, eq1_everywhere(), Vec::new()));
    };
    let model = NoiseModel::read(path)?;
    detail_model(&model, Some(path));
    let file = path.display();
    let sensor = match model.sensor {
        Some(_) if shrink.is_some() => {
            bail!("--shrink: {file} brings its own sensor; leave --shrink out")
        }
        Some(own) => Some(own.sensor().map_err(|e| anyhow::anyhow!("{file}: sensor: {e}"))?),
        None => None,
    };
    if model.sigma.direction == Direction::Perpendicular {
        let across = "describes distances across the plane; depth noise is 1/cos(tilt) times them";
        say(format!("note: {file} {across}"));
    }
    let effects = Active::all_of_model(&model.effects)?;
    let shaped = |id: &str| model.effects.iter().any(|e| e.id == id && !e.shape.is_empty());
    if let Some(id) = given.iter().map(|a| a.effect.card().id).find(|id| shaped(id)) {
        let remedy = "take it out of the model, or leave --effect out";
        bail!("--effect {id}: the model brings its shape; {remedy}");
    }
    Ok((sensor, model.sigma, effects))
}

/// Eq. 1 wherever a board of this size reaches, short of its pole.
fn eq1_everywhere() -> SigmaModel {
    let domain = Domain { z_m: [0.2, 10.0], theta_rad: [0.0, PAPER_EQ1[5] - 0.02] };
    SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
}

/// Notes the number of views outside the range in which the model was fitted.
fn note_clamped(views: &[ViewPlan], sigma: &SigmaModel) {
    let outside = |v: &&ViewPlan| {
        let plane = &v.bench.plane;
        // No recording has a tilt of exactly zero; facing the target counts as inside.
        let theta = plane.theta().max(sigma.domain.theta_rad[0]);
        !sigma.domain.contains(plane.depth(0.0, 0.0), theta)
    };
    let (count, all) = (views.iter().filter(outside).count(), views.len());
    let ([near, far], tilt) = (sigma.domain.z_m, sigma.domain.theta_rad[1].to_degrees());
    if count > 0 {
        say(format!(
            "note: {count} of {all} views {} outside the model's range (z {near:.2} to {far:.2} m, tilt up to {tilt:.1} degrees); sigma is held at its edge there",
            verb(count, "lies", "lie")
        ));
    }
}

/// Checks that the recipe is a new file outside the recording, before hours of shooting rather than after.
fn check_recipe(path: &Path, output: &Path) -> anyhow::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let fault = if path.exists() {
        "the file exists; name a new one"
    } else if settled(path)?.starts_with(settled(output)?) {
        "inside the recording it would give the answer away; put it elsewhere"
    } else if folder.is_some_and(|f| !f.is_dir()) {
        "its folder does not exist; make it first"
    } else {
        return Ok(());
    };
    bail!("--recipe {}: {fault}", path.display())
}
