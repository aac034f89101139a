//! The file in which `kinoise simulate` tells what it switched on.

use std::path::Path;

use anyhow::bail;
use kinoise::io::write_json;

/// A recipe is a file of its own: before hours of shooting, not after.
pub fn check_recipe(path: &Path, output: &Path) -> anyhow::Result<()> {
    if path.exists() {
        bail!("--recipe {}: the file exists; name a new one", path.display());
    }
    if path.starts_with(output) {
        bail!("--recipe {}: inside the recording it would tell; put it elsewhere", path.display());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if folder.is_some_and(|f| !f.is_dir()) {
        bail!("--recipe {}: its folder does not exist; make it first", path.display());
    }
    Ok(())
}

/// Write it whole or not at all.
pub fn write_recipe(path: &Path, recipe: &serde_json::Value) -> anyhow::Result<()> {
    write_json(path, recipe, "report this as a bug")?;
    Ok(())
}
