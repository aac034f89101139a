//! The sensor that `kinoise simulate` shoots with, and how its noise is described.

use std::path::Path;

use anyhow::{Context, bail};
use kinoise::effects::Active;
use kinoise::model::{Direction, Domain, PAPER_EQ1};
use kinoise::simulate::kinect_v1;
use kinoise::{Form, NoiseModel, Sensor, SigmaModel};

use super::common::say;

/// What shoots: the model's own sensor and effects, or a Kinect and Eq. 1.
/// What is `given` beside a model must not be in its shape already.
pub fn sensor_and_noise(
    model: Option<&Path>,
    shrink: Option<usize>,
    given: &[Active],
) -> anyhow::Result<(Sensor, SigmaModel, Vec<Active>)> {
    let factor = shrink.unwrap_or(1);
    if !(1..=8).contains(&factor) {
        bail!("--shrink {factor}: give a whole number from 1 to 8");
    }
    let Some(path) = model else {
        return Ok((kinect_v1(factor), eq1_at_its_word(), Vec::new()));
    };
    let model = NoiseModel::read(path)?;
    let sensor = match model.sensor {
        Some(_) if shrink.is_some() => {
            bail!("--shrink: {} brings its own sensor; leave --shrink out", path.display())
        }
        Some(file) => {
            file.sensor().map_err(|e| anyhow::anyhow!("{}: sensor: {e}", path.display()))?
        }
        None => kinect_v1(factor),
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
    refuse_over_shape(shaped.map(|e| e.id.as_str()), given)?;
    Ok((sensor, model.sigma, effects))
}

/// Eq. 1 everywhere a board of this size reaches, short of its pole.
fn eq1_at_its_word() -> SigmaModel {
    let domain = Domain { z_m: [0.2, 10.0], theta_rad: [0.0, PAPER_EQ1[5] - 0.02] };
    SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
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
