//! The solver of a blind trial: what `diagnose` does, by a process that can reach one set only.

use std::path::Path;

use clap::Args;
use kinoise::prove::{DATA, confine};

use super::common::Global;
use super::diagnose;

/// Everything lies where it must.
#[derive(Debug, Args)]
pub struct Arguments {}

/// Before any thread is started.
pub fn shut_in() {
    let [read, write] = DATA.map(Path::new);
    println!("{}", confine(read, write));
}

pub fn run(global: &Global) -> anyhow::Result<u8> {
    let [set, out] = DATA.map(Path::new);
    let (model, simulated) = (set.join("model.json"), set.join("simulated"));
    let arguments = diagnose::Arguments::plain(
        set.join("recording"),
        model.exists().then_some(model),
        simulated.exists().then_some(simulated),
        out.to_path_buf(),
    );
    diagnose::run(&arguments, global)
}
