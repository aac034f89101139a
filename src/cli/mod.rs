//! The subcommands, one per file: arguments and `run`.

mod calibrate;
mod calibrate_summary;
mod capture;
mod capture_interface;
mod common;
mod compare;
mod completions;
mod console;
mod correct;
mod demo;
mod demo_seal;
mod diagnose;
mod diagnose_next;
mod effects;
mod evaluate;
mod export;
mod man;
mod map;
mod metrics;
mod origin;
mod output;
mod schema;
mod sigma;
mod simulate;
mod simulate_room;
mod simulate_scene;
mod units;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

/// How noisy is this depth sensor, and why?
#[derive(Debug, Parser)]
#[command(name = "kinoise", version, about, max_term_width = 100, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten, next_help_heading = "General options")]
    global: common::Global,
}

const EXAMPLES: &str = "\
Examples:
  kinoise demo
  kinoise calibrate recording -o out/kinect";

#[derive(Debug, Subcommand)]
enum Command {
    /// Take views from a running Kinect; the screen guides you to those that matter
    Capture(capture::Arguments),
    /// Fit sigma(z, theta) to recorded views of a plane, or to a table: model.json, plots, report
    Calibrate(calibrate::Arguments),
    /// Fit sigma(z, theta) to a table z_m,theta_rad,sigma_m[,n]
    Fit(calibrate::FitArguments),
    /// Give the vendors' figures of a recording: Z-accuracy, spatial and sub-pixel RMS, fill rate
    Metrics(metrics::Arguments),
    /// Find what a model or a simulation leaves out of a recording, name it and model it
    Diagnose(diagnose::Arguments),
    /// Make a recording of a board, or a film of a room
    Simulate(simulate::Arguments),
    /// Write a recording again, with the model's biases taken out of the depth
    Correct(correct::Arguments),
    /// Write a sigma image beside every depth image of a sequence
    Sigma(sigma::Arguments),
    /// Build a map from a sequence: trajectory, coloured points, statistics
    Map(map::Arguments),
    /// Compare the paper's four variants of the mapper: tables, figures, report
    Compare(compare::Arguments),
    /// Compute ATE and RPE of a trajectory, as the TUM scripts do
    Evaluate(evaluate::Arguments),
    /// Compare units of a kind: what is common, what is one unit's own, what has changed since
    Units(units::Arguments),
    /// Write a model as other software reads it: a program, tables, parameters of a mapper
    Export(export::Arguments),
    /// Show the catalogue of physical effects: what each does, how it shows, what it resembles
    Effects(effects::Arguments),
    /// Calibrate bundled data, then diagnose a cause drawn by lot and sealed, then map
    Demo(demo::Arguments),
    /// Print the JSON Schema of a file that kinoise writes
    Schema(schema::Arguments),
    /// Print the completions of a shell
    Completions(completions::Arguments),
    /// Write the manual's pages
    Man(man::Arguments),
}

/// Heading of the options for folders that do not describe themselves.
const INPUT_HEADING: &str = "Input without a recording.json";

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
            console::failure(&one_line(&e));
            return ExitCode::from(FAILURE);
        }
    };
    match run(&arguments) {
        Ok(code) => ExitCode::from(code),
        Err(e) => {
            output::wait_if_interrupted();
            console::failure(&format!("{e:#}"));
            ExitCode::from(FAILURE)
        }
    }
}

/// Whether clap's text is a help page: asked for, or shown because no command was given.
fn is_help(e: &clap::Error) -> bool {
    !e.use_stderr() || e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
}

/// Clap's message and tips on one line, without its usage; and where to find help.
fn one_line(e: &clap::Error) -> String {
    let text = e.to_string();
    let words = |part: &str| part.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = text.split("\n\n").map(words);
    let message = parts.next().unwrap_or_default().trim_start_matches("error: ").to_string();
    // The tip "to pass '--x' as a value" does not help after a typing error.
    let tips = parts.filter_map(|p| p.strip_prefix("tip: ").map(|tip| format!("; {tip}")));
    let tips = tips.filter(|tip| !tip.starts_with("; to pass "));
    let help = match subcommand() {
        Some(name) => format!("kinoise {name} --help"),
        None => "kinoise --help".into(),
    };
    format!("{message}{}; see {help}", tips.collect::<String>())
}

/// All commands with their options.
fn command() -> clap::Command {
    <Arguments as clap::CommandFactory>::command()
}

/// The given command's name, to point to its help; options may precede it.
fn subcommand() -> Option<String> {
    let command = command();
    // An argument that is not UTF-8 is no command.
    let mut words = std::env::args_os().skip(1).filter_map(|word| word.into_string().ok());
    words.find(|word| command.find_subcommand(word).is_some())
}

fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let global = &arguments.global;
    global.set_up()?;
    output::survive_file_limits()?;
    // Capture handles interruption itself: it keeps the complete views.
    if !matches!(arguments.command, Command::Capture(_)) {
        output::discard_when_interrupted()?;
    }
    match &arguments.command {
        Command::Capture(a) => capture::run(a, global),
        Command::Calibrate(a) => calibrate::run(a, global).map(|()| 0),
        Command::Fit(a) => calibrate::fit(a, global).map(|()| 0),
        Command::Metrics(a) => metrics::run(a, global).map(|()| 0),
        Command::Diagnose(a) => diagnose::run(a, global),
        Command::Simulate(a) => simulate::run(a, global).map(|()| 0),
        Command::Correct(a) => correct::run(a, global).map(|()| 0),
        Command::Sigma(a) => sigma::run(a, global).map(|()| 0),
        Command::Map(a) => map::run(a, global).map(|()| 0),
        Command::Compare(a) => compare::run(a, global).map(|()| 0),
        Command::Evaluate(a) => evaluate::run(a, global).map(|()| 0),
        Command::Units(a) => units::run(a, global).map(|()| 0),
        Command::Effects(a) => effects::run(a, global).map(|()| 0),
        Command::Demo(a) => demo::run(a, global).map(|()| 0),
        Command::Export(a) => export::run(a, global).map(|()| 0),
        Command::Schema(a) => schema::run(a).map(|()| 0),
        Command::Completions(a) => completions::run(a, global).map(|()| 0),
        Command::Man(a) => man::run(a, global).map(|()| 0),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn subcommands() -> Vec<clap::Command> {
        let mut whole = Arguments::command();
        whole.build();
        whole.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect()
    }

    #[test]
    fn every_command_has_two_examples_that_parse() {
        for command in subcommands() {
            let name = command.get_name();
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let examples: Vec<&str> =
                help.lines().filter(|l| l.starts_with("  kinoise ")).collect();
            assert!(examples.len() >= 2, "{name}: {help}");
            for example in examples {
                assert!(example.starts_with(&format!("  kinoise {name}")), "{example}");
                let words = example.split_whitespace().map(|w| w.trim_matches('\''));
                let parsed = Arguments::try_parse_from(words);
                assert!(parsed.is_ok(), "{example}: {}", parsed.err().unwrap());
            }
        }
    }

    /// An option of several commands has the same short form in all of them.
    #[test]
    fn options_are_alike_in_all_commands() {
        for (long, short) in [("output", 'o'), ("model", 'm'), ("quiet", 'q'), ("verbose", 'v')] {
            for command in subcommands() {
                let arguments = command.get_arguments().filter(|a| !a.is_positional());
                for a in arguments.filter(|a| a.get_long() == Some(long)) {
                    assert_eq!(a.get_short(), Some(short), "{} --{long}", command.get_name());
                }
            }
        }
    }

    /// Every option that takes numbers has a range: non-numbers, huge values and very long input are refused
    /// at parsing.
    #[test]
    fn every_number_has_a_range() {
        use std::any::TypeId;
        let numbers = [
            TypeId::of::<f64>(),
            TypeId::of::<f32>(),
            TypeId::of::<usize>(),
            TypeId::of::<u64>(),
            TypeId::of::<[f64; 2]>(),
            TypeId::of::<[f64; 4]>(),
            evaluate::offset_type(),
        ];
        let long = "9".repeat(200);
        let mut looked_at = 0;
        for command in subcommands() {
            let is_number =
                |a: &&clap::Arg| numbers.iter().any(|t| a.get_value_parser().type_id() == *t);
            for argument in command.get_arguments().filter(is_number) {
                let long_name = argument.get_long().expect("numbers are options");
                let many = argument.get_value_names().map_or("", |n| n[0].as_str()).matches(',');
                let times = if argument.get_value_delimiter().is_some() { 0 } else { many.count() };
                for wrong in ["1e300", "-1e300", "NaN", "inf", "-inf", "1e999", &long, "", "x"] {
                    // The seed may be any u64.
                    let value = vec![wrong; times + 1].join(",");
                    let words = ["kinoise", command.get_name(), &format!("--{long_name}={value}")];
                    let refused = Arguments::try_parse_from(words).expect_err("out of range");
                    assert!(
                        matches!(
                            refused.kind(),
                            ErrorKind::ValueValidation | ErrorKind::InvalidValue
                        ),
                        "{} --{long_name}={value}: {refused}",
                        command.get_name()
                    );
                    let said = console::one_line(&one_line(&refused));
                    assert!(said.len() < 400, "{said}");
                }
                looked_at += 1;
            }
        }
        assert!(looked_at > 80, "{looked_at} options with numbers");
    }

    /// Positionals, -o, -m, the command's own options, input without a description, general options.
    #[test]
    fn options_come_in_one_order() {
        let place = |a: &clap::Arg| match (a.get_long(), a.get_help_heading()) {
            (_, Some("General options")) => 5,
            (_, Some(INPUT_HEADING)) => 4,
            (Some("output"), _) => 1,
            (Some("model"), _) => 2,
            (None, _) => 0,
            _ => 3,
        };
        for command in subcommands() {
            let shown = |a: &&clap::Arg| !matches!(a.get_long(), Some("help" | "version"));
            let places: Vec<i32> = command.get_arguments().filter(shown).map(place).collect();
            assert!(places.is_sorted(), "{}: {places:?}", command.get_name());
        }
    }
}
