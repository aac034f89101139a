//! Export of a model to the formats of other software, each with notes on what it cannot hold.
//!
//! ```text
//! model.json -> python, c: the whole model as a program
//!            -> npz, opencv: tables of sigma and of the correction
//!            -> clams, open3d: tables of the bias alone
//!            -> elevation-mapping, isaac: the noise in the parameters of a mapper and of a simulator
//!            -> camera-info: the intrinsics
//! ```

mod c;
mod camera_info;
mod clams;
mod elevation_mapping;
mod expressions;
mod isaac;
mod npz;
mod open3d;
mod opencv;
mod program;
mod python;
mod tables;

use crate::error::Result;
use crate::model::NoiseModel;

/// A file to be written.
#[derive(Debug, Clone)]
pub struct Exported {
    pub bytes: Vec<u8>,
    /// Sentences on what of the model the file does not hold, and what replaces it.
    pub notes: Vec<String>,
}

/// Formats that other software reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportFormat {
    Python,
    C,
    Npz,
    OpenCv,
    CameraInfo,
    ElevationMapping,
    Isaac,
    Clams,
    Open3d,
}

/// Converts `model` to a file of another format.
///
/// # Errors
/// When the model lacks what the format needs: a sensor, a baseline, an image of a certain size.
pub fn export(model: &NoiseModel, format: ExportFormat) -> Result<Exported> {
    match format {
        ExportFormat::Python => python::write(model),
        ExportFormat::C => c::write(model),
        ExportFormat::Npz => npz::write(model),
        ExportFormat::OpenCv => opencv::write(model),
        ExportFormat::CameraInfo => camera_info::write(model),
        ExportFormat::ElevationMapping => elevation_mapping::write(model),
        ExportFormat::Isaac => isaac::write(model),
        ExportFormat::Clams => clams::write(model),
        ExportFormat::Open3d => open3d::write(model),
    }
}
