//! Completeness and consistency of the catalogue.

use assert_cmd::Command;
use kinoise::effects::{Active, CATALOGUE};

/// The ids and parameters of src/docs/catalogue.md.
const DOCUMENTED: &[(&str, &[&str])] = &[
    ("disparity-quantisation", &["step_px"]),
    ("depth-rounding", &["step_m"]),
    ("pixel-locking", &["amplitude_px"]),
    ("column-banding", &["amplitude_px", "period_px"]),
    ("radial-disparity-bias", &["k_px"]),
    ("lens-distortion", &["k1"]),
    ("range-not-depth", &[]),
    ("depth-scale", &["scale"]),
    ("disparity-offset", &["offset_px"]),
    ("thermal-drift", &["relative", "time_constant_s"]),
    ("target-bow", &["sagitta_m"]),
    ("target-motion", &["velocity_mps"]),
    ("fixed-pattern-noise", &["sigma_px"]),
    ("edge-mixing", &["width_px"]),
    ("range-exponent", &["excess"]),
    ("slope-noise", &["sigma_lateral_px"]),
    ("tilt-axis-anisotropy", &["ratio"]),
    ("vignetting", &["growth"]),
    ("intensity-dependent-noise", &["exponent"]),
    ("ambient-light", &["ratio"]),
    ("heavy-tails", &["fraction", "scale"]),
    ("spatial-correlation", &["length_px"]),
    ("temporal-correlation", &["rho"]),
    ("frozen-noise", &["fraction"]),
    ("row-noise", &["sigma_px"]),
    ("frame-jitter", &["sigma_px"]),
    ("grazing-dropout", &["theta50_deg", "width_deg"]),
    ("range-dropout", &["z50_m", "width_m"]),
    ("occlusion-shadow", &[]),
];

const STATISTICS: &[&str] = &["bias", "variance", "distribution", "correlation", "missing"];
const AXES: &[&str] = &[
    "z",
    "disparity-phase",
    "column",
    "row",
    "radius",
    "pixel",
    "theta",
    "azimuth",
    "target-position",
    "edge-distance",
    "intensity",
    "frame",
    "session-time",
    "temperature",
    "pixel-lag",
    "residual",
];

fn ids() -> Vec<&'static str> {
    CATALOGUE.iter().map(|e| e.card().id).collect()
}

#[test]
fn the_catalogue_is_the_documented_one_in_its_order() {
    assert_eq!(ids(), DOCUMENTED.iter().map(|(id, _)| *id).collect::<Vec<_>>());
    for (effect, (id, parameters)) in CATALOGUE.iter().zip(DOCUMENTED) {
        let known: Vec<&str> = effect.card().parameters.iter().map(|p| p.name).collect();
        assert!(parameters.iter().all(|p| known.contains(p)), "{id}: {known:?}");
    }
}

/// An effect file that is not in the list would be dead code.
#[test]
fn every_file_with_an_effect_is_in_the_list() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/effects");
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let text = std::fs::read_to_string(entry.path()).unwrap();
        // A fitted shape has no formula of its own, and so no entry.
        let shape = entry.file_name() == "shape.rs";
        if text.contains("impl Effect for ") && !shape {
            files += 1;
            let id = entry.path().file_stem().unwrap().to_str().unwrap().replace('_', "-");
            assert!(ids().contains(&id.as_str()), "{id} is missing from catalogue! in mod.rs");
        }
    }
    assert_eq!(files, CATALOGUE.len(), "an effect a file");
}

#[test]
fn every_card_is_filled_in() {
    for effect in CATALOGUE {
        let card = effect.card();
        assert!(STATISTICS.contains(&card.statistic), "{}", card.id);
        assert!(AXES.contains(&card.axis), "{}", card.id);
        assert!(card.summary.len() > 40 && card.reference.len() > 8, "{}", card.id);
        let names_another =
            ids().iter().any(|id| *id != card.id && card.confused_with.contains(id));
        assert!(names_another, "{}: {}", card.id, card.confused_with);
        let strength = &card.parameters[0];
        assert!(card.identity != strength.typical, "{}", card.id);
        assert!((strength.range[0]..=strength.range[1]).contains(&card.identity), "{}", card.id);
        for p in card.parameters {
            assert!((p.range[0]..=p.range[1]).contains(&p.typical), "{}: {}", card.id, p.name);
            assert!(p.summary.len() > 8, "{}: {}", card.id, p.name);
        }
    }
}

#[test]
fn texts_that_are_no_effect_are_refused_with_words() {
    for (text, said) in [
        ("locking", "did you mean pixel-locking?"),
        ("nonsense", "not in the catalogue"),
        ("pixel-locking:amplitude=1", "but amplitude_px"),
        ("pixel-locking:amplitude_px", "is not key=value"),
        ("pixel-locking:amplitude_px=much", "is not a number"),
        ("pixel-locking:amplitude_px=3", "outside 0 to 0.5 px"),
        ("pixel-locking:amplitude_px=nan", "outside"),
        ("", "not in the catalogue"),
    ] {
        let words = Active::parse(text).expect_err(text).to_string();
        assert!(words.contains(said) && words.contains("kinoise effects"), "{text}: {words}");
    }
}

fn kinoise(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_kinoise")).args(arguments).output().unwrap()
}

#[test]
fn the_command_prints_every_effect_for_people_and_for_programs() {
    let text = String::from_utf8(kinoise(&["effects"]).stdout).unwrap();
    assert!(text.lines().all(|line| line.len() <= 100));
    let output = kinoise(&["effects", "--json"]).stdout;
    let json: serde_json::Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(json.as_array().unwrap().len(), CATALOGUE.len());
    for (id, card) in ids().iter().zip(json.as_array().unwrap()) {
        assert!(text.contains(id));
        assert_eq!(card["id"], *id);
        assert!(card["parameters"][0]["range"][1].is_number());
    }
    assert!(!kinoise(&["effects", "none-such"]).status.success());
}

#[test]
fn an_effect_named_twice_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let effect = ["--effect", "row-noise", "--effect", "row-noise:sigma_px=0.1"];
    let output = kinoise(&[&["simulate", out.to_str().unwrap()], &effect[..]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("twice"));
    assert!(!out.exists());
}
