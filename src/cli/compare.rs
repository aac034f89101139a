use std::path::PathBuf;

use anyhow::ensure;
use clap::Args;
use kinoise::compare::{compare, of_the_paper, past_the_paper, tables};
use kinoise::io::OutputDir;
use kinoise::report::{comparison_figures, comparison_page};
use kinoise::sequence::open;

use super::common::{Global, Input, Model, Thinning, notes, say};
use super::origin::origin;

#[derive(Debug, Args)]
pub struct Arguments {
    /// A sequence with ground truth, in the layout of the TUM RGB-D benchmark or of 7-Scenes
    sequence: PathBuf,
    #[command(flatten)]
    model: Model,
    /// Folder for tables.json, tables.txt, figures and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Also what goes past the paper, one step at a time
    #[arg(long)]
    ablation: bool,
    /// Runs of each variant that draws by chance
    #[arg(long, value_name = "N", default_value_t = 1)]
    repeats: usize,
    #[command(flatten)]
    thinning: Thinning,
    #[command(flatten)]
    input: Input,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    ensure!(arguments.repeats > 0, "--repeats 0: give 1 or more");
    let mut sequence = open(&arguments.sequence, &arguments.input.assumed()?)?;
    sequence.thin(arguments.thinning.stride, arguments.thinning.frames);
    let output = OutputDir::create(&arguments.output)?;
    let model = arguments.model.read()?;
    let mut variants = of_the_paper();
    let ours = past_the_paper().into_iter();
    variants.extend(ours.filter(|v| arguments.ablation || v.name.contains("default")));
    let progress =
        |name: &str, done: usize, all: usize| say(format!("run {} of {all}: {name}", done + 1));
    let comparison =
        compare(&sequence, &model, &variants, arguments.repeats, global.seed(), &progress)?;
    let text = tables::text(&comparison);
    let json = tables::json(&comparison);
    output.write("tables.json", serde_json::to_string_pretty(&json)?.as_bytes())?;
    output.write("tables.txt", text.as_bytes())?;
    for (name, svg) in comparison_figures(&comparison)? {
        output.write(name, svg.as_bytes())?;
    }
    let origin = origin(&arguments.sequence, &arguments.output, global.seed);
    output.write("report.html", comparison_page(&comparison, &origin)?.as_bytes())?;
    notes(&sequence.remarks);
    say(text);
    say(format!("wrote {}", arguments.output.join("report.html").display()));
    global.print_json(&json)
}
