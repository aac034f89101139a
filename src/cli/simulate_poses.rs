//! The poses that `kinoise simulate` shoots from, of a grid.

use anyhow::bail;
use clap::{Args, ValueEnum};
use kinoise::simulate::{Grid, GridView};

#[derive(Debug, Args)]
pub struct PosesArguments {
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
    pub ordered: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum GridArgument {
    /// 1 to 4 m by 0.5 m, 0 to 70 degrees by 10, and 76 for 80: Eq. 1 has its pole at 79.6
    Paper,
}

impl PosesArguments {
    pub fn views(&self) -> anyhow::Result<Vec<GridView>> {
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
