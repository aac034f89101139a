//! Scratch driver of the proof's ray generator:
//! `rays OUTDIR --cell CELL --effect ID[,ID] [--strength S | --nats N] --seed N [--count K] [--views N] [--frames N] [--small]`
//!
//! With `--nats` a set is as the trial seals it: 320x240, `--small` 160x120. With `--light` it is made
//! of dots, `--effect` names a cause, and `OUT/<name>/` holds `recording/` and `simulated/`.

use std::path::PathBuf;
use std::time::Instant;

use crate::raytraced::question::{Asked, World};
use crate::raytraced::{Cell, Order, Set, write};
use crate::{light, worlds};
use anyhow::Context;
use clap::Args;
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

    /// `OUT/<name>/`, and its truth where the others have theirs.
    fn shoot(&self, effects: &[String], seed: u64) -> anyhow::Result<()> {
        let begin = Instant::now();
        let asked = self.asked(World::Light, effects, seed);
        let name = &sha256_hex(format!("{asked:?}").as_bytes())[..10];
        let set = worlds::seal(&asked, None)?;
        set.write(&self.out.join(name))?;
        let truth = self.out.join("truth");
        std::fs::create_dir_all(&truth)?;
        let told = set.truth();
        std::fs::write(truth.join(format!("{name}.json")), serde_json::to_vec_pretty(&told)?)?;
        let causes: Vec<&str> = told.hidden.iter().map(|h| h.form.as_str()).collect();
        let seconds = begin.elapsed().as_secs_f64();
        println!("{name} {} {:?} {seconds:.2} s", causes.join("+"), asked.nats);
        Ok(())
    }

    fn set(&self, effects: &[String], seed: u64) -> kinoise::error::Result<Set> {
        let (cell, small) = (self.cell, self.small);
        if self.nats.is_some() || self.sealed {
            let asked = self.asked(World::Rays, effects, seed);
            return Set::sealed(&asked, self.views, self.frames);
        }
        Set::draw(Order {
            cell,
            effects: effects.to_vec(),
            strength: self.strength,
            seed,
            views: self.views,
            frames: self.frames,
            small,
        })
    }
}

pub fn run(a: &Arguments) -> anyhow::Result<()> {
    let every: Vec<Vec<String>> = if a.effect == ["all"] {
        use crate::raytraced::{CATALOGUE, OUTSIDE};
        let causes: Vec<&str> = light::known().collect();
        let list: &[&str] = match a.cell {
            _ if a.light => &causes,
            Cell::Outside => &OUTSIDE,
            _ => &CATALOGUE,
        };
        list.iter().map(|id| vec![(*id).to_string()]).collect()
    } else {
        vec![a.effect.clone()]
    };
    for effects in every {
        for seed in a.seed..a.seed + a.count {
            if a.light {
                a.shoot(&effects, seed)?;
                continue;
            }
            let begin = Instant::now();
            let set = a.set(&effects, seed)?;
            let drawn = begin.elapsed().as_secs_f64();
            write(&set, &a.out).with_context(|| set.name.clone())?;
            let frames: usize = set.plans.iter().map(|p| p.stamps.len()).sum();
            let ids: Vec<&str> =
                set.causes.iter().map(|c| c.label.id.unwrap_or(c.label.form)).collect();
            let written = begin.elapsed().as_secs_f64() - drawn;
            let told: Vec<String> =
                set.told().iter().map(|(s, n)| format!("{s:.4}:{n:.1}")).collect();
            println!(
                "{} {} {} {frames} frames, drawn {drawn:.3} s, written {written:.2} s",
                set.name,
                ids.join("+"),
                told.join("+"),
            );
        }
    }
    Ok(())
}
