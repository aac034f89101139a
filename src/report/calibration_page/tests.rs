use super::*;
use crate::calibrate::{CalibrateOptions, model_of_table};
use crate::measure::{Cell, ResidualPicture, SigmaRow, SigmaTable, Spread, ViewMeasurement};
use crate::model::Form;
use crate::plane::{Exclusions, Plane};
use crate::stats::Correlation;
use crate::view::Excluded;

fn calibration() -> Calibration {
    let model = Overlay::Khoshelham.model();
    let row = |view: usize, z_m: f64| SigmaRow {
        z_m,
        theta_rad: 0.0,
        sigma_m: model.sigma(z_m, 0.0),
        n_effective: Some(100.0),
        view,
    };
    let rows = [1.0, 1.5, 2.0, 3.0].into_iter().enumerate().map(|(i, z)| row(i, z)).collect();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("table.csv");
    std::fs::write(&path, "z_m,theta_rad,sigma_m\n").unwrap();
    let options = CalibrateOptions { form: Some(Form::Khoshelham), ..Default::default() };
    model_of_table(&SigmaTable { rows }, &path, &options).unwrap()
}

fn view(name: &str) -> ViewMeasurement {
    let spread =
        Spread { spatial_m: 0.00571, temporal_m: None, total_m: 0.006, perpendicular_m: 0.0057 };
    let whole = Cell {
        z_m: 2.0,
        spread,
        std_error_m: 1e-4,
        n: 5000,
        n_effective: 1234.0,
        n_effective_temporal: 1.0,
        dropouts: 0,
        cut: 0,
    };
    ViewMeasurement {
        name: name.into(),
        time_s: 0.0,
        plane: Plane::tilted(2.0, 0.1, -0.5),
        z_m: 2.0,
        theta_rad: 0.1,
        azimuth_rad: -0.5,
        whole,
        cells: vec![whole],
        paper: None,
        correlation: Correlation {
            along_u: vec![1.0],
            along_v: vec![1.0],
            sum: 4.0,
            sum_of_squares: 4.0,
            persists: true,
        },
        temporal_correlation: None,
        frames: 1,
        exclusions: Exclusions { considered: 9000, invalid: 11, off_plane: 22, edge: 33 },
        reference_distance_m: None,
        axis_distance_m: 2.0,
        infrared: None,
        picture: ResidualPicture { width: 2, height: 1, millimetres: vec![1.0, f32::NAN] },
        notes: Vec::new(),
        digest: [0; 32],
    }
}

#[test]
fn the_page_tells_numbers_and_escapes_names() {
    let mut calibration = calibration();
    calibration.warnings = vec!["view <b>: odd".into(), "view gone was left out: no plane".into()];
    let excluded = vec![Excluded { view: "gone".into(), reason: "no plane".into() }];
    let measurements = Measurements { views: vec![view("<b>")], excluded };
    let page = calibration_page(&CalibrationPage {
        title: "Kinect & co",
        sensor: None,
        measurements: Some(&measurements),
        calibration: &calibration,
        overlays: &Overlay::ALL,
    })
    .unwrap();
    assert!(page.starts_with("<!DOCTYPE html>"));
    for says in [
        "Kinect &amp; co",
        "&lt;b&gt;",
        "5.71",
        "11 / 22 / 33",
        "2.0+",
        "0.001425",
        "1 used, 1 excluded",
        "data:image/png;base64,",
        "1 view left out",
    ] {
        assert!(page.contains(says), "{says}");
    }
    assert!(!page.contains("<b><"), "a name became a tag");
    assert!(!page.contains("<script") && !page.contains("http://localhost"));
}

#[test]
fn a_bare_table_makes_a_page() {
    let calibration = calibration();
    let page = calibration_page(&CalibrationPage {
        title: "table.csv",
        sensor: None,
        measurements: None,
        calibration: &calibration,
        overlays: &[],
    })
    .unwrap();
    assert!(page.contains("4 rows of a table") && page.contains("1.43"));
    assert!(!page.contains("<h2>Views</h2>"));
}
