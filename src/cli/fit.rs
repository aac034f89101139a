use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use kinoise::io::OutputDir;
use kinoise::measure::read_table;
use kinoise::report::CalibrationPage;
use kinoise::{CalibrateOptions, model_of_table};

use super::calibrate::{Fitting, write_outputs};
use super::common::{Global, say, source_date};
use super::words;

#[derive(Debug, Args)]
pub struct Arguments {
    /// CSV with the columns z_m,theta_rad,sigma_m and optionally n (SI units)
    table: PathBuf,
    /// Folder for model.json, sigma.svg and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    fitting: Fitting,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let table = read_table(&arguments.table)?;
    let form = arguments.fitting.form()?;
    let options = CalibrateOptions { form, created: source_date(), ..Default::default() };
    let calibration = model_of_table(&table, &arguments.table, &options)
        .with_context(|| arguments.table.display().to_string())?;
    let out = OutputDir::create(&arguments.output)?;
    let page = CalibrationPage {
        title: &format!("Noise model of {}", arguments.table.display()),
        sensor: None,
        measurements: None,
        calibration: &calibration,
        overlays: arguments.fitting.overlays(),
    };
    write_outputs(&out, &page)?;
    say(words::summary(&calibration));
    say(words::warnings(&calibration));
    global.print_json(&words::as_json(&calibration, None))
}
