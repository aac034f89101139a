//! Scratch driver of the proof's ray generator:
//! `rays OUTDIR --cell CELL --effect ID[,ID] --strength S --seed N [--count K] [--views N] [--frames N] [--small]`

use std::path::PathBuf;

use anyhow::Context;
use clap::Parser;
use kinoise::prove::rays::{Cell, Order, Set, write};

#[derive(Parser)]
struct Arguments {
    out: PathBuf,
    #[arg(long)]
    cell: Cell,
    /// By lot when none is named; "all" for every one of the cell
    #[arg(long, value_delimiter = ',')]
    effect: Vec<String>,
    #[arg(long, default_value_t = 1.0)]
    strength: f64,
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
}

fn main() -> anyhow::Result<()> {
    let a = Arguments::parse();
    let every: Vec<Vec<String>> = if a.effect == ["all"] {
        use kinoise::prove::rays::{CATALOGUE, OUTSIDE};
        let list: &[&str] = if a.cell == Cell::Outside { &OUTSIDE } else { &CATALOGUE };
        list.iter().map(|id| vec![(*id).to_string()]).collect()
    } else {
        vec![a.effect.clone()]
    };
    for effects in every {
        for seed in a.seed..a.seed + a.count {
            let order = Order {
                cell: a.cell,
                effects: effects.clone(),
                strength: a.strength,
                seed,
                views: a.views,
                frames: a.frames,
                small: a.small,
            };
            let set = Set::draw(order)?;
            let begin = std::time::Instant::now();
            write(&set, &a.out).with_context(|| set.name.clone())?;
            let frames: usize = set.plans.iter().map(|p| p.stamps.len()).sum();
            let ids: Vec<&str> =
                set.causes.iter().map(|c| c.label.id.unwrap_or(c.label.form)).collect();
            let ms = begin.elapsed().as_secs_f64() * 1e3 / frames as f64;
            println!("{} {} {frames} frames {ms:.1} ms each", set.name, ids.join("+"));
        }
    }
    Ok(())
}
