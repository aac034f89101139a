use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::compare::{compare, of_the_paper, past_the_paper, tables};
use kinoise::io::pretty_json;
use kinoise::report::{comparison_charts, comparison_page};
use kinoise::sequence::open;

use super::common::{Global, Input, Model, Thinning, count};
use super::console::{beside, next_step, notes, result_lines, say};
use super::origin::origin;
use super::output::{COMPARISON, begin};

/// Maximum number of runs of each variant: their scatter is known well before.
const MAX_REPEATS: usize = 100;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise compare rgbd_dataset_freiburg1_desk -o out/desk -m out/kinect/model.json
  kinoise compare rgbd_dataset_freiburg1_desk -o out/steps --ablation --repeats 3")]
pub struct Arguments {
    /// A sequence with ground truth, in the layout of the TUM RGB-D benchmark or of 7-Scenes
    sequence: PathBuf,
    /// Folder for tables.json, tables.txt, figures and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    model: Model,
    /// Also run each step beyond the paper, one at a time
    #[arg(long)]
    ablation: bool,
    /// Number of runs of each variant that draws random numbers
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(1, MAX_REPEATS))]
    repeats: usize,
    #[command(flatten, next_help_heading = "Frames")]
    thinning: Thinning,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let mut sequence = open(&arguments.sequence, &arguments.input.assumed()?)?;
    sequence.thin(arguments.thinning.stride, arguments.thinning.frames);
    notes(&sequence.remarks);
    let model = arguments.model.read_for(&sequence)?;
    let inputs: Vec<&Path> =
        arguments.model.path().into_iter().chain([&*arguments.sequence]).collect();
    let output = begin(&arguments.output, COMPARISON, &inputs, global)?;
    let mut variants = of_the_paper();
    let ours = past_the_paper().into_iter();
    variants.extend(ours.filter(|v| arguments.ablation || v.name.contains("default")));
    let progress =
        |name: &str, done: usize, all: usize| say(format!("run {} of {all}: {name}", done + 1));
    let comparison =
        compare(&sequence, &model, &variants, arguments.repeats, global.seed(), &progress)?;
    let text = tables::text(&comparison);
    let json = tables::json(&comparison);
    output.write("tables.json", pretty_json(&json)?.as_bytes())?;
    output.write("tables.txt", text.as_bytes())?;
    for (name, chart) in comparison_charts(&comparison) {
        output.write(name, chart.svg()?.as_bytes())?;
    }
    let origin = origin(&arguments.sequence, global.seed().0);
    output.write("report.html", comparison_page(&comparison, &origin)?.as_bytes())?;
    output.finish()?;
    result_lines(text);
    say(format!("wrote {}", arguments.output.join("report.html").display()));
    global.print_json(&json)?;
    let to = beside(&arguments.output, "map");
    let next = vec!["map".into(), arguments.sequence.clone().into(), "-o".into(), to.into()];
    let (model, thinning) = (arguments.model.again(), arguments.thinning.again());
    next_step(&[next, model, thinning, arguments.input.again()].concat());
    Ok(())
}
