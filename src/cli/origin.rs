//! Provenance shown on a page: the recording and the command as typed.

use std::path::Path;

use kinoise::report::Origin;

use super::common::source_date;
use super::console::quoted;

/// Flags without influence on the results.
const FLAGS: [&str; 5] = ["--json", "--force", "--exit-zero", "--quiet", "--verbose"];
const SHORT_FLAGS: [char; 2] = ['q', 'v'];

/// Origin of a page made from `recording` now (or at SOURCE_DATE_EPOCH).
pub fn origin(recording: &Path, seed: u64) -> Origin {
    let typed: Vec<String> =
        std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
    let recording = recording.to_string_lossy();
    Origin::at(&quoted(&recording), &command(&typed), Some(seed), source_date())
}

/// The command line without options that do not affect results; the output folder by its name only.
fn command(typed: &[String]) -> String {
    let (mut words, mut typed) = (vec!["kinoise".to_string()], typed.iter());
    while let Some(word) = typed.next() {
        let (name, value) = name_and_value(word);
        let mut value = || value.or_else(|| typed.next().map(String::as_str)).unwrap_or_default();
        match name {
            "-" if word.len() > 1 => {}
            _ if FLAGS.contains(&name) => {}
            "--threads" => _ = value(),
            "-o" | "--output" => {
                words.extend(["-o".into(), quoted(&name_of(Path::new(value())))]);
            }
            _ => words.push(quoted(word)),
        }
    }
    words.join(" ")
}

/// Name of an option and the value in the same word. Short flags before `o` are dropped; a word of such flags
/// alone gives "-".
fn name_and_value(word: &str) -> (&str, Option<&str>) {
    let short = word.strip_prefix('-').filter(|rest| !rest.starts_with('-'));
    let Some(rest) = short.map(|rest| rest.trim_start_matches(SHORT_FLAGS)) else {
        return word.split_once('=').map_or((word, None), |(name, value)| (name, Some(value)));
    };
    match rest.strip_prefix('o') {
        Some("") => ("-o", None),
        Some(value) => ("-o", Some(value.strip_prefix('=').unwrap_or(value))),
        None => (if rest.is_empty() { "-" } else { word }, None),
    }
}

fn name_of(folder: &Path) -> String {
    folder.file_name().map_or_else(|| ".".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_results_do_not_depend_on_is_left_out() {
        let typed =
            ["calibrate", "my rec", "--threads", "2", "--json", "-o", "/tmp/x/out", "--seed", "3"];
        let typed = typed.map(String::from);
        assert_eq!(command(&typed), "kinoise calibrate 'my rec' -o out --seed 3");
        let typed = ["map", "a'b", "--output=/tmp/m", "--threads=1"].map(String::from);
        assert_eq!(command(&typed), r"kinoise map 'a'\''b' -o m");
        for output in ["-o/tmp/x/out", "-o=/tmp/x/out", "-qvo/tmp/x/out"] {
            let typed = ["map", "-qv", "rec", output, "-v", "-mout", "-"].map(String::from);
            assert_eq!(command(&typed), "kinoise map rec -o out -mout -");
        }
    }
}
