//! The views that a diagnosis asks for.

use std::path::Path;

use serde::Deserialize;

use super::wanted::{Pose, Tolerance, Wanted, WantedView};
use crate::error::{Error, Result};
use crate::read::{plainly, read_json};

/// The part of `diagnosis.json` that is used here.
#[derive(Deserialize)]
struct Diagnosis {
    findings: Vec<Finding>,
    /// Views that were diagnosed.
    #[serde(default)]
    views: Vec<KnownView>,
}

#[derive(Deserialize)]
struct Finding {
    next_view: Option<NextView>,
}

#[derive(Deserialize)]
struct NextView {
    z_m: f64,
    theta_rad: f64,
    azimuth_rad: f64,
    why: String,
}

#[derive(Deserialize)]
struct KnownView {
    name: String,
}

impl Wanted {
    /// The views that a diagnosis asks for (`diagnosis.json`). A view that it has already seen does not count
    /// as taken: a new one at the same pose gets a number.
    /// Fails if the file is not a diagnosis, advises nothing, or advises an impossible pose.
    pub fn advised(path: &Path) -> Result<Self> {
        let text = read_json(path)?;
        let remedy = "give the diagnosis.json that kinoise diagnose wrote";
        let diagnosis: Diagnosis = serde_json::from_str(&text)
            .map_err(|e| Error::text(path, e.line(), plainly(&e), remedy))?;
        let mut views: Vec<WantedView> = Vec::new();
        for next in diagnosis.findings.into_iter().filter_map(|f| f.next_view) {
            let NextView { z_m, theta_rad, azimuth_rad, why } = next;
            let possible = (0.1..=9.99).contains(&z_m)
                && (0.0..=88f64.to_radians()).contains(&theta_rad)
                && azimuth_rad.abs() < 100.0;
            if !possible {
                let what = format!("no board stands at {z_m} m, {theta_rad} rad");
                return Err(Error::text(path, 0, what, remedy));
            }
            let tolerance = Tolerance {
                z_m: 0.1 * z_m,
                theta_rad: 5f64.to_radians(),
                azimuth_rad: Some(20f64.to_radians()),
            };
            let pose = Pose { z_m, theta_rad, azimuth_rad };
            let mut view = WantedView::new(pose, tolerance, Some(why));
            view.name = unseen(&view.name, &diagnosis.views);
            if views.iter().all(|v| v.name != view.name) {
                views.push(view);
            }
        }
        if views.is_empty() {
            let remedy = "leave --advise out to take the paper's grid";
            return Err(Error::text(path, 0, "the diagnosis advises no further view", remedy));
        }
        Ok(Wanted { views, any: false })
    }
}

/// `name`, or `name-2` and so on: the first that is not among the views seen.
fn unseen(name: &str, seen: &[KnownView]) -> String {
    let is_new = |candidate: &String| seen.iter().all(|v| v.name != *candidate);
    let numbered = (2..seen.len() + 3).map(|n| format!("{name}-{n}"));
    [name.to_string()].into_iter().chain(numbered).find(is_new).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Result<Vec<String>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Ok(Wanted::advised(file.path())?.views.into_iter().map(|v| v.name).collect())
    }

    const FACING: &str =
        r#"{"next_view": {"z_m": 1.5, "theta_rad": 0.0, "azimuth_rad": 0.0, "why": "a or b"}}"#;

    #[test]
    fn what_the_diagnosis_has_seen_does_not_count_as_taken() {
        let diagnosis =
            |views: &str| format!(r#"{{"findings": [{FACING}, {FACING}], "views": {views}}}"#);
        assert_eq!(names(&diagnosis("[]")).unwrap(), ["z150-t00"]);
        assert_eq!(names(&diagnosis(r#"[{"name": "z150-t00"}]"#)).unwrap(), ["z150-t00-2"]);
        let twice = diagnosis(r#"[{"name": "z150-t00"}, {"name": "z150-t00-2"}]"#);
        assert_eq!(names(&twice).unwrap(), ["z150-t00-3"]);
    }

    #[test]
    fn a_pose_that_cannot_be_is_refused() {
        let far = FACING.replace("1.5", "-3.0");
        let refused = names(&format!(r#"{{"findings": [{far}]}}"#)).unwrap_err().to_string();
        assert!(refused.contains("no board stands at -3 m"), "{refused}");
    }
}
