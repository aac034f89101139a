//! Makes concealed sets as the trial does, for goldens and for inspection: `trial make OUT --cell CELL ...`.
//!
//! With `--nats` or `--sealed` a set is as in the trial: 320x240, `--small` 160x120; otherwise it has one
//! strength: 640x480, `--small` 320x240. With `--light` it is made by the speckle simulator, `--effect`
//! names a cause, and `OUT/<name>/` holds `recording/` and `simulated/`.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::Args;

use crate::raytraced::question::{Asked, World};
use crate::raytraced::{CATALOGUE, Cell, OUTSIDE, Order, Set, write};
use crate::speckle;
use kinoise::io::sha256_hex;

#[derive(Debug, Args)]
pub struct Arguments {
    out: PathBuf,
    /// As in the truth: "few-views", for one; "all" of the catalogue by `--effect all`
    #[arg(long, value_parser = cell)]
    cell: Cell,
    /// By lot when none is named; "all" for every one of the cell
    #[arg(long, value_delimiter = ',')]
    effect: Vec<String>,
    #[arg(long, default_value_t = 1.0)]
    strength: f64,
    /// Strength by what knowing of each cause is worth, in place of --strength
    #[arg(long, conflicts_with = "strength")]
    nats: Option<f64>,
    /// A set of the trial at strength 1, for cells that only the trial has
    #[arg(long)]
    sealed: bool,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[arg(long, default_value_t = 1)]
    count: u64,
    #[arg(long)]
    views: Option<usize>,
    #[arg(long)]
    frames: Option<usize>,
    #[arg(long)]
    small: bool,
    /// By light: null or single
    #[arg(long)]
    light: bool,
}

fn cell(text: &str) -> Result<Cell, String> {
    serde_json::from_value(text.into()).map_err(|_| format!("no cell is called \"{text}\""))
}

/// Makes one set in `OUT/<name>/`, `OUT/truth/` and, unless by light, `OUT/model/`; returns a summary.
fn make(a: &Arguments, names: Vec<String>, seed: u64) -> anyhow::Result<String> {
    let Arguments { cell, nats, strength, views, frames, small, .. } = *a;
    let world = if a.light { World::Light } else { World::Rays };
    let asked = Asked { world, cell, names, nats, seed, small };
    if a.light {
        let name = &sha256_hex(format!("{asked:?}").as_bytes())[..10];
        let set = speckle::conceal(&asked)?;
        set.write(&a.out.join(name))?;
        let (folder, truth) = (a.out.join("truth"), set.truth());
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(format!("{name}.json")), serde_json::to_vec_pretty(&truth)?)?;
        let causes: Vec<&str> = truth.hidden.iter().map(|h| h.form.as_str()).collect();
        return Ok(format!("{name} {} {nats:?}", causes.join("+")));
    }
    let set = if nats.is_some() || a.sealed {
        Set::asked(&asked, views, frames)?
    } else {
        Set::draw(Order { cell, effects: asked.names, strength, seed, views, frames, small })?
    };
    write(&set, &a.out).with_context(|| set.name.clone())?;
    let forms: Vec<&str> = set.causes.iter().map(|c| c.label.form.as_str()).collect();
    let worth = set.concealed.iter();
    let worth = worth.map(|c| format!("{:.4}:{:.1}", c.strength, c.nats.unwrap_or(f64::NAN)));
    Ok(format!("{} {} {}", set.name, forms.join("+"), worth.collect::<Vec<_>>().join("+")))
}

pub fn run(a: &Arguments) -> anyhow::Result<()> {
    let list: Vec<&str> = match a.cell {
        _ if a.light => speckle::known().collect(),
        Cell::Outside => OUTSIDE.to_vec(),
        _ => CATALOGUE.to_vec(),
    };
    let every: Vec<Vec<String>> = match a.effect == ["all"] {
        true => list.into_iter().map(|id| vec![id.to_string()]).collect(),
        false => vec![a.effect.clone()],
    };
    for effects in every {
        for seed in a.seed..a.seed + a.count {
            let begin = Instant::now();
            let made = make(a, effects.clone(), seed)?;
            println!("{made} {:.2} s", begin.elapsed().as_secs_f64());
        }
    }
    Ok(())
}
