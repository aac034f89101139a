use std::path::PathBuf;

use clap::{Args, ValueEnum};
use kinoise::model::{Direction, Domain, PAPER_EQ1};
use kinoise::simulate::{Board, Grid, Shoot, kinect_v1};
use kinoise::units::shortest;
use kinoise::{Form, NoiseModel, SigmaModel};

use super::common::{Bar, Global, numbers, say};

#[derive(Debug, Args)]
pub struct Arguments {
    /// New folder for the recording
    output: PathBuf,
    /// model.json to shoot with [default: the paper's Eq. 1, taken at its word outside 1 to 4 m too]
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The poses
    #[arg(long, value_enum, default_value_t = GridArgument::Paper)]
    grid: GridArgument,
    /// Frames a view
    #[arg(long, default_value_t = 1)]
    frames: usize,
    /// Make the image 1 to 8 times smaller each way [default: 1, which is 640 x 480]; not with a
    /// model that carries its own sensor
    #[arg(long, value_name = "N")]
    shrink: Option<usize>,
    /// Board width and height in m
    #[arg(long, value_parser = numbers::<2>, default_value = "1,0.8", value_name = "W,H")]
    board: [f64; 2],
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum GridArgument {
    /// 1 to 4 m by 0.5 m, 0 to 70 degrees by 10, and 76
    Paper,
}

/// Eq. 1 everywhere a board of this size reaches, short of its pole.
fn eq1_at_its_word() -> SigmaModel {
    let domain = Domain { z_m: [0.2, 10.0], theta_rad: [0.0, PAPER_EQ1[5] - 0.02] };
    SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let shrink = arguments.shrink.unwrap_or(1);
    if arguments.frames == 0 {
        anyhow::bail!("--frames 0: give at least 1");
    }
    // At 8 a board of 1 m, seen from 4 m, is still 18 px wide; smaller ones are all rim.
    if !(1..=8).contains(&shrink) {
        anyhow::bail!("--shrink {shrink}: give a whole number from 1 to 8");
    }
    let [width_m, height_m] = arguments.board;
    if !(width_m > 0.0 && height_m > 0.0) {
        anyhow::bail!(
            "--board {},{}: give a width and a height in m",
            shortest(width_m),
            shortest(height_m)
        );
    }
    let (sigma, sensor) = match &arguments.model {
        Some(path) => {
            let model = NoiseModel::read(path)?;
            let sensor = match model.sensor {
                Some(_) if arguments.shrink.is_some() => anyhow::bail!(
                    "--shrink: {} carries its own sensor, whose size it has; leave --shrink out",
                    path.display()
                ),
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
            (model.sigma, sensor)
        }
        None => (eq1_at_its_word(), kinect_v1(shrink)),
    };
    let GridArgument::Paper = arguments.grid;
    let shoot = Shoot {
        sensor,
        board: Board { width_m, height_m },
        grid: Grid::paper(),
        frames: arguments.frames,
        sigma,
        seed: global.seed(),
    };
    if shoot.grid.views().iter().any(|v| !shoot.sigma.domain.contains(v.z_m, v.theta_rad)) {
        let d = shoot.sigma.domain;
        say(format!(
            "note: some views lie outside the model's range (z {:.2} to {:.2} m, tilt up to {:.1} degrees); sigma is clamped to its edge there",
            d.z_m[0],
            d.z_m[1],
            d.theta_rad[1].to_degrees()
        ));
    }
    let bar = Bar::new("views");
    let views = shoot.write(&arguments.output, &|done, all| bar.step(done, all))?;
    drop(bar);
    say(format!(
        "wrote {views} views of {} frame(s) to {}",
        arguments.frames,
        arguments.output.display()
    ));
    global.print_json(&serde_json::json!({"views": views, "frames": arguments.frames, "output": arguments.output}))
}
