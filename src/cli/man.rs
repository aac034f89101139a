use std::path::PathBuf;

use clap::Args;
use clap_mangen::Man;

use super::command;
use super::common::Global;
use super::console::result;
use super::output::{PAGES, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise man ~/.local/share/man/man1/kinoise
  kinoise man out/man --force")]
pub struct Arguments {
    /// Folder for the pages: kinoise.1, and kinoise-COMMAND.1 of each command
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let output = begin(&arguments.folder, PAGES, &[], global)?;
    let mut whole = command().disable_help_subcommand(true);
    whole.build();
    let mut pages = vec![("kinoise".to_string(), whole.clone())];
    let shown = whole.get_subcommands().filter(|c| !c.is_hide_set());
    pages.extend(shown.map(|c| (format!("kinoise-{}", c.get_name()), c.clone())));
    for (name, command) in &pages {
        let mut page = Vec::new();
        Man::new(command.clone()).render(&mut page)?;
        output.write(&format!("{name}.1"), &page)?;
    }
    output.finish()?;
    result(format!("wrote {} pages into {}", pages.len(), arguments.folder.display()));
    global.print_json(&serde_json::json!({
        "output": arguments.folder,
        "pages": pages.iter().map(|(name, _)| format!("{name}.1")).collect::<Vec<_>>(),
    }))
}
