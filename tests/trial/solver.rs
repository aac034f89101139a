//! Diagnosis in a separate process that can reach one set and nothing else.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant, SystemTime};

use kinoise::calibrate::paper_model;
use kinoise::diagnose::{DiagnoseOptions, Verdict, diagnose, diagnose_against};
use kinoise::error::Result;
use kinoise::io::{Assumed, open, pretty_json, sha256_hex, write_atomic};
use kinoise::{Error, NoiseModel, Recording};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Hidden subcommand that confines itself and diagnoses.
const SUBCOMMAND: &str = "solve";
/// The solver's set and output folders, relative to its working directory.
const DATA: [&str; 2] = [".", "../out"];
/// Exit code of a mismatch, as of `kinoise diagnose`.
const MISMATCH: u8 = 1;

/// The diagnosis of one set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The diagnosis without its curves; they are in `diagnoses/`.
    pub verdict: Option<Value>,
    /// Why there is no verdict.
    pub failure: Option<String>,
    pub diagnosis_sha256: Option<String>,
}

/// An answer and how it was obtained.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Solved {
    #[serde(flatten)]
    pub answer: Answer,
    /// SHA-256 of its `model.json`.
    #[serde(default)]
    pub model_sha256: Option<String>,
    /// What confined the process.
    pub confinement: String,
    /// Duration; depends on the machine.
    pub seconds: f64,
}

impl Answer {
    /// Answer from the bytes of a `diagnosis.json`, or from the reason why there are none.
    pub fn of(diagnosis: std::result::Result<Vec<u8>, String>) -> Self {
        let read = diagnosis.and_then(|bytes| {
            let verdict = serde_json::from_slice(&bytes).map_err(|e| e.to_string())?;
            Ok((sha256_hex(&bytes), without_curves(verdict)))
        });
        match read {
            Ok((hash, verdict)) => {
                Answer { verdict: Some(verdict), failure: None, diagnosis_sha256: Some(hash) }
            }
            Err(why) => Answer { verdict: None, failure: Some(why), diagnosis_sha256: None },
        }
    }
}

/// Diagnoses the set in `scratch/set` in a process of `program`, which writes to `scratch/out`. A failed
/// diagnosis is an answer too.
pub fn solve(program: &Path, limit: Duration, scratch: &Path) -> Result<Solved> {
    let out = scratch.join("out");
    fs::create_dir_all(&out).map_err(|e| Error::write(&out, e))?;
    let begin = Instant::now();
    let ended = run(program, limit, scratch)?;
    let seconds = begin.elapsed().as_secs_f64();
    let text = |file: &str| fs::read_to_string(scratch.join(file)).unwrap_or_default();
    let answer = Answer::of(match ended {
        None => Err(format!("no answer within {} s", limit.as_secs())),
        Some(status) if !matches!(status.code(), Some(0 | 1)) => {
            Err(format!("{status}: {}", text("stderr").lines().last().unwrap_or_default()))
        }
        Some(_) => fs::read(out.join("diagnosis.json")).map_err(|e| e.to_string()),
    });
    let confinement = text("stdout").lines().next().unwrap_or("unknown").to_string();
    let model_sha256 = fs::read(out.join("model.json")).ok().map(|bytes| sha256_hex(&bytes));
    Ok(Solved { answer, model_sha256, confinement, seconds })
}

