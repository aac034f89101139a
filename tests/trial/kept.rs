//! The curves of a trial's diagnoses, for whoever draws them.

use std::path::Path;

use serde::Deserialize;

use super::proof::{DIAGNOSES, ProvenSet, read_json};

/// The first finding's curve; gaps are `None`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub struct KeptCurve {
    /// What x is, with its unit.
    pub x_label: String,
    pub y_label: String,
    pub x: Vec<Option<f64>>,
    /// Measured, bin by bin.
    pub y: Vec<Option<f64>>,
    pub y_std_error: Vec<Option<f64>>,
    /// As the extended model has it.
    pub model: Vec<Option<f64>>,
}

#[derive(Deserialize)]
struct Kept {
    findings: Vec<KeptFinding>,
}

#[derive(Deserialize)]
struct KeptFinding {
    status: String,
    curve: Option<KeptCurve>,
}

/// The curve of the first thing that was claimed of a set, from the diagnosis kept in `folder`.
/// `None` where nothing was claimed or kept, or where the file is not the one that was hashed.
pub fn kept_curve(folder: &Path, set: &ProvenSet) -> Option<KeptCurve> {
    let path = folder.join(DIAGNOSES).join(format!("{}.json", set.name));
    let (kept, hash): (Kept, String) = read_json(&path).ok()?;
    if set.diagnosis_sha256.as_ref() != Some(&hash) {
        return None;
    }
    let claimed = kept.findings.into_iter().find(|f| f.status != "not-identifiable")?;
    claimed.curve.filter(|c| c.x.len() > 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Marks;
    use kinoise::io::sha256_hex;

    const TEXT: &str = r#"{"findings": [{"status": "not-identifiable"}, {"status": "named",
        "curve": {"x_label": "x", "y_label": "y", "x": [1, 2], "y": [3, null],
                  "y_std_error": [0.1, 0.1], "model": [3, 3]}}]}"#;

    #[test]
    fn only_the_diagnosis_that_was_hashed_is_drawn() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join(DIAGNOSES)).unwrap();
        std::fs::write(dir.path().join(DIAGNOSES).join("a.json"), TEXT).unwrap();
        let hash = sha256_hex(TEXT.as_bytes());
        let set: ProvenSet = serde_json::from_value(serde_json::json!({
            "name": "a", "salt": "", "marks": Marks::default(), "seconds": 1.0,
            "diagnosis_sha256": hash, "verdict_sha256": null, "verdict": null, "failure": null,
            "gains": null,
            "truth": {"asked": {"world": "rays", "cell": "null", "nats": null, "seed": 1, "small": true},
                      "hidden": [], "base": null},
        }))
        .unwrap();
        let curve = kept_curve(dir.path(), &set).unwrap();
        assert_eq!((curve.x_label.as_str(), &curve.y[..]), ("x", &[Some(3.0), None][..]));
        let other = ProvenSet { diagnosis_sha256: Some("0".into()), ..set.clone() };
        assert_eq!(kept_curve(dir.path(), &other), None);
        assert_eq!(kept_curve(&dir.path().join("nowhere"), &set), None);
    }
}
