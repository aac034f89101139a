//! A diagnosis by another process, which gets one set and nothing else.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::seal::{canonical, hash_folder};
use super::verdict::reduced;
use crate::raytraced::question::Sealed;
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;

/// The hidden subcommand that shuts itself in and diagnoses.
const SUBCOMMAND: &str = "solve";

/// What the solver calls its set and its answer, seen from the folder it is started in.
pub const DATA: [&str; 2] = [".", "../out"];

/// What came of one set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solved {
    pub name: String,
    /// Of `diagnosis.json`, every byte.
    pub diagnosis_sha256: Option<String>,
    /// Of `verdict` as compact JSON with sorted keys.
    pub verdict_sha256: Option<String>,
    /// The diagnosis without its curves.
    pub verdict: Option<Value>,
    /// Why there is none.
    pub failure: Option<String>,
    /// What kept the process from the rest of the machine.
    pub confinement: String,
    /// Depends on the machine.
    pub seconds: f64,
}

/// How every set is diagnosed.
pub struct Solver<'a> {
    pub program: &'a Path,
    pub seed: u64,
    pub limit: Duration,
}

impl Solver<'_> {
    /// Diagnose the set in `scratch/set`; the answer goes to `scratch/out`.
    ///
    /// # Errors
    /// When the disk or the system refuses; a diagnosis that fails is an answer.
    pub fn solve(&self, name: &str, scratch: &Path) -> Result<Solved> {
        let (set, out) = (scratch.join("set"), scratch.join("out"));
        fs::create_dir_all(&out).map_err(|e| Error::write(&out, e))?;
        let begin = Instant::now();
        let ended = self.run(&set, scratch)?;
        let seconds = begin.elapsed().as_secs_f64();
        let said = fs::read_to_string(scratch.join("stdout")).unwrap_or_default();
        let confinement = said.lines().next().unwrap_or("not told").to_string();
        let blank = Solved {
            name: name.into(),
            diagnosis_sha256: None,
            verdict_sha256: None,
            verdict: None,
            failure: None,
            confinement,
            seconds,
        };
        let failed = |why: String| Ok(Solved { failure: Some(why), ..blank.clone() });
        match ended {
            None => return failed(format!("no answer within {} s", self.limit.as_secs())),
            Some(status) if !matches!(status.code(), Some(0 | 1)) => {
                let errors = fs::read_to_string(scratch.join("stderr")).unwrap_or_default();
                let last = errors.lines().last().unwrap_or_default();
                return failed(format!("{status}: {last}"));
            }
            Some(_) => {}
        }
        let Ok(bytes) = fs::read(out.join("diagnosis.json")) else {
            return failed("no diagnosis.json was written".into());
        };
        let Ok(diagnosis) = serde_json::from_slice(&bytes) else {
            return failed("diagnosis.json is not JSON".into());
        };
        let verdict = reduced(&diagnosis);
        Ok(Solved {
            diagnosis_sha256: Some(sha256_hex(&bytes)),
            verdict_sha256: Some(verdict_hash(&verdict)),
            verdict: Some(verdict),
            ..blank
        })
    }

    /// `None` when it had to be ended.
    fn run(&self, set: &Path, scratch: &Path) -> Result<Option<ExitStatus>> {
        let to = |name: &str| -> Result<File> {
            let path = scratch.join(name);
            File::create(&path).map_err(|e| Error::write(&path, e))
        };
        let mut child = Command::new(self.program)
            .arg(SUBCOMMAND)
            .current_dir(set)
            .env_clear()
            // The same model file every time.
            .env("SOURCE_DATE_EPOCH", "0")
            .stdin(Stdio::null())
            .stdout(to("stdout")?)
            .stderr(to("stderr")?)
            .spawn()
            .map_err(|e| Error::read(self.program, e))?;
        wait(&mut child, self.limit).map_err(|e| Error::read(self.program, e))
    }
}

fn wait(child: &mut Child, limit: Duration) -> std::io::Result<Option<ExitStatus>> {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if begin.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// SHA-256 of the canonical text.
pub fn verdict_hash(verdict: &Value) -> String {
    sha256_hex(canonical(verdict).as_bytes())
}

/// Make a set's folder, and only it.
///
/// # Errors
/// When the disk refuses.
pub fn make(sealed: &dyn Sealed, scratch: &Path) -> Result<String> {
    if scratch.exists() {
        fs::remove_dir_all(scratch).map_err(|e| Error::write(scratch, e))?;
    }
    let set = scratch.join("set");
    fs::create_dir_all(&set).map_err(|e| Error::write(&set, e))?;
    sealed.write(&set)?;
    hash_folder(&set)
}
