use super::*;
use crate::calibrate::{CalibrateOptions, measure, model_of_table};
use crate::io::{Assumed, open};
use crate::measure::{MeasureOptions, ViewMeasurement, read_table};
use crate::model::Form;
use crate::plane::Exclusions;
use crate::rng::Seed;
use crate::scene::Target;
use crate::simulate::{Grid, Shoot, kinect_v1};
use crate::view::Excluded;

fn calibration() -> Calibration {
    let model = SigmaModel::khoshelham();
    let rows = [1.0, 1.5, 2.0, 3.0].map(|z| format!("{z},0,{},100\n", model.sigma(z, 0.0)));
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("table.csv");
    std::fs::write(&path, format!("z_m,theta_rad,sigma_m,n\n{}", rows.concat())).unwrap();
    let options = CalibrateOptions { form: Some(Form::Khoshelham), ..Default::default() };
    model_of_table(&read_table(&path).unwrap(), &path, &options).unwrap()
}

/// A small measured wall, with recognisable numbers for the page.
fn view() -> ViewMeasurement {
    let folder = tempfile::tempdir().unwrap();
    let poses = Grid { distances_m: vec![2.0], tilts_rad: vec![0.0] }.views();
    let sigma = SigmaModel::paper();
    let shoot = Shoot::plain(kinect_v1(8), Target::Wall, &poses, 1, sigma, Seed(1));
    shoot.write(folder.path(), &|_, _| ()).unwrap();
    let recording = open(folder.path(), &Assumed::default()).unwrap();
    let options = MeasureOptions::default();
    let mut view = measure(&recording, &options, &|_, _| ()).unwrap().views.remove(0);
    view.name = "<b>".into();
    view.whole.spread.spatial_m = 0.00571;
    view.exclusions = Exclusions { considered: 9000, invalid: 11, off_plane: 22, edge: 33 };
    (view.correlation.sum_of_squares, view.correlation.persists) = (4.0, true);
    view
}

#[test]
fn the_page_tells_numbers_and_escapes_names() {
    let mut calibration = calibration();
    calibration.warnings = vec!["view <b>: odd".into(), "view gone was left out: no plane".into()];
    let excluded = vec![Excluded { view: "gone".into(), reason: "no plane".into() }];
    let measurements = Measurements { views: vec![view()], excluded, ranges: None };
    let mut page = CalibrationPage {
        title: "Kinect & co",
        sensor: None,
        measurements: Some(&measurements),
        calibration: &calibration,
        overlays: &Overlay::ALL,
        origin: &Origin::default(),
    };
    let text = calibration_page(&page).unwrap();
    assert!(text.starts_with("<!DOCTYPE html>"));
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
        assert!(text.contains(says), "{says}");
    }
    assert!(!text.contains("<b><"), "a name became a tag");
    assert!(!text.contains("src=\"http") && !text.contains("http://localhost"));
    for says in [
        "sigma_m = 0.001425",
        "Measured σ minus the fit",
        "needs views of several frames",
        "of the target",
    ] {
        assert!(text.contains(says), "{says}");
    }
    (page.measurements, page.overlays) = (None, &[]);
    let bare = calibration_page(&page).unwrap();
    assert!(bare.contains("4 rows of a table") && bare.contains("1.43"));
    assert!(!bare.contains("id=\"views\""));
}
