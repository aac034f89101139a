//! One file a subcommand: its arguments and `run`.

mod calibrate;
mod calibrate_summary;
mod capture;
mod capture_interface;
mod common;
mod compare;
mod correct;
mod demo;
mod diagnose;
mod effects;
mod evaluate;
mod map;
mod origin;
mod simulate;
mod simulate_room;
mod simulate_scene;

use std::process::ExitCode;

use clap::error::ErrorKind;
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
    /// Take views from a running Kinect, guided to those that matter
    Capture(capture::Arguments),
    /// Fit sigma(z, theta) to recorded views of a plane, or to a table: model.json, plots, report
    Calibrate(calibrate::Arguments),
    /// Fit sigma(z, theta) to a table z_m,theta_rad,sigma_m[,n]
    #[command(hide = true)]
    Fit(calibrate::FitArguments),
    /// What a model leaves out of a recording: located, named, modelled, and shown to help
    Diagnose(diagnose::Arguments),
    /// Make a recording, or a film of a room, by formula or by light
    Simulate(simulate::Arguments),
    /// Write a recording again with the model's biases taken out of the depth
    Correct(correct::Arguments),
    /// Build a map from a sequence: trajectory, coloured points, statistics
    Map(map::Arguments),
    /// The paper's four variants of the mapper side by side: tables, figures, report
    Compare(compare::Arguments),
    /// ATE and RPE of a trajectory, as the TUM scripts compute them
    Evaluate(evaluate::Arguments),
    /// The catalogue of physical effects: what each does, how it shows, what it resembles
    Effects(effects::Arguments),
    /// The whole road on bundled data
    Demo(demo::Arguments),
}

/// Exit code of bad input or failure.
const FAILURE: u8 = 2;

pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(e) if is_help(&e) => {
            let _ = e.print();
            return if e.use_stderr() { ExitCode::from(FAILURE) } else { ExitCode::SUCCESS };
        }
        Err(e) => {
            eprintln!("kinoise: {}; see kinoise --help", one_line(&e));
            return ExitCode::from(FAILURE);
        }
    };
    match run(&arguments) {
        Ok(code) => ExitCode::from(code),
        Err(e) => {
            eprintln!("kinoise: {e:#}");
            ExitCode::from(FAILURE)
        }
    }
}

/// Asked for, or nothing was said at all: the page is the answer.
fn is_help(e: &clap::Error) -> bool {
    !e.use_stderr() || e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
}

/// What clap says before its usage and its tips, without its "error: ".
fn one_line(e: &clap::Error) -> String {
    let text = e.to_string();
    let message = text.split("\n\n").next().unwrap_or_default();
    let words: Vec<&str> = message.split_whitespace().collect();
    words.join(" ").trim_start_matches("error: ").to_string()
}

fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let global = &arguments.global;
    global.set_threads()?;
    match &arguments.command {
        Command::Capture(a) => capture::run(a, global),
        Command::Calibrate(a) => calibrate::run(a, global).map(|()| 0),
        Command::Fit(a) => calibrate::fit(a, global).map(|()| 0),
        Command::Diagnose(a) => diagnose::run(a, global),
        Command::Simulate(a) => simulate::run(a, global).map(|()| 0),
        Command::Correct(a) => correct::run(a, global).map(|()| 0),
        Command::Map(a) => map::run(a, global).map(|()| 0),
        Command::Compare(a) => compare::run(a, global).map(|()| 0),
        Command::Evaluate(a) => evaluate::run(a, global).map(|()| 0),
        Command::Effects(a) => effects::run(a, global).map(|()| 0),
        Command::Demo(a) => demo::run(a, global).map(|()| 0),
    }
}
