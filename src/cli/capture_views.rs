//! Which views a capture is to take.

use std::path::PathBuf;

use anyhow::bail;
use clap::{Args, ValueEnum};
use kinoise::capture::Wanted;

#[derive(Debug, Args)]
pub struct Views {
    /// Which views are wanted
    #[arg(long, value_enum, default_value_t = ViewsArgument::Paper)]
    views: ViewsArgument,
    /// Own distances in m, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "M,M,..")]
    distances: Vec<f64>,
    /// Own tilts in degrees, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "DEG,..")]
    tilts: Vec<f64>,
    /// The views that a diagnosis advised
    #[arg(long, value_name = "FILE", conflicts_with_all = ["views", "distances", "tilts"])]
    advise: Option<PathBuf>,
    /// Take this view again; the old one stays until the new one is whole; repeatable
    #[arg(long, value_name = "VIEW")]
    pub retake: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum ViewsArgument {
    /// 1 to 4 m by 0.5 m, 0 to 80 degrees by 10: 63 views
    Paper,
    /// 1 to 4 m by 1 m, 0, 30, 60 and 75 degrees: 16 views
    Quick,
    /// Every still pose that is not there yet
    Any,
}

impl Views {
    pub fn wanted(&self) -> anyhow::Result<Wanted> {
        if let Some(path) = &self.advise {
            return Ok(Wanted::advised(path)?);
        }
        if self.views == ViewsArgument::Any {
            if !self.distances.is_empty() || !self.tilts.is_empty() {
                bail!("--views any: it knows no grid; leave --distances and --tilts out");
            }
            return Ok(Wanted::any());
        }
        let (mut distances, mut tilts): (Vec<f64>, Vec<f64>) = match self.views {
            ViewsArgument::Quick => (vec![1.0, 2.0, 3.0, 4.0], vec![0.0, 30.0, 60.0, 75.0]),
            _ => (
                (0..7).map(|i| 1.0 + 0.5 * f64::from(i)).collect(),
                (0..9).map(|i| f64::from(10 * i)).collect(),
            ),
        };
        if !self.distances.is_empty() {
            distances.clone_from(&self.distances);
        }
        if !self.tilts.is_empty() {
            tilts.clone_from(&self.tilts);
        }
        if distances.iter().any(|z| !(0.1..=9.99).contains(z)) {
            bail!("--distances: a distance lies between 0.1 and 9.99 m");
        }
        if tilts.iter().any(|t| !(0.0..=88.0).contains(t)) {
            bail!("--tilts: a tilt lies between 0 and 88 degrees");
        }
        let tilts: Vec<f64> = tilts.iter().map(|t| t.to_radians()).collect();
        Ok(Wanted::grid(&distances, &tilts))
    }
}
