//! Writes a sigma image for every depth image of a sequence, for use as weights.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::correction::{Conditions, Correction};
use super::rewrite::{SIGMA_UNITS_PER_METRE, TOP, sigma_word};
use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::{encode_png16, write_atomic, write_json};
use crate::model::NoiseModel;
use crate::sequence::{Moment, Sequence};

/// Statistics of the written images.
#[derive(Debug, Clone, Default)]
pub struct SigmaImages {
    pub frames: usize,
    /// Pixels with a depth, in all frames.
    pub measured: usize,
    /// Pixels whose sigma exceeds the range of an image; its largest value is written.
    pub clamped: usize,
    /// Pixels at a depth outside the range where sigma was measured; sigma is held at the edge.
    pub beyond: usize,
    /// Mean sigma of the measured pixels, m.
    pub mean_m: f64,
    /// Where the model does not match the sequence's sensor, and what sigma lacks.
    pub remarks: Vec<String>,
}

/// Writes into `output` 16-bit `sigma/*.png` in units of 10 um ([`SIGMA_UNITS_PER_METRE`]), 0 where there is
/// no depth; `sigma.txt`, a TUM list of their stamps and paths; and `sigma.json`, which describes the values.
/// An image has the name of its depth image.
/// Fails if the model is of another sensor, a depth image cannot be read, or `output` cannot be written.
pub fn sigma_images(
    sequence: &Sequence,
    model: &NoiseModel,
    output: &Path,
    progress: Progress<'_>,
) -> Result<SigmaImages> {
    let correction = Correction::of(model, &sequence.sensor)?;
    let table = sequence.sensor.code.table();
    let folder = output.join("sigma");
    std::fs::create_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
    let names = names(&sequence.moments);
    let done = AtomicUsize::new(0);
    let [near, far] = model.sigma.domain.z_m;
    let one = |(moment, name): (&Moment, &String)| -> Result<SigmaImages> {
        let depth = table.depths(&sequence.depth(moment)?);
        let sigma = correction.sigma_m(&depth, &Conditions::of(moment, sequence))?;
        let mut found = SigmaImages { frames: 1, ..SigmaImages::default() };
        for (z, sigma) in depth.iter().zip(&sigma).filter(|(_, s)| s.is_finite()) {
            found.measured += 1;
            found.mean_m += sigma;
            found.clamped += usize::from(sigma * SIGMA_UNITS_PER_METRE > TOP);
            found.beyond += usize::from(!(near..=far).contains(&f64::from(*z)));
        }
        let camera = &sequence.sensor.camera;
        let raw = sigma.iter().map(|s| sigma_word(*s)).collect();
        let frame = Frame { width: camera.width, height: camera.height, raw };
        write_atomic(&folder.join(name), &encode_png16(&frame)?)?;
        progress.step(done.fetch_add(1, Ordering::Relaxed) + 1, sequence.moments.len());
        Ok(found)
    };
    // The first error in frame order, not the first that a thread meets.
    let all: Vec<Result<_>> = sequence.moments.par_iter().zip(&names).map(one).collect();
    let all = all.into_iter().collect::<Result<Vec<_>>>()?;
    let mut list = String::from("# timestamp path\n");
    for (moment, name) in sequence.moments.iter().zip(&names) {
        // Writing to a String does not fail.
        let _ = writeln!(list, "{:.6} sigma/{name}", moment.stamp);
    }
    write_atomic(&output.join("sigma.txt"), list.as_bytes())?;
    let about = serde_json::json!({
        "format": "kinoise-sigma/1",
        "quantity": "standard deviation of the stored depth along the optical axis, as the model predicts it",
        "unit": "m",
        "units_per_metre": SIGMA_UNITS_PER_METRE,
        "invalid": 0,
        "valid": model.sigma.domain,
    });
    write_json(&output.join("sigma.json"), &about, "report this as a bug")?;
    let mut sum = all.into_iter().fold(SigmaImages::default(), SigmaImages::and);
    sum.mean_m /= sum.measured.max(1) as f64;
    let first = sequence.moments.first();
    let conditions = first.map_or_else(Conditions::default, |m| Conditions::of(m, sequence));
    sum.remarks = correction.remarks_on_sigma(&conditions);
    Ok(sum)
}

impl SigmaImages {
    fn and(self, other: SigmaImages) -> SigmaImages {
        SigmaImages {
            frames: self.frames + other.frames,
            measured: self.measured + other.measured,
            clamped: self.clamped + other.clamped,
            beyond: self.beyond + other.beyond,
            mean_m: self.mean_m + other.mean_m,
            remarks: Vec::new(),
        }
    }
}

/// File names: those of the depth images if they are unique, otherwise the stamps.
fn names(moments: &[Moment]) -> Vec<String> {
    let of = |m: &Moment| {
        let stem = m.depth.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let stem = stem.strip_suffix(".depth").unwrap_or(&stem);
        format!("{stem}.png")
    };
    let named: Vec<String> = moments.iter().map(of).collect();
    let unique: HashSet<&String> = named.iter().collect();
    if unique.len() == named.len() {
        return named;
    }
    moments.iter().map(|m| format!("{:.6}.png", m.stamp)).collect()
}
