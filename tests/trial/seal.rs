//! What is published before the first diagnosis: hashes that bind everybody.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::judge::{JUDGE_SOURCE, endpoints_in_words};
use super::plan::Planned;
use super::worlds;
use crate::raytraced::question::{Asked, Sealed, Truth};
use kinoise::error::{Error, Result};
use kinoise::io::{hex, sha256_hex};

pub const SEAL_FORMAT: &str = "kinoise-seal/1";

/// `seal.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Seal {
    pub format: String,
    pub version: String,
    /// Of the trial's seed as eight bytes, least first. A small seed can be guessed from it: take a
    /// large one for a trial that others are to trust.
    pub seed_sha256: String,
    /// Of the program that diagnoses.
    pub binary_sha256: String,
    /// Of the judge's source, file after file.
    pub judge_sha256: String,
    /// What the trial is to be judged by.
    pub endpoints: Vec<String>,
    /// The seed of every diagnosis.
    pub solver_seed: u64,
    /// Wall-clock limit of one diagnosis, s.
    pub limit_s: u64,
    /// In the order in which they are put.
    pub sets: Vec<SealedSet>,
}

/// One set, as far as anybody may know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SealedSet {
    pub name: String,
    /// [`hash_folder`] of what the solver gets.
    pub data_sha256: String,
    /// [`commitment`] of the truth.
    pub commitment: String,
}

/// A set that is ready, with its answer.
pub struct Taken {
    pub name: String,
    pub salt: String,
    pub truth: Truth,
    pub commitment: String,
    pub sealed: Box<dyn Sealed>,
}

impl Taken {
    /// Make the set that `planned` asks for.
    ///
    /// # Errors
    /// When its world cannot make it.
    pub fn of(planned: &Planned, data: Option<&Path>) -> Result<Self> {
        let sealed = worlds::seal(&planned.asked, data)?;
        let truth = as_read_back(&sealed.truth(), &planned.asked)?;
        let commitment = commitment(&planned.salt, &truth);
        Ok(Taken {
            name: planned.name.clone(),
            salt: planned.salt.clone(),
            truth,
            commitment,
            sealed,
        })
    }
}

/// What a file keeps of it, so that the hash is the same for those who read the file.
fn as_read_back(truth: &Truth, asked: &Asked) -> Result<Truth> {
    let text = serde_json::to_string(truth);
    text.and_then(|text| serde_json::from_str(&text)).map_err(|e| Error::Argument {
        what: format!(
            "the truth of a set of {:?}/{:?} cannot be written: {e}",
            asked.world, asked.cell
        ),
        remedy: "its maker must give finite numbers",
    })
}

/// SHA-256 of the salt's text followed by the truth's: compact JSON with sorted keys.
pub fn commitment(salt: &str, truth: &Truth) -> String {
    let value = serde_json::to_value(truth).unwrap_or(Value::Null);
    sha256_hex(format!("{salt}{}", canonical(&value)).as_bytes())
}

/// Compact JSON, the keys of every object sorted.
pub fn canonical(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<(&String, &Value)> = map.iter().collect();
            entries.sort_by_key(|e| e.0);
            let inside: Vec<String> = entries
                .into_iter()
                .map(|(k, v)| format!("{}:{}", Value::String(k.clone()), canonical(v)))
                .collect();
            format!("{{{}}}", inside.join(","))
        }
        Value::Array(list) => {
            format!("[{}]", list.iter().map(canonical).collect::<Vec<_>>().join(","))
        }
        other => other.to_string(),
    }
}

/// SHA-256 over all files below `root` in the order of their paths: for each the path with '/', a
/// zero byte, its length as eight bytes, least first, and its bytes.
///
/// # Errors
/// When something cannot be read.
pub fn hash_folder(root: &Path) -> Result<String> {
    let mut files = Vec::new();
    list(root, &mut files)?;
    let mut named: Vec<(String, PathBuf)> =
        files.into_iter().map(|file| (inside(root, &file), file)).collect();
    named.sort();
    let mut hash = Sha256::new();
    for (name, file) in named {
        let bytes = fs::read(&file).map_err(|e| Error::read(&file, e))?;
        hash.update(name.as_bytes());
        hash.update([0]);
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(&bytes);
    }
    Ok(hex(&hash.finalize()))
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| Error::read(folder, e))? {
        let path = entry.map_err(|e| Error::read(folder, e))?.path();
        if path.is_dir() { list(&path, files)? } else { files.push(path) }
    }
    Ok(())
}

fn inside(root: &Path, file: &Path) -> String {
    let parts = file.strip_prefix(root).unwrap_or(file).components();
    let parts: Vec<String> = parts.map(|p| p.as_os_str().to_string_lossy().into_owned()).collect();
    parts.join("/")
}

impl Seal {
    /// Over these sets, for this program.
    ///
    /// # Errors
    /// When the program's file cannot be read.
    pub fn new(
        seed: u64,
        program: &Path,
        (solver_seed, limit_s): (u64, u64),
        sets: Vec<SealedSet>,
    ) -> Result<Self> {
        let binary = fs::read(program).map_err(|e| Error::read(program, e))?;
        Ok(Seal {
            format: SEAL_FORMAT.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            seed_sha256: seed_hash(seed),
            binary_sha256: sha256_hex(&binary),
            judge_sha256: judge_hash(),
            endpoints: endpoints_in_words(),
            solver_seed,
            limit_s,
            sets,
        })
    }
}

pub fn seed_hash(seed: u64) -> String {
    sha256_hex(&seed.to_le_bytes())
}

/// Of the judge that this program was built with.
pub fn judge_hash() -> String {
    let mut hash = Sha256::new();
    for (name, text) in JUDGE_SOURCE {
        hash.update(name.as_bytes());
        hash.update([0]);
        hash.update(text.as_bytes());
    }
    hex(&hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_canonical_text_does_not_depend_on_the_order_of_keys() {
        let a = json!({"b": [1.5, null, "x\"y"], "a": {"d": 1e-7, "c": true}});
        let b = json!({"a": {"c": true, "d": 1e-7}, "b": [1.5, null, "x\"y"]});
        assert_eq!(canonical(&a), canonical(&b));
        assert_eq!(canonical(&a), r#"{"a":{"c":true,"d":1e-7},"b":[1.5,null,"x\"y"]}"#);
    }

    #[test]
    fn a_folder_hash_sees_names_bytes_and_borders() {
        let make = |files: &[(&str, &str)]| {
            let dir = tempfile::tempdir().unwrap();
            for (name, text) in files {
                let path = dir.path().join(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, text).unwrap();
            }
            hash_folder(dir.path()).unwrap()
        };
        let one = make(&[("a/x", "12"), ("b", "3")]);
        assert_eq!(one, make(&[("b", "3"), ("a/x", "12")]));
        assert_ne!(one, make(&[("a/x", "1"), ("b", "23")]));
        assert_ne!(one, make(&[("a/y", "12"), ("b", "3")]));
    }
}