/// Runs the solver; `None` if it exceeded the limit and was killed.
fn run(program: &Path, limit: Duration, scratch: &Path) -> Result<Option<ExitStatus>> {
    let to = |name: &str| -> Result<File> {
        let path = scratch.join(name);
        File::create(&path).map_err(|e| Error::write(&path, e))
    };
    let failed = |e| Error::read(program, e);
    let begin = Instant::now();
    let mut child = Command::new(program)
        .arg(SUBCOMMAND)
        .current_dir(scratch.join("set"))
        .env_clear()
        .stdin(Stdio::null())
        .stdout(to("stdout")?)
        .stderr(to("stderr")?)
        .spawn()
        .map_err(failed)?;
    while begin.elapsed() <= limit {
        if let Some(status) = child.try_wait().map_err(failed)? {
            return Ok(Some(status));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().and_then(|()| child.wait()).map_err(failed)?;
    Ok(None)
}

/// Drops what serves only for drawing; the complete diagnosis keeps it.
fn without_curves(mut diagnosis: Value) -> Value {
    if let Some(findings) = diagnosis.get_mut("findings").and_then(Value::as_array_mut) {
        for finding in findings.iter_mut().filter_map(Value::as_object_mut) {
            finding.shift_remove("curve");
        }
    }
    if let Some(all) = diagnosis.as_object_mut() {
        all.retain(|key, _| !["map", "detectable", "views"].contains(&key.as_str()));
    }
    diagnosis
}

/// Solver process: confines itself, then does what `kinoise diagnose` does.
pub fn diagnose_shut_in() -> anyhow::Result<u8> {
    let [set, out] = DATA.map(Path::new);
    // Before any thread is started: threads that already run would stay unconfined.
    println!("{}", confine(set, out));
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let recording = open(&set.join("recording"), &Assumed::default())?;
    let options = DiagnoseOptions::default();
    let simulated = set.join("simulated");
    let done = if simulated.exists() {
        let simulated = open(&simulated, &Assumed::default())?;
        // The model's hash is published: it must not depend on the day.
        let day = Some(SystemTime::UNIX_EPOCH);
        let sigma = |recording: &Recording| paper_model(recording, options.seed, day, &|_, _| ());
        let model = sigma(&simulated).or_else(|_| sigma(&recording))?;
        diagnose_against(&recording, &simulated, &model, &options, &|_, _| ())?
    } else {
        let model = NoiseModel::read(&set.join("model.json"))?;
        diagnose(&recording, &model, &options, &|_, _| ())?
    };
    std::fs::create_dir_all(out)?;
    write_atomic(&out.join("diagnosis.json"), pretty_json(&done.diagnosis)?.as_bytes())?;
    done.model.write(&out.join("model.json"))?;
    Ok(if done.diagnosis.verdict == Verdict::Mismatch { MISMATCH } else { 0 })
}

/// Confines this process to reading below `read` and writing below `write`, without network. Returns what is
/// in force, and only what a test confirms.
#[cfg(target_os = "linux")]
fn confine(read: &Path, write: &Path) -> String {
    use landlock::{
        ABI, Access, AccessFs, AccessNet, CompatLevel, Compatible, LandlockStatus, Ruleset,
        RulesetAttr, RulesetCreatedAttr, RulesetError, Scope, path_beneath_rules,
    };
    let restrict = || -> std::result::Result<_, RulesetError> {
        let all = AccessFs::from_all(ABI::V5);
        Ruleset::default()
            // Restrictions that an older kernel lacks are left out; the status says so.
            .set_compatibility(CompatLevel::BestEffort)
            .handle_access(all)?
            .handle_access(AccessNet::from_all(ABI::V4))?
            .scope(Scope::from_all(ABI::V6))?
            .create()?
            .add_rules(path_beneath_rules([read], AccessFs::ReadFile | AccessFs::ReadDir))?
            .add_rules(path_beneath_rules([write], all))?
            .restrict_self()
    };
    // An unconfined process can list the root folder on every Linux.
    let shut = || fs::read_dir("/").is_err();
    match restrict().map(|status| status.landlock) {
        Ok(LandlockStatus::Available { effective_abi, .. }) if shut() => {
            format!("landlock ABI {}", effective_abi as i32)
        }
        Ok(_) => "not available on this kernel".into(),
        Err(e) => format!("not in force: {e}"),
    }
}

#[cfg(not(target_os = "linux"))]
fn confine(_read: &Path, _write: &Path) -> String {
    "not available on this system".into()
}
