//! Keys of a JSON file that have no effect.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

/// Keys that no part of the program reads, and the files they stand in: a slip of the pen, or a
/// newer layout. Told, not fatal: files of later versions stay readable.
#[derive(Default)]
pub(super) struct UnknownKeys(BTreeMap<String, Vec<PathBuf>>);

impl UnknownKeys {
    /// Whatever `given` has and `understood` (the same document, read and written again) has not.
    pub fn note(&mut self, path: &Path, given: &Value, understood: &Value) {
        for key in unknown_keys(given, understood) {
            self.0.entry(key).or_default().push(path.to_path_buf());
        }
    }

    /// A remark a key, not a remark a file.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|(key, files)| {
            let others = match files.len() - 1 {
                0 => String::new(),
                n => format!(" and {n} more"),
            };
            format!("{}{others}: unknown key \"{key}\", which has no effect", files[0].display())
        })
    }
}

fn unknown_keys(given: &Value, understood: &Value) -> Vec<String> {
    let Some(given) = given.as_object() else { return Vec::new() };
    given
        .iter()
        // null is how some programs write "not given".
        .filter(|(_, value)| !value.is_null())
        .flat_map(|(key, value)| match understood.get(key) {
            None => vec![key.clone()],
            Some(known) => {
                unknown_keys(value, known).iter().map(|inner| format!("{key}.{inner}")).collect()
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn keys_are_found_at_any_depth_and_null_is_not_given() {
        let given = json!({
            "roi": [0, 0, 9, 9], "distance_m": 2, "colour": null, "target": {"width_m": 1, "depth_m": 0.1}
        });
        let understood = json!({"roi": [0.0, 0.0, 9.0, 9.0], "target": {"width_m": 1.0}});
        assert_eq!(unknown_keys(&given, &understood), ["distance_m", "target.depth_m"]);
    }
}
