//! `proof.json`: everything that was sealed, said, opened and counted.

use std::collections::BTreeMap;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::advice::SecondRound;
use super::gains::Gains;
use super::judge::{Judged, Marks, Scores};
use super::seal::Seal;
use crate::raytraced::question::Truth;
use kinoise::error::{Error, Result};
use kinoise::io::{self, sha256_hex};
use kinoise::model::Provenance;

pub const PROOF_FORMAT: &str = "kinoise-proof/1";
pub const PROOF_FILE: &str = "proof.json";
pub const SEAL_FILE: &str = "seal.json";
pub const VERDICTS_FILE: &str = "verdicts.json";
/// Complete diagnoses, by the name of the set.
pub const DIAGNOSES: &str = "diagnoses";

/// A finished trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Proof {
    pub format: String,
    pub provenance: Provenance,
    pub order: Ordered,
    pub scores: Scores,
    /// Of the files as they were written, before the first diagnosis and before the opening.
    pub seal_sha256: String,
    pub verdicts_sha256: String,
    pub seal: Seal,
    /// What kept the solver from the rest of the machine, and for how many sets.
    pub confinement: BTreeMap<String, usize>,
    /// In the order in which they were put.
    pub sets: Vec<ProvenSet>,
    /// Advised views taken; older trials have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<SecondRound>,
}

/// What the trial was made from: the same again gives the same sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ordered {
    pub sets: usize,
    pub seed: u64,
    /// With real recordings.
    pub real: bool,
}

/// One set with everything about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProvenSet {
    pub name: String,
    pub salt: String,
    pub truth: Truth,
    /// The diagnosis without its curves; they are in `diagnoses/`.
    pub verdict: Option<Value>,
    pub failure: Option<String>,
    pub diagnosis_sha256: Option<String>,
    pub verdict_sha256: Option<String>,
    pub marks: Marks,
    pub gains: Option<Gains>,
    /// Ids of the catalogue by baseline, best first.
    #[serde(default)]
    pub named_by_others: BTreeMap<String, Vec<String>>,
    /// The diagnosis took so long; nothing else here depends on the machine.
    pub seconds: f64,
}

impl ProvenSet {
    pub fn judged(&self) -> Judged<'_> {
        Judged {
            truth: &self.truth,
            marks: &self.marks,
            gains: self.gains.as_ref(),
            named_by_others: &self.named_by_others,
        }
    }
}

impl Proof {
    /// Read `proof.json` of a folder.
    ///
    /// # Errors
    /// When it is not there or not a proof.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(PROOF_FILE);
        let proof: Proof = read_json(&path)?.0;
        if proof.format != PROOF_FORMAT {
            return Err(foreign(&path, format!("format \"{}\"", proof.format)));
        }
        Ok(proof)
    }
}

/// `verdicts.json`: written when all is said and nothing is opened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdicts {
    pub format: String,
    pub seal_sha256: String,
    pub verdicts: Vec<VerdictLine>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VerdictLine {
    pub name: String,
    pub diagnosis_sha256: Option<String>,
    pub verdict_sha256: Option<String>,
    pub failure: Option<String>,
}

pub const VERDICTS_FORMAT: &str = "kinoise-verdicts/1";

/// What a JSON file holds, and the hash of its bytes.
///
/// # Errors
/// When it is not there or something else.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<(T, String)> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
    let value = serde_json::from_slice(&bytes).map_err(|e| foreign(path, e.to_string()))?;
    Ok((value, sha256_hex(&bytes)))
}

const REMEDY: &str = "give the folder of a trial made by this version of kinoise prove";

fn foreign(path: &Path, what: String) -> Error {
    Error::Json { path: path.to_path_buf(), line: 0, what, remedy: REMEDY }
}

/// Write whole or not at all; the hash of the bytes.
///
/// # Errors
/// When the disk refuses.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<String> {
    Ok(sha256_hex(io::write_json(path, value, REMEDY)?.as_bytes()))
}
