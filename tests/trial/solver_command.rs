//! The solver of a blind trial: what `kinoise diagnose` does, by a process that can reach one set
//! only.

use std::path::Path;

use kinoise::diagnose::{DiagnoseOptions, Verdict, diagnose, diagnose_against};
use kinoise::io::{Assumed, OutputDir, open};
use kinoise::{CalibrateOptions, Form, NoiseModel, Recording};

use crate::{DATA, confine};

/// A mismatch was found.
const FOUND: u8 = 1;

pub fn run() -> anyhow::Result<u8> {
    let [set, out] = DATA.map(Path::new);
    // Before any thread is started.
    println!("{}", confine(set, out));
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let recording = open(&set.join("recording"), &Assumed::default())?;
    let options = DiagnoseOptions::default();
    let silent = |_, _| ();
    let simulated = set.join("simulated");
    let done = if simulated.exists() {
        let simulated = open(&simulated, &Assumed::default())?;
        let model = calibrated(&simulated).or_else(|_| calibrated(&recording))?;
        diagnose_against(&recording, &simulated, &model, &options, &silent)?
    } else {
        let file = set.join("model.json");
        let model = if file.exists() { NoiseModel::read(&file)? } else { calibrated(&recording)? };
        diagnose(&recording, &model, &options, &silent)?
    };
    let folder = OutputDir::create(out)?;
    let json = serde_json::to_value(&done.diagnosis)?;
    folder.write("diagnosis.json", format!("{json:#}\n").as_bytes())?;
    done.model.write(&folder.path().join("model.json"))?;
    Ok(if done.diagnosis.verdict == Verdict::Mismatch { FOUND } else { 0 })
}

fn calibrated(recording: &Recording) -> anyhow::Result<NoiseModel> {
    let options = CalibrateOptions { form: Some(Form::Paper), ..Default::default() };
    let views = kinoise::measure_recording(recording, &options.measure, &|_, _| ())?;
    Ok(kinoise::model_of(recording, &views, &options)?.model)
}
