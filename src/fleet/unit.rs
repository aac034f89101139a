//! Reads and names models of one kind of sensor, and refuses those that cannot be compared.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::error::{Error, Result};
use crate::model::NoiseModel;
use crate::units::counted;
use crate::view::RecordingFile;

/// A model and its file.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitModel {
    pub path: PathBuf,
    pub model: NoiseModel,
}

/// Least degrees of freedom of a sigma: at two or fewer Student's t has no variance, so errors are unknown.
const MIN_DEGREES_OF_FREEDOM: f64 = 3.0;

impl UnitModel {
    /// Reads a `model.json`, or the one in a folder.
    pub fn read(path: &Path) -> Result<Self> {
        let file = NoiseModel::file(path);
        Ok(UnitModel { model: NoiseModel::read(&file)?, path: file })
    }

    /// The serial number, or the name of the folder for a unit without one.
    pub fn name(&self) -> String {
        let folder = || Some(self.path.parent()?.file_name()?.to_string_lossy().into_owned());
        let own = || self.path.display().to_string();
        self.serial().map(String::from).or_else(folder).unwrap_or_else(own)
    }

    pub fn serial(&self) -> Option<&str> {
        self.model.sensor.as_ref()?.serial.as_deref().filter(|s| !s.trim().is_empty())
    }

    pub(super) fn created(&self) -> Option<SystemTime> {
        humantime::parse_rfc3339(&self.model.provenance.created).ok()
    }

    fn refused(&self, what: impl Into<String>, remedy: &'static str) -> Error {
        Error::recording(&self.path, what, remedy)
    }

    fn sensor(&self) -> Result<&RecordingFile> {
        self.model.sensor.as_ref().ok_or_else(|| {
            self.refused(
                "it is of a bare table and does not say which sensor it is of",
                "calibrate recordings of the units: `kinoise calibrate RECORDING -o DIR`",
            )
        })
    }

    /// Fails if the uncertainty of sigma is unknown.
    fn check_errors(&self) -> Result<()> {
        let sigma = &self.model.sigma;
        if sigma.covariance.iter().all(|v| *v == 0.0) {
            return Err(self.refused(
                "its sigma has no covariance, so no difference from it can be judged",
                "give models made by `kinoise calibrate`",
            ));
        }
        if sigma.degrees_of_freedom < MIN_DEGREES_OF_FREEDOM {
            let what = format!(
                "it was fitted to {}, too few to say how sure it is ({} degrees of freedom; {MIN_DEGREES_OF_FREEDOM} are needed)",
                counted(self.model.fit.views, "view"),
                sigma.degrees_of_freedom
            );
            return Err(self.refused(what, "record more views of this unit"));
        }
        Ok(())
    }

    /// Identification of the recording it was made from, if any.
    fn source(&self) -> Option<String> {
        let hashes = &self.model.provenance.sha256;
        let frames = || Some(hashes.get("frames")?.as_str()?.to_string());
        frames().or_else(|| (!hashes.is_empty()).then(|| format!("{hashes:?}")))
    }

    /// The kind of standard deviation that its sigma is, in words.
    fn kind_of_sigma(&self) -> Option<&str> {
        self.model.provenance.options.get("sigma")?.as_str()
    }
}

/// Fails if the models cannot be compared; otherwise returns remarks.
pub(super) fn check(units: &[UnitModel]) -> Result<Vec<String>> {
    let Some((first, others)) = units.split_first().filter(|(_, others)| !others.is_empty()) else {
        return Err(Error::Argument {
            what: match units {
                [] => "no model was given".into(),
                _ => "one model has nothing to be compared with".into(),
            },
            remedy: "give the model.json of two or more units of a kind, or of one unit at two dates",
        });
    };
    let sensor = first.sensor()?;
    for unit in units {
        unit.check_errors()?;
    }
    for unit in others {
        if let Some(what) = other_kind(sensor, unit.sensor()?) {
            let what = format!("{what} (in {})", first.path.display());
            return Err(unit.refused(what, "give units of one kind and one mode"));
        }
        if let (Some(a), Some(b)) = (first.kind_of_sigma(), unit.kind_of_sigma())
            && a != b
        {
            let what = format!("its sigma is the {b}, that of {} the {a}", first.path.display());
            return Err(unit.refused(what, "calibrate all units with the same options"));
        }
    }
    for (i, unit) in units.iter().enumerate() {
        let source = unit.source();
        let twin = units[..i].iter().find(|u| source.is_some() && u.source() == source);
        if let Some(twin) = twin {
            let what = format!("it was made of the same frames as {}", twin.path.display());
            return Err(unit.refused(what, "give each measurement once"));
        }
    }
    Ok(remarks(units))
}

/// Describes how the second recording is of another kind of unit, if it is.
fn other_kind(first: &RecordingFile, other: &RecordingFile) -> Option<String> {
    if first.sensor != other.sensor {
        return Some(format!("its sensor is \"{}\", not \"{}\"", other.sensor, first.sensor));
    }
    let size = |r: &RecordingFile| (r.camera.width, r.camera.height);
    let ((w, h), (ow, oh)) = (size(first), size(other));
    if (w, h) != (ow, oh) {
        return Some(format!("its pictures have {ow} x {oh} px, not {w} x {h}"));
    }
    // A recording that does not state its mode is taken to be in the normal one.
    let mode = |r: &RecordingFile| r.mode.clone().unwrap_or_else(|| "normal".into());
    (mode(first) != mode(other))
        .then(|| format!("it is of the mode \"{}\", not \"{}\"", mode(other), mode(first)))
}

fn remarks(units: &[UnitModel]) -> Vec<String> {
    let nameless = units.iter().filter(|u| u.serial().is_none());
    let nameless = nameless.map(|u| {
        format!(
            "{}: it has no serial and is taken for a unit of its own; write \"serial\" into recording.json to follow a unit over time",
            u.path.display()
        )
    });
    let raw = |u: &UnitModel| u.model.sensor.as_ref().is_some_and(|s| s.raw_disparity.is_some());
    let some_raw = units.iter().any(raw) && !units.iter().all(raw);
    let codes = some_raw.then(|| {
        "some units store raw disparities and some millimetres or the like: rounding differs and is part of sigma".into()
    });
    nameless.chain(codes).collect()
}
