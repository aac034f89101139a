//! One file a subcommand: its arguments and `run`.

mod calibrate;
mod common;
mod demo;
mod fit;
mod simulate;
mod words;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// How noisy is this depth sensor, and why?
#[derive(Debug, Parser)]
#[command(name = "kinoise", version, about, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    global: common::Global,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fit sigma(z, theta) to recorded views of a plane: model.json, plots, report
    Calibrate(calibrate::Arguments),
    /// Fit sigma(z, theta) to a table z_m,theta_rad,sigma_m[,n]
    Fit(fit::Arguments),
    /// Make a recording by formula
    Simulate(simulate::Arguments),
    /// The whole road on bundled data
    Demo(demo::Arguments),
}

/// Bad input or failure (contract, section 3).
const FAILURE: u8 = 2;

pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(e) => {
            let _ = e.print();
            return if e.use_stderr() { ExitCode::from(FAILURE) } else { ExitCode::SUCCESS };
        }
    };
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("kinoise: {e:#}");
            ExitCode::from(FAILURE)
        }
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let global = &arguments.global;
    global.set_threads()?;
    match &arguments.command {
        Command::Calibrate(a) => calibrate::run(a, global),
        Command::Fit(a) => fit::run(a, global),
        Command::Simulate(a) => simulate::run(a, global),
        Command::Demo(a) => demo::run(a, global),
    }
}
