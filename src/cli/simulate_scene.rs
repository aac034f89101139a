//! Poses and scene options of `kinoise simulate`.

use anyhow::ensure;
use clap::Args;
use kinoise::effects::Active;
use kinoise::scene::{Board, PATCH_SIDE_M, Print, Target, WHITE};
use kinoise::simulate::{Grid, GridView, Scenery};

use super::common::{between, count, numbers, one_of};
use super::console::say;

#[derive(Debug, Args)]
pub struct PosesArguments {
    /// The poses to take
    #[arg(long, default_value = "paper", value_parser = one_of([(
        "paper",
        "1 to 4 m by 0.5 m, 0 to 70 degrees by 10, and 76 for 80: Eq. 1 has its pole at 79.6",
        Grid::paper as fn() -> Grid,
    )]))]
    grid: fn() -> Grid,
    /// Distances in m, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "M,M,..", allow_hyphen_values = true, value_parser = between(0.1, 20.0, "m"))]
    distances: Vec<f64>,
    /// Tilts in degrees, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "DEG,..", allow_hyphen_values = true, value_parser = between(0.0, 88.8, "degrees"))]
    tilts: Vec<f64>,
    /// Directions of tilt in degrees, 0 along the columns; every pose is taken in each of them
    #[arg(long, value_delimiter = ',', value_name = "DEG,..", allow_hyphen_values = true, value_parser = between(-360.0, 360.0, "degrees"))]
    azimuths: Vec<f64>,
    /// Take the views in the grid's order, not in random order
    #[arg(long)]
    pub ordered: bool,
}

/// A day of one view every ten seconds.
const MAX_VIEWS: usize = 8640;

impl PosesArguments {
    pub fn views(&self) -> anyhow::Result<Vec<GridView>> {
        let mut grid = (self.grid)();
        if !self.distances.is_empty() {
            grid.distances_m = self.distances.clone();
        }
        if !self.tilts.is_empty() {
            grid.tilts_rad = self.tilts.iter().map(|t| t.to_radians()).collect();
        }
        let views = grid.distances_m.len() * grid.tilts_rad.len() * self.azimuths.len().max(1);
        ensure!(
            views <= MAX_VIEWS,
            "{views} views: give distances, tilts and azimuths for {MAX_VIEWS} or fewer"
        );
        if self.azimuths.is_empty() {
            return Ok(grid.views());
        }
        let azimuths: Vec<f64> = self.azimuths.iter().map(|a| a.to_radians()).collect();
        Ok(grid.views_towards(&azimuths))
    }
}

#[derive(Debug, Args)]
pub struct SceneryArguments {
    /// Board width and height in m
    #[arg(long, value_parser = numbers::<2>(0.01, 100.0, "m"), default_value = "1,0.8", value_name = "W,H", allow_hyphen_values = true)]
    board: [f64; 2],
    /// Make the target a wall that fills the picture
    #[arg(long, conflicts_with = "board")]
    wall_target: bool,
    /// Print grey squares on the target
    #[arg(long)]
    pub patches: bool,
    /// Put a wall this far behind the target, m
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = between(0.0, 1e3, "m"))]
    pub wall: Option<f64>,
    /// Number of boxes in the way, beside the target's middle
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = count(0, MAX_CLUTTER))]
    clutter: usize,
    /// Write reference distances with this standard deviation, m
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = between(0.0, 1.0, "m"))]
    reference_error: Option<f64>,
    /// Write the room's temperature and light into every view
    #[arg(long)]
    conditions: bool,
}

/// More boxes than this leave no target to see.
const MAX_CLUTTER: usize = 100;

impl SceneryArguments {
    pub fn scenery(&self) -> Scenery {
        let [width_m, height_m] = self.board;
        let board = Target::Board(Board { width_m, height_m });
        Scenery {
            target: if self.wall_target { Target::Wall } else { board },
            print: if self.patches { Print::Patches(PATCH_SIDE_M) } else { Print::Plain(WHITE) },
            wall_gap_m: self.wall,
            clutter: self.clutter,
            reference_error_m: self.reference_error,
            conditions: self.conditions,
        }
    }
}

/// Notes effects that have nothing to act on in this scene.
pub fn note_idle(effects: &[Active], scenery: &SceneryArguments, like: bool, frames: usize) {
    for active in effects {
        let (id, bare) = (active.effect.card().id, scenery.wall.is_none());
        let (missing, option) = match id {
            "occlusion-shadow" | "edge-mixing" if bare => ("something behind the target", "--wall"),
            "intensity-dependent-noise" if !scenery.patches => {
                ("a target of several greys", "--patches")
            }
            "target-motion" | "temporal-correlation" | "frame-jitter" if frames < 2 => {
                ("several frames a view", "--frames")
            }
            _ => continue,
        };
        let how = if like { "views taken --like others have none" } else { option };
        say(format!("note: {id} needs {missing} to show much ({how})"));
    }
}
