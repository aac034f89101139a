//! What stands before the camera of `kinoise simulate`, beside the poses.

use anyhow::bail;
use clap::Args;
use kinoise::scene::{Board, PATCH_SIDE_M, Print, Target, WHITE};
use kinoise::simulate::Scenery;
use kinoise::units::shortest;

use super::common::numbers;

#[derive(Debug, Args)]
pub struct SceneryArguments {
    /// Board width and height in m
    #[arg(long, value_parser = numbers::<2>, default_value = "1,0.8", value_name = "W,H", allow_hyphen_values = true)]
    board: [f64; 2],
    /// The target is a wall that fills the picture
    #[arg(long, conflicts_with = "board")]
    wall_target: bool,
    /// Print grey squares on the target
    #[arg(long)]
    pub patches: bool,
    /// A wall this far behind the target, m
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub wall: Option<f64>,
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

/// More boxes than this leave no target to see.
const MAX_CLUTTER: usize = 100;
/// A reference off by more than this is none, m.
const LARGEST_REFERENCE_ERROR_M: f64 = 1.0;

impl SceneryArguments {
    pub fn scenery(&self) -> anyhow::Result<Scenery> {
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
        if self.clutter > MAX_CLUTTER {
            bail!("--clutter {}: give at most {MAX_CLUTTER}", self.clutter);
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
