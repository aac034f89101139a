//! `trial make OUT --cell CELL ...`: raytraced sets as the trial makes them, for goldens and a look.
//!
//! With `--nats` or `--sealed` a set is the trial's: 320x240, `--small` 160x120; else it is of one
//! strength: 640x480, `--small` 320x240. With `--light` it is made of dots, `--effect` names a cause,
//! and `OUT/<name>/` holds `recording/` and `simulated/`.

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

impl Arguments {
    fn asked(&self, world: World, effects: &[String], seed: u64) -> Asked {
        let Arguments { cell, nats, small, .. } = *self;
        Asked { world, cell, names: effects.to_vec(), nats, seed, small }
    }

    /// Into `OUT/<name>/`, and its truth where the others have theirs. What was made.
    fn speckle(&self, effects: &[String], seed: u64) -> anyhow::Result<String> {
        let asked = self.asked(World::Light, effects, seed);
        let name = &sha256_hex(format!("{asked:?}").as_bytes())[..10];
        let set = speckle::conceal(&asked)?;
        set.write(&self.out.join(name))?;
        let folder = self.out.join("truth");
        std::fs::create_dir_all(&folder)?;
        let truth = set.truth();
        std::fs::write(folder.join(format!("{name}.json")), serde_json::to_vec_pretty(&truth)?)?;
        let causes: Vec<&str> = truth.hidden.iter().map(|h| h.form.as_str()).collect();
        Ok(format!("{name} {} {:?}", causes.join("+"), asked.nats))
    }

    /// Into `OUT/<name>/`, `OUT/model/` and `OUT/truth/`. What was made.
    fn raytraced(&self, effects: &[String], seed: u64) -> anyhow::Result<String> {
        let Arguments { cell, strength, views, frames, small, .. } = *self;
        let set = if self.nats.is_some() || self.sealed {
            Set::asked(&self.asked(World::Rays, effects, seed), views, frames)?
        } else {
            let effects = effects.to_vec();
            Set::draw(Order { cell, effects, strength, seed, views, frames, small })?
        };
        write(&set, &self.out).with_context(|| set.name.clone())?;
        let forms: Vec<&str> = set.causes.iter().map(|c| c.label.form.as_str()).collect();
        let worth: Vec<String> = set
            .concealed
            .iter()
            .map(|c| format!("{:.4}:{:.1}", c.strength, c.nats.unwrap_or(f64::NAN)))
            .collect();
        Ok(format!("{} {} {}", set.name, forms.join("+"), worth.join("+")))
    }
}

pub fn run(a: &Arguments) -> anyhow::Result<()> {
    let causes: Vec<&str> = speckle::known().collect();
    let list: &[&str] = match a.cell {
        _ if a.light => &causes,
        Cell::Outside => &OUTSIDE,
        _ => &CATALOGUE,
    };
    let every: Vec<Vec<String>> = match a.effect == ["all"] {
        true => list.iter().map(|id| vec![(*id).to_string()]).collect(),
        false => vec![a.effect.clone()],
    };
    for effects in every {
        for seed in a.seed..a.seed + a.count {
            let begin = Instant::now();
            let made =
                if a.light { a.speckle(&effects, seed)? } else { a.raytraced(&effects, seed)? };
            println!("{made} {:.2} s", begin.elapsed().as_secs_f64());
        }
    }
    Ok(())
}
