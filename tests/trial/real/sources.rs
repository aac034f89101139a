//! Which real recordings of a plane lie in a folder of data.

use std::path::{Path, PathBuf};

use kinoise::error::{Error, Result};
use kinoise::frame::{DepthCode, KINECT_NO_MEASUREMENT};
use kinoise::io::{Assumed, open};
use kinoise::view::Recording;

/// A recording of a planar target, and what must be known to read it.
#[derive(Debug, Clone)]
pub struct Source {
    pub path: PathBuf,
    pub assumed: Assumed,
    /// Views whose names begin with this show something else than one plane.
    other: Option<&'static str>,
}

/// The bare pictures that carry no description of their own: a second Kinect v1, whose disparities
/// somebody converted with these numbers; the rooms among them are called test*.
const UNDESCRIBED: &str = "kinect-v1-second-unit";
const SECOND: [f64; 4] = [585.0, 585.0, 319.5, 239.5];
const SECOND_CODE: DepthCode =
    DepthCode::Disparity { offset: 3.3309, slope: -0.003_071_1, invalid: KINECT_NO_MEASUREMENT };
const KINECT_BASELINE_M: f64 = 0.075;

/// The recordings in `data`, in name order: `data` itself, its folders, and `recording/` in these,
/// wherever a `recording.json` describes them.
pub fn recordings(data: &Path) -> Vec<Source> {
    let own = |path: PathBuf| Source { path, assumed: Assumed::default(), other: None };
    let described = |path: &Path| path.join(kinoise::io::DESCRIPTION).is_file();
    if described(data) {
        return vec![own(data.to_path_buf())];
    }
    let Ok(entries) = std::fs::read_dir(data) else { return Vec::new() };
    let mut folders: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    folders.sort();
    let source = |folder: PathBuf| {
        let inner = folder.join("recording");
        if described(&folder) {
            Some(own(folder))
        } else if described(&inner) {
            Some(own(inner))
        } else if folder.file_name().is_some_and(|n| n == UNDESCRIBED) {
            Some(second_unit(folder))
        } else {
            None
        }
    };
    folders.into_iter().filter_map(source).collect()
}

fn second_unit(path: PathBuf) -> Source {
    let assumed = Assumed {
        intrinsics: Some(SECOND),
        code: Some(SECOND_CODE),
        baseline_m: Some(KINECT_BASELINE_M),
    };
    Source { path, assumed, other: Some("test") }
}

impl Source {
    /// With the views that show a plane.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(&self) -> Result<Recording> {
        let mut recording = open(&self.path, &self.assumed)?;
        if let Some(other) = self.other {
            recording.views.retain(|v| !v.name.starts_with(other));
        }
        Ok(recording)
    }
}

/// # Errors
/// When there is none.
pub(super) fn required(data: &Path) -> Result<Vec<Source>> {
    let sources = recordings(data);
    if sources.is_empty() {
        return Err(Error::Argument {
            what: format!("{}: no real recording of a plane is here", data.display()),
            remedy: "give the folder of a recording (recording.json and a folder a view), or one \
                     that holds some; or leave the real sets out",
        });
    }
    Ok(sources)
}
