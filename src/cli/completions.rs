use anyhow::Context;
use clap::Args;
use clap_complete::Shell;
use serde_json::json;

use super::command;
use super::common::Global;
use super::console::answer;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise completions bash
  kinoise completions zsh

bash reads them in ~/.local/share/bash-completion/completions/kinoise, zsh in _kinoise of a folder in
its fpath, fish in ~/.config/fish/completions/kinoise.fish.")]
pub struct Arguments {
    /// Whose completions to print on stdout
    #[arg(value_enum)]
    shell: Shell,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command(), "kinoise", &mut script);
    if global.json {
        return global.print_json(&json!({ "script": String::from_utf8_lossy(&script) }));
    }
    answer(&script).context("stdout")
}
