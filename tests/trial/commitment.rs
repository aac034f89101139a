//! Hashes that commit to the solver's input, the truths and the verdicts.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use kinoise::Error;
use kinoise::error::Result;
use kinoise::io::{hex, sha256_hex};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::raytraced::question::Pose;

/// Published before the first diagnosis (`commitments.json`), and again before the second round
/// (`commitments-advised.json`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Commitments {
    pub version: String,
    /// SHA-256 of the trial's seed as eight little-endian bytes; choose a large seed where others are
    /// to trust it.
    pub seed_sha256: String,
    /// SHA-256 of this program, which diagnoses and judges.
    pub binary_sha256: String,
    /// The endpoints that the trial is judged by, in words.
    pub endpoints: Vec<String>,
    /// Wall-clock limit of one diagnosis, s.
    pub limit_s: u64,
    /// SHA-256 of the first round's verdicts; `None` in the first round.
    pub after: Option<String>,
    /// In the order of the plan.
    pub sets: Vec<Committed>,
}

/// What is published about one set before its diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Committed {
    pub name: String,
    /// [`hash_folder`] of the solver's input.
    pub data_sha256: String,
    /// [`hash_json`] of the truth. It contains the set's own 64-bit seed, so nobody can guess it.
    pub truth_sha256: String,
    /// In the second round: the view that was advised and the one that was taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<[Pose; 2]>,
}

/// Published before any answer is opened: `verdicts.json`, `verdicts-advised.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdicts {
    /// SHA-256 of the commitments that these verdicts answer.
    pub commitments_sha256: String,
    pub verdicts: Vec<VerdictHash>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VerdictHash {
    pub name: String,
    /// SHA-256 of `diagnosis.json`; `None` where there is no diagnosis.
    pub diagnosis_sha256: Option<String>,
    /// SHA-256 of the extended model, from which the gains follow.
    #[serde(default)]
    pub model_sha256: Option<String>,
    /// What confined the solver; empty in older trials, which do not record it per set.
    #[serde(default)]
    pub confinement: String,
}

/// SHA-256 of compact JSON with sorted keys.
pub fn hash_json(value: &impl Serialize) -> String {
    let mut value = serde_json::to_value(value).unwrap_or(Value::Null);
    value.sort_all_objects();
    sha256_hex(value.to_string().as_bytes())
}

pub fn hash_file(path: &Path) -> Result<String> {
    Ok(sha256_hex(&fs::read(path).map_err(|e| Error::read(path, e))?))
}

/// SHA-256 over all files below `root` in path order: for each the path with '/', a zero byte, its length as
/// eight little-endian bytes, and its contents.
pub fn hash_folder(root: &Path) -> Result<String> {
    let mut files = BTreeMap::new();
    list(root, "", &mut files)?;
    let mut hash = Sha256::new();
    for (name, file) in files {
        let bytes = fs::read(&file).map_err(|e| Error::read(&file, e))?;
        hash.update(name.as_bytes());
        hash.update([0]);
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(&bytes);
    }
    Ok(hex(&hash.finalize()))
}

fn list(folder: &Path, above: &str, files: &mut BTreeMap<String, PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| Error::read(folder, e))? {
        let entry = entry.map_err(|e| Error::read(folder, e))?;
        let (name, path) = (entry.file_name(), entry.path());
        let name = format!("{above}{}", name.to_string_lossy());
        if path.is_dir() {
            list(&path, &format!("{name}/"), files)?;
        } else {
            files.insert(name, path);
        }
    }
    Ok(())
}

const REMEDY: &str = "give the folder of a trial made by this version";

/// Reads a JSON file; returns its value and the SHA-256 of its bytes.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<(T, String)> {
    let bytes = fs::read(path).map_err(|e| Error::read(path, e))?;
    let value = serde_json::from_slice(&bytes).map_err(|e| Error::Text {
        path: path.to_path_buf(),
        line: e.line(),
        what: e.to_string(),
        remedy: REMEDY,
    })?;
    Ok((value, sha256_hex(&bytes)))
}

/// Writes the file whole or not at all; returns the SHA-256 of its bytes.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<String> {
    Ok(sha256_hex(kinoise::io::write_json(path, value, REMEDY)?.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_hash_of_json_does_not_depend_on_the_order_of_keys() {
        let a = json!({"b": [1.5, null, "x\"y"], "a": {"d": 1e-7, "c": true}});
        let text = r#"{"a":{"c":true,"d":1e-7},"b":[1.5,null,"x\"y"]}"#;
        assert_eq!(hash_json(&a), sha256_hex(text.as_bytes()));
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
