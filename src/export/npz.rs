//! NumPy's archive of arrays: an uncompressed zip of .npy files (numpy.lib.format).

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::Exported;
use super::program::correction_of;
use super::tables::{SigmaTable, even, frontal, notes_of_bias};
use crate::error::{Error, Result};
use crate::model::NoiseModel;

/// Depths of the correction, evenly spaced in disparity: linear interpolation reproduces a bowl that grows
/// with the square of the disparity to a hundredth.
const DEPTHS: usize = 9;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let sigma = SigmaTable::of(model);
    let mut archive = Archive(ZipWriter::new(Cursor::new(Vec::new())));
    let doubles = |numbers: &[f64]| numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut put = |name: &str, shape: &[usize], numbers: &[f64]| {
        archive.add(name, &array("<f8", shape, doubles(numbers)))
    };
    let (n, m) = (sigma.z_m.len(), sigma.theta_rad.len());
    put("sigma_z_m", &[n], &sigma.z_m)?;
    put("sigma_theta_rad", &[m], &sigma.theta_rad)?;
    put("sigma_m", &[n, m], &sigma.sigma_m)?;
    let mut notes = Vec::new();
    match correction_of(model)? {
        None => notes.push("the model has no sensor: sigma's table alone is in the file".into()),
        Some((_, correction)) => {
            let camera = &correction.camera;
            put("intrinsics", &[4], &[camera.fx, camera.fy, camera.cx, camera.cy])?;
            put("distortion", &[5], &camera.distortion.unwrap_or_default())?;
            let [near, far] = model.sigma.domain.z_m;
            let depths: Vec<f64> =
                even([1.0 / far, 1.0 / near], DEPTHS).iter().rev().map(|q| 1.0 / q).collect();
            put("correction_z_m", &[DEPTHS], &depths)?;
            let mut all = Vec::new();
            for &depth in &depths {
                let stored = f64::from(depth as f32);
                let corrected = frontal(&correction, depth)?;
                all.extend(corrected.iter().flat_map(|z| ((z - stored) as f32).to_le_bytes()));
            }
            let shape = [DEPTHS, camera.height, camera.width];
            archive.add("correction_m", &array("<f4", &shape, all))?;
            notes = notes_of_bias(&correction);
            if !correction.variance.is_empty() {
                notes.push(
                    "what changes the noise beside depth and tilt is not in the table".into(),
                );
            }
        }
    }
    Ok(Exported { bytes: archive.finish()?, notes })
}

/// An .npy file, version 1.0.
fn array(kind: &str, shape: &[usize], data: Vec<u8>) -> Vec<u8> {
    let sizes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sizes}), }}");
    // Ten bytes precede the header, a newline ends it, and the total is a multiple of 64.
    let padding = 63 - (head.len() + 10) % 64;
    head.push_str(&" ".repeat(padding));
    head.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((head.len() as u16).to_le_bytes());
    file.extend(head.as_bytes());
    file.extend(data);
    file
}

/// An uncompressed zip whose bytes do not depend on the time.
struct Archive(ZipWriter<Cursor<Vec<u8>>>);

impl Archive {
    fn add(&mut self, name: &str, data: &[u8]) -> Result<()> {
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        let options = stored.last_modified_time(DateTime::default());
        self.0.start_file(format!("{name}.npy"), options).map_err(failed)?;
        self.0.write_all(data).map_err(failed)
    }

    fn finish(self) -> Result<Vec<u8>> {
        Ok(self.0.finish().map_err(failed)?.into_inner())
    }
}

fn failed(e: impl std::fmt::Display) -> Error {
    Error::Drawing { what: "NPZ", why: e.to_string() }
}
