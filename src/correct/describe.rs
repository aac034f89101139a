//! Saying what the words of a folder mean once they are in another code.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::again::Again;
use super::recording::Job;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::io::{DESCRIPTION, Layout, pretty_json, write_atomic, write_recording_file};
use crate::view::Sensor;

impl Again<'_> {
    /// Say in recording.json what the words mean now; what else it says stays.
    pub fn describe(&self, jobs: &[Job]) -> Result<()> {
        let sensor = Sensor { code: self.code, ..self.sensor.clone() };
        match self.layout {
            Layout::Images => Ok(()),
            Layout::Dump => {
                self.list(jobs)?;
                write_recording_file(self.output, &sensor)
            }
            Layout::Recording | Layout::Sequence => {
                let path = self.output.join(DESCRIPTION);
                match std::fs::read_to_string(&path) {
                    Ok(text) => write_atomic(&path, with_code(&text, &self.code)?.as_bytes()),
                    Err(_) => write_recording_file(self.output, &sensor),
                }
            }
        }
    }

    fn list(&self, jobs: &[Job]) -> Result<()> {
        let mut list = String::from("# timestamp path\n");
        for job in jobs {
            let _ =
                writeln!(list, "{:.6} {}", job.timestamp, job.file.with_extension("png").display());
        }
        write_atomic(&self.output.join("depth.txt"), list.as_bytes())
    }
}

/// The text of recording.json with another code.
fn with_code(text: &str, code: &DepthCode) -> Result<String> {
    let failed = |e: serde_json::Error| Error::Argument {
        what: format!("{DESCRIPTION}: {e}"),
        remedy: "compare it with the recording layout in the README",
    };
    let mut value: Value = serde_json::from_str(text).map_err(failed)?;
    if let (Some(map), DepthCode::Metric { units_per_metre, invalid }) =
        (value.as_object_mut(), code)
    {
        map.shift_remove("raw_disparity");
        map.insert("units_per_metre".into(), json!(units_per_metre));
        map.insert("invalid".into(), json!(invalid));
    }
    pretty_json(&value).map_err(failed)
}
