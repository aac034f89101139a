use anyhow::Context;
use clap::Args;
use kinoise::io::pretty_json;
use kinoise::schema::{SchemaOf, schema};

use super::common::one_of;
use super::console::answer;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise schema model
  kinoise schema diagnosis")]
pub struct Arguments {
    /// Whose schema to print on stdout
    #[arg(value_name = "FILE", value_parser = one_of([
        ("model", "model.json", SchemaOf::Model),
        ("diagnosis", "diagnosis.json", SchemaOf::Diagnosis),
        ("measurements", "measurements.csv, a row an object; what is empty is null", SchemaOf::Measurements),
    ]))]
    file: SchemaOf,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let text = pretty_json(&schema(arguments.file))?;
    answer(text.as_bytes()).context("stdout")
}
